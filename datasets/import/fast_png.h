// PNG files of pictures that come by the thousand.
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string_view>
#include <vector>

namespace trigpoint {

// PNGs of 8-bit grey or BGR pictures: differences to the pixel on the left, coded by one Huffman code for the whole
// picture (RFC 1951, a dynamic block without matches). Three times as fast as deflate with a search for matches, which
// pictures with noise hardly have. Linear time. Keeps its memory from picture to picture: fresh memory takes longer to
// map than the pixels to code. One for each thread.
class FastPngWriter {
 public:
  // The bytes of the file, until the next call.
  std::string_view Write(const cv::Mat& picture);

 private:
  std::vector<uint8_t> rows_, line_, file_;  // as long as the largest picture needed
};

}  // namespace trigpoint

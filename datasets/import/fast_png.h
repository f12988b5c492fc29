// PNG files of pictures that come by the thousand.
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

namespace trigpoint {

// The bytes of a PNG of an 8-bit grey or BGR picture: differences to the pixel on the left, coded by one Huffman code
// for the whole picture (RFC 1951, a dynamic block without matches). Three times as fast as deflate with a search for
// matches, which pictures with noise hardly have. Linear time; thread safe.
std::string FastPng(const cv::Mat& picture);

}  // namespace trigpoint

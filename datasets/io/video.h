// Video files as image sources.
#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace trigpoint {

// Frame `index` (0 = first) as 8-bit grey. Thread safe; fast when frames are asked for roughly in order.
// Throws InputError naming the video and the frame.
cv::Mat ReadVideoFrameGrey(const std::filesystem::path& file, int index);
// The same in colour, BGR.
cv::Mat ReadVideoFrameColour(const std::filesystem::path& file, int index);

}  // namespace trigpoint

// OpenCV's ArUco dictionaries by name, so that readers can check a target without OpenCV's headers.
#pragma once

#include <string>

namespace trigpoint {

// The index that cv::aruco::getPredefinedDictionary takes for "DICT_4X4_50", ..., or -1 for a name it doesn't have.
int DictionaryNamed(const std::string& name);

}  // namespace trigpoint

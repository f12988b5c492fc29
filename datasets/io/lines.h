// The lines of a text. They refer to the text, which must outlive them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace trigpoint {

// Without their ends; the last one need not have one.
std::vector<std::string_view> Lines(std::string_view text);
std::vector<std::string_view> Lines(std::string&& text) = delete;

struct DataLine {
  std::string_view text;  // without spaces around
  int number = 1;         // in the file
};
// Those that are neither empty nor comments (#); `comments`: those that are, without the #.
std::vector<DataLine> DataLines(std::string_view text, std::vector<std::string_view>* comments = nullptr);
std::vector<DataLine> DataLines(std::string&& text, std::vector<std::string_view>* comments = nullptr) = delete;

// Is a trajectory's text of KITTI's kind: twelve numbers a row (3 x 4 matrices of the first camera) and no time?
bool HasKittiRows(std::string_view text);

}  // namespace trigpoint

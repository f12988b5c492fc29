// The last lines of a command: what was done, how good it is, what is wrong, where to look, what to do next.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/base/counted.h"

namespace trigpoint {

constexpr size_t kEndingLines = 12;
constexpr size_t kDemoEndingLines = 16;

// Lines are added in any order and written in a fixed one: headline, facts, rows, problems, places, next. Where there
// is no room for all of them, rows give way first, then facts, then problems; what is left out is counted in a line.
class Ending {
 public:
  explicit Ending(std::string headline) : headline_(std::move(headline)) {}
  Ending& Headline(const std::string& text);
  // How good it is: "Located   7 of 8 panoramas".
  Ending& Fact(const std::string& label, const std::string& text);
  // A line of a list or table.
  Ending& Row(const std::string& text);
  // The lines of a text or table.
  Ending& Rows(const std::string& text);
  // What is wrong: "Warning   pano_110.jpg: geotag off by 0.64 m". One that is there already is not added again.
  Ending& Problem(const std::string& label, const std::string& text);
  // Where to look.
  Ending& Look(const std::string& label, const std::filesystem::path& path);
  // What to do next.
  Ending& Next(const std::string& text);
  // Where the problems are that found no room, "results/*/log.txt"; default: --verbose.
  Ending& RestIn(const std::string& where);
  bool has_problems() const { return !problems_.empty(); }

  std::string Text(size_t lines = kEndingLines) const;

 private:
  std::string headline_, next_, rest_in_ = "--verbose";
  std::vector<std::string> facts_, rows_, problems_, places_;
};

// As it can be typed in the working directory: relative below it, else as it is.
std::string ShownPath(const std::filesystem::path& path);
// "localize": "Localize".
std::string Capitalised(std::string text);
// "12 s", "2 min 5 s", "1 h 3 min".
std::string TakenText(double seconds);

}  // namespace trigpoint

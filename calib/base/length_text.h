// Sentences that state lengths: made once, read in metres or in the unit that somebody chose.
#pragma once

#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace trigpoint {

struct Length {
  double metres = 0;
  int decimals = 0;   // -1: up to four digits, "0.02"
  bool named = true;  // "3.2 m", else "3.2"
  bool operator==(const Length&) const = default;
};

// Thread safe as a std::string is.
class LengthText {
 public:
  LengthText() = default;
  LengthText(std::string text) { Add({std::move(text), {}}); }
  LengthText(const char* text) : LengthText(std::string(text)) {}
  LengthText(const Length& length) { Add({"", length}); }

  LengthText& operator+=(const LengthText& other) {
    for (const Part& part : other.parts_) Add(part);
    return *this;
  }
  bool operator==(const LengthText&) const = default;

  // `metres`: of one unit.
  std::string In(const std::string& unit = "m", double metres = 1) const {
    std::string text;
    for (const Part& part : parts_) {
      text += part.text;
      if (!part.length) continue;
      const int decimals = part.length->decimals;
      char number[64];
      std::snprintf(number, sizeof(number), decimals < 0 ? "%.*g" : "%.*f", decimals < 0 ? 4 : decimals,
                    part.length->metres / metres);
      text += number;
      if (part.length->named) text += " " + unit;
    }
    return text;
  }

 private:
  struct Part {
    std::string text;
    std::optional<Length> length;  // after the text
    bool operator==(const Part&) const = default;
  };
  void Add(Part part) {
    if (part.text.empty() && !part.length) return;
    if (!parts_.empty() && !parts_.back().length) {
      part.text.insert(0, parts_.back().text);
      parts_.pop_back();
    }
    parts_.push_back(std::move(part));
  }

  std::vector<Part> parts_;
};

inline LengthText operator+(LengthText first, const LengthText& second) {
  first += second;
  return first;
}

}  // namespace trigpoint

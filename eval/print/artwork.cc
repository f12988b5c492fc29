// Tags, scale bars and boards, drawn in millimetres.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "calib/base/error.h"
#include "datasets/io/text.h"
#include "eval/print/sheets.h"
#include "eval/report/drawing.h"
#include "survey/tags/tag_family.h"

namespace trigpoint {
namespace {

constexpr double kMmPerM = 1e3;
constexpr const char* kSoft = "#555555";

// Letters so small that the text is no wider than `room`.
double FittingSize(const std::string& text, double wanted, double room) {
  constexpr double kSmallest = 0.9;
  return std::max(kSmallest, std::min(wanted, wanted * room / std::max(1e-6, 1.12 * TextWidth(text, wanted))));
}

// The printed cells of a tag and what white they need around them.
struct TagPrint {
  TagPattern pattern;
  double cell_mm = 0;
  int first = 0, cells = 0;  // of the pattern that is ink: its outermost white rings are the quiet zone
  double quiet_mm = 0;
  double Ink() const { return cells * cell_mm; }
  double Side() const { return Ink() + 2 * quiet_mm; }
};

TagPrint MakeTagPrint(const TagFamily& family, int id, double size_mm) {
  TagPrint print;
  print.pattern = family.Pattern(id);
  print.cell_mm = size_mm / print.pattern.width;
  const int total = print.pattern.total;
  bool ring_is_white = true;  // of this tag; whether it is the family's is the same question for a border
  for (int k = 0; k < total; ++k) {
    ring_is_white = ring_is_white && print.pattern.At(0, k) && print.pattern.At(total - 1, k) &&
                    print.pattern.At(k, 0) && print.pattern.At(k, total - 1);
  }
  // A white border of the family lies outside the square that is measured; data cells may be white by chance.
  const bool border = ring_is_white && print.pattern.width == total - 2;
  print.first = border ? 1 : 0;
  print.cells = total - 2 * print.first;
  print.quiet_mm = print.cell_mm;
  return print;
}

// The black cells with the ink's upper left corner at x, y; runs of a row are one box.
void AddTagInk(const TagPrint& print, const std::string& name, double x, double y, Artwork* artwork) {
  for (int r = 0; r < print.cells; ++r) {
    for (int c = 0; c < print.cells;) {
      int end = c;
      while (end < print.cells && !print.pattern.At(print.first + r, print.first + end)) ++end;
      if (end > c) {
        artwork->boxes.push_back(
            {x + c * print.cell_mm, y + r * print.cell_mm, (end - c) * print.cell_mm, print.cell_mm});
      }
      c = std::max(end, c + 1);
    }
  }
  const double low = (print.pattern.margin - print.first) * print.cell_mm;
  const double high = low + print.pattern.width * print.cell_mm;
  const std::array<std::pair<double, double>, 4> corners = {{{low, high}, {high, high}, {high, low}, {low, low}}};
  for (size_t k = 0; k < 4; ++k) {
    artwork->points.push_back({name, static_cast<int>(k), x + corners[k].first, y + corners[k].second});
  }
}

// Above and below a tag's quiet zone (upper left corner at x, y): corner numbers, arrow, id, family and size.
struct Labels {
  double head = 0, foot = 0;
  explicit Labels(double side) : head(std::clamp(0.055 * side, 6.0, 18.0)), foot(std::clamp(0.036 * side, 4.5, 12.0)) {}
};

void AddLabels(const std::string& family, int id, double size_mm, double x, double y, double side, Artwork* artwork) {
  const Labels labels(side);
  const double digit = 0.42 * labels.head, centre = x + 0.5 * side, bottom = y + side;
  const double edge = 0.03 * side + 0.3, room = side - 2 * edge - 3 * digit;
  const auto corner = [&](int k, bool right, bool upper) {
    artwork->texts.push_back({right ? x + side - edge : x + edge, upper ? y - 0.25 * digit : bottom + digit, digit,
                              right ? 1 : -1, false, kSoft, std::to_string(k)});
  };
  corner(3, false, true);
  corner(2, true, true);
  corner(0, false, false);
  corner(1, true, false);
  // Two lines above: the id with an arrow, and the id in words.
  const std::string name = fmt::format("tag {}", id), words = NumberInWords(id);
  const double name_size = FittingSize(name, 0.5 * labels.head, 0.7 * room);
  const double words_size = FittingSize(words, 0.3 * labels.head, room);
  const double base = y - 0.48 * labels.head, half = 0.5 * TextWidth(name, name_size);
  artwork->texts.push_back({centre, base, name_size, 0, true, "#000000", name});
  artwork->texts.push_back({centre, y - 0.12 * labels.head, words_size, 0, false, kSoft, words});
  for (const double side_sign : {-1.0, 1.0}) {  // an arrow on either side of the id
    const double ax = centre + side_sign * (half + name_size), tip = base - 0.78 * name_size, w = 0.35 * name_size;
    artwork->areas.push_back({{ax, tip},
                              {ax + w, tip + 1.2 * w},
                              {ax + 0.35 * w, tip + 1.2 * w},
                              {ax + 0.35 * w, base},
                              {ax - 0.35 * w, base},
                              {ax - 0.35 * w, tip + 1.2 * w},
                              {ax - w, tip + 1.2 * w}});
  }
  const std::string below = fmt::format("{}   {:g} mm   arrows up", family, size_mm);
  artwork->texts.push_back(
      {centre, bottom + 0.62 * labels.foot, FittingSize(below, 0.55 * labels.foot, room), 0, false, kSoft, below});
}

void RequireSize(double size_mm, const std::string& what) {
  constexpr double kLeast = 5, kMost = 5000;
  if (!(size_mm >= kLeast && size_mm <= kMost)) {
    throw OptionError(fmt::format("{}: expected {:g} to {:g} mm, found {:g}", what, kLeast, kMost, size_mm));
  }
}

std::string TagName(int id) { return fmt::format("tag {}", id); }

}  // namespace

PaperSize PaperNamed(const std::string& text) {
  static const std::vector<PaperSize> known = {
      {"A0", 841, 1189},       {"A1", 594, 841},         {"A2", 420, 594}, {"A3", 297, 420},
      {"A4", 210, 297},        {"A5", 148, 210},         {"A6", 105, 148}, {"Letter", 215.9, 279.4},
      {"Legal", 215.9, 355.6}, {"Tabloid", 279.4, 431.8}};
  const auto lower = [](std::string s) {
    for (char& c : s) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    return s;
  };
  std::vector<std::string> names;
  for (const PaperSize& paper : known) {
    if (lower(paper.name) == lower(text)) return paper;
    names.push_back(paper.name);
  }
  const size_t cross = text.find('x');
  if (cross != std::string::npos) {
    const auto width = ParseDouble(text.substr(0, cross)), height = ParseDouble(text.substr(cross + 1));
    constexpr double kLeast = 60, kMost = 5000;
    if (width && height && std::min(*width, *height) >= kLeast && std::max(*width, *height) <= kMost) {
      return {text, *width, *height};
    }
    throw OptionError("paper '" + text + "': expected WIDTHxHEIGHT in mm, each 60 to 5000, as 600x900");
  }
  throw OptionError("paper '" + text +
                    "': expected A0 to A6, Letter, Legal, Tabloid, or WIDTHxHEIGHT in mm; nearest: '" +
                    NearestName(text, names) + "'");
}

std::string NumberInWords(int number) {
  static constexpr const char* kSmall[] = {
      "zero", "one",    "two",    "three",    "four",     "five",    "six",     "seven",     "eight",    "nine",
      "ten",  "eleven", "twelve", "thirteen", "fourteen", "fifteen", "sixteen", "seventeen", "eighteen", "nineteen"};
  static constexpr const char* kTens[] = {"",      "",      "twenty",  "thirty", "forty",
                                          "fifty", "sixty", "seventy", "eighty", "ninety"};
  if (number < 0 || number > 999999) throw OptionError(fmt::format("{}: expected 0 to 999999", number));
  if (number < 20) return kSmall[number];
  if (number < 100) {
    return std::string(kTens[number / 10]) + (number % 10 > 0 ? std::string("-") + kSmall[number % 10] : "");
  }
  if (number < 1000) {
    return std::string(kSmall[number / 100]) + " hundred" +
           (number % 100 > 0 ? " and " + NumberInWords(number % 100) : "");
  }
  const int rest = number % 1000;
  return NumberInWords(number / 1000) + " thousand" +
         (rest == 0 ? "" : (rest < 100 ? " and " : " ") + NumberInWords(rest));
}

Artwork TagArtwork(const std::string& family, int id, double size_mm) {
  RequireSize(size_mm, "size of a tag");
  const TagPrint print = MakeTagPrint(TagFamily(family), id, size_mm);
  const double side = print.Side();
  const Labels labels(side);
  Artwork artwork;
  artwork.title = fmt::format("tag {} ({})", id, NumberInWords(id));
  artwork.width_mm = side;
  artwork.height_mm = labels.head + side + labels.foot;
  artwork.white_mm = print.quiet_mm;
  AddTagInk(print, TagName(id), print.quiet_mm, labels.head + print.quiet_mm, &artwork);
  AddLabels(family, id, size_mm, 0, labels.head, side, &artwork);
  const char* what = print.first == 1 ? "edge of the black square" : "edge from corner 0 to corner 1";
  artwork.checks.push_back(
      fmt::format("{}: {:.1f} mm, diagonals both {:.1f} mm", what, size_mm, std::sqrt(2.0) * size_mm));
  return artwork;
}

Artwork ScaleBarArtwork(const std::string& family, int first_id, int second_id, double size_mm, double length_mm) {
  RequireSize(size_mm, "size of a tag");
  const TagFamily codes(family);
  const TagPrint left = MakeTagPrint(codes, first_id, size_mm), right = MakeTagPrint(codes, second_id, size_mm);
  const double side = left.Side();
  if (!(length_mm >= side)) {
    throw OptionError(fmt::format("scale bar of {:g} mm: the tags' quiet zones overlap; expected at least {:.0f} mm",
                                  length_mm, std::ceil(side)));
  }
  const Labels labels(side);
  Artwork artwork;
  artwork.title = fmt::format("scale bar, tags {} and {}", first_id, second_id);
  artwork.width_mm = side + length_mm;
  artwork.height_mm = labels.head + side + labels.foot + 12;
  artwork.white_mm = left.quiet_mm;
  const double y = labels.head + left.quiet_mm;
  AddTagInk(left, TagName(first_id), left.quiet_mm, y, &artwork);
  AddTagInk(right, TagName(second_id), left.quiet_mm + length_mm, y, &artwork);
  AddLabels(family, first_id, size_mm, 0, labels.head, side, &artwork);
  AddLabels(family, second_id, size_mm, length_mm, labels.head, side, &artwork);
  // The distance that is measured: from centre to centre, on a line below.
  const double a = 0.5 * side, b = a + length_mm, line = artwork.height_mm - 5;
  artwork.lines.push_back({a, line, b, line});
  for (const double x : {a, b}) artwork.lines.push_back({x, line - 4, x, line + 4});
  artwork.texts.push_back({0.5 * (a + b), line - 1.5, 3, 0, false, kSoft,
                           fmt::format("centre to centre {:g} mm   measured: ____________ mm", length_mm)});
  artwork.checks.push_back(fmt::format("distance of the centres: {:.1f} mm", length_mm));
  artwork.checks.push_back(fmt::format("edge of each tag: {:.1f} mm", size_mm));
  return artwork;
}

Artwork BoardArtwork(const Target& target) {
  const BoardInk ink = InkOfBoard(target);
  const double quiet = kMmPerM * ink.quiet_m, foot = 7;
  Artwork artwork;
  artwork.title = target.Text();
  artwork.width_mm = kMmPerM * ink.width_m + 2 * quiet;
  artwork.height_mm = kMmPerM * ink.height_m + 2 * quiet + foot;
  artwork.white_mm = quiet;
  for (const InkBox& box : ink.boxes) {
    artwork.boxes.push_back(
        {quiet + kMmPerM * box.x, quiet + kMmPerM * box.y, kMmPerM * box.width, kMmPerM * box.height});
  }
  for (const InkCircle& circle : ink.circles) {
    artwork.circles.push_back({quiet + kMmPerM * circle.x, quiet + kMmPerM * circle.y, kMmPerM * circle.radius});
  }
  for (size_t k = 0; k < ink.points.size(); ++k) {
    const Eigen::Vector2d p = kMmPerM * ink.points[k];
    artwork.points.push_back({"board", static_cast<int>(k), quiet + p.x(), quiet + p.y()});
  }
  artwork.texts.push_back({0.5 * artwork.width_mm, artwork.height_mm - 2.5,
                           FittingSize(target.Text(), 3.2, artwork.width_mm - 6), 0, false, kSoft, target.Text()});
  artwork.checks.push_back(
      fmt::format("width of the ink: {:.1f} mm, height: {:.1f} mm", kMmPerM * ink.width_m, kMmPerM * ink.height_m));
  return artwork;
}

}  // namespace trigpoint

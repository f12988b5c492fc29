// Tags, scale bars and boards, drawn in millimetres.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "calib/base/error.h"
#include "datasets/io/text.h"
#include "eval/print/sheets.h"
#include "eval/print/text_fit.h"
#include "survey/tags/tag_family.h"

namespace trigpoint {
namespace {

constexpr double kMmPerM = 1e3;
constexpr const char* kSoft = "#555555";

constexpr double kLineStep = 1.3;  // of lines of text, in letters

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

// What stands above and below a tag with its quiet zone: corner numbers, id between arrows; id in words, family, size.
struct Labels {
  double width = 0;  // of the tag's piece: wider than a tag that is narrower than its text
  double head = 0, foot = 0;
  double digit = 0, letters = 0;
  bool beside = false;             // lines lie between the numbers of the lower corners, else below them
  std::vector<std::string> lines;  // at the foot
  double Edge() const { return 0.03 * width + 0.3; }
  double Inset() const { return beside ? Edge() : 0.4; }  // of all text from the piece's left and right edge
  double Between() const { return width - 2 * Edge() - 3 * digit; }
};

Labels MakeLabels(const std::string& family, int id, double size_mm, double side) {
  constexpr double kLeastWidth = 14, kLeastLetters = 1.4, kLeastBetween = 20;
  Labels labels;
  labels.width = std::max(side, kLeastWidth);
  labels.head = std::clamp(0.055 * side, std::clamp(0.18 * side, 3.0, 6.0), 18.0);
  labels.digit = std::max(kLeastLetters, 0.42 * labels.head);
  labels.letters = std::clamp(0.02 * side, std::clamp(0.05 * side, kLeastLetters, 2.5), 6.6);
  labels.beside = labels.Between() >= kLeastBetween;
  const double room = labels.beside ? labels.Between() : labels.width - 2 * labels.Inset();
  const std::string words = NumberInWords(id);
  const std::string kind = fmt::format("{}   {:g}\u00a0mm   arrows\u00a0up", family, size_mm);
  labels.lines = WrappedLines(words + "   " + kind, labels.letters, room);
  if (labels.lines.size() > 1) {
    labels.lines = WrappedLines(words, labels.letters, room);
    for (const std::string& line : WrappedLines(kind, labels.letters, room)) labels.lines.push_back(line);
  }
  const double lines = kLineStep * labels.letters * static_cast<double>(labels.lines.size()) + 0.3 * labels.letters;
  labels.foot = labels.beside ? std::max(1.3 * labels.digit, lines) : 1.2 * labels.digit + lines;
  return labels;
}

// The id between two arrows, with y on its baseline, no wider than `room`.
void AddName(int id, double centre, double base, double wanted, double room, Artwork* artwork) {
  constexpr double kLeast = 1.4, kArrows = 2.7;  // width of both arrows, in letters
  std::string name = fmt::format("tag {}", id);
  const auto fitted = [&] { return FittedSize(name, wanted, room - kArrows * wanted, true); };
  double letters = fitted();
  if (letters < kLeast) {
    name = std::to_string(id);
    letters = fitted();
  }
  artwork->texts.push_back({centre, base, letters, 0, true, "#000000", name});
  const double half = 0.5 * PrintedWidth(name, letters, true);
  for (const double sign : {-1.0, 1.0}) {
    const double x = centre + sign * (half + letters), tip = base - 0.78 * letters, w = 0.35 * letters;
    artwork->areas.push_back({{x, tip},
                              {x + w, tip + 1.2 * w},
                              {x + 0.35 * w, tip + 1.2 * w},
                              {x + 0.35 * w, base},
                              {x - 0.35 * w, base},
                              {x - 0.35 * w, tip + 1.2 * w},
                              {x - w, tip + 1.2 * w}});
  }
}

// x, y: upper left corner of the part of the piece between head and foot; `side` is its height.
void AddLabels(int id, const Labels& labels, double x, double y, double side, Artwork* artwork) {
  const double centre = x + 0.5 * labels.width, bottom = y + side, digit = labels.digit, edge = labels.Edge();
  const auto corner = [&](int k, bool right, bool upper) {
    artwork->texts.push_back({right ? x + labels.width - edge : x + edge, upper ? y - 0.25 * digit : bottom + digit,
                              digit, right ? 1 : -1, false, kSoft, std::to_string(k)});
  };
  corner(3, false, true);
  corner(2, true, true);
  corner(0, false, false);
  corner(1, true, false);
  AddName(id, centre, y - 0.25 * labels.head, 0.55 * labels.head, labels.Between(), artwork);
  double base = bottom + (labels.beside ? 0 : 1.2 * digit) + labels.letters;
  for (const std::string& line : labels.lines) {
    artwork->texts.push_back({centre, base, labels.letters, 0, false, kSoft, line});
    base += kLineStep * labels.letters;
  }
}

void RequireSize(double size_mm, const std::string& what) {
  constexpr double kLeast = 5, kMost = 5000;
  if (!(size_mm >= kLeast && size_mm <= kMost)) {
    throw OptionError(fmt::format("{}: expected {:g} to {:g} mm, found {:g}", what, kLeast, kMost, size_mm));
  }
}

std::string TagName(int id) { return fmt::format("tag {}", id); }

}  // namespace

const std::vector<PaperSize>& KnownPapers() {
  static const std::vector<PaperSize> known = {
      {"A0", 841, 1189},       {"A1", 594, 841},         {"A2", 420, 594}, {"A3", 297, 420},
      {"A4", 210, 297},        {"A5", 148, 210},         {"A6", 105, 148}, {"Letter", 215.9, 279.4},
      {"Legal", 215.9, 355.6}, {"Tabloid", 279.4, 431.8}};
  return known;
}

PaperSize PaperNamed(const std::string& text) {
  const auto lower = [](std::string s) {
    for (char& c : s) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    return s;
  };
  std::vector<std::string> names;
  for (const PaperSize& paper : KnownPapers()) {
    if (lower(paper.name) == lower(text)) return paper;
    names.push_back(paper.name);
  }
  const size_t cross = text.find('x');
  if (cross != std::string::npos) {
    const auto width = ParseDouble(text.substr(0, cross)), height = ParseDouble(text.substr(cross + 1));
    constexpr double kLeast = 60, kMost = 5000;
    if (width && height && std::min(*width, *height) >= kLeast && std::max(*width, *height) <= kMost) {
      return {fmt::format("{:g}x{:g} mm", *width, *height), *width, *height};
    }
    throw OptionError("paper '" + text +
                      "': expected WIDTHxHEIGHT in mm, each 60 to 5000, as 600x900; the smallest paper with a name is "
                      "A6, 105x148");
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
  const Labels labels = MakeLabels(family, id, size_mm, side);
  Artwork artwork;
  artwork.title = fmt::format("tag {} ({})", id, NumberInWords(id));
  artwork.width_mm = labels.width;
  artwork.height_mm = labels.head + side + labels.foot;
  artwork.edge_mm = size_mm;
  const double x = 0.5 * (labels.width - print.Ink());
  artwork.white_mm = std::min(x, labels.Inset());
  AddTagInk(print, TagName(id), x, labels.head + print.quiet_mm, &artwork);
  AddLabels(id, labels, 0, labels.head, side, &artwork);
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
  const Labels first = MakeLabels(family, first_id, size_mm, side);
  const Labels second = MakeLabels(family, second_id, size_mm, side);
  if (!(length_mm >= first.width)) {
    throw OptionError(
        fmt::format("scale bar of {:g} mm with tags of {:g} mm: expected at least {:.0f} mm from centre to centre, the "
                    "tags' quiet zones overlap; take a longer bar (--length) or smaller tags (--size)",
                    length_mm, size_mm, std::ceil(first.width)));
  }
  constexpr double kLineStrip = 12, kTick = 4, kLetters = 3;
  Artwork artwork;
  artwork.title = fmt::format("scale bar, tags {} and {}", first_id, second_id);
  artwork.width_mm = first.width + length_mm;
  artwork.height_mm = first.head + side + std::max(first.foot, second.foot) + kLineStrip;
  artwork.edge_mm = size_mm;
  const double x = 0.5 * (first.width - left.Ink()), y = first.head + left.quiet_mm;
  artwork.white_mm = std::min(x, first.Inset());
  AddTagInk(left, TagName(first_id), x, y, &artwork);
  AddTagInk(right, TagName(second_id), x + length_mm, y, &artwork);
  AddLabels(first_id, first, 0, first.head, side, &artwork);
  AddLabels(second_id, second, length_mm, first.head, side, &artwork);
  // The distance that is measured: from centre to centre, on a line below.
  const double a = 0.5 * first.width, b = a + length_mm, line = artwork.height_mm - 5;
  artwork.lines.push_back({a, line, b, line});
  for (const double end : {a, b}) artwork.lines.push_back({end, line - kTick, end, line + kTick});
  const std::string text = fmt::format("centre to centre {:g} mm   measured: ____________ mm", length_mm);
  artwork.texts.push_back(
      {0.5 * (a + b), line - 1.5, FittedSize(text, kLetters, length_mm - 2), 0, false, kSoft, text});
  artwork.checks.push_back(fmt::format("distance of the centres: {:.1f} mm", length_mm));
  artwork.checks.push_back(fmt::format("edge of each tag: {:.1f} mm", size_mm));
  return artwork;
}

Artwork BoardArtwork(const Target& target) {
  const BoardInk ink = InkOfBoard(target);
  constexpr double kLetters = 3.2;
  const double quiet = kMmPerM * ink.quiet_m;
  Artwork artwork;
  artwork.title = target.Text();
  artwork.width_mm = kMmPerM * ink.width_m + 2 * quiet;
  const std::vector<std::string> lines = WrappedLines(target.Text(), kLetters, kMmPerM * ink.width_m);
  artwork.height_mm = kMmPerM * ink.height_m + 2 * quiet + kLineStep * kLetters * static_cast<double>(lines.size()) + 2;
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
  double base = kMmPerM * ink.height_m + 2 * quiet + kLetters;
  for (const std::string& line : lines) {
    artwork.texts.push_back({0.5 * artwork.width_mm, base, kLetters, 0, false, kSoft, line});
    base += kLineStep * kLetters;
  }
  artwork.checks.push_back(
      fmt::format("width of the ink: {:.1f} mm, height: {:.1f} mm", kMmPerM * ink.width_m, kMmPerM * ink.height_m));
  return artwork;
}

}  // namespace trigpoint

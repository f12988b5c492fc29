// A picture made of lines, areas and words, to be written as SVG or drawn on paper: one description, two outputs.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace trigpoint {

struct Shape {
  enum class Kind { kPath, kCircle, kText, kPicture };
  Kind kind = Kind::kPath;
  std::vector<std::pair<double, double>> points;  // path: its corners; circle, text, picture (top left): one
  bool closed = false;
  std::string stroke, fill;  // "#rrggbb", empty: none. Text is written in `fill`
  double width = 1;          // of the line
  double opacity = 1;        // of the area
  bool dashed = false;
  double radius = 0;                           // of a circle
  std::pair<double, double> extent;            // width and height of a picture
  std::shared_ptr<const std::string> picture;  // a JPEG file
  std::string text;                            // UTF-8, any content
  double size = 12;                            // of text
  int anchor = 0;                              // -1 begins at the point, 0 is centred on it, 1 ends at it
  bool bold = false;
  bool upwards = false;  // turned a quarter to the left
};

// Where something of the site stands in a drawing, for windows in which it can be pointed at; nothing is drawn there.
struct Spot {
  double x = 0, y = 0;
  std::string object;  // as the review names objects: "station:S57", "tag:57", "image:run1/images/000012.jpg"
};
// Several of them in a rectangle of a drawing, a bar of a histogram; x, y: its upper left corner.
struct SpotGroup {
  double x = 0, y = 0, width = 0, height = 0;
  std::vector<std::string> objects;
};

// x to the right, y down; units are pixels of a screen, 1/96 inch on paper.
struct Drawing {
  double width = 720, height = 360;
  std::vector<Shape> shapes;
  std::vector<Spot> spots;
  std::vector<SpotGroup> groups;

  void Line(std::vector<std::pair<double, double>> points, const std::string& colour, double width_px = 1,
            bool dashed = false);
  void Area(std::vector<std::pair<double, double>> points, const std::string& fill, double opacity = 1);
  void Rectangle(double x, double y, double w, double h, const std::string& fill, double opacity = 1);
  void Circle(double x, double y, double radius, const std::string& fill, double opacity = 1);
  void Photograph(double x, double y, double w, double h, std::string jpeg);
  void Text(double x, double y, const std::string& text, int anchor = 0, double size = 12,
            const std::string& colour = "#333333", bool bold = false, bool upwards = false);
};

// About as wide as the text will be; fonts differ.
double TextWidth(const std::string& text, double size);

struct DrawnBox {
  double x = 0, y = 0, width = 0, height = 0;  // upper left corner and extent
  bool Overlaps(const DrawnBox& other) const;
};

// Places for names beside marks: inside a frame and over nothing that is taken.
class LabelPlaces {
 public:
  explicit LabelPlaces(const DrawnBox& frame) : frame_(frame) {}
  void Take(const DrawnBox& box) { taken_.push_back(box); }
  void TakeLine(const std::vector<std::pair<double, double>>& line) { Cover(line, &taken_); }
  // A name covers it only where there is no other place.
  void AvoidLine(const std::vector<std::pair<double, double>>& line) { Cover(line, &avoided_); }
  bool IsFree(const DrawnBox& box) const;
  // The first free of eight boxes of this extent around a mark: at its right, left, above, below, then its corners.
  // The box is taken from then on. Nothing if none is free.
  std::optional<DrawnBox> Place(const DrawnBox& mark, double width, double height);

 private:
  static void Cover(const std::vector<std::pair<double, double>>& line, std::vector<DrawnBox>* boxes);
  DrawnBox frame_;
  std::vector<DrawnBox> taken_, avoided_;
};

// An <svg> element that scales with its place; `title` is read aloud. Every text is escaped.
std::string SvgOf(const Drawing& drawing, const std::string& title);
// The same as a file of its own: with the namespace, size and fonts that a page gives to the element.
std::string SvgFileOf(const Drawing& drawing, const std::string& title);

// Text for HTML and SVG: & < > " ' escaped, control characters and broken UTF-8 replaced.
std::string Escape(std::string_view text);
// Valid UTF-8 without control characters (line ends and tabs become spaces).
std::string CleanText(std::string_view text);

}  // namespace trigpoint

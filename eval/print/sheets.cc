// Pages by Cairo in millimetres.
#include "eval/print/sheets.h"

#include <cairo-pdf.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "eval/print/text_fit.h"
#include "eval/report/drawing.h"
#include "eval/report/paint.h"

namespace trigpoint {
namespace {

constexpr double kPointsPerMm = 72 / 25.4;
constexpr double kSide = 9;           // strip of an upright bar at the left edge
constexpr double kBarEnd = 1;         // from the margin to a bar's end
constexpr double kFootBar = 6.2;      // strip of a lying bar with its length in words at the bottom edge
constexpr double kUprightStrip = 12;  // beside an upright bar at the bottom edge
constexpr double kLeastBar = 20, kBarStep = 10;
constexpr double kMostBar = 500;   // of which half a millimetre is 0.1 %
constexpr double kLineStep = 1.3;  // of lines of text, in letters
constexpr double kHair = 0.1;      // line, mm
constexpr double kMarks = 8;       // strip of the crop marks around a cut sheet
constexpr double kBleed = 3;       // drawn beyond the cut
constexpr double kLeastTrim = 30;  // of a cut sheet
constexpr int kMostTiles = 200;
constexpr const char* kInk = "#000000";
constexpr const char* kSoft = "#555555";
constexpr const char* kCut = "#9a9a9a";
constexpr const char* kJoint = "#a84a00";
constexpr const char* kFaint = "#cccccc";  // ink of a small picture, under lines and numbers

// Letters of the text of a sheet: on small paper small ones.
double LettersOf(double width) { return std::clamp(width / 85, 1.7, 2.4); }

std::string PaperText(const PaperSize& paper) {
  const bool by_size = paper.name.find('x') != std::string::npos && paper.name[0] >= '0' && paper.name[0] <= '9';
  return by_size ? paper.name : fmt::format("{}, {:g} x {:g} mm", paper.name, paper.width_mm, paper.height_mm);
}

double BarFor(double room) { return std::min(kMostBar, kBarStep * std::floor(room / kBarStep + 1e-9)); }

// What stands at the foot of a sheet below its name. `edge`: of a tag, 0: there is none. `tags`: else it is a board.
std::string FootText(const SheetOptions& options, double bar, double edge, bool tags) {
  const double length = std::max(bar, edge);
  const std::string what = edge > bar ? fmt::format("the tag's edges of {:g} mm, longer than the bars,", edge)
                                      : fmt::format("both bars of {:g} mm", bar);
  const std::string enter =
      tags ? fmt::format(", and enter: trigpoint print DIR --measured ACROSS UP --nominal {:g}", length)
           : fmt::format(", and multiply the sizes of --target by measured / {:g}", length);
  return fmt::format(
      "{}: print at 100 %, not fitted to the page. Measure {} with a ruler across and up{}. A reading to 0.5 mm is "
      "{:.2g} % of {:g} mm.",
      PaperText(options.paper), what, enter, ReadingPercent(length), length);
}

// The size of what is laid out.
struct Cell {
  double width = 0, height = 0, white = 0, edge = 0;
};

// How pieces of one size lie on the paper.
struct Grid {
  bool band = false;  // both bars lie below the pieces, else an upright one left of them
  int cols = 0, rows = 0;
  double width = 0, height = 0;  // paper as it is used
  double x0 = 0, y0 = 0;         // of the first piece
  double bar = 0, edge = 0;      // lengths to measure
  double foot = 0;               // height of the bottom strip with text
  std::string text;              // of the foot
  int Count() const { return cols * rows; }
  double TextRoom(double margin) const { return width - 2 * margin - 2 * kBarEnd - (band ? kUprightStrip : 0); }
};

// Height of the foot with the text of any bar up to `grid.bar`.
double FootHeight(const SheetOptions& options, bool tags, const Grid& grid) {
  const double letters = LettersOf(grid.width);
  size_t lines = 0;
  for (const double bar : {grid.bar, kLeastBar}) {
    const std::string text = FootText(options, bar, grid.edge, tags);
    lines = std::max(lines, WrappedLines(text, letters, grid.TextRoom(options.margin_mm)).size());
  }
  return kFootBar + kLineStep * letters * static_cast<double>(1 + lines) + 0.5;
}

Grid GridOf(const Cell& cell, const SheetOptions& options, bool tags, bool landscape, bool band) {
  constexpr double kRounding = 1e-6;
  Grid grid;
  grid.band = band;
  grid.edge = cell.edge;
  grid.width = landscape ? options.paper.height_mm : options.paper.width_mm;
  grid.height = landscape ? options.paper.width_mm : options.paper.height_mm;
  const double m = options.margin_mm, white = std::min(cell.white, m);
  grid.bar = BarFor(grid.width - 2 * m - 2 * kBarEnd);
  grid.foot = FootHeight(options, tags, grid);
  if (!band) grid.bar = std::min(grid.bar, BarFor(grid.height - 2 * m - grid.foot - 2 - kBarEnd));
  const double left = band ? m - white : m + kSide, right = grid.width - m + white;
  const double low = grid.height - m - (band ? std::max(grid.foot, kLeastBar + 4) : grid.foot);
  grid.cols = std::max(0, static_cast<int>(std::floor((right - left) / cell.width + kRounding)));
  grid.rows = std::max(0, static_cast<int>(std::floor((low - m) / cell.height + kRounding)));
  if (band) grid.bar = std::min(grid.bar, BarFor(grid.height - 2 * m - grid.rows * cell.height - 4));
  if (grid.bar < kLeastBar) grid.rows = 0;
  grid.text = FootText(options, grid.bar, grid.edge, tags);
  grid.x0 = left + 0.5 * (right - left - grid.cols * cell.width);
  grid.y0 = band ? m : m + 0.5 * (low - m - grid.rows * cell.height);
  return grid;
}

// Most pieces on a sheet with bars at its edges, upright paper before the other way; bars below the pieces, which are
// shorter, only where nothing fits else.
Grid BestGrid(const Cell& cell, const SheetOptions& options, bool tags) {
  Grid best;
  for (const bool band : {false, true}) {
    for (const bool landscape : {false, true}) {
      const Grid grid = GridOf(cell, options, tags, landscape, band);
      if (grid.Count() > best.Count() || (band && grid.Count() == best.Count() && grid.bar > best.bar)) best = grid;
    }
    if (best.Count() > 0) break;
  }
  return best;
}

// A piece that is larger than the paper, cut into sheets.
struct Tiling {
  int cols = 0, rows = 0;
  double width = 0, height = 0;            // paper as it is used
  double trim_width = 0, trim_height = 0;  // of a sheet when it is cut
  double x0 = 0, y0 = 0;                   // of the cut on the paper
  int Count() const { return cols * rows; }
};

Tiling BestTiling(const Artwork& piece, const PaperSize& paper, double margin_mm) {
  Tiling best;
  for (const bool landscape : {false, true}) {
    Tiling t;
    t.width = landscape ? paper.height_mm : paper.width_mm;
    t.height = landscape ? paper.width_mm : paper.height_mm;
    t.x0 = t.y0 = margin_mm + kMarks;
    t.trim_width = std::floor(t.width - 2 * t.x0);
    t.trim_height = std::floor(t.height - 2 * t.y0);
    t.cols = static_cast<int>(std::ceil(piece.width_mm / t.trim_width - 1e-9));
    t.rows = static_cast<int>(std::ceil(piece.height_mm / t.trim_height - 1e-9));
    if (best.cols == 0 || t.Count() < best.Count()) best = t;
  }
  return best;
}

double LeastTrim(const PaperSize& paper, double margin_mm) {
  return std::min(paper.width_mm, paper.height_mm) - 2 * (margin_mm + kMarks);
}

bool IsoPaper(const PaperSize& paper) {
  return paper.name != "Letter" && paper.name != "Legal" && paper.name != "Tabloid";
}

// The smallest paper with a name for which `fits` is true, of the series of `like` if one of it is; empty if none is.
template <typename Fits>
std::string SmallestPaper(const PaperSize& like, const Fits& fits) {
  for (const bool same_series : {true, false}) {
    const PaperSize* best = nullptr;
    for (const PaperSize& paper : KnownPapers()) {
      if (same_series && IsoPaper(paper) != IsoPaper(like)) continue;
      const bool smaller = best == nullptr || paper.width_mm * paper.height_mm < best->width_mm * best->height_mm;
      if (smaller && fits(paper)) best = &paper;
    }
    if (best != nullptr) return best->name;
  }
  return "";
}

void RequireTiling(const Artwork& piece, const SheetOptions& options, const Tiling& tiling) {
  if (tiling.Count() <= kMostTiles) return;
  const std::string paper = SmallestPaper(options.paper, [&](const PaperSize& p) {
    return LeastTrim(p, options.margin_mm) >= kLeastTrim &&
           BestTiling(piece, p, options.margin_mm).Count() <= kMostTiles;
  });
  throw OptionError(fmt::format("{}: {:.0f} x {:.0f} mm, {} sheets of {}; expected at most {}: {}", piece.title,
                                piece.width_mm, piece.height_mm, tiling.Count(), options.paper.name, kMostTiles,
                                paper.empty() ? "make it smaller" : "take " + paper + " or larger paper"));
}

class Sheets {
 public:
  // `tags`: there are tags, whose sizes are kept.
  Sheets(const SheetOptions& options, bool tags, const std::filesystem::path& file)
      : options_(options), tags_(tags), file_(file.string()) {
    surface_.reset(
        cairo_pdf_surface_create(file_.c_str(), Points(options.paper.width_mm), Points(options.paper.height_mm)));
    cairo_.reset(cairo_create(surface_.get()));
    CheckWritten();
    cairo_pdf_surface_set_metadata(surface_.get(), CAIRO_PDF_METADATA_TITLE, CleanText(options.title).c_str());
    cairo_pdf_surface_set_metadata(surface_.get(), CAIRO_PDF_METADATA_CREATOR, "Trigpoint");
    // Never the clock: the same sheets give the same bytes.
    cairo_pdf_surface_set_metadata(surface_.get(), CAIRO_PDF_METADATA_CREATE_DATE, "1970-01-01T00:00:00Z");
    painter_ = std::make_unique<TextPainter>(cairo_.get());
  }

  // All on one grid: they have one size.
  void DrawOnGrid(const std::vector<const Artwork*>& pieces, const Cell& cell, const Grid& grid) {
    const size_t most =
        static_cast<size_t>(options_.per_sheet > 0 ? std::min(options_.per_sheet, grid.Count()) : grid.Count());
    printed_.per_sheet = std::max(printed_.per_sheet, static_cast<int>(most));
    for (size_t begin = 0; begin < pieces.size(); begin += most) {
      BeginPage(grid.width, grid.height);
      for (size_t k = begin; k < std::min(pieces.size(), begin + most); ++k) {
        const int at = static_cast<int>(k - begin);
        const double x = grid.x0 + (at % grid.cols) * cell.width;
        const double y = grid.y0 + (at / grid.cols) * cell.height;
        CutLines(x, y, cell);
        Draw(*pieces[k], x, y);
        for (const ArtworkPoint& p : pieces[k]->points) {
          printed_.points.push_back({page_, p.object, p.index, x + p.x_mm, y + p.y_mm});
        }
      }
      Bars(grid);
      EndPage();
    }
  }

  void DrawTiled(const Artwork& piece, const Tiling& t) {
    printed_.tiles = std::max(printed_.tiles, t.Count());
    DrawAssembly(piece, t);
    for (int r = 0; r < t.rows; ++r) {
      for (int c = 0; c < t.cols; ++c) {
        BeginPage(t.width, t.height);
        const double dx = t.x0 - c * t.trim_width, dy = t.y0 - r * t.trim_height;
        cairo_save(cairo_.get());
        cairo_rectangle(cairo_.get(), t.x0 - kBleed, t.y0 - kBleed, t.trim_width + 2 * kBleed,
                        t.trim_height + 2 * kBleed);
        cairo_clip(cairo_.get());
        Draw(piece, dx, dy);
        cairo_restore(cairo_.get());
        CropMarks(t);
        CutCaption(piece, t, r, c);
        for (const ArtworkPoint& p : piece.points) {
          const double px = p.x_mm - c * t.trim_width, py = p.y_mm - r * t.trim_height;
          const bool inside = px >= 0 && py >= 0 && px < t.trim_width && py < t.trim_height;
          if (inside) printed_.points.push_back({page_, p.object, p.index, t.x0 + px, t.y0 + py});
        }
        EndPage();
      }
    }
  }

  // Below a cut sheet, two lines in the strip of the crop marks.
  void CutCaption(const Artwork& piece, const Tiling& t, int row, int column) {
    constexpr double kLetters = 1.7;
    const double room = t.trim_width - 2;
    const std::string place = fmt::format(": row {} of {}, column {} of {}", row + 1, t.rows, column + 1, t.cols);
    const std::vector<std::string> lines = {
        Shortened(piece.title, kLetters, room - PrintedWidth(place, kLetters)) + place,
        fmt::format("{:g} mm across and {:g} mm down between the crop marks", t.trim_width, t.trim_height)};
    double y = t.y0 + t.trim_height + kBleed + 0.1;
    for (const std::string& line : lines) {
      y += kLineStep * kLetters;
      Text(0.5 * t.width, y, FittedSize(line, kLetters, room), 0, false, kSoft, line);
    }
  }

  // A form for where each tag was put. What is noted on small paper is less.
  void DrawPlaces(const std::vector<PlaceRow>& rows) {
    constexpr double kRow = 8.5, kEnoughWidth = 190;
    const bool landscape = options_.paper.width_mm < kEnoughWidth;
    const double short_side = std::min(options_.paper.width_mm, options_.paper.height_mm);
    const double long_side = std::max(options_.paper.width_mm, options_.paper.height_mm);
    const double w = landscape ? long_side : options_.paper.width_mm;
    const double h = landscape ? short_side : options_.paper.height_mm;
    const double m = options_.margin_mm + (landscape ? 1 : 4), across = w - 2 * m, letters = LettersOf(w);
    const std::vector<FormColumn> columns = FormColumns(across, letters);
    size_t head_lines = 0;
    for (const FormColumn& column : columns) head_lines = std::max(head_lines, column.head.size());
    const double head = kLineStep * letters * static_cast<double>(head_lines) + 2;
    for (size_t begin = 0; begin < rows.size();) {
      BeginPage(w, h);
      const double top = FormHead(m, across, letters, rows[begin].family);
      const double room = h - m - top - head;
      const size_t count = std::min(rows.size() - begin, static_cast<size_t>(std::max(1.0, std::floor(room / kRow))));
      const double bottom = top + head + static_cast<double>(count) * kRow;
      for (const FormColumn& column : columns) {
        double y = top + 0.4;
        for (const std::string& line : column.head) {
          Text(m + column.at + 0.8, y += kLineStep * letters, letters, -1, true, kInk, line);
        }
        Line(m + column.at, top, m + column.at, bottom, 0.15, kSoft);
      }
      Line(m + across, top, m + across, bottom, 0.15, kSoft);
      Line(m, top, m + across, top, 0.3, kInk);
      for (size_t k = 0; k <= count; ++k) {
        const double y = top + head + static_cast<double>(k) * kRow;
        Line(m, y, m + across, y, 0.15, kSoft);
        if (k == count) break;
        const PlaceRow& row = rows[begin + k];
        for (const auto& [at, text] : {std::pair(size_t{0}, row.tag), std::pair(size_t{1}, row.size_mm)}) {
          const double room_across = columns[at + 1].at - columns[at].at - 1.4;
          Text(m + columns[at].at + 0.8, y + 0.62 * kRow, FittedSize(text, 2.9, room_across, at == 0), -1, at == 0,
               kInk, text);
        }
      }
      EndPage();
      begin += count;
    }
  }

  PrintedSheets Finish() {
    cairo_surface_finish(surface_.get());
    CheckWritten();
    printed_.pages = page_;
    return printed_;
  }

 private:
  struct FormColumn {
    double at = 0;  // its left edge
    std::vector<std::string> head;
  };

  // Tag, size and place always; the others as far as there is room for the place.
  static std::vector<FormColumn> FormColumns(double across, double letters) {
    constexpr double kPlace = 36;
    const std::vector<std::pair<const char*, double>> all = {
        {"tag", 14},         {"size mm", 14}, {"where: object, side, height above ground", 0},
        {"measured mm", 20}, {"facing", 16},  {"fixed with", 18},
        {"put up, date", 20}};
    std::vector<bool> there(all.size(), false);
    double place = across;
    for (size_t k = 0; k < all.size(); ++k) {
      there[k] = k < 3 || place - all[k].second >= kPlace;
      if (there[k]) place -= all[k].second;
    }
    std::vector<FormColumn> columns;
    double at = 0;
    for (size_t k = 0; k < all.size(); ++k) {
      if (!there[k]) continue;
      const double width = all[k].second > 0 ? all[k].second : place;
      columns.push_back({at, WrappedLines(all[k].first, letters, width - 1.6, true)});
      at += width;
    }
    return columns;
  }

  // Returns where the table begins.
  double FormHead(double m, double across, double letters, const std::string& family) {
    const std::string title = "Where each tag was put";
    const double size = FittedSize(title, 2.1 * letters, across, true);
    double y = m + size;
    Text(m, y, size, -1, true, kInk, title);
    const std::string fields =
        "Site\u00a0______________________________   Date\u00a0____________   Name\u00a0____________________   "
        "Family\u00a0" +
        family;
    y += 0.8;
    for (const std::string& line : WrappedLines(fields, letters, across)) {
      Text(m, y += 1.9 * letters, letters, -1, false, kSoft, line);
    }
    return y + 2.5;
  }

  static double Points(double mm) { return mm * kPointsPerMm; }

  void CheckWritten() const {
    const cairo_status_t status = cairo_surface_status(surface_.get());
    if (status != CAIRO_STATUS_SUCCESS) {
      throw IoError(file_ + ": cannot be written: " + cairo_status_to_string(status) + "; is the disk full?");
    }
  }

  void BeginPage(double width, double height) {
    ++page_;
    cairo_pdf_surface_set_size(surface_.get(), Points(width), Points(height));
    cairo_save(cairo_.get());
    cairo_scale(cairo_.get(), kPointsPerMm, kPointsPerMm);
  }
  void EndPage() {
    cairo_restore(cairo_.get());
    cairo_show_page(cairo_.get());
  }

  void Line(double x0, double y0, double x1, double y1, double width, const char* colour, bool dashed = false) {
    const double dashes[] = {1.5, 1.5};
    SetColour(cairo_.get(), colour, 1);
    cairo_set_line_width(cairo_.get(), width);
    cairo_set_dash(cairo_.get(), dashes, dashed ? 2 : 0, 0);
    cairo_move_to(cairo_.get(), x0, y0);
    cairo_line_to(cairo_.get(), x1, y1);
    cairo_stroke(cairo_.get());
  }
  void Text(double x, double y, double size, int anchor, bool bold, const std::string& colour, const std::string& text,
            bool upwards = false) {
    constexpr double kFine = 50;  // Pango puts letters on whole units: these are of 0.02 mm
    Shape shape;
    shape.kind = Shape::Kind::kText;
    shape.points = {{kFine * x, kFine * y}};
    shape.text = text;
    shape.size = kFine * size;
    shape.anchor = anchor;
    shape.bold = bold;
    shape.fill = colour;
    shape.upwards = upwards;
    cairo_save(cairo_.get());
    cairo_scale(cairo_.get(), 1 / kFine, 1 / kFine);
    painter_->DrawAt(shape);
    cairo_restore(cairo_.get());
  }

  // Everything black of one fill is one path: neighbouring boxes leave no hairline between them.
  void Draw(const Artwork& piece, double x, double y, const char* ink = kInk) {
    cairo_t* cairo = cairo_.get();
    SetColour(cairo, ink, 1);
    cairo_new_path(cairo);
    for (const InkBox& box : piece.boxes) cairo_rectangle(cairo, x + box.x, y + box.y, box.width, box.height);
    cairo_fill(cairo);
    for (const InkCircle& circle : piece.circles) {
      cairo_arc(cairo, x + circle.x, y + circle.y, circle.radius, 0, 2 * M_PI);
      cairo_fill(cairo);
    }
    for (const auto& area : piece.areas) {
      for (const auto& [px, py] : area) cairo_line_to(cairo, x + px, y + py);
      cairo_close_path(cairo);
      cairo_fill(cairo);
    }
    for (const ArtworkLine& line : piece.lines) {
      Line(x + line.x0_mm, y + line.y0_mm, x + line.x1_mm, y + line.y1_mm, kHair, ink);
    }
    for (const ArtworkText& text : piece.texts) {
      Text(x + text.x_mm, y + text.y_mm, text.size_mm, text.anchor, text.bold, text.colour, text.text);
    }
  }

  void CutLines(double x, double y, const Cell& cell) {
    const double w = cell.width, h = cell.height;
    Line(x, y, x + w, y, kHair, kCut, true);
    Line(x, y + h, x + w, y + h, kHair, kCut, true);
    Line(x, y, x, y + h, kHair, kCut, true);
    Line(x + w, y, x + w, y + h, kHair, kCut, true);
  }

  void CropMarks(const Tiling& t) {
    for (const double x : {t.x0, t.x0 + t.trim_width}) {
      for (const double y : {t.y0, t.y0 + t.trim_height}) {
        const double right = x > t.x0 ? 1 : -1, down = y > t.y0 ? 1 : -1;
        Line(x + right * kBleed, y, x + right * kMarks, y, kHair, kInk);
        Line(x, y + down * kBleed, x, y + down * kMarks, kHair, kInk);
      }
    }
  }

  // `length` mm to the right, or upwards, with a tick every 10 mm.
  void Bar(double x, double y, double length, bool upwards, double letters) {
    const auto stroke = [&](double along0, double across0, double along1, double across1, double width) {
      if (upwards) {
        Line(x + across0, y - along0, x + across1, y - along1, width, kInk);
      } else {
        Line(x + along0, y - across0, x + along1, y - across1, width, kInk);
      }
    };
    stroke(0, 0, length, 0, kHair);
    for (int k = 0; 10 * k <= static_cast<int>(length + 0.5); ++k) {
      const bool end = k == 0 || 10 * k + 10 > length + 0.5;
      stroke(10 * k, end ? -2 : -0.8, 10 * k, end ? 2 : 0.8, kHair);
    }
    const std::string text = fmt::format("{:g} mm, end to end", length);
    if (upwards) {
      Text(x - 1.5, y - 0.5 * length, letters, 0, false, kSoft, text, true);
    } else {
      Text(x + 0.5 * length, y - 1.5, letters, 0, false, kSoft, text);
    }
  }

  void Bars(const Grid& grid) {
    const double m = options_.margin_mm, base = grid.height - m - 2.2, letters = LettersOf(grid.width);
    const double left = m + kBarEnd;
    printed_.bar_mm = grid.bar;
    printed_.measure_mm = std::max(grid.bar, grid.edge);
    Bar(left, base, grid.bar, false, letters);
    const double up_x = grid.band ? grid.width - m - 4 : m + 4,
                 up_y = grid.band ? base : grid.height - m - grid.foot - 2;
    Bar(up_x, up_y, grid.bar, true, letters);
    printed_.points.push_back({page_, "bar across", 0, left, base});
    printed_.points.push_back({page_, "bar across", 1, left + grid.bar, base});
    printed_.points.push_back({page_, "bar up", 0, up_x, up_y});
    printed_.points.push_back({page_, "bar up", 1, up_x, up_y - grid.bar});
    const double room = grid.TextRoom(m);
    std::vector<std::string> lines = WrappedLines(grid.text, letters, room);
    const std::string number = fmt::format(", sheet {}", page_);
    lines.insert(lines.begin(),
                 Shortened(options_.title, letters, room - PrintedWidth(number, letters, true), true) + number);
    double y = grid.height - m - kFootBar - kLineStep * letters * (static_cast<double>(lines.size()) - 0.7);
    for (size_t k = 0; k < lines.size(); ++k, y += kLineStep * letters) {
      Text(left, y, letters, -1, k == 0, kSoft, lines[k]);
    }
  }

  // The first sheet of a piece that is cut: how it goes together, what to measure.
  void DrawAssembly(const Artwork& piece, const Tiling& t) {
    constexpr double kLeastPicture = 15;
    Grid grid;
    grid.width = t.width;
    grid.height = t.height;
    grid.edge = piece.edge_mm;
    const double m = options_.margin_mm, left = m + kSide + 3, letters = 1.2 * LettersOf(t.width);
    grid.bar = BarFor(std::min(t.width - 2 * m - 2 * kBarEnd, t.height - 2 * m - 20));
    grid.foot = FootHeight(options_, tags_, grid);
    grid.bar = std::min(grid.bar, BarFor(t.height - 2 * m - grid.foot - 2 - kBarEnd));
    grid.text = FootText(options_, grid.bar, grid.edge, tags_);
    const double room_x = t.width - left - m;
    std::vector<std::string> words = {
        fmt::format("{} sheets: {} of {}. Cut each along its crop marks and put them edge to edge.", t.Count(),
                    Counted(t.rows, "row"), t.cols),
        "Numbers in the picture: row, column, as below each sheet.",
        "Glue them to a flat, stiff plate, beginning with the sheet in the middle. Then measure:"};
    for (const std::string& check : piece.checks)
      words.push_back(check + "      measured:\u00a0______________\u00a0mm");
    BeginPage(t.width, t.height);
    const double title = FittedSize(piece.title, 2 * letters, room_x, true);
    double y = m + 2 + title;
    Text(left, y, title, -1, true, kInk, piece.title);
    for (const std::string& paragraph : words) {
      y += 0.5 * letters;
      for (const std::string& line : WrappedLines(paragraph, letters, room_x)) {
        Text(left, y += kLineStep * letters, letters, -1, false, kInk, line);
      }
    }
    const double top = y + 1.5 * letters, room_y = t.height - m - grid.foot - 2 - top;
    if (room_y < kLeastPicture || grid.bar < kLeastBar) {
      throw OptionError(fmt::format(
          "{}: {} with a margin of {:g} mm has no room for the sheet that shows how {} sheets go together; expected "
          "A6 or larger paper",
          piece.title, options_.paper.name, m, t.Count()));
    }
    DrawSmall(piece, t, left, top, room_x, room_y);
    Bars(grid);
    EndPage();
  }

  // Around x, y, on white.
  void Number(double x, double y, double letters, const std::string& text) {
    const double w = PrintedWidth(text, letters, true) + 0.6 * letters, h = 1.6 * letters;
    SetColour(cairo_.get(), "#ffffff", 1);
    cairo_rectangle(cairo_.get(), x - 0.5 * w, y - 0.5 * h, w, h);
    cairo_fill(cairo_.get());
    Text(x, y + 0.36 * letters, letters, 0, true, kInk, text);
  }

  // A piece in `width` x `height` mm, with its cuts and the numbers of its sheets.
  void DrawSmall(const Artwork& piece, const Tiling& t, double x, double y, double width, double height) {
    const double all_x = t.cols * t.trim_width, all_y = t.rows * t.trim_height;
    const double scale = std::min(width / all_x, height / all_y), thin = 0.25 / scale;
    cairo_save(cairo_.get());
    cairo_translate(cairo_.get(), x, y);
    cairo_scale(cairo_.get(), scale, scale);
    Draw(piece, 0, 0, kFaint);
    for (int c = 0; c <= t.cols; ++c) Line(c * t.trim_width, 0, c * t.trim_width, all_y, thin, kJoint);
    for (int r = 0; r <= t.rows; ++r) Line(0, r * t.trim_height, all_x, r * t.trim_height, thin, kJoint);
    const std::string widest = fmt::format("{}, {}", t.rows, t.cols);
    const double letters = FittedSize(widest, std::min(3.4 / scale, 0.3 * t.trim_height), 0.85 * t.trim_width, true);
    for (int r = 0; r < t.rows; ++r) {
      for (int c = 0; c < t.cols; ++c) {
        Number((c + 0.5) * t.trim_width, (r + 0.5) * t.trim_height, letters, fmt::format("{}, {}", r + 1, c + 1));
      }
    }
    cairo_restore(cairo_.get());
  }

  SheetOptions options_;
  bool tags_ = false;
  std::string file_;
  std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)> surface_{nullptr, cairo_surface_destroy};
  std::unique_ptr<cairo_t, void (*)(cairo_t*)> cairo_{nullptr, cairo_destroy};
  std::unique_ptr<TextPainter> painter_;
  PrintedSheets printed_;
  int page_ = 0;
};

// The smallest paper with a name on which no piece is cut.
std::string UncutPaper(const std::vector<Artwork>& artworks, const SheetOptions& options, bool tags) {
  return SmallestPaper(options.paper, [&](const PaperSize& paper) {
    SheetOptions other = options;
    other.paper = paper;
    return std::all_of(artworks.begin(), artworks.end(), [&](const Artwork& piece) {
      return BestGrid({piece.width_mm, piece.height_mm, piece.white_mm, piece.edge_mm}, other, tags).Count() > 0;
    });
  });
}

void RequireMargin(const SheetOptions& options) {
  const double least = LeastTrim(options.paper, options.margin_mm);
  if (options.margin_mm >= 0 && least >= kLeastTrim) return;
  const std::string paper =
      SmallestPaper(options.paper, [&](const PaperSize& p) { return LeastTrim(p, options.margin_mm) >= kLeastTrim; });
  throw OptionError(
      fmt::format("margin of {:g} mm: leaves {:.0f} mm of {} between crop marks, expected at least {:g}: a margin of 0 "
                  "to {:.0f} mm{}",
                  options.margin_mm, std::max(0.0, least), options.paper.name, kLeastTrim,
                  std::max(0.0, std::floor(options.margin_mm + 0.5 * (least - kLeastTrim))),
                  options.margin_mm < 0 || paper.empty() ? "" : ", or " + paper + " or larger paper"));
}

}  // namespace

double ReadingPercent(double length_mm) {
  constexpr double kReading_mm = 0.5;
  return 100 * kReading_mm / length_mm;
}

PrintedSheets WriteSheets(const std::vector<Artwork>& artworks, const std::vector<PlaceRow>& places,
                          const SheetOptions& options, const std::filesystem::path& file) {
  RequireMargin(options);
  const bool tags = !places.empty();
  Sheets sheets(options, tags, file);
  // Neighbours of one width share sheets.
  for (size_t begin = 0; begin < artworks.size();) {
    const Artwork& first = artworks[begin];
    Cell cell{first.width_mm, first.height_mm, first.white_mm, first.edge_mm};
    size_t end = begin;
    for (; end < artworks.size() && artworks[end].width_mm == first.width_mm && artworks[end].edge_mm == first.edge_mm;
         ++end) {
      cell.height = std::max(cell.height, artworks[end].height_mm);
    }
    const Grid grid = BestGrid(cell, options, tags);
    std::vector<const Artwork*> same;
    for (; begin < end; ++begin) {
      if (grid.Count() > 0) {
        same.push_back(&artworks[begin]);
        continue;
      }
      const Tiling tiling = BestTiling(artworks[begin], options.paper, options.margin_mm);
      RequireTiling(artworks[begin], options, tiling);
      sheets.DrawTiled(artworks[begin], tiling);
    }
    if (!same.empty()) sheets.DrawOnGrid(same, cell, grid);
  }
  if (tags) sheets.DrawPlaces(places);
  PrintedSheets printed = sheets.Finish();
  if (printed.tiles > 0) printed.one_sheet = UncutPaper(artworks, options, tags);
  return printed;
}

}  // namespace trigpoint

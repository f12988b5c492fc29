// Pages by Cairo in millimetres.
#include "eval/print/sheets.h"

#include <cairo-pdf.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "eval/report/drawing.h"
#include "eval/report/paint.h"

namespace trigpoint {
namespace {

constexpr double kPointsPerMm = 72 / 25.4;
constexpr double kSide = 9;    // strip of an upright bar at the left edge
constexpr double kFoot = 10;   // strip of a lying bar at the bottom edge
constexpr double kBand = 62;   // strip of both at the bottom edge, where there is no room at the left
constexpr double kHair = 0.1;  // line, mm
constexpr double kMarks = 8;   // strip of the crop marks around a cut sheet
constexpr double kBleed = 3;   // drawn beyond the cut
constexpr const char* kInk = "#000000";
constexpr const char* kSoft = "#555555";
constexpr const char* kCut = "#9a9a9a";

// How pieces of one size lie on the paper.
struct Grid {
  bool band = false;
  int cols = 0, rows = 0;
  double width = 0, height = 0;  // paper as it is used
  double x0 = 0, y0 = 0;         // of the first piece
  int Count() const { return cols * rows; }
};

Grid GridOf(const Artwork& piece, const SheetOptions& options, bool landscape, bool band) {
  Grid grid{band};
  grid.width = landscape ? options.paper.height_mm : options.paper.width_mm;
  grid.height = landscape ? options.paper.width_mm : options.paper.height_mm;
  const double m = options.margin_mm, white = std::min(piece.white_mm, m);
  const double left = band ? m - white : m + kSide, right = grid.width - m + white;
  const double bottom = grid.height - m - (band ? kBand : kFoot);
  constexpr double kRounding = 1e-6;
  grid.cols = std::max(0, static_cast<int>(std::floor((right - left) / piece.width_mm + kRounding)));
  grid.rows = std::max(0, static_cast<int>(std::floor((bottom - m) / piece.height_mm + kRounding)));
  grid.x0 = left + 0.5 * (right - left - grid.cols * piece.width_mm);
  grid.y0 = m + 0.5 * (bottom - m - grid.rows * piece.height_mm);
  return grid;
}

// Most pieces on a sheet, upright paper and bars at the edges before other ways.
Grid BestGrid(const Artwork& piece, const SheetOptions& options) {
  Grid best;
  for (const bool landscape : {false, true}) {
    for (const bool band : {false, true}) {
      const Grid grid = GridOf(piece, options, landscape, band);
      if (grid.Count() > best.Count()) best = grid;
    }
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

Tiling BestTiling(const Artwork& piece, const SheetOptions& options) {
  Tiling best;
  for (const bool landscape : {false, true}) {
    Tiling t;
    t.width = landscape ? options.paper.height_mm : options.paper.width_mm;
    t.height = landscape ? options.paper.width_mm : options.paper.height_mm;
    t.x0 = t.y0 = options.margin_mm + kMarks;
    t.trim_width = std::floor(t.width - 2 * t.x0);
    t.trim_height = std::floor(t.height - 2 * t.y0);
    t.cols = static_cast<int>(std::ceil(piece.width_mm / t.trim_width - 1e-9));
    t.rows = static_cast<int>(std::ceil(piece.height_mm / t.trim_height - 1e-9));
    if (best.cols == 0 || t.Count() < best.Count()) best = t;
  }
  return best;
}

class Sheets {
 public:
  Sheets(const SheetOptions& options, const std::filesystem::path& file) : options_(options), file_(file.string()) {
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
  void DrawOnGrid(const std::vector<const Artwork*>& pieces, const Grid& grid) {
    const size_t most =
        static_cast<size_t>(options_.per_sheet > 0 ? std::min(options_.per_sheet, grid.Count()) : grid.Count());
    printed_.per_sheet = std::max(printed_.per_sheet, static_cast<int>(most));
    for (size_t begin = 0; begin < pieces.size(); begin += most) {
      BeginPage(grid.width, grid.height);
      for (size_t k = begin; k < std::min(pieces.size(), begin + most); ++k) {
        const int at = static_cast<int>(k - begin);
        const double x = grid.x0 + (at % grid.cols) * pieces[k]->width_mm;
        const double y = grid.y0 + (at / grid.cols) * pieces[k]->height_mm;
        CutLines(x, y, *pieces[k]);
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
        const std::string text =
            fmt::format("{}: row {} of {}, column {} of {}. Between the crop marks {:g} mm across, {:g} mm down.",
                        piece.title, r + 1, t.rows, c + 1, t.cols, t.trim_width, t.trim_height);
        Text(0.5 * t.width, t.y0 + t.trim_height + kBleed + 3.4, 2.4, 0, false, kSoft, text);
        for (const ArtworkPoint& p : piece.points) {
          const double x = p.x_mm - c * t.trim_width, y = p.y_mm - r * t.trim_height;
          const bool inside = x >= 0 && y >= 0 && x < t.trim_width && y < t.trim_height;
          if (inside) printed_.points.push_back({page_, p.object, p.index, t.x0 + x, t.y0 + y});
        }
        EndPage();
      }
    }
  }

  // A form for where each tag was put.
  void DrawPlaces(const std::vector<PlaceRow>& rows) {
    const double w = options_.paper.width_mm, h = options_.paper.height_mm, m = options_.margin_mm + 4;
    constexpr double kRow = 8.5, kHead = 24;
    const size_t on_page = static_cast<size_t>(std::max(1.0, std::floor((h - 2 * m - kHead - 8) / kRow)));
    const std::vector<std::pair<const char*, double>> columns = {{"tag", 0},
                                                                 {"size mm", 0.08},
                                                                 {"measured mm", 0.17},
                                                                 {"where: object, side, height above ground", 0.29},
                                                                 {"facing", 0.70},
                                                                 {"fixed with", 0.79},
                                                                 {"put up, date", 0.89},
                                                                 {"", 1}};
    for (size_t begin = 0; begin < rows.size(); begin += on_page) {
      BeginPage(w, h);
      Text(m, m + 6, 5, -1, true, kInk, "Where each tag was put");
      Text(m, m + 12, 2.6, -1, false, kSoft,
           "Site ______________________________   Date ____________   Name ____________________   Family " +
               rows[begin].family);
      const double top = m + kHead - 7, across = w - 2 * m;
      const size_t count = std::min(on_page, rows.size() - begin);
      for (size_t k = 0; k + 1 < columns.size(); ++k) {
        Text(m + columns[k].second * across + 0.8, top + 4.5, 2.4, -1, true, kInk, columns[k].first);
      }
      const double bottom = top + 6.5 + static_cast<double>(count) * kRow;
      for (size_t k = 0; k <= count; ++k) {
        const double y = top + 6.5 + static_cast<double>(k) * kRow;
        Line(m, y, m + across, y, 0.15, kSoft);
        if (k == count) break;
        const double base = y + 0.62 * kRow;
        Text(m + 0.8, base, 3, -1, true, kInk, rows[begin + k].tag);
        Text(m + columns[1].second * across + 0.8, base, 2.8, -1, false, kInk, rows[begin + k].size_mm);
      }
      Line(m, top, m + across, top, 0.3, kInk);
      for (const auto& [name, at] : columns) Line(m + at * across, top, m + at * across, bottom, 0.15, kSoft);
      EndPage();
    }
  }

  PrintedSheets Finish() {
    cairo_surface_finish(surface_.get());
    CheckWritten();
    printed_.pages = page_;
    return printed_;
  }

 private:
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
  void Draw(const Artwork& piece, double x, double y) {
    cairo_t* cairo = cairo_.get();
    SetColour(cairo, kInk, 1);
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
      Line(x + line.x0_mm, y + line.y0_mm, x + line.x1_mm, y + line.y1_mm, kHair, kInk);
    }
    for (const ArtworkText& text : piece.texts) {
      Text(x + text.x_mm, y + text.y_mm, text.size_mm, text.anchor, text.bold, text.colour, text.text);
    }
  }

  void CutLines(double x, double y, const Artwork& piece) {
    const double w = piece.width_mm, h = piece.height_mm;
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
  void Bar(double x, double y, double length, bool upwards) {
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
      Text(x - 1.2, y - 0.5 * length, 2.4, 0, false, kSoft, text, true);
    } else {
      Text(x + 0.5 * length, y - 1.2, 2.4, 0, false, kSoft, text);
    }
  }

  void Bars(const Grid& grid) {
    const double m = options_.margin_mm;
    const double foot = grid.height - m - 3;
    const double left = grid.band ? m + 3 : m + kSide + 2;
    const double room = std::min(grid.width - left - m, grid.height - 2 * m - kFoot - 4);
    const double length = grid.band ? 50 : room >= 100 ? 100 : room >= 50 ? 50 : 20;
    printed_.bar_mm = length;
    Bar(left, foot, length, false);
    const double up_x = grid.band ? grid.width - m - 4 : m + 4, up_y = grid.band ? foot : grid.height - m - kFoot - 2;
    Bar(up_x, up_y, length, true);
    printed_.points.push_back({page_, "bar across", 0, left, foot});
    printed_.points.push_back({page_, "bar across", 1, left + length, foot});
    printed_.points.push_back({page_, "bar up", 0, up_x, up_y});
    printed_.points.push_back({page_, "bar up", 1, up_x, up_y - length});
    const double begin = left + length + 5, free = grid.width - begin - m - (grid.band ? 12 : 0);
    const std::string size =
        fmt::format("{} of {:g} x {:g} mm", options_.paper.name, options_.paper.width_mm, options_.paper.height_mm);
    const std::vector<std::string> lines = {fmt::format("{}, sheet {}", options_.title, page_),
                                            fmt::format("{}: print at 100 %, not fitted to the page", size),
                                            "then measure both bars with a ruler"};
    double text_size = 2.5;
    for (const std::string& line : lines) {
      text_size = std::min(text_size, text_size * free / std::max(1.0, 1.05 * TextWidth(line, text_size)));
    }
    if (text_size < 1.2) return;  // small paper: the form and the terminal say the same
    for (size_t k = 0; k < lines.size(); ++k) {
      Text(begin, foot + 1 - 1.35 * text_size * static_cast<double>(lines.size() - 1 - k), text_size, -1, k == 0, kSoft,
           lines[k]);
    }
  }

  // The first sheet of a piece that is cut: how it goes together, what to measure.
  void DrawAssembly(const Artwork& piece, const Tiling& t) {
    Grid grid;
    grid.width = t.width;
    grid.height = t.height;
    BeginPage(t.width, t.height);
    const double m = options_.margin_mm, left = m + kSide + 3;
    double y = m + 7;
    constexpr double kTitle_mm = 5, kBoldWider = 1.2;
    const double title_width = kBoldWider * TextWidth(piece.title, kTitle_mm);
    Text(left, y, kTitle_mm * std::min(1.0, (t.width - left - m) / title_width), -1, true, kInk, piece.title);
    std::vector<std::string> words = {
        fmt::format("{} sheets: {} of {}. Cut each along its crop marks and put them edge to edge.", t.Count(),
                    Counted(t.rows, "row"), t.cols),
        "Glue them to a flat, stiff plate, beginning with the sheet in the middle. Then measure:"};
    for (const std::string& check : piece.checks) words.push_back("   " + check + "      measured: ______________ mm");
    y += 3;
    for (const std::string& line : words) Text(left, y += 5.5, 2.9, -1, false, kInk, line);
    // The piece, small, with the cuts.
    const double room_x = t.width - left - m, room_y = t.height - y - 8 - m - kFoot - 6;
    const double all_x = t.cols * t.trim_width, all_y = t.rows * t.trim_height;
    const double scale = std::min(room_x / all_x, room_y / all_y);
    cairo_save(cairo_.get());
    cairo_translate(cairo_.get(), left, y + 8);
    cairo_scale(cairo_.get(), scale, scale);
    Draw(piece, 0, 0);
    const double thin = 0.25 / scale;
    for (int c = 0; c <= t.cols; ++c) Line(c * t.trim_width, 0, c * t.trim_width, all_y, thin, "#d55e00");
    for (int r = 0; r <= t.rows; ++r) Line(0, r * t.trim_height, all_x, r * t.trim_height, thin, "#d55e00");
    for (int r = 0; r < t.rows; ++r) {
      for (int c = 0; c < t.cols; ++c) {
        Text((c + 0.04) * t.trim_width, r * t.trim_height + 4.5 / scale, 3.4 / scale, -1, true, "#d55e00",
             fmt::format("{}, {}", r + 1, c + 1));
      }
    }
    cairo_restore(cairo_.get());
    Bars(grid);
    EndPage();
  }

  SheetOptions options_;
  std::string file_;
  std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)> surface_{nullptr, cairo_surface_destroy};
  std::unique_ptr<cairo_t, void (*)(cairo_t*)> cairo_{nullptr, cairo_destroy};
  std::unique_ptr<TextPainter> painter_;
  PrintedSheets printed_;
  int page_ = 0;
};

}  // namespace

PrintedSheets WriteSheets(const std::vector<Artwork>& artworks, const std::vector<PlaceRow>& places,
                          const SheetOptions& options, const std::filesystem::path& file) {
  const double least = std::min(options.paper.width_mm, options.paper.height_mm) - 2 * (options.margin_mm + kMarks);
  constexpr double kLeastTrim = 30;
  if (!(options.margin_mm >= 0) || least < kLeastTrim) {
    throw OptionError(fmt::format("margin of {:g} mm: leaves nothing of {:g} x {:g} mm paper; expected 0 to {:.0f} mm",
                                  options.margin_mm, options.paper.width_mm, options.paper.height_mm,
                                  std::max(0.0, options.margin_mm + 0.5 * (least - kLeastTrim))));
  }
  Sheets sheets(options, file);
  // Neighbours of one size share sheets.
  for (size_t begin = 0; begin < artworks.size();) {
    const Artwork& first = artworks[begin];
    const Grid grid = BestGrid(first, options);
    if (grid.Count() == 0) {
      sheets.DrawTiled(first, BestTiling(first, options));
      ++begin;
      continue;
    }
    std::vector<const Artwork*> same;
    for (; begin < artworks.size() && artworks[begin].width_mm == first.width_mm &&
           artworks[begin].height_mm == first.height_mm;
         ++begin) {
      same.push_back(&artworks[begin]);
    }
    sheets.DrawOnGrid(same, grid);
  }
  if (!places.empty()) sheets.DrawPlaces(places);
  return sheets.Finish();
}

}  // namespace trigpoint

// Pages by Cairo, words by Pango.
#include <cairo-pdf.h>
#include <fmt/format.h>
#include <pango/pangocairo.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "calib/base/error.h"
#include "eval/report/document.h"
#include "eval/report/paint.h"

namespace trigpoint {
namespace {

constexpr double kMargin = 46;  // points
constexpr double kFoot = 26;
constexpr double kTextPt = 9.5, kTablePt = 7.6, kSmallestPt = 5;

// A part of the document's structure, for readers that read aloud. Never over the end of a page.
class Tagged {
 public:
  Tagged(cairo_t* cairo, const char* name) : cairo_(cairo), name_(name) { cairo_tag_begin(cairo_, name_, nullptr); }
  ~Tagged() { cairo_tag_end(cairo_, name_); }
  Tagged(const Tagged&) = delete;
  Tagged& operator=(const Tagged&) = delete;

 private:
  cairo_t* cairo_;
  const char* name_;
};

// Cairo 1.16 writes the structure of a tagged document without declaring it: an update of the catalogue, appended as
// PDF has it, adds that and the language.
void MarkAsTagged(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  std::string pdf((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  const size_t type = pdf.rfind("<< /Type /Catalog"), trailer = pdf.rfind("trailer\n<<"),
               xref = pdf.rfind("startxref\n");
  if (type == std::string::npos || trailer == std::string::npos || xref == std::string::npos) return;
  const size_t object = pdf.rfind('\n', type - 2) + 1, end = pdf.find(">>\nendobj", type);
  const std::string catalogue = pdf.substr(object, end - object);
  if (end == std::string::npos || catalogue.find("/MarkInfo") != std::string::npos) return;
  const size_t close = pdf.find(">>", trailer), number = pdf.find_first_of("0123456789", xref);
  const std::string before = pdf.substr(number, pdf.find('\n', number) - number),
                    id = catalogue.substr(0, catalogue.find(' '));
  std::string update = "\n";
  const size_t at = pdf.size() + update.size();
  update += catalogue + "   /MarkInfo << /Marked true >>\n   /Lang (en)\n>>\nendobj\n";
  const size_t table = pdf.size() + update.size();
  update += fmt::format("xref\n{} 1\n{:010} 00000 n \n{}   /Prev {}\n>>\nstartxref\n{}\n%%EOF\n", id, at,
                        pdf.substr(trailer, close - trailer), before, table);
  std::ofstream out(file, std::ios::binary | std::ios::app);
  out << update;
  out.close();
  if (!out) throw IoError(file + ": cannot be written; is the disk full?");
}

class Pages {
 public:
  Pages(const Document& document, Paper paper, const std::string& file)
      : document_(document),
        file_(file),
        width_(paper == Paper::kA4 ? 595.276 : 612),
        height_(paper == Paper::kA4 ? 841.89 : 792) {
    surface_.reset(cairo_pdf_surface_create(file.c_str(), width_, height_));
    cairo_.reset(cairo_create(surface_.get()));
    CheckWritten();
    const auto set = [&](cairo_pdf_metadata_t what, const std::string& text) {
      cairo_pdf_surface_set_metadata(surface_.get(), what, text.c_str());
    };
    set(CAIRO_PDF_METADATA_TITLE, CleanText(document.title));
    set(CAIRO_PDF_METADATA_CREATOR, "Trigpoint");
    // Never the clock: the same results give the same bytes.
    set(CAIRO_PDF_METADATA_CREATE_DATE, document.date.empty() ? "1970-01-01T00:00:00Z" : document.date);
    painter_ = std::make_unique<TextPainter>(cairo_.get());
  }

  void Write() {
    y_ = kMargin;
    Words(document_.title, 20, true, kInk, 0, "H1");
    Words(document_.subtitle, kTextPt, false, kSoft, 10);
    const std::vector<Block> blocks = OnPaper(document_.blocks);
    for (size_t i = 0; i < blocks.size(); ++i) {
      if (const auto* fold = std::get_if<FoldBegin>(&blocks[i]); fold != nullptr && !fold->on_paper) {
        LeaveOut(blocks, &i);
      } else if (std::holds_alternative<Figure>(blocks[i])) {
        PlaceFigures(blocks, &i);
      } else {
        KeepWithNext(blocks, i);
        std::visit(*this, blocks[i]);
      }
    }
    while (!waiting_.empty()) Turn();
    Foot();
    cairo_show_page(cairo_.get());
    cairo_surface_finish(surface_.get());
    CheckWritten();
    MarkAsTagged(file_);
  }

  std::vector<double> filled() const { return filled_; }

  void operator()(const Heading& h) {
    const double size = h.level == 2 ? 15 : 11.5;
    Need(size * 2 + (h.level == 2 ? 60 : 110));
    y_ += y_ > kMargin ? (h.level == 2 ? 16 : 10) : 0;
    if (h.level == 2) {
      cairo_tag_begin(cairo_.get(), CAIRO_TAG_DEST, ("name='" + h.anchor + "'").c_str());
      cairo_tag_end(cairo_.get(), CAIRO_TAG_DEST);
      cairo_pdf_surface_add_outline(surface_.get(), CAIRO_PDF_OUTLINE_ROOT, CleanText(h.text).c_str(),
                                    ("dest='" + h.anchor + "'").c_str(), CAIRO_PDF_OUTLINE_FLAG_OPEN);
      SetColour(cairo_.get(), kInk, 1);
      cairo_set_line_width(cairo_.get(), 1.2);
      cairo_move_to(cairo_.get(), kMargin, y_);
      cairo_line_to(cairo_.get(), width_ - kMargin, y_);
      cairo_stroke(cairo_.get());
      y_ += 6;
    }
    Words(h.text, size, true, kInk, 5, h.level == 2 ? "H2" : "H3");
  }
  void operator()(const Paragraph& p) {
    Words(p.text, kTextPt, false, p.tone == Tone::kBad ? kBad : p.tone == Tone::kWarning ? kWarn : kInk, 5);
  }
  void operator()(const FoldBegin& fold) {
    Need(110);
    Words(fold.title, kTextPt, true, kInk, 4);
  }
  void operator()(const FoldEnd&) {}
  void operator()(const Columns&) {}
  void operator()(const AppendixBegin&) {}
  void operator()(const AppendixEnd&) {}
  void operator()(const Figure&) {}  // PlaceFigures

  void operator()(const Facts& facts) {
    const int columns = std::clamp(static_cast<int>(facts.facts.size()), 1, 5);
    const double gap = 8, w = (Room() - gap * (columns - 1)) / columns;
    for (size_t begin = 0; begin < facts.facts.size(); begin += static_cast<size_t>(columns)) {
      const size_t end = std::min(facts.facts.size(), begin + static_cast<size_t>(columns));
      double h = 0;
      for (size_t i = begin; i < end; ++i) h = std::max(h, FactHeight(facts.facts[i], w));
      Need(h + gap);
      const Tagged tag(cairo_.get(), "P");
      for (size_t i = begin; i < end; ++i)
        DrawFact(facts.facts[i], kMargin + static_cast<double>(i - begin) * (w + gap), w, h);
      y_ += h + gap;
    }
  }

  void operator()(const Table& table) {
    if (const std::string caption = CaptionOf(table); !caption.empty()) {
      Need(80);
      Words(caption, 8, false, kSoft, 3);
    }
    if (table.columns.empty()) return;
    // As wide as their widest cell where there is room; else lines are broken between words, then letters get smaller,
    // then the table comes in parts that repeat the first column.
    const size_t n = table.columns.size();
    std::vector<Ems> wide(n);
    for (size_t k = 0; k < n; ++k) {
      wide[k].Add(table.columns[k].name, kBoldWider);
      for (const auto& row : table.rows) {
        if (k < row.size()) wide[k].Add(row[k].text, 1);
      }
    }
    const double gap = 7;
    double least = 0;
    for (const Ems& w : wide) least += w.least;
    const double size =
        std::clamp((Room() - gap * static_cast<double>(n)) / std::max(1.0, least), kSmallestPt, kTablePt);
    for (size_t k = 1; k <= n;) {
      double used = wide[0].least * size + gap;
      std::vector<size_t> part = {0};
      while (k < n && (part.size() == 1 || used + wide[k].least * size + gap <= Room())) {
        used += wide[k].least * size + gap;
        part.push_back(k++);
      }
      DrawRows(table, part, WidthsOf(table, part, wide, size, gap), size, gap);
      if (k >= n) break;
    }
    y_ += 8;
  }

 private:
  static constexpr double kLeastShrink = 0.6, kLeastShrinkOfPairs = 0.75;

  // The blocks with appendices at the end.
  static std::vector<Block> OnPaper(const std::vector<Block>& blocks) {
    std::vector<Block> all, later;
    bool appendix = false;
    for (const Block& block : blocks) {
      if (const auto* begin = std::get_if<AppendixBegin>(&block)) {
        appendix = true;
        later.push_back(Heading{2, "Appendix: " + begin->title, begin->anchor});
      } else if (std::holds_alternative<AppendixEnd>(block)) {
        appendix = false;
      } else {
        (appendix ? later : all).push_back(block);
      }
    }
    std::move(later.begin(), later.end(), std::back_inserter(all));
    return all;
  }

  // Width and height on the page, points.
  std::pair<double, double> SizeOf(const Figure& figure, double shrink) const {
    double w = 0, h = 0;
    if (const auto* drawing = std::get_if<Drawing>(&figure.content)) {
      w = 0.75 * drawing->width, h = 0.75 * drawing->height;
    } else {
      const Picture& picture = std::get<Picture>(figure.content);
      w = picture.width, h = picture.height;
      // Two go on a page, under a heading too.
      const double fit = std::min(Room() / std::max(1.0, w), (0.5 * (height_ - 2 * kMargin) - 72) / std::max(1.0, h));
      w *= fit, h *= fit;
    }
    const double scale =
        shrink * std::min({1.0, Room() / std::max(1.0, w), (height_ - 2 * kMargin - 110) / std::max(1.0, h)});
    return {scale * w, scale * h};
  }
  double CaptionRoom(const Figure& figure) const { return painter_->Height(figure.caption, 8, false, Room()) + 16; }

  // A figure, or two side by side (one in the left half).
  struct Row {
    const Figure* left = nullptr;
    const Figure* right = nullptr;
    bool Pair() const { return InPairs(*left); }
  };
  double RowCaption(const Row& row) const {
    if (!row.Pair()) return CaptionRoom(*row.left);
    double text = 0;
    for (const Figure* figure : {row.left, row.right}) {
      if (figure != nullptr) text = std::max(text, painter_->Height(figure->caption, 7.5, false, HalfWidth()));
    }
    return text + 14;
  }
  double RowPicture(const Row& row) const {
    if (!row.Pair()) return SizeOf(*row.left, 1).second;
    return std::max(HalfHeight(*row.left), row.right == nullptr ? 0 : HalfHeight(*row.right));
  }

  // How much smaller the rows must be to stand on what is left of the page, at most 1; nothing if that is too small.
  std::optional<double> ShrinkToFit(const std::vector<Row>& rows) const {
    double captions = 0, pictures = 0;
    for (const Row& row : rows) captions += RowCaption(row), pictures += RowPicture(row);
    const double shrink = std::min(1.0, (End() - y_ - captions) / std::max(1.0, pictures));
    if (shrink < (rows.front().Pair() ? kLeastShrinkOfPairs : kLeastShrink)) return std::nullopt;
    return shrink;
  }

  void DrawRow(const Row& row, double shrink) {
    if (row.Pair()) {
      DrawPair(row, shrink);
      return;
    }
    const auto [w, h] = SizeOf(*row.left, shrink);
    DrawContent(*row.left, kMargin + 0.5 * (Room() - w), w);
    y_ += h + 5;
    Words(row.left->caption, 8, false, kSoft, 9, "Caption");
  }

  void DrawPair(const Row& row, double shrink) {
    const double above = y_, h = shrink * RowPicture(row), all = h + RowCaption(row);
    double x = kMargin;
    for (const Figure* figure : {row.left, row.right}) {
      if (figure == nullptr) continue;
      DrawContent(*figure, x, shrink * HalfWidth());
      const Tagged tag(cairo_.get(), "Caption");
      painter_->Draw(figure->caption, x, y_ + h + 4, 7.5, false, kSoft, HalfWidth(), -1, 0);
      x += HalfWidth() + kHalfGap;
    }
    y_ = above + all;
  }

  // Figures that follow each other go together on what is left of the page, a little smaller if need be, else one by
  // one. What has no room waits for the next page; the text that follows fills this one. `i`: the first; on return the
  // last of them.
  void PlaceFigures(const std::vector<Block>& blocks, size_t* i) {
    std::vector<Row> rows;
    const bool pairs = InPairs(std::get<Figure>(blocks[*i]));
    size_t k = *i;
    for (; k < blocks.size(); ++k) {
      const auto* figure = std::get_if<Figure>(&blocks[k]);
      if (figure == nullptr || InPairs(*figure) != pairs) break;
      if (pairs && !rows.empty() && rows.back().right == nullptr) {
        rows.back().right = figure;
      } else {
        rows.push_back({figure});
      }
    }
    *i = k - 1;
    if (waiting_.empty()) {
      if (const auto shrink = ShrinkToFit(rows)) {
        for (const Row& row : rows) DrawRow(row, *shrink);
        return;
      }
    }
    waiting_.insert(waiting_.end(), rows.begin(), rows.end());
    PlaceWaiting();
    constexpr double kWorthFilling = 0.12;  // of a page
    if (!waiting_.empty() && End() - y_ < kWorthFilling * End()) Turn();
  }

  // In their order, as far as there is room.
  void PlaceWaiting() {
    while (!waiting_.empty()) {
      const Row row = waiting_.front();
      auto shrink = ShrinkToFit({row});
      // On a page of its own anything is drawn.
      if (!shrink && y_ <= kMargin) shrink = std::min(1.0, (End() - y_ - RowCaption(row)) / RowPicture(row));
      if (!shrink) return;
      waiting_.erase(waiting_.begin());
      DrawRow(row, std::max(*shrink, 0.1));
    }
  }

  // A heading stays with what is below it. A sentence stays with the pictures in pairs that it is about, where that
  // leaves no more than a quarter of the page empty.
  void KeepWithNext(const std::vector<Block>& blocks, size_t i) {
    constexpr double kMostEmpty = 0.25;
    if (i + 1 >= blocks.size()) return;
    const bool heading = std::holds_alternative<Heading>(blocks[i]);
    if (heading && !std::holds_alternative<Paragraph>(blocks[i + 1])) Need(LeastBelow(blocks, i + 1));
    const size_t sentence = heading ? i + 1 : i;
    if (sentence + 1 >= blocks.size() || !IsPair(blocks[sentence + 1]) || End() - y_ > kMostEmpty * End()) return;
    if (std::holds_alternative<Paragraph>(blocks[sentence])) Need(LeastBelow(blocks, sentence));
  }

  // A heading and the least of a figure, table or section that follows it; nothing for other blocks.
  double LeastBelow(const std::vector<Block>& blocks, size_t i) const {
    constexpr double kHeading = 60, kSection = 130;
    if (i >= blocks.size()) return 0;
    const Block& next = blocks[i];
    if (const auto* text = std::get_if<Paragraph>(&next)) {
      return painter_->Height(text->text, kTextPt, false, Room()) + 5 + LeastBelow(blocks, i + 1);
    }
    if (std::holds_alternative<Heading>(next)) return kHeading + kSection;
    if (const auto* table = std::get_if<Table>(&next)) {
      constexpr double kRow = 12, kSomeRows = 80;
      const double rows = std::min(kSomeRows, kRow * static_cast<double>(table->rows.size() + 2));
      return kHeading + painter_->Height(table->caption, 8, false, Room()) + rows;
    }
    const auto* figure = std::get_if<Figure>(&next);
    if (figure == nullptr) return 0;
    if (!InPairs(*figure)) return kHeading + SizeOf(*figure, kLeastShrink).second + CaptionRoom(*figure);
    return kHeading + HalfHeight(*figure) + painter_->Height(figure->caption, 7.5, false, HalfWidth()) + 14;
  }
  static bool InPairs(const Figure& figure) { return figure.thumbnail || figure.half; }
  static bool IsPair(const Block& block) {
    const auto* figure = std::get_if<Figure>(&block);
    return figure != nullptr && InPairs(*figure);
  }
  static constexpr double kHalfGap = 12;
  double HalfWidth() const { return 0.5 * (Room() - kHalfGap); }
  double HalfHeight(const Figure& figure) const {
    if (const auto* drawing = std::get_if<Drawing>(&figure.content))
      return HalfWidth() * drawing->height / drawing->width;
    const Picture& picture = std::get<Picture>(figure.content);
    return HalfWidth() * picture.height / std::max(1, picture.width);
  }

  // Folds that aren't for paper and follow each other: what they hold is named. `i`: the first one's beginning; on
  // return the last one's end.
  void LeaveOut(const std::vector<Block>& blocks, size_t* i) {
    const auto left_out = [&](size_t k) {
      const auto* fold = k < blocks.size() ? std::get_if<FoldBegin>(&blocks[k]) : nullptr;
      return fold != nullptr && !fold->on_paper ? fold : nullptr;
    };
    std::string text;
    while (const FoldBegin* fold = left_out(*i)) {
      text += (text.empty() ? "" : "; ") + fold->title;
      while (*i < blocks.size() && !std::holds_alternative<FoldEnd>(blocks[*i])) ++*i;
      ++*i;
    }
    --*i;
    Words("In index.html (tables also in tables/, as CSV): " + text + ".", 8, false, kSoft, 6);
  }

  static constexpr const char* kInk = "#1d2329";
  static constexpr const char* kSoft = "#5a6570";
  static constexpr const char* kBad = "#a8420a";
  static constexpr const char* kWarn = "#8a5a00";
  static constexpr const char* kGoodInk = "#00694d";

  static constexpr double kBoldWider = 1.12;

  // A column's width in ems: so that no word is broken (long ones are), and so that no line is.
  struct Ems {
    static constexpr double kLongestWord = 17, kLongestLine = 150;
    double least = 1, all = 1;
    void Add(const std::string& text, double wider) {
      constexpr double kAir = 0.25;  // letters are set on whole fractions of a point
      double line = kAir, word = kAir;
      for (const char c : text) {
        const double letter = wider * WidthOf(c);
        line += letter;
        word = c == ' ' ? kAir : word + letter;
        least = std::max(least, std::min(kLongestWord, word));
        if (line > kLongestLine) break;
      }
      all = std::max(all, std::min(kLongestLine, line));
    }
    // Of the pages' sans-serif letters, a little on the safe side.
    static double WidthOf(char c) {
      if (std::string_view(" .,:;'|!()[]/ijlIftr-").find(c) != std::string_view::npos) return 0.42;
      if (std::string_view("mwMW%@").find(c) != std::string_view::npos) return 0.98;
      if ((c >= 'A' && c <= 'Z') || (static_cast<unsigned char>(c) & 0xC0U) == 0xC0U) return 0.73;
      return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U ? 0 : 0.68;
    }
  };

  // So wide that no cell has more lines than it must have for the table to fit, and no wider than whole lines.
  std::vector<double> WidthsOf(const Table& table, const std::vector<size_t>& part, const std::vector<Ems>& wide,
                               double size, double gap) const {
    constexpr double kRagged = 1.15;  // lines that end between words are not full
    constexpr int kMostLines = 12;
    const double room = Room() - gap * static_cast<double>(part.size());
    const auto need = [&](size_t k, int lines) {
      if (table.columns[k].number || lines == 1) return lines == 1 ? wide[k].all : wide[k].least;
      return std::max(wide[k].least, std::min(wide[k].all, kRagged * wide[k].all / lines));
    };
    const auto sum = [&](int lines) {
      double all = 0;
      for (size_t k : part) all += need(k, lines) * size;
      return all;
    };
    int lines = 1;
    while (lines < kMostLines && sum(lines) > room) ++lines;
    const double least = sum(lines), all = sum(1);
    const double squeeze = std::min(1.0, room / least);
    const double share = all > least ? std::clamp((room - least) / (all - least), 0.0, 1.0) : 0;
    std::vector<double> widths(wide.size());
    for (size_t k : part) widths[k] = (squeeze * need(k, lines) + share * (need(k, 1) - need(k, lines))) * size;
    return widths;
  }

  double Room() const { return width_ - 2 * kMargin; }

  void CheckWritten() const {
    const cairo_status_t status = cairo_surface_status(surface_.get());
    if (status != CAIRO_STATUS_SUCCESS) {
      throw IoError(file_ + ": cannot be written: " + cairo_status_to_string(status) + "; is the disk full?");
    }
  }

  double End() const { return height_ - kMargin - 6; }

  void Foot() {
    ++page_;
    filled_.push_back((y_ - kMargin) / (End() - kMargin));
    painter_->Draw(document_.title, kMargin, height_ - kFoot, 7.5, false, kSoft, Room() - 60, -1, 1);
    painter_->Draw(std::to_string(page_), width_ - kMargin - 60, height_ - kFoot, 7.5, false, kSoft, 60, 1, 1);
  }
  void Turn() {
    Foot();
    cairo_show_page(cairo_.get());
    y_ = kMargin;
    PlaceWaiting();
  }
  void Need(double height) {
    while (y_ + height > End() && y_ > kMargin) Turn();
  }

  void Words(const std::string& text, double size, bool bold, const char* colour, double after, const char* tag = "P") {
    const double h = painter_->Height(text, size, bold, Room());
    Need(std::min(h, 200.0));
    const Tagged tagged(cairo_.get(), tag);
    painter_->Draw(text, kMargin, y_, size, bold, colour, Room(), -1, 0);
    y_ += h + after;
  }

  double FactHeight(const Fact& f, double w) const {
    return 12 + painter_->Height(f.label, 7.5, false, w - 14) + painter_->Height(f.value, 13, true, w - 14) +
           painter_->Height(f.detail, 7.5, false, w - 14);
  }
  void DrawFact(const Fact& f, double x, double w, double h) {
    SetColour(cairo_.get(), "#f5f7f9", 1);
    cairo_rectangle(cairo_.get(), x, y_, w, h);
    cairo_fill(cairo_.get());
    SetColour(cairo_.get(),
              f.tone == Tone::kGood      ? "#009e73"
              : f.tone == Tone::kWarning ? "#e69f00"
              : f.tone == Tone::kBad     ? "#d55e00"
                                         : "#d9dee3",
              1);
    cairo_rectangle(cairo_.get(), x, y_, 2.5, h);
    cairo_fill(cairo_.get());
    double y = y_ + 5;
    const auto line = [&](const std::string& text, double size, bool bold, const char* colour) {
      painter_->Draw(text, x + 8, y, size, bold, colour, w - 14, -1, 0);
      y += painter_->Height(text, size, bold, w - 14);
    };
    line(f.label, 7.5, false, kSoft);
    line(f.value, 13, true, kInk);
    line(f.detail, 7.5, false, kSoft);
  }

  // At y_, `w` wide.
  void DrawContent(const Figure& figure, double x, double w) {
    const Tagged tag(cairo_.get(), "Figure");
    const auto* drawing = std::get_if<Drawing>(&figure.content);
    if (drawing == nullptr) {
      DrawPicture(std::get<Picture>(figure.content), x, w);
      return;
    }
    cairo_save(cairo_.get());
    cairo_translate(cairo_.get(), x, y_);
    cairo_scale(cairo_.get(), w / drawing->width, w / drawing->width);
    Paint(cairo_.get(), *drawing);
    cairo_restore(cairo_.get());
  }

  void DrawPicture(const Picture& picture, double x, double w) {
    cairo_save(cairo_.get());
    cairo_translate(cairo_.get(), x, y_);
    const double scale = w / std::max(1, picture.width);
    cairo_scale(cairo_.get(), scale, scale);
    std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)> image(nullptr, cairo_surface_destroy);
    if (picture.jpeg) {
      // The file's own bytes go in; the pixels behind them are never looked at.
      image.reset(cairo_image_surface_create(CAIRO_FORMAT_A1, picture.width, picture.height));
      auto* bytes = new std::string(picture.bytes);
      cairo_surface_set_mime_data(
          image.get(), CAIRO_MIME_TYPE_JPEG, reinterpret_cast<const unsigned char*>(bytes->data()), bytes->size(),
          [](void* data) { delete static_cast<std::string*>(data); }, bytes);
    } else {
      image = DecodedSurface(picture.bytes);
    }
    if (image) {
      cairo_set_source_surface(cairo_.get(), image.get(), 0, 0);
      FillImage(cairo_.get(), image.get());
    }
    cairo_restore(cairo_.get());
  }

  static double Across(const std::vector<size_t>& part, const std::vector<double>& widths, double gap) {
    double across = 0;
    for (size_t k : part) across += widths[k] + gap;
    return across;
  }

  void Header(const Table& table, const std::vector<size_t>& part, const std::vector<double>& widths, double size,
              double gap) {
    double h = size * 1.6;
    for (size_t k : part) {
      h = std::max(h, painter_->Height(table.columns[k].name, size, true, widths[k]) + 0.3 * size);
    }
    SetColour(cairo_.get(), "#eef1f4", 1);
    cairo_rectangle(cairo_.get(), kMargin, y_, Across(part, widths, gap), h);
    cairo_fill(cairo_.get());
    const Tagged tag(cairo_.get(), "TR");
    double x = kMargin + 2;
    for (size_t k : part) {
      const Tagged cell(cairo_.get(), "TH");
      const double above = h - 0.15 * size - painter_->Height(table.columns[k].name, size, true, widths[k]);
      painter_->Draw(table.columns[k].name, x, y_ + above, size, true, kInk, widths[k],
                     table.columns[k].number ? 1 : -1, 0);
      x += widths[k] + gap;
    }
    y_ += h;
  }

  // A row that has no value in a further part of its table, which begins with the first column once more.
  static bool SaysNothing(const std::vector<TableCell>& row, const std::vector<size_t>& part) {
    return part.size() > 1 && part[1] > 1 &&
           std::all_of(part.begin() + 1, part.end(), [&](size_t k) { return k >= row.size() || row[k].text.empty(); });
  }

  void DrawRows(const Table& table, const std::vector<size_t>& part, const std::vector<double>& widths, double size,
                double gap) {
    Need(size * 1.6 * 3);
    cairo_tag_begin(cairo_.get(), "Table", nullptr);
    Header(table, part, widths, size, gap);
    for (const auto& row : table.rows) {
      if (SaysNothing(row, part)) continue;
      double h = size * 1.45;
      for (size_t k : part) {
        if (k < row.size() && TextWidth(row[k].text, size) > 0.8 * widths[k]) {
          h = std::max(h, painter_->Height(row[k].text, size, false, widths[k]) + 0.2 * size);
        }
      }
      if (y_ + h > End()) {
        cairo_tag_end(cairo_.get(), "Table");
        Turn();
        Need(3 * 1.6 * size + h);  // below figures that waited
        cairo_tag_begin(cairo_.get(), "Table", nullptr);
        Header(table, part, widths, size, gap);
      }
      const Tagged tag(cairo_.get(), "TR");
      double x = kMargin + 2;
      for (size_t k : part) {
        if (k < row.size()) {
          const Tagged cell(cairo_.get(), "TD");
          const Tone tone = row[k].tone;
          painter_->Draw(row[k].text.empty() ? "-" : row[k].text, x, y_ + 0.1 * size, size, false,
                         tone == Tone::kBad       ? kBad
                         : tone == Tone::kWarning ? kWarn
                         : tone == Tone::kGood    ? kGoodInk
                                                  : kInk,
                         widths[k], table.columns[k].number ? 1 : -1, 0);
        }
        x += widths[k] + gap;
      }
      y_ += h;
      SetColour(cairo_.get(), "#d9dee3", 1);
      cairo_set_line_width(cairo_.get(), 0.4);
      cairo_move_to(cairo_.get(), kMargin, y_);
      cairo_line_to(cairo_.get(), kMargin + Across(part, widths, gap), y_);
      cairo_stroke(cairo_.get());
    }
    cairo_tag_end(cairo_.get(), "Table");
    y_ += 6;
  }

  const Document& document_;
  std::string file_;
  double width_, height_;
  std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)> surface_{nullptr, cairo_surface_destroy};
  std::unique_ptr<cairo_t, void (*)(cairo_t*)> cairo_{nullptr, cairo_destroy};
  std::unique_ptr<TextPainter> painter_;
  double y_ = kMargin;
  std::vector<Row> waiting_;    // figures for the next page
  std::vector<double> filled_;  // share of each page
  int page_ = 0;
};

}  // namespace

std::vector<double> WritePdf(const Document& document, Paper paper, const std::string& file) {
  Pages pages(document, paper, file);
  pages.Write();
  return pages.filled();
}

}  // namespace trigpoint

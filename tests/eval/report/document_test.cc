#include "eval/report/document.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <regex>

#include "calib/base/error.h"
#include "eval/report/base64.h"
#include "eval/report/charts.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kEvil = "\"><script>alert(1)</script>&'\x01\xff\xc3";

Document Evil() {
  Document d;
  d.title = d.subtitle = d.footer = kEvil;
  d.date = "2026-05-12T09:43:20Z";
  d.blocks.push_back(Heading{2, kEvil, "one"});
  d.blocks.push_back(Paragraph{kEvil, Tone::kBad});
  d.blocks.push_back(Facts{{{kEvil, kEvil, kEvil, Tone::kGood}}});
  TableCell link{kEvil};
  link.link = kEvil;
  d.blocks.push_back(Table{"t", kEvil, {{kEvil}, {"n", true}}, {{{kEvil}, {"1.5", 1.5}}, {link, {"", std::nullopt}}}});
  d.blocks.push_back(FoldBegin{kEvil});
  d.blocks.push_back(Figure{"f", kEvil, DotChart({kEvil, "b"}, {{kEvil, {{0, 1.0}, {1, 20.0}}}}, kEvil)});
  d.blocks.push_back(FoldEnd{});
  return d;
}

TEST(Base64, AgreesWithRfc4648) {
  EXPECT_EQ(Base64(""), "");
  EXPECT_EQ(Base64("f"), "Zg==");
  EXPECT_EQ(Base64("fo"), "Zm8=");
  EXPECT_EQ(Base64("foo"), "Zm9v");
  EXPECT_EQ(Base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(Base64("\xff\xfe"), "//4=");
}

TEST(Html, NothingFromDataBecomesMarkup) {
  const std::string html = HtmlOf(Evil());
  // One script, ours; no other element, attribute or address comes from the data.
  EXPECT_THAT(html, Not(HasSubstr("<script>alert")));
  size_t scripts = 0;
  for (size_t at = html.find("<script"); at != std::string::npos; at = html.find("<script", at + 1)) ++scripts;
  EXPECT_EQ(scripts, 1u);
  EXPECT_THAT(html, HasSubstr("&lt;script&gt;alert(1)&lt;/script&gt;&amp;&#39;"));
  EXPECT_THAT(html, HasSubstr("script-src 'sha256-"));
  EXPECT_THAT(html, HasSubstr("default-src 'none'"));
  // No request leaves the page.
  EXPECT_FALSE(std::regex_search(html, std::regex("(src|href)=\"(https?:)?//")));
  EXPECT_EQ(html.find('\x01'), std::string::npos);
  EXPECT_EQ(html.find('\xff'), std::string::npos) << "broken UTF-8 is replaced";
}

TEST(Html, TheSameDocumentGivesTheSameBytes) { EXPECT_EQ(HtmlOf(Evil()), HtmlOf(Evil())); }

TEST(Text, CleansWhatIsNotUtf8) {
  EXPECT_EQ(CleanText("a\xc0\xaf"
                      "b"),
            "a\xEF\xBF\xBD\xEF\xBF\xBD"
            "b")
      << "overlong";
  EXPECT_EQ(CleanText("\xed\xa0\x80"), "\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBD") << "surrogate";
  EXPECT_EQ(CleanText("Grüße, 東京 🚗"), "Grüße, 東京 🚗");
  EXPECT_EQ(CleanText("a\nb\tc\x7f"), "a b c");
}

TEST(Markdown, TablesSurviveTheirCells) {
  Document d;
  d.title = "x";
  d.blocks.push_back(Table{"t", "", {{"a|b"}}, {{{"1|2\n3"}}}});
  EXPECT_THAT(MarkdownOf(d), HasSubstr("| a\\|b |\n|---|\n| 1\\|2 3 |\n"));
}

TEST(Csv, QuotesAndNamesItself) {
  const std::string csv =
      CsvOf(Table{"t", "two\nlines", {{"a"}, {"b", true}}, {{{"x,\"y\""}, {"1"}}, {{"short row"}}}});
  EXPECT_EQ(csv, "# trigpoint report table 1; two lines\na,b\n\"x,\"\"y\"\"\",1\nshort row,\n");
}

class PdfTest : public ::testing::Test {
 protected:
  TempDir dir_;
};

TEST_F(PdfTest, IsRepeatableInBothSizes) {
  Document d = Evil();
  // Wider and longer than a page, and a picture that cannot be decoded.
  Table wide{"w", "wide", {}, {}};
  for (int k = 0; k < 40; ++k) wide.columns.push_back({"column " + std::to_string(k), k > 0});
  for (int r = 0; r < 90; ++r) wide.rows.emplace_back(40, TableCell{"12345.678"});
  d.blocks.push_back(wide);
  d.blocks.push_back(Paragraph{std::string(4000, 'x')});
  d.blocks.push_back(
      Figure{"png", "a picture", Picture{PngOf(DotChart({"a"}, {{"b", {{0, 1.0}}}}, "c"), 1), false, 640, 480}});
  d.blocks.push_back(Figure{"broken", "a broken picture", Picture{"no picture", false, 100, 50}});
  Figure scene{"scene", "a scene", Picture{PngOf(DotChart({"a"}, {{"b", {{0, 1.0}}}}, "c"), 1), false, 400, 300}};
  d.blocks.push_back(scene);
  scene.thumbnail = true;
  d.blocks.insert(d.blocks.end(), 3, scene);
  WritePdf(d, Paper::kA4, (dir_ / "a.pdf").string());
  WritePdf(d, Paper::kA4, (dir_ / "b.pdf").string());
  WritePdf(d, Paper::kLetter, (dir_ / "c.pdf").string());
  const std::string a = dir_.Read("a.pdf");
  EXPECT_EQ(a, dir_.Read("b.pdf"));
  EXPECT_TRUE(a.starts_with("%PDF-"));
  EXPECT_THAT(a, HasSubstr("/MarkInfo << /Marked true >>"));
  // The last table of objects is where the end of the file says, and the catalogue where that table says.
  const size_t table = std::stoul(a.substr(a.rfind("startxref\n") + 10));
  EXPECT_EQ(a.substr(table, 5), "xref\n");
  const size_t entry = a.find('\n', table + 5) + 1;
  EXPECT_THAT(a.substr(std::stoul(a.substr(entry, 10)), 60), HasSubstr("obj\n<< /Type /Catalog"));
  EXPECT_THAT(a, HasSubstr("595.2"));
  EXPECT_THAT(dir_.Read("c.pdf"), HasSubstr("0 0 612 792"));
}

// Whatever the order of figures, text and tables: what does not fit goes on, and no page stays half empty.
// The air below the last table of a page may reach into the margin.
TEST_F(PdfTest, TextFillsWhatAFigureLeaves) {
  Drawing large = DotChart({"a"}, {{"b", {{0, 1.0}}}}, "c");
  for (const double tall : {300.0, 520.0, 760.0}) {
    Document d;
    d.title = "t";
    large.height = tall;
    Table table{"t", "a table", {{"a"}, {"b", true}}, {}};
    for (int r = 0; r < 14; ++r) table.rows.push_back({{"row"}, {"1.5", 1.5}});
    for (int k = 0; k < 24; ++k) {
      if (k % 6 == 0) d.blocks.push_back(Heading{2, "chapter", "c" + std::to_string(k)});
      for (int p = 0; p < k % 5; ++p) d.blocks.push_back(Paragraph{std::string(300 + 40 * k, 'x')});
      d.blocks.push_back(Figure{"f" + std::to_string(k), "a figure", large, false, k % 4 == 3});
      if (k % 3 == 0) d.blocks.push_back(table);
      d.blocks.push_back(Paragraph{"Some words."});
    }
    const std::vector<double> filled = WritePdf(d, Paper::kA4, (dir_ / "f.pdf").string());
    ASSERT_GT(filled.size(), 5u);
    for (size_t page = 0; page + 1 < filled.size(); ++page) {
      EXPECT_GT(filled[page], 0.7) << "page " << page + 1 << ", figures of " << tall;
      EXPECT_LE(filled[page], 1.02) << "page " << page + 1 << ", figures of " << tall;
    }
  }
}

TEST_F(PdfTest, AnAppendixComesLast) {
  Document d;
  d.title = "t";
  d.blocks = {Heading{2, "First", "first"},   AppendixBegin{"details", "details"},
              Paragraph{"All of it."},        AppendixEnd{},
              Heading{2, "Second", "second"}, Paragraph{"More."}};
  WritePdf(d, Paper::kA4, (dir_ / "p.pdf").string());
  const std::string pdf = dir_.Read("p.pdf");
  const size_t first = pdf.find("(First)"), second = pdf.find("(Second)"), details = pdf.find("(Appendix: details)");
  ASSERT_NE(details, std::string::npos);
  EXPECT_LT(first, second);
  EXPECT_LT(second, details);
  const std::string html = HtmlOf(d);
  EXPECT_LT(html.find("All of it."), html.find("id=\"second\""));
  EXPECT_THAT(html, Not(HasSubstr("Appendix: details")));
}

TEST_F(PdfTest, SaysWhereItCannotWrite) {
  try {
    WritePdf(Evil(), Paper::kA4, (dir_ / "no" / "such" / "a.pdf").string());
    FAIL();
  } catch (const IoError& e) {
    EXPECT_THAT(e.what(), HasSubstr("a.pdf: cannot be written"));
  }
}

TEST(Charts, AreDrawnFromNothingAndFromAnything) {
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  const std::vector<Drawing> drawings = {
      CumulativeChart({}, "x", "y"),
      CumulativeChart({{"a", {{0, 0.5, {}, {}}, {nan, 1, {}, {}}, {inf, 1, {}, {}}}}}, "x", "y"),
      CumulativeChart({{"a", {{0.3, 0.5, 0.2, 0.7}, {1.4, 1, 0.8, 1.0}}}}, "x", "y"),
      LineChart({}, "x", "y", true),
      DotChart({}, {}, "y"),
      DotChart({"a"}, {{"s", {{0, -1.0}, {0, nan}, {0, 3.0}}}}, "y"),
      HistogramChart({{"a", {}}}, 10, 1, "x"),
      HistogramChart({{"a", {-1, 0.5, 1e300, nan, inf}}}, 10, 1, "x"),
      BarChart({}, "s", 1),
      BarChart({{"a", 0.0}, {"b", 2.0}}, "s", 1)};
  for (const Drawing& drawing : drawings) {
    const std::string svg = SvgOf(drawing, "t");
    EXPECT_THAT(svg, Not(HasSubstr("nan")));
    EXPECT_THAT(svg, Not(HasSubstr("inf")));
    EXPECT_EQ(PngOf(drawing, 1).substr(1, 3), "PNG");
  }
}

TEST(Charts, ABarHasItsObjectsTheLargestValueFirst) {
  const Drawing few = HistogramChart({{"a", {0.1, 0.95, 7, 0.12}, {"p:1", "p:2", "p:3", "p:4"}}}, 10, 1, "x");
  ASSERT_EQ(few.groups.size(), 2u);
  EXPECT_THAT(few.groups[0].objects, testing::ElementsAre("p:4", "p:1"));
  EXPECT_THAT(few.groups[1].objects, testing::ElementsAre("p:3", "p:2"));
  EXPECT_EQ(few.spots.size(), 4u);
  Sample many{"a", {}, {}};
  for (int i = 0; i < 1000; ++i) many.values.push_back(1e-3 * i), many.objects.push_back("p:" + std::to_string(i));
  const Drawing crowded = HistogramChart({many}, 10, 1, "x");
  EXPECT_EQ(crowded.groups.size(), 10u);
  EXPECT_TRUE(crowded.spots.empty());
}

TEST(Drawings, AFileOfItsOwnHasANamespaceAndASize) {
  Drawing drawing;
  drawing.width = 300, drawing.height = 200;
  drawing.Text(10, 20, "a & b");
  const std::string svg = SvgFileOf(drawing, "t");
  EXPECT_THAT(svg, testing::StartsWith("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"300\" height=\"200\""));
  EXPECT_THAT(svg, HasSubstr("a &amp; b"));
  // In a page it has the page's namespace, and no address of another host.
  EXPECT_THAT(SvgOf(drawing, "t"), Not(HasSubstr("http")));
}

TEST(Drawings, NamesFindAPlaceOfEight) {
  LabelPlaces places({0, 0, 100, 100});
  const DrawnBox mark{45, 45, 10, 10};
  places.Take(mark);
  std::vector<DrawnBox> taken = {mark};
  for (int k = 0; k < 8; ++k) {
    const auto box = places.Place(mark, 10, 10);
    ASSERT_TRUE(box.has_value()) << k;
    for (const DrawnBox& other : taken) EXPECT_FALSE(box->Overlaps(other)) << k;
    taken.push_back(*box);
  }
  EXPECT_FALSE(places.Place(mark, 10, 10).has_value());
  // Not beyond the frame, and over a path only where nothing else is free.
  LabelPlaces corner({0, 0, 100, 100});
  EXPECT_EQ(corner.Place({90, 0, 10, 10}, 20, 10)->x, 68);
  LabelPlaces path({0, 0, 100, 100});
  path.AvoidLine({{60, 0}, {60, 100}});
  EXPECT_LT(path.Place(mark, 10, 10)->x, 45);
  LabelPlaces narrow({0, 40, 100, 20});
  narrow.AvoidLine({{0, 50}, {100, 50}});
  EXPECT_TRUE(narrow.Place(mark, 10, 10).has_value());
}

TEST(Charts, PutValuesWhereTheyBelong) {
  // One dot of 10 between ticks 1 and 100: half way up.
  const Drawing d = DotChart({"a"}, {{"s", {{0, 1.0}, {0, 10.0}, {0, 100.0}}}}, "y");
  std::vector<double> y;
  for (const Shape& s : d.shapes) {
    if (s.kind == Shape::Kind::kCircle && s.radius == 4) y.push_back(s.points[0].second);
  }
  ASSERT_EQ(y.size(), 3u);
  EXPECT_NEAR(y[1], 0.5 * (y[0] + y[2]), 1e-9);
  EXPECT_LT(y[2], y[0]);
}

}  // namespace
}  // namespace trigpoint

// Sheets as they are printed: the PDF is rendered at 150 dpi by pdftoppm, photographed with tilt, blur and noise, and
// what is detected must lie where the PDF has it.
#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <sstream>
#include <tuple>

#include "calib/estimation/random.h"
#include "calib/target/detect.h"
#include "datasets/io/tables.h"
#include "datasets/io/tags_file.h"
#include "datasets/io/text.h"
#include "eval/print/sheets.h"
#include "eval/print/text_fit.h"
#include "survey/tags/detection.h"
#include "survey/tags/tag_family.h"
#include "tests/support/program.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr double kDpi = 150, kMmPerInch = 25.4;
constexpr double kTolerance_mm = 0.05;

// Pages at `dpi`, each pixel the mean of `samples` x `samples` of the renderer's: at one sample it places edges in
// steps of a quarter of a pixel, 0.04 mm at 150 dpi.
std::vector<cv::Mat> Rendered(const fs::path& pdf, double dpi = kDpi, int samples = 2) {
  const fs::path prefix = pdf.string() + "_page";
  const std::string command =
      "pdftoppm -gray -r " + std::to_string(samples * dpi) + " '" + pdf.string() + "' '" + prefix.string() + "'";
  EXPECT_EQ(std::system(command.c_str()), 0) << command << " (package poppler-utils)";
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(pdf.parent_path())) {
    if (entry.path().string().starts_with(prefix.string())) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::vector<cv::Mat> pages;
  for (const fs::path& file : files) {
    cv::Mat page = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
    const int below = (samples - page.rows % samples) % samples, right = (samples - page.cols % samples) % samples;
    cv::copyMakeBorder(page, page, 0, below, 0, right, cv::BORDER_CONSTANT, 255);
    cv::resize(page, page, cv::Size(page.cols / samples, page.rows / samples), 0, 0, cv::INTER_AREA);
    pages.push_back(page);
    fs::remove(file);
  }
  return pages;
}

Eigen::Vector2d Mm(const Eigen::Vector2d& pixel, double dpi = kDpi) {
  return (pixel + Eigen::Vector2d(0.5, 0.5)) * kMmPerInch / dpi;
}

// A page photographed from the side: about 30 degrees of tilt, turned by `turn_deg`, out of focus, with noise.
struct Photo {
  cv::Mat grey;
  cv::Matx33d page_from_photo;
  double dpi = kDpi;
  Eigen::Vector2d PageMm(const Eigen::Vector2d& p) const {
    const cv::Vec3d q = page_from_photo * cv::Vec3d(p.x(), p.y(), 1);
    return Mm({q[0] / q[2], q[1] / q[2]}, dpi);
  }
};

Photo Photographed(const cv::Mat& page, double turn_deg, double blur_px) {
  const double w = page.cols, h = page.rows, tilt = 30 * M_PI / 180, turn = turn_deg * M_PI / 180;
  const double far = 2 * std::max(w, h), border = 30;
  std::vector<cv::Point2f> from, to;
  for (const auto& [x, y] : std::vector<std::pair<double, double>>{{0, 0}, {w, 0}, {w, h}, {0, h}}) {
    const double cx = x - w / 2, cy = y - h / 2;
    const double rx = std::cos(turn) * cx - std::sin(turn) * cy, ry = std::sin(turn) * cx + std::cos(turn) * cy;
    const double scale = 1.15 * far / (far + std::sin(tilt) * ry);
    from.emplace_back(x, y);
    to.emplace_back(scale * rx, scale * std::cos(tilt) * ry);
  }
  const cv::Rect2f box = cv::boundingRect(to);
  for (cv::Point2f& p : to) p -= box.tl() - cv::Point2f(border, border);
  Photo photo;
  const cv::Matx33d photo_from_page = cv::getPerspectiveTransform(from, to);
  photo.page_from_photo = photo_from_page.inv();
  const cv::Size size(static_cast<int>(box.width + 2 * border), static_cast<int>(box.height + 2 * border));
  cv::warpPerspective(page, photo.grey, photo_from_page, size, cv::INTER_CUBIC, cv::BORDER_CONSTANT, 128);
  cv::GaussianBlur(photo.grey, photo.grey, cv::Size(), blur_px);
  Random random(3);
  for (int v = 0; v < photo.grey.rows; ++v) {
    for (int u = 0; u < photo.grey.cols; ++u) {
      const double value = 25 + 0.8 * photo.grey.at<unsigned char>(v, u) + 1.5 * random.Normal();
      photo.grey.at<unsigned char>(v, u) = cv::saturate_cast<unsigned char>(std::lround(value));
    }
  }
  return photo;
}

std::vector<TagDetection> Detected(const cv::Mat& grey, const std::string& family) {
  DetectTagsOptions options;
  options.family = family;
  options.max_hamming = 0;
  ProgressSink silent;
  const DetectTagsResult found = DetectTags(
      1, [&](int64_t) { return grey; }, [](int64_t) -> const Camera* { return nullptr; }, options, 1, silent,
      CancelToken());
  return found.images.front().detections;
}

// Every tag of `page` is found in its photo, with its id, corners within the tolerance; returns the largest error.
double ExpectReadBack(const Photo& photo, const std::string& family, const PrintedSheets& sheets, int page) {
  std::map<std::string, std::array<Eigen::Vector2d, 4>> truth;
  for (const PrintedPoint& p : sheets.points) {
    if (p.page == page && p.object.starts_with("tag "))
      truth[p.object][static_cast<size_t>(p.index)] = {p.x_mm, p.y_mm};
  }
  double worst = 0;
  std::set<std::string> seen;
  for (const TagDetection& d : Detected(photo.grey, family)) {
    const std::string name = "tag " + std::to_string(d.id);
    const auto it = truth.find(name);
    EXPECT_NE(it, truth.end()) << family << ": " << name << " is not on page " << page;
    if (it == truth.end()) continue;
    EXPECT_TRUE(seen.insert(name).second) << name << " twice";
    EXPECT_TRUE(d.refined) << family << " " << name;
    for (size_t k = 0; k < 4; ++k) {
      const double error = (photo.PageMm(d.corners[k]) - it->second[k]).norm();
      EXPECT_LT(error, kTolerance_mm) << family << " " << name << " corner " << k;
      worst = std::max(worst, error);
    }
  }
  EXPECT_EQ(seen.size(), truth.size()) << family << " page " << page;
  return worst;
}

TEST(Print, TagsOfEveryFamilyAreReadBack) {
  const TempDir folder;
  for (const std::string& family : TagFamilyNames()) {
    const int last = TagFamily(family).size() - 1;
    std::vector<Artwork> artworks;
    for (const int id : {0, last / 2, last}) artworks.push_back(TagArtwork(family, id, 62));
    const PrintedSheets sheets = WriteSheets(artworks, {}, {}, folder / (family + ".pdf"));
    const std::vector<cv::Mat> pages = Rendered(folder / (family + ".pdf"));
    ASSERT_EQ(pages.size(), static_cast<size_t>(sheets.pages));
    double worst = 0;
    for (int page = 1; page <= sheets.pages; ++page) {
      worst = std::max(
          worst, ExpectReadBack(Photographed(pages[static_cast<size_t>(page) - 1], 20, 1.0), family, sheets, page));
    }
    RecordProperty(family + "_worst_um", static_cast<int>(1e3 * worst));
  }
}

// Read back with `blur_px`; the largest error of a corner, mm.
double ExpectAllReadBack(const std::vector<Artwork>& artworks, const std::string& family, const SheetOptions& options,
                         const fs::path& file, double turn_deg, double blur_px) {
  const PrintedSheets sheets = WriteSheets(artworks, {}, options, file);
  const std::vector<cv::Mat> pages = Rendered(file);
  EXPECT_EQ(sheets.tiles, 0) << file;
  EXPECT_EQ(pages.size(), static_cast<size_t>(sheets.pages)) << file;
  double worst = 0;
  for (int page = 1; page <= sheets.pages; ++page) {
    const Photo photo = Photographed(pages[static_cast<size_t>(page) - 1], turn_deg, blur_px);
    worst = std::max(worst, ExpectReadBack(photo, family, sheets, page));
  }
  return worst;
}

TEST(Print, TagsAreReadBackFromEveryPaper) {
  const TempDir folder;
  for (const auto& [paper, size_mm] : std::vector<std::pair<std::string, double>>{
           {"A3", 200}, {"A4", 160}, {"A5", 90}, {"A6", 65}, {"Letter", 160}, {"130x240", 75}, {"62x100", 30}}) {
    SheetOptions options;
    options.paper = PaperNamed(paper);
    const double worst = ExpectAllReadBack({TagArtwork("tag36h11", 377, size_mm)}, "tag36h11", options,
                                           folder / (paper + ".pdf"), 35, 1.0);
    RecordProperty(paper + "_worst_um", static_cast<int>(1e3 * worst));
  }
}

TEST(Print, SmallTagsOfSeveralFamiliesAreReadBack) {
  const TempDir folder;
  for (const auto& [family, size_mm] : std::vector<std::pair<std::string, double>>{
           {"tag36h11", 8}, {"tag36h11", 20}, {"tag25h9", 10}, {"tag16h5", 10}, {"tagStandard41h12", 8}}) {
    std::vector<Artwork> artworks;
    for (int id = 0; id < 30; ++id) artworks.push_back(TagArtwork(family, id, size_mm));
    const double worst = ExpectAllReadBack(artworks, family, {}, folder / "small.pdf", 15, 0.7);
    RecordProperty(family + "_worst_um", static_cast<int>(1e3 * worst));
  }
}

TEST(Print, ManySmallTagsShareASheet) {
  const TempDir folder;
  std::vector<Artwork> artworks;
  for (int id = 0; id < 36; ++id) artworks.push_back(TagArtwork("tag36h11", id, 30));
  SheetOptions options;
  options.paper = PaperNamed("letter");
  const PrintedSheets sheets = WriteSheets(artworks, {}, options, folder / "small.pdf");
  ASSERT_EQ(sheets.pages, 2);
  EXPECT_GE(sheets.per_sheet, 18);
  const std::vector<cv::Mat> pages = Rendered(folder / "small.pdf");
  for (int page = 1; page <= 2; ++page) {
    ExpectReadBack(Photographed(pages[static_cast<size_t>(page) - 1], -65, 0.8), "tag36h11", sheets, page);
  }
}

TEST(Print, QuietZoneStaysWhite) {
  const TempDir folder;
  for (const std::string& family : TagFamilyNames()) {
    const PrintedSheets sheets = WriteSheets({TagArtwork(family, 1, 50)}, {}, {}, folder / (family + ".pdf"));
    const cv::Mat page = Rendered(folder / (family + ".pdf")).front();
    const TagPattern pattern = TagFamily(family).Pattern(1);
    const double cell = 50.0 / pattern.width;
    Eigen::Vector2d corner(1e9, 1e9);  // upper left of the measured square
    for (const PrintedPoint& p : sheets.points) {
      if (p.object == "tag 1" && p.index == 3) corner = {p.x_mm, p.y_mm};
    }
    // One cell around the ink; the ink is the whole pattern but for a border that is white in all tags of the family.
    const bool border = pattern.width == pattern.total - 2 && pattern.margin == 1;
    const int ink = border ? pattern.width : pattern.total;
    const Eigen::Vector2d low = corner - (border ? 0 : pattern.margin) * cell * Eigen::Vector2d::Ones();
    const auto pixel = [&](double mm) { return static_cast<int>(std::lround(mm * kDpi / kMmPerInch - 0.5)); };
    int grey = 0;
    for (double along = -cell + 0.4; along < (ink + 1) * cell - 0.4; along += 0.15) {
      for (const double across :
           {-0.9 * cell, -0.5 * cell, -0.4, ink * cell + 0.4, (ink + 0.5) * cell, (ink + 0.9) * cell}) {
        grey += page.at<unsigned char>(pixel(low.y() + across), pixel(low.x() + along)) < 250;
        grey += page.at<unsigned char>(pixel(low.y() + along), pixel(low.x() + across)) < 250;
      }
    }
    EXPECT_EQ(grey, 0) << family;
  }
}

// Put together as by hand: each sheet gives what lies between its crop marks, `trim` mm apart and `cut` mm from the
// edge of the paper.
cv::Mat Joined(const std::vector<cv::Mat>& pages, int cols, int rows, const Eigen::Vector2d& trim, double cut,
               double dpi = kDpi) {
  const double px = dpi / kMmPerInch;
  cv::Mat whole(static_cast<int>(rows * trim.y() * px), static_cast<int>(cols * trim.x() * px), CV_8U, 255);
  for (int t = 0; t < cols * rows; ++t) {
    const double dx = (t % cols * trim.x() - cut) * px, dy = (t / cols * trim.y() - cut) * px;
    cv::Mat moved;
    cv::warpAffine(pages[static_cast<size_t>(t) + 1], moved, cv::Matx23d(1, 0, dx, 0, 1, dy), whole.size(),
                   cv::INTER_CUBIC);
    const cv::Rect part(static_cast<int>(t % cols * trim.x() * px), static_cast<int>(t / cols * trim.y() * px),
                        static_cast<int>(trim.x() * px) + 1, static_cast<int>(trim.y() * px) + 1);
    const cv::Rect inside = part & cv::Rect(0, 0, whole.cols, whole.rows);
    moved(inside).copyTo(whole(inside));
  }
  return whole;
}

// A word as it stands in the PDF, mm from the upper left corner of its page.
struct Word {
  int page = 0;
  double page_width = 0, page_height = 0;
  double x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  std::string text;
};

std::vector<Word> WordsOf(const fs::path& pdf) {
  const fs::path file = pdf.string() + ".html";
  const std::string command = "pdftotext -bbox '" + pdf.string() + "' '" + file.string() + "'";
  EXPECT_EQ(std::system(command.c_str()), 0) << command << " (package poppler-utils)";
  std::istringstream lines(ReadTextFile(file));
  const double mm = kMmPerInch / 72;
  std::vector<Word> words;
  Word word;
  for (std::string line; std::getline(lines, line);) {
    if (std::sscanf(line.c_str(), " <page width=\"%lf\" height=\"%lf\"", &word.page_width, &word.page_height) == 2) {
      ++word.page, word.page_width *= mm, word.page_height *= mm;
    }
    if (std::sscanf(line.c_str(), " <word xMin=\"%lf\" yMin=\"%lf\" xMax=\"%lf\" yMax=\"%lf\"", &word.x0, &word.y0,
                    &word.x1, &word.y1) == 4) {
      word.x0 *= mm, word.y0 *= mm, word.x1 *= mm, word.y1 *= mm;
      const size_t begin = line.find('>') + 1;
      word.text = line.substr(begin, line.find('<', begin) - begin);
      words.push_back(word);
    }
  }
  return words;
}

TEST(Print, ALargeTagIsOneAgainWhenItsSheetsAreCutAndJoined) {
  const TempDir folder;
  const double cut = 16;  // a margin of 8 and 8 for crop marks
  for (const auto& [paper, size, dpi] : std::vector<std::tuple<std::string, double, double>>{
           {"A4", 400, kDpi}, {"A3", 600, kDpi / 2}, {"A6", 150, kDpi}}) {
    const Artwork artwork = TagArtwork("tag36h11", 7, size);
    SheetOptions options;
    options.paper = PaperNamed(paper);
    const PrintedSheets sheets = WriteSheets({artwork}, {}, options, folder / "large.pdf");
    const std::vector<cv::Mat> pages = Rendered(folder / "large.pdf", dpi);
    // Upright or lying paper, whichever takes fewer sheets.
    Eigen::Vector2d trim;
    int cols = 0, rows = 0;
    for (const bool landscape : {false, true}) {
      Eigen::Vector2d t(options.paper.width_mm - 2 * cut, options.paper.height_mm - 2 * cut);
      if (landscape) t.reverseInPlace();
      const int c = static_cast<int>(std::ceil(artwork.width_mm / t.x()));
      const int r = static_cast<int>(std::ceil(artwork.height_mm / t.y()));
      if (cols == 0 || c * r < cols * rows) trim = t, cols = c, rows = r;
    }
    ASSERT_EQ(sheets.tiles, cols * rows) << paper << " " << size;
    ASSERT_EQ(static_cast<int>(pages.size()), 1 + sheets.tiles);
    EXPECT_EQ(sheets.measure_mm, size);
    // The first page names the piece and each of its sheets.
    std::string first;
    for (const Word& word : WordsOf(folder / "large.pdf")) first += word.page == 1 ? word.text + " " : "";
    EXPECT_THAT(first, HasSubstr("tag 7 "));
    for (int t = 0; t < cols * rows; ++t) {
      EXPECT_THAT(first, HasSubstr(std::to_string(t / cols + 1) + ", " + std::to_string(t % cols + 1) + " "));
    }
    Photo photo = Photographed(Joined(pages, cols, rows, trim, cut, dpi), 25, 1);
    photo.dpi = dpi;
    const std::vector<TagDetection> found = Detected(photo.grey, "tag36h11");
    ASSERT_EQ(found.size(), 1U) << paper << " " << size;
    EXPECT_EQ(found[0].id, 7);
    for (size_t k = 0; k < 4; ++k) {
      const Eigen::Vector2d truth(artwork.points[k].x_mm, artwork.points[k].y_mm);
      EXPECT_LT((photo.PageMm(found[0].corners[k]) - truth).norm(), kTolerance_mm) << paper << " " << size;
      const PrintedPoint* printed = nullptr;
      for (const PrintedPoint& p : sheets.points) {
        if (p.object == "tag 7" && p.index == static_cast<int>(k)) printed = &p;
      }
      ASSERT_NE(printed, nullptr);
      const int t = printed->page - 2;
      EXPECT_NEAR(printed->x_mm - cut + t % cols * trim.x(), truth.x(), 1e-9);
      EXPECT_NEAR(printed->y_mm - cut + t / cols * trim.y(), truth.y(), 1e-9);
    }
  }
}

// A scale bar and a board that are larger than the paper.
TEST(Print, AScaleBarIsOneAgainWhenItsSheetsAreJoined) {
  const TempDir folder;
  const Artwork artwork = ScaleBarArtwork("tag36h11", 30, 31, 60, 500);
  const PrintedSheets sheets = WriteSheets({artwork}, {}, {}, folder / "bar.pdf");
  const double cut = 16;
  const Eigen::Vector2d trim(297 - 2 * cut, 210 - 2 * cut);
  ASSERT_EQ(sheets.tiles, 3);  // one row of landscape sheets
  const Photo photo = Photographed(Joined(Rendered(folder / "bar.pdf"), 3, 1, trim, cut), -10, 0.8);
  const std::vector<TagDetection> found = Detected(photo.grey, "tag36h11");
  ASSERT_EQ(found.size(), 2U);
  for (const TagDetection& d : found) {
    for (size_t k = 0; k < 4; ++k) {
      const ArtworkPoint& p = artwork.points[(d.id == 30 ? 0 : 4) + k];
      EXPECT_LT((photo.PageMm(d.corners[k]) - Eigen::Vector2d(p.x_mm, p.y_mm)).norm(), kTolerance_mm) << d.id;
    }
  }
}

TEST(Print, BoardsAreReadBack) {
  const TempDir folder;
  Target checkerboard{TargetKind::kCheckerboard, 8, 6, 0.019, 0.019};
  Target charuco{TargetKind::kCharuco, 8, 6, 0.021, 0.021, 0.0125};
  Target grid{TargetKind::kAprilGrid, 5, 4, 0.026, 0.026, 0, 0.3};
  Target circles{TargetKind::kAsymmetricCircles, 4, 9, 0.018, 0.018};
  Target large_checkerboard{TargetKind::kCheckerboard, 9, 6, 0.025, 0.025};
  Target large_charuco{TargetKind::kCharuco, 8, 6, 0.03, 0.03, 0.022};
  Target large_grid{TargetKind::kAprilGrid, 6, 6, 0.03, 0.03, 0, 0.3};
  Target small_checkerboard{TargetKind::kCheckerboard, 6, 4, 0.014, 0.014};
  Target small_grid{TargetKind::kAprilGrid, 3, 3, 0.02, 0.02, 0, 0.3};
  const std::vector<std::pair<Target, std::string>> boards = {
      {checkerboard, "A4"},  {charuco, "A4"},     {grid, "A4"},
      {circles, "A4"},       {charuco, "Letter"}, {large_checkerboard, "A3"},
      {large_charuco, "A3"}, {large_grid, "A3"},  {small_checkerboard, "A5"},
      {small_grid, "A6"},    {grid, "220x250"}};
  for (const auto& [target, paper] : boards) {
    const std::string name = std::string(TargetKindName(target.kind)) + "_" + paper;
    SheetOptions options;
    options.paper = PaperNamed(paper);
    const PrintedSheets sheets = WriteSheets({BoardArtwork(target)}, {}, options, folder / (name + ".pdf"));
    ASSERT_EQ(sheets.pages, 1) << name;
    const Photo photo = Photographed(Rendered(folder / (name + ".pdf")).front(), 10, 0.8);
    ProgressSink silent;
    const std::vector<BoardView> views = DetectBoards(
        1, [&](int64_t) { return photo.grey; }, target, 1, silent, CancelToken());
    ASSERT_TRUE(views[0].usable) << name << ": " << views[0].problem;
    EXPECT_EQ(views[0].points.size(), target.BoardPoints().size()) << name;
    // The middle of a tilted circle's picture is not the picture of its middle.
    const double tolerance = target.kind == TargetKind::kAsymmetricCircles ? 0.25 : kTolerance_mm;
    std::map<int, Eigen::Vector2d> truth;
    for (const PrintedPoint& p : sheets.points) {
      if (p.object == "board") truth[p.index] = {p.x_mm, p.y_mm};
    }
    // A board that looks the same when turned by half may be counted from its end.
    double direct = 0, turned = 0, worst_direct = 0, worst_turned = 0;
    const int last = static_cast<int>(truth.size()) - 1;
    for (const BoardPoint& p : views[0].points) {
      const double a = (photo.PageMm(p.pixel) - truth[p.id]).norm(),
                   b = (photo.PageMm(p.pixel) - truth[last - p.id]).norm();
      direct += a * a, turned += b * b;
      worst_direct = std::max(worst_direct, a), worst_turned = std::max(worst_turned, b);
    }
    const bool is_turned = target.LooksTheSameTurned() && turned < direct;
    const double rms = std::sqrt((is_turned ? turned : direct) / static_cast<double>(truth.size()));
    RecordProperty(name + "_rms_um", static_cast<int>(1e3 * rms));
    EXPECT_LT(rms, tolerance) << name;
    const double worst = is_turned ? worst_turned : worst_direct;
    RecordProperty(name + "_worst_um", static_cast<int>(1e3 * worst));
    EXPECT_LT(worst, tolerance) << name;
  }
}

TEST(Print, AScaleBarHasItsLength) {
  const TempDir folder;
  SheetOptions options;
  options.paper = PaperNamed("A3");
  const PrintedSheets sheets =
      WriteSheets({ScaleBarArtwork("tag25h9", 3, 4, 60, 300)}, {}, options, folder / "bar.pdf");
  ASSERT_EQ(sheets.pages, 1);
  const Photo photo = Photographed(Rendered(folder / "bar.pdf").front(), 0, 0.8);
  ExpectReadBack(photo, "tag25h9", sheets, 1);
  std::map<int, Eigen::Vector2d> centre;
  for (const TagDetection& d : Detected(photo.grey, "tag25h9")) {
    centre[d.id].setZero();
    for (const Eigen::Vector2d& corner : d.corners) centre[d.id] += 0.25 * photo.PageMm(corner);
  }
  EXPECT_NEAR((centre[4] - centre[3]).norm(), 300, kTolerance_mm);
  EXPECT_THROW(ScaleBarArtwork("tag36h11", 3, 4, 60, 70), OptionError);
}

// Where the strokes at the ends of a measuring bar are in the picture: middle of the dark pixels around a point.
double StrokeAt(const cv::Mat& page, double dpi, double x_mm, double y_mm, bool across) {
  double sum = 0, weight = 0;
  for (double d = -1; d <= 1; d += 0.5 * kMmPerInch / dpi) {
    const double x = (across ? x_mm + d : x_mm) * dpi / kMmPerInch - 0.5;
    const double y = (across ? y_mm : y_mm + d) * dpi / kMmPerInch - 0.5;
    const double dark =
        255 - page.at<unsigned char>(static_cast<int>(std::lround(y)), static_cast<int>(std::lround(x)));
    const double at = (across ? std::lround(x) : std::lround(y)) + 0.5;
    sum += dark * at * kMmPerInch / dpi;
    weight += dark;
  }
  EXPECT_GT(weight, 0) << "no stroke at " << x_mm << ", " << y_mm;
  return sum / weight;
}

TEST(Print, MeasuringBarsHaveTheirLength) {
  const TempDir folder;
  for (const char* paper : {"A3", "A4", "A5", "A6", "Letter"}) {
    SheetOptions options;
    options.paper = PaperNamed(paper);
    const PrintedSheets sheets = WriteSheets({TagArtwork("tag36h11", 0, 40)}, {}, options, folder / "bars.pdf");
    const double dpi = 600;
    const cv::Mat page = Rendered(folder / "bars.pdf", dpi, 1).front();
    std::map<std::string, std::array<double, 2>> ends;
    for (const PrintedPoint& p : sheets.points) {
      const bool across = p.object == "bar across";
      if (!across && p.object != "bar up") continue;
      // Beside the bar itself, where only the strokes at its ends reach.
      const double x = across ? p.x_mm : p.x_mm + 1.5, y = across ? p.y_mm + 1.5 : p.y_mm;
      ends[p.object][static_cast<size_t>(p.index)] = StrokeAt(page, dpi, x, y, across);
    }
    ASSERT_EQ(ends.size(), 2U) << paper;
    for (const auto& [bar, end] : ends)
      EXPECT_NEAR(std::abs(end[1] - end[0]), sheets.bar_mm, kTolerance_mm) << paper << " " << bar;
    EXPECT_GE(sheets.bar_mm, 50) << paper;
    // As long as the shorter side permits, up to a centimetre and the strip with the text.
    const double side = std::min(options.paper.width_mm, options.paper.height_mm);
    EXPECT_GT(sheets.bar_mm, side - 2 * options.margin_mm - 32) << paper;
    EXPECT_EQ(std::fmod(sheets.bar_mm, 10), 0) << paper;
  }
}

// Do two intervals share more than what font boxes have in excess of their letters?
bool Overlap(double a0, double a1, double b0, double b1) {
  constexpr double kExcess_mm = 0.15;
  return std::min(a1, b1) - std::max(a0, b0) > kExcess_mm;
}

// All words lie where a printer can print, none on another or on a tag with its quiet zone of a cell.
void ExpectTextFits(const fs::path& pdf, const PrintedSheets& sheets, double margin_mm, double quiet_mm,
                    const std::string& of) {
  const std::vector<Word> words = WordsOf(pdf);
  EXPECT_GT(words.size(), 10U) << of;
  for (size_t i = 0; i < words.size(); ++i) {
    const Word& a = words[i];
    const std::string where = of + ", page " + std::to_string(a.page) + ": '" + a.text + "'";
    const double m = margin_mm - 0.15;
    EXPECT_TRUE(a.x0 > m && a.y0 > m && a.x1 < a.page_width - m && a.y1 < a.page_height - m)
        << where << " " << a.x0 << " to " << a.x1 << ", " << a.y0 << " to " << a.y1 << " of " << a.page_width << " x "
        << a.page_height;
    for (size_t k = i + 1; k < words.size() && words[k].page == a.page; ++k) {
      const Word& b = words[k];
      EXPECT_FALSE(Overlap(a.x0, a.x1, b.x0, b.x1) && Overlap(a.y0, a.y1, b.y0, b.y1)) << where << " on " << b.text;
    }
    std::map<std::string, std::array<Eigen::Vector2d, 2>> tags;  // upper left, lower right
    for (const PrintedPoint& p : sheets.points) {
      if (p.page != a.page || !p.object.starts_with("tag ")) continue;
      if (p.index == 3) tags[p.object][0] = {p.x_mm - quiet_mm, p.y_mm - quiet_mm};
      if (p.index == 1) tags[p.object][1] = {p.x_mm + quiet_mm, p.y_mm + quiet_mm};
    }
    for (const auto& [name, box] : tags) {
      EXPECT_FALSE(Overlap(a.x0, a.x1, box[0].x(), box[1].x()) && Overlap(a.y0, a.y1, box[0].y(), box[1].y()))
          << where << " on " << name;
    }
  }
}

TEST(Print, TextFitsOnEveryPaper) {
  const TempDir folder;
  const std::string family = "tag36h11";
  for (const char* paper : {"A3", "A4", "A5", "A6", "Letter", "62x100", "100x62"}) {
    for (const double size : {5.0, 8.0, 20.0, 27.0, 65.0, 160.0}) {
      const std::string of = std::string(paper) + " " + std::to_string(size) + " mm";
      std::vector<Artwork> artworks;
      std::vector<PlaceRow> places;
      for (const int id : {0, 377, 378, 586}) {
        artworks.push_back(TagArtwork(family, id, size));
        places.push_back({std::to_string(id), family, "160"});
      }
      SheetOptions options;
      options.paper = PaperNamed(paper);
      options.title = "tags_of_the_northern_gate_with_a_name_that_is_far_too_long_for_a_small_sheet_of_paper";
      if (size > 30 && std::min(options.paper.width_mm, options.paper.height_mm) < 100) continue;  // is cut or refused
      const PrintedSheets sheets = WriteSheets(artworks, places, options, folder / "text.pdf");
      if (sheets.tiles == 0) ExpectTextFits(folder / "text.pdf", sheets, options.margin_mm, size / 8, of);
    }
  }
}

TEST(Print, TextOfCutPiecesFits) {
  const TempDir folder;
  Target board{TargetKind::kCharuco, 8, 6, 0.03, 0.03, 0.022};
  for (const char* paper : {"A4", "A5", "A6", "90x130"}) {
    for (const Artwork& artwork : {TagArtwork("tag36h11", 377, 250), BoardArtwork(board)}) {
      SheetOptions options;
      options.paper = PaperNamed(paper);
      options.title = "cut";
      const PrintedSheets sheets = WriteSheets({artwork}, {}, options, folder / "text.pdf");
      ASSERT_GT(sheets.tiles, 0) << paper;
      constexpr double w = 0.15;  // font boxes are larger than letters
      for (const Word& word : WordsOf(folder / "text.pdf")) {
        const bool caption = word.y0 > word.page_height - options.margin_mm - 8;
        if (word.page > 1 && !caption) continue;  // text of the piece, that may be cut
        EXPECT_TRUE(word.x0 > options.margin_mm - w && word.x1 < word.page_width - options.margin_mm + w)
            << paper << " page " << word.page << ": " << word.text << " " << word.x0 << " to " << word.x1;
        EXPECT_LT(word.y1, word.page_height - options.margin_mm + w) << paper << ": " << word.text;
      }
    }
  }
}

TEST(Print, WhatDoesNotFitNamesPaperThatDoes) {
  const TempDir folder;
  SheetOptions options;
  EXPECT_THAT(
      MessageOf<OptionError>([&] { WriteSheets({TagArtwork("tag36h11", 7, 5000)}, {}, options, folder / "x.pdf"); }),
      HasSubstr("sheets of A4; expected at most 200: take A1 or larger paper"));
  EXPECT_EQ(WriteSheets({TagArtwork("tag36h11", 7, 180)}, {}, options, folder / "x.pdf").one_sheet, "A3");
  options.margin_mm = 60;
  EXPECT_THAT(MessageOf<OptionError>([&] {
                options.paper = PaperNamed("A5");
                WriteSheets({TagArtwork("tag36h11", 7, 20)}, {}, options, folder / "x.pdf");
              }),
              HasSubstr("a margin of 0 to 51 mm, or A4 or larger paper"));
}

TEST(Print, LinesAreBrokenAtSpacesAndShortened) {
  const std::string text = "three hundred and seventy-seven";
  const std::vector<std::string> lines = WrappedLines(text, 1.4, 13);
  EXPECT_GE(lines.size(), 2U);
  std::string joined;
  for (const std::string& line : lines) {
    EXPECT_LE(PrintedWidth(line, 1.4), 13) << line;
    joined += (joined.empty() ? "" : " ") + line;
  }
  EXPECT_EQ(joined, text);
  for (const std::string& line : WrappedLines("ÄÖÜäöüßÄÖÜäöüßÄÖÜ", 2, 6)) {
    EXPECT_LE(PrintedWidth(line, 2), 6) << line;
    EXPECT_EQ(static_cast<unsigned char>(line[0]), 0xC3U) << "a letter is cut";
  }
  EXPECT_LE(PrintedWidth(Shortened(text, 2, 15), 2), 15);
  EXPECT_EQ(Shortened("short", 2, 15), "short");
  EXPECT_LE(PrintedWidth(text, FittedSize(text, 3, 20, true), true), 20 + 1e-9);
  EXPECT_TRUE(WrappedLines("  ", 2, 10).empty());
}

TEST(Print, NumbersInWords) {
  EXPECT_EQ(NumberInWords(0), "zero");
  EXPECT_EQ(NumberInWords(12), "twelve");
  EXPECT_EQ(NumberInWords(45), "forty-five");
  EXPECT_EQ(NumberInWords(305), "three hundred and five");
  EXPECT_EQ(NumberInWords(2015), "two thousand and fifteen");
  EXPECT_EQ(NumberInWords(48713), "forty-eight thousand seven hundred and thirteen");
}

TEST(Print, PaperSizes) {
  EXPECT_EQ(PaperNamed("a3").height_mm, 420);
  EXPECT_EQ(PaperNamed("600x900").width_mm, 600);
  EXPECT_THAT(MessageOf<OptionError>([] { PaperNamed("A11"); }), HasSubstr("nearest: 'A1'"));
  EXPECT_THAT(MessageOf<OptionError>([] { PaperNamed("20x30"); }), HasSubstr("60 to 5000"));
}

TEST(TagsFile, EntriesAreAddedAndCommentsStay) {
  const TempDir folder;
  const fs::path file = folder / "tags.yaml";
  const auto with = [&](const std::string& text, const std::map<int, double>& sizes,
                        const std::map<int, double>& expected = {}) {
    if (!text.empty()) WriteFileAtomically(file, text);
    return WithTagSizes(text, "tag36h11", sizes, expected, file);
  };
  EXPECT_EQ(with("", {{3, 0.16}}).text, "family: tag36h11\nsizes_m:  # edge of the black square\n  3: 0.16\n");
  EXPECT_EQ(with("size_m: 0.5  # tape\n", {{3, 0.16}}).text,
            "size_m: 0.5  # tape\nsizes_m:  # edge of the black square\n  3: 0.16\n");
  EXPECT_EQ(with("sizes_m: {7: 0.25}  # two kinds\nsize_m: 0.5\n", {{3, 0.16}}).text,
            "sizes_m:  # two kinds\n  7: 0.25\n  3: 0.16\nsize_m: 0.5\n");
  const std::string block = "sizes_m:\n    7: 0.25  # gate\n    # more\nsize_m: 0.5\n";
  EXPECT_EQ(with(block, {{3, 0.16}}).text, "sizes_m:\n    7: 0.25  # gate\n    3: 0.16\n    # more\nsize_m: 0.5\n");
  EXPECT_EQ(with(block, {{7, 0.25}}).text, block);
  EXPECT_EQ(with(block, {{7, 0.2493}}, {{7, 0.25}}).text, "sizes_m:\n    7: 0.2493  # gate\n    # more\nsize_m: 0.5\n");
  EXPECT_THAT(MessageOf<InputError>([&] { with(block, {{7, 0.16}}); }), HasSubstr("tag 7 is listed with 0.25 m"));
  // Tags of another family are named; an id is one tag.
  EXPECT_EQ(with("family: tag25h9\n", {{7, 0.16}}).text,
            "family: tag25h9\nfamilies:  # of tags of another family\n  7: tag36h11\n"
            "sizes_m:  # edge of the black square\n  7: 0.16\n");
  EXPECT_EQ(with("family: tag25h9\nfamilies: {7: tag36h11}\nsizes_m: {7: 0.2}\n", {{8, 0.16}}).text,
            "family: tag25h9\nfamilies:\n  7: tag36h11\n  8: tag36h11\nsizes_m:\n  7: 0.2\n  8: 0.16\n");
  EXPECT_THAT(MessageOf<InputError>([&] {
                with("family: tag25h9\nsizes_m: {7: 0.16}\n", {{7, 0.16}});
              }),
              HasSubstr("tag 7 is listed as of tag25h9, not tag36h11"));
}

TEST(PrintCommand, NotesWhatWasPrintedAndMeasured) {
  const TempDir folder;
  const std::string dir = folder.string();
  const Finished printed = Trigpoint({"print", dir, "--ids", "0-2,9", "--size", "100", "--json"});
  ASSERT_EQ(printed.exit_code, 0) << printed.err;
  EXPECT_TRUE(fs::exists(printed.Json()["file"].get<std::string>()));
  EXPECT_EQ(printed.Json()["entries_added"], 4);
  EXPECT_EQ(ReadTagSizes(folder / "tags.yaml").sizes_m,
            (std::map<int, double>{{0, 0.1}, {1, 0.1}, {2, 0.1}, {9, 0.1}}));
  // The form with the places is the last page.
  EXPECT_EQ(static_cast<int>(Rendered(printed.Json()["file"].get<std::string>()).size()), printed.Json()["pages"]);

  const std::string before = ReadTextFile(folder / "tags.yaml");
  const Finished measured = Trigpoint({"print", dir, "--measured", "99.7", "--nominal", "100", "--json"});
  ASSERT_EQ(measured.exit_code, 0) << measured.err;
  EXPECT_EQ(ReadTagSizes(folder / "tags.yaml").sizes_m.at(9), 0.0997);
  EXPECT_EQ(ReadTextFile(measured.Json()["old"].get<std::string>()), before);
  // Measured again: the size asked for is what counts.
  ASSERT_EQ(Trigpoint({"print", dir, "--ids", "9", "--measured", "99.5", "99.6", "--nominal", "100"}).exit_code, 0);
  const Finished uneven = Trigpoint({"print", dir, "--ids", "2", "--measured", "99.4", "99.8", "--nominal", "100"});
  const std::string said = uneven.out + uneven.err;
  EXPECT_THAT(said, HasSubstr("the lengths across and up differ by 0.40 %"));
  EXPECT_EQ(said.find("the lengths across"), said.rfind("the lengths across"));  // once
  EXPECT_NEAR(ReadTagSizes(folder / "tags.yaml").sizes_m.at(9), 0.09955, 1e-9);
  EXPECT_EQ(ReadTagSizes(folder / "tags.yaml").sizes_m.at(0), 0.0997);

  // The record can be moved with the folder, whatever way the folder was named.
  const fs::path before_here = fs::current_path();
  fs::current_path(folder / "");
  EXPECT_EQ(Trigpoint({"print", ".", "--ids", "30", "--size", "50"}).exit_code, 0);
  fs::current_path(before_here);
  EXPECT_THAT(ReadTextFile(folder / "print/printed.csv"), HasSubstr(",print/tags_tag36h11_30_50mm.pdf,"));
  EXPECT_THAT(ReadTextFile(folder / "print/printed.csv"), HasSubstr(",print/tags_tag36h11_0_1_2_9_100mm.pdf,"));
  EXPECT_THAT(ReadTextFile(folder / "print/printed.csv"), testing::Not(HasSubstr(dir)));

  // The same ids in another size would contradict the file: nothing is printed.
  const Finished again = Trigpoint({"print", dir, "--ids", "9", "--size", "200"});
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.err, HasSubstr("tag 9 is listed with 0.09955 m"));
  EXPECT_FALSE(fs::exists(folder / "print/tags_tag36h11_9_200mm.pdf"));
  EXPECT_EQ(Trigpoint({"print", dir, "--ids", "9", "--measured", "100", "102"}).exit_code, 2);
  EXPECT_EQ(Trigpoint({"print", dir, "--ids", "700", "--size", "100"}).exit_code, 1);
  EXPECT_EQ(Trigpoint({"print", dir, "--ids", "3-1", "--size", "100"}).exit_code, 2);
  EXPECT_EQ(Trigpoint({"print", (folder / "nowhere").string(), "--ids", "1", "--size", "100"}).exit_code, 1);
  // Tags of a second family in the same site; ids without a family are of that which the file states.
  ASSERT_EQ(Trigpoint({"print", dir, "--ids", "20", "--size", "100", "--family", "tag16h5"}).exit_code, 0);
  EXPECT_EQ(ReadTagSizes(folder / "tags.yaml").family, "tag36h11,tag16h5:20");
  const Finished mixed = Trigpoint({"print", dir, "--ids", "20,21", "--size", "100"});
  EXPECT_EQ(mixed.exit_code, 2);
  EXPECT_THAT(mixed.err, HasSubstr("tag 20 is of tag16h5 and tag 21 of tag36h11; print one family at a time"));
  // A file of the user is not written onto.
  WriteFileAtomically(folder / "mine.pdf", "mine");
  EXPECT_EQ(Trigpoint({"print", dir, "--what", "board", "--target", "checkerboard:9x6:0.02", "--out",
                       (folder / "mine.pdf").string()})
                .exit_code,
            1);
  EXPECT_EQ(ReadTextFile(folder / "mine.pdf"), "mine");
}

TEST(PrintCommand, ATagPrintedAgainKeepsItsEntryUntilItIsMeasured) {
  const TempDir folder;
  const std::string dir = folder.string();
  ASSERT_EQ(Trigpoint({"print", dir, "--ids", "4,5", "--size", "100"}).exit_code, 0);
  ASSERT_EQ(Trigpoint({"print", dir, "--measured", "97", "--nominal", "100"}).exit_code, 0);
  const std::string measured = ReadTextFile(folder / "tags.yaml");
  const Finished again =
      Trigpoint({"print", dir, "--ids", "4", "--size", "100", "--out", dir + "/again.pdf", "--json"});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(again.Json()["entries_added"], 0);
  EXPECT_THAT(again.Json()["warnings"].dump(), HasSubstr("tag 4: tags.yaml has 97 mm"));
  EXPECT_THAT(again.Json()["warnings"].dump(), HasSubstr("this sheet has 100 mm"));
  EXPECT_EQ(ReadTextFile(folder / "tags.yaml"), measured);
  // Only the tag that was printed again gets the new measure.
  ASSERT_EQ(Trigpoint({"print", dir, "--ids", "4", "--measured", "99.8", "--nominal", "100"}).exit_code, 0);
  EXPECT_EQ(ReadTagSizes(folder / "tags.yaml").sizes_m, (std::map<int, double>{{4, 0.0998}, {5, 0.097}}));
  EXPECT_THAT(ReadTextFile(folder / "print/printed.csv"), HasSubstr("tag36h11,4,100.000,97.000"));
  EXPECT_THAT(ReadTextFile(folder / "print/printed.csv"), HasSubstr("tag36h11,4,100.000,99.800"));
  // An entry by hand is the user's.
  WriteFileAtomically(folder / "tags.yaml", "sizes_m: {4: 0.0995, 5: 0.097}\n");
  const Finished refused = Trigpoint({"print", dir, "--ids", "4", "--measured", "99.8", "--nominal", "100"});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, HasSubstr("tag 4 is listed with 0.0995 m, which is neither the 100 mm"));
}

TEST(PrintCommand, MessagesStateWhatWasExpected) {
  const TempDir folder;
  const std::string dir = folder.string();
  const auto expect = [&](std::vector<std::string> arguments, int exit_code, const std::string& message) {
    arguments.insert(arguments.begin(), {"print", dir});
    const Finished finished = Trigpoint(arguments);
    EXPECT_EQ(finished.exit_code, exit_code) << message;
    EXPECT_THAT(finished.err, HasSubstr(message));
  };
  const std::string mine = dir + "/mine.txt";
  expect({"--size", "100"}, 2, "--ids: expected ids of tags, as 0-9,12");
  expect({"--ids", "5-2", "--size", "100"}, 2, "expected ids and ranges, as 0-9,12; found '5-2'");
  expect({"--ids", "999999", "--size", "100"}, 1, "tag 999999 is not in tag36h11, which has the ids 0 to 586");
  expect({"--ids", "1"}, 2, "--size: expected the size of a tag in mm");
  expect({"--ids", "1", "--size", "0"}, 2, "--size: expected 5 to 5000 mm, found '0'");
  expect({"--measured", "-5", "--nominal", "50"}, 2, "--measured: expected 1 to 20000 mm, found '-5'");
  expect({"--ids", "1", "--size", "5000"}, 2, "take A1 or larger paper");
  expect({"--ids", "1", "--size", "20", "--paper", "10x10"}, 2, "expected WIDTHxHEIGHT in mm, each 60 to 5000");
  expect({"--ids", "1", "--size", "20", "--out", mine}, 2, "expected the name of a file that ends in .pdf");
  expect({"--ids", "1", "--size", "20", "--nominal", "100"}, 2, "expected --measured with it");
  expect({"--ids", "1,2", "--size", "20", "--what", "scale-bar"}, 2, "--length: expected the distance");
  expect({"--measured", "99", "--nominal", "100"}, 1, "nothing was printed yet");
  EXPECT_FALSE(fs::exists(folder / "tags.yaml"));
  ASSERT_EQ(Trigpoint({"print", dir, "--ids", "1", "--size", "160"}).exit_code, 0);
  expect({"--measured", "99"}, 2, "on these sheets 50 mm (the bars) or 160 mm (the tags' edges)");
  expect({"--measured", "50", "--nominal", "500"}, 2, "80 to 125 % of each other");
  WriteFileAtomically(folder / "tags.yaml", "sizes_m: {1: [\n");
  expect({"--ids", "2", "--size", "20"}, 1, "tags.yaml:2: not valid YAML");
}

}  // namespace
}  // namespace trigpoint

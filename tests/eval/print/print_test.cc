// Sheets as they are printed: the PDF is rendered at 150 dpi by pdftoppm, photographed with tilt, blur and noise, and
// what is detected must lie where the PDF has it.
#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "calib/estimation/random.h"
#include "calib/target/detect.h"
#include "datasets/io/tables.h"
#include "datasets/io/tags_file.h"
#include "datasets/io/text.h"
#include "eval/print/sheets.h"
#include "survey/tags/detection.h"
#include "survey/tags/tag_family.h"
#include "tests/datasets/project_folder.h"
#include "tests/e2e/program.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr double kDpi = 150, kMmPerInch = 25.4;
constexpr double kTolerance_mm = 0.05;

// An empty folder that is removed with the object.
class Folder {
 public:
  Folder() {
    static int count = 0;
    dir_ = fs::temp_directory_path() / ("trigpoint_print_" + std::to_string(getpid()) + "_" + std::to_string(count++));
    fs::create_directories(dir_);
  }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(dir_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  fs::path operator/(const std::string& name) const { return dir_ / name; }
  std::string text() const { return dir_.string(); }

 private:
  fs::path dir_;
};

std::vector<cv::Mat> Rendered(const fs::path& pdf, double dpi = kDpi) {
  const fs::path prefix = pdf.string() + "_page";
  const std::string command =
      "pdftoppm -gray -r " + std::to_string(dpi) + " '" + pdf.string() + "' '" + prefix.string() + "'";
  EXPECT_EQ(std::system(command.c_str()), 0) << command << " (package poppler-utils)";
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(pdf.parent_path())) {
    if (entry.path().string().starts_with(prefix.string())) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::vector<cv::Mat> pages;
  for (const fs::path& file : files) {
    pages.push_back(cv::imread(file.string(), cv::IMREAD_GRAYSCALE));
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
  Eigen::Vector2d PageMm(const Eigen::Vector2d& p) const {
    const cv::Vec3d q = page_from_photo * cv::Vec3d(p.x(), p.y(), 1);
    return Mm({q[0] / q[2], q[1] / q[2]});
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
  const Folder folder;
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

TEST(Print, ManySmallTagsShareASheet) {
  const Folder folder;
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
  const Folder folder;
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

TEST(Print, ALargeTagIsOneAgainWhenItsSheetsAreCutAndJoined) {
  const Folder folder;
  const double size = 400;
  const Artwork artwork = TagArtwork("tag36h11", 7, size);
  const PrintedSheets sheets = WriteSheets({artwork}, {}, {}, folder / "large.pdf");
  const std::vector<cv::Mat> pages = Rendered(folder / "large.pdf");
  const double cut = 16, trim_x = 178, trim_y = 265;  // A4 with a margin of 8 and 8 for crop marks
  const int cols = static_cast<int>(std::ceil(artwork.width_mm / trim_x));
  const int rows = static_cast<int>(std::ceil(artwork.height_mm / trim_y));
  ASSERT_EQ(sheets.tiles, cols * rows);
  ASSERT_EQ(static_cast<int>(pages.size()), 1 + sheets.tiles);
  // Put together as by hand: each sheet gives what lies between its crop marks.
  const double px = kDpi / kMmPerInch;
  cv::Mat whole(static_cast<int>(rows * trim_y * px), static_cast<int>(cols * trim_x * px), CV_8U, 255);
  for (int t = 0; t < sheets.tiles; ++t) {
    const double dx = (t % cols * trim_x - cut) * px, dy = (t / cols * trim_y - cut) * px;
    cv::Mat moved;
    cv::warpAffine(pages[static_cast<size_t>(t) + 1], moved, cv::Matx23d(1, 0, dx, 0, 1, dy), whole.size(),
                   cv::INTER_CUBIC);
    const cv::Rect part(static_cast<int>(t % cols * trim_x * px), static_cast<int>(t / cols * trim_y * px),
                        static_cast<int>(trim_x * px) + 1, static_cast<int>(trim_y * px) + 1);
    const cv::Rect inside = part & cv::Rect(0, 0, whole.cols, whole.rows);
    moved(inside).copyTo(whole(inside));
  }
  cv::GaussianBlur(whole, whole, cv::Size(), 1);
  const std::vector<TagDetection> found = Detected(whole, "tag36h11");
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].id, 7);
  for (size_t k = 0; k < 4; ++k) {
    EXPECT_LT((Mm(found[0].corners[k]) - Eigen::Vector2d(artwork.points[k].x_mm, artwork.points[k].y_mm)).norm(),
              kTolerance_mm);
    const PrintedPoint* printed = nullptr;
    for (const PrintedPoint& p : sheets.points) {
      if (p.object == "tag 7" && p.index == static_cast<int>(k)) printed = &p;
    }
    ASSERT_NE(printed, nullptr);
    const int t = printed->page - 2;
    EXPECT_NEAR(printed->x_mm - cut + t % cols * trim_x, artwork.points[k].x_mm, 1e-9);
    EXPECT_NEAR(printed->y_mm - cut + t / cols * trim_y, artwork.points[k].y_mm, 1e-9);
  }
}

TEST(Print, BoardsAreReadBack) {
  const Folder folder;
  Target checkerboard{TargetKind::kCheckerboard, 8, 6, 0.019, 0.019};
  Target charuco{TargetKind::kCharuco, 8, 6, 0.021, 0.021, 0.0125};
  Target grid{TargetKind::kAprilGrid, 5, 4, 0.026, 0.026, 0, 0.3};
  Target circles{TargetKind::kAsymmetricCircles, 4, 9, 0.018, 0.018};
  for (const Target& target : {checkerboard, charuco, grid, circles}) {
    const std::string name(TargetKindName(target.kind));
    const PrintedSheets sheets = WriteSheets({BoardArtwork(target)}, {}, {}, folder / (name + ".pdf"));
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
    // A board that looks the same when turned by half may be counted from its end. The root mean square shows where the
    // ink is; single saddle points are found less exactly than the corners of tags.
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
    EXPECT_LT(is_turned ? worst_turned : worst_direct, 2 * tolerance) << name;
  }
}

TEST(Print, AScaleBarHasItsLength) {
  const Folder folder;
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
  const Folder folder;
  for (const char* paper : {"A4", "A6", "Letter"}) {
    SheetOptions options;
    options.paper = PaperNamed(paper);
    const PrintedSheets sheets = WriteSheets({TagArtwork("tag36h11", 0, 40)}, {}, options, folder / "bars.pdf");
    const double dpi = 600;
    const cv::Mat page = Rendered(folder / "bars.pdf", dpi).front();
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
  }
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
  const Folder folder;
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
  const Folder folder;
  const std::string dir = folder.text();
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
  ASSERT_EQ(Trigpoint({"print", dir, "--ids", "9", "--measured", "99.5", "99.6"}).exit_code, 0);
  EXPECT_NEAR(ReadTagSizes(folder / "tags.yaml").sizes_m.at(9), 0.09955, 1e-9);
  EXPECT_EQ(ReadTagSizes(folder / "tags.yaml").sizes_m.at(0), 0.0997);

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

}  // namespace
}  // namespace trigpoint

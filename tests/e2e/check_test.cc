// A rendered site, copied in pieces and damaged as sites are: `check` names what is wrong while there is time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <thread>

#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "survey/tags/detection.h"
#include "tests/support/program.h"
#include "tests/synthetic/rendered_site.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

class FieldCheck : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    base_ = fs::temp_directory_path() / ("trigpoint check " + std::to_string(getpid()));
    fs::remove_all(base_);
    SyntheticOptions options;
    options.length_m = 80;
    options.step_m = 1;
    options.panoramas = 5;
    options.panoramas_left = true;
    BodyCamera camera = SyntheticCamera("cam0", 0.8);
    camera.camera = Camera(CameraModel::kRadtan, 480, 300, {260, 260, 239.5, 149.5, 0, 0, 0, 0});
    RenderedSiteOptions rendered;
    rendered.px_per_m = 24;
    rendered.panorama_width = 256;
    rendered.photo_sets = 1;
    ProgressSink progress;
    WriteRenderedSite(MakeSyntheticSite(options, 3, {camera}), rendered, 3, base_ / "whole", base_ / "truth", 2,
                      progress, {});
  }
  static void TearDownTestSuite() { fs::remove_all(base_); }

  void SetUp() override {
    fs::remove_all(site_);
    fs::copy(base_ / "whole", site_, fs::copy_options::recursive);
    images_ = Images(site_);
    for (const fs::path& image : images_) Age(image);
    fs::remove_all(site_ / "photos");
  }
  // A moment ago: check has to wait until it knows that they are complete.
  void BringPhotos() const { fs::copy(base_ / "whole" / "photos", site_ / "photos", fs::copy_options::recursive); }

  // As if it had been copied a while ago.
  static void Age(const fs::path& file) {
    fs::last_write_time(file, fs::file_time_type::clock::now() - std::chrono::minutes(1));
  }
  // While this is there, the file changes every tenth of a second, as one that is being copied.
  class BeingCopied {
   public:
    explicit BeingCopied(const fs::path& file) : file_(file) {
      Touch();
      copier_ = std::thread([this] {
        while (!done_) {
          std::this_thread::sleep_for(std::chrono::milliseconds(100));
          Touch();
        }
      });
    }
    ~BeingCopied() {
      done_ = true;
      copier_.join();
    }
    BeingCopied(const BeingCopied&) = delete;
    BeingCopied& operator=(const BeingCopied&) = delete;

   private:
    void Touch() const {
      std::error_code ignored;
      fs::last_write_time(file_, fs::file_time_type::clock::now(), ignored);
    }
    fs::path file_;
    std::atomic<bool> done_ = false;
    std::thread copier_;
  };
  static std::vector<fs::path> Images(const fs::path& site) {
    std::vector<fs::path> images;
    for (const auto& entry : fs::directory_iterator(site / "runs" / "run1" / "images")) images.push_back(entry.path());
    std::sort(images.begin(), images.end());
    return images;
  }
  static std::vector<std::string> Findings(const nlohmann::json& summary, const std::string& but = "green") {
    std::vector<std::string> texts;
    for (const auto& f : summary.at("findings")) {
      if (f.at("light") != but) texts.push_back(f.at("text"));
    }
    return texts;
  }
  nlohmann::json Check(int* exit_code = nullptr) const {
    const Finished finished = Trigpoint({"check", site_.string(), "--json"});
    if (exit_code != nullptr) *exit_code = finished.exit_code;
    EXPECT_THAT(finished.exit_code, testing::AnyOf(0, 3)) << finished.err;
    return finished.Json();
  }
  // Writes the pictures anew that `change(index, picture, its tags)` changed, which it returns.
  template <typename Change>
  void ChangePictures(const Change& change) const {
    ProgressSink silent;
    std::vector<cv::Mat> pictures;
    for (const fs::path& image : images_) pictures.push_back(cv::imread(image.string(), cv::IMREAD_GRAYSCALE));
    const DetectTagsResult found =
        DetectTags(static_cast<int64_t>(pictures.size()), [&](int64_t i) { return pictures[static_cast<size_t>(i)]; },
                   {}, {}, 2, silent, {});
    for (size_t i = 0; i < pictures.size(); ++i) {
      if (!change(i, pictures[i], found.images[i].detections)) continue;
      cv::imwrite(images_[i].string(), pictures[i]);
      Age(images_[i]);
    }
  }
  static std::vector<cv::Point2f> Corners(const TagDetection& tag, double grown) {
    cv::Point2f centre(0, 0);
    std::vector<cv::Point2f> corners;
    for (const Eigen::Vector2d& c : tag.corners) {
      corners.emplace_back(static_cast<float>(c.x()), static_cast<float>(c.y()));
      centre += corners.back() * 0.25F;
    }
    for (cv::Point2f& c : corners) c = centre + static_cast<float>(grown) * (c - centre);
    return corners;
  }
  static void Hide(const TagDetection& tag, cv::Mat* picture) {
    std::vector<cv::Point> corners;
    for (const cv::Point2f& c : Corners(tag, 1.6)) corners.emplace_back(cvRound(c.x), cvRound(c.y));
    cv::fillConvexPoly(*picture, corners, 120);
  }

  static fs::path base_;
  fs::path site_ = base_ / "site";
  std::vector<fs::path> images_;
};
fs::path FieldCheck::base_;

TEST_F(FieldCheck, PiecesAreTakenUpAsTheyArrive) {
  const size_t third = images_.size() / 3;
  for (size_t i = third; i < images_.size(); ++i) fs::remove(images_[i]);
  int exit_code = 0;
  const nlohmann::json first = Check(&exit_code);
  EXPECT_EQ(exit_code, 3);
  EXPECT_EQ(first.at("light"), "red");
  EXPECT_EQ(first.at("pictures"), third);
  EXPECT_THAT(Findings(first), Contains(HasSubstr("planned and in no picture")));
  EXPECT_THAT(first.at("next").at(0).get<std::string>(), HasSubstr("Photograph tag"));
  // The next piece arrives; one picture of it is half there, another one is being copied.
  for (size_t i = third; i < images_.size(); ++i) {
    fs::copy(base_ / "whole/runs/run1/images" / images_[i].filename(), images_[i]);
    Age(images_[i]);
  }
  fs::resize_file(images_[third], fs::file_size(images_[third]) / 2);
  Age(images_[third]);
  nlohmann::json second;
  {
    const BeingCopied last(images_.back());
    second = Check();
  }
  EXPECT_EQ(second.at("waiting"), 1);
  EXPECT_THAT(Findings(second), Contains(HasSubstr("1 picture cannot be used")));
  EXPECT_THAT(Findings(second), Not(Contains(HasSubstr("in no picture"))));
  fs::copy(base_ / "whole/runs/run1/images" / images_[third].filename(), images_[third],
           fs::copy_options::overwrite_existing);
  Age(images_[third]);
  Age(images_.back());
  BringPhotos();
  const nlohmann::json third_time = Check();
  EXPECT_EQ(third_time.at("pictures"), images_.size());
  EXPECT_EQ(third_time.at("waiting"), 0);
  EXPECT_THAT(Findings(third_time), Not(Contains(HasSubstr("cannot be used"))));
  EXPECT_THAT(Findings(third_time, ""), Contains(HasSubstr("the ring of 12 photos is closed")));
  for (const char* file : {"index.html", "map.svg", "findings.csv", "tags.csv", "next.csv", "summary.json"}) {
    EXPECT_TRUE(fs::exists(site_ / "results/check" / file)) << file;
  }
}

TEST_F(FieldCheck, AHiddenTagIsNamed) {
  ChangePictures([](size_t, cv::Mat& picture, const std::vector<TagDetection>& tags) {
    bool changed = false;
    for (const TagDetection& tag : tags) {
      if (tag.id != 2) continue;
      Hide(tag, &picture);
      changed = true;
    }
    return changed;
  });
  EXPECT_THAT(Findings(Check()), Contains(HasSubstr("tag 2 (")));
}

// Sheets are printed in stock: where a sketch says what is put up, the others are missed by nobody.
// Files and JSON stay in metres.
TEST_F(FieldCheck, LengthsAreInTheUnitAskedFor) {
  for (const fs::path& image : images_) fs::remove(image);
  const Finished metres = Trigpoint({"check", site_.string()});
  const Finished feet = Trigpoint({"check", site_.string(), "--units", "ft"});
  EXPECT_THAT(metres.out + metres.err, HasSubstr("from 3 to 5 m and from two sides"));
  EXPECT_THAT(feet.out + feet.err, HasSubstr("from 10 to 16 ft and from two sides"));
  EXPECT_THAT(ReadTextFile(site_ / "results" / "check" / "next.csv"), HasSubstr("from 3 to 5 m"));
  EXPECT_THAT(ReadTextFile(site_ / "results" / "check" / "index.html"),
              AllOf(HasSubstr("from 10 to 16 ft"), Not(HasSubstr("from 3 to 5 m"))));
}

TEST_F(FieldCheck, PrintedSparesAreNotMissing) {
  std::ofstream(site_ / "tags.yaml", std::ios::app) << "sizes_m: {30: 0.16}\n";
  EXPECT_THAT(Findings(Check()), Contains(HasSubstr("tag 30 is planned and in no picture")));
  std::ofstream(site_ / "plan.csv") << "kind,name,east_m,north_m,up_m,heading_deg\ntag,0,0,0,1,0\ntag,31,5,0,1,0\n";
  const std::vector<std::string> findings = Findings(Check());
  EXPECT_THAT(findings, Contains(HasSubstr("tag 31 (in plan.csv) is planned and in no picture")));
  EXPECT_THAT(findings, Not(Contains(HasSubstr("tag 30"))));
}

TEST_F(FieldCheck, WhatAMaskIgnoresIsNoTagOfTheSite) {
  const nlohmann::json before = Check();
  const std::string yaml = ReadTextFile(site_ / "runs/run1/run.yaml");
  std::ofstream(site_ / "runs/run1/run.yaml", std::ios::app) << "\nmasks: {cam0: [[0, 0, 479, 299]]}\n";
  const nlohmann::json masked = Check();
  EXPECT_EQ(masked.at("pictures"), before.at("pictures"));
  EXPECT_THAT(Findings(masked), Contains(HasSubstr("tags 0 (")));
  EXPECT_THAT(Findings(masked, ""), Not(Contains(HasSubstr("the tags' squares"))));
  std::ofstream(site_ / "runs/run1/run.yaml", std::ios::trunc) << yaml;
  EXPECT_EQ(Findings(Check()), Findings(before));
}

TEST_F(FieldCheck, ADoubledTagIsNamed) {
  // What tag 3 looks like, from its largest picture, goes where tag 1 is.
  cv::Mat pattern;
  double largest = 0;
  constexpr float kSide = 120;
  const std::vector<cv::Point2f> square = {{0, kSide}, {kSide, kSide}, {kSide, 0}, {0, 0}};
  ChangePictures([&](size_t, cv::Mat& picture, const std::vector<TagDetection>& tags) {
    for (const TagDetection& tag : tags) {
      const double side = (tag.corners[0] - tag.corners[1]).norm();
      if (tag.id != 3 || side < largest) continue;
      largest = side;
      cv::warpPerspective(picture, pattern, cv::getPerspectiveTransform(Corners(tag, 1.2), square), {120, 120});
    }
    return false;
  });
  ChangePictures([&](size_t, cv::Mat& picture, const std::vector<TagDetection>& tags) {
    bool changed = false;
    for (const TagDetection& tag : tags) {
      if (tag.id != 1) continue;
      changed = true;
      const cv::Mat there = cv::getPerspectiveTransform(square, Corners(tag, 1.2));
      cv::Mat warped, mask;
      cv::warpPerspective(pattern, warped, there, picture.size());
      cv::warpPerspective(cv::Mat(pattern.size(), CV_8U, cv::Scalar(255)), mask, there, picture.size(),
                          cv::INTER_NEAREST);
      warped.copyTo(picture, mask);
    }
    return changed;
  });
  const std::vector<std::string> findings = Findings(Check());
  EXPECT_THAT(findings, Contains(HasSubstr("tag 3 stands at two places")));
  EXPECT_THAT(findings, Contains(HasSubstr("tag 1 (")));
}

// Copied a moment ago, half of it dated by a clock that is an hour ahead, with settings of one run that cannot be read
// and tags whose size nobody entered.
TEST_F(FieldCheck, WhatCannotBeUsedHidesNothingElse) {
  const auto now = fs::file_time_type::clock::now(), ahead = now + std::chrono::hours(1);
  for (size_t i = 0; i < images_.size(); ++i) fs::last_write_time(images_[i], i % 2 == 0 ? now : ahead);
  for (const auto& panorama : fs::directory_iterator(site_ / "panoramas")) fs::last_write_time(panorama, ahead);
  fs::create_directories(site_ / "runs/run2/images");
  std::ofstream(site_ / "runs/run2/run.yaml") << "rolee: both\n";
  std::ofstream(site_ / "plan.csv") << "kind,name\nfoo,1\n";
  std::ofstream(site_ / "tags.yaml") << "family: tag36h11\n";
  const nlohmann::json seen = Check();
  EXPECT_EQ(seen.at("pictures"), images_.size());
  EXPECT_EQ(seen.at("waiting"), 0);
  const std::vector<std::string> findings = Findings(seen);
  EXPECT_THAT(findings, Contains(HasSubstr("unknown key 'rolee'")));
  EXPECT_THAT(findings, Contains(HasSubstr("unknown kind 'foo'")));
  EXPECT_THAT(findings, Contains(HasSubstr("have no size in tags.yaml")));
  EXPECT_EQ(seen.at("light"), "red");
}

TEST_F(FieldCheck, AGateWithoutADatumIsUndecided) {
  for (const char* table : {"control_points.csv", "panoramas.csv"}) fs::remove(site_ / table);
  fs::remove_all(site_ / "panoramas");
  std::ofstream(site_ / "trigpoint.yaml") << "stages: {plan: {max_tag_sigma_m: 5}}\n";
  int exit_code = 0;
  EXPECT_THAT(Findings(Check(&exit_code)), Contains(HasSubstr("the gates are undecided")));
  EXPECT_EQ(exit_code, 3);
}

TEST_F(FieldCheck, ALensThatGetsSmearedIsNamed) {
  ChangePictures([&](size_t i, cv::Mat& picture, const std::vector<TagDetection>&) {
    if (i > images_.size() / 2) cv::GaussianBlur(picture, picture, {}, 2);
    return i > images_.size() / 2;
  });
  EXPECT_THAT(Findings(Check()), Contains(HasSubstr("the lens is smeared or out of focus")));
}

TEST_F(FieldCheck, AnOpenRingIsNamed) {
  BringPhotos();
  const fs::path set = fs::directory_iterator(site_ / "photos")->path();
  std::vector<fs::path> photos;
  for (const auto& photo : fs::directory_iterator(set)) photos.push_back(photo.path());
  std::sort(photos.begin(), photos.end());
  for (size_t k = 7; k < photos.size(); ++k) fs::remove(photos[k]);
  EXPECT_THAT(Findings(Check()), Contains(HasSubstr("the ring is open")));
}

TEST_F(FieldCheck, TheHeadlineStatesWhatWasJudged) {
  fs::remove_all(site_ / "runs");
  BringPhotos();
  const std::string out = Trigpoint({"check", site_.string()}).out;
  EXPECT_THAT(out, HasSubstr(": 12 pictures of 1 photo set, "));
  EXPECT_THAT(out, Not(HasSubstr("0 pictures")));
}

// A video has its index at the end: the half that is there cannot be read, and the rest of the site is judged.
TEST_F(FieldCheck, AVideoThatIsStillBeingCopiedIsNamed) {
  const fs::path run = site_ / "runs/run2", video = run / "clip.mp4";
  fs::create_directories(run);
  fs::copy(site_ / "runs/run1/camchain.yaml", run / "camchain.yaml");
  const fs::path whole = base_ / "whole.mp4";
  cv::VideoWriter writer(whole.string(), cv::VideoWriter::fourcc('m', 'p', '4', 'v'), 2, {480, 300});
  ASSERT_TRUE(writer.isOpened());
  for (const fs::path& image : images_) writer.write(cv::imread(image.string()));
  writer.release();
  const std::string bytes = ReadTextFile(whole);
  WriteFileAtomically(video, bytes.substr(0, bytes.size() / 2));
  nlohmann::json copying;
  {
    const BeingCopied clip(video);
    copying = Check();
  }
  EXPECT_THAT(Findings(copying), Contains(HasSubstr("run2: video clip.mp4, ")));
  EXPECT_THAT(Findings(copying), Contains(HasSubstr("MB so far, still being copied: it is looked at when it is")));
  EXPECT_EQ(copying.at("pictures"), images_.size());
  EXPECT_EQ(copying.at("waiting"), 1);
  Age(video);
  const Finished stopped = Trigpoint({"check", site_.string()});
  EXPECT_THAT(stopped.out, HasSubstr("cannot be read yet: its end is missing"));
  EXPECT_THAT(stopped.err, Not(HasSubstr("moov")));
  // A watch takes it up when the rest arrives.
  const Program watch({"check", site_.string(), "--watch"});
  const auto wait_for = [&](const std::string& text) {
    for (int k = 0; k < 600; ++k) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      const fs::path file = site_ / "results/check/findings.csv";
      if (fs::exists(file) && ReadTextFile(file).find(text) != std::string::npos) return true;
    }
    return false;
  };
  EXPECT_TRUE(wait_for("its end is missing"));
  WriteFileAtomically(video, bytes.substr(0, 3 * bytes.size() / 4));
  {
    const BeingCopied clip(video);
    EXPECT_TRUE(wait_for("still being copied"));
  }
  Age(video);
  EXPECT_TRUE(wait_for("its end is missing"));
  WriteFileAtomically(video, bytes);
  EXPECT_TRUE(wait_for("run2: "));
  const auto pictures = [&] {
    return nlohmann::json::parse(ReadTextFile(site_ / "results/check/summary.json")).at("pictures").get<size_t>();
  };
  for (int k = 0; k < 600 && pictures() <= images_.size(); ++k) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  watch.Signal(SIGINT);
  watch.Wait();
  EXPECT_THAT(ReadTextFile(site_ / "results/check/findings.csv"), Not(HasSubstr("clip.mp4,")));
  EXPECT_GT(pictures(), images_.size());
}

TEST_F(FieldCheck, AKillLosesOnlyWhatWasInHand) {
  const fs::path log = site_ / "results/check/pictures.jsonl";
  const auto lines = [&] {
    std::ifstream in(log);
    return std::count(std::istreambuf_iterator<char>(in), {}, '\n');
  };
  // On a busy machine it can be done before this test gets to kill it; then it is tried again.
  auto kept = std::ssize(images_) + 1;
  for (int attempt = 0; attempt < 5 && kept > std::ssize(images_); ++attempt) {
    fs::remove_all(log.parent_path());
    const Program killed({"check", site_.string(), "--threads", "1"});
    while (lines() < 10) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    killed.Signal(SIGKILL);
    killed.Wait();
    do {  // its own child ends a moment later
      kept = lines();
      std::this_thread::sleep_for(std::chrono::milliseconds(500));
    } while (lines() != kept);
  }
  ASSERT_LE(kept, std::ssize(images_)) << "it was done before it was killed";
  const std::string before = ReadTextFile(log);
  std::ofstream(log, std::ios::app) << "{\"run\":\"run1\",\"ima";  // a line that was cut off
  EXPECT_EQ(Check().at("pictures"), images_.size());
  EXPECT_EQ(lines(), std::ssize(images_) + 1);  // each picture once, the first line besides
  EXPECT_TRUE(ReadTextFile(log).starts_with(before.substr(0, before.rfind('\n') + 1)));
}

TEST_F(FieldCheck, TheWatchedPageFollowsTheFolder) {
  for (size_t i = 20; i < images_.size(); ++i) fs::remove(images_[i]);
  const Program watch({"check", site_.string(), "--watch"});
  const auto wait_for = [&](size_t number, const std::string& of = "pictures") {
    for (int k = 0; k < 3000; ++k) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      const fs::path file = site_ / "results/check/summary.json";
      if (!fs::exists(file)) continue;
      if (nlohmann::json::parse(ReadTextFile(file)).at(of) == number) return true;
    }
    return false;
  };
  ASSERT_TRUE(wait_for(20));
  const std::string page = ReadTextFile(site_ / "results/check/index.html");
  EXPECT_THAT(page, HasSubstr("http-equiv=\"refresh\""));
  EXPECT_THAT(page, Not(HasSubstr("http://")));
  EXPECT_THAT(page, Not(HasSubstr("https://")));
  for (size_t i = 20; i < images_.size(); ++i) {
    fs::copy(base_ / "whole/runs/run1/images" / images_[i].filename(), images_[i]);
  }
  EXPECT_TRUE(wait_for(images_.size()));
  BringPhotos();
  EXPECT_TRUE(wait_for(12, "photos_of_sets"));
  watch.Signal(SIGINT);
  const Finished ended = watch.Wait();
  const auto last = nlohmann::json::parse(ReadTextFile(site_ / "results/check/summary.json"));
  EXPECT_EQ(ended.exit_code, last.at("light") == "green" ? 0 : 3);
  EXPECT_THAT(ended.err, HasSubstr("planned and in no picture"));
  EXPECT_LE(std::count(ended.out.begin(), ended.out.end(), '\n'), 12);
  EXPECT_THAT(ReadTextFile(site_ / "results/check/index.html"), Not(HasSubstr("http-equiv=\"refresh\"")));
}

}  // namespace
}  // namespace trigpoint

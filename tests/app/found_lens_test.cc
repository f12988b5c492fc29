// The lens that was found for a run's images, in a survey.
#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>

#include "app/pipeline/survey_input.h"
#include "tests/support/project_folder.h"

namespace trigpoint {
namespace {

// Photos without EXIF, a calibration and odometry, in which somebody has found a tag.
TEST(FoundLens, IsUsedByASurveyWithoutOdometry) {
  const ProjectFolder folder;
  const std::string found = folder.Read("runs/run1/camchain.yaml");
  for (const char* file : {"odometry.tum", "camchain.yaml", "detections.csv"}) {
    std::filesystem::remove(folder / (std::string("runs/run1/") + file));
  }
  std::filesystem::create_directories(folder / "runs/run1/images");
  for (const char* file : {"a.png", "b.png"}) {
    cv::imwrite((folder / (std::string("runs/run1/images/") + file)).string(),
                cv::Mat(100, 100, CV_8UC1, cv::Scalar(90)));
  }
  folder.Write("runs/run1/images.txt", "1.0 images/a.png\n2.0 images/b.png\n");
  const Project project = Project::Open(folder.dir());
  ProgressSink progress;
  const CancelToken cancel;
  nlohmann::json metrics;
  StageContext context{project, folder / "out", 1, 1, progress, cancel, metrics};
  ImageDetections image{1'000'000'000, "images/a.png", "cam0", std::vector<TagDetection>(1)};
  image.detections[0].id = 1;
  image.detections[0].corners = {Eigen::Vector2d(10, 20), Eigen::Vector2d(20, 20), Eigen::Vector2d(20, 10),
                                 Eigen::Vector2d(10, 10)};
  const DetectionsOfRuns detections = {{"run1", {image}}};
  const auto job = [&] { return MakeSurveyJob(project, {}, {}, context, &detections); };
  EXPECT_NE(MessageOf<InputError>(job).find("the lens of its pictures is not known"), std::string::npos);
  folder.Write("results/reconstruct/run1/camchain.yaml", found);
  const SurveyJob with = job();
  ASSERT_EQ(with.input.runs.size(), 1u);
  EXPECT_EQ(with.input.runs[0].cameras[0].camera.MeanFocal(), 100);
  for (const std::string& warning : with.warnings) EXPECT_EQ(warning.find("EXIF"), std::string::npos) << warning;
  // The survey is out of date once the lens is another one.
  folder.Write("results/reconstruct/run1/manifest.json", "{}");
  const std::vector<std::filesystem::path> inputs = MakeRequest(project, StageNamed("survey"), {}).inputs;
  EXPECT_EQ(std::count(inputs.begin(), inputs.end(), folder / "results/reconstruct/run1/manifest.json"), 1);
}

}  // namespace
}  // namespace trigpoint

// Runs of cameras that see more than a pinhole does: 360 pictures and dual fisheyes, rendered with their true poses.
#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "calib/base/progress.h"
#include "calib/geometry/so3.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "datasets/io/trajectory.h"
#include "tests/support/program.h"
#include "tests/support/project_folder.h"
#include "tests/synthetic/rendered_site.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// On a pole, turned and not quite upright.
Rigid3d OnAPole(double yaw_rad) {
  Rigid3d cam_from_body = SyntheticCamera("cam0", yaw_rad).cam_from_body;
  cam_from_body.rotation = ExpSO3({0.03, 0, -0.04}) * cam_from_body.rotation;
  return cam_from_body;
}

BodyCamera Mounted(const std::string& name, const Camera& camera, const Rigid3d& cam_from_body) {
  return {.name = name, .camera = camera, .cam_from_body = cam_from_body, .has_extrinsics = true};
}

class SphereRun : public testing::Test {
 protected:
  void Make(const std::vector<BodyCamera>& cameras) {
    for (const ProjectFolder* folder : {&folder_, &truth_}) fs::remove_all(folder->dir());
    SyntheticOptions options;
    options.length_m = 24;
    options.step_m = 1;
    options.panoramas = 4;
    options.geotag_sigma_h_m = options.geotag_sigma_v_m = 0.01;
    options.geotag_sigma_heading_deg = options.geotag_sigma_tilt_deg = 0.05;
    site_ = MakeSyntheticSite(options, 11, cameras);
    RenderedSiteOptions render;
    render.panorama_width = 2048;
    ProgressSink progress;
    WriteRenderedSite(site_, render, 5, folder_.dir(), truth_.dir(), 2, progress, {});
    fs::remove(folder_ / "runs/run1/gps.csv");
  }
  Finished Call(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin() + 1, folder_.dir().string());
    return Trigpoint(arguments);
  }
  // Largest errors of the first camera's poses, m and deg, in the site's frame.
  std::pair<double, double> LargestErrors() const {
    const Trajectory truth = ReadTrajectory(truth_ / "runs/run1_cameras.tum");
    const Trajectory found = ReadTrajectory(folder_ / "results/localize/run1/cameras.tum");
    EXPECT_EQ(found.poses.size(), truth.poses.size());
    double metres = 0, degrees = 0;
    for (size_t i = 0; i < std::min(found.poses.size(), truth.poses.size()); ++i) {
      const Rigid3d &a = found.poses[i].target_from_body, &b = truth.poses[i].target_from_body;
      metres = std::max(metres, (a.translation - b.translation).norm());
      degrees = std::max(degrees, kRadToDeg * AngleBetween(a.rotation, b.rotation));
    }
    return {metres, degrees};
  }
  // Largest error of a tag's centre in the map, m.
  double LargestTagError() const {
    std::map<int64_t, Eigen::Vector3d> truth;
    const auto centre = [](const CsvRow& row) {
      return Eigen::Vector3d(row.Number("x"), row.Number("y"), row.Number("z"));
    };
    const CsvTable tags = CsvTable::Read(truth_ / "tags.csv", {"tag_id", "x", "y", "z"});
    for (const CsvRow& row : tags.rows()) truth[row.Integer("tag_id")] = centre(row);
    const CsvTable map = CsvTable::Read(folder_ / "results/survey/tags.csv", {"tag_id", "x", "y", "z"});
    EXPECT_EQ(map.rows().size(), truth.size());
    double largest = 0;
    for (const CsvRow& row : map.rows()) {
      largest = std::max(largest, (centre(row) - truth.at(row.Integer("tag_id"))).norm());
    }
    return largest;
  }
  size_t Rows(const std::string& file) const { return CsvTable::Read(folder_ / file, {}).rows().size(); }

  ProjectFolder folder_, truth_;
  SyntheticSite site_;
};

TEST_F(SphereRun, A360CameraIsACameraLikeAnyOther) {
  Make({Mounted("cam0", Camera::Equirectangular(1600, 800), OnAPole(0.5))});
  Finished finished = Call({"init"});
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  EXPECT_THAT(finished.out, HasSubstr("run run1: 24 images, 1 camera, 360 images in 5 views each"));
  finished = Call({"run"});
  ASSERT_EQ(finished.exit_code, 0) << finished.err;
  const auto [metres, degrees] = LargestErrors();
  EXPECT_LT(metres, 0.05);
  EXPECT_LT(degrees, 0.2);
  EXPECT_LT(LargestTagError(), 0.03);
  // One row for each picture; four panoramas answered.
  EXPECT_EQ(Rows("results/localize/run1/cameras.csv"), 24u);
  EXPECT_EQ(Rows("results/localize/run1/cameras_cov.csv"), 24u);
  EXPECT_FALSE(fs::exists(folder_ / "results/localize/run1/cameras_cam0_72.tum"));
  EXPECT_EQ(Rows("results/reference/run1/poses.csv"), 24u);
  const CsvTable panoramas = CsvTable::Read(folder_ / "results/localize/run1/panoramas.csv", {"status"});
  for (const CsvRow& row : panoramas.rows()) EXPECT_EQ(row.Text("status"), "localized");
  // A tag in the overlap of two views was seen once.
  std::map<std::pair<int64_t, int64_t>, int> sights;
  const CsvTable detections = CsvTable::Read(folder_ / "results/detect/run1/detections.csv", {"timestamp", "tag_id"});
  for (const CsvRow& row : detections.rows()) ++sights[{row.StampNs("timestamp"), row.Integer("tag_id")}];
  for (const auto& [sight, times] : sights) EXPECT_EQ(times, 1);
  EXPECT_GT(sights.size(), 24u);
  finished = Call({"report"});
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  // Exported, it is one camera and one trajectory.
  const fs::path out = folder_ / "out";
  EXPECT_EQ(Call({"export", "--to", "kalibr", "--run", "run1", "--out", out.string()}).exit_code, 0);
  EXPECT_THAT(ReadTextFile(out / "camchain.yaml"),
              HasSubstr("camera_model: equirectangular\n  resolution: [1600, 800]"));
  EXPECT_THAT(ReadTextFile(out / "camchain.yaml"), testing::Not(HasSubstr("cam0_72")));
  EXPECT_EQ(Call({"export", "--to", "tum", "--frame", "world", "--run", "run1", "--out", out.string()}).exit_code, 0);
  // The picture is excluded with all of its views.
  const std::string excluded = ReadTextFile(folder_ / "results/localize/run1/cameras.csv");
  ASSERT_THAT(excluded, HasSubstr("images/000005.jpg,cam0"));
  EXPECT_EQ(Call({"review", "exclude", "image:run1/images/000005.jpg", "--reason", "test"}).exit_code, 0);
  EXPECT_EQ(Call({"localize"}).exit_code, 0);
  EXPECT_EQ(Rows("results/localize/run1/cameras.csv"), 23u);
}

TEST_F(SphereRun, NeedsNeitherCalibrationNorOdometry) {
  Make({Mounted("cam0", Camera::Equirectangular(1600, 800), SyntheticCamera("cam0", 0).cam_from_body)});
  fs::remove(folder_ / "runs/run1/camchain.yaml");
  fs::remove(folder_ / "runs/run1/odometry.tum");
  folder_.Write("runs/run1/run.yaml", "camera: equirectangular\n");
  const Finished finished = Call({"localize"});
  ASSERT_EQ(finished.exit_code, 0) << finished.err;
  const auto [metres, degrees] = LargestErrors();
  EXPECT_LT(metres, 0.1);
  EXPECT_LT(degrees, 0.3);
}

TEST_F(SphereRun, TheCirclesOfADualFisheyeAreTwoCameras) {
  constexpr int kSize = 720;
  const double focal = 0.5 * kSize / (95 * kDegToRad);  // 190 deg
  const Camera lens(CameraModel::kKannalaBrandt, kSize, kSize,
                    {focal, focal, 0.5 * (kSize - 1) + 1.5, 0.5 * (kSize - 1) - 1, 0.012, -0.003, 0.0004, 0});
  Rigid3d back = OnAPole(0.5);
  back = Rigid3d(ExpSO3({0, std::numbers::pi, 0}), {0.01, 0, -0.03}) * back;
  Make({Mounted("cam0", lens, OnAPole(0.5)), Mounted("cam1", lens, back)});
  // Both circles into one picture.
  const fs::path run = folder_ / "runs/run1";
  std::string images, rows;
  for (size_t i = 0; i + 1 < site_.images.size(); i += 2) {
    const auto name = [&](size_t k) {
      return "images/" + std::string(6 - std::to_string(k).size(), '0') + std::to_string(k) + ".jpg";
    };
    const cv::Mat front = cv::imread((run / name(i)).string()), rear = cv::imread((run / name(i + 1)).string());
    cv::Mat both;
    cv::hconcat(front, rear, both);
    fs::remove(run / name(i + 1));
    ASSERT_TRUE(cv::imwrite((run / name(i)).string(), both));
    rows += std::to_string(1e-9 * static_cast<double>(site_.images[i].stamp_ns)) + " " + name(i) + "\n";
  }
  folder_.Write("runs/run1/images.txt", rows);
  std::string chain = ReadTextFile(run / "camchain.yaml");
  for (int camera = 0; camera < 2; ++camera) {
    const std::string topic = "  rostopic: /cam" + std::to_string(camera) + "/image_raw\n";
    chain.replace(chain.find(topic), topic.size(), "  crop: [" + std::to_string(camera * kSize) + ", 0, 720, 720]\n");
  }
  folder_.Write("runs/run1/camchain.yaml", chain);
  const Finished finished = Call({"run"});
  ASSERT_EQ(finished.exit_code, 0) << finished.err;
  const auto [metres, degrees] = LargestErrors();
  EXPECT_LT(metres, 0.05);
  EXPECT_LT(degrees, 0.2);
  EXPECT_LT(LargestTagError(), 0.03);
  EXPECT_EQ(Rows("results/localize/run1/cameras.csv"), 48u) << "each lens has a pose of its own";
}

}  // namespace
}  // namespace trigpoint

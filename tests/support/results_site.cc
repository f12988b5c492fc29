#include "tests/support/results_site.h"

#include <fmt/format.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "calib/geo/geodetic.h"
#include "datasets/colmap/model.h"
#include "datasets/io/camchain.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "datasets/io/trajectory.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

constexpr double kStep = 0.3;  // m between images
constexpr double kRate = 0.5;  // s between images
const Geodetic kOrigin{48.0, 7.8, 240.0};

// Camera axes (x right, y down, z forward) in site ENU, looking east.
const Eigen::Quaterniond kEast((Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished());

int64_t StampNs(int image) { return 1'000'000'000'000 + static_cast<int64_t>(image * kRate * 1e9); }
std::string ImageName(int image) { return fmt::format("images/{:06}.jpg", image); }
Rigid3d WorldFromCam(int image) { return {kEast, {kStep * image, 0, 1.5}}; }
std::string PanoramaName(int i) { return fmt::format("panoramas/p{:03}.jpg", i); }
std::string StationName(int i) { return fmt::format("S{}", i); }
Eigen::Vector3d PanoramaAt(const ResultsSiteSize& size, int i) {
  return {kStep * size.images * (i + 0.5) / size.panoramas, i % 2 == 0 ? 4.0 : -4.0, 2.0};
}

Camera TestCamera(const ResultsSiteSize& size) {
  const double f = 0.8 * size.image_width;
  return Camera(CameraModel::kRadtan, size.image_width, size.image_height,
                {f, f, 0.5 * (size.image_width - 1), 0.5 * (size.image_height - 1), 0, 0, 0, 0});
}

void WritePicture(const fs::path& file, int width, int height, const std::string& text) {
  cv::Mat picture(height, width, CV_8UC3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const bool dark = (x * 16 / width + y * 16 / height) % 2 == 0;
      picture.at<cv::Vec3b>(y, x) = dark ? cv::Vec3b(90, 90, static_cast<uchar>(60 + 120 * x / width))
                                         : cv::Vec3b(200, static_cast<uchar>(120 + 100 * y / height), 190);
    }
  }
  cv::putText(picture, text, {10, height / 2}, cv::FONT_HERSHEY_SIMPLEX, 0.6, {20, 20, 20}, 2, cv::LINE_AA);
  fs::create_directories(file.parent_path());
  cv::imwrite(file.string(), picture);
}

void WriteInputs(const fs::path& dir, const ResultsSiteSize& size) {
  const fs::path run = dir / "runs/run1";
  std::string list;
  std::vector<TimedPose> odometry;
  // A hundred pictures of their own; the others are the same files under other names.
  for (int i = 0; i < size.images; ++i) {
    const fs::path file = run / ImageName(i);
    if (i < 100) {
      WritePicture(file, size.image_width, size.image_height, ImageName(i));
    } else {
      fs::create_hard_link(run / ImageName(i % 100), file);
    }
    list += FormatNsAsSeconds(StampNs(i)) + " " + ImageName(i) + "\n";
    odometry.push_back({StampNs(i), Rigid3d{Eigen::Quaterniond::Identity(), {kStep * i, 0, 0}}});
  }
  WriteFileAtomically(run / "images.txt", list);
  WriteTum(run / "odometry.tum", odometry, {});
  BodyCamera camera;
  camera.name = "cam0";
  camera.camera = TestCamera(size);
  camera.cam_from_body = Rigid3d{kEast, {0, 0, 1.5}}.Inverse();
  camera.has_extrinsics = true;
  WriteCamchain(run / "camchain.yaml", {camera});
  const LocalFrame frame(kOrigin);
  CsvWriter panoramas({"file", "station", "latitude_deg", "longitude_deg", "height_m", "heading_deg"});
  CsvWriter stations({"station", "tag_id", "east_m", "north_m", "up_m"});
  CsvWriter control({"tag_id", "role", "latitude_deg", "longitude_deg", "height_m", "sigma_h_m", "sigma_v_m"});
  for (int i = 0; i < size.panoramas; ++i) {
    const fs::path file = dir / PanoramaName(i);
    if (i < 10) {
      WritePicture(file, size.panorama_width, size.panorama_width / 2, StationName(i));
    } else {
      fs::create_hard_link(dir / PanoramaName(i % 10), file);
    }
    const Geodetic g = frame.GeodeticFromEnu(PanoramaAt(size, i));
    panoramas.Text(PanoramaName(i)).Text(StationName(i));
    panoramas.Number(g.latitude_deg, 9).Number(g.longitude_deg, 9).Number(g.height_m, 4).Number(0, 1).EndRow();
    stations.Text(StationName(i)).Integer(i).Number(0, 3).Number(0, 3).Number(-1, 3).EndRow();
    if (i >= 4) continue;
    const Geodetic tag = frame.GeodeticFromEnu(PanoramaAt(size, i) + Eigen::Vector3d(0, 0, 1));
    control.Integer(i).Text(i % 2 == 0 ? "control" : "check");
    control.Number(tag.latitude_deg, 9).Number(tag.longitude_deg, 9).Number(tag.height_m, 4);
    control.Number(0.01, 3).Number(0.01, 3).EndRow();
  }
  panoramas.Save(dir / "panoramas.csv");
  stations.Save(dir / "stations.csv");
  control.Save(dir / "control_points.csv");
  WriteFileAtomically(dir / "tags.yaml", "family: tag36h11\nsize_m: 0.5\n");
  WriteFileAtomically(dir / "origin.json", "{\"lat\": 48.0, \"lon\": 7.8, \"alt\": 240.0}\n");
}

void PutPose(CsvWriter& csv, const Rigid3d& pose) {
  for (int k = 0; k < 3; ++k) csv.Number(pose.translation(k), 6);
  const Eigen::Quaterniond& q = pose.rotation;
  csv.Number(q.x(), 9).Number(q.y(), 9).Number(q.z(), 9).Number(q.w(), 9);
}

void WriteLocalized(const fs::path& out, const ResultsSiteSize& size, double off_m) {
  CsvWriter cameras(
      {"timestamp", "image", "camera", "x", "y", "z", "qx", "qy", "qz", "qw", "sigma_e_m", "sigma_n_m", "sigma_u_m"},
      {"trigpoint cameras 1; frame=enu; datum=geotags; sigma=1"});
  std::vector<TimedPose> poses;
  for (int i = 0; i < size.images; ++i) {
    cameras.Stamp(StampNs(i)).Text(ImageName(i)).Text("cam0");
    PutPose(cameras, WorldFromCam(i));
    cameras.Number(0.02, 5).Number(0.02, 5).Number(0.03, 5).EndRow();
    poses.push_back({StampNs(i), WorldFromCam(i)});
  }
  cameras.Save(out / "cameras.csv");
  WriteTum(out / "cameras.tum", poses, {});
  WriteTum(out / "cameras_odom.tum", poses, {});
  CsvWriter panoramas({"panorama",  "station",   "status",       "reason",  "x",       "y",
                       "z",         "qx",        "qy",           "qz",      "qw",      "sigma_x_m",
                       "sigma_y_m", "sigma_z_m", "view_matches", "inliers", "views",   "odom_x",
                       "odom_y",    "odom_z",    "odom_qx",      "odom_qy", "odom_qz", "odom_qw"},
                      {"trigpoint panoramas 1; frame=enu; datum=geotags; sigma=1"});
  for (int i = 0; i < size.panoramas; ++i) {
    const Rigid3d pose{kEast, PanoramaAt(size, i) + Eigen::Vector3d(off_m, 0, 0)};
    panoramas.Text(PanoramaName(i)).Text(StationName(i)).Text("localized").Text("");
    PutPose(panoramas, pose);
    panoramas.Number(0.05, 5).Number(0.05, 5).Number(0.08, 5).Integer(200).Integer(150).Integer(4);
    PutPose(panoramas, pose);
    panoramas.EndRow();
  }
  panoramas.Save(out / "panoramas.csv");
}

void WriteModel(const fs::path& out, const ResultsSiteSize& size) {
  const Camera camera = TestCamera(size);
  SparseModel model;
  model.cameras.emplace_back(1, camera);
  for (int i = 0; i < size.images; ++i) {
    ModelImage image;
    image.id = static_cast<uint32_t>(i + 1);
    image.name = ImageName(i);
    image.camera_id = 1;
    image.cam_from_world = WorldFromCam(i).Inverse();
    model.images.push_back(std::move(image));
  }
  uint32_t state = 1;  // any even spread will do
  const auto draw = [&state] {
    state = state * 1664525u + 1013904223u;
    return static_cast<double>(state >> 8) / (1 << 24);
  };
  for (int p = 0; p < size.points; ++p) {
    ModelPoint point;
    point.id = p + 1;
    const int first = static_cast<int>(draw() * std::max(1, size.images - size.observations_per_point));
    const double depth = 5 + 20 * draw();
    const Eigen::Vector2d pixel(size.image_width * (0.35 + 0.3 * draw()), size.image_height * (0.35 + 0.3 * draw()));
    point.position = WorldFromCam(first) * (depth * *camera.Unproject(pixel));
    point.error_px = 0.5;
    for (int k = 0; k < size.observations_per_point && first + k < size.images; ++k) {
      ModelImage& image = model.images[static_cast<size_t>(first + k)];
      const auto seen = camera.Project(image.cam_from_world * point.position);
      if (!seen || !camera.Contains(*seen)) continue;
      point.track.emplace_back(image.id, static_cast<uint32_t>(image.pixels.size()));
      image.pixels.push_back(*seen + Eigen::Vector2d(draw() - 0.5, draw() - 0.5));
      image.points.push_back(point.id);
    }
    model.points.push_back(std::move(point));
  }
  WriteColmapModel(model, out / "sparse");
}

void WriteDetected(const fs::path& out, const ResultsSiteSize& size) {
  CsvWriter csv({"timestamp", "image", "camera", "family", "tag_id", "hamming", "margin", "u0", "v0", "u1", "v1", "u2",
                 "v2", "u3", "v3", "sigma_px"},
                {"trigpoint detections 1"});
  for (int i = 0; i < size.images; i += 3) {
    const int tag = i * size.panoramas / size.images;
    const double u = 0.4 * size.image_width, v = 0.4 * size.image_height, side = 12 + i % 12;
    csv.Stamp(StampNs(i)).Text(ImageName(i)).Text("cam0").Text("tag36h11").Integer(tag).Integer(0).Number(80, 1);
    csv.Number(u, 3).Number(v + side, 3).Number(u + side, 3).Number(v + side, 3);
    csv.Number(u + side, 3).Number(v, 3).Number(u, 3).Number(v, 3).Number(0.1, 3).EndRow();
  }
  csv.Save(out / "detections.csv");
}

void WriteErrors(const fs::path& out, const ResultsSiteSize& size, const std::string& variant, double factor) {
  CsvWriter csv({"run",           "variant",   "method",     "station",   "panorama",  "tag_id", "reference", "kind",
                 "status",        "reason",    "error_3d_m", "error_h_m", "error_v_m", "de_m",   "dn_m",      "du_m",
                 "error_rot_deg", "sigma_e_m", "sigma_n_m",  "sigma_u_m", "nees",      "dof"},
                {"trigpoint errors 1; m"});
  for (int i = 0; i < size.panoramas; ++i) {
    const double e = factor * 0.01 * (i + 1);
    csv.Text("run1").Text(variant).Text("single").Text(StationName(i)).Text(PanoramaName(i)).Integer(i).Text("control");
    csv.Text("absolute").Text("localized").Text("").Number(e, 4).Number(e, 4).Number(0, 4).Number(e, 4).Number(0, 4);
    csv.Number(0, 4).Empty().Number(0.05, 4).Number(0.05, 4).Number(0.08, 4).Number(1, 2).Integer(3).EndRow();
  }
  csv.Save(out / "errors.csv");
}

}  // namespace

void WriteResultsSite(const fs::path& dir, const ResultsSiteSize& size) {
  WriteInputs(dir, size);
  const fs::path results = dir / "results";
  WriteLocalized(results / "localize/run1", size, 0.02);
  WriteModel(results / "localize/run1", size);
  WriteLocalized(results / "localize/run1@trial", size, 0.04);
  WriteDetected(results / "detect/run1", size);
  WriteErrors(results / "evaluate", size, "", 1);
  WriteErrors(results / "evaluate@trial", size, "trial", 2);
}

}  // namespace trigpoint

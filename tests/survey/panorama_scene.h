// A sphere of random blobs, seen by photos: what a panorama at infinity looks like.
#pragma once

#include <cmath>
#include <map>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "calib/estimation/random.h"
#include "calib/geo/geodetic.h"
#include "survey/panorama/stitch.h"

namespace trigpoint {

inline cv::Mat BlobSphere(int width, uint64_t seed) {
  Random random(seed);
  cv::Mat sphere(width / 2, width, CV_8UC3, cv::Scalar(110, 120, 130));
  for (int k = 0; k < 9000; ++k) {
    const cv::Scalar colour(random.Uniform(0, 255), random.Uniform(0, 255), random.Uniform(0, 255));
    const cv::Point at(static_cast<int>(random.Uniform(0, width)), static_cast<int>(random.Uniform(0, width / 2)));
    const cv::Size size(static_cast<int>(random.Uniform(2, 14)), static_cast<int>(random.Uniform(2, 14)));
    for (const int shift : {-width, 0, width}) {
      cv::ellipse(sphere, at + cv::Point(shift, 0), size, random.Uniform(0, 180), 0, 360, colour, -1, cv::LINE_AA);
    }
  }
  cv::GaussianBlur(sphere, sphere, cv::Size(), 0.8);
  return sphere;
}

// A photo of it, cam_from_world given; world: y down. Beyond a circle: black.
inline cv::Mat PhotoOf(const cv::Mat& sphere, const Eigen::Quaterniond& cam_from_world, const PairView& view,
                       const Lens& lens) {
  cv::Mat map(view.height, view.width, CV_32FC2);
  cv::Mat outside(view.height, view.width, CV_8U, cv::Scalar(0));
  for (int v = 0; v < view.height; ++v) {
    for (int u = 0; u < view.width; ++u) {
      const Eigen::Vector3d d = cam_from_world.conjugate() * RayOfPixel(view, lens, {u, v});
      const double azimuth = std::atan2(d.x(), d.z()), elevation = std::atan2(-d.y(), std::hypot(d.x(), d.z()));
      map.at<cv::Vec2f>(v, u) =
          cv::Vec2f(static_cast<float>((azimuth / (2 * std::numbers::pi) + 0.5) * sphere.cols - 0.5),
                    static_cast<float>((0.5 - elevation / std::numbers::pi) * sphere.rows - 0.5));
      if (view.circle && (Eigen::Vector2d(u, v) - view.circle->centre).norm() > view.circle->radius_px)
        outside.at<uchar>(v, u) = 255;
    }
  }
  cv::Mat photo;
  cv::remap(sphere, photo, map, cv::Mat(), cv::INTER_LINEAR, cv::BORDER_WRAP);
  photo.setTo(cv::Scalar(4, 4, 4), outside);
  return photo;
}

// Heading, pitch, roll (deg) of a camera in a world whose y points down and whose z is north.
inline Eigen::Quaterniond CamFromWorld(double heading_deg, double pitch_deg, double roll_deg) {
  const Eigen::Quaterniond world_from_cam = Eigen::AngleAxisd(heading_deg * kDegToRad, Eigen::Vector3d::UnitY()) *
                                            Eigen::AngleAxisd(pitch_deg * kDegToRad, Eigen::Vector3d::UnitX()) *
                                            Eigen::AngleAxisd(roll_deg * kDegToRad, Eigen::Vector3d::UnitZ());
  return world_from_cam.conjugate();
}

// Photos in memory under the names they are asked by.
struct MemorySet {
  PhotoSet set;
  std::map<std::string, cv::Mat> pictures;
  std::map<std::string, Eigen::Quaterniond> truth;  // cam_from_world

  void Add(const std::string& name, const cv::Mat& picture, std::optional<double> focal = std::nullopt) {
    Photo photo;
    photo.name = name;
    photo.width = picture.cols, photo.height = picture.rows;
    photo.focal_px = focal;
    set.photos.push_back(photo);
    pictures[name] = picture;
  }
  void AddView(const std::string& name, const cv::Mat& sphere, const Eigen::Quaterniond& cam_from_world, int width,
               int height, double focal, std::optional<double> said = std::nullopt) {
    Add(name, PhotoOf(sphere, cam_from_world, {width, height, nullptr, std::nullopt}, Lens{focal}), said);
    truth[name] = cam_from_world;
  }
  cv::Mat Grey(const Photo& photo) const {
    cv::Mat grey;
    cv::cvtColor(pictures.at(photo.name), grey, cv::COLOR_BGR2GRAY);
    return grey;
  }
  cv::Mat Colour(const Photo& photo) const { return pictures.at(photo.name); }
};

inline StitchedRig StitchSet(const MemorySet& set, const StitchOptions& options) {
  ProgressSink progress;
  CancelToken cancel;
  return StitchPhotos(
      set.set, [&](const Photo& p) { return set.Grey(p); }, options, 2, 1, progress, cancel);
}

// Errors (deg) of the placed photos' turns against the first one's.
inline std::vector<double> TurnErrors(const StitchedRig& rig, const MemorySet& set) {
  std::vector<double> errors;
  int first = -1;
  for (int i = 0; i < static_cast<int>(rig.photos.size()); ++i) {
    const RigPhoto& p = rig.state.photos[static_cast<size_t>(i)];
    const auto truth = set.truth.find(rig.photos[static_cast<size_t>(i)].name);
    if (!p.placed || truth == set.truth.end()) continue;
    if (first < 0) first = i;
    const Eigen::Quaterniond found =
        p.cam_from_rig * rig.state.photos[static_cast<size_t>(first)].cam_from_rig.conjugate();
    const Eigen::Quaterniond right =
        truth->second * set.truth.at(rig.photos[static_cast<size_t>(first)].name).conjugate();
    errors.push_back(found.angularDistance(right) * kRadToDeg);
  }
  return errors;
}

inline double LargestTurnError(const StitchedRig& rig, const MemorySet& set) {
  const std::vector<double> errors = TurnErrors(rig, set);
  return errors.empty() ? 0 : *std::max_element(errors.begin(), errors.end());
}

inline double RmsTurnError(const StitchedRig& rig, const MemorySet& set) {
  double sum = 0;
  const std::vector<double> errors = TurnErrors(rig, set);
  for (const double e : errors) sum += e * e;
  return std::sqrt(sum / static_cast<double>(errors.size()));
}

}  // namespace trigpoint

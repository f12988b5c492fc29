// A small world for tests of the localization: points with a descriptor each, seen by pinholes.
#pragma once

#include <opencv2/core/mat.hpp>
#include <utility>
#include <vector>

#include "calib/camera/camera.h"
#include "calib/estimation/random.h"
#include "datasets/colmap/database.h"

namespace trigpoint::test {

// SIFT-like: few large entries, the same for the same spot, with a little noise of the picture.
inline void FillDescriptor(uint64_t spot, uint64_t picture, uint8_t* row) {
  Random shape(Random(spot + 1).Next()), noise(Random(picture * 65537 + spot).Next());
  for (int c = 0; c < 128; ++c) {
    const double u = shape.Uniform();
    row[c] = static_cast<uint8_t>(200 * u * u * u * u + noise.Uniform(0, 6));
  }
}

struct SeenFeatures {
  FeatureSet features;
  std::vector<int> points;  // which point each feature shows
};

// All points in the image and nearer than `most_m`, `sigma_px` of noise. `spots`: what each point looks like.
inline SeenFeatures See(const Camera& camera, const Rigid3d& cam_from_world, const std::vector<Eigen::Vector3d>& points,
                        const std::vector<uint64_t>& spots, double most_m, double sigma_px, uint64_t picture) {
  SeenFeatures seen;
  Random random(picture * 1009 + 7);
  for (size_t j = 0; j < points.size(); ++j) {
    const Eigen::Vector3d in_cam = cam_from_world * points[j];
    const auto pixel = camera.Project(in_cam);
    if (!pixel || !camera.Contains(*pixel) || in_cam.norm() > most_m) continue;
    const Eigen::Vector2d noisy = *pixel + sigma_px * Eigen::Vector2d(random.Normal(), random.Normal());
    seen.features.points.push_back(noisy.cast<float>());
    seen.features.scales.push_back(static_cast<float>(40 / in_cam.norm()));
    seen.features.angles.push_back(0);
    seen.points.push_back(static_cast<int>(j));
  }
  seen.features.descriptors = cv::Mat::zeros(static_cast<int>(seen.points.size()), 128, CV_8U);
  for (size_t i = 0; i < seen.points.size(); ++i) {
    FillDescriptor(spots[static_cast<size_t>(seen.points[i])], picture,
                   seen.features.descriptors.ptr<uint8_t>(static_cast<int>(i)));
  }
  return seen;
}

inline std::vector<Eigen::Vector3d> Rays(const Camera& camera, const FeatureSet& features) {
  std::vector<Eigen::Vector3d> rays;
  for (const Eigen::Vector2f& p : features.points) rays.push_back(*camera.Unproject(p.cast<double>()));
  return rays;
}

}  // namespace trigpoint::test

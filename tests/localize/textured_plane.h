// A plane with a random texture, for tests of what pictures show.
#pragma once

#include <cmath>
#include <vector>

#include "calib/estimation/random.h"
#include "calib/geometry/rigid3.h"

namespace trigpoint {

struct Wave {
  Eigen::Vector2d frequency;
  double phase;
};

// Waves of `shortest_m` to ten times that.
inline std::vector<Wave> MakeTexture(uint64_t seed, double shortest_m = 0.1) {
  Random random(seed);
  std::vector<Wave> waves;
  for (int i = 0; i < 40; ++i) {
    const double direction = random.Uniform(0, 2 * EIGEN_PI), length_m = shortest_m * std::pow(10.0, random.Uniform());
    waves.push_back({2 * EIGEN_PI / length_m * Eigen::Vector2d(std::cos(direction), std::sin(direction)),
                     random.Uniform(0, 2 * EIGEN_PI)});
  }
  return waves;
}

inline double GreyOf(const std::vector<Wave>& texture, const Eigen::Vector2d& at) {
  double sum = 0;
  for (const Wave& w : texture) sum += std::cos(w.frequency.dot(at) + w.phase);
  return 128 + 10 * sum;
}

// Where a camera's ray meets the plane normal * x + distance = 0.
inline Eigen::Vector3d OnPlane(const Eigen::Vector3d& normal, double distance, const Rigid3d& camera_from_world,
                               const Eigen::Vector3d& ray) {
  const Eigen::Vector3d centre = camera_from_world.TargetOriginInSource();
  const Eigen::Vector3d direction = camera_from_world.rotation.conjugate() * ray;
  return centre - (normal.dot(centre) + distance) / normal.dot(direction) * direction;
}

}  // namespace trigpoint

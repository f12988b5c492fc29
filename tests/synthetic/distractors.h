// Panoramas of streets that do not exist, made fast, to give image retrieval something to get wrong.
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>

#include "tests/synthetic/scene.h"

namespace trigpoint {

struct DistractorOptions {
  int width = 2048;  // of the equirectangular picture; its height is half of it
  int facades = 5;   // on each side of the street
  int cars = 5;
  double px_per_m = 32;  // of the facades
};

// A street of houses whose windows repeat, with ground, cars and posters; all of it drawn from `seed`.
Scene DistractorScene(const DistractorOptions& options, uint64_t seed);

// That street from its middle, equirectangular, BGR, with its own light and exposure.
cv::Mat MakeDistractorPanorama(const DistractorOptions& options, uint64_t seed, int threads);

// Adds an upright rectangle between two ground points: seen from the left of a -> b, the picture is the right way
// round.
void AddWall(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double height, std::shared_ptr<const Texture> texture,
             Scene* scene);
// Adds a parked car: four sides and a roof. Centre on the ground, direction of travel.
void AddCar(const Eigen::Vector3d& centre, const Eigen::Vector2d& direction, uint64_t seed, Scene* scene);

}  // namespace trigpoint

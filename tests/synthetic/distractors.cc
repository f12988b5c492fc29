#include "tests/synthetic/distractors.h"

#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "calib/estimation/random.h"
#include "calib/geo/geodetic.h"
#include "tests/synthetic/texture.h"

namespace trigpoint {

using Eigen::Vector2d;
using Eigen::Vector3d;

void AddWall(const Vector3d& a, const Vector3d& b, double height, std::shared_ptr<const Texture> texture,
             Scene* scene) {
  // Who stands to the left of a -> b and looks at the wall has b at his left.
  scene->planes.push_back({b + Vector3d(0, 0, height), a - b, Vector3d(0, 0, -height), std::move(texture)});
}

void AddCar(const Vector3d& centre, const Vector2d& direction, uint64_t seed, Scene* scene) {
  const double length = 4.2, width = 1.8, height = 1.5;
  const Vector3d t(direction.x(), direction.y(), 0), n(-t.y(), t.x(), 0);
  const auto side = std::make_shared<Texture>(CarTexture(seed, true)),
             end = std::make_shared<Texture>(CarTexture(seed, false));
  Vector3d corner[4];
  for (int i = 0; i < 4; ++i) {
    corner[i] = centre + (i == 0 || i == 3 ? -0.5 : 0.5) * length * t + (i < 2 ? -0.5 : 0.5) * width * n;
  }
  // Counter-clockwise from the rear right: the outside is on the right of each edge.
  for (int i = 0; i < 4; ++i) AddWall(corner[(i + 1) % 4], corner[i], height, i % 2 == 0 ? side : end, scene);
  cv::Mat roof = CarTexture(seed, true);
  roof = roof(cv::Rect(roof.cols / 3, roof.rows / 2, 30, 16)).clone();
  scene->planes.push_back(
      {corner[3] + Vector3d(0, 0, height), length * t, -width * n, std::make_shared<Texture>(roof)});
}

Scene DistractorScene(const DistractorOptions& options, uint64_t seed) {
  Random random(Random(seed).Next());
  Scene scene;
  scene.sun = {random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(0.3, 1)};
  scene.ambient = random.Uniform(0.45, 0.85);
  const auto clouds = std::make_shared<Texture>(CloudTexture(512, random.Uniform(0.1, 1), random.Next()));
  scene.planes.push_back({{-1500, 1500, 150}, {3000, 0, 0}, {0, -3000, 0}, clouds});

  double reach = 0;
  for (const double side : {-1.0, 1.0}) {
    double x = 0;
    std::vector<std::array<double, 3>> houses;  // start, end, setback
    for (int i = 0; i < options.facades; ++i) {
      const double width = random.Uniform(8, 24), setback = random.Uniform(6, 16);
      houses.push_back({x, x + width, setback});
      x += width;
    }
    reach = std::max(reach, x / 2);
    for (const auto& [start, end, setback] : houses) {
      FacadeOptions facade;
      facade.width_m = end - start;
      facade.height_m = random.Uniform(5, 16);
      facade.px_per_m = options.px_per_m;
      facade.variety = random.Uniform(0.1, 0.9);
      const auto texture = std::make_shared<Texture>(FacadeTexture(facade, random.Next()));
      const Vector3d a(start - x / 2, side * setback, 0), b(end - x / 2, side * setback, 0);
      if (side < 0) {
        AddWall(a, b, facade.height_m, texture, &scene);
      } else {
        AddWall(b, a, facade.height_m, texture, &scene);
      }
    }
  }
  for (const double end : {-1.0, 1.0}) {  // a house across each end of the street
    FacadeOptions facade;
    facade.width_m = 40;
    facade.height_m = random.Uniform(6, 14);
    facade.px_per_m = options.px_per_m / 2;
    const double x = end * (reach + random.Uniform(3, 15));
    const auto texture = std::make_shared<Texture>(FacadeTexture(facade, random.Next()));
    AddWall({x, end * 20, 0}, {x, -end * 20, 0}, facade.height_m, texture, &scene);
  }
  const double length = 2 * reach + 40;
  const auto ground = std::make_shared<Texture>(GroundTexture(length, 40, options.px_per_m / 2, random.Next()));
  scene.planes.push_back({{-length / 2, 20, 0}, {length, 0, 0}, {0, -40, 0}, ground});
  // Newer asphalt where the camera stands, finely resolved because it is near.
  const auto near_ground = std::make_shared<Texture>(GroundTexture(24, 14, 1.5 * options.px_per_m, random.Next()));
  scene.planes.push_back({{-12, 7, 0.01}, {24, 0, 0}, {0, -14, 0}, near_ground});
  for (int i = 0; i < options.cars; ++i) {
    const double x = random.Uniform(-20, 20), y = (random.Uniform() < 0.5 ? -1 : 1) * random.Uniform(3, 5.5);
    const double turn = random.Uniform(-0.1, 0.1) + (random.Uniform() < 0.5 ? std::numbers::pi : 0);
    AddCar({x, y, 0}, {std::cos(turn), std::sin(turn)}, random.Next(), &scene);
  }
  return scene;
}

cv::Mat MakeDistractorPanorama(const DistractorOptions& options, uint64_t seed, int threads) {
  const Scene scene = DistractorScene(options, seed);
  Random random(Random(seed).Next() + 1);
  const Attitude attitude = {random.Uniform(0, 2 * std::numbers::pi), random.Uniform(-0.03, 0.03),
                             random.Uniform(-0.03, 0.03)};
  const Vector3d position(random.Uniform(-6, 6), random.Uniform(-1.5, 1.5), random.Uniform(1.6, 2.6));
  RenderOptions render;
  render.supersample = 1;
  render.gain = random.Uniform(0.75, 1.15);
  render.noise_sigma = 2;
  render.seed = seed;
  render.threads = threads;
  return Render(scene, Camera::Equirectangular(options.width, options.width / 2),
                Rigid3d(WorldFromCamRotation(attitude), position), render);
}

}  // namespace trigpoint

// Uses the installed headers and libraries: a pixel's ray, a position on the Earth, a model written and read back.
#include <cstdio>

#include "calib/camera/camera.h"
#include "calib/geo/geodetic.h"
#include "datasets/colmap/model.h"

int main(int, char** argv) {
  const auto camera = trigpoint::Camera::FromFieldOfView(640, 480, 1.2);
  const auto ray = camera.Unproject({319.5, 239.5});
  const trigpoint::LocalFrame frame({48.0, 7.8, 240});
  const Eigen::Vector3d enu = frame.EnuFromGeodetic(frame.GeodeticFromEnu({1, 2, 3}));
  trigpoint::SparseModel model;
  model.cameras.emplace_back(1, camera);
  trigpoint::WriteColmapModel(model, argv[1]);
  const bool same = trigpoint::ReadColmapModel(argv[1]).cameras.size() == 1;
  const bool good = ray && ray->z() > 0.999999 && (enu - Eigen::Vector3d(1, 2, 3)).norm() < 1e-6 && same;
  std::puts(good ? "installed trigpoint works" : "installed trigpoint is wrong");
  return good ? 0 : 1;
}

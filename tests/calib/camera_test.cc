#include "calib/camera/camera.h"

#include <gtest/gtest.h>

#include <limits>
#include <numbers>
#include <opencv2/calib3d.hpp>

#include "calib/base/error.h"
#include "calib/geometry/bearing.h"
#include "tests/support/numeric.h"

namespace trigpoint {
namespace {

constexpr double kPi = std::numbers::pi;

struct Named {
  const char* name;
  Camera camera;
};

std::vector<Named> Cameras() {
  return {
      {"Pinhole", Camera(CameraModel::kPinhole, 960, 600, {402.8, 410.1, 470.2, 305.5})},
      {"PinholeWide", Camera::FromFieldOfView(800, 600, 2.4)},
      {"RadtanBarrel",
       Camera(CameraModel::kRadtan, 752, 480, {458.7, 457.3, 367.2, 248.4, -0.2834, 0.0740, 1.9e-4, 1.8e-5})},
      {"RadtanPincushion", Camera(CameraModel::kRadtan, 640, 480, {500, 505, 315, 245, 0.12, 0.05, -1e-3, 2e-3, 0.01})},
      {"Rational", Camera(CameraModel::kRational, 1280, 720,
                          {610, 609.8, 637.6, 366.9, 0.516, -2.58, 9e-4, -1e-4, 1.45, 0.395, -2.41, 1.38})},
      {"KannalaBrandt",
       Camera(CameraModel::kKannalaBrandt, 848, 800, {284.9, 285.9, 425.2, 398.5, -0.0073, 0.0438, -0.0415, 0.0075})},
      {"KannalaBrandt200Deg",
       Camera(CameraModel::kKannalaBrandt, 1200, 1200, {330, 330, 599.5, 599.5, 0.01, -0.002, 0.001, -0.0001})},
      {"Equirectangular", Camera::Equirectangular(2048, 1024)},
  };
}

class EveryCamera : public testing::TestWithParam<Named> {
 protected:
  // A grid over the image, corners and the principal point included.
  std::vector<Eigen::Vector2d> Pixels() const {
    const Camera& c = GetParam().camera;
    std::vector<Eigen::Vector2d> pixels;
    for (int i = 0; i <= 40; ++i) {
      for (int j = 0; j <= 40; ++j) pixels.emplace_back((c.width() - 1) * i / 40.0, (c.height() - 1) * j / 40.0);
    }
    if (c.params().size() >= 4) pixels.emplace_back(c.params()[2], c.params()[3]);
    return pixels;
  }
};

TEST_P(EveryCamera, PixelToRayAndBack) {
  const Camera& camera = GetParam().camera;
  int valid = 0;
  for (const Eigen::Vector2d& pixel : Pixels()) {
    const auto ray = camera.Unproject(pixel);
    if (!ray) continue;
    ++valid;
    EXPECT_NEAR(ray->norm(), 1, 1e-12);
    for (const double depth : {1e-3, 1.0, 1e4}) {
      const auto back = camera.Project(depth * *ray);
      ASSERT_TRUE(back) << pixel.transpose();
      EXPECT_LT((*back - pixel).norm(), 1e-9 * std::max(1.0, camera.MeanFocal())) << pixel.transpose();
    }
  }
  EXPECT_EQ(valid, static_cast<int>(Pixels().size())) << "the model must have a ray all over this image";
}

TEST_P(EveryCamera, RayToPixelAndBack) {
  const Camera& camera = GetParam().camera;
  Random random(1);
  int valid = 0;
  for (int i = 0; i < 3000; ++i) {
    const Eigen::Vector3d ray = RandomNormal3(random).normalized();
    const auto pixel = camera.Project(7 * ray);
    if (!pixel || !camera.Contains(*pixel)) continue;
    ++valid;
    const auto back = camera.Unproject(*pixel);
    ASSERT_TRUE(back) << ray.transpose();
    EXPECT_LT(AngleBetween(*back, ray), 1e-9) << ray.transpose();
  }
  EXPECT_GT(valid, 100);
}

TEST_P(EveryCamera, JacobianIsTheDerivative) {
  const Camera& camera = GetParam().camera;
  for (const Eigen::Vector2d& pixel : Pixels()) {
    const Eigen::Vector3d point = 3.0 * camera.Unproject(pixel).value();
    const bool at_seam =
        camera.model() == CameraModel::kEquirectangular && (pixel.x() < 1 || pixel.x() > camera.width() - 2);
    if (at_seam) continue;
    Eigen::Matrix<double, 2, 3> jacobian;
    camera.Project(point, &jacobian);
    const Eigen::MatrixXd numeric =
        NumericJacobian([&](const Eigen::VectorXd& p) { return camera.Project(p).value(); }, point, 1e-7);
    EXPECT_LT((jacobian - numeric).norm(), 2e-6 * (1 + jacobian.norm())) << pixel.transpose();
    EXPECT_LT((jacobian * point).norm(), 1e-9 * (1 + jacobian.norm())) << "pixels do not change along the ray";
  }
}

TEST_P(EveryCamera, JacobianOnAndNearTheAxis) {
  const Camera& camera = GetParam().camera;
  for (const double off : {0.0, 1e-13, 1e-10, 1e-8, 1e-5}) {
    const Eigen::Vector3d point(off, -0.5 * off, 2);
    Eigen::Matrix<double, 2, 3> jacobian;
    ASSERT_TRUE(camera.Project(point, &jacobian));
    const Eigen::MatrixXd numeric =
        NumericJacobian([&](const Eigen::VectorXd& p) { return camera.Project(p).value(); }, point, 1e-5);
    EXPECT_LT((jacobian - numeric).norm(), 1e-5 * jacobian.norm()) << off;
  }
}

TEST_P(EveryCamera, BearingSqrtInfoWhitensPixelNoise) {
  const Camera& camera = GetParam().camera;
  Random random(2);
  const double sigma = 0.7;
  const int w = camera.width(), h = camera.height();
  for (const Eigen::Vector2d& pixel :
       {Eigen::Vector2d(0.5 * w, 0.5 * h), Eigen::Vector2d(0.1 * w, 0.2 * h), Eigen::Vector2d(0.9 * w, 0.7 * h)}) {
    const auto whiten = camera.BearingSqrtInfo(pixel, sigma);
    EXPECT_LT((whiten * camera.Unproject(pixel).value()).norm(), 1e-9);
    Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
    const int n = 20000;
    for (int i = 0; i < n; ++i) {
      const double du = sigma * random.Normal(), dv = sigma * random.Normal();
      const Eigen::Vector2d r = whiten * camera.Unproject(pixel + Eigen::Vector2d(du, dv)).value();
      scatter += r * r.transpose() / n;
    }
    EXPECT_LT(CovarianceDeviation(scatter, Eigen::Matrix2d::Identity()), 0.06) << pixel.transpose();
  }
}

TEST_P(EveryCamera, ScaledSeesTheSameRays) {
  const Camera& camera = GetParam().camera;
  for (const double factor : {0.5, 0.25, 2.0, 0.37}) {
    const Camera scaled = camera.Scaled(factor);
    EXPECT_EQ(scaled.width(), std::lround(camera.width() * factor));
    const Eigen::Vector2d ratio(static_cast<double>(scaled.width()) / camera.width(),
                                static_cast<double>(scaled.height()) / camera.height());
    for (const Eigen::Vector2d& pixel : Pixels()) {
      const Eigen::Vector2d there = (pixel.array() + 0.5) * ratio.array() - 0.5;  // edges stay edges
      EXPECT_LT(AngleBetween(scaled.Unproject(there).value(), camera.Unproject(pixel).value()), 1e-9) << factor;
    }
  }
}

TEST_P(EveryCamera, RefusesWhatIsNotANumber) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(GetParam().camera.Unproject({nan, 3}));
  EXPECT_FALSE(GetParam().camera.Project({nan, 0, 1}));
  EXPECT_FALSE(GetParam().camera.Project({0, 0, nan}));
  EXPECT_FALSE(GetParam().camera.Project({0, 0, 0}));
}

INSTANTIATE_TEST_SUITE_P(All, EveryCamera, testing::ValuesIn(Cameras()), [](const auto& p) { return p.param.name; });

std::vector<cv::Point3d> PointsInView(const Camera& camera, Random& random) {
  std::vector<cv::Point3d> points;
  while (points.size() < 200) {
    const Eigen::Vector2d pixel(random.Uniform(0, camera.width() - 1), random.Uniform(0, camera.height() - 1));
    const Eigen::Vector3d p = random.Uniform(1, 20) * camera.Unproject(pixel).value();
    if (p.z() > 0.1) points.emplace_back(p.x(), p.y(), p.z());
  }
  return points;
}

TEST(Camera, ProjectsAsOpenCvDoes) {
  Random random(3);
  for (const auto& [name, camera] : Cameras()) {
    const std::vector<double>& p = camera.params();
    if (p.size() < 4) continue;
    const cv::Mat k = (cv::Mat_<double>(3, 3) << p[0], 0, p[2], 0, p[1], p[3], 0, 0, 1);
    const cv::Mat distortion(std::vector<double>(p.begin() + 4, p.end()), true);
    const std::vector<cv::Point3d> points = PointsInView(camera, random);
    std::vector<cv::Point2d> pixels;
    if (camera.model() == CameraModel::kKannalaBrandt) {
      cv::fisheye::projectPoints(points, pixels, cv::Vec3d(), cv::Vec3d(), k, distortion);
    } else {
      cv::projectPoints(points, cv::Vec3d(), cv::Vec3d(), k, distortion, pixels);
    }
    for (size_t i = 0; i < points.size(); ++i) {
      const auto ours = camera.Project({points[i].x, points[i].y, points[i].z});
      ASSERT_TRUE(ours) << name;
      EXPECT_LT((*ours - Eigen::Vector2d(pixels[i].x, pixels[i].y)).norm(), 1e-8) << name;
    }
  }
}

TEST(Camera, NothingBehindAPinhole) {
  const Camera camera = Camera::FromFieldOfView(640, 480, kPi / 2);
  EXPECT_FALSE(camera.Project({0, 0, -1}));
  EXPECT_FALSE(camera.Project({1, 0, 0}));
  EXPECT_TRUE(camera.Project({1, 0, 1e-2}));  // far outside the image, but in front
}

TEST(Camera, NinetyDegreesPutTheImageEdgeAtFortyFive) {
  const Camera camera = Camera::FromFieldOfView(1024, 1024, kPi / 2);
  EXPECT_LT((camera.Project({1, 0, 1}).value() - Eigen::Vector2d(1023.5, 511.5)).norm(),
            1e-9);  // the last pixel's edge
  EXPECT_LT((camera.Unproject({511.5, 511.5}).value() - Eigen::Vector3d::UnitZ()).norm(), 1e-15);
}

TEST(Camera, FisheyeSeesBehindItself) {
  const Camera camera = Cameras()[6].camera;
  const double theta = 1.75;  // 100 deg from the axis
  const auto pixel = camera.Project({std::sin(theta), 0, std::cos(theta)});
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(AngleBetween(camera.Unproject(*pixel).value(), Eigen::Vector3d::UnitZ()), theta, 1e-9);
  EXPECT_FALSE(camera.Project({0, 0, -1}));  // straight behind has no azimuth
}

TEST(Camera, DistortionThatFoldsBackHasNoRaysBeyondItsFold) {
  // r (1 - 0.3 r^2) grows up to r = 1.054, where it is 0.703.
  const Camera camera(CameraModel::kRadtan, 1000, 1000, {500, 500, 499.5, 499.5, -0.3, 0, 0, 0});
  EXPECT_TRUE(camera.Project({1.0, 0, 1}));
  EXPECT_FALSE(camera.Project({1.2, 0, 1}));
  EXPECT_TRUE(camera.Unproject({499.5 + 500 * 0.69, 499.5}));
  EXPECT_FALSE(camera.Unproject({499.5 + 500 * 0.72, 499.5}));
  EXPECT_THROW(camera.BearingSqrtInfo({499.5 + 500 * 0.72, 499.5}, 1), NumericError);
  // Every ray that is given comes back to its pixel, up to the fold.
  for (double r = 0; r < 0.71; r += 0.001) {
    const Eigen::Vector2d pixel(499.5 + 500 * r, 499.5);
    if (const auto ray = camera.Unproject(pixel)) {
      EXPECT_LT((camera.Project(*ray).value() - pixel).norm(), 1e-6) << r;
    } else {
      EXPECT_GT(r, 0.70);
    }
  }
}

TEST(Equirectangular, CentreSeamAndPoles) {
  const Camera camera = Camera::Equirectangular(4096, 2048);
  const auto ray = [&](double u, double v) { return camera.Unproject({u, v}).value(); };
  EXPECT_LT((ray(2047.5, 1023.5) - Eigen::Vector3d::UnitZ()).norm(), 1e-14);  // the image centre looks along +z
  EXPECT_LT((ray(3071.5, 1023.5) - Eigen::Vector3d::UnitX()).norm(), 1e-14);  // a quarter to the right is +x
  EXPECT_LT((ray(2047.5, 2047.5) - Eigen::Vector3d::UnitY()).norm(), 1e-14);  // the bottom edge is down
  // The left and the right edge are the same direction, and a step over the seam is as long as any other.
  EXPECT_LT((ray(-0.5, 900) - ray(4095.5, 900)).norm(), 1e-12);
  EXPECT_NEAR(AngleBetween(ray(4095, 1023.5), ray(0, 1023.5)), 2 * kPi / 4096, 1e-12);
  // Just left and right of straight behind come out at the two ends of the image, inside it.
  const Eigen::Vector2d left = camera.Project({-1e-6, 0, -1}).value(), right = camera.Project({1e-6, 0, -1}).value();
  EXPECT_NEAR(left.x(), -0.5, 1e-2);
  EXPECT_NEAR(right.x(), 4095.5, 1e-2);
  EXPECT_TRUE(camera.Contains(left));
  EXPECT_TRUE(camera.Contains(right));
  // At the poles: a pixel, finite derivatives.
  for (const double sign : {-1.0, 1.0}) {
    Eigen::Matrix<double, 2, 3> jacobian;
    const auto pole = camera.Project({0, sign, 0}, &jacobian);
    ASSERT_TRUE(pole);
    EXPECT_NEAR(pole->y(), sign > 0 ? 2047.5 : -0.5, 1e-9);
    EXPECT_TRUE(jacobian.allFinite());
  }
}

TEST(Camera, RefusesBadParameters) {
  EXPECT_THROW(Camera(CameraModel::kPinhole, 0, 480, {1, 1, 0, 0}), InputError);
  EXPECT_THROW(Camera(CameraModel::kPinhole, 640, 480, {1, 1, 0}), InputError);
  EXPECT_THROW(Camera(CameraModel::kPinhole, 640, 480, {-500, 500, 320, 240}), InputError);
  EXPECT_THROW(Camera(CameraModel::kRadtan, 640, 480, {500, 500, 320, std::nan(""), 0, 0, 0, 0}), InputError);
  EXPECT_THROW(Camera(CameraModel::kRational, 640, 480, {500, 500, 320, 240, 0, 0, 0, 0}), InputError);
}

}  // namespace
}  // namespace trigpoint

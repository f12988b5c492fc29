// The focal length of photos that EXIF states roughly: found as well as is said, and not where nothing shows it.
#include "localize/references/photo_focal.h"

#include <gtest/gtest.h>

#include <cmath>
#include <deque>

#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

constexpr double kStated_px = 500, kShare = 0.05, kPixel_px = 1, kPoint_m = 0.01;
constexpr int kPoints = 60;

Camera CameraOf(double focal_px) {
  return Camera(CameraModel::kPinhole, 1000, 800, {focal_px, focal_px, 499.5, 399.5});
}

// Photos of a focal length drawn by its prior, that show points with errors of their own; each starts where the stated
// focal length puts it: back or forward by the share that it is wrong.
class Draw {
 public:
  Draw(int photos, double nearest_m, double farthest_m, uint64_t seed, double scatter = 0) : random_(seed) {
    factor_ = std::exp(kShare * random_.Normal());
    const double all = factor_;
    for (int k = 0; k < photos; ++k) {
      factor_ = all * std::exp(scatter * random_.Normal());
      Take(nearest_m, farthest_m);
    }
  }
  PhotoFocal Estimate() const {
    std::vector<RegisteredPhoto> placed;
    for (size_t k = 0; k < photos_.size(); ++k) placed.push_back({photos_[k], registrations_[k]});
    return EstimateFocal(placed, points_, std::vector<Eigen::Matrix3d>(points_.size(), Covariance()), {}, 0, kShare);
  }
  double factor() const { return factor_; }  // of the last photo

 private:
  static Eigen::Matrix3d Covariance() { return kPoint_m * kPoint_m * Eigen::Matrix3d::Identity(); }

  void Take(double nearest_m, double farthest_m) {
    ReferenceViews& photo = photos_.emplace_back();
    photo.rig.views.push_back({"photo", CameraOf(kStated_px), Rigid3d(), Matrix6d::Zero()});
    Registration& answer = registrations_.emplace_back();
    const double middle_m = 0.5 * (nearest_m + farthest_m);
    answer.rig_from_odom.translation = Eigen::Vector3d(0.05, -0.05, (1 / factor_ - 1) * middle_m);
    while (answer.inliers.size() < kPoints) {
      const Eigen::Vector3d y(random_.Uniform(-8, 8), random_.Uniform(-6, 6), random_.Uniform(nearest_m, farthest_m));
      const auto pixel = CameraOf(kStated_px * factor_).Project(y);
      if (!pixel || !CameraOf(kStated_px).Contains(*pixel)) continue;
      ViewObservation o;
      o.point = static_cast<int>(points_.size());
      o.pixel = (*pixel + kPixel_px * Eigen::Vector2d(random_.Normal(), random_.Normal())).cast<float>();
      answer.inliers.push_back(o);
      points_.push_back(y + kPoint_m * Eigen::Vector3d(random_.Normal(), random_.Normal(), random_.Normal()));
    }
  }

  Random random_;
  double factor_ = 1;
  std::deque<ReferenceViews> photos_;
  std::deque<Registration> registrations_;
  std::vector<Eigen::Vector3d> points_;
};

struct Errors {
  double nees = 0, sigma = 0, mean_sigma = 0;
};

Errors Redraw(int photos, double nearest_m, double farthest_m, double scatter = 0) {
  constexpr int kRedraws = 200;
  Errors mean;
  for (int k = 0; k < kRedraws; ++k) {
    const Draw draw(photos, nearest_m, farthest_m, static_cast<uint64_t>(k), scatter);
    const PhotoFocal focal = draw.Estimate();
    EXPECT_EQ(focal.photos, photos);
    EXPECT_EQ(focal.points, photos * kPoints);
    const double e = std::log(focal.factor / draw.factor()) / focal.sigma;
    mean.nees += e * e / kRedraws, mean.sigma += focal.sigma / kRedraws;
    mean.mean_sigma += focal.mean_sigma / kRedraws;
  }
  return mean;
}

// Chi-square with 200 degrees of freedom: a 99.9 % band of 0.70 to 1.36.
void ExpectCalibrated(const Errors& errors) {
  EXPECT_GT(errors.nees, 0.70);
  EXPECT_LT(errors.nees, 1.36);
}

TEST(EstimateFocal, IsFoundFromPointsAtSeveralDistances) {
  const Errors one = Redraw(1, 6, 30), four = Redraw(4, 6, 30);
  ExpectCalibrated(one), ExpectCalibrated(four);
  EXPECT_LT(one.sigma, 0.1 * kShare);
  EXPECT_NEAR(four.mean_sigma, one.mean_sigma / 2, 0.1 * one.mean_sigma);
}

// Focus or another phone: what is said holds for each of the photos.
TEST(EstimateFocal, SaysHowMuchThePhotosDiffer) {
  constexpr double kScatter = 0.02;
  const Errors errors = Redraw(6, 6, 30, kScatter);
  EXPECT_LT(errors.nees, 2);  // of six photos the scatter itself is known to a third only
  EXPECT_NEAR(errors.sigma, kScatter, 0.25 * kScatter);
}

// Nearer with a shorter focal length looks the same.
TEST(EstimateFocal, StaysAsStatedBeforeAFlatWall) {
  const Errors wall = Redraw(1, 10, 10);
  ExpectCalibrated(wall);
  EXPECT_GT(wall.sigma, 0.9 * kShare);
}

}  // namespace
}  // namespace trigpoint

// The photo of a hand-held set that stands elsewhere than the others.
#include "localize/references/stray_photo.h"

#include <gtest/gtest.h>

#include <cmath>

#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

constexpr double kHeld_m = 0.15;

struct Photos {
  std::vector<Eigen::Vector3d> places;
  std::vector<Eigen::Matrix3d> covariances;
  int Stray() const { return StrayPhoto(places, covariances, kHeld_m); }
};

// Each known along its line of sight worse than across.
Photos Draw(size_t count, Random* random) {
  Photos photos;
  for (size_t k = 0; k < count; ++k) {
    const Eigen::Vector3d ray = Eigen::Vector3d(random->Normal(), random->Normal(), 0.1).normalized();
    const Eigen::Matrix3d root =
        0.02 * Eigen::Matrix3d::Identity() + random->Uniform(0.02, 0.3) * ray * ray.transpose();
    const auto normal = [&] { return Eigen::Vector3d(random->Normal(), random->Normal(), random->Normal()); };
    photos.places.push_back(Eigen::Vector3d(10, -5, 2) + kHeld_m * normal() + root * normal());
    photos.covariances.push_back(root * root.transpose());
  }
  return photos;
}

TEST(StrayPhoto, IsFoundBySigmasOfItsOwn) {
  Random random(3);
  for (size_t count = 3; count <= 8; ++count) {
    Photos photos = Draw(count, &random);
    photos.places[1] = Eigen::Vector3d(10, -5, 2.9);
    photos.covariances[1] = std::pow(0.1, 2) * Eigen::Matrix3d::Identity();
    EXPECT_EQ(photos.Stray(), 1) << count;
    photos.covariances[1] = Eigen::Matrix3d::Identity();  // 0.9 m say nothing of what is known to a metre
    EXPECT_EQ(photos.Stray(), -1) << count;
  }
}

TEST(StrayPhoto, OfTwoEitherMayBeWrong) {
  Random random(4);
  Photos photos = Draw(2, &random);
  photos.places[1].x() += 10;
  EXPECT_EQ(photos.Stray(), -1);
}

TEST(StrayPhoto, GoodPhotosAreRarelyTakenForOne) {
  Random random(5);
  int strays = 0;
  for (int draw = 0; draw < 1000; ++draw) strays += Draw(4, &random).Stray() >= 0 ? 1 : 0;
  EXPECT_LT(strays, 15);  // 4 of 1,000 photos each
}

}  // namespace
}  // namespace trigpoint

#include "tests/synthetic/synthetic_features.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

namespace trigpoint {
namespace {

TEST(SyntheticFeatures, APointLooksTheSameEverywhereAndLikeNoOther) {
  SyntheticOptions options;
  options.length_m = 20;
  options.panoramas = 2;
  const SyntheticSite site = MakeSyntheticSite(options, 4);
  const FeatureSet a = SyntheticImageFeatures(site, 0), b = SyntheticImageFeatures(site, 1);
  ASSERT_EQ(a.size(), site.images[0].observations.size());
  ASSERT_EQ(static_cast<size_t>(a.descriptors.rows), a.size());
  int shared = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a.points[i], site.images[0].observations[i].pixel.cast<float>());
    for (size_t j = 0; j < b.size(); ++j) {
      const double distance = cv::norm(a.descriptors.row(static_cast<int>(i)), b.descriptors.row(static_cast<int>(j)));
      const bool same = site.images[0].observations[i].point == site.images[1].observations[j].point;
      shared += same;
      if (same) {
        EXPECT_LT(distance, 60);
        EXPECT_GT(distance, 0);
      } else {
        EXPECT_GT(distance, 300);
      }
    }
  }
  EXPECT_GT(shared, 30);
}

TEST(SyntheticFeatures, ViewsHaveTheirObservationsInOrder) {
  SyntheticOptions options;
  options.length_m = 20;
  options.panoramas = 2;
  const SyntheticSite site = MakeSyntheticSite(options, 4);
  size_t sum = 0;
  for (int v = 0; v < options.views; ++v) {
    const FeatureSet view = SyntheticViewFeatures(site, 1, v);
    size_t k = 0;
    for (const SyntheticViewObservation& o : site.panoramas[1].observations) {
      if (o.view == v) {
        EXPECT_EQ(view.points[k++], o.pixel.cast<float>());
      }
    }
    EXPECT_EQ(k, view.size());
    sum += k;
  }
  EXPECT_EQ(sum, site.panoramas[1].observations.size());
}

}  // namespace
}  // namespace trigpoint

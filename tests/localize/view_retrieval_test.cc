// Of many references, a run is tested with those of its region.
#include "localize/references/view_retrieval.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "tests/localize/test_scene.h"

namespace trigpoint {
namespace {

constexpr int kColumns = 15, kReferences = 225, kImages = 12;
constexpr double kSpacing = 50;  // m, between references
constexpr int kFirst = 7 * kColumns + 1;

// A town: references on a square grid, one view each. The run passes those from kFirst on, one image at each.
class Town : public testing::Test {
 protected:
  Town() {
    input_.has_frame = true;
    input_.frame = LocalFrame({48, 9, 300});
    for (int r = 0; r < kReferences; ++r) {
      ReferenceViews reference;
      reference.rig.views.resize(1);
      reference.geotag.has_position = true;
      reference.geotag.position = input_.frame.GeodeticFromEnu(PlaceOf(r));
      input_.references.push_back(reference);
    }
    for (int i = 0; i < kImages; ++i) {
      input_.images.push_back({i, std::to_string(i), 0, i});
      input_.odom_from_body.push_back(Rigid3d(Eigen::Quaterniond::Identity(), {kSpacing * i, 0, 0}));
    }
    input_.image_features = [](int image) { return Seen(kFirst + image, 2); };
    options_.most_references = 60;
    CodebookOptions few;
    few.words = 500;
    const auto descriptors = [](int reference) { return DescriptorBlock(Seen(reference, 1).descriptors); };
    std::vector<std::pair<int, int>> views;
    for (int r = 0; r < kReferences; ++r) views.emplace_back(r, 0);
    const auto index = std::make_shared<const ViewIndex>(
        ViewIndex{IndexInMemory(kReferences, descriptors, few, 1, 1, {}), std::move(views)});
    input_.view_index = [index] { return index; };
  }
  static Eigen::Vector3d PlaceOf(int reference) {
    return {kSpacing * (reference % kColumns), kSpacing * (reference / kColumns), 0};
  }
  // A place has 150 spots of its own, and 50 of 200 that are everywhere.
  static FeatureSet Seen(int place, uint64_t picture) {
    FeatureSet f;
    f.descriptors = cv::Mat(200, 128, CV_8U);
    Random random(static_cast<uint64_t>(place) * 10 + picture);
    for (int k = 0; k < f.descriptors.rows; ++k) {
      const uint64_t spot = k < 150 ? 1000 + 150 * static_cast<uint64_t>(place) + static_cast<uint64_t>(k)
                                    : static_cast<uint64_t>(random.Below(200));
      test::FillDescriptor(spot, picture * 100000 + static_cast<uint64_t>(place), f.descriptors.ptr<uint8_t>(k));
    }
    return f;
  }
  Retrieval Retrieve(const std::vector<GpsPlace>& gps) {
    ProgressSink progress;
    return RetrieveViews(input_, gps, options_, 30, false, 1, 1, progress, {});
  }
  std::vector<GpsPlace> Gps(const Eigen::Vector3d& offset) const {
    std::vector<GpsPlace> gps(kImages);
    for (int i = 0; i < kImages; ++i) {
      gps[static_cast<size_t>(i)].pose = i;
      gps[static_cast<size_t>(i)].position = PlaceOf(kFirst + i) + offset;
    }
    return gps;
  }
  static int OfRun(const std::vector<char>& tested) {
    return static_cast<int>(std::count(tested.begin() + kFirst, tested.begin() + kFirst + kImages, 1));
  }

  LocalizeInput input_;
  RetrievalOptions options_;
};

TEST_F(Town, ImagesTellTheRegion) {
  const Retrieval found = Retrieve({});
  EXPECT_EQ(std::count(found.tested.begin(), found.tested.end(), 1), 60);
  EXPECT_EQ(OfRun(found.tested), kImages);
  // Asked again among these alone, each image names its own place first.
  for (size_t i = 0; i < kImages; ++i) {
    ASSERT_FALSE(found.of_image[i].empty());
    EXPECT_EQ(found.of_image[i].front().reference, kFirst + static_cast<int>(i));
    for (const Retrieval::Hit& hit : found.of_image[i]) EXPECT_TRUE(found.tested[static_cast<size_t>(hit.reference)]);
  }
}

TEST_F(Town, GpsTellsTheRegionWhateverTheImagesLookLike) {
  input_.image_features = [](int image) { return Seen(image, 2); };  // the first row of the town
  const Retrieval found = Retrieve(Gps({0, 0, 0}));
  EXPECT_EQ(OfRun(found.tested), kImages);
  EXPECT_LE(std::count(found.tested.begin(), found.tested.end(), 1), 60);
  EXPECT_FALSE(found.tested[0]);
}

// Each fix and each reference has its own reach: half the way to the next fix, and three sigmas of both.
TEST_F(Town, GpsTestsAllReferencesInReachOfAFix) {
  std::vector<GpsPlace> gps = Gps({0, 20, 0});
  for (size_t i = 0; i < gps.size(); ++i) gps[i].sigma_h_m = static_cast<double>(1 + 2 * (i % 4));
  for (size_t r = 0; r < input_.references.size(); ++r) {
    input_.references[r].geotag.sigma_h_m = static_cast<double>(1 + r % 5);
  }
  const Retrieval found = Retrieve(gps);
  for (size_t r = 0; r < input_.references.size(); ++r) {
    const bool reached = std::any_of(gps.begin(), gps.end(), [&](const GpsPlace& fix) {
      const double sigma = std::hypot(fix.sigma_h_m, input_.references[r].geotag.sigma_h_m);
      const Eigen::Vector3d off = PlaceOf(static_cast<int>(r)) - fix.position;
      return off.head<2>().norm() < 30 + 0.5 * kSpacing + 3 * sigma;
    });
    EXPECT_EQ(found.tested[r] != 0, reached) << r;
  }
}

TEST_F(Town, GpsFarFromAllReferencesIsNoReasonToTestNone) {
  EXPECT_EQ(OfRun(Retrieve(Gps({1e5, 0, 0})).tested), kImages);
}

TEST_F(Town, WhereGpsIsOutTheRunMayBeAnywhereInReach) {
  std::vector<GpsPlace> gps = Gps({0, 0, 0});
  gps.resize(3);
  EXPECT_EQ(OfRun(Retrieve(gps).tested), kImages);
}

// Where no place is left out, a hand-held set counts with all that it scores.
TEST_F(Town, AHandHeldSetBesideFewPanoramasIsNamed) {
  options_.most_references = kReferences;
  options_.top_k = kReferences;
  input_.references[kFirst].set = 0;
  const Retrieval found = Retrieve({});
  const std::vector<Retrieval::Hit>& hits = found.of_image[0];
  EXPECT_TRUE(std::any_of(hits.begin(), hits.end(), [](const Retrieval::Hit& h) { return h.reference == kFirst; }));
}

TEST_F(Town, OfFewReferencesAllAreTested) {
  options_.most_references = kReferences;
  EXPECT_TRUE(Retrieve(Gps({1e5, 0, 0})).tested.empty());
}

}  // namespace
}  // namespace trigpoint

// From photos to a rig: rings, outliers, copies, zooms, gaps, levelling, and the picture made of them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "calib/base/error.h"
#include "survey/panorama/composite.h"
#include "survey/panorama/levelling.h"
#include "survey/panorama/photo_graph.h"
#include "tests/survey/panorama_scene.h"

namespace trigpoint {
namespace {

constexpr int kWidth = 400, kHeight = 300;
constexpr double kFocal = 330;

const cv::Mat& Sphere() {
  static const cv::Mat sphere = BlobSphere(2400, 5);
  return sphere;
}

// Every `step` deg from `from` up to `to`, held with a little pitch and roll.
MemorySet Ring(double from, double to, double step, std::optional<double> said = std::nullopt) {
  MemorySet set;
  Random random(3);
  for (double h = from; h < to; h += step) {
    const Eigen::Quaterniond q = CamFromWorld(h, random.Uniform(-2, 2), random.Uniform(-1.5, 1.5));
    set.AddView(std::string("p").append(std::to_string(static_cast<int>(1000 + h))).append(".jpg"), Sphere(), q, kWidth,
                kHeight, kFocal, said);
  }
  return set;
}

StitchOptions Small() {
  StitchOptions o;
  o.max_features = 1200;
  o.level = "horizon";
  return o;
}

TEST(Stitch, RingWithoutFocalLengthClosesAndFindsIt) {
  const MemorySet set = Ring(0, 360, 30);
  const StitchedRig rig = StitchSet(set, Small());
  EXPECT_EQ(rig.placed, 12);
  EXPECT_NEAR(rig.state.lenses.front().focal_px / kFocal, 1, 0.003);
  EXPECT_LT(RmsTurnError(rig, set), 0.05);  // a pixel is 0.17 deg
  EXPECT_TRUE(rig.closure.full_turn);
  EXPECT_NEAR(rig.closure.error_deg, 0, 0.3);
  EXPECT_FALSE(rig.focal_from_exif);
  EXPECT_THAT(rig.warnings, testing::IsEmpty());
}

TEST(Stitch, FindsDistortionAndDecentring) {
  const Lens lens{kFocal, 0.05, -0.012, false, 0.002, -0.0015};
  MemorySet set;
  for (double h = 0; h < 360; h += 20) {
    const Eigen::Quaterniond q = CamFromWorld(h, 3 * std::sin(h), 2 * std::cos(h));
    const std::string name = std::string("p").append(std::to_string(static_cast<int>(1000 + h))).append(".jpg");
    set.Add(name, PhotoOf(Sphere(), q, {kWidth, kHeight, nullptr, std::nullopt}, lens));
    set.truth[name] = q;
  }
  const StitchedRig rig = StitchSet(set, Small());
  EXPECT_EQ(rig.placed, 18);
  const Lens& found = rig.state.lenses.front();
  EXPECT_NEAR(found.focal_px / kFocal, 1, 0.002);
  EXPECT_NEAR(found.k1, lens.k1, 0.01);
  EXPECT_NEAR(found.p1, lens.p1, 4e-4);
  EXPECT_NEAR(found.p2, lens.p2, 4e-4);
  EXPECT_LT(RmsTurnError(rig, set), 0.03);
  const Eigen::Index p1 = 6 * rig.placed + 3;
  EXPECT_NEAR(found.p1, lens.p1, 4 * std::sqrt(rig.bundle.covariance(p1, p1)));
}

TEST(Stitch, IgnoresWhatAMaskHides) {
  PairView view{kWidth, kHeight, nullptr, std::nullopt};
  view.mask = cv::Mat(30, 40, CV_8U, cv::Scalar(255));
  view.mask.colRange(0, 10).setTo(0);
  EXPECT_LT(view.Depth({50, 150}), 0);
  EXPECT_GT(view.Depth({150, 150}), 0);
  const MemorySet set = Ring(0, 20, 30);
  const ShrunkPicture grey(set.Grey(set.set.photos.front()), 4000);
  const PhotoFeatures all = FindPhotoFeatures(grey, 500, std::nullopt, cv::Mat());
  const PhotoFeatures kept = FindPhotoFeatures(grey, 500, std::nullopt, view.mask);
  const auto hidden = [](const PhotoFeatures& f) {
    return std::count_if(f.points.begin(), f.points.end(), [](const Eigen::Vector2f& p) { return p.x() < 98; });
  };
  EXPECT_GT(hidden(all), 10);
  EXPECT_EQ(hidden(kept), 0);
}

// Turns of a ring as pairs see them through a lens that is a quarter too long: they add up to 288 deg.
TEST(FindClosure, TellsByHowMuchTheFocalLengthIsOff) {
  std::vector<PhotoPair> pairs;
  const auto add = [&](int a, int b, double turn_deg, double score) {
    PhotoPair p;
    p.a = a, p.b = b, p.score = score;
    p.b_from_a = CamFromWorld(turn_deg, 1, 0.5);
    pairs.push_back(p);
  };
  for (int i = 0; i < 17; ++i) add(i, i + 1, 16, 100 + i);
  EXPECT_FALSE(FindClosure(18, pairs).closed);
  add(3, 5, 32, 20);  // agrees with the chain: closes nothing
  EXPECT_FALSE(FindClosure(18, pairs).closed);
  add(0, 17, -16, 30);
  const RingClosure ring = FindClosure(18, pairs);
  EXPECT_TRUE(ring.closed);
  EXPECT_NEAR(ring.turns, 0.8, 0.01);
}

TEST(Stitch, SameAnswerOnAnyNumberOfThreads) {
  const MemorySet set = Ring(0, 120, 30, kFocal);
  ProgressSink progress;
  CancelToken cancel;
  const auto load = [&](const Photo& p) { return set.Grey(p); };
  const StitchedRig a = StitchPhotos(set.set, load, Small(), 1, 1, progress, cancel);
  const StitchedRig b = StitchPhotos(set.set, load, Small(), 3, 1, progress, cancel);
  ASSERT_EQ(a.state.points.size(), b.state.points.size());
  EXPECT_NEAR(a.state.lenses.front().focal_px, b.state.lenses.front().focal_px, 1e-3);
}

TEST(Stitch, LeavesOutWhatDoesNotBelongAndNamesIt) {
  MemorySet set = Ring(0, 360, 30, kFocal);
  set.AddView("stranger.jpg", BlobSphere(2400, 77), CamFromWorld(40, 0, 0), kWidth, kHeight, kFocal, kFocal);
  set.Add("twin.jpg", set.pictures.begin()->second, kFocal);
  set.Add("wall.jpg", cv::Mat(kHeight, kWidth, CV_8UC3, cv::Scalar(90, 90, 90)), kFocal);
  const StitchedRig rig = StitchSet(set, Small());
  EXPECT_EQ(rig.placed, 12);
  std::string said;
  for (const std::string& w : rig.warnings) said += w + "\n";
  EXPECT_THAT(said, testing::HasSubstr("stranger.jpg is not placed: does not belong"));
  EXPECT_THAT(said, testing::HasSubstr("twin.jpg is left out: is a copy of"));
  EXPECT_THAT(said, testing::HasSubstr("wall.jpg is not placed: only"));
  EXPECT_LT(LargestTurnError(rig, set), 0.05);
}

// Its patches look unlike the others': it is placed all the same.
TEST(Stitch, OneBlurredPhotoIsPlacedLikeTheOthers) {
  MemorySet set = Ring(0, 160, 20, kFocal);
  cv::Mat& blurred = set.pictures.at("p1060.jpg");
  cv::GaussianBlur(blurred, blurred, cv::Size(), 3);
  const StitchedRig rig = StitchSet(set, Small());
  EXPECT_EQ(rig.placed, static_cast<int>(set.pictures.size()));
  EXPECT_LT(LargestTurnError(rig, set), 0.15);
}

TEST(Stitch, PortraitAndLandscapeAndAnotherZoomTogether) {
  MemorySet set = Ring(0, 360, 30);
  set.AddView("portrait.jpg", Sphere(), CamFromWorld(45, 15, 0), kHeight, kWidth, kFocal);
  set.AddView("zoomed.jpg", Sphere(), CamFromWorld(200, 2, 1), kWidth, kHeight, 1.5 * kFocal);
  const StitchedRig rig = StitchSet(set, Small());
  EXPECT_EQ(rig.placed, 14);
  EXPECT_LT(LargestTurnError(rig, set), 0.1);
  double zoomed = 0;
  for (size_t i = 0; i < rig.photos.size(); ++i) {
    if (rig.photos[i].name == "zoomed.jpg") {
      zoomed = rig.state.lenses[static_cast<size_t>(rig.state.photos[i].lens)].focal_px;
    }
  }
  EXPECT_NEAR(zoomed / (1.5 * kFocal), 1, 0.01);
}

// A zoom that moved a little: its photos still fit the others, badly.
TEST(Stitch, ASmallChangeOfZoomIsNamed) {
  MemorySet set = Ring(0, 150, 30);
  for (int i = 1; i <= 4; ++i) {
    set.AddView("zoomed" + std::to_string(i) + ".jpg", Sphere(), CamFromWorld(140 + 25 * i, 0, 0), kWidth, kHeight,
                1.08 * kFocal);
  }
  const StitchedRig rig = StitchSet(set, Small());
  EXPECT_EQ(rig.placed, static_cast<int>(rig.photos.size()));
  ASSERT_EQ(rig.state.lenses.size(), 2U);
  EXPECT_NEAR(rig.state.lenses[1].focal_px / rig.state.lenses[0].focal_px, 1.08, 0.01);
  for (size_t i = 0; i < rig.photos.size(); ++i) {
    EXPECT_EQ(rig.state.photos[i].lens, rig.photos[i].name.starts_with("zoomed") ? 1 : 0) << rig.photos[i].name;
  }
  EXPECT_THAT(rig.warnings, testing::Contains(testing::HasSubstr("zoomed1.jpg was taken at another zoom")));
  EXPECT_LT(LargestTurnError(rig, set), 2);  // an open sweep leaves the focal length open by a percent
}

// A lens of 196 deg whose picture is a circle, a little off the middle, on a black frame.
constexpr int kFisheyeSide = 700;
const PairView kRound{kFisheyeSide, kFisheyeSide, nullptr, ImageCircle{{352, 347}, 330}};
const Lens kFisheye{230, -0.05, -0.002, true};

TEST(Lens, FisheyePixelsAndRaysAreEachOthersInverse) {
  for (const double degrees : {0.0, 0.01, 30.0, 89.0, 91.0, 97.0}) {
    const double theta = degrees * kDegToRad;
    const Eigen::Vector3d ray(0.6 * std::sin(theta), -0.8 * std::sin(theta), std::cos(theta));
    Eigen::Vector2d pixel;
    ASSERT_TRUE(PixelOfRay(kRound, kFisheye, ray, &pixel)) << degrees;
    EXPECT_LT((RayOfPixel(kRound, kFisheye, pixel) - ray).norm(), 1e-9) << degrees;
  }
  Eigen::Vector2d pixel;
  EXPECT_FALSE(PixelOfRay(kRound, kFisheye, {0, std::sin(1.9), std::cos(1.9)}, &pixel)) << "beyond the circle";
  EXPECT_NEAR(HalfView(kRound, kFisheye) * kRadToDeg, 98, 1.5);
}

// What a lens shows in the stored picture it shows in the one that EXIF turns by a quarter to the right.
TEST(Lens, DecentringTurnsWithThePicture) {
  const Lens lens{kFocal, 0.05, -0.012, false, 0.002, -0.0015};
  const PairView stored{kWidth, kHeight, nullptr, std::nullopt};
  PairView shown{kHeight, kWidth, nullptr, std::nullopt};
  shown.orientation = 6;
  const Eigen::Vector3d ray = Eigen::Vector3d(0.4, -0.25, 1).normalized(), turned(-ray.y(), ray.x(), ray.z());
  Eigen::Vector2d at, at_shown;
  ASSERT_TRUE(PixelOfRay(stored, lens, ray, &at));
  ASSERT_TRUE(PixelOfRay(shown, lens, turned, &at_shown));
  EXPECT_LT((at_shown - Eigen::Vector2d(kHeight - 1 - at.y(), at.x())).norm(), 1e-9);
  EXPECT_LT((RayOfPixel(shown, lens, at_shown) - turned).norm(), 1e-9);
}

// Stripes on something that moves with the camera.
TEST(Level, EdgesThatAMaskHidesCountForNothing) {
  constexpr int kColumns = 1000, kRows = 750;
  cv::Mat stripes(kRows, kColumns, CV_8U, cv::Scalar(40));
  for (int x = 50; x < kColumns; x += 100) stripes.colRange(x, x + 50).setTo(220);
  for (const bool masked : {false, true}) {
    StitchedRig rig;
    rig.state.lenses = {Lens{600}};
    for (const double heading : {-30.0, 30.0}) {
      rig.photos.emplace_back();
      PairView& view = rig.views.emplace_back();
      view.width = kColumns, view.height = kRows;
      if (masked) view.mask = cv::Mat(kRows, kColumns, CV_8U, cv::Scalar(0));
      RigPhoto& photo = rig.state.photos.emplace_back();
      photo.placed = true;
      photo.cam_from_rig = CamFromWorld(heading, 0, 0);
    }
    LevelRig([&](const Photo&) { return stripes; }, "lines", 1, CancelToken(), &rig);
    EXPECT_EQ(rig.level_source, masked ? "horizon" : "lines");
  }
}

TEST(Level, OfARigThatIsNotLevelledIsUnknown) {
  StitchedRig rig;
  rig.state.lenses = {Lens{600}};
  rig.photos.emplace_back();
  PairView& view = rig.views.emplace_back();
  view.width = 1000, view.height = 750;
  RigPhoto& photo = rig.state.photos.emplace_back();
  photo.placed = true;
  photo.cam_from_rig = CamFromWorld(0, 10, 5);
  const auto level = [&](const char* wanted) {
    rig.level_sigma_deg.reset();
    LevelRig([](const Photo&) { return cv::Mat(); }, wanted, 1, CancelToken(), &rig);
  };
  level("horizon");
  EXPECT_TRUE(rig.level_sigma_deg);
  level("none");
  EXPECT_EQ(rig.level_source, "none");
  EXPECT_FALSE(rig.level_sigma_deg);
}

TEST(ImageCircle, FoundOnBlackFramesOnly) {
  cv::Mat round, square;
  cv::cvtColor(PhotoOf(Sphere(), CamFromWorld(0, 0, 0), kRound, kFisheye), round, cv::COLOR_BGR2GRAY);
  const std::optional<ImageCircle> circle = FindImageCircle(round);
  ASSERT_TRUE(circle);
  EXPECT_LT((circle->centre - kRound.circle->centre).norm(), 2);
  EXPECT_NEAR(circle->radius_px, 0.985 * kRound.circle->radius_px, 4);
  cv::cvtColor(PhotoOf(Sphere(), CamFromWorld(0, 0, 0), {700, 500, nullptr, std::nullopt}, Lens{500}), square,
               cv::COLOR_BGR2GRAY);
  EXPECT_FALSE(FindImageCircle(square));
  // Night with one lit window.
  cv::Mat night(500, 700, CV_8U, cv::Scalar(5));
  square(cv::Rect(200, 150, 250, 200)).copyTo(night(cv::Rect(200, 150, 250, 200)));
  EXPECT_FALSE(FindImageCircle(night));
  EXPECT_FALSE(FindImageCircle(cv::Mat(500, 700, CV_8U, cv::Scalar(0))));
}

TEST(Stitch, TwoFisheyesBackToBackMakeASphere) {
  MemorySet set;
  const Eigen::Quaterniond front = CamFromWorld(20, 6, 1), back = CamFromWorld(199, -6, 0.5);
  // EXIF says a tenth less, as it may.
  set.Add("front.jpg", PhotoOf(Sphere(), front, kRound, kFisheye), 207);
  set.Add("back.jpg", PhotoOf(Sphere(), back, kRound, kFisheye), 207);
  set.truth["front.jpg"] = front, set.truth["back.jpg"] = back;
  StitchOptions options = Small();
  options.max_features = 4000;
  const StitchedRig rig = StitchSet(set, options);
  EXPECT_EQ(rig.placed, 2);
  EXPECT_TRUE(rig.state.lenses.front().fisheye);
  EXPECT_LT(LargestTurnError(rig, set), 0.5);  // a pixel is 0.25 deg
  EXPECT_EQ(rig.closure.largest_gap_deg, 0);
  EXPECT_THAT(rig.warnings, testing::IsEmpty());
  // The rim is known, whatever the axis is.
  const auto z_at_rim = [](const PairView& view, const Lens& lens) {
    return RayOfPixel(view, lens, view.Principal() + Eigen::Vector2d(310, 0)).z();
  };
  EXPECT_NEAR(z_at_rim(rig.views[0], rig.state.lenses.front()), z_at_rim(kRound, kFisheye), 1 * kDegToRad);
  // Nothing says how far up two photos look that are taken back to back.
  EXPECT_EQ(rig.level_source, "horizon");
  EXPECT_GT(rig.level_sigma_deg.value_or(0), 5);
  EXPECT_EQ(CameraOf(rig, 0).model(), CameraModel::kKannalaBrandt);
}

TEST(Stitch, FisheyesThatFillTheirFrameAreToldFromStraightLenses) {
  MemorySet set;
  const PairView view{600, 400, nullptr, std::nullopt};
  const Lens lens{290, -0.04, 0, true};
  for (int k = 0; k < 6; ++k) {
    const std::string name = "f" + std::to_string(k) + ".jpg";
    set.truth[name] = CamFromWorld(60 * k, k % 2 == 0 ? 3 : -3, 0.5 * k);
    set.Add(name, PhotoOf(Sphere(), set.truth[name], view, lens));
  }
  const StitchedRig rig = StitchSet(set, Small());
  EXPECT_EQ(rig.placed, 6);
  ASSERT_TRUE(rig.state.lenses.front().fisheye);
  EXPECT_NEAR(rig.state.lenses.front().focal_px / lens.focal_px, 1, 0.01);
  EXPECT_LT(LargestTurnError(rig, set), 0.15);
}

TEST(Stitch, FramesOfADriveAreSaidNotToBeAPanorama) {
  MemorySet set;
  for (int i = 10; i < 18; ++i) {
    const std::string name = "0000" + std::to_string(i) + ".jpg";
    const cv::Mat frame = cv::imread("datasets/parking_lot/runs/run1/images/" + name);
    ASSERT_FALSE(frame.empty()) << name;
    set.Add(name, frame);
  }
  EXPECT_THAT(StitchSet(set, Small()).warnings, testing::Contains(testing::HasSubstr("hardly taken from one place")));
}

TEST(Stitch, HalfATurnSaysHowMuchIsNotSeen) {
  const MemorySet set = Ring(0, 160, 25, kFocal);
  const StitchedRig rig = StitchSet(set, Small());
  EXPECT_EQ(rig.placed, 7);
  EXPECT_FALSE(rig.closure.full_turn);
  EXPECT_NEAR(rig.closure.largest_gap_deg, 360 - 150 - 2 * std::atan(0.5 * kWidth / kFocal) * kRadToDeg, 4);
  EXPECT_LT(LargestTurnError(rig, set), 0.1);
}

TEST(Stitch, CompassAndPitchTagsTurnTheRig) {
  MemorySet set = Ring(0, 360, 30, kFocal);
  for (Photo& p : set.set.photos) {
    const Eigen::Vector3d look = set.truth.at(p.name).conjugate() * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d right = set.truth.at(p.name).conjugate() * Eigen::Vector3d::UnitX();
    // The whole turn was held 5 deg askew; the tags know it.
    p.metadata.heading_deg = std::fmod(std::atan2(look.x(), look.z()) * kRadToDeg + 360 + 70, 360.0);
    p.tilt.pitch_deg = std::asin(-look.y()) * kRadToDeg;
    p.tilt.roll_deg = std::asin(right.y() / std::cos(std::asin(-look.y()))) * kRadToDeg;
  }
  StitchOptions options = Small();
  options.level = "auto";
  const StitchedRig rig = StitchSet(set, options);
  EXPECT_EQ(rig.level_source, "tags");
  ASSERT_TRUE(rig.heading_rad);
  const Eigen::Vector3d north_look = rig.state.photos[0].cam_from_rig.conjugate() * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d true_look = set.truth.at(rig.photos[0].name).conjugate() * Eigen::Vector3d::UnitZ();
  const double found = *rig.heading_rad + std::atan2(north_look.x(), north_look.z());
  EXPECT_NEAR(WrapAngle(found - std::atan2(true_look.x(), true_look.z()) - 70 * kDegToRad) * kRadToDeg, 0, 0.5);
  for (size_t i = 0; i < rig.photos.size(); ++i) {
    const double pitch = std::asin(-(rig.state.photos[i].cam_from_rig.conjugate() * Eigen::Vector3d::UnitZ()).y());
    EXPECT_NEAR(pitch * kRadToDeg, *rig.photos[i].tilt.pitch_deg, 0.1);
  }
}

TEST(Stitch, NothingToStitchIsSaidInOneSentence) {
  const auto message = [](const MemorySet& set) {
    try {
      StitchSet(set, Small());
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string("no error");
  };
  MemorySet one = Ring(0, 10, 30);
  EXPECT_THAT(message(one), testing::HasSubstr("at least two photos"));
  MemorySet same = one;
  for (const char* name : {"b.jpg", "c.jpg"}) same.Add(name, one.pictures.begin()->second);
  EXPECT_THAT(message(same), testing::HasSubstr("is a copy of"));
  MemorySet apart = one;
  apart.AddView("b.jpg", Sphere(), CamFromWorld(120, 0, 0), kWidth, kHeight, kFocal);
  apart.AddView("c.jpg", Sphere(), CamFromWorld(240, 0, 0), kWidth, kHeight, kFocal);
  EXPECT_THAT(message(apart), testing::HasSubstr("no two of the 3 photos overlap"));
}

TEST(Composite, ShowsTheSphereAcrossItsEnds) {
  const MemorySet set = Ring(0, 360, 30, kFocal);
  const StitchedRig rig = StitchSet(set, Small());
  CompositeOptions options;
  options.width = 1600;
  options.seam_width = 800;
  ProgressSink progress;
  CancelToken cancel;
  cv::Mat picture;
  const Composite made = CompositePanorama(
      rig, [&](const Photo& p) { return set.Colour(p); }, options, 2,
      {[](const Composite& c) { EXPECT_EQ(c.part, cv::Rect(0, 0, 1600, 800)); },
       [&](const cv::Mat& rows) { picture.push_back(rows); }},
      progress, cancel);
  ASSERT_EQ(picture.cols, 1600);
  ASSERT_EQ(picture.rows, 800);
  EXPECT_EQ(made.height, 800);
  // What the sphere shows in the same directions; the poles are holes.
  const Eigen::Quaterniond world_from_rig =
      set.truth.at(rig.photos[0].name).conjugate() * rig.state.photos[0].cam_from_rig;
  double sum = 0;
  int seen = 0, holes = 0;
  for (int v = 0; v < picture.rows; v += 3) {
    for (int u = 0; u < picture.cols; u += 3) {
      const cv::Vec4b& at = picture.at<cv::Vec4b>(v, u);
      const double azimuth = ((u + 0.5) / picture.cols - 0.5) * 2 * std::numbers::pi;
      const double elevation = (0.5 - (v + 0.5) / picture.rows) * std::numbers::pi;
      if (std::abs(elevation) > 35 * kDegToRad) holes += at[3] == 0 ? 1 : 0;
      if (std::abs(elevation) > 15 * kDegToRad) continue;
      ASSERT_EQ(at[3], 255) << u << " " << v;
      const Eigen::Vector3d d =
          world_from_rig * Eigen::Vector3d(std::cos(elevation) * std::sin(azimuth), -std::sin(elevation),
                                           std::cos(elevation) * std::cos(azimuth));
      const int x = static_cast<int>((std::atan2(d.x(), d.z()) / (2 * std::numbers::pi) + 0.5) * Sphere().cols);
      const int y = static_cast<int>((0.5 - std::asin(-d.y()) / std::numbers::pi) * Sphere().rows);
      const cv::Vec3b& right = Sphere().at<cv::Vec3b>(std::min(y, Sphere().rows - 1), std::min(x, Sphere().cols - 1));
      for (int c = 0; c < 3; ++c) sum += std::abs(at[c] - right[c]);
      ++seen;
    }
  }
  EXPECT_LT(sum / seen / 3, 14);  // edges of blobs are a pixel off here and there; a misplaced photo gives 60
  EXPECT_GT(holes, 1000);
  // A band as high as the photos: sin of half their field of view, and a little for the pitch they were held with.
  EXPECT_NEAR(made.covered, std::sin(std::atan(0.5 * kHeight / kFocal)), 0.03);
}

TEST(Composite, APartOfTheHorizonIsAPictureOfThatPart) {
  const MemorySet set = Ring(0, 90, 30, kFocal);  // three photos
  const StitchedRig rig = StitchSet(set, Small());
  CompositeOptions options;
  options.width = 1600;
  options.seam_width = 800;
  ProgressSink progress;
  CancelToken cancel;
  cv::Mat picture;
  cv::Rect begun;
  const Composite made = CompositePanorama(
      rig, [&](const Photo& p) { return set.Colour(p); }, options, 2,
      {[&](const Composite& c) { begun = c.part; }, [&](const cv::Mat& rows) { picture.push_back(rows); }}, progress,
      cancel);
  EXPECT_EQ(begun, made.part);
  EXPECT_EQ(picture.size(), made.part.size());
  EXPECT_EQ(made.width, 1600);
  // The photos' own field of view and 60 deg between the first and the last.
  const double field_deg = 60 + 2 * std::atan(0.5 * kWidth / kFocal) * kRadToDeg;
  EXPECT_NEAR(made.part.width, 1600 * field_deg / 360, 40);
  EXPECT_LT(made.part.height, 500);
  // All that is seen is in it, and most of it is filled.
  cv::Mat alpha;
  cv::extractChannel(picture, alpha, 3);
  EXPECT_GT(cv::countNonZero(alpha), 0.7 * picture.total());
  for (const cv::Mat& edge : {alpha.row(0), alpha.row(alpha.rows - 1), alpha.col(0), alpha.col(alpha.cols - 1)}) {
    EXPECT_EQ(cv::countNonZero(edge), 0);
  }
}

}  // namespace
}  // namespace trigpoint

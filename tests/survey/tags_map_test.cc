#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "calib/base/error.h"
#include "calib/estimation/random.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/so3.h"
#include "survey/tags/tag_map.h"

namespace trigpoint {
namespace {

const Camera kCamera(CameraModel::kPinhole, 960, 600, {400, 400, 479.5, 299.5});

template <typename Matcher>
auto Says(const Matcher& text) {
  return testing::Field(&MapWarning::text, text);
}

Eigen::Vector3d RandomVector(Random* random, double size) {
  return size * Eigen::Vector3d(random->Normal(), random->Normal(), random->Normal());
}

// Eight tags round a yard, two runs inside it with drifting odometry.
struct Yard {
  std::vector<Rigid3d> tags;
  SurveyInput input;
};

std::vector<TagDetection> TagsSeen(const std::vector<Rigid3d>& tags, const Rigid3d& cam_from_world, Random* random) {
  std::vector<TagDetection> detections;
  for (size_t t = 0; t < tags.size(); ++t) {
    TagDetection d;
    d.id = static_cast<int>(t);
    bool seen = (cam_from_world * tags[t].translation).z() > 1;
    for (int k = 0; k < 4 && seen; ++k) {
      const auto p = kCamera.Project(cam_from_world * (tags[t] * TagCorner(0.5, k)));
      seen = p && kCamera.Contains(*p);
      if (seen) d.corners[k] = *p + 0.2 * Eigen::Vector2d(random->Normal(), random->Normal());
    }
    d.corner_sigma_px.fill(0.2);
    if (seen) detections.push_back(d);
  }
  return detections;
}

// Body x along the circle, clockwise, so that its left (y) points outwards.
Rigid3d WorldFromBody(int run, int i) {
  const double a = (run == 0 ? 1 : 1.02) * 0.0785398 * i;
  Eigen::Matrix3d r;
  r.col(1) << std::cos(a), std::sin(a), 0;
  r.col(2) << 0, 0, 1;
  r.col(0) = r.col(1).cross(r.col(2));
  return {Eigen::Quaterniond(r), {7 * std::cos(a), 7 * std::sin(a), 0.8 + 0.1 * std::sin(5 * a)}};
}

// The tags hang in three heights, `storey_m` apart.
Yard MakeYard(uint64_t seed, double storey_m = 0.5) {
  Yard yard;
  Random random(seed);
  for (int i = 0; i < 8; ++i) {
    const double a = 0.785398 * i;
    Eigen::Matrix3d r;  // z away from the middle, y down
    r.col(2) << std::cos(a), std::sin(a), 0;
    r.col(1) << 0, 0, -1;
    r.col(0) = r.col(1).cross(r.col(2));
    yard.tags.emplace_back(Eigen::Quaterniond(r),
                           Eigen::Vector3d(12 * std::cos(a), 12 * std::sin(a), 1 + storey_m * (i % 3)));
  }
  yard.input.sizes.size_m = 0.5;
  Eigen::Matrix3d cam_from_body;  // looks to the body's left
  cam_from_body << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  for (int run = 0; run < 2; ++run) {
    SurveyRun survey;
    survey.name = "run" + std::to_string(run + 1);
    BodyCamera camera;
    camera.name = "cam0";
    camera.camera = kCamera;
    camera.cam_from_body = Rigid3d(Eigen::Quaterniond(cam_from_body), {0, 0, 0.1});
    survey.cameras.push_back(camera);
    Rigid3d odom_from_body, before;
    for (int i = 0; i < 80; ++i) {
      const Rigid3d body = WorldFromBody(run, i);
      if (i > 0) {
        Rigid3d step = before.Inverse() * body;
        const double root = std::sqrt(step.translation.norm());
        step.translation = step.translation / 1.008 + 0.01 * root * RandomVector(&random, 1);
        step.rotation = ExpSO3(0.002 * root * RandomVector(&random, 1)) * step.rotation;
        odom_from_body = odom_from_body * step;
      }
      before = body;
      const int64_t stamp = 500000000LL * i;
      survey.odometry.poses.push_back({stamp, odom_from_body});
      ImageDetections image{stamp, "", "cam0", {}};
      const Rigid3d cam_from_world = camera.cam_from_body * body.Inverse();
      image.detections = TagsSeen(yard.tags, cam_from_world, &random);
      survey.images.push_back(image);
    }
    yard.input.runs.push_back(survey);
  }
  for (int t : {0, 3, 5}) {
    SurveyPoint p;
    p.name = "P" + std::to_string(t);
    p.tag_id = t;
    p.sigma_h_m = p.sigma_v_m = 0.005;
    p.world_m = yard.tags[t].translation + 0.005 * RandomVector(&random, 1);
    yard.input.points.push_back(p);
  }
  SurveyPoint check = yard.input.points.front();
  check.name = "C6";
  check.role = PointRole::kCheck;
  check.tag_id = 6;
  check.world_m = yard.tags[6].translation;
  yard.input.points.push_back(check);
  return yard;
}

// A hand-held set of 16 photos in the yard, on a circle of 0.3 m about the holder; its rig is stitched too small.
SurveyRun MakeStills(const Yard& yard, uint64_t seed, double rig_over_true) {
  Random random(seed);
  SurveyRun set;
  set.name = "photo set";
  set.stills = true;
  set.scale_sigma = 0.2;
  set.max_gap_s = 100;
  set.cameras.push_back({"lens0", kCamera, Rigid3d()});
  for (int i = 0; i < 16; ++i) {
    const double a = 0.39270 * i;
    Eigen::Matrix3d r;  // z outwards, y down
    r.col(2) << std::cos(a), std::sin(a), 0;
    r.col(1) << 0, 0, -1;
    r.col(0) = r.col(1).cross(r.col(2));
    const Rigid3d world_from_cam(Eigen::Quaterniond(r), Eigen::Vector3d(0.5, -1, 1.5) + 0.3 * r.col(2));
    const int64_t stamp = 1'000'000'000LL * i;
    set.images.push_back({stamp, "", "lens0", TagsSeen(yard.tags, world_from_cam.Inverse(), &random)});
    Rigid3d in_rig(ExpSO3(0.0005 * RandomVector(&random, 1)) * Eigen::Quaterniond(r), rig_over_true * 0.3 * r.col(2));
    in_rig.translation += 0.003 * RandomVector(&random, 1);
    set.odometry.poses.push_back({stamp, in_rig});
  }
  return set;
}

SurveyResult Survey(const SurveyInput& input, SurveyOptions options = {}) {
  ProgressSink progress;
  const CancelToken cancel;
  options.extra_sigma_px = 0;
  return SurveyTags(input, options, 2, progress, cancel);
}

TEST(TagMap, RecoversTheYardAndItsUncertaintyIsReal) {
  double nees = 0, worst = 0;
  int n = 0;
  const int redraws = 20;
  for (int seed = 1; seed <= redraws; ++seed) {
    const Yard yard = MakeYard(seed);
    const SurveyResult map = Survey(yard.input);
    EXPECT_EQ(map.datum, "control");
    ASSERT_EQ(map.tags.size(), 8U);
    for (const TagEstimate& tag : map.tags) {
      ASSERT_TRUE(tag.HasPose()) << tag.tag_id << " " << tag.reason;
      EXPECT_EQ(tag.status, "ok") << tag.tag_id << " " << tag.reason;
      const Vector6d e = tag.world_from_tag->Minus(yard.tags[tag.tag_id]);
      worst = std::max(worst, e.tail<3>().norm());
      nees += e.dot(tag.covariance.inverse() * e);
      ++n;
    }
    EXPECT_NEAR(map.runs[0].scale, 1.008, 4 * map.runs[0].scale_sigma);
    EXPECT_EQ(map.check.n, 1);
    EXPECT_LT(map.check.rmse_3d_m, 0.05);
  }
  EXPECT_LT(worst, 0.06);
  // The tags of one map share their errors; the band is that of 20 independent maps with 6 degrees each: +- 25 %.
  EXPECT_GT(nees / n, 6 * 0.65);
  EXPECT_LT(nees / n, 6 * 1.35);
}

TEST(TagMap, TurnsAndShiftsWithTheWorld) {
  const Rigid3d t(ExpSO3({0, 0, 1.1}), {3.5e6, 5.4e6, 3});  // a grid's; sigmas of points are horizontal and vertical
  Yard moved = MakeYard(4);
  const SurveyResult one = Survey(moved.input);
  for (SurveyPoint& p : moved.input.points) p.world_m = t * p.world_m;
  const SurveyResult two = Survey(moved.input);
  for (size_t i = 0; i < one.tags.size(); ++i) {
    EXPECT_LT(two.tags[i].world_from_tag->Minus(t * *one.tags[i].world_from_tag).norm(), 1e-4);
  }
}

TEST(TagMap, OneHeldTagIsADatum) {
  Yard yard = MakeYard(5);
  yard.input.points.clear();
  yard.input.fixed = FixedTag{2, yard.tags[2]};
  const SurveyResult held = Survey(yard.input);
  EXPECT_EQ(held.datum, "tag 2");
  for (const TagEstimate& tag : held.tags) {
    EXPECT_LT((tag.world_from_tag->translation - yard.tags[tag.tag_id].translation).norm(), 0.3) << tag.tag_id;
  }
}

TEST(TagMap, RunsWithoutOdometryAreMappedFromTheirPictures) {
  Yard yard = MakeYard(5);
  for (SurveyRun& run : yard.input.runs) run.odometry.poses.clear();
  const SurveyResult map = Survey(yard.input);
  EXPECT_EQ(map.datum, "control");
  for (const TagEstimate& tag : map.tags) {
    ASSERT_TRUE(tag.HasPose()) << tag.tag_id << " " << tag.reason;
    const Vector6d e = tag.world_from_tag->Minus(yard.tags[static_cast<size_t>(tag.tag_id)]);
    EXPECT_LT(e.tail<3>().norm(), 0.2) << tag.tag_id;
    EXPECT_LT(e.dot(tag.covariance.inverse() * e), 22.5) << tag.tag_id;  // chi-square, 6 dof, 99.9 %
  }
}

TEST(TagMap, WrongPicturesAreRejectedAndNothingIsAnError) {
  Yard yard = MakeYard(6);
  int spoiled = 0;
  for (ImageDetections& image : yard.input.runs[0].images) {
    if (!image.detections.empty() && ++spoiled % 12 == 0) {
      image.detections[0].corners[1] += Eigen::Vector2d(25, -10);
    }
  }
  const SurveyResult map = Survey(yard.input);
  EXPECT_GE(map.runs[0].rejected, spoiled / 12);
  for (const TagEstimate& tag : map.tags) {
    EXPECT_LT((tag.world_from_tag->translation - yard.tags[tag.tag_id].translation).norm(), 0.08) << tag.tag_id;
  }
  EXPECT_THROW(Survey(SurveyInput{}), InputError);
}

TEST(TagMap, HeadingDriftIsEstimatedWithTheScale) {
  Yard yard = MakeYard(11);
  // Odometry that turns a little with every metre.
  for (SurveyRun& run : yard.input.runs) {
    double way = 0;
    Rigid3d before = run.odometry.poses.front().target_from_body, bent = before;
    for (TimedPose& pose : run.odometry.poses) {
      const Rigid3d step = before.Inverse() * pose.target_from_body;
      before = pose.target_from_body;
      way += step.translation.norm();
      const double turn = -0.002 * step.translation.norm();
      bent = bent * step * Rigid3d(ExpSO3({0, 0, turn}), Eigen::Vector3d::Zero());
      pose.target_from_body = bent;
    }
    EXPECT_GT(way, 20);
  }
  const SurveyResult map = Survey(yard.input);
  for (const RunAgreement& run : map.runs) {
    EXPECT_NEAR(run.heading_drift_deg_m, 0.002 * 57.2958, 4 * run.heading_drift_sigma_deg_m);
    EXPECT_LT(run.heading_drift_sigma_deg_m, 0.05);
  }
}

// The pictures of tag `id` in a run show it at `world_from_tag` instead.
void Show(Yard* yard, size_t run, int id, const Rigid3d& world_from_tag, size_t first_image, size_t last_image) {
  for (size_t i = first_image; i < last_image; ++i) {
    const Rigid3d body = WorldFromBody(static_cast<int>(run), static_cast<int>(i));
    const Rigid3d cam_from_world = yard->input.runs[run].cameras[0].cam_from_body * body.Inverse();
    std::vector<TagDetection>& detections = yard->input.runs[run].images[i].detections;
    std::erase_if(detections, [&](const TagDetection& d) { return d.id == id; });
    TagDetection d;
    d.id = id;
    d.corner_sigma_px.fill(0.2);
    bool seen = (cam_from_world * world_from_tag.translation).z() > 1;
    for (size_t k = 0; k < 4 && seen; ++k) {
      const auto pixel = kCamera.Project(cam_from_world * (world_from_tag * TagCorner(0.5, static_cast<int>(k))));
      seen = pixel && kCamera.Contains(*pixel);
      if (seen) d.corners[k] = *pixel;
    }
    if (seen) detections.push_back(d);
  }
}

// Tags other than these are where they are, to what odometry and pictures allow.
void ExpectOthersRight(const SurveyResult& map, const Yard& yard, const std::set<int>& but) {
  for (const TagEstimate& tag : map.tags) {
    if (but.count(tag.tag_id) > 0) continue;
    ASSERT_TRUE(tag.HasPose()) << tag.tag_id;
    EXPECT_LT((tag.world_from_tag->translation - yard.tags[static_cast<size_t>(tag.tag_id)].translation).norm(), 0.1)
        << tag.tag_id;
    EXPECT_EQ(tag.status, "ok") << tag.tag_id << " " << tag.reason;
  }
}

TEST(TagMap, AMovedTagIsNamedAndNotAveragedThoughOdometryCouldBend) {
  for (const Eigen::Vector3d& shift :
       {Eigen::Vector3d(0.4, 0.3, 0), Eigen::Vector3d(0, 0.3, 0), Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(0, 3, 0)}) {
    Yard yard = MakeYard(21);
    Rigid3d moved = yard.tags[4];
    moved.translation += shift;
    Show(&yard, 1, 4, moved, 0, 80);
    const SurveyResult map = Survey(yard.input);
    const TagEstimate& tag = map.tags[4];
    EXPECT_EQ(tag.status, "moved") << shift.transpose() << " " << tag.reason;
    // It stands where one of the runs saw it, and the reason names the other run.
    const double first_m = (tag.world_from_tag->translation - yard.tags[4].translation).norm();
    const double second_m = (tag.world_from_tag->translation - moved.translation).norm();
    EXPECT_LT(std::min(first_m, second_m), 0.08) << shift.transpose();
    EXPECT_THAT(tag.reason, testing::HasSubstr(first_m < second_m ? "in run2 it stands" : "in run1 it stands"));
    ExpectOthersRight(map, yard, {4});
  }
}

// Without scene points the observations explain all of a tag's variance, and more precise ones lower their own share.
TEST(TagMap, TheBudgetAddsUpAndNamesWhatLimits) {
  const auto budget_of = [](double control_m) {
    Yard yard = MakeYard(41);
    for (SurveyPoint& p : yard.input.points) p.sigma_h_m = p.sigma_v_m = control_m;
    SurveyOptions options;
    options.budget = true;
    return Survey(yard.input, options);
  };
  const SurveyResult good = budget_of(0.005), rough = budget_of(0.5);
  ASSERT_EQ(good.budgets.size(), 8U);
  const auto control = static_cast<size_t>(BudgetSource::kControl),
             scene = static_cast<size_t>(BudgetSource::kScenePoints);
  for (size_t t = 0; t < good.budgets.size(); ++t) {
    const TagBudget& b = good.budgets[t];
    double sum = 0;
    for (const double s : b.sigma_m) sum += s * s;
    EXPECT_EQ(b.tag_id, good.tags[t].tag_id);
    EXPECT_NEAR(sum, b.total_m * b.total_m, 1e-6 * sum);
    EXPECT_NEAR(b.total_m * b.total_m, (good.tags[t].covariance.bottomRightCorner<3, 3>().trace()), 1e-12);
    EXPECT_LT(b.sigma_m[scene], 0.01 * b.total_m);
    EXPECT_GT(rough.budgets[t].sigma_m[control], 10 * b.sigma_m[control]);
    EXPECT_EQ(rough.budgets[t].LimitedBy(), BudgetSource::kControl);
    EXPECT_GT(b.sigma_m[static_cast<size_t>(BudgetSource::kOdometry)], 0);
    EXPECT_GT(b.sigma_m[static_cast<size_t>(BudgetSource::kCorners)], 0);
  }
}

// What surveying the proposed tag would gain is what it gains, and more than any other tag's would.
TEST(TagMap, TheNextPointIsTheBest) {
  const Yard yard = MakeYard(42);
  SurveyOptions options;
  options.budget = true;
  options.variance_rounds = 0;  // stated sigmas, so that solutions differ in nothing but the point
  const auto rms_of = [](const SurveyResult& map) {
    double sum = 0;
    for (const TagEstimate& t : map.tags) sum += t.covariance.bottomRightCorner<3, 3>().trace();
    return std::sqrt(sum / static_cast<double>(map.tags.size()));
  };
  const SurveyResult map = Survey(yard.input, options);
  ASSERT_TRUE(map.next_point);
  EXPECT_NEAR(map.next_point->rms_now_m, rms_of(map), 1e-9);
  for (const size_t tag : {1U, 2U, 4U, 6U, 7U}) {
    Yard more = yard;
    SurveyPoint p = yard.input.points[0];
    p.name = "next";
    p.tag_id = static_cast<int>(tag);
    p.world_m = map.tags[tag].world_from_tag->translation;
    more.input.points.push_back(p);
    const double then = rms_of(Survey(more.input, options));
    if (p.tag_id == map.next_point->tag_id) {
      EXPECT_NEAR(then, map.next_point->rms_then_m, 0.02 * then);
    } else {
      EXPECT_GT(then, 0.99 * map.next_point->rms_then_m) << tag;
    }
  }
}

// Hung upside down or on its side between two days, its corners are read in another order.
TEST(TagMap, ASheetThatHangsTurnedIsNamedAndBendsNothing) {
  for (const double turned_deg : {180.0, 90.0}) {
    for (const Eigen::Vector3d& shift :
         {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.2, 0.2, 0), Eigen::Vector3d(0, 1, 0)}) {
      Yard yard = MakeYard(23);
      Rigid3d turned = yard.tags[4];
      turned.rotation = turned.rotation * ExpSO3({0, 0, turned_deg * kDegToRad});
      turned.translation += shift;
      Show(&yard, 1, 4, turned, 0, 80);
      const SurveyResult map = Survey(yard.input);
      EXPECT_EQ(map.tags[4].status, "moved") << turned_deg << " " << shift.transpose();
      EXPECT_THAT(map.tags[4].reason, testing::HasSubstr(", turned by "));
      ExpectOthersRight(map, yard, {4});
    }
  }
}

// At the end of a run nothing but odometry says where a tag is: it moved, or odometry jumped. Neither is passed over.
TEST(TagMap, WhereATagMayHaveMovedOrOdometryJumpedBothAreNamed) {
  constexpr size_t kFirst = 16;  // images of run2 that see one tag alone, which no later one sees
  Yard yard = MakeYard(25);
  std::vector<ImageDetections>& images = yard.input.runs[1].images;
  std::map<int, int> seen;
  for (size_t i = 0; i < kFirst; ++i) {
    for (const TagDetection& d : images[i].detections) ++seen[d.id];
  }
  const int id = std::max_element(seen.begin(), seen.end(), [](const auto& a, const auto& b) {
                   return a.second < b.second;
                 })->first;
  Rigid3d moved = yard.tags[static_cast<size_t>(id)];
  moved.translation += Eigen::Vector3d(0.6, 0.8, 0);
  Show(&yard, 1, id, moved, 0, kFirst);
  for (size_t i = 0; i < images.size(); ++i) {
    std::erase_if(images[i].detections, [&](const TagDetection& d) { return (d.id == id) != (i < kFirst); });
  }
  const SurveyResult map = Survey(yard.input);
  ExpectOthersRight(map, yard, {id});
  ASSERT_EQ(map.undecided.size(), 1U);
  EXPECT_EQ(map.undecided[0].tag_id, id);
  EXPECT_NEAR(map.undecided[0].moved_m, 1, 0.2);
  EXPECT_THAT(map.warnings,
              testing::Contains(Says(testing::AllOf(testing::HasSubstr("m from its place when run2 passed it"),
                                                    testing::HasSubstr("odometry of run2 jumped at")))));
}

TEST(TagMap, AnIdAtTwoPlacesIsNamedAndHoldsNothing) {
  Yard yard = MakeYard(22);
  // Another sheet with the number of control tag 0 hangs where tag 4 hung.
  for (size_t run : {0U, 1U}) {
    for (ImageDetections& image : yard.input.runs[run].images) {
      for (TagDetection& d : image.detections) d.id = d.id == 4 ? 0 : d.id;
      int zeros = 0;
      for (const TagDetection& d : image.detections) zeros += d.id == 0 ? 1 : 0;
      if (zeros > 1) std::erase_if(image.detections, [](const TagDetection& d) { return d.id == 0; });
    }
  }
  SurveyPoint more = yard.input.points[0];
  more.name = "P7";
  more.tag_id = 7;
  more.world_m = yard.tags[7].translation;
  yard.input.points.push_back(more);
  const SurveyResult map = Survey(yard.input);
  EXPECT_EQ(map.tags[0].status, "duplicate") << map.tags[0].reason;
  ExpectOthersRight(map, yard, {0, 4});
  const bool named = std::any_of(map.warnings.begin(), map.warnings.end(), [](const MapWarning& w) {
    return w.point == "P0" && w.text.find("several places") != std::string::npos;
  });
  EXPECT_TRUE(named);
}

TEST(TagMap, OdometryThatJumpsIsNoDuplicate) {
  Yard yard = MakeYard(23);
  // From the middle of the second run on, odometry is somewhere else: every tag that comes back says so.
  const Rigid3d jump(ExpSO3({0, 0, 0.4}), {6, -3, 0});
  std::vector<TimedPose>& poses = yard.input.runs[1].odometry.poses;
  for (size_t i = 40; i < poses.size(); ++i) poses[i].target_from_body = jump * poses[i].target_from_body;
  const SurveyResult map = Survey(yard.input);
  ExpectOthersRight(map, yard, {});
}

// The yard's tags as geotags of panoramas beside them state them.
void AddGeotags(double up_m, Yard* yard) {
  for (int t = 0; t < 8; ++t) {
    SurveyPoint geotag;
    geotag.name = "pano" + std::to_string(t);
    geotag.role = PointRole::kGeotag;
    geotag.tag_id = t;
    geotag.sigma_h_m = geotag.sigma_v_m = 0.3;
    geotag.world_m = yard->tags[static_cast<size_t>(t)].translation + up_m * Eigen::Vector3d::UnitZ();
    yard->input.points.push_back(geotag);
  }
}

TEST(TagMap, ControlThatNoPictureShowsIsNamedAndGeotagsHoldTheMap) {
  Yard yard = MakeYard(24);
  yard.input.points[0].tag_id = 99;
  AddGeotags(0, &yard);
  const SurveyResult map = Survey(yard.input);
  EXPECT_EQ(map.datum, "control and geotags");
  EXPECT_TRUE(map.in_world);
  const bool named = std::any_of(map.warnings.begin(), map.warnings.end(), [](const MapWarning& w) {
    return w.text.find("control point P0: no picture shows its tag") != std::string::npos;
  });
  EXPECT_TRUE(named);
}

// Nothing but the tag itself joins the other run to the map: where it stands there cannot be tested.
TEST(TagMap, ATagThatAloneJoinsARunIsNotSaidToHaveMoved) {
  for (int seed = 40; seed < 60; ++seed) {
    Yard yard = MakeYard(static_cast<uint64_t>(seed));
    AddGeotags(0, &yard);
    std::erase_if(yard.input.points, [](const SurveyPoint& p) { return p.tag_id > 2; });
    for (SurveyRun& run : yard.input.runs) {
      const int last = &run == &yard.input.runs[0] ? 0 : 2;
      run.images.resize(20);
      for (ImageDetections& image : run.images) {
        std::erase_if(image.detections, [&](const TagDetection& d) { return d.id > last; });
      }
    }
    SurveyOptions options;
    options.max_iterations = 4;  // ends a little beside the minimum
    const SurveyResult map = Survey(yard.input, options);
    EXPECT_EQ(map.tags.at(0).status, "ok") << "seed " << seed << ": " << map.tags.at(0).reason;
  }
}

// Heights above the sea in one of the two: the map starts at the geotags, and control has it elsewhere.
TEST(TagMap, ControlHoldsTheMapWhereGeotagsLieApartFromIt) {
  Yard yard = MakeYard(24);
  yard.input.points.resize(2);
  Yard together = yard;
  AddGeotags(0, &together);
  AddGeotags(48, &yard);
  const SurveyResult map = Survey(yard.input);
  EXPECT_LE(map.iterations, 2 * Survey(together.input).iterations);  // it has no way to go
  EXPECT_EQ(map.datum, "control and geotags");
  for (const SurveyPoint& p : {yard.input.points[0], yard.input.points[1]}) {
    const auto tag =
        std::find_if(map.tags.begin(), map.tags.end(), [&](const auto& t) { return t.tag_id == p.tag_id; });
    ASSERT_NE(tag, map.tags.end());
    EXPECT_LT((tag->world_from_tag->translation - p.world_m).norm(), 0.1) << p.name;
  }
}

TEST(TagMap, AWrongDistanceIsTakenOut) {
  Yard yard = MakeYard(25);
  const double truth = (yard.tags[1].translation - yard.tags[5].translation).norm();
  yard.input.distances = {{1, 5, truth, 0.002, false}, {2, 6, 5, 0.002, false}};
  const SurveyResult map = Survey(yard.input);
  EXPECT_FALSE(map.distances[0].excluded);
  EXPECT_TRUE(map.distances[1].excluded);
  yard.input.distances.pop_back();
  const SurveyResult without = Survey(yard.input);
  for (size_t i = 0; i < map.tags.size(); ++i) {
    const double sigma_m = std::sqrt(without.tags[i].covariance.bottomRightCorner<3, 3>().trace());
    EXPECT_LT((map.tags[i].world_from_tag->translation - without.tags[i].world_from_tag->translation).norm(),
              0.5 * sigma_m);
  }
}

TEST(TagMap, AWrongSizeIsNamed) {
  Yard yard = MakeYard(8);
  yard.input.sizes.sizes_m[6] = 0.55;  // printed 0.5
  const SurveyResult map = Survey(yard.input);
  EXPECT_EQ(map.tags[6].status, "size") << map.tags[6].reason;
  // The map was made with the size found, so whoever uses its poses needs that one.
  EXPECT_LT(std::abs(map.tags[6].size_m - 0.5), 0.25 * 0.05);
  for (int i : {0, 1, 2, 3, 4, 5, 7}) {
    EXPECT_NE(map.tags[i].status, "size") << i << map.tags[i].reason;
    EXPECT_EQ(map.tags[i].size_m, 0.5) << i;
  }
}

// Without known lengths a wrong size scales all of the map about the tag that is held: its error is one for all tags.
TEST(TagMap, ACommonSizeErrorIsSharedByTheTags) {
  Yard yard = MakeYard(8);
  yard.input.points.clear();
  yard.input.fixed = FixedTag{2, yard.tags[2]};
  yard.input.sizes.size_m /= 0.97;
  const SurveyResult map = Survey(yard.input);
  ASSERT_TRUE(map.common_size);
  const Eigen::Vector3d held = yard.tags[2].translation;
  const auto outwards = [&](int id) {
    return (map.tags[static_cast<size_t>(id)].world_from_tag->translation - held).normalized();
  };
  const auto variance = [&](int id) {
    return outwards(id).dot(map.tags[static_cast<size_t>(id)].covariance.bottomRightCorner<3, 3>() * outwards(id));
  };
  int pairs = 0;
  for (const auto& [pair, covariance] : map.cross) {
    const auto [a, b] = pair;
    const double shared = outwards(a).dot(covariance.bottomRightCorner<3, 3>() * outwards(b));
    EXPECT_GT(shared / std::sqrt(variance(a) * variance(b)), 0.8) << a << " " << b;
    ++pairs;
  }
  EXPECT_EQ(pairs, 7 * 6 / 2);  // of all tags but the one that is held
}

// A sheet printed at 97 %: no single tag is worse than the others, and control is blamed for what odometry hides.
TEST(TagMap, OneWrongFactorOnAllSizesIsNamed) {
  const SurveyResult right = Survey(MakeYard(8).input);
  EXPECT_FALSE(right.common_size);
  Yard yard = MakeYard(8);
  yard.input.sizes.size_m /= 0.97;
  for (auto& [id, size] : yard.input.sizes.sizes_m) size /= 0.97;
  const SurveyResult map = Survey(yard.input);
  ASSERT_TRUE(map.common_size);
  EXPECT_NEAR(map.common_size->log_ratio, std::log(0.97), 4 * map.common_size->sigma);
  EXPECT_LT(map.common_size->sigma, 0.01);
  EXPECT_THAT(map.warnings, testing::Contains(Says(testing::HasSubstr("smaller than stated"))));
}

TEST(TagMap, WrongControlIsTakenOutAndNamed) {
  Yard yard = MakeYard(9);
  for (int t : {1, 7}) {
    SurveyPoint p = yard.input.points[0];
    p.name = "P" + std::to_string(t);
    p.tag_id = t;
    p.world_m = yard.tags[t].translation;
    yard.input.points.push_back(p);
  }
  yard.input.points[1].world_m += Eigen::Vector3d(0.5, 0, 0.1);
  const SurveyResult map = Survey(yard.input);
  int excluded = 0;
  for (const PointAgreement& p : map.points) {
    EXPECT_EQ(p.excluded, p.name == "P3") << p.name;
    excluded += p.excluded ? 1 : 0;
    EXPECT_EQ(p.left_out_m.has_value(), p.used && p.role == PointRole::kControl);
  }
  EXPECT_EQ(excluded, 1);
  EXPECT_LT((map.tags[3].world_from_tag->translation - yard.tags[3].translation).norm(), 0.06);
}

// A digit too many in one of two points: the map bends to them, so that its residuals would show nothing.
TEST(TagMap, TwoPointsThatLieFarFartherApartThanTheTagsAreRefused) {
  Yard yard = MakeYard(24);
  yard.input.points.resize(2);
  EXPECT_NO_THROW(Survey(yard.input));
  yard.input.points[0].world_m += Eigen::Vector3d(940, 0, 0);
  try {
    Survey(yard.input);
    FAIL() << "expected a refusal";
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("the two surveyed points are"), std::string::npos) << e.what();
  }
}

// Two pillars that are known, one set-up over the first and one anywhere between the tags; both read every tag.
void ReadWithTotalStation(uint64_t seed, Yard* yard) {
  constexpr double kAngle = 2e-5, kLength = 0.002, kPillar = 0.003, kCentring = 0.001;
  Random random(seed + 1000);
  const std::map<std::string, Eigen::Vector3d> marks = {{"A", {-1, 2, 0}}, {"B", {40, 60, 3}}, {"free", {2, -3, 0.2}}};
  SurveyStations stations;
  for (const char* name : {"A", "B"}) {
    stations.known.push_back({name, marks.at(name) + kPillar * RandomVector(&random, 1), kPillar, kPillar});
  }
  for (const std::string setup : {"A", "free"}) {
    const Eigen::Vector3d instrument =
        marks.at(setup) + Eigen::Vector3d(0, 0, 1.6) + kCentring * RandomVector(&random, 1);
    const double orientation = setup == "A" ? 1 : -2;
    std::map<std::string, Eigen::Vector3d> targets = {{"B", marks.at("B")}};
    if (setup != "A") targets["A"] = marks.at("A");
    for (size_t t = 0; t < yard->tags.size(); ++t) targets["tag:" + std::to_string(t)] = yard->tags[t].translation;
    for (const auto& [name, at] : targets) {
      StationSighting s;
      s.setup = setup, s.target = name;
      s.instrument_height_m = 1.6;
      s.sigma_direction_rad = s.sigma_zenith_rad = kAngle, s.sigma_distance_m = kLength;
      const auto read = [&](StationReading reading, double sigma) {
        const double* parameters[] = {instrument.data(), at.data(), &orientation};
        double value = 0;
        EXPECT_TRUE(StationCost(reading, 0, 1, {}, 0).Evaluate(parameters, &value, nullptr));
        return value + sigma * random.Normal();
      };
      s.direction_rad = read(StationReading::kDirection, kAngle);
      s.zenith_rad = read(StationReading::kZenith, kAngle);
      s.distance_m = read(StationReading::kDistance, kLength);
      s.line = static_cast<int>(stations.sightings.size()) + 2;
      stations.sightings.push_back(s);
    }
  }
  stations.network = AdjustNetwork(stations.sightings, stations.known, {});
  yard->input.points.clear();
  for (const NetworkPoint& point : stations.network.points) {
    const auto tag = TagOfTarget(point.name);
    if (!tag) continue;
    SurveyPoint p;
    p.name = point.name;
    p.start_only = true;
    p.tag_id = tag->first;
    p.world_m = point.position;
    p.sigma_h_m = p.sigma_v_m = 0.005;
    yard->input.points.push_back(p);
  }
  yard->input.stations = stations;
}

TEST(TagMap, ReadingsOfATotalStationHoldTheMap) {
  double nees = 0, worst = 0;
  int n = 0;
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    Yard yard = MakeYard(seed);
    ReadWithTotalStation(seed, &yard);
    const SurveyResult map = Survey(yard.input);
    EXPECT_TRUE(map.in_world);
    EXPECT_TRUE(map.points.empty());  // a start is neither control nor check
    EXPECT_EQ(map.station_residuals.size(), 3 * yard.input.stations->sightings.size());
    for (const TagEstimate& tag : map.tags) {
      ASSERT_TRUE(tag.HasPose()) << tag.tag_id;
      const Vector6d e = tag.world_from_tag->Minus(yard.tags[static_cast<size_t>(tag.tag_id)]);
      worst = std::max(worst, e.tail<3>().norm());
      nees += e.dot(tag.covariance.inverse() * e);
      ++n;
    }
  }
  // 3 mm of a pillar, 2 mm of a distance: beyond four of their sigmas there is nothing.
  EXPECT_LT(worst, 0.016);
  EXPECT_GT(nees / n, 6 * 0.5);
  EXPECT_LT(nees / n, 6 * 1.5);
}

TEST(TagMap, ReadingsHoldTheMapWhereverItsCoordinatesBegin) {
  Yard here = MakeYard(3);
  ReadWithTotalStation(3, &here);
  Yard there = here;
  const Eigen::Vector3d grid(512'000, 5'321'000, 310);
  for (NetworkPoint& p : there.input.stations->known) p.position += grid;
  for (SurveyPoint& p : there.input.points) p.world_m += grid;
  for (Yard* yard : {&here, &there}) {
    SurveyStations& s = *yard->input.stations;
    s.level_from_world = LevelFromWorld(s.known, s.sightings, std::nullopt);
    s.network = AdjustNetwork(s.sightings, s.known, {}, s.level_from_world);
  }
  const SurveyResult one = Survey(here.input), two = Survey(there.input);
  ASSERT_TRUE(two.in_world);
  for (size_t i = 0; i < one.tags.size(); ++i) {
    const Eigen::Vector3d &a = one.tags[i].world_from_tag->translation, &b = two.tags[i].world_from_tag->translation;
    EXPECT_LT((b - a - grid).norm(), 1e-4) << i;
  }
}

TEST(TagMap, ATagThatWasMovedAfterItWasReadIsNamedByItsLine) {
  Yard yard = MakeYard(4);
  ReadWithTotalStation(4, &yard);
  for (StationSighting& s : yard.input.stations->sightings) {
    if (s.target == "tag:2") s.distance_m = *s.distance_m + 0.1;
  }
  const SurveyResult map = Survey(yard.input);
  std::string all;
  for (const MapWarning& w : map.warnings) all += w.text + "\n";
  for (const StationSighting& s : yard.input.stations->sightings) {
    if (s.target != "tag:2") continue;
    EXPECT_NE(all.find("total_station.csv, line " + std::to_string(s.line) + ":"), std::string::npos) << all;
  }
}

TEST(TagMap, DistancesAreHeldOrOnlyCompared) {
  Yard yard = MakeYard(10);
  const double truth = (yard.tags[1].translation - yard.tags[5].translation).norm();
  yard.input.distances = {{1, 5, truth, 0.002, false}, {2, 6, truth + 0.5, 0.002, true}};
  const SurveyResult map = Survey(yard.input);
  ASSERT_EQ(map.distances.size(), 2U);
  EXPECT_NEAR(map.distances[0].map_m, truth, 0.006);
  EXPECT_NEAR(map.distances[1].map_m, (yard.tags[2].translation - yard.tags[6].translation).norm(), 0.08);
  const std::string all = [&] {
    std::string text;
    for (const MapWarning& w : map.warnings) text += w.text + "\n";
    return text;
  }();
  EXPECT_NE(all.find("distance 2 - 6"), std::string::npos) << all;
  EXPECT_EQ(all.find("distance 1 - 5"), std::string::npos) << all;
}

// A stitched photo set sees all tags from one place: it ties the map together, and its rig's size is found.
TEST(TagMap, StillsTakePart) {
  double nees = 0, with = 0, without = 0, best = 1;
  int n = 0;
  const int redraws = 20;
  for (int seed = 1; seed <= redraws; ++seed) {
    Yard yard = MakeYard(seed);
    const SurveyResult runs = Survey(yard.input);
    yard.input.runs.push_back(MakeStills(yard, 100 + seed, 0.87));
    const SurveyResult map = Survey(yard.input);
    for (size_t t = 0; t < map.tags.size(); ++t) {
      ASSERT_TRUE(map.tags[t].HasPose());
      EXPECT_EQ(map.tags[t].runs, 3);
      const Vector6d e = map.tags[t].world_from_tag->Minus(yard.tags[t]);
      nees += e.dot(map.tags[t].covariance.inverse() * e);
      with += e.tail<3>().squaredNorm();
      without += runs.tags[t].world_from_tag->Minus(yard.tags[t]).tail<3>().squaredNorm();
      ++n;
    }
    const RunAgreement& stills = map.runs[2];
    EXPECT_EQ(stills.frames, 16);
    EXPECT_EQ(stills.rejected, 0);
    EXPECT_NEAR(stills.scale, 1 / 0.87, 4 * stills.scale_sigma);
    best = std::min(best, stills.scale_sigma);
  }
  EXPECT_LT(best, 0.15);  // the prior's is 0.2
  EXPECT_LT(with, 0.8 * without);
  // Tags of one map are not independent: the band is that of the redraws alone.
  EXPECT_GT(nees / (6 * n), 0.8);
  EXPECT_LT(nees / (6 * n), 1.25);
}

TEST(TagMap, TagsThatAreOnNoPlaneAreNamed) {
  Yard yard = MakeYard(12);
  yard.input.points.clear();
  yard.input.level_tags = {0, 3, 6};
  const SurveyResult three = Survey(yard.input);
  ASSERT_EQ(three.plane.size(), 3U);
  for (const PlaneAgreement& p : three.plane) EXPECT_EQ(p.sigma_m, 0) << p.tag_id;  // three always have a plane
  for (const int off : {1, 2}) {                                                    // half a metre, a metre higher
    yard.input.level_tags = {0, 3, 6, off};
    EXPECT_THAT(Survey(yard.input).warnings, testing::Contains(Says(testing::HasSubstr("the plane of plane_tags"))));
  }
}

TEST(TagMap, APlaneLevelsTheMap) {
  Yard yard = MakeYard(12);
  yard.input.points.clear();
  yard.input.level_tags = {0, 3, 6};  // tags at 1 m
  for (SurveyRun& run : yard.input.runs) {
    const Rigid3d tilt(ExpSO3({0.1, -0.05, 0.3}), {1, 2, 3});
    for (TimedPose& pose : run.odometry.poses) pose.target_from_body = tilt * pose.target_from_body;
  }
  const SurveyResult map = Survey(yard.input);
  EXPECT_EQ(map.datum, "plane");
  for (int i : {0, 3, 6}) EXPECT_NEAR(map.tags[i].world_from_tag->translation.z(), 0, 0.02);
  EXPECT_NEAR(map.tags[2].world_from_tag->translation.z(), 1.0, 0.1);
}

// Control on these tags, too.
void AddControl(Yard* yard, const std::vector<size_t>& tags, Random* random) {
  for (const size_t t : tags) {
    SurveyPoint p = yard->input.points[0];
    p.name = std::to_string(t).insert(0, 1, 'P');
    p.tag_id = static_cast<int>(t);
    p.world_m = yard->tags[t].translation + 0.005 * RandomVector(random, 1);
    yard->input.points.push_back(p);
  }
}

std::string RefusalOf(const Yard& yard) {
  try {
    Survey(yard.input);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(TagMap, APlaneNeedsATagBesideTheLine) {
  Yard yard = MakeYard(12, 0);  // all tags at one height
  yard.input.points.clear();
  const Rigid3d between(yard.tags[1].rotation, 0.5 * (yard.tags[0].translation + yard.tags[2].translation));
  for (const size_t run : {0U, 1U}) Show(&yard, run, 1, between, 0, 80);
  yard.input.level_tags = {0, 1, 2};
  EXPECT_THAT(RefusalOf(yard), testing::HasSubstr("plane_tags (0 1 2): these tags lie on one line"));
  yard.input.level_tags = {0, 1, 2, 5};
  EXPECT_EQ(Survey(yard.input).datum, "plane");
  yard.input.level_tags = {0, 5, 99};
  EXPECT_THAT(RefusalOf(yard), testing::HasSubstr("in the map, found 2"));
}

// They lie 9 to 20 m off: with their full weight the first solution would not converge.
TEST(TagMap, ExchangedPointsAreTakenOut) {
  Random random(31);
  Yard yard = MakeYard(31);
  AddControl(&yard, {1, 4, 7}, &random);
  std::swap(yard.input.points[1].world_m, yard.input.points.back().world_m);  // of tags 3 and 7
  const SurveyResult map = Survey(yard.input);
  for (const PointAgreement& p : map.points) EXPECT_EQ(p.excluded, p.name == "P3" || p.name == "P7") << p.name;
  ExpectOthersRight(map, yard, {});
}

TEST(TagMap, SheetsExchangedBetweenRunsAreNamed) {
  Yard yard = MakeYard(32);
  Show(&yard, 1, 2, yard.tags[6], 0, 80);
  Show(&yard, 1, 6, yard.tags[2], 0, 80);
  const SurveyResult map = Survey(yard.input);
  for (const size_t id : {2U, 6U}) {
    EXPECT_EQ(map.tags[id].status, "moved") << map.tags[id].reason;
    EXPECT_LT((map.tags[id].world_from_tag->translation - yard.tags[id].translation).norm(), 0.1) << id;
  }
  ExpectOthersRight(map, yard, {2, 6});
}

// It is the point that is taken out: no tag is said to have moved or to have another size in its place.
TEST(TagMap, AWrongPointIsNotBlamedOnTags) {
  for (const double off_m : {0.1, 0.9}) {
    Random random(33);
    Yard yard = MakeYard(33);
    AddControl(&yard, {1, 7}, &random);
    yard.input.points.back().world_m.y() += off_m;
    const SurveyResult map = Survey(yard.input);
    for (const PointAgreement& p : map.points) EXPECT_EQ(p.excluded, p.name == "P7") << p.name << " " << off_m;
    EXPECT_FALSE(map.common_size);
    ExpectOthersRight(map, yard, {});
  }
}

// Control shows factors that odometry cannot: which of sizes and points are wrong is what odometry agrees with.
TEST(TagMap, SizesAndUnitsOfPointsAreToldApart) {
  Random random(34);
  Yard sizes = MakeYard(34);
  AddControl(&sizes, {1, 7}, &random);
  Yard yards = sizes;
  sizes.input.sizes.size_m *= 1.013;
  const SurveyResult map = Survey(sizes.input);
  ASSERT_TRUE(map.common_size);
  EXPECT_NEAR(map.common_size->log_ratio, -std::log(1.013), 4 * map.common_size->sigma);
  for (const TagEstimate& tag : map.tags) {
    EXPECT_NEAR(std::log(tag.size_m / sizes.input.sizes.size_m), map.common_size->log_ratio,
                0.5 * map.common_size->sigma);
  }
  ExpectOthersRight(map, sizes, {});
  for (const PointAgreement& p : map.points) EXPECT_FALSE(p.excluded) << p.name;
  for (SurveyPoint& p : yards.input.points) p.world_m /= 0.9144;
  EXPECT_THAT(RefusalOf(yards), testing::HasSubstr("found what may be yards"));
}

TEST(TagMap, OdometryOfOneRunThatContradictsTheTagsIsRefused) {
  const auto refusal = [](const Eigen::Matrix3d& change) {
    Yard yard = MakeYard(35);
    for (TimedPose& pose : yard.input.runs[1].odometry.poses) {
      pose.target_from_body.translation = change * pose.target_from_body.translation;
    }
    return RefusalOf(yard);
  };
  EXPECT_THAT(refusal(ExpSO3({0, 0, M_PI_2}).toRotationMatrix()),
              testing::AllOf(testing::HasSubstr("run run2: "), testing::HasSubstr("are turned by 9")));
  EXPECT_THAT(refusal(Eigen::Vector3d(1, -1, 1).asDiagonal()), testing::HasSubstr("positions are mirrored"));
  EXPECT_THAT(refusal(Eigen::Matrix3d(Eigen::Matrix3d::Identity() / 0.3048)),
              testing::HasSubstr("run run2: lengths of its odometry are 3.3"));
  EXPECT_EQ(refusal(Eigen::Matrix3d::Identity()), "");
}

TEST(TagMap, OtherConventionsAreRefused) {
  Yard corners = MakeYard(13);
  for (ImageDetections& image : corners.input.runs[0].images) {
    for (TagDetection& d : image.detections) std::reverse(d.corners.begin(), d.corners.end());
  }
  EXPECT_THROW(Survey(corners.input), InputError);
  Yard quaternions = MakeYard(13);
  for (TimedPose& pose : quaternions.input.runs[0].odometry.poses) {
    const Eigen::Quaterniond q = pose.target_from_body.rotation;  // written w x y z, read x y z w
    pose.target_from_body.rotation = Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y());
  }
  EXPECT_THROW(Survey(quaternions.input), InputError);
  const auto with_points = [](Yard yard) {
    for (const int t : {1, 2, 4, 7}) {
      yard.input.points.push_back(yard.input.points[0]);
      yard.input.points.back().name = "P" + std::to_string(t);
      yard.input.points.back().tag_id = t;
      yard.input.points.back().world_m = yard.tags[static_cast<size_t>(t)].translation;
    }
    return yard;
  };
  Yard level = with_points(MakeYard(13));  // points in one plane fit their mirror image, too
  EXPECT_EQ(RefusalOf(level), "");
  for (SurveyPoint& p : level.input.points) p.world_m.x() *= -1;
  EXPECT_NE(RefusalOf(level).find("the site on its head"), std::string::npos) << RefusalOf(level);
  Yard swapped = with_points(MakeYard(13, 1.6));
  EXPECT_EQ(RefusalOf(swapped), "");
  for (SurveyPoint& p : swapped.input.points) std::swap(p.world_m.x(), p.world_m.y());
  EXPECT_NE(RefusalOf(swapped).find("easting and northing are swapped"), std::string::npos) << RefusalOf(swapped);
  Yard down = MakeYard(13);  // forward, right, down
  const Eigen::Matrix3d flip = Eigen::Vector3d(1, -1, -1).asDiagonal();
  const Eigen::Quaterniond half_turn(flip);
  for (TimedPose& pose : down.input.runs[0].odometry.poses) {
    const Rigid3d& p = pose.target_from_body;
    pose.target_from_body = Rigid3d(half_turn * p.rotation * half_turn, half_turn * p.translation);
  }
  EXPECT_NE(RefusalOf(down).find("forward, right, down"), std::string::npos) << RefusalOf(down);
  Yard inverted = MakeYard(13);
  for (TimedPose& pose : inverted.input.runs[1].odometry.poses) pose.target_from_body = pose.target_from_body.Inverse();
  EXPECT_NE(RefusalOf(inverted).find("body_from_odom"), std::string::npos) << RefusalOf(inverted);
  Yard size = MakeYard(13);
  size.input.sizes.size_m = 0.4;  // printed 0.5
  EXPECT_NE(RefusalOf(size).find("tags.yaml"), std::string::npos) << RefusalOf(size);
  Yard feet = MakeYard(13);
  for (SurveyPoint& p : feet.input.points) p.world_m /= 0.3048;
  EXPECT_NE(RefusalOf(feet).find("feet"), std::string::npos) << RefusalOf(feet);
}

TEST(TagMap, APrincipalPointThatNobodyMeasuredIsAskedAbout) {
  Yard yard = MakeYard(13);
  BodyCamera& camera = yard.input.runs[0].cameras[0];
  const auto asked = [](const SurveyResult& map) {
    return std::any_of(map.warnings.begin(), map.warnings.end(), [](const MapWarning& w) {
      return w.text.find("principal point is exactly half the picture") != std::string::npos;
    });
  };
  EXPECT_FALSE(asked(Survey(yard.input)));
  std::vector<double> params = camera.camera.params();
  params[2] = 0.5 * camera.camera.width(), params[3] = 0.5 * camera.camera.height();
  camera.camera = Camera(camera.camera.model(), camera.camera.width(), camera.camera.height(), params);
  EXPECT_TRUE(asked(Survey(yard.input)));
}

}  // namespace
}  // namespace trigpoint

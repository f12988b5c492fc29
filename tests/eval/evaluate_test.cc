#include "eval/errors/evaluate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "calib/base/error.h"
#include "calib/estimation/random.h"
#include "eval/errors/compare.h"

namespace trigpoint {
namespace {

using ::testing::HasSubstr;

const Rigid3d kWorldFromOdom(ExpSO3({0.05, -0.1, 1.3}), {3, -7, 0.5});

// A tag that hangs upright and faces the direction `facing_rad` (ENU yaw of its outward normal).
Rigid3d UprightTag(const Eigen::Vector3d& position, double facing_rad) {
  const Eigen::Vector3d out(std::cos(facing_rad), std::sin(facing_rad), 0);
  Eigen::Matrix3d r;  // x right as seen by a reader, y down, z into the tag
  r.col(2) = -out;
  r.col(1) = -Eigen::Vector3d::UnitZ();
  r.col(0) = r.col(1).cross(r.col(2));
  return {Eigen::Quaterniond(r), position};
}

// Two stations, one with each form of offset, and a run whose answers are off by a known vector.
struct Scene {
  std::vector<Station> stations{{.name = "S1", .tag_id = 1, .offset_m = {0.1, 0.2, 0.9}, .sigma_m = 0.03},
                                {.name = "S2", .tag_id = 2, .offset_m = {0.3, 0.4, 0.8}, .in_tag_frame = true}};
  std::vector<TagResult> world_tags;
  std::vector<Eigen::Vector3d> centres;
  EvaluatedRun run{.run = "run1"};

  Scene() {
    for (int i = 0; i < 2; ++i) {
      TagResult tag;
      tag.tag_id = i + 1;
      tag.map_from_tag = UprightTag({10.0 * i, 5, 1}, 0.5);
      world_tags.push_back(tag);
    }
    centres.push_back(world_tags[0].map_from_tag->translation + stations[0].offset_m);
    // Right of a reader who faces the tag is minus the turned-left facing.
    const Eigen::Vector3d out(std::cos(0.5), std::sin(0.5), 0), right(-std::sin(0.5), std::cos(0.5), 0);
    centres.push_back(world_tags[1].map_from_tag->translation + 0.3 * right + 0.4 * out +
                      0.8 * Eigen::Vector3d::UnitZ());
    const Rigid3d odom_from_world = kWorldFromOdom.Inverse();
    for (const TagResult& tag : world_tags) {
      run.self_tags.push_back(tag);
      run.self_tags.back().map_from_tag = odom_from_world * *tag.map_from_tag;
    }
    Random random(3);
    for (int i = 0; i < 20; ++i) {
      const Rigid3d world_from_cam(ExpSO3({random.Normal(), random.Normal(), random.Normal()}), {0.5 * i, 2, 1});
      run.result.cameras.push_back({i * 1000, world_from_cam});
      run.result.cameras_odom.push_back({i * 1000, odom_from_world * world_from_cam});
    }
  }
  void Answer(int station, const Eigen::Vector3d& error) {
    const Rigid3d world_from_pano(ExpSO3({0.1, 0.2, 0.3}), centres[static_cast<size_t>(station)] + error);
    run.result.panoramas.push_back({.panorama = "p" + std::to_string(station + 1) + ".jpg",
                                    .station = "S" + std::to_string(station + 1),
                                    .status = "localized",
                                    .world_from_pano = world_from_pano,
                                    .odom_from_pano = kWorldFromOdom.Inverse() * world_from_pano});
  }
  Evaluation Evaluate(std::vector<ReferenceMap> references = {}) {
    run.result.world_from_odom = WorldFromOdom(run.result.cameras_odom, run.result.cameras);
    return trigpoint::Evaluate({.runs = {run}, .stations = stations, .references = std::move(references)},
                               {.bootstrap_samples = 0});
  }
};

TEST(StationCentre, HandlesBothFormsOfOffset) {
  const Scene scene;
  std::string reason;
  const Eigen::Matrix3d enu = Eigen::Matrix3d::Identity();
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  for (size_t i = 0; i < 2; ++i) {
    const auto centre = StationCentre(scene.stations[i], *scene.world_tags[i].map_from_tag, enu, up, &reason);
    ASSERT_TRUE(centre);
    EXPECT_LT((*centre - scene.centres[i]).norm(), 1e-12);
  }
}

TEST(StationCentre, LevelsATiltedTag) {
  const Scene scene;
  std::string reason;
  const Rigid3d upright = *scene.world_tags[1].map_from_tag;
  // Leaning back or rolled by a little, the tape still measured along the level and the plumb line.
  const Rigid3d leaning(upright.rotation * ExpSO3({0.2, 0, 0}), upright.translation);
  const auto centre = StationCentre(scene.stations[1], leaning, std::nullopt, Eigen::Vector3d::UnitZ(), &reason);
  ASSERT_TRUE(centre);
  EXPECT_LT((*centre - scene.centres[1]).norm(), 1e-12);
}

TEST(StationCentre, SaysWhatIsMissing) {
  const Scene scene;
  std::string reason;
  EXPECT_FALSE(StationCentre(scene.stations[0], *scene.world_tags[0].map_from_tag, std::nullopt,
                             Eigen::Vector3d::UnitZ(), &reason));
  EXPECT_THAT(reason, HasSubstr("no global fit"));
  EXPECT_FALSE(
      StationCentre(scene.stations[1], *scene.world_tags[1].map_from_tag, std::nullopt, std::nullopt, &reason));
  EXPECT_THAT(reason, HasSubstr("odometry.levelled"));
  const Rigid3d on_its_side(ExpSO3({0, -1.5707963267948966, 0}), Eigen::Vector3d::Zero());  // x axis vertical
  EXPECT_FALSE(StationCentre(scene.stations[1], on_its_side, std::nullopt, Eigen::Vector3d::UnitZ(), &reason));
  EXPECT_THAT(reason, HasSubstr("on its side"));
}

TEST(WorldFromOdom, IsRecoveredFromTheTwoTrajectories) {
  const Scene scene;
  const auto fit = WorldFromOdom(scene.run.result.cameras_odom, scene.run.result.cameras);
  ASSERT_TRUE(fit);
  EXPECT_LT(fit->TransformPose(Rigid3d()).Minus(kWorldFromOdom).norm(), 1e-12);
  EXPECT_NEAR(fit->scale, 1, 1e-12);
  std::vector<TimedPose> longer = scene.run.result.cameras;
  for (TimedPose& pose : longer) pose.target_from_body.translation *= 1.25;
  EXPECT_NEAR(WorldFromOdom(scene.run.result.cameras_odom, longer)->scale, 1.25, 1e-12);
  EXPECT_FALSE(WorldFromOdom(scene.run.result.cameras_odom, {}));
}

TEST(Evaluate, GivesRelativeErrorsInEnuComponents) {
  Scene scene;
  scene.Answer(0, {0.03, -0.04, 0.12});
  scene.Answer(1, {0.3, 0.4, 0});
  const Evaluation e = scene.Evaluate();
  ASSERT_EQ(e.rows.size(), 2u);
  EXPECT_EQ(e.rows[0].reference, "self");
  EXPECT_EQ(e.rows[0].kind, "relative");
  EXPECT_TRUE(e.rows[0].shares_evidence);
  EXPECT_EQ(e.rows[0].tag_id, 1);
  EXPECT_NEAR(*e.rows[0].error_3d_m, 0.13, 1e-9);
  EXPECT_NEAR(*e.rows[0].error_h_m, 0.05, 1e-9);
  EXPECT_NEAR(*e.rows[0].error_v_m, 0.12, 1e-9);
  EXPECT_LT((*e.rows[0].error_enu_m - Eigen::Vector3d(0.03, -0.04, 0.12)).norm(), 1e-9);
  EXPECT_NEAR(*e.rows[1].error_3d_m, 0.5, 1e-9);
  EXPECT_FALSE(e.rows[0].covariance_m2);
  EXPECT_FALSE(e.rows[0].nees);
  ASSERT_EQ(e.groups.size(), 1u);
  EXPECT_EQ(e.groups[0].attempts, 2);
  EXPECT_EQ(e.groups[0].answers, 2);
  EXPECT_EQ(e.groups[0].passed, 2);
}

TEST(Evaluate, IsInvariantToTheRunsOwnFrame) {
  Scene scene;
  scene.Answer(0, {0.03, -0.04, 0.12});
  const Evaluation before = scene.Evaluate();
  const Rigid3d moved(ExpSO3({1, 2, -0.5}), {100, 20, -3});
  for (TagResult& tag : scene.run.self_tags) tag.map_from_tag = moved * *tag.map_from_tag;
  for (TimedPose& pose : scene.run.result.cameras_odom) pose.target_from_body = moved * pose.target_from_body;
  for (PanoramaResult& row : scene.run.result.panoramas) row.odom_from_pano = moved * *row.odom_from_pano;
  const Evaluation after = scene.Evaluate();
  EXPECT_LT((*after.rows[0].error_enu_m - *before.rows[0].error_enu_m).norm(), 1e-9);
}

// A run whose metre is 0.3 m long: its cameras, tags, answers and their sigmas are, and the tape is not.
TEST(Evaluate, RelativeErrorsAndTheirSigmasAreInMetresOfTheTags) {
  Scene scene;
  scene.Answer(0, {0.03, -0.04, 0.12});
  scene.Answer(1, {0.03, -0.04, 0.12});
  for (PanoramaResult& row : scene.run.result.panoramas) row.odom_sigma_m = Eigen::Vector3d(0.01, 0.02, 0.03);
  for (TagResult& tag : scene.run.self_tags) tag.sigma_m = Eigen::Vector3d(0.02, 0.01, 0.01);
  const Evaluation in_metres = scene.Evaluate();
  static constexpr double kMetre = 0.3;
  const auto longer = [](Rigid3d pose) {
    pose.translation *= kMetre;
    return pose;
  };
  for (TagResult& tag : scene.run.self_tags) {
    tag.map_from_tag = longer(*tag.map_from_tag);
    *tag.sigma_m *= kMetre;
  }
  for (TimedPose& pose : scene.run.result.cameras_odom) pose.target_from_body = longer(pose.target_from_body);
  for (PanoramaResult& row : scene.run.result.panoramas) {
    row.odom_from_pano = longer(*row.odom_from_pano);
    *row.odom_sigma_m *= kMetre;
  }
  scene.run.self_metre = kMetre;
  const Evaluation in_frame = scene.Evaluate();
  ASSERT_EQ(in_frame.rows.size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(*in_frame.rows[i].error_3d_m, 0.13, 1e-9);
    EXPECT_NEAR(*in_frame.rows[i].nees, *in_metres.rows[i].nees, 1e-9);
    EXPECT_NEAR(*in_frame.rows[i].sigma_tag_map_m, *in_metres.rows[i].sigma_tag_map_m, 1e-12);
    EXPECT_NEAR(*in_frame.rows[i].sigma_localization_m, *in_metres.rows[i].sigma_localization_m, 1e-12);
  }
}

TEST(Evaluate, WithoutAGlobalFitUsesALevelledOdometryForTheVertical) {
  Scene scene;
  scene.Answer(1, {0.3, 0.4, 0.1});
  const Rigid3d levelled_from_odom(ExpSO3({0, 0, 0.7}), {0, 0, 0});
  for (TagResult& tag : scene.run.self_tags) tag.map_from_tag = levelled_from_odom * kWorldFromOdom * *tag.map_from_tag;
  for (TimedPose& pose : scene.run.result.cameras_odom) {
    pose.target_from_body = levelled_from_odom * kWorldFromOdom * pose.target_from_body;
  }
  for (PanoramaResult& row : scene.run.result.panoramas) {
    row.odom_from_pano = levelled_from_odom * kWorldFromOdom * *row.odom_from_pano;
    row.world_from_pano.reset();
  }
  scene.run.result.cameras.clear();
  const Evaluation blind = scene.Evaluate();
  EXPECT_EQ(blind.rows.at(1).status, "no_reference");
  scene.run.odometry_levelled = true;
  const Evaluation e = scene.Evaluate();
  EXPECT_NEAR(*e.rows.at(1).error_3d_m, std::sqrt(0.26), 1e-9);
  EXPECT_NEAR(*e.rows.at(1).error_v_m, 0.1, 1e-9);
  EXPECT_FALSE(e.rows.at(1).error_enu_m);
}

TEST(Evaluate, KeepsAbstentionsWithTheirReasons) {
  Scene scene;
  scene.Answer(0, {1, 0, 0});
  scene.run.result.panoramas[0].status = "rejected";
  scene.run.result.panoramas[0].reason = "the views disagree";
  const Evaluation e = scene.Evaluate();
  ASSERT_EQ(e.rows.size(), 2u);
  EXPECT_EQ(e.rows[0].status, "rejected");
  EXPECT_FALSE(e.rows[0].error_3d_m);
  EXPECT_TRUE(e.rows[0].passed);
  EXPECT_EQ(e.rows[1].status, "missing");
  EXPECT_EQ(e.groups[0].attempts, 2);
  EXPECT_EQ(e.groups[0].answers, 0);
  EXPECT_EQ(e.groups[0].reasons.at("rejected: the views disagree"), 1);
  EXPECT_FALSE(e.groups[0].error_3d.median);
  EXPECT_FALSE(e.groups[0].error_3d.median_attempts);
}

TEST(Evaluate, AnAnswerWithoutReferenceIsNoAttempt) {
  Scene scene;
  scene.Answer(0, {1, 0, 0});
  scene.Answer(1, {1, 0, 0});
  scene.run.self_tags.erase(scene.run.self_tags.begin());
  scene.run.result.panoramas[1].station = "elsewhere";
  const Evaluation e = scene.Evaluate();
  ASSERT_EQ(e.rows.size(), 3u);  // S1 without tag, S2 missing, elsewhere without station
  EXPECT_EQ(e.rows[0].status, "no_reference");
  EXPECT_THAT(e.rows[0].reason, HasSubstr("tag 1"));
  EXPECT_EQ(e.rows[1].status, "missing");
  EXPECT_EQ(e.rows[2].status, "no_reference");
  EXPECT_THAT(e.rows[2].reason, HasSubstr("elsewhere is not in stations.csv"));
  EXPECT_EQ(e.groups[0].attempts, 1);
  EXPECT_EQ(e.groups[0].unscored, 2);
  // Nor is a refusal where no reference says where the station is, also where rows are compared.
  scene.run.result.panoramas[0].status = "rejected";
  const Evaluation refused = scene.Evaluate();
  EXPECT_EQ(refused.rows[0].status, "rejected");
  EXPECT_EQ(refused.groups[0].attempts, 1);
  EXPECT_EQ(refused.groups[0].unscored, 1);
  const std::vector<ComparedGroup> compared = CompareErrors(refused.rows, refused.rows);
  ASSERT_EQ(compared.size(), 1u);
  EXPECT_EQ(compared[0].a.attempts, 1);
}

TEST(Evaluate, G1SpeaksThroughItsViewWithTheMostInliers) {
  Scene scene;
  scene.Answer(0, {0.1, 0, 0});
  scene.run.method = "g2";
  const auto view = [&](const char* name, const char* status, double error, int inliers) {
    const Rigid3d world_from_view(Eigen::Quaterniond::Identity(), scene.centres[0] + Eigen::Vector3d(error, 0, 0));
    scene.run.result.views.push_back({.panorama = "p1.jpg",
                                      .view = name,
                                      .status = status,
                                      .odom_from_view = kWorldFromOdom.Inverse() * world_from_view,
                                      .inliers = inliers});
  };
  view("0", "localized", 1.5, 20);
  view("1", "localized", 0.7, 50);
  view("2", "rejected", 9, 80);
  const Evaluation e = scene.Evaluate({{.name = "survey", .tags = scene.world_tags, .runs = {"run9"}}});
  ASSERT_EQ(e.groups.size(), 4u);
  EXPECT_EQ(e.groups[0].group.method, "g1");
  EXPECT_EQ(e.groups[2].group.method, "g2");
  EXPECT_NEAR(*e.groups[0].error_3d.median, 0.7, 1e-9);
  EXPECT_NEAR(*e.groups[1].error_3d.median, 0.7, 1e-9);  // absolute, through the run's global fit
  EXPECT_NEAR(*e.groups[2].error_3d.median, 0.1, 1e-9);
  EXPECT_EQ(e.groups[0].attempts, 2);
}

TEST(Evaluate, AbsoluteErrorsUseTheMapAndTheWorldPosition) {
  Scene scene;
  scene.Answer(0, {0, 0, 0});
  scene.run.result.panoramas[0].world_from_pano->translation += Eigen::Vector3d(0.2, 0, 0);  // the global fit's error
  scene.run.result.panoramas[0].sigma_m = Eigen::Vector3d(0.1, 0.2, 0.3);
  scene.world_tags[0].sigma_m = Eigen::Vector3d(0.01, 0.02, 0.03);
  const Evaluation e = scene.Evaluate({{.name = "survey", .tags = scene.world_tags, .runs = {"run9"}}});
  ASSERT_EQ(e.rows.size(), 4u);
  const ErrorRow& absolute = e.rows[2];
  EXPECT_EQ(absolute.kind, "absolute");
  EXPECT_EQ(absolute.reference, "survey");
  EXPECT_FALSE(absolute.shares_evidence);
  EXPECT_NEAR(*absolute.error_3d_m, 0.2, 1e-9);
  ASSERT_TRUE(absolute.covariance_m2);
  const double variance = 0.1 * 0.1 + 0.01 * 0.01 + 0.03 * 0.03;  // answer, tag, tape
  EXPECT_NEAR((*absolute.covariance_m2)(0, 0), variance, 1e-12);
  EXPECT_NEAR(*absolute.nees, 0.04 / variance, 1e-9);
  EXPECT_EQ(absolute.dof, 3);
  EXPECT_NEAR(*e.rows[0].error_3d_m, 0, 1e-9);  // relative: the common error cancels
}

TEST(Evaluate, PointsThatHeldTheRunAreKeptFromThoseThatDidNot) {
  Scene scene;
  scene.Answer(0, {0.1, 0, 0});
  scene.Answer(1, {0.1, 0, 0});
  scene.run.evidence = {"control:" + std::to_string(scene.stations[0].tag_id)};
  ReferenceMap control{.name = "control", .tags = scene.world_tags};
  for (size_t i = 0; i < 2; ++i) {
    const int id = scene.stations[i].tag_id;
    control.own_evidence[id] = (i == 0 ? "control:" : "check:") + std::to_string(id);
    control.evidence.push_back(control.own_evidence[id]);
  }
  const Evaluation e = scene.Evaluate({control});
  int seen = 0;
  for (const ErrorRow& row : e.rows) {
    if (row.kind != "absolute" || !row.error_3d_m) continue;
    EXPECT_EQ(row.shares_evidence, row.station == scene.stations[0].name) << row.station;
    ++seen;
  }
  EXPECT_EQ(seen, 2);
}

TEST(Evaluate, AMapTheRunWentIntoIsKeptApart) {
  Scene scene;
  scene.Answer(0, {0.1, 0, 0});
  EvaluatedRun other = scene.run;
  other.run = "run2";
  const Evaluation e = Evaluate({.runs = {scene.run, other},
                                 .stations = scene.stations,
                                 .references = {{.name = "survey", .tags = scene.world_tags, .runs = {"run1"}}}});
  int independent = 0, shared = 0;
  for (const GroupSummary& g : e.groups) {
    if (g.group.kind != "absolute") continue;
    EXPECT_EQ(g.runs, 1);
    (g.group.shares_evidence ? shared : independent) += 1;
  }
  EXPECT_EQ(independent, 1);
  EXPECT_EQ(shared, 1);

  // Run1 was held by a map of run9: against that map its errors are agreement.
  scene.run.evidence = {"tags:run9"};
  const Evaluation held = scene.Evaluate({{.name = "survey", .tags = scene.world_tags, .runs = {"run9"}}});
  EXPECT_TRUE(held.groups[1].group.shares_evidence);

  scene.run.evidence = {"geotag:S1"};
  const Evaluation by_geotag = scene.Evaluate(
      {{.name = "survey", .tags = scene.world_tags, .runs = {"run9"}, .evidence = {"control:4", "geotag:S1"}}});
  ASSERT_EQ(by_geotag.groups[1].group.reference, "survey");
  EXPECT_TRUE(by_geotag.groups[1].group.shares_evidence);
}

TEST(Evaluate, ToleratesNanCovariancesDuplicateStationsAndOneStation) {
  Scene scene;
  scene.Answer(0, {0.1, 0, 0});
  scene.stations[1] = scene.stations[0];
  scene.run.result.panoramas[0].sigma_m = Eigen::Vector3d::Constant(std::nan(""));
  scene.world_tags[0].sigma_m = Eigen::Vector3d::Constant(0.01);
  const Evaluation e = scene.Evaluate({{.name = "survey", .tags = scene.world_tags}});
  ASSERT_EQ(e.warnings.size(), 2u);
  EXPECT_THAT(e.warnings[0], HasSubstr("S1 stands twice"));
  EXPECT_THAT(e.warnings[1], HasSubstr("reference survey: no covariance of tag 2"));
  ASSERT_EQ(e.rows[1].kind, "absolute");
  EXPECT_NEAR(*e.rows[1].error_3d_m, 0.1, 1e-9);
  EXPECT_FALSE(e.rows[1].nees);
}

TEST(Evaluate, RefusesNothingToEvaluateAndWrongOptions) {
  EXPECT_THROW(Evaluate({}), InputError);
  Scene scene;
  EXPECT_THROW(Evaluate({.runs = {scene.run}}, {.confidence = 2}), OptionError);
}

// The statement of the sigma: over many draws the mean normalised error squared is the degrees of freedom.
TEST(Evaluate, NeesIsChiSquareWhenTheNoiseIsAsStated) {
  Random random(11);
  double sum = 0;
  constexpr int kDraws = 2000;
  for (int i = 0; i < kDraws; ++i) {
    Scene scene;
    const auto noise = [&](double s) {
      return Eigen::Vector3d(s * random.Normal(), s * random.Normal(), s * random.Normal());
    };
    scene.Answer(1, noise(0.05));
    scene.run.result.panoramas[0].sigma_m = Eigen::Vector3d::Constant(0.05);
    // The tag's heading is uncertain too: the offset of S2 swings with it.
    TagResult& tag = scene.world_tags[1];
    tag.covariance = Matrix6d::Zero();
    tag.covariance->diagonal() << 0.04, 0.04, 0.04, 0.0004, 0.0004, 0.0004;
    Vector6d d;
    d << noise(0.2), noise(0.02);
    d.head<2>().setZero();
    tag.map_from_tag = tag.map_from_tag->Plus(d);
    tag.map_from_tag->translation += noise(scene.stations[1].sigma_m);  // the tape
    const Evaluation e = scene.Evaluate({{.name = "survey", .tags = scene.world_tags}});
    ASSERT_EQ(e.rows[3].kind, "absolute");
    ASSERT_TRUE(e.rows[3].nees);
    sum += *e.rows[3].nees;
  }
  // Sum of 2000 chi-square(3): mean 3, sigma of the mean sqrt(6 / 2000) = 0.055.
  EXPECT_NEAR(sum / kDraws, 3.0, 4 * 0.055);
}

}  // namespace
}  // namespace trigpoint

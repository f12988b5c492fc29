// Several runs past the same panoramas and tags, as one solution: better than each alone, and as good as it says.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <map>
#include <set>

#include "calib/base/error.h"
#include "calib/estimation/loss.h"
#include "calib/estimation/random.h"
#include "datasets/solution/solution_covariance.h"
#include "localize/references/view_turns.h"
#include "localize/site/adjust_site.h"
#include "tests/localize/world_tags.h"
#include "tests/synthetic/synthetic_site.h"

namespace trigpoint {
namespace {

using test::CamFromBody;
using test::FacingTheRun;
using test::Normal3;
using test::OdometryFactor;
using test::SightedTag;

constexpr int kPoses = 24, kRuns = 3, kSpots = 260, kPanoramas = 4;
constexpr double kPixel_px = 0.7, kViewPixel_px = 1.0, kTagPixel_px = 0.3;
constexpr double kStepSigma_m = 0.02, kTurnSigma_rad = 0.002, kScaleSigma = 0.01;
constexpr double kGeotag_m = 0.3, kHeading_rad = 0.02, kTilt_rad = 0.005;

// Body `i` of run `run`: side by side on a bend.
Rigid3d Truth(int run, int i) {
  const double a = 0.02 * i, radius = 50 + 0.8 * run;
  return {Eigen::Quaterniond(Eigen::AngleAxisd(a, Eigen::Vector3d::UnitZ())),
          Eigen::Vector3d(radius * std::sin(a), 50 - radius * std::cos(a), 0.2 * std::sin(0.3 * i))};
}

struct World {
  std::vector<Eigen::Vector3d> spots;
  std::vector<ReferenceViews> panoramas;  // with geotags
  std::vector<Rigid3d> world_from_pano;
  // Of each panorama, each view: the pixel of each spot that it shows.
  std::vector<std::vector<std::vector<std::pair<int, Eigen::Vector2d>>>> seen;
};

Camera TheCamera() { return Camera::FromFieldOfView(900, 700, 1.5); }

void AddPanorama(int k, const LocalFrame& frame, Random* random, World* w) {
  Eigen::Matrix3d upright;  // camera axes, looking north
  upright << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  const Rigid3d beside(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 2.5, 0.8));
  const Rigid3d pose((Truth(0, 3 + 6 * k).rotation * Eigen::Quaterniond(upright)).normalized(),
                     Truth(0, 3 + 6 * k) * beside.translation);
  ReferenceViews views;
  views.name = "p" + std::to_string(k);
  views.rig = EvenViewRig(views.name, 8, 800, 0.5 * EIGEN_PI);
  GeoTag& tag = views.geotag;
  tag.has_position = tag.has_height = tag.has_heading = tag.has_tilt = true;
  tag.position = frame.GeodeticFromEnu(pose.translation + Normal3(random, kGeotag_m));
  tag.sigma_h_m = tag.sigma_v_m = kGeotag_m;
  tag.attitude = AttitudeOf(pose.rotation);
  tag.attitude.heading_rad += kHeading_rad * random->Normal();
  tag.attitude.pitch_rad += kTilt_rad * random->Normal();
  tag.attitude.roll_rad += kTilt_rad * random->Normal();
  tag.sigma_heading_rad = kHeading_rad, tag.sigma_tilt_rad = kTilt_rad;
  auto& seen = w->seen.emplace_back(views.rig.views.size());
  for (size_t v = 0; v < views.rig.views.size(); ++v) {
    const View& view = views.rig.views[v];
    for (int s = 0; s < kSpots; ++s) {
      const Eigen::Vector3d in_view = (pose * view.rig_from_view).Inverse() * w->spots[static_cast<size_t>(s)];
      if (in_view.z() < 1 || in_view.norm() > 14) continue;
      const auto pixel = view.camera.Project(in_view);
      if (!pixel || !view.camera.Contains(*pixel)) continue;
      seen[v].emplace_back(s, *pixel + kViewPixel_px * Eigen::Vector2d(random->Normal(), random->Normal()));
    }
  }
  w->panoramas.push_back(views);
  w->world_from_pano.push_back(pose);
}

LocalFrame Frame() { return LocalFrame({48, 11, 500}); }

World MakeWorld(Random* random) {
  World w;
  for (int s = 0; s < kSpots; ++s) {
    const double a = random->Uniform(-0.1, 0.02 * kPoses + 0.1), depth = random->Uniform(5, 11);
    w.spots.emplace_back((50 - depth) * std::sin(a), 50 - (50 - depth) * std::cos(a), random->Uniform(-1.5, 3));
  }
  for (int k = 0; k < kPanoramas; ++k) AddPanorama(k, Frame(), random, &w);
  return w;
}

// Odometry of a run, whose poses are where it puts them.
void AddOdometry(int run, Random* random, SiteRun* out) {
  BundleProblem& p = out->solution.problem;
  const double scale = 1 + kScaleSigma * random->Normal();
  Rigid3d odom_from_body;
  for (int i = 0; i < kPoses; ++i) {
    const int64_t stamp = int64_t{i} * 1'000'000'000;
    out->input.images.push_back({stamp, std::to_string(i), 0, i});
    out->solution.images.push_back({stamp, std::to_string(i), 0, i});
    out->input.pose_stamps.push_back(stamp);
    if (i > 0) {
      Rigid3d step = Truth(run, i - 1).Inverse() * Truth(run, i);
      step.rotation = ExpSO3(Normal3(random, kTurnSigma_rad)) * step.rotation;
      step.translation = step.translation / scale + Normal3(random, kStepSigma_m);
      odom_from_body = odom_from_body * step;
      p.factors.push_back(OdometryFactor(i, step, kTurnSigma_rad, kStepSigma_m));
    }
    p.poses.push_back(odom_from_body.Inverse());
    p.pose_constant.push_back(i == 0);
    out->input.odom_from_body.push_back(odom_from_body);
  }
  out->solution.pose_stamps = out->input.pose_stamps;
}

BearingObservation Seen(const Camera& camera, const Eigen::Vector2d& pixel, double sigma, int point, int pose,
                        int view) {
  BearingObservation o;
  o.point = point, o.pose = pose, o.view = view;
  o.ray = camera.Unproject(pixel)->cast<float>();
  o.w = camera.BearingSqrtInfo(pixel, sigma).cast<float>();
  return o;
}

// The run's images, and the panoramas as they see what these see; features are spots.
void AddObservations(int run, const World& w, Random* random, SiteRun* out) {
  Solution& s = out->solution;
  BundleProblem& p = s.problem;
  const Rigid3d odom_from_world = Truth(run, 0).Inverse();
  for (size_t k = 0; k < w.panoramas.size(); ++k) {
    out->input.references.push_back(w.panoramas[k]);
    SolutionReference& r = s.references.emplace_back();
    r.name = r.row = w.panoramas[k].name;
    r.status = "localized";
    r.pose = static_cast<int>(p.poses.size());
    p.poses.push_back((odom_from_world * w.world_from_pano[k]).Inverse());
    p.pose_constant.push_back(false);
    for (const View& v : w.panoramas[k].rig.views) p.views.push_back(v.rig_from_view.Inverse());
  }
  const Camera camera = TheCamera();
  for (int spot = 0; spot < kSpots; ++spot) {
    const int point = static_cast<int>(p.points.size());
    std::vector<std::pair<BearingObservation, std::pair<int, int>>> rows;  // image, feature
    for (int i = 0; i < kPoses; ++i) {
      const auto pixel = camera.Project(CamFromBody() * (Truth(run, i).Inverse() * w.spots[static_cast<size_t>(spot)]));
      if (!pixel || !camera.Contains(*pixel)) continue;
      const Eigen::Vector2d noisy = *pixel + kPixel_px * Eigen::Vector2d(random->Normal(), random->Normal());
      rows.push_back({Seen(camera, noisy, kPixel_px, point, i, 0), {i, spot}});
    }
    if (rows.size() < 3) continue;
    for (size_t k = 0; k < w.panoramas.size(); ++k) {
      for (size_t v = 0; v < w.seen[k].size(); ++v) {
        for (const auto& [id, pixel] : w.seen[k][v]) {
          if (id != spot) continue;
          const Camera& view = w.panoramas[k].rig.views[v].camera;
          rows.push_back(
              {Seen(view, pixel, kViewPixel_px, point, s.references[k].pose, static_cast<int>(1 + 8 * k + v)),
               {-1 - static_cast<int>(k), spot}});
        }
      }
    }
    for (const auto& [o, of] : rows) {
      p.observations.push_back(o);
      s.image_of.push_back(of.first);
      s.feature_of.push_back(of.second);
    }
    p.points.push_back(odom_from_world * w.spots[static_cast<size_t>(spot)] + Normal3(random, 0.05));
    s.depth_m.push_back(5);
    s.point_valid.push_back(true);
  }
}

// As a run leaves `localize`: solved in its own frame, and placed in the world as well as its geotags do.
SiteRun MakeRun(int run, const World& w, Random* random) {
  SiteRun out;
  out.name = out.solution.run = "run" + std::to_string(run);
  BodyCamera camera;
  camera.name = "cam0";
  camera.camera = TheCamera();
  camera.cam_from_body = CamFromBody();
  out.input.cameras = out.solution.cameras = {camera};
  out.input.has_frame = true;
  out.input.frame = Frame();
  out.input.scale_sigma = kScaleSigma;
  out.solution.problem.views = {CamFromBody()};
  out.solution.problem.loss = MakeLoss("dcs", 5.99);
  out.solution.sigma_px = kPixel_px;
  AddOdometry(run, random, &out);
  AddObservations(run, w, random, &out);
  ProgressSink progress;
  SolveBundle(out.solution.problem, BundleOptions(), progress, {});
  SolutionGeoreference& geo = out.solution.georeference.emplace();
  geo.source = "geotags";
  geo.world_from_odom = {1, ExpSO3(Normal3(random, 0.01)) * Truth(run, 0).rotation,
                         Truth(run, 0).translation + Normal3(random, 0.2)};
  geo.covariance.diagonal() << 1e-4, 1e-4, 1e-4, 0.04 + 0.01 * run, 0.04, 0.04, 1e-4;
  return out;
}

SiteAdjustment Adjust(std::vector<SiteRun> runs, const WorldEvidence& evidence = {}) {
  SiteOptions options;
  options.links.images = false;  // there are no features to match
  ProgressSink progress;
  return AdjustSite(std::move(runs), evidence, options, 1, 1, progress, {});
}

// Errors of the positions of bodies of a run in a solution, m: root mean square.
double BodyError(const Solution& s, size_t run, int truth) {
  double square = 0;
  for (int i = 0; i < kPoses; ++i) {
    const int pose = s.runs[run].first_pose + i;
    square += (OdomFromRig(s, pose).translation - Truth(truth, i).translation).squaredNorm() / kPoses;
  }
  return std::sqrt(square);
}

// Of a body's position against what the solution states: chi-square, 3 degrees of freedom.
double BodyChi2(const Solution& s, size_t run, int i) {
  const int pose = s.runs[run].first_pose + i;
  const Eigen::Vector3d e = OdomFromRig(s, pose).translation - Truth(static_cast<int>(run), i).translation;
  const Eigen::Matrix3d c = WorldCovariance(s, pose).bottomRightCorner<3, 3>();
  return e.dot(c.ldlt().solve(e));
}
constexpr double kMostChi2 = 16.3;  // 99.9 %

double PanoramaError(const Solution& s, const World& w) {
  double square = 0;
  for (size_t k = 0; k < s.references.size(); ++k) {
    square += (OdomFromRig(s, s.references[k].pose).translation - w.world_from_pano[k].translation).squaredNorm();
  }
  return std::sqrt(square / static_cast<double>(s.references.size()));
}

// Of two bodies of different runs and a panorama, jointly: 9 degrees of freedom; and of what lies between the
// bodies, 3.
std::pair<double, double> Nees(const Solution& s, const World& w) {
  const std::vector<int> poses = {s.runs[0].first_pose + kPoses / 2, s.runs[2].first_pose + kPoses - 2,
                                  s.references[1].pose};
  Eigen::VectorXd e(9);
  const Eigen::Vector3d truth[] = {Truth(0, kPoses / 2).translation, Truth(2, kPoses - 2).translation,
                                   w.world_from_pano[1].translation};
  std::vector<SolutionFunction> functions;
  Eigen::MatrixXd position = Eigen::MatrixXd::Zero(3, 6);
  position.rightCols<3>().setIdentity();
  for (int k = 0; k < 3; ++k) {
    const int pose = poses[static_cast<size_t>(k)];
    e.segment<3>(3 * k) = OdomFromRig(s, pose).translation - truth[k];
    functions.push_back(position * WorldPose(s, pose));
  }
  const Eigen::MatrixXd c = SolutionCovariance(s, false, 1, {}).Of(functions);
  EXPECT_TRUE((c.block<3, 3>(3, 3).isApprox(WorldCovariance(s, poses[1]).bottomRightCorner<3, 3>(), 1e-6)));
  const Eigen::Vector3d between = e.segment<3>(0) - e.segment<3>(3);
  const Eigen::Matrix3d of_between =
      c.block<3, 3>(0, 0) + c.block<3, 3>(3, 3) - c.block<3, 3>(0, 3) - c.block<3, 3>(3, 0);
  return {e.dot(c.ldlt().solve(e)), between.dot(of_between.ldlt().solve(between))};
}

TEST(Site, IsAsGoodAsItSaysAndNoWorseThanARunAlone) {
  constexpr int kDraws = 16;
  double nees = 0, between = 0, joint = 0, alone = 0, panoramas = 0, panoramas_alone = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    Random random(100 + static_cast<uint64_t>(draw));
    const World w = MakeWorld(&random);
    std::vector<SiteRun> runs;
    for (int run = 0; run < kRuns; ++run) runs.push_back(MakeRun(run, w, &random));
    for (int run = 0; run < kRuns; ++run) {
      const Solution s = Adjust({runs[static_cast<size_t>(run)]}).solution;
      alone += std::pow(BodyError(s, 0, run), 2) / (kRuns * kDraws);
      panoramas_alone += std::pow(PanoramaError(s, w), 2) / (kRuns * kDraws);
    }
    const SiteAdjustment site = Adjust(runs);
    EXPECT_TRUE(site.warnings.empty()) << site.warnings.front();
    ASSERT_EQ(site.solution.runs.size(), 3u);
    ASSERT_EQ(site.solution.references.size(), static_cast<size_t>(kPanoramas));  // each once
    for (const RunInSite& run : site.runs) {
      EXPECT_EQ(run.shared_panoramas, kPanoramas);
      EXPECT_GT(run.shared_points, kSpots / 4);
    }
    const auto [all, apart] = Nees(site.solution, w);
    nees += all / kDraws, between += apart / kDraws;
    for (int run = 0; run < kRuns; ++run) {
      joint += std::pow(BodyError(site.solution, static_cast<size_t>(run), run), 2) / (kRuns * kDraws);
    }
    panoramas += std::pow(PanoramaError(site.solution, w), 2) / kDraws;
  }
  RecordProperty("nees_of_9", std::to_string(nees));
  RecordProperty("nees_between_of_3", std::to_string(between));
  std::printf("NEES %.2f of 9, between runs %.2f of 3; RMSE m bodies %.4f (alone %.4f), panoramas %.4f (alone %.4f)\n",
              nees, between, std::sqrt(joint), std::sqrt(alone), std::sqrt(panoramas), std::sqrt(panoramas_alone));
  EXPECT_NEAR(nees, 9, 3 * std::sqrt(18.0 / kDraws));
  EXPECT_NEAR(between, 3, 3 * std::sqrt(6.0 / kDraws));
  EXPECT_LT(joint, alone);
  EXPECT_LT(panoramas, 1.02 * panoramas_alone);
}

// The frame of its odometry begins anywhere.
void LoseGeoreference(Solution* solution) {
  solution->georeference.reset();
  const Rigid3d far(Eigen::Quaterniond::Identity(), Eigen::Vector3d(1000, 0, 0));
  for (Rigid3d& pose : solution->problem.poses) pose = pose * far.Inverse();
  for (Eigen::Vector3d& point : solution->problem.points) point = far * point;
}

TEST(Site, RunWithoutGeoreferenceIsPlacedByWhatItShares) {
  Random random(5);
  const World w = MakeWorld(&random);
  std::vector<SiteRun> runs = {MakeRun(0, w, &random), MakeRun(1, w, &random)};
  LoseGeoreference(&runs[1].solution);
  const SiteAdjustment site = Adjust(runs);
  ASSERT_EQ(site.runs.size(), 2u);
  EXPECT_LT(site.runs[1].largest_move_m, 5) << "from where its panoramas put it";
  EXPECT_LT(BodyChi2(site.solution, 1, kPoses / 2), kMostChi2);
  // It lies as well beside the other one as that run's own noise allows.
  const Eigen::Vector3d apart = OdomFromRig(site.solution, site.solution.runs[1].first_pose + 9).translation -
                                OdomFromRig(site.solution, site.solution.runs[0].first_pose + 9).translation;
  EXPECT_LT((apart - (Truth(1, 9).translation - Truth(0, 9).translation)).norm(), 0.05);
}

TEST(Site, PanoramaThatOneRunPutsElsewhereIsLeftOutOfIt) {
  Random random(6);
  const World w = MakeWorld(&random);
  std::vector<SiteRun> runs = {MakeRun(0, w, &random), MakeRun(1, w, &random)};
  Solution& s = runs[1].solution;
  Rigid3d& pose = s.problem.poses[static_cast<size_t>(s.references[2].pose)];
  pose.translation += pose.rotation * Eigen::Vector3d(3, 0, 0);  // the next window of a facade
  const SiteAdjustment site = Adjust(runs);
  ASSERT_EQ(site.warnings.size(), 1u);
  EXPECT_NE(site.warnings[0].find("p2"), std::string::npos) << site.warnings[0];
  EXPECT_EQ(site.runs[1].shared_panoramas, kPanoramas - 1);
  EXPECT_LT(BodyChi2(site.solution, 1, kPoses / 2), kMostChi2);
}

// `localize` takes the pose of a panorama back that its geotag contradicts; its views and observations stay.
TEST(Site, ViewsOfPanoramasStayTheirOwnBesideARejectedOne) {
  Random random(9);
  const World w = MakeWorld(&random);
  std::vector<SiteRun> runs = {MakeRun(0, w, &random)};
  SolutionReference& rejected = runs[0].solution.references[1];
  rejected.status = "rejected", rejected.pose = -1;
  std::vector<std::string> warnings;
  const std::vector<PlacedRun> placed = PlaceRuns(runs, {}, &warnings);
  const JoinedRuns joined = JoinRuns(&runs, placed, 0.1);
  const BundleProblem& p = joined.reconstruction.problem;
  int seen = 0;
  for (size_t k = 0; k < p.observations.size(); ++k) {
    const int image = joined.reconstruction.image_of[k];
    if (image >= 0) continue;
    const auto panorama = static_cast<size_t>(-1 - image);
    ASSERT_NE(panorama, 1u);
    const std::vector<View>& views = w.panoramas[panorama].rig.views;
    const auto view = static_cast<size_t>(joined.view_of[k]), at = static_cast<size_t>(p.observations[k].view);
    ASSERT_LT(view, views.size());
    ASSERT_LT(at, p.views.size());
    EXPECT_LT(AngleBetween(p.views[at].rotation, views[view].rig_from_view.rotation.conjugate()), 1e-6);
    ++seen;
  }
  EXPECT_GT(seen, 0);
}

// Views that are turned against their panorama have poses of their own: all runs that see one show the same turn.
void ExpectTurnedViewsShared(const std::set<int>& turned) {
  Random random(12);
  const World w = MakeWorld(&random);
  std::vector<SiteRun> runs;
  for (int run = 0; run < 2; ++run) {
    BundleProblem& p = runs.emplace_back(MakeRun(run, w, &random)).solution.problem;
    std::vector<RigViews> rigs;
    for (int k = 0; k < kPanoramas; ++k) rigs.push_back({kPoses + k, 1 + 8 * k, 8});
    if (turned.count(run) > 0) {
      EXPECT_GT(FreeViews(rigs, 0.002, &p).size(), 0U);
    }
  }
  std::vector<std::string> warnings;
  const std::vector<PlacedRun> placed = PlaceRuns(runs, {}, &warnings);
  const JoinedRuns joined = JoinRuns(&runs, placed, 0.1);
  const BundleProblem& p = joined.reconstruction.problem;
  std::map<int, int> rig_of;
  for (const PoseFactor& f : p.factors) {
    if (IsTie(f)) rig_of[f.a] = f.b;
  }
  std::map<std::pair<int, int>, std::set<int>> poses;  // of a panorama and its view
  std::map<std::pair<int, int>, std::set<int>> of_runs;
  for (size_t k = 0; k < p.observations.size(); ++k) {
    const int image = joined.reconstruction.image_of[k], pose = p.observations[k].pose;
    if (image >= 0) {
      EXPECT_EQ(pose, joined.input.images[static_cast<size_t>(image)].pose);
      continue;
    }
    ASSERT_EQ(rig_of.count(pose), 1U);
    EXPECT_EQ(rig_of.at(pose), joined.references[static_cast<size_t>(-1 - image)].pose);
    poses[{image, joined.view_of[k]}].insert(pose);
    of_runs[{image, joined.view_of[k]}].insert(joined.run_of_point[static_cast<size_t>(p.observations[k].point)]);
  }
  EXPECT_EQ(rig_of.size(), poses.size());
  EXPECT_EQ(p.poses.size(), 2U * kPoses + kPanoramas + poses.size());
  EXPECT_EQ(p.pose_constant.size(), p.poses.size());
  int shared = 0;
  for (const auto& [view, own] : poses) {
    EXPECT_EQ(own.size(), 1U);
    shared += of_runs.at(view).size() == 2 ? 1 : 0;
  }
  EXPECT_GT(shared, 0);
}

TEST(Site, TurnedViewsOfAPanoramaAreThoseOfAllRuns) {
  for (const std::set<int>& turned : {std::set<int>{0, 1}, {0}, {1}}) ExpectTurnedViewsShared(turned);
}

TEST(Site, NotesWhatGeotagsState) {
  Random random(10);
  const World w = MakeWorld(&random);
  std::vector<SiteRun> runs = {MakeRun(0, w, &random), MakeRun(1, w, &random)};
  for (SiteRun& run : runs) {
    for (const size_t k : {0U, 1U}) run.input.references[k].set = 5;  // photos of one hand-held set share a geotag
    run.input.references[2].geotag.has_height = false;
  }
  const Solution s = Adjust(runs).solution;
  EXPECT_NE(s.references[0].geotag, "");
  EXPECT_EQ(s.references[1].geotag, "") << "it is one statement";
  EXPECT_LT(s.references[2].geotag_difference.head<2>().norm(), 2);
  EXPECT_TRUE(std::isnan(s.references[2].geotag_difference.z()));
  EXPECT_LT(s.references[3].geotag_difference.norm(), 3);
}

TEST(Site, WithoutAnyDatumIsRefused) {
  Random random(7);
  const World w = MakeWorld(&random);
  SiteRun run = MakeRun(0, w, &random);
  run.solution.georeference.reset();
  EXPECT_THROW(Adjust({run}), InputError);
}

// Tag `id` left of body `at` of every run, as the images around it show it.
WorldTag SeenTag(int id, int run, const Eigen::Vector3d& moved, Random* random) {
  Rigid3d world_from_tag = Truth(0, id) * Rigid3d(FacingTheRun(), Eigen::Vector3d(0, 5, 0.5));
  world_from_tag.translation += moved;
  const auto truth = [&](int i) { return Truth(run, i); };
  return SightedTag(id, world_from_tag, id, kPoses, kTagPixel_px, truth, random);
}

// Control on tags holds all runs; a tag that was moved between two runs does not.
TEST(Site, ControlOnTagsAndAMovedTag) {
  Random random(8);
  const World w = MakeWorld(&random);
  std::vector<SiteRun> runs;
  for (int run = 0; run < kRuns; ++run) {
    runs.push_back(MakeRun(run, w, &random));
    for (int id : {2, 8, 14, 20}) {
      const bool moved = run == 2 && id == 8;
      runs.back().tags.push_back(
          SeenTag(id, run, moved ? Eigen::Vector3d(0.2, 0, 0) : Eigen::Vector3d::Zero(), &random));
    }
  }
  WorldEvidence evidence;
  for (int id : {2, 14, 20}) {
    WorldTag tag;
    tag.id = id;
    TagControl control;
    control.position = (Truth(0, id) * Eigen::Vector3d(0, 5, 0.5)) + Normal3(&random, 0.01);
    tag.control.push_back(control);
    evidence.tags.push_back(tag);
  }
  const SiteAdjustment site = Adjust(runs, evidence);
  ASSERT_EQ(site.warnings.size(), 1u);
  EXPECT_NE(site.warnings[0].find("tag 8 stands elsewhere in run run2"), std::string::npos) << site.warnings[0];
  EXPECT_EQ(site.fit.control_tags, (std::vector<int>{2, 14, 20}));
  for (int run = 0; run < kRuns; ++run) EXPECT_LT(BodyError(site.solution, static_cast<size_t>(run), run), 0.05);
  const Eigen::Vector3d tag8 =
      OdomFromRig(site.solution, site.fit.first_tag + 3).translation - Truth(0, 8) * Eigen::Vector3d(0, 5, 0.5);
  EXPECT_EQ(site.tags[3], 8);
  EXPECT_LT(tag8.norm(), 0.05);
}

// A run that localized no panorama; it shows these tags.
SiteRun RunWithTagsAlone(int run, World w, const std::vector<int>& tags, Random* random) {
  w.panoramas.clear(), w.world_from_pano.clear(), w.seen.clear();
  SiteRun out = MakeRun(run, w, random);
  for (int id : tags) out.tags.push_back(SeenTag(id, run, Eigen::Vector3d::Zero(), random));
  return out;
}

// No other run shows its tags: the map places the run, and holds it.
TEST(Site, RunIsPlacedByTagsOfTheMapThatItAloneShows) {
  Random random(11);
  const World w = MakeWorld(&random);
  std::vector<SiteRun> runs = {RunWithTagsAlone(1, w, {6, 12, 18}, &random), MakeRun(0, w, &random)};
  LoseGeoreference(&runs[0].solution);
  WorldEvidence evidence;
  for (const WorldTag& seen : runs[0].tags) {
    WorldTag& tag = evidence.tags.emplace_back();
    tag.id = seen.id;
    tag.world_from_tag = Truth(1, seen.sightings.front().image) * seen.body_from_tag;
  }
  evidence.map_covariance = 1e-4 * Eigen::MatrixXd::Identity(18, 18);
  const SiteAdjustment site = Adjust(runs, evidence);
  ASSERT_EQ(site.runs.size(), 2u);
  EXPECT_EQ(site.fit.map_tags, (std::vector<int>{6, 12, 18}));
  EXPECT_LT(BodyError(site.solution, 0, 1), 0.1);
  // The other run lies where its geotags put it.
  EXPECT_NEAR(BodyError(site.solution, 1, 0), BodyError(Adjust({runs[1]}).solution, 0, 0), 0.02);
}

// One surveyed point does not show how a run lies. Its tag is in the evidence and no run is left that shows it.
TEST(Site, TagsOfARunThatIsLeftOutTakeNoPart) {
  Random random(12);
  const World w = MakeWorld(&random);
  std::vector<SiteRun> runs = {MakeRun(0, w, &random), RunWithTagsAlone(1, w, {8}, &random)};
  runs[1].solution.georeference.reset();
  WorldEvidence evidence;
  evidence.tags.emplace_back().id = 8;
  evidence.tags.back().control.emplace_back().position = Truth(0, 8) * Eigen::Vector3d(0, 5, 0.5);
  const SiteAdjustment site = Adjust(runs, evidence);
  ASSERT_EQ(site.runs.size(), 1u);
  EXPECT_EQ(site.runs[0].name, "run0");
  EXPECT_TRUE(site.tags.empty());
  ASSERT_FALSE(site.warnings.empty());
  EXPECT_NE(site.warnings.back().find("run run1 is left out: it is not georeferenced"), std::string::npos)
      << site.warnings.back();
}

// As after `localize --use tags` and `adjust` without: its georeference rests on what the adjustment does not use.
TEST(Site, RunThatNothingHoldsIsLeftOut) {
  Random random(13);
  const World w = MakeWorld(&random);
  const std::vector<SiteRun> runs = {RunWithTagsAlone(1, w, {8}, &random), MakeRun(0, w, &random)};
  const SiteAdjustment site = Adjust(runs);
  ASSERT_EQ(site.runs.size(), 1u);
  EXPECT_EQ(site.runs[0].name, "run0");
  ASSERT_EQ(site.warnings.size(), 1u);
  EXPECT_NE(site.warnings[0].find("run run1 is left out: no geotag, GPS fix or surveyed tag"), std::string::npos)
      << site.warnings[0];
  const SiteAdjustment alone = Adjust({runs[1]});
  EXPECT_EQ(BodyError(site.solution, 0, 0), BodyError(alone.solution, 0, 0));
  // A tag in common with a run that is held ties it.
  std::vector<SiteRun> tied = runs;
  tied[1].tags.push_back(SeenTag(8, 0, Eigen::Vector3d::Zero(), &random));
  EXPECT_EQ(Adjust(tied).runs.size(), 2u);
}

}  // namespace
}  // namespace trigpoint

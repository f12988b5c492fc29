// A tag map on a synthetic site: how long, how much memory, and whether the stated uncertainty is real.
//   tag_map [--tags 1000] [--images 5000] [--cameras 1] [--redraws 1] [--seed 1] [--threads 0]
// A robot drives up and down the aisles of a hall with tags on both sides; odometry drifts, four tags are surveyed.
// Prints seconds, peak memory, RMSE of the free tags, and over the redraws the joint NEES of all free tags (their whole
// covariance, cross-covariances included) with its 95 % band.
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <Eigen/Cholesky>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "calib/estimation/random.h"
#include "survey/tags/tag_map.h"

namespace trigpoint {
namespace {

struct Hall {
  std::vector<Rigid3d> tags;
  SurveyInput input;
};

Eigen::Vector3d Noise(Random* random, double sigma) {
  return sigma * Eigen::Vector3d(random->Normal(), random->Normal(), random->Normal());
}

// Aisles along x, 4 m apart, tags every 1.5 m on both sides looking into the aisle.
Hall MakeHall(int tag_count, int images, int cameras, uint64_t seed) {
  Hall hall;
  Random random(seed);
  const int aisles = std::max(1, static_cast<int>(std::lround(std::sqrt(tag_count / 40.0))));
  const int per_side = std::max(2, tag_count / (2 * aisles));
  const double length = 1.5 * (per_side - 1);
  for (int a = 0; a < aisles; ++a) {
    for (int i = 0; i < per_side; ++i) {
      for (int side : {-1, 1}) {
        Eigen::Matrix3d r;  // y down, z into the tag: away from the aisle
        r.col(2) << 0, side, 0;
        r.col(1) << 0, 0, -1;
        r.col(0) = r.col(1).cross(r.col(2));
        hall.tags.emplace_back(Eigen::Quaterniond(r),
                               Eigen::Vector3d(1.5 * i, 4.0 * a + 1.7 * side, 1 + 0.4 * (i % 3)));
      }
    }
  }
  hall.input.sizes.size_m = 0.2;
  SurveyRun run;
  run.name = "run1";
  const double f = cameras == 1 ? 500 : 700;
  const Camera pinhole(CameraModel::kPinhole, 1280, 800, {f, f, 639.5, 399.5});
  for (int c = 0; c < cameras; ++c) {  // ahead; or ahead to the left, ahead to the right
    BodyCamera camera;
    camera.name = "cam" + std::to_string(c);
    camera.camera = pinhole;
    Eigen::Matrix3d forward;
    forward << 0, -1, 0, 0, 0, -1, 1, 0, 0;
    const double turn = cameras == 1 ? 0 : (c == 0 ? 1 : -1) * 0.8;
    camera.cam_from_body =
        Rigid3d(Eigen::Quaterniond(forward) * Eigen::Quaterniond(Eigen::AngleAxisd(-turn, Eigen::Vector3d::UnitZ())),
                {0, 0.8, 0});
    run.cameras.push_back(camera);
  }
  const double way = aisles * (length + 4.0);
  const int stops = images / cameras;
  Rigid3d odom, before;
  const double drift = 2e-4 * random.Normal(), scale = 1 + 0.01 * random.Normal();
  for (int i = 0; i < stops; ++i) {
    const double s = way * i / std::max(1, stops - 1);
    const int aisle = std::min(aisles - 1, static_cast<int>(s / (length + 4.0)));
    const double t = s - aisle * (length + 4.0);
    const bool back = aisle % 2 == 1;
    const double x = std::min(t, length), y = 4.0 * aisle + std::max(0.0, t - length);
    double heading = back ? M_PI : 0;
    if (t > length) heading = M_PI / 2;
    const Rigid3d body(ExpSO3({0, 0, heading}), {back ? length - x : x, y, 0});
    const int64_t stamp = i * 100'000'000LL;
    if (i > 0) {
      Rigid3d step = before.Inverse() * body;
      const double d = step.translation.norm(), root = std::sqrt(d + 1e-6);
      const Eigen::Vector3d turn = Noise(&random, 0.002 * root) + Eigen::Vector3d(0, 0, drift * d);
      step.translation = step.translation / scale + Noise(&random, 0.01 * root);
      step.rotation = step.rotation * ExpSO3(turn);
      odom = odom * step;
    }
    before = body;
    run.odometry.poses.push_back({stamp, odom});
    for (size_t c = 0; c < run.cameras.size(); ++c) {
      ImageDetections image{stamp, "", run.cameras[c].name, {}};
      const Rigid3d cam_from_world = run.cameras[c].cam_from_body * body.Inverse();
      for (size_t k = 0; k < hall.tags.size(); ++k) {
        if ((hall.tags[k].translation - body.translation).squaredNorm() > 49) continue;
        // Not through a shelf.
        if (std::abs(hall.tags[k].translation.y() - body.translation.y()) > 1.8 && t <= length) continue;
        const Rigid3d cam_from_tag = cam_from_world * hall.tags[k];
        const Eigen::Vector3d normal = cam_from_tag.rotation * Eigen::Vector3d::UnitZ();
        if (normal.dot(cam_from_tag.translation.normalized()) < 0.35 || cam_from_tag.translation.z() < 0.3) continue;
        TagDetection d;
        d.id = static_cast<int>(k);
        bool seen = true;
        for (int corner = 0; corner < 4 && seen; ++corner) {
          const auto p = pinhole.Project(cam_from_tag * TagCorner(0.2, corner));
          seen = p && pinhole.Contains(*p);
          if (seen)
            d.corners[static_cast<size_t>(corner)] = *p + 0.2 * Eigen::Vector2d(random.Normal(), random.Normal());
        }
        d.corner_sigma_px.fill(0.2);
        if (seen) image.detections.push_back(d);
      }
      run.images.push_back(std::move(image));
    }
  }
  hall.input.runs.push_back(std::move(run));
  const int n = static_cast<int>(hall.tags.size());
  for (int t : {0, per_side, n - 2, n - 1 - per_side}) {
    SurveyPoint p;
    p.name = "P" + std::to_string(t);
    p.tag_id = t;
    p.sigma_h_m = p.sigma_v_m = 0.005;
    p.world_m = hall.tags[static_cast<size_t>(t)].translation + Noise(&random, 0.005);
    hall.input.points.push_back(p);
  }
  return hall;
}

int Main(int argc, char** argv) {
  CLI::App app("a tag map on a synthetic site");
  int tags = 1000, images = 5000, cameras = 1, redraws = 1, threads = 0;
  uint64_t seed = 1;
  app.add_option("--tags", tags);
  app.add_option("--images", images);
  app.add_option("--cameras", cameras);
  app.add_option("--redraws", redraws);
  app.add_option("--threads", threads);
  app.add_option("--seed", seed);
  CLI11_PARSE(app, argc, argv);
  SurveyOptions options;
  options.extra_sigma_px = 0;
  options.cross_covariances = redraws > 1;
  double nees = 0, square = 0, seconds = 0;
  int64_t free_tags = 0, sights = 0;
  for (int r = 0; r < redraws; ++r) {
    const Hall hall = MakeHall(tags, images, cameras, seed + static_cast<uint64_t>(r));
    ProgressSink silent;
    const CancelToken cancel;
    const auto begin = std::chrono::steady_clock::now();
    const SurveyResult map = SurveyTags(hall.input, options, threads, silent, cancel);
    seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    sights = map.runs[0].sights;
    std::vector<const TagEstimate*> estimates;
    std::vector<Eigen::Vector3d> errors;
    for (const TagEstimate& t : map.tags) {
      if (!t.HasPose() || t.role == "control") continue;
      estimates.push_back(&t);
      errors.emplace_back(t.world_from_tag->translation - hall.tags[static_cast<size_t>(t.tag_id)].translation);
      square += errors.back().squaredNorm();
      ++free_tags;
    }
    if (redraws < 2) continue;
    const auto n = static_cast<Eigen::Index>(3 * errors.size());
    Eigen::MatrixXd covariance(n, n);
    Eigen::VectorXd e(n);
    for (size_t a = 0; a < errors.size(); ++a) {
      e.segment<3>(3 * static_cast<Eigen::Index>(a)) = errors[a];
      for (size_t b = a; b < errors.size(); ++b) {
        const Eigen::Matrix3d block =
            a == b
                ? Eigen::Matrix3d(estimates[a]->covariance.bottomRightCorner<3, 3>())
                : Eigen::Matrix3d(map.cross.at({estimates[a]->tag_id, estimates[b]->tag_id}).bottomRightCorner<3, 3>());
        covariance.block<3, 3>(3 * static_cast<Eigen::Index>(a), 3 * static_cast<Eigen::Index>(b)) = block;
        covariance.block<3, 3>(3 * static_cast<Eigen::Index>(b), 3 * static_cast<Eigen::Index>(a)) = block.transpose();
      }
    }
    nees += e.dot(covariance.ldlt().solve(e)) / static_cast<double>(n);
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::printf(
      "{\"tags\": %d, \"images\": %d, \"sights\": %lld, \"redraws\": %d, \"seconds_each\": %.1f, "
      "\"peak_memory_gib\": %.2f, \"rmse_m\": %.4f",
      tags, images, static_cast<long long>(sights), redraws, seconds / redraws,
      static_cast<double>(usage.ru_maxrss) / (1024.0 * 1024.0),
      std::sqrt(square / static_cast<double>(std::max<int64_t>(1, free_tags))));
  if (redraws > 1) {
    const double dof = 3.0 * static_cast<double>(free_tags);
    std::printf(", \"joint_nees_per_dof\": %.3f, \"band_95\": [%.3f, %.3f]", nees / redraws,
                1 - 1.96 * std::sqrt(2 / dof), 1 + 1.96 * std::sqrt(2 / dof));
  }
  std::printf("}\n");
  return 0;
}

}  // namespace
}  // namespace trigpoint

int main(int argc, char** argv) { return trigpoint::Main(argc, argv); }

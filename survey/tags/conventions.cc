#include "survey/tags/conventions.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "calib/geo/geodetic.h"
#include "calib/geometry/alignment.h"
#include "survey/tags/planar_pose.h"

namespace trigpoint {
namespace {

constexpr double kLeastStep_m = 0.02;  // shorter steps of odometry say nothing about its direction
constexpr int kLeastSteps = 20;
constexpr double kMostlyShare = 0.9;  // of detections that must agree before an order is called wrong
constexpr double kFoot = 0.3048;

// How well the body's direction of motion stays the same in the body's frame: 1 for wheels, 0 for nonsense.
// `order` permutes a quaternion's coefficients as read (x, y, z, w).
double MotionConsistency(const Trajectory& odometry, const std::array<int, 4>& order) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int n = 0;
  for (size_t i = 1; i < odometry.poses.size(); ++i) {
    const Rigid3d& a = odometry.poses[i - 1].target_from_body;
    const Eigen::Vector3d step = odometry.poses[i].target_from_body.translation - a.translation;
    if (step.norm() < kLeastStep_m) continue;
    const Eigen::Vector4d c = a.rotation.coeffs();
    const Eigen::Quaterniond q(c[order[3]], c[order[0]], c[order[1]], c[order[2]]);
    sum += q.conjugate() * step.normalized();
    ++n;
  }
  return n < kLeastSteps ? -1 : sum.norm() / n;
}

double FitRms(const std::vector<Eigen::Vector3d>& map, const std::vector<Eigen::Vector3d>& stated) {
  const Sim3d fit = AlignPoints(map, stated, AlignmentKind::kSE3);
  double square = 0;
  for (size_t i = 0; i < map.size(); ++i) square += (fit * map[i] - stated[i]).squaredNorm();
  return std::sqrt(square / static_cast<double>(map.size()));
}

void CheckCorners(const SurveyRun& run, std::vector<ConventionFinding>* findings) {
  int n = 0, clockwise = 0;
  for (const ImageDetections& image : run.images) {
    for (const TagDetection& d : image.detections) {
      double area = 0;
      for (size_t k = 0; k < 4; ++k) {
        const Eigen::Vector2d &a = d.corners[k], &b = d.corners[(k + 1) % 4];
        area += a.x() * b.y() - a.y() * b.x();
      }
      ++n;
      clockwise += area > 0 ? 1 : 0;  // y points down: bottom-left, bottom-right, top-right runs against the clock
    }
  }
  if (n > 0 && clockwise > kMostlyShare * n) {
    findings->push_back(
        {true, fmt::format("run {}: corners of {} of {} detections run clockwise in the picture; expected bottom-left, "
                           "bottom-right, top-right, top-left of the upright tag. Reorder the columns u0..v3, or, if "
                           "the pictures are mirrored, say mirrored: true in run.yaml",
                           run.name, clockwise, n)});
  }
}

void CheckOdometry(const SurveyRun& run, std::vector<ConventionFinding>* findings) {
  const double as_read = MotionConsistency(run.odometry, {0, 1, 2, 3});
  const double w_first = MotionConsistency(run.odometry, {1, 2, 3, 0});
  if (as_read >= 0 && as_read < 0.7 && w_first > 0.95) {
    findings->push_back(
        {true,
         fmt::format("run {}: odometry turns as if its quaternions were written w x y z (its body then moves one "
                     "way in {:.0f} % of the steps, as read in {:.0f} %); expected x y z w: reorder the columns of "
                     "odometry.tum",
                     run.name, 100 * w_first, 100 * as_read)});
  }
}

// Levelled odometry knows what is up; printed tags mostly stand upright.
void CheckUpright(const SurveyInput& input, const SurveyRun& run, std::vector<ConventionFinding>* findings) {
  if (!run.levelled) return;
  int wall = 0;
  std::array<int, 4> down{};  // where the tag's y axis points: down, right, up, left
  for (const ImageDetections& image : run.images) {
    const auto camera = std::find_if(run.cameras.begin(), run.cameras.end(),
                                     [&](const BodyCamera& c) { return c.name == image.camera; });
    const auto odom = run.odometry.At(image.stamp_ns, static_cast<int64_t>(run.max_gap_s * 1e9));
    if (camera == run.cameras.end() || !odom) continue;
    for (const TagDetection& d : image.detections) {
      if (!(input.sizes.SizeOf(d.id) > 0)) continue;
      std::vector<PlanarPose> poses;
      try {
        poses = EstimatePlanarPoses(MakeTagSight(camera->camera, d), input.sizes.SizeOf(d.id));
      } catch (const NumericError&) {
        continue;
      }
      if (poses.empty()) continue;
      const Eigen::Quaterniond odom_from_tag =
          odom->rotation * camera->cam_from_body.rotation.conjugate() * poses[0].cam_from_tag.rotation;
      const double x = (odom_from_tag * Eigen::Vector3d::UnitX()).z(),
                   y = (odom_from_tag * Eigen::Vector3d::UnitY()).z();
      if (std::hypot(x, y) < 0.9) continue;  // not on a wall
      ++wall;
      ++down[std::abs(y) > std::abs(x) ? (y < 0 ? 0 : 2) : (x < 0 ? 1 : 3)];
    }
  }
  const auto most = std::max_element(down.begin(), down.end());
  if (wall >= kLeastSteps && most != down.begin() && *most > kMostlyShare * wall) {
    const char* const how[] = {"upright", "on their right side", "on their head", "on their left side"};
    findings->push_back({false, fmt::format("run {}: {} of {} tags on walls stand {}: either they were mounted so, or "
                                            "the corners begin at another one than bottom-left",
                                            run.name, *most, wall, how[most - down.begin()])});
  }
}

}  // namespace

std::vector<ConventionFinding> CheckInput(const SurveyInput& input) {
  std::vector<ConventionFinding> findings;
  for (const SurveyRun& run : input.runs) {
    CheckCorners(run, &findings);
    CheckOdometry(run, &findings);
    CheckUpright(input, run, &findings);
  }
  return findings;
}

std::vector<ConventionFinding> CheckPoints(const SurveyInput& input, const MapStart& start,
                                           const std::vector<SurveyPoint>& points) {
  std::vector<ConventionFinding> findings;
  std::vector<Eigen::Vector3d> map, stated;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e300), high = -low;
  for (const SurveyPoint& p : points) {
    const auto tag = start.world_from_tag.find(p.tag_id);
    if (tag == start.world_from_tag.end() || p.role == PointRole::kGeotag) continue;
    map.push_back(p.corner < 0 ? tag->second.translation
                               : tag->second * TagCorner(input.sizes.SizeOf(p.tag_id), p.corner));
    stated.push_back(p.world_m);
    low = low.cwiseMin(p.world_m), high = high.cwiseMax(p.world_m);
  }
  if (map.size() < 3) return findings;
  const double extent = (high - low).norm(), as_is = FitRms(map, stated);
  if (as_is < 0.3 + 0.05 * extent) return findings;  // odometry drifts by a few percent
  struct Reading {
    const char* what;
    std::function<Eigen::Vector3d(const Eigen::Vector3d&)> mend;
  };
  const std::vector<Reading> readings = {
      {"easting and northing are swapped",
       [](const Eigen::Vector3d& p) { return Eigen::Vector3d(p.y(), p.x(), p.z()); }},
      {"heights count downwards", [](const Eigen::Vector3d& p) { return Eigen::Vector3d(p.x(), p.y(), -p.z()); }},
      {"coordinates are in feet, not metres", [](const Eigen::Vector3d& p) { return Eigen::Vector3d(kFoot * p); }},
      {"heights are in feet, not metres",
       [](const Eigen::Vector3d& p) { return Eigen::Vector3d(p.x(), p.y(), kFoot * p.z()); }},
  };
  for (const Reading& reading : readings) {
    std::vector<Eigen::Vector3d> mended;
    for (const Eigen::Vector3d& p : stated) mended.push_back(reading.mend(p));
    const double rms = FitRms(map, mended);
    // Three points fit a mirrored map as well as the true one: their plane hides it.
    if (rms < 0.2 * as_is && rms < 0.3 + 0.05 * extent) {
      findings.push_back({true, fmt::format("control_points.csv: the surveyed points fit the pictures only to {:.2f} m "
                                            "as they stand, but to {:.2f} m if {}: mend the table",
                                            as_is, rms, reading.what)});
      return findings;
    }
  }
  findings.push_back(
      {false, fmt::format("control_points.csv: the surveyed points fit the starting map only to {:.2f} m "
                          "over {:.1f} m: look for a wrong id, a wrong tag size or poor odometry",
                          as_is, extent)});
  return findings;
}

}  // namespace trigpoint

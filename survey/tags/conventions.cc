#include "survey/tags/conventions.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>

#include "calib/base/error.h"
#include "calib/base/median.h"
#include "calib/geo/geodetic.h"
#include "calib/geo/unit_of_length.h"
#include "calib/geometry/alignment.h"
#include "calib/geometry/nearest_to_rays.h"
#include "survey/tags/planar_pose.h"

namespace trigpoint {
namespace {

constexpr double kLeastStep_m = 0.02;  // shorter steps of odometry say nothing about its direction
constexpr int kLeastSteps = 20;
constexpr double kMostlyShare = 0.9;  // of detections that must agree before an order is called wrong
constexpr double kFoot = 0.3048;
constexpr double kLeastParallax_rad = 10 * kDegToRad, kLeastWay_m = 0.3;
constexpr double kScaleKnown = 0.05;  // odometry whose stated scale sigma is larger says nothing about sizes
constexpr double kSizesAlike = 0.04, kMostOff = 0.1;
constexpr double kLeastUnit = 0.15;     // logarithm of a factor: a start is not that far off
constexpr double kLeastTurned_deg = 5;  // positions against rotations: the pictures of few tags show less by chance

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

// After the best fit; infinite where the points hold none (all at one place).
double FitRms(const std::vector<Eigen::Vector3d>& map, const std::vector<Eigen::Vector3d>& stated, AlignmentKind kind,
              double* scale = nullptr) {
  try {
    const Sim3d fit = AlignPoints(map, stated, kind);
    if (scale != nullptr) *scale = fit.scale;
    double square = 0;
    for (size_t i = 0; i < map.size(); ++i) square += (fit * map[i] - stated[i]).squaredNorm();
    return std::sqrt(square / static_cast<double>(map.size()));
  } catch (const NumericError&) {
    return std::numeric_limits<double>::infinity();
  }
}

// Without the point that fits worst: a single wrong one is no convention.
double FitRmsWithoutWorst(const std::vector<Eigen::Vector3d>& map, const std::vector<Eigen::Vector3d>& stated) {
  double least = std::numeric_limits<double>::infinity();
  for (size_t i = 0; map.size() > 3 && i < map.size(); ++i) {
    std::vector<Eigen::Vector3d> a = map, b = stated;
    a.erase(a.begin() + static_cast<std::ptrdiff_t>(i)), b.erase(b.begin() + static_cast<std::ptrdiff_t>(i));
    least = std::min(least, FitRms(a, b, AlignmentKind::kSE3));
  }
  return least;
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
                           "the pictures are mirrored, set mirrored: true in run.yaml",
                           run.name, clockwise, n)});
  }
}

// Half a pixel cannot be seen in tags alone: a shifted principal point looks like a turned camera. What can be seen is
// where a number comes from.
void CheckPrincipalPoint(const SurveyRun& run, std::vector<ConventionFinding>* findings) {
  for (const BodyCamera& c : run.cameras) {
    if (c.camera.model() == CameraModel::kEquirectangular) continue;
    const std::vector<double>& p = c.camera.params();
    if (p[2] != 0.5 * c.camera.width() || p[3] != 0.5 * c.camera.height()) continue;
    findings->push_back(
        {false,
         fmt::format("run {}, {}: the principal point is exactly half the picture, {:g}, {:g}: either it was "
                     "not calibrated (calibrate the camera), or its pixels count from the corner of the first "
                     "pixel; expected pixels that count from its centre, where the picture's middle is {:g}, {:g}",
                     run.name, c.name, p[2], p[3], p[2] - 0.5, p[3] - 0.5)});
  }
}

void CheckOdometry(const SurveyRun& run, std::vector<ConventionFinding>* findings) {
  const double as_read = MotionConsistency(run.odometry, {0, 1, 2, 3});
  const double w_first = MotionConsistency(run.odometry, {1, 2, 3, 0});
  if (as_read >= 0 && as_read < 0.7 && w_first > 0.95) {
    findings->push_back(
        {true,
         fmt::format(
             "run {}: odometry turns as if its quaternions were written w x y z (read so, the direction of motion in "
             "the body's frame is the same in {:.0f} % of the steps, as read in {:.0f} %); expected x y z w: reorder "
             "the columns of odometry.tum",
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
    const char* const how[] = {"upright", "on their right side", "upside down", "on their left side"};
    findings->push_back({false, fmt::format("run {}: {} of {} tags on walls stand {}: either they were mounted so, or "
                                            "their corners do not begin at bottom-left",
                                            run.name, *most, wall, how[most - down.begin()])});
  }
}

// A tag's centre as a picture has it: where the camera's body is by odometry, and the centre in the body's frame, which
// rests on the tag's stated size.
struct CentreSight {
  int64_t stamp_ns = 0;
  Rigid3d odom_from_body;
  Eigen::Vector3d in_body = Eigen::Vector3d::Zero(), camera_in_body = Eigen::Vector3d::Zero();
};

// By tag, of one run.
std::map<int, std::vector<CentreSight>> CentresOf(const SurveyInput& input, const MapStart& start, int run) {
  std::map<int, std::vector<CentreSight>> centres;
  for (const MapFrame& frame : start.frames) {
    if (frame.run != run || !frame.odom_from_body) continue;
    for (int i : frame.sights) {
      const MapSight& s = start.sights[static_cast<size_t>(i)];
      const auto poses = EstimatePlanarPoses(s.sight, input.sizes.SizeOf(s.detection.id));
      if (poses.empty()) continue;
      const Rigid3d body_from_cam =
          input.runs[static_cast<size_t>(run)].cameras[static_cast<size_t>(s.camera)].cam_from_body.Inverse();
      centres[s.detection.id].push_back({frame.stamp_ns, *frame.odom_from_body,
                                         body_from_cam * poses.front().cam_from_tag.translation,
                                         body_from_cam.translation});
    }
  }
  return centres;
}

// Distance to a tag by the parallax of its pictures along odometry, over that by its stated size: median of the
// pictures. Nothing without parallax.
std::optional<double> SizeRatio(const std::vector<CentreSight>& sights) {
  NearestToRays meeting;
  std::vector<Eigen::Vector3d> origins, rays;
  for (const CentreSight& s : sights) {
    origins.push_back(s.odom_from_body * s.camera_in_body);
    rays.push_back((s.odom_from_body * s.in_body - origins.back()).normalized());
    meeting.Add(origins.back(), rays.back());
  }
  double widest = 1;
  for (const Eigen::Vector3d& ray : rays) widest = std::min(widest, ray.dot(rays.front()));
  if (widest > std::cos(kLeastParallax_rad)) return std::nullopt;
  const Eigen::Vector3d point = meeting.Point();
  std::vector<double> ratios;
  for (size_t i = 0; i < sights.size(); ++i) {
    ratios.push_back((point - origins[i]).dot(rays[i]) / (sights[i].in_body - sights[i].camera_in_body).norm());
  }
  return Median(std::move(ratios));
}

// The first stretch of pictures of a tag in which odometry has hardly drifted.
std::vector<CentreSight> FirstVisit(const std::vector<CentreSight>& sights) {
  std::vector<CentreSight> visit;
  for (const CentreSight& s : sights) {
    if (!visit.empty() && s.stamp_ns - visit.back().stamp_ns > kVisitGap_ns) break;
    visit.push_back(s);
  }
  return visit;
}

// Of one run or several: how much farther away the tags are by odometry than by their stated size.
struct SizeRatios {
  std::vector<double> all;
  double middle = 1;
  int64_t alike = 0;

  void Judge() {
    middle = Median(all);
    alike = std::count_if(all.begin(), all.end(), [&](double r) { return std::abs(r / middle - 1) < kSizesAlike; });
  }
  bool IsKnown() const { return all.size() >= 3 && alike >= 0.7 * static_cast<double>(all.size()); }
  bool IsOff() const { return IsKnown() && std::abs(middle - 1) >= 2 * kSizesAlike; }
};

void CheckSizes(const SurveyInput& input, const std::vector<std::map<int, std::vector<CentreSight>>>& runs,
                std::vector<ConventionFinding>* findings) {
  SizeRatios together;
  std::vector<SizeRatios> by_run(runs.size());
  for (size_t r = 0; r < runs.size(); ++r) {
    if (input.runs[r].scale_sigma > kScaleKnown) continue;
    for (const auto& [id, sights] : runs[r]) {
      const std::vector<CentreSight> visit = FirstVisit(sights);
      if (visit.size() < 3) continue;
      if (const auto ratio = SizeRatio(visit); ratio && *ratio > 0) by_run[r].all.push_back(*ratio);
    }
    together.all.insert(together.all.end(), by_run[r].all.begin(), by_run[r].all.end());
    if (!by_run[r].all.empty()) by_run[r].Judge();
  }
  if (together.all.empty()) return;
  together.Judge();
  if (together.IsOff()) {
    findings->push_back(
        {true,
         fmt::format("tags.yaml: by odometry the tags are {:.2f} times as far away as by their stated size ({} of {} "
                     "visits agree): either all tags were printed {:.2f} times as large as stated, or odometry is not "
                     "in metres. Measure a printed tag. Option --set survey.check_conventions=false skips this check",
                     together.middle, together.alike, together.all.size(), together.middle)});
    return;
  }
  // Sizes that one run's odometry confirms are right: a run that contradicts them has another unit or scale.
  const bool confirmed =
      std::any_of(by_run.begin(), by_run.end(), [](const SizeRatios& r) { return r.IsKnown() && !r.IsOff(); });
  for (size_t r = 0; confirmed && r < runs.size(); ++r) {
    if (!by_run[r].IsOff()) continue;
    findings->push_back(
        {true, fmt::format(
                   "run {}: lengths of its odometry are {:.3f} times those by the tags' stated sizes ({} of {} visits "
                   "agree), while the odometry of other runs agrees with the sizes: expected metres; correct the unit "
                   "or the scale of its odometry.tum. Option --set survey.check_conventions=false skips this check",
                   input.runs[r].name, by_run[r].middle, by_run[r].alike, by_run[r].all.size())});
  }
}

// What turns (or mirrors) a run's positions so that tags stay where they are while the body drives by: between two
// pictures of a tag, turn * (t1 - t2) = R2 x2 - R1 x1.
Eigen::Matrix3d TurnOfPositions(const std::map<int, std::vector<CentreSight>>& centres) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const auto& [id, sights] : centres) {
    const std::vector<CentreSight> visit = FirstVisit(sights);
    for (size_t i = 1; i < visit.size(); ++i) {
      const Rigid3d &first = visit[0].odom_from_body, &now = visit[i].odom_from_body;
      const Eigen::Vector3d by_positions = first.translation - now.translation;
      const Eigen::Vector3d by_tag = now.rotation * visit[i].in_body - first.rotation * visit[0].in_body;
      if (by_positions.norm() >= kLeastWay_m) sum += by_tag.normalized() * by_positions.normalized().transpose();
    }
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  // In a plane a mirror is a half turn about an axis in it, too: it is called a mirror where the plane is level.
  const Eigen::Matrix3d as_found = svd.matrixU() * svd.matrixV().transpose();
  Eigen::Matrix3d other = svd.matrixU() * Eigen::Vector3d(1, 1, -1).asDiagonal() * svd.matrixV().transpose();
  return as_found(2, 2) > other(2, 2) ? as_found : other;
}

// A tag stays where it is while the body drives by: under the reading of odometry that is right.
void CheckAxes(const SurveyRun& run, const std::map<int, std::vector<CentreSight>>& centres,
               std::vector<ConventionFinding>* findings) {
  const Eigen::Matrix3d flip = Eigen::Vector3d(1, -1, -1).asDiagonal();
  const Eigen::Quaterniond half_turn(flip);
  struct Reading {
    std::string what;
    std::function<Rigid3d(const Rigid3d&)> mend;
  };
  const Eigen::Matrix3d turn = TurnOfPositions(centres);
  const double turned_deg = Eigen::AngleAxisd(turn).angle() * kRadToDeg;
  const bool mirrored = turn.determinant() < 0;
  const std::string turned =
      mirrored
          ? "its positions are mirrored against its rotations (a sign or the order of x, y, z)"
          : fmt::format("its positions are turned by {:.0f} deg against its rotations (expected both in one frame)",
                        turned_deg);
  std::vector<Reading> readings = {
      {"", [](const Rigid3d& p) { return p; }},
      {"its axes are forward, right, down (expected forward, left, up, as T_cam_imu of camchain.yaml has the body)",
       [&](const Rigid3d& p) { return Rigid3d(half_turn * p.rotation * half_turn, half_turn * p.translation); }},
      {"its quaternions turn the other way (expected odom_from_body)",
       [](const Rigid3d& p) { return Rigid3d(p.rotation.conjugate(), p.translation); }},
      {"its poses are body_from_odom (expected odom_from_body)", [](const Rigid3d& p) { return p.Inverse(); }},
  };
  if (mirrored || turned_deg > kLeastTurned_deg) {
    readings.push_back({turned, [&](const Rigid3d& p) { return Rigid3d(p.rotation, turn * p.translation); }});
  }
  std::vector<double> errors;
  for (const Reading& reading : readings) {
    std::vector<double> off;
    for (const auto& [id, sights] : centres) {
      const std::vector<CentreSight> visit = FirstVisit(sights);
      for (size_t i = 1; i < visit.size(); ++i) {
        const Rigid3d first = reading.mend(visit[0].odom_from_body), now = reading.mend(visit[i].odom_from_body);
        if ((now.translation - first.translation).norm() < kLeastWay_m) continue;
        const Eigen::Vector3d expected = now.Inverse() * (first * visit[0].in_body);
        off.push_back((expected - visit[i].in_body).norm() / visit[i].in_body.norm());
      }
    }
    if (off.size() < static_cast<size_t>(kLeastSteps)) return;
    errors.push_back(Median(std::move(off)));
  }
  const size_t best = static_cast<size_t>(std::min_element(errors.begin(), errors.end()) - errors.begin());
  if (best == 0 || errors[best] > 0.3 * errors[0] || errors[best] > kMostOff) return;
  findings->push_back(
      {true, fmt::format("run {}: with odometry.tum as read, tags in view move by {:.0f} % of their distance while the "
                         "body passes, but only by {:.0f} % if {}; expected tags that stay in place: correct the file",
                         run.name, 100 * errors[0], 100 * errors[best], readings[best].what)});
}

// A way to read surveyed points which fits the pictures to less than `least`, m; `as_is`: the fit as they stand.
std::optional<ConventionFinding> FindPointReading(const std::vector<Eigen::Vector3d>& map,
                                                  const std::vector<Eigen::Vector3d>& stated, double as_is,
                                                  double least) {
  struct Reading {
    const char* what;
    std::function<Eigen::Vector3d(const Eigen::Vector3d&)> mend;
  };
  const std::vector<Reading> readings = {
      {"easting and northing are swapped",
       [](const Eigen::Vector3d& p) { return Eigen::Vector3d(p.y(), p.x(), p.z()); }},
      {"heights count downwards", [](const Eigen::Vector3d& p) { return Eigen::Vector3d(p.x(), p.y(), -p.z()); }},
      {"heights are in feet, not metres",
       [](const Eigen::Vector3d& p) { return Eigen::Vector3d(p.x(), p.y(), kFoot * p.z()); }},
  };
  for (const Reading& reading : readings) {
    std::vector<Eigen::Vector3d> mended;
    for (const Eigen::Vector3d& p : stated) mended.push_back(reading.mend(p));
    const double rms = FitRms(map, mended, AlignmentKind::kSE3);
    // Three points fit a mirrored map as well as the true one: their plane hides it.
    if (rms < least) {
      return ConventionFinding{true,
                               fmt::format("control_points.csv: the surveyed points fit the pictures only to {:.2f} m "
                                           "as they stand, but to {:.2f} m if {}: correct the table",
                                           as_is, rms, reading.what)};
    }
  }
  return std::nullopt;
}

// How far points spread across their longest extent, rms.
double Breadth(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) mean += p / static_cast<double>(points.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) {
    spread += (p - mean) * (p - mean).transpose() / static_cast<double>(points.size());
  }
  return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvalues()(1)));
}

// Points in one plane fit their mirror image as well, with the site on its head: then bodies point downwards.
void CheckHead(const MapStart& start, const std::vector<Eigen::Vector3d>& map,
               const std::vector<Eigen::Vector3d>& stated, double noise_m, std::vector<ConventionFinding>* findings) {
  constexpr double kDown = -0.5;              // mean z of the bodies' z axes
  if (Breadth(stated) < 3 * noise_m) return;  // points in a line leave the turn about it open
  const Eigen::Quaterniond turn = AlignPoints(map, stated, AlignmentKind::kSE3).rotation;
  double up = 0;
  int bodies = 0;
  for (const MapFrame& frame : start.frames) {
    if (!frame.world_from_body || !frame.odom_from_body) continue;
    up += (turn * (frame.world_from_body->rotation * Eigen::Vector3d::UnitZ())).z();
    ++bodies;
  }
  if (bodies < kLeastSteps || up / bodies > kDown) return;
  findings->push_back({true,
                       "control_points.csv: the surveyed points fit the pictures only with the site on its head (the "
                       "body's z axis points down in the mean, expected up): they are mirrored. Exchange latitude and "
                       "longitude, or easting and northing, or correct the sign of one"});
}

}  // namespace

std::vector<ConventionFinding> CheckSights(const SurveyInput& input, const MapStart& start) {
  std::vector<ConventionFinding> findings;
  std::vector<std::map<int, std::vector<CentreSight>>> centres;
  for (size_t r = 0; r < input.runs.size(); ++r) {
    centres.push_back(CentresOf(input, start, static_cast<int>(r)));
    CheckAxes(input.runs[r], centres.back(), &findings);
  }
  if (findings.empty()) CheckSizes(input, centres, &findings);
  return findings;
}

std::vector<ConventionFinding> CheckInput(const SurveyInput& input) {
  std::vector<ConventionFinding> findings;
  for (const SurveyRun& run : input.runs) {
    CheckCorners(run, &findings);
    CheckPrincipalPoint(run, &findings);
    CheckOdometry(run, &findings);
    CheckUpright(input, run, &findings);
  }
  return findings;
}

namespace {

constexpr double kLeastNoise_m = 0.3;  // of a starting map

// Two points show nothing but their distance. Where it is wrong by more than all of it, they place nothing.
std::vector<ConventionFinding> DistanceFinding(double in_map_m, double stated_m, double sigma_m) {
  constexpr double kSigmas = 3;
  if (std::abs(stated_m - in_map_m) <= in_map_m + kLeastNoise_m + kSigmas * sigma_m) return {};
  return {{true, fmt::format("control_points.csv: the two surveyed points are {:.2f} m apart, but {:.2f} m by the "
                             "pictures: check for a wrong coordinate, id or unit, a wrong tag size or poor odometry",
                             stated_m, in_map_m)}};
}

}  // namespace

std::vector<ConventionFinding> CheckPoints(const SurveyInput& input, const MapStart& start,
                                           const std::vector<SurveyPoint>& points) {
  std::vector<ConventionFinding> findings;
  std::vector<Eigen::Vector3d> map, stated;
  double variance_m2 = 0;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e300), high = -low;
  for (const SurveyPoint& p : points) {
    const auto tag = start.world_from_tag.find(p.tag_id);
    if (tag == start.world_from_tag.end() || p.role == PointRole::kGeotag) continue;
    map.push_back(p.corner < 0 ? tag->second.translation
                               : tag->second * TagCorner(input.sizes.SizeOf(p.tag_id), p.corner));
    stated.push_back(p.world_m);
    variance_m2 += 2 * p.sigma_h_m * p.sigma_h_m + p.sigma_v_m * p.sigma_v_m;
    low = low.cwiseMin(map.back()), high = high.cwiseMax(map.back());
  }
  if (map.size() == 2) {
    return DistanceFinding((map[0] - map[1]).norm(), (stated[0] - stated[1]).norm(), std::sqrt(variance_m2));
  }
  if (map.size() < 3) return findings;
  const double extent = (high - low).norm(), as_is = FitRms(map, stated, AlignmentKind::kSE3);
  const double near = kLeastNoise_m + 0.05 * extent;  // odometry drifts by a few percent
  double factor = 1;
  const double scaled = FitRms(map, stated, AlignmentKind::kSim3, &factor);
  const double without_worst = FitRmsWithoutWorst(map, stated);
  if (factor > 0 && std::abs(std::log(factor)) > kLeastUnit && scaled < 0.3 * as_is && scaled < without_worst) {
    const std::string unit = UnitOfLength(1 / factor, 0.1);
    findings.push_back(
        {true, fmt::format("control_points.csv: the surveyed points are {:.3g} times as far from each other as by the "
                           "pictures (fit to {:.2f} m, {:.2f} m with this factor); expected metres{}: correct the "
                           "table, or tags.yaml and odometry if these are what is wrong",
                           factor, as_is, scaled, unit.empty() ? "" : ", found what may be " + unit)});
    return findings;
  }
  if (as_is < near) {
    CheckHead(start, map, stated, std::max(kLeastNoise_m, as_is), &findings);
    return findings;
  }
  if (const auto other = FindPointReading(map, stated, as_is, std::min({0.2 * as_is, near, without_worst}))) {
    return {*other};
  }
  // Points that are farther from the map than it is wide place nothing.
  findings.push_back(
      {as_is > extent, fmt::format("control_points.csv: the surveyed points fit the starting map only to "
                                   "{:.2f} m over {:.1f} m: check for a wrong coordinate or id, a wrong "
                                   "tag size or poor odometry",
                                   as_is, extent)});
  return findings;
}

}  // namespace trigpoint

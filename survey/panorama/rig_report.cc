#include "survey/panorama/rig_report.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

#include "calib/geo/geodetic.h"
#include "calib/geometry/nearest_to_rays.h"

namespace trigpoint {
namespace {

double Percentile(std::vector<double> v, double share) {
  if (v.empty()) return 0;
  const size_t k = std::min(v.size() - 1, static_cast<size_t>(share * static_cast<double>(v.size())));
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(k), v.end());
  return v[k];
}

// Rotation b_from_a of a pair by itself: least squares over its matches, with those that don't agree left out.
std::optional<Eigen::Quaterniond> OwnRotation(const StitchedRig& rig, const PhotoPair& pair) {
  const auto lens = [&](int i) -> const Lens& {
    return rig.state.lenses[static_cast<size_t>(rig.state.photos[static_cast<size_t>(i)].lens)];
  };
  const PairView& view = rig.views[static_cast<size_t>(pair.b)];
  PairRotation r =
      FindRotation(rig.views, pair, lens(pair.a), lens(pair.b), 6.0 * std::max(view.width, view.height) / 1600, 500, 1);
  if (r.inliers.size() < 8) return std::nullopt;
  return r.b_from_a;
}

}  // namespace

void CentreRig(StitchedRig* rig) {
  RigState& s = rig->state;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  int n = 0;
  for (const RigPhoto& p : s.photos) {
    if (p.placed) mean += p.centre, ++n;
  }
  if (n == 0) return;
  mean /= n;
  MoveRigOrigin(mean, &s);
  for (RigPhoto& p : s.photos) {
    if (!p.placed) p.centre.setZero();
  }
  // c_i' = c_i - mean c: the covariance follows.
  Eigen::MatrixXd& c = rig->bundle.covariance;
  if (c.rows() < 6 * n) return;
  Eigen::MatrixXd j = Eigen::MatrixXd::Identity(c.rows(), c.cols());
  for (int a = 0; a < n; ++a) {
    for (int b = 0; b < n; ++b) {
      j.block<3, 3>(6 * a + 3, 6 * b + 3) -= Eigen::Matrix3d::Identity() / n;
    }
  }
  c = j * c * j.transpose();
  j.conservativeResize(6 * n, 6 * n);
  rig->bundle.shape_covariance = j * rig->bundle.shape_covariance * j.transpose();
}

Eigen::Vector3d CentreOfAxes(const RigState& state) {
  NearestToRays meeting;
  for (const RigPhoto& p : state.photos) {
    if (p.placed) meeting.Add(p.centre, p.cam_from_rig.conjugate() * Eigen::Vector3d::UnitZ());
  }
  if (meeting.Spread()(0) < 1e-6 * meeting.Trace()) return Eigen::Vector3d::Zero();
  return meeting.Point();
}

void DescribeParallax(StitchedRig* rig) {
  RigState& s = rig->state;
  ParallaxBudget& b = rig->parallax;
  double sum = 0;
  int n = 0;
  for (const RigPhoto& p : s.photos) {
    if (!p.placed) continue;
    sum += p.centre.squaredNorm();
    b.largest_m = std::max(b.largest_m, p.centre.norm());
    ++n;
  }
  b.spread_m = n > 0 ? std::sqrt(sum / n) : 0;
  b.axes_centre = CentreOfAxes(s);
  std::vector<double> shift, distance;
  for (RigPoint& p : s.points) {
    for (const RigObservation& o : p.observations) {
      RigPoint far = p;
      far.inverse_distance = 0;
      Eigen::Vector2d with, without;
      if (ProjectRigPoint(rig->views, s, p, o.photo, &with) && ProjectRigPoint(rig->views, s, far, o.photo, &without)) {
        shift.push_back((with - without).norm());
      }
    }
    p.sigma = SigmaOfDistance(rig->views, s, p);
    if (p.inverse_distance > 3 * p.sigma) distance.push_back(1 / p.inverse_distance);
  }
  b.median_px = Percentile(shift, 0.5);
  b.p95_px = Percentile(shift, 0.95);
  b.max_px = shift.empty() ? 0 : *std::max_element(shift.begin(), shift.end());
  b.points_with_distance = static_cast<int>(distance.size());
  b.median_distance_m = Percentile(distance, 0.5);
}

void DescribeClosure(StitchedRig* rig) {
  Closure& c = rig->closure;
  c.full_turn = false;
  // The main row: photos whose axis is within 15 deg of the median pitch, in order of azimuth.
  std::vector<double> pitches;
  const auto look = [&](int i) -> Eigen::Vector3d {
    return rig->state.photos[static_cast<size_t>(i)].cam_from_rig.conjugate() * Eigen::Vector3d::UnitZ();
  };
  std::vector<int> placed;
  for (int i = 0; i < static_cast<int>(rig->photos.size()); ++i) {
    if (rig->state.photos[static_cast<size_t>(i)].placed) placed.push_back(i);
  }
  // The row with the most photos within 12 deg of one another.
  std::vector<int> row;
  for (int i : placed) {
    std::vector<int> near;
    const double pitch = std::asin(std::clamp(-look(i).y(), -1.0, 1.0));
    for (int k : placed) {
      if (std::abs(std::asin(std::clamp(-look(k).y(), -1.0, 1.0)) - pitch) < 12 * kDegToRad) near.push_back(k);
    }
    if (near.size() > row.size()) row = near;
  }
  c.photos = static_cast<int>(row.size());
  if (row.size() < 3) return;
  const auto azimuth = [&](int i) { return std::atan2(look(i).x(), look(i).z()); };
  std::sort(row.begin(), row.end(), [&](int a, int b) { return azimuth(a) < azimuth(b); });
  std::map<std::pair<int, int>, const PhotoPair*> pair_of;
  for (const PhotoPair& p : rig->pairs) pair_of[{p.a, p.b}] = &p;
  double sum = 0;
  for (size_t k = 0; k < row.size(); ++k) {
    const int a = row[k], b = row[(k + 1) % row.size()];
    const auto it = pair_of.find({std::min(a, b), std::max(a, b)});
    if (it == pair_of.end()) return;
    const std::optional<Eigen::Quaterniond> own = OwnRotation(*rig, *it->second);
    if (!own) return;
    const Eigen::Quaterniond b_from_a = it->second->a == a ? *own : own->conjugate();
    // Where a, standing as adjusted, says that b looks: its azimuth less a's.
    const Eigen::Vector3d said = rig->state.photos[static_cast<size_t>(a)].cam_from_rig.conjugate() *
                                 (b_from_a.conjugate() * Eigen::Vector3d::UnitZ());
    const double turn = WrapAngle(std::atan2(said.x(), said.z()) - azimuth(a));
    sum += turn;
  }
  c.sum_deg = sum * kRadToDeg;
  if (std::abs(c.sum_deg - 360) > 60) return;  // there and back again, no turn
  c.full_turn = true;
  c.error_deg = c.sum_deg - 360;
}

}  // namespace trigpoint

#include "localize/reconstruct/rolling_shutter.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "calib/estimation/bundle_terms.h"

namespace trigpoint {
namespace {

using Vector3d = Eigen::Vector3d;

// Of a body in its own frame: how it turns (rad/s) and moves (m/s).
struct Rate {
  Vector3d omega = Vector3d::Zero(), velocity = Vector3d::Zero();
  bool known = false;
};

// From a to b, `seconds` apart, as the body at `at`, between them, sees it.
Rate RateBetween(const Rigid3d& odom_from_a, const Rigid3d& odom_from_b, const Rigid3d& odom_from_at, double seconds) {
  Rate rate;
  rate.omega = LogSO3(odom_from_a.rotation.conjugate() * odom_from_b.rotation) / seconds;
  rate.velocity = odom_from_at.rotation.conjugate() * (odom_from_b.translation - odom_from_a.translation) / seconds;
  rate.known = true;
  return rate;
}

// By odometry where it is denser than the images, else by the poses before and behind. Over more than a second nobody
// knows how a body moved between two poses.
std::vector<Rate> BodyRates(const LocalizeInput& input, const BundleProblem& p) {
  constexpr double kLongest_s = 1;
  const size_t n = input.pose_stamps.size();
  std::vector<Rate> rates(n);
  std::vector<size_t> order(n);
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(),
            [&](size_t a, size_t b) { return input.pose_stamps[a] < input.pose_stamps[b]; });
  const auto seconds = [&](size_t a, size_t b) {
    return 1e-9 * static_cast<double>(input.pose_stamps[b] - input.pose_stamps[a]);
  };
  for (size_t k = 0; k < n; ++k) {
    const size_t at = order[k];
    if (at < input.odometry_rates.size()) {
      const Vector6d& given = input.odometry_rates[at];
      rates[at] = {given.head<3>(), given.tail<3>(), true};
      continue;
    }
    size_t before = k > 0 ? order[k - 1] : at, behind = k + 1 < n ? order[k + 1] : at;
    if (seconds(before, at) > kLongest_s) before = at;
    if (seconds(at, behind) > kLongest_s) behind = at;
    if (before == behind) continue;
    rates[at] = RateBetween(p.poses[before].Inverse(), p.poses[behind].Inverse(), p.poses[at].Inverse(),
                            seconds(before, behind));
  }
  return rates;
}

// Of the camera in its own frame.
Rate CameraRate(const Rate& body, const Rigid3d& cam_from_body) {
  Rate rate = body;
  const Vector3d arm = cam_from_body.TargetOriginInSource();
  rate.omega = cam_from_body.rotation * body.omega;
  rate.velocity = cam_from_body.rotation * (body.velocity + body.omega.cross(arm));
  return rate;
}

// How much later than the image's time a row is exposed, as a part of the readout time: -1/2 to 1/2.
double RowTime(const Camera& camera, double v) { return v / std::max(1, camera.height() - 1) - 0.5; }

const BodyCamera& CameraOf(const LocalizeInput& input, int image) {
  return input.cameras[static_cast<size_t>(input.images[static_cast<size_t>(image)].camera)];
}

}  // namespace

bool HasReadout(const LocalizeInput& input) {
  return std::any_of(input.cameras.begin(), input.cameras.end(),
                     [](const BodyCamera& camera) { return camera.readout_s != 0; });
}

std::vector<TrackObservation> AtImageTimes(const LocalizeInput& input, const Reconstruction& r) {
  const BundleProblem& p = r.problem;
  const std::vector<Rate> rates = BodyRates(input, p);
  std::vector<std::vector<size_t>> of_image(input.images.size());
  for (size_t i = 0; i < p.observations.size(); ++i) of_image[static_cast<size_t>(r.image_of[i])].push_back(i);
  std::vector<TrackObservation> tracks(p.observations.size());
  for (size_t image = 0; image < of_image.size(); ++image) {
    const FeatureSet features = input.image_features(static_cast<int>(image));
    const BodyCamera& camera = CameraOf(input, static_cast<int>(image));
    const auto pose = static_cast<size_t>(input.images[image].pose);
    const Rate rate = CameraRate(rates[pose], camera.cam_from_body);
    for (size_t i : of_image[image]) {
      const BearingObservation& o = p.observations[i];
      TrackObservation& t = tracks[i];
      t = {o.point, static_cast<int>(image), r.feature_of[i], features.points[static_cast<size_t>(r.feature_of[i])]};
      const auto ray = camera.camera.Unproject(t.pixel.cast<double>());
      if (!rate.known || camera.readout_s == 0 || !ray) continue;
      const double dt = camera.readout_s * RowTime(camera.camera, t.pixel.y());
      const auto point = static_cast<size_t>(o.point);
      Vector3d moved = ExpSO3(dt * rate.omega) * *ray;
      if (r.point_valid[point]) {
        const Vector3d seen = p.views[static_cast<size_t>(o.view)] * (p.poses[pose] * p.points[point]);
        moved += dt / seen.norm() * rate.velocity;
      }
      if (const auto pixel = camera.camera.Project(moved)) t.pixel = pixel->cast<float>();
    }
  }
  return tracks;
}

namespace {

// Normal equations of the cameras' readout times, the points eliminated.
struct ReadoutEquations {
  Eigen::MatrixXd normal;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd with_poses;  // their part with the poses' left tangents
};

// A whitened observation, by its pose, its point and its camera's readout time.
struct ReadoutRow {
  ObservationTerms terms;
  Eigen::Vector2d by_readout = Eigen::Vector2d::Zero();
  Eigen::Index pose = 0, camera = 0;
  double weight = 1;
};

std::optional<ReadoutRow> RowOf(const LocalizeInput& input, const Reconstruction& r, const std::vector<Rate>& rates,
                                size_t i) {
  const BundleProblem& p = r.problem;
  const BearingObservation& o = p.observations[i];
  const Vector3d& point = p.points[static_cast<size_t>(o.point)];
  ReadoutRow row;
  if (!o.active || !Evaluate<true>(p, o, point, &row.terms)) return std::nullopt;
  const BodyCamera& camera = CameraOf(input, r.image_of[i]);
  const Vector3d ray = o.ray.cast<double>();
  const auto pixel = camera.camera.Project(ray);
  if (!pixel) return std::nullopt;
  const Rate rate = CameraRate(rates[static_cast<size_t>(o.pose)], camera.cam_from_body);
  const double distance =
      (p.views[static_cast<size_t>(o.view)] * (p.poses[static_cast<size_t>(o.pose)] * point)).norm();
  const Vector3d by_time = rate.omega.cross(ray) + rate.velocity / distance;
  row.by_readout = -RowTime(camera.camera, pixel->y()) * (o.w.cast<double>() * by_time);
  row.pose = 6 * static_cast<Eigen::Index>(o.pose);
  row.camera = o.view;
  double rho[3] = {0, 1, 0};
  if (p.loss) p.loss->Evaluate(row.terms.r.squaredNorm(), rho);
  row.weight = rho[1];
  return row;
}

// The rows of one point.
void AddPoint(const std::vector<ReadoutRow>& rows, ReadoutEquations* equations) {
  const Eigen::Index n = equations->gradient.size();
  Eigen::Matrix3d hyy = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, Eigen::Dynamic> hyt = Eigen::MatrixXd::Zero(3, n);
  Vector3d gy = Vector3d::Zero();
  for (const ReadoutRow& row : rows) {
    hyy += row.weight * row.terms.jy.transpose() * row.terms.jy;
    hyt.col(row.camera) += row.weight * row.terms.jy.transpose() * row.by_readout;
    gy += row.weight * row.terms.jy.transpose() * row.terms.r;
  }
  const Eigen::LDLT<Eigen::Matrix3d> solve(hyy);
  const Eigen::Matrix<double, 3, Eigen::Dynamic> point_by_readout = solve.solve(hyt);
  const Vector3d step = solve.solve(gy);
  equations->normal -= hyt.transpose() * point_by_readout;
  for (const ReadoutRow& row : rows) {
    equations->normal(row.camera, row.camera) += row.weight * row.by_readout.squaredNorm();
    equations->gradient(row.camera) += row.weight * row.by_readout.dot(row.terms.r - row.terms.jy * step);
    Eigen::Matrix<double, 2, Eigen::Dynamic> left = -row.terms.jy * point_by_readout;
    left.col(row.camera) += row.by_readout;
    equations->with_poses.middleRows<6>(row.pose) += row.weight * row.terms.jp.transpose() * left;
  }
}

}  // namespace

std::vector<ReadoutEstimate> EstimateReadout(const LocalizeInput& input, const Reconstruction& r, int threads,
                                             const CancelToken& cancel) {
  const BundleProblem& p = r.problem;
  const std::vector<Rate> rates = BodyRates(input, p);
  const auto n = static_cast<Eigen::Index>(input.cameras.size());
  ReadoutEquations equations{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n),
                             Eigen::MatrixXd::Zero(6 * static_cast<Eigen::Index>(p.poses.size()), n)};
  for (size_t i = 0; i < p.observations.size();) {
    std::vector<ReadoutRow> rows;
    for (const int point = p.observations[i].point; i < p.observations.size() && p.observations[i].point == point;
         ++i) {
      if (auto row = RowOf(input, r, rates, i)) rows.push_back(std::move(*row));
    }
    if (rows.size() > 1) AddPoint(rows, &equations);
  }
  const BundleCovariance covariance(p, threads, cancel);
  const Eigen::MatrixXd& w = equations.with_poses;
  const Eigen::MatrixXd normal = equations.normal - w.transpose() * covariance.Times(w);
  std::vector<ReadoutEstimate> estimates;
  for (Eigen::Index c = 0; c < n; ++c) {
    // Cameras are estimated one by one: they are rarely of one kind, and mostly one has the motion to show it.
    if (!(normal(c, c) > 0)) continue;
    ReadoutEstimate e;
    e.camera = static_cast<int>(c);
    e.change_s = -equations.gradient(c) / normal(c, c);
    e.sigma_s = 1 / std::sqrt(normal(c, c));
    e.readout_s = input.cameras[static_cast<size_t>(c)].readout_s + e.change_s;
    estimates.push_back(e);
  }
  return estimates;
}

}  // namespace trigpoint

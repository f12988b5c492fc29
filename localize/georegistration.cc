#include "localize/georegistration.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "calib/base/median.h"
#include "calib/geometry/alignment.h"

namespace trigpoint {
namespace {

using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;

Sim3d Moved(const Sim3d& s, const Vector7d& d) {
  return {s.scale + d(6), (ExpSO3(d.head<3>()) * s.rotation).normalized(), s.translation + d.segment<3>(3)};
}

// Rows of one observation: position (3), then heading, pitch, roll. Sigma 0 marks a row that is not observed.
struct Rows {
  Vector6d r = Vector6d::Zero();                                        // predicted - said
  Vector6d sigma = Vector6d::Zero();                                    // of what is said
  Eigen::Matrix<double, 6, 7> j = Eigen::Matrix<double, 6, 7>::Zero();  // d r / d global
  Matrix6d jo = Matrix6d::Zero();                                       // d r / d odom_from_rig
};

Rows Evaluate(const GeoObservation& o, const Sim3d& s) {
  Rows rows;
  const Eigen::Vector3d rotated = s.rotation * o.odom_from_rig.translation;
  const Eigen::Matrix3d rot = s.rotation.toRotationMatrix();
  if (o.has_position) {
    rows.r.head<3>() = s.scale * rotated + s.translation - o.position;
    rows.sigma.head<3>() << o.sigma_h_m, o.sigma_h_m, o.has_height ? o.sigma_v_m : 0;
    rows.j.topLeftCorner<3, 3>() = -s.scale * Skew(rotated);
    rows.j.block<3, 3>(0, 3).setIdentity();
    rows.j.block<3, 1>(0, 6) = rotated;
    rows.jo.topRightCorner<3, 3>() = s.scale * rot;
  }
  if (o.has_heading || o.has_tilt) {
    const Eigen::Quaterniond world_from_rig = s.rotation * o.odom_from_rig.rotation;
    const Attitude a = AttitudeOf(world_from_rig);
    // Looking straight up or down there is no heading: such a view says nothing here.
    if (std::cos(a.pitch_rad) > 0.05) {
      const Eigen::Matrix3d ja = AttitudeJacobian(world_from_rig);
      rows.r.tail<3>() << WrapAngle(a.heading_rad - o.attitude.heading_rad),
          WrapAngle(a.pitch_rad - o.attitude.pitch_rad), WrapAngle(a.roll_rad - o.attitude.roll_rad);
      rows.sigma.tail<3>() << (o.has_heading ? o.sigma_heading_rad : 0), (o.has_tilt ? o.sigma_tilt_rad : 0),
          (o.has_tilt ? o.sigma_tilt_rad : 0);
      rows.j.bottomLeftCorner<3, 3>() = ja;
      rows.jo.bottomLeftCorner<3, 3>() = ja * rot;
    }
  }
  return rows;
}

// Dynamic covariance scaling: evidence within the knee keeps all its weight, so that the covariance of a fit without
// outliers is that of least squares.
double RobustWeight(double s, double knee) { return s <= knee ? 1.0 : std::pow(2 * knee / (knee + s), 2); }

}  // namespace

std::vector<std::string> GeoRegistrationOptions::Check() const {
  std::vector<std::string> problems = CheckRanges(*this);
  if (use_gps != "never" && use_gps != "always" && use_gps != "auto") {
    problems.push_back("option use_gps is '" + use_gps + "', expected never, always or auto");
  }
  return problems;
}

GeoRegistration RegisterToEarth(const std::vector<GeoObservation>& obs, const Eigen::MatrixXd& odom_covariance,
                                double scale_prior, double scale_sigma, bool levelled,
                                const GeoRegistrationOptions& options) {
  GeoRegistration result;
  const size_t n = obs.size();
  result.weights.assign(n, 1);
  result.outlier.assign(n, false);
  result.residuals.assign(n, Eigen::Vector3d::Zero());
  if (n == 0) {
    result.reason = "no localized reference has a geotag";
    return result;
  }
  // Rows are whitened against geotag noise plus the places' own covariance; robust weights are of geotags.
  std::vector<double> w_position(n, 1), w_attitude(n, 1);
  const double tilt_sigma = (levelled ? 0.05 : options.tilt_sigma_deg) * kDegToRad;

  const bool heights =
      std::any_of(obs.begin(), obs.end(), [](const GeoObservation& o) { return o.has_position && o.has_height; });

  const auto prior = [&](const Sim3d& s, Matrix7d* h, Vector7d* g) {
    if (!heights) {
      Eigen::Matrix<double, 1, 7> j = Eigen::Matrix<double, 1, 7>::Zero();
      double r = 0;
      for (const GeoObservation& o : obs) {
        if (!o.has_position) continue;
        const Rows rows = Evaluate(o, s);
        j += rows.j.row(2);
        r += rows.r(2);
      }
      // Divided by their number on both sides: the mean has this sigma, however many there are.
      if (const double places = j(5); places > 0) {
        const double w = std::pow(1 / (places * kUnknownHeightSigma), 2);
        *h += w * j.transpose() * j;
        *g += w * j.transpose() * r;
      }
    }
    // Tilt of the odometry frame: the world's up seen in it, x and y.
    const Eigen::Matrix3d rot = s.rotation.toRotationMatrix();
    const Eigen::Vector3d up = rot.transpose() * Eigen::Vector3d::UnitZ();
    Eigen::Matrix<double, 2, 7> j = Eigen::Matrix<double, 2, 7>::Zero();
    j.leftCols<3>() = (rot.transpose() * Skew(Eigen::Vector3d::UnitZ())).topRows<2>();
    const double w = 1 / (tilt_sigma * tilt_sigma);
    *h += w * j.transpose() * j;
    *g += w * j.transpose() * up.head<2>();
    (*h)(6, 6) += 1 / (scale_sigma * scale_sigma);
    (*g)(6) += (s.scale - scale_prior) / (scale_sigma * scale_sigma);
  };

  // Robust cost with independent places: for choosing among first guesses.
  const auto score = [&](const Sim3d& s) {
    double cost = std::pow((s.scale - scale_prior) / scale_sigma, 2);
    for (const GeoObservation& o : obs) {
      const Rows rows = Evaluate(o, s);
      double sp = 0, sa = 0;
      for (int k = 0; k < 6; ++k) {
        if (rows.sigma(k) > 0) (k < 3 ? sp : sa) += std::pow(rows.r(k) / (rows.sigma(k) + (k < 3 ? 0.1 : 0.005)), 2);
      }
      cost += options.loss_chi2 * (std::log1p(sp / options.loss_chi2) + std::log1p(sa / options.loss_chi2));
    }
    return cost;
  };
  std::vector<Sim3d> guesses;
  for (size_t a = 0; a < n; ++a) {
    // One reference with its attitude says it all.
    if (obs[a].has_heading) {
      Attitude said = obs[a].attitude;
      Sim3d s;
      s.scale = scale_prior;
      if (obs[a].has_tilt) {
        s.rotation = WorldFromCamRotation(said) * obs[a].odom_from_rig.rotation.conjugate();
      } else {
        const double yaw = AttitudeOf(obs[a].odom_from_rig.rotation).heading_rad - said.heading_rad;
        s.rotation = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ());
      }
      s.translation = obs[a].position - s.scale * (s.rotation * obs[a].odom_from_rig.translation);
      guesses.push_back(s);
    }
    // Two positions give the yaw of a nearly level frame.
    for (size_t b = 0; b < a && n <= 200; ++b) {
      const Eigen::Vector3d od = obs[a].odom_from_rig.translation - obs[b].odom_from_rig.translation;
      const Eigen::Vector3d wd = obs[a].position - obs[b].position;
      if (od.head<2>().norm() < 0.5) continue;
      Sim3d s;
      s.scale = scale_prior;
      s.rotation = Eigen::AngleAxisd(std::atan2(wd.y(), wd.x()) - std::atan2(od.y(), od.x()), Eigen::Vector3d::UnitZ());
      s.translation = 0.5 * (obs[a].position + obs[b].position) -
                      s.rotation * (0.5 * (obs[a].odom_from_rig.translation + obs[b].odom_from_rig.translation));
      guesses.push_back(s);
    }
  }
  if (guesses.empty()) {
    result.reason = "one geotag without heading does not fix the run's direction: at least two are needed";
    return result;
  }
  Sim3d s = guesses.front();
  double best = score(s);
  for (const Sim3d& g : guesses) {
    const double c = score(g);
    if (c < best) best = c, s = g;
  }

  Eigen::MatrixXd weight_matrix;  // inverse covariance of all used rows
  std::vector<std::pair<size_t, int>> used;
  Eigen::MatrixXd jac;
  Matrix7d h;
  Eigen::MatrixXd jo_all;
  for (int it = 0; it < options.iterations; ++it) {
    result.iterations = it + 1;
    std::vector<Rows> rows;
    used.clear();
    for (size_t i = 0; i < n; ++i) {
      rows.push_back(Evaluate(obs[i], s));
      for (int k = 0; k < 6; ++k) {
        if (rows[i].sigma(k) > 0) used.emplace_back(i, k);
      }
    }
    const Eigen::Index m = static_cast<Eigen::Index>(used.size());
    jo_all = Eigen::MatrixXd::Zero(m, 6 * static_cast<Eigen::Index>(n));
    jac.resize(m, 7);
    Eigen::VectorXd r(m), variance(m);
    for (Eigen::Index k = 0; k < m; ++k) {
      const auto [i, row] = used[static_cast<size_t>(k)];
      jac.row(k) = rows[i].j.row(row);
      r(k) = rows[i].r(row);
      jo_all.block<1, 6>(k, 6 * static_cast<Eigen::Index>(i)) = rows[i].jo.row(row);
      const double w = row < 3 ? w_position[i] : w_attitude[i];
      variance(k) = rows[i].sigma(row) * rows[i].sigma(row) / std::max(w, 1e-6);
    }
    Eigen::MatrixXd covariance = jo_all * odom_covariance * jo_all.transpose();
    const Eigen::VectorXd own = covariance.diagonal();
    covariance.diagonal() += variance;
    weight_matrix = covariance.llt().solve(Eigen::MatrixXd::Identity(m, m));
    h = jac.transpose() * weight_matrix * jac;
    Vector7d g = jac.transpose() * (weight_matrix * r);
    prior(s, &h, &g);
    const Vector7d step = -h.ldlt().solve(g);
    if (!step.allFinite()) {
      result.reason = "the geotags do not fix the run's frame";
      return result;
    }
    s = Moved(s, step);
    // Weights from the residuals against each geotag's own noise plus the place's.
    for (size_t i = 0; i < n; ++i) {
      const Rows now = Evaluate(obs[i], s);
      double sp = 0, sa = 0;
      for (Eigen::Index k = 0; k < m; ++k) {
        if (used[static_cast<size_t>(k)].first != i) continue;
        const int row = used[static_cast<size_t>(k)].second;
        const double e2 = now.r(row) * now.r(row) / (now.sigma(row) * now.sigma(row) + own(k));
        (row < 3 ? sp : sa) += e2;
      }
      w_position[i] = RobustWeight(sp, options.loss_chi2);
      w_attitude[i] = RobustWeight(sa, options.loss_chi2);
      result.outlier[i] = sp > options.outlier_chi2;
      result.residuals[i] = -now.r.head<3>();
    }
    if (step.norm() < 1e-9) break;
  }
  if (!(s.scale > 0.1) || !(s.scale < 10)) {
    result.reason = "the geotags contradict the run's size";
    return result;
  }
  const Matrix7d inverse = h.ldlt().solve(Matrix7d::Identity());
  result.solved = true;
  result.world_from_odom = s;
  result.covariance = inverse;
  result.sensitivity = -inverse * jac.transpose() * weight_matrix * jo_all;
  result.weights = w_position;
  return result;
}

std::optional<std::string> OtherHeadings(const std::vector<GeoObservation>& observations) {
  constexpr size_t kLeast = 4;
  constexpr double kWrong = 20 * kDegToRad, kRight = 7 * kDegToRad;
  std::vector<Eigen::Vector3d> places, said;
  std::vector<double> sigmas, sigmas_rad;
  for (const GeoObservation& o : observations) {
    if (!o.has_position || !o.has_heading) continue;
    places.push_back(o.odom_from_rig.translation);
    said.push_back(o.position);
    sigmas.push_back(o.sigma_h_m);
    sigmas_rad.push_back(o.sigma_heading_rad);
  }
  if (said.size() < kLeast) return std::nullopt;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : said) mean += p / static_cast<double>(said.size());
  std::vector<double> reach;
  for (const Eigen::Vector3d& p : said) reach.push_back((p - mean).head<2>().norm());
  if (Median(reach) < std::max(2.0, 5 * Median(sigmas))) return std::nullopt;
  const Sim3d fit = AlignPoints(places, said, AlignmentKind::kYawTranslation);
  std::vector<double> off;
  for (size_t i = 0; i < said.size(); ++i) off.push_back((fit * places[i] - said[i]).head<2>().norm());
  // A map that does not fit the places says nothing of the headings.
  if (Median(off) > 0.2 * Median(reach)) return std::nullopt;
  struct Reading {
    const char* what;
    double sign, add;  // heading as meant = sign * as read + add
    double factor = 1;
  };
  constexpr Reading kReadings[] = {
      {"", 1, 0},
      {"counter-clockwise from north", -1, 0},
      {"counter-clockwise from east", -1, 0.5 * EIGEN_PI},
      {"clockwise from east", 1, 0.5 * EIGEN_PI},
      {"clockwise from south (as of what lies behind)", 1, EIGEN_PI},
      {"clockwise from west", 1, -0.5 * EIGEN_PI},
      {"in radians", 1, 0, kRadToDeg},
  };
  std::vector<double> errors;
  for (const Reading& reading : kReadings) {
    std::vector<double> wrong;
    for (const GeoObservation& o : observations) {
      if (!o.has_position || !o.has_heading) continue;
      const double is = AttitudeOf(fit.rotation * o.odom_from_rig.rotation).heading_rad;
      const double meant = reading.sign * reading.factor * o.attitude.heading_rad + reading.add;
      wrong.push_back(std::abs(WrapAngle(is - meant)));
    }
    errors.push_back(Median(std::move(wrong)));
  }
  const size_t best = static_cast<size_t>(std::min_element(errors.begin(), errors.end()) - errors.begin());
  if (errors[0] < std::max(kWrong, 3 * Median(sigmas_rad)) || best == 0 || errors[best] > kRight) return std::nullopt;
  return kReadings[best].what;
}

}  // namespace trigpoint

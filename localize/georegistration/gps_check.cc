#include "localize/georegistration/gps_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>

#include "calib/base/median.h"

namespace trigpoint {

namespace {

using Vector7d = Eigen::Matrix<double, 7, 1>;
using Complex = std::complex<double>;

// A GPS fix against the place of the antenna in the world.
struct Offset {
  Eigen::Vector3d arm;         // from the origin of the run's frame to the antenna, world axes, m
  Eigen::Vector3d difference;  // GPS - antenna, m
  double sigma_h_m = 0, sigma_v_m = 0;
};

std::vector<Offset> OffsetsOf(const BundleProblem& problem, const std::vector<GpsPlace>& gps, const Sim3d& fit) {
  std::vector<Offset> offsets;
  for (const GpsPlace& g : gps) {
    const Eigen::Vector3d place = fit * (problem.poses[static_cast<size_t>(g.pose)].Inverse() * g.arm_m);
    offsets.push_back({place - fit.translation, g.position - place, g.sigma_h_m, g.sigma_v_m});
  }
  return offsets;
}

// The turn and shift that lay the run's plan over GPS, with the least sum of distances.
struct Overlay {
  double turn_rad = 0;
  Complex shift_m;    // of the origin of the run's frame
  double misfit = 0;  // median distance that is left, in sigmas; 1 where GPS errs as stated
};

Overlay LayOver(const std::vector<Offset>& offsets, bool mirrored) {
  constexpr int kIterations = 20;
  constexpr double kMedianChi2 = 1.386;  // of two degrees of freedom
  std::vector<Complex> run, gps;
  for (const Offset& o : offsets) {
    const Complex place(o.arm.x(), o.arm.y());
    run.push_back(mirrored ? std::conj(place) : place);
    gps.push_back(place + Complex(o.difference.x(), o.difference.y()));
  }
  std::vector<double> weights(offsets.size(), 1), chi2(offsets.size());
  Overlay found;
  for (int it = 0; it < kIterations; ++it) {
    double sum = 0;
    Complex run_middle, gps_middle, turn;
    for (size_t i = 0; i < run.size(); ++i) {
      sum += weights[i], run_middle += weights[i] * run[i], gps_middle += weights[i] * gps[i];
    }
    run_middle /= sum, gps_middle /= sum;
    for (size_t i = 0; i < run.size(); ++i) {
      turn += weights[i] * std::conj(run[i] - run_middle) * (gps[i] - gps_middle);
    }
    found.turn_rad = std::arg(turn);
    found.shift_m = gps_middle - std::polar(1.0, found.turn_rad) * run_middle;
    for (size_t i = 0; i < run.size(); ++i) {
      const Complex left = gps[i] - found.shift_m - std::polar(1.0, found.turn_rad) * run[i];
      weights[i] = 1 / std::max(std::abs(left), offsets[i].sigma_h_m);
      chi2[i] = std::norm(left) / std::pow(offsets[i].sigma_h_m, 2);
    }
  }
  found.misfit = std::sqrt(Median(std::move(chi2)) / kMedianChi2);
  return found;
}

template <typename Value>
double MedianOf(const std::vector<Offset>& offsets, const Value& value) {
  std::vector<double> values;
  for (const Offset& o : offsets) values.push_back(value(o));
  return Median(std::move(values));
}

void Say(const std::string& text, GeoRegistration* geo) { geo->reason += (geo->reason.empty() ? "" : "; ") + text; }

}  // namespace

void HeedGps(const BundleProblem& problem, const std::vector<GpsPlace>& gps, GeoRegistration* geo) {
  constexpr double kSigmas = 4, kLeast_m = 10, kHeightSigmas = 5, kLeastHeight_m = 15, kMostTurn_rad = 0.3;
  if (!geo->solved || gps.size() < kLeastGpsFixes) return;
  const std::vector<Offset> offsets = OffsetsOf(problem, gps, geo->world_from_odom);
  const double far = MedianOf(offsets, [](const Offset& o) { return o.difference.head<2>().norm(); });
  const double up = MedianOf(offsets, [](const Offset& o) { return o.difference.z(); });
  // The run's positions have the fit's own uncertainty, too.
  const Eigen::Matrix3d own = geo->covariance.block<3, 3>(3, 3);
  const double sigma_h =
      std::hypot(MedianOf(offsets, [](const Offset& o) { return o.sigma_h_m; }), std::sqrt(own(0, 0) + own(1, 1)));
  const double sigma_v =
      std::hypot(MedianOf(offsets, [](const Offset& o) { return o.sigma_v_m; }), std::sqrt(own(2, 2)));
  const bool is_far = far > std::max(kLeast_m, kSigmas * sigma_h);
  if (!is_far && std::abs(up) <= std::max(kLeastHeight_m, kHeightSigmas * sigma_v)) return;
  const Overlay over = LayOver(offsets, false);
  Vector7d change;
  change << 0, 0, over.turn_rad, over.shift_m.real(), over.shift_m.imag(), up, 0;
  geo->covariance += change * change.transpose();
  // A covariance describes small turns only.
  geo->solved = std::abs(over.turn_rad) < kMostTurn_rad;
  Say(fmt::format(
          "GPS lies {:.0f} m {} the run as the geotags place it (GPS, 1 sigma: {:.1f} m): one of the two is wrong, and "
          "{}; check positions, headings, heights (above the ellipsoid) and origin",
          is_far ? far : std::abs(up),
          is_far   ? "from"
          : up > 0 ? "above"
                   : "below",
          is_far ? sigma_h : sigma_v,
          geo->solved ? "the difference is part of the result's sigmas" : "they differ in the run's direction, too"),
      geo);
}

void CheckGpsShape(const BundleProblem& problem, const std::vector<GpsPlace>& gps, GeoRegistration* geo) {
  constexpr double kFits = 2, kContradicts = 5;  // misfits
  if (!geo->solved || gps.size() < kLeastGpsFixes) return;
  const std::vector<Offset> offsets = OffsetsOf(problem, gps, geo->world_from_odom);
  const double misfit = LayOver(offsets, false).misfit;
  if (misfit < kFits) return;
  const bool mirrored = LayOver(offsets, true).misfit < misfit / kFits;
  geo->solved = !mirrored && misfit < kContradicts;
  geo->covariance *= misfit * misfit;
  Say(fmt::format("{} GPS fixes contradict the run's shape, by {:.1f} times their sigmas in the median; {}", gps.size(),
                  misfit,
                  mirrored      ? "they fit if east and west are exchanged; check the longitudes and odometry"
                  : geo->solved ? "the result's sigmas are multiplied by that factor"
                                : "check latitude, longitude, sigmas, time and odometry"),
      geo);
}

}  // namespace trigpoint

#include "localize/georegistration/gps_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <optional>

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

Overlay LayOver(const std::vector<Offset>& offsets) {
  constexpr int kIterations = 20;
  constexpr double kMedianChi2 = 1.386;  // of two degrees of freedom
  std::vector<Complex> run, gps;
  for (const Offset& o : offsets) {
    const Complex place(o.arm.x(), o.arm.y());
    run.push_back(place);
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
  const Overlay over = LayOver(offsets);
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

namespace {

// GPS errors wander: a Gauss-Markov process of first order, seen at times that are far enough apart for the noise of
// single fixes not to matter.
struct Track {
  double wander_s = 0;
  std::vector<double> seconds, sigma_m;
  std::vector<Complex> run, gps;  // places of the antenna in plan

  Track Chosen(const std::vector<size_t>& which) const {
    Track chosen{wander_s, {}, {}, {}, {}};
    for (const size_t i : which) {
      chosen.seconds.push_back(seconds[i]), chosen.sigma_m.push_back(sigma_m[i]);
      chosen.run.push_back(run[i]), chosen.gps.push_back(gps[i]);
    }
    return chosen;
  }
  // Where the run is at a time within its own.
  Complex RunAt(double second) const {
    const auto after = std::upper_bound(seconds.begin() + 1, seconds.end() - 1, second) - seconds.begin();
    const auto k = static_cast<size_t>(after);
    const double share = (second - seconds[k - 1]) / (seconds[k] - seconds[k - 1]);
    return (1 - share) * run[k - 1] + share * run[k];
  }
};

std::optional<Track> TrackOf(const std::vector<GpsPlace>& gps, const std::vector<Offset>& offsets, double wander_s) {
  Track track{wander_s, {}, {}, {}, {}};
  for (size_t i = 0; i < gps.size(); ++i) {
    const double second = 1e-9 * static_cast<double>(gps[i].stamp_ns - gps.front().stamp_ns);
    if (!track.seconds.empty() && second <= track.seconds.back()) continue;
    const Complex place(offsets[i].arm.x(), offsets[i].arm.y());
    track.seconds.push_back(second);
    track.sigma_m.push_back(offsets[i].sigma_h_m);
    track.run.push_back(place);
    track.gps.push_back(place + Complex(offsets[i].difference.x(), offsets[i].difference.y()));
  }
  if (track.seconds.size() < kLeastGpsFixes) return std::nullopt;
  return track;
}

// Differences between neighbours that do not depend on each other, each with a variance of 1.
template <typename Value, typename ValueAt>
std::vector<Value> Whitened(const Track& track, const ValueAt& value) {
  std::vector<Value> white;
  for (size_t i = 0; i < track.seconds.size(); ++i) {
    const Value now = value(i) / track.sigma_m[i];
    if (i == 0 || track.wander_s <= 0) {
      white.push_back(now);
      continue;
    }
    const double rho = std::exp(-(track.seconds[i] - track.seconds[i - 1]) / track.wander_s);
    white.push_back((now - rho * value(i - 1) / track.sigma_m[i - 1]) / std::sqrt(1 - rho * rho));
  }
  return white;
}

// What is left between run and GPS when the run is turned and shifted: chi-square, two degrees of freedom a fix less
// three. Single fixes count no more than four sigmas.
double Misfit(const Track& track) {
  constexpr int kIterations = 10;
  constexpr double kRobust = 2, kMost = 16;
  const std::vector<double> ones = Whitened<double>(track, [](size_t) { return 1.0; });
  const std::vector<Complex> run = Whitened<Complex>(track, [&](size_t i) { return track.run[i]; });
  const std::vector<Complex> gps = Whitened<Complex>(track, [&](size_t i) { return track.gps[i]; });
  std::vector<double> weights(ones.size(), 1);
  double chi2 = 0;
  for (int it = 0; it < kIterations; ++it) {
    double sum = 0;
    Complex run_middle, gps_middle, turn;
    for (size_t i = 0; i < ones.size(); ++i) {
      sum += weights[i] * ones[i] * ones[i];
      run_middle += weights[i] * ones[i] * run[i], gps_middle += weights[i] * ones[i] * gps[i];
    }
    run_middle /= sum, gps_middle /= sum;
    for (size_t i = 0; i < ones.size(); ++i) {
      turn += weights[i] * std::conj(run[i] - ones[i] * run_middle) * (gps[i] - ones[i] * gps_middle);
    }
    turn = std::polar(1.0, std::arg(turn));
    chi2 = 0;
    for (size_t i = 0; i < ones.size(); ++i) {
      const double left = std::abs(gps[i] - ones[i] * gps_middle - turn * (run[i] - ones[i] * run_middle));
      weights[i] = 1 / std::max(1.0, left / kRobust);
      chi2 += std::min(left * left, kMost);
    }
  }
  return chi2;
}

// Another reading of GPS is a thousand times as likely as the stated one: with that factor, a true reading is rejected
// in at most one of a thousand runs (Markov's inequality), in one of a hundred over ten offsets that can be told apart.
const double kMoreLikely = 2 * std::log(1000.0);

// Seconds to be added to the stamps of GPS; nothing: none is that much more likely than 0.
std::optional<double> OtherTime(const Track& track) {
  constexpr double kMost_s = 20, kStep_s = 0.5, kShare = 1.0 / 3;  // of the run's time: the rest has to show it
  const double last = track.seconds.back();
  const int steps = static_cast<int>(std::min(kMost_s, kShare * last) / kStep_s);
  std::optional<double> best;
  double most = kMoreLikely;
  for (int k = -steps; k <= steps; ++k) {
    const double offset = k * kStep_s;
    std::vector<size_t> both;  // fixes with a place on the run at either time
    for (size_t i = 0; i < track.seconds.size(); ++i) {
      if (track.seconds[i] + offset >= 0 && track.seconds[i] + offset <= last) both.push_back(i);
    }
    if (both.size() < kLeastGpsFixes) continue;
    const Track stated = track.Chosen(both);
    Track moved = stated;
    for (size_t i = 0; i < both.size(); ++i) moved.run[i] = track.RunAt(moved.seconds[i] + offset);
    const double gain = Misfit(stated) - Misfit(moved);
    if (gain > most) most = gain, best = offset;
  }
  return best;
}

// Why GPS cannot be what it is taken for; empty: nothing speaks against it.
std::string OtherReading(const std::vector<GpsPlace>& gps, const std::vector<Offset>& offsets, double wander_s) {
  constexpr double kApart = 1.0 / 6;  // of the time in which GPS errors wander
  const std::optional<Track> all = TrackOf(gps, offsets, wander_s);
  if (!all) return "";
  std::vector<size_t> apart;
  for (size_t i = 0; i < all->seconds.size(); ++i) {
    if (apart.empty() || all->seconds[i] - all->seconds[apart.back()] >= kApart * wander_s) apart.push_back(i);
  }
  if (apart.size() < kLeastGpsFixes) return "";
  const Track track = all->Chosen(apart);
  Track mirrored = track;
  for (Complex& place : mirrored.run) place = std::conj(place);
  if (Misfit(track) - Misfit(mirrored) > kMoreLikely) {
    return "they fit if east and west are exchanged; check the longitudes and odometry";
  }
  if (const std::optional<double> offset = OtherTime(track)) {
    return fmt::format("they fit with about {:+.1f} s added to their times; check gps.time_offset_s in run.yaml",
                       *offset);
  }
  return "";
}

}  // namespace

void CheckGpsShape(const BundleProblem& problem, const std::vector<GpsPlace>& gps, double wander_s,
                   GeoRegistration* geo) {
  constexpr double kFits = 2, kContradicts = 5;  // misfits
  if (!geo->solved || gps.size() < kLeastGpsFixes) return;
  const std::vector<Offset> offsets = OffsetsOf(problem, gps, geo->world_from_odom);
  const double misfit = LayOver(offsets).misfit;
  const std::string other = OtherReading(gps, offsets, wander_s);
  if (misfit < kFits && other.empty()) return;
  geo->solved = other.empty() && misfit < kContradicts;
  geo->covariance *= std::max(1.0, misfit * misfit);
  Say(fmt::format("{} GPS fixes contradict the run's shape, by {:.1f} times their sigmas in the median; {}", gps.size(),
                  misfit,
                  !other.empty() ? other
                  : geo->solved  ? "the result's sigmas are multiplied by that factor"
                                 : "check latitude, longitude, sigmas, time and odometry"),
      geo);
}

}  // namespace trigpoint

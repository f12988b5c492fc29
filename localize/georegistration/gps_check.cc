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
using Matrix7d = Eigen::Matrix<double, 7, 7>;
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
  found.misfit = SigmaRatio(std::move(chi2), 2);
  return found;
}

template <typename Value>
double MedianOf(const std::vector<Offset>& offsets, const Value& value) {
  std::vector<double> values;
  for (const Offset& o : offsets) values.push_back(value(o));
  return Median(std::move(values));
}

// RMS distance of the run's places from their middle, in the plane.
double ExtentOf(const std::vector<Offset>& offsets) {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const Offset& o : offsets) middle += o.arm.head<2>() / static_cast<double>(offsets.size());
  double squares = 0;
  for (const Offset& o : offsets) squares += (o.arm.head<2>() - middle).squaredNorm();
  return std::sqrt(squares / static_cast<double>(offsets.size()));
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
  Overlay over;  // stays zero where only heights differ
  if (is_far) over = LayOver(offsets);
  if (is_far && std::abs(over.turn_rad) < kSigmas * sigma_h / ExtentOf(offsets)) {  // a turn by chance
    over.turn_rad = 0;
    over.shift_m = {MedianOf(offsets, [](const Offset& o) { return o.difference.x(); }),
                    MedianOf(offsets, [](const Offset& o) { return o.difference.y(); })};
  }
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

// The run laid over GPS: turned and shifted.
struct Fit {
  double chi2 =
      0;  // what is left; two degrees of freedom a fix less three. Single fixes count no more than four sigmas
  double turn_rad = 0;
  Complex shift_m;  // of the origin of the run's frame
};

Fit FitTrack(const Track& track) {
  constexpr int kIterations = 10;
  constexpr double kRobust = 2, kMost = 16;
  const std::vector<double> ones = Whitened<double>(track, [](size_t) { return 1.0; });
  const std::vector<Complex> run = Whitened<Complex>(track, [&](size_t i) { return track.run[i]; });
  const std::vector<Complex> gps = Whitened<Complex>(track, [&](size_t i) { return track.gps[i]; });
  std::vector<double> weights(ones.size(), 1);
  Fit fit;
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
    fit = {0, std::arg(turn), gps_middle - turn * run_middle};
    for (size_t i = 0; i < ones.size(); ++i) {
      const double left = std::abs(gps[i] - ones[i] * gps_middle - turn * (run[i] - ones[i] * run_middle));
      weights[i] = 1 / std::max(1.0, left / kRobust);
      fit.chi2 += std::min(left * left, kMost);
    }
  }
  return fit;
}

// Another reading of GPS is a thousand times as likely as the stated one: with that factor, a true reading is rejected
// in at most one of a thousand runs (Markov's inequality), in one of a hundred over ten offsets that can be told apart.
const double kMoreLikely = 2 * std::log(1000.0);

// GPS with a time added to its stamps, against the stamps as they are, both by the fixes that have a place on the run
// at either time.
struct OtherClock {
  double offset_s = 0;
  double gain = 0;  // of chi-square
  double turn_rad = 0;
  Complex shift_m;  // both: how it would move the run
};

constexpr double kClockStep_s = 0.5;
constexpr int kClockSteps = 40;  // to each side

// `whole`: all fixes, by which the run is known at other times. Between the few that tell something new it bends.
std::vector<OtherClock> OtherClocks(const Track& track, const Track& whole) {
  constexpr double kShare = 1.0 / 3;  // of the run's time: the rest has to show it
  const double last = whole.seconds.back();
  const int steps = std::min(kClockSteps, static_cast<int>(kShare * last / kClockStep_s));
  std::vector<OtherClock> clocks;
  for (int k = -steps; k <= steps; ++k) {
    const double offset = k * kClockStep_s;
    std::vector<size_t> both;
    for (size_t i = 0; i < track.seconds.size(); ++i) {
      if (track.seconds[i] + offset >= 0 && track.seconds[i] + offset <= last) both.push_back(i);
    }
    if (both.size() < kLeastGpsFixes) continue;
    const Track stated = track.Chosen(both);
    Track moved = stated;
    for (size_t i = 0; i < both.size(); ++i) moved.run[i] = whole.RunAt(moved.seconds[i] + offset);
    const Fit as_stated = FitTrack(stated), as_moved = FitTrack(moved);
    clocks.push_back({offset, as_stated.chi2 - as_moved.chi2, as_moved.turn_rad - as_stated.turn_rad,
                      as_moved.shift_m - as_stated.shift_m});
  }
  return clocks;
}

// The fixes that say something new: errors that wander are alike in neighbours.
std::optional<Track> TellingTrack(const Track& all) {
  constexpr double kApart = 1.0 / 6;  // of the time in which GPS errors wander
  std::vector<size_t> apart;
  for (size_t i = 0; i < all.seconds.size(); ++i) {
    if (apart.empty() || all.seconds[i] - all.seconds[apart.back()] >= kApart * all.wander_s) apart.push_back(i);
  }
  if (apart.size() < kLeastGpsFixes) return std::nullopt;
  return all.Chosen(apart);
}

// Why GPS cannot be what it is taken for: the reading that explains it best. Empty: nothing speaks against it.
std::string OtherReading(const Track& track, const std::vector<OtherClock>& clocks) {
  Track mirrored = track;
  for (Complex& place : mirrored.run) place = std::conj(place);
  const double mirror_gain = FitTrack(track).chi2 - FitTrack(mirrored).chi2;
  const auto best = std::max_element(clocks.begin(), clocks.end(),
                                     [](const OtherClock& a, const OtherClock& b) { return a.gain < b.gain; });
  const double clock_gain = best == clocks.end() ? 0 : best->gain;
  if (std::max(mirror_gain, clock_gain) <= kMoreLikely) return "";
  if (mirror_gain > clock_gain) return "they fit if east and west are exchanged; check the longitudes and odometry";
  return fmt::format("they fit with about {:+.1f} s added to their times; check gps.time_offset_s in run.yaml",
                     best->offset_s);
}

// Of a run that is too short to be tried at other times: a second moves it by its mean velocity.
std::vector<OtherClock> AtMeanVelocity(const std::vector<GpsPlace>& gps, const std::vector<Offset>& offsets) {
  const double seconds = 1e-9 * static_cast<double>(gps.back().stamp_ns - gps.front().stamp_ns);
  if (seconds <= 0) return {};
  const Eigen::Vector3d velocity = (offsets.back().arm - offsets.front().arm) / seconds;
  return {{1, 0, 0, Complex(velocity.x(), velocity.y())}};
}

// What the clock of GPS leaves open of the run's place, as GeoRegistration's covariance: the mean over the offsets that
// GPS does not exclude. `doubt`: the probability that the clock is wrong, by any of them.
Matrix7d OpenClock(const std::vector<OtherClock>& clocks, double doubt) {
  Matrix7d open = Matrix7d::Zero();
  if (clocks.empty()) return open;
  const double step = doubt / (2 * kClockSteps);
  double all = 1 - doubt;
  for (int k = -kClockSteps; k <= kClockSteps; ++k) {
    if (k == 0) continue;
    const double offset = k * kClockStep_s;
    // Beyond what a short run can be tried at, the last one tried tells.
    const OtherClock& clock = *std::min_element(clocks.begin(), clocks.end(), [&](const auto& a, const auto& b) {
      return std::pair(a.offset_s == 0, std::abs(a.offset_s - offset)) <
             std::pair(b.offset_s == 0, std::abs(b.offset_s - offset));
    });
    const double farther = clock.offset_s == 0 ? 0 : offset / clock.offset_s;
    const double likely = step * std::exp(0.5 * clock.gain);
    Vector7d change;
    change << 0, 0, clock.turn_rad, clock.shift_m.real(), clock.shift_m.imag(), 0, 0;
    open += likely * farther * farther * change * change.transpose();
    all += likely;
  }
  return open / all;
}

// How far a covariance of the fit reaches in the plan of a run, m: RMS over the places of the antenna.
double ReachOf(const Matrix7d& covariance, const std::vector<Offset>& offsets) {
  double sum = 0;
  for (const Offset& o : offsets) {
    Eigen::Matrix<double, 2, 3> by;  // turn, shift
    by << -o.arm.y(), 1, 0, o.arm.x(), 0, 1;
    sum += (by * covariance.block<3, 3>(2, 2) * by.transpose()).trace();
  }
  return std::sqrt(sum / static_cast<double>(offsets.size()));
}

void AddOpenClock(const Matrix7d& open, double doubt, const std::vector<Offset>& offsets, GeoRegistration* geo) {
  const double before = ReachOf(geo->covariance, offsets), clock = ReachOf(open, offsets);
  geo->covariance += open;
  if (clock < before) return;
  Say(fmt::format(
          "the shape of the run does not show whether the clocks of GPS and images agree; an offset moves the run "
          "along its path. One is assumed with a probability of {:g}: it adds {:.1f} m to the horizontal sigma, all "
          "other errors {:.1f} m. If the clocks are synchronised, set localize.geo.gps_clock_doubt to 0",
          doubt, clock, before),
      geo);
}

}  // namespace

void CheckGpsShape(const BundleProblem& problem, const std::vector<GpsPlace>& gps,
                   const GeoRegistrationOptions& options, bool alone, GeoRegistration* geo) {
  constexpr double kFits = 2, kContradicts = 5;  // misfits
  if (!geo->solved || gps.size() < kLeastGpsFixes) return;
  const std::vector<Offset> offsets = OffsetsOf(problem, gps, geo->world_from_odom);
  const double misfit = LayOver(offsets).misfit;
  std::string other;
  std::vector<OtherClock> clocks;
  const std::optional<Track> whole = TrackOf(gps, offsets, options.gps_correlation_s);
  if (const std::optional<Track> track = whole ? TellingTrack(*whole) : std::nullopt) {
    clocks = OtherClocks(*track, *whole);
    other = OtherReading(*track, clocks);
  }
  if (alone && other.empty()) {
    if (clocks.size() < 2) clocks = AtMeanVelocity(gps, offsets);
    AddOpenClock(OpenClock(clocks, options.gps_clock_doubt), options.gps_clock_doubt, offsets, geo);
  }
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

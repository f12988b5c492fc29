#include "localize/reconstruct/odometry_clock.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "calib/base/median.h"
#include "calib/geo/geodetic.h"

namespace trigpoint {
namespace {

constexpr size_t kLeastTurns = 8;
constexpr int64_t kGap_ns = 2'000'000'000;                 // of odometry, that is interpolated
constexpr double kCoarse_s = 0.1, kFine = 10;              // between offsets tried; parts of it close to the best one
constexpr double kLeastCovered = 0.6;                      // share of the turns that odometry covers at an offset
constexpr double kLeastNoise_rad = 0.3 * kDegToRad;        // calibration, rolling shutter and the like
constexpr double kMedianOfChi3 = 1.538;                    // of the length of three unit normal deviates
constexpr double kMostChi2 = 12;                           // of one turn
constexpr double kSignificantChi2 = 25, kAllowedChi2 = 9;  // against the best offset; of three sigma
constexpr double kLeastOffset_s = 0.05;
constexpr double kClearlyBetter = 2;  // times the median difference at the best offset

int64_t FirstOf(const std::vector<MeasuredTurn>& turns) {
  int64_t first = turns.front().a_ns;
  for (const MeasuredTurn& turn : turns) first = std::min({first, turn.a_ns, turn.b_ns});
  return first;
}

// Differences of rotation at an offset, of the turns that odometry covers; none where these are too few.
std::vector<double> DifferencesAt(const Trajectory& odometry, const std::vector<MeasuredTurn>& turns, double offset_s,
                                  double rate = 0) {
  const int64_t first_ns = FirstOf(turns);
  // Of odometry, whose stamps get offset and rate, at an image's time.
  const auto stamp = [&](int64_t image_ns) {
    const double since_s = 1e-9 * static_cast<double>(image_ns - first_ns);
    return first_ns + std::llround(1e9 * (since_s - offset_s) / (1 + rate));
  };
  std::vector<double> off;
  for (const MeasuredTurn& turn : turns) {
    const auto a = odometry.At(stamp(turn.a_ns), kGap_ns), b = odometry.At(stamp(turn.b_ns), kGap_ns);
    if (!a || !b) continue;
    const Eigen::Quaterniond b_from_a =
        turn.sensor_from_body * b->rotation.conjugate() * a->rotation * turn.sensor_from_body.conjugate();
    off.push_back(b_from_a.angularDistance(turn.b_from_a));
  }
  const double least = std::max<double>(kLeastTurns, kLeastCovered * static_cast<double>(turns.size()));
  return static_cast<double>(off.size()) < least ? std::vector<double>() : off;
}

// Chi-square of the turns at an offset, as of `independent` ones.
double Chi2Of(const std::vector<double>& off, double noise_rad, size_t independent) {
  double sum = 0;
  for (const double angle : off) sum += std::min(kMostChi2, std::pow(angle / noise_rad, 2));
  return sum * static_cast<double>(independent) / static_cast<double>(off.size());
}

// Turns that share images share errors: of n images, at most n - 1 turns are independent.
size_t IndependentOf(const std::vector<MeasuredTurn>& turns) {
  std::set<int64_t> images;
  for (const MeasuredTurn& turn : turns) images.insert({turn.a_ns, turn.b_ns});
  return std::min(turns.size(), images.size() - 1);
}

// Median time between poses, s.
double StepOf(const Trajectory& odometry) {
  std::vector<double> steps;
  for (size_t k = 1; k < odometry.poses.size(); ++k) {
    steps.push_back(1e-9 * static_cast<double>(odometry.poses[k].stamp_ns - odometry.poses[k - 1].stamp_ns));
  }
  return Median(std::move(steps));
}

struct Tried {
  double offset_s = 0;
  std::vector<double> off;
  double rate = 0;
};

// A clock that runs at another rate, where the turns agree far better with it than with `near`.
std::optional<Tried> FindRate(const Trajectory& odometry, const std::vector<MeasuredTurn>& turns, double most_s,
                              const std::vector<double>& near) {
  constexpr int kRates = 10;
  constexpr double kRateStep = 0.005;
  const auto best_of = [](const Tried& a, const Tried& b) { return Median(a.off) < Median(b.off); };
  std::vector<Tried> tried;
  const int steps = static_cast<int>(most_s / kCoarse_s);
  for (int r = -kRates; r <= kRates; ++r) {
    for (int k = -steps; k <= steps && r != 0; ++k) {
      Tried t{k * kCoarse_s, DifferencesAt(odometry, turns, k * kCoarse_s, r * kRateStep), r * kRateStep};
      if (!t.off.empty()) tried.push_back(std::move(t));
    }
  }
  if (tried.empty() || near.empty()) return std::nullopt;
  Tried best = *std::min_element(tried.begin(), tried.end(), best_of);
  // What fits ever better up to the last one tried is no rate: a lens of another focal length does so.
  if (std::abs(best.rate) > (kRates - 0.5) * kRateStep) return std::nullopt;
  const double noise = std::max(kLeastNoise_rad, Median(best.off) / kMedianOfChi3);
  const size_t independent = IndependentOf(turns);
  const bool far_better = Chi2Of(near, noise, independent) > Chi2Of(best.off, noise, independent) + kSignificantChi2;
  if (!far_better || !(Median(near) > kClearlyBetter * Median(best.off))) return std::nullopt;
  return best;
}

// The one with the least median; for a tie the smaller offset.
const Tried* BestOf(const std::vector<Tried>& tried) {
  const Tried* best = nullptr;
  double least = 0;
  for (const Tried& t : tried) {
    const double median = Median(t.off);
    if (best != nullptr && (median > least || (median == least && std::abs(t.offset_s) > std::abs(best->offset_s)))) {
      continue;
    }
    best = &t, least = median;
  }
  return best;
}

}  // namespace

std::optional<OdometryClock> FindOdometryClock(const Trajectory& odometry, const std::vector<MeasuredTurn>& turns,
                                               double most_s) {
  if (turns.size() < kLeastTurns || odometry.poses.size() < 2) return std::nullopt;
  std::vector<Tried> tried;
  const auto attempt = [&](double offset_s) {
    Tried t{offset_s, DifferencesAt(odometry, turns, offset_s)};
    if (!t.off.empty()) tried.push_back(std::move(t));
  };
  const int steps = static_cast<int>(most_s / kCoarse_s);
  for (int k = -steps; k <= steps; ++k) attempt(k * kCoarse_s);
  if (tried.empty()) return std::nullopt;
  const double noise = std::max(kLeastNoise_rad, Median(BestOf(tried)->off) / kMedianOfChi3);
  const size_t independent = IndependentOf(turns);
  const auto chi2 = [&](const Tried& t) { return Chi2Of(t.off, noise, independent); };
  const auto least = [&] {
    return *std::min_element(tried.begin(), tried.end(),
                             [&](const Tried& a, const Tried& b) { return chi2(a) < chi2(b); });
  };
  const double around = least().offset_s;
  for (int k = -static_cast<int>(kFine); k <= static_cast<int>(kFine); ++k) attempt(around + k * kCoarse_s / kFine);
  const Tried best = least();
  OdometryClock clock;
  clock.offset_s = best.offset_s;
  clock.off_after_rad = Median(best.off);
  // Three sigma reach as far as any offset that the turns allow, wherever it lies.
  clock.sigma_s = kCoarse_s / kFine / 3;
  for (const Tried& t : tried) {
    if (chi2(t) < chi2(best) + kAllowedChi2) {
      clock.sigma_s = std::max(clock.sigma_s, std::abs(t.offset_s - best.offset_s) / 3);
    }
  }
  // How the body turns within a step of odometry is not known: an offset is no more certain than the step allows.
  const double step_s = StepOf(odometry);
  clock.sigma_s = std::hypot(clock.sigma_s, step_s / std::sqrt(12.0));
  const Tried none{0, DifferencesAt(odometry, turns, 0)};
  clock.off_before_rad = none.off.empty() ? M_PI : Median(none.off);
  clock.agrees = std::abs(clock.offset_s) <= std::max(kLeastOffset_s, 3 * clock.sigma_s);
  // Between its poses odometry is interpolated, which halves its noise. The clock as stated is therefore judged by the
  // best of the offsets 0 and half a step either way.
  Tried near = none;
  for (const double half_s : {-0.5 * step_s, 0.5 * step_s}) {
    Tried t{half_s, DifferencesAt(odometry, turns, half_s)};
    if (near.off.empty() || (!t.off.empty() && Median(t.off) < Median(near.off))) near = std::move(t);
  }
  clock.significant = !clock.agrees && (near.off.empty() || (Median(near.off) > kClearlyBetter * clock.off_after_rad &&
                                                             chi2(near) > chi2(best) + kSignificantChi2));
  if (clock.agrees) return clock;
  if (const auto other = FindRate(odometry, turns, most_s, clock.significant ? best.off : near.off)) {
    clock.offset_s = other->offset_s, clock.rate = other->rate;
    clock.off_after_rad = Median(other->off);
    clock.significant = true;
  }
  return clock;
}

std::optional<ClockStep> FindClockStep(const Trajectory& odometry, std::vector<MeasuredTurn> turns, double most_s) {
  constexpr size_t kParts = 4;
  constexpr double kAgrees_rad = 2 * kDegToRad;  // in the median; odometry that turns otherwise has no right clock
  std::sort(turns.begin(), turns.end(),
            [](const MeasuredTurn& a, const MeasuredTurn& b) { return a.a_ns + a.b_ns < b.a_ns + b.b_ns; });
  for (size_t part = 1; part < kParts; ++part) {
    const auto split = turns.begin() + static_cast<std::ptrdiff_t>(part * turns.size() / kParts);
    const auto before = FindOdometryClock(odometry, {turns.begin(), split}, most_s);
    const auto after = FindOdometryClock(odometry, {split, turns.end()}, most_s);
    if (!before || !after || before->significant == after->significant) continue;
    const OdometryClock& off = before->significant ? *before : *after;
    const OdometryClock& right = before->significant ? *after : *before;
    // A part in which the clock is hardly known agrees with any.
    if (off.rate != 0 || off.off_after_rad > kAgrees_rad || !right.agrees || 3 * right.sigma_s > std::abs(off.offset_s))
      continue;
    return ClockStep{(split->a_ns + split->b_ns) / 2, after->significant, off};
  }
  return std::nullopt;
}

}  // namespace trigpoint

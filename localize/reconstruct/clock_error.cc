#include "localize/reconstruct/clock_error.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "calib/geo/geodetic.h"
#include "calib/geometry/so3.h"
#include "localize/reconstruct/believed_images.h"
#include "localize/reconstruct/odometry_parameters.h"

namespace trigpoint {
namespace {

// Odometry's scale; the body's turn and place in its cameras; how late all images are, s. Those of the candidates
// follow.
enum Parameter : Eigen::Index { kScale, kMount, kLate = kMount + 6, kCommon };

constexpr double kClockSigma_s = 10;               // wide: it is looked for
constexpr double kMountSigma_rad = 1 * kDegToRad;  // 1 sigma of what a calibration states
constexpr double kArmSigma_m = 0.05;               // of a camera among the others
constexpr double kBodySigma_m = 1;                 // of all: odometry is often of another point of the body
constexpr int kPlaces = 16;                        // along a run at which its clock may step

// Images that may be late by themselves: of a camera, which may stand elsewhere, too, or of a part of the run.
struct Some {
  std::vector<bool> poses;  // that are theirs
  int camera = -1;
  std::optional<int64_t> from_ns;
  Eigen::Index mount = 0, late = 0, end = 0;  // its parameters: its turn and place, if any, and how late they are
};

Rigid3d Small(const Vector6d& turn_and_shift) {
  return {Eigen::Quaterniond(ExpSO3(turn_and_shift.head<3>())), turn_and_shift.tail<3>()};
}

// The body's motion from the time that a pose was taken at to the stated one.
Rigid3d Since(const MotionRate& rate, double late_s) {
  return {Eigen::Quaterniond(ExpSO3(late_s * rate.omega)), late_s * rate.velocity};
}

// How the body moves at each pose; between its neighbours where odometry's own steps are too long to say.
std::vector<MotionRate> RatesOf(const LocalizeInput& input) {
  std::vector<MotionRate> rates = input.body_rates;
  rates.resize(input.pose_stamps.size());
  for (size_t k = 0; k < rates.size(); ++k) {
    const size_t a = k == 0 ? 0 : k - 1, b = std::min(k + 1, rates.size() - 1);
    if (rates[k].known || a == b) continue;
    rates[k] = RateBetween(input.odom_from_body[a], input.odom_from_body[b], input.odom_from_body[k],
                           1e-9 * static_cast<double>(input.pose_stamps[b] - input.pose_stamps[a]));
  }
  return rates;
}

// Poses all images of which are of one camera.
std::vector<bool> PosesOf(const LocalizeInput& input, int camera) {
  std::vector<bool> its(input.pose_stamps.size(), false);
  for (const FrameImage& image : input.images) its[static_cast<size_t>(image.pose)] = true;
  for (const FrameImage& image : input.images) {
    if (image.camera != camera) its[static_cast<size_t>(image.pose)] = false;
  }
  return its;
}

std::vector<Some> Candidates(const LocalizeInput& input) {
  std::vector<Some> candidates;
  for (int c = 0; c < std::ssize(input.cameras); ++c) {
    std::vector<bool> poses = PosesOf(input, c);
    const std::ptrdiff_t own = std::count(poses.begin(), poses.end(), true);
    if (own > 0 && own < std::ssize(poses)) candidates.push_back({std::move(poses), c, std::nullopt});
  }
  const size_t poses = input.pose_stamps.size();
  size_t before = 0;
  for (size_t place = 1; place < kPlaces; ++place) {
    const size_t from = place * poses / kPlaces;
    if (from == before) continue;
    before = from;
    Some later{std::vector<bool>(poses, false), -1, input.pose_stamps[from]};
    std::fill(later.poses.begin() + static_cast<std::ptrdiff_t>(from), later.poses.end(), true);
    candidates.push_back(std::move(later));
  }
  Eigen::Index next = kCommon;
  for (Some& some : candidates) {
    some.mount = next;
    some.late = next + (some.camera >= 0 ? 6 : 0);
    next = some.end = some.late + 1;
  }
  return candidates;
}

}  // namespace

double ClockError::Sigmas() const { return std::abs(late_s) / sigma_s; }

std::vector<ClockError> FindClockErrors(const LocalizeInput& input, const Reconstruction& r, int threads,
                                        const CancelToken& cancel) {
  const std::optional<BelievedImages> believed = BelieveImages(r, threads, cancel);
  const BundleProblem& p = believed ? believed->problem : r.problem;
  const std::vector<Some> candidates = Candidates(input);
  const std::vector<MotionRate> rates = RatesOf(input);
  const auto residual = [&](const PoseFactor& f, const Eigen::VectorXd& x) -> Vector6d {
    const auto a = static_cast<size_t>(f.a), b = static_cast<size_t>(f.b);
    Rigid3d moved_a = Small(x.segment<6>(kMount)), moved_b = moved_a;
    double late_a = x(kLate), late_b = x(kLate);
    for (const Some& some : candidates) {
      // Odometry may have jumped between the two: nothing of that is attributed to the clock.
      if (some.from_ns && some.poses[a] != some.poses[b]) continue;
      if (some.poses[a]) late_a += x(some.late);
      if (some.poses[b]) late_b += x(some.late);
      if (some.mount == some.late) continue;
      const Rigid3d moved = Small(x.segment<6>(some.mount));
      if (some.poses[a]) moved_a = moved * moved_a;
      if (some.poses[b]) moved_b = moved * moved_b;
    }
    const Rigid3d predicted = moved_a * p.poses[a] * p.poses[b].Inverse() * moved_b.Inverse();
    Rigid3d measured = Since(rates[a], late_a) * f.measured * Since(rates[b], late_b).Inverse();
    measured.translation *= 1 + x(kScale);
    return f.sqrt_info * predicted.Minus(measured);
  };
  Eigen::VectorXd sigmas =
      Eigen::VectorXd::Constant(candidates.empty() ? kCommon : candidates.back().end, kClockSigma_s);
  const auto set_mount = [&](Eigen::Index at, double arm_sigma_m) {
    sigmas.segment<3>(at).setConstant(kMountSigma_rad);
    sigmas.segment<3>(at + 3).setConstant(arm_sigma_m);
  };
  sigmas(kScale) = input.scale_sigma;
  set_mount(kMount, kBodySigma_m);
  for (const Some& some : candidates) {
    if (some.mount < some.late) set_mount(some.mount, kArmSigma_m);
  }
  const OdometryParameters parameters(p, residual, sigmas, threads, cancel);
  std::vector<Eigen::Index> common(kCommon);
  std::iota(common.begin(), common.end(), 0);
  std::vector<ClockError> errors;
  const auto estimate = [&](const std::vector<Eigen::Index>& asked, int camera, std::optional<int64_t> from_ns) {
    const ParameterEstimate e = parameters.Estimate(asked);
    const Eigen::Index last = std::ssize(asked) - 1;
    errors.push_back({e.value(last), std::sqrt(e.covariance(last, last)), camera, from_ns});
  };
  estimate(common, -1, std::nullopt);
  for (const Some& some : candidates) {
    std::vector<Eigen::Index> asked = common;
    for (Eigen::Index k = some.mount; k < some.end; ++k) asked.push_back(k);
    estimate(asked, some.camera, some.from_ns);
  }
  return errors;
}

}  // namespace trigpoint

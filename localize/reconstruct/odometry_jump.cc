#include "localize/reconstruct/odometry_jump.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "calib/estimation/bundle_terms.h"
#include "calib/estimation/ransac.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/bearing.h"
#include "calib/geometry/nearest_to_rays.h"
#include "localize/reconstruct/believed_images.h"
#include "localize/reconstruct/reconstruct.h"

namespace trigpoint {
namespace {

constexpr double kFits_rad = 0.4 * kDegToRad;  // a pixel and a half of a usual camera, and the points' own noise
constexpr int kLeastPoints = 30;
constexpr int kWindow = 10;  // moments on each side of a step that are looked at

struct Sight {
  int moment = 0;
  Eigen::Vector3d centre, ray;  // odometry's axes
};

// What the run's images see of each point, as tracks had it: observations that were left out included.
std::vector<std::vector<Sight>> SightsOf(const LocalizeInput& input, const Reconstruction& r) {
  const std::vector<int> moments = MomentsOfPoses(input);
  std::vector<std::vector<Sight>> sights(r.problem.points.size());
  for (size_t k = 0; k < r.problem.observations.size(); ++k) {
    if (r.image_of[k] < 0) continue;
    const BearingObservation& o = r.problem.observations[k];
    const Rigid3d odom_from_view =
        (r.problem.views[static_cast<size_t>(o.view)] * r.problem.poses[static_cast<size_t>(o.pose)]).Inverse();
    sights[static_cast<size_t>(o.point)].push_back({moments[static_cast<size_t>(o.pose)], odom_from_view.translation,
                                                    odom_from_view.rotation * o.ray.cast<double>().normalized()});
  }
  return sights;
}

// Steps from one moment to the next across which many points were left out. A point counts between two of its sights
// that follow each other soon: how odometry drifts until a place is seen again is no jump.
std::vector<int> SuspectSteps(const LocalizeInput& input, const Reconstruction& r) {
  constexpr double kMostLeft = 0.65;  // share that is still seen on both sides; a shift has to explain the others
  const std::vector<int> moments = MomentsOfPoses(input);
  const auto steps = static_cast<size_t>(moments.empty() ? 0 : moments.back());
  std::vector<int> all(steps), left(steps);
  struct Last {
    int seen = -1, active = -1;
  };
  std::vector<Last> last(r.problem.points.size());
  const auto add = [&](int moment, int* before, std::vector<int>* count) {
    if (*before >= 0 && std::abs(moment - *before) <= kWindow) {
      for (int m = std::min(*before, moment); m < std::max(*before, moment); ++m) ++(*count)[static_cast<size_t>(m)];
    }
    *before = moment;
  };
  for (size_t k = 0; k < r.problem.observations.size(); ++k) {
    if (r.image_of[k] < 0) continue;
    const BearingObservation& o = r.problem.observations[k];
    const int moment = moments[static_cast<size_t>(o.pose)];
    Last& of_point = last[static_cast<size_t>(o.point)];
    add(moment, &of_point.seen, &all);
    if (o.active) add(moment, &of_point.active, &left);
  }
  std::vector<int> suspect;
  for (size_t m = 0; m < steps; ++m) {
    if (all[m] >= kLeastPoints && left[m] < kMostLeft * all[m]) suspect.push_back(static_cast<int>(m));
  }
  return suspect;
}

// A point that one side places, as seen from the other: it lies along `ray` once `arm` is moved by `sign` x the shift.
struct Across {
  int point = 0;
  Eigen::Vector3d arm, ray;
  double sign = 1;
  double Off(const Eigen::Vector3d& shift) const { return AngleBetween(arm + sign * shift, ray); }
};

std::optional<Eigen::Vector3d> PlacedBy(const std::vector<Sight>& sights) {
  constexpr double kParallax_rad = 1.5 * kDegToRad;
  NearestToRays nearest;
  double parallax = 0;
  for (const Sight& s : sights) {
    nearest.Add(s.centre, s.ray);
    parallax = std::max(parallax, AngleBetween(s.ray, sights.front().ray));
  }
  if (sights.size() < 2 || parallax < kParallax_rad) return std::nullopt;
  const Eigen::Vector3d point = nearest.Point();
  const bool fits = std::all_of(sights.begin(), sights.end(),
                                [&](const Sight& s) { return AngleBetween(point - s.centre, s.ray) < kFits_rad; });
  return fits ? std::optional(point) : std::nullopt;
}

std::vector<Across> SeenAcross(const std::vector<std::vector<Sight>>& points, int step) {
  std::vector<Across> across;
  for (size_t j = 0; j < points.size(); ++j) {
    std::vector<Sight> sides[2];
    for (const Sight& s : points[j]) {
      if (s.moment > step - kWindow && s.moment <= step + kWindow) sides[s.moment > step ? 1 : 0].push_back(s);
    }
    if (sides[0].empty() || sides[1].empty()) continue;
    for (const int placing : {0, 1}) {
      const auto point = PlacedBy(sides[placing]);
      if (!point) continue;
      // What follows is moved: its points by the shift, and its cameras, from which the arm begins.
      for (const Sight& s : sides[1 - placing]) {
        across.push_back({static_cast<int>(j), *point - s.centre, s.ray, placing == 1 ? 1.0 : -1.0});
      }
    }
  }
  return across;
}

// The shift that puts all of them along their rays: it lies nearest to the lines of the shifts that each allows.
std::optional<Eigen::Vector3d> ShiftOf(const std::vector<Across>& all, const std::vector<int>& which) {
  NearestToRays nearest;
  for (int k : which) {
    const Across& a = all[static_cast<size_t>(k)];
    nearest.Add(-a.sign * a.arm, a.ray);
  }
  if (nearest.Spread()(0) < 1e-6) return std::nullopt;  // they are parallel
  return nearest.Point();
}

// How many points fit in all their sights across.
int Fitting(const std::vector<Across>& all, const Eigen::Vector3d& shift, int* points) {
  std::map<int, bool> fits;
  for (const Across& a : all) {
    const auto [at, fresh] = fits.try_emplace(a.point, true);
    at->second = at->second && a.Off(shift) < kFits_rad;
  }
  if (points != nullptr) *points = static_cast<int>(fits.size());
  return static_cast<int>(std::count_if(fits.begin(), fits.end(), [](const auto& f) { return f.second; }));
}

}  // namespace

namespace {

// Where the body is at a moment.
class Path {
 public:
  Path(const LocalizeInput& input, const Reconstruction& r) : input_(input), r_(r), moments_(MomentsOfPoses(input)) {}
  int FirstPose(int moment) const {
    return static_cast<int>(std::lower_bound(moments_.begin(), moments_.end(), moment) - moments_.begin());
  }
  Eigen::Vector3d Step(int moment) const { return At(moment + 1) - At(moment); }
  double Seconds(int moment) const {
    const auto stamp = [&](int m) { return input_.pose_stamps[static_cast<size_t>(FirstPose(m))]; };
    return 1e-9 * static_cast<double>(stamp(moment + 1) - stamp(moment));
  }
  // What the steps before and after make likely of one, by their speeds; nothing where it is the only one.
  std::optional<Eigen::Vector3d> Expected(int step) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    int steps = 0;
    for (const int other : {step - 1, step + 1}) {
      if (other < 0 || other >= moments_.back() || Seconds(other) <= 0) continue;
      sum += Step(other) / Seconds(other);
      ++steps;
    }
    return steps > 0 ? std::optional<Eigen::Vector3d>(Seconds(step) / steps * sum) : std::nullopt;
  }

 private:
  Eigen::Vector3d At(int moment) const {
    return r_.problem.poses[static_cast<size_t>(FirstPose(moment))].TargetOriginInSource();
  }
  const LocalizeInput& input_;
  const Reconstruction& r_;
  std::vector<int> moments_;
};

// A shift is a jump of odometry if it is along the step, makes the speed more even, and is no noise. What repeats along
// a street may match one period off, and a turn or a camera's place may look like a shift aside.
bool IsOfOdometry(const Path& path, int step, const Eigen::Vector3d& shift) {
  constexpr double kLeast_m = 0.2, kLeastPart = 0.2, kAlong = 0.8, kMoreEven = 0.5;
  const Eigen::Vector3d moved = path.Step(step);
  const auto expected = path.Expected(step);
  if (!expected || shift.norm() < std::max(kLeast_m, kLeastPart * moved.norm())) return false;
  return std::abs(shift.dot(moved)) > kAlong * shift.norm() * moved.norm() &&
         (moved + shift - *expected).norm() < kMoreEven * (moved - *expected).norm();
}

// Odometry goes on evenly, and the images of what follows are from farther on: pictures are missing.
bool IsOfImages(const Path& path, int step, const Eigen::Vector3d& shift) {
  constexpr double kLeastPart = 0.3, kAlong = 0.8, kEven = 0.3;
  const Eigen::Vector3d moved = path.Step(step);
  const auto expected = path.Expected(step);
  return expected && shift.norm() > kLeastPart * moved.norm() &&
         shift.dot(moved) > kAlong * shift.norm() * moved.norm() &&
         (moved - *expected).norm() < kEven * expected->norm();
}

}  // namespace

std::optional<JumpByPoints> FindJumpByPoints(const LocalizeInput& input, const Reconstruction& r, uint64_t seed) {
  constexpr double kMost = 0.5;  // share of the points that the shift has to explain
  constexpr int kTimesMore = 4;  // than without
  const std::vector<int> suspect = SuspectSteps(input, r);
  if (suspect.empty()) return std::nullopt;
  const std::vector<std::vector<Sight>> sights = SightsOf(input, r);
  const Path path(input, r);
  for (const int step : suspect) {
    const std::vector<Across> across = SeenAcross(sights, step);
    RansacOptions options;
    options.threshold = kFits_rad;
    options.seed = seed;
    const auto found = Ransac<Eigen::Vector3d, 2>(
        static_cast<int>(across.size()), options,
        [&](const std::vector<int>& two) {
          const auto shift = ShiftOf(across, two);
          return shift ? std::vector{*shift} : std::vector<Eigen::Vector3d>();
        },
        [&](const Eigen::Vector3d& shift, int k) { return across[static_cast<size_t>(k)].Off(shift); });
    if (!found.found) continue;
    JumpByPoints jump{path.FirstPose(step), path.FirstPose(step + 1), found.model};
    jump.fitting = Fitting(across, jump.shift_m, &jump.points);
    jump.fitting_unmoved = Fitting(across, Eigen::Vector3d::Zero(), nullptr);
    if (jump.points >= kLeastPoints && jump.fitting >= kMost * jump.points &&
        jump.fitting >= kTimesMore * jump.fitting_unmoved && IsOfOdometry(path, step, jump.shift_m)) {
      return jump;
    }
  }
  return std::nullopt;
}

namespace {

// Odometry's steps from moment to moment: indices of factors.
std::vector<size_t> OdometrySteps(const LocalizeInput& input, const BundleProblem& p) {
  const std::vector<int> moments = MomentsOfPoses(input);
  const auto moment = [&](int pose) { return moments[static_cast<size_t>(pose)]; };
  std::vector<size_t> steps;
  for (size_t k = 0; k < p.factors.size(); ++k) {
    const PoseFactor& f = p.factors[k];
    if (f.kind == PoseFactor::Kind::kBetween && f.scale >= 0 && moment(f.a) != moment(f.b)) steps.push_back(k);
  }
  return steps;
}

// Solved again without one step; its cost.
double SolveWithout(size_t step, const BundleOptions& bundle, const CancelToken& cancel, BundleProblem* p) {
  constexpr double kNearlyNothing = 1e-3;  // the run stays in one piece
  PoseFactor& f = p->factors[step];
  f.sqrt_info *= kNearlyNothing;
  f.loss = nullptr;
  ProgressSink silent;
  return SolveBundle(*p, bundle, silent, cancel).final_cost;
}

Eigen::Vector3d StepBetween(const BundleProblem& p, int a, int b) {
  const auto centre = [&](int pose) { return p.poses[static_cast<size_t>(pose)].TargetOriginInSource(); };
  return centre(b) - centre(a);
}

Eigen::Vector3d OdometryStep(const LocalizeInput& input, int a, int b) {
  const auto centre = [&](int pose) { return input.odom_from_body[static_cast<size_t>(pose)].translation; };
  return centre(b) - centre(a);
}

// Of the other steps, per degree of freedom.
double MeanSquaredResidual(const BundleProblem& p, const std::vector<size_t>& steps, size_t without) {
  double sum = 0;
  for (const size_t k : steps) sum += k == without ? 0 : SquaredError(p, p.factors[k]);
  return sum / (6.0 * static_cast<double>(steps.size() - 1));
}

// Of `p`, solved: the steps that fit worst, all if they are few.
std::vector<size_t> WorstSteps(const BundleProblem& p, std::vector<size_t> steps) {
  constexpr size_t kMost = 10;
  std::stable_sort(steps.begin(), steps.end(),
                   [&](size_t a, size_t b) { return SquaredError(p, p.factors[a]) > SquaredError(p, p.factors[b]); });
  if (steps.size() > kMost) steps.resize(kMost);
  return steps;
}

}  // namespace

std::optional<ContradictedStep> FindContradictedStep(const LocalizeInput& input, const Reconstruction& r, int threads,
                                                     const CancelToken& cancel) {
  constexpr size_t kLeastSteps = 5;
  constexpr double kLeastGain = 38.3;  // chi-square of 6 degrees of freedom, once in a million
  constexpr double kOfBest = 0.5;
  const std::vector<size_t> steps = OdometrySteps(input, r.problem);
  if (!input.has_odometry || steps.size() < kLeastSteps) return {};
  const std::optional<BelievedImages> believed = BelieveImages(r, threads, cancel);
  if (!believed) return {};
  const BundleProblem& p = believed->problem;
  BundleOptions bundle;
  bundle.threads = threads;
  ContradictedStep found;
  Eigen::Vector3d by_images = Eigen::Vector3d::Zero();
  double rest = 0;
  std::vector<std::pair<size_t, double>> gains;
  for (const size_t k : WorstSteps(p, steps)) {
    BundleProblem q = p;
    gains.emplace_back(k, 2 * (believed->cost - SolveWithout(k, bundle, cancel, &q)));
    if (gains.back().second <= found.gain) continue;
    const PoseFactor& f = q.factors[k];
    by_images = StepBetween(q, f.a, f.b);
    found = {f.a, f.b, by_images - OdometryStep(input, f.a, f.b), gains.back().second};
    rest = MeanSquaredResidual(q, steps, k);
  }
  const std::vector<int> moments = MomentsOfPoses(input);
  double second = 0;  // the steps beside it explain a part of what it does
  for (const auto& [k, gain] : gains) {
    const PoseFactor& f = p.factors[k];
    const bool beside = moments[static_cast<size_t>(f.a)] <= moments[static_cast<size_t>(found.after)] &&
                        moments[static_cast<size_t>(f.b)] >= moments[static_cast<size_t>(found.before)];
    if (!beside) second = std::max(second, gain);
  }
  const double limit = 1 + 2 / std::sqrt(3.0 * static_cast<double>(steps.size() - 1));
  if (found.gain < kLeastGain || second > kOfBest * found.gain || rest > limit) return {};
  const int moment = moments[static_cast<size_t>(found.before)];
  const Path path(input, r);
  const Eigen::Vector3d shift = by_images - path.Step(moment);
  const bool of_odometry = IsOfOdometry(path, moment, shift);
  found.of_images = !of_odometry && IsOfImages(path, moment, shift);
  if (!of_odometry && !found.of_images) return {};
  return found;
}

}  // namespace trigpoint

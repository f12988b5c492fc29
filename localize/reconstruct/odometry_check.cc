#include "localize/reconstruct/odometry_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <set>

#include "calib/base/median.h"
#include "calib/base/parallel.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/bearing.h"
#include "localize/reconstruct/camera_mount.h"
#include "localize/reconstruct/odometry_clock.h"
#include "localize/reconstruct/odometry_stretch.h"
#include "localize/reconstruct/prepared_image.h"
#include "localize/reconstruct/two_view.h"

namespace trigpoint {
namespace {

constexpr size_t kFeatures = 1500;  // of an image: the largest, which other images show, too
constexpr size_t kAllFeatures = std::numeric_limits<size_t>::max();

const Camera& CameraOf(const LocalizeInput& input, int image) {
  return input.cameras[static_cast<size_t>(input.images[static_cast<size_t>(image)].camera)].camera;
}

struct View {
  int image = 0;
  double pixel_rad = 0;
  DescriptorBlock descriptors;
  std::vector<Eigen::Vector3d> rays;
};

View ReadView(const LocalizeInput& input, int image, size_t most = kFeatures) {
  const FeatureSet all = input.image_features(image);
  std::vector<size_t> order(all.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return all.scales[a] > all.scales[b]; });
  View view;
  view.image = image;
  view.pixel_rad = 1 / CameraOf(input, image).MeanFocal();
  cv::Mat descriptors(0, DescriptorBlock::kDim, CV_8U);
  for (size_t i : order) {
    const auto ray = CameraOf(input, image).Unproject(all.points[i].cast<double>());
    if (!ray) continue;
    descriptors.push_back(all.descriptors.row(static_cast<int>(i)));
    view.rays.push_back(*ray);
    if (view.rays.size() >= most) break;
  }
  view.descriptors = DescriptorBlock(descriptors);
  return view;
}

// Two images, the rays of their features that match, in the same order, and how far these move in the median.
struct MatchedPair {
  int a = 0, b = 0;
  std::vector<Eigen::Vector3d> rays_a, rays_b;
  double motion_rad = 0;
};

// How far the features of two images that match move in the median, what stands still included, rad.
std::optional<double> MotionOfAll(const View& a, const View& b, const OdometryCheckOptions& options) {
  std::vector<double> motions;
  for (const auto& [i, j] : MatchMutual(a.descriptors, b.descriptors, options.ratio, 0.75))
    motions.push_back(AngleBetween(a.rays[static_cast<size_t>(i)], b.rays[static_cast<size_t>(j)]));
  if (static_cast<int>(motions.size()) < options.least_matches) return std::nullopt;
  return Median(std::move(motions));
}

// Nothing where too few features match.
std::optional<MatchedPair> Match(const View& a, const View& b, const OdometryCheckOptions& options) {
  const Matches matches =
      WithoutCarrier(MatchMutual(a.descriptors, b.descriptors, options.ratio, 0.75), a.rays, b.rays, a.pixel_rad);
  if (static_cast<int>(matches.size()) < options.least_matches) return std::nullopt;
  MatchedPair pair{a.image, b.image, {}, {}, 0};
  std::vector<double> motions;
  for (const auto& [i, j] : matches) {
    pair.rays_a.push_back(a.rays[static_cast<size_t>(i)]);
    pair.rays_b.push_back(b.rays[static_cast<size_t>(j)]);
    motions.push_back(AngleBetween(pair.rays_a.back(), pair.rays_b.back()));
  }
  pair.motion_rad = Median(std::move(motions));
  return pair;
}

std::optional<MeasuredMotion> Measure(const LocalizeInput& input, const MatchedPair& pair,
                                      const OdometryCheckOptions& options, uint64_t seed) {
  WideBaselineOptions two;
  two.inlier_rad = options.inlier_px / CameraOf(input, pair.a).MeanFocal();
  two.seed = seed;
  const RelativePoseEstimate estimate = EstimateRelativePose(pair.rays_a, pair.rays_b, two);
  const WideBaselineResult& g = estimate.best;
  if (!g.verified || static_cast<int>(g.inliers.size()) < options.least_matches) return std::nullopt;
  if (estimate.rotation_ambiguous) return std::nullopt;
  const Eigen::Matrix<double, 5, 5> covariance = g.information.ldlt().solve(Eigen::Matrix<double, 5, 5>::Identity());
  if (!covariance.allFinite()) return std::nullopt;
  const FrameImage &frame_a = input.images[static_cast<size_t>(pair.a)],
                   &frame_b = input.images[static_cast<size_t>(pair.b)];
  MeasuredMotion m;
  m.a = frame_a.pose, m.b = frame_b.pose;
  m.sensor_from_body = input.cameras[static_cast<size_t>(frame_a.camera)].cam_from_body;
  m.b_from_a = g.b_from_a;
  m.matches = static_cast<int>(g.inliers.size());
  m.sigma_rotation_rad = std::sqrt(covariance.topLeftCorner<3, 3>().trace() / 3);
  m.sigma_direction_rad = std::sqrt(covariance.bottomRightCorner<2, 2>().trace() / 2);
  m.has_direction =
      !g.rotation_only && !estimate.direction_ambiguous && m.sigma_direction_rad < options.most_sigma_deg * kDegToRad;
  return m;
}

// The image `count` images later; -1 after the last.
int Later(const std::vector<int>& next, int image, int count) {
  for (int k = 0; k < count && image >= 0; ++k) image = next[static_cast<size_t>(image)];
  return image;
}

// From an image to a later one, at least `first_apart` images on, that shows enough motion and yet the same things.
std::optional<MeasuredMotion> MeasureFrom(const LocalizeInput& input, const std::vector<int>& next, int image,
                                          int first_apart, const OdometryCheckOptions& options, uint64_t seed) {
  const View view = ReadView(input, image);
  std::optional<MeasuredMotion> found;
  for (int apart = first_apart; apart <= options.most_apart; apart *= 2) {
    const int other = Later(next, image, apart);
    if (other < 0) break;
    const std::optional<MatchedPair> pair = Match(view, ReadView(input, other), options);
    if (!pair) break;
    if (pair->motion_rad > options.least_deg * kDegToRad) {
      const auto motion = Measure(input, *pair, options, seed + static_cast<uint64_t>(apart));
      if (motion && (!found || motion->has_direction)) found = motion;
      if (found && found->has_direction) break;
    }
  }
  return found || first_apart == 1 ? found : MeasureFrom(input, next, image, 1, options, seed);
}

std::vector<MeasuredMotion> Found(const std::vector<std::optional<MeasuredMotion>>& measured) {
  std::vector<MeasuredMotion> motions;
  for (const auto& m : measured) {
    if (m) motions.push_back(*m);
  }
  return motions;
}

// Of each image to the next ones: for runs of so few images that all of them can be compared.
std::vector<MeasuredMotion> MeasureNeighbours(const LocalizeInput& input, OdometryCheckOptions options, int threads,
                                              uint64_t seed, const CancelToken& cancel) {
  constexpr int kApart = 4;
  // Chance is excluded by the geometry of each pair; with so few no false one hides among many.
  options.least_matches = std::min(options.least_matches, 2 * kLeastMatches);
  const std::vector<int> next = NextOfCamera(input);
  std::vector<std::pair<int, int>> pairs;
  for (int image = 0; image < static_cast<int>(input.images.size()); ++image) {
    for (int apart = 1; apart <= std::min(kApart, options.most_apart); ++apart) {
      if (const int other = Later(next, image, apart); other >= 0) pairs.emplace_back(image, other);
    }
  }
  std::vector<std::optional<MeasuredMotion>> measured(pairs.size());
  ParallelFor(static_cast<int64_t>(pairs.size()), threads, cancel, [&](int64_t i) {
    const auto [image, other] = pairs[static_cast<size_t>(i)];
    const std::optional<MatchedPair> pair =
        Match(ReadView(input, image, kAllFeatures), ReadView(input, other, kAllFeatures), options);
    if (!pair || pair->motion_rad < options.least_deg * kDegToRad) return;
    measured[static_cast<size_t>(i)] = Measure(input, *pair, options, seed + static_cast<uint64_t>(i));
  });
  return Found(measured);
}

// `count` images spread over the run by their order; half a stride later for `second`.
std::vector<int> Spread(int images, int count, bool second) {
  std::set<int> chosen;
  for (int k = 0; k < count; ++k) {
    chosen.insert(static_cast<int>((k + (second ? 0.5 : 0.0)) * images / count));
  }
  return {chosen.begin(), chosen.end()};
}

// The images at which odometry turns most.
std::vector<int> Turning(const LocalizeInput& input, const std::vector<int>& next, int count) {
  std::vector<std::pair<double, int>> turns;
  for (size_t i = 0; i < input.images.size(); ++i) {
    if (next[i] < 0) continue;
    const auto pose = [&](size_t image) {
      return input.odom_from_body[static_cast<size_t>(input.images[image].pose)].rotation;
    };
    turns.emplace_back(-AngleBetween(pose(i), pose(static_cast<size_t>(next[i]))), static_cast<int>(i));
  }
  std::sort(turns.begin(), turns.end());
  std::vector<int> images;
  for (const auto& [turn, image] : turns) {
    if (static_cast<int>(images.size()) < count) images.push_back(image);
  }
  return images;
}

double SecondsBetween(const LocalizeInput& input, int a, int b) {
  return 1e-9 *
         static_cast<double>(input.pose_stamps[static_cast<size_t>(b)] - input.pose_stamps[static_cast<size_t>(a)]);
}

// Speeds of the body's own motion between two poses: rotation rad/s, translation m/s.
Vector6d SpeedOf(const LocalizeInput& input, int a, int b) {
  const Rigid3d step =
      input.odom_from_body[static_cast<size_t>(a)].Inverse() * input.odom_from_body[static_cast<size_t>(b)];
  Vector6d speed;
  speed << LogSO3(step.rotation), step.translation;
  return speed / std::max(1e-3, SecondsBetween(input, a, b));
}

// A step from an image of a camera to the next that differs from those around it, and the step that they make likely
// instead. Each camera has its own steps: where the cameras' clocks differ by milliseconds, those between consecutive
// poses are next to nothing, and no image shows them.
struct OddStep {
  int a = 0, b = 0;  // poses
  double score = 0;  // how much it differs; 1: worth a look
  Rigid3d likely;
};

// Of one camera, whose images have these poses.
std::vector<OddStep> OddStepsAlong(const LocalizeInput& input, const std::vector<int>& poses) {
  constexpr int kAround = 3;
  constexpr double kOdd_m = 0.3, kOddPart = 0.25, kOdd_rad = 10 * kDegToRad;
  std::vector<Vector6d> speeds;
  for (size_t k = 1; k < poses.size(); ++k) speeds.push_back(SpeedOf(input, poses[k - 1], poses[k]));
  const int steps = static_cast<int>(speeds.size());
  std::vector<OddStep> odd;
  for (int k = 0; k < steps; ++k) {
    Vector6d likely = Vector6d::Zero();
    for (Eigen::Index c = 0; c < 6; ++c) {
      std::vector<double> around;
      for (int j = std::max(0, k - kAround); j <= std::min(steps - 1, k + kAround); ++j) {
        if (j != k) around.push_back(speeds[static_cast<size_t>(j)](c));
      }
      likely(c) = Median(std::move(around));
    }
    OddStep step;
    step.a = poses[static_cast<size_t>(k)], step.b = poses[static_cast<size_t>(k) + 1];
    const double seconds = SecondsBetween(input, step.a, step.b);
    const Vector6d difference = seconds * (speeds[static_cast<size_t>(k)] - likely);
    likely *= seconds;
    step.likely = {ExpSO3(likely.head<3>()), likely.tail<3>()};
    step.score = std::max(difference.tail<3>().norm() / std::max(kOdd_m, kOddPart * likely.tail<3>().norm()),
                          difference.head<3>().norm() / kOdd_rad);
    if (step.score > 1) odd.push_back(step);
  }
  return odd;
}

// Those of all cameras, the oddest first.
std::vector<OddStep> FindOddSteps(const LocalizeInput& input, size_t count) {
  std::vector<std::vector<int>> poses(input.cameras.size());
  for (const FrameImage& image : input.images) poses[static_cast<size_t>(image.camera)].push_back(image.pose);
  std::map<std::pair<int, int>, OddStep> by_poses;  // cameras that share poses share steps
  for (const std::vector<int>& its : poses) {
    for (const OddStep& step : OddStepsAlong(input, its)) {
      OddStep& known = by_poses[{step.a, step.b}];
      if (step.score > known.score) known = step;
    }
  }
  std::vector<OddStep> odd;
  for (const auto& [ends, step] : by_poses) odd.push_back(step);
  std::stable_sort(odd.begin(), odd.end(), [](const OddStep& x, const OddStep& y) { return x.score > y.score; });
  if (odd.size() > count) odd.resize(count);
  return odd;
}

// A motion shows a jump of odometry only if it differs by more than these, which grow with the noise of all motions:
// where stops are some metres apart, odometry and the motions that images show are a few degrees off everywhere.
struct JumpGates {
  double turn_rad = 10 * kDegToRad, direction_rad = 15 * kDegToRad;
  double aside_m = 0;  // across the direction that the images show

  JumpGates(const std::vector<Rigid3d>& poses, const std::vector<MeasuredMotion>& motions) {
    constexpr double kMedians = 4;
    std::vector<double> turns, aside;
    for (const MeasuredMotion& m : motions) {
      const MotionComparison c = CompareMotion(poses, m);
      turns.push_back(c.rotation_off_rad);
      if (c.moves) aside.push_back(AsideOf(c));
    }
    turn_rad = std::max(turn_rad, kMedians * Median(std::move(turns)));
    aside_m = kMedians * Median(std::move(aside));
  }

  static double AsideOf(const MotionComparison& c) {
    return c.length_m * std::sin(std::min(c.direction_off_rad, 90 * kDegToRad));
  }

  bool IsOff(const MotionComparison& c, const MeasuredMotion& m) const {
    constexpr double kSigmas = 5;
    return c.rotation_off_rad > std::max(turn_rad, kSigmas * m.sigma_rotation_rad) ||
           (c.moves && c.direction_off_rad > std::max(direction_rad, kSigmas * m.sigma_direction_rad) &&
            AsideOf(c) > aside_m);
  }
};

// Whether a motion over a step contradicts it and agrees with the likely one.
bool ShowsJump(const std::vector<Rigid3d>& poses, const OddStep& step, MeasuredMotion motion, const JumpGates& gates) {
  motion.a = 0, motion.b = 1;
  const auto a = static_cast<size_t>(step.a), b = static_cast<size_t>(step.b);
  return gates.IsOff(CompareMotion({poses[a], poses[b]}, motion), motion) &&
         !gates.IsOff(CompareMotion({Rigid3d(), step.likely}, motion), motion);
}

// Whether images contradict a step and agree with the likely one.
bool IsJump(const LocalizeInput& input, const std::vector<int>& next, const OddStep& step, const JumpGates& gates,
            const OdometryCheckOptions& options, uint64_t seed) {
  for (size_t i = 0; i < input.images.size(); ++i) {
    if (input.images[i].pose != step.a || next[i] < 0 || input.images[static_cast<size_t>(next[i])].pose != step.b) {
      continue;
    }
    const std::optional<MatchedPair> pair =
        Match(ReadView(input, static_cast<int>(i)), ReadView(input, next[i]), options);
    const auto motion = pair ? Measure(input, *pair, options, seed) : std::nullopt;
    if (motion && ShowsJump(input.odom_from_body, step, *motion, gates)) return true;
  }
  return false;
}

// Whether one motion alone shows that a step is wrong: it is from an image to the next, has many matches, differs much,
// and agrees with the steps around it. Motions that repeated windows or traffic pretend do not agree with these.
bool IsShownWell(const std::vector<Rigid3d>& poses, const MeasuredMotion& m, const std::vector<OddStep>& odd,
                 const JumpGates& gates) {
  constexpr int kMatches = 50;
  return m.matches >= kMatches && !Agrees(poses, m) && std::any_of(odd.begin(), odd.end(), [&](const OddStep& step) {
           return step.a == m.a && step.b == m.b && ShowsJump(poses, step, m, gates);
         });
}

// The poses between which odometry jumps: all motions that contradict it span these, or begin or end at the one
// moment that is wrong, and the others agree (with a wrong lens model they do not, though one place stands out). A
// single one must be shown well. One moment must stand out by its steps, too: else its image is of another. Nothing
// where they say no such thing.
std::optional<std::pair<int, int>> FindBrokenPlace(const LocalizeInput& input,
                                                   const std::vector<MeasuredMotion>& motions, const JumpGates& gates) {
  const std::vector<Rigid3d>& poses = input.odom_from_body;
  constexpr int kLeastOff = 2, kLeastRight = 3;
  std::vector<const MeasuredMotion*> off, right;
  for (const MeasuredMotion& m : motions) {
    const MotionComparison c = CompareMotion(poses, m);
    if (c.turns || c.moves) (gates.IsOff(c, m) ? off : right).push_back(&m);
  }
  const std::vector<OddStep> odd = FindOddSteps(input, poses.size());
  if (off.empty() || (static_cast<int>(off.size()) < kLeastOff && !IsShownWell(poses, *off.front(), odd, gates))) {
    return std::nullopt;
  }
  const auto explains = [&](const auto& touches) {
    if (!std::all_of(off.begin(), off.end(), [&](const MeasuredMotion* m) { return touches(*m); })) return false;
    std::vector<MeasuredMotion> apart;
    int through = 0;
    for (const MeasuredMotion* m : right) {
      if (touches(*m)) {
        ++through;
      } else {
        apart.push_back(*m);
      }
    }
    return static_cast<int>(apart.size()) >= kLeastRight && 2 * through <= static_cast<int>(off.size()) &&
           JudgeReadings(poses, apart, {PoseReadings().front()}).kind != ReadingVerdict::Kind::kContradicted;
  };
  const int last = static_cast<int>(poses.size()) - 1;
  const auto may_jump_after = [&](int k) {
    return explains([k](const MeasuredMotion& m) { return std::min(m.a, m.b) <= k && std::max(m.a, m.b) > k; });
  };
  for (int k = 0; k < last; ++k) {
    if (!may_jump_after(k)) continue;
    int end = k + 1;  // which one of several steps it is no motion tells
    while (end < last && may_jump_after(end)) ++end;
    return std::pair(k, end);
  }
  const std::vector<int> moments = MomentsOfPoses(input);
  const auto moment = [&](int pose) { return moments[static_cast<size_t>(pose)]; };
  std::set<int> ends_of_odd;
  for (const OddStep& step : odd) ends_of_odd.insert({moment(step.a), moment(step.b)});
  for (const int k : ends_of_odd) {
    if (!explains([&](const MeasuredMotion& m) { return moment(m.a) == k || moment(m.b) == k; })) continue;
    const auto [begin, end] = std::equal_range(moments.begin(), moments.end(), k);
    return std::pair(std::max(0, static_cast<int>(begin - moments.begin()) - 1),
                     std::min(last, static_cast<int>(end - moments.begin())));
  }
  return std::nullopt;
}

std::string Jump(const LocalizeInput& input, const std::string& odometry, int from, int to) {
  const auto a = static_cast<size_t>(from), b = static_cast<size_t>(to);
  double moved = 0, turned = 0;
  for (size_t k = a; k < b; ++k) {
    const Rigid3d step = input.odom_from_body[k].Inverse() * input.odom_from_body[k + 1];
    moved = std::max(moved, step.translation.norm());
    turned = std::max(turned, AngleBetween(step.rotation, Eigen::Quaterniond::Identity()));
  }
  return fmt::format(
      "{}: jumps between {:.3f} and {:.3f} s: it moves {:.2f} m and turns {:.0f} deg there, which the images "
      "contradict; expected a continuous motion without corrections by GPS or loops, and the calibration of this "
      "camera. Option --set reconstruct.check_conventions=false skips this check",
      odometry, 1e-9 * static_cast<double>(input.pose_stamps[a]), 1e-9 * static_cast<double>(input.pose_stamps[b]),
      moved, turned * kRadToDeg);
}

// Images that are all one picture while odometry moves: a camera that hangs, or files written once too often.
std::optional<std::string> FindStandstill(const LocalizeInput& input, const std::string& odometry,
                                          const OdometryCheckOptions& options) {
  constexpr double kStill_rad = 0.003 * kDegToRad, kMoves_m = 0.2;
  constexpr int kLooks = 8;
  const std::vector<int> next = NextOfCamera(input);
  int compared = 0;
  double moved = 0;
  for (const int image : Spread(static_cast<int>(input.images.size()), kLooks, false)) {
    const int other = next[static_cast<size_t>(image)];
    if (other < 0) continue;
    const auto pose = [&](int i) {
      return input.odom_from_body[static_cast<size_t>(input.images[static_cast<size_t>(i)].pose)].translation;
    };
    const double step = (pose(other) - pose(image)).norm();
    if (step < kMoves_m) continue;
    const std::optional<MatchedPair> pair = Match(ReadView(input, image), ReadView(input, other), options);
    if (!pair || pair->motion_rad > kStill_rad) return std::nullopt;
    ++compared;
    moved += step;
  }
  if (compared < 2) return std::nullopt;
  return fmt::format(
      "{}: moves {:.2f} m in all between the images of {} pairs that show the same picture: the camera froze, or "
      "images.txt lists one picture at several times; expected one picture for each time. Option --set "
      "reconstruct.check_conventions=false skips this check",
      odometry, moved, compared);
}

bool IsSamePose(const Rigid3d& a, const Rigid3d& b) {
  constexpr double kSame = 1e-6;
  return (a.translation - b.translation).norm() < kSame && AngleBetween(a.rotation, b.rotation) < kSame;
}

// Odometry whose poses are held until the next one comes: it stands, number for number, in many steps in which the
// pictures move. At a red light most of a picture stays where it is.
std::optional<std::string> FindHeld(const LocalizeInput& input, const std::string& odometry,
                                    const OdometryCheckOptions& options) {
  constexpr double kMoves_rad = 0.3 * kDegToRad;
  constexpr int kLooks = 8, kLeast = 4;
  constexpr double kLeastPart = 0.2;  // of all steps: a stop before a passing tram is shorter
  const std::vector<int> next = NextOfCamera(input);
  const auto steps = std::count_if(next.begin(), next.end(), [](int n) { return n >= 0; });
  std::vector<int> held;
  for (size_t i = 0; i < input.images.size(); ++i) {
    const auto pose = [&](size_t image) { return input.odom_from_body[static_cast<size_t>(input.images[image].pose)]; };
    if (next[i] >= 0 && IsSamePose(pose(i), pose(static_cast<size_t>(next[i])))) held.push_back(static_cast<int>(i));
  }
  if (static_cast<double>(held.size()) < std::max<double>(kLeast, kLeastPart * static_cast<double>(steps)))
    return std::nullopt;
  int compared = 0, moving = 0;
  for (const int k : Spread(static_cast<int>(held.size()), kLooks, false)) {
    const int image = held[static_cast<size_t>(k)];
    const auto motion = MotionOfAll(ReadView(input, image), ReadView(input, next[static_cast<size_t>(image)]), options);
    compared += motion ? 1 : 0;
    moving += motion && *motion > kMoves_rad ? 1 : 0;
  }
  if (moving < kLeast || 3 * moving < 2 * compared) return std::nullopt;
  return fmt::format(
      "{}: the pose does not change in {} of {} steps from image to image; of {} of these that were examined, the "
      "images move in {}: poses seem to be held until the next one comes; expected each pose at its own time only, or "
      "interpolated ones. Option --set reconstruct.check_conventions=false skips this check",
      odometry, held.size(), steps, compared, moving);
}

// Odometry that has one pose twice, number for number, and then catches up, while the images turn in between. Things
// that pass before a body at rest look like a motion, but not like a turn.
std::optional<std::string> FindFrozen(const LocalizeInput& input, const std::string& odometry,
                                      const OdometryCheckOptions& options, uint64_t seed, const CancelToken& cancel) {
  constexpr double kTurned_rad = 3 * kDegToRad, kSigmas = 5;
  const std::vector<int> next = NextOfCamera(input);
  const auto turn = [&](int from, int to) {
    const auto rotation = [&](int image) {
      return input.odom_from_body[static_cast<size_t>(input.images[static_cast<size_t>(image)].pose)].rotation;
    };
    return AngleBetween(rotation(from), rotation(to));
  };
  const auto measured = [&](int from, int to) {
    const std::optional<MatchedPair> pair = Match(ReadView(input, from), ReadView(input, to), options);
    return pair ? Measure(input, *pair, options, seed) : std::nullopt;
  };
  const auto differs = [&](const MeasuredMotion& m, double expected) {
    const double turned = AngleBetween(m.b_from_a.rotation, Eigen::Quaterniond::Identity());
    return std::abs(turned - expected) > std::max(kTurned_rad, kSigmas * m.sigma_rotation_rad);
  };
  for (const OddStep& step : FindOddSteps(input, static_cast<size_t>(options.pairs))) {
    if (!IsSamePose(input.odom_from_body[static_cast<size_t>(step.a)],
                    input.odom_from_body[static_cast<size_t>(step.b)])) {
      continue;
    }
    for (int i = 0; i < static_cast<int>(input.images.size()); ++i) {
      cancel.ThrowIfCancelled();
      const int other = next[static_cast<size_t>(i)], after = other < 0 ? -1 : next[static_cast<size_t>(other)];
      if (after < 0 || input.images[static_cast<size_t>(i)].pose != step.a ||
          input.images[static_cast<size_t>(other)].pose != step.b) {
        continue;
      }
      const auto still = measured(i, other), catching_up = measured(other, after);
      if (!still || !catching_up || !differs(*still, 0) || !differs(*catching_up, turn(other, after))) continue;
      return fmt::format(
          "{}: jumps: it has the same pose at {:.3f} and {:.3f} s, but the images turn by {:.1f} deg (1 sigma {:.1f} "
          "deg) between these times; expected a pose of each moment. Option --set reconstruct.check_conventions=false "
          "skips this check",
          odometry, 1e-9 * static_cast<double>(input.pose_stamps[static_cast<size_t>(step.a)]),
          1e-9 * static_cast<double>(input.pose_stamps[static_cast<size_t>(step.b)]),
          kRadToDeg * AngleBetween(still->b_from_a.rotation, Eigen::Quaterniond::Identity()),
          kRadToDeg * still->sigma_rotation_rad);
    }
  }
  return std::nullopt;
}

// Names the first jump of odometry; nothing where images show none.
std::optional<std::string> FindJump(const LocalizeInput& input, const std::string& odometry, const JumpGates& gates,
                                    const OdometryCheckOptions& options, int threads, uint64_t seed,
                                    const CancelToken& cancel) {
  const std::vector<OddStep> odd = FindOddSteps(input, static_cast<size_t>(options.pairs) / 2);
  const std::vector<int> next = NextOfCamera(input);
  std::vector<char> jumps(odd.size(), 0);
  ParallelFor(static_cast<int64_t>(odd.size()), threads, cancel, [&](int64_t i) {
    const auto k = static_cast<size_t>(i);
    jumps[k] = IsJump(input, next, odd[k], gates, options, seed + static_cast<uint64_t>(odd[k].a)) ? 1 : 0;
  });
  const auto first = std::find(jumps.begin(), jumps.end(), 1);
  if (first == jumps.end()) return std::nullopt;
  const OddStep& step = odd[static_cast<size_t>(first - jumps.begin())];
  return Jump(input, odometry, step.a, step.b);
}

std::string Counts(const MotionAgreement& m) {
  return fmt::format(
      "the rotation in {} of {} pairs, the direction of motion in {} of {} (median differences {:.1f} and {:.1f} deg)",
      m.turns_agree, m.turns, m.directions_agree, m.directions, m.rotation_off_rad * kRadToDeg,
      m.direction_off_rad * kRadToDeg);
}

std::string Contradiction(const ReadingVerdict& v, const std::string& odometry) {
  std::string text = fmt::format(
      "{}: contradicts the images; expected odom_from_body, quaternions x y z w, axes forward, left, up. As read, "
      "pairs of images agree with {}",
      odometry, Counts(v.as_read));
  text += BetterReadings(v, Counts(v.best));
  if (v.better.empty()) {
    text +=
        "; no other order, axis, sign or inverse agrees: check the file, its time (odometry: "
        "time_offset_s in run.yaml), and the calibration in camchain.yaml (T_cam_imu, lens model, intrinsics, "
        "distortion)";
  }
  return text + ". Option --set reconstruct.check_conventions=false skips this check";
}

struct Turns {
  Eigen::Vector3d odometry, images;  // of a sensor between two images, rad
};

Turns TurnsOf(const std::vector<Rigid3d>& poses, const MeasuredMotion& motion) {
  const auto pose = [&](int k) {
    return poses[static_cast<size_t>(k)].rotation * motion.sensor_from_body.rotation.conjugate();
  };
  return {LogSO3(pose(motion.b).conjugate() * pose(motion.a)), LogSO3(motion.b_from_a.rotation)};
}

// Whether odometry turns more to one side than the images, about an axis of the body: a drift is no noise.
bool Drifts(const std::vector<Rigid3d>& poses, const std::vector<MeasuredMotion>& motions) {
  constexpr double kSigmas = 4;
  Eigen::Array3d sum = Eigen::Array3d::Zero(), squares = Eigen::Array3d::Zero();
  for (const MeasuredMotion& motion : motions) {
    const Turns turns = TurnsOf(poses, motion);
    const Eigen::Array3d off = motion.sensor_from_body.rotation.conjugate() * (turns.odometry - turns.images);
    sum += off, squares += off.square();
  }
  const double n = static_cast<double>(motions.size());
  const Eigen::Array3d mean = sum / n, variance = squares / n - mean.square();
  return (mean.abs() > kSigmas * (variance.max(0) / std::max(1, IndependentMotions(motions))).sqrt()).any();
}

// Rotations that scatter about those of the images by a few degrees, neither less nor more in all, while directions
// agree: noise, which no other reading mends.
bool IsNoise(const ReadingVerdict& verdict, const std::vector<Rigid3d>& poses,
             const std::vector<MeasuredMotion>& motions) {
  constexpr double kMost_rad = 10 * kDegToRad, kSlope = 0.25, kSigmas = 3;
  constexpr int kLeast = 4;
  const MotionAgreement& m = verdict.as_read;
  const bool directions = m.directions >= kLeast && 2 * m.directions_agree > m.directions;
  if (!verdict.better.empty() || !directions || m.rotation_off_rad > kMost_rad || Drifts(poses, motions)) return false;
  // The slope of odometry's turns over the images' is 1 for noise; 0 where it turns about another axis or not at all.
  double both = 0, images = 0, odometry = 0;
  for (const MeasuredMotion& motion : motions) {
    const Turns turns = TurnsOf(poses, motion);
    both += turns.odometry.dot(turns.images), images += turns.images.squaredNorm();
    odometry += turns.odometry.squaredNorm();
  }
  if (!(images > 0)) return false;
  const double slope = both / images;
  const double rest = (odometry - slope * both) / std::max(1, 3 * IndependentMotions(motions) - 1);
  return std::abs(slope - 1) < std::max(kSlope, kSigmas * std::sqrt(std::max(0.0, rest) / images));
}

std::vector<MeasuredTurn> TurnsInTime(const LocalizeInput& input, const std::vector<MeasuredMotion>& motions) {
  std::vector<MeasuredTurn> turns;
  for (const MeasuredMotion& m : motions) {
    turns.push_back({input.pose_stamps[static_cast<size_t>(m.a)], input.pose_stamps[static_cast<size_t>(m.b)],
                     m.sensor_from_body.rotation, m.b_from_a.rotation});
  }
  return turns;
}

std::string OtherClock(const OdometryClock& clock, const std::string& odometry) {
  if (clock.rate != 0) {
    return fmt::format(
        "{}: its clock runs about {:.1f} % {} than the images': with its stamps corrected its rotations agree with the "
        "images' (median difference {:.2f} deg, uncorrected {:.2f} deg); expected one clock for both: correct its "
        "stamps. Option --set reconstruct.check_conventions=false skips this check",
        odometry, 100 * std::abs(clock.rate), clock.rate < 0 ? "faster" : "slower", clock.off_after_rad * kRadToDeg,
        clock.off_before_rad * kRadToDeg);
  }
  return fmt::format(
      "{}: its clock is {:+.2f} s off the images' (1 sigma {:.2f} s): with its stamps corrected its rotations agree "
      "with the images' (median difference {:.2f} deg, uncorrected {:.2f} deg); expected one clock for both: write "
      "odometry: {{time_offset_s: {:.2f}}} into run.yaml (add it to an offset that is there already). Option --set "
      "reconstruct.check_conventions=false skips this check",
      odometry, -clock.offset_s, clock.sigma_s, clock.off_after_rad * kRadToDeg, clock.off_before_rad * kRadToDeg,
      clock.offset_s);
}

// Odometry that turns as the images do, but at other times, in all of the run or in a part of it.
std::optional<std::string> FindOtherClock(const Trajectory& whole, const std::vector<MeasuredTurn>& turns,
                                          const std::string& odometry, ProgressSink& progress) {
  constexpr double kMost_s = 10;
  const std::optional<OdometryClock> clock = FindOdometryClock(whole, turns, kMost_s);
  if (!clock) return std::nullopt;
  progress.Log(LogLevel::kInfo, fmt::format("odometry's clock against the images': {:+.2f} s (1 sigma {:.2f} s)",
                                            -clock->offset_s, clock->sigma_s));
  if (clock->significant) return OtherClock(*clock, odometry);
  const std::optional<ClockStep> step = FindClockStep(whole, turns, kMost_s);
  if (!step) return std::nullopt;
  return fmt::format(
      "{}: {} about {:.1f} s its clock is {:+.2f} s off the images' (1 sigma {:.2f} s; with its stamps corrected the "
      "median difference of rotations is {:.2f} deg, uncorrected {:.2f} deg), in the other part of the run it agrees; "
      "expected one clock for both: check the times and the order of the images (one that was lost shifts the times of "
      "all that follow) and of odometry. Option --set reconstruct.check_conventions=false skips this check",
      odometry, step->after ? "after" : "before", 1e-9 * static_cast<double>(step->at_ns), -step->clock.offset_s,
      step->clock.sigma_s, step->clock.off_after_rad * kRadToDeg, step->clock.off_before_rad * kRadToDeg);
}

// A camera that stands on the body otherwise than its calibration states.
std::optional<std::string> FindWrongMount(const LocalizeInput& input, const std::vector<MeasuredMotion>& motions,
                                          const std::string& calibration, ProgressSink& progress) {
  constexpr double kMost_rad = 3 * kDegToRad, kSigmas = 5;
  for (const BodyCamera& camera : input.cameras) {
    if (!camera.has_extrinsics) continue;
    std::vector<MeasuredMotion> its;
    for (const MeasuredMotion& m : motions) {
      if (m.sensor_from_body.rotation.coeffs() == camera.cam_from_body.rotation.coeffs()) its.push_back(m);
    }
    const std::optional<MountError> error = FindMountError(input.odom_from_body, its);
    if (!error) continue;
    const Eigen::Vector3d deg = error->rotation * kRadToDeg;
    progress.Log(LogLevel::kInfo, fmt::format("{}: rotation against its T_cam_imu, by the images and odometry: {:.1f}, "
                                              "{:.1f}, {:.1f} deg (1 sigma {:.2f} deg)",
                                              camera.name, deg.x(), deg.y(), deg.z(), error->sigma_rad * kRadToDeg));
    if (error->rotation.norm() < std::max(kMost_rad, kSigmas * error->sigma_rad)) continue;
    return fmt::format(
        "{}: {}: its T_cam_imu differs by {:.1f} deg (1 sigma {:.1f} deg) from what the motions of {} pairs of images "
        "show: {:+.1f}, {:+.1f}, {:+.1f} deg about the camera's axes right, down, forward; expected the pose of the "
        "camera on the body (x forward, y left, z up): correct it, or calibrate the camera anew. Other causes: "
        "positions of odometry that are turned against its rotations; on a straight path, a negated z; on an even "
        "curve, a wrong translation of T_cam_imu or a calibration with another focal length or distortion. Option "
        "--set reconstruct.check_conventions=false skips this check",
        calibration, camera.name, deg.norm(), error->sigma_rad * kRadToDeg, error->motions, deg.x(), deg.y(), deg.z());
  }
  return std::nullopt;
}

// Positions in which a metre is not equally long in all directions.
std::optional<std::string> FindWrongStretch(const LocalizeInput& input, const std::vector<MeasuredMotion>& motions,
                                            const std::string& odometry, ProgressSink& progress) {
  constexpr double kMost_rad = 3 * kDegToRad, kSigmas = 5;
  const std::optional<OdometryStretch> stretch = FindStretch(input.odom_from_body, motions);
  if (!stretch) return std::nullopt;
  const std::string found = fmt::format("{:.2f} (1 sigma {:.2f}) at {:.0f} deg from x towards y", stretch->ratio,
                                        stretch->sigma_ratio, stretch->axis_rad * kRadToDeg);
  progress.Log(LogLevel::kInfo, "odometry's stretch by the directions that images show: " + found);
  if (stretch->turned_rad < std::max(kMost_rad, kSigmas * stretch->sigma_rad)) return std::nullopt;
  return fmt::format(
      "{}: contradicts the images: its lengths are too long in one direction by a factor of {}, as the directions of "
      "motion in {} pairs of images show; a wrong lens model, distortion or focal length in camchain.yaml shows the "
      "same. Expected metres in all directions: correct the positions or the calibration. Option --set "
      "reconstruct.check_conventions=false skips this check",
      odometry, found, stretch->motions);
}

}  // namespace

std::vector<MeasuredMotion> MeasureMotions(const LocalizeInput& input, const std::vector<int>& first_images,
                                           const OdometryCheckOptions& options, int threads, uint64_t seed,
                                           const CancelToken& cancel) {
  const std::vector<int> next = NextOfCamera(input);
  std::vector<std::optional<MeasuredMotion>> measured(first_images.size());
  ParallelFor(static_cast<int64_t>(first_images.size()), threads, cancel, [&](int64_t i) {
    const int image = first_images[static_cast<size_t>(i)];
    // Neighbours show the direction of motion best, images farther apart the rotation.
    const int first_apart = i % 2 == 0 ? 1 : std::min(4, options.most_apart);
    measured[static_cast<size_t>(i)] =
        MeasureFrom(input, next, image, first_apart, options, seed + 1009 * static_cast<uint64_t>(image));
  });
  return Found(measured);
}

namespace {

// Spread over the run and where it turns; more where some of them contradict odometry.
std::vector<MeasuredMotion> MeasureSample(const LocalizeInput& input, const OdometryCheckOptions& options, int threads,
                                          uint64_t seed, const CancelToken& cancel) {
  const int images = static_cast<int>(input.images.size());
  std::vector<int> first = Spread(images, options.pairs, false);
  for (int image : Turning(input, NextOfCamera(input), options.pairs / 3)) {
    if (std::find(first.begin(), first.end(), image) == first.end()) first.push_back(image);
  }
  std::vector<MeasuredMotion> motions = MeasureMotions(input, first, options, threads, seed, cancel);
  const bool all_agree = std::all_of(motions.begin(), motions.end(),
                                     [&](const MeasuredMotion& m) { return Agrees(input.odom_from_body, m); });
  if (!all_agree) {
    std::vector<int> more;
    for (int image : Spread(images, 4 * options.pairs, true)) {
      if (std::find(first.begin(), first.end(), image) == first.end()) more.push_back(image);
    }
    for (const MeasuredMotion& m : MeasureMotions(input, more, options, threads, seed, cancel)) motions.push_back(m);
  }
  return motions;
}

}  // namespace

OdometryFinding CheckOdometry(const LocalizeInput& input, const Trajectory& whole, const std::string& odometry,
                              const OdometryCheckOptions& options, int threads, uint64_t seed, ProgressSink& progress,
                              const CancelToken& cancel) {
  const int images = static_cast<int>(input.images.size());
  progress.Begin("odometry against images", 0);
  if (auto still = FindStandstill(input, odometry, options)) return {still, {}};
  if (auto held = FindHeld(input, odometry, options)) return {held, {}};
  const std::vector<MeasuredMotion> motions = images <= options.pairs
                                                  ? MeasureNeighbours(input, options, threads, seed, cancel)
                                                  : MeasureSample(input, options, threads, seed, cancel);
  std::vector<PoseReading> readings = PoseReadings();
  if (!input.cameras.empty()) {
    const BodyCamera& camera = input.cameras.front();
    readings.insert(readings.begin() + 1, PosesOfSensor("camera " + camera.name, camera.cam_from_body));
  }
  const ReadingVerdict verdict = JudgeReadings(input.odom_from_body, motions, readings);
  if (verdict.kind != ReadingVerdict::Kind::kContradicted || verdict.better.empty()) {
    if (auto other = FindOtherClock(whole, TurnsInTime(input, motions), odometry, progress)) return {other, {}};
  }
  // After the clock: on another clock a few steps differ most and look like a jump.
  if (auto frozen = FindFrozen(input, odometry, options, seed, cancel)) return {frozen, {}};
  const JumpGates gates(input.odom_from_body, motions);
  if (const auto place = FindBrokenPlace(input, motions, gates)) {
    return {Jump(input, odometry, place->first, place->second), {}};
  }
  const std::optional<OdometryDrift> drift = FindDrift(input.odom_from_body, motions, options.noise_rad);
  if (drift) progress.Log(LogLevel::kInfo, "odometry against the images: " + DriftText(*drift));
  const bool drifts = drift && drift->significant;
  const bool noisy = IsNoise(verdict, input.odom_from_body, motions);
  const bool contradicted = verdict.kind == ReadingVerdict::Kind::kContradicted;
  if (contradicted && !noisy) {
    return {Contradiction(verdict, odometry) + (drifts ? ". By these pairs " + DriftText(*drift) : ""), {}};
  }
  progress.Log(contradicted ? LogLevel::kWarning : LogLevel::kInfo,
               (contradicted ? odometry : "odometry") + ": pairs of images agree with " + Counts(verdict.as_read) +
                   (contradicted ? "; its rotations are taken as noisy" : ""));
  const std::string calibration = (std::filesystem::path(odometry).parent_path() / "camchain.yaml").string();
  if (auto wrong = FindWrongMount(input, motions, calibration, progress)) return {wrong, {}};
  if (auto wrong = FindWrongStretch(input, motions, odometry, progress)) return {wrong, {}};
  return {FindJump(input, odometry, gates, options, threads, seed, cancel),
          drifts ? drift : std::optional<OdometryDrift>(),
          TurnNoise(drifts ? WithoutDrift(input.odom_from_body, drift->significant_rad_m) : input.odom_from_body,
                    motions, options.rotation_variances)};
}

std::optional<std::string> ContradictedByPairs(const LocalizeInput& input, const std::vector<ImagePair>& rejected,
                                               const std::string& odometry) {
  constexpr int kLeast = 3;  // two pairs may both be wrong by a repeated facade
  const std::vector<int> moments = MomentsOfPoses(input);
  const auto moment = [&](int image) {
    return moments[static_cast<size_t>(input.images[static_cast<size_t>(image)].pose)];
  };
  int contradicting = 0;  // of consecutive images
  for (const ImagePair& pair : rejected) contradicting += std::abs(moment(pair.b) - moment(pair.a)) == 1;
  if (contradicting < kLeast || 2 * contradicting < moments.back()) return {};
  return fmt::format(
      "{}: contradicts the images: of {} steps between images, {} have enough matches to be judged, and odometry "
      "agrees with none of these within its noise. Check its times (odometry: time_offset_s in run.yaml), that it "
      "belongs to this run, and T_cam_imu. Option --set reconstruct.check_conventions=false skips this check",
      odometry, moments.back(), contradicting);
}

}  // namespace trigpoint

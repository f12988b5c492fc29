#include "survey/network/layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "datasets/io/tag_families.h"

namespace trigpoint {
namespace {

constexpr double kRefSide_px = 100;    // of corner_sigma_px
constexpr double kSharpBlur_px = 0.7;  // of a lens in focus
constexpr double kBorder_px = 2;       // a tag that touches the picture's edge is not found

// Rotation (rad/s, body axes) and velocity (m/s, world) at a frame, by its neighbours.
struct Motion {
  Eigen::Vector3d turn = Eigen::Vector3d::Zero(), velocity = Eigen::Vector3d::Zero();
};

Motion MotionAt(const std::vector<TimedPose>& poses, size_t k) {
  const size_t a = k > 0 ? k - 1 : 0, b = std::min(k + 1, poses.size() - 1);
  Motion motion;
  const double seconds = 1e-9 * static_cast<double>(poses[b].stamp_ns - poses[a].stamp_ns);
  if (!(seconds > 0)) return motion;
  const Rigid3d &first = poses[a].target_from_body, &last = poses[b].target_from_body;
  motion.velocity = (last.translation - first.translation) / seconds;
  motion.turn = LogSO3(first.rotation.conjugate() * last.rotation) / seconds;
  return motion;
}

// A number of its own for each of what is drawn, which does not depend on what else is drawn.
uint64_t Mixed(uint64_t state, uint64_t value) { return Random(state ^ Random(value).Next()).Next(); }

uint64_t SeedOf(const PlannedPass& pass, uint64_t seed) {
  uint64_t state = Mixed(seed, pass.name.size());
  for (const char c : pass.name) state = Mixed(state, static_cast<unsigned char>(c));
  return state;
}

// Is a visible tag found? Whether other tags or passes are there changes nothing.
bool IsFound(uint64_t pass_seed, const PlannedSight& sight, double detected) {
  uint64_t state = Mixed(pass_seed, static_cast<uint64_t>(sight.frame));
  state = Mixed(state, static_cast<uint64_t>(sight.camera));
  return Random(Mixed(state, static_cast<uint64_t>(sight.tag_id))).Uniform() <= detected;
}

// How far a point moves in the picture during the exposure.
double BlurPx(const Camera& camera, const Rigid3d& cam_from_body, const Rigid3d& world_from_body, const Motion& motion,
              const Eigen::Vector3d& world, double seconds) {
  Vector6d step;
  step << world_from_body.rotation * motion.turn * seconds, motion.velocity * seconds;
  const auto before = camera.Project(cam_from_body * (world_from_body.Inverse() * world));
  const auto after = camera.Project(cam_from_body * (world_from_body.Plus(step).Inverse() * world));
  return before && after ? (*after - *before).norm() : 1e9;
}

// What keeps a tag from being found, in the order in which it is looked at.
enum class Hidden { kOutside, kBehind, kOblique, kSmall, kBlurred, kNot };

// The later part of `sight` is filled as far as it is looked at.
Hidden SeeTag(const PlannedPass& pass, size_t frame, const Motion& motion, size_t camera_index,
              const Rigid3d& world_from_tag, double size_m, const NetworkOptions& options, PlannedSight* sight) {
  const BodyCamera& camera = pass.cameras[camera_index];
  const Rigid3d& world_from_body = pass.world_from_body[frame].target_from_body;
  const Rigid3d cam_from_tag = camera.cam_from_body * world_from_body.Inverse() * world_from_tag;
  const double w = camera.camera.width(), h = camera.camera.height();
  for (int k = 0; k < 4; ++k) {
    const auto pixel = camera.camera.Project(cam_from_tag * TagCorner(size_m, k));
    if (!pixel || pixel->x() < kBorder_px || pixel->y() < kBorder_px || pixel->x() > w - 1 - kBorder_px ||
        pixel->y() > h - 1 - kBorder_px) {
      return Hidden::kOutside;
    }
    sight->detection.corners[static_cast<size_t>(k)] = *pixel;
  }
  const double facing =
      (cam_from_tag.rotation * Eigen::Vector3d::UnitZ()).dot(Eigen::Vector3d(cam_from_tag.translation.normalized()));
  sight->angle_deg = std::acos(std::clamp(facing, -1.0, 1.0)) * kRadToDeg;
  if (facing <= 0) return Hidden::kBehind;
  if (facing <= std::cos(options.max_angle_deg * kDegToRad)) return Hidden::kOblique;
  sight->side_px = 1e9;
  for (size_t k = 0; k < 4; ++k) {
    const double side = (sight->detection.corners[k] - sight->detection.corners[(k + 1) % 4]).norm();
    sight->side_px = std::min(sight->side_px, side);
  }
  if (sight->side_px < options.min_side_px) return Hidden::kSmall;
  sight->blur_px = BlurPx(camera.camera, camera.cam_from_body, world_from_body, motion, world_from_tag.translation,
                          1e-3 * options.exposure_ms);
  return sight->blur_px > options.max_blur_px ? Hidden::kBlurred : Hidden::kNot;
}

// An edge of n pixels is found as if by n / sigma of them; blur spreads it over more.
double CornerSigma(const PlannedSight& sight, const NetworkOptions& options) {
  const double blur = std::sqrt(1 + std::pow(sight.blur_px / kSharpBlur_px, 2) / 12);
  return options.corner_sigma_px * std::sqrt(kRefSide_px / sight.side_px) * blur;
}

}  // namespace

std::vector<std::string> NetworkOptions::Check() const {
  std::vector<std::string> problems = CheckRanges(*this);
  if (!(tie_far_m > tie_near_m)) {
    problems.push_back(fmt::format("tie_far_m {:g}: expected more than tie_near_m {:g}", tie_far_m, tie_near_m));
  }
  return problems;
}

std::vector<PlannedSight> PlanSights(const NetworkLayout& layout, const NetworkOptions& options, uint64_t seed) {
  std::vector<PlannedSight> sights;
  const TagFamilies families(layout.sizes.family);
  for (size_t p = 0; p < layout.passes.size(); ++p) {
    const PlannedPass& pass = layout.passes[p];
    const uint64_t pass_seed = SeedOf(pass, seed);
    if (pass.seen) {
      for (PlannedSight sight : *pass.seen) {
        sight.pass = static_cast<int>(p);
        sights.push_back(std::move(sight));
      }
      continue;
    }
    for (size_t f = 0; f < pass.world_from_body.size(); ++f) {
      const Motion motion = MotionAt(pass.world_from_body, f);
      for (size_t c = 0; c < pass.cameras.size(); ++c) {
        for (const auto& [id, tag] : layout.world_from_tag) {
          PlannedSight sight{static_cast<int>(p), static_cast<int>(f), static_cast<int>(c), id};
          const Hidden hidden = SeeTag(pass, f, motion, c, tag, layout.sizes.SizeOf(id), options, &sight);
          if (hidden != Hidden::kNot || !IsFound(pass_seed, sight, options.detected)) continue;
          sight.detection.id = id;
          sight.detection.family = families.Of(id);
          sight.detection.margin = 50;
          sight.detection.corner_sigma_px.fill(pass.corner_factor * CornerSigma(sight, options));
          sight.detection.refined = true;
          sights.push_back(sight);
        }
      }
    }
  }
  return sights;
}

std::string WhyUnseen(const NetworkLayout& layout, const NetworkOptions& options, int tag_id) {
  const Rigid3d& tag = layout.world_from_tag.at(tag_id);
  Hidden furthest = Hidden::kOutside;
  double value = 1e9, distance = 1e9;  // of the nearest miss: deg, px; where all are alike the distance counts
  for (const PlannedPass& pass : layout.passes) {
    if (pass.seen) return {};
    for (size_t f = 0; f < pass.world_from_body.size(); ++f) {
      const Motion motion = MotionAt(pass.world_from_body, f);
      const double away = (pass.world_from_body[f].target_from_body.translation - tag.translation).norm();
      for (size_t c = 0; c < pass.cameras.size(); ++c) {
        PlannedSight sight;
        const Hidden hidden = SeeTag(pass, f, motion, c, tag, layout.sizes.SizeOf(tag_id), options, &sight);
        const double miss = hidden == Hidden::kOblique   ? sight.angle_deg
                            : hidden == Hidden::kSmall   ? -sight.side_px
                            : hidden == Hidden::kBlurred ? sight.blur_px
                                                         : away;
        if (hidden < furthest || (hidden == furthest && miss >= value)) continue;
        furthest = hidden, value = miss, distance = away;
      }
    }
  }
  switch (furthest) {
    case Hidden::kOutside: return fmt::format("outside every picture; the path comes within {:.1f} m", distance);
    case Hidden::kBehind: return fmt::format("in view from behind only, at {:.1f} m: turn it", distance);
    case Hidden::kOblique:
      return fmt::format("too oblique: at best {:.0f} deg from its normal, at most {:g} are decoded", value,
                         options.max_angle_deg);
    case Hidden::kSmall:
      return fmt::format("too small or too far: at best {:.1f} px a side at {:.1f} m, at least {:g} are decoded",
                         -value, distance, options.min_side_px);
    case Hidden::kBlurred:
      return fmt::format("blurred: at best {:.1f} px of motion, at most {:g} are decoded", value, options.max_blur_px);
    case Hidden::kNot: break;
  }
  return options.detected < 1 ? "in so few pictures that none of them happens to be decoded" : "";
}

PassTies PlanTies(const PlannedPass& pass, const NetworkOptions& options, uint64_t seed) {
  PassTies result;
  if (options.ties_per_image <= 0 || pass.cameras.empty()) return result;
  Random random(SeedOf(pass, seed ^ 0x7469657321ULL));
  std::vector<int> seen(pass.world_from_body.size() * pass.cameras.size(), 0);
  const auto count = [&](size_t f, size_t c) -> int& { return seen[f * pass.cameras.size() + c]; };
  for (size_t f = 0; f + 1 < pass.world_from_body.size(); ++f) {
    for (size_t c = 0; c < pass.cameras.size(); ++c) {
      const BodyCamera& camera = pass.cameras[c];
      while (count(f, c) < options.ties_per_image) {
        // A point on a ray of this picture; distances spread evenly in their logarithm.
        const Eigen::Vector2d pixel(random.Uniform(0, camera.camera.width() - 1),
                                    random.Uniform(0, camera.camera.height() - 1));
        const double distance = options.tie_near_m * std::pow(options.tie_far_m / options.tie_near_m, random.Uniform());
        // Tracks end at any picture with the same chance: their lengths are geometric.
        const double length = 2 + std::floor(-std::log(1 - random.Uniform()) * (options.tie_length - 2));
        ++count(f, c);  // also where the ray leads nowhere: the loop ends
        const auto ray = camera.camera.Unproject(pixel);
        if (!ray) continue;
        const Eigen::Vector3d world = pass.world_from_body[f].target_from_body *
                                      (camera.cam_from_body.Inverse() * Eigen::Vector3d(distance * *ray));
        std::vector<PlannedTie> track;
        for (size_t k = f; k < pass.world_from_body.size() && static_cast<double>(k - f) < length; ++k) {
          const auto at = camera.camera.Project(camera.cam_from_body *
                                                (pass.world_from_body[k].target_from_body.Inverse() * world));
          if (!at || !camera.camera.Contains(*at)) break;
          track.push_back({static_cast<int>(result.points.size()), static_cast<int>(k), static_cast<int>(c), *at});
        }
        if (track.size() < 2) continue;
        for (size_t k = 1; k < track.size(); ++k) ++count(static_cast<size_t>(track[k].frame), c);
        result.points.push_back(world);
        result.ties.insert(result.ties.end(), track.begin(), track.end());
      }
    }
  }
  return result;
}

namespace {

// Odometry along a pass: steps with the noise of a random walk, a scale and a drift of heading of their own.
Trajectory SimulateOdometry(const PlannedPass& pass, const NetworkOptions& options, Random* noise) {
  Trajectory odometry;
  const auto draw = [&](double sigma) { return noise != nullptr ? sigma * noise->Normal() : 0; };
  const double scale = 1 + draw(pass.scale_sigma), drift = draw(options.heading_drift_deg_m * kDegToRad);
  Rigid3d odom_from_body = pass.world_from_body.front().target_from_body;
  odometry.poses.push_back({pass.world_from_body.front().stamp_ns, odom_from_body});
  for (size_t k = 1; k < pass.world_from_body.size(); ++k) {
    const TimedPose &a = pass.world_from_body[k - 1], &b = pass.world_from_body[k];
    Rigid3d step = a.target_from_body.Inverse() * b.target_from_body;
    const double seconds = 1e-9 * static_cast<double>(b.stamp_ns - a.stamp_ns);
    step.translation /= scale;  // metres = scale * odometry
    const double length = step.translation.norm(), root = std::sqrt(length + 0.01 * seconds + 1e-6);
    // Of the rotation's error the part about the vertical grows with the way.
    Eigen::Vector3d turn = length * drift * (b.target_from_body.rotation.conjugate() * Eigen::Vector3d::UnitZ());
    for (int i = 0; i < 3; ++i) {
      turn[i] += draw(pass.odometry_factor[i] * options.odometry_rot_deg * kDegToRad * root);
      step.translation[i] += draw(pass.odometry_factor[i + 3] * options.odometry_m * root);
    }
    step.rotation = step.rotation * ExpSO3(-turn);
    odom_from_body = odom_from_body * step;
    odometry.poses.push_back({b.stamp_ns, odom_from_body});
  }
  return odometry;
}

void AddDetections(const PlannedPass& pass, size_t index, const std::vector<PlannedSight>& sights,
                   double extra_sigma_px, Random* noise, SurveyRun* run) {
  std::map<std::pair<int, int>, ImageDetections> images;
  for (const PlannedSight& sight : sights) {
    if (sight.pass != static_cast<int>(index)) continue;
    ImageDetections& image = images[{sight.frame, sight.camera}];
    image.stamp_ns = pass.world_from_body[static_cast<size_t>(sight.frame)].stamp_ns;
    image.camera = pass.cameras[static_cast<size_t>(sight.camera)].name;
    image.image = fmt::format("{}_{}", sight.frame, sight.camera);
    TagDetection detection = sight.detection;
    const double sigma = std::hypot(detection.corner_sigma_px[0], extra_sigma_px);
    for (Eigen::Vector2d& corner : detection.corners) {
      if (noise != nullptr) corner += sigma * Eigen::Vector2d(noise->Normal(), noise->Normal());
    }
    image.detections.push_back(detection);
  }
  for (auto& [key, image] : images) run->images.push_back(std::move(image));
}

}  // namespace

SurveyInput SimulateSurvey(const NetworkLayout& layout, const NetworkOptions& options, uint64_t seed, Random* noise) {
  const std::vector<PlannedSight> sights = PlanSights(layout, options, seed);
  SurveyInput input;
  input.sizes = layout.sizes;
  input.points = layout.points;
  input.distances = layout.distances;
  for (SurveyPoint& p : input.points) {
    if (noise == nullptr) continue;
    p.world_m +=
        Eigen::Vector3d(p.sigma_h_m * noise->Normal(), p.sigma_h_m * noise->Normal(), p.sigma_v_m * noise->Normal());
  }
  for (SurveyDistance& d : input.distances) {
    if (noise != nullptr) d.distance_m += d.sigma_m * noise->Normal();
  }
  for (size_t p = 0; p < layout.passes.size(); ++p) {
    const PlannedPass& pass = layout.passes[p];
    SurveyRun run;
    run.name = pass.name;
    run.date = pass.date;
    run.cameras = pass.cameras;
    run.scale_sigma = pass.scale_sigma;
    run.max_gap_s = 1e6;
    run.odometry = SimulateOdometry(pass, options, noise);
    AddDetections(pass, p, sights, options.extra_sigma_px, noise, &run);
    const PassTies ties = PlanTies(pass, options, seed);
    if (!ties.ties.empty()) {
      run.start.poses = pass.world_from_body;
      run.tie_points = ties.points;
      run.tie_loss_chi2 = 1e6;  // no wrong ones among them
    }
    for (const PlannedTie& tie : ties.ties) {
      const Camera& camera = pass.cameras[static_cast<size_t>(tie.camera)].camera;
      Eigen::Vector2d pixel = tie.pixel;
      if (noise != nullptr) pixel += options.tie_sigma_px * Eigen::Vector2d(noise->Normal(), noise->Normal());
      run.ties.push_back({tie.point, pass.world_from_body[static_cast<size_t>(tie.frame)].stamp_ns, tie.camera,
                          camera.BearingSqrtInfo(pixel, options.tie_sigma_px).cast<float>()});
    }
    input.runs.push_back(std::move(run));
  }
  return input;
}

SurveyOptions OptionsOfSurvey(const NetworkOptions& options) {
  SurveyOptions survey;
  survey.extra_sigma_px = options.extra_sigma_px;
  survey.min_side_px = options.min_side_px;
  survey.odometry_rot_deg = options.odometry_rot_deg;
  survey.odometry_m = options.odometry_m;
  survey.heading_drift_deg_m = options.heading_drift_deg_m;
  survey.variance_rounds = 0;
  survey.check_conventions = false;
  return survey;
}

}  // namespace trigpoint

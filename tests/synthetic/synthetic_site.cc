#include "tests/synthetic/synthetic_site.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "calib/base/error.h"
#include "calib/estimation/random.h"
#include "calib/geometry/bearing.h"

namespace trigpoint {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
constexpr double kPi = std::numbers::pi;

// Independent streams, so that one kind of noise does not shift another's numbers.
enum class Stream : uint64_t { kGeometry = 1, kVisibility, kPanoramas, kImages, kOdometry, kViews, kGeotags, kGps };
Random MakeRandom(uint64_t seed, Stream stream) {
  // Hashed twice: states that differ by a multiple of the generator's increment give the same numbers, shifted.
  return Random(Random(Random(seed).Next() + static_cast<uint64_t>(stream)).Next());
}

// A spot of the scene. normal zero: seen from all sides.
struct Spot {
  Vector3d position, normal, along;
};

// The drive as a polyline of about 5 cm, at equal steps.
std::vector<Vector2d> PathPoints(const SyntheticOptions& options) {
  const int n = std::max(2, static_cast<int>(std::lround(options.length_m / 0.05)));
  std::vector<Vector2d> fine;
  if (options.path == "loop") {
    // An ellipse 5 : 3; Ramanujan's circumference gives its size.
    const double a = 1, b = 0.6, h = 3 * (a + b) - std::sqrt((3 * a + b) * (a + 3 * b));
    const double scale = options.length_m / (kPi * h);
    for (int i = 0; i <= 20 * n; ++i) {
      const double t = 2 * kPi * i / (20.0 * n);
      fine.emplace_back(scale * a * std::cos(t), scale * b * std::sin(t));
    }
  } else {
    for (int i = 0; i <= 20 * n; ++i) {
      const double x = options.length_m * i / (20.0 * n);
      fine.emplace_back(x, 4 * std::sin(x / 30));
    }
  }
  std::vector<Vector2d> points;
  double since = options.step_m;
  for (size_t i = 0; i < fine.size(); ++i) {
    if (i > 0) since += (fine[i] - fine[i - 1]).norm();
    if (since >= options.step_m * (1 - 1e-9)) {
      points.push_back(fine[i]);
      since = 0;
    }
  }
  return points;
}

Vector2d Tangent(const std::vector<Vector2d>& path, size_t i) {
  const size_t a = i == 0 ? 0 : i - 1, b = std::min(i + 1, path.size() - 1);
  return a == b ? Vector2d(1, 0) : Vector2d((path[b] - path[a]).normalized());
}

// world_from_level: x along `tangent`, z up.
Eigen::Quaterniond HeadingRotation(const Vector2d& tangent) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(std::atan2(tangent.y(), tangent.x()), Vector3d::UnitZ()));
}

std::vector<Rigid3d> BodyPoses(const SyntheticOptions& options, const std::vector<Vector2d>& path, Random& random) {
  const double amplitude = options.tilt_deg * kDegToRad / 2;
  double phase[4];
  for (double& p : phase) p = random.Uniform(0, 2 * kPi);
  std::vector<Rigid3d> poses;
  for (size_t i = 0; i < path.size(); ++i) {
    const double s = static_cast<double>(i) * options.step_m;
    const double pitch = amplitude * (std::sin(s / 3 + phase[0]) + std::sin(s / 11 + phase[1]));
    const double roll = amplitude * (std::sin(s / 4 + phase[2]) + std::sin(s / 13 + phase[3]));
    const Eigen::Quaterniond q = HeadingRotation(Tangent(path, i)) * Eigen::AngleAxisd(pitch, Vector3d::UnitY()) *
                                 Eigen::AngleAxisd(roll, Vector3d::UnitX());
    poses.emplace_back(q, Vector3d(path[i].x(), path[i].y(), SyntheticGroundHeight(path[i].x(), path[i].y()) + 0.4));
  }
  return poses;
}

Vector3d OnGround(const Vector2d& p) { return {p.x(), p.y(), SyntheticGroundHeight(p.x(), p.y())}; }

void AddWall(const Vector2d& a, const Vector2d& b, double height, double per_m2, Random& random,
             std::vector<Spot>* spots, std::vector<SyntheticWall>* walls) {
  walls->push_back({OnGround(a), OnGround(b), height});
  const Vector2d d = b - a;
  const Vector2d along = d.normalized();
  const int n = static_cast<int>(std::lround(d.norm() * height * per_m2));
  for (int i = 0; i < n; ++i) {
    const Vector2d p = a + random.Uniform() * d;
    spots->push_back({OnGround(p) + Vector3d(0, 0, random.Uniform(0.3, height)),
                      {-along.y(), along.x(), 0},
                      {along.x(), along.y(), 0}});
  }
}

std::vector<Spot> MakeSpots(const SyntheticOptions& options, const std::vector<Vector2d>& path, Random& random,
                            std::vector<SyntheticWall>* walls) {
  std::vector<Spot> spots;
  if (options.path == "loop") {
    Vector2d low = path[0], high = path[0];
    for (const Vector2d& p : path) low = low.cwiseMin(p), high = high.cwiseMax(p);
    low.array() -= 14, high.array() += 14;
    const Vector2d corners[4] = {low, {high.x(), low.y()}, high, {low.x(), high.y()}};
    for (int i = 0; i < 4; ++i) AddWall(corners[i], corners[(i + 1) % 4], 9, 1.5, random, &spots, walls);
  } else {
    const int house = std::max(1, static_cast<int>(std::lround(18 / options.step_m)));
    for (size_t i = 0; i + 1 < path.size(); i += static_cast<size_t>(house)) {
      const size_t j = std::min(path.size() - 1, i + static_cast<size_t>(house));
      for (const double side : {-1.0, 1.0}) {
        const double setback = side * random.Uniform(8, 14), height = random.Uniform(7, 14);
        const Vector2d t = (path[j] - path[i]).normalized(), n(-t.y(), t.x());
        const Vector2d a = path[i] + setback * n, b = path[j] + setback * n;
        // The wall faces the street.
        if (side < 0) {
          AddWall(a, b, height, 1.5, random, &spots, walls);
        } else {
          AddWall(b, a, height, 1.5, random, &spots, walls);
        }
      }
    }
    const Vector2d t = Tangent(path, path.size() - 1), n(-t.y(), t.x()), end = path.back() + 25 * t;
    AddWall(end - 20 * n, end + 20 * n, 10, 1.5, random, &spots, walls);  // closes the street
  }
  // Cars, bins, poles beside the path, and the ground itself.
  for (size_t i = 0; i < path.size(); ++i) {
    const Vector2d t = Tangent(path, i), n(-t.y(), t.x());
    const int clutter = std::max(1, static_cast<int>(std::lround(12 * options.step_m)));
    for (int k = 0; k < clutter; ++k) {
      const double side = random.Uniform() < 0.5 ? -1 : 1;
      const Vector2d p = path[i] + side * random.Uniform(3.5, 8) * n;
      spots.push_back({{p.x(), p.y(), SyntheticGroundHeight(p.x(), p.y()) + random.Uniform(0.2, 2.5)},
                       Vector3d::Zero(),
                       Vector3d::Zero()});
      const Vector2d g = path[i] + random.Uniform(-12, 12) * n;
      spots.push_back({{g.x(), g.y(), SyntheticGroundHeight(g.x(), g.y())}, Vector3d::UnitZ(), Vector3d::Zero()});
    }
  }
  return spots;
}

bool Faces(const Spot& spot, const Vector3d& from) {
  return spot.normal.isZero() || (from - spot.position).normalized().dot(spot.normal) > 0.12;
}

std::optional<Vector2d> PixelOf(const SyntheticOptions& options, const Camera& camera, const Vector3d& in_cam) {
  const double depth = in_cam.norm();
  if (depth < options.min_depth_m || depth > options.max_depth_m) return std::nullopt;
  const std::optional<Vector2d> pixel = camera.Project(in_cam);
  const double margin = 8;  // a feature needs a patch
  if (!pixel || pixel->x() < margin || pixel->y() < margin || pixel->x() > camera.width() - 1 - margin ||
      pixel->y() > camera.height() - 1 - margin) {
    return std::nullopt;
  }
  return pixel;
}

// Fills images, points, along; `track_spot[point]` is the spot of the scene behind a point.
std::vector<int> MakeTracks(const std::vector<Spot>& spots, Random& random, SyntheticSite* site) {
  const SyntheticOptions& options = site->options;
  struct Track {
    int spot;
    std::vector<int> seen;  // images
  };
  std::vector<Track> tracks;
  for (int camera = 0; camera < static_cast<int>(site->cameras.size()); ++camera) {
    std::vector<int> live;  // tracks
    std::vector<char> in_use(spots.size(), 0);
    for (int image = 0; image < static_cast<int>(site->images.size()); ++image) {
      if (site->images[image].camera != camera) continue;
      const Rigid3d world_from_cam = site->WorldFromCam(site->images[image]);
      const Rigid3d cam_from_world = world_from_cam.Inverse();
      const auto visible = [&](int spot) {
        return Faces(spots[spot], world_from_cam.translation) &&
               PixelOf(options, site->cameras[camera].camera, cam_from_world * spots[spot].position);
      };
      std::vector<int> kept;
      for (const int track : live) {
        const int spot = tracks[track].spot;
        if (visible(spot) && random.Uniform() < options.track_survival) {
          tracks[track].seen.push_back(image);
          kept.push_back(track);
        } else {
          in_use[spot] = 0;
        }
      }
      live = std::move(kept);
      std::vector<int> fresh;
      for (int spot = 0; spot < static_cast<int>(spots.size()); ++spot) {
        if (in_use[spot] || !visible(spot)) continue;
        // Spots are spread over surfaces, features over pixels.
        const double share = std::pow(10 / (spots[spot].position - world_from_cam.translation).norm(), 2);
        if (random.Uniform() < share) fresh.push_back(spot);
      }
      random.Shuffle(fresh);
      for (const int spot : fresh) {
        if (static_cast<int>(live.size()) >= options.points_per_image) break;
        in_use[spot] = 1;
        live.push_back(static_cast<int>(tracks.size()));
        tracks.push_back({spot, {image}});
      }
    }
  }
  std::vector<int> track_spot;
  for (const Track& track : tracks) {
    if (static_cast<int>(track.seen.size()) < options.min_track_length) continue;
    const int point = static_cast<int>(track_spot.size());
    track_spot.push_back(track.spot);
    site->truth.points.push_back(spots[track.spot].position);
    site->truth.along.push_back(spots[track.spot].along);
    for (const int image : track.seen) site->images[image].observations.push_back({point});
  }
  return track_spot;
}

void MakePanoramas(const std::vector<Vector2d>& path, const std::vector<Spot>& spots,
                   const std::vector<int>& track_spot, Random& random, SyntheticSite* site) {
  const SyntheticOptions& options = site->options;
  std::vector<std::vector<Vector3d>> seen_from(track_spot.size());
  for (const SyntheticImage& image : site->images) {
    const Vector3d centre = site->WorldFromCam(image).translation;
    for (const SyntheticObservation& o : image.observations) seen_from[o.point].push_back(centre);
  }
  for (int k = 0; k < options.panoramas; ++k) {
    const size_t i = static_cast<size_t>((k + 0.5) / options.panoramas * static_cast<double>(path.size()));
    const Vector2d t = Tangent(path, i), n(-t.y(), t.x());
    const Vector2d p = path[i] + (options.panoramas_left || k % 2 == 0 ? 1 : -1) * options.panorama_offset_m *
                                     random.Uniform(0.7, 1.3) * n;
    const double tilt = options.tilt_deg * kDegToRad;
    const Attitude attitude = {random.Uniform(0, 2 * kPi), random.Uniform(-tilt, tilt), random.Uniform(-tilt, tilt)};
    const Rigid3d world_from_pano(WorldFromCamRotation(attitude),
                                  {p.x(), p.y(), SyntheticGroundHeight(p.x(), p.y()) + random.Uniform(1.6, 2.0)});
    SyntheticPanorama panorama;
    panorama.name = "pano_" + std::to_string(k);
    panorama.rig = EvenViewRig(panorama.name, options.views, options.view_size_px, 90 * kDegToRad);

    // Of a spot's tracks, the one seen from nearest by is matched.
    std::vector<std::pair<double, int>> best(spots.size(), {1e9, -1});
    for (int point = 0; point < static_cast<int>(track_spot.size()); ++point) {
      const Spot& spot = spots[track_spot[point]];
      const Vector3d ray = world_from_pano.translation - spot.position;
      if (!Faces(spot, world_from_pano.translation)) continue;
      for (const Vector3d& centre : seen_from[point]) {
        const Vector3d other = centre - spot.position;
        const double ratio = ray.norm() / other.norm();
        if (AngleBetween(ray, other) > options.match_angle_deg * kDegToRad || ratio > options.match_ratio ||
            ratio < 1 / options.match_ratio) {
          continue;
        }
        const double distance = (centre - world_from_pano.translation).norm();
        if (distance < best[track_spot[point]].first) best[track_spot[point]] = {distance, point};
      }
    }
    for (int v = 0; v < options.views; ++v) {
      const View& view = panorama.rig.views[v];
      const Rigid3d view_from_world = view.rig_from_view.Inverse() * world_from_pano.Inverse();
      std::vector<int> points;
      for (const auto& [distance, point] : best) {
        if (point >= 0 && PixelOf(options, view.camera, view_from_world * site->truth.points[point])) {
          points.push_back(point);
        }
      }
      random.Shuffle(points);
      points.resize(std::min(points.size(), static_cast<size_t>(options.points_per_view)));
      std::sort(points.begin(), points.end());
      for (const int point : points) panorama.observations.push_back({v, point});
    }
    site->truth.world_from_pano.push_back(world_from_pano);
    site->panoramas.push_back(std::move(panorama));
  }
}

Vector2d Noise2(double sigma, Random& random) {
  const double u = random.Normal(), v = random.Normal();
  return sigma * Vector2d(u, v);
}

Vector3d NoiseEnu(double sigma_h, double sigma_v, Random& random) {
  const double e = random.Normal(), n = random.Normal(), u = random.Normal();
  return {sigma_h * e, sigma_h * n, sigma_v * u};
}

void DrawImages(Random random, SyntheticSite* site) {
  site->truth.wrong.clear();
  for (SyntheticImage& image : site->images) {
    const Camera& camera = site->cameras[image.camera].camera;
    const Rigid3d cam_from_world = site->WorldFromCam(image).Inverse();
    std::vector<bool>& wrong = site->truth.wrong.emplace_back();
    for (SyntheticObservation& o : image.observations) {
      wrong.push_back(random.Uniform() < site->options.outlier_fraction);
      const Vector2d noise = Noise2(site->options.pixel_sigma_px, random);
      const double u = random.Uniform(0, camera.width() - 1), v = random.Uniform(0, camera.height() - 1);
      o.pixel = wrong.back() ? Vector2d(u, v)
                             : Vector2d(*camera.Project(cam_from_world * site->truth.points[o.point]) + noise);
    }
  }
}

void DrawOdometry(Random random, SyntheticSite* site) {
  const SyntheticOptions& options = site->options;
  const std::vector<Rigid3d>& poses = site->truth.world_from_body;
  site->truth.odometry_scale = 1 + options.odometry_scale_sigma * random.Normal();
  const double drift = options.odometry_heading_drift_per_m * random.Normal();
  const auto stamp = [&](size_t i) { return std::llround(static_cast<double>(i) * options.step_s * 1e9); };
  site->odometry.poses.assign(1, {stamp(0), Rigid3d()});
  for (size_t i = 0; i + 1 < poses.size(); ++i) {
    const Rigid3d step = poses[i].Inverse() * poses[i + 1];
    const double length = step.translation.norm();
    Vector6d delta = OdometrySigma(options, length);
    for (int k = 0; k < 6; ++k) delta[k] *= random.Normal();
    const Rigid3d turn(ExpSO3({0, 0, drift * length}), Vector3d::Zero());
    const Rigid3d observed = Rigid3d(step.rotation, site->truth.odometry_scale * step.translation).Plus(delta) * turn;
    site->odometry.poses.push_back({stamp(i + 1), site->odometry.poses.back().target_from_body * observed});
  }
}

void DrawViews(Random random, SyntheticSite* site) {
  const SyntheticOptions& options = site->options;
  site->truth.aliased.clear();
  for (size_t i = 0; i < site->panoramas.size(); ++i) {
    SyntheticPanorama& panorama = site->panoramas[i];
    std::vector<bool>& aliased = site->truth.aliased.emplace_back();
    for (SyntheticViewObservation& o : panorama.observations) {
      const View& view = panorama.rig.views[o.view];
      const Rigid3d view_from_world = view.rig_from_view.Inverse() * site->truth.world_from_pano[i].Inverse();
      const Vector3d shift = options.alias_shift_m * site->truth.along[o.point];
      const bool draw = random.Uniform() < options.alias_fraction;
      const std::optional<Vector2d> twin = view.camera.Project(view_from_world * (site->truth.points[o.point] + shift));
      aliased.push_back(draw && !shift.isZero() && twin);
      o.pixel = (aliased.back() ? *twin : *view.camera.Project(view_from_world * site->truth.points[o.point])) +
                Noise2(options.view_pixel_sigma_px, random);
    }
  }
}

void DrawGeotags(Random random, SyntheticSite* site) {
  const SyntheticOptions& options = site->options;
  const size_t n = site->panoramas.size();
  std::vector<size_t> order(n);
  for (size_t i = 0; i < n; ++i) order[i] = i;
  random.Shuffle(order);
  site->truth.geotag_is_outlier.assign(n, false);
  for (size_t i = 0; i < std::min(n, static_cast<size_t>(options.geotag_outliers)); ++i) {
    site->truth.geotag_is_outlier[order[i]] = true;
  }
  for (size_t i = 0; i < n; ++i) {
    const Rigid3d& pose = site->truth.world_from_pano[i];
    Vector3d position = pose.translation + NoiseEnu(options.geotag_sigma_h_m, options.geotag_sigma_v_m, random);
    const double direction = random.Uniform(0, 2 * kPi);
    if (site->truth.geotag_is_outlier[i]) {
      position += options.geotag_outlier_m * Vector3d(std::cos(direction), std::sin(direction), 0);
    }
    GeoTag& tag = site->panoramas[i].geotag;
    tag.has_position = tag.has_height = tag.has_heading = tag.has_tilt = true;
    tag.sigma_h_m = options.geotag_sigma_h_m;
    tag.sigma_v_m = options.geotag_sigma_v_m;
    tag.sigma_heading_rad = options.geotag_sigma_heading_deg * kDegToRad;
    tag.sigma_tilt_rad = options.geotag_sigma_tilt_deg * kDegToRad;
    tag.position = site->frame.GeodeticFromEnu(position);
    tag.attitude = AttitudeOf(pose.rotation);
    tag.attitude.heading_rad += tag.sigma_heading_rad * random.Normal();
    tag.attitude.pitch_rad += tag.sigma_tilt_rad * random.Normal();
    tag.attitude.roll_rad += tag.sigma_tilt_rad * random.Normal();
  }
}

void DrawGps(Random random, SyntheticSite* site) {
  const SyntheticOptions& options = site->options;
  const size_t stride = static_cast<size_t>(std::max(1L, std::lround(options.gps_interval_s / options.step_s)));
  site->gps.clear();
  for (size_t i = 0; i < site->truth.world_from_body.size(); i += stride) {
    const Vector3d noise = NoiseEnu(options.gps_sigma_h_m, options.gps_sigma_v_m, random);
    site->gps.push_back({site->odometry.poses[i].stamp_ns,
                         site->frame.GeodeticFromEnu(site->truth.world_from_body[i].translation + noise),
                         options.gps_sigma_h_m, options.gps_sigma_v_m});
  }
}

}  // namespace

std::vector<std::string> SyntheticOptions::Check() const {
  std::vector<std::string> problems = CheckRanges(*this);
  if (path != "loop" && path != "street") {
    problems.push_back("option path is '" + path + "', expected loop or street");
  }
  if (min_depth_m >= max_depth_m) problems.push_back("option min_depth_m must be below max_depth_m");
  return problems;
}

double SyntheticGroundHeight(double x, double y) { return 0.01 * x - 0.005 * y; }

BodyCamera SyntheticCamera(const std::string& name, double yaw_rad) {
  BodyCamera camera;
  camera.name = name;
  camera.camera = Camera::FromFieldOfView(960, 600, 100 * kDegToRad);
  // Camera axes in a body turned to the left by yaw: right = -y, down = -z, forward = x.
  Eigen::Matrix3d body_from_cam;
  const double s = std::sin(yaw_rad), c = std::cos(yaw_rad);
  body_from_cam << s, 0, c, -c, 0, s, 0, -1, 0;
  camera.cam_from_body = Rigid3d(Eigen::Quaterniond(body_from_cam), {0.2, 0, 1.1}).Inverse();
  camera.has_extrinsics = true;
  return camera;
}

Vector6d OdometrySigma(const SyntheticOptions& options, double length_m) {
  Vector6d sigma;
  sigma.head<3>().setConstant(options.odometry_rotation_sigma_rad + options.odometry_rotation_sigma_per_m * length_m);
  sigma.tail<3>().setConstant(options.odometry_translation_sigma_m +
                              options.odometry_translation_sigma_per_m * length_m);
  return sigma;
}

ViewRig EvenViewRig(const std::string& name, int n, int size_px, double fov_rad) {
  ViewRig rig;
  rig.name = name;
  for (int i = 0; i < n; ++i) {
    View view;
    view.name = std::to_string(i);
    view.camera = Camera::FromFieldOfView(size_px, size_px, fov_rad);
    view.rig_from_view = Rigid3d(ExpSO3({0, 2 * kPi * i / n, 0}), Vector3d::Zero());
    rig.views.push_back(std::move(view));
  }
  return rig;
}

SyntheticSite MakeSyntheticSite(const SyntheticOptions& options, uint64_t seed, std::vector<BodyCamera> cameras) {
  std::string problems;
  for (const std::string& problem : options.Check()) problems += (problems.empty() ? "" : "; ") + problem;
  if (!problems.empty()) throw OptionError("synthetic site: " + problems);

  SyntheticSite site;
  site.options = options;
  site.frame = LocalFrame({48.0, 8.0, 300.0});
  site.cameras = std::move(cameras);
  if (site.cameras.empty()) site.cameras.push_back(SyntheticCamera("cam0", 45 * kDegToRad));
  Random geometry = MakeRandom(seed, Stream::kGeometry);
  const std::vector<Vector2d> path = PathPoints(options);
  site.truth.world_from_body = BodyPoses(options, path, geometry);
  const std::vector<Spot> spots = MakeSpots(options, path, geometry, &site.truth.walls);
  for (size_t i = 0; i < path.size(); ++i) {
    for (size_t camera = 0; camera < site.cameras.size(); ++camera) {
      site.images.push_back({static_cast<int>(camera),
                             static_cast<int>(i),
                             std::llround(static_cast<double>(i) * options.step_s * 1e9),
                             {}});
    }
  }
  Random visibility = MakeRandom(seed, Stream::kVisibility);
  const std::vector<int> track_spot = MakeTracks(spots, visibility, &site);
  Random panoramas = MakeRandom(seed, Stream::kPanoramas);
  MakePanoramas(path, spots, track_spot, panoramas, &site);
  return RedrawNoise(site, seed);
}

SyntheticSite RedrawNoise(const SyntheticSite& site, uint64_t seed) {
  SyntheticSite out = site;
  DrawImages(MakeRandom(seed, Stream::kImages), &out);
  DrawOdometry(MakeRandom(seed, Stream::kOdometry), &out);
  DrawViews(MakeRandom(seed, Stream::kViews), &out);
  DrawGeotags(MakeRandom(seed, Stream::kGeotags), &out);
  DrawGps(MakeRandom(seed, Stream::kGps), &out);
  return out;
}

}  // namespace trigpoint

#include "tests/synthetic/rendered_site.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/base/error.h"
#include "calib/estimation/random.h"
#include "tests/synthetic/distractors.h"
#include "tests/synthetic/site_writer.h"
#include "tests/synthetic/texture.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

std::string TumRow(const std::string& key, const Rigid3d& pose) {
  const Vector3d& t = pose.translation;
  const Eigen::Quaterniond& q = pose.rotation;
  return fmt::format("{} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n", key, t.x(), t.y(), t.z(), q.x(), q.y(),
                     q.z(), q.w());
}

std::string Seconds(int64_t stamp_ns) { return fmt::format("{}.{:09}", stamp_ns / 1000000000, stamp_ns % 1000000000); }

void WriteRun(const SyntheticSite& site, const RenderedSiteOptions& options, const fs::path& dir,
              const fs::path& truth) {
  const fs::path run = dir / "runs" / options.run;
  std::string images = "# timestamp[s] filename [camera]\n", odometry = "# body in the odometry frame\n",
              gps = "timestamp_s,latitude_deg,longitude_deg,height_m,sigma_h_m,sigma_v_m\n",
              cameras = "# timestamp tx ty tz qx qy qz qw: world_from_cam of the first camera\n";
  const bool several = site.cameras.size() > 1;
  for (size_t i = 0; i < site.images.size(); ++i) {
    const SyntheticImage& image = site.images[i];
    images += fmt::format("{} images/{:06}.jpg{}\n", Seconds(image.stamp_ns), i,
                          several ? " cam" + std::to_string(image.camera) : "");
    if (image.camera == 0) cameras += TumRow(Seconds(image.stamp_ns), site.WorldFromCam(image));
  }
  for (const TimedPose& pose : site.odometry.poses) odometry += TumRow(Seconds(pose.stamp_ns), pose.target_from_body);
  for (const GpsFix& fix : site.gps) {
    gps += fmt::format("{},{:.9f},{:.9f},{:.3f},{:.2f},{:.2f}\n", Seconds(fix.stamp_ns), fix.position.latitude_deg,
                       fix.position.longitude_deg, fix.position.height_m, fix.sigma_h_m, fix.sigma_v_m);
  }
  WriteText(run / "images.txt", images);
  WriteText(run / "odometry.tum", odometry);
  WriteText(run / "gps.csv", gps);
  WriteText(run / "run.yaml", fmt::format("odometry:\n  levelled: false\n  scale_sigma: {}\n",
                                          std::max(1e-6, site.options.odometry_scale_sigma)));
  WriteCamchain(run / "camchain.yaml", site.cameras);
  WriteText(truth / "runs" / (options.run + "_cameras.tum"), cameras);
}

void WriteTables(const SyntheticSite& site, const RenderedSiteOptions& options, const fs::path& dir,
                 const fs::path& truth) {
  const Geodetic& origin = site.frame.origin();
  WriteText(dir / "origin.json", fmt::format("{{\"lat\": {:.10f}, \"lon\": {:.10f}, \"alt\": {:.4f}}}\n",
                                             origin.latitude_deg, origin.longitude_deg, origin.height_m));
  std::vector<PanoramaRow> rows;
  std::string panoramas = "# station tx ty tz qx qy qz qw: world_from_pano\n",
              tags = "tag_id,size_m,x,y,z,qx,qy,qz,qw\n", stations = "station,tag_id,east_m,north_m,up_m,sigma_m\n",
              control = "tag_id,latitude_deg,longitude_deg,height_m,sigma_h_m,sigma_v_m,role\n";
  for (size_t i = 0; i < site.panoramas.size(); ++i) {
    rows.push_back({fmt::format("panoramas/pano_{:03}.jpg", i), fmt::format("S{}", i), site.panoramas[i].geotag});
    panoramas += TumRow(std::to_string(i), site.truth.world_from_pano[i]);
    const Rigid3d tag = SyntheticWorldFromTag(site, options, i);
    const Eigen::Quaterniond& q = tag.rotation;
    tags += fmt::format("{},{:.4f},{:.6f},{:.6f},{:.6f},{:.9f},{:.9f},{:.9f},{:.9f}\n", i, options.tag_size_m,
                        tag.translation.x(), tag.translation.y(), tag.translation.z(), q.x(), q.y(), q.z(), q.w());
    const Vector3d offset = site.truth.world_from_pano[i].translation - tag.translation;
    stations += fmt::format("S{},{},{:.4f},{:.4f},{:.4f},0.001\n", i, i, offset.x(), offset.y(), offset.z());
    const Geodetic g = site.frame.GeodeticFromEnu(tag.translation);
    control += fmt::format("{},{:.10f},{:.10f},{:.4f},0.001,0.001,{}\n", i, g.latitude_deg, g.longitude_deg, g.height_m,
                           i < 3 ? "control" : "check");
  }
  if (rows.empty()) return;
  WritePanoramasCsv(dir / "panoramas.csv", rows);
  WriteText(truth / "panoramas.tum", panoramas);
  if (!options.tags) return;
  WriteText(dir / "stations.csv", stations);
  WriteText(dir / "control_points.csv", control);
  WriteText(dir / "tags.yaml", fmt::format("family: tag36h11\nsize_m: {}\n", options.tag_size_m));
  WriteText(truth / "tags.csv", tags);
}

// Photos of a set: a phone held level by somebody who turns once round. world_from_cam.
std::vector<Rigid3d> PhotoPoses(const Rigid3d& world_from_tag, double eye_above_tag_m, double arm_m, Random* random) {
  constexpr int kPhotos = 12;
  const Vector3d holder =
      world_from_tag.translation - 3 * (world_from_tag.rotation * Vector3d::UnitZ()) + Vector3d(0, 0, eye_above_tag_m);
  const double start = random->Uniform(0, 2 * M_PI);
  std::vector<Rigid3d> poses;
  for (int i = 0; i < kPhotos; ++i) {
    // Nobody turns in equal steps, or holds a phone quite level.
    const double heading = start + 2 * M_PI / kPhotos * (i + 0.1 * random->Normal());
    const Eigen::Quaterniond turn(
        WorldFromCamRotation({heading, 2 * kDegToRad * random->Normal(), 2 * kDegToRad * random->Normal()}));
    const Vector3d out = turn * Vector3d::UnitZ();
    const Vector3d sway(random->Normal(), random->Normal(), random->Normal());
    poses.emplace_back(turn, holder + arm_m * out + 0.1 * arm_m * sway);
  }
  return poses;
}

}  // namespace

Rigid3d SyntheticWorldFromTag(const SyntheticSite& site, const RenderedSiteOptions& options, size_t panorama) {
  const Vector3d& centre = site.truth.world_from_pano[panorama].translation;
  const auto nearest = std::min_element(
      site.truth.world_from_body.begin(), site.truth.world_from_body.end(), [&](const Rigid3d& a, const Rigid3d& b) {
        return (a.translation - centre).head<2>().squaredNorm() < (b.translation - centre).head<2>().squaredNorm();
      });
  const Vector3d into = centre - nearest->translation;  // the tag's z runs into it
  return {WorldFromCamRotation({std::atan2(into.x(), into.y()), 0, 0}), centre - Vector3d(0, 0, options.tag_below_m)};
}

Scene MakeScene(const SyntheticSite& site, const RenderedSiteOptions& options, uint64_t seed) {
  Random random(Random(seed).Next());
  Scene scene;
  std::vector<uint64_t> pictures;
  for (int i = 0; i < options.distinct_facades; ++i) pictures.push_back(random.Next());
  Vector3d low = site.truth.walls.front().a, high = low;
  for (size_t i = 0; i < site.truth.walls.size(); ++i) {
    const SyntheticWall& wall = site.truth.walls[i];
    FacadeOptions facade;
    facade.width_m = (wall.b - wall.a).norm();
    facade.height_m = wall.height;
    facade.px_per_m = options.px_per_m;
    facade.variety = options.variety;
    AddWall(wall.a, wall.b, wall.height,
            std::make_shared<Texture>(FacadeTexture(facade, pictures[i % pictures.size()])), &scene);
    for (const Vector3d& p : {wall.a, wall.b}) low = low.cwiseMin(p), high = high.cwiseMax(p);
  }
  const auto ground = [](double x, double y) { return Vector3d(x, y, SyntheticGroundHeight(x, y)); };
  const double margin = 5;
  const Vector3d corner = ground(low.x() - margin, high.y() + margin);
  const Vector3d right = ground(high.x() + margin, high.y() + margin) - corner;
  const Vector3d down = ground(low.x() - margin, low.y() - margin) - corner;
  // A picture of the ground may not outgrow 64 Mpx on long drives.
  const double px_per_m = std::min(0.6 * options.px_per_m, 8000 / std::sqrt(right.norm() * down.norm()));
  scene.planes.push_back(
      {corner, right, down,
       std::make_shared<Texture>(GroundTexture(right.norm(), down.norm(), px_per_m, random.Next()))});
  const Vector3d lift(0, 0, 2e-3);
  for (size_t i = 0; options.tags && i < site.panoramas.size(); ++i) {
    const Rigid3d tag = SyntheticWorldFromTag(site, options, i);
    const double full = options.tag_size_m * 10 / 8;
    const Eigen::Matrix3d r = tag.rotation.toRotationMatrix();
    scene.planes.push_back({tag * Vector3d(-full / 2, -full / 2, 0), full * r.col(0), full * r.col(1),
                            std::make_shared<Texture>(TagTexture(static_cast<int>(i), 24))});
    // Its back and its post.
    const auto grey = std::make_shared<Texture>(cv::Mat(4, 4, CV_8UC3, cv::Scalar(140, 140, 140)));
    scene.planes.push_back({tag * Vector3d(-full / 2, -full / 2, 0.01), full * r.col(0), full * r.col(1), grey});
    const double drop = tag.translation.z() - SyntheticGroundHeight(tag.translation.x(), tag.translation.y());
    scene.planes.push_back({tag * Vector3d(-0.03, 0, 0.012), 0.06 * r.col(0), drop * r.col(1), grey});
  }

  Random day(Random(seed).Next() + options.day);
  scene.sun = {day.Uniform(-1, 1), day.Uniform(-1, 1), day.Uniform(0.4, 1)};
  scene.ambient = day.Uniform(0.5, 0.8);
  const std::vector<Rigid3d>& path = site.truth.world_from_body;
  for (int i = 0; i < options.cars; ++i) {
    const Rigid3d& at = path[day.Below(path.size())];
    const Vector3d forward = at.rotation * Vector3d::UnitX(), left = at.rotation * Vector3d::UnitY();
    const double side = day.Uniform() < 0.5 ? -1 : 1;
    const Vector3d p = at.translation + side * day.Uniform(5, 8) * left;
    const uint64_t car = day.Next();
    // Nobody parks on a station, or on the drive.
    const auto near = [&](const Rigid3d& pose, double reach) {
      return (pose.translation - p).head<2>().norm() < reach;
    };
    if (std::any_of(site.truth.world_from_pano.begin(), site.truth.world_from_pano.end(),
                    [&](const Rigid3d& pose) { return near(pose, 4); }) ||
        std::any_of(path.begin(), path.end(), [&](const Rigid3d& pose) { return near(pose, 3); })) {
      continue;
    }
    AddCar(ground(p.x(), p.y()) + lift, forward.head<2>().normalized(), car, &scene);
  }
  return scene;
}

void WriteRenderedSite(const SyntheticSite& site, const RenderedSiteOptions& options, uint64_t seed,
                       const fs::path& dir, const fs::path& truth, int threads, ProgressSink& progress,
                       const CancelToken& cancel) {
  std::string problems;
  for (const std::string& problem : options.Check()) problems += (problems.empty() ? "" : "; ") + problem;
  if (!problems.empty()) throw OptionError("rendered site: " + problems);
  const Scene scene = MakeScene(site, options, seed);
  WriteRun(site, options, dir, truth);
  WriteTables(site, options, dir, truth);
  RenderOptions render;
  render.supersample = options.supersample;
  render.blur_sigma_px = options.blur_sigma_px;
  render.noise_sigma = options.noise_sigma;
  render.threads = threads;
  const size_t sets = std::min(static_cast<size_t>(options.photo_sets), site.panoramas.size());
  progress.Begin("rendering", static_cast<int64_t>(site.images.size() + site.panoramas.size() + sets));
  for (size_t i = 0; i < site.images.size(); ++i) {
    cancel.ThrowIfCancelled();
    render.seed = Random(seed + options.day).Next() + i;
    // Exposure wanders, as automatic exposure does.
    render.gain = 1 + 0.1 * std::sin(0.05 * static_cast<double>(i));
    const SyntheticImage& image = site.images[i];
    WritePicture(dir / "runs" / options.run / "images" / fmt::format("{:06}.jpg", i),
                 Render(scene, site.cameras[image.camera].camera, site.WorldFromCam(image), render));
    progress.Advance(1);
  }
  render.gain = 1;
  for (size_t i = 0; i < site.panoramas.size(); ++i) {
    cancel.ThrowIfCancelled();
    render.seed = Random(seed).Next() - i;
    const Camera camera = Camera::Equirectangular(options.panorama_width, options.panorama_width / 2);
    WritePicture(dir / "panoramas" / fmt::format("pano_{:03}.jpg", i),
                 Render(scene, camera, site.truth.world_from_pano[i], render));
    progress.Advance(1);
  }
  const Camera phone(CameraModel::kPinhole, 1600, 1200, {1331, 1331, 799.5, 599.5});
  for (size_t i = 0; i < sets; ++i) {
    cancel.ThrowIfCancelled();
    Random random(Random(seed).Next() + 1000 + i);
    const std::string name = fmt::format("set_{:03}", i);
    std::string rows = "# photo number tx ty tz qx qy qz qw: world_from_cam; pinhole, focal length 1331 px\n";
    int number = 0;
    for (const Rigid3d& pose :
         PhotoPoses(SyntheticWorldFromTag(site, options, i), options.tag_below_m, options.arm_m, &random)) {
      ++number;
      render.seed = random.Next();
      WritePicture(dir / "photos" / name / fmt::format("IMG_{:04}.jpg", number), Render(scene, phone, pose, render));
      rows += TumRow(std::to_string(number), pose);
    }
    WriteText(truth / "photos" / (name + ".tum"), rows);
    progress.Advance(1);
  }
}

}  // namespace trigpoint

#include "app/pipeline/localize_files.h"

#include <algorithm>
#include <map>

#include "calib/base/error.h"
#include "datasets/io/camchain.h"
#include "datasets/io/credits.h"
#include "datasets/io/csv.h"
#include "datasets/io/exif.h"
#include "datasets/io/image.h"
#include "datasets/io/motion_rates.h"
#include "datasets/io/source_quality.h"
#include "localize/reconstruct/rolling_shutter.h"
#include "localize/references/view_index.h"
#include "survey/panorama/refine_rig.h"
#include "survey/panorama/rig_files.h"

namespace trigpoint {
namespace {

// Odometry is interpolated across gaps up to a second, or three of its own steps.
int64_t LongestGap(const Trajectory& odometry) {
  std::vector<int64_t> steps;
  for (size_t i = 1; i < odometry.poses.size(); ++i) {
    steps.push_back(odometry.poses[i].stamp_ns - odometry.poses[i - 1].stamp_ns);
  }
  if (steps.empty()) return 0;
  std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
  return std::max<int64_t>(1'000'000'000, 3 * steps[steps.size() / 2]);
}

void PutPose(CsvWriter& csv, const Rigid3d& target_from_x) {
  for (int k = 0; k < 3; ++k) csv.Number(target_from_x.translation(k), 6);
  const Eigen::Quaterniond& q = target_from_x.rotation;
  csv.Number(q.x(), 9).Number(q.y(), 9).Number(q.z(), 9).Number(q.w(), 9);
}

void PutGeodetic(CsvWriter& csv, const LocalFrame& frame, const Eigen::Vector3d& enu) {
  const Geodetic g = frame.GeodeticFromEnu(enu);
  csv.Number(g.latitude_deg, 9).Number(g.longitude_deg, 9).Number(g.height_m, 4);
}

// Heading, pitch, roll sigmas (rad) of a world_from_x; NaN where there is no heading.
Eigen::Vector3d AttitudeSigmas(const PoseEstimate& e) {
  try {
    const Eigen::Matrix3d j = AttitudeJacobian(e.world_from_x.rotation);
    return (j * e.covariance.topLeftCorner<3, 3>() * j.transpose()).diagonal().cwiseMax(0).cwiseSqrt();
  } catch (const NumericError&) {
    return Eigen::Vector3d::Constant(std::nan(""));
  }
}

Eigen::Vector3d PositionSigmas(const PoseEstimate& e) {
  return e.covariance.diagonal().tail<3>().cwiseMax(0).cwiseSqrt();
}

void PutAttitude(CsvWriter& csv, const Eigen::Quaterniond& world_from_cam) {
  const Attitude a = AttitudeOf(world_from_cam);
  csv.Number(a.heading_rad * kRadToDeg, 4).Number(a.pitch_rad * kRadToDeg, 4).Number(a.roll_rad * kRadToDeg, 4);
}

std::string FrameComment(const char* table, const Localization& result) {
  return std::string("trigpoint ") + table + " 1; frame=" + (result.on_earth ? "enu" : "none") +
         "; datum=" + (result.on_earth ? result.earth_source : "none") + "; sigma=1";
}

Rigid3d CamFromOdom(const LocalizeInput& input, const Localization& result, const FrameImage& image) {
  return input.cameras[static_cast<size_t>(image.camera)].cam_from_body *
         result.body_from_odom[static_cast<size_t>(image.pose)];
}

}  // namespace

void PutWorldPose(CsvWriter& csv, const PoseEstimate& e) {
  PutPose(csv, e.world_from_x);
  for (double s : PositionSigmas(e)) csv.Number(s, 5);
}

void PutGeodeticPose(CsvWriter& csv, const LocalFrame& frame, const Rigid3d& world_from_x) {
  PutGeodetic(csv, frame, world_from_x.translation);
  PutAttitude(csv, world_from_x.rotation);
}

void WriteCameras(const LocalizeInput& input, const Localization& result, const std::filesystem::path& dir) {
  const bool in_odom = !result.body_from_odom.empty();
  for (size_t c = 0; c < input.cameras.size(); ++c) {
    if (input.cameras[c].IsFurtherView()) continue;  // its 360 image reports the pose
    std::vector<TimedPose> odom, world;
    for (size_t i = 0; i < input.images.size(); ++i) {
      const FrameImage& image = input.images[i];
      if (image.camera != static_cast<int>(c)) continue;
      if (in_odom) odom.push_back({image.stamp_ns, CamFromOdom(input, result, image).Inverse()});
      if (result.on_earth) world.push_back({image.stamp_ns, result.cameras[i].world_from_x});
    }
    const std::string suffix = c == 0 ? "" : "_" + input.cameras[c].name;
    const std::string& name = input.cameras[c].name;
    if (in_odom) {
      WriteTum(dir / ("cameras_odom" + suffix + ".tum"), odom,
               {"trigpoint trajectory 1; frame=odom (the run's own, optimised); pose=odom_from_" + name,
                "timestamp tx ty tz qx qy qz qw"});
    }
    if (result.on_earth) {
      WriteTum(dir / ("cameras" + suffix + ".tum"), world,
               {"trigpoint trajectory 1; frame=enu; datum=" + result.earth_source + "; pose=world_from_" + name,
                "timestamp tx ty tz qx qy qz qw"});
    }
  }
  if (!result.on_earth) return;
  CsvWriter csv({"timestamp",
                 "image",
                 "camera",
                 "x",
                 "y",
                 "z",
                 "qx",
                 "qy",
                 "qz",
                 "qw",
                 "latitude_deg",
                 "longitude_deg",
                 "height_m",
                 "sigma_e_m",
                 "sigma_n_m",
                 "sigma_u_m",
                 "heading_deg",
                 "pitch_deg",
                 "roll_deg",
                 "sigma_heading_deg",
                 "sigma_pitch_deg",
                 "sigma_roll_deg"},
                {FrameComment("cameras", result)});
  for (size_t i = 0; i < input.images.size(); ++i) {
    const PoseEstimate& e = result.cameras[i];
    const BodyCamera& camera = input.cameras[static_cast<size_t>(input.images[i].camera)];
    if (camera.IsFurtherView()) continue;
    csv.Stamp(input.images[i].stamp_ns).Text(input.images[i].name);
    csv.Text(camera.name);
    PutPose(csv, e.world_from_x);
    PutGeodetic(csv, input.frame, e.world_from_x.translation);
    for (double s : PositionSigmas(e)) csv.Number(s, 5);
    PutAttitude(csv, e.world_from_x.rotation);
    for (double s : AttitudeSigmas(e)) csv.Number(s * kRadToDeg, 5);
    csv.EndRow();
  }
  csv.Save(dir / "cameras.csv");
}

namespace {

// One line of panoramas.csv: a panorama or photo, or a set whose photos are answered together.
struct Line {
  const Reference* reference = nullptr;
  std::vector<size_t> answers;
};

struct LineAnswer {
  const ReferenceAnswer* shown = nullptr;
  bool answered = false;
  int matches = 0, inliers = 0, views = 0;
  Rigid3d odom_from_pano;
  PoseEstimate world;
};

// A set: its centre is the mean of its photos' centres, its attitude that of the first photo that has one.
LineAnswer AnswerOf(const Line& line, const Localization& result) {
  LineAnswer l;
  l.shown = &result.references[line.answers.front()];
  std::vector<const ReferenceAnswer*> good;
  for (size_t i : line.answers) {
    const ReferenceAnswer& a = result.references[i];
    l.matches += a.registration.view_matches;
    if (a.registration.status != AnswerStatus::kLocalized) continue;
    if (good.empty()) l.shown = &a;
    good.push_back(&a);
    for (const ViewObservation& o : a.registration.inliers) l.inliers += o.repeated ? 0 : 1;
    for (const ViewAnswer& v : a.registration.views) l.views += v.inliers > 0 ? 1 : 0;
  }
  l.answered = !good.empty();
  l.odom_from_pano = l.shown->registration.rig_from_odom.Inverse();
  l.world = l.shown->world;
  if (good.size() < 2) return l;
  // The photos of a set share the run's error: their mean is no better known than one of them.
  const double n = static_cast<double>(good.size());
  l.odom_from_pano.translation.setZero();
  l.world.world_from_x.translation.setZero();
  for (const ReferenceAnswer* a : good) {
    l.odom_from_pano.translation += a->registration.rig_from_odom.TargetOriginInSource() / n;
    l.world.world_from_x.translation += a->world.world_from_x.translation / n;
  }
  return l;
}

// How far the geotag lies from the estimated position, and what was made of it.
void PutGeotag(CsvWriter& csv, const GeoTag& tag, const LocalFrame& frame, const LineAnswer& l) {
  const Eigen::Vector3d d = frame.EnuFromGeodetic(tag.position) - l.world.world_from_x.translation;
  csv.Number(d.x(), 4).Number(d.y(), 4);
  if (tag.has_height) {
    csv.Number(d.z(), 4);
  } else {
    csv.Empty();
  }
  csv.Text(!l.shown->geotag_used ? "unused" : l.shown->geotag_outlier ? "outlier" : "ok");
}

void PutLine(CsvWriter& csv, const Line& line, const Localization& result, const LocalFrame& frame) {
  const LineAnswer l = AnswerOf(line, result);
  const Registration& g = l.shown->registration;
  const bool on_earth = l.answered && result.on_earth;
  csv.Text(line.reference->name).Text(line.reference->station).Text(AnswerStatusName(g.status)).Text(g.reason);
  if (on_earth) {
    PutWorldPose(csv, l.world);
  } else {
    csv.Empty(10);
  }
  csv.Integer(l.matches).Integer(l.inliers).Integer(l.views);
  if (l.answered) {
    PutPose(csv, l.odom_from_pano);
  } else {
    csv.Empty(7);
  }
  if (on_earth) {
    PutGeodeticPose(csv, frame, l.world.world_from_x);
  } else {
    csv.Empty(6);
  }
  const GeoTag& tag = line.reference->geotag;
  if (on_earth && tag.has_position) {
    PutGeotag(csv, tag, frame, l);
  } else {
    csv.Empty(3).Text(tag.has_position ? "unused" : "missing");
  }
  if (l.answered) {
    const Matrix6d odom_covariance = InverseCovariance(g.rig_from_odom, g.covariance);
    for (double s : odom_covariance.diagonal().tail<3>().cwiseMax(0).cwiseSqrt()) csv.Number(s, 5);
    csv.Number(g.matched_share, 4).Number(g.distance_m, 3);
  } else {
    csv.Empty(5);
  }
  csv.EndRow();
}

void WritePanoramas(const Site& site, const LocalizeJob& job, const Localization& result,
                    const std::filesystem::path& dir) {
  CsvWriter csv({"panorama",
                 "station",
                 "status",
                 "reason",
                 "x",
                 "y",
                 "z",
                 "qx",
                 "qy",
                 "qz",
                 "qw",
                 "sigma_x_m",
                 "sigma_y_m",
                 "sigma_z_m",
                 "view_matches",
                 "inliers",
                 "views",
                 "odom_x",
                 "odom_y",
                 "odom_z",
                 "odom_qx",
                 "odom_qy",
                 "odom_qz",
                 "odom_qw",
                 "latitude_deg",
                 "longitude_deg",
                 "height_m",
                 "heading_deg",
                 "pitch_deg",
                 "roll_deg",
                 "geotag_de_m",
                 "geotag_dn_m",
                 "geotag_du_m",
                 "geotag_status",
                 "odom_sigma_x_m",
                 "odom_sigma_y_m",
                 "odom_sigma_z_m",
                 "matched_share",
                 "distance_m"},
                {FrameComment("panoramas", result)});
  std::map<int, Line> lines;
  for (size_t i = 0; i < job.references.size(); ++i) {
    Line& line = lines[job.references[i].reference];
    line.reference = &site.references[static_cast<size_t>(job.references[i].reference)];
    line.answers.push_back(i);
  }
  for (const auto& [index, line] : lines) PutLine(csv, line, result, job.input.frame);
  csv.Save(dir / "panoramas.csv");
}

// A set's photo goes by its own name, whether it stands by itself or is a view of the set's rig.
const std::string& NameOfView(const Reference& reference, const PreparedReference& prepared, size_t view) {
  const bool lone_photo = reference.kind == ReferenceKind::kPhotoSet && prepared.rig.views.size() == 1;
  return lone_photo ? prepared.name : prepared.rig.views[view].name;
}

void WriteViews(const Site& site, const LocalizeJob& job, const Localization& result,
                const std::filesystem::path& dir) {
  CsvWriter csv({"panorama", "view", "status", "reason", "odom_x", "odom_y", "odom_z", "odom_qx", "odom_qy", "odom_qz",
                 "odom_qw", "inliers", "distance_m"},
                {"trigpoint views 1; frame=odom; each view by itself (G1)"});
  for (size_t i = 0; i < job.references.size(); ++i) {
    const PreparedReference& prepared = job.references[i];
    const Reference& reference = site.references[static_cast<size_t>(prepared.reference)];
    for (size_t v = 0; v < prepared.rig.views.size(); ++v) {
      const ViewAnswer& a = result.references[i].registration.views[v];
      csv.Text(reference.name).Text(NameOfView(reference, prepared, v));
      csv.Text(AnswerStatusName(a.status)).Text(a.reason);
      if (a.status == AnswerStatus::kLocalized) {
        PutPose(csv, a.view_from_odom.Inverse());
      } else {
        csv.Empty(7);
      }
      csv.Integer(a.inliers);
      if (a.status == AnswerStatus::kLocalized) {
        csv.Number(a.distance_m, 3);
      } else {
        csv.Empty();
      }
      csv.EndRow();
    }
  }
  csv.Save(dir / "views.csv");
}

// What each answer rests on: a point's pixel in an image of the run and in a view of the reference.
void WriteMatches(const Site& site, const LocalizeJob& job, const Localization& result,
                  const std::filesystem::path& dir) {
  CsvWriter csv({"panorama", "view", "image", "u_image", "v_image", "u_view", "v_view"},
                {"trigpoint matches 1; inliers of the answers; pixels: centre of the first is 0, 0"});
  const Reconstruction& r = result.reconstruction;
  const std::vector<BearingObservation>& observations = r.problem.observations;
  // Of a point in an image; null if there is none.
  const auto observation_of = [&](int point, int image) -> const BearingObservation* {
    auto it = std::partition_point(observations.begin(), observations.end(),
                                   [&](const BearingObservation& o) { return o.point < point; });
    for (; it != observations.end() && it->point == point; ++it) {
      if (r.image_of[static_cast<size_t>(it - observations.begin())] == image) return &*it;
    }
    return nullptr;
  };
  for (size_t i = 0; i < job.references.size(); ++i) {
    const PreparedReference& prepared = job.references[i];
    const Reference& reference = site.references[static_cast<size_t>(prepared.reference)];
    const Registration& g = result.references[i].registration;
    if (g.status != AnswerStatus::kLocalized) continue;
    for (const ViewObservation& o : g.inliers) {
      const BearingObservation* const seen = observation_of(o.point, o.image);
      if (seen == nullptr) continue;
      const FrameImage& image = job.input.images[static_cast<size_t>(o.image)];
      const Camera& camera = job.input.cameras[static_cast<size_t>(image.camera)].camera;
      const auto pixel = camera.Project(seen->ray.cast<double>());
      if (!pixel) continue;
      csv.Text(reference.name).Text(NameOfView(reference, prepared, static_cast<size_t>(o.view)));
      csv.Text(image.name).Number(pixel->x(), 2).Number(pixel->y(), 2);
      // In the pixels of the view or photo as it is.
      const Camera& as_is = prepared.rig.views[static_cast<size_t>(o.view)].camera;
      const Camera& matched = job.input.references[i].rig.views[static_cast<size_t>(o.view)].camera;
      csv.Number((o.pixel.x() + 0.5) * as_is.width() / matched.width() - 0.5, 2);
      csv.Number((o.pixel.y() + 0.5) * as_is.height() / matched.height() - 0.5, 2).EndRow();
    }
  }
  csv.Save(dir / "matches.csv");
}

// Photo sets that are stitched become one reference each, with the photos as views; they leave `prepared`.
void AddStitchedSets(const Site& site, const std::map<std::string, std::filesystem::path>& rigs,
                     const FeatureStore& store, std::vector<PreparedReference>* prepared,
                     std::vector<std::vector<std::string>>* names_of, LocalizeJob* job) {
  for (size_t k = 0; k < site.references.size(); ++k) {
    const Reference& reference = site.references[k];
    const auto found = rigs.find(reference.name);
    if (reference.kind != ReferenceKind::kPhotoSet || found == rigs.end()) continue;
    if (!std::filesystem::exists(found->second / "rig.csv")) continue;
    RigFile file;
    try {
      file = ReadRigFiles(found->second);
    } catch (const InputError& e) {
      job->warnings.push_back(std::string(e.what()) + "; the photos of " + reference.name + " are used one by one");
      continue;
    }
    ReferenceViews r;
    r.name = r.rig.name = reference.name;
    r.station = reference.station;
    r.kind = reference.kind;
    r.geotag = reference.geotag;
    r.stitched = true;
    ViewRig stitched;
    stitched.name = reference.name;
    std::vector<std::string> names;
    bool complete = true;
    for (const View& view : file.rig.views) {
      const auto photo = std::find_if(prepared->begin(), prepared->end(), [&](const PreparedReference& p) {
        return p.reference == static_cast<int>(k) && std::filesystem::path(p.name).filename() == view.name;
      });
      complete = complete && photo != prepared->end() && store.Has(photo->name + "#" + photo->rig.views.front().name);
      if (!complete) break;
      names.push_back(photo->name + "#" + photo->rig.views.front().name);
      stitched.views.push_back(view);
      r.rig.views.push_back(view);
      r.rig.views.back().camera = MatchedCamera(site, view.camera);
    }
    if (!complete) {
      job->warnings.push_back("the rig of " + reference.name +
                              " names photos without features; its photos are used one by one");
      continue;
    }
    std::erase_if(*prepared, [&](const PreparedReference& p) { return p.reference == static_cast<int>(k); });
    RefineRigInput as_stitched;
    as_stitched.rig = stitched;
    as_stitched.shape_covariance = file.shape_covariance;
    as_stitched.log_scale_sigma = file.radius_log_sigma;
    r.errors.poses = StitchedViewCovariance(as_stitched);
    job->shapes[static_cast<int>(job->references.size())] = {file.shape_covariance, file.radius_log_sigma};
    job->references.push_back({static_cast<int>(k), reference.name, std::move(stitched)});
    names_of->push_back(std::move(names));
    job->input.references.push_back(std::move(r));
  }
}

// 1 sigma of a photo's focal length, a share of it: that of EXIF where nobody calibrated its camera.
double FocalShare(const Site& site, const Reference& reference, const PreparedReference& prepared) {
  if (reference.kind == ReferenceKind::kPhotoSet) return kExifFocalSigma;
  if (reference.kind == ReferenceKind::kPanorama) return 0;
  const std::optional<Camera> exif = CameraFromMetadata(ReadPhotoMetadata(site.dir / prepared.name));
  const Camera& camera = prepared.rig.views.front().camera;
  return exif && exif->model() == camera.model() && exif->params() == camera.params() ? kExifFocalSigma : 0;
}

}  // namespace

LocalizeJob MakeRunJob(const Run& run, const std::filesystem::path& run_features) {
  LocalizeJob job;
  LocalizeInput& input = job.input;
  input.cameras = run.cameras;
  input.levelled = run.config.odometry_levelled;
  input.scale_sigma = run.config.odometry_scale_sigma;
  input.has_odometry = !run.odometry.poses.empty();
  const int64_t gap = input.has_odometry ? LongestGap(run.odometry) : 0;
  const auto store = std::make_shared<FeatureStore>(run_features);
  std::map<int64_t, int> pose_of;
  std::vector<ImageEntry> entries;
  // Sorted by the moments they show: cameras with clocks of their own may list them in another order.
  std::vector<std::pair<int64_t, const ImageEntry*>> by_moment;
  for (const ImageEntry& entry : run.images) {
    by_moment.emplace_back(BodyStamp(entry.stamp_ns, run.cameras[static_cast<size_t>(entry.camera)]), &entry);
  }
  std::stable_sort(by_moment.begin(), by_moment.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [stamp, its] : by_moment) {
    const ImageEntry& entry = *its;
    if (!store->Has(entry.file)) {
      ++job.without_features;
      continue;
    }
    const std::optional<Rigid3d> odom_from_body = input.has_odometry ? run.odometry.At(stamp, gap) : Rigid3d();
    if (!odom_from_body) {
      ++job.without_odometry;
      continue;
    }
    const auto [it, fresh] = pose_of.try_emplace(stamp, static_cast<int>(input.pose_stamps.size()));
    if (fresh) {
      input.pose_stamps.push_back(stamp);
      input.odom_from_body.push_back(*odom_from_body);
    }
    input.images.push_back({entry.stamp_ns, entry.file, entry.camera, it->second});
    entries.push_back(entry);
  }
  if (job.without_odometry > 0) {
    job.warnings.push_back("run " + run.name + ": " + std::to_string(job.without_odometry) +
                           " images are not covered by odometry and are left out");
  }
  if (input.pose_stamps.size() < 2 && !input.has_odometry) {
    throw InputError("run " + run.name + ": fewer than 2 images have features (" +
                     std::to_string(job.without_features) + " of " + std::to_string(run.images.size()) +
                     " have none; the features stage names those that cannot be read or have another size than the "
                     "camera's)");
  }
  if (input.pose_stamps.size() < 2) {
    throw InputError("run " + run.name + ": fewer than 2 images have features and odometry at their time (" +
                     std::to_string(job.without_odometry) + " of " + std::to_string(run.images.size()) +
                     " lie outside odometry's time; check odometry.time_offset_s in run.yaml)");
  }
  input.body_rates = RatesAt(run.odometry, input.pose_stamps);
  input.image_features = [store, images = input.images, cameras = input.cameras, rates = input.body_rates](int i) {
    const FrameImage& image = images[static_cast<size_t>(i)];
    const BodyCamera& camera = cameras[static_cast<size_t>(image.camera)];
    return AtImageTime(store->Read(image.name), camera, rates[static_cast<size_t>(image.pose)]);
  };
  input.image_picture = [run = std::make_shared<const Run>(run), entries = std::move(entries)](int i) {
    try {
      return LoadGrey(*run, entries[static_cast<size_t>(i)]);
    } catch (const InputError&) {
      return cv::Mat();  // the features stage has read it; it has gone or changed since
    }
  };
  return job;
}

LocalizeJob MakeLocalizeJob(const Site& site, const Run& run, bool has_frame, const LocalFrame& frame,
                            const std::filesystem::path& run_features,
                            const std::vector<std::filesystem::path>& reference_results, const ViewOptions& views,
                            const std::map<std::string, std::filesystem::path>& rigs) {
  LocalizeJob job = MakeRunJob(run, run_features);
  job.warnings.clear();  // of the run: `reconstruct` warns
  LocalizeInput& input = job.input;
  input.has_frame = has_frame;
  input.frame = frame;
  std::vector<std::filesystem::path> databases;
  for (const std::filesystem::path& result : reference_results) databases.push_back(result / kFeaturesFile);
  const auto reference_store = std::make_shared<FeatureStore>(databases);
  std::vector<PreparedReference> prepared = PrepareReferences(site, views, &job.warnings);
  std::vector<std::vector<std::string>> names_of;  // of each reference's views in the store
  AddStitchedSets(site, rigs, *reference_store, &prepared, &names_of, &job);
  const std::map<std::string, PictureCredit> credits = ReadCredits(site.dir);
  for (PreparedReference& p : prepared) {
    if (!reference_store->Has(p.name + "#" + p.rig.views.front().name)) continue;
    const Reference& reference = site.references[static_cast<size_t>(p.reference)];
    const bool lone_photo = reference.kind == ReferenceKind::kPhotoSet && !reference.camera;
    if (lone_photo && !CameraFromMetadata(ReadPhotoMetadata(site.dir / p.name))) {
      job.warnings.push_back(p.name +
                             ": its focal length is unknown; `trigpoint stitch` estimates it from the whole set");
      continue;
    }
    names_of.emplace_back();
    for (const View& v : p.rig.views) names_of.back().push_back(p.name + "#" + v.name);
    ReferenceViews r;
    r.name = p.name;
    r.station = reference.station;
    r.kind = reference.kind;
    r.rig = p.rig;
    if (reference.kind != ReferenceKind::kPanorama) {
      for (View& view : r.rig.views) view.camera = MatchedCamera(site, view.camera);
    }
    r.geotag = reference.geotag;
    if (const auto credit = credits.find(reference.name); credit != credits.end()) {
      if (QualityOfSource(credit->second.source) != nullptr) r.source = credit->second.source;
    }
    if (reference.kind == ReferenceKind::kPhotoSet) r.set = p.reference;
    r.errors.focal_share = FocalShare(site, reference, p);
    input.references.push_back(std::move(r));
    job.references.push_back(std::move(p));
  }
  // In the pixels of the camera they are matched with.
  std::vector<std::vector<std::pair<Camera, Camera>>> sizes;
  for (size_t i = 0; i < job.references.size(); ++i) {
    sizes.emplace_back();
    for (size_t v = 0; v < job.references[i].rig.views.size(); ++v) {
      sizes.back().emplace_back(job.references[i].rig.views[v].camera, input.references[i].rig.views[v].camera);
    }
  }
  input.view_features = [reference_store, names_of, sizes](int reference, int view) {
    const auto r = static_cast<size_t>(reference), v = static_cast<size_t>(view);
    return ResizedFeatures(reference_store->Read(names_of[r][v]), sizes[r][v].first, sizes[r][v].second);
  };
  input.view_index = [reference_results, names_of] { return MapViewIndex(reference_results, names_of); };

  if (has_frame) {
    const int64_t gap = input.has_odometry ? LongestGap(run.odometry) : 0;
    for (const GpsFix& fix : run.gps) {
      const auto it = std::lower_bound(input.pose_stamps.begin(), input.pose_stamps.end(), fix.stamp_ns);
      size_t at = static_cast<size_t>(it - input.pose_stamps.begin());
      if (at == input.pose_stamps.size() ||
          (at > 0 && fix.stamp_ns - input.pose_stamps[at - 1] < input.pose_stamps[at] - fix.stamp_ns))
        --at;
      if (std::llabs(input.pose_stamps[at] - fix.stamp_ns) > 300'000'000) continue;
      GpsPlace g;
      g.pose = static_cast<int>(at);
      g.arm_m = run.config.gps_lever_arm_m;
      // The pose is that of an image: the run has moved between its time and the fix's.
      if (const auto then = input.has_odometry ? run.odometry.At(fix.stamp_ns, gap) : std::nullopt)
        g.arm_m = input.odom_from_body[at].Inverse() * (*then * g.arm_m);
      g.position = frame.EnuFromGeodetic(fix.position);
      g.sigma_h_m = fix.sigma_h_m, g.sigma_v_m = fix.sigma_v_m;
      g.stamp_ns = fix.stamp_ns;
      job.gps.push_back(g);
    }
  }
  return job;
}

Trajectory FirstCameraTrajectory(const LocalizeJob& job, const Localization& result) {
  Trajectory trajectory;
  for (const FrameImage& image : job.input.images) {
    if (image.camera != 0) continue;
    trajectory.poses.push_back(
        {job.input.pose_stamps[static_cast<size_t>(image.pose)], CamFromOdom(job.input, result, image).Inverse()});
  }
  return trajectory;
}

void WriteLocalization(const Site& site, const LocalizeJob& job, const Localization& result,
                       const std::filesystem::path& dir) {
  WriteCameras(job.input, result, dir);
  WritePanoramas(site, job, result, dir);
  WriteViews(site, job, result, dir);
  WriteMatches(site, job, result, dir);
}

}  // namespace trigpoint

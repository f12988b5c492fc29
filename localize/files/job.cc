#include "localize/files/job.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <utility>

#include "calib/base/error.h"
#include "calib/base/median.h"
#include "datasets/io/camchain.h"
#include "datasets/io/credits.h"
#include "datasets/io/exif.h"
#include "datasets/io/gps.h"
#include "datasets/io/image.h"
#include "datasets/io/motion_rates.h"
#include "datasets/io/odometry_limits.h"
#include "datasets/io/rig_file.h"
#include "datasets/io/run_parts.h"
#include "datasets/io/source_quality.h"
#include "localize/files/view_pictures.h"
#include "localize/reconstruct/feature_store.h"
#include "localize/reconstruct/rolling_shutter.h"
#include "localize/references/view_index.h"

namespace trigpoint {
namespace {

using NamesOfViews = std::vector<std::vector<std::string>>;  // of each reference, in its feature store

// Odometry is interpolated across gaps up to a second, or three of its own steps.
int64_t LongestGap(const Trajectory& odometry) {
  std::vector<int64_t> steps;
  for (size_t i = 1; i < odometry.poses.size(); ++i) {
    steps.push_back(odometry.poses[i].stamp_ns - odometry.poses[i - 1].stamp_ns);
  }
  if (steps.empty()) return 0;
  return std::max<int64_t>(1'000'000'000, 3 * Median(std::move(steps)));
}

// As features are stored.
std::string NameOfView(const PreparedReference& p, const View& view) { return p.name + "#" + view.name; }

// A stitched set: one reference with the photos as views.
struct SetAsReference {
  ReferenceViews reference;  // with the cameras that photos are matched with
  ViewRig rig;               // with the photos' own
  std::vector<std::string> names;
};

// Nothing where the rig names a photo without features.
std::optional<SetAsReference> SetOf(const Site& site, int index, const ViewRig& rig, const FeatureStore& store,
                                    const std::vector<PreparedReference>& prepared) {
  const Reference& reference = site.references[static_cast<size_t>(index)];
  SetAsReference set;
  ReferenceViews& r = set.reference;
  r.name = r.rig.name = set.rig.name = reference.name;
  r.station = reference.station;
  r.kind = reference.kind;
  r.geotag = reference.geotag;
  r.stitched = true;
  for (const View& view : rig.views) {
    const auto photo = std::find_if(prepared.begin(), prepared.end(), [&](const PreparedReference& p) {
      return p.reference == index && std::filesystem::path(p.name).filename() == view.name;
    });
    if (photo == prepared.end()) return std::nullopt;
    std::string name = NameOfView(*photo, photo->rig.views.front());
    if (!store.Has(name)) return std::nullopt;
    set.names.push_back(std::move(name));
    set.rig.views.push_back(view);
    r.rig.views.push_back(view);
    r.rig.views.back().camera = MatchedCamera(site, view.camera);
  }
  return set;
}

// Photo sets that are stitched become one reference each, with the photos as views; they leave `prepared`.
void AddStitchedSets(const Site& site, const std::map<std::string, std::filesystem::path>& rigs,
                     const FeatureStore& store, std::vector<PreparedReference>* prepared, NamesOfViews* names_of,
                     LocalizeJob* job) {
  for (size_t k = 0; k < site.references.size(); ++k) {
    const Reference& reference = site.references[k];
    const int index = static_cast<int>(k);
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
    std::optional<SetAsReference> set = SetOf(site, index, file.rig, store, *prepared);
    if (!set) {
      job->warnings.push_back("the rig of " + reference.name +
                              " names photos without features; its photos are used one by one");
      continue;
    }
    std::erase_if(*prepared, [&](const PreparedReference& p) { return p.reference == index; });
    RefineRigInput as_stitched;
    as_stitched.rig = set->rig;
    as_stitched.shape_covariance = file.shape_covariance;
    as_stitched.log_scale_sigma = file.radius_log_sigma;
    set->reference.errors.poses = StitchedViewCovariance(as_stitched);
    job->shapes[static_cast<int>(job->references.size())] = {file.shape_covariance, file.radius_log_sigma};
    job->references.push_back({index, reference.name, std::move(set->rig)});
    names_of->push_back(std::move(set->names));
    job->input.references.push_back(std::move(set->reference));
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

// Panoramas and photos that stand for themselves.
void AddReferences(const Site& site, const FeatureStore& store, std::vector<PreparedReference> prepared,
                   NamesOfViews* names_of, LocalizeJob* job) {
  const std::map<std::string, PictureCredit> credits = ReadCredits(site.dir);
  for (PreparedReference& p : prepared) {
    if (!store.Has(NameOfView(p, p.rig.views.front()))) continue;
    const Reference& reference = site.references[static_cast<size_t>(p.reference)];
    const bool lone_photo = reference.kind == ReferenceKind::kPhotoSet && !reference.camera;
    if (lone_photo && !CameraFromMetadata(ReadPhotoMetadata(site.dir / p.name))) {
      job->warnings.push_back(p.name +
                              ": its focal length is unknown; `trigpoint stitch` estimates it from the whole set");
      continue;
    }
    names_of->emplace_back();
    for (const View& v : p.rig.views) names_of->back().push_back(NameOfView(p, v));
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
    job->input.references.push_back(std::move(r));
    job->references.push_back(std::move(p));
  }
}

// Features of views in the pixels of the camera they are matched with.
std::function<FeatureSet(int reference, int view)> ViewFeatures(const std::shared_ptr<const FeatureStore>& store,
                                                                const NamesOfViews& names_of, const LocalizeJob& job) {
  std::vector<std::vector<std::pair<Camera, Camera>>> sizes;
  for (size_t i = 0; i < job.references.size(); ++i) {
    sizes.emplace_back();
    for (size_t v = 0; v < job.references[i].rig.views.size(); ++v) {
      sizes.back().emplace_back(job.references[i].rig.views[v].camera, job.input.references[i].rig.views[v].camera);
    }
  }
  return [store, names_of, sizes](int reference, int view) {
    const auto r = static_cast<size_t>(reference), v = static_cast<size_t>(view);
    return ResizedFeatures(store->Read(names_of[r][v]), sizes[r][v].first, sizes[r][v].second);
  };
}

// The pictures that the references' features are from.
std::vector<ReferenceFiles> FilesOf(const Site& site, const NamesOfViews& names_of, const LocalizeInput& input) {
  std::vector<ReferenceFiles> files;
  for (size_t i = 0; i < names_of.size(); ++i) {
    const ReferenceViews& views = input.references[i];
    ReferenceFiles& r = files.emplace_back();
    r.panorama = views.kind == ReferenceKind::kPanorama;
    r.rig = views.rig;
    for (const std::string& name : names_of[i]) r.files.push_back(site.dir / name.substr(0, name.rfind('#')));
  }
  return files;
}

// Of the body about a pose, m/s, by odometry.
double SpeedAt(const LocalizeInput& input, size_t pose) {
  const size_t a = pose > 0 ? pose - 1 : 0, b = std::min(pose + 1, input.pose_stamps.size() - 1);
  const double time_s = 1e-9 * static_cast<double>(input.pose_stamps[b] - input.pose_stamps[a]);
  if (!(time_s > 0)) return 0;
  return (input.odom_from_body[b].translation - input.odom_from_body[a].translation).norm() / time_s;
}

// The run's fixes at the times of its poses.
std::vector<GpsPlace> GpsPlaces(const Run& run, const LocalizeInput& input) {
  std::vector<GpsPlace> places;
  const int64_t gap = input.has_odometry ? LongestGap(run.odometry) : 0;
  for (const GpsFix& fix : run.gps) {
    const auto at = NearestToFix(input.pose_stamps, fix);
    if (!at) continue;
    GpsPlace g;
    g.pose = static_cast<int>(*at);
    g.arm_m = run.config.gps_lever_arm_m;
    // The pose is that of an image: the run has moved between its time and the fix's.
    if (const auto then = input.has_odometry ? run.odometry.At(fix.stamp_ns, gap) : std::nullopt)
      g.arm_m = input.odom_from_body[*at].Inverse() * (*then * g.arm_m);
    g.position = input.frame.EnuFromGeodetic(fix.position);
    g.sigma_h_m = fix.sigma_h_m, g.sigma_v_m = fix.sigma_v_m, g.sigma_sea_m = fix.sigma_sea_m;
    // EXIF states a picture's time and place together.
    if (input.time_resolution_s > 0 && GpsFile(run.dir)) {
      const double late_m = SpeedAt(input, *at) * input.time_resolution_s / std::sqrt(3.0);
      g.sigma_h_m = std::hypot(g.sigma_h_m, late_m);
    }
    g.stamp_ns = fix.stamp_ns;
    places.push_back(g);
  }
  return places;
}

// Sorted by the moments they show: cameras with clocks of their own may list them in another order.
std::vector<std::pair<int64_t, const ImageEntry*>> ImagesByMoment(const Run& run) {
  std::vector<std::pair<int64_t, const ImageEntry*>> by_moment;
  for (const ImageEntry& entry : run.images) {
    by_moment.emplace_back(BodyStamp(entry.stamp_ns, run.cameras[static_cast<size_t>(entry.camera)]), &entry);
  }
  std::stable_sort(by_moment.begin(), by_moment.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  return by_moment;
}

// The images with features and odometry, and the poses of their moments. Returns them as the run lists them.
std::vector<ImageEntry> AddImages(const Run& run, const FeatureStore& store, LocalizeJob* job) {
  LocalizeInput& input = job->input;
  const int64_t gap = input.has_odometry ? LongestGap(run.odometry) : 0;
  std::map<int64_t, int> pose_of;
  std::vector<ImageEntry> entries;
  for (const auto& [stamp, its] : ImagesByMoment(run)) {
    const ImageEntry& entry = *its;
    if (!store.Has(entry.file)) {
      ++job->without_features;
      continue;
    }
    const std::optional<Rigid3d> odom_from_body = input.has_odometry ? run.odometry.At(stamp, gap) : Rigid3d();
    if (!odom_from_body) {
      ++job->without_odometry;
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
  return entries;
}

void RequireTwoPoses(const Run& run, const LocalizeJob& job) {
  if (job.input.pose_stamps.size() >= 2) return;
  const std::string given = std::to_string(run.images.size());
  if (!job.input.has_odometry) {
    throw InputError("run " + run.name + ": fewer than 2 images have features (" +
                     std::to_string(job.without_features) + " of " + given +
                     " have none; the features stage names those that cannot be read or have another size than the "
                     "camera's)");
  }
  throw InputError(
      fmt::format("run {}: fewer than 2 images can be used: of {} images {} have no features, {} lie outside "
                  "odometry's time; check the warnings of the features stage, or odometry: time_offset_s in run.yaml",
                  run.name, given, job.without_features, job.without_odometry));
}

// Heights of GPS that cannot be above the ellipsoid are taken as above the sea, as far as that may be from it.
void DoubtGpsHeights(const Site& site, const Run& run, LocalizeJob* job) {
  const std::string why = job->gps.empty() ? "" : GpsHeightContradiction(site, run);
  if (why.empty()) return;
  job->warnings.push_back(why + fmt::format("; a common error of {:.0f} m (1 sigma) is assumed", kUnknownGeoidSigma));
  for (GpsPlace& place : job->gps) {
    if (place.sigma_sea_m > 0 || place.sigma_v_m >= kUnknownHeightSigma) continue;
    place.sigma_sea_m = kUnknownGeoidSigma;
    place.sigma_v_m = std::hypot(place.sigma_v_m, kUnknownGeoidSigma);
  }
}

void WarnOfLimits(const Run& run, LocalizeJob* job) {
  if (job->input.flat) {
    job->warnings.push_back(
        fmt::format("{}: has no heights, no roll and no pitch (they never change): these are taken as unknown, on "
                    "ground that slopes by 3 deg (1 sigma), and odometry as not levelled",
                    (run.dir / "odometry.tum").string()));
  }
  if (job->input.time_resolution_s > 0) {
    job->warnings.push_back(
        fmt::format("{}: the times of its images are whole seconds, and uneven; expected times to a millisecond, as "
                    "odometry has them. Each is taken to be off by up to {:g} s, and odometry counts for less",
                    run.dir.string(), job->input.time_resolution_s));
  }
}

}  // namespace

LocalizeJob MakeRunJob(const Run& run, const std::filesystem::path& run_features) {
  LocalizeJob job;
  LocalizeInput& input = job.input;
  input.cameras = run.cameras;
  input.flat = IsFlat(run.odometry);
  input.levelled = run.config.odometry_levelled && !input.flat;
  input.time_resolution_s = TimeResolution(run);
  input.scale_sigma = run.config.odometry_scale_sigma;
  input.has_odometry = !run.odometry.poses.empty();
  const auto store = std::make_shared<FeatureStore>(run_features);
  std::vector<ImageEntry> entries = AddImages(run, *store, &job);
  if (job.without_odometry > 0) {
    job.warnings.push_back("run " + run.name + ": " + std::to_string(job.without_odometry) +
                           " images are not covered by odometry and are left out");
  }
  RequireTwoPoses(run, job);
  WarnOfLimits(run, &job);
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
  const auto store = std::make_shared<const FeatureStore>(databases);
  std::vector<PreparedReference> prepared = PrepareReferences(site, views, &job.warnings);
  NamesOfViews names_of;
  AddStitchedSets(site, rigs, *store, &prepared, &names_of, &job);
  AddReferences(site, *store, std::move(prepared), &names_of, &job);
  input.view_features = ViewFeatures(store, names_of, job);
  input.reference_pictures = PicturesOf(FilesOf(site, names_of, input));
  input.view_index = [reference_results, names_of] { return MapViewIndex(reference_results, names_of); };
  if (has_frame) job.gps = GpsPlaces(run, input);
  DoubtGpsHeights(site, run, &job);
  return job;
}

}  // namespace trigpoint

#include "localize/reconstruct/feature_store.h"

#include <atomic>
#include <memory>
#include <mutex>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/base/error.h"
#include "calib/base/parallel.h"
#include "calib/camera/shrunk_picture.h"
#include "datasets/io/exif.h"
#include "datasets/io/image.h"
#include "datasets/io/mask.h"

namespace trigpoint {
namespace {

// Pictures are written in order, so that the database does not depend on the threads: so many may wait.
constexpr int kAhead = 16;
// A photo's focal length in pixels, at most so many times that of the runs' finest camera: what a camera would show
// from somewhat nearer.
constexpr double kFinest = 1.3;

std::string ViewName(const PreparedReference& reference, size_t view) {
  return reference.name + "#" + reference.rig.views[view].name;
}

std::string RelativeName(const std::filesystem::path& file, const Site& site) {
  return file.lexically_relative(site.dir).generic_string();
}

void RequireSome(const ExtractionReport& report, const std::string& what) {
  if (report.pictures > 0) return;
  std::string message = what + ": no picture can be used";
  if (!report.skipped.empty()) message += "; the first: " + report.skipped.front();
  throw InputError(message);
}

// Width of a panorama as LoadPanorama gives it.
int WidthOfPanorama(const PhotoMetadata& metadata) {
  const std::optional<SpherePart> lies = PartOfSphere(metadata.gpano, metadata.ShownSize());
  return lies ? lies->sphere.width : metadata.ShownSize().width;
}

// Of a photo of a set: some of its photos may be turned or zoomed. One whose EXIF states no focal length has that of
// the set's first; without any, one that is of use once the set is stitched (localize leaves the photo out before).
Camera CameraInSet(const Reference& set, PhotoMetadata metadata) {
  if (!metadata.focal_px && set.camera) {
    const double side = std::max(metadata.width, metadata.height);
    metadata.focal_px = set.camera->MeanFocal() * side / std::max(set.camera->width(), set.camera->height());
  }
  if (const std::optional<Camera> own = CameraFromMetadata(metadata)) return *own;
  return Camera::FromFieldOfView(metadata.ShownSize().width, metadata.ShownSize().height, 65 * kDegToRad);
}

// A view of a reference to be looked at.
struct ViewJob {
  size_t reference, view;
};

// A reference's picture, read by the first worker that comes to one of its views and dropped by the last.
class ReferencePicture {
 public:
  explicit ReferencePicture(size_t views) : features(views), left_(views) {}

  void Extract(const Site& site, const PreparedReference& p, size_t v, const FeatureStageOptions& options,
               RendererOfSize* renderers) {
    std::call_once(read_, [&] { Read(site, p, renderers); });
    if (problem.empty() && renderer_) {
      const cv::Mat mask = mask_.empty() ? cv::Mat() : cv::Mat(renderer_->Render(mask_, v) == 255);
      features[v] = ExtractFeatures(renderer_->Render(picture_, v), mask, options.references);
    } else if (problem.empty()) {
      const Camera& camera = p.rig.views[v].camera;
      const Camera matched = MatchedCamera(site, camera);
      const cv::Mat reduced = AsMatched(picture_, matched);
      const cv::Mat mask = ReducedMask(mask_, reduced.size());
      features[v] = ResizedFeatures(ExtractFeatures(reduced, mask, options.references), matched, camera);
    }
    if (--left_ > 0) return;
    picture_.release();
    mask_.release();
  }

  std::vector<FeatureSet> features;  // of each view
  std::string problem;               // why it cannot be used

 private:
  void Read(const Site& site, const PreparedReference& p, RendererOfSize* renderers) {
    const std::filesystem::path file = site.dir / p.name;
    const Reference& reference = site.references[static_cast<size_t>(p.reference)];
    try {
      if (reference.kind == ReferenceKind::kPanorama) {
        const cv::Mat panorama = LoadPanorama(file, true);
        renderer_ = renderers->Get(p.rig, panorama.size());
        picture_ = renderer_->Prepare(panorama);
        const cv::Mat mask = ReferenceMask(reference, file, panorama.size());
        if (!mask.empty()) mask_ = renderer_->Prepare(mask);
        return;
      }
      picture_ = LoadPicture(file, true);
      mask_ = ReferenceMask(reference, file, picture_.size());
      const Camera& camera = p.rig.views.front().camera;
      if (picture_.cols == camera.width() && picture_.rows == camera.height()) return;
      throw InputError(file.string() + ": is " + std::to_string(picture_.cols) + " x " + std::to_string(picture_.rows) +
                       " px, its camera's calibration " + std::to_string(camera.width()) + " x " +
                       std::to_string(camera.height()));
    } catch (const InputError& e) {
      problem = e.what();
    }
  }

  std::once_flag read_;
  std::atomic<size_t> left_;
  cv::Mat picture_, mask_;                        // as its views are drawn from; no mask: nothing is ignored
  std::shared_ptr<const ViewRenderer> renderer_;  // of a panorama
};

}  // namespace

ExtractionReport ExtractRunFeatures(const Run& run, const FeatureOptions& options, const FeaturesBefore& before,
                                    const std::filesystem::path& out, int threads, ProgressSink& progress,
                                    const CancelToken& cancel) {
  cv::setNumThreads(1);  // whole pictures in parallel use the cores better than parts of one
  CheckMasks(run, threads, progress, cancel);
  ExtractionReport report;
  KeptFeatures kept(before, out);
  ColmapDatabase database = ColmapDatabase::Create(out / kFeaturesFile);
  database.Begin();
  std::vector<uint32_t> cameras;
  const RunMasks masks(run);
  for (const BodyCamera& c : run.cameras) {
    cameras.push_back(database.AddCamera(c.camera));
  }
  const size_t n = run.images.size();
  progress.Begin("features of " + run.name, static_cast<int64_t>(n));
  std::vector<FeatureSet> features(n);
  std::vector<std::string> problems(n), sources(n);
  const auto extract = [&](int64_t i) {
    const size_t k = static_cast<size_t>(i);
    const ImageEntry& entry = run.images[k];
    try {
      const cv::Mat mask = masks.ForFeatures(entry);
      sources[k] = kept.SourceOf(run, entry, mask, options);
      if (!kept.Has(entry.file, sources[k])) features[k] = ExtractFeatures(LoadGrey(run, entry), mask, options);
    } catch (const InputError& e) {
      problems[k] = e.what();
    }
    progress.Advance(1);
  };
  const auto write = [&](int64_t i) {
    const size_t k = static_cast<size_t>(i);
    const ImageEntry& entry = run.images[k];
    if (!problems[k].empty()) {
      report.skipped.push_back(problems[k]);
      progress.Log(LogLevel::kWarning, "skipped: " + problems[k]);
      return;
    }
    const uint32_t id = database.AddImage(entry.file, cameras[static_cast<size_t>(entry.camera)]);
    report.features += kept.Write(entry.file, sources[k], features[k], id, &database);
    report.kept += kept.Has(entry.file, sources[k]) ? 1 : 0;
    ++report.pictures;
    features[k] = {};
  };
  ParallelInOrder(static_cast<int64_t>(n), threads, kAhead, cancel, extract, write);
  database.Commit();
  RequireSome(report, "run " + run.name);
  return report;
}

std::vector<PreparedReference> PrepareReferences(const Site& site, const ViewOptions& options,
                                                 std::vector<std::string>* warnings) {
  std::vector<PreparedReference> prepared;
  for (size_t r = 0; r < site.references.size(); ++r) {
    const Reference& reference = site.references[r];
    for (const std::filesystem::path& file : reference.files) {
      PreparedReference p;
      p.reference = static_cast<int>(r);
      p.name = RelativeName(file, site);
      try {
        const PhotoMetadata metadata = ReadPhotoMetadata(file);
        if (reference.kind == ReferenceKind::kPanorama) {
          p.rig = PanoramaViews(p.name, WidthOfPanorama(metadata), options);
        } else {
          std::optional<Camera> camera = reference.camera;
          if (reference.kind == ReferenceKind::kPhotoSet) camera = CameraInSet(reference, metadata);
          if (!camera) camera = CameraFromMetadata(metadata);
          if (!camera) {
            throw InputError(file.string() +
                             ": its focal length is unknown; name a camera in photos.csv or use photos with EXIF");
          }
          View view;
          view.name = "0";
          view.camera = *camera;
          p.rig.name = p.name;
          p.rig.views.push_back(view);
        }
      } catch (const InputError& e) {
        if (warnings != nullptr) warnings->push_back(e.what());
        continue;
      }
      prepared.push_back(std::move(p));
    }
  }
  return prepared;
}

ExtractionReport ExtractReferenceFeatures(const Site& site, const FeatureStageOptions& options,
                                          const FeaturesBefore& before, const std::filesystem::path& out, int threads,
                                          ProgressSink& progress, const CancelToken& cancel) {
  cv::setNumThreads(1);
  ExtractionReport report;
  const std::vector<PreparedReference> references = PrepareReferences(site, options.views, &report.skipped);
  KeptFeatures kept(before, out);
  ColmapDatabase database = ColmapDatabase::Create(out / kFeaturesFile);
  database.Begin();
  // All views in one list, so that no core waits at a picture's end for its last view.
  std::vector<ViewJob> jobs;
  std::vector<std::unique_ptr<ReferencePicture>> pictures;
  std::vector<std::string> sources;
  for (size_t r = 0; r < references.size(); ++r) {
    const size_t views = references[r].rig.views.size();
    sources.push_back(kept.SourceOf(site, references[r], options));
    pictures.push_back(std::make_unique<ReferencePicture>(views));
    for (size_t v = 0; v < views; ++v) jobs.push_back({r, v});
  }
  progress.Begin("features of references", static_cast<int64_t>(jobs.size()));
  RendererOfSize renderers;
  const auto extract = [&](int64_t i) {
    const auto [r, v] = jobs[static_cast<size_t>(i)];
    if (!kept.Has(ViewName(references[r], v), sources[r]))
      pictures[r]->Extract(site, references[r], v, options, &renderers);
    progress.Advance(1);
  };
  const auto write = [&](int64_t i) {
    const auto [r, v] = jobs[static_cast<size_t>(i)];
    if (v + 1 < references[r].rig.views.size()) return;  // all views of a picture, or none
    const std::unique_ptr<ReferencePicture> picture = std::move(pictures[r]);
    if (!picture->problem.empty()) {
      report.skipped.push_back(picture->problem);
      progress.Log(LogLevel::kWarning, "skipped: " + picture->problem);
      return;
    }
    for (size_t k = 0; k <= v; ++k) {
      const uint32_t camera = database.AddCamera(references[r].rig.views[k].camera);
      const std::string name = ViewName(references[r], k);
      report.features += kept.Write(name, sources[r], picture->features[k], database.AddImage(name, camera), &database);
    }
    report.kept += kept.Has(ViewName(references[r], v), sources[r]) ? 1 : 0;
    ++report.pictures;
  };
  ParallelInOrder(static_cast<int64_t>(jobs.size()), threads, kAhead, cancel, extract, write);
  database.Commit();
  return report;
}

double FinestFocal(const Site& site) {
  double finest = 0;
  for (const Run& run : site.runs) {
    for (const BodyCamera& camera : run.cameras) finest = std::max(finest, camera.camera.MeanFocal());
  }
  return finest;
}

Camera MatchedCamera(const Site& site, const Camera& photo) {
  const double finest = FinestFocal(site);
  return finest > 0 ? photo.Scaled(std::min(1.0, kFinest * finest / photo.MeanFocal())) : photo;
}

cv::Mat AsMatched(const cv::Mat& photo, const Camera& matched) {
  if (matched.width() == photo.cols && matched.height() == photo.rows) return photo;
  cv::Mat reduced;
  cv::resize(photo, reduced, cv::Size(matched.width(), matched.height()), 0, 0, cv::INTER_AREA);
  return reduced;
}

FeatureSet ResizedFeatures(FeatureSet features, const Camera& from, const Camera& to) {
  if (from.width() == to.width() && from.height() == to.height()) return features;
  const Eigen::Array2f factor(static_cast<float>(to.width()) / static_cast<float>(from.width()),
                              static_cast<float>(to.height()) / static_cast<float>(from.height()));
  for (Eigen::Vector2f& p : features.points) p = (p.array() + 0.5F) * factor - 0.5F;
  for (float& s : features.scales) s *= factor.x();
  return features;
}

FeatureStore::FeatureStore(const std::vector<std::filesystem::path>& databases) {
  for (const std::filesystem::path& file : databases) {
    databases_.push_back(ColmapDatabase::OpenRead(file));
    for (const DatabaseImage& image : databases_.back().Images()) {
      const bool fresh = places_.insert_or_assign(image.name, Place{databases_.size() - 1, image.id}).second;
      if (fresh) names_.push_back(image.name);
    }
  }
}

FeatureSet FeatureStore::Read(const std::string& name) const {
  const Place& place = places_.at(name);
  const std::lock_guard lock(mutex_);
  return databases_[place.database].ReadFeatures(place.id);
}

}  // namespace trigpoint

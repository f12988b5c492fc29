#include "app/pipeline/feature_store.h"

#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/base/error.h"
#include "calib/base/parallel.h"
#include "datasets/io/exif.h"
#include "datasets/io/image.h"

namespace trigpoint {
namespace {

// Several pictures at a time, written in order, so that the database does not depend on the threads.
constexpr int kBatch = 16;
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

}  // namespace

ExtractionReport ExtractRunFeatures(const Run& run, const FeatureOptions& options, const std::filesystem::path& file,
                                    int threads, ProgressSink& progress, const CancelToken& cancel) {
  cv::setNumThreads(1);  // whole pictures in parallel use the cores better than parts of one
  ExtractionReport report;
  ColmapDatabase database = ColmapDatabase::Create(file);
  database.Begin();
  std::vector<uint32_t> cameras;
  std::vector<cv::Mat> masks;
  for (const BodyCamera& c : run.cameras) {
    cameras.push_back(database.AddCamera(c.camera));
    masks.push_back(c.mask.empty() ? cv::Mat() : LoadPicture(c.mask, true));
  }
  const int n = static_cast<int>(run.images.size());
  progress.Begin("features of " + run.name, n);
  for (int begin = 0; begin < n; begin += kBatch) {
    const int count = std::min(kBatch, n - begin);
    std::vector<FeatureSet> features(static_cast<size_t>(count));
    std::vector<std::string> problems(static_cast<size_t>(count));
    ParallelFor(count, threads, cancel, [&](int64_t k) {
      const ImageEntry& entry = run.images[static_cast<size_t>(begin + k)];
      try {
        features[static_cast<size_t>(k)] =
            ExtractFeatures(LoadGrey(run, entry), masks[static_cast<size_t>(entry.camera)], options);
      } catch (const InputError& e) {
        problems[static_cast<size_t>(k)] = e.what();
      }
      progress.Advance(1);
    });
    for (int k = 0; k < count; ++k) {
      const ImageEntry& entry = run.images[static_cast<size_t>(begin + k)];
      if (!problems[static_cast<size_t>(k)].empty()) {
        report.skipped.push_back(problems[static_cast<size_t>(k)]);
        progress.Log(LogLevel::kWarning, "skipped: " + problems[static_cast<size_t>(k)]);
        continue;
      }
      const uint32_t id = database.AddImage(entry.file, cameras[static_cast<size_t>(entry.camera)]);
      database.WriteFeatures(id, features[static_cast<size_t>(k)]);
      ++report.pictures;
      report.features += static_cast<int64_t>(features[static_cast<size_t>(k)].size());
    }
  }
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
        if (reference.kind == ReferenceKind::kPanorama) {
          const PhotoMetadata metadata = ReadPhotoMetadata(file);
          int width = metadata.width;
          if (metadata.gpano && metadata.gpano->full_width > 0) width = metadata.gpano->full_width;
          p.rig = PanoramaViews(p.name, width, options);
        } else {
          std::optional<Camera> camera = reference.camera;
          const PhotoMetadata metadata = ReadPhotoMetadata(file);
          if (!camera) camera = CameraFromMetadata(metadata);
          if (!camera && reference.kind == ReferenceKind::kPhotoSet) {
            // Of use once the set is stitched; localize leaves it out before.
            const bool turned = metadata.SwapsSides();
            camera = Camera::FromFieldOfView(turned ? metadata.height : metadata.width,
                                             turned ? metadata.width : metadata.height, 65 * kDegToRad);
          }
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
                                          const std::filesystem::path& file, int threads, ProgressSink& progress,
                                          const CancelToken& cancel) {
  cv::setNumThreads(1);
  ExtractionReport report;
  const std::vector<PreparedReference> references = PrepareReferences(site, options.views, &report.skipped);
  ColmapDatabase database = ColmapDatabase::Create(file);
  database.Begin();
  int64_t total = 0;
  for (const PreparedReference& p : references) total += static_cast<int64_t>(p.rig.views.size());
  progress.Begin("features of references", total);
  for (const PreparedReference& p : references) {
    cancel.ThrowIfCancelled();
    const Reference& reference = site.references[static_cast<size_t>(p.reference)];
    const std::filesystem::path picture_file = site.dir / p.name;
    const bool panorama = reference.kind == ReferenceKind::kPanorama;
    std::vector<FeatureSet> features(p.rig.views.size());
    try {
      const cv::Mat picture = panorama ? LoadPanorama(picture_file, true) : LoadPicture(picture_file, true);
      const Camera& first = p.rig.views.front().camera;
      if (!panorama && (picture.cols != first.width() || picture.rows != first.height())) {
        throw InputError(picture_file.string() + ": is " + std::to_string(picture.cols) + " x " +
                         std::to_string(picture.rows) + " px, its camera's calibration " +
                         std::to_string(first.width()) + " x " + std::to_string(first.height()));
      }
      ParallelFor(static_cast<int64_t>(features.size()), threads, cancel, [&](int64_t v) {
        const View& view = p.rig.views[static_cast<size_t>(v)];
        FeatureSet& found = features[static_cast<size_t>(v)];
        if (panorama) {
          found = ExtractFeatures(RenderView(picture, view), cv::Mat(), options.references);
        } else {
          const Camera matched = MatchedCamera(site, view.camera);
          cv::Mat reduced = picture;
          if (matched.width() != picture.cols) {
            cv::resize(picture, reduced, {matched.width(), matched.height()}, 0, 0, cv::INTER_AREA);
          }
          found = ResizedFeatures(ExtractFeatures(reduced, cv::Mat(), options.references), matched, view.camera);
        }
        progress.Advance(1);
      });
    } catch (const InputError& e) {
      report.skipped.emplace_back(e.what());
      progress.Log(LogLevel::kWarning, std::string("skipped: ") + e.what());
      continue;
    }
    for (size_t v = 0; v < features.size(); ++v) {
      const uint32_t camera = database.AddCamera(p.rig.views[v].camera);
      database.WriteFeatures(database.AddImage(ViewName(p, v), camera), features[v]);
      report.features += static_cast<int64_t>(features[v].size());
    }
    ++report.pictures;
  }
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

FeatureSet ResizedFeatures(FeatureSet features, const Camera& from, const Camera& to) {
  if (from.width() == to.width() && from.height() == to.height()) return features;
  const Eigen::Array2f factor(static_cast<float>(to.width()) / static_cast<float>(from.width()),
                              static_cast<float>(to.height()) / static_cast<float>(from.height()));
  for (Eigen::Vector2f& p : features.points) p = (p.array() + 0.5F) * factor - 0.5F;
  for (float& s : features.scales) s *= factor.x();
  return features;
}

FeatureStore::FeatureStore(const std::filesystem::path& file) : database_(ColmapDatabase::OpenRead(file)) {
  for (const DatabaseImage& image : database_.Images()) ids_[image.name] = image.id;
}

FeatureSet FeatureStore::Read(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  return database_.ReadFeatures(ids_.at(name));
}

}  // namespace trigpoint

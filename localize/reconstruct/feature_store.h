// Features of a run's images and of the references' views: made by the features stage, read by localize.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "datasets/colmap/database.h"
#include "datasets/io/site.h"
#include "datasets/io/views.h"
#include "localize/reconstruct/features.h"
#include "localize/reconstruct/kept_features.h"

namespace trigpoint {

// What became of the pictures: how many, and a sentence for each that could not be used.
struct ExtractionReport {
  int pictures = 0, kept = 0;  // kept: of these, with the features found before
  int64_t features = 0;
  std::vector<std::string> skipped;
};

// Writes features.db, a COLMAP database with the features of every readable image, and pictures.txt with what each was
// found from. A picture that cannot be used is skipped and named; throws InputError if none can.
ExtractionReport ExtractRunFeatures(const Run& run, const FeatureOptions& options, const FeaturesBefore& before,
                                    const std::filesystem::path& out, int threads, ProgressSink& progress,
                                    const CancelToken& cancel);
// The same for the references' views, named "<picture>#<view>".
ExtractionReport ExtractReferenceFeatures(const Site& site, const FeatureStageOptions& options,
                                          const FeaturesBefore& before, const std::filesystem::path& out, int threads,
                                          ProgressSink& progress, const CancelToken& cancel);

// The pictures of the references with their rigs, in the order of the site. Panoramas need their size: headers are
// read.
std::vector<PreparedReference> PrepareReferences(const Site& site, const ViewOptions& options,
                                                 std::vector<std::string>* warnings);

// The camera at whose resolution a reference photo is matched: a picture several times finer than every camera of the
// runs spends its features on detail that none of them can show, so it is reduced first. Its features are stored in
// the pixels of the picture as it is.
Camera MatchedCamera(const Site& site, const Camera& photo);
// The photo at that resolution.
cv::Mat AsMatched(const cv::Mat& photo, const Camera& matched);
// Features of a picture of `from`'s size in the pixels of the same picture resized to `to`'s.
FeatureSet ResizedFeatures(FeatureSet features, const Camera& from, const Camera& to);
// The largest focal length of the runs' cameras, px; 0 without any.
double FinestFocal(const Site& site);

// Reads features by name, of one or more databases; thread safe.
class FeatureStore {
 public:
  explicit FeatureStore(const std::filesystem::path& database) : FeatureStore(std::vector{database}) {}
  explicit FeatureStore(const std::vector<std::filesystem::path>& databases);
  const std::vector<std::string>& names() const { return names_; }  // in the order of the databases
  bool Has(const std::string& name) const { return places_.count(name) > 0; }
  FeatureSet Read(const std::string& name) const;

 private:
  struct Place {
    size_t database;
    uint32_t id;
  };
  std::vector<ColmapDatabase> databases_;
  std::vector<std::string> names_;
  std::map<std::string, Place> places_;
  mutable std::mutex mutex_;
};

}  // namespace trigpoint

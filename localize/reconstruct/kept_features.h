// Features that were found before, for pictures that are as they were: a table that changes costs no picture anew.
#pragma once

#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "datasets/colmap/database.h"
#include "datasets/io/site.h"
#include "datasets/io/views.h"
#include "localize/reconstruct/features.h"

namespace trigpoint {

// Of the stages features and references.
constexpr const char* kFeaturesFile = "features.db";
constexpr const char* kPicturesFile = "pictures.txt";  // a line a picture: what its features were found from, tab, name

struct FeatureStageOptions {
  FeatureOptions images;      // of the run's images
  FeatureOptions references;  // of views and photos
  ViewOptions views;          // of panoramas

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.images, {"images", "", 0, 0, "features of the run's images"});
    visit(self.references, {"references", "", 0, 0, "features of panorama views and photos"});
    visit(self.views, {"views", "", 0, 0, "rectilinear views of panoramas"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

// A reference as the features stage saw it: one rig of views. A photo set is listed photo by photo.
struct PreparedReference {
  int reference = 0;  // index into Site::references
  std::string name;   // of the picture
  ViewRig rig;
};

// The features that were found before: those of pictures that are as they were need not be found again.
struct FeaturesBefore {
  std::filesystem::path dir;  // with features.db and pictures.txt; empty: there are none
  std::function<std::string(const std::filesystem::path&)> hash_of;  // of a file's content; does not throw
};

// Features of the result that is replaced, by what they were found from; for the new one that is written to `out`.
class KeptFeatures {
 public:
  // Throws InputError where the result before is no database.
  KeptFeatures(const FeaturesBefore& before, const std::filesystem::path& out);

  // What an image's features are found from, in one line; empty: they are always found anew. Parts of pictures depend
  // on the camera in more ways.
  std::string SourceOf(const Run& run, const ImageEntry& entry, const cv::Mat& mask, const FeatureOptions& o) const;
  // The same for the views of a panorama. Photos depend on the runs' cameras, too.
  std::string SourceOf(const Site& site, const PreparedReference& p, const FeatureStageOptions& o) const;
  bool Has(const std::string& name, const std::string& source) const;
  // Those found before, or else `found`, and their source. Returns how many.
  int64_t Write(const std::string& name, const std::string& source, const FeatureSet& found, uint32_t image,
                ColmapDatabase* database);

 private:
  FeaturesBefore before_;
  std::ofstream sources_;
  std::optional<ColmapDatabase> database_;
  std::map<std::string, uint32_t> id_of_;
  std::map<std::string, std::string> source_of_;
};

}  // namespace trigpoint

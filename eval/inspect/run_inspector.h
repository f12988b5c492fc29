// What a solution says about one image: its detections, where its points were seen and where they must lie, and the
// matches with the views of a panorama.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "datasets/io/views.h"
#include "datasets/project/project.h"

namespace trigpoint {

struct InspectedTag {
  int id = -1;
  std::vector<Eigen::Vector2d> corners;  // px, four
  double sigma_px = 0;
  bool excluded = false;  // by the review
};

// A point of the sparse model in an image.
struct InspectedPoint {
  int64_t id = -1;
  Eigen::Vector2d seen;       // px
  Eigen::Vector2d predicted;  // px, by the solution
  int track_length = 0;       // images that see it
};

struct InspectedImage {
  std::vector<InspectedTag> tags;
  std::vector<InspectedPoint> points;
  int width = 0, height = 0;
  bool excluded = false;
  // Root mean square of |predicted - seen|, px; unset without points.
  std::optional<double> rms_px;
};

// A pair of features of an image and a panorama (or photo).
struct InspectedMatch {
  Eigen::Vector2d image;     // px
  Eigen::Vector2d panorama;  // px; of a set in the photo that is the view
  std::string view;          // of a set the photo's name
  double error_px = 0;       // from the epipolar line that the solution gives, in the image's pixels; NaN without poses
  bool inlier = false;       // within 3 px and before both
};

// Of a localization that a version without solution.db made: what is missing and what to run. Empty for any other.
std::string OlderLocalization(const Project& project, const std::string& run, const std::string& variant);

// The results of one run, read once; the model is read when it is first asked for. Not thread safe.
class RunInspector {
 public:
  // Throws InputError for an unknown run.
  RunInspector(const Project& project, const std::string& run, const std::string& variant);
  ~RunInspector();
  RunInspector(const RunInspector&) = delete;
  RunInspector& operator=(const RunInspector&) = delete;

  // Throws InputError if the run has no such image (the nearest one is named). What has no result yet is empty.
  InspectedImage Image(const std::string& file);
  // The images that see a point of the model, in the run's order. Throws InputError if it has no such point.
  std::vector<std::string> ImagesOf(int64_t point);
  // Matches anew between the features of both (mutual nearest neighbours, ratio test) and judges them by the poses of
  // the solution. `references`: results of all parts of the references; `views`: how their views were drawn. Throws
  // InputError without features of either.
  std::vector<InspectedMatch> Matches(const std::string& file, const std::string& panorama,
                                      const std::vector<std::filesystem::path>& references, const ViewOptions& views);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace trigpoint

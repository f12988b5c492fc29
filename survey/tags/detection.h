// AprilTags found in pictures.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "calib/base/option.h"
#include "calib/base/progress.h"
#include "calib/camera/camera.h"

namespace trigpoint {

// One tag in one picture.
struct TagDetection {
  std::string family = "tag36h11";
  int id = -1;
  int hamming = 0;    // bits the decoder corrected
  double margin = 0;  // decision margin, grey values
  // Our pixels; bottom-left, bottom-right, top-right, top-left of the upright tag.
  std::array<Eigen::Vector2d, 4> corners;
  std::array<double, 4> corner_sigma_px{1, 1, 1, 1};  // 1 sigma per axis
  bool refined = false;                               // corners are fitted ones, else the detector's own
  // One number for the four: root of the mean square.
  double SigmaPx() const;
  double ShortestSide() const;  // px
};

// Corner k of a tag of edge length `size_m` in the tag's frame (x right, y down, z into the tag, origin at its
// centre), in the order of TagDetection::corners.
Eigen::Vector3d TagCorner(double size_m, int k);

struct DetectTagsOptions {
  std::string family = "tag36h11";  // or several, as TagFamilies reads them
  // Pictures are searched at 1 / this size: 2 is four times faster and misses small tags, 0.5 finds smaller ones.
  double quad_decimate = 1;
  double quad_sigma = 0;      // Gaussian blur before the search, px; helps noisy pictures
  int max_hamming = 2;        // more corrected bits than this are not believed; fewer for weak families
  double min_margin = 10;     // decision margin below which a detection is not believed, grey values
  double min_side_px = 8;     // shortest side of a tag that is believed, px
  bool refine = true;         // fit the corners to the picture (survey/tags/corner_refinement.h)
  double raw_sigma_px = 0.5;  // 1 sigma per axis of the detector's own corners, where they are not refined
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.family, {"family", "", 0, 0,
                        "tag family: tag36h11, tag25h9, tag16h5, tagStandard41h12, ...; several: "
                        "tag36h11,tag16h5:3:12 (with the ids of those behind the first)"});
    visit(self.quad_decimate, {"quad_decimate", "", 0.25, 8.0,
                               "search at 1 / this size (2: faster, misses small tags; 0.5: finds smaller)"});
    visit(self.quad_sigma, {"quad_sigma", "px", 0.0, 5.0, "blur before the search"});
    visit(self.max_hamming,
          {"max_hamming", "", 0, 2, "most corrected bits of a tag that is believed; weak families: fewer"});
    visit(self.min_margin, {"min_margin", "", 0.0, 255.0, "least decision margin of a tag that is believed"});
    visit(self.min_side_px, {"min_side_px", "px", 4.0, 1000.0, "shortest side of a tag that is believed"});
    visit(self.refine, {"refine", "", 0, 1, "fit the corners to the picture"});
    visit(self.raw_sigma_px, {"raw_sigma_px", "px", 0.01, 10.0, "1 sigma of corners that are not refined"});
  }
  std::vector<std::string> Check() const;
};

// What was found in one picture.
struct ImageTags {
  bool usable = false;  // false: the picture could not be read, `problem` says why
  std::string problem;
  std::vector<TagDetection> detections;  // ascending id, then by place
};

struct DetectTagsResult {
  std::vector<ImageTags> images;  // one for every index
  int64_t unusable = 0;           // pictures that could not be read
  int64_t detections = 0;
  int64_t refused = 0;    // decoded, but below a gate
  int64_t unrefined = 0;  // kept with the detector's corners
};

// Gives the grey 8-bit picture of an index; called from several threads at once. An InputError makes that picture
// unusable, anything else ends the detection.
using PictureSource = std::function<cv::Mat(int64_t)>;
// The camera of an index, or null where it is not known; it accounts for lens distortion inside a tag.
using CameraSource = std::function<const Camera*(int64_t)>;

// Finds the tags in `count` pictures on `threads` workers (0: all cores), each with a detector of its own. The result
// does not depend on the number of threads. Throws OptionError, Cancelled.
DetectTagsResult DetectTags(int64_t count, const PictureSource& picture, const CameraSource& camera,
                            const DetectTagsOptions& options, int threads, ProgressSink& progress,
                            const CancelToken& cancel);

}  // namespace trigpoint

// What the localization works on: images with odometry, references with views; features are read on demand.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "calib/camera/rig.h"
#include "calib/camera/rolling_shutter.h"
#include "datasets/colmap/database.h"
#include "datasets/io/site.h"
#include "datasets/solution/solution.h"

namespace trigpoint {

struct ViewIndex;  // localize/references/view_index.h

using FrameImage = SolutionImage;  // of LocalizeInput::cameras and its body poses

// What is not known of a reference's views. All points seen in them share these errors.
struct ViewErrors {
  double focal_share = 0;  // 1 sigma of the focal length of a pinhole, a share of it; photos of equal focal length
                           // share the error
  // Covariance of all rig_from_view jointly: left tangents [rotation (rad), translation (m)], 6 rows and columns a
  // view. Empty: they are exact.
  Eigen::MatrixXd poses;
};

// A reference to localize: a rig of views with their features.
struct ReferenceViews {
  std::string name;
  std::string station;
  ReferenceKind kind = ReferenceKind::kPanorama;
  ViewRig rig;  // rig frame: x right, y down, z forward at the picture's centre
  GeoTag geotag;
  std::string source;     // service that it is from, or empty
  int set = -1;           // photos of one hand-held set share it; -1: stands alone
  bool stitched = false;  // a whole hand-held set: the run tells the size of its rig
  ViewErrors errors;
};

// The pictures of a reference's views, each read when it is asked for.
class ReferencePictures {
 public:
  virtual ~ReferencePictures() = default;
  // Grey, 8 bit; empty where it cannot be read.
  virtual cv::Mat View(int view) const = 0;
};

// Factors on the standard deviations of odometry's stated noise. Two, since stops that are far apart often have good
// positions and bad rotations.
struct OdometryNoise {
  double rotation = 1, translation = 1;
};

struct LocalizeInput {
  std::vector<BodyCamera> cameras;
  std::vector<FrameImage> images;       // ascending time
  std::vector<int64_t> pose_stamps;     // of each body pose
  std::vector<Rigid3d> odom_from_body;  // odometry at each body pose
  std::vector<MotionRate> body_rates;   // and how the body moves there
  bool flat = false;                    // odometry has no heights, no roll and no pitch (datasets/io/odometry_limits.h)
  double time_resolution_s = 0;         // that the images' times are cut off to; 0: they are exact
  bool has_odometry = true;             // else these are the images' own motion, whose length nothing has measured
  std::vector<ReferenceViews> references;
  // Of cameras with a readout time: where the features of far points would be at the image's time.
  std::function<FeatureSet(int image)> image_features;
  std::function<FeatureSet(int reference, int view)> view_features;
  // The visual words of the references' views, where they are on disk. Optional.
  std::function<std::shared_ptr<const ViewIndex>()> view_index;
  // Grey, 8 bit; empty where it cannot be read. No function: pictures are not at hand.
  std::function<cv::Mat(int image)> image_picture;
  // The same of a reference's views; for a run whose images are aligned with each other (patch_alignment.h).
  std::function<std::unique_ptr<const ReferencePictures>(int reference)> reference_pictures;
  bool has_frame = false;
  LocalFrame frame;
  bool levelled = false;
  double scale_sigma = 0.01;
};

// The next image of the same camera; -1 after the last.
std::vector<int> NextOfCamera(const LocalizeInput& input);

// Distance of consecutive images of a camera by odometry, m: the median. That of consecutive body poses may be near
// zero: cameras whose clocks differ by milliseconds have a body pose each.
double MedianStep(const LocalizeInput& input);

// How far the body has travelled up to each image, m. Its cameras stand apart: from one to the other nothing moves.
std::vector<double> PathToImages(const LocalizeInput& input, const std::vector<Rigid3d>& body_from_odom);

// The moment of each body pose, counted from 0. Poses of one moment belong to different cameras and lie within a
// fifth of the median time between images of a camera; up to four cameras that take turns evenly have moments of
// their own.
std::vector<int> MomentsOfPoses(const LocalizeInput& input);

}  // namespace trigpoint

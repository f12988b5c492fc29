// References of a reconstructed run, the joint solution with them, the Earth. Options in, result out; no files.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "localize/georegistration/georegistration.h"
#include "localize/georegistration/world_fit.h"
#include "localize/reconstruct/frames.h"
#include "localize/reconstruct/reconstruct.h"
#include "localize/reconstruct/step_times.h"
#include "localize/references/photo_focal.h"
#include "localize/references/registration.h"
#include "localize/references/retrieval.h"
#include "localize/references/view_errors.h"

namespace trigpoint {

struct LocalizeOptions {
  std::string mode = "trigpoint";  // trigpoint, or paper: as published
  RetrievalOptions retrieval;
  RegistrationOptions registration;
  GeoRegistrationOptions geo;

  // The defaults of a mode. Throws OptionError for another name than trigpoint or paper.
  static LocalizeOptions ForMode(const std::string& mode);

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.mode, {"mode", "", 0, 0, "trigpoint, or paper: as published"});
    visit(self.retrieval, {"retrieval", "", 0, 0, "candidate references of an image"});
    visit(self.registration, {"registration", "", 0, 0, "poses of references"});
    visit(self.geo, {"geo", "", 0, 0, "georeferencing of the run's frame"});
  }
  std::vector<std::string> Check() const;
};

// A pose with its covariance, world_from_x: tangent [rotation (rad, left: world axes), position (m)].
struct PoseEstimate {
  Rigid3d world_from_x;
  Matrix6d covariance = Matrix6d::Zero();
};

struct ReferenceAnswer {
  Registration registration;  // rig_from_odom after the joint solution
  PoseEstimate world;         // valid where the run is on the Earth
  int pose = -1;              // of the reconstruction's problem; -1: not part of the joint solution
  PlacedViews views;          // of that problem
  bool geotag_used = false;
  bool geotag_outlier = false;
  Eigen::Vector3d geotag_difference = Eigen::Vector3d::Zero();  // said - estimated, ENU, m
};

struct Localization {
  Reconstruction reconstruction;        // poses: body_from_odom of all images, references, turned views
  std::vector<Rigid3d> body_from_odom;  // optimised, one a body pose
  std::vector<ReferenceAnswer> references;
  bool on_earth = false;
  std::string earth_reason;   // why not
  std::string earth_source;   // "geotags", "gps", "geotags and gps", "geotags, tags and control"
  WorldFit world;             // of what was measured in the world, where that is used
  GeoRegistration geo;        // of the final run's frame
  double odometry_scale = 1;  // applied in the run's frame: true / measured length
  double odometry_scale_sigma = 0;
  std::vector<PoseEstimate> cameras;  // each image, world_from_cam; empty when not on the Earth
  // Of all poses of the reconstruction's problem (rig_from_odom), and of their odom_from_rig with the fit to the Earth.
  std::vector<Matrix6d> pose_covariances;
  std::vector<Eigen::Matrix<double, 6, 7>> with_fit;  // empty when not on the Earth
  Retrieval retrieval;
  std::vector<PhotoFocal> photo_focals;  // of photos that EXIF states a focal length of
  StepSeconds seconds;
};

// Without odometry the length of a run is first known once it is georeferenced. Thresholds in metres hold from then on,
// so it is localized again, its reconstruction `length` times as long.
Localization LocalizeAtItsLength(bool has_odometry, const std::function<Localization(double length)>& localize);

// Called when all but the stitched sets have taken part in the solution: it may replace the rigs of these and their
// registrations. The reconstruction has the other references' observations (image_of < 0) too.
using RefineReferences =
    std::function<void(const Reconstruction& reconstruction, const Retrieval& retrieval,
                       std::vector<ReferenceViews>* references, std::vector<Registration>* registrations)>;

// `run`: the run by itself (reconstruct_run.h), which is extended.
// `world`: with it the run is georeferenced by its bundle adjustment, and its shape follows.
Localization Localize(const LocalizeInput& input, Reconstruction run, const std::vector<GpsPlace>& gps,
                      const LocalizeOptions& options, int threads, uint64_t seed, ProgressSink& progress,
                      const CancelToken& cancel, const RefineReferences& refine = nullptr,
                      const WorldEvidence& world = {});

}  // namespace trigpoint

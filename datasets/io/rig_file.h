// The rig of a stitched photo set: rig.csv and rig.json, as survey/panorama/rig_files.h writes them.
#pragma once

#include <Eigen/Core>
#include <filesystem>

#include "calib/camera/rig.h"

namespace trigpoint {

// The views of rig.csv with the lenses of rig.json beside it; names are the photos'. Throws InputError.
struct RigFile {
  ViewRig rig;                                // rig_from_view with covariances
  double radius_m = 0, radius_log_sigma = 0;  // of the circle: what the rig's scale rests on
  // Of all views' [turn of cam_from_rig (left, rad), centre about the mean of the centres (m)] at the rig's size;
  // empty: not known.
  Eigen::MatrixXd shape_covariance;
};
RigFile ReadRigFiles(const std::filesystem::path& dir);

}  // namespace trigpoint

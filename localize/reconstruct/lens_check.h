// Does a calibration fit the images of a run? Its lenses are estimated from them, too.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "localize/reconstruct/reconstruct.h"
#include "localize/reconstruct/self_calibration.h"

namespace trigpoint {

// What a run's images say of a lens against its calibration.
struct LensError {
  int camera = 0;                                       // index into LocalizeInput::cameras
  double focal = 0;                                     // share of the focal length
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();  // of the principal point, right and down
  double rms_px = 0;                                    // shift of a pixel, RMS over the picture
};

struct LensCheck {
  std::vector<LensError> errors;  // of the cameras whose images were used
  double better = 0;              // share of the squared residuals that another lens removes
};

// How the images would have the lens of each camera, given that it is calibrated: LensParameters are shares of the
// focal length; the principal point, px right and down; and shares of distortion by r^2 and r^4, where r is 1 in the
// picture's corners. Empty where the images have too few points in common. Throws NumericError.
std::vector<LensParameters> LensErrors(const LocalizeInput& input, const Reconstruction& reconstruction);

// Reconstruction::lens_roots of lenses that were found from the images; `others`: 1 sigma of each error of a lens that
// was not, the centre's as a share of half the diagonal.
std::vector<LensParameters> LensRoots(const LocalizeInput& input, const std::vector<SelfCalibration>& found,
                                      double others);

// How far the poses of the reconstruction's problem, which is solved, move (left tangent, 6 rows) with each error of
// the lenses: first `lens_roots`, then `lens_errors` together. Nothing without them. Without odometry, the lens alone
// holds a run's scale along its path.
Eigen::MatrixXd PoseShiftsByLenses(const LocalizeInput& input, const Reconstruction& reconstruction, int threads,
                                   const CancelToken& cancel);

// Bundle adjustment of a part of the reconstruction with the lenses of all cameras free, to first order in their
// errors: focal length, principal point, radial distortion. No errors where the images have too few points in common.
// Throws NumericError.
LensCheck CheckLenses(const LocalizeInput& input, const Reconstruction& reconstruction);

// The message for a calibration that cannot be right; nothing where it can. How far the lens found is from the
// calibrated one decides little: in a run straight ahead it takes up odometry's errors. How much better the images fit
// it decides.
std::optional<std::string> Contradiction(const LocalizeInput& input, const LensCheck& check);

}  // namespace trigpoint

// Cameras that nobody calibrated: their focal length and radial distortion from the images of a run.
#pragma once

#include <vector>

#include "localize/reconstruct/reconstruct.h"
#include "localize/reconstruct/view_graph.h"

namespace trigpoint {

struct SelfCalibration {
  int camera = 0;  // index into LocalizeInput::cameras
  Camera found;    // radtan; of a guess f_x = f_y, k1, k2, no decentring
  // 1 sigma, of the run's images and what was known before.
  double sigma_focal_px = 0, sigma_k1 = 0, sigma_k2 = 0, sigma_centre_px = 0;
  Eigen::Matrix<double, 5, 5> covariance = Eigen::Matrix<double, 5, 5>::Zero();  // LensParameters: of errors of a lens
  double sigmas = 0;    // the largest difference of a parameter from what was known before, in sigmas
  double shift_px = 0;  // how far the largest of nine pixels over the picture (its corners among them) moved
};

// Bundle adjustment of the reconstruction with the lenses free of those cameras whose focal length is a guess
// (BodyCamera::focal_sigma_share > 0), over the points that most images show. Priors: the focal length by its share,
// the principal point, and k1 and k2 of usual lenses. Empty where every camera is calibrated. Throws NumericError where
// the images determine nothing.
std::vector<SelfCalibration> SelfCalibrate(const LocalizeInput& input, const Reconstruction& reconstruction);

// The same for calibrated cameras, about `calibrated` as it is known to a per cent: of pinhole and radtan cameras that
// show their whole picture; decentring and the ratio of the focal lengths stay.
std::vector<SelfCalibration> ReviseLenses(const LocalizeInput& input, const Reconstruction& reconstruction,
                                          const std::vector<BodyCamera>& calibrated);

// Cameras whose focal length is hardly known (focal_sigma_share of kWildGuess and more) get the one under which most
// matches of images near each other in time fit a two-view geometry: right to about a tenth. Nothing else changes.
void SearchFocalLengths(LocalizeInput* input, const ViewGraphOptions& pairs, int threads, uint64_t seed,
                        ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint

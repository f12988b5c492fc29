// Focal lengths of photos that nobody calibrated, from the points of the run that they show (docs/method.md section 4).
#pragma once

#include <vector>

#include "calib/base/progress.h"
#include "localize/reconstruct/frames.h"
#include "localize/reconstruct/reconstruct.h"
#include "localize/references/registration.h"
#include "localize/references/view_retrieval.h"

namespace trigpoint {

// Of the photos whose EXIF states one focal length.
struct PhotoFocal {
  double stated_px = 0;
  double factor = 1;  // true / stated
  double sigma = 0;   // of the factor's logarithm, 1 sigma
  int photos = 0, points = 0;
};

// A reference with where it was found.
struct RegisteredPhoto {
  const ReferenceViews& reference;
  const Registration& registration;
};

// The factor on the focal length of the photos' cameras under which the points are seen where they are, poses moving
// along, points within `covariances`. `prior`: its logarithm, known to `prior_sigma`.
PhotoFocal EstimateFocal(const std::vector<RegisteredPhoto>& photos, const std::vector<Eigen::Vector3d>& points,
                         const std::vector<Eigen::Matrix3d>& covariances, const RegistrationOptions& options,
                         double prior, double prior_sigma);

// For all references with a doubt about their focal length (ViewErrors::focal_share): it is estimated from all that
// state the same and are localized, and these are registered again with it, until it stays. Where none is localized,
// focal lengths one and two sigmas off are tried. Changes the references' cameras and their remaining doubt.
std::vector<PhotoFocal> RefinePhotoFocals(const LocalizeInput& input, const Reconstruction& reconstruction,
                                          const Retrieval& retrieval, const RegistrationOptions& options, int threads,
                                          uint64_t seed, ProgressSink& progress, const CancelToken& cancel,
                                          std::vector<ReferenceViews>* references,
                                          std::vector<Registration>* registrations);

}  // namespace trigpoint

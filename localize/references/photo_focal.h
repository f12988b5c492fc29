// Focal lengths of photos that nobody calibrated, from the points of the run that they show (docs/method.md section 4).
#pragma once

#include <vector>

#include "calib/base/progress.h"
#include "localize/reconstruct/frames.h"
#include "localize/reconstruct/reconstruct.h"
#include "localize/references/registration.h"
#include "localize/references/view_retrieval.h"

namespace trigpoint {

// Of photos whose EXIF states one focal length: those of a set, or all that stand alone.
struct PhotoFocal {
  std::vector<size_t> references;  // whose focal length it is
  double factor = 1;               // true / stated
  double mean_sigma = 0;           // of the factor's logarithm, 1 sigma, as the mean of the photos
  double sigma = 0;                // for each photo: with the scatter of their own factors
  int photos = 0, points = 0;      // that it was estimated from
};

// A reference with where it was found.
struct RegisteredPhoto {
  const ReferenceViews& reference;
  const Registration& registration;
};

// The camera with its focal length times a factor. Not for equirectangular ones, which have none.
Camera WithFocalFactor(const Camera& camera, double factor);

// The factor on the focal length of the photos' cameras under which the points are seen where they are, poses moving
// along, points within `covariances`. `prior`: its logarithm, known to `prior_sigma`. Where the photos differ by more
// than their points explain (focus, another phone), that scatter is part of `sigma`.
PhotoFocal EstimateFocal(const std::vector<RegisteredPhoto>& photos, const std::vector<Eigen::Vector3d>& points,
                         const std::vector<Eigen::Matrix3d>& covariances, const RegistrationOptions& options,
                         double prior, double prior_sigma);

// For all references with a doubt about their focal length (ViewErrors::focal_share): it is estimated from those that
// are localized, and all are registered again with it. Where it does not stay, others are tried. Changes the
// references' cameras and their remaining doubt. Where none is localized, or the points are lost, all remains as it is.
std::vector<PhotoFocal> RefinePhotoFocals(const LocalizeInput& input, const Reconstruction& reconstruction,
                                          const Retrieval& retrieval, const RegistrationOptions& options, int threads,
                                          uint64_t seed, ProgressSink& progress, const CancelToken& cancel,
                                          std::vector<ReferenceViews>* references,
                                          std::vector<Registration>* registrations);

}  // namespace trigpoint

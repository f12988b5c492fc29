// Rolling shutters: the rows of an image are exposed one after the other while the camera moves.
//
// An image's time is that of its middle row; row v of h is exposed (v / (h - 1) - 1/2) readout_s later. To first order
// a point X in the camera at that moment is, in the camera at the image's time,
//   X + dt (omega x X + velocity),   omega, velocity: of the camera, in its own frame.
// Observations become what a camera without readout time would have seen, so that all that follows stays as it is.
#pragma once

#include <optional>

#include "localize/reconstruct/reconstruct.h"

namespace trigpoint {

// Whether a camera of the run has a readout time.
bool HasReadout(const LocalizeInput& input);

// The observations of `reconstruction` as tracks again, of the pixels that a camera at the images' times would have
// seen with the poses and points found. Points that are not valid are taken to be far away.
std::vector<TrackObservation> AtImageTimes(const LocalizeInput& input, const Reconstruction& reconstruction);

// A readout time as the images show it, on top of the one that was used: one step of Gauss-Newton with all poses and
// points eliminated, robust weights as they are.
struct ReadoutEstimate {
  int camera = 0;
  double readout_s = 0;  // BodyCamera::readout_s plus the change
  double change_s = 0;
  double sigma_s = 0;  // 1 sigma; large where the motion does not show it
};
// Of every camera with poses whose motion is known. Throws NumericError if the system is singular.
std::vector<ReadoutEstimate> EstimateReadout(const LocalizeInput& input, const Reconstruction& reconstruction,
                                             int threads, const CancelToken& cancel);

}  // namespace trigpoint

// Rolling shutters of a run's cameras (calib/camera/rolling_shutter.h): what depends on the distance of points, and the
// readout times as images show them.
//
// Features are corrected for the camera's rotation when they are read (LocalizeInput::image_features). The correction
// for its translation needs distances: the first reconstruction gives them, and the corrected rays are reconstructed
// again. All that follows uses the corrected rays.
#pragma once

#include <vector>

#include "localize/reconstruct/reconstruct.h"

namespace trigpoint {

// The features of an image as its camera would have seen those of far points at the image's time.
FeatureSet AtImageTime(FeatureSet features, const BodyCamera& camera, const MotionRate& body);

// Whether one of the cameras has a readout time.
bool HasReadout(const std::vector<BodyCamera>& cameras);

// The observations of a reconstruction from uncorrected rays, as a camera at the images' times would have seen them.
std::vector<TrackObservation> AtImageTimes(const LocalizeInput& input, const Reconstruction& reconstruction);

struct ReadoutEstimate {
  int camera = 0;
  double readout_s = 0;  // BodyCamera::readout_s and what the images add to it
  double change_s = 0;
  double sigma_s = 0;  // 1 sigma; large where the motion does not show it
};
// Of the cameras with images, each with its lens free within the errors that calibrations usually have. None where the
// body's motion is not known at the images, or these have too few points in common.
std::vector<ReadoutEstimate> EstimateReadout(const LocalizeInput& input, const Reconstruction& reconstruction);

}  // namespace trigpoint

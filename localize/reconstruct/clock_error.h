// Do images have the times of odometry? An image that was taken later than stated stands farther along odometry's path:
// a reconstruction shows it where speed or direction change, and between the images of one body's cameras everywhere.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "localize/reconstruct/reconstruct.h"

namespace trigpoint {

struct ClockError {
  // How much later than true the stated times of the images are, by odometry; of some images: beside those of all.
  double late_s = 0;
  double sigma_s = 0;                             // 1 sigma
  int camera = -1;                                // of one camera's images alone
  std::optional<int64_t> from_ns = std::nullopt;  // of the images from there on alone
  double Sigmas() const;
};

// By a reconstruction that is solved, to first order: first the error of all images, then those of each camera whose
// body poses are its own, and of the later images for places along the run. Odometry's scale, with 1 sigma
// `input.scale_sigma`, and errors of the cameras' places on the body are estimated with each: of all cameras, and small
// ones of a camera that is asked about. Throws NumericError.
std::vector<ClockError> FindClockErrors(const LocalizeInput& input, const Reconstruction& reconstruction, int threads,
                                        const CancelToken& cancel);

}  // namespace trigpoint

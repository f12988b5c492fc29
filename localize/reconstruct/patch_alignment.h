// Observations of a point, made to show the same spot of it. SIFT finds a feature in each image by itself, and what it
// finds moves with the viewpoint by some tenths of a pixel, the same way in neighbouring images, which no averaging
// removes. The picture about a point's feature in one image is aligned with its other images (docs/method.md section
// 2).
#pragma once

#include <cstdint>
#include <vector>

#include "localize/reconstruct/reconstruct.h"

namespace trigpoint {

struct AlignedTracks {
  std::vector<TrackObservation> observations;  // by point
  int64_t tried = 0, aligned = 0;              // of these and those left out
};

// Pictures are read twice, two at a time; cameras whose rows are read one by one are left as they are, and so are
// points that are not believed or in too few images that can be aligned.
AlignedTracks AlignPatches(const LocalizeInput& input, const Reconstruction& reconstruction, int threads,
                           ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint

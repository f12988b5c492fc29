// Panoramas whose pictures are mirrored, as some stitchers and services hand them out. No view of them matches.
#pragma once

#include <optional>
#include <string>

#include "localize/references/registration.h"

namespace trigpoint {

// The SIFT features of a picture as its mirror image has them (left and right exchanged): pixels, angles, descriptors.
// `width`: of the picture, px.
FeatureSet MirroredFeatures(FeatureSet features, int width);

// Tries the panoramas with their pictures mirrored. A message that names those that are localized so and says what to
// do; nothing without any. For runs of which no panorama is localized: it costs as much as the registration did.
std::optional<std::string> FindMirroredPanoramas(const LocalizeInput& input, const Reconstruction& reconstruction,
                                                 const RetrievalOptions& retrieval, const RegistrationOptions& options,
                                                 int threads, uint64_t seed, ProgressSink& progress,
                                                 const CancelToken& cancel);

}  // namespace trigpoint

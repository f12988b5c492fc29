// The views of references that every image of a run looks like (docs/method.md section 3).
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "calib/base/progress.h"
#include "localize/georegistration/world_fit.h"
#include "localize/reconstruct/frames.h"
#include "localize/references/view_index.h"

namespace trigpoint {

// One of the photos of a hand-held set, or the set as one rig.
inline bool OfSet(const ReferenceViews& r) { return r.set >= 0 || r.stitched; }

struct Retrieval {
  struct Hit {
    int reference, view;
    float score;  // cosine similarity; of a hand-held set: above that of the first place left out
  };
  std::vector<std::vector<Hit>> of_image;
  std::vector<char> tested;  // of each reference, where there are more than can be; empty: all are
  int words = 0;
  double memory_mib = 0;
};

// The top_k views of each image; those of hand-held sets where the set is among the top_k places (paper: no difference
// is made). Of more references than options.most_references (and than images), those are tested that stand within
// `reach_m` of a GPS fix, beyond three sigmas of both; without GPS, those about which most images' votes lie. Uses
// input.view_index; without one it is made in memory.
Retrieval RetrieveViews(const LocalizeInput& input, const std::vector<GpsPlace>& gps, const RetrievalOptions& options,
                        double reach_m, bool paper, uint64_t seed, int threads, ProgressSink& progress,
                        const CancelToken& cancel);

}  // namespace trigpoint

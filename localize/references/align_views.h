// What references see of points, made to show the same spots as the run's images do (docs/method.md section 4). SIFT
// finds a feature in each picture by itself: where a reference looks at a surface from another side than the run, it
// finds it centimetres elsewhere, and all features of the surface alike.
#pragma once

#include <vector>

#include "localize/reconstruct/reconstruct.h"

namespace trigpoint {

// Of an observation of a reference: index into the references.
inline size_t ReferenceOf(const Reconstruction& r, size_t k) { return static_cast<size_t>(-1 - r.image_of[k]); }

struct AlignedViews {
  int64_t tried = 0;
  std::vector<size_t> observations;  // of the problem, that are aligned
  std::vector<Eigen::Vector2f> pixels;
  std::vector<size_t> elsewhere;  // those of which no picture shows the same
};

// Needs a solution in which points lie within a few pixels of what the references see, of a run whose images are
// aligned with each other (patch_alignment.h). `references` as they are in the problem; `first_view` of each: index
// into BundleProblem::views, -1 for those that are left as they are.
AlignedViews AlignViews(const LocalizeInput& input, const std::vector<ReferenceViews>& references,
                        const std::vector<int>& first_view, const Reconstruction& reconstruction, int threads,
                        ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint

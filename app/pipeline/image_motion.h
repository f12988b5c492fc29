// The motion of a run that has no odometry: found from its images by `reconstruct`, kept in motion.tum, followed by
// the stages after it as odometry whose length nothing has measured.
#pragma once

#include <filesystem>

#include "app/pipeline/localize_files.h"
#include "localize/reconstruct_run.h"

namespace trigpoint {

// How far the length of images' own motion may be off before it is found, as odometry's `scale_sigma`.
inline constexpr double kUnknownScaleSigma = 10;

// Writes `file`: the motion of `job`'s images, as long as the run's GPS says, if it has any.
void FindImageMotion(const Run& run, const LocalizeJob& job, const ReconstructRunOptions& options,
                     const std::filesystem::path& file, int threads, uint64_t seed, ProgressSink& progress,
                     const CancelToken& cancel);

// The file's motion becomes the run's odometry; images without a place in it leave the run.
void FollowImageMotion(const std::filesystem::path& file, Run* run);

// The reconstruction `length` times as long; points that are too far away to count now are left out.
void ScaleReconstruction(double length, Reconstruction* reconstruction);

}  // namespace trigpoint

// What `reconstruct` finds of a run that its inputs leave out, for itself and the stages after it: the motion of a run
// without odometry (motion.tum), followed as odometry whose length nothing has measured; the lenses of cameras that
// nobody calibrated (camchain.yaml); what is to be added to odometry's times (odometry_time.yaml).
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "datasets/io/site.h"
#include "localize/reconstruct/frames.h"
#include "localize/reconstruct/reconstruct_run.h"
#include "localize/reconstruct/rig_length.h"
#include "localize/reconstruct/self_calibration.h"

namespace trigpoint {

// How far the length of images' own motion may be off before it is found, as odometry's `scale_sigma`.
inline constexpr double kUnknownScaleSigma = 10;

inline constexpr const char* kMotionFile = "motion.tum";
inline constexpr const char* kFoundCamerasFile = "camchain.yaml";
inline constexpr const char* kOdometryTimeFile = "odometry_time.yaml";

// By how much images' own motion is too short, by fixes at the times of its poses: true over found length.
// Nothing where GPS does not show more than its own noise. A few wrong fixes do not matter.
std::optional<double> LengthByGps(const std::vector<GpsFix>& gps, const std::vector<TimedPose>& motion);

// Which way is up in the frame of images' own motion, by the places of its poses in space: unit. Heights above the sea
// count against each other. Nothing where the fixes do not show it to 10 deg (1 sigma), or most contradict the motion.
std::optional<Eigen::Vector3d> UpByGps(const std::vector<GpsFix>& gps, const std::vector<TimedPose>& motion);

// What to warn of, a sentence that ends with the unit.
struct FoundMotion {
  std::string text, unit;
};

// Writes `file`: the motion of the input's images of the first centre (localize/reconstruct/rig_length.h), z up, as
// long as the run's GPS says, if it has any.
FoundMotion FindImageMotion(const Run& run, const LocalizeInput& all, const ReconstructRunOptions& options,
                            const std::filesystem::path& file, int threads, uint64_t seed, ProgressSink& progress,
                            const CancelToken& cancel);

// Writes `file` anew: the motion of the input's body poses as they are solved. `sigma_share`: 1 sigma of its length,
// which FollowReconstruction takes over; kUnknownScaleSigma: not known.
void WriteMotion(const LocalizeInput& input, const BundleProblem& solved, const std::string& unit, double sigma_share,
                 const std::filesystem::path& file);

// The cameras with the lenses that the reconstruction in a folder has found, for TakeLenses; none if it has found none.
std::vector<BodyCamera> FoundLenses(const std::filesystem::path& dir);
// What the reconstruction in a folder has found that is to be added to odometry's stamps, s; 0: nothing.
double OdometryTime(const std::filesystem::path& dir);
// What the folder of a reconstruction says becomes the run's: its motion and how well its length is known, where the
// run has no odometry (images without a place in it leave the run), the correction of odometry's times, and the lenses
// found, which photos of `site` that were taken with these cameras follow.
void FollowReconstruction(const std::filesystem::path& dir, Run* run, Site* site = nullptr);

// Odometry's stamps become later.
void MoveOdometry(double by_s, Run* run);
// Writes by how much, for FollowReconstruction.
void WriteOdometryTime(double by_s, double sigma_s, const std::filesystem::path& file);

// The lenses found take the places of the run's guesses.
void TakeCameras(const std::vector<SelfCalibration>& found, Run* run);
// Writes the cameras of the run, of which some were found, and says so.
void WriteFoundCameras(const Run& run, const std::vector<SelfCalibration>& found, const std::filesystem::path& file,
                       ProgressSink& progress);
// Writes the cameras of a run whose calibrated lenses its images contradict, and says which lenses are used instead.
void WriteRevisedCameras(const Run& calibrated, const Run& revised, const std::vector<SelfCalibration>& found,
                         const std::filesystem::path& file, ProgressSink& progress);

// The reconstruction `length` times as long; points that are too far away to count now are left out.
void ScaleReconstruction(double length, Reconstruction* reconstruction);

}  // namespace trigpoint

#include "localize/files/run_reconstruction.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "calib/base/error.h"
#include "datasets/project/manifest.h"
#include "localize/files/clock_check.h"
#include "localize/reconstruct/camera_arm.h"
#include "localize/reconstruct/image_motion.h"
#include "localize/reconstruct/lens_check.h"
#include "localize/reconstruct/lens_shift.h"
#include "localize/reconstruct/odometry_check.h"
#include "localize/reconstruct/odometry_jump.h"
#include "localize/reconstruct/odometry_unit.h"
#include "localize/reconstruct/rig_length.h"
#include "localize/reconstruct/self_calibration.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

nlohmann::json ReconstructionMetrics(const LocalizeJob& job, const RunReconstruction& run) {
  nlohmann::json m;
  m["images"] = job.input.images.size();
  m["images_without_odometry"] = job.without_odometry;
  m["tracks"] = run.tracks.tracks;
  m["observations"] = run.tracked;
  m["feature_sigma_px"] = run.reconstruction.sigma_px;
  for (double f : run.reconstruction.odometry_noise_factor) m["odometry_noise_factor_rx_ry_rz_x_y_z"].push_back(f);
  m["pairs_contradicting_odometry"] = run.tracks.odometry_contradicted;
  m["pairs"] = {{"tried", run.pairs_tried}, {"joined", run.pairs_joined}, {"rejected", run.pairs_rejected.size()}};
  for (const ImagePair& pair : run.pairs_rejected) {
    m["pairs"]["rejected_images"].push_back(
        {job.input.images[static_cast<size_t>(pair.a)].name, job.input.images[static_cast<size_t>(pair.b)].name});
  }
  m["alignment"] = {{"tried", run.alignments_tried}, {"aligned", run.aligned}};
  m["loops"] = {{"tried", run.loops.tried},
                {"found", run.loops.found},
                {"contradicting", run.loops.contradicting},
                {"closed", run.loops.closed},
                {"merged_points", run.loops.merged_points},
                {"correction_m", run.loops.correction_m}};
  for (const auto& [name, seconds] : run.seconds) m["seconds"][name] = seconds;
  return m;
}

// What the images show of the cameras' readout times: offered, never taken unasked.
void OfferReadout(const LocalizeInput& input, const std::vector<ReadoutEstimate>& readout, StageContext& context) {
  constexpr double kSigmas = 5, kLeast_s = 1e-3;
  for (const ReadoutEstimate& e : readout) {
    const BodyCamera& camera = input.cameras[static_cast<size_t>(e.camera)];
    if (camera.part.kind != PicturePart::Kind::kAll) continue;  // its rows are not those of a sensor
    context.metrics["readout"][camera.name] = {
        {"used_s", camera.readout_s}, {"estimate_s", e.readout_s}, {"sigma_s", e.sigma_s}};
    if (std::abs(e.change_s) < std::max(kLeast_s, kSigmas * e.sigma_s)) continue;
    context.progress.Log(
        LogLevel::kWarning,
        fmt::format("camera {}: the images fit best with a readout time of {:.1f} ms +- {:.1f} ms (1 sigma) from the "
                    "first row to the last; {:.1f} ms was used. If its shutter is a rolling one, write readout_s: "
                    "{:.4f} under {} in camchain.yaml",
                    camera.name, 1e3 * e.readout_s, 1e3 * e.sigma_s, 1e3 * camera.readout_s, e.readout_s, camera.name));
  }
}

// What the images show of a run's odometry, beside that it can be used.
struct OdometryVerdict {
  bool drifted = false;  // an even drift was taken out
  double noise = 1;      // how many times larger than stated it is
};

// Refuses odometry that follows other conventions than those of docs/file_formats.md; takes out an even drift.
OdometryVerdict RequireConventions(const LocalizeInput& input, const ReconstructRunOptions& options, Run* run,
                                   StageContext& context) {
  if (const auto unit = FindOtherUnit(*run)) throw RefusedInput(kRefusedOdometry, *unit);
  OdometryCheckOptions check;
  LocalizeInput exact = input;  // what limits odometry is no noise that adds up
  exact.flat = false, exact.time_resolution_s = 0;
  const auto variances = [&](const LocalizeInput& its) {
    return RotationVariances(OdometryFactors(its, options.reconstruct, Vector6d::Ones()), its.odom_from_body.size());
  };
  check.noise_rad = std::sqrt(variances(exact).back());
  check.rotation_variances = variances(input);
  const std::string file = (run->dir / "odometry.tum").string();
  const OdometryFinding found =
      CheckOdometry(input, run->odometry, file, check, context.threads, context.seed, context.progress, context.cancel);
  if (found.contradiction) throw RefusedInput(kRefusedOdometry, *found.contradiction);
  // Where images are farther apart, pairs that other pairs confirm show the noise (view_graph.h): single ones are
  // several degrees off themselves, as the parts of stitched pictures are turned against each other.
  const bool estimate = options.reconstruct.estimate_odometry && MedianStep(input) <= options.pairs.video_step_m;
  const double noise = estimate ? found.noise : 1;
  if (noise > 1) {
    context.progress.Log(
        LogLevel::kWarning,
        fmt::format(
            "{}: by the images, its rotations are {:.1f} times as noisy as options odometry_rotation_deg and "
            "odometry_rotation_deg_m of reconstruct state; its noise is taken as that many times larger. Check "
            "the odometry (corrections by a map, jumps, the wrong images or times) and the calibration (camchain.yaml)",
            file, noise));
  }
  if (!found.drift) return {false, noise};
  context.progress.Log(LogLevel::kWarning,
                       file + ": by the images, " + DriftText(*found.drift) +
                           "; it is taken out. A wrong calibration (focal length, principal point) shows the same on a "
                           "path that bends to one side: check the gyroscope or wheels that odometry is from, and "
                           "camchain.yaml");
  run->odometry = WithoutDrift(run->odometry, input.pose_stamps, input.odom_from_body, found.drift->significant_rad_m);
  return {true, noise};
}

ReconstructRunOptions WithNoise(ReconstructRunOptions options, double times) {
  ReconstructOptions& o = options.reconstruct;
  for (double* sigma : {&o.odometry_rotation_deg, &o.odometry_rotation_deg_m, &o.odometry_translation_m,
                        &o.odometry_translation_part}) {
    *sigma *= times;
  }
  return options;
}

// Refuses images that contradict odometry although its drift is taken out: it is their lens that makes them turn
// otherwise.
void RequireDriftExplains(const Run& run, const Reconstruction& r) {
  if (!(WiderThanExplained(r) > 1)) return;
  throw RefusedInput(
      kRefusedOdometry,
      fmt::format("{}: the images contradict odometry even after its drift is taken out (they fit it only with {:.0f} "
                  "times the noise of their features): the calibration seems to be that of another lens; expected that "
                  "of this camera, with the signs of its distortion model: calibrate it anew (trigpoint calibrate), "
                  "and check odometry.tum. Option --set reconstruct.check_conventions=false skips this check",
                  (run.dir / "camchain.yaml").string(), r.correlation_inflation));
}

// What the lenses leave open is part of the covariances: of lenses found from the images, and of all in a run without
// odometry, as images alone know its shape only as well as their lens.
void HeedLenses(const LocalizeInput& input, RunReconstruction* run, StageContext& context) {
  if (!input.has_odometry) {
    try {
      run->reconstruction.lens_errors = LensErrors(input, run->reconstruction);
    } catch (const NumericError&) {  // what does not determine a lens asks for no other
    }
  }
  run->reconstruction.problem.pose_shifts =
      PoseShiftsByLenses(input, run->reconstruction, context.threads, context.cancel);
}

// What is known of lenses that were found from the images of a run.
void KeepRoots(const LocalizeInput& input, const std::vector<SelfCalibration>& found, RunReconstruction* run) {
  run->reconstruction.lens_roots = LensRoots(input, found, input.has_odometry ? 0 : kUsualLensError);
}

// Holds what a computation says until it is known to be the one that counts.
class HeldLog final : public ProgressSink {
 public:
  explicit HeldLog(ProgressSink& to) : to_(to) {}
  ~HeldLog() override {
    if (std::uncaught_exceptions() > exceptions_) Release();  // it failed: this is all that it said
  }
  void Begin(std::string_view task, int64_t total) override { to_.Begin(task, total); }
  void Advance(int64_t steps) override { to_.Advance(steps); }
  void Log(LogLevel level, std::string_view text) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    lines_.emplace_back(level, text);
  }
  void Release() {
    for (const auto& [level, text] : lines_) to_.Log(level, text);
  }

 private:
  ProgressSink& to_;
  const int exceptions_ = std::uncaught_exceptions();
  std::mutex mutex_;
  std::vector<std::pair<LogLevel, std::string>> lines_;
};

StageContext WithProgress(const StageContext& context, ProgressSink& progress) {
  return {context.project, context.out, context.threads, context.seed, progress, context.cancel, context.metrics};
}

// Refuses odometry with a jump that the solution has spread over the run.
void RequireNoContradictedStep(const Run& run, const LocalizeInput& input, const Reconstruction& reconstruction,
                               const StageContext& context) {
  std::optional<ContradictedStep> step;
  try {
    step = FindContradictedStep(input, reconstruction, context.threads, context.cancel);
  } catch (const NumericError&) {
    return;  // what does not determine the poses contradicts no step
  }
  if (!step) return;
  const auto seconds = [&](int pose) {
    return 1e-9 * static_cast<double>(input.pose_stamps[static_cast<size_t>(pose)]);
  };
  if (step->of_images) {
    throw RefusedInput(
        kRefusedOdometry,
        fmt::format("{}: between {:.3f} and {:.3f} s the images move on by about {:.2f} m more than odometry, which "
                    "they agree with in all other steps (chi-square falls by {:.0f} without this one): pictures seem "
                    "to be missing there, so that later ones have the times of earlier ones; expected each picture "
                    "with its own time. Option --set reconstruct.check_conventions=false skips this check",
                    (run.dir / "images.txt").string(), seconds(step->before), seconds(step->after),
                    step->shift_m.norm(), step->gain));
  }
  const std::string text = fmt::format(
      "{}: jumps by about {:.2f} m between {:.3f} and {:.3f} s: the images contradict this step and agree with all "
      "others (chi-square falls by {:.0f} without it); expected a continuous motion without corrections by GPS or "
      "loops. Images of something that repeats along the way look the same: then option --set "
      "reconstruct.check_conventions=false skips this check",
      (run.dir / "odometry.tum").string(), step->shift_m.norm(), seconds(step->before), seconds(step->after),
      step->gain);
  throw RefusedInput(kRefusedOdometry, text);
}

// Refuses odometry that jumps along the direction of motion, which no pair of images contradicts.
void RequireNoJump(const Run& run, const LocalizeInput& input, const Reconstruction& reconstruction,
                   const StageContext& context) {
  const auto seconds = [&](int pose) {
    return 1e-9 * static_cast<double>(input.pose_stamps[static_cast<size_t>(pose)]);
  };
  const auto jump = FindJumpByPoints(input, reconstruction, context.seed);
  if (!jump) return RequireNoContradictedStep(run, input, reconstruction, context);
  const std::string text = fmt::format(
      "{}: jumps between {:.3f} and {:.3f} s: {} of {} points that images on both sides show fit each other if all "
      "that follows is moved by {:.2f} m, and {} as it is; expected a continuous motion without corrections by GPS or "
      "loops. Option --set reconstruct.check_conventions=false skips this check",
      (run.dir / "odometry.tum").string(), seconds(jump->before), seconds(jump->after), jump->fitting, jump->points,
      jump->shift_m.norm(), jump->fitting_unmoved);
  throw RefusedInput(kRefusedOdometry, text);
}

// Refuses cameras that stand elsewhere on the body than their calibration says.
void RequireArms(const Run& run, const LocalizeInput& input, const Reconstruction& reconstruction,
                 StageContext& context) {
  const bool stated =
      std::any_of(input.cameras.begin(), input.cameras.end(), [](const BodyCamera& c) { return c.has_extrinsics; });
  if (!input.has_odometry || !stated) return;
  std::optional<ArmError> error;
  try {
    error = FindArmError(reconstruction, input.scale_sigma, context.threads, context.cancel);
  } catch (const NumericError&) {
    return;  // what does not determine the poses contradicts no calibration
  }
  if (!error) return;
  const Eigen::Vector3d& arm = error->arm_m;
  const std::string text = fmt::format("{:+.2f}, {:+.2f}, {:+.2f} m (body axes; 1 sigma {:.2f} m)", arm.x(), arm.y(),
                                       arm.z(), error->sigma_m);
  context.progress.Log(LogLevel::kInfo,
                       "place of the cameras on the body against T_cam_imu, by images and odometry: " + text);
  if (!error->significant) return;
  throw InputError(fmt::format(
      "{}: by images and odometry the cameras stand some {:.1f} m from where T_cam_imu of the calibration puts them on "
      "the body (x forward, y left, z up); expected their places to a few centimetres: measure them anew, and check of "
      "which point of the body odometry.tum is. Option --set reconstruct.check_conventions=false skips this check",
      (run.dir / "camchain.yaml").string(), arm.norm()));
}

// Refuses a calibration that the images contradict.
void RequireCalibration(const LocalizeInput& input, const RunReconstruction& run, StageContext& context) {
  LensCheck check;
  try {
    check = CheckLenses(input, run.reconstruction);
  } catch (const NumericError&) {
    return;  // what does not determine a lens contradicts none
  }
  context.metrics["lens_residuals_removed"] = check.better;
  if (const auto contradiction = Contradiction(input, check)) throw InputError(*contradiction);
}

// Says that images had to be taken as noisier than they are, beyond what correlation along tracks and chance explain,
// to fit odometry. Refuses both where the images then say nothing: a tenth of half the picture's diagonal.
void HeedContradiction(const Run& run, const LocalizeInput& input, const Reconstruction& r, bool refuse,
                       StageContext& context) {
  constexpr double kNothing = 0.1;
  if (!(WiderThanExplained(r) > kLeastWidening)) return;
  double half_diagonal = 0;
  for (const BodyCamera& c : input.cameras) half_diagonal = std::max(half_diagonal, HalfDiagonal(c.camera));
  const double acting_px = r.sigma_px * r.correlation_inflation;
  const std::string text = fmt::format(
      "run {}: images and odometry contradict each other: they fit only with a noise of the images of {:.1f} px, "
      "{:.0f} times that of their features; check odometry (wheels that slip, a wrong scale in a part, corrections by "
      "a map) and the calibration",
      run.name, acting_px, r.correlation_inflation);
  if (refuse && acting_px > kNothing * half_diagonal) {
    throw RefusedInput(kRefusedOdometry, text + ". Option --set reconstruct.check_conventions=false skips this check");
  }
  context.progress.Log(LogLevel::kWarning, text);
}

// The job of a run without odometry along the motion that was found for it.
LocalizeJob JobAlongMotion(Run run, const fs::path& features, const StageContext& context) {
  FollowReconstruction(context.out, &run);
  LocalizeJob job = MakeRunJob(run, features);
  job.input.has_odometry = false;
  return job;
}

// Of a reconstruction from some images of a run: their indices become those of the run.
void RenumberImages(const std::vector<int>& images, RunReconstruction* run) {
  const auto of_run = [&](int* image) { *image = images[static_cast<size_t>(*image)]; };
  for (int& image : run->reconstruction.image_of) of_run(&image);
  for (ImagePair& pair : run->pairs_rejected) of_run(&pair.a), of_run(&pair.b);
}

// Structure from motion may have single images elsewhere than the reconstruction, which joins all their tracks: where
// it does, the run is reconstructed again along what was found, as its pairs were judged by the wrong motion. In the
// end the reconstruction's own motion stands in place of odometry: the one that it began with would pull on every
// solution that follows.
RunReconstruction ReconstructAlongMotion(const ReconstructRunOptions& options, LocalizeInput input,
                                         const StageContext& context) {
  constexpr int kRounds = 3;
  for (int round = 1;; ++round) {
    RunReconstruction run =
        ReconstructRun(input, options, false, context.threads, context.seed, context.progress, context.cancel);
    BundleProblem& p = run.reconstruction.problem;
    bool contradicted = false;
    for (PoseFactor& f : p.factors) {
      if (f.kind != PoseFactor::Kind::kBetween) continue;
      contradicted = contradicted || f.weight < 1;
      f.measured = p.poses[static_cast<size_t>(f.a)] * p.poses[static_cast<size_t>(f.b)].Inverse();
    }
    if (!contradicted || round == kRounds) return run;
    for (size_t k = 0; k < input.odom_from_body.size(); ++k) input.odom_from_body[k] = p.poses[k].Inverse();
  }
}

// Finds the motion first. Where cameras stand apart on the body, the images of one centre of each pose show the motion
// and, with the other cameras, its length; without a length these take no part, as their places contradict a frame of
// another unit, unless they are so close together that it does not matter.
LocalizeJob ReconstructImagesAlone(const ReconstructRunOptions& options, const fs::path& features, const Run& run,
                                   StageContext& context, RunReconstruction* result) {
  const fs::path file = context.out / kMotionFile;
  const FoundMotion found = FindImageMotion(run, MakeRunJob(run, features).input, options, file, context.threads,
                                            context.seed, context.progress, context.cancel);
  LocalizeJob job = JobAlongMotion(run, features, context);
  const auto done = [&](const std::string& unit, double sigma_share) {
    WriteMotion(job.input, result->reconstruction.problem, unit, sigma_share, file);
    return job;
  };
  const std::vector<int> images = ImagesOfFirstCentre(job.input);
  *result = ReconstructAlongMotion(options, OnlyImages(job.input, images), context);
  job.warnings.push_back(found.text + found.unit);
  if (images.size() == job.input.images.size()) return done(found.unit, kUnknownScaleSigma);
  RenumberImages(images, result);
  const RigLength length =
      LengthByRig(job.input, result->reconstruction, options.pairs, context.threads, context.cancel);
  context.metrics["length_by_rig"] = {{"known", length.known}, {"matches", length.matches}};
  if (!length.known && length.contradiction_sigmas < 1) {  // the distances are too short to matter
    *result = ReconstructAlongMotion(options, job.input, context);
    return done(found.unit, kUnknownScaleSigma);
  }
  if (!length.known) {
    job.warnings.push_back(
        fmt::format("run {}: the distances between its cameras do not determine its scale ({} matches between cameras "
                    "that stand apart agree; expected the scale to 10 %, 1 sigma): the {} images of cameras away from "
                    "the first are not used; odometry would give the scale",
                    run.name, length.matches, job.input.images.size() - images.size()));
    return done(found.unit, kUnknownScaleSigma);
  }
  context.metrics["length_by_rig"]["sigma_share"] = length.sigma_share;
  job.input.odom_from_body = MotionInMetres(job.input, result->reconstruction, length.m_per_unit);
  job.warnings.back() = fmt::format("{}m, by the cameras' places on the body ({:.1f} %, 1 sigma, {} matches)",
                                    found.text, 100 * length.sigma_share, length.matches);
  *result = ReconstructAlongMotion(options, job.input, context);
  return done("m, by the cameras' places on the body", length.sigma_share);
}

// With the cameras of the run as they are.
LocalizeJob ReconstructOnce(const ReconstructRunOptions& options, const std::string& mode, const fs::path& features,
                            const Run& run, StageContext& context, RunReconstruction* result) {
  LocalizeJob job = MakeRunJob(run, features);
  if (!job.input.has_odometry && mode == "paper") {
    throw InputError("run " + run.name +
                     ": has no odometry, which the published method needs: odometry.tum (timestamp tx ty tz qx qy qz "
                     "qw); without it run `trigpoint localize` in its own mode");
  }
  if (!job.input.has_odometry) return ReconstructImagesAlone(options, features, run, context, result);
  *result = ReconstructRun(job.input, options, mode == "paper", context.threads, context.seed, context.progress,
                           context.cancel);
  return job;
}

// Reconstructs a run; where its images turn out to be late against odometry, again with the odometry of `as_read`
// moved.
LocalizeJob ReconstructOnOneClock(const std::function<LocalizeJob(StageContext&)>& reconstruct,
                                  const ReconstructRunOptions& options, RunReconstruction* result, Run* as_read,
                                  StageContext& context) {
  constexpr int kRounds = 3;
  constexpr double kMost_s = 0.5;  // what is of first order reaches no farther
  double late_s = 0, sigma_s = 0;
  for (int round = 1;; ++round) {
    HeldLog log(context.progress);
    StageContext held = WithProgress(context, log);
    LocalizeJob job = reconstruct(held);
    const auto late = FindLateImages(job.input, result->reconstruction, options, round > 1, context);
    if (!late || round == kRounds || std::abs(late_s + late->late_s) > kMost_s) {
      log.Release();  // what was said with other times of odometry is not
      if (late_s == 0) return job;
      WriteOdometryTime(late_s, sigma_s, context.out / kOdometryTimeFile);
      SayLate(*as_read, late_s, sigma_s, context);
      return job;
    }
    const double by_s = std::round(1e9 * late->late_s) / 1e9;  // as the file has it
    late_s += by_s, sigma_s = late->sigma_s;
    MoveOdometry(by_s, as_read);
    *result = {};
  }
}

constexpr double kConvergedPx = 0.5;  // a lens has converged when it moves pixels by less

bool HaveConverged(const std::vector<SelfCalibration>& lenses) {
  return std::all_of(lenses.begin(), lenses.end(), [](const auto& s) { return s.shift_px < kConvergedPx; });
}

// Lenses that nobody calibrated are found from the reconstruction, which is then made again with them, until they stay.
LocalizeJob ReconstructWithItsCameras(const ReconstructRunOptions& options, const std::string& mode,
                                      const fs::path& features, Run run, StageContext& context,
                                      RunReconstruction* result) {
  constexpr int kRounds = 4;
  LocalizeInput begin = MakeRunJob(run, features).input;
  SearchFocalLengths(&begin, options.pairs, context.threads, context.seed, context.progress, context.cancel);
  run.cameras = begin.cameras;
  for (int round = 1;; ++round) {
    HeldLog log(context.progress);
    StageContext held = WithProgress(context, log);
    LocalizeJob job = ReconstructOnce(options, mode, features, run, held, result);
    const std::vector<SelfCalibration> found = SelfCalibrate(job.input, result->reconstruction);
    const bool done = HaveConverged(found);
    if (done || round == kRounds) log.Release();  // what was said of other lenses may be their fault
    if (found.empty()) return job;
    if (done || round == kRounds) {
      KeepRoots(job.input, found, result);
      WriteFoundCameras(run, found, context.out / kFoundCamerasFile, context.progress);
      return job;
    }
    TakeCameras(found, &run);
  }
}

constexpr double kSignificant = 3;  // sigmas by which a lens must differ from its calibration

// The share of the squared residuals that other lenses remove, where images contradict odometry by so much that their
// lenses are doubted; else 0. Good calibrations of the data that this was tried with remove at most 0.08, and images
// act with at most 2.7 times their noise.
double DoubtOfLenses(const LocalizeInput& input, const Reconstruction& r) {
  constexpr double kContradicted = 3, kBetter = 0.1;
  if (!(r.correlation_inflation > kContradicted)) return 0;
  try {
    const double better = CheckLenses(input, r).better;
    return better > kBetter ? better : 0;
  } catch (const NumericError&) {
    return 0;
  }
}

// Lenses as the images have them, about their calibration; none where they are not significantly different.
std::vector<SelfCalibration> OtherLenses(const LocalizeInput& input, const Reconstruction& r, const Run& calibrated) {
  try {
    std::vector<SelfCalibration> found = ReviseLenses(input, r, calibrated.cameras);
    const bool differ = std::any_of(found.begin(), found.end(), [](const auto& s) { return s.sigmas > kSignificant; });
    return differ ? found : std::vector<SelfCalibration>();
  } catch (const NumericError&) {
    return {};
  }
}

// Where the images contradict odometry by their lenses, these are estimated about their calibration, and the run is
// reconstructed again with them, until they stay. Kept where less than half of the doubt remains.
void HeedCalibration(const ReconstructRunOptions& options, const fs::path& features, const Run& calibrated,
                     StageContext& context, OdometryVerdict* verdict, LocalizeJob* job, RunReconstruction* result) {
  constexpr int kRounds = 4;
  std::vector<SelfCalibration> kept;
  std::unique_ptr<HeldLog> said;
  Run run = calibrated;
  double doubt = DoubtOfLenses(job->input, result->reconstruction);
  for (int round = 0; round < kRounds && (doubt > 0 || !kept.empty()); ++round) {
    const std::vector<SelfCalibration> found = OtherLenses(job->input, result->reconstruction, calibrated);
    if (HaveConverged(found)) break;
    TakeCameras(found, &run);
    Run asked = run;
    OdometryVerdict its_verdict;
    auto log = std::make_unique<HeldLog>(context.progress);
    StageContext held = WithProgress(context, *log);
    try {
      its_verdict = RequireConventions(MakeRunJob(asked, features).input, options, &asked, held);
    } catch (const RefusedInput&) {
      break;  // odometry agrees with the images through the calibrated lens alone
    }
    RunReconstruction other;
    LocalizeJob its =
        ReconstructOnce(WithNoise(options, its_verdict.noise), "trigpoint", features, asked, held, &other);
    const double remains = DoubtOfLenses(its.input, other.reconstruction);
    if (remains > (kept.empty() ? 0.5 : 1) * doubt) break;
    *job = std::move(its), *result = std::move(other), *verdict = its_verdict, kept = found, doubt = remains;
    said = std::move(log);
  }
  if (kept.empty()) return;
  said->Release();
  KeepRoots(job->input, kept, result);
  Run revised = calibrated;
  TakeCameras(kept, &revised);
  WriteRevisedCameras(calibrated, revised, kept, context.out / kFoundCamerasFile, context.progress);
}

}  // namespace

ReconstructedRun ReconstructFiles(Run run, const fs::path& features, const ReconstructRunOptions& options,
                                  const std::string& mode, StageContext& context) {
  Run as_read = run;
  OdometryVerdict verdict;
  const auto check = [&](const LocalizeJob& job, StageContext& its_context) {
    if (!options.check_conventions || !job.input.has_odometry) return;
    verdict = RequireConventions(job.input, options, &run, its_context);
  };
  // A lens that is a guess would be blamed on odometry: there the check waits for the lens.
  const bool calibrated = std::none_of(run.cameras.begin(), run.cameras.end(),
                                       [](const BodyCamera& camera) { return camera.focal_sigma_share > 0; });
  ReconstructedRun out;
  RunReconstruction& result = out.reconstruction;
  LocalizeJob& job = out.job;
  const auto reconstruct = [&](StageContext& its_context) {
    if (calibrated) {
      run = as_read;
      check(MakeRunJob(run, features), its_context);
    }
    const ReconstructRunOptions its = WithNoise(options, verdict.noise);
    return calibrated || mode == "paper" ? ReconstructOnce(its, mode, features, run, its_context, &result)
                                         : ReconstructWithItsCameras(its, mode, features, run, its_context, &result);
  };
  const bool heed = options.check_conventions && mode != "paper";
  const bool on_clock = calibrated && heed && !run.odometry.poses.empty();
  job = on_clock ? ReconstructOnOneClock(reconstruct, options, &result, &as_read, context) : reconstruct(context);
  if (!calibrated) {
    check(job, context);
    if (verdict.drifted || verdict.noise > 1) job = reconstruct(context);
  }
  if (options.check_conventions && job.input.has_odometry && result.pairs_joined == 0) {
    const std::string odometry = (run.dir / "odometry.tum").string();
    if (const auto wrong = ContradictedByPairs(job.input, result.pairs_rejected, odometry)) throw InputError(*wrong);
  }
  if (calibrated && heed) {
    RequireCalibration(job.input, result, context);
    if (job.input.has_odometry) {
      HeedCalibration(options, features, as_read, context, &verdict, &job, &result);
      RequireNoJump(run, job.input, result.reconstruction, context);
      if (verdict.drifted) RequireDriftExplains(run, result.reconstruction);
    }
    RequireArms(run, job.input, result.reconstruction, context);
    RequireOneClock(run, job.input, result.reconstruction, options, context);
  }
  if (!job.input.has_odometry || !result.reconstruction.lens_roots.empty()) HeedLenses(job.input, &result, context);
  if (job.input.has_odometry && mode != "paper") {
    HeedContradiction(run, job.input, result.reconstruction, options.check_conventions, context);
  }
  for (const std::string& w : job.warnings) context.progress.Log(LogLevel::kWarning, w);
  context.metrics.update(ReconstructionMetrics(job, result));
  context.metrics["odometry_noise_over_stated"] = verdict.noise;
  OfferReadout(job.input, result.readout, context);
  return out;
}

}  // namespace trigpoint

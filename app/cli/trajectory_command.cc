// trajectory: ATE and RPE of any trajectories.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>

#include "app/cli/command.h"
#include "datasets/io/camchain.h"
#include "datasets/io/gps.h"
#include "datasets/io/lines.h"
#include "datasets/io/text.h"
#include "datasets/project/outputs.h"
#include "eval/report/trajectory_plots.h"
#include "eval/trajectory/trajectory.h"
#include "eval/trajectory/trajectory_frames.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

struct TrajectoryArguments {
  std::string reference;
  std::vector<std::string> estimates;
  std::string align = "none";
  std::string offset = "0";
  double max_difference_s = 0.01;
  bool interpolate = false;
  bool all_pairs = false;
  std::vector<std::string> relative;
  std::vector<double> lever_arm, origin;
  std::string time_zero, out, plot;
  bool force = false;
};

bool IsGps(const fs::path& file) {
  const std::string extension = file.extension().string();
  if (extension == ".nmea" || extension == ".gpx") return true;
  return extension == ".csv" && ReadTextFile(file).find("latitude_deg") != std::string::npos;
}

// Whose GPS track the reference is.
struct TrackedRun {
  std::optional<Eigen::Vector3d> lever_arm_m;  // antenna in the body frame; unset: the command line states it
  std::vector<BodyCamera> cameras;
};

// The camera that a trajectory's poses are of, by its comments as this program writes them: world_from_cam0, or
// world_from_cam for the run's first one. Null: poses of the body.
const BodyCamera* CameraOf(const std::string& file, const std::vector<BodyCamera>& cameras) {
  constexpr std::string_view kFrom = "_from_";
  const std::string text = ReadTextFile(file);
  std::vector<std::string_view> comments;
  DataLines(text, &comments);
  for (const std::string_view comment : comments) {
    const size_t at = comment.rfind(kFrom);
    if (at == std::string_view::npos) continue;
    std::string_view name = comment.substr(at + kFrom.size());
    name = name.substr(0, name.find_first_of(" ;"));
    for (const BodyCamera& camera : cameras) {
      if (name == camera.name || name == "cam") return &camera;
    }
  }
  return nullptr;
}

// The run's clock and antenna are of the body: brings both to what the estimate's poses are of.
void ReferToBody(const TrackedRun& run, const std::string& file, PoseSequence* estimate,
                 AssociationOptions* association) {
  const BodyCamera* camera = CameraOf(file, run.cameras);
  if (run.lever_arm_m) {
    association->estimate_body_from_reference_body.translation =
        camera != nullptr ? camera->cam_from_body * *run.lever_arm_m : *run.lever_arm_m;
  }
  if (camera == nullptr) return;
  for (int64_t& stamp : estimate->stamps_ns) stamp = BodyStamp(stamp, *camera);
}

// A GPS track in site ENU. One in a project's runs/<run>/ takes clock, lever arm and origin from there: `of`.
PoseSequence ReadGps(const fs::path& file, const TrajectoryArguments& arguments, std::optional<TrackedRun>* of) {
  const fs::path run_dir = fs::absolute(file).lexically_normal().parent_path();
  RunClock clock;
  std::optional<LocalFrame> frame;
  int64_t offset_ns = 0;
  if (run_dir.parent_path().filename() == "runs") {
    const Project project = Project::Open(run_dir.parent_path().parent_path());
    const Run& run = project.run(run_dir.filename().string());
    clock = {run.config.time_zero_utc_ns, run.config.date};
    offset_ns = std::llround(run.config.gps_time_offset_s * 1e9);
    if (project.has_frame()) frame = project.frame();
    *of = TrackedRun{std::nullopt, run.cameras};
    if (arguments.lever_arm.empty()) (*of)->lever_arm_m = run.config.gps_lever_arm_m;
  }
  if (!arguments.time_zero.empty()) {
    clock.time_zero_utc_ns = ParseUtcToNs(arguments.time_zero);
    if (!clock.time_zero_utc_ns) {
      throw OptionError("--time-zero " + arguments.time_zero + ": expected a UTC time like 2026-05-12T09:43:20Z");
    }
    clock.date = arguments.time_zero.substr(0, 10);
  }
  const std::string extension = file.extension().string();
  GpsTrack track = extension == ".nmea"  ? ReadNmea(file, clock)
                   : extension == ".gpx" ? ReadGpx(file, clock)
                                         : ReadGpsCsv(file);
  if (track.fixes.empty()) throw InputError(file.string() + ": expected a GPS track, found no fix");
  for (GpsFix& fix : track.fixes) fix.stamp_ns += offset_ns;
  if (arguments.origin.size() == 3) {
    frame = LocalFrame(Geodetic{arguments.origin[0], arguments.origin[1], arguments.origin[2]});
  }
  PoseSequence sequence = PoseSequenceFromGps(track.fixes, frame ? *frame : LocalFrame(track.fixes.front().position));
  sequence.warnings = track.warnings;
  if (!frame)
    sequence.warnings.push_back("east-north-up begins at the track's first fix; --origin names another place");
  return sequence;
}

// Estimates as they are compared: in pairs, on the reference's clock, not aligned yet.
struct Compared {
  TrajectoryReport report;
  std::vector<PosePair> pairs;
  std::optional<FrameDifference> frames;  // without --align
};

Compared Compare(const std::string& file, const PoseSequence& reference, const std::optional<TrackedRun>& of,
                 TrajectoryReportOptions options) {
  PoseSequence estimate = ReadPoseSequence(file);
  if (of) ReferToBody(*of, file, &estimate, &options.association);
  Compared compared{EvaluateTrajectory(file, reference, estimate, options), {}, {}};
  AssociationOptions association = options.association;
  association.offset_s = compared.report.applied_offset_s;
  association.interpolate = compared.report.interpolated;
  compared.pairs = Associate(reference, estimate, association);
  if (options.alignment == TrajectoryAlignment::kNone) compared.frames = FindFrameDifference(compared.pairs);
  return compared;
}

// `plot` from above, <plot>_axes and <plot>_errors along the way, all as aligned as the numbers are.
std::vector<fs::path> WritePlots(const std::vector<Compared>& all, const TrajectoryReportOptions& options,
                                 const TrajectoryArguments& arguments, const DisplayUnit& unit) {
  std::vector<PlottedTrajectory> estimates;
  for (const Compared& compared : all) {
    std::vector<PosePair> pairs = compared.pairs;
    Align(&pairs, options.alignment);
    const TrajectoryErrors errors = AbsoluteErrors(pairs);
    PlottedTrajectory& plotted = estimates.emplace_back();
    plotted.name = fs::path(compared.report.name).filename().string();
    double along = 0;
    for (size_t i = 0; i < pairs.size(); ++i) {
      if (i > 0) along += (pairs[i].reference.translation - pairs[i - 1].reference.translation).norm();
      plotted.reference_places.emplace_back(pairs[i].reference.translation / unit.metres);
      plotted.places.emplace_back(pairs[i].estimate.translation / unit.metres);
      plotted.along.push_back(along / unit.metres);
      plotted.errors.push_back(errors.translation_m[i] / unit.metres);
    }
  }
  const fs::path plan = fs::absolute(arguments.plot).lexically_normal();
  const auto beside = [&](const char* what) {
    return fs::path(plan.stem().string() + "_" + what + plan.extension().string());
  };
  OutputFiles output(plan.parent_path(), arguments.force);
  WriteDrawing(TrajectoryPlan(estimates, unit.name), "Trajectories from above", output.staging() / plan.filename());
  WriteDrawing(TrajectoryAxesChart(estimates, unit.name), "x, y and z along the way",
               output.staging() / beside("axes"));
  WriteDrawing(TrajectoryErrorChart(estimates, unit.name), "Absolute errors along the way",
               output.staging() / beside("errors"));
  return output.Publish();
}

// A line an estimate; the table with every statistic is for --verbose.
Ending TrajectoryEnding(const std::vector<Compared>& all, const TrajectoryReportOptions& options,
                        const DisplayUnit& unit) {
  const auto length = [&](double metres) { return fmt::format("{:.4f} {}", metres / unit.metres, unit.name); };
  Ending ending(Counted(all.size(), "trajectory", "trajectories") +
                (options.alignment == TrajectoryAlignment::kNone ? ", compared as they are"
                                                                 : ", aligned by " + ToString(options.alignment)));
  for (const Compared& compared : all) {
    const TrajectoryReport& r = compared.report;
    std::string text = fmt::format("ATE {} rmse, {} median, {} worst", length(r.ate_m.rmse), length(r.ate_m.median),
                                   length(r.ate_m.max));
    if (r.ate_deg) text += fmt::format(", {:.3f} deg rmse", r.ate_deg->rmse);
    for (const RelativeReport& rpe : r.rpe) {
      const std::string over = RelativeName(rpe.options);
      if (rpe.m)
        text +=
            "; RPE " + over + " " + length(rpe.m->rmse) + (rpe.deg ? fmt::format(", {:.3f} deg", rpe.deg->rmse) : "");
      if (!rpe.m) ending.Problem("Note", r.name + " is too short for one piece of " + over);
    }
    if (options.alignment == TrajectoryAlignment::kSim3)
      text += fmt::format("; scale {:.6f}", r.reference_from_estimate.scale);
    if (r.applied_offset_s != 0) text += fmt::format("; clock moved by {:+.4f} s", r.applied_offset_s);
    ending.Fact(fs::path(r.name).filename().string(), fmt::format("{} ({})", text, Counted(r.pairs, "pair")));
    if (r.ate_h_m) {
      ending.Fact("", fmt::format("horizontal {} rmse, vertical {}; the track states 1 sigma {} and {} per axis, part "
                                  "of every error here",
                                  length(r.ate_h_m->rmse), length(r.ate_v_m->rmse), length(r.reference_sigma_h_m),
                                  length(r.reference_sigma_v_m)));
    }
    if (compared.frames) {
      ending.Problem("Frames", fs::path(r.name).filename().string() + ": " +
                                   Describe(*compared.frames, unit.name, unit.metres) + "; --align " +
                                   ToString(compared.frames->proposed) + " applies it");
    }
    for (const std::string& warning : r.warnings) ending.Problem("Note", r.name + ": " + warning);
    if (!r.time_offset || !r.time_offset->significant || options.find_offset) continue;
    ending.Problem("Note",
                   fmt::format("{} fits better with its clock moved by {:+.3f} s (sigma {:.3f} s): ATE {} instead of "
                               "{} after a rigid fit; --offset auto applies it",
                               r.name, r.time_offset->offset_s, r.time_offset->sigma_s,
                               length(r.time_offset->rmse_after_m), length(r.time_offset->rmse_before_m)));
  }
  return ending;
}

int Score(const Session& session, const TrajectoryArguments& arguments) {
  TrajectoryReportOptions options;
  options.alignment = ParseTrajectoryAlignment(arguments.align);
  options.association.max_difference_s = arguments.max_difference_s;
  options.association.interpolate = arguments.interpolate;
  options.find_offset = arguments.offset == "auto";
  if (!options.find_offset) {
    const auto offset = ParseDouble(arguments.offset);
    if (!offset || !std::isfinite(*offset)) {
      throw OptionError("--offset " + arguments.offset + ": expected seconds, or auto");
    }
    options.association.offset_s = *offset;
  }
  if (arguments.lever_arm.size() == 3) {
    options.association.estimate_body_from_reference_body.translation =
        Eigen::Vector3d::Map(arguments.lever_arm.data());
  }
  if (!arguments.relative.empty()) options.relative.clear();
  for (const std::string& text : arguments.relative) options.relative.push_back(ParseRelative(text));
  for (RelativeOptions& relative : options.relative) relative.all_pairs = arguments.all_pairs;

  std::optional<TrackedRun> of;
  const PoseSequence reference =
      IsGps(arguments.reference) ? ReadGps(arguments.reference, arguments, &of) : ReadPoseSequence(arguments.reference);
  std::vector<Compared> all;
  std::vector<TrajectoryReport> reports;
  std::vector<std::pair<std::string, std::string>> failed;
  const Terminal terminal = session.MakeTerminal();
  int exit_code = 0;
  for (const std::string& file : arguments.estimates) {
    session.cancel->ThrowIfCancelled();
    try {
      all.push_back(Compare(file, reference, of, options));
      reports.push_back(all.back().report);
    } catch (const Error& e) {  // the others go on
      const std::string what = e.what();
      failed.emplace_back(file, what.find(file) == std::string::npos ? file + ": " + what : what);
      exit_code = e.ExitCode();
    }
  }
  if (reports.empty() && failed.size() == 1) throw InputError(failed.front().second);
  const DisplayUnit unit = DisplayUnitNamed(session.options.units);
  if (!reports.empty()) {
    session.PrintDetails(FormatTrajectoryReports(reports, options, unit.name, unit.metres) + "\n");
  }
  nlohmann::json summary = TrajectoryReportsJson(reports, options);
  for (size_t i = 0; i < all.size(); ++i) {
    if (!all[i].frames) continue;
    summary["estimates"][i]["frames"] = {{"proposed", ToString(all[i].frames->proposed)},
                                         {"rmse_before_m", all[i].frames->rmse_before_m},
                                         {"rmse_after_m", all[i].frames->rmse_after_m}};
  }
  summary["failed"] = nlohmann::json::array();
  for (const auto& [file, why] : failed) {
    session.MakeTerminal().Log(LogLevel::kError, why);
    summary["failed"].push_back({{"name", file}, {"error", why}});
  }
  if (!arguments.out.empty()) {
    const fs::path out = fs::absolute(arguments.out).lexically_normal();
    OutputFiles output(out.parent_path(), arguments.force);
    WriteFileAtomically(output.staging() / out.filename(), summary.dump(2) + "\n");
    output.Publish();
  }
  Ending ending = TrajectoryEnding(all, options, unit);
  if (!arguments.plot.empty() && !all.empty()) {
    for (const fs::path& file : WritePlots(all, options, arguments, unit)) ending.Look("Plot", file);
  }
  if (!arguments.out.empty()) ending.Look("Summary", arguments.out);
  session.End(ending);
  summary["command"] = "trajectory";
  summary["ok"] = failed.empty();
  session.PrintJson(summary);
  return exit_code;
}

}  // namespace

void AddTrajectoryCommand(CLI::App& app, Session& session) {
  CLI::App& command = AddCommand(
      app, session, "trajectory", "absolute and relative errors of trajectories against a reference",
      "Files are TUM, KITTI or EuRoC; REFERENCE may be a GPS track (CSV, NMEA, GPX). ATE and RPE are defined as in "
      "the\n"
      "program evo. Without --align the coordinates are compared as given. Where the frames differ, the last lines\n"
      "propose an alignment.\n\n"
      "Examples:\n"
      "  trigpoint trajectory truth.tum slam.tum --align se3 --plot slam.svg\n"
      "  trigpoint trajectory truth.tum a.tum b.tum --align sim3 --rpe 1m --rpe 10s --offset auto\n"
      "  trigpoint trajectory my_site/runs/run1/gps.csv my_site/results/localize/run1/cameras.tum --interpolate");
  const auto a = std::make_shared<TrajectoryArguments>();
  command.add_option("REFERENCE", a->reference, "the trajectory to compare with, or a GPS track")->required();
  command.add_option("ESTIMATE", a->estimates, "one or more trajectories")->required();
  command.add_option("--align", a->align, "none, origin, yaw, se3 or sim3")->capture_default_str();
  command
      .add_option("--offset", a->offset,
                  "seconds added to the estimates' stamps, or auto: what fits best, if it is significant")
      ->capture_default_str();
  command
      .add_option("--max-difference", a->max_difference_s, "largest time difference of two poses that are paired, s")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command.add_flag("--interpolate", a->interpolate, "interpolate the denser one instead of taking the nearest pose");
  command.add_option("--rpe", a->relative, "relative errors over 1f, 10m or 5s (may be given several times; 1f)")
      ->allow_extra_args(false);
  command.add_flag("--all-pairs", a->all_pairs,
                   "take a piece of the path from every pose on, instead of consecutive pieces");
  command
      .add_option("--lever-arm", a->lever_arm,
                  "X Y Z, m: where the reference's point lies in the estimate's body (the antenna, another camera); "
                  "default for the GPS track of a run: the antenna by run.yaml")
      ->expected(3);
  command.add_option("--origin", a->origin, "LAT LON HEIGHT (deg, deg, m) of the frame that a GPS track is put into")
      ->expected(3);
  command.add_option("--time-zero", a->time_zero, "UTC of the estimates' time 0, for NMEA and GPX");
  command.add_option("--out", a->out, "write the JSON summary to this file too; only a summary is ever replaced");
  command.add_option(
      "--plot", a->plot,
      "draw the trajectories from above into this file (.svg or .png); beside it, x, y and z along the way "
      "(name with _axes) and the errors (_errors)");
  command.add_flag("--force", a->force, "replace files that were changed since they were written");
  command.callback([&session, a] { session.action = [a](Session& s) { return Score(s, *a); }; });
}

}  // namespace trigpoint

// Jobs run for a person: a line each while they run, an ending when they are done.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "app/cli/command.h"
#include "app/cli/project_facts.h"
#include "app/cli/run_command.h"
#include "app/pipeline/command_line.h"
#include "datasets/io/csv.h"
#include "datasets/io/photo_sets.h"
#include "datasets/io/readable.h"
#include "datasets/io/site_inputs.h"
#include "datasets/io/survey_tables.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "eval/gates/judge_results.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

// Why no measured distance took part in a survey; "" if one did, or none is there.
std::string UnusedDistances(const Project& project, const fs::path& survey) {
  const fs::path file = project.dir() / "distances.csv", table = survey / "distances.csv";
  std::vector<std::string> ignored;
  try {
    if (!fs::exists(file) || !fs::exists(table) || !CsvTable::Read(table, {"from", "to"}).rows().empty()) return "";
    const size_t rows = ReadDistances(file, &ignored).size();
    return rows == 0 ? ""
                     : fmt::format(
                           "{}: expected a distance between two tags of the map, found none in {}; nothing of "
                           "this file is used",
                           file.string(), Counted(static_cast<int64_t>(rows), "row", "rows"));
  } catch (const InputError&) {
    return "";  // the reader of tables names it
  }
}

// Names of surveyed points that are no tags.
std::vector<std::string> NamedPoints(const Project& project) {
  std::vector<std::string> names, ignored;
  const auto add = [&](const std::vector<ControlPoint>& points) {
    for (const ControlPoint& point : points) {
      if (!point.point.empty()) names.push_back(point.point);
    }
  };
  add(project.site().control_points);
  const fs::path json = project.dir() / "ground_control_points.json", list = project.dir() / "gcp_list.txt";
  if (fs::exists(json)) add(ReadOpenSfmJson(json, &ignored).points);
  if (fs::exists(list)) add(ReadOpenSfmList(list, &ignored).points);
  return names;
}

// Pictures that a mark can be in: below the project, and as in images.txt.
std::vector<std::string> MarkablePictures(const Project& project) {
  std::vector<std::string> pictures;
  for (const Run& run : project.site().runs) {
    for (const ImageEntry& image : run.images) {
      pictures.push_back(RelativeTo(project.dir(), image.path));
      pictures.push_back(image.file);
    }
  }
  for (const fs::path& set : PhotoSetFolders(project.dir())) {
    for (const auto& photo : fs::directory_iterator(set)) pictures.push_back(RelativeTo(project.dir(), photo.path()));
  }
  return pictures;
}

// Why no row of control_observations.csv can be used; "" if one can, or there is none. A project without surveyed
// points by name may have marks all the same: `mark` predicts from them.
std::string UnusedMarks(const Project& project) {
  const fs::path file = project.dir() / "control_observations.csv";
  std::vector<std::string> ignored;
  if (!fs::exists(file)) return "";
  try {
    const std::vector<PointMark> marks = ReadControlObservations(file, &ignored);
    const std::vector<std::string> points = NamedPoints(project), pictures = MarkablePictures(project);
    const auto is_point = [&](const std::string& name) {
      return points.empty() || std::find(points.begin(), points.end(), name) != points.end();
    };
    const auto is_picture = [&](const std::string& name) {
      return std::any_of(pictures.begin(), pictures.end(),
                         [&](const std::string& picture) { return picture == name || picture.ends_with("/" + name); });
    };
    for (const PointMark& mark : marks) {
      if (is_point(mark.point) && is_picture(mark.image)) return "";
    }
    if (marks.empty()) return "";
    const bool image = is_point(marks.front().point);
    const std::string& name = image ? marks.front().image : marks.front().point;
    const std::string nearest = NearestName(name, image ? pictures : points);
    return fmt::format(
        "{}: expected surveyed points in pictures of the project, found none in {}; the first names {} "
        "'{}'{}, which is {}",
        file.string(), Counted(static_cast<int64_t>(marks.size()), "row", "rows"), image ? "the image" : "the point",
        Excerpt(name), nearest.empty() ? "" : " (nearest: '" + Excerpt(nearest) + "')",
        image ? "in no run and no photo set" : "not in control_points.csv");
  } catch (const InputError&) {
    return "";  // the reader of tables names it
  }
}

// What was given and led to nothing: tables without a usable row, references of which none is localized.
std::vector<std::string> GivenForNothing(const Project& project, const std::vector<JobResult>& results) {
  std::vector<std::string> problems;
  int64_t references = 0, localized = 0;
  bool reads_tables = false;
  std::string size;
  for (const JobResult& result : results) {
    const std::string& stage = result.job.stage->name;
    reads_tables = reads_tables || (stage != "features" && stage != "reconstruct" && stage != "detect" &&
                                    stage != "calibrate" && stage != "stitch");
    const bool there = result.end == JobEnd::kComputed || result.end == JobEnd::kUpToDate;
    if (stage == "survey" && there) {
      if (const std::string why = UnusedDistances(project, result.outcome.dir); !why.empty()) problems.push_back(why);
    }
    if (stage != "localize" || !there) continue;
    references += result.outcome.manifest["metrics"].value("references", int64_t{0});
    localized += result.outcome.manifest["metrics"].value("localized", int64_t{0});
    if (size.empty()) size = result.outcome.manifest["metrics"].value("size", "");
  }
  if (reads_tables) {
    if (const std::string why = UnusedMarks(project); !why.empty()) {
      problems.push_back(why + "; nothing of this file is used");
    }
    for (const std::string& why : UnusedTables(project.dir(), project.RunNames()))
      problems.push_back(why + "; nothing of this file is used");
  }
  if (references > 0 && localized == 0) {
    problems.push_back(fmt::format(
        "localize: none of {} is localized: they show other places, or the run is wrong{}; check units, clocks and "
        "order of odometry and images, and the calibration; column reason of results/localize/*/panoramas.csv has the "
        "cause",
        Counted(references, "panorama or photo", "panoramas and photos"), size.empty() ? "" : ": " + size));
  }
  return problems;
}

bool IsThere(const JobResult& result) { return result.end == JobEnd::kComputed || result.end == JobEnd::kUpToDate; }

// While jobs run: a line for each in a log, a line for each stage on a terminal, where many runs would push everything
// else off the screen.
class JobLines {
 public:
  JobLines(Terminal* terminal, bool verbose) : terminal_(*terminal), verbose_(verbose || !terminal->draws()) {}

  void Begun(const Job& job) { terminal_.SetTitle(job.Title()); }
  void Ended(const JobResult& result) {
    terminal_.SetTitle("");
    if (stage_ != result.job.stage->name) Flush();
    stage_ = result.job.stage->name;
    if (result.end == JobEnd::kFailed) {
      terminal_.Log(LogLevel::kError, result.job.Title() + ": failed: " + result.reason);
    } else if (verbose_) {
      std::string line = result.job.Title() + ": " + std::string(JobEndName(result.end));
      if (result.end == JobEnd::kComputed) line += " in " + TakenText(Seconds(result));
      terminal_.Say(line + (result.reason.empty() ? "" : ": " + result.reason));
    } else if (result.end == JobEnd::kComputed) {
      seconds_ += Seconds(result);
      computed_.push_back(ResultName(*result.job.stage, result.job.target));
    } else if (result.end == JobEnd::kSkipped) {
      terminal_.Say(result.job.Title() + ": skipped: " + result.reason);
    }
  }
  void Flush() {
    std::erase(computed_, "");
    if (seconds_ > 0) {
      terminal_.Say(stage_ + (computed_.empty() ? "" : " " + Listed(computed_)) + ": computed in " +
                    TakenText(seconds_));
    }
    computed_.clear();
    seconds_ = 0;
  }

 private:
  static double Seconds(const JobResult& result) { return result.outcome.manifest.value("wall_seconds", 0.0); }

  Terminal& terminal_;
  bool verbose_;
  std::string stage_;
  std::vector<std::string> computed_;
  double seconds_ = 0;
};

// "2 runs (run1, run2), 117 images, 4 panoramas and photos, 1 photo set".
std::string Contents(const Project& project) {
  const Site& site = project.site();
  size_t images = 0;
  for (const Run& run : site.runs) images += run.images.size();
  std::map<ReferenceKind, int64_t> references;
  for (const Reference& r : site.references) ++references[r.kind];
  std::vector<std::string> parts;
  if (!site.runs.empty()) {
    std::vector<std::string> names;
    for (const Run& run : site.runs) names.push_back(run.name);
    parts.push_back(Counted(static_cast<int64_t>(names.size()), "run", "runs") + " (" + Listed(names) + ")");
  }
  if (images > 0) parts.push_back(Counted(static_cast<int64_t>(images), "image", "images"));
  if (const int64_t n = references[ReferenceKind::kPanorama]; n > 0)
    parts.push_back(Counted(n, "panorama", "panoramas"));
  if (const int64_t n = references[ReferenceKind::kPhoto]; n > 0) parts.push_back(Counted(n, "photo", "photos"));
  const auto sets = static_cast<int64_t>(PhotoSetFolders(project.dir()).size());
  if (sets > 0) parts.push_back(Counted(sets, "photo set", "photo sets"));
  return parts.empty() ? "an empty project" : Listed(parts, parts.size());
}

// What a person types for a stage; other commands as they are.
std::string Typed(const std::string& command) {
  for (const StageInfo& stage : Stages()) {
    if (stage.name == command) return CommandOf(stage);
  }
  return command;
}

std::string Headline(const Session& session, const std::string& command, const Project& project,
                     const std::vector<JobResult>& results, bool whole) {
  std::map<JobEnd, int64_t> ends;
  std::vector<std::string> names;
  for (const JobResult& result : results) {
    ++ends[result.end];
    const std::string name = ResultName(*result.job.stage, result.job.target);
    if (IsThere(result) && result.job.stage->name == command && !name.empty()) names.push_back(name);
  }
  std::string text = Capitalised(Typed(command));
  const int64_t there = ends[JobEnd::kComputed] + ends[JobEnd::kUpToDate];
  if (ends[JobEnd::kFailed] > 0) {
    text +=
        fmt::format(" failed after {}: {} of {} failed, {} skipped", session.Taken(), ends[JobEnd::kFailed],
                    Counted(there + ends[JobEnd::kFailed] + ends[JobEnd::kSkipped], "result"), ends[JobEnd::kSkipped]);
    return text;
  }
  if (there == 0) return text + ": nothing to do";
  text += ends[JobEnd::kComputed] == 0 ? ": everything is up to date" : " done in " + session.Taken();
  if (whole) return text + ": " + Contents(project);
  return text + (names.empty() ? "" : ": " + Listed(names));
}

// One line a result, for stages that are no part of the project's facts: the first of its summary, or its metric. Among
// results of other stages the stage is the label.
void AddBriefs(const std::vector<JobResult>& results, const std::string& name_of_stage, bool among_others,
               const DisplayUnit& unit, Ending* ending) {
  for (const JobResult& result : results) {
    const StageInfo& stage = *result.job.stage;
    if (!IsThere(result) || stage.name != name_of_stage) continue;
    std::string text = stage.summary ? stage.summary(result.outcome, unit) : "";
    text = text.substr(0, text.find('\n'));
    if (text.empty() || text.front() == '#' || text.front() == '|')
      text = MetricText(result.outcome.manifest.at("metrics"), stage.metric, unit);
    const std::string name = ResultName(stage, result.job.target);
    if (text.empty()) continue;
    if (among_others) {
      ending->Fact(Capitalised(stage.name), (name.empty() ? "" : name + ": ") + text);
    } else {
      ending->Fact(name.empty() ? "Result" : name, text);
    }
  }
}

// What a result that was there already had to warn of, as if it had been computed now.
void AddOldWarnings(const std::vector<JobResult>& results, Ending* ending) {
  for (const JobResult& result : results) {
    if (result.end != JobEnd::kUpToDate) continue;
    const auto warnings = result.outcome.manifest.find("warnings");
    if (warnings == result.outcome.manifest.end() || !warnings->is_array()) continue;
    for (const nlohmann::json& warning : *warnings) {
      if (warning.is_string()) ending->Problem("Warning", result.job.Title() + ": " + warning.get<std::string>());
    }
  }
}

// Gates that count for the command: each that is not passed, or all of them.
void AddGates(const RunReport& report, Ending* ending) {
  int passed = 0;
  bool all = true;
  std::string message;
  for (const JobResult& result : report.results) {
    if (!IsThere(result) || result.job.stage->name != "gates") continue;
    for (const nlohmann::json& gate : CountedGates(result.outcome.manifest["metrics"], report.asked)) {
      message = gate.value("message", "");
      if (gate.value("verdict", "") == "passed") {
        ++passed;
      } else {
        all = false;
        ending->Problem("Gate", message);
      }
    }
    if (result.job.target.variant.empty()) ending->Look("Gates", result.outcome.dir / "gates.json");
  }
  if (all && passed > 0) ending->Fact("Gates", passed == 1 ? message : fmt::format("all {} passed", passed));
}

// The one set of results that the command made, else the default one.
std::string VariantOf(const std::vector<JobResult>& results, const std::string& command) {
  std::set<std::string> variants;
  for (const JobResult& result : results) {
    const std::string& stage = result.job.stage->name;
    if (stage == command || (command == "run" && stage == "localize")) variants.insert(result.job.target.variant);
  }
  return variants.size() == 1 ? *variants.begin() : "";
}

void AddPlaces(const std::vector<JobResult>& results, const std::string& command, Ending* ending) {
  std::vector<const JobResult*> own;
  for (const JobResult& result : results) {
    if (!IsThere(result)) continue;
    if (result.job.stage->name == "report") {
      ending->Look("Report", result.outcome.dir / "index.html");
      if (fs::exists(result.outcome.dir / "report.pdf")) ending->Look("PDF", result.outcome.dir / "report.pdf");
    } else if (result.job.stage->name == "evaluate" && command == "evaluate") {
      ending->Look("Tables", result.outcome.dir / "tables.md");
    } else if (result.job.stage->name == command) {
      own.push_back(&result);
    }
  }
  if (own.size() == 1) ending->Look("Files", own.front()->outcome.dir);
  if (own.size() > 1) ending->Look("Files", own.front()->outcome.dir.parent_path());
}

void AddNext(const std::string& command, const Project& project, const RunReport& report, Ending* ending) {
  const std::string dir = ShellWord(ShownPath(project.dir()));
  for (const JobResult& result : report.results) {
    if (result.end != JobEnd::kFailed) continue;
    const fs::path dir_of = project.ResultDir(result.job.stage->name, ResultName(*result.job.stage, result.job.target));
    const fs::path log = dir_of.parent_path() / (std::string(kFailedPrefix) + dir_of.filename().string()) / "log.txt";
    if (!fs::exists(log)) continue;
    ending->Look("Log", log);
    break;
  }
  if (report.exit_code == 1) {
    ending->Next("trigpoint status " + dir);
  } else if (command == "demo") {
    ending->Next("trigpoint init my_site      (docs/guides/own_run.md)");
  } else if (command == "run" || command == "evaluate" || command == "report") {
    ending->Next("trigpoint-desktop " + dir + (command == "report" ? "" : ", or trigpoint report " + dir + " --pdf"));
  } else {  // a project of photos is complete without a run
    ending->Next((project.site().runs.empty() ? "trigpoint report " : "trigpoint run ") + dir);
  }
}

}  // namespace

std::string MetricText(const nlohmann::json& metrics, const std::string& name, const DisplayUnit& unit) {
  const auto it = metrics.find(name);
  if (name.empty() || it == metrics.end() || it->is_null()) return "";
  if (!it->is_number()) return name + " " + (it->is_string() ? it->get<std::string>() : it->dump());
  if (name.ends_with("_m")) {
    return fmt::format("{} {:.3f} {}", name.substr(0, name.size() - 2), it->get<double>() / unit.metres, unit.name);
  }
  if (it->is_number_integer()) return fmt::format("{} {}", name, it->get<int64_t>());
  return fmt::format("{} {:.4g}", name, it->get<double>());
}

RunReport ReportOf(const std::string& command, const Project& project, const std::vector<Job>& jobs,
                   std::vector<JobResult> results) {
  RunReport report;
  report.results = std::move(results);
  for (const Job& job : jobs) report.asked.push_back(job.stage->name);
  bool gates_passed = true;
  nlohmann::json stages = nlohmann::json::array();
  for (const JobResult& result : report.results) {
    const bool there = IsThere(result);
    stages.push_back({{"stage", result.job.stage->name},
                      {"name", ResultName(*result.job.stage, result.job.target)},
                      {"status", JobEndName(result.end)},
                      {"reason", result.reason},
                      {"dir", there ? result.outcome.dir.string() : ""},
                      {"metrics", there ? result.outcome.manifest["metrics"] : nlohmann::json::object()},
                      {"warnings", there ? result.outcome.manifest["warnings"] : nlohmann::json::array()}});
    if (result.end == JobEnd::kFailed)
      report.exit_code = report.exit_code == 0 || report.exit_code == result.exit_code ? result.exit_code : 1;
    if (there && result.job.stage->name == "gates" && !GatesPassed(result.outcome.manifest["metrics"], report.asked))
      gates_passed = false;
  }
  report.problems = GivenForNothing(project, report.results);
  if (report.exit_code == 0 && !report.problems.empty()) report.exit_code = 1;
  if (report.exit_code == 0 && !gates_passed) report.exit_code = kGateExitCode;
  report.json = {{"command", Typed(command)},     {"project", project.dir().string()}, {"ok", report.exit_code == 0},
                 {"exit_code", report.exit_code}, {"problems", report.problems},       {"stages", stages}};
  return report;
}

RunReport RunJobsShown(const Session& session, const std::string& command, const Project& project,
                       const std::vector<Job>& jobs) {
  const DisplayUnit unit = DisplayUnitNamed(session.options.units);
  Terminal terminal = session.MakeTerminal();
  JobLines lines(&terminal, session.options.verbose);
  JobCallbacks callbacks;
  callbacks.begun = [&](const Job& job) { lines.Begun(job); };
  callbacks.ended = [&](const JobResult& result) { lines.Ended(result); };
  RunReport report = ReportOf(
      command, project, jobs,
      RunJobs(project, jobs, session.options.threads, session.options.seed, terminal, *session.cancel, callbacks));
  lines.Flush();
  terminal.ClearProgress();
  for (const JobResult& result : report.results) {
    if (IsThere(result) && result.job.stage->summary)
      session.PrintDetails(result.job.stage->summary(result.outcome, unit));
  }
  for (const std::string& problem : report.problems) terminal.Log(LogLevel::kError, problem);
  return report;
}

Ending EndingOf(const Session& session, const std::string& command, const Project& project, const RunReport& report) {
  const DisplayUnit unit = DisplayUnitNamed(session.options.units);
  const bool whole = command == "demo" || command == "run" || command == "review";
  Ending ending(Headline(session, command, project, report.results, whole));
  std::set<std::string> there;
  for (const JobResult& result : report.results) {
    if (IsThere(result)) there.insert(result.job.stage->name);
  }
  if (whole || command == "localize" || command == "evaluate") {
    // Errors and check points of an earlier solution would be taken for this one's.
    AddProjectFacts(
        project, unit,
        {there.count("evaluate") > 0, whole && there.count("survey") > 0, VariantOf(report.results, command)}, &ending);
  } else {
    AddBriefs(report.results, command, false, unit, &ending);
    if (there.count("survey") > 0 && command == "survey") AddCheckPoints(project, unit, &ending);
  }
  if (command == "demo" || (whole && there.count("localize") == 0)) {
    for (const char* stage : {"survey", "stitch", "calibrate"}) AddBriefs(report.results, stage, true, unit, &ending);
  }
  AddGates(report, &ending);
  AddOldWarnings(report.results, &ending);
  AddPlaces(report.results, command, &ending);
  AddNext(command, project, report, &ending);
  ending.RestIn(ShownPath(project.results()) + "/*/*/log.txt");
  return ending;
}

int RunAndReport(Session& session, const std::string& command, const Project& project, const std::vector<Job>& jobs) {
  const RunReport report = RunJobsShown(session, command, project, jobs);
  session.End(EndingOf(session, command, project, report), command == "demo" ? kDemoEndingLines : kEndingLines);
  session.PrintJson(report.json);
  return report.exit_code;
}

}  // namespace trigpoint

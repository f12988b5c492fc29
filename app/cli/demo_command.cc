// demo: every capability once, on a copy of the embedded site.
#include <fmt/format.h>

#include <vector>

#include "app/cli/command.h"
#include "app/pipeline/command_line.h"
#include "app/pipeline/stitch_stage.h"
#include "datasets/project/demo_site.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

// What `run` makes, and beside it a panorama of photos, a camera from pictures of a board, and localize as published.
std::vector<Job> DemoJobs(const Project& project) {
  std::vector<Job> jobs = StitchJobs(project, {}, nlohmann::json::object());
  if (fs::is_directory(project.dir() / "board")) {
    const nlohmann::json options = {{"images", "board/*.jpg"}, {"target", "checkerboard:9x6:0.04"}};
    jobs.push_back({&StageNamed("calibrate"), {"camera", "", {{"calibrate", options}}}});
  }
  JobQuery query;
  query.variants = {"", "paper"};
  for (Job& job : PlanJobs(project, query)) {
    const bool beside = job.stage->name == "reconstruct" || job.stage->name == "localize";
    // The published method is slow: one run shows it.
    const bool first = !project.RunNames().empty() && job.target.run == project.RunNames().front();
    if (job.target.variant.empty() || (beside && first)) jobs.push_back(std::move(job));
  }
  return jobs;
}

int EndCopy(const Session& session, const fs::path& dir) {
  session.End(Ending("The example site is in " + ShownPath(dir)).Next("trigpoint run " + ShellWord(ShownPath(dir))));
  session.PrintJson({{"command", "demo"}, {"ok", true}, {"project", dir.string()}});
  return 0;
}

int Demo(Session& session, const std::string& dir, bool copy_only) {
  MakeDemoSite(dir);
  if (copy_only) return EndCopy(session, dir);
  const Project project = OpenProject(session, dir);
  return RunAndReport(session, "demo", project, DemoJobs(project));
}

}  // namespace

void AddDemoCommand(CLI::App& app, Session& session) {
  CLI::App& command = AddCommand(app, session, "demo", "copy the embedded site, run everything, report its accuracy",
                                 "A folder that holds the site already is used as it is; finished results are kept.\n\n"
                                 "Examples:\n  trigpoint demo\n  trigpoint demo /tmp/lot --units ft\n"
                                 "  trigpoint demo my_site --copy-only");
  const auto dir = std::make_shared<std::string>("trigpoint-demo");
  const auto copy_only = std::make_shared<bool>(false);
  command.add_option("DIR", *dir, "where the copy goes")->capture_default_str();
  command.add_flag("--copy-only", *copy_only, "copy the site, compute nothing");
  command.callback(
      [&session, dir, copy_only] { session.action = [=](Session& s) { return Demo(s, *dir, *copy_only); }; });
}

}  // namespace trigpoint

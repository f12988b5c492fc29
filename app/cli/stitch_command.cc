#include "app/cli/stitch_command.h"

#include "app/cli/stage_command.h"
#include "app/pipeline/stitch_stage.h"
#include "calib/base/error.h"

namespace trigpoint {

void AddStitchCommand(CLI::App& app, Session& session) {
  struct Arguments {
    std::string dir;
    std::vector<std::string> settings;
  };
  CLI::App& command =
      AddCommand(app, session, "stitch", StageNamed("stitch").help,
                 OptionTable(StageNamed("stitch"), true) +
                     "Examples:\n  trigpoint stitch my_photos\n  trigpoint stitch my_site --set corner\n"
                     "  trigpoint stitch my_site --set panorama.width=4096 --set panorama.format=tif\n");
  const auto arguments = std::make_shared<Arguments>();
  command.add_option("DIR", arguments->dir, "the project, or a plain folder of photos")->required();
  command
      .add_option("--set", arguments->settings,
                  "the name of a photo set: only this one; or option=value, over trigpoint.yaml (both several times)")
      ->allow_extra_args(false);
  command.callback([&session, arguments] {
    session.action = [arguments](Session& s) {
      std::vector<std::string> sets, settings;
      for (const std::string& text : arguments->settings) {
        (text.find('=') == std::string::npos ? sets : settings).push_back(text);
      }
      const nlohmann::json overrides = ParseOverrides(settings, "stitch");
      const Project project = OpenProjectToCompute(s, arguments->dir);
      const std::vector<Job> jobs = StitchJobs(project, sets, overrides);
      if (jobs.empty()) {
        throw InputError(project.dir().string() +
                         ": holds no photo set; put the photos of one panorama into photos/<name>/");
      }
      return RunAndReport(s, "stitch", project, jobs);
    };
  });
}

}  // namespace trigpoint

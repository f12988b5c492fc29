// What the menus do beside stages, as forms: import, export, publish. The same as the commands of these names.
#pragma once

#include <QString>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "app/desktop/stage_form.h"
#include "calib/base/progress.h"
#include "datasets/project/options_json.h"

namespace trigpoint {

struct Action {
  std::string command;  // "export"
  QString title, intro;
  std::vector<OptionDescription> options;
  std::string required;  // the option that the command line states even where it has its default
  StageForm::Check check;
  // Does it with the options that differ from their defaults; what came of it, for people. Throws Error, Cancelled.
  std::function<std::string(const std::filesystem::path& dir, const nlohmann::json& values, ProgressSink& progress,
                            const CancelToken& cancel)>
      run;
};

Action ImportAction();
Action ExportAction();
Action PublishAction();

}  // namespace trigpoint

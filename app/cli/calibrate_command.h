#pragma once

#include "app/cli/command.h"

namespace trigpoint {

void AddCalibrateCommand(CLI::App& app, Session& session);

}  // namespace trigpoint

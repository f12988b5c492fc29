// Commands for the field: before the trip, and while still on site.
#pragma once

#include "app/cli/command.h"

namespace trigpoint {

void AddPrintCommand(CLI::App& app, Session& session);
void AddPlanCommand(CLI::App& app, Session& session);
void AddCheckCommand(CLI::App& app, Session& session);

}  // namespace trigpoint

// Commands to and from other programs.
#pragma once

#include "app/cli/command.h"

namespace trigpoint {

void AddExportCommand(CLI::App& app, Session& session);
void AddImportCommand(CLI::App& app, Session& session);
void AddCompletionCommand(CLI::App& app, Session& session);
void AddManualCommand(CLI::App& app, Session& session, const std::string& version);

}  // namespace trigpoint

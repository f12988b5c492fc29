#pragma once

#include <filesystem>
#include <string>

#include "app/cli/command.h"

namespace trigpoint {

void AddCalibrateCommand(CLI::App& app, Session& session);

// Makes a folder a project if it is none yet, for commands that need no runs.
void MakeBareProject(const std::filesystem::path& dir, const std::string& command);

}  // namespace trigpoint

// stitch: photo sets, or a plain folder of photos, to panoramas.
#pragma once

#include "app/cli/command.h"

namespace trigpoint {

void AddStitchCommand(CLI::App& app, Session& session);

}  // namespace trigpoint

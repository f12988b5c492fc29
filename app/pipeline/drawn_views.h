// The views of panoramas as the stage `references` drew them.
#pragma once

#include "datasets/io/views.h"
#include "datasets/project/project.h"

namespace trigpoint {

// How the panoramas' views were drawn; as the project says where none are.
ViewOptions ViewOptionsOf(const Project& project);

}  // namespace trigpoint

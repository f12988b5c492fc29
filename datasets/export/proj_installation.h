// The PROJ that coordinate reference systems come from.
#pragma once

#include <string>

namespace trigpoint {

// "9.1.1" and the number of its grids (datum shifts, geoids) in its data folders; empty and 0: built without PROJ.
struct ProjInstallation {
  std::string version;
  int grids = 0;
};
ProjInstallation FindProj();

}  // namespace trigpoint

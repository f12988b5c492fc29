#include "datasets/export/proj_installation.h"

#include <filesystem>

#ifdef TRIGPOINT_HAVE_PROJ
#include <proj.h>
#endif

namespace trigpoint {

ProjInstallation FindProj() {
  ProjInstallation found;
#ifdef TRIGPOINT_HAVE_PROJ
  namespace fs = std::filesystem;
  const PJ_INFO info = proj_info();
  found.version = info.version;
  for (size_t i = 0; i < info.path_count; ++i) {
    std::error_code ignored;
    for (fs::directory_iterator it(info.paths[i], ignored), end; it != end; it.increment(ignored)) {
      const fs::path kind = it->path().extension();
      if (kind == ".tif" || kind == ".gsb" || kind == ".gtx") ++found.grids;
    }
  }
#endif
  return found;
}

}  // namespace trigpoint

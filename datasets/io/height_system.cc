#include "datasets/io/height_system.h"

#include <GeographicLib/Geoid.hpp>
#include <cmath>
#include <vector>

#include "calib/base/error.h"

#ifdef TRIGPOINT_HAVE_PROJ
#include <proj.h>
#endif

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

// GeographicLib's grids, the finest of a model first, and PROJ's of the same model.
struct Grid {
  const char* name;
  const char* proj;
};
constexpr Grid kGrids[] = {{"egm2008-1", "us_nga_egm08_25.tif"},
                           {"egm2008-2_5", "us_nga_egm08_25.tif"},
                           {"egm2008-5", "us_nga_egm08_25.tif"},
                           {"egm96-5", "us_nga_egm96_15.tif"},
                           {"egm96-15", "us_nga_egm96_15.tif"},
                           {"egm84-15", ""},
                           {"egm84-30", ""}};

bool IsGridFile(const std::string& name) {
  const std::string extension = fs::path(name).extension().string();
  return extension == ".gtx" || extension == ".tif";
}

std::vector<Grid> GridsOf(const std::string& name) {
  std::vector<Grid> grids;
  for (const Grid& grid : kGrids) {
    const std::string its = grid.name;
    if (its == name || its.starts_with(name + "-")) grids.push_back(grid);
  }
  return grids;
}

#ifdef TRIGPOINT_HAVE_PROJ
// A shift of heights by one grid.
class ProjGrid {
 public:
  static std::unique_ptr<ProjGrid> Open(const std::string& file) {
    auto grid = std::unique_ptr<ProjGrid>(new ProjGrid);
    proj_context_set_enable_network(grid->context_, 0);
    proj_log_level(grid->context_, PJ_LOG_NONE);
    if (file.find_first_of("\" ") != std::string::npos) return nullptr;  // no way to write it in PROJ's language
    grid->shift_ = proj_create(grid->context_, ("+proj=vgridshift +multiplier=1 +grids=" + file).c_str());
    return grid->shift_ == nullptr ? nullptr : std::move(grid);
  }
  ~ProjGrid() {
    proj_destroy(shift_);
    proj_context_destroy(context_);
  }
  std::optional<double> At(const Geodetic& g) const {
    proj_errno_reset(shift_);
    const PJ_COORD in = proj_coord(proj_torad(g.longitude_deg), proj_torad(g.latitude_deg), 0, HUGE_VAL);
    const double height = proj_trans(shift_, PJ_FWD, in).xyz.z;
    return std::isfinite(height) ? std::optional<double>(height) : std::nullopt;
  }

 private:
  ProjGrid() = default;
  PJ_CONTEXT* context_ = proj_context_create();
  PJ* shift_ = nullptr;
};
#endif

}  // namespace

struct HeightSystem::Model {
  std::unique_ptr<GeographicLib::Geoid> geographiclib;
#ifdef TRIGPOINT_HAVE_PROJ
  std::unique_ptr<ProjGrid> proj;
#endif
  // Takes the grid if PROJ finds it.
  bool OpenProj([[maybe_unused]] const std::string& file) {
#ifdef TRIGPOINT_HAVE_PROJ
    if (!file.empty()) proj = ProjGrid::Open(file);
    return proj != nullptr;
#else
    return false;
#endif
  }
};

HeightSystem::HeightSystem() = default;
HeightSystem::~HeightSystem() = default;
HeightSystem::HeightSystem(HeightSystem&&) noexcept = default;
HeightSystem& HeightSystem::operator=(HeightSystem&&) noexcept = default;

bool HeightSystem::IsKnown(const std::string& name) {
  return name.empty() || name == "ellipsoidal" || IsGridFile(name) || !GridsOf(name).empty();
}

HeightSystem HeightSystem::Named(const std::string& name, const std::string& what, const fs::path& folder) {
  HeightSystem system;
  if (name.empty() || name == "ellipsoidal") return system;
  auto model = std::make_unique<Model>();
  if (IsGridFile(name)) {
    const fs::path own = folder / name;
    if (!model->OpenProj(!folder.empty() && fs::exists(own) ? own.string() : name)) {
      throw OptionError(what + name + ": expected the file of a grid (.gtx, .tif) in " +
                        (folder.empty() ? std::string("the working folder") : folder.string()) +
                        " or in PROJ's folders, found none that can be read; get it with: projsync --file " +
                        fs::path(name).filename().string());
    }
    system.name_ = name;
    system.model_ = std::move(model);
    return system;
  }
  const std::vector<Grid> fitting = GridsOf(name);
  if (fitting.empty()) {
    throw OptionError(what + name +
                      ": unknown; expected ellipsoidal, egm84, egm96, egm2008, one of their grids, e.g. egm2008-1, or "
                      "the file of a grid (.gtx, .tif)");
  }
  const std::string installed = GeographicLib::Geoid::DefaultGeoidPath();
  for (const Grid& grid : fitting) {
    if (!fs::exists(fs::path(installed) / (std::string(grid.name) + ".pgm"))) continue;
    try {
      model->geographiclib = std::make_unique<GeographicLib::Geoid>(grid.name);
    } catch (const std::exception& e) {
      throw OptionError(what + name + ": " + e.what() + "; fetch the grid again: geographiclib-get-geoids " +
                        grid.name);
    }
    system.name_ = grid.name;
    system.model_ = std::move(model);
    return system;
  }
  // PROJ packages have EGM96 in a form of an older time, too.
  const std::string own = fitting.front().proj;
  for (const std::string& file : {own, std::string(own == "us_nga_egm96_15.tif" ? "egm96_15.gtx" : "")}) {
    if (!model->OpenProj(file)) continue;
    system.name_ = file;
    system.model_ = std::move(model);
    return system;
  }
  throw OptionError(what + name + ": its grid is not installed in " + installed +
                    "; get it by: apt install geographiclib-tools && geographiclib-get-geoids " + fitting.front().name +
                    " (or set GEOGRAPHICLIB_GEOID_PATH to the folder that holds it)");
}

double HeightSystem::Undulation(const Geodetic& g) const {
  if (model_ == nullptr) return 0;
  if (model_->geographiclib) return (*model_->geographiclib)(g.latitude_deg, g.longitude_deg);
#ifdef TRIGPOINT_HAVE_PROJ
  if (const std::optional<double> height = model_->proj->At(g)) return *height;
#endif
  throw InputError("latitude " + std::to_string(g.latitude_deg) + ", longitude " + std::to_string(g.longitude_deg) +
                   " lies outside the grid " + name_);
}

double HeightSystem::FromEllipsoidal(const Geodetic& g) const { return g.height_m - Undulation(g); }

}  // namespace trigpoint

// Heights above a geoid: models and grids that GeographicLib or PROJ find installed, or a grid's file.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "calib/geo/geodetic.h"

namespace trigpoint {

// Ellipsoidal heights, or heights above a geoid.
class HeightSystem {
 public:
  // "" or "ellipsoidal"; a model ("egm84", "egm96", "egm2008": the finest grid there is) or one of its grids
  // ("egm2008-2_5") as GeographicLib has them, else as PROJ has them; the file of a grid (.gtx, .tif), in `folder` or
  // where PROJ looks for them. `what` begins messages. Throws OptionError that says how to get the grid when it isn't
  // installed.
  static HeightSystem Named(const std::string& name, const std::string& what = "--heights ",
                            const std::filesystem::path& folder = {});
  // Does the name mean a model or a grid that Named can look for? Else nothing is known but the name ("DHHN2016").
  static bool IsKnown(const std::string& name);
  ~HeightSystem();
  HeightSystem(HeightSystem&&) noexcept;
  HeightSystem& operator=(HeightSystem&&) noexcept;
  HeightSystem(const HeightSystem&) = delete;

  bool ellipsoidal() const { return model_ == nullptr; }
  const std::string& name() const { return name_; }  // "ellipsoidal" or the grid's
  double FromEllipsoidal(const Geodetic& g) const;   // m
  // Geoid above the ellipsoid, m; 0 if ellipsoidal. Throws InputError outside the grid.
  double Undulation(const Geodetic& g) const;

 private:
  struct Model;
  HeightSystem();
  std::string name_ = "ellipsoidal";
  std::unique_ptr<Model> model_;
};

}  // namespace trigpoint

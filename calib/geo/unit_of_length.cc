#include "calib/geo/unit_of_length.h"

#include <fmt/format.h>

#include <cmath>

namespace trigpoint {

std::string UnitOfLength(double factor, double tolerance) {
  struct Unit {
    const char* name;
    double metres;
  };
  constexpr Unit kUnits[] = {{"feet", 0.3048},  {"inches", 0.0254},  {"millimetres", 0.001}, {"centimetres", 0.01},
                             {"yards", 0.9144}, {"decimetres", 0.1}, {"kilometres", 1000},   {"miles", 1609.344}};
  const Unit* nearest = &kUnits[0];
  const auto off = [&](const Unit& unit) { return std::abs(std::log(factor / unit.metres)); };
  for (const Unit& unit : kUnits) {
    if (off(unit) < off(*nearest)) nearest = &unit;
  }
  return off(*nearest) < tolerance ? fmt::format("{} ({:g} m)", nearest->name, nearest->metres) : "";
}

}  // namespace trigpoint

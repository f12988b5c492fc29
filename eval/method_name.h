// What people read for the methods that errors.csv calls g1, g2 and single.
#pragma once

#include <string>

namespace trigpoint {

// "view (G1)": one pose for each rectilinear view; "panorama (G2)": one for the whole panorama, the final answer.
inline std::string MethodName(const std::string& method) {
  if (method == "g1") return "view (G1)";
  return method == "g2" || method == "single" ? "panorama (G2)" : method;
}

}  // namespace trigpoint

// What people read for the methods, references and statuses that errors.csv calls g1, g2, single, self, control,
// survey, rejected, unmatched and no_reference.
#pragma once

#include <string>

namespace trigpoint {

// "view (G1)": one pose for each rectilinear view; "panorama (G2)": one for the whole panorama, the final answer.
inline std::string MethodName(const std::string& method) {
  if (method == "g1") return "view (G1)";
  return method == "g2" || method == "single" ? "panorama (G2)" : method;
}

// "panorama (G2), variant paper".
inline std::string MethodName(const std::string& method, const std::string& variant) {
  return MethodName(method) + (variant.empty() ? "" : ", variant " + variant);
}

// What answers are compared with.
inline std::string ReferenceName(const std::string& reference) {
  if (reference == "self") return "the run's own tags";
  if (reference == "control") return "surveyed control";
  return reference == "survey" ? "the tag map" : reference;
}

// What became of an answer, by the statuses of errors.csv and panoramas.csv.
inline std::string StatusName(const std::string& status) {
  if (status == "rejected") return "refused";
  if (status == "unmatched") return "no match";
  return status == "no_reference" ? "no reference" : status;
}

}  // namespace trigpoint

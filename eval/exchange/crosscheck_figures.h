// Pictures of a cross-check.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

namespace trigpoint {

struct CrossFigure {
  std::string system;
  std::vector<Eigen::Vector3d> places;       // our cameras, m
  std::vector<Eigen::Vector3d> differences;  // theirs minus ours after Sim3, m
  std::vector<double> normalised;            // NaN: not known
};

// <dir>/<run>_plan.png: from above, differences drawn larger as said in the picture; <dir>/<run>_normalised.png: along
// the run, with the 99 % line. Throws IoError.
void WriteCrossFigures(const std::filesystem::path& dir, const std::string& run,
                       const std::vector<CrossFigure>& figures);

}  // namespace trigpoint

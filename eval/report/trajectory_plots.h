// Trajectories drawn: from above, and their errors along the way.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "eval/report/drawing.h"

namespace trigpoint {

struct PlottedTrajectory {
  std::string name;
  std::vector<Eigen::Vector2d> places;  // x, y of the frame compared in
  std::vector<double> along, errors;    // distance along the reference and the error there
};

// Lengths are in the unit that is named. The reference is dashed.
Drawing TrajectoryPlan(const std::vector<Eigen::Vector2d>& reference, const std::vector<PlottedTrajectory>& estimates,
                       const std::string& unit);
Drawing TrajectoryErrorChart(const std::vector<PlottedTrajectory>& estimates, const std::string& unit);

// As SVG or PNG, by the file's ending. Throws OptionError for another ending, IoError.
void WriteDrawing(const Drawing& drawing, const std::string& title, const std::filesystem::path& file);

}  // namespace trigpoint

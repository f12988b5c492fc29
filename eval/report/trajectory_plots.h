// Trajectories drawn as the program evo draws them: from above, their coordinates, and their errors along the way.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "eval/report/drawing.h"

namespace trigpoint {

struct PlottedTrajectory {
  std::string name;
  std::vector<Eigen::Vector3d> places;            // of the estimate, in the frame compared in
  std::vector<Eigen::Vector3d> reference_places;  // of the reference, at the same times
  std::vector<double> along, errors;              // distance along the reference and the error there
};

// Lengths are in the unit that is named. The reference is dashed: that of the estimate with the most pairs. A single
// estimate is coloured by its error.
Drawing TrajectoryPlan(const std::vector<PlottedTrajectory>& estimates, const std::string& unit);
// x, y and z against the distance along the reference.
Drawing TrajectoryAxesChart(const std::vector<PlottedTrajectory>& estimates, const std::string& unit);
// A single estimate comes with its RMSE and median.
Drawing TrajectoryErrorChart(const std::vector<PlottedTrajectory>& estimates, const std::string& unit);

// As SVG or PNG, by the file's ending. Throws OptionError for another ending, IoError.
void WriteDrawing(const Drawing& drawing, const std::string& title, const std::filesystem::path& file);

}  // namespace trigpoint

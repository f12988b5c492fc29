// Surveyed points as a project's tables have them, and where they are marked in pictures.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "datasets/io/survey_tables.h"
#include "datasets/project/project.h"
#include "survey/input/job.h"

namespace trigpoint {

struct KnownPoints {
  std::vector<ControlPoint> points;
  std::vector<PointMark> marks;
};

KnownPoints ReadKnownPoints(const Project& project, std::vector<std::string>* warnings);

// In the project's frame, or that of the surveyor's own; nothing where the project has no frame for it.
std::optional<Eigen::Vector3d> WorldOf(const Project& project, const ControlPoint& point);

// The survey's pictures that the marks of a point can mean.
std::vector<SurveyMark> MarksOf(const Project& project, const std::string& point, const KnownPoints& known,
                                const SurveyInput& input, std::vector<std::string>* warnings);

// Systems of the coordinates as control_points.csv and gcp_list.txt name them.
std::set<std::string> StatedSystems(const Project& project, const std::vector<ControlPoint>& points);

// The camera of a run by its name; the first one where none has it.
size_t CameraNamed(const SurveyRun& run, const std::string& name);

}  // namespace trigpoint

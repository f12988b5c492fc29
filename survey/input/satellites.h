// Positions by satellites for the survey: geotags of panoramas, GPS of runs.
#pragma once

#include <vector>

#include "datasets/project/project.h"
#include "survey/tags/tag_map.h"

namespace trigpoint {

// A panorama's geotag says where its station's tag is, less the measured offset.
std::vector<SurveyPoint> GeotagPoints(const Project& project);

// The fixes at the times of the run's pictures.
void AddGps(const Project& project, const Run& run, SurveyRun* survey);

}  // namespace trigpoint

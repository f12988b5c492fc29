// The report's charts as pictures in which its objects can be pointed at. No Qt here.
#pragma once

#include <string>
#include <vector>

#include "app/desktop/snapshot.h"
#include "eval/report/drawing.h"
#include "eval/text/display_unit.h"

namespace trigpoint {

struct PaintedDrawing {
  std::string png;          // empty: there is nothing
  std::vector<Spot> spots;  // in the picture's pixels, as are the groups
  std::vector<SpotGroup> groups;
};

// Its words in the window's language.
PaintedDrawing PaintDrawing(const Drawing& drawing, double scale);

struct NamedChart {
  std::string name;  // of the report's figure
  std::string title, caption;
  PaintedDrawing painted;
};

// What the report draws of accuracy, consistency, cameras, the survey and the runs, in its order. Reads the results;
// what is missing or broken has no chart.
std::vector<NamedChart> LoadCharts(const Snapshot& snapshot, const DisplayUnit& unit);

}  // namespace trigpoint

// A project with results in place, without computing any: a straight drive past panoramas, tags and points. For tests
// of what shows results, and of any size for measuring how fast they open.
#pragma once

#include <filesystem>

namespace trigpoint {

struct ResultsSiteSize {
  int images = 24;
  int points = 2000;
  int observations_per_point = 4;
  int panoramas = 4;  // each with a station and a tag
  int image_width = 320, image_height = 240;
  int panorama_width = 512;
};

// Writes runs/run1 with pictures, panoramas, stations, tags, control points, and results/{localize,detect,evaluate}. A
// second variant `trial` of localize and evaluate lies beside.
void WriteResultsSite(const std::filesystem::path& dir, const ResultsSiteSize& size);

}  // namespace trigpoint

// The pictures a camera or rig is calibrated from.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace trigpoint {

struct CalibrationImages {
  std::string camera;                        // cam0, ...
  std::vector<std::filesystem::path> files;  // absolute, in natural order (img2 before img10)
  std::vector<int> frame_of;                 // index into PairFrames()
};

// `patterns`: shell patterns (or folders) separated by ';', each with `camera=` before it or not; without names each
// pattern is a camera of its own, cam0, cam1, ... A pattern that isn't absolute is looked for below `base`. Several
// patterns of one camera add up. Throws InputError naming a pattern without pictures.
std::vector<CalibrationImages> FindCalibrationImages(const std::string& patterns, const std::filesystem::path& base);

// Names of the frames (pictures of one moment) and, in `frame_of`, which each file belongs to. One camera: every file
// by itself. Several: files of the same name without ending, else of the same last number ("left01.png",
// "right01.png").
std::vector<std::string> PairFrames(std::vector<CalibrationImages>* cameras);

}  // namespace trigpoint

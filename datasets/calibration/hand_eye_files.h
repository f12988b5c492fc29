// What a hand-eye calibration writes.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/target/hand_eye.h"
#include "datasets/io/site.h"

namespace trigpoint {

struct CameraOnBody {
  BodyCamera camera;  // with its pose from before
  HandEyeResult found;
  std::string unseen;  // what the motion does not show of its place, a sentence; empty: nothing of that
};

// `prior_m`: 1 sigma of the place from before the calibration.
std::string UnseenOf(const HandEyeResult& found, double prior_m);

// camchain.yaml and the other camera files, calibration.json, quality.md.
void WriteHandEye(const std::filesystem::path& out, const std::string& run, const std::vector<CameraOnBody>& cameras);

}  // namespace trigpoint

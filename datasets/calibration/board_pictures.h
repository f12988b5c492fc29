// Pictures of a board, into what cameras are calibrated from.
#pragma once

#include <filesystem>
#include <vector>

#include "calib/base/progress.h"
#include "calib/target/calibrate.h"
#include "calib/target/target.h"
#include "datasets/calibration/calibrate_files.h"
#include "datasets/calibration/calibration_images.h"

namespace trigpoint {

struct FoundBoards {
  CalibrationInput input;  // pictures by their paths below `base`
  std::vector<LeftOutPicture> left_out;
  size_t pictures = 0;  // all there were
};

// Finds the board in every picture; `mirrored` ones are flipped left-right. Pictures of another size than most of their
// camera are left out. Throws InputError where no picture shows the board, and where the board is larger than `target`.
FoundBoards FindBoards(const Target& target, std::vector<CalibrationImages> cameras, bool mirrored,
                       const std::filesystem::path& base, int threads, ProgressSink& progress,
                       const CancelToken& cancel);

}  // namespace trigpoint

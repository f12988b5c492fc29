// Surveyed points marked in images by hand: control_observations.csv (`point,image,u,v`).
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "datasets/io/survey_tables.h"
#include "datasets/project/project.h"

namespace trigpoint {

// Rows of control_observations.csv; `image`: below the project, "runs/run1/images/000012.jpg", however the file
// shortens it; of several images with that ending the first one, as in `survey`. A name that no image of a run has
// stays as it is. Empty without the file. Throws InputError naming file and line.
std::vector<PointMark> ReadPointMarks(const Project& project);
// Adds a mark, or moves the one of the same point in the same image; its sigma is written where the file has a column
// for it. The file as it was is kept in results/replaced/, where `kept` names it (empty: there was none). The other
// lines of the file stay as they are. `image` may be RUN/FILE or below the project. Other programs may add marks at the
// same time: each waits until the other has written. Throws InputError for an unknown image, a name that is empty, a
// pixel outside the image; IoError.
PointMark SavePointMark(const Project& project, const std::string& point, const std::string& image,
                        const Eigen::Vector2d& pixel, std::filesystem::path* kept = nullptr, double sigma_px = 1);
// Takes a mark away, and with the last one the file that SavePointMark began. Throws InputError if there is none.
void RemovePointMark(const Project& project, const std::string& point, const std::string& image,
                     std::filesystem::path* kept = nullptr);

}  // namespace trigpoint

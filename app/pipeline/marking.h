// Surveyed points marked in images by hand: control_observations.csv (`point,image,u,v`), and where a point that is
// marked in two images must lie in the others.
#pragma once

#include <Eigen/Core>
#include <optional>
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

struct PredictedMark {
  std::string run, file, image;  // file as in images.txt, image below the project
  Eigen::Vector2d pixel;
  Eigen::Matrix2d covariance_px2;  // of the predicted pixel: of the marks, through the point
  std::optional<Eigen::Vector2d> marked;
};

struct PointSolution {
  Eigen::Vector3d world_m;     // site ENU
  Eigen::Matrix3d covariance;  // m^2, 1 px marks, cameras held
  double rms_px = 0;           // of the marks; from two marks it says little
  int marks = 0;
  std::vector<PredictedMark> images;  // every image that must show it, nearest camera first
};

// From the marks in localized images, by least squares on their pixels. Throws InputError if fewer than two marks lie
// in localized images, NumericError if their rays don't meet.
PointSolution PredictPoint(const Project& project, const std::string& point, const std::string& variant);

}  // namespace trigpoint

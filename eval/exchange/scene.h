// Results as scenes: models, point clouds, graphs.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "datasets/colmap/model.h"
#include "datasets/solution/solution.h"
#include "eval/exchange/export.h"

namespace trigpoint {

// A run as localized: its solution, and the sparse model of it in world or in the run's own frame.
struct RunScene {
  std::string run;
  std::optional<Sim3d> world_from_odom;      // frame: site ENU; unset: the run's own
  Solution solution;                         // in its own frame
  SparseModel model;                         // ids of images are indices + 1
  std::vector<std::vector<int>> feature_of;  // of each image's pixels: in `features`
  std::filesystem::path features;
};
// Throws InputError for a run that is not localized, or was by a program that wrote no solution.
RunScene ReadRunScene(const Project& project, const std::string& run, const std::string& variant,
                      const std::string& frame);
// Its features and the matches that its tracks stand for, as a COLMAP database; images and cameras get the ids 1, 2,
// ... in the model's order.
void WriteSceneDatabase(const RunScene& scene, const std::filesystem::path& file, const CancelToken& cancel);

// Covariance of a point given its cameras (what triangulation alone leaves), model frame, m^2; none with less than two
// rays or no parallax.
std::optional<Eigen::Matrix3d> PointCovariance(const RunScene& scene, const ModelPoint& point);

// Writes plain scenes: colmap, ply, g2o, g2o-bundle.
void ExportScene(const Project& project, const ExportRequest& request, const std::string& run,
                 const std::filesystem::path& out, ExportReport* report, const CancelToken& cancel);

}  // namespace trigpoint

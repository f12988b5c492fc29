// From a project's results to files of other programs: what `trigpoint export` does.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "app/pipeline/stages.h"
#include "calib/base/progress.h"
#include "calib/geo/geodetic.h"
#include "datasets/colmap/model.h"
#include "datasets/export/layers.h"
#include "datasets/export/scene_files.h"
#include "datasets/project/project.h"
#include "datasets/solution/solution.h"

namespace trigpoint {

struct ExportRequest {
  std::string to;                 // a name of ExportFormats()
  std::vector<std::string> what;  // layers or parts; empty: all that the format takes
  std::vector<std::string> runs;  // empty: all that have results
  std::string variant;
  std::string crs;            // "", "EPSG:N", "utm"
  std::string heights;        // "", "ellipsoidal", a geoid
  std::string frame;          // "", "world", "odom": of scenes and trajectories; "": world where there is one
  double confidence = 0.95;   // of ellipses
  double ellipse_scale = 1;   // ellipses are drawn so many times larger
  std::filesystem::path out;  // file or folder; empty: results/export/...
  bool force = false;         // replace files of an earlier export that were changed since
};

struct ExportReport {
  std::vector<std::filesystem::path> files;
  std::vector<std::string> lines;     // what is in them, for people
  std::vector<std::string> warnings;  // what is missing and why
};

struct ExportFormat {
  std::string name;                  // "gpkg"
  std::vector<std::string> aliases;  // "geopackage"
  std::string help;
  std::vector<std::string> what;  // what it takes, in order
};
const std::vector<ExportFormat>& ExportFormats();

// Writes the files, all or none of them, and never onto one that Trigpoint did not write (datasets/project/outputs.h).
// Throws OptionError for what cannot be asked for, InputError when the results it needs are missing
// (naming the command that makes them).
ExportReport ExportResults(const Project& project, const ExportRequest& request, ProgressSink& progress,
                           const CancelToken& cancel);

// --- The parts, for crosscheck and tests.

// The site ENU that a result's coordinates are in: about the origin that its manifest states, from which the project's
// may have moved since; about the project's where it states none.
LocalFrame FrameOfResult(const Project& project, const std::string& stage, const StageTarget& target);
// Warns, in the name of `what`, of coordinates in a frame about another origin than the project's.
void WarnOfOtherOrigin(const Project& project, const LocalFrame& frame, const std::string& what,
                       std::vector<std::string>* warnings);

// The layers of maps, in site ENU brought to the Earth. Missing results are named in `warnings`.
std::vector<Layer> MapLayers(const Project& project, const ExportRequest& request, std::vector<std::string>* warnings);

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

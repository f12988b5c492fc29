// What a site looks like in three dimensions: plain values read from a project's results, without VTK, without a GPU.
// SceneView (eval/scene/scene_view.h) turns it into layers of a renderer; the report and the desktop use the same two.
//
//   const SceneModel model = LoadScene(project, options);
//   SceneView view(model);
//   view.AddTo(renderer);
//
// Everything is in one frame, `frame`: site ENU (x east, y north, z up, metres) where at least one run has a global
// fit, else the optimised frame of the first run that has a result. Large coordinates never occur: site ENU begins at
// the site.
#pragma once

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "datasets/io/trajectory.h"
#include "datasets/project/project.h"

namespace trigpoint {

struct SceneOptions {
  std::vector<std::string> runs;  // empty: all
  std::string variant;            // whose localize and evaluate results
  std::string release;            // draws what this release froze, in place of the project's results
  int max_points = 200000;        // of the sparse models, all runs together; more are thinned evenly; 0: not read
  int max_cameras = 400;          // frusta, all runs together; more are thinned evenly
  int panorama_width_px = 512;    // of the spheres' textures; 0: no pictures are read
  int aerial_px = 2048;           // longest side of the aerial image; 0: it is not read
};

// A line through the scene.
struct ScenePath {
  enum class Kind { kOdometry, kOptimised, kTruth, kReference, kEstimate, kGps };
  Kind kind = Kind::kOptimised;
  std::string run;
  std::string source;  // "odometry", "localize", "truth", "reference poses ...", or the other system's name
  // Scene frame from camera (optimised, truth, reference), body (odometry, estimates) or antenna (GPS: places alone).
  // Odometry is laid onto the optimised pose of its first image, so that what is seen is its drift. Truth and reference
  // are in the world; in the frame of a run that is not georeferenced they are laid onto the optimised path.
  std::vector<TimedPose> poses;
};

struct ScenePoint {
  int run = 0;      // index into SceneModel::runs
  int64_t id = -1;  // in the run's sparse model
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  int track_length = 0;  // images that see it
  // Largest standard deviation of its position with the cameras held, from the rays that see it and their residuals;
  // NaN where it cannot be told.
  double sigma_m = 0;
  double residual_px = 0;  // mean length of its reprojection errors; NaN: not known
  // An image that sees it: index into SceneModel::images, and the pixel there; -1: none.
  int image = -1;
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
};

struct SceneCamera {
  std::string run, image;
  std::filesystem::path file;
  Rigid3d world_from_cam;
  std::vector<Eigen::Vector3d> corner_rays;  // camera frame: bottom-left, bottom-right, top-right, top-left
  std::optional<Eigen::Vector3d> sigma_m;    // east, north, up
};

struct ScenePanorama {
  std::string run, variant, panorama, station;
  ReferenceKind kind = ReferenceKind::kPanorama;
  Rigid3d world_from_pano;
  std::optional<Eigen::Vector3d> sigma_m;
  std::optional<Eigen::Vector3d> geotag;  // where its geotag says it is
  std::filesystem::path file;
  cv::Mat texture;  // BGR, equirectangular (a photo: as taken); empty: none was read
};

struct SceneTag {
  int id = -1;
  std::string family, role, source;  // source: "survey", "run1" (from that run's own cameras)
  double size_m = 0;
  Rigid3d world_from_tag;
  std::optional<Eigen::Vector3d> sigma_m;
  cv::Mat pattern;  // 8-bit grey, one pixel a cell, margin included; empty: family or id unknown
  double pattern_size_m = 0;
};

// A picture that points were seen in.
struct SceneImage {
  std::shared_ptr<const Run> run;  // its cameras and configuration alone; null: the run has no such image
  ImageEntry entry;
};

// A surveyed point.
struct SceneControl {
  std::string name, role;  // role: control, check
  int tag_id = -1;         // at its centre or a corner; -1: marked in images
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d sigma_m = Eigen::Vector3d::Zero();  // as stated, east, north, up
  std::optional<Eigen::Vector3d> residual_m;          // tag map minus stated; of a check point its error
};

// Difference between an answer and its reference.
struct SceneError {
  std::string run, variant, method, station, panorama, reference;
  Eigen::Vector3d reference_position = Eigen::Vector3d::Zero();
  Eigen::Vector3d difference = Eigen::Vector3d::Zero();  // estimate - reference
  std::optional<Eigen::Vector3d> sigma_m;                // of the difference, per axis
};

// Vertices of a grid over the aerial image, row by row from its top-left corner, in the scene's frame.
struct SceneAerial {
  cv::Mat picture;  // BGR
  int columns = 0, rows = 0;
  std::vector<Eigen::Vector3d> vertices;
  std::string file;
};

struct SceneModel {
  std::string site;
  std::string frame;  // "site ENU" or "the optimised frame of <run>"
  bool on_earth = false;
  std::vector<std::string> runs;
  std::vector<ScenePath> paths;
  std::vector<ScenePoint> points;
  std::vector<SceneCamera> cameras;
  std::vector<ScenePanorama> panoramas;
  std::vector<SceneTag> tags;
  std::vector<SceneControl> control;
  std::string comparison;  // that all of `errors` are of: "absolute, against surveyed control"; empty: there are none
  std::vector<SceneError> errors;
  std::vector<SceneImage> images;  // that points were seen in
  std::optional<SceneAerial> aerial;
  double ground_z = 0;             // height at which the ground is drawn, a guess from points and cameras
  std::vector<std::string> notes;  // what could not be shown, and why; one sentence each

  bool Empty() const { return paths.empty() && panoramas.empty() && tags.empty() && points.empty(); }
  // Corners of the box around paths, panoramas and tags (points reach far); both zero for an empty model.
  std::pair<Eigen::Vector3d, Eigen::Vector3d> Bounds() const;
};

// The project whose results are drawn, and which of them.
struct SceneSource {
  std::filesystem::path project;
  std::string variant, release;
  bool operator==(const SceneSource&) const = default;
};

// Of what `compare` is given: a project, a release (DIR/releases/N), the folder of an errors.csv in one of them, each
// with
// @VARIANT behind it or not. Nothing for errors that stand alone.
std::optional<SceneSource> SceneSourceOf(const std::string& written);

// Reads what there is. A result that is missing or broken is left out and named in `notes`; nothing here throws for
// it. Throws Cancelled.
SceneModel LoadScene(const Project& project, const SceneOptions& options = {}, const CancelToken& cancel = {});

// The colour (R, G, B) of each point in the image that `image` and `pixel` name; grey where it cannot be read. Opens
// each image once, a video's frames in their order. Throws Cancelled.
std::vector<std::array<uint8_t, 3>> PointColoursOf(const SceneModel& model, ProgressSink& progress,
                                                   const CancelToken& cancel);

// A GeoTIFF as a textured grid in site ENU at height z. Throws InputError naming the file and what is wrong with it.
SceneAerial ReadAerial(const std::filesystem::path& file, const LocalFrame& frame, double z, int max_px);

}  // namespace trigpoint

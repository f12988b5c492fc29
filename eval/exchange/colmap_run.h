// COLMAP as a program beside us: what `crosscheck` asks it to do.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "calib/base/option.h"
#include "datasets/io/views.h"
#include "datasets/project/child_process.h"
#include "eval/exchange/scene.h"

namespace trigpoint {

struct CrosscheckOptions {
  bool features = true;                // depth a
  bool images = true;                  // depth b
  bool panoramas = true;               // depth c
  bool rig = true;                     // depth c: the views of a panorama move together
  std::string solver = "triangulate";  // of depth a
  std::string matcher = "auto";        // of depth b
  int exhaustive_below = 60;           // images
  int spread = 24;                     // images a panorama's views are matched with, evenly over the run
  int candidates = 8;                  // and so many nearest to our answer
  double timeout_min = 240;            // of one COLMAP step
  bool keep = false;                   // COLMAP's workspace
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.features,
          {"features", "", 0, 1, "depth a: Trigpoint's features and matches, with its cameras as initial values"});
    visit(self.images, {"images", "", 0, 1, "depth b: COLMAP's own features on the same images"});
    visit(self.panoramas, {"panoramas", "", 0, 1, "depth c: views of the panoramas registered into depth b"});
    visit(self.rig, {"rig", "", 0, 1, "depth c: the views of a panorama move as one rig in the last adjustment"});
    visit(self.solver, {"solver", "", 0, 0, "depth a: triangulate (and adjust, from Trigpoint's cameras) or mapper"});
    visit(self.matcher, {"matcher", "", 0, 0, "depth b: auto, exhaustive or sequential"});
    visit(self.exhaustive_below,
          {"exhaustive_below", "", 2, 10000, "matcher auto is exhaustive up to this number of images"});
    visit(self.spread,
          {"spread", "", 1, 1e5, "number of images, spread over the run, that a panorama's views are matched with"});
    visit(self.candidates,
          {"candidates", "", 0, 1000, "number of further images, the nearest to Trigpoint's answer if there is one"});
    visit(self.timeout_min,
          {"timeout_min", "min", 0, 1e5, "time limit of a COLMAP step, which is ended after it; 0: no limit"});
    visit(self.keep, {"keep", "", 0, 1, "keep COLMAP's databases, images and models in work/"});
  }
  std::vector<std::string> Check() const;
};

struct ColmapStep {
  std::string depth, name;
  ChildResult result;
};

// One depth's outcome.
struct ColmapSolution {
  std::string depth;                           // a, b, c
  std::string status;                          // done, failed, skipped
  std::string reason;                          // in words where it isn't done, or what is odd about it (several models)
  SparseModel model;                           // of the most images
  int models = 0;                              // how many it fell apart into
  int images = 0;                              // that it was given
  std::map<std::string, std::string> name_of;  // COLMAP's image name -> ours
};

// Runs steps in a folder; nothing of it throws but Cancelled and IoError.
class ColmapRun {
 public:
  ColmapRun(const Project& project, const std::string& run, const RunScene& scene, const CrosscheckOptions& options,
            const ViewOptions& views, const std::filesystem::path& work, const std::filesystem::path& log, int threads,
            ProgressSink& progress, const CancelToken& cancel);

  const std::string& version() const { return version_; }  // empty: COLMAP is not there
  const std::vector<ColmapStep>& steps() const { return steps_; }

  ColmapSolution Features();  // depth a
  ColmapSolution Images();    // depth b
  // depth c, on top of `images`: every panorama, whether we localized it or not. `panorama`: image name -> (panorama,
  // index of its view).
  ColmapSolution Panoramas(const ColmapSolution& images,
                           std::map<std::string, std::pair<std::string, size_t>>* panorama);

 private:
  struct PanoramaViews {
    std::map<size_t, std::vector<std::string>> names;  // of images, by index of the view
    std::map<size_t, Camera> cameras;
    std::map<size_t, Rigid3d> rig_from_view;
    std::map<std::string, std::pair<std::string, size_t>> panorama;  // of an image, with the index of the view
    std::string pairs;                                               // COLMAP's list of what to match
  };
  // False: it failed, and `solution` says so.
  bool Step(ColmapSolution* solution, const std::string& name, const std::vector<std::string>& arguments);
  bool ExtractFeatures(ColmapSolution* solution, const std::string& name, const std::filesystem::path& database,
                       const std::filesystem::path& images, const std::vector<std::string>& names,
                       const Camera& camera);
  PanoramaViews RenderViews(const ColmapSolution& images, const std::filesystem::path& pictures,
                            ColmapSolution* solution);
  bool RegisterViews(const PanoramaViews& views, const std::filesystem::path& dir,
                     const std::filesystem::path& pictures, ColmapSolution* solution);
  bool AdjustAsRigs(const PanoramaViews& views, const std::set<size_t>& registered, const std::filesystem::path& dir,
                    ColmapSolution* solution);
  std::set<std::string> Candidates(const ColmapSolution& images, const std::optional<Eigen::Vector3d>& answer) const;
  bool PickModel(ColmapSolution* solution, const std::filesystem::path& dir);
  std::string Option(const std::string& sift) const;

  const Project& project_;
  const std::string run_;
  const RunScene& scene_;
  const CrosscheckOptions& options_;
  const ViewOptions& views_;
  const std::filesystem::path work_, log_;
  const int threads_;
  ProgressSink& progress_;
  const CancelToken& cancel_;
  std::filesystem::path program_;
  std::string version_;
  bool new_option_names_ = false;  // since COLMAP 3.12
  std::vector<ColmapStep> steps_;
};

}  // namespace trigpoint

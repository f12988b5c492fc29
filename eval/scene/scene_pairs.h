// How well two things of a scene are known against each other: what both have in common (datum, drift) drops out.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "datasets/project/project.h"
#include "eval/scene/scene_model.h"

namespace trigpoint {

// A camera or panorama of a run, or a tag of the survey's map.
struct SceneThing {
  enum class Kind { kCamera, kPanorama, kTag };
  Kind kind = Kind::kCamera;
  std::string run, name;                               // image, panorama, tag id
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // scene frame, m
};

// The solution that was asked for last stays factored until another one is, or it was made again. Thread safe.
class ScenePairs {
 public:
  ScenePairs();
  ~ScenePairs();

  // Covariance (m^2, scene frame) of the vector between two things, from their joint covariance: two cameras or
  // panoramas of one run from its solution `variant`, two tags from tags_cov.csv. Nothing where there is none of both,
  // and where the results are no longer those of the scene. Throws Error for results that cannot be read. Seconds for
  // thousands of images, once a solution.
  std::optional<Eigen::Matrix3d> Between(const Project& project, const std::string& variant, bool on_earth,
                                         const SceneThing& a, const SceneThing& b);

 private:
  struct Solved;
  std::optional<Eigen::Matrix3d> BetweenPoses(const std::filesystem::path& file, bool on_earth, const SceneThing& a,
                                              const SceneThing& b);

  std::mutex mutex_;
  std::unique_ptr<Solved> solved_;
};

}  // namespace trigpoint

// What `localize --use` takes from the world: the surveyed map, control points, GPS (docs/method.md section 5).
#pragma once

#include <set>
#include <string>
#include <vector>

#include "datasets/project/stage.h"
#include "eval/errors/evaluate.h"
#include "localize/files/job.h"
#include "localize/reconstruct/reconstruct.h"
#include "survey/tags/tag_files.h"
#include "survey/tags/tag_poses.h"

namespace trigpoint {

// Options of localize.
struct UseOptionsOfWorld {
  std::string use;        // control, tags, gps, with commas between; empty: none of them
  std::string reference;  // whose tags: empty: the survey's
  // The parts of `use`, with tags where a reference is named.
  std::set<std::string> Parts() const;
  std::vector<std::string> Check(const std::string& mode) const;
};

// Stages and files that a result of localize reads because of it.
std::vector<std::string> StagesForWorld(const UseOptionsOfWorld& options);
void AddWorldInputs(const Project& project, const std::string& run, const std::string& variant,
                    const UseOptionsOfWorld& options, StageRequest* request);

// What was measured around one run, as read from the project; its tags begin where the run's own images show them.
class WorldSources {
 public:
  // `all_tags`: those that neither map nor control point places, too, where they were detected; they may link runs.
  // Throws InputError for what is asked for and not there.
  WorldSources(const Project& project, const std::string& run, const std::string& variant,
               const UseOptionsOfWorld& options, const LocalizeJob& job, bool all_tags = false);
  // The tags as images of the run show them, with where map and control points place them. body_from_odom: the run's.
  std::vector<WorldTag> TagsOf(const std::vector<Rigid3d>& body_from_odom, int threads, ProgressSink& progress,
                               const CancelToken& cancel) const;
  // The map's joint covariance of those of `tags` that it places.
  Eigen::MatrixXd MapCovariance(const std::vector<WorldTag>& tags, ProgressSink& progress) const;
  // The evidence for a reconstruction of the run: where its images show the tags. Throws InputError where they show
  // none.
  WorldEvidence EvidenceFor(const Reconstruction& reconstruction, int threads, ProgressSink& progress,
                            const CancelToken& cancel) const;
  // What a fit rests on, one name each, as EvaluatedRun::evidence.
  std::vector<std::string> EvidenceOf(const WorldFit& fit) const;
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  const TagResult* InMap(int tag_id) const;  // null: it is not in the map, or without covariance
  void ReadMap(const Project& project, const std::string& name);
  void ReadControl(const Project& project);
  void ReadImages(const Project& project);
  std::vector<TagView> ViewsOf(const std::vector<Rigid3d>& body_from_odom) const;

  std::string run_;
  const LocalizeJob& job_;
  std::set<std::string> parts_;
  bool all_tags_;
  ReferenceMap map_;
  std::map<int, std::vector<TagControl>> control_;
  std::vector<ImageDetections> detections_;
  TagSizes sizes_;
  std::vector<std::string> warnings_;
};

}  // namespace trigpoint

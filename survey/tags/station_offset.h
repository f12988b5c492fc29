// Where a panorama's centre is from its station's tag, by the tags of the map that the panorama shows.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "datasets/io/site.h"
#include "survey/tags/tag_poses.h"

namespace trigpoint {

// A tag in one view of a panorama.
struct PanoramaTag {
  TagDetection detection;
  const Camera* camera = nullptr;  // of the view
  Rigid3d pano_from_view;
  Eigen::Matrix3d centre_covariance = Eigen::Matrix3d::Zero();  // of the view's centre in the panorama's frame
};

struct StationOffset {
  std::string station, panorama;
  int tag_id = -1;
  Eigen::Vector3d stated_m = Eigen::Vector3d::Zero();  // world axes, as stations.csv has it
  double stated_sigma_m = 0;                           // per axis
  // Empty where the panorama shows too little; `reason` says what.
  std::optional<Eigen::Vector3d> offset_m;                         // world axes
  Rigid3d world_from_pano;                                         // with it
  double sigma_rot_rad = 0;                                        // of its rotation, root mean square of the axes
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();            // of it, the map's uncertainty included
  Eigen::Vector3d combined_m = Eigen::Vector3d::Zero();            // both, weighted
  Eigen::Matrix3d combined = Eigen::Matrix3d::Zero();              // its covariance
  Eigen::Matrix3d world_from_level = Eigen::Matrix3d::Identity();  // right, out, up of the tag's levelled frame
  double chi2 = 0;                                                 // estimated - stated, 3 degrees of freedom
  bool own_tag = false;                                            // the station's own tag is among those seen
  int tags = 0, rejected = 0;
  double rms_px = 0;  // of the corners, per axis
  std::string reason;
  bool Contradicts() const { return chi2 > 16.3; }  // 99.9 %
};

// The panorama's pose from all its pictures of tags of the map (robust least squares on the corners; the tags may move
// within their covariances, taken as independent of each other), less the place of the station's tag. Of several
// pictures of one tag the one nearest the middle of its view is used: overlapping views show the same pixels.
StationOffset EstimateStationOffset(const Station& station, const std::string& panorama,
                                    const std::vector<PanoramaTag>& seen, const std::vector<TagEstimate>& map,
                                    const TagPosesOptions& options);

// estimated minus stated and all the rest, one row a panorama: `# trigpoint stations 1; frame=...`.
void WriteStationOffsets(const std::filesystem::path& file, const std::vector<StationOffset>& offsets,
                         const std::string& frame);

}  // namespace trigpoint

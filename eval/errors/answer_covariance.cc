#include "eval/errors/answer_covariance.h"

#include <algorithm>
#include <cmath>

#include "datasets/solution/reference_rows.h"
#include "datasets/solution/solution_covariance.h"
#include "eval/errors/stations.h"

namespace trigpoint {
namespace {

// The centre that a tag gives for a panorama's station, by the cameras that show the tag; world.
std::optional<SolutionFunction> CentreByCameras(const Solution& s, const SolutionReference& reference,
                                                const std::vector<TagResult>& tags, const TagDerivatives& by_camera,
                                                const std::vector<Station>& stations) {
  const std::string name = StationOf(reference.row, reference.station, stations);
  const auto station =
      std::find_if(stations.begin(), stations.end(), [&](const Station& each) { return each.name == name; });
  if (station == stations.end()) return std::nullopt;
  const auto tag = std::find_if(tags.begin(), tags.end(), [&](const TagResult& each) {
    return each.tag_id == station->tag_id && each.map_from_tag;
  });
  const auto cameras = by_camera.find(station->tag_id);
  if (tag == tags.end() || cameras == by_camera.end()) return std::nullopt;
  const Sim3d& world_from_odom = s.georeference->world_from_odom;
  const Rigid3d world_from_tag = world_from_odom.TransformPose(*tag->map_from_tag);
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  std::string reason;
  const auto centre = StationCentre(*station, world_from_tag, Eigen::Matrix3d::Identity(), up, &reason);
  if (!centre) return std::nullopt;
  // From tangents in odom to tangents in world.
  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = world_from_odom.rotation.toRotationMatrix();
  turn.bottomRightCorner<3, 3>() = world_from_odom.scale * turn.topLeftCorner<3, 3>();
  const Matrix6d back = turn.inverse();
  const Eigen::Matrix<double, 3, 6> by_tag = CentreFromTag(*station, world_from_tag, *centre, up);
  SolutionFunction function;
  for (const auto& [index, by_cam] : cameras->second) {
    const SolutionImage& image = s.images[static_cast<size_t>(index)];
    const Eigen::MatrixXd by_world = by_tag * turn * by_cam * back;
    function = function + by_world * WorldPose(s, image.pose, BodyFromCam(s, image));
  }
  return function;
}

}  // namespace

std::optional<Eigen::Matrix3d> JointCovariance::Between(const std::string& a, const std::string& b) const {
  const auto row = at.find(a), column = at.find(b);
  if (row == at.end() || column == at.end()) return std::nullopt;
  return m2.block<3, 3>(row->second, column->second);
}

AnswerCovariances CovariancesOfAnswers(const Solution& s, const std::vector<TagResult>& tags,
                                       const TagDerivatives& by_camera, const std::vector<Station>& stations,
                                       int threads, const CancelToken& cancel) {
  AnswerCovariances result;
  if (!s.georeference || s.covariances.empty()) return result;
  Eigen::MatrixXd position(3, 6);
  position << Eigen::Matrix3d::Zero(), Eigen::Matrix3d::Identity();
  std::vector<SolutionFunction> absolute, relative;
  const auto add = [](const std::string& name, SolutionFunction function, JointCovariance* to,
                      std::vector<SolutionFunction>* functions) {
    to->at.emplace(name, 3 * static_cast<Eigen::Index>(functions->size()));
    functions->push_back(std::move(function));
  };
  const std::vector<ReferenceRow> rows = ReferenceRows(s);
  for (const ReferenceRow& row : rows) {
    if (row.localized.empty()) continue;
    const double share = 1.0 / static_cast<double>(row.localized.size());
    SolutionFunction place;
    for (const size_t i : row.localized) place = place + share * position * WorldPose(s, s.references[i].pose);
    add(row.name, place, &result.absolute, &absolute);
    const auto centre = CentreByCameras(s, s.references[row.shown], tags, by_camera, stations);
    if (centre) add(row.name, place + -Eigen::Matrix3d::Identity() * *centre, &result.relative, &relative);
  }
  if (absolute.empty()) return result;
  const SolutionCovariance covariance(s, false, threads, cancel);
  result.absolute.m2 = covariance.Of(absolute);
  result.relative.m2 = covariance.Of(relative);
  for (const ReferenceRow& row : rows) {
    const double variance = std::pow(s.georeference->world_from_odom.scale * row.centre_sigma_m, 2);
    for (JointCovariance* joint : {&result.absolute, &result.relative}) {
      const auto at = joint->at.find(row.name);
      if (at != joint->at.end()) joint->m2.diagonal().segment<3>(at->second).array() += variance;
    }
  }
  return result;
}

}  // namespace trigpoint

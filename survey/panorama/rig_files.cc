#include "survey/panorama/rig_files.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "calib/geo/geodetic.h"
#include "datasets/io/csv.h"
#include "datasets/io/json_matrix.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

using nlohmann::json;

json Vector(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

// Covariance of rig_from_cam [rotation, translation = centre] from that of [cam_from_rig's left tangent, centre].
Matrix6d RigFromCamCovariance(const RigPhoto& p, const Matrix6d& c) {
  Matrix6d j = Matrix6d::Identity();
  // (Exp(w) R)^-1 = R^T Exp(-w) = Exp(-R^T w) R^T
  j.topLeftCorner<3, 3>() = -p.cam_from_rig.conjugate().toRotationMatrix();
  return j * c * j.transpose();
}

// Of the i-th photo, the at-th placed one; zero where it was not computed.
Matrix6d CovarianceOf(const StitchedRig& rig, size_t i, int at) {
  const Eigen::MatrixXd& covariance = rig.bundle.covariance;
  if (covariance.rows() < 6 * (at + 1)) return Matrix6d::Zero();
  return RigFromCamCovariance(rig.state.photos[i], covariance.block<6, 6>(6 * at, 6 * at));
}

void AddRow(const StitchedRig& rig, size_t i, const Matrix6d& covariance, CsvWriter* csv) {
  const Rigid3d pose = RigFromCam(rig.state.photos[i]);
  csv->Text(rig.photos[i].name);
  for (int k = 0; k < 3; ++k) csv->Number(pose.translation(k), 6);
  csv->Number(pose.rotation.x(), 9)
      .Number(pose.rotation.y(), 9)
      .Number(pose.rotation.z(), 9)
      .Number(pose.rotation.w(), 9);
  for (int k = 3; k < 6; ++k) csv->Number(std::sqrt(std::max(0.0, covariance(k, k))), 5);
  csv->Number(rig.state.lenses[static_cast<size_t>(rig.state.photos[i].lens)].focal_px, 4);
  csv->EndRow();
}

json PlacedPhoto(const StitchedRig& rig, const Composite* composite, size_t i, const Matrix6d& covariance) {
  const Rigid3d pose = RigFromCam(rig.state.photos[i]);
  const Lens& lens = rig.state.lenses[static_cast<size_t>(rig.state.photos[i].lens)];
  const Eigen::Vector2d decentring = DecentringIn(rig.views[i], {lens.p1, lens.p2});
  json entry = {{"lens", rig.state.photos[i].lens},
                {"principal_px", {rig.views[i].Principal().x(), rig.views[i].Principal().y()}},
                {"decentring", {decentring.x(), decentring.y()}},
                {"translation_m", Vector(pose.translation)},
                {"quaternion_xyzw", {pose.rotation.x(), pose.rotation.y(), pose.rotation.z(), pose.rotation.w()}},
                {"covariance_rotation_rad_translation_m", JsonRows(covariance)}};
  if (composite != nullptr) {
    const Eigen::Vector3d& g = composite->gains[i];
    entry["gain_rgb"] = {g(2), g(1), g(0)};
    entry["share_of_panorama"] = composite->share[i];
  }
  return entry;
}

// Writes rig.csv; the photos' entries of rig.json.
json WriteRigTable(const StitchedRig& rig, const Composite* composite, const std::filesystem::path& file) {
  CsvWriter csv(
      {"photo", "tx", "ty", "tz", "qx", "qy", "qz", "qw", "sigma_tx_m", "sigma_ty_m", "sigma_tz_m", "focal_px"},
      {"trigpoint rig 1; frame=rig: x right, y down, z forward at the panorama's centre; origin=mean of the "
       "photos' centres; sigma=1, relative to the origin; pose=rig_from_cam"});
  json photos = json::array();
  int at = 0;
  for (size_t i = 0; i < rig.photos.size(); ++i) {
    const RigPhoto& p = rig.state.photos[i];
    json entry = {{"photo", rig.photos[i].name},
                  {"placed", p.placed},
                  {"width_px", rig.photos[i].width},
                  {"height_px", rig.photos[i].height}};
    if (p.placed) {
      const Matrix6d covariance = CovarianceOf(rig, i, at++);
      AddRow(rig, i, covariance, &csv);
      entry.update(PlacedPhoto(rig, composite, i, covariance));
    } else {
      entry["reason"] = rig.reason[i];
    }
    photos.push_back(std::move(entry));
  }
  for (const LeftOutPhoto& p : rig.left_out) {
    photos.push_back({{"photo", p.name}, {"placed", false}, {"reason", p.reason}});
  }
  csv.Save(file);
  return photos;
}

json Lenses(const StitchedRig& rig) {
  const Eigen::MatrixXd& covariance = rig.bundle.covariance;
  const auto placed =
      std::count_if(rig.state.photos.begin(), rig.state.photos.end(), [](const RigPhoto& p) { return p.placed; });
  json lenses = json::array();
  for (size_t l = 0; l < rig.state.lenses.size(); ++l) {
    const Lens& lens = rig.state.lenses[l];
    const Eigen::Index k = 6 * placed + kLensParameters * static_cast<Eigen::Index>(l);
    Eigen::VectorXd sigma = Eigen::VectorXd::Zero(kLensParameters);
    if (covariance.rows() >= k + kLensParameters) {
      sigma = covariance.diagonal().segment<kLensParameters>(k).cwiseMax(0).cwiseSqrt();
    }
    const double exif = rig.state.lens_priors[l].focal_px;
    lenses.push_back({{"model", CameraModelName(lens.fisheye ? CameraModel::kKannalaBrandt : CameraModel::kRadtan)},
                      {"focal_px", lens.focal_px},
                      {"k1", lens.k1},
                      {"k2", lens.k2},
                      {"p1", lens.p1},
                      {"p2", lens.p2},
                      {"sigma_focal_px", sigma(0)},
                      {"sigma_k1", sigma(1)},
                      {"sigma_k2", sigma(2)},
                      {"sigma_p1", sigma(3)},
                      {"sigma_p2", sigma(4)},
                      {"exif_focal_px", exif > 0 ? json(exif) : json(nullptr)}});
  }
  return lenses;
}

// Of the photos in the order of rig.csv; by the lower triangle.
json ShapeCovariance(const StitchedRig& rig) {
  const Eigen::MatrixXd& m = rig.bundle.shape_covariance;
  json shape = json::array();
  for (Eigen::Index r = 0; r < m.rows(); ++r) {
    for (Eigen::Index k = 0; k <= r; ++k) shape.push_back(static_cast<float>(m(r, k)));
  }
  return shape;
}

json Parallax(const ParallaxBudget& b) {
  return {{"median_px", b.median_px},
          {"p95_px", b.p95_px},
          {"max_px", b.max_px},
          {"rms_one_centre_px", b.rms_central_px},
          {"rms_own_centres_px", b.rms_rig_px},
          {"centres_rms_m", b.spread_m},
          {"centres_largest_m", b.largest_m},
          {"median_distance_m", b.median_distance_m},
          {"points_with_distance", b.points_with_distance}};
}

}  // namespace

void WriteRigFiles(const StitchedRig& rig, const Composite* composite, const std::filesystem::path& dir) {
  const json photos = WriteRigTable(rig, composite, dir / "rig.csv");
  const Closure& c = rig.closure;
  json sidecar = {
      {"schema", "trigpoint rig 1"},
      {"frame",
       "rig: x right, y down, z forward at the panorama's centre; metres; sigmas and covariances at 1 sigma, "
       "relative to the first placed photo's rotation and to the origin"},
      {"photos", photos},
      {"lenses", Lenses(rig)},
      {"centre",
       {{"definition", "mean of the photos' centres"},
        {"why",
         "it is where the pictures were taken; the point nearest to all optical axes is pulled along the axes by "
         "photos "
         "that look up or down"},
        {"axes_centre_m", Vector(rig.parallax.axes_centre)}}},
      {"shape_covariance", ShapeCovariance(rig)},
      {"shared_errors", rig.bundle.shared_errors},
      {"circle", {{"radius_m", rig.state.radius_m}, {"log_sigma", rig.bundle.radius_log_sigma}}},
      {"parallax", Parallax(rig.parallax)},
      {"closure",
       {{"full_turn", c.full_turn},
        {"photos", c.photos},
        {"sum_deg", c.sum_deg},
        {"error_deg", c.error_deg},
        {"largest_gap_deg", c.largest_gap_deg}}}};
  sidecar["level"]["source"] = rig.level_source;
  if (rig.level_sigma_deg) sidecar["level"]["sigma_deg"] = *rig.level_sigma_deg;
  if (rig.heading_rad) {
    sidecar["heading"] = {{"source", rig.heading_source},
                          {"heading_deg", *rig.heading_rad * kRadToDeg},
                          {"sigma_deg", rig.heading_sigma_rad * kRadToDeg}};
  }
  if (composite != nullptr) {
    sidecar["panorama"] = {{"width_px", composite->part.width},
                           {"height_px", composite->part.height},
                           {"covered_share", composite->covered}};
  }
  WriteFileAtomically(dir / "rig.json", sidecar.dump(1) + "\n");
}

void WritePairs(const StitchedRig& rig, const std::filesystem::path& dir) {
  CsvWriter csv(
      {"photo_a", "photo_b", "matches", "candidates"},
      {"trigpoint pairs 1; matches: those that agree with the turn between the two; candidates: before that"});
  for (const PhotoPair& pair : rig.pairs) {
    csv.Text(rig.photos[static_cast<size_t>(pair.a)].name)
        .Text(rig.photos[static_cast<size_t>(pair.b)].name)
        .Integer(static_cast<int64_t>(pair.matches.size()))
        .Integer(pair.candidates)
        .EndRow();
  }
  csv.Save(dir / "pairs.csv");
}

void WriteHeldOut(const StitchedRig& rig, const std::filesystem::path& dir) {
  CsvWriter csv(
      {"photo_a", "photo_b", "u_a", "v_a", "u_b", "v_b", "rig_u_b", "rig_v_b", "turn_u_b", "turn_v_b"},
      {"trigpoint held_out 1; px; rig: predicted from (u_a, v_a) with the photos' own centres and the distance "
       "of the points nearby; turn: with the rotations alone"});
  for (const HeldOutMatch& m : rig.held_out) {
    const auto photo = [&](int i) -> const RigPhoto& { return rig.state.photos[static_cast<size_t>(i)]; };
    if (!photo(m.a).placed || !photo(m.b).placed) continue;
    const auto lens = [&](int i) -> const Lens& { return rig.state.lenses[static_cast<size_t>(photo(i).lens)]; };
    const Eigen::Vector3d ray =
        photo(m.a).cam_from_rig.conjugate() * RayOfPixel(rig.views[static_cast<size_t>(m.a)], lens(m.a), m.pixel_a);
    // Inverse distance from the points that the first photo has nearby, the nearest most; where there are none, from
    // those that are nearest.
    double sum = 0, weights = 0, far_sum = 0, far_weights = 0;
    for (const RigPoint& p : rig.state.points) {
      Eigen::Vector2d at;
      if (!(p.sigma > 0) || !ProjectRigPoint(rig.views, rig.state, p, m.a, &at)) continue;
      const double angle2 = (at - m.pixel_a).squaredNorm() / (lens(m.a).focal_px * lens(m.a).focal_px);
      const double w = 1 / ((angle2 + 1e-6) * (p.sigma * p.sigma + 1e-4));
      if (angle2 < 0.03 * 0.03 && p.sigma < 0.5) sum += w * p.inverse_distance, weights += w;
      far_sum += w / (angle2 + 1e-6) * p.inverse_distance, far_weights += w / (angle2 + 1e-6);
    }
    const double inverse = weights > 0 ? sum / weights : far_weights > 0 ? far_sum / far_weights : 0;
    csv.Text(rig.photos[static_cast<size_t>(m.a)].name).Text(rig.photos[static_cast<size_t>(m.b)].name);
    csv.Number(m.pixel_a.x(), 4).Number(m.pixel_a.y(), 4).Number(m.pixel_b.x(), 4).Number(m.pixel_b.y(), 4);
    // Seen from a's centre, not the rig's: the ray begins there.
    for (const double rho : {inverse, 0.0}) {
      const Eigen::Vector3d d = ray + rho * (photo(m.a).centre - photo(m.b).centre);
      Eigen::Vector2d pixel;
      if (PixelOfRay(rig.views[static_cast<size_t>(m.b)], lens(m.b), photo(m.b).cam_from_rig * d.normalized(),
                     &pixel)) {
        csv.Number(pixel.x(), 4).Number(pixel.y(), 4);
      } else {
        csv.Empty(2);
      }
    }
    csv.EndRow();
  }
  csv.Save(dir / "held_out.csv");
}

}  // namespace trigpoint

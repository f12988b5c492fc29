#include "localize/files/tables.h"

#include <algorithm>
#include <cmath>

#include "calib/base/error.h"
#include "calib/geo/geodetic.h"
#include "datasets/colmap/model.h"
#include "datasets/io/trajectory.h"
#include "datasets/solution/covariance_tables.h"
#include "datasets/solution/reference_rows.h"
#include "datasets/solution/solution_file.h"
#include "datasets/solution/solution_model.h"

namespace trigpoint {
namespace {

void PutGeodetic(CsvWriter& csv, const LocalFrame& frame, const Eigen::Vector3d& enu) {
  const Geodetic g = frame.GeodeticFromEnu(enu);
  csv.Number(g.latitude_deg, 9).Number(g.longitude_deg, 9).Number(g.height_m, 4);
}

// Heading, pitch, roll sigmas (rad) of a world_from_x; NaN where there is no heading.
Eigen::Vector3d AttitudeSigmas(const PoseEstimate& e) {
  try {
    const Eigen::Matrix3d j = AttitudeJacobian(e.world_from_x.rotation);
    return (j * e.covariance.topLeftCorner<3, 3>() * j.transpose()).diagonal().cwiseMax(0).cwiseSqrt();
  } catch (const NumericError&) {
    return Eigen::Vector3d::Constant(std::nan(""));
  }
}

Eigen::Vector3d PositionSigmas(const PoseEstimate& e) {
  return e.covariance.diagonal().tail<3>().cwiseMax(0).cwiseSqrt();
}

void PutAttitude(CsvWriter& csv, const Eigen::Quaterniond& world_from_cam) {
  const Attitude a = AttitudeOf(world_from_cam);
  csv.Number(a.heading_rad * kRadToDeg, 4).Number(a.pitch_rad * kRadToDeg, 4).Number(a.roll_rad * kRadToDeg, 4);
}

std::string FrameComment(const char* table, const Localization& result) {
  return std::string("trigpoint ") + table + " 1; frame=" + (result.on_earth ? "enu" : "none") +
         "; datum=" + (result.on_earth ? result.earth_source : "none") + "; sigma=1";
}

Rigid3d CamFromOdom(const LocalizeInput& input, const Localization& result, const FrameImage& image) {
  return input.cameras[static_cast<size_t>(image.camera)].cam_from_body *
         result.body_from_odom[static_cast<size_t>(image.pose)];
}

}  // namespace

void PutPose(CsvWriter& csv, const Rigid3d& target_from_x) {
  for (int k = 0; k < 3; ++k) csv.Number(target_from_x.translation(k), 6);
  const Eigen::Quaterniond& q = target_from_x.rotation;
  csv.Number(q.x(), 9).Number(q.y(), 9).Number(q.z(), 9).Number(q.w(), 9);
}

void PutWorldPose(CsvWriter& csv, const PoseEstimate& e) {
  PutPose(csv, e.world_from_x);
  for (double s : PositionSigmas(e)) csv.Number(s, 5);
}

void PutGeodeticPose(CsvWriter& csv, const LocalFrame& frame, const Rigid3d& world_from_x) {
  PutGeodetic(csv, frame, world_from_x.translation);
  PutAttitude(csv, world_from_x.rotation);
}

namespace {

// cameras.tum, cameras_odom.tum.
void WriteCameraTrajectories(const LocalizeInput& input, const Localization& result, const std::filesystem::path& dir) {
  const bool in_odom = !result.body_from_odom.empty();
  for (size_t c = 0; c < input.cameras.size(); ++c) {
    if (input.cameras[c].IsFurtherView()) continue;  // its 360 image reports the pose
    std::vector<TimedPose> odom, world;
    for (size_t i = 0; i < input.images.size(); ++i) {
      const FrameImage& image = input.images[i];
      if (image.camera != static_cast<int>(c)) continue;
      if (in_odom) odom.push_back({image.stamp_ns, CamFromOdom(input, result, image).Inverse()});
      if (result.on_earth) world.push_back({image.stamp_ns, result.cameras[i].world_from_x});
    }
    const std::string suffix = c == 0 ? "" : "_" + input.cameras[c].name;
    const std::string& name = input.cameras[c].name;
    if (in_odom) {
      WriteTum(dir / ("cameras_odom" + suffix + ".tum"), odom,
               {"trigpoint trajectory 1; frame=odom (the run's own, optimised); pose=odom_from_" + name,
                "timestamp tx ty tz qx qy qz qw"});
    }
    if (result.on_earth) {
      WriteTum(dir / ("cameras" + suffix + ".tum"), world,
               {"trigpoint trajectory 1; frame=enu; datum=" + result.earth_source + "; pose=world_from_" + name,
                "timestamp tx ty tz qx qy qz qw"});
    }
  }
}

}  // namespace

void WriteCameras(const LocalizeInput& input, const Localization& result, const std::filesystem::path& dir) {
  WriteCameraTrajectories(input, result, dir);
  if (!result.on_earth) return;
  CsvWriter csv({"timestamp",
                 "image",
                 "camera",
                 "x",
                 "y",
                 "z",
                 "qx",
                 "qy",
                 "qz",
                 "qw",
                 "latitude_deg",
                 "longitude_deg",
                 "height_m",
                 "sigma_e_m",
                 "sigma_n_m",
                 "sigma_u_m",
                 "heading_deg",
                 "pitch_deg",
                 "roll_deg",
                 "sigma_heading_deg",
                 "sigma_pitch_deg",
                 "sigma_roll_deg"},
                {FrameComment("cameras", result)});
  for (size_t i = 0; i < input.images.size(); ++i) {
    const PoseEstimate& e = result.cameras[i];
    const BodyCamera& camera = input.cameras[static_cast<size_t>(input.images[i].camera)];
    if (camera.IsFurtherView()) continue;
    csv.Stamp(input.images[i].stamp_ns).Text(input.images[i].name);
    csv.Text(camera.name);
    PutPose(csv, e.world_from_x);
    PutGeodetic(csv, input.frame, e.world_from_x.translation);
    for (double s : PositionSigmas(e)) csv.Number(s, 5);
    PutAttitude(csv, e.world_from_x.rotation);
    for (double s : AttitudeSigmas(e)) csv.Number(s * kRadToDeg, 5);
    csv.EndRow();
  }
  csv.Save(dir / "cameras.csv");
}

namespace {

// How far the geotag lies from the estimated position, and what was made of it.
void PutGeotag(CsvWriter& csv, const GeoTag& tag, const LocalFrame& frame, const Eigen::Vector3d& estimated,
               const ReferenceAnswer& shown) {
  const Eigen::Vector3d d = frame.EnuFromGeodetic(tag.position) - estimated;
  csv.Number(d.x(), 4).Number(d.y(), 4);
  if (tag.has_height) {
    csv.Number(d.z(), 4);
  } else {
    csv.Empty();
  }
  csv.Text(!shown.geotag_used ? "unused" : shown.geotag_outlier ? "outlier" : "ok");
}

void PutMatches(CsvWriter& csv, const ReferenceRow& row, const Localization& result) {
  int matches = 0;
  int64_t inliers = 0, views = 0;
  for (const size_t i : row.references) matches += result.references[i].registration.view_matches;
  for (const size_t i : row.localized) {
    const Registration& g = result.references[i].registration;
    inliers += std::count_if(g.inliers.begin(), g.inliers.end(), [](const auto& o) { return !o.repeated; });
    views += std::count_if(g.views.begin(), g.views.end(), [](const ViewAnswer& v) { return v.inliers > 0; });
  }
  csv.Integer(matches).Integer(inliers).Integer(views);
}

void PutRow(CsvWriter& csv, const Reference& reference, const ReferenceRow& row, const Localization& result,
            const Solution& s, const LocalFrame& frame) {
  const ReferenceAnswer& shown = result.references[row.shown];
  const Registration& g = shown.registration;
  const bool answered = !row.localized.empty(), on_earth = answered && s.georeference;
  const GeoTag& tag = reference.geotag;
  csv.Text(reference.name).Text(reference.station).Text(AnswerStatusName(g.status)).Text(g.reason);
  PoseEstimate world;
  if (on_earth) {
    world = {s.georeference->world_from_odom.TransformPose(row.odom_from_pano), WorldCovariance(s, row)};
    PutWorldPose(csv, world);
  } else {
    csv.Empty(10);
  }
  PutMatches(csv, row, result);
  if (answered) {
    PutPose(csv, row.odom_from_pano);
  } else {
    csv.Empty(7);
  }
  if (on_earth) {
    PutGeodeticPose(csv, frame, world.world_from_x);
  } else {
    csv.Empty(6);
  }
  if (on_earth && tag.has_position) {
    PutGeotag(csv, tag, frame, world.world_from_x.translation, shown);
  } else {
    csv.Empty(3).Text(tag.has_position ? "unused" : "missing");
  }
  if (answered) {
    for (double sigma : PositionSigmas({row.odom_from_pano, OdomCovariance(s, row)})) csv.Number(sigma, 5);
    csv.Number(g.matched_share, 4).Number(g.distance_m, 3);
  } else {
    csv.Empty(5);
  }
  csv.EndRow();
}

void WritePanoramas(const Site& site, const LocalizeJob& job, const Localization& result, const Solution& solution,
                    const std::filesystem::path& dir) {
  CsvWriter csv({"panorama",
                 "station",
                 "status",
                 "reason",
                 "x",
                 "y",
                 "z",
                 "qx",
                 "qy",
                 "qz",
                 "qw",
                 "sigma_x_m",
                 "sigma_y_m",
                 "sigma_z_m",
                 "view_matches",
                 "inliers",
                 "views",
                 "odom_x",
                 "odom_y",
                 "odom_z",
                 "odom_qx",
                 "odom_qy",
                 "odom_qz",
                 "odom_qw",
                 "latitude_deg",
                 "longitude_deg",
                 "height_m",
                 "heading_deg",
                 "pitch_deg",
                 "roll_deg",
                 "geotag_de_m",
                 "geotag_dn_m",
                 "geotag_du_m",
                 "geotag_status",
                 "odom_sigma_x_m",
                 "odom_sigma_y_m",
                 "odom_sigma_z_m",
                 "matched_share",
                 "distance_m"},
                {FrameComment("panoramas", result)});
  for (const ReferenceRow& row : ReferenceRows(solution)) {
    const Reference& reference = site.references[static_cast<size_t>(job.references[row.shown].reference)];
    PutRow(csv, reference, row, result, solution, job.input.frame);
  }
  csv.Save(dir / "panoramas.csv");
}

// A set's photo goes by its own name, whether it stands by itself or is a view of the set's rig.
const std::string& NameOfView(const Reference& reference, const PreparedReference& prepared, size_t view) {
  const bool lone_photo = reference.kind == ReferenceKind::kPhotoSet && prepared.rig.views.size() == 1;
  return lone_photo ? prepared.name : prepared.rig.views[view].name;
}

void WriteViews(const Site& site, const LocalizeJob& job, const Localization& result,
                const std::filesystem::path& dir) {
  CsvWriter csv({"panorama", "view", "status", "reason", "odom_x", "odom_y", "odom_z", "odom_qx", "odom_qy", "odom_qz",
                 "odom_qw", "inliers", "distance_m"},
                {"trigpoint views 1; frame=odom; each view by itself (G1)"});
  for (size_t i = 0; i < job.references.size(); ++i) {
    const PreparedReference& prepared = job.references[i];
    const Reference& reference = site.references[static_cast<size_t>(prepared.reference)];
    for (size_t v = 0; v < prepared.rig.views.size(); ++v) {
      const ViewAnswer& a = result.references[i].registration.views[v];
      csv.Text(reference.name).Text(NameOfView(reference, prepared, v));
      csv.Text(AnswerStatusName(a.status)).Text(a.reason);
      if (a.status == AnswerStatus::kLocalized) {
        PutPose(csv, a.view_from_odom.Inverse());
      } else {
        csv.Empty(7);
      }
      csv.Integer(a.inliers);
      if (a.status == AnswerStatus::kLocalized) {
        csv.Number(a.distance_m, 3);
      } else {
        csv.Empty();
      }
      csv.EndRow();
    }
  }
  csv.Save(dir / "views.csv");
}

// What each answer rests on: a point's pixel in an image of the run and in a view of the reference.
void WriteMatches(const Site& site, const LocalizeJob& job, const Localization& result,
                  const std::filesystem::path& dir) {
  CsvWriter csv({"panorama", "view", "image", "u_image", "v_image", "u_view", "v_view"},
                {"trigpoint matches 1; inliers of the answers; pixels: centre of the first is 0, 0"});
  const Reconstruction& r = result.reconstruction;
  const std::vector<BearingObservation>& observations = r.problem.observations;
  // Of a point in an image; null if there is none.
  const auto observation_of = [&](int point, int image) -> const BearingObservation* {
    auto it = std::partition_point(observations.begin(), observations.end(),
                                   [&](const BearingObservation& o) { return o.point < point; });
    for (; it != observations.end() && it->point == point; ++it) {
      if (r.image_of[static_cast<size_t>(it - observations.begin())] == image) return &*it;
    }
    return nullptr;
  };
  for (size_t i = 0; i < job.references.size(); ++i) {
    const PreparedReference& prepared = job.references[i];
    const Reference& reference = site.references[static_cast<size_t>(prepared.reference)];
    const Registration& g = result.references[i].registration;
    if (g.status != AnswerStatus::kLocalized) continue;
    for (const ViewObservation& o : g.inliers) {
      const BearingObservation* const seen = observation_of(o.point, o.image);
      if (seen == nullptr) continue;
      const FrameImage& image = job.input.images[static_cast<size_t>(o.image)];
      const Camera& camera = job.input.cameras[static_cast<size_t>(image.camera)].camera;
      const auto pixel = camera.Project(seen->ray.cast<double>());
      if (!pixel) continue;
      csv.Text(reference.name).Text(NameOfView(reference, prepared, static_cast<size_t>(o.view)));
      csv.Text(image.name).Number(pixel->x(), 2).Number(pixel->y(), 2);
      // In the pixels of the view or photo as it is.
      const Camera& as_is = prepared.rig.views[static_cast<size_t>(o.view)].camera;
      const Camera& matched = job.input.references[i].rig.views[static_cast<size_t>(o.view)].camera;
      csv.Number((o.pixel.x() + 0.5) * as_is.width() / matched.width() - 0.5, 2);
      csv.Number((o.pixel.y() + 0.5) * as_is.height() / matched.height() - 0.5, 2).EndRow();
    }
  }
  csv.Save(dir / "matches.csv");
}

}  // namespace

Trajectory FirstCameraTrajectory(const LocalizeInput& input, const Localization& result) {
  Trajectory trajectory;
  for (const FrameImage& image : input.images) {
    if (image.camera != 0) continue;
    trajectory.poses.push_back(
        {input.pose_stamps[static_cast<size_t>(image.pose)], CamFromOdom(input, result, image).Inverse()});
  }
  return trajectory;
}

void WriteLocalization(const Site& site, const LocalizeJob& job, const Localization& result,
                       const std::filesystem::path& dir) {
  WriteCameras(job.input, result, dir);
  WriteViews(site, job, result, dir);
  WriteMatches(site, job, result, dir);
}

void WriteRigs(const std::vector<SetRefinement>& sets, const Localization& result, const std::filesystem::path& dir) {
  if (sets.empty()) return;
  CsvWriter csv(
      {"panorama",   "photo",      "freedom",    "tx", "ty", "tz", "qx",       "qy",       "qz",       "qw",
       "sigma_tx_m", "sigma_ty_m", "sigma_tz_m", "x",  "y",  "z",  "world_qx", "world_qy", "world_qz", "world_qw"},
      {"trigpoint rigs 1; tx..qw: rig_from_cam, origin=mean of the photos' centres, metres by the run's points; "
       "x..world_qw: world_from_cam, site ENU, empty if not known or the set is rejected; sigma=1, relative to the "
       "origin"});
  for (const SetRefinement& set : sets) {
    const Registration& g = result.references[static_cast<size_t>(set.reference)].registration;
    for (const View& view : set.rig.rig.views) {
      csv.Text(set.name).Text(view.name).Text(RigFreedomName(set.freedom));
      PutPose(csv, view.rig_from_view);
      for (int k = 3; k < 6; ++k) csv.Number(std::sqrt(std::max(0.0, view.covariance(k, k))), 5);
      if (result.on_earth && g.status == AnswerStatus::kLocalized) {
        PutPose(csv, result.geo.world_from_odom.TransformPose(g.rig_from_odom.Inverse() * view.rig_from_view));
      } else {
        csv.Empty(7);
      }
      csv.EndRow();
    }
  }
  csv.Save(dir / "rigs.csv");
}

void WriteLocalizedSolution(const Site& site, const LocalizeJob& job, const Localization& result, Solution* solution,
                            const std::filesystem::path& dir) {
  for (size_t i = 0; i < job.references.size(); ++i) {
    solution->references[i].row = site.references[static_cast<size_t>(job.references[i].reference)].name;
  }
  WriteSolution(*solution, dir / kSolutionFile);
  WritePanoramas(site, job, result, *solution, dir);
  WriteCameraCovariances(*solution, dir);
  WritePanoramaCovariances(*solution, dir);
  WriteColmapModel(ModelOf(*solution).model, dir / "sparse");
}

}  // namespace trigpoint

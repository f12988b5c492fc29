#include "survey/tags/tag_files.h"

#include <cmath>

#include "calib/base/error.h"
#include "calib/geo/geodetic.h"
#include "datasets/io/csv.h"
#include "datasets/solution/covariance_tables.h"

namespace trigpoint {
namespace {

const char* const kCornerColumns[4][2] = {{"u0", "v0"}, {"u1", "v1"}, {"u2", "v2"}, {"u3", "v3"}};

std::string Comment(const std::string& table, const std::string& frame, const std::string& datum) {
  return "trigpoint " + table + " 1; frame=" + frame + "; datum=" + datum + "; sigma=1";
}

}  // namespace

void WriteDetections(const std::filesystem::path& file, const std::vector<ImageDetections>& images) {
  CsvWriter csv({"timestamp", "image", "camera", "family", "tag_id", "hamming", "margin", "u0", "v0", "u1", "v1", "u2",
                 "v2", "u3", "v3", "sigma_px"},
                {"trigpoint detections 1; pixels: centre of the first is 0, 0; corners bottom-left, bottom-right, "
                 "top-right, top-left of the upright tag; sigma=1"});
  for (const ImageDetections& image : images) {
    for (const TagDetection& d : image.detections) {
      csv.Stamp(image.stamp_ns).Text(image.image).Text(image.camera).Text(d.family);
      csv.Integer(d.id).Integer(d.hamming).Number(d.margin, 2);
      for (const Eigen::Vector2d& corner : d.corners) csv.Number(corner.x(), 4).Number(corner.y(), 4);
      csv.Number(d.SigmaPx(), 4).EndRow();
    }
  }
  csv.Save(file);
}

std::vector<ImageDetections> ReadDetections(const std::filesystem::path& file, double default_sigma_px,
                                            std::vector<std::string>* warnings) {
  const CsvTable table = CsvTable::Read(file, {"timestamp", "tag_id", "u0", "v0", "u1", "v1", "u2", "v2", "u3", "v3"},
                                        {"image", "camera", "family", "hamming", "margin", "sigma_px"});
  warnings->insert(warnings->end(), table.warnings().begin(), table.warnings().end());
  std::vector<ImageDetections> images;
  std::map<std::pair<int64_t, std::string>, size_t> index;
  table.ForEachUsable(warnings, [&](const CsvRow& row) {
    TagDetection d;
    d.id = static_cast<int>(row.Integer("tag_id"));
    if (d.id < 0) row.Fail("tag_id is negative");
    if (row.Has("family")) d.family = row.Text("family");
    d.hamming = static_cast<int>(row.Integer("hamming", 0));
    d.margin = row.Number("margin", 0);
    for (int k = 0; k < 4; ++k) {
      d.corners[k] = {row.Number(kCornerColumns[k][0]), row.Number(kCornerColumns[k][1])};
    }
    const double sigma = row.Number("sigma_px", default_sigma_px);
    if (!(sigma > 0)) row.Fail("sigma_px must be positive");
    d.corner_sigma_px.fill(sigma);
    d.refined = true;  // whoever wrote them stands by them
    const int64_t stamp = row.StampNs("timestamp");
    const std::string camera = row.Has("camera") ? row.Text("camera") : "cam0";
    const auto [it, fresh] = index.try_emplace({stamp, camera}, images.size());
    if (fresh) images.push_back({stamp, row.Has("image") ? row.Text("image") : "", camera, {}});
    images[it->second].detections.push_back(d);
  });
  return images;
}

void WriteTags(const std::filesystem::path& file, const std::vector<TagEstimate>& tags, const std::string& frame,
               const std::string& datum) {
  CsvWriter csv({"tag_id",       "family",       "size_m", "x",         "y",         "z",         "qx",
                 "qy",           "qz",           "qw",     "sigma_x_m", "sigma_y_m", "sigma_z_m", "sigma_rx_deg",
                 "sigma_ry_deg", "sigma_rz_deg", "images", "runs",      "rms_px",    "role",      "status"},
                {Comment("tags", frame, datum)});
  for (const TagEstimate& tag : tags) {
    csv.Integer(tag.tag_id).Text(tag.family).Number(tag.size_m, 6);
    if (tag.HasPose()) {
      const Rigid3d& t = *tag.world_from_tag;
      for (int i = 0; i < 3; ++i) csv.Number(t.translation[i], 6);
      for (int i = 0; i < 4; ++i) csv.Number(t.rotation.coeffs()[i], 9);
      for (int i = 3; i < 6; ++i) csv.Number(std::sqrt(tag.covariance(i, i)), 6);
      // Rotation sigmas are about the tag's own axes.
      const Eigen::Matrix3d r = t.rotation.toRotationMatrix();
      const Eigen::Matrix3d about_tag = r.transpose() * tag.covariance.topLeftCorner<3, 3>() * r;
      for (int i = 0; i < 3; ++i) csv.Number(std::sqrt(about_tag(i, i)) * kRadToDeg, 5);
    } else {
      csv.Empty(13);
    }
    csv.Integer(tag.images).Integer(tag.runs).Number(tag.rms_px, 4).Text(tag.role).Text(tag.status).EndRow();
  }
  csv.Save(file);
}

void WriteTagCovariances(const std::filesystem::path& file, const std::vector<TagEstimate>& tags,
                         const TagCrossCovariances& cross, const std::string& frame, const std::string& datum) {
  CsvWriter csv(WithCovarianceColumns({"tag_a", "tag_b"}),
                {Comment("tags_cov", frame, datum) + "; rotation (rad) first, left tangent, row by row"});
  const auto row = [&](int a, int b, const Matrix6d& c) {
    csv.Integer(a).Integer(b);
    PutCovariance(c, &csv);
    csv.EndRow();
  };
  for (const TagEstimate& tag : tags) {
    if (tag.HasPose()) row(tag.tag_id, tag.tag_id, tag.covariance);
  }
  for (const auto& [pair, c] : cross) row(pair.first, pair.second, c);
  csv.Save(file);
}

}  // namespace trigpoint

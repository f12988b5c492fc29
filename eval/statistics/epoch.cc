#include "eval/statistics/epoch.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>

#include "calib/geo/geodetic.h"
#include "eval/statistics/distributions.h"
#include "eval/statistics/statistics.h"
#include "eval/text/json_values.h"
#include "eval/text/markdown.h"
#include "eval/text/number_text.h"

namespace trigpoint {
namespace {

std::map<int, const TagResult*> Usable(const std::vector<TagResult>& tags) {
  std::map<int, const TagResult*> usable;
  for (const TagResult& tag : tags) {
    if (tag.map_from_tag && tag.map_from_tag->IsFinite()) usable[tag.tag_id] = &tag;
  }
  return usable;
}

std::optional<Matrix6d> Covariance(const TagResult& tag) {
  if (tag.covariance) return tag.covariance;
  if (!tag.sigma_m || !tag.sigma_rot_rad) return std::nullopt;
  Matrix6d c = Matrix6d::Zero();
  const Eigen::Matrix3d r = tag.map_from_tag->rotation.toRotationMatrix();
  c.topLeftCorner<3, 3>() = r * tag.sigma_rot_rad->cwiseAbs2().asDiagonal() * r.transpose();
  c.bottomRightCorner<3, 3>() = tag.sigma_m->cwiseAbs2().asDiagonal();
  return c;
}

struct Common {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero(), shift = Eigen::Vector3d::Zero();
  double yaw = 0;
  Eigen::Vector3d At(const Eigen::Vector3d& p) const {
    return shift + yaw * Eigen::Vector3d::UnitZ().cross(p - centre);
  }
};

// Iteratively reweighted: shift and yaw of the differences d at the places p.
Common FitCommon(const std::vector<Eigen::Vector3d>& p, const std::vector<Eigen::Vector3d>& d) {
  Common common;
  for (const Eigen::Vector3d& x : p) common.centre += x / static_cast<double>(p.size());
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Eigen::Vector3d& x : d) values.push_back(x[axis]);
    common.shift[axis] = Quantile(values, 0.5);
  }
  for (int iteration = 0; iteration < 30; ++iteration) {
    std::vector<double> rest;
    for (size_t i = 0; i < p.size(); ++i) rest.push_back((d[i] - common.At(p[i])).norm());
    const double scale = std::max(1e-5, 4.685 * 1.4826 * Quantile(rest, 0.5));
    Eigen::Matrix4d normal = 1e-12 * Eigen::Matrix4d::Identity();
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    for (size_t i = 0; i < p.size(); ++i) {
      const double u = rest[i] / scale;
      const double w = u < 1 ? (1 - u * u) * (1 - u * u) : 0;
      Eigen::Matrix<double, 3, 4> j;
      j << Eigen::Matrix3d::Identity(), Eigen::Vector3d::UnitZ().cross(p[i] - common.centre);
      normal += w * j.transpose() * j;
      right += w * j.transpose() * d[i];
    }
    const Eigen::Vector4d x = normal.ldlt().solve(right);
    common.shift = x.head<3>();
    common.yaw = x[3];
  }
  return common;
}

std::optional<double> Chi2(const Eigen::Vector3d& e, const Eigen::Matrix3d& c) {
  const Eigen::LLT<Eigen::Matrix3d> llt(c);
  if (llt.info() != Eigen::Success) return std::nullopt;
  return e.dot(llt.solve(e));
}

}  // namespace

EpochTest TestEpoch(const std::vector<TagResult>& a, const std::vector<TagResult>& b, double significance) {
  EpochTest test;
  test.significance = significance;
  const auto tags_a = Usable(a), tags_b = Usable(b);
  std::vector<Eigen::Vector3d> place, difference;
  for (const auto& [id, tag] : tags_a) {
    const auto it = tags_b.find(id);
    if (it == tags_b.end()) {
      test.only_a.push_back(id);
      continue;
    }
    place.push_back(tag->map_from_tag->translation);
    difference.push_back(it->second->map_from_tag->translation - tag->map_from_tag->translation);
  }
  for (const auto& [id, tag] : tags_b) {
    if (tags_a.count(id) == 0) test.only_b.push_back(id);
  }
  if (place.empty()) return test;
  Common common;
  if (place.size() >= 4) common = FitCommon(place, difference);
  test.shift_m = common.shift;
  test.yaw_deg = kRadToDeg * common.yaw;
  test.critical_chi2 = ChiSquareQuantile(1 - significance / (2 * static_cast<double>(place.size())), 3);
  size_t i = 0;
  for (const auto& [id, tag] : tags_a) {
    const auto it = tags_b.find(id);
    if (it == tags_b.end()) continue;
    const Rigid3d &x = *tag->map_from_tag, &y = *it->second->map_from_tag;
    TagMove move;
    move.tag_id = id;
    move.moved_m = difference[i] - common.At(place[i]);
    ++i;
    const Eigen::Quaterniond turned(Eigen::AngleAxisd(common.yaw, Eigen::Vector3d::UnitZ()));
    const Eigen::Vector3d w = LogSO3(y.rotation * (turned * x.rotation).conjugate());
    move.turned_deg = kRadToDeg * w.norm();
    const auto ca = Covariance(*tag), cb = Covariance(*it->second);
    if (ca && cb && ca->allFinite() && cb->allFinite()) {
      const Matrix6d c = *ca + *cb;
      move.sigma_m = c.diagonal().tail<3>().cwiseMax(0).cwiseSqrt();
      move.chi2_position = Chi2(move.moved_m, c.bottomRightCorner<3, 3>());
      move.chi2_rotation = Chi2(w, c.topLeftCorner<3, 3>());
      move.moved = move.chi2_position.value_or(0) > test.critical_chi2;
      move.turned = move.chi2_rotation.value_or(0) > test.critical_chi2;
    }
    test.tags.push_back(move);
  }
  return test;
}

std::string FormatEpoch(const EpochTest& test, const std::string& a, const std::string& b, const std::string& unit,
                        double metres_per_unit) {
  const auto length = [&](double metres) { return fmt::format("{:.4f}", metres / metres_per_unit); };
  std::vector<std::vector<std::string>> lines{
      {"tag", "east", "north", "up", "sigma e", "n", "u", "turned deg", "chi2 (3)", "of rotation", "verdict"}};
  std::string names;
  for (const TagMove& t : test.tags) {
    const std::string verdict = !t.chi2_position ? "no covariance" : t.moved ? "moved" : t.turned ? "turned" : "";
    lines.push_back({std::to_string(t.tag_id), length(t.moved_m.x()), length(t.moved_m.y()), length(t.moved_m.z()),
                     length(t.sigma_m.x()), length(t.sigma_m.y()), length(t.sigma_m.z()),
                     fmt::format("{:.3f}", t.turned_deg), NumberText(t.chi2_position, 1, "-"),
                     NumberText(t.chi2_rotation, 1, "-"), verdict});
    if (t.moved || t.turned) names += fmt::format("{}{}", names.empty() ? "" : ", ", t.tag_id);
  }
  std::string text = fmt::format(
      "### Tags from {} to {} [{}]\n\n{}\n{} at the {:.0f} % level for all tags together (chi-square beyond {:.1f}); "
      "taken out "
      "as common to all: {}, {}, {} {} and {:.4f} deg of yaw\n",
      a, b, unit, AlignMarkdown(lines), names.empty() ? "No tag moved" : "Moved or turned: tags " + names,
      100 * test.significance, test.critical_chi2, length(test.shift_m.x()), length(test.shift_m.y()),
      length(test.shift_m.z()), unit, test.yaw_deg);
  const auto only = [&](const std::vector<int>& ids, const std::string& who) {
    if (ids.empty()) return;
    text.append("Only in ").append(who).append(":");
    for (const int id : ids) text.append(" ").append(std::to_string(id));
    text += "\n";
  };
  only(test.only_a, a);
  only(test.only_b, b);
  return text;
}

nlohmann::json EpochJson(const EpochTest& test) {
  nlohmann::json tags = nlohmann::json::array(), moved = nlohmann::json::array();
  for (const TagMove& t : test.tags) {
    tags.push_back({{"tag_id", t.tag_id},
                    {"moved_m", {t.moved_m.x(), t.moved_m.y(), t.moved_m.z()}},
                    {"sigma_m", {t.sigma_m.x(), t.sigma_m.y(), t.sigma_m.z()}},
                    {"turned_deg", t.turned_deg},
                    {"chi2_position", OrNull(t.chi2_position)},
                    {"chi2_rotation", OrNull(t.chi2_rotation)},
                    {"moved", t.moved},
                    {"turned", t.turned}});
    if (t.moved || t.turned) moved.push_back(t.tag_id);
  }
  return {{"tags", tags},
          {"moved", moved},
          {"only_a", test.only_a},
          {"only_b", test.only_b},
          {"shift_m", {test.shift_m.x(), test.shift_m.y(), test.shift_m.z()}},
          {"yaw_deg", test.yaw_deg},
          {"critical_chi2", test.critical_chi2},
          {"significance", test.significance}};
}

}  // namespace trigpoint

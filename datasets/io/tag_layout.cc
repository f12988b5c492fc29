#include "datasets/io/tag_layout.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "calib/base/error.h"
#include "datasets/io/readable.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

using nlohmann::json;

// theirs_from_tag: our right is their y, our down is -z, our inward -x.
Rigid3d LayoutFromTag() {
  Eigen::Matrix3d r;
  r << 0, 0, -1, 1, 0, 0, 0, -1, 0;
  return {Eigen::Quaterniond(r), Eigen::Vector3d::Zero()};
}

// Of an object's member; throws nlohmann's exception where it is none.
double Real(const json& object, const char* key) { return object.at(key).get<double>(); }

LayoutTag WpilibTag(const json& entry) {
  LayoutTag tag;
  tag.id = entry.at("ID").get<int>();
  const json& pose = entry.at("pose");
  const json &t = pose.at("translation"), &q = pose.at("rotation").at("quaternion");
  const Eigen::Quaterniond rotation(Real(q, "W"), Real(q, "X"), Real(q, "Y"), Real(q, "Z"));
  if (!(std::abs(rotation.norm() - 1) < 1e-2)) throw InputError("expected a unit quaternion");
  tag.world_from_tag = Rigid3d(rotation, {Real(t, "x"), Real(t, "y"), Real(t, "z")}) * LayoutFromTag();
  return tag;
}

constexpr const char* kFmapFamilies[] = {"36h11", "36h10", "25h9", "16h5"};

// apriltag3_36h11_classic -> tag36h11
std::string FamilyOf(const std::string& name) {
  for (const char* family : kFmapFamilies) {
    if (name.find(family) != std::string::npos) return std::string("tag") + family;
  }
  throw InputError("expected a family such as apriltag3_36h11_classic, found '" + Excerpt(name) + "'");
}

LayoutTag FmapTag(const json& entry) {
  LayoutTag tag;
  tag.id = entry.at("id").get<int>();
  tag.family = FamilyOf(entry.at("family").get<std::string>());
  tag.size_m = 1e-3 * Real(entry, "size");
  const auto m = entry.at("transform").get<std::vector<double>>();
  if (m.size() != 16) throw InputError("expected a transform of 16 numbers, found " + std::to_string(m.size()));
  const Eigen::Matrix4d matrix = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(m.data());
  const Eigen::Matrix3d r = matrix.topLeftCorner<3, 3>();
  if (!((r.transpose() * r - Eigen::Matrix3d::Identity()).norm() < 1e-2) || r.determinant() < 0) {
    throw InputError("the transform holds no rotation");
  }
  tag.world_from_tag = Rigid3d(Eigen::Quaterniond(r), matrix.topRightCorner<3, 1>()) * LayoutFromTag();
  return tag;
}

json ParseLayout(const std::filesystem::path& file) {
  json layout = json::parse(ReadTextFile(file), nullptr, false);
  const auto holds = [&](const char* key) {
    return layout.is_object() && layout.contains(key) && layout.at(key).is_array();
  };
  if (holds("fiducials")) return layout;
  if (holds("tags") && !layout.at("tags").empty() && layout.at("tags")[0].contains("pose")) return layout;
  return {};
}

}  // namespace

bool IsTagLayout(const std::filesystem::path& file) { return !ParseLayout(file).is_null(); }

std::vector<LayoutTag> ReadTagLayout(const std::filesystem::path& file) {
  const json layout = ParseLayout(file);
  if (layout.is_null()) {
    throw InputError(file.string() + ": expected a field layout of WPILib (tags with poses) or an fmap (fiducials)");
  }
  const bool fmap = layout.contains("fiducials");
  std::vector<LayoutTag> tags;
  for (const json& entry : layout.at(fmap ? "fiducials" : "tags")) {
    const std::string where = file.string() + ": tag " + std::to_string(tags.size() + 1) + " of the list: ";
    try {
      tags.push_back(fmap ? FmapTag(entry) : WpilibTag(entry));
    } catch (const InputError& e) {
      throw InputError(where + e.what());
    } catch (const json::exception&) {
      throw InputError(where + (fmap ? "expected id, family, size (mm) and a transform of 16 numbers"
                                     : "expected ID and pose with translation x, y, z and quaternion W, X, Y, Z"));
    }
    if (tags.back().id < 0 || !tags.back().world_from_tag.IsFinite() || !(tags.back().size_m >= 0)) {
      throw InputError(where + "expected a number from 0, a finite pose and a size");
    }
    const auto same =
        std::find_if(tags.begin(), tags.end() - 1, [&](const LayoutTag& other) { return other.id == tags.back().id; });
    if (same != tags.end() - 1) throw InputError(where + "tag " + std::to_string(same->id) + " is there twice");
  }
  if (tags.empty()) throw InputError(file.string() + ": no tag in it");
  return tags;
}

void WriteWpilibLayout(const std::filesystem::path& file, const std::vector<LayoutTag>& tags) {
  json list = json::array();
  double length = 0, width = 0;
  for (const LayoutTag& tag : tags) {
    const Rigid3d pose = tag.world_from_tag * LayoutFromTag().Inverse();
    const Eigen::Vector3d& t = pose.translation;
    const Eigen::Quaterniond& q = pose.rotation;
    list.push_back({{"ID", tag.id},
                    {"pose",
                     {{"translation", {{"x", t.x()}, {"y", t.y()}, {"z", t.z()}}},
                      {"rotation", {{"quaternion", {{"W", q.w()}, {"X", q.x()}, {"Y", q.y()}, {"Z", q.z()}}}}}}}});
    length = std::max(length, t.x());
    width = std::max(width, t.y());
  }
  WriteFileAtomically(file, json{{"tags", list}, {"field", {{"length", length}, {"width", width}}}}.dump(1) + "\n");
}

void WriteFmap(const std::filesystem::path& file, const std::vector<LayoutTag>& tags) {
  json list = json::array();
  for (const LayoutTag& tag : tags) {
    if (!(tag.size_m > 0)) {
      throw InputError("tag " + std::to_string(tag.id) + ": an fmap states sizes; add this one's to tags.yaml");
    }
    if (FamilyOf(tag.family) != tag.family) throw InputError(tag.family + ": an fmap has no such family");
    const Rigid3d pose = tag.world_from_tag * LayoutFromTag().Inverse();
    const Eigen::Matrix3d r = pose.rotation.toRotationMatrix();
    std::vector<double> m;
    for (int row = 0; row < 3; ++row) {
      m.insert(m.end(), {r(row, 0), r(row, 1), r(row, 2), pose.translation[row]});
    }
    m.insert(m.end(), {0, 0, 0, 1});
    list.push_back({{"family", "apriltag3_" + tag.family.substr(3) + "_classic"},
                    {"id", tag.id},
                    {"size", 1e3 * tag.size_m},
                    {"transform", m},
                    {"unique", 1}});
  }
  WriteFileAtomically(file, json{{"fiducials", list}, {"type", "frc"}}.dump(1) + "\n");
}

}  // namespace trigpoint

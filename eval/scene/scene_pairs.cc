#include "eval/scene/scene_pairs.h"

#include <map>

#include "datasets/solution/solution_covariance.h"
#include "datasets/solution/solution_file.h"
#include "eval/errors/results.h"

namespace trigpoint {
namespace {

constexpr double kSame_m = 0.01;  // a result that was made again since the scene was loaded lies elsewhere

// A thing's place in a solution.
struct Mounted {
  int pose = -1;
  Rigid3d rig_from_thing;
};

std::optional<Mounted> FindIn(const Solution& s, const SceneThing& thing) {
  if (thing.kind == SceneThing::Kind::kCamera) {
    for (const SolutionImage& image : s.images) {
      if (image.name == thing.name) return Mounted{image.pose, BodyFromCam(s, image)};
    }
    return std::nullopt;
  }
  for (const SolutionReference& reference : s.references) {
    if (reference.row == thing.name && reference.pose >= 0) return Mounted{reference.pose, Rigid3d()};
  }
  return std::nullopt;
}

bool StandsThere(const Solution& s, bool on_earth, const Mounted& mounted, const SceneThing& thing) {
  const Rigid3d odom_from_rig = OdomFromRig(s, mounted.pose);
  const Rigid3d rig = on_earth ? s.georeference->world_from_odom.TransformPose(odom_from_rig) : odom_from_rig;
  return ((rig * mounted.rig_from_thing).translation - thing.position).norm() < kSame_m;
}

std::optional<Eigen::Matrix3d> BetweenTags(const Project& project, const SceneThing& a, const SceneThing& b) {
  const std::filesystem::path folder = project.ResultDir("survey", "");
  const int from = std::stoi(a.name), to = std::stoi(b.name);
  const TagCovariances cross = ReadTagCovariances(folder / "tags_cov.csv");
  const auto both = cross.find({std::min(from, to), std::max(from, to)});
  if (both == cross.end()) return std::nullopt;
  std::map<int, Matrix6d> own;
  for (const TagResult& tag : ReadTagResults(folder / "tags.csv", folder / "tags_cov.csv")) {
    const bool is_a = tag.tag_id == from, is_b = tag.tag_id == to;
    if ((!is_a && !is_b) || !tag.covariance || !tag.map_from_tag) continue;
    if ((tag.map_from_tag->translation - (is_a ? a : b).position).norm() < kSame_m) own[tag.tag_id] = *tag.covariance;
  }
  if (own.size() != 2) return std::nullopt;
  const Eigen::Matrix3d common = both->second.bottomRightCorner<3, 3>();
  return Eigen::Matrix3d(own[from].bottomRightCorner<3, 3>() + own[to].bottomRightCorner<3, 3>() - common -
                         common.transpose());
}

// Which file it is, and which state of it.
struct Version {
  std::filesystem::path file;
  std::filesystem::file_time_type written;
  std::uintmax_t bytes = 0;
  bool on_earth = false;
  bool operator==(const Version&) const = default;
};

}  // namespace

struct ScenePairs::Solved {
  explicit Solved(const Version& v) : version(v), solution(ReadSolution(v.file)) {}
  const SolutionCovariance& Covariance() {
    if (!covariance) covariance.emplace(solution, !version.on_earth, 0, never);
    return *covariance;
  }

  const Version version;
  const Solution solution;
  const CancelToken never;
  std::optional<SolutionCovariance> covariance;
};

ScenePairs::ScenePairs() = default;
ScenePairs::~ScenePairs() = default;

std::optional<Eigen::Matrix3d> ScenePairs::BetweenPoses(const std::filesystem::path& file, bool on_earth,
                                                        const SceneThing& a, const SceneThing& b) {
  if (!std::filesystem::exists(file)) return std::nullopt;
  const Version version{file, std::filesystem::last_write_time(file), std::filesystem::file_size(file), on_earth};
  const std::lock_guard guard(mutex_);
  if (solved_ && solved_->version != version) solved_.reset();  // before the next one needs its memory
  if (!solved_) solved_ = std::make_unique<Solved>(version);
  const Solution& s = solved_->solution;
  if (on_earth && !s.georeference) return std::nullopt;
  const auto from = FindIn(s, a), to = FindIn(s, b);
  if (!from || !to || !StandsThere(s, on_earth, *from, a) || !StandsThere(s, on_earth, *to, b)) return std::nullopt;
  const auto pose = [&](const Mounted& m) {
    return on_earth ? WorldPose(s, m.pose, m.rig_from_thing) : OdomPose(s, m.pose, m.rig_from_thing);
  };
  Eigen::MatrixXd centre(3, 6);
  centre << Eigen::Matrix3d::Zero(), Eigen::Matrix3d::Identity();
  return solved_->Covariance().Of({centre * pose(*to) + Eigen::MatrixXd(-centre) * pose(*from)});
}

std::optional<Eigen::Matrix3d> ScenePairs::Between(const Project& project, const std::string& variant, bool on_earth,
                                                   const SceneThing& a, const SceneThing& b) {
  const bool tag = a.kind == SceneThing::Kind::kTag;
  if (tag != (b.kind == SceneThing::Kind::kTag) || a.run != b.run) return std::nullopt;
  if (tag) return BetweenTags(project, a, b);
  const std::string name = ResultNameOf(a.run, variant);
  return BetweenPoses(project.ResultDir("localize", name) / kSolutionFile, on_earth, a, b);
}

}  // namespace trigpoint

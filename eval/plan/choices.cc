#include "eval/plan/choices.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace trigpoint {
namespace {

constexpr size_t kMostPlaces = 16;  // for tags, tried at a time
constexpr double kAside_m = 4;      // of such a place from the path
constexpr double kApart_m = 2;      // from the tags that are there
constexpr size_t kEnds = 4;         // points of the paths between which ways across are tried
constexpr double kShortestAcross_m = 5;

// A pass once more, on another day; `back`: the other way round.
PlannedPass Again(const PlannedPass& pass, bool back, int copy) {
  PlannedPass again = pass;
  again.name += fmt::format(" ({} {})", back ? "back" : "again", copy);
  again.date += again.name;
  if (!back) return again;
  const int64_t begin = pass.world_from_body.front().stamp_ns, end = pass.world_from_body.back().stamp_ns;
  std::reverse(again.world_from_body.begin(), again.world_from_body.end());
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()));
  for (TimedPose& pose : again.world_from_body) {
    pose.stamp_ns = begin + end - pose.stamp_ns;
    pose.target_from_body.rotation = pose.target_from_body.rotation * turn;
  }
  return again;
}

PlannedPass Named(PlannedPass pass, int copy) {
  pass.name += fmt::format(" ({})", copy);
  pass.date += pass.name;
  return pass;
}

// Points of the passes, each as far as possible from those chosen before it.
std::vector<Eigen::Vector3d> FarthestPoints(const std::vector<PlannedPass>& passes) {
  std::vector<Eigen::Vector3d> ends = {passes.front().world_from_body.front().target_from_body.translation};
  while (ends.size() < kEnds) {
    double most = 0;
    Eigen::Vector3d farthest = ends.front();
    for (const PlannedPass& pass : passes) {
      for (const TimedPose& pose : pass.world_from_body) {
        const Eigen::Vector3d& at = pose.target_from_body.translation;
        double least = 1e12;
        for (const Eigen::Vector3d& end : ends) least = std::min(least, (at - end).norm());
        if (least > most) most = least, farthest = at;
      }
    }
    if (most < kShortestAcross_m) break;
    ends.push_back(farthest);
  }
  return ends;
}

// These ways have the speed and the picture rate of the first pass.
std::vector<PassChoice> WaysAcross(const PlanLayout& layout) {
  std::vector<PassChoice> ways;
  const PlannedPass& like = layout.network.passes.front();
  const std::vector<TimedPose>& poses = like.world_from_body;
  double length = 0;
  for (size_t k = 1; k < poses.size(); ++k) {
    length += (poses[k].target_from_body.translation - poses[k - 1].target_from_body.translation).norm();
  }
  const double seconds = 1e-9 * static_cast<double>(poses.back().stamp_ns - poses.front().stamp_ns);
  const std::optional<Eigen::Quaterniond> way_from_body =
      layout.learned ? WayFromBody(poses) : Eigen::Quaterniond::Identity();
  if (!(seconds > 0 && length > 0) || !way_from_body) return ways;
  const double rate_hz = static_cast<double>(poses.size() - 1) / seconds;
  const std::vector<Eigen::Vector3d> ends = FarthestPoints(layout.network.passes);
  for (size_t a = 0; a < ends.size(); ++a) {
    for (size_t b = a + 1; b < ends.size(); ++b) {
      PassChoice way;
      way.pass = like;
      way.pass.seen.reset();
      way.pass.name =
          fmt::format("from {:.1f}, {:.1f} to {:.1f}, {:.1f}", ends[a].x(), ends[a].y(), ends[b].x(), ends[b].y());
      way.what = "a pass straight " + way.pass.name;
      way.pass.world_from_body = PosesAlong({ends[a], ends[b]}, length / seconds, rate_hz, *way_from_body);
      if (way.pass.world_from_body.size() > 1) ways.push_back(std::move(way));
    }
  }
  return ways;
}

}  // namespace

std::map<std::string, Rigid3d> TagPlaces(const PlanLayout& layout) {
  if (!layout.candidates.empty()) return layout.candidates;
  std::vector<double> heights;
  for (const auto& [id, pose] : layout.network.world_from_tag) heights.push_back(pose.translation.z());
  std::sort(heights.begin(), heights.end());
  const double height = heights[heights.size() / 2];
  std::map<std::string, Rigid3d> places;
  for (const PlannedPass& pass : layout.network.passes) {
    const size_t n = pass.world_from_body.size();
    const size_t step = std::max<size_t>(1, n * layout.network.passes.size() * 2 / kMostPlaces);
    for (size_t k = step / 2; k < n; k += step) {
      const Rigid3d& body = pass.world_from_body[k].target_from_body;
      for (const double side : {1.0, -1.0}) {
        Eigen::Vector3d out = body.rotation * Eigen::Vector3d(0, side, 0);
        out.z() = 0;
        // Ahead of the body, where its cameras look at it from several places.
        Eigen::Vector3d at =
            body.translation + kAside_m * (out.normalized() + body.rotation * Eigen::Vector3d::UnitX());
        at.z() = height;
        const bool near = std::any_of(layout.network.world_from_tag.begin(), layout.network.world_from_tag.end(),
                                      [&](const auto& t) { return (t.second.translation - at).norm() < kApart_m; });
        if (near || places.size() >= kMostPlaces) continue;
        const Eigen::Vector3d face = body.translation - at;
        places[fmt::format("{:.1f}, {:.1f}, {:.1f} m", at.x(), at.y(), at.z())] =
            UprightTag(at, std::atan2(face.x(), face.y()));
      }
    }
  }
  return places;
}

std::vector<PassChoice> PassChoices(const PlanLayout& layout, int copy) {
  std::vector<PassChoice> choices;
  for (const PlannedPass& pass : layout.network.passes) {
    for (const bool back : {false, true}) {
      choices.push_back({fmt::format("pass {} once more{}", pass.name, back ? ", the other way round" : ""),
                         Again(pass, back, copy)});
    }
  }
  if (layout.candidate_passes.empty()) {
    for (PassChoice& way : WaysAcross(layout)) choices.push_back({way.what, Named(std::move(way.pass), copy)});
  }
  for (const PlannedPass& pass : layout.candidate_passes) choices.push_back({"pass " + pass.name, Named(pass, copy)});
  return choices;
}

}  // namespace trigpoint

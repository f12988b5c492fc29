// Where the parts of a robot are mounted: the transforms of a recording that stay the same.
#pragma once

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/geometry/rigid3.h"

namespace trigpoint {

class FrameTree {
 public:
  void Add(const std::string& parent, const std::string& child, const Rigid3d& parent_from_child) {
    constexpr double kSame = 1e-4;  // rad and m
    const auto [it, fresh] = edges_.emplace(child, Edge{parent, parent_from_child});
    if (fresh) return;
    it->second.moves |= it->second.parent != parent || it->second.pose.Minus(parent_from_child).norm() > kSame;
  }
  bool Has(const std::string& frame) const { return edges_.count(frame) > 0 || IsParent(frame); }
  // to_from_from; nothing where they are not joined by transforms that stay the same.
  std::optional<Rigid3d> Find(const std::string& to, const std::string& from) const {
    const auto up_from = Ancestors(from), up_to = Ancestors(to);
    for (const auto& [frame, frame_from_from] : up_from) {
      for (const auto& [other, frame_from_to] : up_to) {
        if (other == frame) return frame_from_to.Inverse() * frame_from_from;
      }
    }
    return std::nullopt;
  }

 private:
  struct Edge {
    std::string parent;
    Rigid3d pose;
    bool moves = false;
  };
  bool IsParent(const std::string& frame) const {
    return std::any_of(edges_.begin(), edges_.end(), [&](const auto& edge) { return edge.second.parent == frame; });
  }
  // The frame itself and those above it, each with its transform from `frame`.
  std::vector<std::pair<std::string, Rigid3d>> Ancestors(const std::string& frame) const {
    constexpr size_t kDeepest = 64;  // also ends a circle
    std::vector<std::pair<std::string, Rigid3d>> chain = {{frame, Rigid3d()}};
    while (chain.size() < kDeepest) {
      const auto edge = edges_.find(chain.back().first);
      if (edge == edges_.end() || edge->second.moves) break;
      chain.emplace_back(edge->second.parent, edge->second.pose * chain.back().second);
    }
    return chain;
  }

  std::map<std::string, Edge> edges_;  // by child
};

}  // namespace trigpoint

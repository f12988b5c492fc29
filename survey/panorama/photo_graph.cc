#include "survey/panorama/photo_graph.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <set>

#include "calib/base/median.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/so3.h"
#include "survey/panorama/rig_bundle.h"

namespace trigpoint {
namespace {

using Rotations = std::vector<Eigen::Quaterniond>;

double Disagreement(const PhotoPair& p, const Rotations& q) {
  const Eigen::Quaterniond said = q[static_cast<size_t>(p.b)] * q[static_cast<size_t>(p.a)].conjugate();
  return AngleBetween(said, p.b_from_a);
}

// Connected parts; the part of each photo.
std::vector<int> Parts(int photos, const std::vector<PhotoPair>& pairs) {
  std::vector<int> part(static_cast<size_t>(photos));
  std::iota(part.begin(), part.end(), 0);
  const auto root = [&](int x) {
    while (part[static_cast<size_t>(x)] != x) x = part[static_cast<size_t>(x)];
    return x;
  };
  for (const PhotoPair& p : pairs) {
    const int a = root(p.a), b = root(p.b);
    part[static_cast<size_t>(std::max(a, b))] = std::min(a, b);
  }
  std::vector<int> of(static_cast<size_t>(photos));
  for (int i = 0; i < photos; ++i) of[static_cast<size_t>(i)] = root(i);
  return of;
}

// Photos along the tree of the strongest pairs (Prim): each with the pair that reaches it from one before; null where a
// part begins, at its strongest photo.
struct TreeStep {
  int photo = 0, from = -1;
  const PhotoPair* pair = nullptr;
};
std::vector<TreeStep> StrongestTree(int photos, const std::vector<PhotoPair>& pairs) {
  std::vector<double> strength(static_cast<size_t>(photos), 0.0);
  for (const PhotoPair& p : pairs) {
    strength[static_cast<size_t>(p.a)] += p.score;
    strength[static_cast<size_t>(p.b)] += p.score;
  }
  std::vector<bool> done(static_cast<size_t>(photos), false);
  std::vector<TreeStep> steps;
  while (static_cast<int>(steps.size()) < photos) {
    // The strongest pair between what is done and what is not; none: the strongest photo left begins a new part.
    TreeStep step;
    for (const PhotoPair& p : pairs) {
      if (done[static_cast<size_t>(p.a)] == done[static_cast<size_t>(p.b)]) continue;
      if (step.pair == nullptr || p.score > step.pair->score) step.pair = &p;
    }
    if (step.pair != nullptr) {
      const bool from_a = done[static_cast<size_t>(step.pair->a)];
      step.photo = from_a ? step.pair->b : step.pair->a, step.from = from_a ? step.pair->a : step.pair->b;
    } else {
      step.photo = -1;
      for (int i = 0; i < photos; ++i) {
        if (!done[static_cast<size_t>(i)] &&
            (step.photo < 0 || strength[static_cast<size_t>(i)] > strength[static_cast<size_t>(step.photo)]))
          step.photo = i;
      }
    }
    done[static_cast<size_t>(step.photo)] = true;
    steps.push_back(step);
  }
  return steps;
}

// What a pair says of photo `to`, given the other's orientation.
Eigen::Quaterniond Through(const PhotoPair& p, int to, const Rotations& q) {
  return p.b == to ? p.b_from_a * q[static_cast<size_t>(p.a)] : p.b_from_a.conjugate() * q[static_cast<size_t>(p.b)];
}

Rotations AlongTree(int photos, const std::vector<TreeStep>& tree) {
  Rotations q(static_cast<size_t>(photos), Eigen::Quaterniond::Identity());
  for (const TreeStep& s : tree) {
    if (s.pair != nullptr) q[static_cast<size_t>(s.photo)] = Through(*s.pair, s.photo, q);
  }
  return q;
}

// Orientations along the tree of the strongest pairs, then averaged over all pairs with less and less trust in those
// that disagree (iteratively reweighted, sum of angles).
Rotations Orient(int photos, const std::vector<PhotoPair>& pairs) {
  Rotations q = AlongTree(photos, StrongestTree(photos, pairs));
  for (int sweep = 0; sweep < 100; ++sweep) {
    double moved = 0;
    for (int i = 0; i < photos; ++i) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      double weights = 0;
      for (const PhotoPair& p : pairs) {
        if (p.a != i && p.b != i) continue;
        const Eigen::Vector3d off = LogSO3(Through(p, i, q) * q[static_cast<size_t>(i)].conjugate());
        const double weight = p.score / std::max(off.norm(), 0.002);
        sum += weight * off;
        weights += weight;
      }
      if (weights <= 0) continue;
      const Eigen::Vector3d step = sum / weights;
      q[static_cast<size_t>(i)] = (ExpSO3(step) * q[static_cast<size_t>(i)]).normalized();
      moved = std::max(moved, step.norm());
    }
    if (moved < 1e-5) break;
  }
  return q;
}

}  // namespace

PhotoGraph BuildPhotoGraph(int photos, std::vector<PhotoPair> pairs, double limit_rad) {
  PhotoGraph graph;
  for (int round = 0; round < 4; ++round) {
    graph.cam_from_rig = Orient(photos, pairs);
    std::vector<double> off;
    for (const PhotoPair& p : pairs) off.push_back(Disagreement(p, graph.cam_from_rig));
    if (off.empty()) break;
    const double limit = std::max(limit_rad, 4 * Median(off));
    std::vector<PhotoPair> kept;
    for (size_t k = 0; k < pairs.size(); ++k) {
      (off[k] <= limit ? kept : graph.contradicting).push_back(std::move(pairs[k]));
    }
    const bool same = kept.size() == off.size();
    pairs = std::move(kept);
    if (same) break;
  }
  const std::vector<int> part = Parts(photos, pairs);
  std::vector<int> size(static_cast<size_t>(photos), 0);
  for (int p : part) ++size[static_cast<size_t>(p)];
  const int largest = static_cast<int>(std::max_element(size.begin(), size.end()) - size.begin());
  graph.parts = static_cast<int>(std::count_if(size.begin(), size.end(), [](int s) { return s > 1; }));
  for (int i = 0; i < photos; ++i) {
    graph.placed.push_back(size[static_cast<size_t>(largest)] > 1 && part[static_cast<size_t>(i)] == largest);
  }
  for (PhotoPair& p : pairs) {
    if (graph.placed[static_cast<size_t>(p.a)]) graph.pairs.push_back(std::move(p));
  }
  return graph;
}

RingClosure FindClosure(int photos, const std::vector<PhotoPair>& pairs) {
  RingClosure closure;
  const std::vector<TreeStep> tree = StrongestTree(photos, pairs);
  const Rotations q = AlongTree(photos, tree);
  RigState state;
  for (const Eigen::Quaterniond& cam_from_rig : q)
    state.photos.push_back({true, 0, cam_from_rig, Eigen::Vector3d::Zero()});
  const Eigen::Vector3d up = UpFromPhotos(state);
  const Eigen::Vector3d east = up.unitOrthogonal(), north = up.cross(east);
  const auto azimuth = [&](const Eigen::Quaterniond& cam_from_rig) {
    const Eigen::Vector3d look = cam_from_rig.conjugate() * Eigen::Vector3d::UnitZ();
    return std::atan2(look.dot(east), look.dot(north));
  };
  std::vector<double> unwrapped(static_cast<size_t>(photos), 0.0);
  std::set<const PhotoPair*> of_tree;
  std::vector<double> tree_scores;
  for (const TreeStep& s : tree) {
    if (s.pair == nullptr) continue;
    const size_t from = static_cast<size_t>(s.from), to = static_cast<size_t>(s.photo);
    unwrapped[to] = unwrapped[from] + WrapAngle(azimuth(q[to]) - azimuth(q[from]));
    of_tree.insert(s.pair);
    tree_scores.push_back(s.pair->score);
  }
  struct Vote {
    double turns, score;
  };
  std::vector<Vote> votes;
  for (const PhotoPair& p : pairs) {
    if (of_tree.count(&p) > 0) continue;
    const size_t a = static_cast<size_t>(p.a), b = static_cast<size_t>(p.b);
    const double own = WrapAngle(azimuth(Through(p, p.b, q)) - azimuth(q[a]));
    const double turns = std::abs(unwrapped[b] - unwrapped[a] - own) / (2 * std::numbers::pi);
    if (turns > 0.65 && turns < 1.5) votes.push_back({turns, p.score});
  }
  if (votes.empty()) return closure;
  // Pairs of repeated textures close somewhere, but not in the same place: the heaviest group within 5 % counts.
  double most = 0;
  for (const Vote& v : votes) {
    double sum = 0, turns = 0;
    for (const Vote& w : votes) {
      if (std::abs(w.turns - v.turns) < 0.05) sum += w.score, turns += w.score * w.turns;
    }
    if (sum > most) most = sum, closure.turns = turns / sum;
  }
  closure.closed = most > 0.15 * Median(std::move(tree_scores));
  return closure;
}

}  // namespace trigpoint

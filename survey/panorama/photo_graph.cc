#include "survey/panorama/photo_graph.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "calib/geometry/so3.h"

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

// Orientations along the tree of the strongest pairs, then averaged over all pairs with less and less trust in those
// that disagree (iteratively reweighted, sum of angles).
Rotations Orient(int photos, const std::vector<PhotoPair>& pairs) {
  Rotations q(static_cast<size_t>(photos), Eigen::Quaterniond::Identity());
  std::vector<double> strength(static_cast<size_t>(photos), 0.0);
  for (const PhotoPair& p : pairs) {
    strength[static_cast<size_t>(p.a)] += p.score;
    strength[static_cast<size_t>(p.b)] += p.score;
  }
  std::vector<bool> done(static_cast<size_t>(photos), false);
  while (true) {
    // The strongest pair between what is done and what is not; none: the strongest photo left begins a new tree.
    const PhotoPair* best = nullptr;
    for (const PhotoPair& p : pairs) {
      if (done[static_cast<size_t>(p.a)] == done[static_cast<size_t>(p.b)]) continue;
      if (best == nullptr || p.score > best->score) best = &p;
    }
    if (best != nullptr) {
      const size_t a = static_cast<size_t>(best->a), b = static_cast<size_t>(best->b);
      if (done[a]) {
        q[b] = best->b_from_a * q[a];
      } else {
        q[a] = best->b_from_a.conjugate() * q[b];
      }
      done[a] = done[b] = true;
      continue;
    }
    int next = -1;
    for (int i = 0; i < photos; ++i) {
      if (!done[static_cast<size_t>(i)] &&
          (next < 0 || strength[static_cast<size_t>(i)] > strength[static_cast<size_t>(next)]))
        next = i;
    }
    if (next < 0) break;
    done[static_cast<size_t>(next)] = true;
  }
  for (int sweep = 0; sweep < 100; ++sweep) {
    double moved = 0;
    for (int i = 0; i < photos; ++i) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      double weights = 0;
      for (const PhotoPair& p : pairs) {
        if (p.a != i && p.b != i) continue;
        const Eigen::Quaterniond said =
            p.b == i ? p.b_from_a * q[static_cast<size_t>(p.a)] : p.b_from_a.conjugate() * q[static_cast<size_t>(p.b)];
        const Eigen::Vector3d off = LogSO3(said * q[static_cast<size_t>(i)].conjugate());
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
    std::vector<double> sorted = off;
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
    const double limit = std::max(limit_rad, 4 * sorted[sorted.size() / 2]);
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

}  // namespace trigpoint

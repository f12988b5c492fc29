#include "survey/panorama/photo_pairs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "calib/base/parallel.h"
#include "calib/estimation/random.h"
#include "calib/estimation/ransac.h"

namespace trigpoint {
namespace {

// No fisheye sees farther round than this, rad: 280 deg of view.
constexpr double kWidestAngle = 140 * std::numbers::pi / 180;

// Rotation b_from_a that takes ray a1 to b1 and the plane (a1, a2) to (b1, b2), symmetric in the two.
Eigen::Quaterniond RotationOfTwo(const Eigen::Vector3d& a1, const Eigen::Vector3d& a2, const Eigen::Vector3d& b1,
                                 const Eigen::Vector3d& b2) {
  const auto frame = [](const Eigen::Vector3d& x, const Eigen::Vector3d& y) {
    Eigen::Matrix3d m;
    m.col(0) = (x + y).normalized();
    m.col(1) = x.cross(y).normalized();
    m.col(2) = m.col(0).cross(m.col(1));
    return m;
  };
  return Eigen::Quaterniond(frame(b1, b2) * frame(a1, a2).transpose());
}

// Least-squares rotation of matched rays (Kabsch).
Eigen::Quaterniond BestRotation(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b,
                                const std::vector<int>& used) {
  Eigen::Matrix3d m = Eigen::Matrix3d::Zero();
  for (int i : used) m += b[static_cast<size_t>(i)] * a[static_cast<size_t>(i)].transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d d(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant());
  return Eigen::Quaterniond(svd.matrixU() * d.asDiagonal() * svd.matrixV().transpose());
}

// tf-idf of every photo over a codebook of descriptors drawn from all of them.
std::vector<std::vector<float>> BagsOfWords(const std::vector<PairView>& views, uint64_t seed, int threads,
                                            const CancelToken& cancel) {
  constexpr int kWords = 1200, kUsed = 300;
  Random random(seed);
  std::vector<std::pair<int, int>> words;
  for (int w = 0; w < kWords; ++w) {
    const int view = static_cast<int>(random.Below(views.size()));
    const int n = views[static_cast<size_t>(view)].features->size();
    if (n > 0) words.emplace_back(view, static_cast<int>(random.Below(static_cast<uint64_t>(n))));
  }
  std::vector<std::vector<float>> bags(views.size(), std::vector<float>(words.size(), 0.0F));
  ParallelFor(static_cast<int64_t>(views.size()), threads, cancel, [&](int64_t v) {
    const PhotoFeatures& f = *views[static_cast<size_t>(v)].features;
    for (int i = 0; i < std::min(f.size(), kUsed); ++i) {
      int most = -1;
      size_t best = 0;
      for (size_t w = 0; w < words.size(); ++w) {
        const int16_t *x = f.row(i), *y = views[static_cast<size_t>(words[w].first)].features->row(words[w].second);
        int product = 0;
        for (int k = 0; k < PhotoFeatures::kDim; ++k) product += x[k] * y[k];
        if (product > most) most = product, best = w;
      }
      if (!words.empty()) bags[static_cast<size_t>(v)][best] += 1;
    }
  });
  for (size_t w = 0; w < words.size(); ++w) {
    int in = 0;
    for (const auto& bag : bags) in += bag[w] > 0 ? 1 : 0;
    const float idf = in > 0 ? std::log(static_cast<float>(views.size()) / static_cast<float>(in)) : 0.0F;
    for (auto& bag : bags) bag[w] *= idf;
  }
  return bags;
}

}  // namespace

Lens StartLens(double focal_px, bool fisheye) {
  return fisheye ? Lens{focal_px, -1.0 / 24, 1.0 / 1920, true} : Lens{focal_px, 0, 0, false};
}

Eigen::Vector2d Decentring(double p1, double p2, const Eigen::Vector2d& q) {
  const double r2 = q.squaredNorm(), xy = 2 * q.x() * q.y();
  return {p1 * xy + p2 * (r2 + 2 * q.x() * q.x()), p1 * (r2 + 2 * q.y() * q.y()) + p2 * xy};
}

// Decentring is 2 (t . q) q + |q|^2 t with t = (p2, p1): t turns as points of the picture do (Oriented in image.cc).
Eigen::Vector2d DecentringIn(const PairView& view, const Eigen::Vector2d& p1_p2) {
  double x = p1_p2.y(), y = p1_p2.x();
  const int o = view.orientation;
  if (o >= 5) std::swap(x, y);
  if (o == 2 || o == 6 || o == 3 || o == 7) x = -x;
  if (o == 4 || o == 8 || o == 3 || o == 7) y = -y;
  return {y, x};
}

double HalfView(const PairView& view, const Lens& lens) {
  const double r = view.circle ? view.circle->radius_px : 0.5 * std::hypot(view.width, view.height);
  const Eigen::Vector3d ray = RayOfPixel(view, lens, view.Principal() + Eigen::Vector2d(r, 0));
  return std::atan2(ray.head<2>().norm(), ray.z());
}

Eigen::Vector3d RayOfPixel(const PairView& view, const Lens& lens, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d distorted = (pixel - view.Principal()) / lens.focal_px;
  if (lens.fisheye) {
    const double radius = distorted.norm();
    if (radius < 1e-12) return Eigen::Vector3d::UnitZ();
    double theta = std::min(radius, kWidestAngle);
    for (int i = 0; i < 20; ++i) {
      const double t2 = theta * theta;
      const double slope = 1 + t2 * (3 * lens.k1 + 5 * t2 * lens.k2);
      const double step = (theta * (1 + t2 * (lens.k1 + t2 * lens.k2)) - radius) / std::max(0.1, slope);
      theta = std::clamp(theta - step, 0.0, kWidestAngle);
      if (std::abs(step) < 1e-14) break;
    }
    const double s = std::sin(theta) / radius;
    return {s * distorted.x(), s * distorted.y(), std::cos(theta)};
  }
  Eigen::Vector2d x = distorted;
  if (lens.k1 != 0 || lens.k2 != 0 || lens.p1 != 0 || lens.p2 != 0) {
    const Eigen::Vector2d p = DecentringIn(view, {lens.p1, lens.p2});
    for (int i = 0; i < 20; ++i) {
      const double r2 = x.squaredNorm();
      x = (distorted - Decentring(p.x(), p.y(), x)) / std::max(0.2, 1 + r2 * (lens.k1 + r2 * lens.k2));
    }
  }
  return Eigen::Vector3d(x.x(), x.y(), 1).normalized();
}

bool PixelOfRay(const PairView& view, const Lens& lens, const Eigen::Vector3d& ray, Eigen::Vector2d* pixel) {
  if (lens.fisheye) {
    const double across = ray.head<2>().norm(), theta = std::atan2(across, ray.z()), t2 = theta * theta;
    if (theta > kWidestAngle || 1 + t2 * (3 * lens.k1 + 5 * t2 * lens.k2) <= 0.05) return false;
    const double radius = lens.focal_px * theta * (1 + t2 * (lens.k1 + t2 * lens.k2));
    if (view.circle && radius > view.circle->radius_px) return false;
    *pixel = view.Principal();
    if (across > 1e-12) *pixel += radius / across * ray.head<2>();
    return true;
  }
  if (ray.z() < 1e-3) return false;
  const Eigen::Vector2d x = ray.head<2>() / ray.z();
  const double r2 = x.squaredNorm();
  // Where the distorted radius no longer grows, pixels would be met twice.
  if (1 + r2 * (3 * lens.k1 + 5 * r2 * lens.k2) <= 0.05) return false;
  const Eigen::Vector2d p = DecentringIn(view, {lens.p1, lens.p2});
  const Eigen::Vector2d distorted = (1 + r2 * (lens.k1 + r2 * lens.k2)) * x + Decentring(p.x(), p.y(), x);
  *pixel = lens.focal_px * distorted + view.Principal();
  return true;
}

std::vector<std::pair<int, int>> CandidatePairs(const std::vector<PairView>& views, const PairOptions& options,
                                                int threads, const CancelToken& cancel) {
  std::set<std::pair<int, int>> pairs;
  const int n = static_cast<int>(views.size());
  if (n <= options.all_pairs_up_to) {
    for (int a = 0; a < n; ++a) {
      for (int b = a + 1; b < n; ++b) pairs.emplace(a, b);
    }
    return {pairs.begin(), pairs.end()};
  }
  for (int a = 0; a < n; ++a) {
    for (int d = 1; d <= options.neighbours; ++d) {
      const int b = (a + d) % n;  // the last meets the first: rings close
      pairs.emplace(std::min(a, b), std::max(a, b));
    }
  }
  const std::vector<std::vector<float>> bags = BagsOfWords(views, options.seed, threads, cancel);
  std::vector<float> norms;
  for (const auto& bag : bags) {
    float sum = 1e-9F;
    for (float v : bag) sum += v * v;
    norms.push_back(std::sqrt(sum));
  }
  for (int a = 0; a < n; ++a) {
    cancel.ThrowIfCancelled();
    std::vector<std::pair<float, int>> similar;
    for (int b = 0; b < n; ++b) {
      if (b == a) continue;
      float product = 0;
      for (size_t w = 0; w < bags[0].size(); ++w) {
        product += bags[static_cast<size_t>(a)][w] * bags[static_cast<size_t>(b)][w];
      }
      similar.emplace_back(-product / norms[static_cast<size_t>(a)] / norms[static_cast<size_t>(b)], b);
    }
    std::sort(similar.begin(), similar.end());
    for (int k = 0; k < std::min<int>(options.retrieved, static_cast<int>(similar.size())); ++k) {
      const int b = similar[static_cast<size_t>(k)].second;
      pairs.emplace(std::min(a, b), std::max(a, b));
    }
  }
  return {pairs.begin(), pairs.end()};
}

std::vector<PhotoPair> MatchPairs(const std::vector<PairView>& views,
                                  const std::vector<std::pair<int, int>>& candidates, const PairOptions& options,
                                  int threads, ProgressSink& progress, const CancelToken& cancel) {
  std::vector<PhotoPair> pairs(candidates.size());
  progress.Begin("match photos", static_cast<int64_t>(candidates.size()));
  ParallelFor(static_cast<int64_t>(candidates.size()), threads, cancel, [&](int64_t k) {
    PhotoPair& pair = pairs[static_cast<size_t>(k)];
    std::tie(pair.a, pair.b) = candidates[static_cast<size_t>(k)];
    pair.matches = MatchStrongest(*views[static_cast<size_t>(pair.a)].features,
                                  *views[static_cast<size_t>(pair.b)].features, options.coarse_features, options.ratio);
    progress.Advance(1);
  });
  return pairs;
}

PairRotation FindRotation(const std::vector<PairView>& views, const PhotoPair& pair, const Lens& lens_a,
                          const Lens& lens_b, double threshold_px, int iterations, uint64_t seed) {
  PairRotation result;
  const PairView &va = views[static_cast<size_t>(pair.a)], &vb = views[static_cast<size_t>(pair.b)];
  std::vector<Eigen::Vector3d> a, b;
  for (const auto& [i, j] : pair.matches) {
    a.push_back(RayOfPixel(va, lens_a, va.features->points[static_cast<size_t>(i)].cast<double>()));
    b.push_back(RayOfPixel(vb, lens_b, vb.features->points[static_cast<size_t>(j)].cast<double>()));
  }
  if (a.size() < 6) return result;
  RansacOptions ransac;
  ransac.max_iterations = iterations;
  ransac.threshold = threshold_px;
  ransac.seed = seed;
  // The error in pixels of b, at the ray's own magnification.
  const auto residual = [&](const Eigen::Quaterniond& q, int k) {
    return lens_b.focal_px * (q * a[static_cast<size_t>(k)] - b[static_cast<size_t>(k)]).norm();
  };
  auto found = Ransac<Eigen::Quaterniond, 2>(
      static_cast<int>(a.size()), ransac,
      [&](const std::vector<int>& s) {
        const auto at = [](const std::vector<Eigen::Vector3d>& v, int i) { return v[static_cast<size_t>(i)]; };
        std::vector<Eigen::Quaterniond> models;
        const double apart_a = at(a, s[0]).cross(at(a, s[1])).norm(), apart_b = at(b, s[0]).cross(at(b, s[1])).norm();
        if (apart_a > 0.02 && apart_b > 0.02 && std::abs(apart_a - apart_b) * lens_b.focal_px < 3 * threshold_px) {
          models.push_back(RotationOfTwo(at(a, s[0]), at(a, s[1]), at(b, s[0]), at(b, s[1])));
        }
        return models;
      },
      residual);
  if (!found.found || found.inliers.size() < 4) return result;
  for (int round = 0; round < 3 && found.inliers.size() >= 4; ++round) {
    const Eigen::Quaterniond q = BestRotation(a, b, found.inliers);
    std::vector<int> inliers;
    double score = 0;
    for (int k = 0; k < static_cast<int>(a.size()); ++k) {
      const double r = residual(q, k) / threshold_px;
      if (r < 1) inliers.push_back(k), score += 1 - r * r;
    }
    if (score < found.score) break;
    found.model = q, found.score = score, found.inliers = std::move(inliers);
  }
  result.b_from_a = found.model;
  result.inliers = found.inliers;
  result.score = found.score;
  // Matches where the photos overlap by this rotation: what could have agreed.
  for (size_t k = 0; k < a.size(); ++k) {
    Eigen::Vector2d p;
    if (PixelOfRay(vb, lens_b, found.model * a[k], &p) && vb.Depth(p) > 0) ++result.candidates;
  }
  // Chance puts a few of the matches right; parallax takes a share of the true ones out (Brown & Lowe 2007, eq. 10,
  // with the share lowered for it).
  result.accepted = static_cast<double>(result.inliers.size()) > 8 + 0.15 * result.candidates;
  return result;
}

std::vector<FocalScore> SearchFocal(const std::vector<PairView>& views, const std::vector<PhotoPair>& pairs,
                                    bool fisheye, const PairOptions& options, int threads, const CancelToken& cancel) {
  // The pairs with the most matches speak.
  std::vector<const PhotoPair*> used;
  for (const PhotoPair& p : pairs) {
    if (p.matches.size() >= 12) used.push_back(&p);
  }
  std::stable_sort(used.begin(), used.end(),
                   [](const PhotoPair* x, const PhotoPair* y) { return x->matches.size() > y->matches.size(); });
  if (used.size() > 20) used.resize(20);
  if (used.empty()) return {};
  std::vector<double> shares;
  // A fisheye longer than its picture is wide looks like any other lens.
  const double from = fisheye ? 0.15 : 0.35, to = fisheye ? 1.0 : 6.0;
  for (double share = from; share < to; share *= 1.06) shares.push_back(share);
  std::vector<double> scores(shares.size(), 0.0);
  ParallelFor(static_cast<int64_t>(shares.size()), threads, cancel, [&](int64_t s) {
    const double share = shares[static_cast<size_t>(s)];
    for (const PhotoPair* p : used) {
      const auto lens = [&](int v) {
        const PairView& view = views[static_cast<size_t>(v)];
        return StartLens(share * std::max(view.width, view.height), fisheye);
      };
      const PairView& b = views[static_cast<size_t>(p->b)];
      const double threshold = 0.5 * options.coarse_px * std::max(b.width, b.height) / 1600;
      const PairRotation r = FindRotation(views, *p, lens(p->a), lens(p->b), threshold, 150, options.seed);
      if (r.accepted) scores[static_cast<size_t>(s)] += r.score;
    }
  });
  std::vector<FocalScore> found;
  const double best = *std::max_element(scores.begin(), scores.end());
  for (size_t k = 0; k < shares.size(); ++k) {
    if (scores[k] > 0.75 * best) found.push_back({shares[k], scores[k]});
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const FocalScore& a, const FocalScore& b) { return a.score > b.score; });
  return found;
}

}  // namespace trigpoint

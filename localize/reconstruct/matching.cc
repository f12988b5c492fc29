#include "localize/reconstruct/matching.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/flann.hpp>
#include <set>
#include <utility>

#include "calib/base/wide.h"
#include "calib/geometry/bearing.h"
#include "localize/reconstruct/features.h"

namespace trigpoint {
namespace {

// A plain loop that compilers turn into multiply-add instructions.
[[gnu::always_inline]] inline int Dot(const int16_t* __restrict a, const int16_t* __restrict b) {
  int sum = 0;
  for (int c = 0; c < DescriptorBlock::kDim; ++c) sum += static_cast<int>(a[c]) * static_cast<int>(b[c]);
  return sum;
}

// Of one row with each of those at `rows`.
TRIGPOINT_WIDE
void DotsAt(const int16_t* a, const int16_t* b, const int* rows, int count, int* out) {
  for (int k = 0; k < count; ++k) out[k] = Dot(a, b + static_cast<std::ptrdiff_t>(rows[k]) * DescriptorBlock::kDim);
}

constexpr double kCurveStep_px = 16;  // between samples along an epipolar curve

// Calls look(pixel) along the epipolar curve of a far point and a baseline. Depth from infinity (inverse depth 0) to
// the nearest: where the curve leaves the image it simply ends.
template <typename Look>
void WalkEpipolarCurve(const Camera& camera, const Eigen::Vector3d& far, const Eigen::Vector3d& t, double nearest,
                       Look&& look) {
  const std::optional<Eigen::Vector2d> p_far = camera.Project(far);
  const std::optional<Eigen::Vector2d> p_mid = camera.Project(far + t * (0.5 / nearest));
  const std::optional<Eigen::Vector2d> p_near = camera.Project(far + t / nearest);
  double length = 200;
  if (p_far && p_near) length = (*p_far - *p_near).norm();
  const int samples = std::clamp(static_cast<int>(length / kCurveStep_px) + 2, 2, 64);
  // Nearly always the curve is a straight line as far as the search cares; strong distortion bends it.
  const Eigen::Vector2d along = p_far && p_near ? Eigen::Vector2d(*p_near - *p_far) : Eigen::Vector2d::Zero();
  const bool straight =
      p_far && p_mid && p_near && length < 63 * kCurveStep_px &&
      std::abs(along.x() * (p_mid->y() - p_far->y()) - along.y() * (p_mid->x() - p_far->x())) < std::max(length, 1.0);
  for (int s = 0; s < samples; ++s) {
    const double part = static_cast<double>(s) / (samples - 1);
    if (straight) {
      look(*p_far + part * along);
    } else if (const auto p = camera.Project(far + t * (part / nearest))) {
      look(*p);
    }
  }
}

int MaxSquared(double max_distance) { return static_cast<int>(max_distance * max_distance * 255.0 * 255.0); }

}  // namespace

DescriptorBlock::DescriptorBlock(const cv::Mat& sift) {
  const cv::Mat root = RootSift(sift);
  values_.resize(static_cast<size_t>(root.rows) * kDim);
  norms_.resize(static_cast<size_t>(root.rows));
  for (int r = 0; r < root.rows; ++r) {
    const uint8_t* from = root.ptr<uint8_t>(r);
    std::copy(from, from + kDim, values_.begin() + static_cast<std::ptrdiff_t>(r) * kDim);
    norms_[static_cast<size_t>(r)] = Dot(row(r), row(r));
  }
}

void DescriptorBlock::SquaredDistances(int i, const DescriptorBlock& other, const std::vector<int>& rows,
                                       std::vector<int>* out) const {
  out->resize(rows.size());
  DotsAt(row(i), other.values_.data(), rows.data(), static_cast<int>(rows.size()), out->data());
  for (size_t k = 0; k < rows.size(); ++k) (*out)[k] = SquaredNorm(i) + other.SquaredNorm(rows[k]) - 2 * (*out)[k];
}

void DescriptorBlock::Append(const DescriptorBlock& other, int j) {
  values_.insert(values_.end(), other.row(j), other.row(j) + kDim);
  norms_.push_back(other.norms_[static_cast<size_t>(j)]);
}

Matches MatchMutual(const DescriptorBlock& a, const DescriptorBlock& b, double ratio, double max_distance) {
  std::vector<NearestTwo> of_a, of_b;
  FindNearestBothWays(a.Rows(), b.Rows(), &of_a, &of_b);
  Matches matches;
  const double r2 = ratio * ratio;
  const int most = MaxSquared(max_distance);
  for (int i = 0; i < a.size(); ++i) {
    const NearestTwo& m = of_a[static_cast<size_t>(i)];
    if (m.index < 0 || m.best > most || m.best > r2 * m.second) continue;
    const NearestTwo& back = of_b[static_cast<size_t>(m.index)];
    if (back.index != i || back.best > r2 * back.second) continue;
    matches.emplace_back(i, m.index);
  }
  return matches;
}

Matches WithoutCarrier(Matches matches, const std::vector<Eigen::Vector3d>& rays_a,
                       const std::vector<Eigen::Vector3d>& rays_b, double pixel_rad) {
  constexpr double kStill_px = 1.5, kMoving_px = 6, kPart_px = 64;
  constexpr size_t kLeastStill = 8, kLeastMoving = 20;
  constexpr double kMostBetween = 0.15;  // of those that stand still
  const auto ray_a = [&](const std::pair<int, int>& m) -> const Eigen::Vector3d& {
    return rays_a[static_cast<size_t>(m.first)];
  };
  const auto moved_px = [&](const std::pair<int, int>& m) {
    return AngleBetween(ray_a(m), rays_b[static_cast<size_t>(m.second)]) / pixel_rad;
  };
  using Parts = std::set<std::array<int, 3>>;  // of the picture
  size_t still = 0, moving = 0;
  Parts still_in, moving_in;
  for (const auto& m : matches) {
    const double px = moved_px(m);
    const Eigen::Vector3d at = ray_a(m) / (pixel_rad * kPart_px);
    const std::array<int, 3> part = {static_cast<int>(std::floor(at.x())), static_cast<int>(std::floor(at.y())),
                                     static_cast<int>(std::floor(at.z()))};
    if (px < kStill_px) ++still, still_in.insert(part);
    if (px >= kMoving_px) ++moving, moving_in.insert(part);
  }
  const size_t between = matches.size() - still - moving;
  const bool apart = static_cast<double>(between) <= kMostBetween * static_cast<double>(still);
  // Where the camera stands, nearly all of the picture stands still.
  const bool in_a_part = still_in.size() <= 2 * moving_in.size();
  if (still < kLeastStill || moving < kLeastMoving || !apart || !in_a_part) return matches;
  std::erase_if(matches, [&](const auto& m) { return moved_px(m) < kStill_px; });
  return matches;
}

Matches MatchFlann(const cv::Mat& sift_a, const cv::Mat& sift_b, double ratio) {
  Matches matches;
  if (sift_a.rows < 1 || sift_b.rows < 2) return matches;
  cv::Mat a, b;
  sift_a.convertTo(a, CV_32F);
  sift_b.convertTo(b, CV_32F);
  // Trees split at random, by a generator of each thread's own: the answer must not depend on what it built before.
  cv::theRNG() = cv::RNG(1);
  cv::flann::Index index(b, cv::flann::KDTreeIndexParams(4));
  cv::Mat found(a.rows, 2, CV_32S), distance(a.rows, 2, CV_32F);
  index.knnSearch(a, found, distance, 2, cv::flann::SearchParams(48));
  std::vector<std::pair<float, int>> best(static_cast<size_t>(b.rows), {std::numeric_limits<float>::max(), -1});
  for (int i = 0; i < a.rows; ++i) {
    // FLANN returns squared distances.
    const float d0 = distance.at<float>(i, 0), d1 = distance.at<float>(i, 1);
    if (!(d0 < ratio * ratio * d1)) continue;
    auto& slot = best[static_cast<size_t>(found.at<int>(i, 0))];
    if (d0 < slot.first) slot = {d0, i};
  }
  for (size_t j = 0; j < best.size(); ++j) {
    if (best[j].second >= 0) matches.emplace_back(best[j].second, static_cast<int>(j));
  }
  std::sort(matches.begin(), matches.end());
  return matches;
}

FeatureGrid::FeatureGrid(const std::vector<Eigen::Vector2f>& points, int width, int height, float cell_px)
    : inverse_cell_(1.0 / static_cast<double>(cell_px)),
      columns_(std::max(1, static_cast<int>(std::ceil(static_cast<float>(width) / cell_px)))),
      rows_(std::max(1, static_cast<int>(std::ceil(static_cast<float>(height) / cell_px)))) {
  std::vector<int> cell(points.size());
  start_.assign(static_cast<size_t>(columns_) * static_cast<size_t>(rows_) + 1, 0);
  for (size_t i = 0; i < points.size(); ++i) {
    cell[i] = Cell(points[i].y(), rows_) * columns_ + Cell(points[i].x(), columns_);
    ++start_[static_cast<size_t>(cell[i]) + 1];
  }
  for (size_t c = 1; c < start_.size(); ++c) start_[c] += start_[c - 1];
  entries_.resize(points.size());
  std::vector<int> next(start_.begin(), start_.end() - 1);
  for (size_t i = 0; i < points.size(); ++i) {
    entries_[static_cast<size_t>(next[static_cast<size_t>(cell[i])]++)] = {static_cast<int>(i), points[i]};
  }
}

Matches MatchGuided(const FeatureSet& features_a, const DescriptorBlock& a, const std::vector<Eigen::Vector3d>& rays_a,
                    const FeatureSet& features_b, const DescriptorBlock& b, const std::vector<Eigen::Vector3d>& rays_b,
                    const FeatureGrid& grid_b, const Camera& camera_b, const Rigid3d& b_from_a,
                    const GuidedOptions& options) {
  std::vector<NearestTwo> of_a(static_cast<size_t>(a.size())), of_b(static_cast<size_t>(b.size()));
  std::vector<int> visited(grid_b.cells(), -1), near, distances;
  const Eigen::Matrix3d rotation = b_from_a.rotation.toRotationMatrix();
  const Eigen::Vector3d t = b_from_a.translation;
  const double band = options.epipolar_px / camera_b.MeanFocal();
  // Nearer than about the baseline, SIFT does not stand the change of viewpoint.
  const double nearest = std::max(options.min_depth_m, 1.2 * t.norm());
  for (int i = 0; i < a.size(); ++i) {
    const Eigen::Vector3d far = rotation * rays_a[static_cast<size_t>(i)];
    const Eigen::Vector3d normal = t.cross(far);
    const double normal_length = normal.norm();
    const float scale_a = features_a.scales[static_cast<size_t>(i)];
    near.clear();
    const auto look = [&](const Eigen::Vector2d& p) {
      if (!camera_b.Contains(p)) return;
      const auto fresh = [&](size_t cell) { return std::exchange(visited[cell], i) != i; };
      grid_b.Visit(p.x(), p.y(), 0.5 * kCurveStep_px + options.epipolar_px, fresh, [&](int j, const Eigen::Vector2f&) {
        const Eigen::Vector3d& ray = rays_b[static_cast<size_t>(j)];
        if (normal_length > 1e-6 && std::abs(ray.dot(normal)) > band * normal_length) return;
        const float scale_b = features_b.scales[static_cast<size_t>(j)];
        if (scale_b > 2.5F * scale_a || scale_a > 2.5F * scale_b) return;
        near.push_back(j);
      });
    };
    WalkEpipolarCurve(camera_b, far, t, nearest, look);
    a.SquaredDistances(i, b, near, &distances);
    for (size_t k = 0; k < near.size(); ++k) {
      of_a[static_cast<size_t>(i)].Offer(distances[k], near[k]);
      of_b[static_cast<size_t>(near[k])].Offer(distances[k], i);
    }
  }
  Matches matches;
  const double r2 = options.ratio * options.ratio;
  const int most = MaxSquared(options.max_distance);
  for (int i = 0; i < a.size(); ++i) {
    const NearestTwo& m = of_a[static_cast<size_t>(i)];
    if (m.index < 0 || m.best > most || m.best > r2 * m.second) continue;
    if (of_b[static_cast<size_t>(m.index)].index == i) matches.emplace_back(i, m.index);
  }
  return matches;
}

}  // namespace trigpoint

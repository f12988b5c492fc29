// Matching of SIFT descriptors.
#pragma once

#include <algorithm>
#include <opencv2/core/mat.hpp>
#include <utility>
#include <vector>

#include "calib/base/nearest_rows.h"
#include "calib/camera/camera.h"
#include "calib/geometry/rigid3.h"
#include "datasets/colmap/database.h"

namespace trigpoint {

// RootSIFT descriptors laid out for fast exact comparison.
class DescriptorBlock {
 public:
  static constexpr int kDim = kDescriptorDim;
  DescriptorBlock() = default;
  // From 8-bit SIFT rows (n x 128).
  explicit DescriptorBlock(const cv::Mat& sift);
  int size() const { return static_cast<int>(norms_.size()); }
  const int16_t* row(int i) const { return values_.data() + static_cast<size_t>(i) * kDim; }
  DescriptorRows Rows() const { return {values_.data(), norms_.data(), size()}; }
  int SquaredNorm(int i) const { return norms_[static_cast<size_t>(i)]; }
  // Squared distances between row i and some rows of another block; unit descriptors have length 255.
  void SquaredDistances(int i, const DescriptorBlock& other, const std::vector<int>& rows, std::vector<int>* out) const;
  void Append(const DescriptorBlock& other, int j);

 private:
  std::vector<int16_t> values_;
  std::vector<int> norms_;
};

// Pairs (index in a, index in b), ascending in a.
using Matches = std::vector<std::pair<int, int>>;

// Exact nearest neighbours both ways: best / second-best distance below `ratio`, mutual, and closer than
// `max_distance` (of unit descriptors, 0 to sqrt 2).
Matches MatchMutual(const DescriptorBlock& a, const DescriptorBlock& b, double ratio, double max_distance);

// Matches of two pictures of one camera without those of what is fixed to it (a bonnet, a mount, dust): these stand
// still (to 1.5 px) while the others, in at least half as large a part of the picture, move, and hardly any lie in
// between. `rays_a`, `rays_b`: of all features.
Matches WithoutCarrier(Matches matches, const std::vector<Eigen::Vector3d>& rays_a,
                       const std::vector<Eigen::Vector3d>& rays_b, double pixel_rad);

// The paper's way: FLANN (kd-trees) on SIFT, ratio test one way. Several of a may share one of b: the closest stays.
Matches MatchFlann(const cv::Mat& sift_a, const cv::Mat& sift_b, double ratio);

// A grid over an image's features for range queries.
class FeatureGrid {
 public:
  FeatureGrid(const std::vector<Eigen::Vector2f>& points, int width, int height, float cell_px);
  // Calls fn(feature index, its pixel) for every feature in the cells that touch the square of half size `radius` round
  // (x, y); cells for which fresh(cell) is false are left out.
  template <typename Fresh, typename Fn>
  void Visit(double x, double y, double radius, Fresh&& fresh, Fn&& fn) const {
    const int x0 = Cell(x - radius, columns_), x1 = Cell(x + radius, columns_);
    const int y0 = Cell(y - radius, rows_), y1 = Cell(y + radius, rows_);
    for (int cy = y0; cy <= y1; ++cy) {
      for (int cx = x0; cx <= x1; ++cx) {
        const size_t c = static_cast<size_t>(cy) * static_cast<size_t>(columns_) + static_cast<size_t>(cx);
        if (!fresh(c)) continue;
        for (int k = start_[c]; k < start_[c + 1]; ++k) {
          const Entry& e = entries_[static_cast<size_t>(k)];
          fn(e.feature, e.pixel);
        }
      }
    }
  }

  template <typename Fn>
  void Visit(double x, double y, double radius, Fn&& fn) const {
    Visit(
        x, y, radius, [](size_t) { return true; }, std::forward<Fn>(fn));
  }
  size_t cells() const { return start_.size() - 1; }

 private:
  struct Entry {
    int feature;
    Eigen::Vector2f pixel;
  };
  int Cell(double v, int count) const { return std::clamp(static_cast<int>(v * inverse_cell_), 0, count - 1); }
  double inverse_cell_;
  int columns_, rows_;
  std::vector<int> start_;
  std::vector<Entry> entries_;  // by cell, so that a query reads memory in order
};

struct GuidedOptions {
  double epipolar_px = 3;      // half width of the band about the epipolar curve, px
  double min_depth_m = 1.5;    // nearest depth searched, m
  double ratio = 0.85;         // best / second best among the candidates
  double max_distance = 0.75;  // of unit descriptors
};

// Matches of a's features along their epipolar curves in b, mutual. b_from_a in metres.
Matches MatchGuided(const FeatureSet& features_a, const DescriptorBlock& a, const std::vector<Eigen::Vector3d>& rays_a,
                    const FeatureSet& features_b, const DescriptorBlock& b, const std::vector<Eigen::Vector3d>& rays_b,
                    const FeatureGrid& grid_b, const Camera& camera_b, const Rigid3d& b_from_a,
                    const GuidedOptions& options);

}  // namespace trigpoint

// Which photos overlap, and how they are turned against each other: rotation-only RANSAC, one focal length for all.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <optional>
#include <vector>

#include "calib/base/progress.h"
#include "survey/panorama/image_circle.h"
#include "survey/panorama/photo_features.h"

namespace trigpoint {

// A photo's lens: focal length (px) and distortion. Straight: radial k1, k2 and decentring p1, p2 of normalised
// coordinates (Brown-Conrady, as OpenCV). Fisheye: r = f theta (1 + k1 theta^2 + k2 theta^4), the first terms of
// Kannala & Brandt (2006), without decentring.
struct Lens {
  double focal_px = 0;
  double k1 = 0, k2 = 0;
  bool fisheye = false;
  double p1 = 0, p2 = 0;
};
inline constexpr int kLensParameters = 5;  // f, k1, k2, p1, p2: their order wherever they stand in a vector

// Decentring's part of a straight lens' picture coordinates, of undistorted ones `q`.
Eigen::Vector2d Decentring(double p1, double p2, const Eigen::Vector2d& q);

// A lens to begin with: without distortion, or a fisheye of equal solid angles (r = 2 f sin(theta / 2)), which is what
// most are near.
Lens StartLens(double focal_px, bool fisheye);

// What pairs are made from.
struct PairView {
  int width = 0, height = 0;
  const PhotoFeatures* features = nullptr;
  std::optional<ImageCircle> circle;  // of a fisheye that does not fill its frame
  cv::Mat mask = {};                  // 8-bit, 0 = ignored, the whole picture in any size; empty: nothing is
  int orientation = 1;                // EXIF 1..8: how the stored picture was turned to what is looked at here

  // The circle's centre, or the picture's.
  Eigen::Vector2d Principal() const {
    return circle ? circle->centre : Eigen::Vector2d(0.5 * (width - 1), 0.5 * (height - 1));
  }
  bool IsIgnored(const Eigen::Vector2d& pixel) const {
    if (mask.empty()) return false;
    const int u = static_cast<int>((pixel.x() + 0.5) * mask.cols / width);
    const int v = static_cast<int>((pixel.y() + 0.5) * mask.rows / height);
    return u >= 0 && v >= 0 && u < mask.cols && v < mask.rows && mask.at<uint8_t>(v, u) == 0;
  }
  // 0 at the edge of what the lens drew, 1 in its middle, negative outside and where a mask ignores it.
  double Depth(const Eigen::Vector2d& pixel) const {
    if (IsIgnored(pixel)) return -1;
    const double w = width - 1, h = height - 1;
    const double in_frame =
        std::min(std::min(pixel.x(), w - pixel.x()) / (0.5 * w), std::min(pixel.y(), h - pixel.y()) / (0.5 * h));
    return circle ? std::min(in_frame, 1 - (pixel - circle->centre).norm() / circle->radius_px) : in_frame;
  }
};

// A lens' p1, p2 as the picture shows them. They belong to the lens and its sensor: where the camera was held upright
// and EXIF turns the picture, they turn with it, and photos held both ways share one lens.
Eigen::Vector2d DecentringIn(const PairView& view, const Eigen::Vector2d& p1_p2);

// Largest angle between the optical axis and what the photo shows, rad.
double HalfView(const PairView& view, const Lens& lens);

// Unit ray of a pixel; inverts the distortion. Camera frame: x right, y down, z forward. Outside a fisheye's picture:
// the ray of a pixel as far out as the lens reaches.
Eigen::Vector3d RayOfPixel(const PairView& view, const Lens& lens, const Eigen::Vector2d& pixel);
// Pixel of a direction; false behind a straight lens, beyond a fisheye's circle, or where the distortion folds.
bool PixelOfRay(const PairView& view, const Lens& lens, const Eigen::Vector3d& ray, Eigen::Vector2d* pixel);

struct PhotoPair {
  int a = 0, b = 0;
  Eigen::Quaterniond b_from_a = Eigen::Quaterniond::Identity();
  PhotoMatches matches;  // those that agree with the rotation
  int candidates = 0;    // matches where the photos overlap, before the rotation decided
  double score = 0;      // of the RANSAC
};

struct PairOptions {
  double ratio = 0.8;         // ratio test of descriptors
  int coarse_features = 900;  // strongest features that decide whether two photos overlap
  double coarse_px = 8;       // RANSAC threshold at 1600 px of picture width (parallax included)
  int all_pairs_up_to = 60;   // photos; above: neighbours in order and retrieval
  int neighbours = 4;         // in order, above that
  int retrieved = 8;          // most similar others, above that
  uint64_t seed = 1;
};

// Pairs to be tried: all, or by order and retrieval (tf-idf over a small codebook).
std::vector<std::pair<int, int>> CandidatePairs(const std::vector<PairView>& views, const PairOptions& options,
                                                int threads, const CancelToken& cancel);

// Coarse matches of each candidate pair, in order.
std::vector<PhotoPair> MatchPairs(const std::vector<PairView>& views,
                                  const std::vector<std::pair<int, int>>& candidates, const PairOptions& options,
                                  int threads, ProgressSink& progress, const CancelToken& cancel);

// The rotation that most of a pair's matches agree with; `accepted` false: chance could have done it.
struct PairRotation {
  bool accepted = false;
  Eigen::Quaterniond b_from_a = Eigen::Quaterniond::Identity();
  std::vector<int> inliers;
  int candidates = 0;
  double score = 0;
};
PairRotation FindRotation(const std::vector<PairView>& views, const PhotoPair& pair, const Lens& lens_a,
                          const Lens& lens_b, double threshold_px, int iterations, uint64_t seed);

// Focal lengths (px, as shares of the long side) at which rotations explain nearly the most matches of all pairs, the
// best first, in steps of 6 %; none if no pair is explained at any. Coarse: the bundle refines it. All photos are taken
// to have straight lenses, or all fisheyes.
struct FocalScore {
  double share = 0, score = 0;
};
std::vector<FocalScore> SearchFocal(const std::vector<PairView>& views, const std::vector<PhotoPair>& pairs,
                                    bool fisheye, const PairOptions& options, int threads, const CancelToken& cancel);

}  // namespace trigpoint

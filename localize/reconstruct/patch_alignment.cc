#include "localize/reconstruct/patch_alignment.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "calib/base/parallel.h"
#include "localize/reconstruct/patch.h"
#include "localize/reconstruct/surface_warp.h"

namespace trigpoint {
namespace {

constexpr int kEnough = 2;  // images that a point is aligned in: the others are not needed

class TrackAligner {
 public:
  TrackAligner(const LocalizeInput& input, const Reconstruction& r) : input_(input), r_(r), p_(r.problem) {
    of_image_.resize(input.images.size());
    tracks_.resize(p_.points.size());
    aligned_.assign(p_.observations.size(), 0);
    pixels_.reserve(p_.observations.size());
    for (size_t k = 0; k < p_.observations.size(); ++k) {
      const auto pixel = CameraOf(k).Project(p_.observations[k].ray.cast<double>());
      pixels_.push_back(pixel.value_or(Eigen::Vector2d(-1, -1)).cast<float>());
    }
    for (size_t begin = 0, end = 0; begin < p_.observations.size(); begin = end) {
      const auto point = static_cast<size_t>(p_.observations[begin].point);
      while (end < p_.observations.size() && static_cast<size_t>(p_.observations[end].point) == point) ++end;
      if (r.point_valid[point]) Enter(begin, end, &tracks_[point]);
    }
  }

  AlignedTracks Run(int threads, ProgressSink& progress, const CancelToken& cancel) {
    const auto images = static_cast<int64_t>(input_.images.size());
    progress.Begin("aligning the pictures of points", 2 * images);
    // From the middle of each track on, and from there back: patches are in memory only along their tracks.
    ParallelFor(2, threads, cancel, [&](int64_t direction) {
      std::unordered_map<int, Patch> patches;
      for (int64_t k = 0; k < images; ++k) {
        cancel.ThrowIfCancelled();
        const bool back = direction == 1;
        AlignImage(static_cast<int>(back ? images - 1 - k : k), back, &patches);
        progress.Advance(1);
      }
    });
    return Result();
  }

 private:
  struct Track {
    int64_t middle = -1;      // the observation whose picture is looked for in the others; -1: none
    int first = 0, last = 0;  // images
  };

  // The observations of a point, in [begin, end). The one in the middle is the least unlike all others.
  void Enter(size_t begin, size_t end, Track* track) {
    std::vector<std::pair<int, size_t>> of_image;
    for (size_t k = begin; k < end; ++k) {
      const bool rows = input_.cameras[static_cast<size_t>(p_.observations[k].view)].readout_s != 0;
      if (!rows) of_image.emplace_back(r_.image_of[k], k);
    }
    std::sort(of_image.begin(), of_image.end());
    const auto twice =
        std::unique(of_image.begin(), of_image.end(), [](const auto& a, const auto& b) { return a.first == b.first; });
    of_image.erase(twice, of_image.end());
    std::vector<size_t> believed;
    for (const auto& [image, k] : of_image) {
      if (p_.observations[k].active) believed.push_back(k);
    }
    if (believed.size() < 2) return;
    *track = {static_cast<int64_t>(believed[believed.size() / 2]), of_image.front().first, of_image.back().first};
    for (const auto& [image, k] : of_image) of_image_[static_cast<size_t>(image)].push_back(k);
  }

  void AlignImage(int image, bool back, std::unordered_map<int, Patch>* patches) {
    const std::vector<size_t>& here = of_image_[static_cast<size_t>(image)];
    const cv::Mat grey = here.empty() ? cv::Mat() : input_.image_picture(image);
    if (grey.empty()) return;
    const cv::Mat smooth = SmoothForPatches(grey);
    const std::vector<float> scales = input_.image_features(image).scales;
    for (const size_t k : here) {
      const int point = p_.observations[k].point;
      const Track& track = tracks_[static_cast<size_t>(point)];
      if (track.middle == static_cast<int64_t>(k)) {
        Patch patch;
        if (Cut(smooth, k, scales[static_cast<size_t>(r_.feature_of[k])], &patch)) patches->emplace(point, patch);
        continue;
      }
      const auto patch = patches->find(point);
      if (patch == patches->end()) continue;
      const auto warp = WarpBetween(Placed(static_cast<size_t>(track.middle)), Placed(k), PointOf(k));
      aligned_[k] = warp && patch->second.Align(smooth, *warp, &pixels_[k]) ? 1 : 0;
      if (image == (back ? track.first : track.last)) patches->erase(patch);
    }
  }

  bool Cut(const cv::Mat& smooth, size_t k, float scale, Patch* patch) const {
    const double distance = (CameraFromWorld(k) * PointOf(k)).norm();
    return patch->Cut(smooth, pixels_[k], PatchRadius(scale), distance / CameraOf(k).MeanFocal());
  }

  // What cannot be aligned shows something else, or too little: where a point has enough others, it is left out.
  AlignedTracks Result() const {
    std::vector<int> aligned(p_.points.size(), 0);
    for (size_t k = 0; k < pixels_.size(); ++k) aligned[static_cast<size_t>(p_.observations[k].point)] += aligned_[k];
    AlignedTracks out;
    out.observations.reserve(pixels_.size());
    for (size_t k = 0; k < pixels_.size(); ++k) {
      const auto point = static_cast<size_t>(p_.observations[k].point);
      const int64_t middle = tracks_[point].middle;
      const bool other = middle != static_cast<int64_t>(k);
      out.tried += middle >= 0 && other ? 1 : 0;
      out.aligned += aligned_[k];
      if (other && aligned_[k] == 0 && aligned[point] >= kEnough) continue;
      out.observations.push_back({p_.observations[k].point, r_.image_of[k], r_.feature_of[k], pixels_[k]});
    }
    return out;
  }

  const Camera& CameraOf(size_t k) const { return input_.cameras[static_cast<size_t>(p_.observations[k].view)].camera; }
  const Eigen::Vector3d& PointOf(size_t k) const { return p_.points[static_cast<size_t>(p_.observations[k].point)]; }
  PlacedCamera Placed(size_t k) const { return {CameraOf(k), CameraFromWorld(k)}; }
  Rigid3d CameraFromWorld(size_t k) const {
    const BearingObservation& o = p_.observations[k];
    return p_.views[static_cast<size_t>(o.view)] * p_.poses[static_cast<size_t>(o.pose)];
  }

  const LocalizeInput& input_;
  const Reconstruction& r_;
  const BundleProblem& p_;
  std::vector<std::vector<size_t>> of_image_;  // observations that may be aligned
  std::vector<Track> tracks_;                  // of each point
  std::vector<Eigen::Vector2f> pixels_;        // of each observation
  std::vector<char> aligned_;                  // and whether it is; bytes, as two threads write
};

}  // namespace

AlignedTracks AlignPatches(const LocalizeInput& input, const Reconstruction& reconstruction, int threads,
                           ProgressSink& progress, const CancelToken& cancel) {
  return TrackAligner(input, reconstruction).Run(threads, progress, cancel);
}

}  // namespace trigpoint

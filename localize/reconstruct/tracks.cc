#include "localize/reconstruct/tracks.h"

#include <algorithm>
#include <limits>
#include <map>
#include <memory>

#include "calib/base/parallel.h"
#include "calib/geo/geodetic.h"
#include "localize/reconstruct/prepared_image.h"
#include "localize/reconstruct/track_table.h"
#include "localize/reconstruct/two_view.h"

namespace trigpoint {
namespace {

TrackTable::Keep AtLeast(int images) {
  return [images](const TrackTable::Track& track) { return static_cast<int>(track.size()) >= images; };
}

std::vector<int> Gaps(int max_gap) {
  std::vector<int> gaps;
  for (int g = 2; g <= max_gap; g = g < 4 ? g + 1 : g + g / 2) gaps.push_back(g);
  return gaps;
}

struct PairResult {
  Matches matches;
  Rigid3d b_from_a;
  bool contradicted = false;
};

PairResult MatchPaper(const PreparedImage& a, const PreparedImage& b, const TrackOptions& o) {
  PairResult result;
  const Matches matches = MatchFlann(a.features.descriptors, b.features.descriptors, o.ratio);
  std::vector<Eigen::Vector2f> pa, pb;
  for (const auto& [i, j] : matches) {
    pa.push_back(a.features.points[static_cast<size_t>(i)]);
    pb.push_back(b.features.points[static_cast<size_t>(j)]);
  }
  for (int k : VerifyHomography(pa, pb, o.homography_px)) result.matches.push_back(matches[static_cast<size_t>(k)]);
  return result;
}

PairResult Verified(const PreparedImage& a, const PreparedImage& b, const Matches& matches, const Rigid3d& prior,
                    const TwoViewOptions& options) {
  std::vector<Eigen::Vector3d> ra, rb;
  for (const auto& [i, j] : matches) {
    ra.push_back(a.rays[static_cast<size_t>(i)]);
    rb.push_back(b.rays[static_cast<size_t>(j)]);
  }
  const TwoViewResult two = VerifyTwoView(ra, rb, prior, options);
  PairResult result;
  result.b_from_a = two.b_from_a;
  result.contradicted = two.used_ransac;
  for (int k : two.inliers) result.matches.push_back(matches[static_cast<size_t>(k)]);
  return result;
}

Matches GuidedMatches(const PreparedImage& a, const PreparedImage& b, const Camera& camera_b, const Rigid3d& b_from_a,
                      const GuidedOptions& options) {
  return MatchGuided(a.features, a.descriptors, a.rays, b.features, b.descriptors, b.rays, *b.grid, camera_b, b_from_a,
                     options);
}

// What every camera's stream is tracked with.
struct Tracking {
  const LocalizeInput& input;
  const TrackOptions& options;
  int threads;
  uint64_t seed;
  ProgressSink& progress;
  const CancelToken& cancel;
};

// The images of one camera: a window slides over them, batch by batch.
class StreamTracker {
 public:
  StreamTracker(const Tracking& tracking, const std::vector<int>& stream, TrackSet* result)
      : t_(tracking),
        o_(tracking.options),
        paper_(o_.mode == "paper"),
        stream_(stream),
        gaps_(paper_ ? std::vector<int>{} : Gaps(o_.max_gap)),
        window_(stream.size()),
        next_from_this_(stream.size()),
        result_(result) {}

  void Track() {
    constexpr int kBatch = 16;
    const int m = static_cast<int>(stream_.size());
    for (int begin = 0; begin < m; begin += kBatch) {
      const int end = std::min(m, begin + kBatch);
      Read(begin, end);
      // Consecutive frames first: they refine the relative poses.
      JoinConsecutive(begin, end);
      JoinWide(begin, end);
      const int still_matched = std::max(0, end - std::max(1, o_.max_gap));
      for (int k = 0; k < still_matched; ++k) window_[static_cast<size_t>(k)] = nullptr;
      open_.Close(stream_[static_cast<size_t>(still_matched)], AtLeast(o_.min_length), result_);
    }
    open_.Close(std::numeric_limits<int>::max(), AtLeast(o_.min_length), result_);
  }

 private:
  const FrameImage& FrameOf(int k) const {
    return t_.input.images[static_cast<size_t>(stream_[static_cast<size_t>(k)])];
  }
  const BodyCamera& CameraOf(int k) const { return t_.input.cameras[static_cast<size_t>(FrameOf(k).camera)]; }
  const PreparedImage& Image(int k) const { return *window_[static_cast<size_t>(k)]; }

  Rigid3d CamFromOdom(int k) const {
    return CameraOf(k).cam_from_body * t_.input.odom_from_body[static_cast<size_t>(FrameOf(k).pose)].Inverse();
  }

  void Read(int begin, int end) {
    ParallelFor(end - begin, t_.threads, t_.cancel, [&](int64_t i) {
      const auto k = static_cast<size_t>(begin + i);
      window_[k] = PrepareImage(t_.input, stream_[k], paper_);
    });
    for (int k = begin; k < end; ++k) open_.AddImage(stream_[static_cast<size_t>(k)], Image(k).features.size());
  }

  void JoinConsecutive(int begin, int end) {
    std::vector<PairResult> consecutive(static_cast<size_t>(end - begin));
    ParallelFor(end - begin, t_.threads, t_.cancel, [&](int64_t i) {
      const int k = begin + static_cast<int>(i);
      if (k == 0) return;
      PairResult& out = consecutive[static_cast<size_t>(i)];
      out = paper_ ? MatchPaper(Image(k - 1), Image(k), o_) : MatchConsecutive(k);
      t_.progress.Advance(1);
    });
    for (int k = std::max(begin, 1); k < end; ++k) {
      const PairResult& r = consecutive[static_cast<size_t>(k - begin)];
      next_from_this_[static_cast<size_t>(k - 1)] = r.b_from_a;
      result_->odometry_contradicted += r.contradicted ? 1 : 0;
      Join(k - 1, k, r.matches);
    }
  }

  // An image with the one before it.
  PairResult MatchConsecutive(int k) const {
    const PreparedImage &a = Image(k - 1), &b = Image(k);
    const Rigid3d prior = CamFromOdom(k) * CamFromOdom(k - 1).Inverse();
    const Camera& camera = CameraOf(k).camera;
    const double focal = camera.MeanFocal();
    TwoViewOptions two;
    two.inlier_rad = o_.inlier_px / focal;
    two.sigma_rotation_rad = o_.sigma_rotation_deg * kDegToRad;
    two.sigma_direction_rad = o_.sigma_direction_deg * kDegToRad;
    two.seed = t_.seed + static_cast<uint64_t>(k);
    // First along the epipolar curves that odometry predicts: cheap, and blind to far-off repetitions. Where that finds
    // little, or the images contradict odometry, everything is compared with everything.
    const double epipolar_px = std::max(2 * o_.inlier_px, two.sigma_rotation_rad * focal);
    const Matches near = GuidedMatches(a, b, camera, prior, {epipolar_px, o_.min_depth_m, o_.ratio, o_.max_distance});
    TwoViewOptions trusting = two;
    trusting.min_prior_inliers = 0;
    PairResult out = Verified(a, b, near, prior, trusting);
    if (out.matches.size() < 100 || out.matches.size() < 0.6 * static_cast<double>(near.size())) {
      const Matches mutual = MatchMutual(a.descriptors, b.descriptors, o_.ratio, o_.max_distance);
      const PairResult all = Verified(a, b, WithoutCarrier(mutual, a.rays, b.rays, 1 / focal), prior, two);
      if (all.matches.size() > out.matches.size()) out = all;
    }
    if (static_cast<int>(out.matches.size()) < kLeastMatches) out.b_from_a = prior;
    return out;
  }

  // Wider gaps, guided by the refined poses.
  void JoinWide(int begin, int end) {
    struct Job {
      int a, b;
    };
    std::vector<Job> jobs;
    for (int gap : gaps_) {
      for (int k = std::max(begin, gap); k < end; ++k) jobs.push_back({k - gap, k});
    }
    std::vector<PairResult> wide(jobs.size());
    ParallelFor(static_cast<int64_t>(jobs.size()), t_.threads, t_.cancel, [&](int64_t i) {
      const Job job = jobs[static_cast<size_t>(i)];
      wide[static_cast<size_t>(i)] = MatchWide(job.a, job.b);
    });
    for (size_t i = 0; i < jobs.size(); ++i) {
      if (wide[i].matches.size() >= 8) Join(jobs[i].a, jobs[i].b, wide[i].matches);
    }
  }

  PairResult MatchWide(int ka, int kb) const {
    Rigid3d b_from_a;
    for (int k = ka; k < kb; ++k) b_from_a = next_from_this_[static_cast<size_t>(k)] * b_from_a;
    const PreparedImage &a = Image(ka), &b = Image(kb);
    const Camera& camera = CameraOf(kb).camera;
    const Matches matches =
        GuidedMatches(a, b, camera, b_from_a, {2 * o_.inlier_px, o_.min_depth_m, o_.guided_ratio, o_.max_distance});
    TwoViewOptions two;
    two.inlier_rad = o_.inlier_px / camera.MeanFocal();
    two.sigma_rotation_rad = 0.2 * kDegToRad * (kb - ka);
    two.sigma_direction_rad = 2 * kDegToRad;
    two.min_prior_inliers = 0;  // guided matches all lie near the prior: RANSAC has nothing to add
    return Verified(a, b, matches, b_from_a, two);
  }

  // Matches are joined in a fixed order, so that threads do not matter; short gaps first: they are the surest, and a
  // conflict keeps what is there.
  void Join(int ka, int kb, const Matches& matches) {
    const int a = stream_[static_cast<size_t>(ka)], b = stream_[static_cast<size_t>(kb)];
    const FeatureSet &of_a = Image(ka).features, &of_b = Image(kb).features;
    for (const auto& [fa, fb] : matches) {
      open_.Join({0, a, fa, of_a.points[static_cast<size_t>(fa)]}, {0, b, fb, of_b.points[static_cast<size_t>(fb)]});
    }
    result_->verified_matches += static_cast<int64_t>(matches.size());
    ++result_->pairs;
  }

  const Tracking& t_;
  const TrackOptions& o_;
  bool paper_;
  const std::vector<int>& stream_;
  std::vector<int> gaps_;
  std::vector<std::unique_ptr<PreparedImage>> window_;
  TrackTable open_;
  std::vector<Rigid3d> next_from_this_;  // refined relative poses, k -> k + 1
  TrackSet* result_;
};

}  // namespace

TrackSet BuildTracks(const LocalizeInput& input, const TrackOptions& options, int threads, uint64_t seed,
                     ProgressSink& progress, const CancelToken& cancel) {
  TrackSet result;
  const int n = static_cast<int>(input.images.size());
  // Each camera is a stream of its own.
  std::vector<std::vector<int>> streams(input.cameras.size());
  for (int i = 0; i < n; ++i) streams[static_cast<size_t>(input.images[static_cast<size_t>(i)].camera)].push_back(i);
  const Tracking tracking{input, options, threads, seed, progress, cancel};
  progress.Begin("matching", n);
  for (const std::vector<int>& stream : streams) StreamTracker(tracking, stream, &result).Track();
  return result;
}

}  // namespace trigpoint

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

}  // namespace

TrackSet BuildTracks(const LocalizeInput& input, const TrackOptions& options, int threads, uint64_t seed,
                     ProgressSink& progress, const CancelToken& cancel) {
  const bool paper = options.mode == "paper";
  TrackSet result;
  const int n = static_cast<int>(input.images.size());
  // Each camera is a stream of its own.
  std::vector<std::vector<int>> streams(input.cameras.size());
  for (int i = 0; i < n; ++i) streams[static_cast<size_t>(input.images[static_cast<size_t>(i)].camera)].push_back(i);

  const std::vector<int> gaps = paper ? std::vector<int>{} : Gaps(options.max_gap);
  const auto cam_from_odom = [&](int image) {
    const FrameImage& f = input.images[static_cast<size_t>(image)];
    return input.cameras[static_cast<size_t>(f.camera)].cam_from_body *
           input.odom_from_body[static_cast<size_t>(f.pose)].Inverse();
  };

  progress.Begin("matching", n);
  for (const std::vector<int>& stream : streams) {
    std::vector<std::unique_ptr<PreparedImage>> window(stream.size());
    TrackTable open;
    // Matches are joined in a fixed order, so that threads do not matter; short gaps first: they are the surest, and a
    // conflict keeps what is there.
    const auto join = [&](int ka, int kb, const Matches& matches) {
      const int a = stream[static_cast<size_t>(ka)], b = stream[static_cast<size_t>(kb)];
      const FeatureSet &of_a = window[static_cast<size_t>(ka)]->features,
                       &of_b = window[static_cast<size_t>(kb)]->features;
      for (const auto& [fa, fb] : matches) {
        open.Join({0, a, fa, of_a.points[static_cast<size_t>(fa)]}, {0, b, fb, of_b.points[static_cast<size_t>(fb)]});
      }
      result.verified_matches += static_cast<int64_t>(matches.size());
      ++result.pairs;
    };
    std::vector<Rigid3d> next_from_this(stream.size());  // refined relative poses, k -> k + 1
    constexpr int kBatch = 16;
    const int m = static_cast<int>(stream.size());
    for (int begin = 0; begin < m; begin += kBatch) {
      const int end = std::min(m, begin + kBatch);
      for (int k = begin; k < end; ++k) window[static_cast<size_t>(k)] = nullptr;
      ParallelFor(end - begin, threads, cancel, [&](int64_t k) {
        window[static_cast<size_t>(begin + k)] = PrepareImage(input, stream[static_cast<size_t>(begin + k)], paper);
      });
      for (int k = begin; k < end; ++k) {
        open.AddImage(stream[static_cast<size_t>(k)], window[static_cast<size_t>(k)]->features.size());
      }
      // Consecutive frames first: they refine the relative poses.
      std::vector<PairResult> consecutive(static_cast<size_t>(end - begin));
      ParallelFor(end - begin, threads, cancel, [&](int64_t i) {
        const int k = begin + static_cast<int>(i);
        if (k == 0) return;
        const PreparedImage &a = *window[static_cast<size_t>(k - 1)], &b = *window[static_cast<size_t>(k)];
        const int ia = stream[static_cast<size_t>(k - 1)], ib = stream[static_cast<size_t>(k)];
        const Rigid3d prior = cam_from_odom(ib) * cam_from_odom(ia).Inverse();
        PairResult& out = consecutive[static_cast<size_t>(i)];
        if (paper) {
          out = MatchPaper(a, b, options);
        } else {
          const double focal =
              input.cameras[static_cast<size_t>(input.images[static_cast<size_t>(ib)].camera)].camera.MeanFocal();
          TwoViewOptions two;
          two.inlier_rad = options.inlier_px / focal;
          two.sigma_rotation_rad = options.sigma_rotation_deg * kDegToRad;
          two.sigma_direction_rad = options.sigma_direction_deg * kDegToRad;
          two.seed = seed + static_cast<uint64_t>(k);
          // First along the epipolar curves that odometry predicts: cheap, and blind to far-off repetitions. Where
          // that finds little, or the images contradict odometry, everything is compared with everything.
          GuidedOptions guided;
          guided.epipolar_px = std::max(2 * options.inlier_px, two.sigma_rotation_rad * focal);
          guided.min_depth_m = options.min_depth_m;
          guided.ratio = options.ratio;
          guided.max_distance = options.max_distance;
          const Camera& camera =
              input.cameras[static_cast<size_t>(input.images[static_cast<size_t>(ib)].camera)].camera;
          const Matches near = MatchGuided(a.features, a.descriptors, a.rays, b.features, b.descriptors, b.rays,
                                           *b.grid, camera, prior, guided);
          TwoViewOptions trusting = two;
          trusting.min_prior_inliers = 0;
          out = Verified(a, b, near, prior, trusting);
          if (out.matches.size() < 100 || out.matches.size() < 0.6 * static_cast<double>(near.size())) {
            const PairResult all = Verified(
                a, b, MatchMutual(a.descriptors, b.descriptors, options.ratio, options.max_distance), prior, two);
            if (all.matches.size() > out.matches.size()) out = all;
          }
          if (static_cast<int>(out.matches.size()) < kLeastMatches) out.b_from_a = prior;
        }
        progress.Advance(1);
      });
      for (int k = std::max(begin, 1); k < end; ++k) {
        PairResult& r = consecutive[static_cast<size_t>(k - begin)];
        next_from_this[static_cast<size_t>(k - 1)] = r.b_from_a;
        result.odometry_contradicted += r.contradicted ? 1 : 0;
        join(k - 1, k, r.matches);
      }
      // Wider gaps, guided by the refined poses.
      struct Job {
        int a, b;
      };
      std::vector<Job> jobs;
      for (int gap : gaps) {
        for (int k = std::max(begin, gap); k < end; ++k) jobs.push_back({k - gap, k});
      }
      std::vector<PairResult> wide(jobs.size());
      ParallelFor(static_cast<int64_t>(jobs.size()), threads, cancel, [&](int64_t i) {
        const Job job = jobs[static_cast<size_t>(i)];
        Rigid3d b_from_a;
        for (int k = job.a; k < job.b; ++k) b_from_a = next_from_this[static_cast<size_t>(k)] * b_from_a;
        const PreparedImage &a = *window[static_cast<size_t>(job.a)], &b = *window[static_cast<size_t>(job.b)];
        const int ib = stream[static_cast<size_t>(job.b)];
        const Camera& camera = input.cameras[static_cast<size_t>(input.images[static_cast<size_t>(ib)].camera)].camera;
        GuidedOptions guided;
        guided.epipolar_px = 2 * options.inlier_px;
        guided.min_depth_m = options.min_depth_m;
        guided.ratio = options.guided_ratio;
        guided.max_distance = options.max_distance;
        const Matches matches = MatchGuided(a.features, a.descriptors, a.rays, b.features, b.descriptors, b.rays,
                                            *b.grid, camera, b_from_a, guided);
        TwoViewOptions two;
        two.inlier_rad = options.inlier_px / camera.MeanFocal();
        two.sigma_rotation_rad = 0.2 * kDegToRad * (job.b - job.a);
        two.sigma_direction_rad = 2 * kDegToRad;
        two.min_prior_inliers = 0;  // guided matches all lie near the prior: RANSAC has nothing to add
        wide[static_cast<size_t>(i)] = Verified(a, b, matches, b_from_a, two);
      });
      for (size_t i = 0; i < jobs.size(); ++i) {
        if (wide[i].matches.size() < 8) continue;
        join(jobs[i].a, jobs[i].b, wide[i].matches);
      }
      const int still_matched = std::max(0, end - std::max(1, options.max_gap));
      for (int k = 0; k < still_matched; ++k) window[static_cast<size_t>(k)] = nullptr;
      open.Close(stream[static_cast<size_t>(still_matched)], AtLeast(options.min_length), &result);
    }
    open.Close(std::numeric_limits<int>::max(), AtLeast(options.min_length), &result);
  }
  return result;
}

}  // namespace trigpoint

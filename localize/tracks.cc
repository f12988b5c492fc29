#include "localize/tracks.h"

#include <algorithm>
#include <memory>
#include <numeric>
#include <unordered_map>

#include "calib/base/parallel.h"
#include "calib/geo/geodetic.h"
#include "localize/two_view.h"

namespace trigpoint {
namespace {

struct Prepared {
  FeatureSet features;
  DescriptorBlock descriptors;
  std::vector<Eigen::Vector3d> rays;
  std::unique_ptr<FeatureGrid> grid;
};

std::unique_ptr<Prepared> Prepare(const LocalizeInput& input, int image, bool paper) {
  auto p = std::make_unique<Prepared>();
  p->features = input.image_features(image);
  const Camera& camera = input.cameras[static_cast<size_t>(input.images[static_cast<size_t>(image)].camera)].camera;
  if (!paper) p->descriptors = DescriptorBlock(p->features.descriptors);
  p->rays.reserve(p->features.size());
  for (const Eigen::Vector2f& pixel : p->features.points) {
    p->rays.push_back(camera.Unproject(pixel.cast<double>()).value_or(Eigen::Vector3d(0, 0, -1)));
  }
  p->grid = std::make_unique<FeatureGrid>(p->features.points, camera.width(), camera.height(), 12.0F);
  return p;
}

// Union-find over (image, feature), refusing unions that would put two features of one image into a track.
class TrackForest {
 public:
  explicit TrackForest(std::vector<int64_t> offsets) : offsets_(std::move(offsets)) {
    parent_.resize(static_cast<size_t>(offsets_.back()));
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  int64_t Node(int image, int feature) const { return offsets_[static_cast<size_t>(image)] + feature; }
  int64_t Root(int64_t n) {
    while (parent_[static_cast<size_t>(n)] != n) {
      parent_[static_cast<size_t>(n)] = parent_[static_cast<size_t>(parent_[static_cast<size_t>(n)])];
      n = parent_[static_cast<size_t>(n)];
    }
    return n;
  }
  void Union(int image_a, int feature_a, int image_b, int feature_b) {
    int64_t a = Root(Node(image_a, feature_a)), b = Root(Node(image_b, feature_b));
    if (a == b) return;
    std::vector<int>& ia = Images(a, image_a);
    std::vector<int>& ib = Images(b, image_b);
    std::vector<int> merged;
    merged.reserve(ia.size() + ib.size());
    std::merge(ia.begin(), ia.end(), ib.begin(), ib.end(), std::back_inserter(merged));
    if (std::adjacent_find(merged.begin(), merged.end()) != merged.end()) return;
    images_.erase(b);
    parent_[static_cast<size_t>(b)] = a;
    images_[a] = std::move(merged);
  }

 private:
  // A fresh node is the track of its own image.
  std::vector<int>& Images(int64_t root, int image) {
    const auto [it, fresh] = images_.try_emplace(root);
    if (fresh) it->second.push_back(image);
    return it->second;
  }
  std::vector<int64_t> offsets_;
  std::vector<int64_t> parent_;
  std::unordered_map<int64_t, std::vector<int>> images_;
};

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

PairResult MatchPaper(const Prepared& a, const Prepared& b, const TrackOptions& o) {
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

PairResult Verified(const Prepared& a, const Prepared& b, const Matches& matches, const Rigid3d& prior,
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

  // Matches of all pairs, in a fixed order; the forest is built afterwards, so that threads do not matter.
  struct Pair {
    int a, b;  // images, a before b
    Matches matches;
  };
  std::vector<Pair> pairs;
  std::vector<int64_t> offsets(static_cast<size_t>(n) + 1, 0);
  std::vector<std::vector<Eigen::Vector2f>> pixels(static_cast<size_t>(n));
  progress.Begin("matching", n);
  for (const std::vector<int>& stream : streams) {
    std::vector<std::unique_ptr<Prepared>> window(stream.size());
    std::vector<Rigid3d> next_from_this(stream.size());  // refined relative poses, k -> k + 1
    constexpr int kBatch = 16;
    const int m = static_cast<int>(stream.size());
    for (int begin = 0; begin < m; begin += kBatch) {
      const int end = std::min(m, begin + kBatch);
      for (int k = begin; k < end; ++k) window[static_cast<size_t>(k)] = nullptr;
      ParallelFor(end - begin, threads, cancel, [&](int64_t k) {
        window[static_cast<size_t>(begin + k)] = Prepare(input, stream[static_cast<size_t>(begin + k)], paper);
      });
      for (int k = begin; k < end; ++k) {
        const size_t image = static_cast<size_t>(stream[static_cast<size_t>(k)]);
        pixels[image] = window[static_cast<size_t>(k)]->features.points;
        offsets[image + 1] = static_cast<int64_t>(pixels[image].size());
      }
      // Consecutive frames first: they refine the relative poses.
      std::vector<PairResult> consecutive(static_cast<size_t>(end - begin));
      ParallelFor(end - begin, threads, cancel, [&](int64_t i) {
        const int k = begin + static_cast<int>(i);
        if (k == 0) return;
        const Prepared &a = *window[static_cast<size_t>(k - 1)], &b = *window[static_cast<size_t>(k)];
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
          if (out.matches.size() < 12) out.b_from_a = prior;
        }
        progress.Advance(1);
      });
      for (int k = std::max(begin, 1); k < end; ++k) {
        PairResult& r = consecutive[static_cast<size_t>(k - begin)];
        next_from_this[static_cast<size_t>(k - 1)] = r.b_from_a;
        result.odometry_contradicted += r.contradicted ? 1 : 0;
        pairs.push_back({stream[static_cast<size_t>(k - 1)], stream[static_cast<size_t>(k)], std::move(r.matches)});
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
        const Prepared &a = *window[static_cast<size_t>(job.a)], &b = *window[static_cast<size_t>(job.b)];
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
        pairs.push_back({stream[static_cast<size_t>(jobs[i].a)], stream[static_cast<size_t>(jobs[i].b)],
                         std::move(wide[i].matches)});
      }
      for (int k = 0; k < end - std::max(1, options.max_gap); ++k) window[static_cast<size_t>(k)] = nullptr;
    }
  }
  for (size_t i = 1; i < offsets.size(); ++i) offsets[i] += offsets[i - 1];
  // Short gaps first: their matches are the surest, and a conflict keeps what is there.
  std::stable_sort(pairs.begin(), pairs.end(), [](const Pair& x, const Pair& y) { return x.b - x.a < y.b - y.a; });
  TrackForest forest(offsets);
  for (const Pair& pair : pairs) {
    result.verified_matches += static_cast<int64_t>(pair.matches.size());
    ++result.pairs;
    for (const auto& [fa, fb] : pair.matches) forest.Union(pair.a, fa, pair.b, fb);
  }
  // Number the tracks by their first observation and keep the long ones.
  std::vector<std::pair<int64_t, std::pair<int, int>>> members;
  for (const Pair& pair : pairs) {
    for (const auto& [fa, fb] : pair.matches) {
      members.push_back({forest.Root(forest.Node(pair.a, fa)), {pair.a, fa}});
      members.push_back({forest.Root(forest.Node(pair.b, fb)), {pair.b, fb}});
    }
  }
  pairs.clear();
  std::sort(members.begin(), members.end());
  members.erase(std::unique(members.begin(), members.end()), members.end());
  for (size_t i = 0; i < members.size();) {
    size_t end = i;
    while (end < members.size() && members[end].first == members[i].first) ++end;
    // A refused union leaves a feature in a track of another root; a track never holds an image twice.
    if (end - i >= static_cast<size_t>(options.min_length)) {
      for (size_t k = i; k < end; ++k) {
        const auto [image, feature] = members[k].second;
        result.observations.push_back(
            {result.tracks, image, feature, pixels[static_cast<size_t>(image)][static_cast<size_t>(feature)]});
      }
      ++result.tracks;
    }
    i = end;
  }
  return result;
}

}  // namespace trigpoint

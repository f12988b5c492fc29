#include "localize/site/link_runs.h"

#include <algorithm>
#include <map>

#include "calib/geo/geodetic.h"
#include "calib/geometry/bearing.h"

namespace trigpoint {
namespace {

// A link: how an image lies in the frame of the runs before, and where it was before.
struct Link {
  LoopQuery query;
  const Registration* answer = nullptr;
  Rigid3d body_from_world;  // by the link
  Rigid3d predicted;        // as placed
};

class Linker {
 public:
  Linker(const JoinedRuns& joined, const LinkOptions& options)
      : j_(joined), o_(options), travelled_(PathToImages(joined.input, joined.reconstruction.problem.poses)) {
    const std::vector<FrameImage>& images = joined.input.images;
    for (size_t i = 0; i < images.size(); ++i) {
      const Rigid3d cam_from_world = CamFromBody(images[i]) * BodyFromWorld(images[i]);
      centres_.push_back(cam_from_world.TargetOriginInSource());
      axes_.push_back(cam_from_world.rotation.conjugate() * Eigen::Vector3d::UnitZ());
    }
  }

  std::vector<LoopQuery> Queries() const {
    std::vector<LoopQuery> queries;
    size_t begin = 0;  // of the run
    double last = 0;
    for (size_t i = 0; i < centres_.size(); ++i) {
      if (i > 0 && Run(i) != Run(i - 1)) begin = i, last = -o_.spacing_m;
      if (begin == 0 || travelled_[i] - last < o_.spacing_m) continue;
      LoopQuery query;
      query.image = static_cast<int>(i);
      query.candidates = Candidates(i, begin);
      // Of images before this path those of the other runs are in reach.
      query.latest_m = 0.5 * (travelled_[begin - 1] + travelled_[begin]);
      if (query.candidates.empty()) continue;
      queries.push_back(std::move(query));
      last = travelled_[i];
    }
    return queries;
  }

  Link MakeLink(const LoopQuery& query, const Registration& answer) const {
    const FrameImage& image = j_.input.images[static_cast<size_t>(query.image)];
    return {query, &answer, CamFromBody(image).Inverse() * answer.rig_from_odom, BodyFromWorld(image)};
  }

  // The run's offset that one link has found, applied to the other.
  static bool Agree(const Link& a, const Link& b) {
    constexpr double kDrift_m = 0.3, kDrift_deg = 1.5;
    const Rigid3d by_a = b.predicted * a.predicted.Inverse() * a.body_from_world;
    return (by_a.TargetOriginInSource() - b.body_from_world.TargetOriginInSource()).norm() < kDrift_m &&
           AngleBetween(by_a.rotation, b.body_from_world.rotation) < kDrift_deg * kDegToRad;
  }

  int Run(size_t image) const { return j_.run_of_image[image]; }

  PoseFactor FactorOf(const Link& link) const {
    PoseFactor f;
    f.a = j_.input.images[static_cast<size_t>(link.query.candidates.front())].pose;
    f.b = j_.input.images[static_cast<size_t>(link.query.image)].pose;
    f.kind = PoseFactor::Kind::kBetween;
    f.measured = j_.reconstruction.problem.poses[static_cast<size_t>(f.a)] * link.body_from_world.Inverse();
    f.sqrt_info = Vector6d(Vector6d::Constant(1 / 0.02)).asDiagonal();
    f.sqrt_info.topLeftCorner<3, 3>() *= 0.02 / (0.1 * kDegToRad);
    return f;
  }

 private:
  const Rigid3d& CamFromBody(const FrameImage& image) const {
    return j_.input.cameras[static_cast<size_t>(image.camera)].cam_from_body;
  }
  const Rigid3d& BodyFromWorld(const FrameImage& image) const {
    return j_.reconstruction.problem.poses[static_cast<size_t>(image.pose)];
  }
  // The nearest images before `end` that look the same way, apart from each other, all of one run: others may lie a
  // little off still.
  std::vector<int> Candidates(size_t image, size_t end) const {
    std::vector<std::pair<double, int>> near;
    for (size_t k = 0; k < end; ++k) {
      const double distance = (centres_[k] - centres_[image]).norm();
      if (distance < o_.radius_m && AngleBetween(axes_[k], axes_[image]) < o_.angle_deg * kDegToRad) {
        near.emplace_back(distance, static_cast<int>(k));
      }
    }
    std::sort(near.begin(), near.end());
    std::vector<int> candidates;
    for (const auto& [distance, k] : near) {
      if (Run(static_cast<size_t>(k)) != Run(static_cast<size_t>(near.front().second))) continue;
      const bool close =
          std::any_of(candidates.begin(), candidates.end(), [k = k](int c) { return std::abs(k - c) < 2; });
      if (!close) candidates.push_back(k);
      if (static_cast<int>(candidates.size()) >= o_.candidates) break;
    }
    return candidates;
  }

  const JoinedRuns& j_;
  const LinkOptions& o_;
  std::vector<Eigen::Vector3d> centres_, axes_;
  std::vector<double> travelled_;  // over all runs
};

// The point of each feature of the images that are linked.
std::map<std::pair<int, int>, int> PointsOf(const JoinedRuns& joined, const std::vector<Link>& links) {
  std::vector<bool> linked(joined.input.images.size(), false);
  for (const Link& link : links) linked[static_cast<size_t>(link.query.image)] = true;
  std::map<std::pair<int, int>, int> points;
  const Reconstruction& r = joined.reconstruction;
  for (size_t k = 0; k < r.image_of.size(); ++k) {
    const BearingObservation& o = r.problem.observations[k];
    if (r.image_of[k] < 0 || !linked[static_cast<size_t>(r.image_of[k])] || !o.active) continue;
    points[{r.image_of[k], r.feature_of[k]}] = o.point;
  }
  return points;
}

}  // namespace

RunLinks LinkRuns(const JoinedRuns& joined, const LinkOptions& options, const RegistrationOptions& registration,
                  int threads, uint64_t seed, ProgressSink& progress, const CancelToken& cancel) {
  RunLinks out;
  if (!options.images) return out;
  const Linker linker(joined, options);
  const std::vector<LoopQuery> queries = linker.Queries();
  out.tried = static_cast<int>(queries.size());
  if (queries.empty()) return out;
  const std::vector<Registration> answers =
      RegisterImages(joined.input, joined.reconstruction, queries, registration, threads, seed, progress, cancel);
  std::vector<Link> found, links;
  for (size_t q = 0; q < queries.size(); ++q) {
    if (answers[q].status == AnswerStatus::kLocalized) found.push_back(linker.MakeLink(queries[q], answers[q]));
  }
  out.found = static_cast<int>(found.size());
  for (const Link& a : found) {
    const auto run = [&](const Link& link) { return linker.Run(static_cast<size_t>(link.query.image)); };
    int agreeing = -1, others = -1;  // not itself
    for (const Link& b : found) {
      if (run(a) != run(b)) continue;
      ++others;
      agreeing += Linker::Agree(a, b) ? 1 : 0;
    }
    // Odometry bends a run, so that links far apart need not agree; most of a run's links do.
    if (agreeing >= options.min_agreeing && 3 * agreeing >= others) links.push_back(a);
  }
  out.refused = out.found - static_cast<int>(links.size());
  const std::map<std::pair<int, int>, int> points = PointsOf(joined, links);
  for (const Link& link : links) {
    out.factors.push_back(linker.FactorOf(link));
    for (const ViewObservation& v : link.answer->inliers) {
      const auto own = points.find({link.query.image, v.feature});
      if (own != points.end() && own->second != v.point) out.pairs.emplace_back(v.point, own->second);
    }
  }
  return out;
}

}  // namespace trigpoint

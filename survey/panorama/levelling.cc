#include "survey/panorama/levelling.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "calib/base/error.h"
#include "calib/base/parallel.h"
#include "calib/camera/shrunk_picture.h"
#include "calib/geo/geodetic.h"

namespace trigpoint {
namespace {

// Farthest the vertical may be from the photos' own top: where they look all round, and where they look one way (or
// back to back), so that nothing says how far up they look.
constexpr double kFromTop = 12 * kDegToRad, kFromTopOneWay = 25 * kDegToRad;
// Any other vertical this far away must explain the edges worse than the chosen one, by this factor; by the second
// where many more are looked at.
constexpr double kOtherVertical = 5 * kDegToRad, kStandsOut = 1.5, kStandsOutOneWay = 2;

// 1 sigma of how far up or down a camera is held that should be level.
constexpr double kPitchSigma = 8 * kDegToRad;
// Shortest edges used, share of the picture; fisheyes bend them, and what is found are pieces.
constexpr double kShortEdge = 0.05, kShortArc = 0.03;

struct Level {
  bool found = false;
  Eigen::Vector3d up = -Eigen::Vector3d::UnitY();
  double sigma_rad = 0;
};

// Pitch and roll that the cameras wrote: linear in the vertical.
Level FromTags(const StitchedRig& rig) {
  Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  std::vector<std::pair<Eigen::Vector3d, double>> rows;
  for (size_t i = 0; i < rig.photos.size(); ++i) {
    const RigPhoto& p = rig.state.photos[i];
    const PhotoTilt& m = rig.photos[i].tilt;
    if (!p.placed || !m.pitch_deg) continue;
    const Eigen::Vector3d up_in_cam =
        WorldFromCamRotation({0, *m.pitch_deg * kDegToRad, m.roll_deg.value_or(0) * kDegToRad}).conjugate() *
        Eigen::Vector3d::UnitZ();
    rows.emplace_back(p.cam_from_rig.conjugate() * Eigen::Vector3d::UnitZ(), up_in_cam.z());
    if (m.roll_deg) rows.emplace_back(p.cam_from_rig.conjugate() * Eigen::Vector3d::UnitX(), up_in_cam.x());
  }
  for (const auto& [row, value] : rows) {
    h += row * row.transpose();
    g += row * value;
  }
  Level level;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(h);
  if (rows.size() < 3 || eigen.eigenvalues()(1) < 0.02 * h.trace()) return level;
  // The third direction, where the rows leave it open, follows from the length of one.
  Eigen::Vector3d up =
      eigen.eigenvalues()(0) > 0.02 * h.trace() ? Eigen::Vector3d(h.ldlt().solve(g)) : Eigen::Vector3d::Zero();
  if (up.isZero()) {
    for (int k = 1; k < 3; ++k) {
      const Eigen::Vector3d e = eigen.eigenvectors().col(k);
      up += e * (e.dot(g) / eigen.eigenvalues()(k));
    }
    const Eigen::Vector3d e = eigen.eigenvectors().col(0);
    const double rest = std::sqrt(std::max(0.0, 1 - up.squaredNorm()));
    up += e * (e.dot(UpFromPhotos(rig.state)) > 0 ? rest : -rest);
  }
  double sum = 0;
  for (const auto& [row, value] : rows) sum += std::pow(row.dot(up) - value, 2);
  level.found = up.norm() > 0.5;
  level.up = up.normalized();
  // Sensors are off by some tenths of a degree, all photos alike.
  level.sigma_rad = std::hypot(std::sqrt(sum) / static_cast<double>(rows.size()), 0.2 * kDegToRad);
  return level;
}

Level FromHorizon(const StitchedRig& rig) {
  Level level;
  level.found = true;
  level.up = UpFromPhotos(rig.state);
  double sum = 0;
  int n = 0;
  for (const RigPhoto& p : rig.state.photos) {
    if (!p.placed) continue;
    sum += std::pow((p.cam_from_rig.conjugate() * Eigen::Vector3d::UnitX()).dot(level.up), 2);
    ++n;
  }
  // The scatter of the photos' roll; a handful tells little of it.
  level.sigma_rad = std::sqrt((sum + 2 * std::pow(2 * kDegToRad, 2)) / (n + 2) * 2 / std::max(1, n));
  // Photos that look one way, or back to back, say nothing of how far up they look.
  const double across = std::pow(std::sin(kPitchSigma), 2) / std::max(1e-12, LookAround(rig.state));
  level.sigma_rad = std::hypot(level.sigma_rad, kPitchSigma * std::min(1.0, across));
  return level;
}

struct Edge {
  Eigen::Vector3d normal;  // of the plane through the centre, rig frame
  double weight;           // length, as a share of the picture
  int photo;
};

std::vector<Edge> EdgesOf(const StitchedRig& rig, int photo, const cv::Mat& grey) {
  const ShrunkPicture small(grey, 1000);
  std::vector<cv::Vec4f> lines;
  cv::createLineSegmentDetector()->detect(small.picture, lines);
  const PairView& view = rig.views[static_cast<size_t>(photo)];
  const RigPhoto& p = rig.state.photos[static_cast<size_t>(photo)];
  const Lens& lens = rig.state.lenses[static_cast<size_t>(p.lens)];
  std::vector<Edge> edges;
  for (const cv::Vec4f& l : lines) {
    const double length = std::hypot(l[2] - l[0], l[3] - l[1]) / std::max(small.picture.cols, small.picture.rows);
    if (length < (lens.fisheye ? kShortArc : kShortEdge)) continue;
    // What a mask hides, and the rim of a fisheye's circle, are no edges of the place.
    if (view.Depth(small.ToFull({0.5 * (l[0] + l[2]), 0.5 * (l[1] + l[3])})) < 0) continue;
    const auto ray = [&](float x, float y) -> Eigen::Vector3d {
      return p.cam_from_rig.conjugate() * RayOfPixel(view, lens, small.ToFull({x, y}));
    };
    const Eigen::Vector3d normal = ray(l[0], l[1]).cross(ray(l[2], l[3]));
    if (normal.norm() > 1e-6) edges.push_back({normal.normalized(), length, photo});
  }
  return edges;
}

// The photos' own top, about which the vertical is looked for.
struct Top {
  explicit Top(const RigState& state) : up(UpFromPhotos(state)), one_way(LookAround(state) < kOneWay) {}
  double Reach() const { return one_way ? kFromTopOneWay : kFromTop; }
  bool IsFar(const Eigen::Vector3d& vertical) const { return vertical.dot(up) < std::cos(Reach()); }

  Eigen::Vector3d up;
  bool one_way;
};

// How much of the edges runs along a direction.
double Support(const std::vector<Edge>& edges, const Eigen::Vector3d& up) {
  double sum = 0;
  for (const Edge& e : edges) {
    const double r = e.normal.dot(up) / 0.01;
    if (std::abs(r) < 1) sum += e.weight * (1 - r * r);
  }
  return sum;
}

// The direction that most edges run along: every pair of well separated ones is a candidate, a few hundred of them.
// Nothing if another one does nearly as well. Sorts the edges, the longest first.
std::optional<Eigen::Vector3d> CommonDirection(const Top& top, std::vector<Edge>* edges) {
  std::vector<std::pair<Eigen::Vector3d, double>> candidates = {{top.up, Support(*edges, top.up)}};
  std::stable_sort(edges->begin(), edges->end(), [](const Edge& a, const Edge& b) { return a.weight > b.weight; });
  const size_t lead = std::min<size_t>(edges->size(), 60);
  for (size_t a = 0; a < lead; ++a) {
    for (size_t b = a + 1; b < lead; ++b) {
      Eigen::Vector3d up = (*edges)[a].normal.cross((*edges)[b].normal);
      if (up.norm() < 0.3) continue;
      up.normalize();
      if (up.dot(top.up) < 0) up = -up;
      if (!top.IsFar(up)) candidates.emplace_back(up, Support(*edges, up));
    }
  }
  const auto better = [](const auto& a, const auto& b) { return a.second < b.second; };
  const auto& [best, best_score] = *std::max_element(candidates.begin(), candidates.end(), better);
  double other_score = 0;
  for (const auto& [up, s] : candidates) {
    if (up.dot(best) < std::cos(kOtherVertical)) other_score = std::max(other_score, s);
  }
  if (best_score < (top.one_way ? kStandsOutOneWay : kStandsOut) * other_score) return std::nullopt;
  return best;
}

// Robust least squares of normal . up = 0 in the tangent plane of `best`.
Level FitVertical(const std::vector<Edge>& edges, const Top& top, Eigen::Vector3d best) {
  Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
  double residual = 0, weights = 0;
  int used = 0;
  for (int round = 0; round < 20; ++round) {
    h.setZero();
    residual = weights = 0;
    used = 0;
    for (const Edge& e : edges) {
      const double r = e.normal.dot(best) / 0.006;
      if (std::abs(r) > 3) continue;
      const double w = e.weight / std::pow(1 + r * r, 2);
      h += w * e.normal * e.normal.transpose();
      residual += w * std::pow(e.normal.dot(best), 2);
      weights += w;
      ++used;
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(h);
    Eigen::Vector3d up = eigen.eigenvectors().col(0);
    if (up.dot(top.up) < 0) up = -up;
    const bool still = (up - best).norm() < 1e-9;
    best = up;
    if (still) break;
  }
  Level level;
  if (used < 15 || top.IsFar(best)) return level;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(h);
  if (eigen.eigenvalues()(1) < 0.03 * h.trace()) return level;  // all edges in one direction: no hold across it
  level.found = true;
  level.up = best;
  // Edges of one building share its lean: they count as one in five.
  level.sigma_rad = std::hypot(std::sqrt(residual / weights / (used / 5.0) * weights / (2 * eigen.eigenvalues()(1))),
                               0.05 * kDegToRad);
  return level;
}

Level FromLines(const StitchedRig& rig, const std::function<cv::Mat(const Photo&)>& load_grey, int threads,
                const CancelToken& cancel) {
  std::vector<std::vector<Edge>> of_photo(rig.photos.size());
  ParallelFor(static_cast<int64_t>(rig.photos.size()), threads, cancel, [&](int64_t i) {
    if (!rig.state.photos[static_cast<size_t>(i)].placed) return;
    of_photo[static_cast<size_t>(i)] = EdgesOf(rig, static_cast<int>(i), load_grey(rig.photos[static_cast<size_t>(i)]));
  });
  const Top top(rig.state);
  std::vector<Edge> edges;
  for (const auto& list : of_photo) {
    for (const Edge& e : list) {
      if (std::abs(e.normal.dot(top.up)) < std::sin(top.Reach())) edges.push_back(e);
    }
  }
  if (edges.size() < 20) return {};
  const std::optional<Eigen::Vector3d> common = CommonDirection(top, &edges);
  return common ? FitVertical(edges, top, *common) : Level();
}

// Heading of the rig's z axis from compass tags.
void HeadingFromTags(StitchedRig* rig) {
  std::vector<double> said;
  for (size_t i = 0; i < rig->photos.size(); ++i) {
    const RigPhoto& p = rig->state.photos[i];
    const auto& heading = rig->photos[i].metadata.heading_deg;
    if (!p.placed || !heading) continue;
    const Eigen::Vector3d look = p.cam_from_rig.conjugate() * Eigen::Vector3d::UnitZ();
    if (std::hypot(look.x(), look.z()) < 0.3) continue;
    said.push_back(*heading * kDegToRad - std::atan2(look.x(), look.z()));
  }
  if (said.empty()) return;
  // The angle with the smallest sum of distances to all: a median on the circle.
  double best = 0, least = 1e300;
  for (double candidate : said) {
    double sum = 0;
    for (double s : said) sum += std::abs(WrapAngle(s - candidate));
    if (sum < least) least = sum, best = candidate;
  }
  double offset = 0;
  int used = 0;
  const double limit = std::max(5 * kDegToRad, 3 * least / static_cast<double>(said.size()));
  double square = 0;
  for (double s : said) {
    const double d = WrapAngle(s - best);
    if (std::abs(d) > limit) continue;
    offset += d, square += d * d, ++used;
  }
  const double mean = offset / used;
  const double scatter = std::sqrt(std::max(0.0, square / used - mean * mean));
  const double heading = best + mean;
  rig->heading_rad = heading - 2 * std::numbers::pi * std::floor(heading / (2 * std::numbers::pi));
  // A phone's compass is off by some degrees whatever its readings' scatter.
  rig->heading_sigma_rad = std::hypot(scatter / std::sqrt(used), 5 * kDegToRad);
  rig->heading_source = "compass";
}

// The vertical by the wanted source, or the next best one, which the rig is told.
Level FindLevel(const std::function<cv::Mat(const Photo&)>& load_grey, const std::string& wanted, int threads,
                const CancelToken& cancel, StitchedRig* rig) {
  Level level;
  rig->level_source = "none";
  if (wanted == "auto" || wanted == "tags") {
    level = FromTags(*rig);
    if (level.found) rig->level_source = "tags";
    if (wanted == "tags" && !level.found)
      rig->warnings.push_back("no photo has pitch and roll; levelled by the horizon");
  }
  if (!level.found && (wanted == "auto" || wanted == "lines")) {
    level = FromLines(*rig, load_grey, threads, cancel);
    if (level.found) rig->level_source = "lines";
    if (wanted == "lines" && !level.found) rig->warnings.push_back("too few vertical edges; levelled by the horizon");
  }
  if (!level.found && wanted != "none") {
    level = FromHorizon(*rig);
    rig->level_source = "horizon";
  }
  return level;
}

// new_from_old: y down, z as far as possible forward.
Eigen::Quaterniond LevelFrame(const Eigen::Vector3d& up, const Eigen::Vector3d& forward) {
  Eigen::Matrix3d m;  // rows: the new axes in the old frame
  const Eigen::Vector3d y = -up;
  Eigen::Vector3d z = forward - y * y.dot(forward);
  if (z.norm() < 1e-3) z = y.unitOrthogonal();
  m.row(2) = z.normalized();
  m.row(1) = y;
  m.row(0) = y.cross(z.normalized());
  return Eigen::Quaterniond(m);
}

struct Gap {
  double width_deg = 0;
  double azimuth_rad = 0;  // of its middle
};

// The widest range of azimuths that no photo sees.
Gap WidestGap(const StitchedRig& rig) {
  std::vector<bool> covered(3600, false);
  for (size_t i = 0; i < rig.photos.size(); ++i) {
    const RigPhoto& p = rig.state.photos[i];
    if (!p.placed) continue;
    const PairView& v = rig.views[i];
    const Lens& lens = rig.state.lenses[static_cast<size_t>(p.lens)];
    for (double x = 0; x <= 1; x += 1.0 / 256) {
      for (double y : {0.1, 0.5, 0.9}) {
        const Eigen::Vector2d pixel(x * (v.width - 1), y * (v.height - 1));
        if (v.circle && v.Depth(pixel) < 0) continue;
        const Eigen::Vector3d ray = p.cam_from_rig.conjugate() * RayOfPixel(v, lens, pixel);
        const int at = static_cast<int>((std::atan2(ray.x(), ray.z()) / (2 * std::numbers::pi) + 0.5) * 3600);
        for (int d = -8; d <= 8; ++d) covered[static_cast<size_t>((at + d + 7200) % 3600)] = true;
      }
    }
  }
  int widest = 0, middle = 0, run = 0;
  for (int k = 0; k < 7200; ++k) {
    run = covered[static_cast<size_t>(k % 3600)] ? 0 : run + 1;
    if (run > widest && run <= 3600) widest = run, middle = k - run / 2;
  }
  return {widest * 0.1, ((middle % 3600) / 3600.0 - 0.5) * 2 * std::numbers::pi};
}

}  // namespace

void LevelRig(const std::function<cv::Mat(const Photo&)>& load_grey, const std::string& wanted, int threads,
              const CancelToken& cancel, StitchedRig* rig) {
  const Level level = FindLevel(load_grey, wanted, threads, cancel, rig);
  if (level.found) rig->level_sigma_deg = level.sigma_rad * kRadToDeg;
  size_t first = 0;
  while (first < rig->photos.size() && !rig->state.photos[first].placed) ++first;
  const Eigen::Quaterniond rig_from_first = rig->state.photos[first].cam_from_rig.conjugate();
  const Eigen::Vector3d up = level.found ? level.up : Eigen::Vector3d(rig_from_first * -Eigen::Vector3d::UnitY());
  TurnRig(LevelFrame(up, rig_from_first * Eigen::Vector3d::UnitZ()), &rig->state);
  // The panorama's centre looks away from the widest gap.
  const Gap gap = WidestGap(*rig);
  rig->closure.largest_gap_deg = gap.width_deg;
  if (gap.width_deg > 0) {
    const Eigen::Vector3d away(-std::sin(gap.azimuth_rad), 0, -std::cos(gap.azimuth_rad));
    TurnRig(LevelFrame(-Eigen::Vector3d::UnitY(), away), &rig->state);
  }
  HeadingFromTags(rig);
}

}  // namespace trigpoint

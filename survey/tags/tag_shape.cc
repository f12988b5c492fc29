#include "survey/tags/tag_shape.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

#include "calib/base/median.h"
#include "calib/estimation/huber_by_median.h"

namespace trigpoint {
namespace {

constexpr int kLeastImages = 4;
constexpr double kSigmas = 5;             // cameras are held, so that sigmas are a little too small
constexpr double kLeastSizeError = 0.02;  // printers and rulers are no worse
constexpr double kLeastBend = 0.02;       // of the edge
constexpr double kHuberChi2 = 15.5;

using Vector9d = Eigen::Matrix<double, 9, 1>;
using Matrix9d = Eigen::Matrix<double, 9, 9>;
using Matrix89d = Eigen::Matrix<double, 8, 9>;

struct Shape {
  Rigid3d world_from_tag;
  Eigen::Vector3d extra = Eigen::Vector3d::Zero();  // log size ratio, log aspect, twist / edge
};

Eigen::Vector3d Corner(double size_m, int k, const Eigen::Vector3d& extra) {
  Eigen::Vector3d c = TagCorner(size_m, k);
  c.x() *= std::exp(extra(0) - 0.5 * extra(1));
  c.y() *= std::exp(extra(0) + 0.5 * extra(1));
  c.z() = (k % 2 == 0 ? 1 : -1) * extra(2) * size_m;
  return c;
}

Vector8d Residual(const TagSight& sight, const Rigid3d& cam_from_world, double size_m, const Shape& shape) {
  Vector8d r = Vector8d::Zero();
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector3d p = cam_from_world * (shape.world_from_tag * Corner(size_m, k, shape.extra));
    r.segment<2>(2 * k) = sight.whitening[static_cast<size_t>(k)] * p.normalized();
  }
  return r;
}

Shape Moved(const Shape& shape, const Vector9d& d) {
  Shape moved;
  moved.world_from_tag = shape.world_from_tag.Plus(d.head<6>());
  moved.extra = shape.extra + d.tail<3>();
  return moved;
}

// A tag as a camera sees it.
struct Sight {
  TagSight sight;
  Rigid3d cam_from_world;
};

// Of each view that the tag was estimated from its first picture.
std::vector<Sight> SightsOf(const TagEstimate& tag, const std::vector<TagView>& views, double extra_sigma_px) {
  std::vector<Sight> sights;
  for (int v : tag.views) {
    const TagView& view = views[static_cast<size_t>(v)];
    for (const TagDetection& d : view.detections) {
      if (d.id != tag.tag_id) continue;
      sights.push_back({MakeTagSight(*view.camera, d, extra_sigma_px), view.world_from_cam.Inverse()});
      break;
    }
  }
  return sights;
}

// d residual / d shape, by central differences.
Matrix89d Jacobian(const Sight& s, double size_m, const Shape& shape) {
  constexpr double kStep = 1e-6;
  Matrix89d j = Matrix89d::Zero();
  for (int k = 0; k < 9; ++k) {
    const Vector9d h = kStep * Vector9d::Unit(k);
    j.col(k) = (Residual(s.sight, s.cam_from_world, size_m, Moved(shape, h)) -
                Residual(s.sight, s.cam_from_world, size_m, Moved(shape, -h))) /
               (2 * kStep);
  }
  return j;
}

// Robust least squares from the shape given, which it improves; the covariance of the result.
Matrix9d FitShape(const std::vector<Sight>& sights, double size_m, Shape* shape) {
  Matrix9d normal = Matrix9d::Identity();
  double square = 0, weights = 0;
  for (int round = 0; round < 8; ++round) {
    normal.setZero();
    Vector9d gradient = Vector9d::Zero();
    square = weights = 0;
    for (const Sight& sight : sights) {
      const Vector8d r = Residual(sight.sight, sight.cam_from_world, size_m, *shape);
      const Matrix89d j = Jacobian(sight, size_m, *shape);
      const double s = r.squaredNorm(), w = s > kHuberChi2 ? std::sqrt(kHuberChi2 / s) : 1;
      normal += w * j.transpose() * j;
      gradient += w * j.transpose() * r;
      square += w * s;
      weights += 8 * w;
    }
    normal.diagonal() *= 1 + 1e-9;
    const Vector9d step = -normal.ldlt().solve(gradient);
    if (!step.allFinite()) break;
    *shape = Moved(*shape, step);
    if (step.dot(normal * step) < 1e-6) break;
  }
  return normal.inverse() * std::max(1.0, square / std::max(1.0, weights - 9));
}

}  // namespace

bool TagShape::SizeIsWrong() const {
  return std::abs(size_ratio - 1) > std::max(kLeastSizeError, kSigmas * size_sigma);
}

bool TagShape::IsBent() const {
  return std::abs(aspect - 1) > std::max(1.5 * kLeastBend, kSigmas * aspect_sigma) ||
         std::abs(twist_m) > std::max(kLeastBend * edge_m, kSigmas * twist_sigma_m);
}

std::vector<TagShape> MeasureTagShapes(const std::vector<TagView>& views, const std::vector<TagEstimate>& tags,
                                       double extra_sigma_px) {
  std::vector<TagShape> shapes;
  for (const TagEstimate& tag : tags) {
    if (!tag.HasPose() || static_cast<int>(tag.views.size()) < kLeastImages) continue;
    const std::vector<Sight> sights = SightsOf(tag, views, extra_sigma_px);
    Shape shape;
    shape.world_from_tag = *tag.world_from_tag;
    const Matrix9d covariance = FitShape(sights, tag.size_m, &shape);
    if (!shape.extra.allFinite()) continue;
    TagShape result;
    result.tag_id = tag.tag_id;
    result.edge_m = tag.size_m;
    result.images = static_cast<int>(sights.size());
    result.size_ratio = std::exp(shape.extra(0));
    result.aspect = std::exp(shape.extra(1));
    result.twist_m = shape.extra(2) * tag.size_m;
    result.size_sigma = result.size_ratio * std::sqrt(covariance(6, 6));
    result.aspect_sigma = result.aspect * std::sqrt(covariance(7, 7));
    result.twist_sigma_m = tag.size_m * std::sqrt(covariance(8, 8));
    shapes.push_back(result);
  }
  return shapes;
}

CommonRatio CommonSizeRatio(const std::vector<TagShape>& shapes, double prior_sigma) {
  constexpr int kRounds = 20;
  std::vector<double> logs;
  for (const TagShape& shape : shapes) logs.push_back(std::log(shape.size_ratio));
  double mean = logs.empty() ? 0 : Median(logs), information = 0;
  HuberByMedian huber;
  for (int round = 0; round < kRounds; ++round) {
    information = 1 / (prior_sigma * prior_sigma);
    double sum = 0;
    for (size_t i = 0; i < shapes.size(); ++i) {
      const double stated = shapes[i].size_sigma / shapes[i].size_ratio, sigma = huber.noise() * stated;
      const double weight = huber.Weight(std::abs(logs[i] - mean) / stated) / (sigma * sigma);
      sum += weight * logs[i], information += weight;
    }
    mean = sum / information;
    huber.EndRound();
  }
  return {std::exp(mean), std::exp(mean) / std::sqrt(information), static_cast<int>(shapes.size())};
}

}  // namespace trigpoint

#include "survey/tags/corner_refinement.h"

#include <Eigen/Cholesky>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "calib/base/median.h"
#include "calib/geometry/bearing.h"

namespace trigpoint {
namespace {

constexpr int kGeometry = 8;           // homography
constexpr int kLevels = 10;            // see Levels()
constexpr int kBlur = kGeometry;       // position of the blur among the unknowns
constexpr int kGamma = kGeometry + 1;  // of the exponent of the tone curve
constexpr int kLevel = kGeometry + 2;  // of the first level
constexpr int kBeyond = kLevel + 6;    // of the level beyond the first side
constexpr int kUnknowns = kLevel + kLevels;
constexpr int kMaxIterations = 30;
constexpr double kKnee = 2.5;  // of the Huber loss, in robust sigmas
// Pixels at edges, which tell where the corners are, differ more from the model than others: by the aliasing of a sharp
// picture, the response of its pixels, compression. Each kind has a sigma of its own. An edge: the share of the
// contrast by which the model changes within a pixel.
constexpr double kEdge = 0.05;
constexpr size_t kLeastOfKind = 50;  // fewer: the sigma of all
constexpr double kTolerancePx = 0.002, kNearPx = 0.05;
constexpr double kNoCost = 0.05;                 // chi-square
constexpr size_t kMostStride = 7, kEnough = 20;  // of pixels left out at first; pixels for each unknown
// Below this standard deviation the Gaussian makes no visible difference beside the pixel's square. The unknown is how
// much its variance exceeds that.
constexpr double kLeastBlur = 0.2, kMostBlur = 10;
// The exponent's prior: between a linear picture (1) and a display's (2.2), wide enough for the picture to decide.
constexpr double kGammaMean = 1.6, kGammaSigma = 1.0, kGammaMin = 0.7, kGammaMax = 3.5;
// That of what lies beyond the margin, in grey values above black. Where the pixels see but a trace of it, they would
// put it at thousands of grey values.
constexpr double kBeyondMean = 128, kBeyondSigma = 100;
constexpr double kNoise = 10;  // grey values, before it is known
struct Prior {
  int unknown;
  double mean, sigma;
};
constexpr std::array<Prior, 5> kPriors{{{kGamma, kGammaMean, kGammaSigma},
                                        {kBeyond, kBeyondMean, kBeyondSigma},
                                        {kBeyond + 1, kBeyondMean, kBeyondSigma},
                                        {kBeyond + 2, kBeyondMean, kBeyondSigma},
                                        {kBeyond + 3, kBeyondMean, kBeyondSigma}}};
// A picture's curve is steep at black but not vertical: the least share of white's light that black is taken to have.
constexpr double kLeastBlack = 2e-3;
// Above this size of a cell only the outer ring of cells is used: it carries enough, and a sheet that is not quite
// flat pulls less at the corners.
constexpr double kAllCellsBelowPx = 8.0;
constexpr double kFlatPx = 3;  // farther from every edge, pixels show only the levels
// What a picture's noise does not tell: printing, flatness, the pixel's true response. Share of a pixel.
constexpr double kSigmaFloorPx = 0.02;

using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;
using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;

// Derivatives of residuals, a column each. Their rounding is far below the noise of pixels.
using Columns = Eigen::Matrix<float, kUnknowns, Eigen::Dynamic>;

// The sum of w^2 j j^T over columns j with weights w, both triangles.
Normal SumOfProducts(const Columns& columns, const Eigen::VectorXf& weights) {
  constexpr Eigen::Index kBlock = 64;  // sums of floats stay short
  Normal sum = Normal::Zero();
  for (Eigen::Index i = 0; i < columns.cols(); i += kBlock) {
    const Eigen::Index n = std::min(kBlock, columns.cols() - i);
    const Eigen::Matrix<float, kUnknowns, Eigen::Dynamic, 0, kUnknowns, kBlock> weighted =
        columns.middleCols(i, n) * weights.segment(i, n).asDiagonal();
    Eigen::Matrix<float, kUnknowns, kUnknowns> part = Eigen::Matrix<float, kUnknowns, kUnknowns>::Zero();
    part.selfadjointView<Eigen::Lower>().rankUpdate(weighted);
    sum += part.cast<double>();
  }
  return sum.selfadjointView<Eigen::Lower>();
}

// The normal distribution by a table: cubic Hermite interpolation, whose error is below 1e-7. A tag's pixels ask for it
// hundreds of thousands of times.
class NormalTable {
 public:
  struct Value {
    double phi, density;
  };
  static const NormalTable& Get() {
    static const NormalTable table;
    return table;
  }
  Value At(double x) const {
    // In this order what is not a number ends at 0.
    const double at = std::min(std::max(0.0, (x + kReach) * kPerSigma), kNodes - 1.001);
    const auto i = static_cast<size_t>(at);
    const Node &l = nodes_[i], &r = nodes_[i + 1];
    const double t = at - static_cast<double>(i), u = 1 - t;
    const double l0 = u * u * (1 + 2 * t), r0 = t * t * (3 - 2 * t), l1 = t * u * u, r1 = -t * t * u;
    return {l0 * l.at.phi + l1 * l.slope.phi + r0 * r.at.phi + r1 * r.slope.phi,
            l0 * l.at.density + l1 * l.slope.density + r0 * r.at.density + r1 * r.slope.density};
  }

 private:
  NormalTable() {
    for (int i = 0; i < kNodes; ++i) {
      const double x = static_cast<double>(i) / kPerSigma - kReach;
      const double density = std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi);
      nodes_[i] = {{0.5 * std::erfc(-x * std::numbers::sqrt2 / 2), density},
                   {density / kPerSigma, -x * density / kPerSigma}};
    }
  }
  static constexpr int kReach = 6, kPerSigma = 16, kNodes = 2 * kReach * kPerSigma + 1;
  struct Node {
    Value at, slope;  // the slopes by the table's own steps
  };
  std::array<Node, kNodes> nodes_;
};

// A step from 0 to 1 at d = 0, blurred by a Gaussian of standard deviation s and averaged over a pixel. The pixel's
// extent along any direction has the variance of a unit interval, which stands for it here.
struct Step {
  double value, by_d, by_s;
  void Add(const Step& other) { value += other.value, by_d += other.by_d, by_s += other.by_s; }
};
class BlurredStep {
 public:
  explicit BlurredStep(double s) : table_(NormalTable::Get()), s_(s), per_s_(1 / s) {}
  double Reach() const { return 5 * s_ + 0.5; }
  Step At(double d) const {
    const double a = (d + 0.5) * per_s_, b = (d - 0.5) * per_s_;
    const NormalTable::Value at_a = table_.At(a), at_b = table_.At(b);
    return {s_ * (a * at_a.phi - b * at_b.phi + at_a.density - at_b.density), at_a.phi - at_b.phi,
            at_a.density - at_b.density};
  }

 private:
  const NormalTable& table_;
  double s_, per_s_;
};

// Within bounds, `least` for what is not a number. Without SSE4.1, std::floor is a call of the library.
int Floor(double x, int least, int most) {
  const double bounded = std::min(std::max<double>(least, x), static_cast<double>(most));
  const int whole = static_cast<int>(bounded);
  return whole - (bounded < whole ? 1 : 0);
}

// A picture's tone curve between a tag's black and its white: light is mixed by lens and pixel, and encoded afterwards,
// as (share of light)^(1 / gamma). Where half of a pixel is white its grey value is far above the middle, which draws
// every edge towards the black side by up to 0.2 px. From the share f of white in a pixel to the share of contrast.
struct Tone {
  double value, by_f, by_gamma;
};
class ToneCurve {
 public:
  // `black`, `white`: grey values of the two; what they are in light follows from gamma.
  ToneCurve(double gamma, double black, double white) : gamma_(gamma) {
    const double ratio = std::clamp(black / std::max(white, 1.0), 0.0, 0.95);
    black_light_ = std::max(kLeastBlack, std::pow(ratio, gamma));
    black_ = std::pow(black_light_, 1 / gamma);
    // d black_ / d gamma: the ratio of grey values is given, unless the floor holds.
    black_by_gamma_ = black_light_ > kLeastBlack ? 0.0 : -black_ * std::log(black_light_) / (gamma * gamma);
    black_light_by_gamma_ = black_light_ > kLeastBlack ? black_light_ * std::log(ratio) : 0.0;
  }
  Tone At(double f) const {
    f = std::clamp(f, 0.0, 1.0);
    const double light = black_light_ + (1 - black_light_) * f, range = 1 - black_;
    const double log_light = std::log(light), value = std::exp(log_light / gamma_);
    Tone t;
    t.value = (value - black_) / range;
    t.by_f = value / light / gamma_ * (1 - black_light_) / range;
    const double by_gamma =
        -value * log_light / (gamma_ * gamma_) + value / light / gamma_ * (1 - f) * black_light_by_gamma_;
    t.by_gamma = (by_gamma - black_by_gamma_ + t.value * black_by_gamma_) / range;
    return t;
  }

 private:
  double gamma_, black_light_, black_, black_by_gamma_, black_light_by_gamma_;
};

// Pixels of a plane tangent to the view's direction at the tag, scaled like the picture: straight lines stay straight.
class LocalPlane {
 public:
  LocalPlane(const Camera* camera, const Eigen::Vector2d& centre) : camera_(camera), centre_(centre) {
    if (camera_ == nullptr) return;
    const std::optional<Eigen::Vector3d> axis = camera_->Unproject(centre);
    if (!axis) {
      camera_ = nullptr;
      return;
    }
    axis_ = *axis;
    basis_ = TangentBasis(axis_);
    Eigen::Matrix<double, 2, 3> jacobian;
    if (!camera_->Project(axis_, &jacobian)) {
      camera_ = nullptr;
      return;
    }
    scale_ = jacobian * basis_.transpose();
  }

  std::optional<Eigen::Vector2d> FromPixel(const Eigen::Vector2d& pixel) const {
    if (camera_ == nullptr) return pixel;
    const std::optional<Eigen::Vector3d> ray = camera_->Unproject(pixel);
    if (!ray) return std::nullopt;
    const double depth = axis_.dot(*ray);
    if (depth < 0.1) return std::nullopt;
    return Eigen::Vector2d(centre_ + scale_ * (basis_ * *ray) / depth);
  }

  std::optional<Eigen::Vector2d> ToPixel(const Eigen::Vector2d& plane) const {
    if (camera_ == nullptr) return plane;
    const Eigen::Vector2d m = scale_.inverse() * (plane - centre_);
    return camera_->Project(axis_ + basis_.transpose() * m);
  }

 private:
  const Camera* camera_;
  Eigen::Vector2d centre_;
  Eigen::Vector3d axis_;
  Eigen::Matrix<double, 2, 3> basis_;
  Eigen::Matrix2d scale_;
};

// Homography that takes four points to four points; nothing if three of them are on a line.
std::optional<Eigen::Matrix3d> FourPoints(const std::array<Eigen::Vector2d, 4>& from,
                                          const std::array<Eigen::Vector2d, 4>& to) {
  Eigen::Matrix<double, 8, 8> a = Eigen::Matrix<double, 8, 8>::Zero();
  Eigen::Matrix<double, 8, 1> b;
  for (int k = 0; k < 4; ++k) {
    const double x = from[k].x(), y = from[k].y(), u = to[k].x(), v = to[k].y();
    a.row(2 * k) << x, y, 1, 0, 0, 0, -u * x, -u * y;
    a.row(2 * k + 1) << 0, 0, 0, x, y, 1, -v * x, -v * y;
    b[2 * k] = u;
    b[2 * k + 1] = v;
  }
  const Eigen::FullPivLU<Eigen::Matrix<double, 8, 8>> lu(a);
  if (!lu.isInvertible()) return std::nullopt;
  const Eigen::Matrix<double, 8, 1> h = lu.solve(b);
  Eigen::Matrix3d m;
  m << h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1;
  return m;
}

struct Sample {
  Eigen::Vector2d plane;  // normalised: (plane - centre) / radius
  double grey;
  int x, y;
  bool is_edge = false;
  double residual = 0;      // grey values, of the last evaluation
  bool looks_edge = false;  // then
};

// The fit of one tag.
class Fit {
 public:
  Fit(const cv::Mat& grey, const TagPattern& pattern, const std::array<Eigen::Vector2d, 4>& corners,
      const Camera* camera)
      : grey_(grey),
        pattern_(pattern),
        centre_(0.25 * (corners[0] + corners[1] + corners[2] + corners[3])),
        plane_(camera, centre_) {
    const double w = pattern.width;
    tag_corners_ = {Eigen::Vector2d(0, w), Eigen::Vector2d(w, w), Eigen::Vector2d(w, 0), Eigen::Vector2d(0, 0)};
    start_ = corners;
  }

  CornerRefinement Run() {
    CornerRefinement out;
    out.corners = start_;
    out.reason = Solve(&out);
    out.ok = out.reason.empty();
    if (!out.ok) out.corners = start_;
    return out;
  }

 private:
  std::string Solve(CornerRefinement* out) {
    double perimeter = 0;
    for (int k = 0; k < 4; ++k) {
      const double side = (start_[(k + 1) % 4] - start_[k]).norm();
      if (side < 4) return "the tag is smaller than 4 px";
      perimeter += side;
    }
    cell_px_ = perimeter / (4 * pattern_.width);
    radius_ = perimeter / 8;
    std::array<Eigen::Vector2d, 4> from;
    for (int k = 0; k < 4; ++k) {
      const auto p = plane_.FromPixel(start_[k]);
      if (!p) return "a corner has no ray";
      from[k] = Normalised(*p);
    }
    const auto h = FourPoints(from, tag_corners_);
    if (!h) return "the corners are on a line";
    Unknowns x = Unknowns::Zero();
    for (int i = 0; i < kGeometry; ++i) x[i] = (*h)(i / 3, i % 3);
    x[kBlur] = 0.36;
    x[kGamma] = kGammaMean;
    CollectSamples(x);
    if (samples_.size() < 3 * kUnknowns) return "too few pixels of the tag are in the picture";
    // Most of the way a part of the pixels shows as well as all of them.
    const size_t stride = std::clamp<size_t>(samples_.size() / (kEnough * kUnknowns), 1, kMostStride);
    for (size_t i = 0; i < samples_.size(); i += stride) used_.push_back(samples_[i]);
    if (!SolveLevels(&x)) return "no contrast";
    if (stride > 1) {
      Unknowns near = x;
      if (Iterate(kNearPx, &near, &out->iterations).empty() && CornerMotion(x, near) < MostMotion()) x = near;
    }
    used_ = std::move(samples_);
    const std::string problem = Iterate(kTolerancePx, &x, &out->iterations);
    if (!problem.empty()) return problem;
    return Finish(x, out);
  }

  // Levenberg-Marquardt until no corner moves by more than the tolerance. If it converges, the last evaluation is that
  // of the result.
  std::string Iterate(double tolerance_px, Unknowns* x, int* iterations) {
    Evaluate(*x);
    Sort();
    sigmas_ = RobustSigmas();
    System system = SystemAt(*x);
    double cost = CostAt(*x), lambda = 1e-3, motion = 1e9, motion_before = 0;
    for (int i = 0; i < kMaxIterations; ++i, ++*iterations) {
      Normal damped = system.a;
      damped.diagonal() *= 1 + lambda;
      damped.diagonal().array() += 1e-12;
      const Unknowns next = Within(damped, system.b, *x);
      if (!next.allFinite()) return "singular fit";
      Evaluate(next);
      const double cost_next = CostAt(next);
      motion = CornerMotion(*x, next);
      if (!(cost_next < cost)) {
        // No descent left: what the step moves or costs is far below the noise.
        if (motion < 5 * tolerance_px || cost_next - cost < kNoCost * sigmas_[0] * sigmas_[0]) {
          Evaluate(*x);
          return {};
        }
        lambda = std::max(10 * lambda, 1e-2);
        motion_before = 0;
        continue;
      }
      *x = next;
      cost = cost_next;
      lambda = std::max(lambda * 0.1, 1e-7);
      if (i < 5 && ((RobustSigmas() - sigmas_).abs() > 0.1 * sigmas_).any()) {  // the scale follows the fit, at first
        Sort();
        sigmas_ = RobustSigmas();
        cost = CostAt(*x);
      } else if (motion < tolerance_px || motion * motion < tolerance_px * (motion_before - motion)) {
        return {};  // steps shrink at an even rate: the second condition bounds the sum of those that would follow
      }
      motion_before = motion;
      system = SystemAt(*x);
    }
    return motion < 0.02 ? "" : "no convergence";
  }

  // What solves a (x - next) = b within the bounds of blur and exponent: the other unknowns go with those at a bound.
  static Unknowns Within(Normal a, Unknowns b, const Unknowns& x) {
    struct Bound {
      int unknown;
      double least, most;
      bool held = false;
    };
    std::array<Bound, 2> bounds{{{kBlur, 0, kMostBlur * kMostBlur}, {kGamma, kGammaMin, kGammaMax}}};
    for (;;) {
      Unknowns next = x - a.ldlt().solve(b);
      bool within = true;
      for (Bound& bound : bounds) {
        const int k = bound.unknown;
        const double at = std::clamp(next[k], bound.least, bound.most);
        if (next[k] == at || bound.held) {
          next[k] = at;
          continue;
        }
        const double step = x[k] - at;
        b -= step * a.col(k);
        a.row(k).setZero(), a.col(k).setZero();
        a(k, k) = 1, b[k] = step;
        bound.held = true, within = false;
      }
      if (within) return next;
    }
  }

  Eigen::Vector2d Normalised(const Eigen::Vector2d& p) const { return (p - centre_) / radius_; }

  // Whether all cells within `reach` of a place have one colour, that of the pattern.
  bool IsFlat(double s, double t, double reach) const {
    const auto cell = [&](double at) { return Floor(at + pattern_.margin, -1, pattern_.total); };
    const int left = cell(s - reach), right = cell(s + reach), top = cell(t - reach), bottom = cell(t + reach);
    if (std::min(left, top) < 0 || std::max(right, bottom) >= pattern_.total) return false;
    for (int row = top; row <= bottom; ++row) {
      for (int column = left; column <= right; ++column) {
        if (pattern_.At(row, column) != pattern_.At(top, left)) return false;
      }
    }
    return true;
  }

  // The pixels that carry information: the tag with its white margin, or for big tags a band along the outer edges.
  void CollectSamples(const Unknowns& x) {
    const bool all = cell_px_ < kAllCellsBelowPx;
    constexpr double kBandCells = 2;
    const double w = pattern_.width, outer = std::max(1, pattern_.margin);
    Eigen::Vector2d low = start_[0], high = start_[0];
    for (const Eigen::Vector2d& c : PlaneCorners(x, outer)) {
      const std::optional<Eigen::Vector2d> pixel = plane_.ToPixel(centre_ + radius_ * c);
      if (pixel) low = low.cwiseMin(*pixel), high = high.cwiseMax(*pixel);
    }
    const double pad = cell_px_;  // a lens bends the edges of the margin
    const int x0 = std::max(0, static_cast<int>(low.x() - pad)), y0 = std::max(0, static_cast<int>(low.y() - pad));
    const int x1 = std::min(grey_.cols - 1, static_cast<int>(high.x() + pad));
    const int y1 = std::min(grey_.rows - 1, static_cast<int>(high.y() + pad));
    for (int v = y0; v <= y1; ++v) {
      for (int u = x0; u <= x1; ++u) {
        const auto p = plane_.FromPixel({static_cast<double>(u), static_cast<double>(v)});
        if (!p) continue;
        const Eigen::Vector2d q = Normalised(*p);
        const double denominator = x[6] * q.x() + x[7] * q.y() + 1;
        if (denominator < 1e-3) continue;
        const double s = (x[0] * q.x() + x[1] * q.y() + x[2]) / denominator;
        const double t = (x[3] * q.x() + x[4] * q.y() + x[5]) / denominator;
        if (s < -outer || t < -outer || s > w + outer || t > w + outer) continue;
        if (!all && std::min({s, t, w - s, w - t}) > kBandCells) continue;
        // Pixels away from all edges show only the levels: a quarter of them is enough.
        if (((u + 2 * v) & 3) != 0 && IsFlat(s, t, kFlatPx / cell_px_)) continue;
        samples_.push_back({q, static_cast<double>(grey_.at<unsigned char>(v, u)), u, v});
      }
    }
  }

  // Model of one pixel: share of white light in it with its derivatives by tag coordinates and blur, the share of
  // contrast that the tone curve makes of it, and the weight of what lies beyond each side of the white margin, whose
  // brightness is not known.
  struct Prediction {
    double u, v, per_denominator;
    double white = 0, white_by_u = 0, white_by_v = 0, white_by_s = 0;
    double slope = 0;  // of white, per pixel
    std::array<double, 4> beyond{};
    double beyond_by_u = 0, beyond_by_v = 0, beyond_by_s = 0;  // of what it adds, grey values
    Tone tone{};
  };

  static double BlurOf(const Unknowns& x) { return std::sqrt(kLeastBlur * kLeastBlur + x[kBlur]); }
  static ToneCurve CurveOf(const Unknowns& x) { return {x[kGamma], x[kLevel], x[kLevel] + x[kLevel + 3]}; }

  Prediction Predict(const Unknowns& x, const ToneCurve& curve, const BlurredStep& steps,
                     const Eigen::Vector2d& q) const {
    Prediction p;
    p.per_denominator = 1 / (x[6] * q.x() + x[7] * q.y() + 1);
    p.u = (x[0] * q.x() + x[1] * q.y() + x[2]) * p.per_denominator;
    p.v = (x[3] * q.x() + x[4] * q.y() + x[5]) * p.per_denominator;
    const auto px_per_cell = [&](double by_x, double by_y) {
      return radius_ / std::max(std::sqrt(by_x * by_x + by_y * by_y) * std::abs(p.per_denominator), 1e-9);
    };
    const double px_per_u = px_per_cell(x[0] - p.u * x[6], x[1] - p.u * x[7]);
    const double px_per_v = px_per_cell(x[3] - p.v * x[6], x[4] - p.v * x[7]);
    std::array<Weight, 32> wu, wv;
    const int nu = CellWeights(p.u, px_per_u, steps, &wu), nv = CellWeights(p.v, px_per_v, steps, &wv);
    const int n = pattern_.total;
    const auto outside = [&](int side, const Step& along_u, const Step& along_v) {
      const double level = x[kBeyond + side];
      p.beyond[side] += along_u.value * along_v.value;
      p.beyond_by_u += level * along_u.by_d * along_v.value * px_per_u;
      p.beyond_by_v += level * along_u.value * along_v.by_d * px_per_v;
      p.beyond_by_s += level * (along_u.by_s * along_v.value + along_u.value * along_v.by_s);
    };
    Step inside{0, 0, 0};  // of the pixel along its row
    for (int j = 0; j < nu; ++j) {
      const int column = wu[j].cell + pattern_.margin;
      if (column >= 0 && column < n) {
        inside.Add(wu[j].share);
      } else {
        outside(column < 0 ? 3 : 1, wu[j].share, {1, 0, 0});
      }
    }
    for (int i = 0; i < nv; ++i) {
      const int row = wv[i].cell + pattern_.margin;
      const Step& share = wv[i].share;
      if (row < 0 || row >= n) {
        outside(row < 0 ? 2 : 0, inside, share);
        continue;
      }
      Step white{0, 0, 0};  // along this row of cells
      for (int j = 0; j < nu; ++j) {
        const int column = wu[j].cell + pattern_.margin;
        if (column >= 0 && column < n && pattern_.At(row, column)) white.Add(wu[j].share);
      }
      p.white += share.value * white.value;
      p.white_by_u += share.value * white.by_d;
      p.white_by_v += share.by_d * white.value;
      p.white_by_s += share.by_s * white.value + share.value * white.by_s;
    }
    p.slope = std::sqrt(p.white_by_u * p.white_by_u + p.white_by_v * p.white_by_v);
    p.white_by_u *= px_per_u;
    p.white_by_v *= px_per_v;
    p.tone = curve.At(p.white);
    return p;
  }

  // Share of each cell along one axis in the blurred pixel at tag coordinate t; cells -margin - 1 and
  // width + margin stand for everything beyond the pattern.
  struct Weight {
    int cell;
    Step share;
  };
  int CellWeights(double t, double px_per_cell, const BlurredStep& steps, std::array<Weight, 32>* weights) const {
    const double reach = steps.Reach() / px_per_cell;
    const int lowest = -pattern_.margin, highest = pattern_.width + pattern_.margin;  // boundaries
    const int first = -Floor(reach - t, -highest - 1, -lowest);
    int last = Floor(t + reach, lowest - 1, highest);
    if (last - first > 29) last = first + 29;
    int n = 0;
    Step before{1, 0, 0};  // of the boundary left of the current cell
    for (int boundary = first; boundary <= last + 1; ++boundary) {
      const Step step = boundary <= last ? steps.At((t - boundary) * px_per_cell) : Step{0, 0, 0};
      (*weights)[n++] = {boundary - 1, {before.value - step.value, before.by_d - step.by_d, before.by_s - step.by_s}};
      before = step;
    }
    return n;
  }

  // The levels enter linearly: dark level with slopes (3), bright minus dark with slopes (3), beyond each side (4).
  Eigen::Matrix<double, kLevels, 1> Levels(const Prediction& p) const {
    const double w = 0.5 * pattern_.width;
    const double a = p.u / w - 1, b = p.v / w - 1;
    Eigen::Matrix<double, kLevels, 1> row;
    row << 1, a, b, p.tone.value, p.tone.value * a, p.tone.value * b, p.beyond[0], p.beyond[1], p.beyond[2],
        p.beyond[3];
    return row;
  }

  bool SolveLevels(Unknowns* x) const {
    Eigen::Matrix<double, kLevels, kLevels> a = Eigen::Matrix<double, kLevels, kLevels>::Zero();
    Eigen::Matrix<double, kLevels, 1> b = Eigen::Matrix<double, kLevels, 1>::Zero();
    const ToneCurve curve((*x)[kGamma], 0, 255);  // levels are not known yet
    const BlurredStep steps(BlurOf(*x));
    for (const Sample& sample : used_) {
      const auto row = Levels(Predict(*x, curve, steps, sample.plane));
      a += row * row.transpose();
      b += row * sample.grey;
    }
    a.diagonal().array() += 1e-6;
    const double prior = std::pow(kNoise / kBeyondSigma, 2);
    a.diagonal().tail<4>().array() += prior;
    b.tail<4>().array() += prior * kBeyondMean;
    x->tail<kLevels>() = a.ldlt().solve(b);
    return x->allFinite() && (*x)[kLevel + 3] > 5;  // bright minus dark
  }

  // Of residuals; not below what rounding to whole grey values leaves.
  static double RobustSigma(std::vector<double> residuals) {
    for (double& r : residuals) r = std::abs(r);
    return std::max(1.4826 * Median(std::move(residuals)), 0.5);
  }
  // Of pixels at edges, and of others.
  Eigen::Array2d RobustSigmas() const {
    std::array<std::vector<double>, 2> kinds;
    for (const Sample& s : used_) kinds[s.is_edge ? 0 : 1].push_back(s.residual);
    if (std::min(kinds[0].size(), kinds[1].size()) < kLeastOfKind) return Eigen::Array2d::Constant(AllSigma());
    return {RobustSigma(std::move(kinds[0])), RobustSigma(std::move(kinds[1]))};
  }
  double AllSigma() const {
    std::vector<double> all;
    for (const Sample& s : used_) all.push_back(s.residual);
    return RobustSigma(std::move(all));
  }
  double SigmaOf(const Sample& s) const { return sigmas_[s.is_edge ? 0 : 1]; }
  // The kinds stay as they are from step to step: else the cost would jump.
  void Sort() {
    for (Sample& s : used_) s.is_edge = s.looks_edge;
  }

  // Residuals at x, their kinds and derivatives.
  void Evaluate(const Unknowns& x) {
    const double w = 0.5 * pattern_.width;
    const ToneCurve curve = CurveOf(x);
    const double blur = BlurOf(x);
    const BlurredStep steps(blur);
    derivatives_.resize(Eigen::NoChange, static_cast<Eigen::Index>(used_.size()));
    for (size_t i = 0; i < used_.size(); ++i) {
      Sample& sample = used_[i];
      const Eigen::Vector2d& q = sample.plane;
      const Prediction p = Predict(x, curve, steps, q);
      const Eigen::Matrix<double, kLevels, 1> levels = Levels(p);
      const auto c = x.tail<kLevels>();
      const double contrast = c[3] + c[4] * levels[1] + c[5] * levels[2];
      const double by_white = contrast * p.tone.by_f;
      const double by_u = by_white * p.white_by_u + p.beyond_by_u + (c[1] + c[4] * p.tone.value) / w;
      const double by_v = by_white * p.white_by_v + p.beyond_by_v + (c[2] + c[5] * p.tone.value) / w;
      Unknowns j;
      const double d = p.per_denominator, k = -(by_u * p.u + by_v * p.v) * d;
      j.head<kGeometry>() << by_u * q.x() * d, by_u * q.y() * d, by_u * d, by_v * q.x() * d, by_v * q.y() * d, by_v * d,
          k * q.x(), k * q.y();
      j[kBlur] = (by_white * p.white_by_s + p.beyond_by_s) / (2 * blur);
      j[kGamma] = contrast * p.tone.by_gamma;
      j.tail<kLevels>() = levels;
      derivatives_.col(static_cast<Eigen::Index>(i)) = j.cast<float>();
      sample.residual = levels.dot(c) - sample.grey;
      sample.looks_edge = p.slope * std::abs(by_white) > kEdge * std::abs(c[3]);
    }
  }

  // Of the last evaluation, which was at x: the Huber cost.
  double CostAt(const Unknowns& x) const {
    double cost = 0;
    for (const Prior& p : kPriors) cost += std::pow(sigmas_[0] / p.sigma * (x[p.unknown] - p.mean), 2);
    for (const Sample& s : used_) {
      const double sigma = SigmaOf(s), size = std::abs(s.residual) / sigma;
      cost += sigma * sigma * (size > kKnee ? 2 * kKnee * size - kKnee * kKnee : size * size);
    }
    return cost;
  }
  // And its Gauss-Newton system a * step = b.
  struct System {
    Normal a;
    Unknowns b;
  };
  System SystemAt(const Unknowns& x) const {
    Eigen::VectorXf roots(used_.size()), pulls(used_.size());
    for (size_t i = 0; i < used_.size(); ++i) {
      const double limit = kKnee * SigmaOf(used_[i]), r = used_[i].residual;
      roots[i] = static_cast<float>(std::sqrt(std::min(1.0, limit / std::max(std::abs(r), 1e-9))));
      pulls[i] = static_cast<float>(std::clamp(r, -limit, limit));
    }
    System out{SumOfProducts(derivatives_, roots), (derivatives_ * pulls).cast<double>()};
    for (const Prior& p : kPriors) {
      const double weight = std::pow(sigmas_[0] / p.sigma, 2);
      out.a(p.unknown, p.unknown) += weight;
      out.b[p.unknown] += weight * (x[p.unknown] - p.mean);
    }
    return out;
  }

  // Of a corner, px: the first guess may be half a cell or a pixel off; more than that is another edge.
  double MostMotion() const { return std::max(1.5, 0.6 * cell_px_); }

  // Corners in normalised plane coordinates, of the square that is wider by so many cells on each side.
  std::array<Eigen::Vector2d, 4> PlaneCorners(const Unknowns& x, double wider = 0) const {
    Eigen::Matrix3d h;
    h << x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], 1;
    const Eigen::Matrix3d inverse = h.inverse();
    std::array<Eigen::Vector2d, 4> out;
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector2d corner =
          tag_corners_[k].array() + wider * (tag_corners_[k].array() - 0.5 * pattern_.width).sign();
      out[k] = (inverse * corner.homogeneous()).hnormalized();
    }
    return out;
  }

  double CornerMotion(const Unknowns& x, const Unknowns& y) const {
    const auto a = PlaneCorners(x), b = PlaneCorners(y);
    double most = 0;
    for (int k = 0; k < 4; ++k) most = std::max(most, (a[k] - b[k]).norm() * radius_);
    return most;
  }

  // Residuals of neighbouring pixels agree (compression, sharpening, what the model lacks): so many pixels count
  // as one. From their correlation at lag one in x and y, as for two first-order autoregressive processes.
  double PixelsPerObservation() const {
    double square = 0, along_x = 0, along_y = 0;
    int nx = 0, ny = 0;
    constexpr double kLimit = 4;
    const auto size = [&](const Sample& s) { return std::clamp(s.residual / SigmaOf(s), -kLimit, kLimit); };
    const auto is_at = [&](size_t i, int x, int y) { return i < used_.size() && used_[i].x == x && used_[i].y == y; };
    size_t below = 0;
    for (size_t i = 0; i < used_.size(); ++i) {  // samples are in row order
      const int x = used_[i].x, y = used_[i].y;
      const double r = size(used_[i]);
      square += r * r;
      if (is_at(i + 1, x + 1, y)) {
        along_x += r * size(used_[i + 1]);
        ++nx;
      }
      while (below < used_.size() && std::pair(used_[below].y, used_[below].x) < std::pair(y + 1, x)) ++below;
      if (is_at(below, x, y + 1)) {
        along_y += r * size(used_[below]);
        ++ny;
      }
    }
    const double variance = square / static_cast<double>(std::max<size_t>(1, used_.size()));
    if (variance <= 0 || nx == 0 || ny == 0) return 1;
    const double rx = std::clamp(along_x / nx / variance, 0.0, 0.9);
    const double ry = std::clamp(along_y / ny / variance, 0.0, 0.9);
    return (1 + rx) / (1 - rx) * (1 + ry) / (1 - ry);
  }

  std::string Finish(const Unknowns& x, CornerRefinement* out) {
    out->blur_px = BlurOf(x);
    out->gamma = x[kGamma];
    out->contrast = x[kLevel + 3];
    if (out->contrast < 8) return "contrast below 8 grey values";
    // Sandwich form (White 1980): what the model lacks sits at the edges, where the corners come from, so that one
    // variance for all pixels would be too good.
    Eigen::VectorXf pulls(used_.size());
    for (size_t i = 0; i < used_.size(); ++i) {
      const double limit = kKnee * SigmaOf(used_[i]);
      pulls[i] = static_cast<float>(std::clamp(used_[i].residual, -limit, limit));
    }
    const Normal a = SystemAt(x).a, scatter = SumOfProducts(derivatives_, pulls);
    out->residual = AllSigma();
    double square = 0;
    for (const Sample& s : used_) square += std::pow(std::min(std::abs(s.residual), 5 * SigmaOf(s)), 2);
    const double variance = square / (used_.size() - kUnknowns);
    if (std::sqrt(variance) > 0.25 * out->contrast) return "the picture does not look like the tag";
    const auto corners = PlaneCorners(x);
    for (int k = 0; k < 4; ++k) {
      const auto pixel = plane_.ToPixel(centre_ + radius_ * corners[k]);
      if (!pixel || !pixel->allFinite()) return "a corner left the picture";
      if ((*pixel - start_[k]).norm() > MostMotion()) return "a corner moved to another edge";
      out->corners[k] = *pixel;
    }
    const Normal inverse = a.ldlt().solve(Normal::Identity());
    const double freedom = static_cast<double>(used_.size()) / static_cast<double>(used_.size() - kUnknowns);
    const Normal covariance = inverse * scatter * inverse * (freedom * PixelsPerObservation());
    Eigen::Matrix<double, 8, kGeometry> jacobian;
    for (int i = 0; i < kGeometry; ++i) {
      const double h = 1e-6 * std::max(1.0, std::abs(x[i]));
      Unknowns plus = x, minus = x;
      plus[i] += h;
      minus[i] -= h;
      const auto cp = PlaneCorners(plus), cm = PlaneCorners(minus);
      for (int k = 0; k < 4; ++k) jacobian.block<2, 1>(2 * k, i) = radius_ * (cp[k] - cm[k]) / (2 * h);
    }
    const Eigen::Matrix<double, 8, 8> c = jacobian * covariance.topLeftCorner<8, 8>() * jacobian.transpose();
    for (int k = 0; k < 4; ++k) {
      const double v = 0.5 * (c(2 * k, 2 * k) + c(2 * k + 1, 2 * k + 1));
      if (!(v >= 0) || !std::isfinite(v)) return "singular fit";
      out->sigma_px[k] = std::sqrt(v + kSigmaFloorPx * kSigmaFloorPx);
      if (out->sigma_px[k] > 1) return "a corner is uncertain by more than a pixel";
    }
    return {};
  }

  const cv::Mat& grey_;
  const TagPattern& pattern_;
  Eigen::Vector2d centre_;
  LocalPlane plane_;
  std::array<Eigen::Vector2d, 4> tag_corners_;
  std::array<Eigen::Vector2d, 4> start_;
  double cell_px_ = 0, radius_ = 1;
  Eigen::Array2d sigmas_ = {1, 1};  // see RobustSigmas
  std::vector<Sample> samples_;     // all pixels
  std::vector<Sample> used_;        // those of the present fit
  Columns derivatives_;             // of their residuals, of the last evaluation
};

}  // namespace

CornerRefinement RefineCorners(const cv::Mat& grey, const TagPattern& pattern,
                               const std::array<Eigen::Vector2d, 4>& corners, const Camera* camera) {
  return Fit(grey, pattern, corners, camera).Run();
}

}  // namespace trigpoint

#include "calib/target/uncertainty.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "calib/base/error.h"
#include "calib/base/grid.h"
#include "calib/base/median.h"
#include "calib/camera/projection.h"

namespace trigpoint {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

int CellOf(double at, int size, int cells) {
  return std::clamp(static_cast<int>((at + 0.5) / size * cells), 0, cells - 1);
}

std::vector<bool> CoveredPixels(const ImageGrid& grid, const Coverage& coverage, const Camera& camera) {
  std::vector<bool> covered;
  for (const Eigen::Vector2d& pixel : grid.pixels)
    covered.push_back(IsCovered(coverage, camera.width(), camera.height(), pixel));
  return covered;
}

}  // namespace

ImageGrid MakeGrid(int width, int height, int cols) {
  ImageGrid grid;
  grid.cols = std::max(2, cols);
  grid.rows = std::max(2, static_cast<int>(std::lround(static_cast<double>(cols - 1) * height / width)) + 1);
  for (int r = 0; r < grid.rows; ++r) {
    for (int c = 0; c < grid.cols; ++c) {
      grid.pixels.emplace_back((width - 1.0) * c / (grid.cols - 1), (height - 1.0) * r / (grid.rows - 1));
    }
  }
  return grid;
}

Coverage MeasureCoverage(const CalibrationInput& input, const Calibration& calibration, int camera, int cols) {
  const auto& size = input.cameras[static_cast<size_t>(camera)];
  Coverage coverage;
  coverage.cols = cols;
  coverage.rows = std::max(3, static_cast<int>(std::lround(static_cast<double>(cols) * size.height / size.width)));
  coverage.points.assign(CellCount(coverage.rows, coverage.cols), 0);
  const Eigen::Vector2d middle(0.5 * (size.width - 1), 0.5 * (size.height - 1));
  for (const PointResidual& r : calibration.residuals) {
    if (!r.used || input.views[static_cast<size_t>(r.view)].camera != camera) continue;
    const int c = CellOf(r.pixel.x(), size.width, coverage.cols), row = CellOf(r.pixel.y(), size.height, coverage.rows);
    ++coverage.points[CellIndex(row, c, coverage.cols)];
    coverage.radius_share = std::max(coverage.radius_share, (r.pixel - middle).norm() / middle.norm());
  }
  // Cells that points lie around count too: a board's squares may be larger than they are.
  int filled = 0;
  std::array<int, 9> part_cells{}, part_filled{};
  for (int row = 0; row < coverage.rows; ++row) {
    for (int c = 0; c < coverage.cols; ++c) {
      const Eigen::Vector2d pixel((c + 0.5) * size.width / coverage.cols - 0.5,
                                  (row + 0.5) * size.height / coverage.rows - 0.5);
      const bool seen = IsCovered(coverage, size.width, size.height, pixel);
      const auto part = CellIndex(3 * row / coverage.rows, 3 * c / coverage.cols, 3);
      ++part_cells[part];
      part_filled[part] += seen;
      filled += seen;
    }
  }
  coverage.share = static_cast<double>(filled) / static_cast<double>(coverage.points.size());
  static constexpr const char* kParts[] = {"upper left", "top",        "upper right", "left",       "middle",
                                           "right",      "lower left", "bottom",      "lower right"};
  for (size_t part = 0; part < 9; ++part) {
    if (2 * part_filled[part] < part_cells[part]) coverage.poor.emplace_back(kParts[part]);
  }
  return coverage;
}

bool IsCovered(const Coverage& coverage, int width, int height, const Eigen::Vector2d& pixel) {
  const int c = CellOf(pixel.x(), width, coverage.cols), r = CellOf(pixel.y(), height, coverage.rows);
  const auto at = [&](int col, int row) {
    return col >= 0 && row >= 0 && col < coverage.cols && row < coverage.rows &&
           coverage.points[CellIndex(row, col, coverage.cols)] > 0;
  };
  return at(c, r) || (at(c - 1, r) && at(c + 1, r)) || (at(c, r - 1) && at(c, r + 1));
}

void ProjectionUncertainty::Multiply(double factor) {
  for (double& sigma : sigma_px) sigma *= factor;
  for (double* sigma : {&median_covered_px, &max_covered_px, &max_px, &rms_covered_px}) *sigma *= factor;
}

ProjectionUncertainty MeasureUncertainty(const CalibratedCamera& calibrated, const Coverage& coverage) {
  const Camera& camera = calibrated.camera;
  ProjectionUncertainty result;
  result.grid = MakeGrid(camera.width(), camera.height());
  result.covered = CoveredPixels(result.grid, coverage, camera);
  const auto count = static_cast<Eigen::Index>(camera.params().size());
  struct Pixel {
    Eigen::Matrix<double, 2, Eigen::Dynamic> by_params;
    Eigen::Matrix<double, 2, 3> by_rotation;
    bool has_ray = false;
  };
  std::vector<Pixel> pixels(result.grid.pixels.size());
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(3, count);
  const bool any_covered = std::count(result.covered.begin(), result.covered.end(), true) > 2;
  int without = 0;
  for (size_t i = 0; i < pixels.size(); ++i) {
    Pixel& p = pixels[i];
    const auto ray = camera.Unproject(result.grid.pixels[i]);
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> by_point;
    p.has_ray = ray && ProjectByParams(camera.model(), camera.params(), *ray, &pixel, &by_point, &p.by_params);
    without += !p.has_ray;
    if (!p.has_ray) continue;
    p.by_rotation = by_point * -Skew(*ray);
    if (any_covered && !result.covered[i]) continue;
    normal += p.by_rotation.transpose() * p.by_rotation;
    right += p.by_rotation.transpose() * p.by_params;
  }
  result.no_ray_share = static_cast<double>(without) / static_cast<double>(pixels.size());
  const Eigen::MatrixXd rotation_by_params = normal.ldlt().solve(right);  // 3 x count; undone
  std::vector<double> covered;
  double sum = 0;
  for (size_t i = 0; i < pixels.size(); ++i) {
    if (!pixels[i].has_ray) {
      result.sigma_px.push_back(kNan);
      continue;
    }
    const Eigen::Matrix<double, 2, Eigen::Dynamic> j = pixels[i].by_params - pixels[i].by_rotation * rotation_by_params;
    const Eigen::Matrix2d c = j * calibrated.covariance * j.transpose();
    const double half = 0.5 * c.trace(), det = c.determinant();
    const double sigma = std::sqrt(std::max(0.0, half + std::sqrt(std::max(0.0, half * half - det))));
    result.sigma_px.push_back(sigma);
    result.max_px = std::max(result.max_px, sigma);
    if (!result.covered[i]) continue;
    covered.push_back(sigma);
    sum += c.trace();
    result.max_covered_px = std::max(result.max_covered_px, sigma);
  }
  result.median_covered_px = Median(covered);
  result.rms_covered_px = covered.empty() ? 0 : std::sqrt(sum / static_cast<double>(covered.size()));
  return result;
}

CameraDifference CompareCameras(const Camera& a, const Camera& b, const Coverage& coverage) {
  CameraDifference result;
  result.grid = MakeGrid(a.width(), a.height());
  result.covered = CoveredPixels(result.grid, coverage, a);
  const bool any_covered = std::count(result.covered.begin(), result.covered.end(), true) > 2;
  std::vector<std::optional<Eigen::Vector3d>> rays;
  for (const Eigen::Vector2d& pixel : result.grid.pixels) rays.push_back(a.Unproject(pixel));
  Eigen::Quaterniond b_from_a = Eigen::Quaterniond::Identity();
  for (int iteration = 0; iteration < 20; ++iteration) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (size_t i = 0; i < rays.size(); ++i) {
      if (!rays[i] || (any_covered && !result.covered[i])) continue;
      const Eigen::Vector3d ray = b_from_a * *rays[i];
      Eigen::Matrix<double, 2, 3> by_point;
      const auto pixel = b.Project(ray, &by_point);
      if (!pixel) continue;
      const Eigen::Matrix<double, 2, 3> j = by_point * -Skew(ray);
      normal += j.transpose() * j;
      right += j.transpose() * (*pixel - result.grid.pixels[i]);
    }
    const Eigen::Vector3d step = normal.ldlt().solve(right);
    if (!step.allFinite()) break;
    b_from_a = (ExpSO3(-step) * b_from_a).normalized();
    if (step.norm() < 1e-10) break;
  }
  result.rotation_rad = LogSO3(b_from_a).norm();
  double sum = 0, n = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    const auto pixel = rays[i] ? b.Project(b_from_a * *rays[i]) : std::nullopt;
    result.shift_px.push_back(pixel ? Eigen::Vector2d(*pixel - result.grid.pixels[i]) : Eigen::Vector2d(kNan, kNan));
    if (!pixel) continue;
    const double shift = result.shift_px.back().norm();
    result.max_px = std::max(result.max_px, shift);
    if (!result.covered[i]) continue;
    result.max_covered_px = std::max(result.max_covered_px, shift);
    sum += shift * shift;
    n += 1;
  }
  result.rms_covered_px = n > 0 ? std::sqrt(sum / n) : 0;
  return result;
}

CrossValidation CrossValidate(const CalibrationInput& input, const CalibrateOptions& options,
                              const Calibration& calibration, const std::vector<Coverage>& coverage,
                              ProgressSink& progress, const CancelToken& cancel) {
  CrossValidation result;
  // Every other frame, of those that are used, so that both halves have the same kinds of views.
  std::vector<bool> first(input.frames.size(), false), second(input.frames.size(), false);
  bool turn = false;
  for (size_t f = 0; f < input.frames.size(); ++f) {
    if (!calibration.frame_used[f]) continue;
    (turn ? second : first)[f] = true;
    turn = !turn;
  }
  constexpr int kLeast = 3;
  for (size_t c = 0; c < input.cameras.size(); ++c) {
    int views[2] = {0, 0};
    for (size_t v = 0; v < input.views.size(); ++v) {
      const CalibrationView& view = input.views[v];
      if (static_cast<size_t>(view.camera) != c || !calibration.views[v].used) continue;
      ++views[second[static_cast<size_t>(view.frame)] ? 1 : 0];
    }
    if (std::min(views[0], views[1]) < kLeast) {
      result.reason = input.cameras[c].name + " has too few pictures for two halves of at least three";
      return result;
    }
  }
  progress.Begin("calibrating two halves", 2);
  const std::vector<int> bends = options.board_shape ? std::vector<int>{0, 1, 2} : std::vector<int>();
  try {
    const Calibration a = Recalibrate(input, options, calibration, first, bends, cancel);
    progress.Advance(1);
    const Calibration b = Recalibrate(input, options, calibration, second, bends, cancel);
    progress.Advance(1);
    const std::vector<double> a_on_b = HoldOutRms(input, calibration, a, second, cancel);
    const std::vector<double> b_on_a = HoldOutRms(input, calibration, b, first, cancel);
    for (size_t c = 0; c < input.cameras.size(); ++c) {
      result.difference.push_back(CompareCameras(a.cameras[c].camera, b.cameras[c].camera, coverage[c]));
      const auto pooled = [](double x, double y) { return std::sqrt(0.5 * (x * x + y * y)); };
      result.rms_own_px.push_back(pooled(a.cameras[c].rms_px, b.cameras[c].rms_px));
      result.rms_other_px.push_back(pooled(a_on_b[c], b_on_a[c]));
      const double predicted = std::hypot(MeasureUncertainty(a.cameras[c], coverage[c]).rms_covered_px,
                                          MeasureUncertainty(b.cameras[c], coverage[c]).rms_covered_px);
      result.ratio.push_back(predicted > 0 ? result.difference[c].rms_covered_px / predicted : 0);
    }
    result.done = true;
  } catch (const NumericError& e) {
    result.reason = e.what();
  } catch (const InputError& e) {  // parameters that are no camera
    result.reason = e.what();
  }
  return result;
}

}  // namespace trigpoint

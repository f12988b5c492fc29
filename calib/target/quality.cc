#include "calib/target/quality.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <optional>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "calib/base/grid.h"

namespace trigpoint {
namespace {

constexpr double kRadToDeg = 180 / std::numbers::pi;
constexpr int kLeastInPart = 8;  // points, for a mean to say something

class Judge {
 public:
  explicit Judge(Quality* quality) : quality_(quality) {}

  void Add(FindingLevel level, const std::string& camera, const std::string& check, const std::string& reason,
           const std::string& advice = "") {
    quality_->findings.push_back({level, camera, check, reason, advice});
    quality_->level = std::max(quality_->level, level);
  }
  // A value that should not exceed its limits.
  void Above(double value, double warn, double refuse, const std::string& camera, const std::string& check,
             const std::string& reason, const std::string& advice) {
    if (value > refuse || !std::isfinite(value)) {
      Add(FindingLevel::kRefusal, camera, check, reason, advice);
    } else if (value > warn) {
      Add(FindingLevel::kWarning, camera, check, reason, advice);
    }
  }

 private:
  Quality* quality_;
};

// Root mean square of group means beyond what noise of `sigma` per coordinate explains.
struct Systematic {
  double sum = 0, noise = 0;
  int groups = 0;
  void Add(const Eigen::Vector2d& mean, int n, double sigma) {
    sum += mean.squaredNorm();
    noise += 2 * sigma * sigma / n;
    ++groups;
  }
  double Value() const { return groups > 0 ? std::sqrt(std::max(0.0, sum - noise) / groups) : 0; }
};

void JudgeViews(const CalibrationInput& input, const Calibration& calibration, int c, const CalibrationGates& gates,
                Judge& judge) {
  const CalibratedCamera& camera = calibration.cameras[static_cast<size_t>(c)];
  judge.Above(
      -camera.views_used, -gates.warn_views, -gates.refuse_views, camera.name, "pictures",
      fmt::format("{} could be used; expected at least {}", Counted(camera.views_used, "picture"), gates.warn_views),
      "take more: 20 to 40 sharp pictures, each from another place");
  std::vector<std::string> outliers;
  for (size_t v = 0; v < input.views.size(); ++v) {
    if (input.views[v].camera != c) continue;
    const ViewSummary& view = calibration.views[v];
    if (!view.used) outliers.push_back(input.views[v].image + " (" + view.reason + ")");
  }
  if (!outliers.empty()) {
    const bool many = 4 * outliers.size() > static_cast<size_t>(camera.views);
    judge.Add(many ? FindingLevel::kWarning : FindingLevel::kNote, camera.name, "outliers",
              fmt::format("{} of {} pictures don't fit the others and are left out: {}", outliers.size(), camera.views,
                          fmt::join(outliers, ", ")),
              "check them for motion blur, a bent board, reflections and corners on the wrong square");
  }
}

void JudgeTilt(const CalibrationInput& input, const Calibration& calibration, int c, const CalibrationGates& gates,
               Judge& judge) {
  const CalibratedCamera& camera = calibration.cameras[static_cast<size_t>(c)];
  std::vector<double> tilts;
  Eigen::Vector2d lean = Eigen::Vector2d::Zero();
  double weight = 0;
  for (size_t v = 0; v < input.views.size(); ++v) {
    const ViewSummary& view = calibration.views[v];
    if (input.views[v].camera != c || !view.used) continue;
    tilts.push_back(view.tilt_rad * kRadToDeg);
    // Tilts to the left and to the right determine the focal length alike: directions count modulo 180 deg.
    lean += view.tilt_rad * Eigen::Vector2d(std::cos(2 * view.azimuth_rad), std::sin(2 * view.azimuth_rad));
    weight += view.tilt_rad;
  }
  std::sort(tilts.rbegin(), tilts.rend());
  const double third = tilts.size() >= 3 ? tilts[2] : 0;
  const std::string advice =
      "photograph the board turned by 30 to 45 deg away from the picture's plane, to the left, right, up and down";
  judge.Above(-third, -gates.warn_tilt_deg, -gates.refuse_tilt_deg, camera.name, "tilt",
              fmt::format("the board is hardly tilted: three pictures have {:.0f} deg or more, expected at least "
                          "{:.0f} deg; focal length and distance cannot be told apart",
                          third, gates.warn_tilt_deg),
              advice);
  constexpr double kOneSided = 0.9;
  if (weight > 0 && third >= gates.warn_tilt_deg && lean.norm() > kOneSided * weight) {
    judge.Add(FindingLevel::kWarning, camera.name, "tilt", "the board is tilted about one direction only", advice);
  }
}

// Principal point and proportions of the pixels against what cameras have.
void JudgeIntrinsics(const CalibratedCamera& camera, Judge& judge) {
  const std::vector<double>& p = camera.camera.params();
  const double off = std::max(std::abs(p[2] - 0.5 * (camera.camera.width() - 1)) / camera.camera.width(),
                              std::abs(p[3] - 0.5 * (camera.camera.height() - 1)) / camera.camera.height());
  constexpr double kFarOff = 0.1;
  if (off > kFarOff) {
    judge.Add(FindingLevel::kWarning, camera.name, "principal point",
              fmt::format("the principal point lies {:.0f} % of the picture's size from its middle", 100 * off),
              "were the pictures cropped? Else take more pictures with the board tilted in all directions");
  }
  const double aspect = std::abs(p[0] / p[1] - 1) * 100,
               aspect_sigma = 100 *
                              std::sqrt(std::max(0.0, camera.covariance(0, 0) + camera.covariance(1, 1) -
                                                          2 * camera.covariance(0, 1))) /
                              p[0];
  if (aspect > 1 && aspect > 4 * aspect_sigma) {
    judge.Add(aspect > 5 ? FindingLevel::kRefusal : FindingLevel::kWarning, camera.name, "board",
              fmt::format("fx and fy differ by {:.1f} %, but pixels of a camera are square: the board seems to differ "
                          "from its description",
                          aspect),
              "measure the board in both directions; was it printed stretched?");
  }
}

void JudgeFit(const Calibration& calibration, const Quality& quality, int c, const CalibrationGates& gates,
              Judge& judge) {
  const auto i = static_cast<size_t>(c);
  const CalibratedCamera& camera = calibration.cameras[i];
  const Coverage& coverage = quality.coverage[i];
  const std::string poor = fmt::format("{}", fmt::join(coverage.poor, ", "));
  judge.Above(
      -coverage.share, -gates.warn_coverage, -gates.refuse_coverage, camera.name, "coverage",
      fmt::format("the board covers {:.0f} % of the picture, expected at least {:.0f} %{}", 100 * coverage.share,
                  100 * gates.warn_coverage, coverage.poor.empty() ? "" : "; hardly any points: " + poor),
      coverage.poor.empty() ? "photograph the board in the parts of the picture that are empty on the coverage map"
                            : "photograph the board in these parts of the picture: " + poor);
  const Eigen::VectorXd sigmas = camera.Sigmas();
  const double focal = 100 * std::max(sigmas[0] / camera.camera.params()[0], sigmas[1] / camera.camera.params()[1]);
  judge.Above(focal, gates.warn_focal_sigma_percent, gates.refuse_focal_sigma_percent, camera.name, "focal length",
              fmt::format("the focal length is known to {:.2g} % (1 sigma), expected at most {:g} %", focal,
                          gates.warn_focal_sigma_percent),
              "photograph the board tilted by 30 to 45 deg, near enough to fill the picture");
  const ProjectionUncertainty& uncertainty = quality.uncertainty[i];
  judge.Above(
      uncertainty.max_covered_px, gates.warn_uncertainty_px, gates.refuse_uncertainty_px, camera.name, "uncertainty",
      fmt::format(
          "pixels are known to {:.2g} px (1 sigma, worst place where the board was seen), expected at most {:g} px",
          uncertainty.max_covered_px, gates.warn_uncertainty_px),
      "take more pictures, most of all where the uncertainty map is bright");
  judge.Above(
      camera.rms_px, gates.warn_rms_px, gates.refuse_rms_px, camera.name, "residuals",
      fmt::format("the residuals are {:.2f} px (rms), expected at most {:g} px", camera.rms_px, gates.warn_rms_px),
      "hold board and camera still, in good light, in focus; keep zoom and focus fixed; check that the board is "
      "flat and the target's description right");
  const double pattern = quality.pattern[i].systematic_px;
  const bool fisheye = camera.camera.model() == CameraModel::kKannalaBrandt;
  judge.Above(pattern, std::max(gates.warn_pattern_px, 0.3 * camera.sigma_px), gates.refuse_pattern_px, camera.name,
              "pattern",
              fmt::format("the residuals follow a pattern over the picture: {:.2f} px of them is systematic", pattern),
              fisheye ? "the lens or the board isn't as modelled: try board_shape=true or another model"
                      : "the lens or the board isn't as modelled: try model=rational, for a fisheye kannala_brandt, or "
                        "board_shape=true");
  if (uncertainty.no_ray_share > 0) {
    judge.Add(FindingLevel::kWarning, camera.name, "model",
              fmt::format("{:.1f} % of the picture has no ray: the distortion folds back there, beyond the points that "
                          "were seen",
                          100 * uncertainty.no_ray_share),
              "photograph the board there, or use a model with fewer coefficients");
  }
  JudgeIntrinsics(camera, judge);
}

// The board's proportions, estimated as well; nothing if they are not to be told from these pictures.
std::optional<BoardShape> EstimateProportions(const CalibrationInput& input, const CalibrateOptions& options,
                                              const Calibration& calibration, const CancelToken& cancel) {
  std::vector<int> free;
  for (int i = options.board_shape ? 0 : 3; i < (input.target.kind == TargetKind::kAprilGrid ? 6 : 5); ++i) {
    free.push_back(i);
  }
  try {
    Calibration freed = Recalibrate(input, options, calibration, calibration.frame_used, free, cancel);
    freed.board.sigma *= calibration.sigma_factor;
    return freed.board;
  } catch (const NumericError&) {
  } catch (const InputError&) {
  }
  return std::nullopt;
}

// What of the residuals belongs to points of the board; `sigma` is that of the points, all in px.
double SystematicByPoint(const CalibrationInput& input, const Calibration& calibration, double sigma) {
  std::map<int, std::pair<Eigen::Vector2d, int>> by_point;
  for (const PointResidual& r : calibration.residuals) {
    if (!r.used) continue;
    const CalibrationView& view = input.views[static_cast<size_t>(r.view)];
    // Along the board's own x and y as they appear in the picture, so that turned boards add up.
    const Rigid3d cam_from_board = calibration.cameras[static_cast<size_t>(view.camera)].cam_from_rig *
                                   calibration.rig_from_board[static_cast<size_t>(view.frame)];
    const Eigen::Vector3d x = cam_from_board.rotation * Eigen::Vector3d::UnitX();
    const double norm = x.head<2>().norm();
    if (norm < 0.3) continue;
    const Eigen::Vector2d along = x.head<2>() / norm;
    auto& [sum, n] = by_point.emplace(r.point, std::pair(Eigen::Vector2d(0, 0), 0)).first->second;
    sum += Eigen::Vector2d(along.dot(r.residual), -along.y() * r.residual.x() + along.x() * r.residual.y());
    ++n;
  }
  Systematic systematic;
  for (const auto& [point, mean] : by_point) {
    if (mean.second >= 4) systematic.Add(mean.first / mean.second, mean.second, sigma);
  }
  return systematic.Value();
}

// Estimates the proportions of the board as well and tests whether they differ from its description.
void JudgeBoard(const CalibrationInput& input, const CalibrateOptions& options, const Calibration& calibration,
                const CalibrationGates& gates, Judge& judge, Quality* quality, const CancelToken& cancel) {
  const std::string advice =
      "measure the board: square sizes in both directions, tag size and gap; rows and columns "
      "exchanged?";
  if (const std::optional<BoardShape> freed = EstimateProportions(input, options, calibration, cancel)) {
    quality->proportions = *freed;
    constexpr double kSure = 5;  // sigmas
    const auto test = [&](int i, double percent, const std::string& what) {
      if (std::abs(freed->values[i]) < kSure * freed->sigma[i]) return;
      judge.Above(std::abs(percent), gates.warn_board_percent, gates.refuse_board_percent, "", "board",
                  fmt::format("the board isn't as described: {} by {:.2f} %", what, std::abs(percent)), advice);
    };
    const double stretch = 100 * freed->values[3];
    test(3, stretch, stretch > 0 ? "it is longer along its columns" : "it is shorter along its columns");
    test(4, 100 * freed->values[4], "it is sheared");
    if (input.target.kind == TargetKind::kAprilGrid) {
      const double gap = 100 * freed->values[5] / input.target.spacing_x_m;
      test(
          5, gap,
          fmt::format("gaps between tags are {} (tagSpacing {:.3f} instead of {:.3f}), of the tag size",
                      gap > 0 ? "wider" : "narrower", input.target.tag_spacing + 0.01 * gap, input.target.tag_spacing));
    }
  }
  double sigma = 0;
  for (const CalibratedCamera& camera : calibration.cameras) sigma = std::max(sigma, camera.sigma_px);
  quality->board_systematic_px = SystematicByPoint(input, calibration, sigma);
  judge.Above(quality->board_systematic_px, std::max(gates.warn_pattern_px, 0.4 * sigma), gates.refuse_pattern_px, "",
              "board",
              fmt::format("{:.2f} px of the residuals belong to the board's points: it isn't flat or not as described",
                          quality->board_systematic_px),
              "use a flat, rigid board (glass, aluminium), or board_shape=true; " + advice);
}

// Times what is predicted. By chance one calibration in 300: a difference has about four independent parts, as its
// lens has some eight parameters whose effects overlap; the mean of their squares is above 4 with p = 0.003.
constexpr double kOptimistic = 2;

// Cameras of one rig share the boards, and so what is wrong with them: one factor for all.
void WidenToHalves(const CrossValidation& halves, Calibration* calibration) {
  if (!halves.done) return;
  const double worst = *std::max_element(halves.ratio.begin(), halves.ratio.end());
  if (worst <= kOptimistic) return;
  calibration->sigma_factor = worst;
  for (CalibratedCamera& camera : calibration->cameras) {
    camera.covariance *= worst * worst;
    camera.cam_from_rig_covariance *= worst * worst;
  }
  calibration->board.sigma *= worst;
  calibration->covariance *= worst * worst;
}

void JudgeHalves(const Calibration& calibration, const CalibrationGates& gates, Judge& judge, const Quality& quality) {
  const CrossValidation& halves = quality.halves;
  if (!halves.done) {
    judge.Add(FindingLevel::kWarning, "", "halves", "no cross-validation: " + halves.reason, "take more pictures");
    return;
  }
  for (size_t c = 0; c < calibration.cameras.size(); ++c) {
    const std::string& name = calibration.cameras[c].name;
    const double rms = halves.difference[c].rms_covered_px;
    judge.Above(rms, gates.warn_halves_px, gates.refuse_halves_px, name, "halves",
                fmt::format("two halves of the pictures give cameras that differ by {:.2f} px (rms where the board was "
                            "seen)",
                            rms),
                "take more pictures, with more tilt and better coverage, and keep zoom and focus fixed");
    if (halves.ratio[c] > kOptimistic) {
      judge.Add(FindingLevel::kWarning, name, "halves",
                fmt::format("two halves of the pictures differ {:.1f} times as much as the residuals predict: the "
                            "residuals are not only noise; all stated sigmas are those of the residuals times {:.1f}",
                            halves.ratio[c], calibration.sigma_factor),
                "a model or board that fits better makes the sigmas smaller; see the residual plots");
    }
  }
}

}  // namespace

std::string_view FindingLevelName(FindingLevel level) {
  switch (level) {
    case FindingLevel::kNote: return "note";
    case FindingLevel::kWarning: return "warning";
    case FindingLevel::kRefusal: return "refusal";
  }
  return "";
}

ResidualPattern ImagePattern(const CalibrationInput& input, const Calibration& calibration, int camera, int cols) {
  const auto& size = input.cameras[static_cast<size_t>(camera)];
  ResidualPattern pattern;
  pattern.cols = cols;
  pattern.rows = std::max(2, static_cast<int>(std::lround(static_cast<double>(cols) * size.height / size.width)));
  const auto parts = CellCount(pattern.rows, pattern.cols);
  pattern.mean_px.assign(parts, Eigen::Vector2d::Zero());
  pattern.points.assign(parts, 0);
  for (const PointResidual& r : calibration.residuals) {
    if (!r.used || input.views[static_cast<size_t>(r.view)].camera != camera) continue;
    const int c = std::clamp(static_cast<int>((r.pixel.x() + 0.5) / size.width * pattern.cols), 0, pattern.cols - 1);
    const int row = std::clamp(static_cast<int>((r.pixel.y() + 0.5) / size.height * pattern.rows), 0, pattern.rows - 1);
    const auto part = CellIndex(row, c, pattern.cols);
    pattern.mean_px[part] += r.residual;
    ++pattern.points[part];
  }
  Systematic systematic;
  for (size_t part = 0; part < parts; ++part) {
    if (pattern.points[part] < kLeastInPart) {
      pattern.mean_px[part].setConstant(std::numeric_limits<double>::quiet_NaN());
      continue;
    }
    pattern.mean_px[part] /= pattern.points[part];
    systematic.Add(pattern.mean_px[part], pattern.points[part],
                   calibration.cameras[static_cast<size_t>(camera)].sigma_px);
  }
  pattern.systematic_px = systematic.Value();
  return pattern;
}

Quality JudgeCalibration(const CalibrationInput& input, const CalibrateOptions& options, const CalibrationGates& gates,
                         ProgressSink& progress, const CancelToken& cancel, Calibration* calibrated) {
  const Calibration& calibration = *calibrated;
  Quality quality;
  Judge judge(&quality);
  const auto cameras = static_cast<int>(calibration.cameras.size());
  for (int c = 0; c < cameras; ++c) {
    quality.coverage.push_back(MeasureCoverage(input, calibration, c));
    quality.uncertainty.push_back(
        MeasureUncertainty(calibration.cameras[static_cast<size_t>(c)], quality.coverage.back()));
    quality.pattern.push_back(ImagePattern(input, calibration, c));
  }
  quality.halves = CrossValidate(input, options, calibration, quality.coverage, progress, cancel);
  WidenToHalves(quality.halves, calibrated);
  for (ProjectionUncertainty& u : quality.uncertainty) u.Multiply(calibration.sigma_factor);
  if (!calibration.determined) {
    judge.Add(FindingLevel::kRefusal, "", "determined", "these pictures do not determine all parameters",
              "photograph the board tilted in several directions, and in all parts of the picture");
  }
  for (int c = 0; c < cameras; ++c) {
    JudgeViews(input, calibration, c, gates, judge);
    JudgeTilt(input, calibration, c, gates, judge);
    JudgeFit(calibration, quality, c, gates, judge);
  }
  JudgeBoard(input, options, calibration, gates, judge, &quality, cancel);
  JudgeHalves(calibration, gates, judge, quality);
  judge.Add(FindingLevel::kNote, "", "size",
            "a wrong size of the board (" + input.target.Text() +
                ") cannot be seen in its pictures: intrinsics don't depend on it, but " +
                (cameras > 1 ? "the rig's baselines and " : "") + "distances to the board scale with it",
            "measure the printed board over its whole length and compare");
  if (cameras > 1 && input.target.LooksTheSameTurned()) {
    judge.Add(FindingLevel::kNote, "", "board",
              "the board looks the same when turned by 180 deg; of the two orders of its points, the one in which the "
              "cameras agree was taken",
              "a board with an odd number of corners along one side and an even number along the other is unambiguous");
  }
  std::stable_sort(quality.findings.begin(), quality.findings.end(),
                   [](const Finding& a, const Finding& b) { return a.level > b.level; });
  return quality;
}

}  // namespace trigpoint

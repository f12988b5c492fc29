#include "calib/target/calibrate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <utility>

#include "calib/base/error.h"
#include "calib/base/median.h"
#include "calib/camera/projection.h"
#include "calib/estimation/loss.h"
#include "calib/target/board_problem.h"

namespace trigpoint {
namespace {

constexpr int kLeastViews = 3;          // of a camera
constexpr size_t kLeastPoints = 6;      // of a view that takes part
constexpr double kLeastSigmaPx = 1e-3;  // pictures without any noise
constexpr int kIterations = 200;

struct ModelChoice {
  CameraModel model = CameraModel::kRadtan;
  size_t params = 9;
};

constexpr const char* kModels[] = {"pinhole", "radtan", "radtan5", "rational", "kannala_brandt"};

ModelChoice ModelNamed(const std::string& name) {
  if (name == "pinhole") return {CameraModel::kPinhole, 4};
  if (name == "radtan") return {CameraModel::kRadtan, 8};
  if (name == "radtan5") return {CameraModel::kRadtan, 9};
  if (name == "rational") return {CameraModel::kRational, 12};
  return {CameraModel::kKannalaBrandt, 8};
}

std::vector<std::string> SplitAtCommas(const std::string& text) {
  std::vector<std::string> parts(1);
  for (char c : text) {
    if (c == ',') {
      parts.emplace_back();
    } else if (c != ' ') {
      parts.back() += c;
    }
  }
  return parts;
}

// The model of each camera; the last one named holds for all further cameras.
ModelChoice ModelOf(const CalibrateOptions& options, size_t camera) {
  const std::vector<std::string> names = SplitAtCommas(options.model);
  return ModelNamed(names[std::min(camera, names.size() - 1)]);
}

std::vector<int> Range(int begin, int end) {
  std::vector<int> all;
  for (int i = begin; i < end; ++i) all.push_back(i);
  return all;
}

std::vector<int> FreeIntrinsics(const CameraState& camera) {
  std::vector<int> free = Range(0, static_cast<int>(camera.params.size()));
  if (camera.square_pixels) free.erase(free.begin() + 1);
  return free;
}

// The camera with its present parameters; nothing if they are not valid.
std::optional<Camera> AsCamera(const CameraState& state, int width, int height) {
  try {
    return Camera(state.model, width, height, state.params);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

// Which parameters are free in each step of a start.
std::vector<std::vector<int>> StartSteps(int count, bool fisheye) {
  std::vector<std::vector<int>> steps = {{0}};
  if (count > 4) steps.push_back({0, 4});
  if (fisheye) {
    steps.push_back({0, 2, 3, 4, 5});
  } else if (count > 4) {
    steps.push_back({0, 2, 3, 4, 5, 6, 7});
  }
  steps.push_back(Range(0, std::min(count, 9)));
  if (count > 9) steps.push_back(Range(0, count));
  return steps;
}

// Above 1: two candidates for one pose don't agree.
double Disagreement(const Rigid3d& a, const Rigid3d& b) {
  const double size = std::max({0.1 * a.translation.norm(), 0.1 * b.translation.norm(), 1e-3});
  return AngleBetween(a.rotation, b.rotation) / 0.05 + (a.translation - b.translation).norm() / size;
}

// The candidate that most others agree with.
Rigid3d MostAgreed(const std::vector<Rigid3d>& candidates) {
  double least = std::numeric_limits<double>::infinity();
  Rigid3d best;
  for (const Rigid3d& candidate : candidates) {
    double sum = 0;
    for (const Rigid3d& other : candidates) sum += std::min(1.0, Disagreement(candidate, other));
    if (sum < least) {
      least = sum;
      best = candidate;
    }
  }
  return best;
}

using ViewTable = std::vector<std::vector<int>>;  // camera, frame: the view whose board pose is known; -1: none

struct CameraPair {
  size_t from = 0, to = 0;
  size_t shared = 0;  // frames in which both have a board pose
};

// The camera to be placed that shares most frames with one that is placed.
CameraPair NextToPlace(const ViewTable& view_of, const std::vector<bool>& placed) {
  CameraPair best;
  for (size_t a = 0; a < placed.size(); ++a) {
    for (size_t b = 0; b < placed.size(); ++b) {
      if (!placed[a] || placed[b]) continue;
      size_t shared = 0;
      for (size_t f = 0; f < view_of[a].size(); ++f) shared += view_of[a][f] >= 0 && view_of[b][f] >= 0;
      if (shared > best.shared) best = {a, b, shared};
    }
  }
  return best;
}

class Calibrator {
 public:
  Calibrator(const CalibrationInput& input, const CalibrateOptions& options, const CancelToken& cancel)
      : input_(input), options_(options), cancel_(cancel), board_(input.target) {
    problem_.board = &board_;
    problem_.rig_from_board.resize(input.frames.size());
    problem_.frame_used.assign(input.frames.size(), false);
    reasons_.resize(input.views.size());
    for (size_t v = 0; v < input.views.size(); ++v) {
      const CalibrationView& view = input.views[v];
      for (const BoardPoint& point : view.points) {
        problem_.observations.push_back({view.camera, view.frame, static_cast<int>(v), point.id, point.pixel, true});
      }
    }
    for (size_t c = 0; c < input.cameras.size(); ++c) {
      const ModelChoice choice = ModelOf(options, c);
      CameraState camera;
      camera.model = choice.model;
      camera.params.assign(choice.params, 0.0);
      camera.square_pixels = options.square_pixels;
      problem_.cameras.push_back(camera);
    }
  }

  void Start() {
    cam_from_board_.resize(input_.views.size());
    for (size_t c = 0; c < input_.cameras.size(); ++c) {
      cancel_.ThrowIfCancelled();
      StartOne(c);
    }
    StartRig();
  }

  // From an earlier solution.
  void TakeCameras(const Calibration& from) {
    for (size_t c = 0; c < problem_.cameras.size(); ++c) {
      problem_.cameras[c].params = from.cameras[c].camera.params();
      problem_.cameras[c].cam_from_rig = from.cameras[c].cam_from_rig;
      problem_.cameras[c].sigma_px = from.cameras[c].sigma_px;
    }
    problem_.shape = from.board.values;
  }

  void StartFrom(const Calibration& start, const std::vector<bool>& keep) {
    problem_.rig_from_board = start.rig_from_board;
    TakeCameras(start);
    for (size_t i = 0; i < problem_.observations.size(); ++i) {
      problem_.observations[i].used = start.residuals[i].used;
      problem_.observations[i].point = start.residuals[i].point;
    }
    for (size_t f = 0; f < keep.size(); ++f) problem_.frame_used[f] = start.frame_used[f] && keep[f];
  }

  // Least squares of everything that is free over the points in use.
  void Solve(const std::vector<int>& free_shape, bool free_cameras) {
    for (CameraState& camera : problem_.cameras)
      camera.free = free_cameras ? FreeIntrinsics(camera) : std::vector<int>();
    problem_.free_extrinsics = free_cameras;
    problem_.free_shape = free_shape;
    report_ = SolveBoardProblem(problem_, nullptr, kIterations, cancel_);
    if (!report_.usable)
      throw NumericError("the calibration did not converge; check the pictures and the target's description");
    SetSigmas();
  }

  // Solves with a robust loss and leaves out what doesn't fit, until nothing changes.
  void SolveAndReject(const std::vector<int>& free_shape, ProgressSink& progress) {
    for (CameraState& camera : problem_.cameras) camera.free = FreeIntrinsics(camera);
    problem_.free_extrinsics = true;
    constexpr double kKnee = 9;  // of the whitened squared residual
    HuberChi2Loss loss(kKnee);
    if (options_.reject) {
      for (int round = 0; round < 2; ++round) {
        SetRobustSigmas();
        SolveBoardProblem(problem_, &loss, kIterations, cancel_);
        progress.Advance(1);
      }
      problem_.free_shape = free_shape;
      constexpr int kRounds = 6;
      for (int round = 0; round < kRounds; ++round) {
        SetRobustSigmas();
        if (!Reject() && round > 0) break;
        SolveBoardProblem(problem_, nullptr, kIterations, cancel_);
        progress.Advance(1);
      }
    }
    Solve(free_shape, true);
  }

  std::vector<double> Rms() const {
    auto [sum, n] = SquaredResiduals();
    for (size_t c = 0; c < sum.size(); ++c) sum[c] = n[c] > 0 ? std::sqrt(sum[c] / n[c]) : 0;
    return sum;
  }

  Calibration Result() const;

 private:
  std::vector<size_t> ViewsOf(size_t camera) const {
    std::vector<size_t> views;
    for (size_t v = 0; v < input_.views.size(); ++v) {
      if (static_cast<size_t>(input_.views[v].camera) == camera) views.push_back(v);
    }
    return views;
  }

  const Rigid3d& PoseOf(int view) const { return *cam_from_board_[static_cast<size_t>(view)]; }

  void StartOne(size_t c);
  BoardProblem ProblemOf(size_t c, const CameraStart& start) const;
  void TakeBetterPoses(const Camera& camera, const std::vector<size_t>& views, BoardProblem& one) const;
  void StartRig();
  void PlaceCamera(size_t from, size_t to, const ViewTable& view_of);
  CalibratedCamera CameraResult(size_t c, const Eigen::MatrixXd& covariance, Eigen::Index at) const;
  void AddParameters(Calibration& result) const;
  void AddResiduals(Calibration& result) const;
  void DescribeViews(Calibration& result) const;
  void SetRobustSigmas();
  void SetSigmas();
  // Of each camera: the sum over its active observations, and how many they are.
  std::pair<std::vector<double>, std::vector<double>> SquaredResiduals() const;
  bool Reject();
  void RefreshLeftOutFrames();

  const CalibrationInput& input_;
  const CalibrateOptions& options_;
  const CancelToken& cancel_;
  BoardGeometry board_;
  BoardProblem problem_;
  std::vector<std::optional<Rigid3d>> cam_from_board_;  // of each view, where it is known
  std::vector<std::string> reasons_;                    // why a view is left out
  SolveReport report_;
};

// Camera c by itself.
BoardProblem Calibrator::ProblemOf(size_t c, const CameraStart& start) const {
  BoardProblem one;
  one.board = &board_;
  one.rig_from_board.resize(input_.frames.size());
  one.frame_used.assign(input_.frames.size(), false);
  one.cameras = {problem_.cameras[c]};
  std::copy_n(start.camera.params().begin(), 4, one.cameras[0].params.begin());
  for (const auto& [view, pose] : start.cam_from_board) {
    const auto f = static_cast<size_t>(input_.views[static_cast<size_t>(view)].frame);
    one.rig_from_board[f] = pose;
    one.frame_used[f] = true;
  }
  for (BoardObservation o : problem_.observations) {
    if (static_cast<size_t>(o.camera) != c) continue;
    o.camera = 0;
    one.observations.push_back(o);
  }
  return one;
}

// A plane has two poses, and a poor camera may have preferred the wrong one.
void Calibrator::TakeBetterPoses(const Camera& camera, const std::vector<size_t>& views, BoardProblem& one) const {
  for (size_t v : views) {
    const auto f = static_cast<size_t>(input_.views[v].frame);
    const double rms = one.frame_used[f] ? BoardRms(camera, board_, one.rig_from_board[f], input_.views[v].points)
                                         : std::numeric_limits<double>::infinity();
    for (const Rigid3d& pose : BoardPoses(camera, board_, input_.views[v].points)) {
      if (BoardRms(camera, board_, pose, input_.views[v].points) >= rms) continue;
      one.rig_from_board[f] = pose;
      one.frame_used[f] = true;
      break;
    }
  }
}

// Intrinsics of one camera by itself, from few parameters to all.
void Calibrator::StartOne(size_t c) {
  const auto& size = input_.cameras[c];
  const std::vector<size_t> views = ViewsOf(c);
  if (static_cast<int>(views.size()) < kLeastViews) {
    throw InputError(fmt::format(
        "{}: the board was found in {} of its pictures, at least {} are needed (20 to 40 are good): photograph it from "
        "more sides, tilted by 20 to 45 deg, near and far, and into the corners of the picture",
        size.name, views.size(), kLeastViews));
  }
  CameraState& state = problem_.cameras[c];
  const bool fisheye = state.model == CameraModel::kKannalaBrandt;
  const CameraStart start =
      StartCamera(input_, static_cast<int>(c), fisheye ? CameraModel::kKannalaBrandt : CameraModel::kPinhole, board_);
  if (static_cast<int>(start.cam_from_board.size()) < kLeastViews) {
    throw NumericError(size.name +
                       ": no focal length fits the board in three pictures; check the target's description "
                       "(rows, columns, kind)");
  }
  BoardProblem one = ProblemOf(c, start);
  CameraState& camera = one.cameras[0];
  const std::vector<std::vector<int>> steps = StartSteps(static_cast<int>(camera.params.size()), fisheye);
  HuberChi2Loss loss(4.0);  // px^2: sigma is 1 px here
  for (size_t i = 0; i < steps.size(); ++i) {
    const bool all = i + 1 == steps.size() || steps[i].size() >= 9;
    camera.square_pixels = options_.square_pixels || !all;
    camera.free = steps[i];
    if (camera.square_pixels) std::erase(camera.free, 1);
    SolveBoardProblem(one, &loss, kIterations, cancel_);
    const std::optional<Camera> now = AsCamera(camera, size.width, size.height);
    if (now) TakeBetterPoses(*now, views, one);
  }
  SolveBoardProblem(one, &loss, kIterations, cancel_);
  if (!AsCamera(camera, size.width, size.height)) {
    throw NumericError(size.name +
                       ": no camera model fits the pictures; check the target's description, and that all "
                       "pictures are from one camera with one zoom");
  }
  state.params = camera.params;
  for (size_t v : views) {
    const auto f = static_cast<size_t>(input_.views[v].frame);
    if (one.frame_used[f]) cam_from_board_[v] = one.rig_from_board[f];
  }
}

// Camera `to` by the frames it shares with `from`, which is placed.
void Calibrator::PlaceCamera(size_t from, size_t to, const ViewTable& view_of) {
  // A board that looks the same turned by half may have been counted from the other corner.
  const Rigid3d turned(Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitZ())),
                       2 * board_.Middle());
  const std::vector<Rigid3d> turns =
      input_.target.LooksTheSameTurned() ? std::vector<Rigid3d>{Rigid3d(), turned} : std::vector<Rigid3d>{Rigid3d()};
  std::vector<Rigid3d> candidates;
  std::vector<int> views;  // of `to`, one a candidate
  for (size_t f = 0; f < input_.frames.size(); ++f) {
    if (view_of[from][f] < 0 || view_of[to][f] < 0) continue;
    for (const Rigid3d& turn : turns) {
      candidates.push_back(PoseOf(view_of[to][f]) * turn * PoseOf(view_of[from][f]).Inverse());
      views.push_back(view_of[to][f]);
    }
  }
  const Rigid3d to_from_from = MostAgreed(candidates);
  problem_.cameras[to].cam_from_rig = to_from_from * problem_.cameras[from].cam_from_rig;
  for (size_t i = 0; turns.size() > 1 && i < candidates.size(); i += 2) {
    if (Disagreement(candidates[i], to_from_from) <= Disagreement(candidates[i + 1], to_from_from)) continue;
    cam_from_board_[static_cast<size_t>(views[i])] = PoseOf(views[i]) * turned;
    for (BoardObservation& o : problem_.observations) {
      if (o.view == views[i]) o.point = board_.size() - 1 - o.point;
    }
  }
}

// cam_from_rig and the frames' rig_from_board from the cameras' own board poses.
void Calibrator::StartRig() {
  const size_t cameras = problem_.cameras.size(), frames = input_.frames.size();
  ViewTable view_of(cameras, std::vector<int>(frames, -1));
  for (size_t v = 0; v < input_.views.size(); ++v) {
    if (cam_from_board_[v]) {
      view_of[static_cast<size_t>(input_.views[v].camera)][static_cast<size_t>(input_.views[v].frame)] =
          static_cast<int>(v);
    }
  }
  std::vector<bool> placed(cameras, false);
  placed[0] = true;
  for (size_t step = 1; step < cameras; ++step) {
    const CameraPair pair = NextToPlace(view_of, placed);
    if (pair.shared == 0) {
      std::string alone;
      for (size_t b = 0; b < cameras; ++b) {
        if (!placed[b]) alone += (alone.empty() ? "" : ", ") + input_.cameras[b].name;
      }
      throw InputError(alone +
                       ": shares no picture of the board with the other cameras; photograph the board where two "
                       "cameras see it at once, and name pictures of one moment alike");
    }
    PlaceCamera(pair.from, pair.to, view_of);
    placed[pair.to] = true;
  }
  for (size_t f = 0; f < frames; ++f) {
    for (size_t c = 0; c < cameras && !problem_.frame_used[f]; ++c) {
      if (view_of[c][f] < 0) continue;
      problem_.rig_from_board[f] = problem_.cameras[c].cam_from_rig.Inverse() * PoseOf(view_of[c][f]);
      problem_.frame_used[f] = true;
    }
  }
}

// From the middle of the residuals of all points, so that outliers don't count.
void Calibrator::SetRobustSigmas() {
  std::vector<std::vector<double>> sizes(problem_.cameras.size());
  for (const BoardObservation& o : problem_.observations) {
    Eigen::Vector2d r = Eigen::Vector2d::Zero();
    if (!problem_.frame_used[static_cast<size_t>(o.frame)] || !BoardResidual(problem_, o, &r)) continue;
    sizes[static_cast<size_t>(o.camera)].push_back(std::abs(r.x()));
    sizes[static_cast<size_t>(o.camera)].push_back(std::abs(r.y()));
  }
  for (size_t c = 0; c < sizes.size(); ++c) {
    problem_.cameras[c].sigma_px = std::max(kLeastSigmaPx, 1.4826 * Median(sizes[c]));
  }
}

std::pair<std::vector<double>, std::vector<double>> Calibrator::SquaredResiduals() const {
  std::vector<double> sum(problem_.cameras.size(), 0), n(sum.size(), 0);
  for (const BoardObservation& o : problem_.observations) {
    Eigen::Vector2d r = Eigen::Vector2d::Zero();
    if (!problem_.IsActive(o) || !BoardResidual(problem_, o, &r)) continue;
    sum[static_cast<size_t>(o.camera)] += r.squaredNorm();
    n[static_cast<size_t>(o.camera)] += 1;
  }
  return {std::move(sum), std::move(n)};
}

void Calibrator::SetSigmas() {
  const auto [sum, n] = SquaredResiduals();
  const double all = 2 * std::accumulate(n.begin(), n.end(), 0.0);
  const double freedom = std::max(1.0, all - FreeParameters(problem_));
  for (size_t c = 0; c < sum.size(); ++c) {
    problem_.cameras[c].sigma_px = n[c] > 0 ? std::max(kLeastSigmaPx, std::sqrt(sum[c] / (2 * n[c]) * all / freedom))
                                            : problem_.cameras[c].sigma_px;
  }
}

// Poses of frames that take no part at present, so that they can come back.
void Calibrator::RefreshLeftOutFrames() {
  for (size_t v = 0; v < input_.views.size(); ++v) {
    const CalibrationView& view = input_.views[v];
    const auto f = static_cast<size_t>(view.frame), c = static_cast<size_t>(view.camera);
    if (problem_.frame_used[f]) continue;
    const std::optional<Camera> camera =
        AsCamera(problem_.cameras[c], input_.cameras[c].width, input_.cameras[c].height);
    if (!camera) continue;
    const std::vector<Rigid3d> poses = BoardPoses(*camera, board_, view.points);
    if (!poses.empty()) problem_.rig_from_board[f] = problem_.cameras[c].cam_from_rig.Inverse() * poses.front();
  }
}

// Decides anew which points and views take part; true if anything changed.
bool Calibrator::Reject() {
  RefreshLeftOutFrames();
  std::vector<std::vector<size_t>> of_view(input_.views.size());
  std::vector<double> error(problem_.observations.size(), std::numeric_limits<double>::infinity());  // sigmas
  for (size_t i = 0; i < problem_.observations.size(); ++i) {
    const BoardObservation& o = problem_.observations[i];
    of_view[static_cast<size_t>(o.view)].push_back(i);
    Eigen::Vector2d r = Eigen::Vector2d::Zero();
    if (BoardResidual(problem_, o, &r)) error[i] = r.norm() / problem_.cameras[static_cast<size_t>(o.camera)].sigma_px;
  }
  bool changed = false;
  std::vector<bool> frame_used(problem_.frame_used.size(), false);
  for (size_t v = 0; v < of_view.size(); ++v) {
    size_t good = 0;
    for (size_t i : of_view[v]) good += error[i] <= options_.reject_sigmas;
    const size_t all = of_view[v].size();
    const bool keep = good >= kLeastPoints && 2 * good >= all;
    reasons_[v] = keep ? ""
                       : fmt::format("{} of its {} points are more than {:g} sigma off (sigma {:.3f} px)", all - good,
                                     all, options_.reject_sigmas,
                                     problem_.cameras[static_cast<size_t>(input_.views[v].camera)].sigma_px);
    for (size_t i : of_view[v]) {
      const bool use = keep && error[i] <= options_.reject_sigmas;
      changed = changed || problem_.observations[i].used != use;
      problem_.observations[i].used = use;
    }
    if (keep) frame_used[static_cast<size_t>(input_.views[v].frame)] = true;
  }
  problem_.frame_used = frame_used;
  return changed;
}

// `covariance` is that of all free parameters; the camera's begin at `at`.
CalibratedCamera Calibrator::CameraResult(size_t c, const Eigen::MatrixXd& covariance, Eigen::Index at) const {
  const CameraState& state = problem_.cameras[c];
  const auto& size = input_.cameras[c];
  CalibratedCamera camera;
  camera.name = size.name;
  camera.camera = Camera(state.model, size.width, size.height, state.params);
  camera.parameters = CameraParameterNames(state.model, state.params.size());
  camera.cam_from_rig = state.cam_from_rig;
  camera.sigma_px = state.sigma_px;
  const auto count = static_cast<Eigen::Index>(state.params.size());
  Eigen::MatrixXd spread = Eigen::MatrixXd::Zero(count, static_cast<Eigen::Index>(state.free.size()));
  for (size_t i = 0; i < state.free.size(); ++i) {
    spread(state.free[i], static_cast<Eigen::Index>(i)) = 1;
    if (state.square_pixels && state.free[i] == 0) spread(1, static_cast<Eigen::Index>(i)) = 1;
  }
  camera.covariance = spread * covariance.block(at, at, spread.cols(), spread.cols()) * spread.transpose();
  return camera;
}

// Cameras and board, and what names the rows of the covariance.
void Calibrator::AddParameters(Calibration& result) const {
  Eigen::Index at = 0;
  for (size_t c = 0; c < problem_.cameras.size(); ++c) {
    result.cameras.push_back(CameraResult(c, result.covariance, at));
    const CalibratedCamera& camera = result.cameras.back();
    for (int i : problem_.cameras[c].free) {
      result.labels.push_back(camera.name + " " + camera.parameters[static_cast<size_t>(i)]);
      ++at;
    }
  }
  for (size_t c = 1; c < problem_.cameras.size(); ++c) {
    if (!problem_.free_extrinsics) break;
    result.cameras[c].cam_from_rig_covariance = result.covariance.block<6, 6>(at, at);
    for (const char* axis : {"rx", "ry", "rz", "tx", "ty", "tz"}) {
      result.labels.push_back(result.cameras[c].name + " " + axis);
    }
    at += 6;
  }
  for (int i : problem_.free_shape) {
    result.board.sigma[i] = std::sqrt(std::max(0.0, result.covariance(at, at)));
    result.labels.push_back(std::string("board ") + BoardShape::kNames[i]);
    ++at;
  }
}

// All residuals, with their number and size in each camera and view.
void Calibrator::AddResiduals(Calibration& result) const {
  result.views.resize(input_.views.size());
  std::vector<double> all_sum(result.cameras.size(), 0), used_sum(result.cameras.size(), 0);
  std::vector<double> view_used(result.views.size(), 0), view_all(result.views.size(), 0);
  for (const BoardObservation& o : problem_.observations) {
    const auto v = static_cast<size_t>(o.view), c = static_cast<size_t>(o.camera);
    PointResidual residual;
    residual.view = o.view;
    residual.point = o.point;
    residual.pixel = o.pixel;
    residual.used = problem_.IsActive(o);
    if (!BoardResidual(problem_, o, &residual.residual)) {
      residual.residual.setConstant(std::numeric_limits<double>::quiet_NaN());
      residual.used = false;
    }
    const double squared = residual.residual.squaredNorm();
    ++result.views[v].points;
    ++result.cameras[c].points;
    if (std::isfinite(squared)) {
      all_sum[c] += squared;
      view_all[v] += squared;
    }
    if (residual.used) {
      used_sum[c] += squared;
      view_used[v] += squared;
      ++result.views[v].points_used;
      ++result.cameras[c].points_used;
    }
    result.residuals.push_back(residual);
  }
  for (size_t c = 0; c < result.cameras.size(); ++c) {
    CalibratedCamera& camera = result.cameras[c];
    camera.rms_px = std::sqrt(used_sum[c] / std::max(1, camera.points_used));
    camera.rms_all_px = std::sqrt(all_sum[c] / std::max(1, camera.points));
  }
  for (size_t v = 0; v < result.views.size(); ++v) {
    ViewSummary& view = result.views[v];
    view.used = view.points_used > 0;
    view.rms_px =
        view.used ? std::sqrt(view_used[v] / view.points_used) : std::sqrt(view_all[v] / std::max(1, view.points));
  }
}

// How the board lies in each view, and why a view was not used.
void Calibrator::DescribeViews(Calibration& result) const {
  for (size_t v = 0; v < result.views.size(); ++v) {
    ViewSummary& summary = result.views[v];
    const CalibrationView& view = input_.views[v];
    CalibratedCamera& camera = result.cameras[static_cast<size_t>(view.camera)];
    if (!summary.used) summary.reason = reasons_[v].empty() ? "no pose was found for the board" : reasons_[v];
    const Rigid3d cam_from_board = camera.cam_from_rig * result.rig_from_board[static_cast<size_t>(view.frame)];
    const Eigen::Vector3d normal = cam_from_board.rotation * Eigen::Vector3d::UnitZ();
    summary.tilt_rad = std::acos(std::clamp(std::abs(normal.z()), 0.0, 1.0));
    const double sign = normal.z() < 0 ? -1 : 1;
    summary.azimuth_rad = std::atan2(sign * normal.y(), sign * normal.x());
    summary.distance_m = (cam_from_board * board_.Middle()).norm();
    ++camera.views;
    camera.views_used += summary.used;
  }
}

Calibration Calibrator::Result() const {
  Calibration result;
  result.rig_from_board = problem_.rig_from_board;
  result.frame_used = problem_.frame_used;
  result.board.values = problem_.shape;
  result.iterations = report_.iterations;
  result.cost_before = report_.cost_before;
  result.cost_after = report_.cost_after;
  result.covariance = ReducedCovariance(problem_, &result.determined);
  AddParameters(result);
  AddResiduals(result);
  DescribeViews(result);
  return result;
}

std::vector<int> BendsIf(bool wanted) { return wanted ? std::vector<int>{0, 1, 2} : std::vector<int>(); }

}  // namespace

std::vector<std::string> CalibrateOptions::Check() const {
  std::vector<std::string> problems = CheckRanges(*this);
  for (const std::string& name : SplitAtCommas(model)) {
    if (std::find(std::begin(kModels), std::end(kModels), name) == std::end(kModels)) {
      problems.push_back("option model is '" + name +
                         "', expected pinhole, radtan, radtan5, rational or kannala_brandt");
    }
  }
  return problems;
}

Calibration CalibrateCameras(const CalibrationInput& input, const CalibrateOptions& options, ProgressSink& progress,
                             const CancelToken& cancel) {
  const std::vector<std::string> problems = options.Check();
  if (!problems.empty()) throw OptionError(problems.front());
  progress.Begin("adjusting", 0);
  Calibrator calibrator(input, options, cancel);
  calibrator.Start();
  calibrator.SolveAndReject(BendsIf(options.board_shape), progress);
  return calibrator.Result();
}

Calibration Recalibrate(const CalibrationInput& input, const CalibrateOptions& options, const Calibration& start,
                        const std::vector<bool>& keep, const std::vector<int>& free_shape, const CancelToken& cancel) {
  Calibrator calibrator(input, options, cancel);
  calibrator.StartFrom(start, keep);
  calibrator.Solve(free_shape, true);
  return calibrator.Result();
}

std::vector<double> HoldOutRms(const CalibrationInput& input, const Calibration& all, const Calibration& part,
                               const std::vector<bool>& frames, const CancelToken& cancel) {
  CalibrateOptions options;
  options.model.clear();
  for (const CalibratedCamera& camera : part.cameras) {
    const size_t count = camera.camera.params().size();
    std::string name(CameraModelName(camera.camera.model()));
    if (name == "radtan" && count == 9) name += "5";
    options.model += (options.model.empty() ? "" : ",") + name;
  }
  Calibrator calibrator(input, options, cancel);
  calibrator.StartFrom(all, frames);
  calibrator.TakeCameras(part);
  calibrator.Solve({}, false);
  return calibrator.Rms();
}

}  // namespace trigpoint

#include "survey/tags/tag_map.h"

#include <ceres/ceres.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <set>

#include "calib/base/error.h"
#include "calib/base/parallel.h"
#include "calib/estimation/loss.h"
#include "survey/tags/map_start.h"
#include "survey/tags/selected_inverse.h"
#include "survey/tags/survey_costs.h"

namespace trigpoint {
namespace {

constexpr double kHuberChi2 = 15.5;      // 95 % of chi-square with 8 degrees of freedom
constexpr double kGeotagChi2 = 7.8;      // 95 %, 3 degrees of freedom
constexpr double kPointChi2 = 16.3;      // 99.9 %, 3 degrees of freedom: a point beyond it is named
constexpr double kLeastRedundancy = 20;  // observations to spare before a variance component is believed

using Block = std::array<double, 7>;

enum class Kind { kTag, kOdometry, kPoint, kDistance, kScale };

struct Observation {
  Kind kind;
  int index = 0;  // sight, run or point
  ceres::ResidualBlockId id = nullptr;
  const ceres::LossFunction* loss = nullptr;
  int rows = 0;
};

struct RunState {
  double scale = 1;
  double corner = 1, odometry_rot = 1, odometry_m = 1;  // factors on sigmas
  bool has_scale = false;
};

class StopOnCancel final : public ceres::IterationCallback {
 public:
  StopOnCancel(const CancelToken& cancel, ProgressSink& progress) : cancel_(cancel), progress_(progress) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    progress_.Advance(1);
    return cancel_.IsCancelled() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }

 private:
  const CancelToken& cancel_;
  ProgressSink& progress_;
};

class MapSolver {
 public:
  MapSolver(const SurveyInput& input, const SurveyOptions& options, int threads, ProgressSink& progress,
            const CancelToken& cancel)
      : input_(input), options_(options), threads_(ResolveThreads(threads)), progress_(progress), cancel_(cancel) {}

  SurveyResult Run() {
    start_ = CollectSights(input_, options_);
    if (start_.sights.empty()) throw InputError("no tag is seen in any run: nothing to survey");
    ChooseDatum();
    progress_.Begin("starting values of the tag map", 0);
    FindStart(input_, datum_points_, threads_, cancel_, &start_);
    result_.warnings = start_.warnings;
    if (!input_.fixed && !start_.in_world) {
      if (!datum_points_.empty()) {
        result_.warnings.push_back(
            "fewer than three known points that are off one line: the map stays in a frame of its own");
      }
      datum_points_.clear();
      result_.datum = "first camera";
    }
    result_.in_world = start_.in_world || input_.fixed.has_value();
    LoadState();
    progress_.Begin("tag map", 0);
    // Each round: solve, reject what contradicts, weigh the groups by their own residuals. The last solve has the
    // final weights.
    for (int round = 0;; ++round) {
      Build();
      Solve(round == 0);
      Linearise();
      const bool last = round >= options_.variance_rounds;
      const bool rejected = round < options_.variance_rounds + 3 && Snoop();
      if (last && !rejected) break;
      if (!last) UpdateFactors();
    }
    Collect();
    return std::move(result_);
  }

 private:
  void ChooseDatum() {
    std::vector<SurveyPoint> control, geotags;
    for (const SurveyPoint& p : input_.points) {
      if (p.role == PointRole::kControl) control.push_back(p);
      if (p.role == PointRole::kGeotag) geotags.push_back(p);
    }
    if (input_.fixed) {
      result_.datum = "tag " + std::to_string(input_.fixed->tag_id);
    } else if (control.size() >= 3 || geotags.empty()) {
      datum_points_ = control;
      result_.datum = "control";
    } else {
      datum_points_ = geotags;
      datum_points_.insert(datum_points_.end(), control.begin(), control.end());
      result_.datum = control.empty() ? "geotags" : "control and geotags";
    }
  }

  void LoadState() {
    bodies_.resize(start_.frames.size());
    for (size_t f = 0; f < start_.frames.size(); ++f) {
      if (start_.frames[f].world_from_body) Rigid3ToBlock(*start_.frames[f].world_from_body, bodies_[f].data());
    }
    for (const auto& [id, pose] : start_.world_from_tag) Rigid3ToBlock(pose, tags_[id].data());
    if (input_.fixed) Rigid3ToBlock(input_.fixed->world_from_tag, tags_[input_.fixed->tag_id].data());
    run_states_.resize(input_.runs.size());
    int lost = 0;
    for (const MapFrame& frame : start_.frames) lost += frame.world_from_body ? 0 : 1;
    if (lost > 0) {
      result_.warnings.push_back(std::to_string(lost) +
                                 " picture(s) cannot be placed by odometry or tags and are left out");
    }
  }

  bool Usable(const MapSight& s) const {
    return !s.rejected && start_.frames[s.frame].world_from_body && tags_.count(s.detection.id) > 0;
  }

  void Build() {
    ceres::Problem::Options problem_options;
    problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    problem_options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    problem_ = std::make_unique<ceres::Problem>(problem_options);
    observations_.clear();
    parameters_.clear();
    offsets_.clear();
    const auto add = [&](Kind kind, int index, ceres::CostFunction* cost, ceres::LossFunction* loss,
                         const std::vector<double*>& blocks) {
      const int rows = cost->num_residuals();
      observations_.push_back({kind, index, problem_->AddResidualBlock(cost, loss, blocks), loss, rows});
    };
    for (size_t i = 0; i < start_.sights.size(); ++i) {
      const MapSight& s = start_.sights[i];
      if (!Usable(s)) continue;
      const int run = start_.frames[s.frame].run;
      add(Kind::kTag, static_cast<int>(i),
          new TagCost(s.sight, input_.sizes.SizeOf(s.detection.id), input_.runs[run].cameras[s.camera].cam_from_body,
                      &run_states_[run].corner),
          &huber_, {bodies_[s.frame].data(), tags_.at(s.detection.id).data()});
    }
    AddOdometry(add);
    for (size_t i = 0; i < datum_points_.size(); ++i) {
      const SurveyPoint& p = datum_points_[i];
      const auto tag = tags_.find(p.tag_id);
      if (tag == tags_.end() || !problem_->HasParameterBlock(tag->second.data())) continue;
      add(Kind::kPoint, static_cast<int>(i),
          new PointCost(Lever(p), p.offset_m, p.world_m, {p.sigma_h_m, p.sigma_h_m, p.sigma_v_m}),
          p.role == PointRole::kGeotag ? &geotag_loss_ : nullptr, {tag->second.data()});
    }
    for (size_t i = 0; i < input_.distances.size(); ++i) {
      const SurveyDistance& d = input_.distances[i];
      const auto a = tags_.find(d.from), b = tags_.find(d.to);
      if (a == tags_.end() || b == tags_.end() || d.from == d.to) continue;
      add(Kind::kDistance, static_cast<int>(i), new DistanceCost(d.distance_m, d.sigma_m), nullptr,
          {a->second.data(), b->second.data()});
    }
    for (Block& b : bodies_) AddPose(b.data());
    for (auto& [id, b] : tags_) AddPose(b.data());
    for (size_t r = 0; r < run_states_.size(); ++r) {
      if (run_states_[r].has_scale) AddParameter(&run_states_[r].scale, 1);
    }
    if (input_.fixed) {
      Hold(tags_.at(input_.fixed->tag_id).data());
    } else if (datum_points_.empty()) {
      for (Block& b : bodies_) {
        if (problem_->HasParameterBlock(b.data())) {
          Hold(b.data());
          break;
        }
      }
    }
  }

  template <typename Add>
  void AddOdometry(const Add& add) {
    for (RunState& run : run_states_) run.has_scale = false;
    int before = -1;
    for (size_t f = 0; f < start_.frames.size(); ++f) {
      const MapFrame& frame = start_.frames[f];
      if (!frame.odom_from_body || !frame.world_from_body) continue;
      if (before >= 0 && start_.frames[before].run == frame.run) {
        const Rigid3d a_from_b = start_.frames[before].odom_from_body->Inverse() * *frame.odom_from_body;
        // Random walk over the way travelled; a standing robot drifts a little with time.
        const double seconds = 1e-9 * static_cast<double>(frame.stamp_ns - start_.frames[before].stamp_ns);
        const double root = std::sqrt(a_from_b.translation.norm() + 0.01 * seconds + 1e-6);
        RunState& run = run_states_[frame.run];
        add(Kind::kOdometry, frame.run,
            new OdometryCost(a_from_b, options_.odometry_rot_deg * kDegToRad * root, options_.odometry_m * root,
                             &run.odometry_rot, &run.odometry_m),
            nullptr, {bodies_[before].data(), bodies_[f].data(), &run.scale});
        run.has_scale = true;
      }
      before = static_cast<int>(f);
    }
    for (size_t r = 0; r < run_states_.size(); ++r) {
      if (!run_states_[r].has_scale) continue;
      add(Kind::kScale, static_cast<int>(r), new NumberCost(1, std::max(1e-6, input_.runs[r].scale_sigma)), nullptr,
          {&run_states_[r].scale});
    }
  }

  Eigen::Vector3d Lever(const SurveyPoint& p) const {
    return p.corner < 0 ? Eigen::Vector3d::Zero() : TagCorner(input_.sizes.SizeOf(p.tag_id), p.corner);
  }

  void AddParameter(double* block, int size) {
    offsets_[block] = unknowns_in_order_ = parameters_.empty() ? 0 : unknowns_in_order_;
    parameters_.push_back(block);
    unknowns_in_order_ += size;
  }
  void AddPose(double* block) {
    if (!problem_->HasParameterBlock(block)) return;
    problem_->SetManifold(block, &manifold_);
    AddParameter(block, 6);
  }
  // Takes a pose out of the unknowns.
  void Hold(double* block) {
    problem_->SetParameterBlockConstant(block);
    parameters_.erase(std::find(parameters_.begin(), parameters_.end(), block));
    offsets_.clear();
    unknowns_in_order_ = 0;
    for (double* b : parameters_) {
      offsets_[b] = unknowns_in_order_;
      unknowns_in_order_ += problem_->ParameterBlockTangentSize(b);
    }
  }

  void Solve(bool first) {
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    options.num_threads = threads_;
    options.max_num_iterations = options_.max_iterations;
    options.function_tolerance = 1e-10;
    options.parameter_tolerance = 1e-10;
    options.logging_type = ceres::SILENT;
    StopOnCancel stop(cancel_, progress_);
    options.callbacks.push_back(&stop);
    ceres::Solver::Summary summary;
    ceres::Solve(options, problem_.get(), &summary);
    cancel_.ThrowIfCancelled();
    if (!summary.IsSolutionUsable()) throw NumericError("the tag map did not converge: " + summary.message);
    if (first) result_.cost_before = summary.initial_cost;
    result_.cost_after = summary.final_cost;
    result_.iterations += static_cast<int>(summary.iterations.size());
  }

  // Whitened residuals and derivatives at the solution, weighted by the robust loss, and the inverse of the normal
  // matrix on its pattern.
  void Linearise() {
    ceres::Problem::EvaluateOptions options;
    options.parameter_blocks = parameters_;
    options.apply_loss_function = false;
    options.num_threads = threads_;
    for (const Observation& o : observations_) options.residual_blocks.push_back(o.id);
    ceres::CRSMatrix crs;
    residuals_.clear();
    problem_->Evaluate(options, nullptr, &residuals_, nullptr, &crs);
    weights_.assign(observations_.size(), 1.0);
    int row = 0;
    for (size_t i = 0; i < observations_.size(); ++i) {
      const Observation& o = observations_[i];
      if (o.loss != nullptr) {
        double s = 0, rho[3];
        for (int k = 0; k < o.rows; ++k) s += residuals_[row + k] * residuals_[row + k];
        o.loss->Evaluate(s, rho);
        weights_[i] = rho[1];
      }
      const double root = std::sqrt(weights_[i]);
      for (int k = row; k < row + o.rows; ++k) {
        residuals_[k] *= root;
        for (int e = crs.rows[k]; e < crs.rows[k + 1]; ++e) crs.values[e] *= root;
      }
      row += o.rows;
    }
    using RowMajor = Eigen::SparseMatrix<double, Eigen::RowMajor>;
    jacobian_ = Eigen::Map<const RowMajor>(crs.num_rows, crs.num_cols, static_cast<Eigen::Index>(crs.values.size()),
                                           crs.rows.data(), crs.cols.data(), crs.values.data());
    const Eigen::SparseMatrix<double> normal = jacobian_.transpose() * jacobian_;
    inverse_.reset();  // one at a time
    inverse_ = std::make_unique<SelectedInverse>(normal);
  }

  // J Q J' of an observation whose first row is `row`: the part of its unit covariance that the fit absorbs.
  Eigen::MatrixXd Absorbed(int row, int rows) const {
    const int* outer = jacobian_.outerIndexPtr();
    const int begin = outer[row], count = outer[row + 1] - begin;  // all rows of an observation have the same columns
    const int* columns = jacobian_.innerIndexPtr() + begin;
    Eigen::MatrixXd q(count, count), j(rows, count);
    for (int a = 0; a < count; ++a) {
      for (int b = 0; b <= a; ++b) q(a, b) = q(b, a) = inverse_->At(columns[a], columns[b]);
    }
    for (int k = 0; k < rows; ++k) {
      for (int a = 0; a < count; ++a) j(k, a) = jacobian_.valuePtr()[outer[row + k] + a];
    }
    return j * q * j.transpose();
  }

  // Variance components: for each run's corners, odometry rotations and odometry translations,
  // factor^2 = sum of squared residuals / redundancy.
  void UpdateFactors() {
    struct Group {
      double square = 0, redundancy = 0;
    };
    std::vector<std::array<Group, 3>> groups(run_states_.size());
    int row = 0;
    for (size_t i = 0; i < observations_.size(); ++i) {
      const Observation& o = observations_[i];
      if (o.kind == Kind::kTag || o.kind == Kind::kOdometry) {
        const int run = o.kind == Kind::kTag ? start_.frames[start_.sights[o.index].frame].run : o.index;
        const Eigen::MatrixXd absorbed = Absorbed(row, o.rows);
        for (int k = 0; k < o.rows; ++k) {
          Group& g = groups[run][o.kind == Kind::kTag ? 0 : (k < 3 ? 1 : 2)];
          g.square += residuals_[row + k] * residuals_[row + k];
          g.redundancy += weights_[i] - absorbed(k, k);
        }
      }
      row += o.rows;
    }
    for (size_t r = 0; r < run_states_.size(); ++r) {
      double* const factors[3] = {&run_states_[r].corner, &run_states_[r].odometry_rot, &run_states_[r].odometry_m};
      for (int k = 0; k < 3; ++k) {
        if (groups[r][k].redundancy < kLeastRedundancy) continue;
        *factors[k] *= std::clamp(std::sqrt(groups[r][k].square / groups[r][k].redundancy), 0.1, 10.0);
        *factors[k] = std::clamp(*factors[k], 1e-3, 1e3);
      }
    }
  }

  // Rejects pictures of tags whose standardised residual is beyond the gate. True if any was.
  bool Snoop() {
    // Before the corners' sigma is known to be right, it is judged by the median (of chi-square 8: 7.344).
    std::vector<double> all;
    int row = 0;
    for (size_t i = 0; i < observations_.size(); ++i) {
      const Observation& o = observations_[i];
      if (o.kind == Kind::kTag) {
        all.push_back(Eigen::Map<const Vector8d>(&residuals_[row]).squaredNorm() / weights_[i]);
      }
      row += o.rows;
    }
    if (all.empty()) return false;
    std::nth_element(all.begin(), all.begin() + all.size() / 2, all.end());
    const double gate = options_.snooping_chi2 * std::max(1.0, all[all.size() / 2] / 7.344);
    bool any = false;
    row = 0;
    for (size_t i = 0; i < observations_.size(); ++i) {
      const Observation& o = observations_[i];
      if (o.kind == Kind::kTag) {
        const Eigen::Map<const Vector8d> weighted(&residuals_[row]);
        const double chi2 = weighted.squaredNorm() / weights_[i];
        if (chi2 > gate) {
          start_.sights[o.index].rejected = true;
          any = true;
        }
      }
      row += o.rows;
    }
    if (!any) return false;
    // A tag or a frame is not left without any observation: the least bad ones stay.
    std::set<int> tags, frames;
    for (const MapSight& s : start_.sights) {
      if (Usable(s)) tags.insert(s.detection.id), frames.insert(s.frame);
    }
    for (MapSight& s : start_.sights) {
      if (s.rejected &&
          (tags.count(s.detection.id) == 0 || (frames.count(s.frame) == 0 && !start_.frames[s.frame].odom_from_body))) {
        s.rejected = false;
      }
    }
    for (MapFrame& frame : start_.frames) {
      if (frame.world_from_body) frame.world_from_body = Rigid3FromBlock(bodies_[&frame - start_.frames.data()].data());
    }
    return true;
  }

  void Collect() {
    for (size_t f = 0; f < start_.frames.size(); ++f) {
      if (start_.frames[f].world_from_body) start_.frames[f].world_from_body = Rigid3FromBlock(bodies_[f].data());
    }
    // Duplicates, moved tags and twins show when the cameras are known.
    std::map<int, TagEstimate> judged;
    TagPosesOptions judge;
    judge.extra_sigma_px = options_.extra_sigma_px;
    judge.min_side_px = options_.min_side_px;
    ProgressSink silent;
    for (const TagEstimate& t :
         EstimateTagPoses(ViewsOf(input_, start_, -1), input_.sizes, judge, threads_, silent, cancel_)) {
      judged[t.tag_id] = t;
    }
    std::map<int, TagEstimate> tags;
    std::map<int, std::set<int>> runs;
    std::map<int, double> square_px;
    for (RunState& state : run_states_) {
      const size_t r = &state - run_states_.data();
      RunAgreement run;
      run.name = input_.runs[r].name;
      run.scale = state.scale;
      run.corner_factor = state.corner;
      run.odometry_rot_factor = state.odometry_rot;
      run.odometry_m_factor = state.odometry_m;
      if (state.has_scale)
        run.scale_sigma = std::sqrt(inverse_->At(offsets_.at(&state.scale), offsets_.at(&state.scale)));
      result_.runs.push_back(run);
    }
    for (const MapFrame& frame : start_.frames) {
      if (!frame.world_from_body) continue;
      ++result_.runs[frame.run].frames;
      result_.runs[frame.run].world_from_body.push_back({frame.stamp_ns, *frame.world_from_body});
    }
    for (const MapSight& s : start_.sights) {
      TagEstimate& tag = tags[s.detection.id];
      tag.tag_id = s.detection.id;
      tag.family = s.detection.family;
      tag.size_m = input_.sizes.SizeOf(tag.tag_id);
      RunAgreement& run = result_.runs[start_.frames[s.frame].run];
      if (!Usable(s)) {
        ++tag.rejected;
        ++run.rejected;
        continue;
      }
      const Vector8d r =
          TagResidual(s.sight, tag.size_m, input_.runs[start_.frames[s.frame].run].cameras[s.camera].cam_from_body,
                      *start_.frames[s.frame].world_from_body, Rigid3FromBlock(tags_.at(tag.tag_id).data()));
      const double px = ResidualPx(s.sight, r);
      ++tag.images;
      ++run.sights;
      runs[tag.tag_id].insert(start_.frames[s.frame].run);
      square_px[tag.tag_id] += px * px;
      run.rms_px += px * px;
    }
    for (RunAgreement& run : result_.runs) run.rms_px = run.sights > 0 ? std::sqrt(run.rms_px / run.sights) : 0;
    for (auto& [id, tag] : tags) {
      const auto block = tags_.find(id);
      if (block == tags_.end() || !problem_->HasParameterBlock(block->second.data())) {
        tag.status = "unsolved";
        tag.reason = "not tied to the rest of the map";
      } else {
        tag.world_from_tag = Rigid3FromBlock(block->second.data());
        const auto offset = offsets_.find(block->second.data());
        if (offset != offsets_.end()) tag.covariance = inverse_->Block(offset->second, offset->second, 6, 6);
        tag.runs = static_cast<int>(runs[id].size());
        tag.rms_px = std::sqrt(square_px[id] / std::max(1, tag.images));
        tag.status = judged.count(id) > 0 ? judged[id].status : "weak";
        tag.reason = judged.count(id) > 0 ? judged[id].reason : "";
      }
      if (!tag.reason.empty())
        result_.warnings.push_back("tag " + std::to_string(id) + " (" + tag.status + "): " + tag.reason);
      for (const SurveyPoint& p : input_.points) {
        if (p.tag_id != id || p.role == PointRole::kGeotag) continue;
        const bool used = p.role == PointRole::kControl && result_.datum.starts_with("control");
        tag.role = used ? "control" : p.role == PointRole::kCheck ? "check" : tag.role;
      }
      result_.tags.push_back(tag);
    }
    CompareWithPoints();
    if (options_.cross_covariances) CrossCovariances();
  }

  void CompareWithPoints() {
    double square_h = 0, square_v = 0;
    for (const SurveyPoint& p : input_.points) {
      const auto block = tags_.find(p.tag_id);
      if (!result_.in_world || block == tags_.end() || !problem_->HasParameterBlock(block->second.data())) continue;
      const Rigid3d pose = Rigid3FromBlock(block->second.data());
      const Eigen::Vector3d turned = pose.rotation * Lever(p);
      PointAgreement agreement{p.name, p.role, p.tag_id, turned + pose.translation + p.offset_m - p.world_m};
      Eigen::Matrix3d stated = Eigen::Vector3d(p.sigma_h_m, p.sigma_h_m, p.sigma_v_m).cwiseAbs2().asDiagonal();
      Eigen::Matrix3d map = Eigen::Matrix3d::Zero();
      const auto offset = offsets_.find(block->second.data());
      if (offset != offsets_.end()) {
        Eigen::Matrix<double, 3, 6> j;
        j << -Skew(turned), Eigen::Matrix3d::Identity();
        map = j * inverse_->Block(offset->second, offset->second, 6, 6) * j.transpose();
      }
      const bool used = std::any_of(datum_points_.begin(), datum_points_.end(), [&](const SurveyPoint& q) {
        return q.tag_id == p.tag_id && q.role == p.role && q.corner == p.corner && q.name == p.name;
      });
      // Residual of an observation that took part: its covariance is the stated one less the fitted one.
      const Eigen::Matrix3d covariance = used ? Eigen::Matrix3d(stated - map) : Eigen::Matrix3d(stated + map);
      agreement.sigma_h_m = std::sqrt(std::max(0.0, 0.5 * (covariance(0, 0) + covariance(1, 1))));
      agreement.sigma_v_m = std::sqrt(std::max(0.0, covariance(2, 2)));
      const Eigen::Matrix3d floor = 1e-4 * stated;  // a point that alone holds a direction has no residual there
      agreement.chi2 = agreement.error_m.dot((covariance + floor).ldlt().solve(agreement.error_m));
      if (agreement.chi2 > kPointChi2) {
        const std::string role = p.role == PointRole::kControl ? "control"
                                 : p.role == PointRole::kCheck ? "check"
                                                               : "geotag";
        result_.warnings.push_back(role + " point " + p.name + " (tag " + std::to_string(p.tag_id) + ") is " +
                                   std::to_string(agreement.error_m.norm()) +
                                   " m off the map, more than its sigma allows");
      }
      if (p.role == PointRole::kCheck) {
        ++result_.check.n;
        square_h += agreement.error_m.head<2>().squaredNorm();
        square_v += agreement.error_m.z() * agreement.error_m.z();
      }
      result_.points.push_back(agreement);
    }
    if (result_.check.n > 0) {
      result_.check.rmse_h_m = std::sqrt(square_h / result_.check.n);
      result_.check.rmse_v_m = std::sqrt(square_v / result_.check.n);
      result_.check.rmse_3d_m = std::sqrt((square_h + square_v) / result_.check.n);
    }
  }

  void CrossCovariances() {
    for (auto a = tags_.begin(); a != tags_.end(); ++a) {
      const auto offset = offsets_.find(a->second.data());
      if (offset == offsets_.end()) continue;
      cancel_.ThrowIfCancelled();
      const Eigen::MatrixXd columns = inverse_->Columns(offset->second, 6);
      for (auto b = std::next(a); b != tags_.end(); ++b) {
        const auto other = offsets_.find(b->second.data());
        if (other == offsets_.end()) continue;
        const Matrix6d b_a = columns.middleRows(other->second, 6);
        result_.cross[{a->first, b->first}] = b_a.transpose();
      }
    }
  }

  const SurveyInput& input_;
  const SurveyOptions& options_;
  int threads_;
  ProgressSink& progress_;
  const CancelToken& cancel_;
  SurveyResult result_;
  MapStart start_;
  std::vector<SurveyPoint> datum_points_;
  std::vector<Block> bodies_;
  std::map<int, Block> tags_;
  std::vector<RunState> run_states_;
  Rigid3Manifold manifold_;
  HuberChi2Loss huber_{kHuberChi2}, geotag_loss_{kGeotagChi2};
  std::vector<Observation> observations_;
  std::vector<double*> parameters_;  // unknown blocks in the order of the normal matrix
  std::map<const double*, int> offsets_;
  int unknowns_in_order_ = 0;
  std::vector<double> residuals_, weights_;
  Eigen::SparseMatrix<double, Eigen::RowMajor> jacobian_;
  std::unique_ptr<SelectedInverse> inverse_;
  std::unique_ptr<ceres::Problem> problem_;
};

}  // namespace

SurveyResult SurveyTags(const SurveyInput& input, const SurveyOptions& options, int threads, ProgressSink& progress,
                        const CancelToken& cancel) {
  if (const std::vector<std::string> problems = options.Check(); !problems.empty()) throw OptionError(problems.front());
  return MapSolver(input, options, threads, progress, cancel).Run();
}

}  // namespace trigpoint

// Where the uncertainty of the map's tags comes from. With Q the covariance of all unknowns and J_i the whitened design
// of observation i, Q = sum of Q J_i' J_i Q: each kind of observation has its share of a tag's variance.
#include <algorithm>
#include <cmath>

#include "calib/base/median.h"
#include "calib/base/parallel.h"
#include "survey/tags/map_solver.h"

namespace trigpoint {
namespace {

constexpr int kTogether = 16;             // tags whose columns of the covariance are held at a time
constexpr double kNextSigma_m = 0.01;     // of a point that would be surveyed next, where there is no control yet
constexpr double kLeastVariance = 1e-12;  // m2: a tag that is held

}  // namespace

std::string_view BudgetName(BudgetSource source) {
  constexpr std::array<std::string_view, kBudgetSources> kNames = {"control",  "geotags",      "gps",       "corners",
                                                                   "odometry", "scene_points", "distances", "other"};
  return kNames[static_cast<size_t>(source)];
}

BudgetSource TagBudget::LimitedBy() const {
  return static_cast<BudgetSource>(std::max_element(sigma_m.begin(), sigma_m.end()) - sigma_m.begin());
}

BudgetSource MapSolver::SourceOf(const Observation& o) const {
  switch (o.kind) {
    case Kind::kTag:
    case Kind::kMark: return BudgetSource::kCorners;
    case Kind::kOdometry: return BudgetSource::kOdometry;
    case Kind::kPoint: {
      const bool geotag = datum_points_[static_cast<size_t>(o.index)].role == PointRole::kGeotag;
      return geotag ? BudgetSource::kGeotags : BudgetSource::kControl;
    }
    case Kind::kFix: return BudgetSource::kGps;
    case Kind::kDistance:
    case Kind::kStation: return BudgetSource::kDistances;
    case Kind::kOther: break;
  }
  return BudgetSource::kOther;
}

// Variances of the centres of `tags` (indices into result_.tags), by source; and the covariances of their centres with
// those of all tags, in the rows of `cross`.
std::vector<std::array<double, kBudgetSources>> MapSolver::SharesOf(const std::vector<size_t>& tags,
                                                                    const std::vector<int>& offsets,
                                                                    Eigen::MatrixXd* cross) const {
  const auto n = static_cast<Eigen::Index>(tags.size());
  Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(solver_.Equations(), 3 * n);
  for (Eigen::Index k = 0; k < n; ++k) {
    unit.block<3, 3>(offsets[tags[static_cast<size_t>(k)]] + 3, 3 * k).setIdentity();
  }
  const Eigen::MatrixXd columns = solver_.SolveNormal(std::move(unit));
  std::vector<std::array<double, kBudgetSources>> shares(tags.size());
  std::vector<double> explained(tags.size(), 0.0);
  for (size_t i = 0; i < observations_.size(); ++i) {
    const Eigen::MatrixXd by = solver_.Times(static_cast<int>(i), columns);
    const auto source = static_cast<size_t>(SourceOf(observations_[i]));
    for (size_t k = 0; k < tags.size(); ++k) {
      const double share = by.middleCols<3>(3 * static_cast<Eigen::Index>(k)).squaredNorm();
      shares[k][source] += share;
      explained[k] += share;
    }
  }
  for (size_t k = 0; k < tags.size(); ++k) {
    const auto row = 3 * static_cast<Eigen::Index>(tags[k]), column = 3 * static_cast<Eigen::Index>(k);
    for (size_t t = 0; t < offsets.size(); ++t) {
      if (offsets[t] < 0) continue;
      cross->block<3, 3>(row, 3 * static_cast<Eigen::Index>(t)) =
          columns.block<3, 3>(offsets[t] + 3, column).transpose();
    }
    // Scene points are eliminated from the equations: theirs is what the other observations leave.
    const double all = cross->block<3, 3>(row, row).trace();
    shares[k][static_cast<size_t>(BudgetSource::kScenePoints)] = std::max(0.0, all - explained[k]);
  }
  return shares;
}

void MapSolver::CollectBudgets() {
  std::vector<int> offsets;  // of result_.tags among the equations; -1: held or without a place
  std::vector<size_t> estimated;
  for (const TagEstimate& tag : result_.tags) {
    const auto unknown = tag_unknown_.find(tag.tag_id);
    offsets.push_back(unknown == tag_unknown_.end() || !tag.HasPose() ? -1 : solver_.Offset(unknown->second));
    if (offsets.back() >= 0) estimated.push_back(offsets.size() - 1);
  }
  const auto n = 3 * static_cast<Eigen::Index>(offsets.size());
  Eigen::MatrixXd cross = Eigen::MatrixXd::Zero(n, n);
  result_.budgets.resize(estimated.size());
  const auto batches = static_cast<int64_t>((estimated.size() + kTogether - 1) / kTogether);
  ParallelFor(batches, threads_, cancel_, [&](int64_t batch) {
    const size_t begin = static_cast<size_t>(batch) * kTogether, end = std::min(begin + kTogether, estimated.size());
    const std::vector<size_t> tags(estimated.begin() + static_cast<std::ptrdiff_t>(begin),
                                   estimated.begin() + static_cast<std::ptrdiff_t>(end));
    const auto shares = SharesOf(tags, offsets, &cross);
    for (size_t k = 0; k < tags.size(); ++k) {
      TagBudget& budget = result_.budgets[begin + k];
      const TagEstimate& tag = result_.tags[tags[k]];
      budget.tag_id = tag.tag_id;
      budget.total_m = std::sqrt(std::max(0.0, tag.covariance.bottomRightCorner<3, 3>().trace()));
      double sum = 0;
      for (size_t s = 0; s < kBudgetSources; ++s) sum += shares[k][s], budget.sigma_m[s] = std::sqrt(shares[k][s]);
      // What contradictions add to the covariance.
      double& other = budget.sigma_m[static_cast<size_t>(BudgetSource::kOther)];
      other = std::sqrt(other * other + std::max(0.0, budget.total_m * budget.total_m - sum));
    }
  });
  if (!datum_points_.empty()) FindNextPoint(cross, offsets);
}

// The tag that would make the map better than any other would, if it were surveyed as well as the control is: the
// covariance with it is that of one more observation, K - K_c (K_cc + S)^-1 K_c'.
void MapSolver::FindNextPoint(const Eigen::MatrixXd& cross, const std::vector<int>& offsets) {
  std::vector<double> h, v;
  std::set<int> controlled;
  for (const SurveyPoint& p : datum_points_) {
    if (p.role != PointRole::kControl || Excluded(p)) continue;
    h.push_back(p.sigma_h_m), v.push_back(p.sigma_v_m);
    controlled.insert(p.tag_id);
  }
  NextPoint next;
  next.sigma_h_m = h.empty() ? kNextSigma_m : Median(std::move(h));
  next.sigma_v_m = v.empty() ? kNextSigma_m : Median(std::move(v));
  const Eigen::Matrix3d stated =
      Eigen::Vector3d(next.sigma_h_m, next.sigma_h_m, next.sigma_v_m).cwiseAbs2().asDiagonal();
  const auto summary = [&](const Eigen::MatrixXd& covariance, double* rms, double* worst) {
    double sum = 0, most = 0;
    int n = 0;
    for (size_t t = 0; t < offsets.size(); ++t) {
      if (offsets[t] < 0) continue;
      const auto at = 3 * static_cast<Eigen::Index>(t);
      const double variance = covariance.block<3, 3>(at, at).trace();
      sum += variance, most = std::max(most, variance), ++n;
    }
    *rms = std::sqrt(sum / std::max(1, n)), *worst = std::sqrt(most);
  };
  summary(cross, &next.rms_now_m, &next.worst_now_m);
  double best = 0;
  Eigen::MatrixXd decrease;  // of the covariance, by the best
  for (size_t t = 0; t < offsets.size(); ++t) {
    const int id = result_.tags[t].tag_id;
    if (offsets[t] < 0 || controlled.contains(id) || result_.tags[t].status != "ok") continue;
    const auto at = 3 * static_cast<Eigen::Index>(t);
    if (cross.block<3, 3>(at, at).trace() < kLeastVariance) continue;
    const Eigen::Matrix3d inverse = (cross.block<3, 3>(at, at) + stated).inverse();
    const Eigen::MatrixXd column = cross.middleCols<3>(at);
    const double gain = (column * inverse).cwiseProduct(column).sum();
    if (gain > best) best = gain, next.tag_id = id, decrease = column * inverse * column.transpose();
  }
  if (next.tag_id < 0) return;
  summary(cross - decrease, &next.rms_then_m, &next.worst_then_m);
  result_.next_point = next;
}

}  // namespace trigpoint

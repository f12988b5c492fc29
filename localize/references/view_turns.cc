#include "localize/references/view_turns.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <boost/math/tools/minima.hpp>
#include <cmath>
#include <map>

#include "localize/references/cost_by_errors.h"

namespace trigpoint {
namespace {

// So many show the sigma to a few per cent; more would only cost time.
constexpr size_t kMostRigs = 50;

// Turns of a rig's views, 3 each: what the data say of them with poses and points free, along axes that are
// independent of each other.
struct TurnEvidence {
  Eigen::ArrayXd information;  // 1/rad^2
  Eigen::ArrayXd score;        // the gradient of the log likelihood where no view is turned
};

TurnEvidence EvidenceOf(const RigViews& rig, const BundleProblem& p, const BundleCovariance& covariance) {
  SharedErrors turns;
  turns.root = Eigen::MatrixXd::Zero(6 * rig.views, 3 * rig.views);
  for (int v = 0; v < rig.views; ++v) turns.root.block<3, 3>(6 * v, 3 * v).setIdentity();
  turns.first_view.assign(p.poses.size(), -1);
  turns.first_view[static_cast<size_t>(rig.pose)] = rig.first_view;
  const CostByErrors cost(turns, p);
  const Eigen::MatrixXd mixed = cost.mixed() * turns.root, moved = covariance.Times(mixed);
  const Eigen::MatrixXd information = turns.root.transpose() * cost.hessian() * turns.root - mixed.transpose() * moved;
  // Of the profile likelihood also where the solution stopped short of its minimum.
  const Eigen::VectorXd score = moved.transpose() * covariance.Gradient() - turns.root.transpose() * cost.gradient();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(0.5 * (information + information.transpose()));
  TurnEvidence e{axes.eigenvalues().array(), (axes.eigenvectors().transpose() * score).array()};
  // A turn of all views that see a point is the rig's own.
  const auto open = e.information <= 1e-9 * e.information.maxCoeff();
  e.score = open.select(0, e.score).eval();
  e.information = e.information.cwiseMax(0).eval();
  return e;
}

// Twice the negative logarithm of the likelihood of turns with a variance, against that of none.
double Deviance(const std::vector<TurnEvidence>& all, double variance) {
  double sum = 0;
  for (const TurnEvidence& e : all) {
    const Eigen::ArrayXd growth = 1 + variance * e.information;
    sum += (growth.log() - variance * e.score.square() / growth).sum();
  }
  return sum;
}

// Root of the information on the view's pose from the rig's: turned about `centre` (rig axes, m), which stays.
Matrix6d TieOf(double sigma_rad, const Eigen::Vector3d& centre) {
  constexpr double kOneCentre_m = 1e-4;  // stiff, without spoiling the condition
  Matrix6d tie = Matrix6d::Zero();
  tie.diagonal() << Eigen::Vector3d::Constant(1 / sigma_rad), Eigen::Vector3d::Constant(1 / kOneCentre_m);
  tie.bottomLeftCorner<3, 3>() = -Skew(centre) / kOneCentre_m;
  return tie;
}

}  // namespace

std::optional<double> FindViewTurns(const std::vector<RigViews>& rigs, const BundleProblem& p, int threads,
                                    const CancelToken& cancel) {
  // From 1/50 of a pixel of a large panorama to what no stitching leaves.
  const double least = std::log(1e-5), most = std::log(0.05);
  constexpr double kShown = 2.71;  // one-sided 5 % of a variance, which cannot be negative
  constexpr int kSteps = 20;
  if (rigs.empty()) return std::nullopt;
  const BundleCovariance covariance(p, threads, cancel);
  std::vector<TurnEvidence> evidence;
  const size_t count = std::min(kMostRigs, rigs.size());
  for (size_t k = 0; k < count; ++k) evidence.push_back(EvidenceOf(rigs[k * rigs.size() / count], p, covariance));
  const auto at = [&](double log_sigma) { return Deviance(evidence, std::exp(2 * log_sigma)); };
  double best = least;
  for (int k = 1; k <= kSteps; ++k) {
    const double x = least + k * (most - least) / kSteps;
    if (at(x) < at(best)) best = x;
  }
  const double step = (most - least) / kSteps;
  const auto [log_sigma, deviance] =
      boost::math::tools::brent_find_minima(at, std::max(least, best - step), std::min(most, best + step), 20);
  return deviance < -kShown ? std::optional(std::exp(log_sigma)) : std::nullopt;
}

std::vector<TurnedView> FreeViews(const std::function<std::optional<ViewToFree>(size_t)>& of, BundleProblem* p) {
  std::map<std::pair<int, int>, int> own_pose;  // of a rig's pose and its view
  std::vector<TurnedView> turned;
  for (size_t k = 0; k < p->observations.size(); ++k) {
    const std::optional<ViewToFree> view = of(k);
    if (!view) continue;
    BearingObservation& o = p->observations[k];
    const auto [at, fresh] = own_pose.try_emplace({o.pose, view->view}, static_cast<int>(p->poses.size()));
    if (fresh) {
      p->poses.push_back(view->turn * Rigid3d(p->poses[static_cast<size_t>(o.pose)]));
      if (!p->pose_constant.empty()) p->pose_constant.push_back(false);
      PoseFactor tie;
      tie.kind = PoseFactor::Kind::kBetween;
      tie.a = at->second, tie.b = o.pose;
      const Eigen::Vector3d centre = p->views[static_cast<size_t>(o.view)].TargetOriginInSource();
      tie.sqrt_info = TieOf(view->sigma_rad, centre);
      turned.push_back({tie.a, static_cast<int>(p->factors.size()), centre});
      p->factors.push_back(tie);
    }
    o.pose = at->second;
  }
  return turned;
}

std::vector<TurnedView> FreeViews(const std::vector<RigViews>& rigs, double sigma_rad, BundleProblem* p) {
  std::vector<bool> is_rig(p->poses.size(), false);
  for (const RigViews& rig : rigs) is_rig[static_cast<size_t>(rig.pose)] = true;
  const auto of = [&](size_t k) {
    const BearingObservation& o = p->observations[k];
    return is_rig[static_cast<size_t>(o.pose)] ? std::optional(ViewToFree{o.view, sigma_rad, {}}) : std::nullopt;
  };
  return FreeViews(of, p);
}

TurnsShown UpdateTurns(const std::vector<TurnedView>& views, int threads, const CancelToken& cancel, BundleProblem* p) {
  std::vector<int> rig_of(p->poses.size(), -1);
  for (const TurnedView& view : views) {
    rig_of[static_cast<size_t>(view.pose)] = p->factors[static_cast<size_t>(view.factor)].b;
  }
  std::vector<Matrix6d> own, with_rig;
  BundleCovariance(*p, threads, cancel).PoseBlocks(rig_of, &own, &with_rig);
  double turned = 0, open = 0;
  for (const TurnedView& view : views) {
    const auto pose = static_cast<size_t>(view.pose), rig = static_cast<size_t>(rig_of[pose]);
    const Eigen::Vector3d turn = LogSO3(p->poses[pose].rotation * p->poses[rig].rotation.conjugate());
    const Matrix6d left = own[pose] + own[rig] - with_rig[pose] - with_rig[pose].transpose();
    turned += turn.squaredNorm(), open += left.topLeftCorner<3, 3>().trace();
  }
  const double unknowns = 3 * static_cast<double>(views.size());
  const double before = views.empty() ? 0 : SigmaOfTie(p->factors[static_cast<size_t>(views.front().factor)]);
  const double sigma = std::sqrt((turned + open) / std::max(1.0, unknowns));
  for (const TurnedView& view : views) {
    p->factors[static_cast<size_t>(view.factor)].sqrt_info = TieOf(sigma, view.centre);
  }
  return {sigma, std::max(0.0, unknowns - open / (before * before))};
}

}  // namespace trigpoint

// What a single tag may have done to contradict the rest of a map: stand elsewhere in one of the runs, or be of another
// size than stated. Each is tested as an extra parameter of the present solution (Baarda 1968, Teunissen 2006): with
// A its derivative of the tag's whitened residuals, J the design and Q the inverse normal matrix,
//   N = A'A - A'J Q J'A,   g = A'r - A'J Q J'r,   estimate = -N^-1 g,   T = g' N^-1 g ~ chi-square.
// Residuals alone don't show it: odometry bends and cameras step aside, and every picture looks a little wrong.
#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "calib/base/error.h"
#include "calib/base/parallel.h"
#include "calib/geo/geodetic.h"
#include "calib/geo/unit_of_length.h"
#include "survey/tags/control.h"
#include "survey/tags/map_solver.h"

namespace trigpoint {
namespace {

constexpr double kSizeChi2 = 21.0;                // 5e-6 at 1
constexpr double kLeastTurn_rad = 2 * kDegToRad;  // less is no turn but a weakness of the model
constexpr double kTurned_deg = 20;                // of a sheet between two runs: said, wherever it hangs
constexpr double kLeastSizeError = 0.035;         // odometry, whose scale wanders along its way, can show no less
constexpr double kCommonSizeChi2 = 10.8;          // 0.1 % at 1
constexpr double kLeastCommonSize = 0.005;        // less is within what a ruler shows
constexpr double kLeastControlScale = 0.03;       // of known points, before they are called wrong
constexpr double kScaleKnown = 0.05;              // odometry with a larger scale sigma shows nothing about sizes
constexpr double kLeastShown = 0.2;               // of a run's scale, by the tags, over the prior
constexpr size_t kMostExact = 48;                 // hypotheses looked at closely each round
constexpr double kBetter = 1.3;                   // chi-square of one explanation, against that of another
constexpr double kClearlyBetter = 1.5;
constexpr double kRulesOut = 4;  // sigmas of odometry: every run of every site is asked

}  // namespace

struct MapSolver::Hypothesis {
  int place = 0;
  int run = -1;  // of a move; -1: size
  std::vector<int> observations;
  double quick = 0;  // T without the other unknowns' part: a lower bound
  double chi2 = 0;
  Eigen::VectorXd estimate;
  Eigen::MatrixXd covariance;
};

// Weighted derivative of an observation's residual by the hypothesis, from that by the tag's pose.
Eigen::MatrixXd MapSolver::DerivativeOf(const Hypothesis& h, int observation) const {
  const MapSight& s = start_.sights[static_cast<size_t>(observations_[static_cast<size_t>(observation)].index)];
  const MapFrame& frame = start_.frames[static_cast<size_t>(s.frame)];
  const auto run = static_cast<size_t>(frame.run);
  const Rigid3d& tag = tags_.at(s.place);
  const double size = SizeOf(s.place);
  Matrix86d by_tag;
  TagResidual(s.sight, size, input_.runs[run].cameras[static_cast<size_t>(s.camera)].cam_from_body,
              *frame.world_from_body, tag, nullptr, &by_tag);
  by_tag *= std::sqrt(solver_.Weight(observation)) / run_states_[run].corner;
  if (h.run >= 0) return by_tag;
  Vector8d by_log_size;
  for (int k = 0; k < 4; ++k) {
    by_log_size.segment<2>(2 * k) = by_tag.block<2, 3>(2 * k, 3) * (tag.rotation * TagCorner(size, k));
  }
  return by_log_size;
}

void MapSolver::Test(Hypothesis* h, bool exact) const {
  Eigen::MatrixXd normal, coupling;
  Eigen::VectorXd gradient;
  for (int i : h->observations) {
    const Eigen::MatrixXd a = DerivativeOf(*h, i);
    if (normal.size() == 0) {
      normal = Eigen::MatrixXd::Zero(a.cols(), a.cols());
      gradient = Eigen::VectorXd::Zero(a.cols());
      if (exact) coupling = Eigen::MatrixXd::Zero(solver_.Equations(), a.cols());
    }
    normal += a.transpose() * a;
    gradient += a.transpose() * (std::sqrt(solver_.Weight(i)) * solver_.Residual(i));
    if (exact) solver_.AddTransposed(i, a, &coupling);
  }
  if (exact) {
    // The solution ends a little beside the minimum: what is left of its gradient is not the hypothesis's. Where almost
    // nothing but this tag joins a run to the others, N is a small difference, and the remainder would decide.
    const Eigen::MatrixXd solved = solver_.SolveNormal(coupling);
    normal -= coupling.transpose() * solved;
    gradient -= solved.transpose() * solver_.Gradient();
  }
  // What the rest of the map takes in entirely cannot be tested.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(normal);
  const Eigen::VectorXd& values = eigen.eigenvalues();
  Eigen::VectorXd inverse = Eigen::VectorXd::Zero(values.size());
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    if (values[k] > 1e-6 * std::max(1.0, values.maxCoeff())) inverse[k] = 1 / values[k];
  }
  h->covariance = eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose();
  h->estimate = -h->covariance * gradient;
  (exact ? h->chi2 : h->quick) = gradient.dot(h->covariance * gradient);
}

// Each tag of another size, and elsewhere in each of the runs.
std::vector<MapSolver::Hypothesis> MapSolver::TagHypotheses() const {
  std::map<int, std::map<int, std::vector<int>>> of_place;  // place, run: observations
  for (size_t i = 0; i < observations_.size(); ++i) {
    if (observations_[i].kind != Kind::kTag) continue;
    const MapSight& s = start_.sights[static_cast<size_t>(observations_[i].index)];
    of_place[s.place][start_.frames[static_cast<size_t>(s.frame)].run].push_back(static_cast<int>(i));
  }
  std::vector<Hypothesis> hypotheses;
  for (const auto& [place, runs] : of_place) {
    Hypothesis size;
    size.place = place;
    for (const auto& [run, observations] : runs) {
      size.observations.insert(size.observations.end(), observations.begin(), observations.end());
    }
    // Of two runs that disagree the one with fewer pictures, else the later, is said to see the other place.
    for (auto it = runs.rbegin(); runs.size() > 1 && it != runs.rend(); ++it) {
      if (it->second.size() < kLeastSights || size.observations.size() - it->second.size() < kLeastSights) continue;
      if (runs.size() == 2) {
        const size_t first = runs.begin()->second.size(), last = runs.rbegin()->second.size();
        if ((it == runs.rbegin()) != (last <= first)) continue;
      }
      Hypothesis move;
      move.place = place;
      move.run = it->first;
      move.observations = it->second;
      hypotheses.push_back(std::move(move));
    }
    if (size.observations.size() > kLeastSights) hypotheses.push_back(std::move(size));
  }
  return hypotheses;
}

// Gives a tag that stands elsewhere in a run a place of its own there, and one of another size its size; the worst of
// each run at a time. True if there was one.
bool MapSolver::SnoopTags() {
  std::vector<Hypothesis> hypotheses = TagHypotheses();
  ParallelFor(static_cast<int64_t>(hypotheses.size()), threads_, cancel_,
              [&](int64_t i) { Test(&hypotheses[static_cast<size_t>(i)], false); });
  const auto threshold = [](const Hypothesis& h) { return h.run >= 0 ? kMoveChi2 : kSizeChi2; };
  std::stable_sort(hypotheses.begin(), hypotheses.end(), [&](const Hypothesis& a, const Hypothesis& b) {
    return a.quick / threshold(a) > b.quick / threshold(b);
  });
  hypotheses.resize(std::min(hypotheses.size(), kMostExact));
  ParallelFor(static_cast<int64_t>(hypotheses.size()), threads_, cancel_,
              [&](int64_t i) { Test(&hypotheses[static_cast<size_t>(i)], true); });
  std::stable_sort(hypotheses.begin(), hypotheses.end(), [&](const Hypothesis& a, const Hypothesis& b) {
    return a.chi2 / threshold(a) > b.chi2 / threshold(b);
  });
  const double single = hypotheses.empty() ? 0 : hypotheses.front().chi2;
  const double relative = hypotheses.empty() ? 0 : single / threshold(hypotheses.front());
  // Odometry by itself may be what is off: without known lengths the difference is named and nothing is changed.
  const Hypothesis all = HasKnownLengths() ? CommonSizeHypothesis() : Hypothesis();
  const auto control = WorstControl(true);
  if (control && control->second > std::max(kPointChi2, kBetter * std::max(single, all.chi2))) return SnoopControl();
  if (SnoopCommonSize(all, relative)) return true;
  std::set<int> disturbed;  // runs
  std::map<int, double> slips;
  bool any = false;
  for (const Hypothesis& h : hypotheses) {
    if (h.chi2 <= threshold(h)) break;
    std::set<int> its_runs;
    for (int i : h.observations) {
      const MapSight& s = start_.sights[static_cast<size_t>(observations_[static_cast<size_t>(i)].index)];
      its_runs.insert(start_.frames[static_cast<size_t>(s.frame)].run);
    }
    if (std::any_of(its_runs.begin(), its_runs.end(), [&](int r) { return disturbed.contains(r); })) continue;
    if (std::any_of(its_runs.begin(), its_runs.end(), [&](int r) {
          const auto [slip, fresh] = slips.try_emplace(r, 0);
          if (fresh) slip->second = SlipChi2(r);
          return h.chi2 < kBetter * slip->second;
        }))
      continue;
    if (h.run < 0) {
      // Control may show what odometry cannot.
      const double least = ControlAsksFor(h.chi2) ? kLeastCommonSize : kLeastSizeError;
      if (std::abs(h.estimate[0]) < least && sizes_found_.count(h.place) == 0) continue;
      SizeFound& found = sizes_found_[h.place];
      found.log_ratio += std::clamp(h.estimate[0], -0.7, 0.7);
      found.sigma = std::sqrt(h.covariance(0, 0));
      if (std::abs(h.estimate[0]) < 0.1 * found.sigma) continue;
    } else {
      if (h.estimate.tail<3>().norm() < kLeastMove_m && h.estimate.head<3>().norm() < kLeastTurn_rad) continue;
      LeaveOutControlOn(IdOf(h.place));
      for (MapSight* s : GivePlace(h.place, h.run, tags_.at(h.place).Plus(h.estimate))) s->rejected = false;
    }
    disturbed.insert(its_runs.begin(), its_runs.end());
    any = true;
  }
  return any;
}

// A place of its own for a tag in one run. The pictures that show it there; without any there is no such place.
std::vector<MapSight*> MapSolver::GivePlace(int tag_place, int run, const Rigid3d& world_from_tag) {
  std::vector<MapSight*> sights;
  for (MapSight& s : start_.sights) {
    if (s.place == tag_place && start_.frames[static_cast<size_t>(s.frame)].run == run) sights.push_back(&s);
  }
  if (sights.empty()) return sights;
  const int place = -1 - static_cast<int>(moved_.size());
  moved_.push_back({IdOf(tag_place), run});
  tags_[place] = world_from_tag;
  for (MapSight* s : sights) s->place = place;
  return sights;
}

// A surveyed tag that was moved: nobody knows at which of its places it was surveyed.
void MapSolver::LeaveOutControlOn(int tag_id) {
  std::vector<Eigen::Vector3d> left;
  for (const SurveyPoint& p : datum_points_) {
    if (p.role == PointRole::kControl && !Excluded(p) && p.tag_id != tag_id) left.push_back(p.world_m);
  }
  for (const SurveyPoint& p : datum_points_) {
    if (p.role != PointRole::kControl || p.tag_id != tag_id || Excluded(p)) continue;
    if (AreWellSpread(left)) {
      excluded_.insert(p.name);
    } else {
      Warn(fmt::format("control point {}: its tag stands at several places; it is used as nothing else holds the map",
                       p.name));
    }
  }
}

// One factor on the sizes of all tags.
MapSolver::Hypothesis MapSolver::CommonSizeHypothesis() const {
  Hypothesis all;
  for (size_t i = 0; i < observations_.size(); ++i) {
    if (observations_[i].kind == Kind::kTag) all.observations.push_back(static_cast<int>(i));
  }
  if (!all.observations.empty()) Test(&all, true);
  return all;
}

// Two control points that are used, or a measured distance.
bool MapSolver::HasKnownLengths() const {
  const auto control = std::count_if(datum_points_.begin(), datum_points_.end(), [&](const SurveyPoint& p) {
    return p.role == PointRole::kControl && !Excluded(p);
  });
  const auto distances =
      std::count_if(input_.distances.begin(), input_.distances.end(), [](const SurveyDistance& d) { return !d.check; });
  return control >= 2 || distances > std::ssize(wrong_distances_);
}

// Such a factor, and its sigma, as odometry by itself asks for it, by its runs' scales: control that is wrong looks
// like a wrong size, too, and draws odometry the other way.
std::optional<std::pair<double, double>> MapSolver::SizeByOdometry() const {
  double weights = 0, sum = 0;
  for (size_t r = 0; r < run_states_.size(); ++r) {
    const RunState& state = run_states_[r];
    const int offset = state.scale_unknown < 0 ? -1 : solver_.Offset(state.scale_unknown);
    if (offset < 0 || input_.runs[r].scale_sigma > kScaleKnown) continue;
    const double prior = std::pow(input_.runs[r].scale_sigma, 2);
    const double shrunk = 1 - solver_.Covariance(offset, offset, 1, 1)(0, 0) / prior;  // the prior's pull is undone
    if (shrunk < kLeastShown) continue;
    sum += -std::log(std::max(0.1, 1 + (state.scale - 1) / shrunk)) / prior;
    weights += 1 / prior;
  }
  if (!(weights > 0)) return std::nullopt;
  return std::pair(sum / weights, 1 / std::sqrt(weights));
}

bool MapSolver::OdometryAsksFor(double log_ratio) const {
  const auto by_odometry = SizeByOdometry();
  if (!by_odometry) return false;
  const auto [asked, sigma] = *by_odometry;
  return asked * log_ratio > 0 && std::abs(asked) > 2 * sigma && std::abs(asked - log_ratio) < 3 * sigma;
}

bool MapSolver::OdometryRulesOut(double log_ratio) const {
  const auto by_odometry = SizeByOdometry();
  return by_odometry && std::abs(by_odometry->first - log_ratio) > kRulesOut * by_odometry->second;
}

// Whether such a factor, with this chi-square, explains clearly more than the worst control point does: a wrong point
// explains all that it spoils, and a wrong size spoils all points.
bool MapSolver::ControlAsksFor(double chi2) const {
  const auto worst = WorstControl(false);
  return worst && chi2 > kClearlyBetter * worst->second;
}

// Throws if control is what has another scale: it asks for a factor on the sizes that odometry rules out. Tags' sizes
// and odometry agree then.
void MapSolver::RequireMetres(const Hypothesis& all) const {
  const double log_ratio = all.estimate[0];
  if (!options_.check_conventions || all.chi2 <= kSizeChi2 || std::abs(log_ratio) < kLeastControlScale ||
      !ControlAsksFor(all.chi2) || !OdometryRulesOut(log_ratio))
    return;
  const double factor = std::exp(log_ratio);
  const std::string unit = UnitOfLength(1 / factor, 3 * std::sqrt(all.covariance(0, 0)) + 0.01);
  throw InputError(
      fmt::format("control_points.csv: the surveyed points are {:.4g} times as far from each other as by the tags' "
                  "sizes and by odometry, which agree; expected metres{}: check the table's unit and the scale of its "
                  "grid. Option --set survey.check_conventions=false skips this check",
                  factor, unit.empty() ? "" : ", found what may be " + unit));
}

// A sheet printed at 97 %, or sizes measured over the white border: it explains more than any single tag's fault
// (`single`: the worst one's chi-square over its threshold). True if the factor changed.
bool MapSolver::SnoopCommonSize(const Hypothesis& all, double single) {
  if (all.observations.empty() || !(all.covariance(0, 0) > 0)) return false;
  const double log_ratio = all.estimate[0], sigma = std::sqrt(all.covariance(0, 0));
  const bool known = common_log_size_ != 0;
  if (!known) RequireMetres(all);
  if (known ? std::abs(log_ratio) < 0.1 * sigma
            : all.chi2 <= kSizeChi2 * std::max(1.0, single) || std::abs(log_ratio) < kLeastCommonSize ||
                  (!OdometryAsksFor(log_ratio) && (!ControlAsksFor(all.chi2) || OdometryRulesOut(log_ratio)))) {
    return false;
  }
  common_log_size_ += std::clamp(log_ratio, -0.7, 0.7);
  if (!known) sizes_found_.clear();  // single tags that were blamed for it are tested anew
  return true;
}

// Names the factor that SnoopCommonSize took in, or one that is likely, and adds its uncertainty to the tags'.
void MapSolver::JudgeCommonSize() {
  const Hypothesis all = CommonSizeHypothesis();
  if (all.observations.empty() || !(all.covariance(0, 0) > 0)) return;
  const double sigma = std::sqrt(all.covariance(0, 0)), log_ratio = common_log_size_ + all.estimate[0];
  const bool used = common_log_size_ != 0;
  if (!used && (all.chi2 <= kCommonSizeChi2 || std::abs(log_ratio) < kLeastCommonSize || !OdometryAsksFor(log_ratio))) {
    return;
  }
  result_.common_size = CommonSize{log_ratio, sigma};
  Warn(fmt::format(
      "tags.yaml: all tags are {:.2g} % {} than stated (1 sigma {:.2g} %) by {}: measure the black square of a printed "
      "tag and correct the sizes",
      100 * std::abs(std::expm1(log_ratio)), log_ratio < 0 ? "smaller" : "larger", 100 * sigma,
      used                ? "known points and odometry; the map is made with the sizes found"
      : HasKnownLengths() ? "known points and odometry; the difference is part of the tags' sigmas"
                          : "odometry, or odometry's scale is off; the difference is part of the tags' sigmas"));
  AddSizeUncertainty(all, used ? sigma : std::hypot(sigma, log_ratio));
}

// What sizes that were found with this sigma (of the logarithm) add to the covariances of all tags, and to those
// between them: the error is one for all.
void MapSolver::AddSizeUncertainty(const Hypothesis& size, double sigma) {
  Eigen::MatrixXd coupling = Eigen::MatrixXd::Zero(solver_.Equations(), 1);
  for (int i : size.observations) solver_.AddTransposed(i, DerivativeOf(size, i), &coupling);
  const Eigen::MatrixXd by_log_size = solver_.SolveNormal(coupling);
  std::map<int, Vector6d> moved;
  for (TagEstimate& tag : result_.tags) {
    const auto unknown = tag_unknown_.find(tag.tag_id);
    const int offset = unknown == tag_unknown_.end() ? -1 : solver_.Offset(unknown->second);
    if (!tag.HasPose() || offset < 0) continue;
    const Vector6d by = sigma * by_log_size.block<6, 1>(offset, 0);
    tag.covariance += by * by.transpose();
    moved[tag.tag_id] = by;
  }
  for (auto& [pair, covariance] : result_.cross) {
    const auto a = moved.find(pair.first), b = moved.find(pair.second);
    if (a != moved.end() && b != moved.end()) covariance += a->second * b->second.transpose();
  }
}

void MapSolver::JudgeSizes() {
  for (const Hypothesis& h : TagHypotheses()) {
    const auto found = sizes_found_.find(h.place);
    if (h.run < 0 && found != sizes_found_.end()) AddSizeUncertainty(h, found->second.sigma);
  }
  JudgeCommonSize();
}

// Names what SnoopTags found.
void MapSolver::JudgePlaces(TagEstimate* tag) const {
  const auto size = sizes_found_.find(tag->tag_id);
  if (size != sizes_found_.end() && std::abs(size->second.log_ratio) > 3 * size->second.sigma) {
    const double stated = input_.sizes.SizeOf(tag->tag_id), found = SizeOf(tag->tag_id);
    tag->status = "size";
    tag->reason = fmt::format("its edge is {:.4f} +- {:.4f} m (1 sigma) by the pictures, stated are {:.4f} m", found,
                              found * size->second.sigma, stated);
  }
  std::string text;
  for (size_t k = 0; k < moved_.size(); ++k) {
    const auto at = tags_.find(-1 - static_cast<int>(k));
    if (moved_[k].tag_id != tag->tag_id || at == tags_.end() || !tag->world_from_tag) continue;
    const Eigen::Vector3d& a = tag->world_from_tag->translation;
    const Eigen::Vector3d& b = at->second.translation;
    const double turned_deg = AngleBetween(tag->world_from_tag->rotation, at->second.rotation) * kRadToDeg;
    if (!IsAnotherPlace((b - a).norm(), tag->size_m) && turned_deg < kTurned_deg) continue;  // the same, found twice
    text += fmt::format("{}in {} it stands at ({:.2f}, {:.2f}, {:.2f}), {:.2f} m from ({:.2f}, {:.2f}, {:.2f})",
                        text.empty() ? "" : "; ", input_.runs[static_cast<size_t>(moved_[k].run)].name, b.x(), b.y(),
                        b.z(), (b - a).norm(), a.x(), a.y(), a.z());
    if (turned_deg >= kTurned_deg) text += fmt::format(", turned by {:.0f} deg", turned_deg);
  }
  if (text.empty()) return;
  tag->status = duplicates_.count(tag->tag_id) > 0 ? "duplicate" : "moved";
  tag->reason = text;
}

}  // namespace trigpoint

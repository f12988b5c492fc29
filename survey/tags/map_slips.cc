// Steps of odometry that jumped, and tags that moved and only look like such steps: before the first and after the last
// tag of a run, and where few other tags are near, odometry's jump explains what a moved tag does. Both are solved, and
// the one that needs less is kept: chi-square and a price for each step or tag that is given up.
#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "datasets/io/trajectory.h"
#include "survey/tags/map_solver.h"

namespace trigpoint {
namespace {

constexpr double kClearly = 13.8;    // difference of chi-square that decides: odds of 1000 to 1 (Neyman, Pearson 1933)
constexpr size_t kMostInstead = 16;  // tags asked about jumps in a run

}  // namespace

std::string MoveOrJump::Text(const std::string& run_name) const {
  return fmt::format(
      "tag {} was {:.2f} m from its place when {} passed it, or odometry of {} jumped at {} s; the pictures do not "
      "show which: photograph the tag together with its neighbours",
      tag_id, moved_m, run_name, run_name, FormatNsAsSeconds(jump_ns, 1));
}

// What a solution starts from and changes.
struct MapSolver::State {
  MapStart start;
  std::map<int, Rigid3d> tags;
  std::map<std::string, Eigen::Vector3d> marked;
  std::vector<Eigen::Vector3d> tie_points;
  std::vector<RunState> runs;
  Eigen::Vector3d shift;
  std::vector<SplitPlace> moved;
  std::set<int> slipped;
};

MapSolver::State MapSolver::Save() const {
  return {start_, tags_, marked_, tie_points_, run_states_, shift_, moved_, slipped_};
}

void MapSolver::Restore(const State& s) {
  start_ = s.start, tags_ = s.tags, marked_ = s.marked, tie_points_ = s.tie_points;
  run_states_ = s.runs, shift_ = s.shift, moved_ = s.moved, slipped_ = s.slipped;
}

// Marks steps at which odometry jumps: their sigma becomes kSlip times larger. True if there was one.
bool MapSolver::SnoopOdometry() {
  bool any = false;
  for (size_t i = 0; i < observations_.size(); ++i) {
    const Observation& o = observations_[i];
    if (o.kind != Kind::kOdometry || slipped_.count(o.index) > 0) continue;
    if (solver_.Residual(static_cast<int>(i)).squaredNorm() < kSlipChi2) continue;
    slipped_.insert(o.index);
    any = true;
  }
  return any;
}

// Chi-square of the step of a run's odometry that looks most like a jump, as an extra parameter (map_hypotheses.cc). A
// tag that stands elsewhere bends odometry twice, before and after it; a jump is there for all tags that follow.
double MapSolver::SlipChi2(int run) const {
  double most = 0;
  for (size_t i = 0; i < observations_.size(); ++i) {
    const Observation& o = observations_[i];
    if (o.kind != Kind::kOdometry || slipped_.count(o.index) > 0 ||
        start_.frames[static_cast<size_t>(o.index)].run != run)
      continue;
    const int factor = static_cast<int>(i);
    const Eigen::VectorXd r = std::sqrt(solver_.Weight(factor)) * solver_.Residual(factor);
    const Eigen::MatrixXd left = Eigen::MatrixXd::Identity(r.size(), r.size()) * 1.0001 - solver_.Leverage(factor);
    most = std::max(most, r.dot(left.ldlt().solve(r)));
  }
  return most;
}

// Tags that may have moved where odometry is said to have jumped, by place and run: those of the last pictures before a
// jump and of the first after it, that other runs see, too. Each with the jumps that it would explain.
std::map<std::pair<int, int>, std::set<int>> MapSolver::NearSlips() const {
  std::map<std::pair<int, int>, int> sights;
  std::map<int, int> of_place;
  std::vector<std::set<int>> places(start_.frames.size());
  for (const MapSight& s : start_.sights) {
    if (s.place < 0 || !Placed(s.frame) || tags_.count(s.place) == 0) continue;
    ++sights[{s.place, start_.frames[static_cast<size_t>(s.frame)].run}];
    ++of_place[s.place];
    places[static_cast<size_t>(s.frame)].insert(s.place);
  }
  std::map<std::pair<int, int>, std::set<int>> near;
  const auto add = [&](int slip, int frame, int step) {
    const int run = start_.frames[static_cast<size_t>(slip)].run;
    for (int f = frame; f >= 0 && f < std::ssize(places) && start_.frames[static_cast<size_t>(f)].run == run;
         f += step) {
      for (int place : places[static_cast<size_t>(f)]) {
        const int its = sights.at({place, run});
        if (std::min(its, of_place.at(place) - its) >= kLeastSights) near[{place, run}].insert(slip);
      }
      if (!places[static_cast<size_t>(f)].empty()) return;
    }
  };
  for (int slip : slipped_) {
    add(slip, slip - 1, -1);
    add(slip, slip, 1);
  }
  return near;
}

// Chi-square of the map, and the price of what was given up for it. What was rejected counts as far as the gate.
double MapSolver::Score(double cost) const {
  double score =
      2 * cost + kSlipChi2 * static_cast<double>(slipped_.size()) + kMoveChi2 * static_cast<double>(moved_.size());
  for (const MapSight& s : start_.sights) {
    if (!s.rejected || !Placed(s.frame) || tags_.count(s.place) == 0) continue;
    score += std::min(options_.snooping_chi2, SightChi2(s));
  }
  return score;
}

// Odometry is said to have jumped: gives a tag a place of its own in that run instead where this explains the same, or
// more, with less; true if it did. Where neither is clearly better both are named.
bool MapSolver::ReplaceSlips() {
  const auto near = NearSlips();
  undecided_.clear();
  if (near.empty()) return false;
  const State with_slips = Save();
  const double score = Score(result_.cost_after);
  double best = score + kClearly;
  std::optional<State> instead;
  std::map<int, int> asked;  // by run
  for (const auto& [where, slips] : near) {
    const auto [place, run] = where;
    if (++asked[run] > static_cast<int>(kMostInstead)) continue;
    const int id = IdOf(place);
    GivePlace(place, run, tags_.at(place));
    for (int slip : slips) slipped_.erase(slip);
    const double its = Score(Solve(false).cost_after);
    const double moved_m =
        (tags_.at(-static_cast<int>(moved_.size())).translation - tags_.at(place).translation).norm();
    const bool is_other = IsAnotherPlace(moved_m, SizeOf(place));
    if (is_other && its < score + kClearly) {
      undecided_.push_back({id, run, start_.frames[static_cast<size_t>(*slips.begin())].stamp_ns, moved_m});
    }
    if (is_other && its < std::min(best, score - kClearly)) best = its, instead = Save();
    Restore(with_slips);
  }
  if (instead) {
    Restore(*instead);
    undecided_.clear();
    LeaveOutControlOn(moved_.back().tag_id);
  } else {
    Solve(true);  // what is linearised is the last tag's
  }
  return instead.has_value();
}

}  // namespace trigpoint

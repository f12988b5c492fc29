#include "localize/georegistration/georegistration.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

#include "calib/base/median.h"
#include "calib/estimation/median_test.h"
#include "calib/geo/unit_of_length.h"
#include "calib/geometry/alignment.h"

namespace trigpoint {
namespace {

constexpr double kApart_m = 0.5;        // places closer than this show no direction
constexpr size_t kFew = 60;             // geotags up to which several starts are tried
constexpr size_t kStarts = 12;          // the most plausible ones
constexpr double kDifferent = 5;        // solutions farther apart than so many sigmas are two
constexpr size_t kPositionsDecide = 4;  // so many positions show by themselves which headings are wrong
constexpr double kWrongHeading_rad = 20 * kDegToRad;
constexpr double kMostScale = 0.15;         // logarithm: a scale farther off is a wrong unit, not drift
constexpr double kLeastScaleSigma = 0.002;  // of odometry that geotags contradict: wheels wear, tyres warm up
constexpr double kDiscordant = 1.96;        // 95 %: two scales farther apart do not have their stated sigmas
constexpr double kLessCost = kDiscordant * kDiscordant;  // another scale is looked at if the fit is better by this
constexpr double kUnknownScale = 0.5;                    // sigmas of the scale from here on: it is measured, not known
constexpr double kStill = 1e-7;                          // rad, m: a step as short ends the iteration
constexpr int kFewSteps = 4;                             // from an estimate to one of slightly other data
constexpr double kMostSigmaFactor = 5;                   // sigmas too small by more than this are a contradiction

using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;

Sim3d Moved(const Sim3d& s, const Vector7d& d) {
  return {s.scale + d(6), (ExpSO3(d.head<3>()) * s.rotation).normalized(), s.translation + d.segment<3>(3)};
}

// Rows of one observation: position (3), then heading, pitch, roll. Sigma 0 marks a row that is not observed.
struct Rows {
  Vector6d r = Vector6d::Zero();                                        // predicted - stated
  Vector6d sigma = Vector6d::Zero();                                    // of what is stated
  Eigen::Matrix<double, 6, 7> j = Eigen::Matrix<double, 6, 7>::Zero();  // d r / d global
  Matrix6d jo = Matrix6d::Zero();                                       // d r / d odom_from_rig
};

Rows Evaluate(const GeoObservation& o, const Sim3d& s) {
  Rows rows;
  const Eigen::Vector3d rotated = s.rotation * o.odom_from_rig.translation;
  const Eigen::Matrix3d rot = s.rotation.toRotationMatrix();
  if (o.has_position) {
    rows.r.head<3>() = s.scale * rotated + s.translation - o.position;
    rows.sigma.head<3>() << o.sigma_h_m, o.sigma_h_m, o.has_height ? o.sigma_v_m : 0;
    rows.j.topLeftCorner<3, 3>() = -s.scale * Skew(rotated);
    rows.j.block<3, 3>(0, 3).setIdentity();
    rows.j.block<3, 1>(0, 6) = rotated;
    rows.jo.topRightCorner<3, 3>() = s.scale * rot;
  }
  if (o.has_heading || o.has_tilt) {
    const Eigen::Quaterniond world_from_rig = s.rotation * o.odom_from_rig.rotation;
    const Attitude a = AttitudeOf(world_from_rig);
    // A view straight up or down has no heading: its attitude is not used.
    if (std::cos(a.pitch_rad) > 0.05) {
      const Eigen::Matrix3d ja = AttitudeJacobian(world_from_rig);
      rows.r.tail<3>() << WrapAngle(a.heading_rad - o.attitude.heading_rad),
          WrapAngle(a.pitch_rad - o.attitude.pitch_rad), WrapAngle(a.roll_rad - o.attitude.roll_rad);
      rows.sigma.tail<3>() << (o.has_heading ? o.sigma_heading_rad : 0), (o.has_tilt ? o.sigma_tilt_rad : 0),
          (o.has_tilt ? o.sigma_tilt_rad : 0);
      rows.j.bottomLeftCorner<3, 3>() = ja;
      rows.jo.bottomLeftCorner<3, 3>() = ja * rot;
    }
  }
  return rows;
}

// Dynamic covariance scaling: evidence below the threshold keeps its full weight, so that the covariance of a fit
// without outliers is that of least squares.
double RobustWeight(double s, double knee) { return s <= knee ? 1.0 : std::pow(2 * knee / (knee + s), 2); }

// Dynamic covariance scaling's cost, whose weight is RobustWeight.
double RobustCost(double s, double knee) { return s <= knee ? s : knee * (3 * s - knee) / (knee + s); }

// A fit to geotags from one start, and what it makes of each of them.
struct EarthSolution {
  bool good = false;
  Sim3d s;
  int iterations = 0;
  double cost = 0;
  Matrix7d h = Matrix7d::Zero();
  std::vector<double> w_position, w_attitude;
  std::vector<double> position_chi2, attitude_chi2;  // against the geotag's own noise plus the place's
  std::vector<int> position_rows;
  std::vector<double> heading_chi2, heading_rad;  // of the heading alone
  std::vector<Eigen::Vector3d> residuals;
};

// How far each position is off, squared and over what its sigma and that of the run at it allow: 1 in the median.
std::vector<double> RatiosAlone(const EarthSolution& solution) {
  std::vector<double> ratios;
  for (size_t i = 0; i < solution.position_rows.size(); ++i) {
    if (solution.position_rows[i] == 0) continue;
    ratios.push_back(solution.position_chi2[i] / kMediansOfChi2[solution.position_rows[i]]);
  }
  return ratios;
}

// Robust generalised least squares over rotation, translation and scale. Rows are whitened against geotag noise plus
// the places' own covariance; robust weights are of geotags.
class EarthFit {
 public:
  EarthFit(const std::vector<GeoObservation>& obs, const Eigen::MatrixXd& odom_covariance, double scale_prior,
           double scale_sigma, double tilt_sigma_rad, const GeoRegistrationOptions& options)
      : obs_(obs),
        odom_covariance_(odom_covariance),
        scale_prior_(scale_prior),
        scale_sigma_(scale_sigma),
        tilt_sigma_rad_(tilt_sigma_rad),
        heights_(std::any_of(obs.begin(), obs.end(),
                             [](const GeoObservation& o) { return o.has_position && o.has_height; })),
        options_(options) {}

  // First guesses, the most plausible first.
  std::vector<Sim3d> Guesses() const;
  // From a start whose evidence is weighed by how well it fits there, or not at all yet.
  EarthSolution Solve(const Sim3d& start, bool weigh_start) const {
    return Solve(start, weigh_start, options_.iterations);
  }
  // A few steps from an estimate with slightly other data.
  EarthSolution SolveNear(const Sim3d& estimate) const { return Solve(estimate, true, kFewSteps); }
  // The same, those that are no outliers by Baarda's test of each: its neighbours have the run's errors in common with
  // it, so that they show what it alone does not.
  std::vector<double> SquaredRatios(const EarthSolution& solution) const;
  // What the result holds besides the estimate.
  void Describe(const EarthSolution& solution, GeoRegistration* result) const;

 private:
  EarthSolution Solve(const Sim3d& start, bool weigh_start, int most_iterations) const;
  struct System {
    std::vector<std::pair<size_t, int>> rows;  // observation, row of its Rows
    Eigen::MatrixXd jac;                       // rows x 7
    Eigen::MatrixXd jo;                        // rows x 6: d row / d its own place
    Eigen::VectorXd r, own;                    // residual; variance by the place
    Eigen::MatrixXd weight;                    // inverse covariance of the rows
  };
  System Build(const Sim3d& s, const EarthSolution& weights) const;
  Eigen::VectorXd SeaSigmas(const std::vector<std::pair<size_t, int>>& rows) const;
  void AddPrior(const Sim3d& s, Matrix7d* h, Vector7d* g) const;
  double PriorCost(const Sim3d& s) const;
  void Weigh(const System& system, EarthSolution* solution) const;
  double Plausibility(const Sim3d& s) const;
  std::vector<double> BaardaOfEach(const Sim3d& s, const std::vector<size_t>& which) const;
  std::vector<double> BaardaOfEach(const Sim3d& s) const;

  const std::vector<GeoObservation>& obs_;
  const Eigen::MatrixXd& odom_covariance_;
  double scale_prior_, scale_sigma_, tilt_sigma_rad_;
  bool heights_;
  const GeoRegistrationOptions& options_;
};

void EarthFit::AddPrior(const Sim3d& s, Matrix7d* h, Vector7d* g) const {
  if (!heights_) {
    Eigen::Matrix<double, 1, 7> j = Eigen::Matrix<double, 1, 7>::Zero();
    double r = 0;
    for (const GeoObservation& o : obs_) {
      if (!o.has_position) continue;
      const Rows rows = Evaluate(o, s);
      j += rows.j.row(2);
      r += rows.r(2);
    }
    // Divided by their number on both sides: the mean has this sigma, however many there are.
    if (const double places = j(5); places > 0) {
      const double w = std::pow(1 / (places * kUnknownHeightSigma), 2);
      *h += w * j.transpose() * j;
      *g += w * j.transpose() * r;
    }
  }
  // Tilt of the odometry frame: the world's up seen in it, x and y.
  const Eigen::Matrix3d rot = s.rotation.toRotationMatrix();
  const Eigen::Vector3d up = rot.transpose() * Eigen::Vector3d::UnitZ();
  Eigen::Matrix<double, 2, 7> j = Eigen::Matrix<double, 2, 7>::Zero();
  j.leftCols<3>() = (rot.transpose() * Skew(Eigen::Vector3d::UnitZ())).topRows<2>();
  const double w = 1 / (tilt_sigma_rad_ * tilt_sigma_rad_);
  *h += w * j.transpose() * j;
  *g += w * j.transpose() * up.head<2>();
  (*h)(6, 6) += 1 / (scale_sigma_ * scale_sigma_);
  (*g)(6) += (s.scale - scale_prior_) / (scale_sigma_ * scale_sigma_);
}

double EarthFit::PriorCost(const Sim3d& s) const {
  const Eigen::Vector3d up = s.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  return up.head<2>().squaredNorm() / (tilt_sigma_rad_ * tilt_sigma_rad_) +
         std::pow((s.scale - scale_prior_) / scale_sigma_, 2);
}

// Robust cost with independent places: for choosing among first guesses.
double EarthFit::Plausibility(const Sim3d& s) const {
  double cost = std::pow((s.scale - scale_prior_) / scale_sigma_, 2);
  for (const GeoObservation& o : obs_) {
    const Rows rows = Evaluate(o, s);
    double sp = 0, sa = 0;
    for (int k = 0; k < 6; ++k) {
      const double slack = k < 2 ? 0.1 : k == 2 ? 0.1 + o.sigma_sea_m : 0.005;
      if (rows.sigma(k) > 0) (k < 3 ? sp : sa) += std::pow(rows.r(k) / (rows.sigma(k) + slack), 2);
    }
    cost += options_.loss_chi2 * (std::log1p(sp / options_.loss_chi2) + std::log1p(sa / options_.loss_chi2));
  }
  return cost;
}

std::vector<Sim3d> EarthFit::Guesses() const {
  constexpr size_t kPaired = 200;  // observations whose pairs are tried, at most
  const size_t every = (obs_.size() + kPaired - 1) / kPaired;
  std::vector<std::pair<double, Sim3d>> guesses;
  const auto add = [&](const Sim3d& s) { guesses.emplace_back(Plausibility(s), s); };
  for (size_t a = 0; a < obs_.size(); ++a) {
    const GeoObservation& o = obs_[a];
    if (!o.has_position) continue;
    // One reference with position and attitude fixes rotation and translation.
    if (o.has_heading) {
      Sim3d s;
      s.scale = scale_prior_;
      if (o.has_tilt) {
        s.rotation = WorldFromCamRotation(o.attitude) * o.odom_from_rig.rotation.conjugate();
      } else {
        const double yaw = AttitudeOf(o.odom_from_rig.rotation).heading_rad - o.attitude.heading_rad;
        s.rotation = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ());
      }
      s.translation = o.position - s.scale * (s.rotation * o.odom_from_rig.translation);
      add(s);
    }
    // Two positions give the yaw of a nearly level frame, and its scale where nothing else does.
    for (size_t b = 0; b < a && a % every == 0; b += every) {
      if (!obs_[b].has_position) continue;
      const Eigen::Vector3d od = o.odom_from_rig.translation - obs_[b].odom_from_rig.translation;
      const Eigen::Vector3d wd = o.position - obs_[b].position;
      if (od.head<2>().norm() < kApart_m) continue;
      Sim3d s;
      s.scale =
          scale_sigma_ > kUnknownScale * scale_prior_ && wd.norm() > kApart_m ? wd.norm() / od.norm() : scale_prior_;
      s.rotation = Eigen::AngleAxisd(std::atan2(wd.y(), wd.x()) - std::atan2(od.y(), od.x()), Eigen::Vector3d::UnitZ());
      s.translation =
          0.5 * (o.position + obs_[b].position) -
          s.scale * (s.rotation * (0.5 * (o.odom_from_rig.translation + obs_[b].odom_from_rig.translation)));
      add(s);
    }
  }
  std::stable_sort(guesses.begin(), guesses.end(), [](const auto& x, const auto& y) { return x.first < y.first; });
  std::vector<Sim3d> sorted;
  for (const auto& [cost, s] : guesses) sorted.push_back(s);
  return sorted;
}

// Of each row, 0 where it is no height above the sea.
Eigen::VectorXd EarthFit::SeaSigmas(const std::vector<std::pair<size_t, int>>& rows) const {
  Eigen::VectorXd sea(static_cast<Eigen::Index>(rows.size()));
  for (size_t k = 0; k < rows.size(); ++k) {
    sea(static_cast<Eigen::Index>(k)) = rows[k].second == 2 ? obs_[rows[k].first].sigma_sea_m : 0;
  }
  return sea;
}

EarthFit::System EarthFit::Build(const Sim3d& s, const EarthSolution& weights) const {
  System system;
  std::vector<Rows> all;
  for (size_t i = 0; i < obs_.size(); ++i) {
    all.push_back(Evaluate(obs_[i], s));
    for (int k = 0; k < 6; ++k) {
      if (all[i].sigma(k) > 0) system.rows.emplace_back(i, k);
    }
  }
  const auto m = static_cast<Eigen::Index>(system.rows.size());
  system.jac.resize(m, 7);
  system.jo.resize(m, 6);
  system.r.resize(m);
  Eigen::VectorXd variance(m);
  for (Eigen::Index k = 0; k < m; ++k) {
    const auto [i, row] = system.rows[static_cast<size_t>(k)];
    system.jac.row(k) = all[i].j.row(row);
    system.jo.row(k) = all[i].jo.row(row);
    system.r(k) = all[i].r(row);
    const double w = row < 3 ? weights.w_position[i] : weights.w_attitude[i];
    variance(k) = all[i].sigma(row) * all[i].sigma(row) / std::max(w, 1e-6);
  }
  const auto n = static_cast<Eigen::Index>(obs_.size());
  Eigen::MatrixXd of_places(6 * n, 6 * n);  // of all rows, observed or not
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      const Matrix6d own = all[static_cast<size_t>(i)].jo * odom_covariance_.block<6, 6>(6 * i, 6 * j) *
                           all[static_cast<size_t>(j)].jo.transpose();
      of_places.block<6, 6>(6 * i, 6 * j) = own;
      of_places.block<6, 6>(6 * j, 6 * i) = own.transpose();
    }
  }
  const auto place = [&](Eigen::Index k) {
    const auto [i, row] = system.rows[static_cast<size_t>(k)];
    return 6 * static_cast<Eigen::Index>(i) + row;
  };
  Eigen::MatrixXd covariance(m, m);
  for (Eigen::Index k = 0; k < m; ++k) {
    for (Eigen::Index l = 0; l < m; ++l) covariance(l, k) = of_places(place(l), place(k));
  }
  system.own = covariance.diagonal();
  covariance.diagonal() += variance;
  const Eigen::VectorXd sea = SeaSigmas(system.rows);
  covariance += sea * sea.transpose();
  system.weight = covariance.llt().solve(Eigen::MatrixXd::Identity(m, m));
  return system;
}

// Weights from the residuals against each geotag's own noise plus the place's.
void EarthFit::Weigh(const System& system, EarthSolution* solution) const {
  const size_t n = obs_.size();
  for (auto* chi2 :
       {&solution->position_chi2, &solution->attitude_chi2, &solution->heading_chi2, &solution->heading_rad}) {
    chi2->assign(n, 0);
  }
  solution->position_rows.assign(n, 0);
  std::vector<Rows> now;
  for (const GeoObservation& o : obs_) now.push_back(Evaluate(o, solution->s));
  const Eigen::VectorXd sea = SeaSigmas(system.rows);
  const auto variance = [&](size_t k) {
    const auto [i, row] = system.rows[k];
    return now[i].sigma(row) * now[i].sigma(row) + system.own(static_cast<Eigen::Index>(k));
  };
  // Where the sea lies, in its sigmas, by all heights above it: what is left of each is its own error.
  double information = 0;
  std::vector<double> shown;
  for (size_t k = 0; k < system.rows.size(); ++k) {
    const double of_sea = sea(static_cast<Eigen::Index>(k));
    if (!(of_sea > 0)) continue;
    information += of_sea * of_sea / variance(k);
    shown.push_back(now[system.rows[k].first].r(2) / of_sea);
  }
  const double sea_level = shown.empty() ? 0 : Median(std::move(shown)) * information / (1 + information);
  for (size_t k = 0; k < system.rows.size(); ++k) {
    const auto [i, row] = system.rows[k];
    const double left = now[i].r(row) - sea(static_cast<Eigen::Index>(k)) * sea_level;
    const double e2 = left * left / variance(k);
    (row < 3 ? solution->position_chi2 : solution->attitude_chi2)[i] += e2;
    if (row < 3) ++solution->position_rows[i];
    if (row == 3) solution->heading_chi2[i] = e2, solution->heading_rad[i] = now[i].r(row);
  }
  solution->cost = PriorCost(solution->s);
  for (size_t i = 0; i < n; ++i) {
    solution->w_position[i] = RobustWeight(solution->position_chi2[i], options_.loss_chi2);
    solution->w_attitude[i] = RobustWeight(solution->attitude_chi2[i], options_.loss_chi2);
    solution->cost += RobustCost(solution->position_chi2[i], options_.loss_chi2) +
                      RobustCost(solution->attitude_chi2[i], options_.loss_chi2);
    solution->residuals[i] = -now[i].r.head<3>();
    if (!obs_[i].has_height) solution->residuals[i].z() = 0;
  }
}

EarthSolution EarthFit::Solve(const Sim3d& start, bool weigh_start, int most_iterations) const {
  EarthSolution solution;
  solution.s = start;
  solution.w_position.assign(obs_.size(), 1);
  solution.w_attitude.assign(obs_.size(), 1);
  solution.residuals.assign(obs_.size(), Eigen::Vector3d::Zero());
  if (weigh_start) Weigh(Build(start, solution), &solution);
  for (int it = 0; it < most_iterations; ++it) {
    solution.iterations = it + 1;
    const System system = Build(solution.s, solution);
    solution.h = system.jac.transpose() * system.weight * system.jac;
    Vector7d g = system.jac.transpose() * (system.weight * system.r);
    AddPrior(solution.s, &solution.h, &g);
    const Vector7d step = -solution.h.ldlt().solve(g);
    if (!step.allFinite()) return solution;
    solution.s = Moved(solution.s, step);
    Weigh(system, &solution);
    if (step.norm() < kStill) break;
  }
  solution.good = true;
  return solution;
}

std::vector<double> EarthFit::SquaredRatios(const EarthSolution& solution) const {
  constexpr size_t kLeast = 3;  // two decide alone whether they agree
  constexpr int kMostWrong = 10;
  std::vector<double> ratios = RatiosAlone(solution);
  std::vector<size_t> left, ratio_of;  // positions that may be right; of each, where its ratio is
  for (size_t i = 0, k = 0; i < obs_.size(); ++i) {
    if (solution.position_rows[i] == 0) continue;
    if (solution.position_chi2[i] <= options_.outlier_chi2) left.push_back(i), ratio_of.push_back(k);
    ++k;
  }
  for (int wrong = 0; left.size() >= kLeast; ++wrong) {
    const std::vector<double> chi2 = BaardaOfEach(solution.s, left);
    for (size_t k = 0; k < left.size(); ++k) {
      ratios[ratio_of[k]] = chi2[k] / kMediansOfChi2[solution.position_rows[left[k]]];
    }
    // A gross error, which the run's uncertainty hides, is in the errors of its neighbours, too: these are tested
    // without it.
    const auto worst = std::max_element(chi2.begin(), chi2.end()) - chi2.begin();
    if (chi2[static_cast<size_t>(worst)] <= options_.outlier_chi2 || wrong == kMostWrong) break;
    left.erase(left.begin() + worst), ratio_of.erase(ratio_of.begin() + worst);
  }
  return ratios;
}

std::vector<double> EarthFit::BaardaOfEach(const Sim3d& s, const std::vector<size_t>& which) const {
  std::vector<GeoObservation> positions;
  std::vector<int> rows;  // of odom_covariance_
  for (const size_t i : which) {
    positions.push_back(obs_[i]);
    positions.back().has_heading = positions.back().has_tilt = false;
    for (int k = 0; k < 6; ++k) rows.push_back(6 * static_cast<int>(i) + k);
  }
  const Eigen::MatrixXd covariance = odom_covariance_(rows, rows);
  return EarthFit(positions, covariance, scale_prior_, scale_sigma_, tilt_sigma_rad_, options_).BaardaOfEach(s);
}

// Of the best fit near `s`: residuals v of positions with covariance C, whose cofactors are Qvv = C - J H^-1 J'; an
// error of one position alone has T = (P v)' (P Qvv P)^-1 (P v), its rows each (Baarda 1968).
std::vector<double> EarthFit::BaardaOfEach(const Sim3d& s) const {
  EarthSolution even;
  even.w_position.assign(obs_.size(), 1);
  even.w_attitude.assign(obs_.size(), 1);
  const System system = Build(s, even);
  const Eigen::MatrixXd pj = system.weight * system.jac;
  Matrix7d h = system.jac.transpose() * pj;
  Vector7d g = pj.transpose() * system.r;
  AddPrior(s, &h, &g);
  const auto solver = h.ldlt();
  const Eigen::VectorXd pv = system.weight * system.r - pj * solver.solve(g);
  const Eigen::MatrixXd pqp = system.weight - pj * solver.solve(pj.transpose());
  std::vector<double> chi2;
  for (Eigen::Index begin = 0, end = 0; begin < pv.size(); begin = end) {
    const auto of = [&](Eigen::Index k) { return system.rows[static_cast<size_t>(k)].first; };
    while (end < pv.size() && of(end) == of(begin)) ++end;
    const Eigen::VectorXd own = pv.segment(begin, end - begin);
    chi2.push_back(own.dot(pqp.block(begin, begin, end - begin, end - begin).ldlt().solve(own)));
  }
  return chi2;
}

void EarthFit::Describe(const EarthSolution& solution, GeoRegistration* result) const {
  const System system = Build(solution.s, solution);
  const Matrix7d inverse = solution.h.ldlt().solve(Matrix7d::Identity());
  Eigen::MatrixXd jo = Eigen::MatrixXd::Zero(system.jo.rows(), 6 * static_cast<Eigen::Index>(obs_.size()));
  for (Eigen::Index k = 0; k < jo.rows(); ++k) {
    jo.block<1, 6>(k, 6 * static_cast<Eigen::Index>(system.rows[static_cast<size_t>(k)].first)) = system.jo.row(k);
  }
  result->world_from_odom = solution.s;
  result->covariance = inverse;
  result->sensitivity = -inverse * system.jac.transpose() * system.weight * jo;
  result->weights = solution.w_position;
}

// How many positions and headings fit.
int Votes(const EarthSolution& solution, const std::vector<GeoObservation>& obs, double outlier_chi2) {
  int votes = 0;
  for (size_t i = 0; i < obs.size(); ++i) {
    votes += obs[i].has_position && solution.position_chi2[i] <= outlier_chi2 ? 1 : 0;
    votes += obs[i].has_heading && solution.heading_chi2[i] <= outlier_chi2 ? 1 : 0;
  }
  return votes;
}

// Do two fits put a place so far apart that they are two?
bool Differ(const Sim3d& a, const Sim3d& b, const std::vector<GeoObservation>& obs) {
  std::vector<double> sigmas;
  double most = 0;
  for (const GeoObservation& o : obs) {
    const Eigen::Vector3d& p = o.odom_from_rig.translation;
    most = std::max(most, (a * p - b * p).head<2>().norm());
    if (o.has_position) sigmas.push_back(o.sigma_h_m);
  }
  return most > std::max(1.0, kDifferent * Median(sigmas));
}

// Median horizontal distance from the middle.
double ReachOf(const std::vector<Eigen::Vector3d>& positions) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : positions) mean += p / static_cast<double>(positions.size());
  std::vector<double> reach;
  for (const Eigen::Vector3d& p : positions) reach.push_back((p - mean).head<2>().norm());
  return Median(reach);
}

// Do the positions alone show the run's direction, whatever the headings are?
bool PositionsDecide(const std::vector<Eigen::Vector3d>& positions, const std::vector<double>& sigmas) {
  return positions.size() >= kPositionsDecide && ReachOf(positions) >= std::max(2.0, 5 * Median(sigmas));
}

// Two positions agree with each other where they are wrong alike: they outvote no third one.
std::string FewAgree(const EarthSolution& best, const std::vector<GeoObservation>& obs) {
  constexpr int kMajority = 3;
  constexpr double kContradicts = 30.7;  // chi-square, 3 dof, 1e-6: no chance among many runs
  int positions = 0, agree = 0;
  for (size_t i = 0; i < obs.size(); ++i) {
    if (!obs[i].has_position) continue;
    ++positions;
    agree += best.position_chi2[i] > kContradicts ? 0 : 1;
  }
  if (agree == positions || agree >= kMajority) return "";
  return fmt::format(
      "{} of {} positions (geotags, GPS fixes) contradict the others, and fewer than {} agree, which may be wrong "
      "alike; check the positions, heights and headings of all, correct the wrong ones or add another geotag",
      positions - agree, positions, kMajority);
}

// One geotag decides alone: nothing contradicts a heading that is in radians. Whole degrees are no radians.
std::string DoubtfulHeading(const std::vector<GeoObservation>& obs) {
  if (obs.size() != 1 || !obs.front().has_heading) return "";
  const double deg = obs.front().attitude.heading_rad * kRadToDeg;
  constexpr double kWhole = 1e-6;
  if (deg <= 0 || deg >= 2 * EIGEN_PI || std::abs(deg - std::round(deg)) < kWhole) return "";
  return fmt::format(
      "the only geotag has heading_deg {0:g}, which may be radians ({1:.1f} deg), and nothing else shows the run's "
      "direction: add another geotag, or write {2:g} if it is in degrees",
      deg, deg * kRadToDeg, deg + 360);
}

// Why the geotags do not decide where the run lies; empty: they do. `size_known`: the run's lengths are metres at least
// roughly; in those of images alone, what is seen is 10 m away in the median.
std::string Undecided(const EarthSolution& best, const std::vector<EarthSolution>& all,
                      const std::vector<GeoObservation>& obs, bool size_known, const GeoRegistrationOptions& options) {
  if (!best.good) return "the geotags (or GPS fixes) do not determine the run's pose on the Earth";
  const double most = size_known ? 10 : 100;  // 0.1 to 1,000 m away
  if (!(best.s.scale > 1 / most) || !(best.s.scale < most))
    return "the geotags (or GPS fixes) contradict the run's size";
  std::vector<Eigen::Vector3d> positions;
  std::vector<double> sigmas;
  int headings = 0, wrong_headings = 0;
  for (size_t i = 0; i < obs.size(); ++i) {
    if (obs[i].has_position) positions.push_back(obs[i].position), sigmas.push_back(obs[i].sigma_h_m);
    if (!obs[i].has_heading) continue;
    ++headings;
    const bool wrong = best.heading_chi2[i] > options.outlier_chi2 && std::abs(best.heading_rad[i]) > kWrongHeading_rad;
    wrong_headings += wrong ? 1 : 0;
  }
  if (2 * wrong_headings >= headings && wrong_headings > 0 && !PositionsDecide(positions, sigmas)) {
    return fmt::format(
        "the headings of {} of {} geotags contradict their positions by more than {:.0f} deg, and {} positions do not "
        "show which are wrong; expected heading_deg in degrees, clockwise from north",
        wrong_headings, headings, kWrongHeading_rad * kRadToDeg, positions.size());
  }
  const int votes = Votes(best, obs, options.outlier_chi2);
  for (const EarthSolution& other : all) {
    if (!other.good || Votes(other, obs, options.outlier_chi2) < votes || !Differ(best.s, other.s, obs)) continue;
    const Eigen::Vector3d& p = obs.front().odom_from_rig.translation;
    const double apart = (best.s * p - other.s * p).head<2>().norm();
    return fmt::format(
        "the geotags contradict each other: two solutions {:.0f} m apart fit equally many of {} positions; correct the "
        "wrong positions or headings, or add another geotag",
        apart, positions.size());
  }
  if (const std::string few = FewAgree(best, obs); !few.empty()) return few;
  return DoubtfulHeading(obs);
}

std::vector<EarthSolution> SolveFromStarts(const EarthFit& fit, const std::vector<Sim3d>& guesses,
                                           const std::vector<GeoObservation>& obs) {
  // At full weight a wrong geotag shifts the first solution, so every start weighs geotags by its own residuals.
  std::vector<EarthSolution> solutions = {fit.Solve(guesses.front(), false)};
  size_t starts = 0;
  for (const Sim3d& guess : guesses) {
    const bool known = starts > 0 && std::any_of(solutions.begin(), solutions.end(), [&](const EarthSolution& other) {
                         return !Differ(guess, other.s, obs);
                       });
    if (known) continue;
    solutions.push_back(fit.Solve(guess, true));
    if (++starts >= (obs.size() <= kFew ? kStarts : 1)) break;
  }
  return solutions;
}

std::vector<EarthSolution>::const_iterator Best(const std::vector<EarthSolution>& solutions) {
  return std::min_element(solutions.begin(), solutions.end(), [](const auto& a, const auto& b) {
    return std::pair(!a.good, a.cost) < std::pair(!b.good, b.cost);
  });
}

// A scale of the run under which the geotags agree with each other, though not under that of odometry.
struct OtherScale {
  double factor = 1, sigma = 0, stated_sigma = 0;  // true / measured length
  // Too far off for drift, and surely so.
  bool IsUnit() const { return std::abs(std::log(factor)) > kMostScale && IsSure(); }
  bool IsSure() const { return Excess() > 5; }
  // Beyond 99 % it is said; beyond 95 % the sigmas already cover it.
  bool IsSaid() const { return Excess() > 2.58; }
  // Of odometry's scale in the fit that is used.
  double UsedSigma(double scale_prior) const {
    return IsSure() ? scale_prior : std::max(kLeastScaleSigma, stated_sigma);
  }
  // Of the scale that is used, a multiple of odometry's: either of the two is right with a probability of one half
  // (Birge's ratio, if both have one sigma). A wrong calibration bends a run so that geotags agree under a wrong scale.
  double LeastVariance(double used) const {
    if (IsSure()) return 0.25 * std::pow(factor - 1, 2);
    return 0.5 * (std::pow(used - 1, 2) + std::pow(used - factor, 2));
  }
  // How many of its sigmas the disagreement is.
  double Excess() const { return std::abs(factor - 1) / std::hypot(sigma, stated_sigma); }
  std::string Describe() const {
    if (factor < 3 * sigma) {
      return fmt::format(
          "the positions of the geotags, or of GPS, hardly differ, although the run moves: by them true lengths are "
          "{:.2g} +- {:.2g} times those of odometry; check whether they were recorded",
          factor, sigma);
    }
    const std::string unit = IsSure() ? UnitOfLength(factor, std::max(0.02, 3 * sigma / factor)) : "";
    return fmt::format(
        "the geotags agree with each other only if true lengths are {:.4g} +- {:.2g} times those of odometry, which "
        "its scale_sigma of {:g} does not allow{}enter a larger odometry: scale_sigma in run.yaml",
        factor, sigma, stated_sigma,
        unit.empty() ? "; check odometry for a jump, slip or another unit, or "
                     : ": it seems to be in " + unit + "; convert its positions to metres, or ");
  }
};

std::optional<OtherScale> FindOtherScale(const EarthSolution& best, const std::vector<EarthSolution>& free,
                                         const std::vector<GeoObservation>& obs, double scale_prior, double scale_sigma,
                                         const GeoRegistrationOptions& options) {
  constexpr int kLeastPositions = 3;
  if (free.empty()) return std::nullopt;
  const EarthSolution& other = *Best(free);
  if (!other.good || !(other.s.scale > 0)) return std::nullopt;
  int positions = 0, outliers = 0;
  for (size_t i = 0; i < obs.size(); ++i) {
    positions += obs[i].has_position ? 1 : 0;
    outliers += obs[i].has_position && other.position_chi2[i] > options.outlier_chi2 ? 1 : 0;
  }
  if (positions < kLeastPositions || 4 * outliers > positions || other.cost > best.cost - kLessCost) {
    return std::nullopt;
  }
  OtherScale scale;
  scale.factor = other.s.scale / scale_prior;
  scale.sigma = std::sqrt(other.h.ldlt().solve(Matrix7d::Identity())(6, 6)) / scale_prior;
  scale.stated_sigma = scale_sigma;
  if (scale.Excess() < kDiscordant) return std::nullopt;
  return scale;
}

// The scale's variance becomes what the other scale leaves open; what depends on the scale follows. What makes lengths
// disagree bends a run as much as it stretches it, so that the turn in plan about the same point becomes uncertain by
// as many radians as the scale by parts.
void WidenScale(const OtherScale& other, double scale_prior, double scale, Matrix7d* covariance) {
  const double variance = (*covariance)(6, 6);
  const double least = scale_prior * scale_prior * other.LeastVariance(scale / scale_prior);
  if (least <= variance) return;
  const Vector7d stretch = covariance->col(6) / variance;
  Vector7d turn = Vector7d::Zero();
  turn(2) = 1 / scale, turn(3) = -stretch(4), turn(4) = stretch(3);
  *covariance += (least - variance) * (stretch * stretch.transpose() + turn * turn.transpose());
}

// The run's turn by positions alone differs from that by all by more than chance in 19 of 20 cases: in plan, where
// headings take part, or in tilt, where pitch and roll do.
struct OtherTurn {
  bool tilt = false;
  bool certain = false;     // in 999 of 1,000: it is warned of
  Eigen::MatrixXd off_rad;  // columns: about up; of tilt: about east and north, along two axes
  std::string Describe() const {
    return fmt::format(
        "{} and positions of the geotags contradict each other: by positions alone the run is {} by {:.1f} deg more; "
        "the sigmas cover both; check {} and the positions",
        tilt ? "pitch and roll" : "headings", tilt ? "tilted" : "turned", off_rad.norm() * kRadToDeg,
        tilt ? "pitch_deg, roll_deg, the heights" : "heading_deg (degrees clockwise from true north)");
  }
  Eigen::Index First() const { return tilt ? 0 : 2; }
};

// Hausman's test: the difference of an estimate from less data and one from all has the difference of their variances.
template <typename Solve>
std::optional<OtherTurn> FindOtherTurn(bool tilt, const EarthSolution& best, std::vector<GeoObservation> obs,
                                       const Solve& solve) {
  constexpr double kGate[] = {0, 3.84, 5.99}, kCertain[] = {0, 10.83, 13.82};  // chi-square, 95 and 99.9 %
  constexpr double kKnown_rad = 5 * kDegToRad, kMostTilt_rad = 10 * kDegToRad;
  for (GeoObservation& o : obs) (tilt ? o.has_tilt : o.has_heading) = false;
  const EarthSolution less = solve(obs);
  if (!less.good) return std::nullopt;
  OtherTurn other;
  other.tilt = tilt;
  const Eigen::Index first = other.First(), size = tilt ? 2 : 1;
  const auto covariance = [&](const EarthSolution& solution) -> Eigen::MatrixXd {
    return solution.h.ldlt().solve(Matrix7d::Identity()).block(first, first, size, size);
  };
  const Eigen::MatrixXd known = covariance(less);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> gained(known - covariance(best));
  // What positions hardly show is no contradiction, and far from the linear.
  if (known.trace() > kKnown_rad * kKnown_rad || !(gained.eigenvalues().minCoeff() > 0)) return std::nullopt;
  const Eigen::VectorXd off =
      gained.eigenvectors().transpose() * LogSO3(less.s.rotation * best.s.rotation.conjugate()).segment(first, size);
  const double chi2 = off.cwiseAbs2().cwiseQuotient(gained.eigenvalues()).sum();
  if (chi2 < kGate[size]) return std::nullopt;
  other.certain = chi2 > kCertain[size];
  // A few positions of which one is wrong fit any tilt; no frame is tilted so.
  if (tilt && off.norm() > kMostTilt_rad) return std::nullopt;
  other.off_rad = gained.eigenvectors() * off.asDiagonal();
  return other;
}

template <typename Solve>
std::vector<OtherTurn> FindOtherTurns(const EarthSolution& best, const std::vector<GeoObservation>& obs,
                                      const Solve& solve) {
  std::vector<OtherTurn> turns;
  for (const bool tilt : {false, true}) {
    if (const auto turn = FindOtherTurn(tilt, best, obs, solve)) turns.push_back(*turn);
  }
  return turns;
}

// Either is right with a probability of one half: the turn's variance grows by half of the squared difference, and what
// depends on the turn follows.
void WidenTurns(const std::vector<OtherTurn>& turns, Matrix7d* covariance) {
  for (const OtherTurn& turn : turns) {
    const Eigen::Index first = turn.First(), size = turn.off_rad.rows();
    const Eigen::MatrixXd moved =
        covariance->middleCols(first, size) * covariance->block(first, first, size, size).ldlt().solve(turn.off_rad);
    *covariance += 0.5 * moved * moved.transpose();
  }
}

std::string NoDirection(const std::vector<GeoObservation>& obs) {
  const auto positions = static_cast<size_t>(
      std::count_if(obs.begin(), obs.end(), [](const GeoObservation& o) { return o.has_position; }));
  if (positions == 0) {
    return fmt::format("none of {} localized panoramas or photos has a position that is used", obs.size());
  }
  return fmt::format(
      "the run's direction is not known: {} position{} {} (geotags of localized panoramas and photos, GPS fixes), "
      "without a heading; expected positions more than {} m apart, or a geotag with a heading",
      positions, positions == 1 ? "" : "s",
      positions == 1 ? "is there" : fmt::format("lie within {} m of each other", kApart_m), kApart_m);
}

// Positions alone whose turn is nearly unknown: the covariance, which describes small turns, says nothing. Empty: it is
// known, or from headings.
std::string DirectionUnknown(const GeoRegistration& fit, const std::vector<GeoObservation>& obs) {
  constexpr double kMost_rad = 0.5;
  const double sigma = std::sqrt(fit.covariance(2, 2));
  const bool headings = std::any_of(obs.begin(), obs.end(), [](const GeoObservation& o) { return o.has_heading; });
  if (headings || sigma < kMost_rad) return "";
  return fmt::format(
      "{} positions (geotags, GPS fixes) lie too near each other, given their errors, to show the run's direction (1 "
      "sigma {:.0f} deg); expected positions farther apart, or a geotag with a heading",
      std::count_if(obs.begin(), obs.end(), [](const GeoObservation& o) { return o.has_position; }),
      std::min(180.0, sigma * kRadToDeg));
}

bool MostAreOutliers(const EarthSolution& best, double outlier_chi2) {
  int positions = 0, outliers = 0;
  for (size_t i = 0; i < best.position_rows.size(); ++i) {
    if (best.position_rows[i] == 0) continue;
    ++positions;
    outliers += best.position_chi2[i] > outlier_chi2 ? 1 : 0;
  }
  return 2 * outliers > positions;
}

// The sigmas of positions that Register works with.
struct Enlargement {
  double factor = 1;  // over the stated ones
  int round = 0;
  bool most_outliers = false;  // at first
  bool of_run = false;         // the run's own uncertainty does not explain the errors: its shape may be wrong, too
};

// Whether the median of squared ratios is larger than chance explains. Of errors in two dimensions; in three they
// scatter less. Turn in plan and translation take up a position; tilt and scale are known.
bool IsTooLarge(const std::vector<double>& ratios) {
  return ratios.size() > 1 && IsMedianTooLarge(Median(ratios), ratios.size() - 1, 2);
}

// The next one where positions are farther off than their sigmas allow: the median shows it, or most are outliers.
// Then the first is too large, so that none is taken for one. The median of what is left makes it smaller. Nothing: it
// is right.
std::optional<Enlargement> Next(const Enlargement& now, const EarthFit& fit, const EarthSolution& best,
                                double outlier_chi2) {
  constexpr int kRounds = 8;
  constexpr double kSame = 0.05;
  const std::vector<double> ratios = fit.SquaredRatios(best);
  if (now.round == 0) {
    if (MostAreOutliers(best, outlier_chi2)) {
      return Enlargement{std::sqrt(*std::max_element(ratios.begin(), ratios.end())), 1, true, true};
    }
    if (!IsTooLarge(ratios)) return std::nullopt;
    return Enlargement{std::sqrt(Median(ratios)), 1, false, IsTooLarge(RatiosAlone(best))};
  }
  const double change = std::sqrt(Median(ratios));
  if (std::abs(change - 1) < kSame || now.round == kRounds) return std::nullopt;
  return Enlargement{std::max(1.0, now.factor * change), now.round + 1, now.most_outliers, now.of_run};
}

}  // namespace

std::vector<std::string> GeoRegistrationOptions::Check() const {
  std::vector<std::string> problems = CheckRanges(*this);
  if (use_gps != "never" && use_gps != "always" && use_gps != "auto") {
    problems.push_back("option use_gps is '" + use_gps + "', expected never, always or auto");
  }
  return problems;
}

namespace {

// By how much the sigmas of errors with two dimensions are too small, from their chi-squares; 1 where that may be
// chance (0.1 %).
double SigmaFactor(std::vector<double> chi2) {
  constexpr size_t kLeast = 5;
  const size_t count = chi2.size();
  if (count < kLeast) return 1;
  const double median = Median(std::move(chi2)) / kMediansOfChi2[2];
  return IsMedianTooLarge(median, count, 2) ? std::sqrt(median) : 1;
}

// Residuals, and which positions and tilts are beyond the gate.
void Tally(const EarthSolution& best, const std::vector<GeoObservation>& obs, double outlier_chi2,
           GeoRegistration* result) {
  result->residuals = best.residuals;
  std::vector<double> tilts;
  for (size_t i = 0; i < obs.size(); ++i) {
    result->outlier[i] = best.position_chi2[i] > outlier_chi2;
    result->tilts += obs[i].has_tilt ? 1 : 0;
    const double tilt_chi2 = best.attitude_chi2[i] - best.heading_chi2[i];
    result->wrong_tilts += tilt_chi2 > outlier_chi2 ? 1 : 0;
    if (obs[i].has_tilt) tilts.push_back(tilt_chi2);
  }
  result->tilt_factor = SigmaFactor(std::move(tilts));
}

// Do errors point the same way from one position to the next? Those of sigmas that are too small do not.
bool AreSystematic(const std::vector<Eigen::Vector3d>& residuals) {
  constexpr double kSigmas = 3;
  constexpr size_t kLeast = 6;
  double sum = 0;
  size_t pairs = 0;
  for (size_t i = 1; i < residuals.size(); ++i) {
    const Eigen::Vector2d a = residuals[i - 1].head<2>(), b = residuals[i].head<2>();
    if (a.norm() == 0 || b.norm() == 0) continue;
    sum += a.dot(b) / (a.norm() * b.norm());
    ++pairs;
  }
  // A cosine of random directions has a variance of 1/2.
  return pairs >= kLeast && sum > kSigmas * std::sqrt(0.5 * static_cast<double>(pairs));
}

bool ContradictsShape(const Enlargement& enlarged, const EarthSolution& best) {
  return enlarged.of_run &&
         (enlarged.factor > kMostSigmaFactor || (enlarged.most_outliers && AreSystematic(best.residuals)));
}

std::string ShapeContradiction(size_t geotags, double factor) {
  return fmt::format(
      "most of {} geotags (or GPS fixes) contradict the run's shape, by {:.0f} times their sigmas in the median; check "
      "latitude, longitude and the odometry",
      geotags, factor);
}

// What is to be known about a fit that is used.
std::string Remarks(const std::optional<OtherScale>& other, const std::vector<OtherTurn>& turns,
                    const Enlargement& enlarged) {
  std::string reason;
  if (other && other->IsSaid()) {
    reason =
        other->Describe() + (!other->IsSure() ? ", or check the geotags; the scale lies between odometry's and the "
                                                "geotags', and its sigma covers both"
                                              : ", or check the geotags and the calibration; the scale is taken from "
                                                "the geotags, with half of the disagreement as its sigma");
  }
  const auto add = [&](const std::string& said) { reason += (reason.empty() ? "" : "; ") + said; };
  for (const OtherTurn& turn : turns) {
    if (turn.certain) add(turn.Describe());
  }
  if (enlarged.factor > 1) {
    add(
        fmt::format("geotags (or GPS fixes) are farther off than their sigmas allow; these and the result's sigmas{} "
                    "are multiplied by {:.1f}",
                    enlarged.of_run ? "" : ", as far as they are from geotags,", enlarged.factor));
  }
  return reason;
}

// One factor for all positions and directions leaves some too small. What they bring to the fit's covariance is
// therefore multiplied again; all of it where the run's shape may be what is wrong, as that bends what lies between the
// geotags.
void Widen(const Enlargement& enlarged, const Eigen::MatrixXd& odom_covariance, GeoRegistration* result) {
  Matrix7d of_geotags = result->covariance;
  if (!enlarged.of_run) of_geotags -= result->sensitivity * odom_covariance * result->sensitivity.transpose();
  result->covariance += (enlarged.factor * enlarged.factor - 1) * of_geotags;
}

GeoRegistration Unsolved(size_t observations) {
  GeoRegistration result;
  result.weights.assign(observations, 1);
  result.outlier.assign(observations, false);
  result.residuals.assign(observations, Eigen::Vector3d::Zero());
  return result;
}

std::vector<GeoObservation> Enlarged(std::vector<GeoObservation> obs, double factor) {
  for (GeoObservation& o : obs) o.sigma_h_m *= factor, o.sigma_v_m *= factor;
  return obs;
}

// With every observation as it is stated, sigmas of positions `enlarged` times. Where most are farther off than these
// allow, again with larger ones.
GeoRegistration Register(const std::vector<GeoObservation>& obs, const Eigen::MatrixXd& odom_covariance,
                         double scale_prior, double scale_sigma, bool levelled, const GeoRegistrationOptions& options,
                         const Enlargement& enlarged = {}) {
  GeoRegistration result = Unsolved(obs.size());
  if (obs.empty()) {
    result.reason = "no reference with a geotag is localized, and no GPS is used";
    return result;
  }
  const double tilt_sigma = (levelled ? 0.05 : options.tilt_sigma_deg) * kDegToRad;
  const EarthFit fit(obs, odom_covariance, scale_prior, scale_sigma, tilt_sigma, options);
  const std::vector<Sim3d> guesses = fit.Guesses();
  if (guesses.empty()) {
    result.reason = NoDirection(obs);
    return result;
  }
  std::vector<EarthSolution> solutions = SolveFromStarts(fit, guesses, obs);
  auto best = Best(solutions);
  const EarthFit free_fit(obs, odom_covariance, scale_prior, scale_prior, tilt_sigma, options);
  std::vector<EarthSolution> free;
  if (scale_sigma < kUnknownScale && best->cost > kLessCost) free = SolveFromStarts(free_fit, free_fit.Guesses(), obs);
  const auto other = FindOtherScale(*best, free, obs, scale_prior, scale_sigma, options);
  if (other && other->IsUnit()) {
    result.residuals = best->residuals;
    result.reason = other->Describe();
    return result;
  }
  // Odometry's scale is off, or a geotag. Little: either may be, and the sigma covers both. Much: the geotags are
  // believed, with a sigma that still reaches half way back.
  const double used_sigma = other ? other->UsedSigma(scale_prior) : scale_sigma;
  const EarthFit used(obs, odom_covariance, scale_prior, used_sigma, tilt_sigma, options);
  if (other) {
    solutions = other->IsSure() ? free : SolveFromStarts(used, used.Guesses(), obs);
    best = Best(solutions);
  }
  result.iterations = best->iterations;
  if (best->good) Tally(*best, obs, options.outlier_chi2, &result);
  result.reason = Undecided(*best, solutions, obs, scale_sigma < kUnknownScale, options);
  if (!result.reason.empty()) return result;
  if (const auto next = Next(enlarged, used, *best, options.outlier_chi2)) {
    return Register(Enlarged(obs, next->factor / enlarged.factor), odom_covariance, scale_prior, scale_sigma, levelled,
                    options, *next);
  }
  if (ContradictsShape(enlarged, *best)) {
    result.reason = ShapeContradiction(obs.size(), enlarged.factor);
    return result;
  }
  const std::vector<OtherTurn> turns = FindOtherTurns(*best, obs, [&](const std::vector<GeoObservation>& less) {
    return EarthFit(less, odom_covariance, scale_prior, used_sigma, tilt_sigma, options).SolveNear(best->s);
  });
  used.Describe(*best, &result);
  result.reason = DirectionUnknown(result, obs);
  if (!result.reason.empty()) return result;
  if (other) WidenScale(*other, scale_prior, best->s.scale, &result.covariance);
  WidenTurns(turns, &result.covariance);
  Widen(enlarged, odom_covariance, &result);
  result.reason = Remarks(other, turns, enlarged);
  result.solved = true;
  return result;
}

}  // namespace

GeoRegistration RegisterToEarth(const std::vector<GeoObservation>& obs, const Eigen::MatrixXd& odom_covariance,
                                double scale_prior, double scale_sigma, bool levelled,
                                const GeoRegistrationOptions& options) {
  const auto contradicted = [](const GeoRegistration& fit) {
    return fit.tilts >= 2 && 2 * fit.wrong_tilts > fit.tilts;
  };
  const auto say = [](const std::string& said, GeoRegistration fit) {
    fit.reason = fit.reason.empty() ? said : said + "; " + fit.reason;
    return fit;
  };
  GeoRegistration result = Register(obs, odom_covariance, scale_prior, scale_sigma, levelled, options);
  const auto consistent = [&](const GeoRegistration& fit) { return !contradicted(fit) && fit.tilt_factor == 1; };
  if (consistent(result)) return result;
  if (levelled) {
    const GeoRegistration tilted = Register(obs, odom_covariance, scale_prior, scale_sigma, false, options);
    if (tilted.solved && consistent(tilted)) {
      const Eigen::Vector3d up = tilted.world_from_odom.rotation * Eigen::Vector3d::UnitZ();
      return say(fmt::format("pitch and roll of the geotags agree if the run's frame is tilted by {:.2f} deg, but "
                             "run.yaml says odometry: levelled; the frame is taken as tilted; check levelled",
                             std::acos(std::min(1.0, up.z())) * kRadToDeg),
                 tilted);
    }
  }
  const double factor = result.tilt_factor;
  std::vector<GeoObservation> changed = obs;
  if (!contradicted(result) && factor < kMostSigmaFactor) {
    for (GeoObservation& o : changed) o.sigma_tilt_rad *= factor * std::sqrt(static_cast<double>(result.tilts));
    return say(
        fmt::format("pitch and roll of {} geotags scatter by {:.1f} times their sigmas; as the error may be common to "
                    "all, they count as one geotag with the larger sigma; check pitch_deg, roll_deg and sigma_tilt_deg",
                    result.tilts, factor),
        Register(changed, odom_covariance, scale_prior, scale_sigma, levelled, options));
  }
  // A single wrong panorama may be chance; if most are wrong, the table was made with another convention.
  const std::string said = fmt::format(
      "pitch and roll of {} of {} geotags contradict the run and each other; pitch and roll are not used; check "
      "pitch_deg, roll_deg and sigma_tilt_deg",
      result.wrong_tilts, result.tilts);
  for (GeoObservation& o : changed) o.has_tilt = false;
  return say(said, Register(changed, odom_covariance, scale_prior, scale_sigma, levelled, options));
}

namespace {

// Residuals and marks by source. What is stated comes from `stated`, not from sigmas that were changed since.
std::vector<SourceEstimate> EstimateSources(const std::vector<GeoObservation>& stated,
                                            const std::vector<GeoObservation>& used, const GeoRegistration& fit) {
  constexpr int kEnough = 10;
  constexpr double kMedianSpread = 0.72;  // of a sigma from a median of n such, times sqrt(n)
  constexpr double kFitted = 2;           // horizontal places that rotation, translation and scale use up
  struct Found {
    std::vector<double> sigmas, squares;
    int outliers = 0;
    double information = 0;  // of the fit
  };
  double information = 0;
  std::map<std::string, Found> found;
  for (size_t i = 0; i < stated.size(); ++i) {
    if (!stated[i].has_position) continue;
    const double own = 1 / (used[i].sigma_h_m * used[i].sigma_h_m);
    information += own;
    if (stated[i].source.empty()) continue;
    Found& f = found[stated[i].source];
    f.information += own;
    f.sigmas.push_back(stated[i].sigma_h_m);
    // Of each in its own sigmas: a source may state some as better than others.
    f.squares.push_back(fit.residuals[i].head<2>().squaredNorm() / (stated[i].sigma_h_m * stated[i].sigma_h_m));
    f.outliers += fit.outlier[i] ? 1 : 0;
  }
  std::vector<SourceEstimate> estimates;
  for (auto& [source, f] : found) {
    SourceEstimate e{source, static_cast<int>(f.sigmas.size()), f.outliers, Median(f.sigmas)};
    if (e.positions >= kEnough) {
      const double n = e.positions;
      e.sigma_m = e.stated_sigma_m *
                  std::sqrt(Median(f.squares) / kMediansOfChi2[2] * n / (n - kFitted * f.information / information));
      e.relative_sigma = kMedianSpread / std::sqrt(n);
    }
    estimates.push_back(std::move(e));
  }
  return estimates;
}

}  // namespace

GeoRegistration RegisterBySources(std::vector<GeoObservation>* observations, const Eigen::MatrixXd& odom_covariance,
                                  double scale_prior, double scale_sigma, bool levelled,
                                  const GeoRegistrationOptions& options) {
  constexpr int kRounds = 3;
  constexpr double kLeastFactor = 0.1, kMostFactor = 10, kSame = 0.02;
  const std::vector<GeoObservation> stated = *observations;
  std::map<std::string, double> factors;
  for (int round = 1;; ++round) {
    GeoRegistration fit = RegisterToEarth(*observations, odom_covariance, scale_prior, scale_sigma, levelled, options);
    if (!fit.solved) return fit;
    fit.sources = EstimateSources(stated, *observations, fit);
    bool changed = false;
    for (const SourceEstimate& e : fit.sources) {
      if (e.sigma_m == 0) continue;
      double& factor = factors.try_emplace(e.source, 1).first->second;
      const double now = std::clamp(e.sigma_m / e.stated_sigma_m, kLeastFactor, kMostFactor);
      changed |= std::abs(now / factor - 1) > kSame;
      factor = now;
    }
    if (!changed || round == kRounds) return fit;
    for (size_t i = 0; i < stated.size(); ++i) {
      const auto factor = factors.find(stated[i].source);
      if (factor != factors.end()) (*observations)[i].sigma_h_m = factor->second * stated[i].sigma_h_m;
    }
  }
}

namespace {

constexpr double kMedianOfNormal2d = 1.177;  // of the length of a normal error in two dimensions, sigmas

// Root of the sum of the squared horizontal distances from the mean: what a turn is measured by.
double SpreadOf(const std::vector<Eigen::Vector3d>& places) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : places) sum += p;
  double squares = 0;
  for (const Eigen::Vector3d& p : places) {
    squares += (p - sum / static_cast<double>(places.size())).head<2>().squaredNorm();
  }
  return std::sqrt(squares);
}

// Headings that agree with each other, but are turned against the positions by much more than both leave open.
std::optional<std::string> CommonTurn(const std::vector<GeoObservation>& observations,
                                      const Eigen::Quaterniond& world_from_odom, double by_places_rad,
                                      double sigma_rad) {
  constexpr double kSigmas = 5, kMost = 3;  // of the turn; of a single heading
  constexpr double kSigmaOfMedian = 1.2533;
  std::vector<double> turns;
  for (const GeoObservation& o : observations) {
    if (!o.has_position || !o.has_heading) continue;
    const double is = AttitudeOf(world_from_odom * o.odom_from_rig.rotation).heading_rad;
    turns.push_back(WrapAngle(o.attitude.heading_rad - is));
  }
  const double turn = Median(turns);
  const double sigma =
      std::hypot(kSigmaOfMedian * sigma_rad / std::sqrt(static_cast<double>(turns.size())), by_places_rad);
  for (double& t : turns) t = std::abs(WrapAngle(t - turn));
  if (std::abs(turn) < std::max(kSigmas * sigma, kMost * sigma_rad) || Median(turns) > kMost * sigma_rad) return {};
  return fmt::format("turned by {:+.1f} deg (1 sigma {:.1f} deg) against true north, as those from magnetic north are",
                     turn * kRadToDeg, sigma * kRadToDeg);
}

}  // namespace

std::optional<std::string> OtherHeadings(const std::vector<GeoObservation>& observations) {
  constexpr double kWrong = 20 * kDegToRad, kRight = 7 * kDegToRad;
  std::vector<Eigen::Vector3d> places, said;
  std::vector<double> sigmas, sigmas_rad;
  for (const GeoObservation& o : observations) {
    if (!o.has_position || !o.has_heading) continue;
    places.push_back(o.odom_from_rig.translation);
    said.push_back(o.position);
    sigmas.push_back(o.sigma_h_m);
    sigmas_rad.push_back(o.sigma_heading_rad);
  }
  if (!PositionsDecide(said, sigmas)) return std::nullopt;
  const Sim3d fit = AlignPoints(places, said, AlignmentKind::kYawTranslation);
  std::vector<double> off;
  for (size_t i = 0; i < said.size(); ++i) off.push_back((fit * places[i] - said[i]).head<2>().norm());
  // A fit that does not match the positions cannot test the headings.
  if (Median(off) > 0.2 * ReachOf(said)) return std::nullopt;
  struct Reading {
    const char* what;
    double sign, add;  // heading as meant = sign * as read + add
    double factor = 1;
  };
  constexpr Reading kReadings[] = {
      {"", 1, 0},
      {"counter-clockwise from north", -1, 0},
      {"counter-clockwise from east", -1, 0.5 * EIGEN_PI},
      {"clockwise from east", 1, 0.5 * EIGEN_PI},
      {"clockwise from south (the direction behind the camera)", 1, EIGEN_PI},
      {"clockwise from west", 1, -0.5 * EIGEN_PI},
      {"in radians", 1, 0, kRadToDeg},
  };
  std::vector<double> errors;
  for (const Reading& reading : kReadings) {
    std::vector<double> wrong;
    for (const GeoObservation& o : observations) {
      if (!o.has_position || !o.has_heading) continue;
      const double is = AttitudeOf(fit.rotation * o.odom_from_rig.rotation).heading_rad;
      const double meant = reading.sign * reading.factor * o.attitude.heading_rad + reading.add;
      wrong.push_back(std::abs(WrapAngle(is - meant)));
    }
    errors.push_back(Median(std::move(wrong)));
  }
  const size_t best = static_cast<size_t>(std::min_element(errors.begin(), errors.end()) - errors.begin());
  const bool counted_otherwise =
      errors[0] >= std::max(kWrong, 3 * Median(sigmas_rad)) && best != 0 && errors[best] <= kRight;
  if (counted_otherwise) return kReadings[best].what;
  const double place_sigma_m = std::max(Median(sigmas), Median(std::move(off)) / kMedianOfNormal2d);
  return CommonTurn(observations, fit.rotation, place_sigma_m / SpreadOf(said), Median(sigmas_rad));
}

}  // namespace trigpoint

#include "survey/tags/total_station.h"

#include <ceres/crs_matrix.h>
#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "calib/base/error.h"
#include "calib/estimation/manifold.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/alignment.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "survey/tags/survey_costs.h"

namespace trigpoint {
namespace {

constexpr double kEarth_m = 6371000, kRefraction = 0.13;
constexpr double kBlunder = 3.89;  // 99.99 % of a normal distribution

double Wrapped(double angle) { return std::remainder(angle, 2 * EIGEN_PI); }

// From the instrument, along east, north and the plumb line there; first order in position over the Earth's radius.
// Both are in the level frame.
struct LocalVector {
  Eigen::Vector3d l;
  Eigen::Matrix3d by_target, by_instrument;
};

LocalVector Local(const Eigen::Vector3d& instrument, const Eigen::Vector3d& target) {
  const Eigen::Vector3d d = target - instrument;
  const double x = instrument.x() / kEarth_m, y = instrument.y() / kEarth_m;
  LocalVector v;
  v.by_target << 1, 0, -x, 0, 1, -y, x, y, 1;
  v.l = v.by_target * d;
  v.by_instrument = -v.by_target;
  v.by_instrument(0, 0) -= d.z() / kEarth_m;
  v.by_instrument(1, 1) -= d.z() / kEarth_m;
  v.by_instrument(2, 0) += d.x() / kEarth_m;
  v.by_instrument(2, 1) += d.y() / kEarth_m;
  return v;
}

// A reading as predicted, less the orientation, and its derivative by the local vector.
double Predict(StationReading reading, const Eigen::Vector3d& l, Eigen::RowVector3d* by) {
  const double h2 = l.head<2>().squaredNorm(), h = std::sqrt(h2), s = l.norm();
  switch (reading) {
    case StationReading::kDirection: *by << l.y() / h2, -l.x() / h2, 0; return std::atan2(l.x(), l.y());
    case StationReading::kZenith:
      *by << l.x() * l.z() / (h * s * s), l.y() * l.z() / (h * s * s), -h / (s * s);
      *by -= 0.5 * kRefraction / kEarth_m * l.transpose() / s;
      return std::atan2(h, l.z()) - 0.5 * kRefraction / kEarth_m * s;
    case StationReading::kDistance: break;
  }
  *by = l.transpose() / s;
  return s;
}

}  // namespace

std::string_view StationReadingName(StationReading reading) {
  switch (reading) {
    case StationReading::kDirection: return "direction";
    case StationReading::kZenith: return "zenith angle";
    case StationReading::kDistance: break;
  }
  return "slope distance";
}

StationCost::StationCost(StationReading reading, double observed, double sigma,
                         const std::optional<Eigen::Vector3d>& lever, double target_height_m,
                         const Rigid3d& level_from_world)
    : reading_(reading),
      observed_(observed),
      sigma_(sigma),
      lever_(lever),
      target_height_m_(target_height_m),
      level_from_world_(level_from_world) {
  set_num_residuals(1);
  *mutable_parameter_block_sizes() = {3, lever ? 7 : 3};
  if (reading == StationReading::kDirection) mutable_parameter_block_sizes()->push_back(1);
}

bool StationCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Eigen::Map<const Eigen::Vector3d> instrument(parameters[0]);
  Eigen::Vector3d turned = Eigen::Vector3d::Zero(), target;
  if (lever_) {
    const Rigid3d tag = Rigid3FromBlock(parameters[1]);
    turned = tag.rotation * *lever_;
    target = turned + tag.translation;
  } else {
    target = Eigen::Map<const Eigen::Vector3d>(parameters[1]);
  }
  const Eigen::Vector3d prism = level_from_world_ * target + target_height_m_ * Eigen::Vector3d::UnitZ();
  const LocalVector local = Local(level_from_world_ * instrument, prism);
  if (!(local.l.head<2>().norm() > 1e-6)) return false;  // straight above: no direction
  Eigen::RowVector3d by;
  double off = Predict(reading_, local.l, &by) - observed_;
  if (reading_ == StationReading::kDirection) off = Wrapped(off - parameters[2][0]);
  residuals[0] = off / sigma_;
  if (jacobians == nullptr) return true;
  by /= sigma_;
  const Eigen::Matrix3d level = level_from_world_.rotation.toRotationMatrix();
  if (jacobians[0] != nullptr) Eigen::Map<Eigen::RowVector3d>{jacobians[0]} = by * local.by_instrument * level;
  if (jacobians[1] != nullptr) {
    const Eigen::RowVector3d by_target = by * local.by_target * level;
    if (lever_) {
      Eigen::Matrix<double, 1, 6> j;
      j << -by_target * Skew(turned), by_target;
      Eigen::Matrix<double, 6, 7, Eigen::RowMajor> minus;
      Rigid3Manifold().MinusJacobian(parameters[1], minus.data());
      Eigen::Map<Eigen::Matrix<double, 1, 7, Eigen::RowMajor>>{jacobians[1]} = j * minus;
    } else {
      Eigen::Map<Eigen::RowVector3d>{jacobians[1]} = by_target;
    }
  }
  if (reading_ == StationReading::kDirection && jacobians[2] != nullptr) jacobians[2][0] = -1 / sigma_;
  return true;
}

bool AboveCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  constexpr double kCentring_m = 0.001;
  for (int i = 0; i < 3; ++i) {
    residuals[i] = (parameters[1][i] - parameters[0][i] - above_m_[i]) / kCentring_m;
  }
  for (int block = 0; jacobians != nullptr && block < 2; ++block) {
    if (jacobians[block] == nullptr) continue;
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>{jacobians[block]} =
        (block == 0 ? -1 : 1) / kCentring_m * Eigen::Matrix3d::Identity();
  }
  return true;
}

std::pair<double, double> ReadingOf(const StationSighting& s, StationReading reading) {
  switch (reading) {
    case StationReading::kDirection: return {s.direction_rad.value(), s.sigma_direction_rad};
    case StationReading::kZenith: return {s.zenith_rad.value(), s.sigma_zenith_rad};
    case StationReading::kDistance: break;
  }
  return {s.distance_m.value(), s.sigma_distance_m};
}

std::optional<std::pair<int, int>> TagOfTarget(const std::string& target) {
  if (!target.starts_with("tag:")) return std::nullopt;
  const size_t slash = target.find('/');
  const auto id = ParseInt(target.substr(4, slash == std::string::npos ? slash : slash - 4));
  const auto corner = slash == std::string::npos ? std::optional<int64_t>(-1) : ParseInt(target.substr(slash + 1));
  const bool known = id && corner && *id >= 0 && *id <= 1'000'000 && *corner >= -1 && *corner <= 3;
  if (!known) throw InputError("target '" + target + "': expected tag:ID, or tag:ID/CORNER with a corner from 0 to 3");
  return std::pair<int, int>(static_cast<int>(*id), static_cast<int>(*corner));
}

std::vector<StationSighting> ReadTotalStation(const std::filesystem::path& file, std::vector<std::string>* warnings) {
  std::vector<StationSighting> sightings;
  const CsvTable table = CsvTable::Read(
      file, {"setup", "target"},
      {"direction_deg", "direction_gon", "zenith_deg", "zenith_gon", "slope_distance_m", "instrument_height_m",
       "target_height_m", "sigma_direction_deg", "sigma_zenith_deg", "sigma_distance_m"});
  warnings->insert(warnings->end(), table.warnings().begin(), table.warnings().end());
  table.ForEachUsable(warnings, [&](const CsvRow& row) {
    StationSighting s;
    s.setup = row.Text("setup"), s.target = row.Text("target");
    if (s.setup.empty() || s.target.empty()) row.Fail("expected the names of a set-up and of a target");
    if (s.setup == s.target) row.Fail("expected another target than the set-up itself");
    TagOfTarget(s.target);
    const auto angle = [&](const std::string& name) -> std::optional<double> {
      if (row.Has(name + "_deg")) return row.Number(name + "_deg") * kDegToRad;
      if (row.Has(name + "_gon")) return row.Number(name + "_gon") * EIGEN_PI / 200;
      return std::nullopt;
    };
    s.direction_rad = angle("direction");
    s.zenith_rad = angle("zenith");
    if (s.zenith_rad && !(*s.zenith_rad > 0 && *s.zenith_rad < EIGEN_PI)) {
      row.Fail(
          "zenith angle: expected more than 0 and less than 180 deg (200 gon), from the zenith; a reading of the "
          "second face is 360 deg (400 gon) less it, and its direction is turned by half a circle");
    }
    if (row.Has("slope_distance_m")) s.distance_m = row.Number("slope_distance_m");
    if (s.distance_m && !(*s.distance_m > 0)) row.Fail("column slope_distance_m: expected a length above 0");
    if (!s.direction_rad && !s.zenith_rad && !s.distance_m) row.Fail("expected a direction, zenith angle or distance");
    s.instrument_height_m = row.Number("instrument_height_m", 0);
    s.target_height_m = row.Number("target_height_m", 0);
    const auto sigma = [&](const char* name, double unit, double* to) {
      *to = row.Number(name, *to / unit) * unit;
      if (!(*to > 0)) row.Fail(std::string("column ") + name + ": expected a sigma above 0");
    };
    sigma("sigma_direction_deg", kDegToRad, &s.sigma_direction_rad);
    sigma("sigma_zenith_deg", kDegToRad, &s.sigma_zenith_rad);
    sigma("sigma_distance_m", 1, &s.sigma_distance_m);
    s.line = row.line();
    sightings.push_back(std::move(s));
  });
  return sightings;
}

namespace {

struct Setup {
  Eigen::Vector3d instrument = Eigen::Vector3d::Zero();
  double orientation = 0, height = 0;
  bool placed = false;
};

struct Reading {
  size_t sighting = 0;
  StationReading kind = StationReading::kDirection;
  bool excluded = false;
};

class Network {
 public:
  Network(const std::vector<StationSighting>& sightings, const std::vector<NetworkPoint>& known,
          const CancelToken& cancel)
      : sightings_(sightings), known_(known), cancel_(cancel) {
    for (const NetworkPoint& p : known) points_[p.name] = p.position;
    for (const StationSighting& s : sightings) {
      Setup& setup = setups_[s.setup];
      if (s.instrument_height_m == 0) continue;  // stated in another row of the set-up
      if (setup.height != 0 && setup.height != s.instrument_height_m) {
        throw InputError(
            fmt::format("total_station.csv: set-up {} has instrument heights of {} m and {} m; expected one", s.setup,
                        setup.height, s.instrument_height_m));
      }
      setup.height = s.instrument_height_m;
    }
  }

  StationNetwork Adjust() {
    while (PlaceSetups() || PlaceTargets()) cancel_.ThrowIfCancelled();
    CollectReadings();
    if (readings_.empty()) {
      throw InputError(
          "total_station.csv: no set-up can be placed; expected one that reads direction, zenith angle and distance to "
          "two "
          "points of control_points.csv, or to one and stands on another (column point there)");
    }
    StationNetwork out;
    Solve(true);
    do {
      Solve(false);
      Judge(&out);
    } while (TakeOutWorst(&out));
    Collect(&out);
    return out;
  }

 private:
  bool Has(const std::string& point) const { return points_.count(point) > 0; }
  bool IsPolar(const StationSighting& s) const { return s.direction_rad && s.zenith_rad && s.distance_m; }

  // From the instrument, level, in the circle's own direction.
  Eigen::Vector3d PolarVector(const StationSighting& s) const {
    const double h = *s.distance_m * std::sin(*s.zenith_rad);
    return {h * std::sin(*s.direction_rad), h * std::cos(*s.direction_rad), *s.distance_m * std::cos(*s.zenith_rad)};
  }

  bool PlaceSetups() {
    bool any = false;
    for (auto& [name, setup] : setups_) {
      if (setup.placed) continue;
      std::vector<Eigen::Vector3d> local, world;
      if (Has(name)) {
        local.emplace_back(0, 0, 0);
        world.push_back(points_.at(name) + setup.height * Eigen::Vector3d::UnitZ());
      }
      for (const StationSighting& s : sightings_) {
        if (s.setup != name || !IsPolar(s) || !Has(s.target)) continue;
        local.push_back(PolarVector(s));
        world.push_back(points_.at(s.target) + s.target_height_m * Eigen::Vector3d::UnitZ());
      }
      if (local.size() < 2) continue;
      try {
        const Sim3d fit = AlignPoints(local, world, AlignmentKind::kYawTranslation);
        const Eigen::Vector3d north = fit.rotation * Eigen::Vector3d::UnitY();
        setup.instrument = fit.translation;
        setup.orientation = std::atan2(north.x(), north.y());
        setup.placed = any = true;
        // The point below it, which other set-ups may read.
        points_.try_emplace(name, setup.instrument - setup.height * Eigen::Vector3d::UnitZ());
      } catch (const NumericError&) {  // the points lie on one another
      }
    }
    return any;
  }

  bool PlaceTargets() {
    bool any = false;
    for (const StationSighting& s : sightings_) {
      const Setup& setup = setups_.at(s.setup);
      if (!setup.placed || !IsPolar(s) || Has(s.target)) continue;
      const Eigen::AngleAxisd turn(-setup.orientation, Eigen::Vector3d::UnitZ());
      points_[s.target] = setup.instrument + turn * PolarVector(s) - s.target_height_m * Eigen::Vector3d::UnitZ();
      any = true;
    }
    return any;
  }

  void CollectReadings() {
    for (size_t i = 0; i < sightings_.size(); ++i) {
      const StationSighting& s = sightings_[i];
      if (!setups_.at(s.setup).placed || !Has(s.target)) continue;
      if (s.direction_rad) readings_.push_back({i, StationReading::kDirection});
      if (s.zenith_rad) readings_.push_back({i, StationReading::kZenith});
      if (s.distance_m) readings_.push_back({i, StationReading::kDistance});
    }
  }

  double Sigma(const Reading& r) const { return ReadingOf(sightings_[r.sighting], r.kind).second; }

  // One residual a reading, then three a known point, then three a set-up that stands on a point.
  void Build(ceres::Problem* problem, bool robust) {
    blocks_.clear();
    const auto add = [&](double* block, int size) {
      problem->AddParameterBlock(block, size);
      blocks_.push_back(block);
    };
    std::set<std::string> seen;
    for (const Reading& r : readings_) seen.insert(sightings_[r.sighting].target);
    for (auto& [name, at] : points_) {
      if (seen.count(name) > 0 || (setups_.count(name) > 0 && setups_.at(name).placed)) add(at.data(), 3);
    }
    for (auto& [name, setup] : setups_) {
      if (setup.placed) add(setup.instrument.data(), 3), add(&setup.orientation, 1);
    }
    for (const Reading& r : readings_) {
      if (r.excluded) continue;
      const StationSighting& s = sightings_[r.sighting];
      Setup& setup = setups_.at(s.setup);
      auto* cost = new StationCost(r.kind, ReadingOf(s, r.kind).first, Sigma(r), {}, s.target_height_m);
      std::vector<double*> of = {setup.instrument.data(), points_.at(s.target).data()};
      if (r.kind == StationReading::kDirection) of.push_back(&setup.orientation);
      problem->AddResidualBlock(cost, robust ? new ceres::HuberLoss(2) : nullptr, of);
    }
    for (const NetworkPoint& p : known_) {
      if (!problem->HasParameterBlock(points_.at(p.name).data())) continue;
      problem->AddResidualBlock(new KnownPointCost(p.position, {p.sigma_h_m, p.sigma_h_m, p.sigma_v_m}), nullptr,
                                points_.at(p.name).data());
    }
    for (auto& [name, setup] : setups_) {
      if (!setup.placed || !Has(name)) continue;
      problem->AddResidualBlock(new AboveCost(setup.height), nullptr, points_.at(name).data(), setup.instrument.data());
    }
  }

  void Solve(bool robust) {
    ceres::Problem problem;
    Build(&problem, robust);
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.max_num_iterations = 100;
    options.function_tolerance = options.parameter_tolerance = 1e-14;
    options.logging_type = ceres::SILENT;
    options.num_threads = 1;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (robust) return;
    ceres::CRSMatrix jacobian;
    std::vector<double> residuals;
    ceres::Problem::EvaluateOptions in_order;  // of blocks_; by itself Ceres may order them otherwise
    in_order.parameter_blocks = blocks_;
    problem.Evaluate(in_order, nullptr, &residuals, nullptr, &jacobian);
    jacobian_ = Eigen::MatrixXd::Zero(jacobian.num_rows, jacobian.num_cols);
    for (int row = 0; row < jacobian.num_rows; ++row) {
      for (int k = jacobian.rows[static_cast<size_t>(row)]; k < jacobian.rows[static_cast<size_t>(row) + 1]; ++k) {
        jacobian_(row, jacobian.cols[static_cast<size_t>(k)]) = jacobian.values[static_cast<size_t>(k)];
      }
    }
    residuals_ = Eigen::Map<const Eigen::VectorXd>(residuals.data(), static_cast<Eigen::Index>(residuals.size()));
    const Eigen::LDLT<Eigen::MatrixXd> normal(jacobian_.transpose() * jacobian_);
    if (normal.info() != Eigen::Success || !normal.isPositive()) {
      throw NumericError("total_station.csv: the readings do not fix all set-ups and targets");
    }
    covariance_ = normal.solve(Eigen::MatrixXd::Identity(jacobian_.cols(), jacobian_.cols()));
  }

  // Standardised residuals of what takes part.
  void Judge(StationNetwork* out) const {
    std::erase_if(out->residuals, [](const NetworkResidual& r) { return !r.excluded; });
    Eigen::Index row = 0;
    for (const Reading& r : readings_) {
      if (r.excluded) continue;
      const double redundancy = 1 - jacobian_.row(row).dot(covariance_ * jacobian_.row(row).transpose());
      const double standardised = redundancy > 1e-3 ? residuals_(row) / std::sqrt(redundancy) : 0;
      out->residuals.push_back({r.sighting, r.kind, residuals_(row) * Sigma(r), standardised, false});
      ++row;
    }
    out->redundancy = static_cast<int>(jacobian_.rows() - jacobian_.cols());
  }

  std::string Named(const NetworkResidual& r) const {
    const StationSighting& s = sightings_[r.sighting];
    return fmt::format("line {}: the {} from {} to {}", s.line, StationReadingName(r.reading), s.setup, s.target);
  }

  bool TakeOutWorst(StationNetwork* out) {
    NetworkResidual* worst = nullptr;
    for (NetworkResidual& r : out->residuals) {
      if (!r.excluded && (worst == nullptr || std::abs(r.standardised) > std::abs(worst->standardised))) worst = &r;
    }
    if (worst == nullptr || std::abs(worst->standardised) < kBlunder) return false;
    worst->excluded = true;
    const bool length = worst->reading == StationReading::kDistance;
    std::string others;  // that an error could be in as well: no third reading tells which
    for (const NetworkResidual& r : out->residuals) {
      constexpr double kTold = 0.95;
      if (r.excluded || std::abs(r.standardised) < kTold * std::abs(worst->standardised)) continue;
      others += (others.empty() ? "; it could as well be " : ", ") + Named(r);
    }
    out->warnings.push_back(
        fmt::format("total_station.csv, {} contradicts the others by {:.4f} {} ({:.1f} sigma): it is left out{}",
                    Named(*worst), std::abs(worst->residual) * (length ? 1 : kRadToDeg), length ? "m" : "deg",
                    std::abs(worst->standardised), others));
    for (Reading& r : readings_) {
      if (r.sighting == worst->sighting && r.kind == worst->reading) r.excluded = true;
    }
    return true;
  }

  void Collect(StationNetwork* out) {
    std::map<const double*, Eigen::Index> column;
    Eigen::Index next = 0;
    for (double* block : blocks_) {
      column[block] = next;
      bool angle = false;
      for (const auto& [name, setup] : setups_) angle = angle || block == &setup.orientation;
      next += angle ? 1 : 3;
    }
    std::vector<Eigen::Index> of;
    for (const auto& [name, at] : points_) {
      const auto it = column.find(at.data());
      if (it == column.end()) continue;
      out->points.push_back({name, at, 0, 0});
      of.push_back(it->second);
    }
    const auto n = static_cast<Eigen::Index>(of.size());
    out->covariance = Eigen::MatrixXd::Zero(3 * n, 3 * n);
    for (Eigen::Index a = 0; a < n; ++a) {
      for (Eigen::Index b = 0; b < n; ++b) {
        out->covariance.block<3, 3>(3 * a, 3 * b) =
            covariance_.block<3, 3>(of[static_cast<size_t>(a)], of[static_cast<size_t>(b)]);
      }
    }
    std::set<std::string> unplaced;
    for (const auto& [name, setup] : setups_) {
      if (setup.placed) {
        out->setups.push_back({name, setup.instrument, setup.orientation, {}});
        if (Has(name)) out->setups.back().height_m = setup.height;
      } else {
        unplaced.insert(name);
      }
    }
    for (const StationSighting& s : sightings_) {
      if (!Has(s.target)) unplaced.insert(s.target);
    }
    out->unplaced.assign(unplaced.begin(), unplaced.end());
  }

  const std::vector<StationSighting>& sightings_;
  const std::vector<NetworkPoint>& known_;
  const CancelToken& cancel_;
  std::map<std::string, Eigen::Vector3d> points_;
  std::map<std::string, Setup> setups_;
  std::vector<Reading> readings_;
  std::vector<double*> blocks_;  // of the last solution, in the order of its columns
  Eigen::MatrixXd jacobian_, covariance_;
  Eigen::VectorXd residuals_;
};

}  // namespace

Rigid3d LevelFromWorld(const std::vector<NetworkPoint>& known, const std::vector<StationSighting>& sightings,
                       const std::optional<LocalFrame>& enu) {
  // A tower that is read for its direction alone, or a point that nobody reads, may be kilometres away.
  std::vector<NetworkPoint> near = known;
  std::erase_if(near, [&](const NetworkPoint& p) {
    return std::none_of(sightings.begin(), sightings.end(), [&](const StationSighting& s) {
      return s.setup == p.name || (s.target == p.name && s.distance_m);
    });
  });
  if (near.empty()) near = known;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const NetworkPoint& p : near) middle += p.position / static_cast<double>(near.size());
  if (!enu) return {Eigen::Quaterniond::Identity(), -middle};
  const LocalFrame here(enu->GeodeticFromEnu(middle));
  const Eigen::Quaterniond turn(Eigen::Matrix3d(here.EcefFromEnuRotation().transpose() * enu->EcefFromEnuRotation()));
  return {turn, -(turn * middle)};
}

StationNetwork AdjustNetwork(const std::vector<StationSighting>& sightings, const std::vector<NetworkPoint>& known,
                             const CancelToken& cancel, const Rigid3d& level_from_world) {
  std::vector<NetworkPoint> levelled = known;
  for (NetworkPoint& p : levelled) p.position = level_from_world * p.position;
  StationNetwork network = Network(sightings, levelled, cancel).Adjust();
  const Rigid3d world_from_level = level_from_world.Inverse();
  const Eigen::Matrix3d turn = world_from_level.rotation.toRotationMatrix();
  for (NetworkPoint& p : network.points) p.position = world_from_level * p.position;
  for (StationSetup& s : network.setups) s.instrument = world_from_level * s.instrument;
  for (Eigen::Index a = 0; a < network.covariance.rows(); a += 3) {
    for (Eigen::Index b = 0; b < network.covariance.cols(); b += 3) {
      auto block = network.covariance.block<3, 3>(a, b);
      block = Eigen::Matrix3d(turn * block * turn.transpose());
    }
  }
  return network;
}

}  // namespace trigpoint

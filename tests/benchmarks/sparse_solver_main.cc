// The program's sparse estimator and Ceres on the same problems from the same start: time, memory, cost, covariance.
//   sparse_solver --problem bundle --solution results/localize/run1/solution.db [--solver trigpoint|ceres]
//   sparse_solver --problem tags|trajectory [--tags 1000] [--frames 5000] [--solver trigpoint|ceres]
//   further: [--threads 1] [--covariance]
//   of Ceres: [--normal] (SPARSE_NORMAL_CHOLESKY instead of SPARSE_SCHUR) [--radius 1e4] (of its first trust region)
// bundle: the joint solution of a run, its poses and points disturbed. tags: a corridor driven there and back, four
// tags known. trajectory: the same with every tag known. Prints a line of JSON; `digest` is one of the state's bytes,
// `trace` the sum of all variances of poses (rad^2 + m^2). The numbers are in docs/decisions/sparse_estimator.md.
#include <ceres/ceres.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <functional>

#include "calib/base/error.h"
#include "calib/estimation/bearing_terms.h"
#include "calib/estimation/bundle_terms.h"
#include "calib/estimation/loss.h"
#include "calib/estimation/random.h"
#include "calib/estimation/sparse_least_squares.h"
#include "datasets/solution/solution_file.h"
#include "survey/tags/survey_costs.h"

namespace trigpoint {
namespace {

struct Settings {
  std::string problem = "tags", solver = "trigpoint", solution;
  int tags = 1000, frames = 5000, threads = 1;
  bool covariance = false, normal = false;
  double radius = ceres::Solver::Options().initial_trust_region_radius;
};

struct Duration {
  double wall_s = 0, cpu_s = 0;
};

Duration TimeOf(const std::function<void()>& work) {
  const auto begin = std::chrono::steady_clock::now();
  const std::clock_t cpu = std::clock();
  work();
  return {std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(),
          static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC};
}

struct Outcome {
  double cost_before = 0, cost_after = 0, trace = 0;
  Duration solve, covariance;
  int iterations = 0;
  uint64_t digest = 14695981039346656037ULL;  // FNV-1a
  void Digest(const double* values, size_t count) {
    std::vector<unsigned char> bytes(count * sizeof(double));
    std::memcpy(bytes.data(), values, bytes.size());
    for (unsigned char b : bytes) digest = (digest ^ b) * 1099511628211ULL;
  }
};

Vector6d Disturbance(Random* random, double rotation, double translation) {
  Vector6d d;
  for (int i = 0; i < 6; ++i) d[i] = random->Normal() * (i < 3 ? rotation : translation);
  return d;
}

void SolveWithCeres(const Settings& settings, ceres::Problem* problem, const std::vector<double*>& points,
                    Outcome* out) {
  ceres::Solver::Options options;
  options.linear_solver_type = settings.normal ? ceres::SPARSE_NORMAL_CHOLESKY : ceres::SPARSE_SCHUR;
  options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  options.num_threads = settings.threads;
  options.max_num_iterations = 50;
  options.initial_trust_region_radius = settings.radius;
  options.function_tolerance = settings.problem == "bundle" ? 1e-6 : 1e-9;
  if (!points.empty()) {
    options.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    std::vector<double*> blocks;
    problem->GetParameterBlocks(&blocks);
    for (double* b : blocks) options.linear_solver_ordering->AddElementToGroup(b, 1);
    for (double* b : points) options.linear_solver_ordering->AddElementToGroup(b, 0);
  }
  ceres::Solver::Summary summary;
  ceres::Solve(options, problem, &summary);
  out->cost_before = summary.initial_cost, out->cost_after = summary.final_cost;
  out->iterations = summary.num_successful_steps + summary.num_unsuccessful_steps;
}

void CovarianceWithCeres(const Settings& settings, ceres::Problem* problem, const std::vector<double*>& poses,
                         Outcome* out) {
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::SPARSE_QR;
  options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  options.num_threads = settings.threads;
  ceres::Covariance covariance(options);
  std::vector<std::pair<const double*, const double*>> pairs;
  for (double* p : poses) pairs.emplace_back(p, p);
  if (!covariance.Compute(pairs, problem)) throw NumericError("Ceres computes no covariance");
  for (double* p : poses) {
    Eigen::Matrix<double, 6, 6, Eigen::RowMajor> c;
    covariance.GetCovarianceBlockInTangentSpace(p, p, c.data());
    out->trace += c.trace();
  }
}

// --- The tag map and the reference trajectory ------------------------------------------------------------------------

struct Corridor {
  double one = 1;
  std::array<double, 6> ones{1, 1, 1, 1, 1, 1};
  HuberChi2Loss huber{31.8};
  SparseLeastSquares problem;
};

// A tag every metre, left and right by turns, seen by two cameras that look ahead to the left and to the right.
void FillCorridor(const Settings& settings, Corridor* corridor) {
  Random random(1);
  SparseLeastSquares& s = corridor->problem;
  std::vector<Rigid3d> tags, frames;
  for (int k = 0; k < settings.tags; ++k) {
    const double side = k % 2 == 0 ? 1 : -1;
    Eigen::Matrix3d r;  // y down, z into the tag: away from the corridor
    r.col(2) << 0, side, 0;
    r.col(1) << 0, 0, -1;
    r.col(0) = r.col(1).cross(r.col(2));
    tags.emplace_back(Eigen::Quaterniond(r), Eigen::Vector3d(k, 1.7 * side, 0.4 * (k % 3)));
  }
  for (int i = 0; i < settings.frames; ++i) {
    const double way = 2.0 * settings.tags * i / settings.frames;
    const bool back = way > settings.tags;
    frames.emplace_back(ExpSO3({0, 0, back ? M_PI : 0}),
                        Eigen::Vector3d(back ? 2.0 * settings.tags - way : way, back ? 0.3 : -0.3, 0));
  }
  for (const Rigid3d& f : frames) s.AddPose(f.Plus(Disturbance(&random, 0.005, 0.05)));
  for (const Rigid3d& t : tags) s.AddPose(t.Plus(Disturbance(&random, 0.01, 0.05)));
  const int scale = s.AddNumbers({1}), zero = s.AddNumbers({0});
  s.unknowns.back().constant = true;
  const Camera pinhole(CameraModel::kPinhole, 1280, 800, {500, 500, 639.5, 399.5});
  Eigen::Matrix3d forward;
  forward << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  for (int i = 0; i < settings.frames; ++i) {
    for (double turn : {-0.8, 0.8}) {
      const Rigid3d cam_from_body(Eigen::Quaterniond(forward) * ExpSO3({0, 0, turn}), Eigen::Vector3d::Zero());
      const Rigid3d cam_from_world = cam_from_body * frames[static_cast<size_t>(i)].Inverse();
      const int around = static_cast<int>(frames[static_cast<size_t>(i)].translation.x());
      for (int k = std::max(0, around - 8); k < std::min(settings.tags, around + 8); ++k) {
        const Rigid3d cam_from_tag = cam_from_world * tags[static_cast<size_t>(k)];
        TagDetection d;
        d.id = k;
        d.corner_sigma_px.fill(0.2);
        bool seen = cam_from_tag.rotation.toRotationMatrix().col(2).dot(cam_from_tag.translation.normalized()) > 0.3;
        for (int c = 0; c < 4 && seen; ++c) {
          const auto pixel = pinhole.Project(cam_from_tag * TagCorner(0.2, c));
          seen = pixel && pinhole.Contains(*pixel);
          if (seen)
            d.corners[static_cast<size_t>(c)] = *pixel + 0.2 * Eigen::Vector2d(random.Normal(), random.Normal());
        }
        if (!seen) continue;
        s.AddFactor(new TagCost(MakeTagSight(pinhole, d), 0.2, cam_from_body, &corridor->one), &corridor->huber,
                    {i, settings.frames + k, zero});
      }
    }
    if (i == 0) continue;
    Vector6d sigma;
    sigma << Eigen::Vector3d::Constant(0.002), Eigen::Vector3d::Constant(0.01);
    const Rigid3d exact = frames[static_cast<size_t>(i) - 1].Inverse() * frames[static_cast<size_t>(i)];
    s.AddFactor(new OdometryCost(exact.Plus(Disturbance(&random, 0.002, 0.01)), Eigen::Vector3d::Zero(), sigma,
                                 corridor->ones.data()),
                nullptr, {i - 1, i, scale, zero});
  }
  s.AddFactor(new NumberCost(1, 0.01), nullptr, {scale});
  for (int k = 0; k < settings.tags; ++k) {
    if (settings.problem == "trajectory") {
      Vector6d sigma;
      sigma << Eigen::Vector3d::Constant(0.002), Eigen::Vector3d::Constant(0.005);
      s.AddFactor(new PosePriorCost(tags[static_cast<size_t>(k)].Plus(Disturbance(&random, 0.002, 0.005)), sigma),
                  nullptr, {settings.frames + k});
    } else if (k < 2 || k >= settings.tags - 2) {
      s.AddFactor(new PointCost(Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(),
                                tags[static_cast<size_t>(k)].translation, Eigen::Vector3d::Constant(0.005)),
                  nullptr, {settings.frames + k});
    }
  }
}

void RunCorridor(const Settings& settings, Outcome* out) {
  Corridor corridor;
  FillCorridor(settings, &corridor);
  SparseLeastSquares& s = corridor.problem;
  const int poses = settings.frames + settings.tags;
  if (settings.solver == "trigpoint") {
    ProgressSink silent;
    const CancelToken never;
    out->solve = TimeOf([&] {
      const SparseLeastSquares::Summary summary = s.Solve(50, settings.threads, silent, never);
      out->cost_before = summary.cost_before, out->cost_after = summary.cost_after;
      out->iterations = summary.iterations;
    });
    if (settings.covariance) {
      out->covariance = TimeOf([&] { s.Linearise(settings.threads, never); });
      for (int i = 0; i < poses; ++i) out->trace += s.PoseCovariance(i).trace();
    }
  } else {
    Rigid3Manifold manifold;
    ceres::Problem::Options options;
    options.cost_function_ownership = options.loss_function_ownership = options.manifold_ownership =
        ceres::DO_NOT_TAKE_OWNERSHIP;
    ceres::Problem problem(options);
    std::vector<double*> blocks;
    out->solve = TimeOf([&] {
      for (const SparseLeastSquares::Factor& f : s.factors) {
        std::vector<double*> its;
        for (int u : f.unknowns) its.push_back(s.unknowns[static_cast<size_t>(u)].value.data());
        problem.AddResidualBlock(f.cost.get(), const_cast<ceres::LossFunction*>(f.loss), its);
      }
      for (SparseLeastSquares::Unknown& u : s.unknowns) {
        if (!problem.HasParameterBlock(u.value.data())) continue;
        if (u.size == 7) problem.SetManifold(u.value.data(), &manifold);
        if (u.constant) problem.SetParameterBlockConstant(u.value.data());
      }
      SolveWithCeres(settings, &problem, {}, out);
    });
    for (int i = 0; i < poses; ++i) blocks.push_back(s.unknowns[static_cast<size_t>(i)].value.data());
    if (settings.covariance) {
      out->covariance = TimeOf([&] { CovarianceWithCeres(settings, &problem, blocks, out); });
    }
  }
  for (const SparseLeastSquares::Unknown& u : s.unknowns) out->Digest(u.value.data(), static_cast<size_t>(u.size));
}

// --- The bundle ------------------------------------------------------------------------------------------------------

class BearingCost final : public ceres::SizedCostFunction<2, 7, 3> {
 public:
  BearingCost(const BearingObservation& o, const Rigid3d& view) : o_(o), view_(view) {}
  bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
    ObservationTerms t;
    const Eigen::Map<const Eigen::Vector3d> point(x[1]);
    if (!EvaluateBearing<true>(Rigid3FromBlock(x[0]), view_, o_.w.cast<double>(), o_.ray.cast<double>(), point, &t)) {
      return false;
    }
    Eigen::Map<Eigen::Vector2d>{residuals} = t.r;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Matrix<double, 6, 7, Eigen::RowMajor> minus;
      Rigid3Manifold().MinusJacobian(x[0], minus.data());
      Eigen::Map<Eigen::Matrix<double, 2, 7, Eigen::RowMajor>>{jacobians[0]} = t.jp * minus;
    }
    if (jacobians != nullptr && jacobians[1] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>{jacobians[1]} = t.jy;
    }
    return true;
  }

 private:
  const BearingObservation& o_;
  const Rigid3d& view_;
};

// A factor of the bundle with its poses (one or two) and, where it names one, its scale.
class PoseFactorCost final : public ceres::CostFunction {
 public:
  PoseFactorCost(const PoseFactor& f, const std::vector<Rigid3d>& views) : poses_(f.b >= 0 ? 2 : 1) {
    problem_.views = views;
    problem_.poses.resize(poses_);
    problem_.factors = {f};
    problem_.factors[0].a = 0, problem_.factors[0].b = f.b >= 0 ? 1 : -1;
    problem_.factors[0].scale = f.scale >= 0 ? 0 : -1;
    set_num_residuals(6);
    mutable_parameter_block_sizes()->assign(poses_, 7);
    if (f.scale >= 0) mutable_parameter_block_sizes()->push_back(1);
  }
  bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
    BundleProblem p = problem_;
    const bool scaled = p.factors[0].scale >= 0;
    for (size_t i = 0; i < poses_; ++i) p.poses[i] = Rigid3FromBlock(x[i]);
    if (scaled) p.scales[0].value = x[poses_][0];
    FactorTerms t;
    EvaluateFactor(p, p.factors[0], &t);
    Eigen::Map<Vector6d>{residuals} = t.r;
    if (jacobians == nullptr) return true;
    if (scaled && jacobians[poses_] != nullptr) Eigen::Map<Vector6d>{jacobians[poses_]} = t.js;
    for (size_t i = 0; i < poses_; ++i) {
      if (jacobians[i] == nullptr) continue;
      Eigen::Matrix<double, 6, 7, Eigen::RowMajor> minus;
      Rigid3Manifold().MinusJacobian(x[i], minus.data());
      Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>>{jacobians[i]} = (i == 0 ? t.ja : t.jb) * minus;
    }
    return true;
  }

 private:
  size_t poses_;
  BundleProblem problem_;
};

void BundleWithCeres(const Settings& settings, BundleProblem* p, Outcome* out) {
  if (p->map) throw InputError("expected a solution without a tag map's joint prior, found one");
  Rigid3Manifold manifold;
  ceres::Problem::Options options;
  options.loss_function_ownership = options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(options);
  std::vector<std::array<double, 7>> poses(p->poses.size());
  std::vector<double*> points, free;
  for (size_t i = 0; i < poses.size(); ++i) Rigid3ToBlock(p->poses[i], poses[i].data());
  out->solve = TimeOf([&] {
    for (const BearingObservation& o : p->observations) {
      if (!o.active) continue;
      problem.AddResidualBlock(new BearingCost(o, p->views[static_cast<size_t>(o.view)]),
                               p->loss.get() == nullptr ? nullptr : const_cast<ceres::LossFunction*>(p->loss.get()),
                               poses[static_cast<size_t>(o.pose)].data(),
                               p->points[static_cast<size_t>(o.point)].data());
    }
    for (const PoseFactor& f : p->factors) {
      std::vector<double*> its{poses[static_cast<size_t>(f.a)].data()};
      if (f.b >= 0) its.push_back(poses[static_cast<size_t>(f.b)].data());
      if (f.scale >= 0) its.push_back(&p->scales[static_cast<size_t>(f.scale)].value);
      problem.AddResidualBlock(new PoseFactorCost(f, p->views), const_cast<ceres::LossFunction*>(f.loss.get()), its);
    }
    for (OdometryScale& s : p->scales) {
      if (!s.constant) problem.AddResidualBlock(new NumberCost(s.prior, s.sigma), nullptr, &s.value);
      if (s.constant && problem.HasParameterBlock(&s.value)) problem.SetParameterBlockConstant(&s.value);
    }
    for (size_t i = 0; i < poses.size(); ++i) {
      if (!problem.HasParameterBlock(poses[i].data())) continue;
      problem.SetManifold(poses[i].data(), &manifold);
      const bool constant = !p->pose_constant.empty() && p->pose_constant[i];
      if (constant) problem.SetParameterBlockConstant(poses[i].data());
      if (!constant) free.push_back(poses[i].data());
    }
    for (Eigen::Vector3d& y : p->points) {
      if (problem.HasParameterBlock(y.data())) points.push_back(y.data());
    }
    SolveWithCeres(settings, &problem, points, out);
  });
  for (const auto& pose : poses) out->Digest(pose.data(), 7);
  if (settings.covariance) out->covariance = TimeOf([&] { CovarianceWithCeres(settings, &problem, free, out); });
}

void RunBundle(const Settings& settings, Outcome* out) {
  Solution solution = ReadSolution(settings.solution);
  BundleProblem& p = solution.problem;
  Random random(1);
  for (size_t i = 0; i < p.poses.size(); ++i) {
    if (p.pose_constant.empty() || !p.pose_constant[i]) p.poses[i] = p.poses[i].Plus(Disturbance(&random, 0.002, 0.02));
  }
  for (Eigen::Vector3d& y : p.points) y += Disturbance(&random, 0, 0.05).tail<3>();
  if (settings.solver == "ceres") {
    BundleWithCeres(settings, &p, out);
    return;
  }
  ProgressSink silent;
  const CancelToken never;
  out->solve = TimeOf([&] {
    const BundleSummary summary =
        SolveBundle(p, {.relative_cost_tolerance = 1e-6, .threads = settings.threads}, silent, never);
    out->cost_before = summary.initial_cost, out->cost_after = summary.final_cost;
    out->iterations = summary.iterations;
  });
  for (const Rigid3d& pose : p.poses) {
    std::array<double, 7> block{};
    Rigid3ToBlock(pose, block.data());
    out->Digest(block.data(), 7);
  }
  if (!settings.covariance) return;
  std::vector<Matrix6d> diagonal, unused;
  out->covariance = TimeOf([&] { BundleCovariance(p, settings.threads, never).PoseBlocks({}, &diagonal, &unused); });
  for (const Matrix6d& c : diagonal) out->trace += c.trace();
}

int Main(int argc, char** argv) {
  CLI::App app("the program's sparse estimator and Ceres on the same problems");
  Settings settings;
  app.add_option("--problem", settings.problem)->check(CLI::IsMember({"bundle", "tags", "trajectory"}));
  app.add_option("--solver", settings.solver)->check(CLI::IsMember({"trigpoint", "ceres"}));
  app.add_option("--solution", settings.solution);
  app.add_option("--tags", settings.tags);
  app.add_option("--frames", settings.frames);
  app.add_option("--threads", settings.threads);
  app.add_flag("--covariance", settings.covariance);
  app.add_flag("--normal", settings.normal);
  app.add_option("--radius", settings.radius);
  CLI11_PARSE(app, argc, argv);
  Outcome out;
  if (settings.problem == "bundle") {
    RunBundle(settings, &out);
  } else {
    RunCorridor(settings, &out);
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::printf(
      "{\"problem\": \"%s\", \"solver\": \"%s\", \"threads\": %d, \"solve_s\": %.2f, \"solve_cpu_s\": %.2f, "
      "\"iterations\": %d, \"cost_before\": %.6g, \"cost_after\": %.9g, \"covariance_s\": %.2f, "
      "\"covariance_cpu_s\": %.2f, \"trace\": %.9g, \"peak_mib\": %.0f, \"digest\": \"%016llx\"}\n",
      settings.problem.c_str(), settings.solver.c_str(), settings.threads, out.solve.wall_s, out.solve.cpu_s,
      out.iterations, out.cost_before, out.cost_after, out.covariance.wall_s, out.covariance.cpu_s, out.trace,
      static_cast<double>(usage.ru_maxrss) / 1024, static_cast<unsigned long long>(out.digest));
  return 0;
}

}  // namespace
}  // namespace trigpoint

int main(int argc, char** argv) {
  try {
    return trigpoint::Main(argc, argv);
  } catch (const trigpoint::Error& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
}

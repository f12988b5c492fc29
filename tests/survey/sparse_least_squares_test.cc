#include "calib/estimation/sparse_least_squares.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <array>
#include <cmath>

#include "calib/base/error.h"
#include "calib/camera/camera.h"
#include "calib/estimation/random.h"
#include "survey/tags/survey_costs.h"

namespace trigpoint {
namespace {

const Camera kCamera(CameraModel::kPinhole, 960, 600, {400, 400, 479.5, 299.5});

Eigen::Vector3d RandomVector(Random* random, double size) {
  return size * Eigen::Vector3d(random->Normal(), random->Normal(), random->Normal());
}

// Five cameras in a row before forty points, the first two held.
struct Row {
  std::vector<Rigid3d> truth;
  std::vector<Eigen::Vector3d> points;
  SparseLeastSquares solver;
};

void Fill(uint64_t seed, double sigma_px, Row* row) {
  Random random(seed);
  for (int i = 0; i < 5; ++i)
    row->truth.emplace_back(ExpSO3(RandomVector(&random, 0.02)), Eigen::Vector3d(0.5 * i, 0, 0));
  for (int i = 0; i < 40; ++i) {
    row->points.emplace_back(random.Uniform(-3, 5), random.Uniform(-2, 2), random.Uniform(5, 9));
  }
  SparseLeastSquares& s = row->solver;
  for (int i = 0; i < 5; ++i) {
    Vector6d off;
    off << RandomVector(&random, 0.005), RandomVector(&random, 0.02);
    s.AddPose(i < 2 ? row->truth[i] : row->truth[i].Plus(off));
    s.unknowns.back().constant = i < 2;
  }
  s.views.push_back({});
  for (size_t p = 0; p < row->points.size(); ++p) {
    s.points.emplace_back(row->points[p] + RandomVector(&random, 0.05));
    for (int i = 0; i < 5; ++i) {
      const auto pixel = kCamera.Project(row->truth[i].Inverse() * row->points[p]);
      if (!pixel) continue;
      const Eigen::Vector2d seen = *pixel + sigma_px * Eigen::Vector2d(random.Normal(), random.Normal());
      s.observations.push_back({static_cast<int>(p), i, 0, kCamera.BearingSqrtInfo(seen, sigma_px).cast<float>()});
    }
  }
}

TEST(SparseLeastSquares, PointsTieCamerasAndTheirCovarianceIsReal) {
  ProgressSink progress;
  const CancelToken cancel;
  double nees = 0;
  const int redraws = 30;
  for (int seed = 1; seed <= redraws; ++seed) {
    Row row;
    Fill(static_cast<uint64_t>(seed), 0.3, &row);
    const SparseLeastSquares::Summary summary = row.solver.Solve(30, 2, progress, cancel);
    EXPECT_TRUE(summary.converged);
    EXPECT_LT(summary.cost_after, summary.cost_before);
    row.solver.Linearise(2, cancel);
    const Vector6d e = row.solver.Pose(4).Minus(row.truth[4]);
    const Matrix6d covariance = row.solver.PoseCovariance(4);
    // 180 normal errors: one beyond 4.5 sigma in 800 such tests.
    EXPECT_LT((e.array().abs() / covariance.diagonal().array().sqrt()).maxCoeff(), 4.5);
    nees += e.dot(covariance.inverse() * e);
  }
  // Chi-square with 180 degrees of freedom, 95 %: 144 to 219.
  EXPECT_GT(nees, 144 - 10);
  EXPECT_LT(nees, 219 + 10);
}

TEST(SparseLeastSquares, DoesNotDependOnThreads) {
  ProgressSink progress;
  const CancelToken cancel;
  Row one, two;
  Fill(5, 0.3, &one);
  Fill(5, 0.3, &two);
  one.solver.Solve(20, 1, progress, cancel);
  two.solver.Solve(20, 2, progress, cancel);
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(one.solver.unknowns[static_cast<size_t>(i)].value, two.solver.unknowns[static_cast<size_t>(i)].value);
  }
}

TEST(SparseLeastSquares, EliminatedPointsEqualPointsKept) {
  // The same problem with points as unknowns of their own.
  ProgressSink progress;
  const CancelToken cancel;
  Row row;
  Fill(6, 0.3, &row);
  SparseLeastSquares kept;
  kept.unknowns = row.solver.unknowns;
  std::vector<int> unknown;
  for (const Eigen::Vector3d& p : row.solver.points) unknown.push_back(kept.AddNumbers({p.x(), p.y(), p.z()}));
  for (const SparseLeastSquares::PointObservation& s : row.solver.observations) {
    kept.AddFactor(new MarkCost(s.w.cast<double>(), Rigid3d()), nullptr,
                   {s.pose, unknown[static_cast<size_t>(s.point)]});
  }
  row.solver.Solve(30, 2, progress, cancel);
  row.solver.Linearise(2, cancel);
  kept.Solve(30, 2, progress, cancel);
  kept.Linearise(2, cancel);
  for (int i = 2; i < 5; ++i) {
    EXPECT_LT(row.solver.Pose(i).Minus(kept.Pose(i)).norm(), 1e-5);
    const Matrix6d a = row.solver.PoseCovariance(i), b = kept.PoseCovariance(i);
    EXPECT_LT((a - b).norm(), 1e-3 * b.norm());
  }
}

TEST(SparseLeastSquares, ColumnsOfTheCovarianceAgreeWithItsBlocks) {
  ProgressSink progress;
  const CancelToken cancel;
  Row row;
  Fill(7, 0.3, &row);
  SparseLeastSquares& s = row.solver;
  const int scale = s.AddNumbers({1.0});
  s.AddFactor(new NumberCost(1, 0.1), nullptr, {scale});
  s.Solve(30, 2, progress, cancel);
  s.Linearise(2, cancel);
  EXPECT_EQ(s.Offset(0), -1);
  EXPECT_NEAR(s.Covariance(s.Offset(scale), s.Offset(scale), 1, 1)(0, 0), 0.01, 1e-12);
  const Eigen::MatrixXd columns = s.CovarianceColumns(s.Offset(3) + 3, 3);
  ASSERT_EQ(columns.rows(), s.Equations());
  for (int i = 2; i < 5; ++i) {
    EXPECT_LT((columns.middleRows(s.Offset(i), 6) - s.Covariance(s.Offset(i), s.Offset(3) + 3, 6, 3)).norm(),
              1e-9 * columns.norm());
  }
  EXPECT_LT((s.SolveNormal(Eigen::MatrixXd::Identity(s.Equations(), s.Equations())).middleCols(s.Offset(4), 6) -
             s.CovarianceColumns(s.Offset(4), 6))
                .norm(),
            1e-9 * columns.norm());
}

// A chain of thousands of poses that is held at its ends bends so easily that damping must not hold it.
TEST(SparseLeastSquares, ALongChainConvergesToOneMinimumFromEveryStart) {
  constexpr int kPoses = 4000, kMiddle = kPoses / 2;
  const std::array<double, 6> ones{1, 1, 1, 1, 1, 1};
  Vector6d step_sigma, end_sigma;
  step_sigma << Eigen::Vector3d::Constant(0.002), Eigen::Vector3d::Constant(0.01);
  end_sigma << Eigen::Vector3d::Constant(0.001), Eigen::Vector3d::Constant(0.005);
  ProgressSink progress;
  const CancelToken cancel;
  std::vector<Rigid3d> middles;
  double sigma_m = 0;
  for (uint64_t start : {1U, 2U}) {
    Random noise(3), off(start);
    const auto draw = [](Random* random, double rotation, double translation) {
      Vector6d v;
      v << RandomVector(random, rotation), RandomVector(random, translation);
      return v;
    };
    SparseLeastSquares s;
    std::vector<Rigid3d> truth;
    for (int i = 0; i < kPoses; ++i) {
      truth.emplace_back(Eigen::Quaterniond::Identity(), Eigen::Vector3d(i, 0, 0));
      s.AddPose(truth.back().Plus(draw(&off, 0.005, 0.05)));
    }
    const int scale = s.AddNumbers({1}), zero = s.AddNumbers({0});
    for (int u : {scale, zero}) s.unknowns[static_cast<size_t>(u)].constant = true;
    for (int i = 1; i < kPoses; ++i) {
      const Rigid3d exact = truth[static_cast<size_t>(i) - 1].Inverse() * truth[static_cast<size_t>(i)];
      s.AddFactor(
          new OdometryCost(exact.Plus(draw(&noise, 0.002, 0.01)), Eigen::Vector3d::Zero(), step_sigma, ones.data()),
          nullptr, {i - 1, i, scale, zero});
    }
    for (int i : {0, kPoses - 1}) {
      s.AddFactor(new PosePriorCost(truth[static_cast<size_t>(i)], end_sigma), nullptr, {i});
    }
    const SparseLeastSquares::Summary summary = s.Solve(20, 2, progress, cancel);
    EXPECT_TRUE(summary.converged);
    s.Linearise(2, cancel);
    middles.push_back(s.Pose(kMiddle));
    sigma_m = std::sqrt(s.PoseCovariance(kMiddle).diagonal().tail<3>().maxCoeff());
  }
  EXPECT_LT((middles[0].translation - middles[1].translation).norm(), 0.02 * sigma_m);
}

TEST(SparseLeastSquares, WhatNothingHoldsIsSingular) {
  ProgressSink progress;
  const CancelToken cancel;
  SparseLeastSquares solver;
  const int a = solver.AddPose({}), b = solver.AddPose(Rigid3d(Eigen::Quaterniond::Identity(), {1, 0, 0}));
  solver.AddFactor(new DistanceCost(1.1, 0.01), nullptr, {a, b});
  EXPECT_THROW(
      {
        solver.Solve(10, 1, progress, cancel);
        solver.Linearise(1, cancel);
      },
      NumericError);
}

}  // namespace
}  // namespace trigpoint

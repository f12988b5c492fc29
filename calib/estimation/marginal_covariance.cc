#include "calib/estimation/marginal_covariance.h"

#include <ceres/ceres.h>

#include <Eigen/Dense>
#include <algorithm>
#include <map>

namespace trigpoint {
namespace {

// Information and gradient (J^T r) of some columns.
struct Part {
  std::vector<int> columns;  // ascending
  Eigen::MatrixXd h;
  Eigen::VectorXd g;
};

void AddTo(const Part& part, Part* sum) {
  std::vector<Eigen::Index> place;
  for (int c : part.columns) {
    place.push_back(std::lower_bound(sum->columns.begin(), sum->columns.end(), c) - sum->columns.begin());
  }
  for (size_t a = 0; a < place.size(); ++a) {
    sum->g(place[a]) += part.g(static_cast<Eigen::Index>(a));
    for (size_t b = 0; b < place.size(); ++b) {
      sum->h(place[a], place[b]) += part.h(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
    }
  }
}

Part PartOf(std::vector<int> columns) {
  std::sort(columns.begin(), columns.end());
  columns.erase(std::unique(columns.begin(), columns.end()), columns.end());
  const Eigen::Index n = static_cast<Eigen::Index>(columns.size());
  return {std::move(columns), Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n)};
}

// Some rows of J and r, one point of theirs (its first column `begin`, -1: none) eliminated. `kept`: columns below it.
Part PartOfRows(const ceres::CRSMatrix& j, const std::vector<double>& r, const std::vector<int>& rows, int kept,
                int begin) {
  std::vector<int> columns;
  for (int row : rows) {
    for (int k = j.rows[static_cast<size_t>(row)]; k < j.rows[static_cast<size_t>(row) + 1]; ++k) {
      if (j.cols[static_cast<size_t>(k)] < kept) columns.push_back(j.cols[static_cast<size_t>(k)]);
    }
  }
  Part part = PartOf(std::move(columns));
  const Eigen::Index n = static_cast<Eigen::Index>(part.columns.size());
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(rows.size()), n + 3);
  Eigen::VectorXd left(dense.rows());
  for (size_t i = 0; i < rows.size(); ++i) {
    const size_t row = static_cast<size_t>(rows[i]);
    left(static_cast<Eigen::Index>(i)) = r[row];
    for (int k = j.rows[row]; k < j.rows[row + 1]; ++k) {
      const int c = j.cols[static_cast<size_t>(k)];
      const Eigen::Index at = c < kept
                                  ? std::lower_bound(part.columns.begin(), part.columns.end(), c) - part.columns.begin()
                                  : n + c - begin;
      dense(static_cast<Eigen::Index>(i), at) = j.values[static_cast<size_t>(k)];
    }
  }
  part.h = dense.leftCols(n).transpose() * dense.leftCols(n);
  part.g = dense.leftCols(n).transpose() * left;
  if (begin < 0) return part;
  // A direction that nothing depends on stays solvable.
  const Eigen::Matrix3d v =
      dense.rightCols<3>().transpose() * dense.rightCols<3>() + Eigen::Matrix3d::Identity() * 1e-12;
  const Eigen::MatrixXd w = dense.rightCols<3>().transpose() * dense.leftCols(n);
  const Eigen::MatrixXd share = v.inverse() * w;
  part.h -= w.transpose() * share;
  part.g -= share.transpose() * (dense.rightCols<3>().transpose() * left);
  return part;
}

// Sandwich estimate (White 1980), whose mean is what independent errors leave after the fit: a group with information
// h has a gradient of variance h - h C h there. `weight`: of gradients; the covariance C where all is asked for.
double SharedErrors(const std::vector<Part>& of_point, const std::vector<int>& groups,
                    const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& weight) {
  std::map<int, std::vector<const Part*>> of_group;
  for (size_t p = 0; p < of_point.size(); ++p) of_group[groups[p]].push_back(&of_point[p]);
  double seen = 0, expected = 0;
  for (const auto& [group, parts] : of_group) {
    std::vector<int> active;
    for (const Part* part : parts) active.insert(active.end(), part->columns.begin(), part->columns.end());
    Part sum = PartOf(std::move(active));
    for (const Part* part : parts) AddTo(*part, &sum);
    const Eigen::MatrixXd c = covariance(sum.columns, sum.columns);
    const Eigen::MatrixXd w = weight(sum.columns, sum.columns);
    const Eigen::MatrixXd wh = w * sum.h, ch = c * sum.h;
    seen += sum.g.dot(w * sum.g);
    expected += wh.trace() - wh.cwiseProduct(ch.transpose()).sum();
  }
  return expected > 0 ? seen / expected : 0;
}

}  // namespace

MarginalCovariance Marginalise(ceres::Problem* problem, const std::vector<double*>& kept,
                               const std::vector<double*>& points, const std::vector<std::vector<int>>& groupings,
                               int asked) {
  ceres::Problem::EvaluateOptions evaluate;
  evaluate.parameter_blocks = kept;
  evaluate.parameter_blocks.insert(evaluate.parameter_blocks.end(), points.begin(), points.end());
  ceres::CRSMatrix j;
  std::vector<double> r;
  problem->Evaluate(evaluate, nullptr, &r, nullptr, &j);
  int columns = 0;
  for (double* b : kept) columns += problem->ParameterBlockTangentSize(b);
  std::vector<int> begin_of_point;
  std::vector<size_t> point_of_column;
  for (size_t p = 0; p < points.size(); ++p) {
    begin_of_point.push_back(columns + static_cast<int>(point_of_column.size()));
    point_of_column.insert(point_of_column.end(), static_cast<size_t>(problem->ParameterBlockTangentSize(points[p])),
                           p);
  }
  std::vector<std::vector<int>> rows_of_point(points.size());
  std::vector<int> all_columns(static_cast<size_t>(columns));
  for (int c = 0; c < columns; ++c) all_columns[static_cast<size_t>(c)] = c;
  Part whole = PartOf(all_columns);
  for (int row = 0; row < j.num_rows; ++row) {
    const int last = j.rows[static_cast<size_t>(row) + 1] - 1;
    int of_point = -1;
    for (int k = j.rows[static_cast<size_t>(row)]; k <= last; ++k) {
      of_point = std::max(of_point, j.cols[static_cast<size_t>(k)] - columns);
    }
    if (of_point >= 0) {
      rows_of_point[point_of_column[static_cast<size_t>(of_point)]].push_back(row);
    } else {
      AddTo(PartOfRows(j, r, {row}, columns, -1), &whole);
    }
  }
  std::vector<Part> of_point;
  for (size_t p = 0; p < points.size(); ++p) {
    Part part = PartOfRows(j, r, rows_of_point[p], columns, begin_of_point[p]);
    AddTo(part, &whole);
    if (!groupings.empty()) of_point.push_back(std::move(part));
  }
  // A held direction has no information: outweighed, it stays out of the inverse.
  for (int c = 0; c < columns; ++c) {
    if (whole.h(c, c) <= 1e-12) whole.h(c, c) = 1e30;
  }
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(whole.h);
  if (ldlt.info() != Eigen::Success || !(ldlt.vectorD().minCoeff() > 0)) return {};
  MarginalCovariance out;
  out.covariance = ldlt.solve(Eigen::MatrixXd::Identity(columns, columns));
  if (groupings.empty()) return out;
  Eigen::MatrixXd weight = out.covariance;
  if (asked >= 0 && asked < columns) {
    const Eigen::MatrixXd rows = out.covariance.topRows(asked);
    weight = rows.transpose() * rows.leftCols(asked).ldlt().solve(rows);
  }
  for (const std::vector<int>& groups : groupings) {
    out.shared = std::max(out.shared, SharedErrors(of_point, groups, out.covariance, weight));
  }
  return out;
}

}  // namespace trigpoint

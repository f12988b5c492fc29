// Matrices in JSON, row by row.
#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>

namespace trigpoint {

inline nlohmann::json JsonRows(const Eigen::MatrixXd& m) {
  nlohmann::json rows = nlohmann::json::array();
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    nlohmann::json row = nlohmann::json::array();
    for (Eigen::Index k = 0; k < m.cols(); ++k) row.push_back(m(i, k));
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace trigpoint

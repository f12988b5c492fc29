// A detected tag as JSON, exact: what one process finds and another goes on with.
#pragma once

#include <nlohmann/json.hpp>

#include "survey/tags/detection.h"

namespace trigpoint {

// [family, id, hamming, margin, [u0, v0, ..., u3, v3], [sigma_px of each corner], refined]
inline nlohmann::json JsonOf(const TagDetection& t) {
  nlohmann::json corners = nlohmann::json::array();
  for (const Eigen::Vector2d& c : t.corners) corners.insert(corners.end(), {c.x(), c.y()});
  return {t.family, t.id, t.hamming, t.margin, corners, t.corner_sigma_px, t.refined};
}

// Throws nlohmann::json::exception for anything else.
inline TagDetection DetectionOf(const nlohmann::json& t) {
  TagDetection tag;
  tag.family = t.at(0);
  tag.id = t.at(1);
  tag.hamming = t.at(2);
  tag.margin = t.at(3);
  for (size_t k = 0; k < 4; ++k)
    tag.corners[k] = {t.at(4).at(2 * k).get<double>(), t.at(4).at(2 * k + 1).get<double>()};
  tag.corner_sigma_px = t.at(5);
  tag.refined = t.at(6);
  return tag;
}

}  // namespace trigpoint

// What to photograph next, from where, looking where.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/base/length_text.h"
#include "survey/field/findings.h"

namespace trigpoint {

struct Advice {
  LengthText what;                      // a sentence: what, from where, looking where
  std::string why;                      // "tag 57 is in no picture", "the tags' RMS sigma falls from 9.1 to 7.9 mm"
  std::optional<Eigen::Vector3d> from;  // where to stand, m, map frame
  std::optional<Eigen::Vector3d> at;    // what to look at
  std::optional<double> heading_rad;    // of that line of sight, clockwise from the map's y axis (north)
  double rms_after_m = 0;               // predicted RMS sigma of the tags; 0: something is missing, nothing to improve
};

// Most valuable first: what is missing altogether (tags in no picture, tags that stand twice, open rings, stretches
// where pictures in a row do not hang together, open loops), then walks from a well-known tag to a weak one, ranked by
// the accuracy that `survey` would state with them. At most `count`.
std::vector<Advice> WhatNext(const FieldFacts& facts, const NetworkOptions& options, size_t count, uint64_t seed,
                             int threads, const CancelToken& cancel);

// What stands in the place of advice where there is none. `green`: no finding asks for anything.
std::string NothingNext(const FieldFacts& facts, bool green);

// "north-east (47 deg)" of an angle clockwise from north.
std::string CompassText(double heading_rad);

}  // namespace trigpoint

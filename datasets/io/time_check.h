// Do the clocks of a run agree? Estimates what is left of the time offsets declared in run.yaml.
#pragma once

#include <optional>
#include <string>

#include "datasets/io/site.h"

namespace trigpoint {

struct TimeCheckOptions {
  double max_offset_s = 20;   // searched within +-this (at most a fifth of the run); GPS time - UTC is 18 s
  double min_report_s = 0.2;  // smaller contradictions are not worth a word: GPS has its own latency
  double sigmas = 4;          // a contradiction is this many standard deviations from zero
  double segment_s = 60;      // GPS and odometry are compared in pieces of this length, as odometry drifts
};

struct TimeOffset {
  bool observable = false;             // false: too little data, or a motion that shows no time (straight and even)
  double offset_s = 0;                 // to be added to the stamps of the sensor, on top of what run.yaml declares
  double sigma_s = 0;                  // 1 sigma
  std::optional<std::string> warning;  // names the run, the sensor, the offset found and the key to change
};

// GPS against odometry: the offset under which the fixes' paths fit the odometry's paths best. In every segment
// gps = a odometry + b in the plane of motion (a, b complex: turn, scale, shift) by least squares; the residuals'
// correlation in time widens sigma. `run.odometry` and `run.gps` as read. O(fixes * offsets).
TimeOffset CheckGpsTime(const Run& run, const TimeCheckOptions& options = {});

// Odometry against cameras: the offset under which the speeds of turning fit best; they need neither extrinsics nor
// a common frame. `frame_from_cam`: one camera's trajectory, the camera's own time shift added (BodyStamp).
TimeOffset CheckOdometryTime(const Run& run, const Trajectory& frame_from_cam, const TimeCheckOptions& options = {});

}  // namespace trigpoint

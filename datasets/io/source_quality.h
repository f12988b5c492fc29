// How good what sources of panoramas state is.
#pragma once

#include <string>

namespace trigpoint {

// 1 sigma per axis, where a source does not state it of each picture. What contributors' cameras and receivers are good
// for, not measured of these pictures: a run that localizes enough of them estimates the sigma anew.
struct SourceQuality {
  double h_m, v_m, heading_deg, tilt_deg;
  double outlier_share = 0.05;  // of positions that are wrong beyond that
};

// Of a source by its name in panoramas.csv ("panoramax"); null: none is stated, the table's own sigmas hold.
const SourceQuality* QualityOfSource(const std::string& source);

// Is it the name that an import gives to a picture of such a source: <service>-<id>.jpg?
bool IsPictureOfAService(const std::string& name);

}  // namespace trigpoint

// How lists of answers name the places where these are.
#pragma once

#include <map>
#include <set>
#include <string>

#include "eval/report/report_data.h"

namespace trigpoint {

// A station alone says which answer is meant only where it has one panorama.
class PlaceNames {
 public:
  PlaceNames() = default;
  explicit PlaceNames(const ReportData& data);

  bool HasSeveral(const std::string& station) const;
  // Of stations with several: station -> their panoramas.
  std::map<std::string, std::set<std::string>> Several() const;
  // Without its folder, unless another panorama of the station has the same file name.
  std::string PanoramaName(const std::string& station, const std::string& panorama) const;
  // "S57"; "S110 pano_110.jpg" where the station has several; without a station the panorama.
  std::string Name(const std::string& station, const std::string& panorama) const;

 private:
  std::map<std::string, std::set<std::string>> panoramas_;  // of each station
};

}  // namespace trigpoint

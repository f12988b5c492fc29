#include "datasets/io/source_quality.h"

#include <map>

namespace trigpoint {

const SourceQuality* QualityOfSource(const std::string& source) {
  static const std::map<std::string, SourceQuality> qualities = {
      // GPS of action cameras and phones on vehicles and helmets; headings mostly from the track.
      {"panoramax", {3, 20, 5, 4, 0.05}},
      {"mapillary", {3, 20, 5, 4, 0.05}},
      // A file does not state its source: the values of contributors' cameras hold.
      {"stac", {3, 20, 5, 4, 0.05}},
      // Phones; headings from the track.
      {"kartaview", {5, 20, 10, 4, 0.1}},
      // Vehicles with receivers and inertial sensors of their own; other people's panoramas among them are worse.
      {"google", {2, 20, 3, 1.5, 0.05}},
  };
  const auto it = qualities.find(source);
  return it == qualities.end() ? nullptr : &it->second;
}

bool IsPictureOfAService(const std::string& name) {
  const std::string service = name.substr(0, name.find('-'));
  return service.size() < name.size() && name.ends_with(".jpg") && QualityOfSource(service) != nullptr;
}

}  // namespace trigpoint

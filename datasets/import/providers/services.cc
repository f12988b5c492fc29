#include "datasets/import/providers/services.h"

#include <sys/stat.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>

#include "calib/base/error.h"
#include "datasets/io/text.h"

namespace trigpoint {

const std::vector<Service>& Services() {
  static const std::vector<Service> services = {
      {"panoramax", "https://api.panoramax.xyz/api", "", "open pictures of all Panoramax servers; no token", "",
       &OpenPanoramax},
      {"mapillary", "https://graph.mapillary.com", "MAPILLARY_ACCESS_TOKEN",
       "Mapillary; needs a client token of your own", "", &OpenMapillary},
      {"kartaview", "https://api.openstreetcam.org", "", "KartaView; no token", "", &OpenKartaView},
      {"google", "https://tile.googleapis.com/v1", "GOOGLE_MAPS_API_KEY",
       "Google Street View (Map Tiles API); needs a key of your own; kept for the session only",
       "Google's policies for the Map Tiles API forbid image analysis and machine interpretation of Street View, and "
       "keeping it",
       &OpenGoogleStreetView},
  };
  return services;
}

const Service* ServiceNamed(const std::string& name) {
  const auto alike = [](unsigned char a, unsigned char b) { return std::tolower(a) == std::tolower(b); };
  for (const Service& service : Services()) {
    if (std::equal(name.begin(), name.end(), service.name.begin(), service.name.end(), alike)) return &service;
  }
  return nullptr;
}

std::string ReadToken(const Service& service, const std::string& file) {
  if (service.token_env.empty()) {
    if (!file.empty()) throw OptionError("--token-file: " + service.name + " needs no token");
    return "";
  }
  std::string token, from = "the environment variable " + service.token_env;
  if (!file.empty()) {
    from = file;
    struct stat status {};
    if (stat(file.c_str(), &status) != 0) throw InputError(file + ": there is no such file");
    if ((status.st_mode & 077) != 0) {
      throw InputError(file + ": others can read this token; protect it: chmod 600 " + file);
    }
    token = Trim(ReadTextFile(file));
  } else if (const char* value = std::getenv(service.token_env.c_str())) {
    token = Trim(value);
  }
  if (token.empty()) {
    throw InputError(service.name + " needs a token: set " + service.token_env +
                     ", or put it into a file of mode 0600 and name that with --token-file");
  }
  if (token.size() > 4096 || token.find_first_of(" \t\r\n") != std::string::npos) {
    throw InputError(from + ": expected one token without spaces");
  }
  return token;
}

}  // namespace trigpoint

// Services that have panoramas, by the documentation they publish of their interfaces.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "datasets/import/panorama_provider.h"
#include "datasets/import/providers/http_client.h"

namespace trigpoint {

struct ServiceOptions {
  std::string url;    // of the service; empty: its public one
  std::string token;  // of those that need one
  HttpOptions http;
};

struct Service {
  std::string name;       // "panoramax"
  std::string url;        // its public address
  std::string token_env;  // the environment's name of the token; empty: none is needed
  std::string help;       // one line
  // Why pictures are imported only where the user states to be permitted to; empty: anybody may.
  std::string permission;
  std::unique_ptr<PanoramaProvider> (*open)(const ServiceOptions& options);
};
const std::vector<Service>& Services();
const Service* ServiceNamed(const std::string& name);  // in any case; null: none

// The token of a service: `file` if it is named, which nobody but its owner may read (mode 0600), else from the
// environment. Throws InputError or OptionError; the token itself is in no message.
std::string ReadToken(const Service& service, const std::string& file);

// A file of STAC items, whose pictures lie below its folder or at http(s) addresses. Those that state another field of
// view than 360 deg are left out. Throws InputError if the file is none.
std::unique_ptr<PanoramaProvider> OpenStacFile(const std::filesystem::path& file);
bool IsStacFile(const std::filesystem::path& file);
// Google Street View by the Map Tiles API; for the session only.
std::unique_ptr<PanoramaProvider> OpenGoogleStreetView(const ServiceOptions& options);
// STAC items of a Panoramax server. Pictures of 360 deg alone.
std::unique_ptr<PanoramaProvider> OpenPanoramax(const ServiceOptions& options);
// Mapillary's Graph API, version 4; panoramas alone.
std::unique_ptr<PanoramaProvider> OpenMapillary(const ServiceOptions& options);
// KartaView's API, version 2.0; photos that are spheres alone.
std::unique_ptr<PanoramaProvider> OpenKartaView(const ServiceOptions& options);

}  // namespace trigpoint

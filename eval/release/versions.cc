#include "eval/release/versions.h"

#include <GeographicLib/Config.h>
#include <ceres/version.h>
#include <fmt/core.h>
#include <openssl/crypto.h>
#include <sqlite3.h>
#include <sys/utsname.h>

#include <Eigen/Core>
#include <fstream>
#include <opencv2/core/version.hpp>
#include <string>

#ifdef TRIGPOINT_HAVE_PROJ
#include <proj.h>
#endif

namespace trigpoint {
namespace {

// The value behind "KEY" in a file of lines "KEY<separator>VALUE", without quotes.
std::string ValueIn(const char* file, const std::string& key, char separator) {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with(key)) continue;
    size_t begin = line.find(separator);
    if (begin == std::string::npos) continue;
    begin = line.find_first_not_of(" \t\"", begin + 1);
    const size_t end = line.find_last_not_of(" \t\"");
    return begin == std::string::npos ? "" : line.substr(begin, end - begin + 1);
  }
  return "";
}

}  // namespace

nlohmann::json ProgramVersions() {
  utsname system{};
  uname(&system);
  nlohmann::json versions = {
      {"trigpoint", TRIGPOINT_VERSION},
      {"compiler", __VERSION__},
      {"system", ValueIn("/etc/os-release", "PRETTY_NAME", '=') + ", " + system.sysname + " " + system.release},
      {"architecture", system.machine},
      {"processor", ValueIn("/proc/cpuinfo", "model name", ':')},
      {"libraries",
       {{"Ceres", CERES_VERSION_STRING},
        {"Eigen", fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
        {"GeographicLib", GEOGRAPHICLIB_VERSION_STRING},
        {"OpenCV", CV_VERSION},
        {"OpenSSL", OpenSSL_version(OPENSSL_VERSION)},
        {"SQLite", sqlite3_libversion()}}}};
#ifdef TRIGPOINT_HAVE_PROJ
  versions["libraries"]["PROJ"] = proj_info().version;
#endif
  return versions;
}

}  // namespace trigpoint

// Against GeographicLib's own command line, on 10,000 random points.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "calib/estimation/random.h"
#include "calib/geo/geodetic.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

std::vector<Geodetic> Places() {
  Random random(20260512);
  std::vector<Geodetic> places;
  for (int i = 0; i < 10'000; ++i) {
    places.push_back({160 * random.Uniform() - 80, 360 * random.Uniform() - 180, 9000 * random.Uniform() - 500});
  }
  return places;
}

// The program's answer, a line for each place.
std::vector<std::string> Ask(const std::string& command, const std::vector<Geodetic>& places, bool height) {
  const TempDir dir;
  const std::string file = (dir / "places").string();
  {
    std::ofstream out(file);
    out.precision(15);
    for (const Geodetic& g : places) {
      out << g.latitude_deg << ' ' << g.longitude_deg;
      if (height) out << ' ' << g.height_m;
      out << '\n';
    }
  }
  EXPECT_EQ(std::system((command + " < " + file + " > " + file + ".out").c_str()), 0);
  std::vector<std::string> lines;
  std::ifstream in(file + ".out");
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

bool Missing(const char* program) {
  return std::system(("command -v " + std::string(program) + " >/dev/null 2>&1").c_str()) != 0;
}

TEST(GeodeticPrograms, UtmAsGeoConvert) {
  if (Missing("GeoConvert")) GTEST_SKIP() << "geographiclib-tools is not installed";
  const auto places = Places();
  const auto lines = Ask("GeoConvert -u -p 6", places, false);
  ASSERT_EQ(lines.size(), places.size());
  double worst = 0;
  for (size_t i = 0; i < places.size(); ++i) {
    std::istringstream in(lines[i]);
    std::string zone;
    double easting = 0, northing = 0;
    in >> zone >> easting >> northing;
    const Utm utm = UtmFromGeodetic(places[i]);
    ASSERT_EQ(std::to_string(utm.zone) + (utm.north ? "n" : "s"), std::to_string(std::stoi(zone)) + zone.back());
    worst = std::max(worst, std::hypot(utm.easting_m - easting, utm.northing_m - northing));
    const Geodetic back = GeodeticFromUtm(utm, 0);
    ASSERT_NEAR(back.latitude_deg, places[i].latitude_deg, 1e-10);
  }
  EXPECT_LT(worst, 2e-6);
}

TEST(GeodeticPrograms, EcefAndLocalFrameAsCartConvert) {
  if (Missing("CartConvert")) GTEST_SKIP() << "geographiclib-tools is not installed";
  const auto places = Places();
  const Geodetic origin{48.0125518, 7.8322567, 240};
  const LocalFrame frame(origin);
  const auto ecef = Ask("CartConvert -p 6", places, true);
  const auto local = Ask("CartConvert -l 48.0125518 7.8322567 240 -p 6", places, true);
  ASSERT_EQ(ecef.size(), places.size());
  ASSERT_EQ(local.size(), places.size());
  double worst = 0;
  for (size_t i = 0; i < places.size(); ++i) {
    Eigen::Vector3d e, l;
    std::istringstream(ecef[i]) >> e.x() >> e.y() >> e.z();
    std::istringstream(local[i]) >> l.x() >> l.y() >> l.z();
    worst = std::max({worst, (EcefFromGeodetic(places[i]) - e).norm(), (frame.EnuFromGeodetic(places[i]) - l).norm()});
  }
  EXPECT_LT(worst, 3e-6);
}

}  // namespace
}  // namespace trigpoint

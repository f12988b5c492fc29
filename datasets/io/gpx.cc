#include <expat.h>

#include <cmath>
#include <cstring>
#include <memory>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "datasets/io/gps.h"
#include "datasets/io/gps_order.h"
#include "datasets/io/readable.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

struct Parser {
  XML_Parser xml = nullptr;
  bool saw_gpx = false, in_point = false;
  std::string latitude, longitude, height, geoid, time, text;
  int line = 0;
  std::vector<GpsFix> fixes;  // stamps in UTC
  int points = 0, other_points = 0, no_time = 0, no_geoid = 0;
  struct Skipped {
    int count = 0, line = 0;  // line and text of the first
    std::string found;
  } times, places;
};

// Without the prefix of a namespace, in lower case: programs differ in both.
std::string LocalName(const char* name) {
  const char* colon = std::strrchr(name, ':');
  return LowerCase(colon == nullptr ? name : colon + 1);
}

void OnStart(void* data, const char* name, const char** attributes) {
  Parser& p = *static_cast<Parser*>(data);
  p.text.clear();
  const std::string local = LocalName(name);
  if (local == "gpx") p.saw_gpx = true;
  if (local == "wpt" || local == "rtept") ++p.other_points;
  if (local != "trkpt") return;
  ++p.points;
  p.in_point = true;
  p.latitude = p.longitude = p.height = p.geoid = p.time = "";
  p.line = static_cast<int>(XML_GetCurrentLineNumber(p.xml));
  for (; *attributes != nullptr; attributes += 2) {
    const std::string attribute = LocalName(attributes[0]);
    if (attribute == "lat") p.latitude = attributes[1];
    if (attribute == "lon") p.longitude = attributes[1];
  }
}

void OnText(void* data, const char* text, int length) {
  static_cast<Parser*>(data)->text.append(text, static_cast<size_t>(length));
}

void FinishPoint(Parser* p) {
  const auto latitude = ParseDouble(p->latitude), longitude = ParseDouble(p->longitude);
  const auto time = ParseUtcToNs(p->time);
  if (p->time.empty()) {
    ++p->no_time;
    return;
  }
  const auto skip = [&](Parser::Skipped* skipped, const std::string& found) {
    if (skipped->count++ > 0) return;
    skipped->line = p->line;
    skipped->found = Excerpt(found);
  };
  if (!time) return skip(&p->times, p->time);
  if (!latitude || !longitude || !(std::abs(*latitude) <= 90) || !(std::abs(*longitude) <= 180)) {
    return skip(&p->places, p->latitude + ", " + p->longitude);
  }
  GpsFix fix;
  fix.stamp_ns = *time;
  fix.position = {*latitude, *longitude, 0};
  const auto height = ParseDouble(p->height), geoid = ParseDouble(p->geoid);
  if (height && geoid) {
    fix.position.height_m = *height + *geoid;
  } else if (height) {
    fix.position.height_m = *height;
    CountFromSea(&fix);
    ++p->no_geoid;
  } else {
    fix.sigma_v_m = kUnknownHeightSigma;
  }
  p->fixes.push_back(fix);
}

void OnEnd(void* data, const char* name) {
  Parser& p = *static_cast<Parser*>(data);
  const std::string local = LocalName(name);
  if (p.in_point) {
    const std::string content(Trim(p.text));
    if (local == "ele") p.height = content;
    if (local == "geoidheight") p.geoid = content;
    if (local == "time") p.time = content;
    if (local == "trkpt") {
      FinishPoint(&p);
      p.in_point = false;
    }
  }
  p.text.clear();
}

}  // namespace

GpsTrack ReadGpx(const std::filesystem::path& file, const RunClock& clock) {
  const std::string text = ReadTextFile(file);
  if (Trim(text).empty()) throw InputError(file.string() + ": expected a GPX file, found an empty one");
  Parser parser;
  const std::unique_ptr<XML_ParserStruct, decltype(&XML_ParserFree)> xml(XML_ParserCreate(nullptr), &XML_ParserFree);
  parser.xml = xml.get();
  XML_SetUserData(xml.get(), &parser);
  XML_SetElementHandler(xml.get(), &OnStart, &OnEnd);
  XML_SetCharacterDataHandler(xml.get(), &OnText);
  GpsTrack track;
  if (XML_Parse(xml.get(), text.data(), static_cast<int>(text.size()), 1) != XML_STATUS_OK) {
    const std::string problem = FileLine(file, static_cast<int>(XML_GetCurrentLineNumber(xml.get()))) +
                                ": not valid XML: " + XML_ErrorString(XML_GetErrorCode(xml.get()));
    if (parser.fixes.empty()) throw InputError(problem);
    track.warnings.push_back(problem + "; the points before are used");
  }
  if (!parser.saw_gpx) throw InputError(file.string() + ": expected a GPX file, found other XML");
  if (parser.points == 0) {
    throw InputError(file.string() + ": expected track points (trkpt), found none" +
                     (parser.other_points > 0 ? ", but " + Counted(parser.other_points, "way or route point") +
                                                    ", which have no times of a drive; export the recorded track"
                                              : "; is the track empty?"));
  }
  const auto warn = [&](int count, const std::string& what) {
    if (count > 0) track.warnings.push_back(file.string() + ": " + Counted(count, "track point") + " " + what);
  };
  warn(parser.no_time, "without a time skipped");
  const auto warn_of = [&](const Parser::Skipped& skipped, const std::string& expected) {
    if (skipped.count == 0) return;
    track.warnings.push_back(FileLine(file, skipped.line) + ": expected " + expected + ", found '" + skipped.found +
                             "'; " + Counted(skipped.count, "such track point") + " skipped");
  };
  warn_of(parser.times, "a time as 2026-05-12T09:43:20Z");
  warn_of(parser.places, "lat and lon in degrees");
  warn(parser.no_geoid, "without geoid height; heights above the sea share an error of 50 m (1 sigma)");
  track.fixes = std::move(parser.fixes);
  for (GpsFix& fix : track.fixes) fix.stamp_ns -= clock.time_zero_utc_ns.value_or(0);
  PutFixesInOrder(file, &track);
  return track;
}

}  // namespace trigpoint

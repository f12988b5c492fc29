#include <expat.h>

#include <cstring>
#include <memory>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "datasets/io/gps.h"
#include "datasets/io/gps_order.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

struct Parser {
  XML_Parser xml = nullptr;
  bool saw_gpx = false, in_point = false;
  std::string latitude, longitude, height, geoid, time, text;
  int line = 0;
  std::vector<GpsFix> fixes;  // stamps in UTC
  int bad = 0, no_time = 0, no_geoid = 0, first_bad_line = 0;
};

std::string_view LocalName(const char* name) {
  const char* colon = std::strrchr(name, ':');
  return colon == nullptr ? name : colon + 1;
}

void OnStart(void* data, const char* name, const char** attributes) {
  Parser& p = *static_cast<Parser*>(data);
  p.text.clear();
  const std::string_view local = LocalName(name);
  if (local == "gpx") p.saw_gpx = true;
  if (local != "trkpt") return;
  p.in_point = true;
  p.latitude = p.longitude = p.height = p.geoid = p.time = "";
  p.line = static_cast<int>(XML_GetCurrentLineNumber(p.xml));
  for (; *attributes != nullptr; attributes += 2) {
    if (std::string_view(attributes[0]) == "lat") p.latitude = attributes[1];
    if (std::string_view(attributes[0]) == "lon") p.longitude = attributes[1];
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
  if (!latitude || !longitude || !time || !(std::abs(*latitude) <= 90) || !(std::abs(*longitude) <= 180)) {
    if (p->bad++ == 0) p->first_bad_line = p->line;
    return;
  }
  GpsFix fix;
  fix.stamp_ns = *time;
  fix.position = {*latitude, *longitude, 0};
  const auto height = ParseDouble(p->height), geoid = ParseDouble(p->geoid);
  if (height && geoid) {
    fix.position.height_m = *height + *geoid;
  } else if (height) {
    fix.position.height_m = *height;
    fix.sigma_v_m = kUnknownGeoidSigma;
    ++p->no_geoid;
  } else {
    fix.sigma_v_m = kUnknownHeightSigma;
  }
  p->fixes.push_back(fix);
}

void OnEnd(void* data, const char* name) {
  Parser& p = *static_cast<Parser*>(data);
  const std::string_view local = LocalName(name);
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
  const auto warn = [&](int count, const std::string& what) {
    if (count > 0) track.warnings.push_back(file.string() + ": " + Counted(count, "track point") + " " + what);
  };
  warn(parser.no_time, "without a time skipped");
  warn(parser.bad,
       "with an unreadable position or time skipped, the first on line " + std::to_string(parser.first_bad_line));
  warn(parser.no_geoid, "without geoid height; heights above the sea are kept with a sigma of 50 m");
  track.fixes = std::move(parser.fixes);
  for (GpsFix& fix : track.fixes) fix.stamp_ns -= clock.time_zero_utc_ns.value_or(0);
  PutFixesInOrder(file, &track);
  return track;
}

}  // namespace trigpoint

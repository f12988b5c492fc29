#include <algorithm>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "datasets/io/gps.h"
#include "datasets/io/gps_order.h"
#include "datasets/io/lines.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

constexpr int64_t kDayNs = int64_t{86400} * 1'000'000'000;

// Fields between '$' and '*', or nothing if the checksum is wrong. A sentence without one is taken as it is.
std::optional<std::vector<std::string_view>> Sentence(std::string_view line) {
  line.remove_prefix(line.find('$') + 1);
  const size_t star = line.find('*');
  const std::string_view body = line.substr(0, star);
  if (star != std::string_view::npos) {
    unsigned char sum = 0;
    for (char c : body) sum = static_cast<unsigned char>(sum ^ static_cast<unsigned char>(c));
    unsigned stated = 256;
    const std::string_view hex = line.substr(star + 1, 2);
    if (hex.size() == 2) {
      stated = 0;
      for (char c : hex) {
        const size_t value = std::string_view("0123456789ABCDEFabcdef").find(c);
        stated =
            value == std::string_view::npos ? 256 : stated * 16 + static_cast<unsigned>(value < 16 ? value : value - 6);
      }
    }
    if (stated != sum) return std::nullopt;
  }
  std::vector<std::string_view> fields;
  for (size_t at = 0; at <= body.size();) {
    const size_t end = std::min(body.find(',', at), body.size());
    fields.push_back(Trim(body.substr(at, end - at)));
    at = end + 1;
  }
  return fields;
}

// hhmmss.sss as ns since midnight.
std::optional<int64_t> TimeOfDay(std::string_view text) {
  const auto value = ParseDouble(text);
  if (!value || *value < 0 || text.size() < 6) return std::nullopt;
  const auto hour = ParseInt(text.substr(0, 2)), minute = ParseInt(text.substr(2, 2));
  const auto second = ParseDouble(text.substr(4));
  if (!hour || !minute || !second || *hour > 23 || *minute > 59 || *second >= 61) return std::nullopt;
  return (*hour * 3600 + *minute * 60) * 1'000'000'000 + std::llround(*second * 1e9);
}

// ddmm.mmmm and a hemisphere as degrees.
std::optional<double> Angle(std::string_view text, std::string_view hemisphere) {
  const auto value = ParseDouble(text);
  if (!value || hemisphere.empty()) return std::nullopt;
  const double degrees = std::floor(*value / 100);
  const double angle = degrees + (*value - 100 * degrees) / 60;
  return hemisphere == "S" || hemisphere == "W" ? -angle : angle;
}

std::optional<int64_t> DayNs(int year, std::string_view month, std::string_view day) {
  return ParseUtcToNs(std::to_string(year) + "-" + std::string(month) + "-" + std::string(day));
}

struct Entry {
  GpsFix fix;       // stamp_ns: time of day
  int64_t day = 0;  // counted from the file's first day
};

}  // namespace

GpsTrack ReadNmea(const std::filesystem::path& file, const RunClock& clock) {
  GpsTrack track;
  const std::string text = ReadTextFile(file);
  std::vector<Entry> entries;
  std::map<int64_t, std::pair<double, double>> sigmas;  // by time of day (of the day counter's day)
  std::optional<int64_t> first_day_ns;                  // midnight, UTC, of day 0
  int64_t day = 0, last_time = -1;
  size_t dated_entries = 0;  // those before the last sentence with a date
  int bad_checksum = 0, no_fix = 0, malformed = 0, no_geoid = 0, sentences = 0;
  int first_bad_line = 0;

  // A step back by more than half a day is midnight.
  const auto advance = [&](int64_t time) {
    if (last_time >= 0 && time < last_time - kDayNs / 2) ++day;
    if (last_time >= 0 && time > last_time + kDayNs / 2 && day > 0) --day;
    last_time = time;
  };
  const auto anchor = [&](int64_t time, int64_t date_ns) {
    advance(time);
    if (!first_day_ns) first_day_ns = date_ns - day * kDayNs;
    const size_t dated = std::exchange(dated_entries, entries.size());
    const int64_t told = (date_ns - *first_day_ns) / kDayNs;
    if (told == day) return;
    // A file put together from several days: the epoch's GGA may stand before its date.
    for (size_t i = entries.size(); i > dated && entries[i - 1].fix.stamp_ns == time; --i) entries[i - 1].day = told;
    day = told;
  };

  int number = 0;
  for (const std::string_view whole : Lines(text)) {
    ++number;
    const std::string_view line = Trim(whole);
    if (line.find('$') == std::string_view::npos) continue;
    ++sentences;
    const auto fields = Sentence(line);
    if (!fields) {
      if (bad_checksum++ == 0) first_bad_line = number;
      continue;
    }
    const std::vector<std::string_view>& f = *fields;
    if (f[0].size() < 5) continue;
    const std::string_view kind = f[0].substr(f[0].size() - 3);
    if (kind == "GGA" && f.size() >= 12) {
      const auto time = TimeOfDay(f[1]);
      const auto latitude = Angle(f[2], f[3]), longitude = Angle(f[4], f[5]);
      const int64_t quality = ParseInt(f[6]).value_or(0);
      if (quality == 0) {
        ++no_fix;
        continue;
      }
      if (!time || !latitude || !longitude || std::abs(*latitude) > 90 || std::abs(*longitude) > 180) {
        ++malformed;
        continue;
      }
      advance(*time);
      Entry entry;
      entry.day = day;
      entry.fix.stamp_ns = *time;
      entry.fix.position = {*latitude, *longitude, 0};
      if (quality == 4) entry.fix.sigma_h_m = 0.02, entry.fix.sigma_v_m = 0.04;
      if (quality == 5) entry.fix.sigma_h_m = 0.3, entry.fix.sigma_v_m = 0.5;
      const auto above_sea = ParseDouble(f[9]), separation = ParseDouble(f[11]);
      if (above_sea && separation) {
        entry.fix.position.height_m = *above_sea + *separation;
      } else if (above_sea) {
        entry.fix.position.height_m = *above_sea;
        entry.fix.sigma_v_m = kUnknownGeoidSigma;
        ++no_geoid;
      } else {
        entry.fix.sigma_v_m = kUnknownHeightSigma;
      }
      entries.push_back(entry);
    } else if (kind == "RMC" && f.size() >= 10) {
      const auto time = TimeOfDay(f[1]);
      if (f[2] != "A" || !time || f[9].size() != 6) continue;
      const auto year = ParseInt(f[9].substr(4, 2));
      if (!year) continue;
      const auto date =
          DayNs(static_cast<int>(*year < 80 ? 2000 + *year : 1900 + *year), f[9].substr(2, 2), f[9].substr(0, 2));
      if (date) anchor(*time, *date);
    } else if (kind == "ZDA" && f.size() >= 5) {
      const auto time = TimeOfDay(f[1]);
      const auto year = ParseInt(f[4]);
      const auto date = year ? DayNs(static_cast<int>(*year), f[3], f[2]) : std::nullopt;
      if (time && date) anchor(*time, *date);
    } else if (kind == "GST" && f.size() >= 9) {
      const auto time = TimeOfDay(f[1]);
      const auto n = ParseDouble(f[6]), e = ParseDouble(f[7]), u = ParseDouble(f[8]);
      if (!time || !n || !e || !u || *u <= 0 || std::hypot(*n, *e) <= 0) continue;
      advance(*time);
      sigmas[day * kDayNs + *time] = {std::hypot(*n, *e) / std::sqrt(2.0), *u};
    }
  }
  if (sentences == 0) throw InputError(file.string() + ": no NMEA sentence ('$GPGGA,...') in it");
  const auto warn = [&](int count, const std::string& one, const std::string& what, const std::string& many = "") {
    if (count > 0) track.warnings.push_back(file.string() + ": " + Counted(count, one, many) + " " + what);
  };
  warn(bad_checksum, "sentence", "with a wrong checksum skipped, the first on line " + std::to_string(first_bad_line));
  warn(malformed, "GGA sentence", "without a readable time and position skipped");
  warn(no_fix, "GGA sentence", "without a fix");
  warn(no_geoid, "fix", "without geoid separation; heights above the sea get a sigma of 50 m", "fixes");
  if (!first_day_ns && !clock.date.empty()) first_day_ns = ParseUtcToNs(clock.date.substr(0, 10));
  if (!first_day_ns && clock.time_zero_utc_ns) {
    first_day_ns = *clock.time_zero_utc_ns - ((*clock.time_zero_utc_ns % kDayNs) + kDayNs) % kDayNs;
  }
  if (!first_day_ns && !entries.empty()) {
    throw InputError(file.string() +
                     ": no RMC or ZDA sentence states the date; give 'date: YYYY-MM-DD' (UTC) in run.yaml");
  }
  for (const Entry& entry : entries) {
    GpsFix fix = entry.fix;
    const auto sigma = sigmas.find(entry.day * kDayNs + fix.stamp_ns);
    if (sigma != sigmas.end()) {
      fix.sigma_h_m = sigma->second.first;
      if (fix.sigma_v_m < kUnknownGeoidSigma) fix.sigma_v_m = sigma->second.second;
    }
    fix.stamp_ns += *first_day_ns + entry.day * kDayNs - clock.time_zero_utc_ns.value_or(0);
    track.fixes.push_back(fix);
  }
  PutFixesInOrder(file, &track);
  return track;
}

}  // namespace trigpoint

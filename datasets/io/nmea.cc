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
  return SplitAt(body, ',');
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

// What the sentences of a file say, before the day is known.
class NmeaSentences {
 public:
  void Add(std::string_view line, int number);
  // Throws InputError where nothing is a sentence or no date is known.
  GpsTrack Track(const std::filesystem::path& file, const RunClock& clock) const;

 private:
  using Fields = std::vector<std::string_view>;
  void AddFix(const Fields& f);
  void AddSigmas(const Fields& f);
  void Advance(int64_t time);
  void Anchor(int64_t time, int64_t date_ns);
  std::vector<std::string> Warnings(const std::string& file) const;

  std::vector<Entry> entries_;
  std::map<int64_t, std::pair<double, double>> sigmas_;  // horizontal, vertical; by day_ and time of day
  std::optional<int64_t> first_day_ns_;                  // midnight, UTC, of day 0
  int64_t day_ = 0, last_time_ = -1;
  size_t dated_entries_ = 0;  // those before the last sentence with a date
  int bad_checksum_ = 0, no_fix_ = 0, malformed_ = 0, no_geoid_ = 0, sentences_ = 0;
  int first_bad_line_ = 0;
};

// A step back by more than half a day is midnight.
void NmeaSentences::Advance(int64_t time) {
  if (last_time_ >= 0 && time < last_time_ - kDayNs / 2) ++day_;
  if (last_time_ >= 0 && time > last_time_ + kDayNs / 2 && day_ > 0) --day_;
  last_time_ = time;
}

void NmeaSentences::Anchor(int64_t time, int64_t date_ns) {
  Advance(time);
  if (!first_day_ns_) first_day_ns_ = date_ns - day_ * kDayNs;
  const size_t dated = std::exchange(dated_entries_, entries_.size());
  const int64_t stated = (date_ns - *first_day_ns_) / kDayNs;
  if (stated == day_) return;
  // A file put together from several days: the epoch's GGA may stand before its date.
  for (size_t i = entries_.size(); i > dated && entries_[i - 1].fix.stamp_ns == time; --i) entries_[i - 1].day = stated;
  day_ = stated;
}

// A GGA sentence.
void NmeaSentences::AddFix(const Fields& f) {
  const auto time = TimeOfDay(f[1]);
  const auto latitude = Angle(f[2], f[3]), longitude = Angle(f[4], f[5]);
  const int64_t quality = ParseInt(f[6]).value_or(0);
  if (quality == 0) {
    ++no_fix_;
    return;
  }
  if (!time || !latitude || !longitude || std::abs(*latitude) > 90 || std::abs(*longitude) > 180) {
    ++malformed_;
    return;
  }
  Advance(*time);
  Entry entry;
  entry.day = day_;
  entry.fix.stamp_ns = *time;
  entry.fix.position = {*latitude, *longitude, 0};
  if (quality == 4) entry.fix.sigma_h_m = 0.02, entry.fix.sigma_v_m = 0.04;
  if (quality == 5) entry.fix.sigma_h_m = 0.3, entry.fix.sigma_v_m = 0.5;
  const auto above_sea = ParseDouble(f[9]), separation = ParseDouble(f[11]);
  if (above_sea && separation) {
    entry.fix.position.height_m = *above_sea + *separation;
  } else if (above_sea) {
    entry.fix.position.height_m = *above_sea;
    CountFromSea(&entry.fix);
    ++no_geoid_;
  } else {
    entry.fix.sigma_v_m = kUnknownHeightSigma;
  }
  entries_.push_back(entry);
}

// A GST sentence.
void NmeaSentences::AddSigmas(const Fields& f) {
  const auto time = TimeOfDay(f[1]);
  const auto n = ParseDouble(f[6]), e = ParseDouble(f[7]), u = ParseDouble(f[8]);
  if (!time || !n || !e || !u || *u <= 0 || std::hypot(*n, *e) <= 0) return;
  Advance(*time);
  sigmas_[day_ * kDayNs + *time] = {std::hypot(*n, *e) / std::sqrt(2.0), *u};
}

void NmeaSentences::Add(std::string_view line, int number) {
  if (line.find('$') == std::string_view::npos) return;
  ++sentences_;
  const auto fields = Sentence(line);
  if (!fields) {
    if (bad_checksum_++ == 0) first_bad_line_ = number;
    return;
  }
  const Fields& f = *fields;
  if (f[0].size() < 5) return;
  const std::string_view kind = f[0].substr(f[0].size() - 3);
  if (kind == "GGA" && f.size() >= 12) {
    AddFix(f);
  } else if (kind == "RMC" && f.size() >= 10) {
    const auto time = TimeOfDay(f[1]);
    if (f[2] != "A" || !time || f[9].size() != 6) return;
    const auto year = ParseInt(f[9].substr(4, 2));
    if (!year) return;
    const int full_year = static_cast<int>(*year < 80 ? 2000 + *year : 1900 + *year);
    const auto date = DayNs(full_year, f[9].substr(2, 2), f[9].substr(0, 2));
    if (date) Anchor(*time, *date);
  } else if (kind == "ZDA" && f.size() >= 5) {
    const auto time = TimeOfDay(f[1]);
    const auto year = ParseInt(f[4]);
    const auto date = year ? DayNs(static_cast<int>(*year), f[3], f[2]) : std::nullopt;
    if (time && date) Anchor(*time, *date);
  } else if (kind == "GST" && f.size() >= 9) {
    AddSigmas(f);
  }
}

std::vector<std::string> NmeaSentences::Warnings(const std::string& file) const {
  std::vector<std::string> warnings;
  const auto warn = [&](int count, const std::string& one, const std::string& what, const std::string& many = "") {
    if (count > 0) warnings.push_back(file + ": " + Counted(count, one, many) + " " + what);
  };
  warn(bad_checksum_, "sentence",
       "with a wrong checksum skipped, the first on line " + std::to_string(first_bad_line_));
  warn(malformed_, "GGA sentence", "without a readable time and position skipped");
  warn(no_fix_, "GGA sentence", "without a fix");
  warn(no_geoid_, "fix", "without geoid separation; heights above the sea share an error of 50 m (1 sigma)", "fixes");
  return warnings;
}

GpsTrack NmeaSentences::Track(const std::filesystem::path& file, const RunClock& clock) const {
  if (sentences_ == 0) throw InputError(file.string() + ": no NMEA sentence ('$GPGGA,...') in it");
  GpsTrack track;
  track.warnings = Warnings(file.string());
  std::optional<int64_t> first_day_ns = first_day_ns_;
  if (!first_day_ns && !clock.date.empty()) first_day_ns = ParseUtcToNs(clock.date.substr(0, 10));
  if (!first_day_ns && clock.time_zero_utc_ns) {
    first_day_ns = *clock.time_zero_utc_ns - ((*clock.time_zero_utc_ns % kDayNs) + kDayNs) % kDayNs;
  }
  if (!first_day_ns && !entries_.empty()) {
    throw InputError(file.string() +
                     ": no RMC or ZDA sentence states the date; give 'date: YYYY-MM-DD' (UTC) in run.yaml");
  }
  for (const Entry& entry : entries_) {
    GpsFix fix = entry.fix;
    const auto sigma = sigmas_.find(entry.day * kDayNs + fix.stamp_ns);
    if (sigma != sigmas_.end()) {
      fix.sigma_h_m = sigma->second.first;
      if (fix.sigma_v_m < kUnknownHeightSigma) fix.sigma_v_m = std::hypot(sigma->second.second, fix.sigma_sea_m);
    }
    fix.stamp_ns += *first_day_ns + entry.day * kDayNs - clock.time_zero_utc_ns.value_or(0);
    track.fixes.push_back(fix);
  }
  return track;
}

}  // namespace

GpsTrack ReadNmea(const std::filesystem::path& file, const RunClock& clock) {
  const std::string text = ReadTextFile(file);
  NmeaSentences sentences;
  int number = 0;
  for (const std::string_view line : Lines(text)) sentences.Add(Trim(line), ++number);
  GpsTrack track = sentences.Track(file, clock);
  PutFixesInOrder(file, &track);
  return track;
}

}  // namespace trigpoint

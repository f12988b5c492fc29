#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cmath>
#include <fstream>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "datasets/import/made_files.h"
#include "datasets/import/panorama_provider.h"
#include "datasets/import/panorama_table.h"
#include "datasets/import/providers/http_client.h"
#include "datasets/io/capture_date.h"
#include "datasets/io/expired_panoramas.h"
#include "datasets/io/readable.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

// Does a date as 2024-05-12... lie in the range, compared as far as its ends say?
bool IsBetween(const std::string& date, const std::string& since, const std::string& until) {
  if (date.empty()) return since.empty() && until.empty();
  return date.substr(0, since.size()) >= since && (until.empty() || date.substr(0, until.size()) <= until);
}

// 2024, 2024-05 or 2024-05-12, of the calendar?
bool IsDate(const std::string& text) {
  constexpr std::string_view kForm = "dddd-dd-dd";
  if (text.size() != 4 && text.size() != 7 && text.size() != kForm.size()) return false;
  for (size_t i = 0; i < text.size(); ++i) {
    if (kForm[i] == 'd' ? std::isdigit(static_cast<unsigned char>(text[i])) == 0 : text[i] != kForm[i]) return false;
  }
  const auto part = [&](size_t at) {
    return text.size() > at ? static_cast<unsigned>(*ParseInt(text.substr(at, 2))) : 1U;
  };
  return std::chrono::year_month_day(std::chrono::year(static_cast<int>(*ParseInt(text.substr(0, 4)))),
                                     std::chrono::month(part(5)), std::chrono::day(part(8)))
      .ok();
}

std::map<std::string, std::string> RowOf(const PanoramaRecord& record, const PanoramaProvider& provider,
                                         const std::string& file, std::optional<int64_t> keep_until_s) {
  const SourceQuality sigmas = provider.Sigmas();
  const auto number = [](double value, int decimals) { return fmt::format("{:.{}f}", value, decimals); };
  const auto optional = [&](const std::optional<double>& value) { return value ? number(*value, 4) : std::string(); };
  return {{"file", file},
          {"station", record.id},
          {"latitude_deg", number(record.position.latitude_deg, 9)},
          {"longitude_deg", number(record.position.longitude_deg, 9)},
          {"height_m", record.has_height ? number(record.position.height_m, 3) : ""},
          {"heading_deg", optional(record.heading_deg)},
          {"pitch_deg", optional(record.pitch_deg)},
          {"roll_deg", optional(record.roll_deg)},
          {"sigma_h_m", number(record.sigma_h_m.value_or(sigmas.h_m), 3)},
          {"sigma_v_m", number(sigmas.v_m, 3)},
          {"sigma_heading_deg", number(sigmas.heading_deg, 3)},
          {"sigma_tilt_deg", number(sigmas.tilt_deg, 3)},
          {"source", provider.Name()},
          {"captured_at", record.date},
          {"licence", record.licence},
          {"attribution", record.attribution},
          {"keep_until", keep_until_s ? UtcOfSeconds(*keep_until_s) : ""}};
}

std::string NameOf(const PanoramaProvider& provider, const PanoramaRecord& record) {
  return "panoramas/" + provider.Prefix() + record.id + ".jpg";
}

// Begins the JPEG comment of a narrowed picture; its width follows. The source may have a wider one.
constexpr std::string_view kNarrowed = "trigpoint: narrowed to px ";

// `width`: what was asked for, px; 0: as the source has it.
void WritePicture(const PanoramaPicture& picture, int width, const fs::path& file) {
  if (!picture.jpeg.empty()) {
    WriteFileAtomically(file, picture.jpeg);
    return;
  }
  std::vector<uchar> bytes;
  cv::imencode(".jpg", picture.pixels, bytes, {cv::IMWRITE_JPEG_QUALITY, 95});
  if (width > 0 && picture.pixels.cols >= width) {
    std::string comment = fmt::format("{}{}", kNarrowed, picture.pixels.cols);
    comment = std::string("\xFF\xFE\0", 3) + static_cast<char>(comment.size() + 2) + comment;
    const int behind = 4 + 256 * bytes.at(4) + bytes.at(5);  // the start, and the JFIF segment
    bytes.insert(bytes.begin() + behind, comment.begin(), comment.end());
  }
  WriteFileAtomically(file, std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

// Is it a picture that an import has narrowed, to less than what is asked for now?
bool IsTooNarrow(const fs::path& file, int width) {
  std::string begin(96, '\0');
  std::ifstream(file, std::ios::binary).read(begin.data(), static_cast<std::streamsize>(begin.size()));
  size_t at = begin.find(kNarrowed);
  if (at == std::string::npos) return false;
  at += kNarrowed.size();
  const auto narrowed = ParseInt(begin.substr(at, begin.find_first_not_of("0123456789", at) - at));
  return narrowed && (width == 0 || *narrowed < width);
}

// The nearest first, as the options count it.
void SortByNearness(const PanoramaImportOptions& options, double sigma_m, std::vector<PanoramaRecord>* records) {
  struct Key {
    double distance_m, season, years;
    size_t record;
    auto operator<=>(const Key&) const = default;
  };
  std::vector<Key> keys;
  for (size_t i = 0; i < records->size(); ++i) {
    const double distance_m = options.area.Distance_m((*records)[i].position);
    const auto gap = GapBetween((*records)[i].date, options.near_date);
    // Positions are known to two sigma, seasons change by the month.
    keys.push_back(
        gap ? Key{std::floor(distance_m / (2 * sigma_m)), std::floor(gap->season_days / 30), std::abs(gap->years), i}
            : Key{options.near_date.empty() ? distance_m : std::floor(distance_m / (2 * sigma_m)), 12, 0, i});
  }
  std::sort(keys.begin(), keys.end());
  std::vector<PanoramaRecord> sorted;
  for (const Key& key : keys) sorted.push_back(std::move((*records)[key.record]));
  *records = std::move(sorted);
}

}  // namespace

double SearchArea::Distance_m(const Geodetic& position) const {
  double nearest = points.empty() ? 0 : std::numeric_limits<double>::infinity();
  const Eigen::Vector3d at = EcefFromGeodetic({position.latitude_deg, position.longitude_deg, 0});
  for (const Geodetic& point : points) {
    nearest = std::min(nearest, (EcefFromGeodetic({point.latitude_deg, point.longitude_deg, 0}) - at).norm());
  }
  return nearest;
}

int TakeOutImpossible(PanoramaRecord* record) {
  constexpr double kLargestHeading_deg = 1e6, kLowest_m = -500, kHighest_m = 9000, kLeastSigma_m = 0.01,
                   kLargestSigma_m = 1000;
  int count = 0;
  const auto check = [&](std::optional<double>* value, double least, double most) {
    if (!*value || (**value >= least && **value <= most)) return;  // comparisons with NaN are false
    value->reset();
    ++count;
  };
  check(&record->heading_deg, -kLargestHeading_deg, kLargestHeading_deg);
  check(&record->pitch_deg, -90, 90);
  check(&record->roll_deg, -180, 180);
  check(&record->sigma_h_m, kLeastSigma_m, kLargestSigma_m);
  if (record->heading_deg && !(*record->heading_deg >= 0 && *record->heading_deg < 360)) {
    const double wrapped = *record->heading_deg - 360 * std::floor(*record->heading_deg / 360);
    record->heading_deg = wrapped < 360 ? wrapped : 0;  // of -1e-20 rounding makes 360
  }
  if (record->has_height && !(record->position.height_m >= kLowest_m && record->position.height_m <= kHighest_m)) {
    record->has_height = false;
    record->position.height_m = 0;
    ++count;
  }
  return count;
}

std::string ImpossibleValues(const std::string& source, int count) {
  return fmt::format(
      "{}: {} of heading, pitch, roll, height or accuracy outside the possible range (pitch -90 to 90 deg, roll -180 "
      "to 180 deg, height -500 to 9000 m, accuracy 0.01 to 1000 m, 1 sigma); left empty in panoramas.csv",
      source, Counted(count, "value"));
}

void PanoramaImportOptions::Check() const {
  constexpr int kNarrowest = 256, kWidest = 65536;
  for (const auto& [name, date] : {std::pair{"--since", &since}, std::pair{"--until", &until}}) {
    if (!date->empty() && !IsDate(*date)) {
      throw OptionError(fmt::format("{}: expected a date as 2024, 2024-05 or 2024-05-12, found '{}'", name,
                                    Excerpt(ValidUtf8(*date))));
    }
  }
  const size_t common = std::min(since.size(), until.size());
  if (since.substr(0, common) > until.substr(0, common)) {
    throw OptionError("--since " + since + " is later than --until " + until + "; exchange them");
  }
  for (const Geodetic& point : area.points) {
    if (std::abs(point.latitude_deg) <= 90 && std::abs(point.longitude_deg) <= 180) continue;
    throw OptionError(fmt::format(
        "--near {},{}: expected a latitude from -90 to 90 and a longitude from -180 to 180 deg, in this order",
        point.latitude_deg, point.longitude_deg));
  }
  if (!area.points.empty() && !(area.radius_m > 0 && area.radius_m < 1e7)) {
    throw OptionError(fmt::format("--radius: expected metres above 0, found {}", area.radius_m));
  }
  if (width != 0 && (width < kNarrowest || width > kWidest || width % 2 != 0)) {
    throw OptionError(
        fmt::format("--width: expected 0 or an even number of px from {} to {}, found {}", kNarrowest, kWidest, width));
  }
}

std::vector<PanoramaRecord> ChoosePanoramas(PanoramaProvider& provider, const PanoramaImportOptions& options,
                                            const CancelToken& cancel) {
  options.Check();
  std::vector<PanoramaRecord> records = provider.Find(options.area, cancel);
  if (records.empty()) {
    std::string why;
    for (const std::string& warning : provider.Warnings()) why += "; " + warning;
    if (options.area.points.empty()) throw InputError(provider.Name() + ": holds no panorama" + why);
    const Geodetic& first = options.area.points.front();
    throw InputError(fmt::format("{}: no panorama lies within {:g} m of {}latitude {:.7f}, longitude {:.7f}{}",
                                 provider.Name(), options.area.radius_m,
                                 options.area.points.size() > 1 ? "the track that begins at " : "", first.latitude_deg,
                                 first.longitude_deg, why));
  }
  const size_t found = records.size();
  std::erase_if(records, [&](const PanoramaRecord& r) { return !IsBetween(r.date, options.since, options.until); });
  if (records.empty()) {
    throw InputError(fmt::format("{}: none of the {} panoramas there was taken between {} and {}", provider.Name(),
                                 found, options.since.empty() ? "ever" : options.since,
                                 options.until.empty() ? "now" : options.until));
  }
  for (const std::string& id : options.ids) {
    if (std::none_of(records.begin(), records.end(), [&](const PanoramaRecord& r) { return r.id == id; })) {
      throw InputError(provider.Name() + ": panorama " + id + " is not among the " + std::to_string(records.size()) +
                       " that were found; see --list");
    }
  }
  if (!options.ids.empty()) {
    std::erase_if(records, [&](const PanoramaRecord& r) {
      return std::find(options.ids.begin(), options.ids.end(), r.id) == options.ids.end();
    });
  }
  if (options.limit > 0 && records.size() > static_cast<size_t>(options.limit)) {
    SortByNearness(options, provider.Sigmas().h_m, &records);
    records.resize(static_cast<size_t>(options.limit));
  }
  return records;
}

namespace {

// One import on its way. What a service has sent is kept, whatever comes; an import of a folder is done or leaves
// nothing.
class PanoramaImport {
 public:
  PanoramaImport(const fs::path& site, PanoramaProvider& provider, const PanoramaImportOptions& options)
      : site_(site), provider_(provider), options_(options), table_(site), service_(!provider.Prefix().empty()) {}

  // Throws what ends the import.
  void Take(const PanoramaRecord& record, bool last, const CancelToken& cancel) {
    const std::string name = NameOf(provider_, record);
    const bool has_row = table_.Has(name) && !table_.IsBare(name), has_picture = fs::exists(site_ / name);
    const bool widen = has_picture && IsTooNarrow(site_ / name, options_.width);
    // A row of a service's panorama without its picture is what an import that was killed has left.
    if (has_row && !widen && (!service_ || has_picture)) {
      ++there_;
      return;
    }
    try {
      Load(record, name, widen, cancel);
      failures_ = 0;
    } catch (const InputError& e) {
      Skip(e, has_row && widen);
      return;
    } catch (const NetworkError& e) {
      // One picture that a server fails on is skipped; a second one in a row is the server or the connection.
      if (++failures_ >= 2 || last) throw;
      Skip(e, has_row && widen);
      return;
    }
    report_.files.push_back(site_ / name);
  }

  // After an error that ended a service's import.
  void KeepWhatCame() {
    if (service_) SaveTable();
  }
  int arrived() const { return loaded_ + widened_ + there_; }

  ImportReport Finish(size_t records) {
    SaveTable();
    report_.kept = table_.kept();
    report_.files.insert(report_.files.end(), tables_.begin(), tables_.end());
    report_.warnings = provider_.Warnings();
    report_.warnings.insert(report_.warnings.end(), skipped_.begin(), skipped_.end());
    if (arrived() == 0) {
      throw InputError(provider_.Name() + ": no panorama could be imported; the first problem: " + skipped_.front());
    }
    report_.lines.push_back(fmt::format("{} of {}{}{}", arrived(), Counted(records, "panorama"),
                                        there_ > 0 ? fmt::format(", {} of them were there already", there_) : "",
                                        widened_ > 0 ? fmt::format(", {} replaced narrower pictures", widened_) : ""));
    if (widened_ > 0) {
      report_.warnings.push_back(
          fmt::format("{}: {} replaced narrower pictures, whose rows of panoramas.csv stay as they are; masks and "
                      "control_observations.csv of the narrower ones no longer fit",
                      provider_.Name(), Counted(widened_, "wider picture")));
    }
    if (ends_s_ != std::numeric_limits<int64_t>::max()) {
      report_.warnings.push_back(fmt::format(
          "{}: its terms forbid to keep pictures and positions: they count until {}, and the "
          "next run or import after it deletes them; no report, export or release holds one of the pictures",
          provider_.Name(), UtcOfSeconds(ends_s_)));
    }
    return report_;
  }

 private:
  void Skip(const Error& e, bool has_narrower) {
    skipped_.push_back(std::string(e.what()) +
                       (has_narrower ? "; the narrower picture stays" : "; the panorama is skipped"));
    if (has_narrower) ++there_;
  }
  void Load(const PanoramaRecord& record, const std::string& name, bool widen, const CancelToken& cancel) {
    cancel.ThrowIfCancelled();
    // A picture without a row is what an import that was killed had loaded. Of one with an end, that is not known.
    if (!widen && !provider_.ForSessionOnly() && fs::exists(site_ / name)) {
      ++there_;
      table_.Put(RowOf(record, provider_, name, std::nullopt));
      return;
    }
    const PanoramaPicture picture = provider_.Load(record, options_.width, cancel);
    const std::string end = picture.keep_until_s ? UtcOfSeconds(*picture.keep_until_s) : "";
    const bool has_row = table_.Has(name) && !table_.IsBare(name);
    if (!has_row) {
      table_.Put(RowOf(record, provider_, name, picture.keep_until_s));
    } else if (!widen) {  // the row may hold better values by now
      table_.SetEnd(name, end);
    }
    try {
      // The end of a picture is on the disk before the picture, so that a kill leaves none without an end. A narrower
      // picture that is there keeps its own, earlier one until it is replaced.
      if (picture.keep_until_s) SaveTable();
      if (!service_) made_.Making(site_ / name);
      WritePicture(picture, options_.width, site_ / name);
    } catch (const Error&) {
      if (!has_row || !widen) table_.TakeBack();
      throw;
    }
    if (has_row && widen && picture.keep_until_s) table_.SetEnd(name, end);
    ++(widen ? widened_ : loaded_);
    if (picture.keep_until_s) ends_s_ = std::min(ends_s_, *picture.keep_until_s);
    if (service_ && Clock::now() >= next_save_) SaveTable();
  }
  // Writing takes at most a twentieth of the time, however long the table is.
  void SaveTable() {
    if (!table_.Changed()) return;
    const auto begin = Clock::now();
    made_.Making(site_ / "panoramas.csv");
    tables_.insert(table_.Save());
    made_.Keep();
    next_save_ = Clock::now() + std::max<Clock::duration>(kTimeBetweenSaves, 20 * (Clock::now() - begin));
  }

  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds kTimeBetweenSaves{1};

  fs::path site_;
  PanoramaProvider& provider_;
  const PanoramaImportOptions& options_;
  PanoramaTable table_;
  bool service_;
  MadeFiles made_;
  ImportReport report_;
  std::set<fs::path> tables_;
  Clock::time_point next_save_;  // of rows whose pictures have no end
  int loaded_ = 0, widened_ = 0, there_ = 0, failures_ = 0;
  int64_t ends_s_ = std::numeric_limits<int64_t>::max();  // the first end of a picture
  std::vector<std::string> skipped_;
};

}  // namespace

ImportReport ImportPanoramas(const fs::path& site, PanoramaProvider& provider, const PanoramaImportOptions& options,
                             ProgressSink& progress, const CancelToken& cancel) {
  const std::vector<PanoramaRecord> records = ChoosePanoramas(provider, options, cancel);
  ForgetExpiredPanoramas(site);  // those are to be loaded again
  PanoramaImport import(site, provider, options);
  progress.Begin("panoramas", static_cast<int64_t>(records.size()));
  try {
    for (const PanoramaRecord& record : records) {
      import.Take(record, &record == &records.back(), cancel);
      progress.Advance(1);
    }
  } catch (const NetworkError& e) {
    import.KeepWhatCame();
    if (import.arrived() == 0) throw;
    throw NetworkError(fmt::format("{} ({} of {} panoramas arrived; run the same command again for the others)",
                                   e.what(), import.arrived(), records.size()));
  } catch (const Error&) {
    import.KeepWhatCame();
    throw;
  }
  return import.Finish(records.size());
}

}  // namespace trigpoint

#include "app/pipeline/print.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "datasets/calibration/target_file.h"
#include "datasets/io/csv.h"
#include "datasets/io/tables.h"
#include "datasets/io/tag_families.h"
#include "datasets/io/tags_file.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/lock.h"
#include "datasets/project/outputs.h"
#include "datasets/project/replaced.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr double kMmPerM = 1e3;
constexpr int kMostTags = 2000;
const std::vector<std::string> kRecordColumns = {"printed", "file", "family", "tag_id", "size_mm", "measured_mm"};

// A tag that was printed: DIR/print/printed.csv.
struct PrintRecord {
  std::string printed, file, family;
  int tag_id = -1;
  double size_mm = 0;
  double measured_mm = 0;  // its size on the paper; 0: not measured yet
  double Declared() const { return (measured_mm > 0 ? measured_mm : size_mm) / kMmPerM; }
};

fs::path RecordFile(const fs::path& dir) { return dir / "print" / "printed.csv"; }

std::vector<PrintRecord> ReadRecords(const fs::path& dir) {
  std::vector<PrintRecord> records;
  if (!fs::exists(RecordFile(dir))) return records;
  const CsvTable table = CsvTable::Read(RecordFile(dir), kRecordColumns);
  for (const CsvRow& row : table.rows()) {
    records.push_back({row.Text("printed"), row.Text("file"), row.Text("family"),
                       static_cast<int>(row.Integer("tag_id")), row.Number("size_mm"), row.Number("measured_mm", 0)});
  }
  return records;
}

void WriteRecords(const fs::path& dir, const std::vector<PrintRecord>& records) {
  CsvWriter csv(kRecordColumns,
                {"trigpoint printed 1; sizes as asked for and as measured on the paper; `trigpoint print` adds rows"});
  for (const PrintRecord& r : records) {
    csv.Text(r.printed).Text(r.file).Text(r.family).Integer(r.tag_id).Number(r.size_mm, 3);
    if (r.measured_mm > 0) {
      csv.Number(r.measured_mm, 3);
    } else {
      csv.Empty();
    }
    csv.EndRow();
  }
  csv.Save(RecordFile(dir));
}

std::string OldTags(const fs::path& dir) {
  return fs::exists(dir / "tags.yaml") ? ReadTextFile(dir / "tags.yaml") : std::string();
}

void RequireFolder(const fs::path& dir) {
  if (fs::is_directory(dir)) return;
  throw InputError(dir.string() + ": expected the folder of a site, found " +
                   (fs::exists(dir) ? "a file" : "nothing; make it first: mkdir " + dir.string()));
}

std::string FamilyOf(const PrintRequest& request) {
  if (!request.family.empty()) return request.family;
  if (!fs::exists(request.dir / "tags.yaml")) return "tag36h11";
  const TagFamilies families(ReadTagSizes(request.dir / "tags.yaml").family);
  if (request.ids.empty()) return families.names().front();
  for (const int id : request.ids) {
    if (families.Of(id) == families.Of(request.ids.front())) continue;
    throw OptionError(fmt::format("--ids: by tags.yaml, tag {} is of {} and tag {} of {}; print one family at a time",
                                  request.ids.front(), families.Of(request.ids.front()), id, families.Of(id)));
  }
  return families.Of(request.ids.front());
}

// "0-9" or "3_5_12", for the name of a file.
std::string IdsText(const std::vector<int>& ids) {
  const bool range = ids.back() - ids.front() + 1 == static_cast<int>(ids.size());
  if (ids.size() == 1) return std::to_string(ids.front());
  if (range) return fmt::format("{}-{}", ids.front(), ids.back());
  return ids.size() <= 6 ? fmt::format("{}", fmt::join(ids, "_"))
                         : fmt::format("{}-{}_{}tags", ids.front(), ids.back(), ids.size());
}

struct Pieces {
  std::vector<Artwork> artworks;
  std::vector<PlaceRow> places;
  std::map<int, double> sizes_m;
  std::string name;  // of the file, without extension
};

Pieces MakePieces(const PrintRequest& request, const std::string& family) {
  Pieces pieces;
  if (request.what == "board") {
    if (request.target.empty()) throw OptionError("--target: expected the board, as checkerboard:9x6:0.025");
    const Target target = ReadTarget(request.target, request.dir);
    pieces.artworks.push_back(BoardArtwork(target));
    pieces.name = fmt::format("board_{}_{}x{}_{:g}mm", TargetKindName(target.kind), target.cols, target.rows,
                              kMmPerM * target.spacing_x_m);
    return pieces;
  }
  if (request.ids.empty()) throw OptionError("--ids: expected ids of tags, as 0-9,12");
  if (!(request.size_mm > 0)) throw OptionError("--size: expected the size of a tag in mm, as 160");
  if (request.what == "scale-bar") {
    if (request.ids.size() != 2) throw OptionError("--ids: a scale bar has two tags, as 100,101");
    pieces.artworks.push_back(
        ScaleBarArtwork(family, request.ids[0], request.ids[1], request.size_mm, request.length_mm));
    pieces.name = fmt::format("scale_bar_{}_{}_{:g}mm", family, IdsText(request.ids), request.length_mm);
  } else {
    for (const int id : request.ids) pieces.artworks.push_back(TagArtwork(family, id, request.size_mm));
    pieces.name = fmt::format("tags_{}_{}_{:g}mm", family, IdsText(request.ids), request.size_mm);
  }
  for (const int id : request.ids) {
    pieces.places.push_back({std::to_string(id), family, fmt::format("{:g}", request.size_mm)});
    pieces.sizes_m[id] = request.size_mm / kMmPerM;
  }
  return pieces;
}

void WritePoints(const PrintedSheets& sheets, const fs::path& file) {
  CsvWriter csv({"page", "object", "point", "x_mm", "y_mm"},
                {"trigpoint sheet points 1; mm on the paper from its upper left corner, x right, y down; of a tag: its "
                 "corners, 0 bottom-left, 1 bottom-right, 2 top-right, 3 top-left"});
  for (const PrintedPoint& p : sheets.points) {
    csv.Integer(p.page).Text(p.object).Integer(p.index).Number(p.x_mm, 3).Number(p.y_mm, 3);
    csv.EndRow();
  }
  csv.Save(file);
}

}  // namespace

std::vector<int> ParseIds(const std::string& text) {
  std::set<int> ids;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(',', begin), text.size());
    const std::string part(Trim(text.substr(begin, end - begin)));
    const size_t dash = part.find('-', 1);
    const auto first = ParseInt(part.substr(0, dash));
    const auto last = dash == std::string::npos ? first : ParseInt(part.substr(dash + 1));
    if (!first || !last || *first < 0 || *last < *first) {
      throw OptionError("--ids " + text + ": expected ids and ranges, as 0-9,12; found '" + part + "'");
    }
    if (*last - *first >= kMostTags || ids.size() > kMostTags) {
      throw OptionError(fmt::format("--ids {}: expected at most {} tags at a time", text, kMostTags));
    }
    for (int64_t id = *first; id <= *last; ++id) ids.insert(static_cast<int>(id));
    begin = end + 1;
  }
  return {ids.begin(), ids.end()};
}

PrintOutcome PrintSheetsFor(const PrintRequest& request) {
  RequireFolder(request.dir);
  const std::string family = FamilyOf(request);
  const Pieces pieces = MakePieces(request, family);
  const fs::path out = fs::absolute(request.out.empty() ? request.dir / "print" / (pieces.name + ".pdf") : request.out)
                           .lexically_normal();
  const ProjectLock lock(request.dir / "results");
  // What cannot be noted is not printed.
  const std::string old = OldTags(request.dir);
  const std::vector<PrintRecord> before = ReadRecords(request.dir);
  TagsFileChange change;
  if (!pieces.sizes_m.empty()) change = WithTagSizes(old, family, pieces.sizes_m, {}, request.dir / "tags.yaml");

  PrintOutcome outcome;
  SheetOptions options = request.sheets;
  if (options.title.empty()) options.title = out.stem().string();
  for (const Artwork& artwork : pieces.artworks) {
    for (const std::string& check : artwork.checks) {
      if (std::find(outcome.checks.begin(), outcome.checks.end(), check) == outcome.checks.end()) {
        outcome.checks.push_back(check);
      }
    }
  }
  OutputFiles output(out.parent_path(), request.force);
  outcome.pdf = out;
  outcome.points = out.parent_path() / (out.stem().string() + "_points.csv");
  outcome.sheets = WriteSheets(pieces.artworks, pieces.places, options, output.staging() / out.filename());
  WritePoints(outcome.sheets, output.staging() / outcome.points.filename());
  output.Publish();
  if (pieces.sizes_m.empty()) return outcome;

  std::vector<PrintRecord> records = before;
  const std::string now = UtcTimeText();
  for (const auto& [id, size] : pieces.sizes_m) {
    records.push_back({now, RelativeTo(request.dir, out), family, id, kMmPerM * size, 0});
  }
  outcome.old = ReplaceInputFile(request.dir, "tags.yaml", change.text);
  outcome.entries_added = change.added;
  WriteRecords(request.dir, records);
  return outcome;
}

MeasuredPrint EnterMeasuredPrint(const fs::path& dir, const std::vector<int>& ids,
                                 const std::vector<double>& measured_mm, double nominal_mm) {
  constexpr double kLeastFactor = 0.8, kMostFactor = 1.25, kMostUneven = 0.01, kUneven = 0.002;
  RequireFolder(dir);
  const double low = *std::min_element(measured_mm.begin(), measured_mm.end());
  const double high = *std::max_element(measured_mm.begin(), measured_mm.end());
  MeasuredPrint result;
  result.factor = 0.5 * (low + high) / nominal_mm;
  if (!(nominal_mm > 0 && low > 0) || result.factor < kLeastFactor || result.factor > kMostFactor) {
    throw OptionError(
        fmt::format("--measured {:g} --nominal {:g}: expected lengths of the same bar in mm, {:.0f} to "
                    "{:.0f} % of each other",
                    measured_mm.front(), nominal_mm, 100 * kLeastFactor, 100 * kMostFactor));
  }
  if (high - low > kMostUneven * nominal_mm) {
    throw OptionError(
        fmt::format("--measured {:g} {:g}: the print is stretched by {:.1f} % in one direction, its tags "
                    "are not square; print it again",
                    measured_mm.front(), measured_mm.back(), 100 * (high - low) / nominal_mm));
  }
  if (high - low > kUneven * nominal_mm) {
    result.warnings.push_back(fmt::format("the bars differ by {:.2f} %; tags are taken as squares of the mean",
                                          100 * (high - low) / nominal_mm));
  }
  const ProjectLock lock(dir / "results");
  std::vector<PrintRecord> records = ReadRecords(dir);
  if (records.empty()) {
    throw InputError(RecordFile(dir).string() + ": nothing was printed yet; print tags first, then enter the measure");
  }
  const PrintRecord newest = *std::max_element(records.begin(), records.end(),
                                               [](const auto& a, const auto& b) { return a.printed <= b.printed; });
  std::map<int, double> sizes_m, expected_m;
  std::string family;
  for (const int id : ids) {
    if (std::none_of(records.begin(), records.end(), [&](const auto& r) { return r.tag_id == id; })) {
      throw InputError(fmt::format("{}: tag {} was not printed here; see column tag_id", RecordFile(dir).string(), id));
    }
  }
  for (PrintRecord& r : records) {
    const bool meant = ids.empty() ? r.printed == newest.printed && r.file == newest.file
                                   : std::find(ids.begin(), ids.end(), r.tag_id) != ids.end();
    if (!meant) continue;
    if (!family.empty() && r.family != family) {
      throw OptionError(fmt::format("--ids: tag {} is of {}, others are of {}; enter one family at a time", r.tag_id,
                                    r.family, family));
    }
    family = r.family;
    expected_m[r.tag_id] = r.Declared();
    r.measured_mm = r.size_mm * result.factor;
    sizes_m[r.tag_id] = r.Declared();
  }
  const std::string old = OldTags(dir);
  const TagsFileChange change = WithTagSizes(old, family, sizes_m, expected_m, dir / "tags.yaml");
  result.old = ReplaceInputFile(dir, "tags.yaml", change.text);
  WriteRecords(dir, records);
  for (const auto& [id, size] : sizes_m) result.ids.push_back(id);
  return result;
}

}  // namespace trigpoint

#include "eval/print/printed.h"

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
#include "eval/report/drawing_memory.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr double kMmPerM = 1e3;
constexpr int kMostTags = 2000;
constexpr double kSame_mm = 1e-3;
const std::vector<std::string> kRecordColumns = {"printed", "file", "family", "tag_id", "size_mm", "measured_mm"};
constexpr const char* kBarColumn = "bar_mm";

// A tag that was printed: DIR/print/printed.csv.
struct PrintRecord {
  std::string printed, file, family;
  int tag_id = -1;
  double size_mm = 0;
  double measured_mm = 0;  // its size on the paper; 0: not measured yet
  double bar_mm = 0;       // length of the sheet's measuring bars; 0: not noted
  double Declared() const { return (measured_mm > 0 ? measured_mm : size_mm) / kMmPerM; }
};

fs::path RecordFile(const fs::path& dir) { return dir / "print" / "printed.csv"; }

fs::path Absolute(const fs::path& path) { return fs::absolute(path).lexically_normal(); }

// As the record names a PDF: from the project's folder, so that the folder can be moved.
std::string FromFolder(const fs::path& dir, const fs::path& file) {
  const std::string relative = file.lexically_relative(Absolute(dir)).generic_string();
  return relative.empty() ? file.generic_string() : relative;
}

std::vector<PrintRecord> ReadRecords(const fs::path& dir) {
  std::vector<PrintRecord> records;
  if (!fs::exists(RecordFile(dir))) return records;
  const CsvTable table = CsvTable::Read(RecordFile(dir), kRecordColumns, {kBarColumn});
  for (const CsvRow& row : table.rows()) {
    const fs::path file = row.Text("file");
    records.push_back({row.Text("printed"), file.is_absolute() ? FromFolder(dir, file) : file.generic_string(),
                       row.Text("family"), static_cast<int>(row.Integer("tag_id")), row.Number("size_mm"),
                       row.Number("measured_mm", 0), row.Number(kBarColumn, 0)});
  }
  return records;
}

void WriteRecords(const fs::path& dir, const std::vector<PrintRecord>& records) {
  std::vector<std::string> columns = kRecordColumns;
  columns.emplace_back(kBarColumn);
  CsvWriter csv(columns,
                {"trigpoint printed 1; sizes as asked for and as measured on the paper; `trigpoint print` adds rows"});
  for (const PrintRecord& r : records) {
    csv.Text(r.printed).Text(r.file).Text(r.family).Integer(r.tag_id).Number(r.size_mm, 3);
    for (const double length : {r.measured_mm, r.bar_mm}) {
      if (length > 0) {
        csv.Number(length, 3);
      } else {
        csv.Empty();
      }
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
  if (!(request.size_mm > 0))
    throw OptionError(
        "--size: expected the size of a tag in mm, as tags.yaml declares it (edge of the black square), as 160");
  if (request.what == "scale-bar") {
    if (!(request.length_mm > 0)) {
      throw OptionError(
          "--length: expected the distance of the scale bar's two tags, centre to centre, in mm, as 1000");
    }
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

std::string TagsText(const std::vector<int>& ids) {
  return ids.size() == 1 ? fmt::format("tag {}", ids.front()) : fmt::format("tags {}", fmt::join(ids, ", "));
}

// The sizes to add to tags.yaml. Tags that it lists with another size than the sheet's keep theirs if they were printed
// in the sheet's size before: it was measured, or entered by hand.
std::map<int, double> SizesToAdd(const PrintRequest& request, const std::string& family,
                                 const std::vector<PrintRecord>& before, const std::map<int, double>& sizes_m,
                                 std::vector<std::string>* warnings) {
  const fs::path file = request.dir / "tags.yaml";
  if (!fs::exists(file)) return sizes_m;
  const std::map<int, double> listed_m = ReadTagSizes(file).sizes_m;
  std::map<int, double> add;
  std::map<double, std::vector<int>> kept;
  for (const auto& [id, size] : sizes_m) {
    const auto listed = listed_m.find(id);
    if (listed == listed_m.end() || std::abs(kMmPerM * (listed->second - size)) < kSame_mm) {
      add[id] = size;
      continue;
    }
    const bool printed = std::any_of(before.begin(), before.end(), [&, tag = id](const PrintRecord& r) {
      return r.tag_id == tag && r.family == family && std::abs(r.size_mm - request.size_mm) < kSame_mm;
    });
    if (!printed) {
      throw InputError(fmt::format(
          "{}: tag {} is listed with {:.6g} m, the sheet would show {:g} mm; one id is one tag of one size: "
          "take another id, or, if that tag is gone, remove its line from sizes_m",
          file.string(), id, listed->second, request.size_mm));
    }
    kept[listed->second].push_back(id);
  }
  for (const auto& [listed, ids] : kept) {
    warnings->push_back(
        fmt::format("{}: tags.yaml has {:.6g} mm, entered after an earlier print, this sheet has {:g} mm. tags.yaml is "
                    "not changed: measure this sheet and enter that",
                    TagsText(ids), kMmPerM * listed, request.size_mm));
  }
  return add;
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

// size on the paper / size asked for, and what is doubtful about it.
MeasuredPrint FactorOf(const std::vector<double>& measured_mm, double nominal_mm) {
  constexpr double kLeastFactor = 0.8, kMostFactor = 1.25, kMostUneven = 0.01, kUneven = 0.002;
  const double low = *std::min_element(measured_mm.begin(), measured_mm.end());
  const double high = *std::max_element(measured_mm.begin(), measured_mm.end());
  MeasuredPrint result;
  result.factor = 0.5 * (low + high) / nominal_mm;
  if (!(low > 0 && result.factor >= kLeastFactor && result.factor <= kMostFactor)) {
    throw OptionError(
        fmt::format("--measured {:g} --nominal {:g}: expected two lengths of the same bar or tag's edge in mm, as "
                    "measured and as asked for, {:.0f} to {:.0f} % of each other",
                    measured_mm.front(), nominal_mm, 100 * kLeastFactor, 100 * kMostFactor));
  }
  if (high - low > kMostUneven * nominal_mm) {
    throw OptionError(
        fmt::format("--measured {:g} {:g}: the print is stretched by {:.1f} % in one direction, its tags are not "
                    "square; measure again, else print it again",
                    measured_mm.front(), measured_mm.back(), 100 * (high - low) / nominal_mm));
  }
  if (high - low > kUneven * nominal_mm) {
    result.warnings.push_back(
        fmt::format("the lengths across and up differ by {:.2f} %; tags are taken as squares of "
                    "the mean",
                    100 * (high - low) / nominal_mm));
  }
  return result;
}

// The newest print of each of `ids`, or of each tag of the newest PDF.
std::vector<PrintRecord*> NewestPrints(const fs::path& dir, std::vector<int> ids, std::vector<PrintRecord>* records) {
  if (records->empty()) {
    throw InputError(RecordFile(dir).string() + ": nothing was printed yet; print tags first, then enter the measure");
  }
  const auto earlier = [](const PrintRecord& a, const PrintRecord& b) { return a.printed <= b.printed; };
  if (ids.empty()) {
    const PrintRecord& newest = *std::max_element(records->begin(), records->end(), earlier);
    std::set<int> of_file;
    for (const PrintRecord& r : *records) {
      if (r.printed == newest.printed && r.file == newest.file) of_file.insert(r.tag_id);
    }
    ids.assign(of_file.begin(), of_file.end());
  }
  std::vector<PrintRecord*> newest;
  for (const int id : ids) {
    PrintRecord* found = nullptr;
    for (PrintRecord& r : *records) {
      if (r.tag_id == id && (found == nullptr || earlier(*found, r))) found = &r;
    }
    if (found == nullptr) {
      throw InputError(fmt::format("{}: tag {} was not printed here; see column tag_id", RecordFile(dir).string(), id));
    }
    newest.push_back(found);
    if (found->family != newest.front()->family) {
      throw OptionError(fmt::format("--ids: tag {} is of {}, tag {} of {}; enter one family at a time",
                                    newest.front()->tag_id, newest.front()->family, id, found->family));
    }
  }
  return newest;
}

// Lengths on the sheets that can be measured: "160 mm (the tags' edges) or 50 mm (the bars)".
std::string LengthsText(const std::vector<PrintRecord*>& prints) {
  std::set<double> sizes, bars;
  for (const PrintRecord* r : prints) {
    sizes.insert(r->size_mm);
    if (r->bar_mm > 0) bars.insert(r->bar_mm);
  }
  const std::string edges = fmt::format("{:g} mm (the tags' edges)", fmt::join(sizes, ", "));
  return bars.empty() ? edges : fmt::format("{:g} mm (the bars) or {}", fmt::join(bars, ", "), edges);
}

// What tags.yaml has for these tags and may be replaced: sizes that were asked for, or were entered by a measure.
std::map<int, double> ReplaceableSizes(const fs::path& dir, const std::vector<PrintRecord*>& prints,
                                       const std::vector<PrintRecord>& records) {
  std::map<int, double> replaceable_m;
  if (!fs::exists(dir / "tags.yaml")) return replaceable_m;
  const std::map<int, double> listed_m = ReadTagSizes(dir / "tags.yaml").sizes_m;
  for (const PrintRecord* print : prints) {
    const auto listed = listed_m.find(print->tag_id);
    if (listed == listed_m.end()) continue;
    const bool ours = std::any_of(records.begin(), records.end(), [&](const PrintRecord& r) {
      return r.tag_id == print->tag_id && std::abs(kMmPerM * (r.Declared() - listed->second)) < kSame_mm;
    });
    if (!ours) {
      throw InputError(fmt::format(
          "{}: tag {} is listed with {:.6g} m, which is neither the {:g} mm that were printed nor a measure "
          "of it; an entry made by hand is not replaced: edit the file",
          (dir / "tags.yaml").string(), print->tag_id, listed->second, print->size_mm));
    }
    replaceable_m[print->tag_id] = listed->second;
  }
  return replaceable_m;
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
  const fs::path out = Absolute(request.out.empty() ? request.dir / "print" / (pieces.name + ".pdf") : request.out);
  if (out.extension() != ".pdf") {
    throw OptionError(fmt::format("--out {}: expected the name of a file that ends in .pdf", request.out.string()));
  }
  const ProjectLock lock(request.dir / "results");
  // What cannot be noted is not printed.
  const std::string old = OldTags(request.dir);
  const std::vector<PrintRecord> before = ReadRecords(request.dir);
  PrintOutcome outcome;
  TagsFileChange change;
  if (!pieces.sizes_m.empty()) {
    const std::map<int, double> add = SizesToAdd(request, family, before, pieces.sizes_m, &outcome.warnings);
    change = WithTagSizes(old, family, add, {}, request.dir / "tags.yaml");
  }

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
  RequireDrawingMemory("drawing the pages", kPageMemory_mib);
  outcome.sheets = WriteSheets(pieces.artworks, pieces.places, options, output.staging() / out.filename());
  WritePoints(outcome.sheets, output.staging() / outcome.points.filename());
  output.Publish();
  if (pieces.sizes_m.empty()) return outcome;

  std::vector<PrintRecord> records = before;
  const std::string now = UtcTimeText();
  for (const auto& [id, size] : pieces.sizes_m) {
    records.push_back({now, FromFolder(request.dir, out), family, id, kMmPerM * size, 0, outcome.sheets.bar_mm});
  }
  outcome.old = ReplaceInputFile(request.dir, "tags.yaml", change.text);
  outcome.entries_added = change.added;
  WriteRecords(request.dir, records);
  return outcome;
}

MeasuredPrint EnterMeasuredPrint(const fs::path& dir, const std::vector<int>& ids,
                                 const std::vector<double>& measured_mm, double nominal_mm) {
  RequireFolder(dir);
  const ProjectLock lock(dir / "results");
  std::vector<PrintRecord> records = ReadRecords(dir);
  const std::vector<PrintRecord*> prints = NewestPrints(dir, ids, &records);
  const std::string lengths = LengthsText(prints);
  if (!(nominal_mm > 0)) {
    throw OptionError("--nominal: expected the length that was asked for of what was measured; on these sheets " +
                      lengths);
  }
  MeasuredPrint result = FactorOf(measured_mm, nominal_mm);
  const bool known = std::any_of(prints.begin(), prints.end(), [&](const PrintRecord* r) {
    return r->bar_mm <= 0 || std::abs(r->bar_mm - nominal_mm) < kSame_mm ||
           std::abs(r->size_mm - nominal_mm) < kSame_mm;
  });
  if (!known) {
    result.warnings.push_back(fmt::format(
        "--nominal {:g}: the sheets have {}; enter it again if another length was meant", nominal_mm, lengths));
  }
  const std::map<int, double> replaceable_m = ReplaceableSizes(dir, prints, records);
  std::map<int, double> sizes_m;
  for (PrintRecord* print : prints) {
    // To the digits that tags.yaml has.
    const double steps_per_mm = print->size_mm * result.factor < 1000 ? 1000 : 100;
    print->measured_mm = std::round(print->size_mm * result.factor * steps_per_mm) / steps_per_mm;
    sizes_m[print->tag_id] = print->Declared();
  }
  const TagsFileChange change =
      WithTagSizes(OldTags(dir), prints.front()->family, sizes_m, replaceable_m, dir / "tags.yaml");
  result.old = ReplaceInputFile(dir, "tags.yaml", change.text);
  WriteRecords(dir, records);
  for (const auto& [id, size] : sizes_m) result.ids.push_back(id);
  return result;
}

}  // namespace trigpoint

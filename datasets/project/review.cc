#include "datasets/project/review.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <functional>
#include <memory>

#include "datasets/io/csv.h"
#include "datasets/io/lines.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/project.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

const std::vector<std::string> kActions = {"exclude", "restore", "role", "undo"};

std::string KindOf(const std::string& object) {
  const size_t colon = object.find(':');
  const std::string kind = colon == std::string::npos ? "" : object.substr(0, colon);
  const std::vector<std::string>& kinds = ReviewKinds();
  return std::find(kinds.begin(), kinds.end(), kind) == kinds.end() ? "" : kind;
}

std::string TextAt(const json& line, const char* key) {
  const auto it = line.find(key);
  return it != line.end() && it->is_string() ? it->get<std::string>() : "";
}

// Why a line is no entry; empty if it is one.
std::string ParseEntry(const std::string& text, ReviewEntry& entry) {
  const json line = json::parse(text, nullptr, false);
  if (!line.is_object()) return "expected a JSON object";
  entry.action = TextAt(line, "action");
  if (std::find(kActions.begin(), kActions.end(), entry.action) == kActions.end()) {
    return "expected action exclude, restore, role or undo, found '" + entry.action + "'";
  }
  entry.object = TextAt(line, "object");
  if (KindOf(entry.object).empty()) return "expected an object such as station:NAME, found '" + entry.object + "'";
  entry.role = TextAt(line, "role");
  if (entry.action == "role" && entry.role != "control" && entry.role != "check") {
    return "expected role control or check, found '" + entry.role + "'";
  }
  const auto undoes = line.find("undoes");
  if (entry.action == "undo" && (undoes == line.end() || !undoes->is_number_integer())) {
    return "expected `undoes`, the number of an entry";
  }
  if (entry.action == "undo") entry.undoes = undoes->get<int>();
  entry.reason = TextAt(line, "reason");
  entry.user = TextAt(line, "user");
  entry.time = TextAt(line, "time");
  return "";
}

json LineOf(const ReviewEntry& entry) {
  json line = {{"schema", 1},           {"entry", entry.number},  {"time", entry.time},
               {"user", entry.user},    {"action", entry.action}, {"object", entry.object},
               {"reason", entry.reason}};
  if (entry.action == "role") line["role"] = entry.role;
  if (entry.action == "undo") line["undoes"] = entry.undoes;
  return line;
}

// review.jsonl, open and locked against other writers.
class ReviewFile {
 public:
  explicit ReviewFile(fs::path file) : file_(std::move(file)) {
    fd_ = open(file_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    if (fd_ < 0 || flock(fd_, LOCK_EX) != 0) {
      const int error = errno;
      if (fd_ >= 0) close(fd_);
      throw IoErrorFor(file_, "written", error);
    }
  }
  ReviewFile(const ReviewFile&) = delete;
  ReviewFile& operator=(const ReviewFile&) = delete;
  ~ReviewFile() { close(fd_); }

  // A line that a killed writer left half-made is ended first.
  void Append(std::string line) const {
    const off_t size = lseek(fd_, 0, SEEK_END);
    char last = '\n';
    if (size > 0 && pread(fd_, &last, 1, size - 1) == 1 && last != '\n') line.insert(line.begin(), '\n');
    line += '\n';
    const ssize_t written = write(fd_, line.data(), line.size());
    if (written != static_cast<ssize_t>(line.size()) || fsync(fd_) != 0) {
      const int error = written < 0 ? errno : ENOSPC;
      if (ftruncate(fd_, size) != 0) throw IoErrorFor(file_, "written", errno);
      throw IoErrorFor(file_, "written", error);
    }
  }

 private:
  fs::path file_;
  int fd_ = -1;
};

// Every object of the project that can be decided about, detections aside.
std::vector<std::string> ObjectsOf(const Project& project) {
  const Site& site = project.site();
  std::vector<std::string> objects;
  std::set<int> tags;
  for (const Run& run : site.runs) {
    for (const ImageEntry& image : run.images) {
      objects.push_back("image:" + run.name + "/" + ReviewImageName(image.file, image.stamp_ns));
    }
  }
  std::set<std::string> stations;
  for (const Station& station : site.stations) {
    stations.insert(station.name);
    tags.insert(station.tag_id);
  }
  for (const Reference& reference : site.references) {
    if (!reference.station.empty()) stations.insert(reference.station);
    objects.push_back("panorama:" + reference.name);
  }
  for (const std::string& station : stations) objects.push_back("station:" + station);
  for (const ControlPoint& point : site.control_points) {
    objects.push_back("control:" + ReviewControlName(point));
    if (point.tag_id >= 0) tags.insert(point.tag_id);
  }
  for (const auto& [tag, size] : site.tags.sizes_m) tags.insert(tag);
  for (const int tag : tags) objects.push_back("tag:" + std::to_string(tag));
  return objects;
}

// "detection:RUN/FILE#TAG" and "tag:TAG" of what was detected or brought.
void AddDetections(const Project& project, std::vector<std::string>& objects) {
  std::set<std::string> found;
  for (const Run& run : project.site().runs) {
    const fs::path made = project.ResultDir("detect", run.name) / "detections.csv";
    const fs::path file = fs::exists(made) ? made : run.detections;
    if (file.empty() || !fs::exists(file)) continue;
    const CsvTable table = CsvTable::Read(file, {"timestamp", "tag_id"}, {"image"});
    table.ForEachUsable(nullptr, [&](const CsvRow& row) {
      const std::string image = ReviewImageName(row.Has("image") ? row.Text("image") : "", row.StampNs("timestamp"));
      const std::string tag = std::to_string(row.Integer("tag_id"));
      found.insert("image:" + run.name + "/" + image);
      found.insert("detection:" + run.name + "/" + image + "#" + tag);
      found.insert("tag:" + tag);
    });
  }
  objects.insert(objects.end(), found.begin(), found.end());
}

[[noreturn]] void ThrowUnknown(const std::string& text, const std::vector<std::string>& objects) {
  throw InputError("there is no '" + text + "' to review" + NearestHint(text, objects) +
                   "; expected image:RUN/FILE, detection:RUN/FILE#TAG, tag:TAG, station:NAME, panorama:NAME or "
                   "control:TAG");
}

// The entry that an undo takes back.
const ReviewEntry& EntryToUndo(const Project& project, const Review& review, const std::string& text) {
  const std::vector<ReviewEntry>& entries = review.entries();
  const std::optional<int64_t> number = ParseInt(text.starts_with('#') ? text.substr(1) : text);
  std::string object;
  if (!number && text != "last") object = ResolveReviewObject(project, "undo", text);
  for (auto it = entries.rbegin(); it != entries.rend(); ++it) {
    if (it->action == "undo" || (number && it->number != *number) || (!object.empty() && it->object != object))
      continue;
    if (it->in_force) return *it;
    if (number) break;
  }
  throw InputError("review.jsonl: there is nothing to undo for '" + text +
                   "'; expected `last`, an entry's number, or an object with an entry in force");
}

std::string RoleNow(const Project& project, const std::string& object) {
  for (const ControlPoint& point : project.site().control_points) {
    if ("control:" + ReviewControlName(point) == object) return point.control ? "control" : "check";
  }
  return "";
}

}  // namespace

const std::vector<std::string>& ReviewKinds() {
  static const std::vector<std::string> kKinds = {"image", "detection", "tag", "station", "panorama", "control"};
  return kKinds;
}

std::string ReviewImageName(const std::string& file, int64_t stamp_ns) {
  return file.empty() ? fmt::format("@{}", FormatNsAsSeconds(stamp_ns)) : file;
}

std::string ReviewControlName(const ControlPoint& point) {
  if (point.tag_id < 0) return point.point;
  std::string name = std::to_string(point.tag_id);
  if (point.corner >= 0) name.append("/").append(std::to_string(point.corner));
  return name;
}

Review Review::Read(const fs::path& file, std::vector<std::string>* warnings) {
  Review review;
  if (!fs::exists(file)) return review;
  const std::string text = ReadTextFile(file);
  int number = 0, line = 0;
  for (const std::string_view whole : Lines(text)) {
    ++line;
    const std::string row(Trim(whole));
    if (row.empty()) continue;
    ReviewEntry entry;
    entry.number = ++number;  // an unreadable line keeps its number
    if (const std::string problem = ParseEntry(row, entry); !problem.empty()) {
      if (warnings != nullptr) {
        warnings->push_back(FileLine(file, line) + ": " + problem + "; the line is left out");
      }
      continue;
    }
    review.entries_.push_back(std::move(entry));
  }
  for (ReviewEntry& undo : review.entries_) {
    if (undo.action != "undo") continue;
    for (ReviewEntry& entry : review.entries_) {
      if (entry.number == undo.undoes && entry.number < undo.number && entry.action != "undo") entry.in_force = false;
    }
  }
  for (const ReviewEntry& entry : review.entries_) {
    if (!entry.in_force) continue;
    if (entry.action == "exclude") review.excluded_.insert(entry.object);
    if (entry.action == "restore") review.excluded_.erase(entry.object);
    if (entry.action == "role") review.roles_[entry.object] = entry.role;
  }
  return review;
}

bool Review::ExcludesImage(const std::string& run, const std::string& file, int64_t stamp_ns) const {
  if (excluded_.empty()) return false;
  const std::string object = "image:" + run + "/" + ReviewImageName(file, stamp_ns);
  return Excludes(object) || Excludes(object.substr(0, object.rfind('#')));  // a part of a picture that is excluded
}

bool Review::ExcludesDetection(const std::string& run, const std::string& file, int64_t stamp_ns, int tag_id) const {
  if (excluded_.empty()) return false;
  const std::string tag = std::to_string(tag_id);
  return Excludes("tag:" + tag) || ExcludesImage(run, file, stamp_ns) ||
         Excludes("detection:" + run + "/" + ReviewImageName(file, stamp_ns) + "#" + tag);
}

json Review::InForce(const std::vector<std::string>& kinds, const std::string& run) const {
  const auto wanted = [&](const std::string& object) {
    const std::string kind = KindOf(object);
    if (std::find(kinds.begin(), kinds.end(), kind) == kinds.end()) return false;
    if (run.empty() || (kind != "image" && kind != "detection")) return true;
    return object.starts_with(kind + ":" + run + "/");
  };
  json result;
  for (const std::string& object : excluded_) {
    if (wanted(object)) result["excluded"].push_back(object);
  }
  for (const auto& [object, role] : roles_) {
    if (wanted(object)) result["roles"][object] = role;
  }
  return result;
}

std::string ResolveReviewObject(const Project& project, const std::string& action, const std::string& text) {
  std::vector<std::string> objects = ObjectsOf(project);
  AddDetections(project, objects);
  // What was decided about things that have gone since can still be taken back.
  const Review& review = project.review();
  if (action == "undo" || action == "restore") {
    for (const ReviewEntry& entry : review.entries()) objects.push_back(entry.object);
  }
  std::sort(objects.begin(), objects.end());
  objects.erase(std::unique(objects.begin(), objects.end()), objects.end());
  if (action == "role") {
    std::erase_if(objects, [](const std::string& object) { return KindOf(object) != "control"; });
    if (KindOf(text) == "tag") return ResolveReviewObject(project, action, "control:" + text.substr(4));
  } else if (action != "undo") {
    std::erase_if(objects, [](const std::string& object) { return KindOf(object) == "control"; });
  }
  if (std::binary_search(objects.begin(), objects.end(), text)) return text;
  std::vector<std::string> matches;
  for (const std::string& kind : ReviewKinds()) {
    if (std::binary_search(objects.begin(), objects.end(), kind + ":" + text)) matches.push_back(kind + ":" + text);
  }
  if (matches.size() == 1) return matches.front();
  if (matches.empty()) ThrowUnknown(text, objects);
  throw InputError(fmt::format("'{}' is not clear; expected {}", text, fmt::join(matches, " or ")));
}

ReviewEntry AppendReview(const Project& project, const ReviewRequest& request) {
  if (std::find(kActions.begin(), kActions.end(), request.action) == kActions.end()) {
    throw OptionError("unknown review action '" + request.action + "'; nearest: '" +
                      NearestName(request.action, kActions) + "'");
  }
  const std::string reason(Trim(request.reason));
  if (reason.empty()) throw OptionError("a review needs a reason; expected --reason TEXT");
  const fs::path path = project.dir() / "review.jsonl";
  ReviewEntry entry;
  entry.action = request.action;
  entry.reason = reason;
  entry.user = request.user.empty() ? UserName() : request.user;
  if (request.action != "undo") entry.object = ResolveReviewObject(project, request.action, request.object);
  const ReviewFile file(path);
  const Review now = Review::Read(path, nullptr);
  const std::string text = ReadTextFile(path);
  entry.number = 1;
  for (const std::string_view line : Lines(text)) entry.number += Trim(line).empty() ? 0 : 1;  // as Review::Read counts
  if (request.action == "undo") {
    const ReviewEntry& undone = EntryToUndo(project, now, request.object);
    entry.object = undone.object;
    entry.undoes = undone.number;
  } else if (request.action == "exclude" && now.Excludes(entry.object)) {
    throw InputError(entry.object + " is excluded already");
  } else if (request.action == "restore" && !now.Excludes(entry.object)) {
    throw InputError(entry.object + " is not excluded; there is nothing to restore");
  } else if (request.action == "role") {
    const auto changed = now.roles().find(entry.object);
    const std::string role = changed != now.roles().end() ? changed->second : RoleNow(project, entry.object);
    entry.role = request.role.empty() ? (role == "control" ? "check" : "control") : request.role;
    if (entry.role != "control" && entry.role != "check") {
      throw OptionError("--to: expected control or check, found '" + request.role + "'");
    }
    if (entry.role == role) throw InputError(entry.object + " is a " + role + " point already");
  }
  entry.time = UtcTimeText();
  file.Append(DumpJson(LineOf(entry)));
  return entry;
}

std::string FormatReviewEntry(const ReviewEntry& entry) {
  std::string text = fmt::format("{} {} {} ", entry.number, entry.time, entry.user);
  if (entry.action == "undo") text += fmt::format("undoes entry {} on ", entry.undoes);
  if (entry.action == "exclude") text += "excludes ";
  if (entry.action == "restore") text += "restores ";
  if (entry.action == "role") text += "makes a " + entry.role + " point of ";
  return text + entry.object + ": " + entry.reason + (entry.in_force ? "" : " (taken back)");
}

}  // namespace trigpoint

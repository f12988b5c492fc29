// What `check` has seen of a folder that still grows: one line a picture, so that a kill loses the picture in hand.
#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "datasets/project/json_lines.h"
#include "datasets/project/project.h"
#include "survey/field/findings.h"

namespace trigpoint {

// What a file was like when it was looked at; another size or time makes it a new one, and so does another mask.
struct FileStamp {
  int64_t size = -1, changed_ns = 0;
  std::string mask;  // of a picture: boxes, and files with their size and time; empty: none
  bool operator==(const FileStamp&) const = default;
};
// Size -1: there is no such file.
FileStamp StampOf(const std::filesystem::path& file);
// FileStamp::mask of a picture of a run.
std::string MaskStamp(const Run& run, const ImageEntry& image);

// results/check/pictures.jsonl: a line for each picture.
class PictureLog {
 public:
  // Begins anew where `identity` is another one than the file's.
  PictureLog(const std::filesystem::path& file, const nlohmann::json& identity);
  // Takes over the lines that were added since.
  void Read();
  // Of a picture as it is now, else null.
  const FieldPicture* Find(const std::string& run, const std::string& image, const FileStamp& stamp) const;
  const std::filesystem::path& file() const { return lines_.file(); }

 private:
  JsonLines lines_;
  std::map<std::pair<std::string, std::string>, std::pair<FileStamp, FieldPicture>> pictures_;
};

struct PendingPicture {
  const Run* run = nullptr;
  const ImageEntry* image = nullptr;
  FileStamp stamp;
};

// Tells files that are being copied from those that are there.
class FolderWatch {
 public:
  // Pictures that are not in the log, in order of runs and time, and how many of each run are still being copied: such
  // that changed within the last second, by their own time or since they were first seen like this.
  std::vector<PendingPicture> Pending(const Site& site, const PictureLog& log, std::map<std::string, int>* waiting);
  // The same of any file.
  bool IsStable(const std::filesystem::path& file, const FileStamp& stamp);

 private:
  struct Seen {
    FileStamp stamp;
    std::chrono::steady_clock::time_point since;
  };
  std::map<std::filesystem::path, Seen> last_;
};

// Looks for tags, blur and exposure in pictures and adds a line for each to the log as soon as it is done. In a process
// of its own: a picture that the detector dies of is recorded as unusable.
void LookAtPictures(const std::vector<PendingPicture>& pending, const DetectTagsOptions& options, PictureLog* log,
                    int threads, ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint

// A run that an import makes.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/geometry/rigid3.h"
#include "datasets/import/made_files.h"

namespace trigpoint {

// SITE/runs/<name>. Throws OptionError for a name that is none, InputError if the run is there.
std::filesystem::path NewRunPath(const std::filesystem::path& site, const std::string& name);

// Written in SITE/runs/.import-<name> and renamed when it is complete: a kill leaves no half run, and the next import
// of that name begins anew.
class RunFolder {
 public:
  RunFolder(const std::filesystem::path& site, const std::string& name);
  ~RunFolder();
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;
  const std::filesystem::path& dir() const { return dir_; }
  // Returns SITE/runs/<name>. Throws IoError.
  std::filesystem::path Complete();

 private:
  MadeFiles made_;
  std::filesystem::path final_, dir_;
};

struct RunImage {
  int64_t stamp_ns = 0;
  std::string file;    // relative to the run
  std::string camera;  // "": the only one
};

// DIR/images.txt, in the order of time and camera.
void WriteImageList(const std::filesystem::path& dir, std::vector<RunImage> images, const std::string& comment);

}  // namespace trigpoint

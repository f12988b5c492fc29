#include "datasets/project/demo_site.h"

#include <string>
#include <vector>

#include "calib/base/error.h"
#include "datasets/project/files.h"
#include "datasets/project/project.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

// Beside an installed program, else in the tree it was built from.
fs::path EmbeddedSite() {
  std::error_code ignored;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  const std::vector<fs::path> places = {program.parent_path().parent_path() / "share/trigpoint/parking_lot",
                                        fs::path(TRIGPOINT_SOURCE_DIR) / "datasets/parking_lot"};
  for (const fs::path& place : places) {
    if (fs::is_directory(place, ignored)) return place;
  }
  throw IoError("the embedded site was not found; expected " + places[0].string() + " or " + places[1].string() +
                ": install trigpoint completely");
}

// Complete or not at all, so that a copy that was cut short isn't taken for the site.
void CopySite(const fs::path& from, const fs::path& to) {
  const fs::path absolute = fs::absolute(to).lexically_normal();
  const fs::path target = absolute.has_filename() ? absolute : absolute.parent_path();
  const fs::path temporary = target.parent_path() / (std::string(kTemporaryPrefix) + target.filename().string());
  try {
    fs::remove_all(temporary);
    fs::create_directories(temporary);
    fs::copy(from, temporary, fs::copy_options::recursive);
    ReplaceFolder(temporary, target);
  } catch (const fs::filesystem_error& e) {
    std::error_code ignored;
    fs::remove_all(temporary, ignored);
    throw IoErrorFor(target, "written", e.code().value());
  }
}

}  // namespace

void MakeDemoSite(const fs::path& dir) {
  const bool there = fs::exists(dir) && !(fs::is_directory(dir) && fs::is_empty(dir));
  if (there && !fs::exists(dir / "trigpoint.yaml")) {
    throw InputError(dir.string() + " exists and is not a project; name a new folder: trigpoint demo DIR");
  }
  if (there) return;
  CopySite(EmbeddedSite(), dir);
  Project::Init(dir);
}

}  // namespace trigpoint

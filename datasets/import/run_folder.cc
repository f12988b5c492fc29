#include "datasets/import/run_folder.h"

#include <algorithm>
#include <tuple>

#include "calib/base/error.h"
#include "datasets/io/text.h"
#include "datasets/io/trajectory.h"

namespace trigpoint {

std::filesystem::path NewRunPath(const std::filesystem::path& site, const std::string& name) {
  if (name.empty() || name.find_first_of("/\\@") != std::string::npos || name.front() == '.') {
    throw OptionError("--name '" + name + "': expected a name for the new run, without / and @");
  }
  const std::filesystem::path dir = site / "runs" / name;
  if (std::filesystem::exists(dir)) {
    throw InputError(dir.string() + ": is there already; choose another --name, or remove it");
  }
  return dir;
}

RunFolder::RunFolder(const std::filesystem::path& site, const std::string& name)
    : final_(NewRunPath(site, name)), dir_(site / "runs" / (".import-" + name)) {
  std::error_code error;
  std::filesystem::remove_all(dir_, error);
  made_.Making(dir_);
  std::filesystem::create_directories(dir_, error);
  if (error) throw IoError(dir_.string() + ": cannot be made: " + error.message());
}

RunFolder::~RunFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(dir_, ignored);
}

std::filesystem::path RunFolder::Complete() {
  std::error_code error;
  std::filesystem::rename(dir_, final_, error);
  if (error) throw IoError(final_.string() + ": cannot be made: " + error.message());
  made_.Keep();
  return final_;
}

void WriteImageList(const std::filesystem::path& dir, std::vector<RunImage> images, const std::string& comment) {
  std::sort(images.begin(), images.end(), [](const RunImage& a, const RunImage& b) {
    return std::tie(a.stamp_ns, a.camera) < std::tie(b.stamp_ns, b.camera);
  });
  std::string text = "# timestamp file camera; " + comment + "\n";
  for (const RunImage& image : images) {
    text += FormatNsAsSeconds(image.stamp_ns) + " \"" + image.file + "\"";
    text += image.camera.empty() ? "\n" : " " + image.camera + "\n";
  }
  WriteFileAtomically(dir / "images.txt", text);
}

}  // namespace trigpoint

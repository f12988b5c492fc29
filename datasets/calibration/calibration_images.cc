#include "datasets/calibration/calibration_images.h"

#include <glob.h>

#include <algorithm>
#include <map>
#include <set>

#include "calib/base/error.h"
#include "datasets/io/natural_order.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

bool IsPicture(const fs::path& file) {
  static const std::set<std::string> kEndings = {".jpg", ".jpeg", ".png", ".tif", ".tiff",
                                                 ".bmp", ".pgm",  ".ppm", ".webp"};
  return kEndings.contains(Lower(file.extension().string()));
}

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

std::vector<fs::path> Matches(const std::string& pattern) {
  glob_t found{};
  std::vector<fs::path> files;
  if (glob(pattern.c_str(), GLOB_BRACE | GLOB_TILDE, nullptr, &found) == 0) {
    for (size_t i = 0; i < found.gl_pathc; ++i) {
      const fs::path path = fs::absolute(found.gl_pathv[i]).lexically_normal();
      std::error_code ignored;
      if (fs::is_directory(path, ignored)) {
        for (const auto& entry : fs::directory_iterator(path)) {
          if (entry.is_regular_file(ignored) && IsPicture(entry.path())) files.push_back(entry.path());
        }
      } else {
        files.push_back(path);  // named by the user: whatever its ending
      }
    }
  }
  globfree(&found);
  return files;
}

// The last run of digits in a file's name, without leading zeros; "" if there is none.
std::string LastNumber(const fs::path& file) {
  const std::string stem = file.stem().string();
  size_t end = stem.size();
  while (end > 0 && !IsDigit(stem[end - 1])) --end;
  size_t begin = end;
  while (begin > 0 && IsDigit(stem[begin - 1])) --begin;
  while (begin + 1 < end && stem[begin] == '0') ++begin;
  return stem.substr(begin, end - begin);
}

}  // namespace

std::vector<CalibrationImages> FindCalibrationImages(const std::string& patterns, const fs::path& base) {
  std::vector<CalibrationImages> cameras;
  size_t begin = 0;
  while (begin <= patterns.size()) {
    const size_t end = std::min(patterns.find(';', begin), patterns.size());
    std::string pattern = patterns.substr(begin, end - begin);
    begin = end + 1;
    if (pattern.empty()) continue;
    std::string name = "cam" + std::to_string(cameras.size());
    const size_t equals = pattern.find('=');
    if (equals != std::string::npos && pattern.find('/') > equals && equals > 0) {
      name = pattern.substr(0, equals);
      pattern = pattern.substr(equals + 1);
    }
    const std::vector<fs::path> files = Matches(pattern.front() == '~' ? pattern : (base / pattern).string());
    if (files.empty()) {
      throw InputError("--images " + pattern + ": no such pictures in " + base.string() +
                       " (put the pattern in quotes, so that the shell doesn't replace it)");
    }
    auto camera = std::find_if(cameras.begin(), cameras.end(), [&](const auto& c) { return c.camera == name; });
    if (camera == cameras.end()) {
      cameras.push_back({name, {}, {}});
      camera = cameras.end() - 1;
    }
    camera->files.insert(camera->files.end(), files.begin(), files.end());
  }
  if (cameras.empty()) throw InputError("--images: expected a pattern of picture files, found nothing");
  for (CalibrationImages& camera : cameras) {
    std::sort(camera.files.begin(), camera.files.end(),
              [](const fs::path& a, const fs::path& b) { return NaturalLess(a.string(), b.string()); });
    camera.files.erase(std::unique(camera.files.begin(), camera.files.end()), camera.files.end());
  }
  return cameras;
}

std::vector<std::string> PairFrames(std::vector<CalibrationImages>* cameras) {
  using Key = std::string (*)(const fs::path&);
  const auto stem = [](const fs::path& file) { return file.stem().string(); };
  // How many files of later cameras have a partner under a key; none if the key doesn't tell a camera's files apart.
  const auto partners = [&](Key key) {
    std::map<std::string, int> seen;
    for (const CalibrationImages& camera : *cameras) {
      std::set<std::string> own;
      for (const fs::path& file : camera.files) {
        if (!own.insert(key(file)).second) return 0;
      }
      for (const std::string& k : own) ++seen[k];
    }
    return static_cast<int>(std::count_if(seen.begin(), seen.end(), [](const auto& s) { return s.second > 1; }));
  };
  std::vector<std::string> frames;
  if (cameras->size() == 1) {
    CalibrationImages& camera = cameras->front();
    for (size_t i = 0; i < camera.files.size(); ++i) {
      camera.frame_of.push_back(static_cast<int>(i));
      frames.push_back(camera.files[i].stem().string());
    }
    return frames;
  }
  const Key key = partners(+stem) >= partners(&LastNumber) ? Key(+stem) : Key(&LastNumber);
  std::map<std::string, int> index;
  for (CalibrationImages& camera : *cameras) {
    for (const fs::path& file : camera.files) {
      const auto [it, fresh] = index.emplace(key(file), static_cast<int>(frames.size()));
      if (fresh) frames.push_back(it->first);
      camera.frame_of.push_back(it->second);
    }
  }
  return frames;
}

}  // namespace trigpoint

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>
#include <set>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "datasets/io/exif.h"
#include "datasets/io/lines.h"
#include "datasets/io/mask.h"
#include "datasets/io/midnight.h"
#include "datasets/io/readable.h"
#include "datasets/io/run_parts.h"
#include "datasets/io/tables.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

constexpr int64_t kNsPerSecond = 1'000'000'000;

int CameraIndex(const Run& run, std::string_view name) {
  for (size_t i = 0; i < run.cameras.size(); ++i) {
    if (run.cameras[i].name == name) return static_cast<int>(i);
  }
  return -1;
}

[[noreturn]] void FailUnknownCamera(const Run& run, std::string_view name) {
  std::vector<std::string> names;
  for (const BodyCamera& known : run.cameras) names.push_back(known.name);
  throw InputError("there is no camera '" + Excerpt(name) + "' in camchain.yaml; nearest: '" +
                   NearestName(name, names) + "'");
}

// `1000,500000 images/000100.jpg`; a file may have a number as its name, but hardly one without an ending.
bool HasDecimalComma(std::string_view line) {
  const std::vector<std::string_view> words = SplitFields(line);
  const auto is_digits = [](std::string_view text) {
    return !text.empty() && text.find_first_not_of("0123456789") == std::string_view::npos;
  };
  const size_t comma = words.front().find(',');
  return words.size() > 1 && comma != std::string_view::npos && is_digits(words.front().substr(0, comma)) &&
         is_digits(words.front().substr(comma + 1));
}

// `timestamp file [camera]`; a file name with spaces may be quoted, and need not if no camera follows.
ImageEntry ParseLine(const std::filesystem::path& site_dir, const Run& run, std::string_view line,
                     const std::string& where) {
  const size_t end = std::min(line.find_first_of(" \t,;"), line.size());
  if (HasDecimalComma(line)) {
    throw InputError("found the time '" + Excerpt(SplitFields(line).front()) +
                     "' with a decimal comma; expected a dot");
  }
  ImageEntry entry;
  entry.stamp_ns = ParseSecondsToNs(line.substr(0, end));
  std::string_view rest = end < line.size() ? Trim(line.substr(end + 1)) : std::string_view();
  std::string_view camera;
  if (rest.starts_with('"') && rest.find('"', 1) != std::string_view::npos) {
    const size_t close = rest.find('"', 1);
    camera = Trim(rest.substr(close + 1));
    if (camera.starts_with(',')) camera = Trim(camera.substr(1));
    rest = rest.substr(1, close - 1);
  } else {
    const size_t space = rest.find_last_of(" \t,");
    if (space != std::string_view::npos && CameraIndex(run, Trim(rest.substr(space))) >= 0) {
      camera = Trim(rest.substr(space));
    } else if (space != std::string_view::npos && CameraIndex(run, rest.substr(space + 1)) >= 0) {
      camera = rest.substr(space + 1);
    }
    if (!camera.empty()) rest = Trim(rest.substr(0, space));
  }
  if (rest.empty()) throw InputError("expected 'timestamp file [camera]', found '" + Excerpt(line) + "'");
  entry.file = rest;
  entry.camera = camera.empty() ? 0 : CameraIndex(run, camera);
  if (entry.camera < 0) FailUnknownCamera(run, camera);
  entry.path = ResolveInside(site_dir, run.dir, entry.file, where);
  const size_t last = entry.file.find_last_of(" \t");
  const auto exists = [](const std::filesystem::path& path) {
    std::error_code too_long;
    return std::filesystem::exists(path, too_long);
  };
  if (camera.empty() && last != std::string::npos && !exists(entry.path) &&
      exists(ResolveInside(site_dir, run.dir, Trim(entry.file.substr(0, last)), where))) {
    FailUnknownCamera(run, std::string_view(entry.file).substr(last + 1));
  }
  CheckPresent(entry.path, where);
  return entry;
}

// A picture is taken once: one that stands at two times is left out, as nothing shows which of them is right.
void DropAmbiguous(const std::filesystem::path& file, const std::vector<int>& lines, Run* run) {
  std::map<std::filesystem::path, std::vector<size_t>> rows;
  for (size_t i = 0; i < run->images.size(); ++i) rows[run->images[i].path].push_back(i);
  std::vector<bool> out(run->images.size(), false);
  size_t ambiguous = 0;
  std::string first;
  for (const auto& [path, same] : rows) {
    const ImageEntry& a = run->images[same.front()];
    size_t other = 0;
    for (size_t k = 1; k < same.size() && other == 0; ++k) {
      const ImageEntry& b = run->images[same[k]];
      if (a.stamp_ns != b.stamp_ns || a.camera != b.camera) other = k;
    }
    if (other == 0) continue;
    for (size_t i : same) out[i] = true;
    if (ambiguous++ > 0) continue;
    first = FileLine(file, lines[same[other]]) + ": the image '" + a.file +
            "' is listed at another time or camera in line " + std::to_string(lines[same.front()]) +
            "; expected one line for each image; it is left out";
  }
  if (ambiguous == 0) return;
  run->warnings.push_back(first +
                          (ambiguous > 1 ? " (and " + std::to_string(ambiguous - 1) + " more such images)" : ""));
  size_t kept = 0;
  for (size_t i = 0; i < out.size(); ++i) {
    if (!out[i]) run->images[kept++] = run->images[i];
  }
  run->images.resize(kept);
  if (kept == 0) throw InputError(first + "; none of the listed images is usable");
}

void ReadTable(const std::filesystem::path& site_dir, const std::filesystem::path& file, Run* run) {
  const std::string text = ReadTextFile(file);
  std::string first_problem;
  std::vector<int> lines;  // of each image
  int skipped = 0;
  constexpr int kNamed = 5;
  for (const auto& [line, number] : DataLines(text)) {
    const std::string where = FileLine(file, number);
    try {
      run->images.push_back(ParseLine(site_dir, *run, line, where));
      lines.push_back(number);
    } catch (const PathError&) {
      throw;
    } catch (const InputError& e) {
      std::string problem = e.what();
      if (!problem.starts_with(where)) problem = where + ": " + problem;
      if (skipped++ == 0) first_problem = problem;
      if (skipped <= kNamed) run->warnings.push_back(problem + "; the image is skipped");
    }
  }
  if (skipped > kNamed) {
    run->warnings.push_back(file.string() + ": skipped " + Counted(skipped - kNamed, "more image"));
  }
  if (run->images.empty() && skipped > 0) throw InputError(first_problem + "; none of the listed images is usable");
  DropAmbiguous(file, lines, run);
}

// Times from file names: nanoseconds or seconds since 1970 or on any clock, if every name looks like one.
bool StampsFromNames(std::vector<ImageEntry>* images) {
  for (ImageEntry& image : *images) {
    const std::string stem = image.path.stem().string();
    if (stem.find_first_not_of("0123456789.") != std::string::npos) return false;
    const bool fraction = stem.find('.') != std::string::npos;
    // 000123 and 0000000123 count, they do not tell the time; 15 digits are nanoseconds of any clock.
    if (!fraction && (stem.size() < 10 || (stem.size() < 15 && stem.front() == '0'))) return false;
    try {
      image.stamp_ns = ParseSecondsToNs(stem);
    } catch (const InputError&) {
      return false;
    }
  }
  return true;
}

// Cameras may write whole seconds: images of one time are put evenly between it and the next one, a second later at
// most, in the order of their names. Returns how many have the time of another one; none has a time if all have one.
std::optional<size_t> SpreadEqualTimes(std::vector<ImageEntry>* images) {
  std::map<std::pair<int, int64_t>, std::vector<ImageEntry*>> by_time;  // of each camera
  std::set<int64_t> times;
  for (ImageEntry& image : *images) {
    by_time[{image.camera, image.stamp_ns}].push_back(&image);
    times.insert(image.stamp_ns);
  }
  if (times.size() == 1 && by_time.size() < images->size()) return std::nullopt;
  for (auto it = by_time.begin(); it != by_time.end(); ++it) {
    const auto& [camera, stamp_ns] = it->first;
    const auto next = std::next(it);
    int64_t room_ns = kNsPerSecond;
    if (next != by_time.end() && next->first.first == camera) {
      room_ns = std::min(room_ns, next->first.second - stamp_ns);
    }
    const auto same = static_cast<int64_t>(it->second.size());
    for (int64_t k = 0; k < same; ++k) it->second[static_cast<size_t>(k)]->stamp_ns += room_ns * k / same;
  }
  return images->size() - by_time.size();
}

// Why EXIF does not give the images' times; empty: it does.
std::string StampsFromExif(std::vector<ImageEntry>* images, Run* run) {
  bool zone_known = true;
  for (ImageEntry& image : *images) {
    try {
      const PhotoMetadata metadata = ReadPhotoMetadata(image.path);
      if (!metadata.taken_utc_ns) return image.file + " states none";
      zone_known = zone_known && metadata.taken_zone_known;
      image.stamp_ns = *metadata.taken_utc_ns - run->config.time_zero_utc_ns.value_or(0);
    } catch (const InputError& e) {
      return e.what();
    }
  }
  const std::optional<size_t> moved = SpreadEqualTimes(images);
  if (!moved) return "all state the same";
  if (*moved > 0) {
    run->warnings.push_back(run->dir.string() + ": EXIF states the same time for several images (" +
                            Counted(*moved, "image") + " beyond the first of each time); those of one second are put " +
                            "evenly into it, in the order of their names");
  }
  if (!zone_known) {
    run->warnings.push_back(run->dir.string() + ": the images' times are from EXIF without a time zone and taken " +
                            "as UTC; if they are local time, list the images in images.txt");
  }
  return "";
}

// Masks may lie among the images: pictures that run.yaml names, and those that a folder it names has for another image.
std::set<std::filesystem::path> MasksAmong(const std::vector<std::filesystem::path>& pictures, const Run& run) {
  std::set<std::filesystem::path> masks;
  for (const auto& [camera, mask] : run.config.masks) {
    for (const std::filesystem::path& named : mask.pictures) {
      masks.insert(named);
      if (!std::filesystem::is_directory(named)) continue;
      for (const std::filesystem::path& picture : pictures) {
        masks.insert(MaskInFolder(named, picture.lexically_relative(run.dir).string(), picture));
      }
    }
  }
  return masks;
}

void ReadFolders(Run* run) {
  std::vector<ImageEntry> images;
  const auto add = [&](const std::filesystem::path& dir, int camera) {
    const std::vector<std::filesystem::path> pictures = PicturesIn(dir);
    const std::set<std::filesystem::path> masks = MasksAmong(pictures, *run);
    for (const std::filesystem::path& file : pictures) {
      if (masks.contains(file)) continue;
      try {
        CheckPresent(file, run->dir.string());
        images.push_back({0, file.lexically_relative(run->dir).string(), file, camera, -1});
      } catch (const InputError& e) {
        run->warnings.push_back(std::string(e.what()) + "; the image is skipped");
      }
    }
  };
  for (const std::filesystem::path& dir : {run->dir / "images", run->dir}) {
    add(dir, 0);
    if (!images.empty()) break;
    for (size_t i = 0; i < run->cameras.size(); ++i) {
      add(dir / run->cameras[i].name, static_cast<int>(i));
      add(dir / run->cameras[i].name / "data", static_cast<int>(i));  // EuRoC
    }
    if (!images.empty()) break;
  }
  if (images.empty()) return;
  if (!StampsFromNames(&images)) {
    if (const std::string missing = StampsFromExif(&images, run); !missing.empty()) {
      std::vector<int64_t> next(std::max<size_t>(run->cameras.size(), 1), 0);
      for (ImageEntry& image : images) image.stamp_ns = kNsPerSecond * next[static_cast<size_t>(image.camera)]++;
      run->warnings.push_back(run->dir.string() +
                              ": neither the names nor the EXIF of the images have a time for each " + "of them (" +
                              missing + "); they are numbered one a second. Odometry and GPS must use " +
                              "that clock, else list 'timestamp file' in images.txt");
    }
  }
  run->images = std::move(images);
}

void ReadVideos(Run* run) {
  std::vector<std::filesystem::path> videos;
  for (const auto& entry : std::filesystem::directory_iterator(run->dir)) {
    if (entry.is_regular_file() && IsVideoName(entry.path())) videos.push_back(entry.path());
  }
  std::sort(videos.begin(), videos.end());
  for (const std::filesystem::path& video : videos) {
    int camera = CameraIndex(*run, video.stem().string());
    if (camera < 0 && videos.size() == 1) camera = 0;
    if (camera < 0) {
      run->warnings.push_back(video.string() + ": there are several videos and none of the cameras is named '" +
                              video.stem().string() + "'; the video is skipped");
      continue;
    }
    CheckPresent(video, run->dir.string());
    const std::vector<int64_t> times = VideoFrameTimes(video);
    const int64_t start = std::llround(run->config.video_start_s * 1e9);
    for (size_t i = 0; i < times.size(); i += static_cast<size_t>(run->config.video_every)) {
      char number[32];
      std::snprintf(number, sizeof(number), "#%06zu", i);
      run->images.push_back({start + times[i], video.filename().string() + number, video, camera, static_cast<int>(i)});
    }
  }
}

// A camera takes one picture at a time: of several at one time none is used, as nothing shows whose time is wrong. One
// that is listed twice is kept once. The images are sorted by time and camera.
void DropSimultaneous(Run* run) {
  auto& images = run->images;
  const auto same = [](const ImageEntry& a, const ImageEntry& b) {
    return a.stamp_ns == b.stamp_ns && a.camera == b.camera;
  };
  const auto twice = [&](const ImageEntry& a, const ImageEntry& b) {
    return same(a, b) && a.path == b.path && a.video_frame == b.video_frame;
  };
  images.erase(std::unique(images.begin(), images.end(), twice), images.end());
  const bool whole =
      std::all_of(images.begin(), images.end(), [](const ImageEntry& i) { return i.stamp_ns % 1'000'000'000 == 0; });
  std::vector<ImageEntry> kept;
  std::string first;
  for (size_t i = 0; i < images.size();) {
    size_t end = i + 1;
    while (end < images.size() && same(images[i], images[end])) ++end;
    if (end == i + 1) {
      kept.push_back(images[i]);
    } else if (first.empty()) {
      first = "'" + images[i].file + "' and '" + images[i + 1].file + "'";
    }
    i = end;
  }
  if (first.empty()) return;
  run->warnings.push_back(
      run->dir.string() + ": left out " + Counted(images.size() - kept.size(), "image") +
      " with the time of another image of the same camera (" + first + "), as nothing shows which time is right; " +
      (whole ? "all times are whole seconds: give them to a millisecond" : "give each image its own time"));
  images = std::move(kept);
}

}  // namespace

void ReadImageList(const std::filesystem::path& site_dir, Run* run) {
  const std::filesystem::path list = run->dir / "images.txt";
  if (std::filesystem::exists(list)) {
    ReadTable(site_dir, list, run);
  } else if (run->detections.empty()) {
    ReadFolders(run);
    if (run->images.empty()) ReadVideos(run);
  }
  const auto key = [](const ImageEntry& image) { return std::pair(image.stamp_ns, image.camera); };
  const auto earlier = [&](const ImageEntry& a, const ImageEntry& b) { return key(a) < key(b); };
  auto& images = run->images;
  if (!std::is_sorted(images.begin(), images.end(), earlier)) {
    std::vector<int64_t> stamps;
    for (const ImageEntry& image : images) stamps.push_back(image.stamp_ns);
    RequireNoMidnight(std::filesystem::exists(list) ? list : run->dir, stamps);
    const auto later = [](const ImageEntry& a, const ImageEntry& b) { return a.stamp_ns < b.stamp_ns; };
    if (std::filesystem::exists(list) && !std::is_sorted(images.begin(), images.end(), later)) {
      run->warnings.push_back(list.string() + ": timestamps are out of order; the images were sorted by time");
    }
    std::stable_sort(images.begin(), images.end(), earlier);
  }
  DropSimultaneous(run);
}

}  // namespace trigpoint

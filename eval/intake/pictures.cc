#include "eval/intake/pictures.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "calib/base/parallel.h"
#include "datasets/io/image.h"
#include "datasets/io/mask.h"
#include "datasets/io/picture_parts.h"
#include "datasets/project/forked.h"
#include "survey/tags/detection_json.h"
#include "survey/tags/tag_finder.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int64_t kStable_ns = 1'000'000'000;
constexpr double kSearched_px = 2400;  // longer side of what is searched for tags: keeps up with a camera

// Short: there are hundreds a picture.
json HundredthsOf(const std::vector<float>& values) {
  json list = json::array();
  for (const float value : values) list.push_back(std::lround(100 * value));
  return list;
}

std::vector<float> FromHundredths(const json& list) {
  std::vector<float> values;
  for (const json& value : list) values.push_back(value.get<float>() / 100);
  return values;
}

json JsonOfQuality(const PictureQuality& q) {
  json cells = json::array();
  for (const auto& cell : q.cell_blur_px) cells.push_back(cell ? json(*cell) : json());
  return {q.mean,
          q.dark,
          q.bright,
          q.blur_px ? json(*q.blur_px) : json(),
          cells,
          HundredthsOf(q.energy.sharp),
          HundredthsOf(q.energy.reblurred)};
}

PictureQuality QualityOf(const json& j) {
  const auto blur = [](const json& b) { return b.is_null() ? std::nullopt : std::optional<double>(b.get<double>()); };
  PictureQuality q;
  q.mean = j.at(0);
  q.dark = j.at(1);
  q.bright = j.at(2);
  q.blur_px = blur(j.at(3));
  for (size_t k = 0; k < q.cell_blur_px.size(); ++k) q.cell_blur_px[k] = blur(j.at(4).at(k));
  q.energy.sharp = FromHundredths(j.at(5));
  q.energy.reblurred = FromHundredths(j.at(6));
  q.energy.rows = static_cast<int>(q.energy.sharp.size()) / kEnergyColumns;
  return q;
}

json LineOf(const PendingPicture& pending, const std::string& problem, const std::optional<PictureQuality>& quality,
            const std::vector<TagDetection>& tags) {
  json found = json::array();
  for (const TagDetection& tag : tags) found.push_back(JsonOf(tag));
  return {{"run", pending.run->name},
          {"image", pending.image->file},
          {"size", pending.stamp.size},
          {"changed_ns", pending.stamp.changed_ns},
          {"mask", pending.stamp.mask},
          {"problem", problem},
          {"quality", quality ? JsonOfQuality(*quality) : json()},
          {"tags", found}};
}

// Pictures of one run.
void LookAtRun(const std::vector<PendingPicture>& pending, const DetectTagsOptions& options, const fs::path& log,
               int threads, ProgressSink& progress, const CancelToken& cancel) {
  JsonAppender appender(log);
  const Run& run = *pending.front().run;
  const auto entry = [&](int64_t i) -> const ImageEntry& { return *pending[static_cast<size_t>(i)].image; };
  const auto camera = [&](int64_t i) -> const Camera* {
    const auto index = static_cast<size_t>(entry(i).camera);
    return index < run.cameras.size() ? &run.cameras[index].camera : nullptr;
  };
  const RunMasks masks(run);
  TagFinder finder(options);
  progress.Begin("looking at pictures of " + run.name, static_cast<int64_t>(pending.size()));
  ParallelFor(static_cast<int64_t>(pending.size()), threads, cancel, [&](int64_t i) {
    std::optional<PictureQuality> quality;
    int64_t refused = 0;
    cv::Mat mask;
    ImageTags tags = finder.Find(
        [&] {
          cv::Mat grey = LoadGrey(run, entry(i));
          mask = masks.Of(entry(i));
          quality = MeasurePicture(grey, mask);
          return grey;
        },
        camera(i), &refused);
    std::erase_if(tags.detections, [&](const TagDetection& tag) { return IsMasked(tag, mask); });
    appender.Add(LineOf(pending[static_cast<size_t>(i)], tags.problem, quality, tags.detections));
    progress.Advance(1);
  });
}

// Large pictures are searched at a fraction of their size.
DetectTagsOptions OptionsFor(const Run& run, DetectTagsOptions options) {
  double side = 0;
  for (const BodyCamera& camera : run.cameras) {
    side = std::max<double>(
        {side, static_cast<double>(camera.camera.width()), static_cast<double>(camera.camera.height())});
  }
  if (side > kSearched_px) options.quad_decimate = std::max(options.quad_decimate, std::ceil(side / kSearched_px));
  return options;
}

}  // namespace

FileStamp StampOf(const fs::path& file) {
  struct stat its {};
  if (stat(file.c_str(), &its) != 0) return {};
  return {its.st_size, its.st_mtim.tv_sec * 1'000'000'000LL + its.st_mtim.tv_nsec};
}

std::string MaskStamp(const Run& run, const ImageEntry& image) {
  const auto index = static_cast<size_t>(image.camera);
  if (index >= run.cameras.size()) return "";
  const CameraMask& masks = run.cameras[index].mask;
  std::string text;
  for (const Eigen::Vector4d& box : masks.boxes_px) {
    text += fmt::format("box {} {} {} {};", box(0), box(1), box(2), box(3));
  }
  const auto add = [&](const fs::path& file) {
    const FileStamp stamp = StampOf(file);
    text += fmt::format("{} {} {};", file.filename().string(), stamp.size, stamp.changed_ns);
  };
  for (const fs::path& picture : masks.pictures) add(picture);
  for (const fs::path& folder : masks.folders) {
    if (const fs::path file = MaskInFolder(folder, PictureOf(run, image), image.path); !file.empty()) add(file);
  }
  return text;
}

PictureLog::PictureLog(const fs::path& file, const json& identity) : lines_(file, identity) { Read(); }

void PictureLog::Read() {
  lines_.Read([&](const json& j) {
    FieldPicture picture;
    picture.image = j.at("image");
    picture.problem = j.at("problem");
    if (!j.at("quality").is_null()) picture.quality = QualityOf(j.at("quality"));
    for (const json& tag : j.at("tags")) picture.tags.push_back(DetectionOf(tag));
    const std::pair<std::string, std::string> key = {j.at("run"), picture.image};
    pictures_[key] = {FileStamp{j.at("size"), j.at("changed_ns"), j.at("mask")}, std::move(picture)};
  });
}

const FieldPicture* PictureLog::Find(const std::string& run, const std::string& image, const FileStamp& stamp) const {
  const auto it = pictures_.find({run, image});
  return it != pictures_.end() && it->second.first == stamp ? &it->second.second : nullptr;
}

bool FolderWatch::IsStable(const fs::path& file, const FileStamp& stamp) {
  const auto now = std::chrono::steady_clock::now();
  const auto [it, fresh] = last_.try_emplace(file, Seen{stamp, now});
  const bool same = it->second.stamp == stamp;
  if (!same) it->second = {stamp, now};
  // A camera or server whose clock is ahead dates its files in the future: their age counts from when they were first
  // seen with that date.
  const auto ns = [](auto duration) { return std::chrono::nanoseconds(duration).count(); };
  const int64_t age_ns = ns(std::chrono::system_clock::now().time_since_epoch()) - stamp.changed_ns;
  return same && stamp.size > 0 && std::max(age_ns, int64_t{ns(now - it->second.since)}) > kStable_ns;
}

std::vector<PendingPicture> FolderWatch::Pending(const Site& site, const PictureLog& log,
                                                 std::map<std::string, int>* waiting) {
  std::vector<PendingPicture> pending;
  std::map<fs::path, std::pair<FileStamp, bool>> stamps;  // a video has many pictures
  for (const Run& run : site.runs) {
    for (const ImageEntry& image : run.images) {
      const auto [it, fresh] = stamps.try_emplace(image.path);
      if (fresh) {
        it->second.first = StampOf(image.path);
        it->second.second = IsStable(image.path, it->second.first);
      }
      auto [stamp, stable] = it->second;
      stamp.mask = MaskStamp(run, image);
      if (log.Find(run.name, image.file, stamp) != nullptr) continue;
      if (stable) {
        pending.push_back({&run, &image, stamp});
      } else if (stamp.size >= 0) {
        ++(*waiting)[run.name];
      }
    }
  }
  return pending;
}

void LookAtPictures(const std::vector<PendingPicture>& pending, const DetectTagsOptions& options, PictureLog* log,
                    int threads, ProgressSink& progress, const CancelToken& cancel) {
  const auto look = [&](const std::vector<PendingPicture>& pictures) {
    const Run& run = *pictures.front().run;
    RunForked(
        "run " + run.name + ": looking at " + pictures.front().image->file,
        [&](ProgressSink& its) {
          LookAtRun(pictures, OptionsFor(run, options), log->file(), threads, its, cancel);
          return std::string();
        },
        progress, cancel);
  };
  for (size_t begin = 0; begin < pending.size();) {
    size_t end = begin;
    while (end < pending.size() && pending[end].run == pending[begin].run) ++end;
    std::vector<PendingPicture> pictures(pending.begin() + static_cast<std::ptrdiff_t>(begin),
                                         pending.begin() + static_cast<std::ptrdiff_t>(end));
    begin = end;
    try {
      look(pictures);
    } catch (const Cancelled&) {
      throw;
    } catch (const IoError&) {
      throw;
    } catch (const Error&) {
      // The detector failed on one of them, so the rest is processed one by one.
      log->Read();
      std::erase_if(pictures,
                    [&](const PendingPicture& p) { return log->Find(p.run->name, p.image->file, p.stamp) != nullptr; });
      for (const PendingPicture& picture : pictures) {
        try {
          look({picture});
        } catch (const Cancelled&) {
          throw;
        } catch (const Error& e) {
          JsonAppender(log->file()).Add(LineOf(picture, e.what(), std::nullopt, {}));
        }
      }
    }
    log->Read();
  }
}

}  // namespace trigpoint

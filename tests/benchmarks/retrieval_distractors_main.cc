// Image retrieval with many wrong panoramas beside the right ones:
//   retrieval_distractors LOT_A LOT_A_TRUTH [--distractors 500] [--width 2048] [--features 3000] [--words N]
//                         [--threads 0] [--cache FILE]
// Puts the views of synthetic street panoramas beside those of the site's own, retrieves the views of every image of
// run1 by the product's own function, and prints which share of the images has the right panoramas among the best
// ten, the time of a query and the memory. FILE keeps all descriptors for the next time.
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <map>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/base/error.h"
#include "calib/base/parallel.h"
#include "datasets/io/image.h"
#include "datasets/io/site.h"
#include "datasets/io/views.h"
#include "localize/reconstruct/features.h"
#include "localize/references/registration.h"
#include "tests/synthetic/distractors.h"

namespace trigpoint {
namespace {

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

// Remembers at which processor time each task began: on one thread it does not depend on what else the machine does.
class TaskTimes final : public ProgressSink {
 public:
  void Begin(std::string_view task, int64_t) override { begun_[std::string(task)] = std::clock(); }
  double CpuSince(const std::string& task) const {
    return static_cast<double>(std::clock() - begun_.at(task)) / CLOCKS_PER_SEC;
  }

 private:
  std::map<std::string, std::clock_t> begun_;
};

FeatureSet DescriptorsOnly(FeatureSet features) { return {{}, {}, {}, std::move(features.descriptors)}; }

std::vector<FeatureSet> ViewFeatures(const cv::Mat& grey, const FeatureOptions& options) {
  std::vector<FeatureSet> features;
  for (const View& view : PanoramaViews("", grey.cols, {}).views) {
    features.push_back(DescriptorsOnly(ExtractFeatures(RenderView(grey, view), {}, options)));
  }
  return features;
}

// Descriptors of groups of pictures whose numbers are known: number of rows, then the rows, picture by picture.
using Groups = std::vector<std::vector<FeatureSet>>;

bool ReadCache(const std::string& file, Groups* groups) {
  std::ifstream in(file, std::ios::binary);
  for (std::vector<FeatureSet>& group : *groups) {
    for (FeatureSet& picture : group) {
      int32_t rows = 0;
      if (!in.read(reinterpret_cast<char*>(&rows), sizeof rows) || rows < 0) return false;
      picture.descriptors = cv::Mat::zeros(rows, 128, CV_8U);
      if (rows > 0 && !in.read(reinterpret_cast<char*>(picture.descriptors.data), rows * 128L)) return false;
    }
  }
  return true;
}

void WriteCache(const std::string& file, const Groups& groups) {
  std::ofstream out(file, std::ios::binary);
  for (const std::vector<FeatureSet>& group : groups) {
    for (const FeatureSet& picture : group) {
      const int32_t rows = picture.descriptors.rows;
      out.write(reinterpret_cast<const char*>(&rows), sizeof rows);
      if (rows > 0) out.write(reinterpret_cast<const char*>(picture.descriptors.data), rows * 128L);
    }
  }
  if (!out.flush()) throw IoError(file + ": cannot be written");
}

// Of every image and every panorama within 12 m of it: is the panorama among the best ten panoramas (views)?
struct Recall {
  int pairs = 0, in_panoramas = 0, in_views = 0;
  int near_images = 0, any = 0, nearest = 0;  // images; with any, with the nearest of these panoramas
};

// `station` of each of the site's own panoramas, which are the first references.
Recall MeasureRecall(const Retrieval& found, const Run& run, const Trajectory& cameras, const std::vector<int>& station,
                     const std::map<int, Eigen::Vector3d>& places) {
  Recall recall;
  for (size_t i = 0; i < run.images.size(); ++i) {
    const std::optional<Rigid3d> pose = cameras.At(run.images[i].stamp_ns, 1);
    if (!pose) continue;
    std::vector<int> ranking;  // panoramas by their best view
    const auto& hits = found.of_image[i];
    for (const Retrieval::Hit& hit : hits) {
      if (std::find(ranking.begin(), ranking.end(), hit.reference) == ranking.end()) ranking.push_back(hit.reference);
    }
    ranking.resize(std::min<size_t>(ranking.size(), 10));
    double best = 1e9;
    bool near = false, hit_any = false, hit_nearest = false;
    for (size_t r = 0; r < station.size(); ++r) {
      const double distance = (places.at(station[r]) - pose->translation).norm();
      if (distance > 12) continue;
      const bool found_it = std::find(ranking.begin(), ranking.end(), static_cast<int>(r)) != ranking.end();
      near = true;
      hit_any = hit_any || found_it;
      if (distance < best) best = distance, hit_nearest = found_it;
      ++recall.pairs;
      recall.in_panoramas += found_it;
      for (size_t k = 0; k < std::min<size_t>(10, hits.size()); ++k) {
        if (hits[k].reference == static_cast<int>(r)) {
          ++recall.in_views;
          break;
        }
      }
    }
    recall.near_images += near;
    recall.any += hit_any;
    recall.nearest += hit_nearest;
  }
  return recall;
}

int Main(int argc, char** argv) {
  CLI::App app("Image retrieval with many wrong panoramas beside the right ones");
  std::string site_dir, truth_dir, cache;
  int distractors = 500, threads = 0;
  DistractorOptions distractor;
  FeatureOptions feature;
  RetrievalOptions retrieval;
  app.add_option("site", site_dir, "site with run1 and panoramas")->required();
  app.add_option("truth", truth_dir, "its truth: panoramas.tum, runs/run1_cameras.tum")->required();
  app.add_option("--distractors", distractors, "panoramas of other streets");
  app.add_option("--width", distractor.width, "of their pictures, px");
  app.add_option("--features", feature.max_features, "at most, a view or image");
  app.add_option("--words", retrieval.words, "of the codebook");
  app.add_option("--threads", threads, "of the extraction; queries are timed on one");
  app.add_option("--cache", cache, "keeps all descriptors for the next time");
  CLI11_PARSE(app, argc, argv);
  cv::setNumThreads(1);
  const CancelToken cancel;

  const Site site = ReadSite(site_dir);
  const Run run = ReadRun(std::filesystem::path(site_dir) / "runs" / "run1", site_dir);
  std::map<int, Eigen::Vector3d> places;
  for (const TimedPose& p : ReadTrajectory(std::filesystem::path(truth_dir) / "panoramas.tum").poses) {
    places[static_cast<int>(p.stamp_ns / 1000000000)] = p.target_from_body.translation;
  }
  const Trajectory cameras = ReadTrajectory(std::filesystem::path(truth_dir) / "runs" / "run1_cameras.tum");

  std::vector<const Reference*> panoramas;
  for (const Reference& reference : site.references) {
    if (reference.kind == ReferenceKind::kPanorama) panoramas.push_back(&reference);
  }
  // The site's panoramas, the distractors, and last the images; each panorama has its eight views.
  const size_t own = panoramas.size(), documents = own + static_cast<size_t>(distractors);
  Groups groups(documents, std::vector<FeatureSet>(8));
  groups.emplace_back(run.images.size());
  std::vector<FeatureSet>& images = groups.back();
  const Clock::time_point start = Clock::now();
  if (cache.empty() || !ReadCache(cache, &groups)) {
    ParallelFor(static_cast<int64_t>(documents + images.size()), threads, cancel, [&](int64_t k) {
      const size_t i = static_cast<size_t>(k);
      if (i < own) {
        groups[i] = ViewFeatures(LoadPicture(panoramas[i]->files.front(), true), feature);
      } else if (i < documents) {
        cv::Mat grey;
        cv::cvtColor(MakeDistractorPanorama(distractor, 1000 + i - own, 1), grey, cv::COLOR_BGR2GRAY);
        groups[i] = ViewFeatures(grey, feature);
      } else {
        images[i - documents] = DescriptorsOnly(ExtractFeatures(LoadGrey(run, run.images[i - documents]), {}, feature));
      }
    });
    if (!cache.empty()) WriteCache(cache, groups);
  }
  LocalizeInput input;
  std::vector<int> station;  // of the site's own panoramas
  size_t features[2] = {0, 0};
  for (size_t i = 0; i < documents; ++i) {
    ReferenceViews& r = input.references.emplace_back();
    r.name = i < own ? panoramas[i]->name : "distractor";
    r.rig = PanoramaViews(r.name, i < own ? 4096 : distractor.width, {});
    for (const FeatureSet& view : groups[i]) features[i < own ? 0 : 1] += static_cast<size_t>(view.descriptors.rows);
    if (i >= own) continue;
    const std::string& name = panoramas[i]->station;
    station.push_back(std::stoi(name.substr(name.find_first_of("0123456789"))));
  }
  std::printf("%zu panoramas and %zu images of the site, %d distractors: features in %.0f s\n", own, images.size(),
              distractors, SecondsSince(start));
  std::printf("features a view: the site's %.0f, distractors' %.0f\n",
              static_cast<double>(features[0]) / static_cast<double>(8 * own),
              static_cast<double>(features[1]) / std::max(1, 8 * distractors));

  for (size_t i = 0; i < images.size(); ++i) input.images.push_back({run.images[i].stamp_ns, run.images[i].file});
  input.image_features = [&](int i) { return images[i]; };
  input.view_features = [&](int r, int v) { return groups[r][v]; };
  retrieval.top_k = 400;
  TaskTimes times;
  const Retrieval found = RetrieveViews(input, retrieval, true, 1, 1, times, cancel);
  const double query_ms = 1e3 * times.CpuSince("retrieval") / static_cast<double>(images.size());
  const double build_s = times.CpuSince("codebook") - times.CpuSince("retrieval");

  const Recall recall = MeasureRecall(found, run, cameras, station, places);
  const auto percent = [](int n, int of) { return of > 0 ? 100.0 * n / of : 0.0; };
  std::printf("documents %zu, words %d, codebook and index %.1f CPU-seconds, index %.1f MiB\n", 8 * documents,
              found.words, build_s, found.memory_mib);
  std::printf("images within 12 m of a panorama: %d (%d pairs)\n", recall.near_images, recall.pairs);
  std::printf("nearest panorama among the best 10 panoramas: %.1f %% of images\n",
              percent(recall.nearest, recall.near_images));
  std::printf("any panorama within 12 m among the best 10 panoramas: %.1f %% of images\n",
              percent(recall.any, recall.near_images));
  std::printf("every pair: panorama among the best 10 panoramas: %.1f %%, among the best 10 views: %.1f %%\n",
              percent(recall.in_panoramas, recall.pairs), percent(recall.in_views, recall.pairs));
  std::printf("query: %.2f CPU-ms an image (words and ranking, without SIFT)\n", query_ms);
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::printf("peak memory of this program, all descriptors held: %.0f MiB\n",
              static_cast<double>(usage.ru_maxrss) / 1024);
  return 0;
}

}  // namespace
}  // namespace trigpoint

int main(int argc, char** argv) {
  try {
    return trigpoint::Main(argc, argv);
  } catch (const trigpoint::Error& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return e.ExitCode();
  }
}

// Throughput of tag detection against the AprilTag library alone, with the same settings, pictures and threads:
//   tag_detection FOLDER [--runs 10] [--threads 0] [--decimate 1] [--pictures 24]
// Both see pictures that are in memory. The runs take turns; medians are compared, and what refinement costs is stated.
#include <apriltag/apriltag.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <opencv2/imgcodecs.hpp>

#include "calib/base/error.h"
#include "calib/base/parallel.h"
#include "survey/tags/detection.h"
#include "survey/tags/tag_family.h"

namespace trigpoint {
namespace {

double Seconds(const std::function<void()>& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return 0.5 * (values[values.size() / 2] + values[(values.size() - 1) / 2]);
}

// Each worker has a detector of the library; pictures are handed out as ParallelFor does it.
void LibraryAlone(const std::vector<cv::Mat>& pictures, int threads, const std::vector<apriltag_detector_t*>& detectors,
                  std::atomic<int>* found) {
  const CancelToken cancel;
  std::mutex mutex;
  std::vector<apriltag_detector_t*> idle = detectors;
  ParallelFor(static_cast<int64_t>(pictures.size()), threads, cancel, [&](int64_t i) {
    apriltag_detector_t* detector = nullptr;
    {
      const std::lock_guard lock(mutex);
      detector = idle.back();
      idle.pop_back();
    }
    const cv::Mat& grey = pictures[static_cast<size_t>(i)];
    image_u8_t image{grey.cols, grey.rows, static_cast<int32_t>(grey.step[0]), grey.data};
    zarray_t* detections = apriltag_detector_detect(detector, &image);
    *found += zarray_size(detections);
    apriltag_detections_destroy(detections);
    const std::lock_guard lock(mutex);
    idle.push_back(detector);
  });
}

int Main(int argc, char** argv) {
  CLI::App app("throughput of tag detection");
  std::string folder;
  int runs = 10, threads = 0, count = 24;
  DetectTagsOptions options;
  app.add_option("FOLDER", folder)->required();
  app.add_option("--runs", runs);
  app.add_option("--threads", threads);
  app.add_option("--pictures", count);
  app.add_option("--decimate", options.quad_decimate);
  CLI11_PARSE(app, argc, argv);
  threads = ResolveThreads(threads);
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry.path().string());
  std::sort(files.begin(), files.end());
  std::vector<cv::Mat> pictures;
  for (size_t i = 0; i < files.size() && static_cast<int>(pictures.size()) < count; ++i) {
    cv::Mat grey = cv::imread(files[i * std::max<size_t>(1, files.size() / static_cast<size_t>(count)) % files.size()],
                              cv::IMREAD_GRAYSCALE);
    if (!grey.empty()) pictures.push_back(grey);
  }
  if (pictures.empty()) {
    std::fprintf(stderr, "no pictures in %s\n", folder.c_str());
    return 1;
  }
  std::vector<std::unique_ptr<TagFamily>> families;
  std::vector<apriltag_detector_t*> detectors;
  for (int t = 0; t < threads; ++t) {
    families.push_back(std::make_unique<TagFamily>(options.family));
    detectors.push_back(apriltag_detector_create());
    apriltag_detector_add_family(detectors.back(), families.back()->get());
    detectors.back()->nthreads = 1;
    detectors.back()->quad_decimate = static_cast<float>(options.quad_decimate);
    detectors.back()->quad_sigma = static_cast<float>(options.quad_sigma);
  }
  const auto ours = [&](bool refine) {
    DetectTagsOptions its = options;
    its.refine = refine;
    ProgressSink silent;
    const CancelToken cancel;
    return DetectTags(
        static_cast<int64_t>(pictures.size()), [&](int64_t i) { return pictures[static_cast<size_t>(i)]; }, {}, its,
        threads, silent, cancel);
  };
  std::vector<double> alone, plain, refined;
  std::atomic<int> found = 0;
  int64_t detections = 0;
  for (int r = 0; r < runs; ++r) {
    found = 0;
    alone.push_back(Seconds([&] { LibraryAlone(pictures, threads, detectors, &found); }));
    plain.push_back(Seconds([&] { detections = ours(false).detections; }));
    refined.push_back(Seconds([&] { ours(true); }));
  }
  for (apriltag_detector_t* d : detectors) apriltag_detector_destroy(d);
  const double n = static_cast<double>(pictures.size());
  std::printf(
      "{\"pictures\": %zu, \"threads\": %d, \"runs\": %d, \"library_found\": %d, \"ours_kept\": %lld,\n"
      " \"library_per_s\": %.2f, \"ours_per_s\": %.2f, \"ratio\": %.3f, \"refined_per_s\": %.2f, "
      "\"refinement_ms_per_tag\": %.2f}\n",
      pictures.size(), threads, runs, found.load(), static_cast<long long>(detections), n / Median(alone),
      n / Median(plain), Median(alone) / Median(plain), n / Median(refined),
      detections > 0 ? 1e3 * threads * (Median(refined) - Median(plain)) / static_cast<double>(detections) : 0.0);
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

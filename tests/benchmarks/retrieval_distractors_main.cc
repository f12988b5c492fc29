// Image retrieval with many wrong panoramas beside the right ones:
//   retrieval_distractors LOT_A LOT_A_TRUTH [--distractors 500] [--width 2048] [--features 3000] [--words N]
//                         [--threads 0] [--work FOLDER]
// Puts the views of synthetic street panoramas beside those of the site's own, retrieves the views of every image of
// run1 by the product's own function, and prints which share of the images has the right panoramas among the best
// ten, the time of a query and the memory. The lists of visual words are files, one for 125 panoramas; those that are
// in FOLDER are not made again, so that a second call's memory is that of the queries.
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <map>
#include <memory>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/base/error.h"
#include "calib/base/parallel.h"
#include "datasets/io/image.h"
#include "datasets/io/site.h"
#include "datasets/io/views.h"
#include "localize/reconstruct/features.h"
#include "localize/references/view_retrieval.h"
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

constexpr int kPerPart = 125;

// The views of the site's panoramas and of the distractors, in this order, as lists of words in files.
class Parts {
 public:
  Parts(std::vector<std::filesystem::path> own, const DistractorOptions& distractor, const FeatureOptions& feature,
        std::filesystem::path folder)
      : own_(std::move(own)), distractor_(distractor), feature_(feature), folder_(std::move(folder)) {}

  std::shared_ptr<const ViewIndex> Make(int distractors, const CodebookOptions& options, int threads) {
    const std::filesystem::path codebook = folder_ / "codebook.bin";
    if (!std::filesystem::exists(codebook)) Train(options, threads).Write(codebook);
    const auto vocabulary = std::make_shared<const Vocabulary>(Vocabulary::Read(codebook));
    const int own = static_cast<int>(own_.size());
    std::vector<WordLists> parts = {Part(0, own, *vocabulary, threads)};
    for (int first = 0; first < distractors; first += kPerPart)
      parts.push_back(Part(own + first, std::min(kPerPart, distractors - first), *vocabulary, threads));
    ViewIndex index{RetrievalIndex(vocabulary, std::move(parts)), {}};
    for (int d = 0; d < index.words.size(); ++d) index.views.emplace_back(d / kViews, d % kViews);
    return std::make_shared<const ViewIndex>(std::move(index));
  }

  static constexpr int kViews = 8;

 private:
  std::vector<FeatureSet> FeaturesOf(int panorama) const {
    if (panorama < static_cast<int>(own_.size()))
      return ViewFeatures(LoadPicture(own_[static_cast<size_t>(panorama)], true), feature_);
    cv::Mat grey;
    const auto seed = 1000 + static_cast<uint64_t>(panorama) - own_.size();
    cv::cvtColor(MakeDistractorPanorama(distractor_, seed, 1), grey, cv::COLOR_BGR2GRAY);
    return ViewFeatures(grey, feature_);
  }
  // As for a site in parts: on 32 of its pictures.
  Vocabulary Train(const CodebookOptions& options, int threads) const {
    constexpr int kPictures = 32;
    std::vector<std::vector<FeatureSet>> pictures(kPictures);
    ParallelFor(kPictures, threads, {},
                [&](int64_t i) { pictures[static_cast<size_t>(i)] = FeaturesOf(static_cast<int>(i)); });
    const auto descriptors = [&](int d) {
      return DescriptorBlock(pictures[static_cast<size_t>(d / kViews)][static_cast<size_t>(d % kViews)].descriptors);
    };
    return TrainVocabulary(kPictures * kViews, descriptors, options, 1, threads, {});
  }
  WordLists Part(int first, int count, const Vocabulary& vocabulary, int threads) const {
    const std::filesystem::path file = folder_ / ("words_" + std::to_string(first) + "_" + std::to_string(count));
    if (!std::filesystem::exists(file)) {
      std::vector<std::vector<WordCounts>> words(static_cast<size_t>(count));
      ParallelFor(count, threads, {}, [&](int64_t i) {
        for (const FeatureSet& view : FeaturesOf(first + static_cast<int>(i)))
          words[static_cast<size_t>(i)].push_back(CountWords(vocabulary, DescriptorBlock(view.descriptors)));
      });
      WordListBuilder builder(vocabulary.size());
      for (const std::vector<WordCounts>& panorama : words) {
        for (const WordCounts& view : panorama) builder.Add(view);
      }
      WriteWordLists(std::move(builder).Finish(), vocabulary, file);
    }
    return MapWordLists(file, vocabulary);
  }

  std::vector<std::filesystem::path> own_;
  DistractorOptions distractor_;
  FeatureOptions feature_;
  std::filesystem::path folder_;
};

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

std::vector<FeatureSet> ImageFeatures(const Run& run, const FeatureOptions& options, int threads) {
  std::vector<FeatureSet> features(run.images.size());
  ParallelFor(static_cast<int64_t>(features.size()), threads, {}, [&](int64_t i) {
    const auto k = static_cast<size_t>(i);
    features[k] = DescriptorsOnly(ExtractFeatures(LoadGrey(run, run.images[k]), {}, options));
  });
  return features;
}

void Print(const Recall& recall) {
  const auto percent = [](int n, int of) { return of > 0 ? 100.0 * n / of : 0.0; };
  std::printf("images within 12 m of a panorama: %d (%d pairs)\n", recall.near_images, recall.pairs);
  std::printf("nearest panorama among the best 10 panoramas: %.1f %% of images\n",
              percent(recall.nearest, recall.near_images));
  std::printf("any panorama within 12 m among the best 10 panoramas: %.1f %% of images\n",
              percent(recall.any, recall.near_images));
  std::printf("every pair: panorama among the best 10 panoramas: %.1f %%, among the best 10 views: %.1f %%\n",
              percent(recall.in_panoramas, recall.pairs), percent(recall.in_views, recall.pairs));
}

int Main(int argc, char** argv) {
  CLI::App app("Image retrieval with many wrong panoramas beside the right ones");
  std::string site_dir, truth_dir, work;
  int distractors = 500, threads = 0;
  DistractorOptions distractor;
  FeatureOptions feature;
  CodebookOptions codebook;
  app.add_option("site", site_dir, "site with run1 and panoramas")->required();
  app.add_option("truth", truth_dir, "its truth: panoramas.tum, runs/run1_cameras.tum")->required();
  app.add_option("--distractors", distractors, "panoramas of other streets");
  app.add_option("--width", distractor.width, "of their pictures, px");
  app.add_option("--features", feature.max_features, "at most, a view or image");
  app.add_option("--words", codebook.words, "of the codebook");
  app.add_option("--threads", threads, "of the extraction; queries are timed on one");
  app.add_option("--work", work, "folder for the lists of words")->required();
  CLI11_PARSE(app, argc, argv);
  cv::setNumThreads(1);
  std::filesystem::create_directories(work);

  const Site site = ReadSite(site_dir);
  const Run run = ReadRun(std::filesystem::path(site_dir) / "runs" / "run1", site_dir);
  std::map<int, Eigen::Vector3d> places;
  for (const TimedPose& p : ReadTrajectory(std::filesystem::path(truth_dir) / "panoramas.tum").poses) {
    places[static_cast<int>(p.stamp_ns / 1000000000)] = p.target_from_body.translation;
  }
  const Trajectory cameras = ReadTrajectory(std::filesystem::path(truth_dir) / "runs" / "run1_cameras.tum");

  LocalizeInput input;
  std::vector<std::filesystem::path> own;
  std::vector<int> station;  // of the site's own panoramas
  for (const Reference& reference : site.references) {
    if (reference.kind != ReferenceKind::kPanorama) continue;
    own.push_back(reference.files.front());
    station.push_back(std::stoi(reference.station.substr(reference.station.find_first_of("0123456789"))));
  }
  const Clock::time_point start = Clock::now();
  const auto index = Parts(own, distractor, feature, work).Make(distractors, codebook, threads);
  std::printf("%zu panoramas of the site, %d distractors: %d views, %d words, lists of %.1f MiB, in %.0f s\n",
              own.size(), distractors, index->words.size(), index->words.words(),
              static_cast<double>(index->words.MemoryBytes()) / 1048576.0, SecondsSince(start));
  input.references.resize(own.size() + static_cast<size_t>(distractors));
  input.view_index = [&] { return index; };
  const std::vector<FeatureSet> images = ImageFeatures(run, feature, threads);
  for (size_t i = 0; i < images.size(); ++i) input.images.push_back({run.images[i].stamp_ns, run.images[i].file});
  input.image_features = [&](int i) { return images[static_cast<size_t>(i)]; };
  RetrievalOptions retrieval;
  retrieval.top_k = 400;
  retrieval.most_references = 1000000;  // the region is not asked for: one query an image
  TaskTimes times;
  const Retrieval found = RetrieveViews(input, {}, retrieval, 30, true, 1, 1, times, {});
  const double query_ms = 1e3 * times.CpuSince("retrieval") / static_cast<double>(images.size());
  Print(MeasureRecall(found, run, cameras, station, places));
  std::printf("query: %.2f CPU-ms an image (words and ranking, without SIFT)\n", query_ms);
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::printf("peak memory of this program: %.0f MiB\n", static_cast<double>(usage.ru_maxrss) / 1024);
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

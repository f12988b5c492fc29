#include "localize/references/view_index.h"

#include <algorithm>
#include <map>
#include <unordered_map>

#include "calib/base/fnv.h"
#include "calib/base/parallel.h"
#include "localize/reconstruct/feature_store.h"

namespace trigpoint {
namespace {

constexpr size_t kSampled = 32;  // pictures that the codebook of several parts rests on
constexpr int kAhead = 64;       // views whose words are held at a time

std::string PictureOfView(const std::string& view) { return view.substr(0, view.rfind('#')); }

// The views of the pictures whose names have the lowest digests.
std::vector<std::string> Sampled(const std::vector<std::string>& views) {
  std::map<uint64_t, std::vector<std::string>> by_digest;
  for (const std::string& view : views) {
    const std::string picture = PictureOfView(view);
    by_digest[Fnv1a(picture.data(), picture.size())].push_back(view);
  }
  std::vector<std::string> sampled;
  size_t pictures = 0;
  for (const auto& [digest, its] : by_digest) {
    if (++pictures > kSampled) break;
    sampled.insert(sampled.end(), its.begin(), its.end());
  }
  return sampled;
}

}  // namespace

void WriteCodebook(const std::filesystem::path& dir, const CodebookOptions& options, bool sample, uint64_t seed,
                   int threads, const CancelToken& cancel) {
  const FeatureStore store(dir / kFeaturesFile);
  const std::vector<std::string> views = sample ? Sampled(store.names()) : store.names();
  const auto descriptors = [&](int document) {
    return DescriptorBlock(store.Read(views[static_cast<size_t>(document)]).descriptors);
  };
  TrainVocabulary(static_cast<int>(views.size()), descriptors, options, seed, threads, cancel)
      .Write(dir / kCodebookFile);
}

void WriteWords(const std::filesystem::path& dir, const std::filesystem::path& first, int threads,
                const CancelToken& cancel) {
  const Vocabulary vocabulary = Vocabulary::Read(first / kCodebookFile);
  const FeatureStore store(dir / kFeaturesFile);
  const std::vector<std::string>& views = store.names();
  std::vector<WordCounts> words(views.size());
  WordListBuilder builder(vocabulary.size());
  ParallelInOrder(
      static_cast<int64_t>(views.size()), threads, kAhead, cancel,
      [&](int64_t i) {
        const auto k = static_cast<size_t>(i);
        words[k] = CountWords(vocabulary, DescriptorBlock(store.Read(views[k]).descriptors));
      },
      [&](int64_t i) {
        const auto k = static_cast<size_t>(i);
        builder.Add(words[k], views[k]);
        words[k] = {};
      });
  WriteWordLists(std::move(builder).Finish(), vocabulary, dir / kWordsFile);
}

std::shared_ptr<const ViewIndex> MapViewIndex(const std::vector<std::filesystem::path>& results,
                                              const std::vector<std::vector<std::string>>& views_of) {
  const auto vocabulary = std::make_shared<const Vocabulary>(Vocabulary::Read(results.front() / kCodebookFile));
  std::vector<WordLists> parts;
  for (const std::filesystem::path& result : results) parts.push_back(MapWordLists(result / kWordsFile, *vocabulary));
  std::unordered_map<std::string, std::pair<int, int>> view_of;
  for (size_t r = 0; r < views_of.size(); ++r) {
    for (size_t v = 0; v < views_of[r].size(); ++v)
      view_of[views_of[r][v]] = {static_cast<int>(r), static_cast<int>(v)};
  }
  RetrievalIndex words(vocabulary, std::move(parts));
  std::vector<std::pair<int, int>> views;
  for (int d = 0; d < words.size(); ++d) {
    const auto found = view_of.find(words.Name(d));
    views.push_back(found == view_of.end() ? std::pair(-1, -1) : found->second);
  }
  return std::make_shared<const ViewIndex>(ViewIndex{std::move(words), std::move(views)});
}

}  // namespace trigpoint

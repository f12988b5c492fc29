#include "localize/references/retrieval.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "calib/base/parallel.h"
#include "calib/base/wide.h"
#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

constexpr int kDim = DescriptorBlock::kDim;

[[gnu::always_inline]] inline int SquaredDistance(const int16_t* a, const int16_t* b) {
  int sum = 0;
  for (int c = 0; c < kDim; ++c) {
    const int d = static_cast<int>(a[c]) - static_cast<int>(b[c]);
    sum += d * d;
  }
  return sum;
}

TRIGPOINT_WIDE
int Nearest(const int16_t* descriptor, const int16_t* centres, int count) {
  int best = 0, distance = std::numeric_limits<int>::max();
  for (int k = 0; k < count; ++k) {
    const int d = SquaredDistance(descriptor, centres + static_cast<std::ptrdiff_t>(k) * kDim);
    if (d < distance) distance = d, best = k;
  }
  return best;
}

// Lloyd's k-means with distinct random members as seeds; empty clusters keep their centre.
std::vector<int16_t> KMeans(const DescriptorBlock& data, const std::vector<int>& members, int k, int iterations,
                            uint64_t seed, std::vector<int>* label) {
  Random random(seed);
  std::vector<int> order = members;
  random.Shuffle(order);
  std::vector<int16_t> centres;
  for (int c = 0; c < k; ++c)
    centres.insert(centres.end(), data.row(order[static_cast<size_t>(c)]),
                   data.row(order[static_cast<size_t>(c)]) + kDim);
  label->assign(members.size(), 0);
  for (int it = 0; it <= iterations; ++it) {
    bool changed = false;
    for (size_t i = 0; i < members.size(); ++i) {
      const int l = Nearest(data.row(members[i]), centres.data(), k);
      changed = changed || l != (*label)[i];
      (*label)[i] = l;
    }
    if (it == iterations || (!changed && it > 0)) break;
    std::vector<int64_t> sums(static_cast<size_t>(k) * kDim, 0);
    std::vector<int64_t> counts(static_cast<size_t>(k), 0);
    for (size_t i = 0; i < members.size(); ++i) {
      const int16_t* row = data.row(members[i]);
      int64_t* sum = sums.data() + static_cast<std::ptrdiff_t>((*label)[i]) * kDim;
      for (int c = 0; c < kDim; ++c) sum[c] += row[c];
      ++counts[static_cast<size_t>((*label)[i])];
    }
    for (size_t c = 0; c < static_cast<size_t>(k); ++c) {
      if (counts[c] == 0) continue;
      for (size_t d = 0; d < kDim; ++d) {
        centres[c * kDim + d] = static_cast<int16_t>((sums[c * kDim + d] + counts[c] / 2) / counts[c]);
      }
    }
  }
  return centres;
}

}  // namespace

Vocabulary::Vocabulary(const DescriptorBlock& training, const RetrievalOptions& options, uint64_t seed, int threads,
                       const CancelToken& cancel) {
  constexpr int kLevels = 3;
  const int branch = std::max(2, static_cast<int>(std::ceil(std::cbrt(static_cast<double>(options.words)))));
  nodes_.push_back({});
  centres_.assign(kDim, 0);
  struct Open {
    int node;
    std::vector<int> members;
  };
  std::vector<Open> level{{0, {}}};
  level[0].members.resize(static_cast<size_t>(training.size()));
  std::iota(level[0].members.begin(), level[0].members.end(), 0);
  for (int depth = 0; depth < kLevels; ++depth) {
    std::vector<std::vector<int16_t>> centres(level.size());
    std::vector<std::vector<int>> labels(level.size());
    ParallelFor(static_cast<int64_t>(level.size()), threads, cancel, [&](int64_t i) {
      const Open& open = level[static_cast<size_t>(i)];
      // A cluster with few members is a word of its own.
      if (static_cast<int>(open.members.size()) < 2 * branch) return;
      centres[static_cast<size_t>(i)] =
          KMeans(training, open.members, branch, options.iterations, seed * 7919 + static_cast<uint64_t>(open.node),
                 &labels[static_cast<size_t>(i)]);
    });
    std::vector<Open> next;
    for (size_t i = 0; i < level.size(); ++i) {
      if (centres[i].empty()) continue;
      const int first = static_cast<int>(nodes_.size());
      nodes_[static_cast<size_t>(level[i].node)].first_child = first;
      nodes_[static_cast<size_t>(level[i].node)].children = branch;
      nodes_.resize(nodes_.size() + static_cast<size_t>(branch));
      centres_.insert(centres_.end(), centres[i].begin(), centres[i].end());
      std::vector<Open> children(static_cast<size_t>(branch));
      for (int c = 0; c < branch; ++c) children[static_cast<size_t>(c)].node = first + c;
      for (size_t m = 0; m < level[i].members.size(); ++m) {
        children[static_cast<size_t>(labels[i][m])].members.push_back(level[i].members[m]);
      }
      for (Open& child : children) next.push_back(std::move(child));
    }
    level = std::move(next);
  }
  for (Node& node : nodes_) {
    if (node.children == 0) node.word = words_++;
  }
}

int Vocabulary::Word(const int16_t* descriptor) const {
  const Node* node = &nodes_[0];
  while (node->children > 0) {
    const int child =
        node->first_child +
        Nearest(descriptor, centres_.data() + static_cast<std::ptrdiff_t>(node->first_child) * kDim, node->children);
    node = &nodes_[static_cast<size_t>(child)];
  }
  return node->word;
}

namespace {

// (word, count), ascending.
std::vector<std::pair<int, int>> Histogram(const Vocabulary& vocabulary, const DescriptorBlock& descriptors) {
  std::vector<int> words(static_cast<size_t>(descriptors.size()));
  for (int i = 0; i < descriptors.size(); ++i) words[static_cast<size_t>(i)] = vocabulary.Word(descriptors.row(i));
  std::sort(words.begin(), words.end());
  std::vector<std::pair<int, int>> histogram;
  for (int w : words) {
    if (histogram.empty() || histogram.back().first != w) histogram.emplace_back(w, 0);
    ++histogram.back().second;
  }
  return histogram;
}

}  // namespace

void RetrievalIndex::Add(const DescriptorBlock& descriptors) {
  for (const auto& [word, count] : Histogram(vocabulary_, descriptors)) {
    postings_[static_cast<size_t>(word)].push_back({documents_, static_cast<float>(count)});
  }
  ++documents_;
}

void RetrievalIndex::Finish() {
  idf_.assign(postings_.size(), 0);
  std::vector<double> norms(static_cast<size_t>(documents_), 0);
  for (size_t w = 0; w < postings_.size(); ++w) {
    if (postings_[w].empty()) continue;
    idf_[w] = std::log(static_cast<float>(documents_) / static_cast<float>(postings_[w].size()));
    for (Posting& p : postings_[w]) {
      p.weight *= idf_[w];
      norms[static_cast<size_t>(p.document)] += static_cast<double>(p.weight) * p.weight;
    }
  }
  for (std::vector<Posting>& list : postings_) {
    list.shrink_to_fit();
    for (Posting& p : list) {
      const double n = norms[static_cast<size_t>(p.document)];
      p.weight = n > 0 ? static_cast<float>(p.weight / std::sqrt(n)) : 0.0F;
    }
  }
}

std::vector<RetrievalHit> RetrievalIndex::Query(const DescriptorBlock& descriptors, int k) const {
  std::vector<float> scores(static_cast<size_t>(documents_), 0);
  double norm = 0;
  for (const auto& [word, count] : Histogram(vocabulary_, descriptors)) {
    const float weight = static_cast<float>(count) * idf_[static_cast<size_t>(word)];
    norm += static_cast<double>(weight) * weight;
    for (const Posting& p : postings_[static_cast<size_t>(word)])
      scores[static_cast<size_t>(p.document)] += weight * p.weight;
  }
  std::vector<RetrievalHit> hits;
  const float scale = norm > 0 ? static_cast<float>(1 / std::sqrt(norm)) : 0.0F;
  for (int d = 0; d < documents_; ++d) {
    if (scores[static_cast<size_t>(d)] > 0) hits.push_back({d, scores[static_cast<size_t>(d)] * scale});
  }
  const size_t keep = std::min(hits.size(), static_cast<size_t>(k));
  std::partial_sort(hits.begin(), hits.begin() + static_cast<std::ptrdiff_t>(keep), hits.end(),
                    [](const RetrievalHit& a, const RetrievalHit& b) {
                      return a.score != b.score ? a.score > b.score : a.document < b.document;
                    });
  hits.resize(keep);
  return hits;
}

size_t RetrievalIndex::MemoryBytes() const {
  size_t bytes = idf_.size() * sizeof(float);
  bytes += postings_.size() * sizeof(std::vector<Posting>);
  for (const std::vector<Posting>& list : postings_) bytes += list.capacity() * sizeof(Posting);
  return bytes;
}

}  // namespace trigpoint

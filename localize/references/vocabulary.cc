#include "localize/references/vocabulary.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <numeric>

#include "calib/base/error.h"
#include "calib/base/fnv.h"
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

// Of a codebook's file: this, the nodes, their centres.
struct Header {
  char magic[20] = "trigpoint codebook";
  uint32_t version = 1;
  uint32_t nodes = 0;
};
static_assert(sizeof(Header) == 28);

}  // namespace

Vocabulary::Vocabulary(const DescriptorBlock& training, const CodebookOptions& options, uint64_t seed, int threads,
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
  SetFingerprint();
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

void Vocabulary::SetFingerprint() {
  const uint64_t of_nodes = Fnv1a(nodes_.data(), nodes_.size() * sizeof(Node));
  fingerprint_ = Fnv1a(centres_.data(), centres_.size() * sizeof(int16_t), of_nodes);
}

void Vocabulary::Write(const std::filesystem::path& file) const {
  Header header;
  header.nodes = static_cast<uint32_t>(nodes_.size());
  std::ofstream out(file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(&header), sizeof header);
  out.write(reinterpret_cast<const char*>(nodes_.data()), static_cast<std::streamsize>(nodes_.size() * sizeof(Node)));
  out.write(reinterpret_cast<const char*>(centres_.data()),
            static_cast<std::streamsize>(centres_.size() * sizeof(int16_t)));
  if (!out.flush()) throw IoError(file.string() + ": cannot be written");
}

Vocabulary Vocabulary::Read(const std::filesystem::path& file) {
  const auto refuse = [&](const char* why) {
    throw InputError(file.string() + ": " + why + "; expected a codebook as `references` writes it");
  };
  std::error_code error;
  const uint64_t size = std::filesystem::file_size(file, error);
  std::ifstream in(file, std::ios::binary);
  Header header, expected;
  if (error || !in.read(reinterpret_cast<char*>(&header), sizeof header)) refuse("cannot be read");
  if (std::memcmp(header.magic, expected.magic, sizeof header.magic) != 0 || header.version != expected.version)
    refuse("has another format");
  constexpr uint64_t kNodeBytes = sizeof(Node) + kDim * sizeof(int16_t);
  if (header.nodes == 0 || size - sizeof header != header.nodes * kNodeBytes)
    refuse("has another length than its header says");
  Vocabulary v;
  v.nodes_.resize(header.nodes);
  v.centres_.resize(size_t{header.nodes} * kDim);
  in.read(reinterpret_cast<char*>(v.nodes_.data()), static_cast<std::streamsize>(v.nodes_.size() * sizeof(Node)));
  in.read(reinterpret_cast<char*>(v.centres_.data()),
          static_cast<std::streamsize>(v.centres_.size() * sizeof(int16_t)));
  if (!in) refuse("cannot be read");
  for (const Node& node : v.nodes_) v.words_ += node.children == 0 ? 1 : 0;
  if (!v.IsTree()) refuse("is damaged");
  v.SetFingerprint();
  return v;
}

bool Vocabulary::IsTree() const {
  const auto n = static_cast<int64_t>(nodes_.size());
  for (int64_t k = 0; k < n; ++k) {
    const Node& node = nodes_[static_cast<size_t>(k)];
    const bool leaf = node.children == 0;
    if (leaf ? node.word < 0 || node.word >= words_
             : node.children < 0 || node.first_child <= k || int64_t{node.first_child} + node.children > n)
      return false;
  }
  return true;
}

Vocabulary TrainVocabulary(int documents, const DescriptorsOf& descriptors, const CodebookOptions& options,
                           uint64_t seed, int threads, const CancelToken& cancel) {
  DescriptorBlock training;
  const int share = std::max(1, options.training_descriptors / std::max(1, documents));
  for (int d = 0; d < documents; ++d) {
    cancel.ThrowIfCancelled();
    const DescriptorBlock block = descriptors(d);
    std::vector<int> order(static_cast<size_t>(block.size()));
    std::iota(order.begin(), order.end(), 0);
    Random random(seed * 1000003 + static_cast<uint64_t>(d));
    random.Shuffle(order);
    for (int i = 0; i < std::min(share, block.size()); ++i) training.Append(block, order[static_cast<size_t>(i)]);
  }
  return {training, options, seed, threads, cancel};
}

}  // namespace trigpoint

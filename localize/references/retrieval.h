// Candidate references of an image: visual words, tf-idf, cosine similarity (docs/method.md section 3).
#pragma once

#include <cstdint>
#include <vector>

#include "calib/base/option.h"
#include "calib/base/progress.h"
#include "localize/reconstruct/matching.h"

namespace trigpoint {

struct RetrievalOptions {
  int words = 8000;                  // size of the codebook (hierarchical k-means with three levels)
  int training_descriptors = 60000;  // descriptors sampled to build it
  int iterations = 8;                // of k-means, each level
  int top_k = 10;                    // views kept an image

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.words, {"words", "", 8, 1000000, "visual words in the codebook"});
    visit(self.training_descriptors,
          {"training_descriptors", "", 100, 10000000, "descriptors sampled for the codebook"});
    visit(self.iterations, {"iterations", "", 1, 100, "k-means iterations per level"});
    visit(self.top_k, {"top_k", "", 1, 1000, "most similar views kept of each image"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

// A codebook: a tree of k-means centres, three levels.
class Vocabulary {
 public:
  // `training`: RootSIFT rows. Deterministic for a seed.
  Vocabulary(const DescriptorBlock& training, const RetrievalOptions& options, uint64_t seed, int threads,
             const CancelToken& cancel);
  int size() const { return words_; }
  int Word(const int16_t* descriptor) const;

 private:
  struct Node {
    int first_child = -1;  // children are consecutive
    int children = 0;
    int word = -1;
  };
  std::vector<Node> nodes_;
  std::vector<int16_t> centres_;  // nodes x 128
  int words_ = 0;
};

struct RetrievalHit {
  int document = 0;
  float score = 0;  // cosine similarity of tf-idf vectors, 0 to 1
};

// An inverted file over documents (views). Memory: 8 bytes a distinct word and document.
class RetrievalIndex {
 public:
  explicit RetrievalIndex(const Vocabulary& vocabulary)
      : vocabulary_(vocabulary), postings_(static_cast<size_t>(vocabulary.size())) {}
  // Documents are numbered in the order added.
  void Add(const DescriptorBlock& descriptors);
  // Weights and norms; call once after the last Add.
  void Finish();
  // Best `k` documents, best first, ties by number.
  std::vector<RetrievalHit> Query(const DescriptorBlock& descriptors, int k) const;
  int size() const { return documents_; }
  size_t MemoryBytes() const;

 private:
  struct Posting {
    int document;
    float weight;
  };
  const Vocabulary& vocabulary_;
  std::vector<std::vector<Posting>> postings_;
  std::vector<float> idf_;
  int documents_ = 0;
};

}  // namespace trigpoint

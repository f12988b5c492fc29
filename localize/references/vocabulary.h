// A codebook of visual words: a tree of k-means centres over RootSIFT descriptors (docs/method.md section 3).
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "calib/base/option.h"
#include "calib/base/progress.h"
#include "localize/reconstruct/matching.h"

namespace trigpoint {

struct CodebookOptions {
  int words = 8000;                  // size of the codebook (hierarchical k-means with three levels)
  int training_descriptors = 60000;  // descriptors sampled to build it
  int iterations = 8;                // of k-means, each level

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.words, {"words", "", 8, 1000000, "visual words in the codebook"});
    visit(self.training_descriptors,
          {"training_descriptors", "", 100, 10000000, "descriptors sampled for the codebook"});
    visit(self.iterations, {"iterations", "", 1, 100, "k-means iterations per level"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

class Vocabulary {
 public:
  // `training`: RootSIFT rows. Deterministic for a seed.
  Vocabulary(const DescriptorBlock& training, const CodebookOptions& options, uint64_t seed, int threads,
             const CancelToken& cancel);
  int size() const { return words_; }
  int Word(const int16_t* descriptor) const;
  // Tells codebooks apart: lists of words are of use with their own only.
  uint64_t fingerprint() const { return fingerprint_; }

  void Write(const std::filesystem::path& file) const;
  // Throws InputError for a file that Write has not written.
  static Vocabulary Read(const std::filesystem::path& file);

 private:
  struct Node {
    int32_t first_child = -1;  // children are consecutive, and come after their parent
    int32_t children = 0;
    int32_t word = -1;
  };
  Vocabulary() = default;
  bool IsTree() const;
  void SetFingerprint();

  std::vector<Node> nodes_;
  std::vector<int16_t> centres_;  // nodes x 128
  int words_ = 0;
  uint64_t fingerprint_ = 0;  // of nodes and centres
};

// Descriptors of a document (an image, a view of a reference).
using DescriptorsOf = std::function<DescriptorBlock(int document)>;

// Of an even share of every document's descriptors. One word if there are none.
Vocabulary TrainVocabulary(int documents, const DescriptorsOf& descriptors, const CodebookOptions& options,
                           uint64_t seed, int threads, const CancelToken& cancel);

}  // namespace trigpoint

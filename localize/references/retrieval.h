// Candidate references of an image: visual words, tf-idf, cosine similarity (docs/method.md section 3).
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "localize/references/vocabulary.h"
#include "localize/references/word_lists.h"

namespace trigpoint {

struct RetrievalOptions {
  int top_k = 10;             // views kept an image
  int most_references = 500;  // of a run, tested

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.top_k, {"top_k", "", 1, 1000, "most similar views kept of each image"});
    visit(self.most_references, {"most_references", "references", 1, 1000000,
                                 "most references a run is tested with; if there are more: those near its GPS, or in "
                                 "the region that its images resemble"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

struct RetrievalHit {
  int document = 0;
  float score = 0;  // cosine similarity of tf-idf vectors, 0 to 1
};

// An inverted file over the documents of one or more parts, numbered one after another in their order. It takes 4 bytes
// a document; the lists take memory only where they are not mapped from a file.
class RetrievalIndex {
 public:
  RetrievalIndex(std::shared_ptr<const Vocabulary> vocabulary, std::vector<WordLists> parts);
  // Best `k` documents, best first, ties by number. `wanted`, one flag a document: of these alone; empty: of all.
  std::vector<RetrievalHit> Query(const DescriptorBlock& descriptors, int k,
                                  const std::vector<char>& wanted = {}) const;
  int size() const { return static_cast<int>(inverse_norms_.size()); }
  int words() const { return vocabulary_->size(); }
  const std::string& Name(int document) const;
  size_t MemoryBytes() const;  // with that of the lists

 private:
  std::shared_ptr<const Vocabulary> vocabulary_;
  std::vector<WordLists> parts_;
  std::vector<size_t> first_;  // document of each part
  std::vector<float> idf_;
  std::vector<float> inverse_norms_;
};

// In memory, of documents whose descriptors are read twice.
RetrievalIndex IndexInMemory(int documents, const DescriptorsOf& descriptors, const CodebookOptions& options,
                             uint64_t seed, int threads, const CancelToken& cancel);

}  // namespace trigpoint

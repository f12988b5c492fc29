#include "localize/references/retrieval.h"

#include <algorithm>
#include <cmath>

#include "calib/base/error.h"

namespace trigpoint {

RetrievalIndex::RetrievalIndex(std::shared_ptr<const Vocabulary> vocabulary, std::vector<WordLists> parts)
    : vocabulary_(std::move(vocabulary)), parts_(std::move(parts)) {
  size_t documents = 0;
  for (const WordLists& part : parts_) {
    first_.push_back(documents);
    documents += static_cast<size_t>(part.documents);
  }
  std::vector<double> norms(documents, 0);
  for (size_t w = 0; w < static_cast<size_t>(vocabulary_->size()); ++w) {
    size_t with_word = 0;
    for (const WordLists& part : parts_) with_word += part.Of(w).size();
    const float all = static_cast<float>(documents);
    // In a single document every word is in all of them.
    const float idf = documents == 1 ? 1.0F : std::log(all / static_cast<float>(std::max<size_t>(1, with_word)));
    idf_.push_back(with_word > 0 ? idf : 0.0F);
    for (size_t k = 0; k < parts_.size(); ++k) {
      for (const uint32_t posting : parts_[k].Of(w)) {
        const int document = WordLists::Document(posting);
        if (document >= parts_[k].documents)
          throw InputError("visual words: a list names a document that is not there");
        const double weight = static_cast<double>(idf_[w]) * WordLists::Count(posting);
        norms[first_[k] + static_cast<size_t>(document)] += weight * weight;
      }
    }
  }
  for (const double n : norms) inverse_norms_.push_back(n > 0 ? static_cast<float>(1 / std::sqrt(n)) : 0.0F);
}

std::vector<RetrievalHit> RetrievalIndex::Query(const DescriptorBlock& descriptors, int k,
                                                const std::vector<char>& wanted) const {
  std::vector<float> scores(inverse_norms_.size(), 0);
  double norm = 0;
  for (const auto& [word, count] : CountWords(*vocabulary_, descriptors)) {
    const auto w = static_cast<size_t>(word);
    const float weight = static_cast<float>(count) * idf_[w];
    norm += static_cast<double>(weight) * weight;
    const float factor = weight * idf_[w];
    for (size_t part = 0; part < parts_.size(); ++part) {
      float* const of_part = scores.data() + first_[part];
      for (const uint32_t posting : parts_[part].Of(w))
        of_part[WordLists::Document(posting)] += factor * static_cast<float>(WordLists::Count(posting));
    }
  }
  std::vector<RetrievalHit> hits;
  const float scale = norm > 0 ? static_cast<float>(1 / std::sqrt(norm)) : 0.0F;
  for (size_t d = 0; d < scores.size(); ++d) {
    if (scores[d] > 0 && (wanted.empty() || wanted[d] != 0))
      hits.push_back({static_cast<int>(d), scores[d] * inverse_norms_[d] * scale});
  }
  const size_t keep = std::min(hits.size(), static_cast<size_t>(k));
  std::partial_sort(hits.begin(), hits.begin() + static_cast<std::ptrdiff_t>(keep), hits.end(),
                    [](const RetrievalHit& a, const RetrievalHit& b) {
                      return a.score != b.score ? a.score > b.score : a.document < b.document;
                    });
  hits.resize(keep);
  return hits;
}

const std::string& RetrievalIndex::Name(int document) const {
  const auto d = static_cast<size_t>(document);
  const size_t part = static_cast<size_t>(std::upper_bound(first_.begin(), first_.end(), d) - first_.begin()) - 1;
  return parts_[part].names[d - first_[part]];
}

size_t RetrievalIndex::MemoryBytes() const {
  size_t bytes = (idf_.size() + inverse_norms_.size()) * sizeof(float);
  for (const WordLists& part : parts_) bytes += part.begin.size_bytes() + part.postings.size_bytes();
  return bytes;
}

RetrievalIndex IndexInMemory(int documents, const DescriptorsOf& descriptors, const CodebookOptions& options,
                             uint64_t seed, int threads, const CancelToken& cancel) {
  auto vocabulary =
      std::make_shared<const Vocabulary>(TrainVocabulary(documents, descriptors, options, seed, threads, cancel));
  WordListBuilder builder(vocabulary->size());
  for (int d = 0; d < documents; ++d) {
    cancel.ThrowIfCancelled();
    builder.Add(CountWords(*vocabulary, descriptors(d)));
  }
  return {std::move(vocabulary), {std::move(builder).Finish()}};
}

}  // namespace trigpoint

// Which documents have which visual words: one list a word, in memory or mapped from a file.
//
// File (little endian): the header, uint64 begin[words + 1], uint32 postings[begin[words]], then the documents' names,
// each ended by a zero byte. A posting is document << 12 | how often the word occurs (at most 4095).
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "localize/references/vocabulary.h"

namespace trigpoint {

struct WordLists {
  static constexpr int kCountBits = 12;
  static constexpr uint32_t kMostOften = (1U << kCountBits) - 1;
  static int Document(uint32_t posting) { return static_cast<int>(posting >> kCountBits); }
  static uint32_t Count(uint32_t posting) { return posting & kMostOften; }

  int documents = 0;
  std::span<const uint64_t> begin;     // words + 1, into `postings`
  std::span<const uint32_t> postings;  // of each word, by ascending document
  std::vector<std::string> names;      // of the documents; lists in memory may have none
  std::shared_ptr<const void> owner;   // of what the spans look at

  size_t words() const { return begin.size() - 1; }
  std::span<const uint32_t> Of(size_t word) const {
    return postings.subspan(begin[word], begin[word + 1] - begin[word]);
  }
};

// (word, how often) of a document, ascending.
using WordCounts = std::vector<std::pair<int, int>>;
WordCounts CountWords(const Vocabulary& vocabulary, const DescriptorBlock& descriptors);

// Documents are numbered in the order in which they are added.
class WordListBuilder {
 public:
  explicit WordListBuilder(int vocabulary) : lists_(static_cast<size_t>(vocabulary)) {}
  void Add(const WordCounts& words, std::string name = "");
  WordLists Finish() &&;

 private:
  std::vector<std::vector<uint32_t>> lists_;
  std::vector<std::string> names_;
};

// Throws IoError.
void WriteWordLists(const WordLists& lists, const Vocabulary& vocabulary, const std::filesystem::path& file);
// Mapped; only what is looked up is read. Throws InputError for a file that is no such file or of another codebook.
WordLists MapWordLists(const std::filesystem::path& file, const Vocabulary& vocabulary);

}  // namespace trigpoint

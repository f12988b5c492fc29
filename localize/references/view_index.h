// The visual words of the views of a site's references, on disk: written with the views' features, a part at a time,
// and read by every run. The first part holds the codebook of all.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "calib/base/progress.h"
#include "localize/references/retrieval.h"

namespace trigpoint {

constexpr const char* kCodebookFile = "codebook.bin";
constexpr const char* kWordsFile = "words.bin";

// A document that is no view of the input (a panorama excluded by the review) is never an answer.
struct ViewIndex {
  RetrievalIndex words;
  std::vector<std::pair<int, int>> views;  // of each document: reference, view; reference -1: none of the input's
};

// codebook.bin for the features in `dir`. Of a site with several parts (`sample`) it rests on few pictures, chosen by
// their names, so that one picture more seldom changes the words of all.
void WriteCodebook(const std::filesystem::path& dir, const CodebookOptions& options, bool sample, uint64_t seed,
                   int threads, const CancelToken& cancel);
// words.bin for the features in `dir`, by the codebook in `first`.
void WriteWords(const std::filesystem::path& dir, const std::filesystem::path& first, int threads,
                const CancelToken& cancel);
// Of the results of all parts. `views_of`: each reference's views by the names of their features. Throws InputError
// for damaged files.
std::shared_ptr<const ViewIndex> MapViewIndex(const std::vector<std::filesystem::path>& results,
                                              const std::vector<std::vector<std::string>>& views_of);

}  // namespace trigpoint

#include "localize/references/word_lists.h"

#include <algorithm>
#include <boost/interprocess/file_mapping.hpp>
#include <boost/interprocess/mapped_region.hpp>
#include <cstring>
#include <fstream>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

namespace ipc = boost::interprocess;

struct Header {
  char magic[16] = "trigpoint words";
  uint32_t version = 1;
  uint32_t words = 0;
  uint32_t documents = 0;
  uint32_t unused = 0;
  uint64_t postings = 0;
  uint64_t codebook = 0;  // its fingerprint
  uint64_t names_bytes = 0;
};
static_assert(sizeof(Header) == 56);

template <typename T>
void WriteAll(std::span<const T> values, std::ofstream* out) {
  out->write(reinterpret_cast<const char*>(values.data()), static_cast<std::streamsize>(values.size_bytes()));
}

}  // namespace

WordCounts CountWords(const Vocabulary& vocabulary, const DescriptorBlock& descriptors) {
  std::vector<int> words(static_cast<size_t>(descriptors.size()));
  for (int i = 0; i < descriptors.size(); ++i) words[static_cast<size_t>(i)] = vocabulary.Word(descriptors.row(i));
  std::sort(words.begin(), words.end());
  WordCounts counts;
  for (int w : words) {
    if (counts.empty() || counts.back().first != w) counts.emplace_back(w, 0);
    ++counts.back().second;
  }
  return counts;
}

void WordListBuilder::Add(const WordCounts& words, std::string name) {
  const auto document = static_cast<uint32_t>(names_.size());
  if (document > UINT32_MAX >> WordLists::kCountBits) throw InputError("visual words: more than a million documents");
  for (const auto& [word, count] : words) {
    const uint32_t often = std::min(static_cast<uint32_t>(count), WordLists::kMostOften);
    lists_[static_cast<size_t>(word)].push_back(document << WordLists::kCountBits | often);
  }
  names_.push_back(std::move(name));
}

WordLists WordListBuilder::Finish() && {
  struct Storage {
    std::vector<uint64_t> begin;
    std::vector<uint32_t> postings;
  };
  const auto storage = std::make_shared<Storage>();
  storage->begin.reserve(lists_.size() + 1);
  storage->begin.push_back(0);
  for (const std::vector<uint32_t>& list : lists_) storage->begin.push_back(storage->begin.back() + list.size());
  storage->postings.reserve(storage->begin.back());
  for (std::vector<uint32_t>& list : lists_) {
    storage->postings.insert(storage->postings.end(), list.begin(), list.end());
    list = {};
  }
  return {static_cast<int>(names_.size()), storage->begin, storage->postings, std::move(names_), storage};
}

void WriteWordLists(const WordLists& lists, const Vocabulary& vocabulary, const std::filesystem::path& file) {
  Header header;
  header.words = static_cast<uint32_t>(lists.words());
  header.documents = static_cast<uint32_t>(lists.documents);
  header.postings = lists.postings.size();
  header.codebook = vocabulary.fingerprint();
  for (const std::string& name : lists.names) header.names_bytes += name.size() + 1;
  std::ofstream out(file, std::ios::binary);
  WriteAll(std::span<const Header>(&header, 1), &out);
  WriteAll(lists.begin, &out);
  WriteAll(lists.postings, &out);
  for (const std::string& name : lists.names) out.write(name.c_str(), static_cast<std::streamsize>(name.size() + 1));
  if (!out.flush()) throw IoError(file.string() + ": cannot be written");
}

WordLists MapWordLists(const std::filesystem::path& file, const Vocabulary& vocabulary) {
  const auto refuse = [&](const std::string& why) {
    throw InputError(file.string() + ": " + why + "; expected lists of visual words as `references` writes them");
  };
  std::shared_ptr<ipc::mapped_region> region;
  try {
    region = std::make_shared<ipc::mapped_region>(ipc::file_mapping(file.c_str(), ipc::read_only), ipc::read_only);
  } catch (const ipc::interprocess_exception& e) {
    refuse(std::string("cannot be mapped: ") + e.what());
  }
  const auto* bytes = static_cast<const char*>(region->get_address());
  Header header, expected;
  if (region->get_size() < sizeof header) refuse("is too short");
  std::memcpy(&header, bytes, sizeof header);
  if (std::memcmp(header.magic, expected.magic, sizeof header.magic) != 0 || header.version != expected.version)
    refuse("has another format");
  if (header.words != static_cast<uint32_t>(vocabulary.size()) || header.codebook != vocabulary.fingerprint())
    refuse("belongs to another codebook");
  const uint64_t offsets = 8 * (uint64_t{header.words} + 1);
  const uint64_t rest = region->get_size() - sizeof header;
  if (rest < offsets || (rest - offsets) / 4 < header.postings ||
      rest - offsets - 4 * header.postings != header.names_bytes)
    refuse("has another length than its header says");
  WordLists lists;
  lists.documents = static_cast<int>(header.documents);
  lists.begin = {reinterpret_cast<const uint64_t*>(bytes + sizeof header), header.words + size_t{1}};
  lists.postings = {reinterpret_cast<const uint32_t*>(bytes + sizeof header + offsets), header.postings};
  if (lists.begin.front() != 0 || lists.begin.back() != header.postings ||
      !std::is_sorted(lists.begin.begin(), lists.begin.end()))
    refuse("has lists that overlap");
  const auto* name = reinterpret_cast<const char*>(lists.postings.data() + lists.postings.size());
  for (const char *end = name + header.names_bytes, *stop; name < end; name = stop + 1) {
    stop = std::find(name, end, '\0');
    if (stop == end) refuse("has a name without an end");
    lists.names.emplace_back(name, stop);
  }
  if (lists.names.size() != header.documents) refuse("names another number of documents than it has");
  lists.owner = region;
  return lists;
}

}  // namespace trigpoint

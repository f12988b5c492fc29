// Entries of tags.yaml added to its text: comments and order stay.
#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace trigpoint {

struct TagsFileChange {
  std::string text;  // of the whole file
  int added = 0;     // entries of sizes_m
  int changed = 0;
};

// `old_text`: of tags.yaml, empty if there is none. Every id of `sizes_m` gets an entry of its own. An entry that is
// there keeps its value, unless `expected_m` has its id and that value: then it is changed. Throws InputError (of
// `file`) where an entry or the family says otherwise, or where the file is written in a way that cannot be extended.
TagsFileChange WithTagSizes(const std::string& old_text, const std::string& family,
                            const std::map<int, double>& sizes_m, const std::map<int, double>& expected_m,
                            const std::filesystem::path& file);

}  // namespace trigpoint

#include "app/cli/excerpts.h"

#include <algorithm>

#include "datasets/io/readable.h"

namespace trigpoint {
namespace {

void CutAll(const std::string& text, std::string* message) {
  const std::string cut = Excerpt(text);
  if (cut == text) return;
  for (size_t at = message->find(text); at != std::string::npos; at = message->find(text, at + cut.size())) {
    message->replace(at, text.size(), cut);
  }
}

}  // namespace

std::string WithExcerpts(std::string message, const std::vector<std::string>& texts) {
  for (const std::string& text : texts) {
    CutAll(text, &message);
    for (size_t begin = 0; begin <= text.size();) {
      const size_t end = std::min(text.find_first_of("=,", begin), text.size());
      CutAll(text.substr(begin), &message);
      CutAll(text.substr(begin, end - begin), &message);
      begin = end + 1;
    }
  }
  return message;
}

}  // namespace trigpoint

#include "datasets/io/readable.h"

#include <algorithm>

namespace trigpoint {
namespace {

constexpr std::string_view kBeforeWord = " (", kBehindQuote = " ,;:.)";

// Where the quotation that begins at `begin` ends, at its second quote; npos: none begins there.
size_t EndOfQuote(std::string_view text, size_t begin) {
  if (text[begin] != '\'' || (begin > 0 && kBeforeWord.find(text[begin - 1]) == kBeforeWord.npos)) return text.npos;
  size_t end = text.find('\'', begin + 1);
  while (end != text.npos && end + 1 < text.size() && kBehindQuote.find(text[end + 1]) == kBehindQuote.npos) {
    end = text.find('\'', end + 1);
  }
  return end;
}

}  // namespace

std::string WithExcerpts(std::string_view message) {
  std::string cut;
  for (size_t at = 0; at < message.size();) {
    if (const size_t end = EndOfQuote(message, at); end != message.npos) {
      cut += '\'';
      cut += Excerpt(message.substr(at + 1, end - at - 1));
      cut += '\'';
      at = end + 1;
      continue;
    }
    if (kBeforeWord.find(message[at]) != kBeforeWord.npos) {
      cut += message[at++];
      continue;
    }
    const size_t end = std::min(message.find_first_of(kBeforeWord, at), message.size());
    const std::string_view word = message.substr(at, end - at);
    cut += word.find('/') == word.npos ? Excerpt(word) : std::string(word);
    at = end;
  }
  return cut;
}

std::string Excerpt(std::string_view text) {
  constexpr size_t kMost = 200;
  if (text.size() <= kMost) return std::string(text);
  size_t end = kMost;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;  // no half character
  return std::string(text.substr(0, end)) + "... (" + std::to_string(text.size()) + " bytes)";
}

std::string ValidUtf8(std::string_view text) {
  bool valid = true;
  for (size_t at = 0; at < text.size() && valid;) {
    const auto lead = static_cast<unsigned char>(text[at]);
    const size_t more = lead < 0x80 ? 0 : lead >= 0xC2 && lead < 0xE0 ? 1 : lead < 0xF0 ? 2 : 3;
    valid = lead < 0x80 || (lead >= 0xC2 && lead < 0xF5 && at + more < text.size());
    for (size_t k = 1; k <= more && valid; ++k) valid = (static_cast<unsigned char>(text[at + k]) & 0xC0) == 0x80;
    if (valid && more >= 2) {  // neither overlong nor a surrogate nor beyond the last plane
      const auto second = static_cast<unsigned char>(text[at + 1]);
      valid = !(lead == 0xE0 && second < 0xA0) && !(lead == 0xED && second > 0x9F) &&
              !(lead == 0xF0 && second < 0x90) && !(lead == 0xF4 && second > 0x8F);
    }
    at += more + 1;
  }
  if (valid) return std::string(text);
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x80) {
      out += c;
    } else {
      out += static_cast<char>(0xC0 | byte >> 6);
      out += static_cast<char>(0x80 | (byte & 0x3F));
    }
  }
  return out;
}

}  // namespace trigpoint

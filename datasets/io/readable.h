// Text of files as people and other programs can take it.
#pragma once

#include <string>
#include <string_view>

namespace trigpoint {

// At most 200 bytes of a text, for messages.
std::string Excerpt(std::string_view text);

// A message in which what it quotes ('...'), and each word that is no path, is cut as Excerpt does: errors and warnings
// pass through here before they are shown or kept.
std::string WithExcerpts(std::string_view message);

// The text if it is UTF-8, else with its bytes taken as Latin-1.
std::string ValidUtf8(std::string_view text);

}  // namespace trigpoint

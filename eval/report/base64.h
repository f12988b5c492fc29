// Bytes as text, for pictures inside a page.
#pragma once

#include <string>
#include <string_view>

namespace trigpoint {

std::string Base64(std::string_view bytes);

}  // namespace trigpoint

// Long texts of the command line in messages.
#pragma once

#include <string>
#include <vector>

namespace trigpoint {

// A message in which each of `texts` that is long, and each part of it between '=' and ',', is cut as Excerpt does.
std::string WithExcerpts(std::string message, const std::vector<std::string>& texts);

}  // namespace trigpoint

// Shared by the writers of layers.
#pragma once

#include <string>

#include "datasets/export/layers.h"

namespace trigpoint {

std::string XmlText(std::string_view text);  // escaped, as UTF-8; characters XML forbids are left out
// "" for a value that is not known.
std::string ValueText(const LayerValue& value, const LayerField& field);
std::string UtcText(int64_t utc_ns);  // 2026-05-12T09:43:20.125Z

}  // namespace trigpoint

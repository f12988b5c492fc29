#include "datasets/export/layer_text.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cmath>

#include "datasets/io/readable.h"

namespace trigpoint {

std::string XmlText(std::string_view text) {
  std::string out;
  for (char c : ValidUtf8(text)) {
    switch (c) {
      case '&': out += "&amp;"; break;
      case '<': out += "&lt;"; break;
      case '>': out += "&gt;"; break;
      case '"': out += "&quot;"; break;
      default:
        if (static_cast<unsigned char>(c) >= 0x20 || c == '\t' || c == '\n') out += c;
    }
  }
  return out;
}

std::string ValueText(const LayerValue& value, const LayerField& field) {
  if (const auto* i = std::get_if<int64_t>(&value)) return std::to_string(*i);
  if (const auto* s = std::get_if<std::string>(&value)) return *s;
  if (const auto* d = std::get_if<double>(&value))
    return std::isfinite(*d) ? fmt::format("{:.{}f}", *d, field.decimals) : "";
  return "";
}

std::string UtcText(int64_t utc_ns) {
  int64_t seconds = utc_ns / 1'000'000'000, ns = utc_ns % 1'000'000'000;
  if (ns < 0) --seconds, ns += 1'000'000'000;
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03}Z", fmt::gmtime(static_cast<std::time_t>(seconds)), ns / 1'000'000);
}

}  // namespace trigpoint

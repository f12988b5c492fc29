#include "datasets/io/natural_order.h"

#include <string_view>

namespace trigpoint {

bool NaturalLess(const std::string& a, const std::string& b) {
  const auto digit = [](char c) { return c >= '0' && c <= '9'; };
  size_t i = 0, k = 0;
  while (i < a.size() && k < b.size()) {
    if (digit(a[i]) && digit(b[k])) {
      const auto number = [&](const std::string& s, size_t* at) {
        while (*at < s.size() && s[*at] == '0') ++*at;
        const size_t begin = *at;
        while (*at < s.size() && digit(s[*at])) ++*at;
        return std::string_view(s).substr(begin, *at - begin);
      };
      const std::string_view x = number(a, &i), y = number(b, &k);
      if (x.size() != y.size()) return x.size() < y.size();
      if (x != y) return x < y;
    } else if (a[i] != b[k]) {
      return a[i] < b[k];
    } else {
      ++i, ++k;
    }
  }
  return a.size() - i != b.size() - k ? a.size() - i < b.size() - k : a < b;
}

}  // namespace trigpoint

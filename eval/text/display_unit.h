// What lengths are printed in; files stay in metres.
#pragma once

#include <string>

namespace trigpoint {

struct DisplayUnit {
  std::string name = "m";
  double metres = 1;
};

}  // namespace trigpoint

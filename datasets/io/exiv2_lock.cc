#include "datasets/io/exiv2_lock.h"

#include <exiv2/exiv2.hpp>

namespace trigpoint {

std::unique_lock<std::mutex> LockExiv2() {
  static std::mutex mutex;
  std::unique_lock<std::mutex> lock(mutex);
  static const bool begun = [] {
    Exiv2::XmpParser::initialize();
    Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute);
    return true;
  }();
  static_cast<void>(begun);
  return lock;
}

}  // namespace trigpoint

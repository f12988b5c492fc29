#include "survey/tags/tag_family.h"

#include <apriltag/apriltag.h>
#include <apriltag/common/image_u8.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>

#include <algorithm>

#include "calib/base/error.h"
#include "datasets/io/tag_families.h"

namespace trigpoint {
namespace {

struct Maker {
  const char* name;
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};

constexpr Maker kMakers[] = {
    {"tag36h11", tag36h11_create, tag36h11_destroy},
    {"tag36h10", tag36h10_create, tag36h10_destroy},
    {"tag25h9", tag25h9_create, tag25h9_destroy},
    {"tag16h5", tag16h5_create, tag16h5_destroy},
    {"tagCircle21h7", tagCircle21h7_create, tagCircle21h7_destroy},
    {"tagCircle49h12", tagCircle49h12_create, tagCircle49h12_destroy},
    {"tagCustom48h12", tagCustom48h12_create, tagCustom48h12_destroy},
    {"tagStandard41h12", tagStandard41h12_create, tagStandard41h12_destroy},
    {"tagStandard52h13", tagStandard52h13_create, tagStandard52h13_destroy},
};

const Maker& FindMaker(const std::string& name) {
  for (const Maker& maker : kMakers) {
    if (name == maker.name) return maker;
  }
  std::string known;
  for (const Maker& maker : kMakers) known += std::string(known.empty() ? "" : ", ") + maker.name;
  throw OptionError("tag family \"" + name + "\" is not known, expected one of " + known);
}

}  // namespace

std::vector<std::string> TagFamilyNames() {
  std::vector<std::string> names;
  for (const Maker& maker : kMakers) names.emplace_back(maker.name);
  return names;
}

TagFamily::TagFamily(const std::string& name)
    : name_(name), family_(FindMaker(name).create(), FindMaker(name).destroy) {}

int TagFamily::size() const { return static_cast<int>(family_->ncodes); }

int TagFamily::Correctable() const {
  // The library keeps every code with every such error in a table of three places of 16 bytes each.
  constexpr double kLargestTable = 512.0 * 1024 * 1024, kPlace = 3 * 16;
  const double bits = family_->nbits, codes = family_->ncodes;
  int most = std::clamp((static_cast<int>(family_->h) - 5) / 3, 0, 2);
  if (most == 2 && codes * (1 + bits + bits * (bits - 1) / 2) * kPlace > kLargestTable) most = 1;
  return most;
}

TagPattern TagFamily::Pattern(int id) const {
  if (id < 0 || id >= size()) throw InputError(TagIdProblem(name_, id));
  image_u8_t* image = apriltag_to_image(family_.get(), id);
  TagPattern pattern;
  pattern.total = family_->total_width;
  pattern.width = family_->width_at_border;
  pattern.margin = (pattern.total - pattern.width) / 2;
  pattern.white.resize(pattern.total * pattern.total);
  for (int r = 0; r < pattern.total; ++r) {
    for (int c = 0; c < pattern.total; ++c) {
      pattern.white[r * pattern.total + c] = image->buf[r * image->stride + c] > 127 ? 1 : 0;
    }
  }
  image_u8_destroy(image);
  return pattern;
}

}  // namespace trigpoint

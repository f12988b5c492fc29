#include "datasets/project/reference_parts.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

// Whatever the names have in common, each part has its share, and a name has one part.
TEST(ReferencePartsTest, AreAboutEqual) {
  for (const char* pattern : {"S{0}/S{0}.jpg", "panoramas/S{0:03}/S{0:03}.jpg", "S{0:03}/S{0:03}.png", "{}.jpg"}) {
    Site site;
    for (int k = 0; k < 400; ++k) site.references.emplace_back().name = fmt::format(fmt::runtime(pattern), k);
    const std::vector<std::string> parts = ReferenceParts(site);
    ASSERT_EQ(parts.size(), 4U);
    size_t all = 0;
    for (const std::string& part : parts) {
      const size_t count = SiteOfPart(site, part).references.size();
      EXPECT_NEAR(static_cast<double>(count), 100, 45) << pattern << " " << part;  // 5 sigmas
      all += count;
    }
    EXPECT_EQ(all, 400U);
  }
  for (const char* none : {"000of000", "4of4", "3of16", "003of016x", "x"})
    EXPECT_THROW(SiteOfPart(Site(), none), OptionError) << none;
}

}  // namespace
}  // namespace trigpoint

#include "datasets/project/options_json.h"

#include <gmock/gmock.h>

#include <limits>

#include "calib/base/error.h"
#include "datasets/project/yaml_json.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

struct InnerOptions {
  double ratio = 0.8;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.ratio, {"ratio", "", 0.01, 1.0, "ratio test"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

struct ToyOptions {
  bool fast = false;
  int count = 3;
  int64_t large = 1LL << 40;
  uint64_t seed = 1;
  double radius_m = 12;
  std::string mode = "trigpoint";
  InnerOptions tracks;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.fast, {"fast", ""});
    visit(self.count, {"count", "", 1, 10, "how many"});
    visit(self.large, {"large", ""});
    visit(self.seed, {"seed", ""});
    visit(self.radius_m, {"radius_m", "m", 0, 1000, "how far"});
    visit(self.mode, PathOption({"mode", ""}, PathKind::kFile));
    visit(self.tracks, {"tracks", ""});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

std::vector<std::string> Set(const std::string& yaml, ToyOptions& options) {
  std::vector<std::string> problems;
  SetOptions(JsonFromYamlText(yaml), "file", options, problems);
  return problems;
}

TEST(OptionsJson, ComesBackAsItWent) {
  ToyOptions options;
  options.fast = true;
  options.count = -2;
  options.large = std::numeric_limits<int64_t>::min();
  options.seed = std::numeric_limits<uint64_t>::max();
  options.radius_m = 0.1 + 0.2;
  options.mode = "1";
  options.tracks.ratio = 1.0 / 3;
  ToyOptions back;
  std::vector<std::string> problems;
  SetOptions(nlohmann::json::parse(JsonFromOptions(options).dump()), "file", back, problems);
  EXPECT_THAT(problems, testing::IsEmpty());
  EXPECT_EQ(JsonFromOptions(back), JsonFromOptions(options));
  EXPECT_EQ(back.radius_m, options.radius_m);
  EXPECT_EQ(back.tracks.ratio, options.tracks.ratio);
}

TEST(OptionsJson, TakesOnlyWhatIsNamed) {
  ToyOptions options;
  EXPECT_THAT(Set("{radius_m: 5, tracks: {ratio: 0.5}, fast: true, mode: \"2\"}", options), testing::IsEmpty());
  EXPECT_EQ(options.radius_m, 5);  // a whole number is a number
  EXPECT_EQ(options.tracks.ratio, 0.5);
  EXPECT_TRUE(options.fast);
  EXPECT_EQ(options.mode, "2");
  EXPECT_EQ(options.count, 3);
}

TEST(OptionsJson, UnknownNamesComeWithTheNearest) {
  ToyOptions options;
  const auto problems = Set("{radius: 5, tracks: {ration: 0.5}}", options);
  ASSERT_EQ(problems.size(), 2u);
  EXPECT_THAT(problems, testing::Contains("file: unknown option 'radius'; nearest known one: 'radius_m'"));
  EXPECT_THAT(problems, testing::Contains("file: unknown option 'tracks.ration'; nearest known one: 'ratio'"));
}

TEST(OptionsJson, WrongTypesAreNamed) {
  for (const char* yaml :
       {"{count: 1.5}", "{count: many}", "{count: 99999999999}", "{fast: 1}", "{fast: yes}", "{radius_m: far}",
        "{radius_m: .nan}", "{radius_m: inf}", "{mode: 3}", "{tracks: 0.5}", "{seed: -1}", "{large: 1e3}", "[1, 2]"}) {
    ToyOptions options;
    const auto problems = Set(yaml, options);
    ASSERT_EQ(problems.size(), 1u) << yaml;
    EXPECT_THAT(problems[0], HasSubstr("expected ")) << yaml;
    EXPECT_THAT(problems[0], HasSubstr("found ")) << yaml;
    EXPECT_EQ(JsonFromOptions(options), JsonFromOptions(ToyOptions{})) << yaml;
  }
}

TEST(OptionsJson, AllViolationsInOneError) {
  ToyOptions options;
  options.count = 0;
  options.tracks.ratio = 2;
  try {
    ThrowIfAny(options.Check());
    FAIL();
  } catch (const OptionError& e) {
    EXPECT_THAT(e.what(), HasSubstr("count is 0"));
    EXPECT_THAT(e.what(), HasSubstr("tracks: option ratio is 2"));
    EXPECT_EQ(e.ExitCode(), 2);
  }
  EXPECT_NO_THROW(ThrowIfAny({}));
}

TEST(OptionsJson, DescribesWhatHelpShows) {
  const auto all = DescribeOptions<ToyOptions>();
  ASSERT_EQ(all.size(), 7u);
  EXPECT_EQ(all[4].name, "radius_m");
  EXPECT_EQ(all[4].unit, "m");
  EXPECT_EQ(all[4].default_value, 12.0);
  EXPECT_EQ(all[4].max, 1000);
  EXPECT_EQ(all[4].path, PathKind::kNone);
  EXPECT_EQ(all[5].name, "mode");
  EXPECT_EQ(all[5].type, "text");
  EXPECT_EQ(all[5].path, PathKind::kFile);
  EXPECT_EQ(all[6].name, "tracks.ratio");
  EXPECT_EQ(all[6].help, "ratio test");
}

}  // namespace
}  // namespace trigpoint

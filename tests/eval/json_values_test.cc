// Values of results that are not what they should be.
#include "eval/text/json_values.h"

#include <gtest/gtest.h>

namespace trigpoint {
namespace {

using nlohmann::json;

TEST(JsonValues, WhatIsOfAnotherTypeIsNotStated) {
  const json value = {{"a", {{"b", 2.5}, {"list", {1, 2, 3}}}}, {"text", "t"}, {"flag", true}, {"null", nullptr}};
  EXPECT_EQ(At(value, {"a", "b"}), 2.5);
  for (const char* key : {"text", "flag", "null", "missing"}) EXPECT_FALSE(At(value, {key})) << key;
  EXPECT_FALSE(At(value, {"text", "b"}));
  EXPECT_EQ(TextAt(value, "text"), "t");
  EXPECT_EQ(TextAt(value, "flag"), "");
  EXPECT_TRUE(FlagAt(value, "flag"));
  EXPECT_FALSE(FlagAt(value, "text"));
  EXPECT_EQ(ListAt(ObjectAt(value, "a"), "list").size(), 3u);
  EXPECT_TRUE(ListAt(value, "a").empty());
  EXPECT_TRUE(ObjectAt(value, "text").empty());
  EXPECT_EQ(TextAt(json(), "text"), "");
}

TEST(JsonValues, IntervalsMayBeOpen) {
  const json value = {{"both", {0.1, 0.3}}, {"above", {0.1, nullptr}}, {"below", {nullptr, 0.3}}, {"none", nullptr}};
  ASSERT_TRUE(IntervalAt(value, "both"));
  EXPECT_EQ(IntervalAt(value, "both")->high, 0.3);
  EXPECT_EQ(OrNull(IntervalAt(value, "both")), value["both"]);
  for (const char* key : {"above", "below", "none", "missing"}) EXPECT_FALSE(IntervalAt(value, key)) << key;
  ASSERT_TRUE(EndsAt(value, "above"));
  EXPECT_EQ(EndsAt(value, "above")->low, 0.1);
  EXPECT_FALSE(EndsAt(value, "above")->high);
  EXPECT_EQ(EndsAt(value, "below")->high, 0.3);
  EXPECT_FALSE(EndsAt(value, "none"));
  EXPECT_EQ(EndsText("1 m", "2 m"), "1 m to 2 m");
  EXPECT_EQ(EndsText("1 m", ""), "from 1 m");
  EXPECT_EQ(EndsText("", "2 m"), "up to 2 m");
  EXPECT_EQ(EndsText("", ""), "");
}

}  // namespace
}  // namespace trigpoint

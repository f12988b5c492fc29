#include "app/pipeline/command_line.h"

#include <gtest/gtest.h>

namespace trigpoint {
namespace {

TEST(CommandLine, NamesWhatDiffersFromTheDefaults) {
  JobQuery query;
  EXPECT_EQ(CommandLine("my_site", query, 0, 1), "trigpoint run my_site");
  query.stages = {"localize"};
  query.runs = {"run1", "second run"};
  query.variants = {"paper"};
  query.overrides = {{"localize", {{"mode", "paper"}, {"tracks", {{"ratio", 0.7}}}}}, {"features", {{"fast", true}}}};
  EXPECT_EQ(CommandLine("/data/my site", query, 2, 7),
            "trigpoint localize '/data/my site' --run run1 --run 'second run' --variant paper --set features.fast=true "
            "--set 'mode=\"paper\"' --set tracks.ratio=0.7 --threads 2 --seed 7");
}

TEST(CommandLine, StagesWithoutVariantsGetNone) {
  JobQuery query;
  query.stages = {"detect"};
  query.variants = {"paper"};
  EXPECT_EQ(CommandLine("s", query, 0, 1), "trigpoint detect s");
}

TEST(CommandLine, AllVariantsAreWhatRunMakesWithoutANamedOne) {
  JobQuery query;
  query.variants = {"", "paper"};
  EXPECT_EQ(CommandLine("s", query, 0, 1), "trigpoint run s");
  query.variants = {"paper"};
  EXPECT_EQ(CommandLine("s", query, 0, 1), "trigpoint run s --variant paper");
}

TEST(CommandLine, PhotoSetsAndCalibrationsHaveNamesOfTheirOwn) {
  JobQuery query;
  query.stages = {"stitch"};
  query.runs = {"corner"};
  query.overrides = {{"stitch", {{"panorama", {{"width", 4096}}}}}};
  EXPECT_EQ(CommandLine("s", query, 0, 1), "trigpoint stitch s --set corner --set panorama.width=4096");
  query.stages = {"calibrate"};
  query.runs = {"phone"};
  query.overrides = {{"calibrate", {{"images", "board/*.jpg"}}}};
  EXPECT_EQ(CommandLine("s", query, 0, 1), "trigpoint calibrate s --name phone --set 'images=\"board/*.jpg\"'");
  EXPECT_EQ(AllStages().back()->name, "plan");
}

TEST(CommandLine, QuotesForTheShell) {
  EXPECT_EQ(ShellWord("a-b_c/d.e"), "a-b_c/d.e");
  EXPECT_EQ(ShellWord(""), "''");
  EXPECT_EQ(ShellWord("it's"), "'it'\\''s'");
  EXPECT_EQ(ShellWord("$HOME"), "'$HOME'");
}

}  // namespace
}  // namespace trigpoint

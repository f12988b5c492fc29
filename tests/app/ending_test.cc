#include "app/cli/ending.h"

#include <gmock/gmock.h>

#include <algorithm>

#include "app/cli/batch_list.h"
#include "app/cli/excerpts.h"
#include "app/cli/terminal.h"
#include "datasets/io/readable.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;
using testing::Not;

int Lines(const std::string& text) { return static_cast<int>(std::count(text.begin(), text.end(), '\n')); }

TEST(Excerpts, LongTextsOfTheCommandLineAreCut) {
  const std::string text(5000, 'a'), cut = std::string(200, 'a') + "... (5000 bytes)";
  EXPECT_EQ(WithExcerpts("no run '" + text + "' in /x/" + text, {"run", text}), "no run '" + cut + "' in /x/" + cut);
  EXPECT_EQ(WithExcerpts("option 'x' is '" + text + "'", {"--set", "x=" + text}), "option 'x' is '" + cut + "'");
  EXPECT_EQ(WithExcerpts("'" + text + "' is no id", {"--ids", "1," + text}), "'" + cut + "' is no id");
  EXPECT_EQ(WithExcerpts("as it is: a, b", {"a", ""}), "as it is: a, b");
}

// Errors and warnings alike, whatever of the user's files they name.
TEST(Excerpts, LongTextsOfFilesAreCut) {
  const std::string text(5000, 'a'), cut = std::string(200, 'a') + "... (5000 bytes)", path = "/x/" + text;
  EXPECT_EQ(WithExcerpts("a.csv:2: expected control, found '" + text + "'; skipped"),
            "a.csv:2: expected control, found '" + cut + "'; skipped");
  EXPECT_EQ(WithExcerpts("('" + text + " " + text + "')"), "('" + Excerpt(text + " " + text) + "')");
  const std::string spaced = "it's a " + text + " and so on";
  EXPECT_EQ(WithExcerpts("(nearest: '" + spaced + "')"), "(nearest: '" + Excerpt(spaced) + "')");
  EXPECT_EQ(WithExcerpts("point " + text + " is seen in " + path), "point " + cut + " is seen in " + path);
  for (const char* same : {"", "'", " ", "it's 'so", "a 'b' 'c'd' e", "ends with '"})
    EXPECT_EQ(WithExcerpts(same), same);
  testing::internal::CaptureStderr();
  const auto messages = std::make_shared<Messages>();
  Terminal terminal(LogLevel::kWarning, false, messages, false);
  terminal.Log(LogLevel::kWarning, "station '" + text + "'");
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("warning: station '" + cut + "'"));
  EXPECT_EQ(messages->said().front().second, "station '" + cut + "'");
}

TEST(Ending, PutsItsLinesInOrder) {
  Ending ending("Run done in 55 s: 2 runs");
  ending.Next("trigpoint status x").Look("Report", "/nowhere/index.html").Problem("Warning", "clock off by 3 s");
  ending.Fact("Located", "7 of 8");
  EXPECT_EQ(ending.Text(),
            "Run done in 55 s: 2 runs\n"
            "Located   7 of 8\n"
            "Warning   clock off by 3 s\n"
            "Report    /nowhere/index.html\n"
            "Next      trigpoint status x\n");
}

TEST(Ending, KeepsToItsLinesAndCountsWhatIsLeftOut) {
  for (const int facts : {0, 3, 30}) {
    for (const int rows : {0, 2, 40}) {
      for (const int problems : {0, 1, 50}) {
        Ending ending("Done");
        for (int i = 0; i < facts; ++i) ending.Fact("Fact", std::to_string(i));
        for (int i = 0; i < rows; ++i) ending.Row("row " + std::to_string(i));
        for (int i = 0; i < problems; ++i) ending.Problem("Warning", std::to_string(i));
        ending.Look("Report", "/x").Next("n").RestIn("the log");
        const std::string text = ending.Text();
        const int all = 3 + facts + rows + problems;
        EXPECT_EQ(Lines(text), std::min(all, static_cast<int>(kEndingLines))) << text;
        EXPECT_EQ(Lines(ending.Text(std::string::npos)), all);
        if (problems > 0) {
          EXPECT_THAT(text, HasSubstr("Warning   0\n"));
        }
        if (problems > 9 && all > static_cast<int>(kEndingLines)) {
          EXPECT_THAT(text, testing::ContainsRegex("And       [0-9]+ more: the log"));
        }
      }
    }
  }
}

TEST(Ending, AProblemIsSaidOnceAndOnOneLine) {
  Ending ending("Done");
  ending.Problem("Warning", "two\nlines").Problem("Warning", "two\nlines");
  EXPECT_EQ(ending.Text(), "Done\nWarning   two lines\n");
}

TEST(Ending, WritesPathsAndListsAsPeopleReadThem) {
  EXPECT_EQ(ShownPath(std::filesystem::current_path() / "a" / "b.csv"), "a/b.csv");
  EXPECT_EQ(ShownPath("/nowhere/b.csv"), "/nowhere/b.csv");
  EXPECT_EQ(Listed({"a", "b", "c"}, 2), "a, b and 1 more");
  EXPECT_EQ(Counted(1, "run", "runs"), "1 run");
  EXPECT_EQ(TakenText(55.2), "55 s");
  EXPECT_EQ(TakenText(125), "2 min 5 s");
  EXPECT_EQ(TakenText(3780), "63 min 0 s");
  EXPECT_EQ(TakenText(7380), "2 h 3 min");
}

// A project whose evaluation shows this median.
BatchResult Evaluated(const std::string& name, double median_m) {
  BatchResult result;
  result.entry.name = name;
  result.status = "done";
  nlohmann::json evaluate = {{"stage", "evaluate"}};
  evaluate["metrics"]["median_m"] = median_m;
  result.stages.push_back(evaluate);
  return result;
}

TEST(BatchEnding, TheMedianIsTheMiddleOfTheProjectsInTheUnitShown) {
  std::vector<BatchResult> results = {Evaluated("c", 3), Evaluated("a", 1)};
  EXPECT_THAT(BatchEnding(results, "Batch", {}).Text(12),
              HasSubstr("2.00 m of 2 projects; best 1.00 m (a), worst 3.00 m (c)"));
  results.push_back(Evaluated("b", 1.5));
  EXPECT_THAT(BatchEnding(results, "Batch", {"half", 0.5}).Text(12),
              HasSubstr("3.00 half of 3 projects; best 2.00 half (a), worst 6.00 half (c)"));
  const std::string table = FormatBatch(results, {"half", 0.5});
  EXPECT_THAT(table, HasSubstr("median half"));
  EXPECT_THAT(table, HasSubstr("6.000"));
  EXPECT_THAT(BatchEnding({Evaluated("a", 1)}, "Batch", {}).Text(12), HasSubstr("1.00 m of 1 project;"));
}

}  // namespace
}  // namespace trigpoint

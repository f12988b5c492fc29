// Tables, YAML and whole files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <limits>

#include "datasets/io/csv.h"
#include "datasets/io/natural_order.h"
#include "datasets/io/readable.h"
#include "datasets/io/text.h"
#include "datasets/io/yaml.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

TEST(NaturalOrder, NumbersWithinNamesAreNumbers) {
  const std::vector<std::string> ordered = {"672.jpg",  "1015.jpg",  "a",     "a/img_2",
                                            "a/img_10", "a/img_10b", "b_007", "b_08"};
  for (size_t i = 0; i < ordered.size(); ++i) {
    for (size_t k = 0; k < ordered.size(); ++k) {
      EXPECT_EQ(NaturalLess(ordered[i], ordered[k]), i < k) << ordered[i] << ' ' << ordered[k];
    }
  }
  EXPECT_NE(NaturalLess("img_7", "img_07"), NaturalLess("img_07", "img_7"));  // a strict order, also of equal numbers
}

TEST(Csv, ReadsWhatSpreadsheetsWrite) {
  const TempDir dir;
  const auto file = dir.Write("t.csv",
                              "\xEF\xBB\xBF# trigpoint tags 1; frame=enu\r\n\r\ntag_id, x ,name\r\n"
                              "# between\r\n7, 1.5e1 ,\"a, \"\"b\"\"\r\nc\"\r\n8,-2,Umlaut \xC3\xA4\r\n");
  const CsvTable table = CsvTable::Read(file, {"tag_id", "x", "name"});
  ASSERT_EQ(table.rows().size(), 2u);
  EXPECT_EQ(table.comments().front(), "trigpoint tags 1; frame=enu");
  EXPECT_EQ(table.rows()[0].Integer("tag_id"), 7);
  EXPECT_EQ(table.rows()[0].Number("x"), 15);
  EXPECT_EQ(table.rows()[0].Text("name"), "a, \"b\"\r\nc");
  EXPECT_EQ(table.rows()[0].line(), 5);
  EXPECT_EQ(table.rows()[1].line(), 7);
  EXPECT_EQ(table.rows()[1].Text("name"), "Umlaut \xC3\xA4");
}

TEST(Csv, NamesFileLineAndColumn) {
  const TempDir dir;
  const auto file = dir.Write("t.csv", "# c\na,b\n1,2\nx,nan\n1\n1,2,3\n");
  const CsvTable table = CsvTable::Read(file, {"a", "b"});
  const std::string where = file.string() + ":4: column ";
  EXPECT_THAT(MessageOf<InputError>([&] { table.rows()[1].Integer("a"); }), HasSubstr(where + "a: expected a whole"));
  EXPECT_THAT(MessageOf<InputError>([&] { table.rows()[1].Number("b"); }), HasSubstr(where + "b: expected a number"));
  EXPECT_THAT(MessageOf<InputError>([&] { table.rows()[2].Text("a"); }), HasSubstr(":5: expected 2 cells, found 1"));
  EXPECT_THAT(MessageOf<InputError>([&] { table.rows()[3].Text("a"); }), HasSubstr(":6: expected 2 cells, found 3"));
  std::vector<std::string> warnings;
  int used = 0;
  table.ForEachUsable(&warnings, [&](const CsvRow& row) {
    row.Number("b");
    ++used;
  });
  EXPECT_EQ(used, 1);
  EXPECT_EQ(warnings.size(), 3u);
}

TEST(Csv, LeavesBadRowsOutWhereNobodyAsksForProblems) {
  const TempDir dir;
  const CsvTable table = CsvTable::Read(dir.Write("t.csv", "a,b\n1,2\nx,3\n4\n5,6\n"), {"a", "b"});
  std::vector<int64_t> used;
  table.ForEachUsable(nullptr, [&](const CsvRow& row) { used.push_back(row.Integer("a")); });
  EXPECT_EQ(used, (std::vector<int64_t>{1, 5}));
  // A table without a good row is refused all the same.
  const CsvTable bad = CsvTable::Read(dir.Write("bad.csv", "a,b\nx,3\n"), {"a", "b"});
  EXPECT_THAT(MessageOf<InputError>([&] { bad.ForEachUsable(nullptr, [](const CsvRow& row) { row.Integer("a"); }); }),
              HasSubstr("bad.csv:2: column a: expected a whole"));
}

TEST(Csv, NamesTheNearestColumn) {
  const TempDir dir;
  const auto file = dir.Write("t.csv", "station,tagid,east_m,lunch\nS,1,2,3\n");
  EXPECT_THAT(MessageOf<InputError>([&] {
                CsvTable::Read(file, {"station", "tag_id"});
              }),
              HasSubstr(":1: column 'tag_id' is missing in the header row; nearest column found: 'tagid'"));
  const CsvTable table = CsvTable::Read(file, {"station"}, {"tag_id", "east_m"});
  ASSERT_EQ(table.warnings().size(), 2u);
  EXPECT_THAT(table.warnings()[0],
              HasSubstr("column 'tagid' is not known and not used; nearest known column: 'tag_id'"));
  EXPECT_THAT(MessageOf<InputError>([&] { CsvTable::Read(dir.Write("e.csv", "# only\n"), {"a"}); }),
              HasSubstr("empty"));
  EXPECT_THAT(MessageOf<InputError>([&] { CsvTable::Read(dir.Write("d.csv", "a,a\n"), {"a"}); }), HasSubstr("twice"));
  EXPECT_THAT(MessageOf<InputError>([&] { CsvTable::Read(dir.Write("q.csv", "a\n\"x\n"), {"a"}); }),
              HasSubstr("q.csv:2: a quote is opened"));
  EXPECT_THAT(MessageOf<InputError>([&] { CsvTable::Read(dir / "none.csv", {"a"}); }), HasSubstr("no such file"));
}

TEST(Csv, WritesWhatItReads) {
  const TempDir dir;
  CsvWriter csv({"n", "x", "t", "text"}, {"trigpoint test 1"});
  csv.Integer(-3).Number(-0.0001, 3).Stamp(1'000'000'000'000'000'001).Text("a \"quoted\", # text ").EndRow();
  csv.Empty().Number(std::numeric_limits<double>::quiet_NaN(), 3).Stamp(-1, 3).Text("").EndRow();
  EXPECT_THROW(csv.EndRow(), std::logic_error);
  csv.Save(dir / "sub/out.csv");
  EXPECT_EQ(ReadTextFile(dir / "sub/out.csv"),
            "# trigpoint test 1\nn,x,t,text\n-3,0.000,1000000000.000000001,\"a \"\"quoted\"\", # text \"\n,,0.000,\n");
  const CsvTable table = CsvTable::Read(dir / "sub/out.csv", {"n", "x", "t", "text"});
  EXPECT_EQ(table.rows()[0].Text("text"), "a \"quoted\", # text ");
  EXPECT_EQ(table.rows()[0].StampNs("t"), 1'000'000'000'000'000'001);
  EXPECT_FALSE(table.rows()[1].Has("x"));
  EXPECT_EQ(table.rows()[1].Number("x", 5), 5);
}

TEST(Csv, GuardsTextThatASpreadsheetWouldCompute) {
  const TempDir dir;
  const std::vector<std::string> texts = {
      "=cmd|' /C calc'!A0", "+1+2", "-2-3", "@SUM(A1)", "'=quoted", "''+2a", "plain=1", "-", "'tis", "-4.5"};
  CsvWriter csv({"text"});
  for (const std::string& text : texts) csv.Text(text).EndRow();
  csv.Save(dir / "out.csv");
  EXPECT_THAT(ReadTextFile(dir / "out.csv"), HasSubstr("\n'=cmd|' /C calc'!A0\n'+1+2\n'-2-3\n'@SUM(A1)\n"));
  EXPECT_THAT(ReadTextFile(dir / "out.csv"), HasSubstr("\nplain=1\n'-\n'tis\n-4.5\n"));
  const CsvTable table = CsvTable::Read(dir / "out.csv", {"text"});
  for (size_t i = 0; i < texts.size(); ++i) EXPECT_EQ(table.rows()[i].Text("text"), texts[i]);
}

// Names of columns may come from people, too: those of stations and runs.
TEST(Csv, NamesAndCommentsAreGuardedAsCellsAre) {
  const TempDir dir;
  const std::vector<std::string> names = {"run", "=HYPERLINK(\"http://x\")", "a, b", "two\nlines"};
  CsvWriter csv(names, {"evil\n=cmd|calc,1,2\r=1"});
  csv.Text("r").Integer(1).Integer(2).Integer(3).EndRow();
  csv.Save(dir / "out.csv");
  EXPECT_THAT(ReadTextFile(dir / "out.csv"),
              testing::StartsWith("# evil =cmd|calc,1,2 =1\nrun,\"'=HYPERLINK(\"\"http://x\"\")\",\"a, b\","));
  const CsvTable table = CsvTable::Read(dir / "out.csv", {"run"});
  EXPECT_EQ(table.columns(), names);
  EXPECT_EQ(table.rows().at(0).Integer("a, b"), 2);
  EXPECT_EQ(table.TextWithout([](const CsvRow&) { return true; }),
            ReadTextFile(dir / "out.csv").substr(0, ReadTextFile(dir / "out.csv").find("\nr,") + 1));
}

TEST(Csv, LongContentIsCutInMessages) {
  const TempDir dir;
  const CsvTable table = CsvTable::Read(dir.Write("t.csv", "n\n" + std::string(5000, 'x') + "\n"), {"n"});
  const std::string message = MessageOf<InputError>([&] { table.rows()[0].Number("n"); });
  EXPECT_THAT(message, HasSubstr("xxx... (5000 bytes)'"));
  EXPECT_LT(message.size(), dir.path().string().size() + 300);
  EXPECT_THAT(MessageOf<InputError>(
                  [&] { CsvTable::Read(dir.Write("t.csv", "n\n" + std::string(1'000'001, 'x') + "\n"), {"n"}); }),
              HasSubstr("t.csv:2: expected cells of at most 1000000 bytes, found one of 1000001"));
}

TEST(Text, ExcerptsEndAtACharacter) {
  EXPECT_EQ(Excerpt("short"), "short");
  const std::string text = std::string(199, 'a') + "\xC3\xA4" + std::string(100, 'b');
  EXPECT_EQ(Excerpt(text), std::string(199, 'a') + "... (301 bytes)");
}

TEST(Text, Latin1BecomesUtf8) {
  EXPECT_EQ(ValidUtf8("H\xC3\xA4user \xE2\x82\xAC \xF0\x9F\x98\x80"), "H\xC3\xA4user \xE2\x82\xAC \xF0\x9F\x98\x80");
  EXPECT_EQ(ValidUtf8("H\xE4user"), "H\xC3\xA4user");
  EXPECT_EQ(ValidUtf8("cut \xE2\x82"), "cut \xC3\xA2\xC2\x82");
  EXPECT_EQ(ValidUtf8("\xC0\xAF"), "\xC3\x80\xC2\xAF") << "overlong";
  EXPECT_EQ(ValidUtf8("\xED\xA0\x80"), "\xC3\xAD\xC2\xA0\xC2\x80") << "a surrogate";
}

TEST(TextFile, IsReplacedAsAWhole) {
  const TempDir dir;
  WriteFileAtomically(dir / "a/b.txt", "one");
  WriteFileAtomically(dir / "a/b.txt", "two");
  EXPECT_EQ(ReadTextFile(dir / "a/b.txt"), "two");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(dir / "a"), std::filesystem::directory_iterator()), 1);
  // A folder in the file's place, a file in a folder's place: named, and nothing left behind.
  std::filesystem::create_directories(dir / "taken/x");
  EXPECT_THAT(MessageOf<IoError>([&] { WriteFileAtomically(dir / "taken", "x"); }),
              HasSubstr("taken: cannot be written"));
  EXPECT_THAT(MessageOf<IoError>([&] { WriteFileAtomically(dir / "a/b.txt/c", "x"); }), HasSubstr("cannot be written"));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(dir.path()), std::filesystem::directory_iterator()), 2);
  if (geteuid() != 0) {
    chmod((dir / "a").c_str(), 0500);
    EXPECT_THAT(MessageOf<IoError>([&] { WriteFileAtomically(dir / "a/c.txt", "x"); }), HasSubstr("Permission denied"));
    chmod((dir / "a").c_str(), 0700);
  }
}

TEST(Paths, StayInside) {
  const TempDir dir;
  const auto resolve = [&](const std::string& written) {
    return ResolveInside(dir.path(), dir / "runs/run1", written, "table.csv:3");
  };
  EXPECT_EQ(resolve("images/a b.jpg"), dir / "runs/run1/images/a b.jpg");
  EXPECT_EQ(resolve("../shared/x.jpg"), dir / "runs/shared/x.jpg");
  EXPECT_EQ(resolve("..data/x.jpg"), dir / "runs/run1/..data/x.jpg");
  for (const std::string bad : {"../../../etc/passwd", "/etc/passwd", "images/../../../../x"}) {
    EXPECT_THAT(MessageOf<PathError>([&] { resolve(bad); }), HasSubstr("table.csv:3: the path '" + bad + "' leaves"));
  }
}

TEST(Times, AreParsedAsUtc) {
  EXPECT_EQ(ParseUtcToNs("1970-01-02"), 86'400'000'000'000);
  EXPECT_EQ(ParseUtcToNs("2026-05-12T09:43:20Z"), 1'778'579'000'000'000'000);
  EXPECT_EQ(ParseUtcToNs("2026-05-12T11:43:20.25+02:00"), 1'778'579'000'250'000'000);
  for (const char* bad :
       {"", "2026", "2026-13-01", "2026-02-30", "2026-05-12T25:00:00Z", "12.5.2026", "2026-05-12Tx"}) {
    EXPECT_FALSE(ParseUtcToNs(bad)) << bad;
  }
}

TEST(Yaml, NamesLineKeyAndNearest) {
  const TempDir dir;
  const auto load = [&](const std::string& text) {
    const auto file = dir.Write("run.yaml", text);
    return YamlMap(file, LoadYaml(file), {"mirrored", "gps", "list"});
  };
  EXPECT_THAT(MessageOf<InputError>([&] { load("gps: 1\nmirored: true\n"); }),
              HasSubstr("run.yaml:2: unknown key 'mirored'; nearest known key: 'mirrored'"));
  EXPECT_THAT(MessageOf<InputError>([&] { load("gps:\n  a: 1\n").Map("gps", {"lever_arm_m"}); }),
              HasSubstr("run.yaml:2: unknown key 'gps.a'"));
  EXPECT_THAT(MessageOf<InputError>([&] { load("gps: 1\n").Map("gps", {"lever_arm_m"}); }),
              HasSubstr("run.yaml:1: key 'gps': expected 'key: value' lines, found '1'"));
  EXPECT_THAT(MessageOf<InputError>([&] { load("\nmirrored: maybe\n").Bool("mirrored", false); }),
              HasSubstr("run.yaml:2: key 'mirrored': expected true or false, found 'maybe'"));
  EXPECT_THAT(MessageOf<InputError>([&] { load("list: [1, x]\n").Numbers("list"); }), HasSubstr("expected a number"));
  EXPECT_THAT(MessageOf<InputError>([&] { load("list: [1, 2]\n").Numbers("list", 3); }), HasSubstr("a list of 3"));
  EXPECT_THAT(MessageOf<InputError>([&] { load("list: .nan\n").Number("list", 0); }), HasSubstr("expected a number"));
  EXPECT_THAT(MessageOf<InputError>([&] { load("gps: 1\ngps: 2\n"); }),
              HasSubstr("run.yaml:2: key 'gps' stands twice, first on line 1"));
  EXPECT_THAT(MessageOf<InputError>([&] { load("gps:\n\tlever_arm_m: [0, 0, 1]\n"); }),
              HasSubstr("run.yaml:2: the line is indented with a tab"));
  EXPECT_THAT(MessageOf<InputError>([&] { load("gps: [1, 2\n"); }), HasSubstr("not valid YAML"));
  EXPECT_THAT(MessageOf<InputError>([&] { load("- a\n"); }), HasSubstr("found a list of 1"));
  EXPECT_FALSE(load("").Has("gps"));
  EXPECT_EQ(load("\xEF\xBB\xBFmirrored: true\r\nlist: [1, 2.5]\r\n").Numbers("list"), (std::vector<double>{1, 2.5}));
  EXPECT_EQ(load("gps: # nothing\n").Map("gps", {"lever_arm_m"}).Number("lever_arm_m", 4), 4);
}

}  // namespace
}  // namespace trigpoint

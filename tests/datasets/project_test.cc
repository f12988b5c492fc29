#include "datasets/project/project.h"

#include <gmock/gmock.h>

#include "datasets/io/text.h"
#include "datasets/project/result_part.h"
#include "tests/support/project_folder.h"

namespace trigpoint {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(Project, InitWritesWhatItFoundAndOpenReadsIt) {
  const ProjectFolder folder;
  const InitReport report = Project::Init(folder.dir());
  EXPECT_TRUE(report.created);
  EXPECT_THAT(folder.Read("trigpoint.yaml"), HasSubstr("runs: [\"run1\", \"run2\"]"));
  EXPECT_THAT(folder.Read("trigpoint.yaml"), HasSubstr("crs: EPSG:32632"));
  EXPECT_THAT(report.found, testing::Contains(HasSubstr("2 control points, 1 of them for checks only")));
  EXPECT_THAT(report.missing, testing::Contains(HasSubstr("panoramas")));

  const Project project = Project::Open(folder.dir());
  EXPECT_EQ(project.name(), "site");
  EXPECT_THAT(project.RunNames(), ElementsAre("run1", "run2"));
  ASSERT_TRUE(project.has_frame());
  EXPECT_NEAR(project.frame().origin().latitude_deg, 48.0001, 1e-6);
  EXPECT_NEAR(project.frame().origin().height_m, 241, 1e-4);
}

TEST(Project, BareFolderHasTheFrameThatInitWrites) {
  const ProjectFolder folder;
  const Geodetic bare = Project::Open(folder.dir()).frame().origin();
  Project::Init(folder.dir());
  const Geodetic written = Project::Open(folder.dir()).frame().origin();
  EXPECT_EQ(bare.latitude_deg, written.latitude_deg);
  EXPECT_EQ(bare.longitude_deg, written.longitude_deg);
  EXPECT_EQ(bare.height_m, written.height_m);
}

TEST(Project, OriginFileGoesBeforeTheMean) {
  const ProjectFolder folder;
  folder.Write("origin.json", R"({"lat": 47.5, "lon": 8.5, "alt": 400})");
  EXPECT_EQ(Project::Open(folder.dir()).frame().origin().latitude_deg, 47.5);
}

TEST(Project, InitKeepsTheFileAndAddsNewRuns) {
  const ProjectFolder folder;
  folder.Write("trigpoint.yaml", "# mine\nname: \"a: b\"\nruns: [run1]\nroles: {run1: survey}\n");
  const InitReport report = Project::Init(folder.dir());
  EXPECT_FALSE(report.created);
  EXPECT_EQ(folder.Read("trigpoint.yaml"),
            "# mine\nname: \"a: b\"\nruns: [\"run1\", \"run2\"]\nroles: {run1: survey}\n");
  EXPECT_THAT(report.added, ElementsAre("runs: [\"run1\", \"run2\"]"));
  EXPECT_EQ(ReadTextFile(report.kept), "# mine\nname: \"a: b\"\nruns: [run1]\nroles: {run1: survey}\n");
  EXPECT_TRUE(Project::Init(folder.dir()).kept.empty());
  EXPECT_EQ(Project::Open(folder.dir()).run("run1").config.role, "survey");
}

TEST(Project, OnlyACommandThatComputesDeletesWhatHasExpired) {
  const ProjectFolder folder;
  folder.Write("panoramas/google-a.jpg", "x");
  folder.Write("panoramas.csv", "file,keep_until\npanoramas/google-a.jpg,2024-01-01T00:00:00Z\n");
  EXPECT_TRUE(Project::Open(folder.dir()).site().references.empty());
  EXPECT_EQ(folder.Read("panoramas/google-a.jpg"), "x");
  EXPECT_THAT(Project::OpenToCompute(folder.dir()).warnings(),
              testing::Contains(HasSubstr("1 panorama was deleted: their source forbids")));
  EXPECT_FALSE(std::filesystem::exists(folder / "panoramas/google-a.jpg"));
}

TEST(Project, UnlistedRunsTakeNoPartAndAreNamed) {
  const ProjectFolder folder;
  folder.Write("trigpoint.yaml", "runs: [run2]\n");
  const Project project = Project::Open(folder.dir());
  EXPECT_THAT(project.RunNames(), ElementsAre("run2"));
  EXPECT_THAT(project.warnings(), testing::Contains(HasSubstr("run1 is not listed")));
  EXPECT_THAT(MessageOf<InputError>([&] { project.run("run3"); }), HasSubstr("nearest: 'run2'"));
}

struct BadFile {
  const char* content;
  std::vector<const char*> message;
};

TEST(Project, BadProjectFilesAreNamedWithLineAndRemedy) {
  const BadFile kFiles[] = {
      {"schema: 1\nrunz: [run1]\n", {"trigpoint.yaml:2", "runz", "runs"}},
      {"name: x\nruns: run1\n", {"trigpoint.yaml:2", "list"}},
      {"name: \"evil\\n=cmd\"\n", {"trigpoint.yaml:1", "name", "expected one line"}},
      {"runs: [run7]\n", {"run7", "nearest: 'run1'"}},
      {"runs: [../other]\n", {"trigpoint.yaml:1", "../other", "runs/"}},
      {"runs: [../../other]\n", {"trigpoint.yaml:1", "../../other", "leaves the project"}},
      {"runs: [/etc]\n", {"/etc", "leaves the project"}},
      {"roles: {run1: king}\n", {"trigpoint.yaml:1", "king", "evaluation"}},
      {"stages:\n\tlocalize: {}\n", {"trigpoint.yaml:2", "tab"}},
      {"stages:\n  localize: 3\n", {"trigpoint.yaml:2", "localize"}},
      {"variants: {../x: {}}\n", {"../x"}},
      {"name: a\nname: b\n", {"trigpoint.yaml:2", "twice"}},
      {"origin: {latitude_deg: 48}\n", {"longitude_deg"}},
      {"origin: {latitude_deg: north, longitude_deg: 8}\n", {"latitude_deg", "number", "north"}},
      {"origin: {latitude_deg: 95, longitude_deg: 8}\n", {"95"}},
      {"crs: 4326\n", {"EPSG:", "4326"}},
      {"schema: 2\n", {"schema", "expected 1", "found 2"}},
      {"a: [\n", {"trigpoint.yaml", "YAML"}},
  };
  for (const BadFile& bad : kFiles) {
    SCOPED_TRACE(bad.content);
    const ProjectFolder folder;
    folder.Write("trigpoint.yaml", bad.content);
    const std::string message = MessageOf<InputError>([&] { Project::Open(folder.dir()); });
    for (const char* part : bad.message) EXPECT_THAT(message, HasSubstr(part));
    EXPECT_THAT(message, testing::Not(HasSubstr("\n")));
  }
}

TEST(Project, AnythingButAProjectIsRefused) {
  const ProjectFolder folder;
  folder.Write("empty/notes.txt", "x");
  EXPECT_THAT(MessageOf<InputError>([&] { Project::Open(folder / "nowhere"); }), HasSubstr("no such folder"));
  EXPECT_THAT(MessageOf<InputError>([&] { Project::Open(folder / "control_points.csv"); }), HasSubstr("found a file"));
  EXPECT_THAT(MessageOf<InputError>([&] { Project::Init(folder / "empty"); }), HasSubstr("expected a folder"));
  EXPECT_FALSE(std::filesystem::exists(folder / "empty/trigpoint.yaml"));
}

// A folder whose only file cannot be used: its reason is the answer.
TEST(Project, InitStatesWhyTheOnlyTableIsUnusable) {
  const ProjectFolder folder;
  folder.Write("only/a.jpg", "x");
  folder.Write("only/panoramas.csv", "file,latitude_deg,longitude_deg\na.jpg,north,7.8\n");
  const std::string message = MessageOf<InputError>([&] { Project::Init(folder / "only"); });
  EXPECT_THAT(message, HasSubstr("panoramas.csv:2"));
  EXPECT_THAT(message, HasSubstr("'north'"));
  folder.Write("only/panoramas.csv", "bild;breite\na.jpg;48\n");
  EXPECT_THAT(MessageOf<InputError>([&] { Project::Open(folder / "only"); }),
              testing::AllOf(HasSubstr("panoramas.csv:1"), HasSubstr("column 'file' is missing")));
}

TEST(Project, OriginIsAMeanOfKnownHeightsAcrossTheMeridian) {
  const ProjectFolder folder;
  folder.Write("fiji/runs/r/detections.csv", folder.Read("runs/run1/detections.csv"));
  folder.Write("fiji/runs/r/camchain.yaml", folder.Read("runs/run1/camchain.yaml"));
  folder.Write("fiji/runs/r/gps.csv",
               "timestamp_s,latitude_deg,longitude_deg,height_m\n1,-17,179.999,60\n2,-17,-179.999,\n3,-17,179.999,62\n"
               "4,-17,-179.999,\n");
  const Project project = Project::Open(folder / "fiji");
  EXPECT_EQ(project.site().runs.at(0).gps.size(), 4u);
  const SiteOrigin origin = *FindOrigin(project.site());
  EXPECT_NEAR(std::abs(origin.position.longitude_deg), 180, 1e-6);
  EXPECT_NEAR(origin.position.height_m, 61, 1e-9);
}

TEST(Project, NamesOfAnyKindWork) {
  for (const char* name : {"with space", "Straße \"Nord\"", "it's", "a'b\"c: #d"}) {
    SCOPED_TRACE(name);
    const ProjectFolder folder(name);
    Project::Init(folder.dir());
    const Project project = Project::Open(folder.dir());
    EXPECT_EQ(project.name(), name);
    EXPECT_EQ(project.RunNames().size(), 2u);
  }
}

TEST(Project, ResultsOfOneOrAllRunsAndVariants) {
  const ProjectFolder folder;
  const Project project = Project::Open(folder.dir());
  EXPECT_EQ(project.ResultDir("localize", "run1@paper"), project.results() / "localize" / "run1@paper");
  EXPECT_EQ(project.ResultDir("evaluate", ""), project.results() / "evaluate");
  EXPECT_EQ(project.ResultDir("evaluate", "@paper"), project.results() / "evaluate@paper");
  EXPECT_NO_THROW(CheckVariantName("paper-2"));
  for (const char* bad : {"", ".x", "a/b", "a@b"}) EXPECT_THROW(CheckVariantName(bad), OptionError) << bad;
}

TEST(ResultPart, HasANameThatIsReadBack) {
  EXPECT_EQ(PartName({0, 1}), "");
  EXPECT_EQ(PartName({3, 16}), "003of016");
  EXPECT_EQ(PartName({7, 2048}), "007of2048");
  for (const ResultPart part : {ResultPart{0, 1}, ResultPart{3, 16}, ResultPart{1999, 2048}}) {
    const std::string name = PartName(part);
    for (const auto& read : {ParsePartName(name), PartOfResult(name.empty() ? "references" : "references@" + name)}) {
      ASSERT_TRUE(read) << name;
      EXPECT_EQ(read->number, part.number);
      EXPECT_EQ(read->count, part.count);
    }
  }
  for (const char* none : {"000of000", "4of4", "3of16", "003of016x", "x", "016of016"})
    EXPECT_FALSE(ParsePartName(none)) << none;
  // A variant may be called so.
  for (const char* other : {"survey@003of016", "references@", "references@paper", "references2", "references/003of016"})
    EXPECT_FALSE(PartOfResult(other)) << other;
}

}  // namespace
}  // namespace trigpoint

// No command writes onto a file that Trigpoint did not write.
#include "datasets/project/outputs.h"

#include <gmock/gmock.h>

#include "datasets/io/text.h"
#include "tests/support/project_folder.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

void WriteOutput(const fs::path& folder, const std::string& name, const std::string& text, bool force = false) {
  OutputFiles output(folder, force);
  WriteFileAtomically(output.staging() / name, text);
  output.Publish();
}

TEST(OutputFiles, ReplacesItsOwnAndNothingElse) {
  const ProjectFolder site;
  const fs::path folder = site / "results/export/csv";
  WriteOutput(folder, "tags.csv", "one");
  WriteOutput(folder, "deeper/tags.csv", "one");
  WriteOutput(folder, "tags.csv", "two");
  EXPECT_EQ(site.Read("results/export/csv/tags.csv"), "two");
  EXPECT_EQ(site.Read("results/export/csv/deeper/tags.csv"), "one");

  site.Write("results/export/csv/tags.csv", "edited");
  EXPECT_THAT(MessageOf<InputError>([&] { WriteOutput(folder, "tags.csv", "three"); }), HasSubstr("changed since"));
  EXPECT_EQ(site.Read("results/export/csv/tags.csv"), "edited");
  WriteOutput(folder, "tags.csv", "three", true);
  EXPECT_EQ(site.Read("results/export/csv/tags.csv"), "three");

  site.Write("results/export/csv/mine.csv", "mine");
  for (const bool force : {false, true}) {
    EXPECT_THAT(MessageOf<InputError>([&] { WriteOutput(folder, "mine.csv", "theirs", force); }),
                HasSubstr("mine.csv: is there already and was not written by trigpoint"));
  }
  EXPECT_EQ(site.Read("results/export/csv/mine.csv"), "mine");
}

TEST(OutputFiles, OneRefusedFileLeavesAllAsTheyWere) {
  const ProjectFolder site;
  site.Write("out/b.txt", "mine");
  EXPECT_THROW(
      {
        OutputFiles output(site / "out");
        WriteFileAtomically(output.staging() / "a.txt", "new");
        WriteFileAtomically(output.staging() / "b.txt", "new");
        output.Publish();
      },
      InputError);
  EXPECT_FALSE(fs::exists(site / "out/a.txt"));
  EXPECT_EQ(site.Read("out/b.txt"), "mine");
  EXPECT_EQ(std::distance(fs::directory_iterator(site / "out"), fs::directory_iterator()), 1);
}

TEST(OutputFiles, LinksAreNotWrittenThroughAndNotReplaced) {
  const ProjectFolder site;
  site.Write("elsewhere.txt", "mine");
  fs::create_directories(site / "out");
  fs::create_symlink(site / "elsewhere.txt", site / "out/a.txt");
  EXPECT_THROW(WriteOutput(site / "out", "a.txt", "new", true), InputError);
  EXPECT_TRUE(fs::is_symlink(site / "out/a.txt"));
  EXPECT_EQ(site.Read("elsewhere.txt"), "mine");
}

TEST(OutputFiles, PlacesThatAProjectReadsAreRefused) {
  const ProjectFolder site;
  for (const char* name :
       {"panoramas.csv", "control_points.csv", "runs/run9/camchain.yaml", "photos/a/b.jpg", "gcp_list.txt",
        "ground_control_points.json", "plan.csv", "plan.geojson", "estimates/orb/run1.tum", "trigpoint.yaml",
        "results/localize/run1/cameras.tum", "out/../stations.csv"}) {
    EXPECT_THROW(RequireOutputPlace(site / name), InputError) << name;
  }
  fs::create_directory_symlink(site.dir(), site.dir().parent_path() / "link");
  EXPECT_THROW(RequireOutputPlace(site.dir().parent_path() / "link/stations.csv"), InputError);
  for (const char* name : {"site.gpkg", "results/export/csv/panoramas.csv", "maps/panoramas.csv"}) {
    EXPECT_NO_THROW(RequireOutputPlace(site / name)) << name;
  }
  EXPECT_NO_THROW(RequireOutputPlace(site.dir().parent_path() / "panoramas.csv"));
}

}  // namespace
}  // namespace trigpoint

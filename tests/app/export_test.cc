// What `trigpoint export` and `adjust` write of solutions: lenses as used, panoramas by their rows, sets by their
// middle.
#include "app/pipeline/export.h"

#include <gmock/gmock.h>

#include <cmath>

#include "datasets/io/camchain.h"
#include "datasets/io/csv.h"
#include "datasets/io/trajectory.h"
#include "datasets/solution/solution_file.h"
#include "eval/exchange/layers.h"
#include "localize/files/tables.h"
#include "localize/site/tables.h"
#include "tests/datasets/sample_solution.h"
#include "tests/support/project_folder.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

class Exported : public testing::Test {
 protected:
  fs::path Export(const std::string& to, const std::string& frame = "") {
    ExportRequest request;
    request.to = to;
    request.runs = {"run1"};
    request.frame = frame;
    request.out = folder_ / "out";
    ExportResults(Project::Open(folder_.dir()), request, progress_, cancel_);
    return request.out;
  }
  ProjectFolder folder_;
  ProgressSink progress_;
  CancelToken cancel_;
};

TEST_F(Exported, CamerasHaveTheLensesThatWereFound) {
  const auto focal = [&] { return ReadCamchain(Export("kalibr") / "camchain.yaml").front().camera.MeanFocal(); };
  EXPECT_EQ(focal(), 100);
  std::string found = folder_.Read("runs/run1/camchain.yaml");
  const std::string read = "[100, 100, 49.5, 49.5]";
  ASSERT_NE(found.find(read), std::string::npos);
  folder_.Write("results/reconstruct/run1/camchain.yaml",
                found.replace(found.find(read), read.size(), "[105, 105, 49.5, 49.5]"));
  EXPECT_EQ(focal(), 105);
}

TEST_F(Exported, CamerasThatAreNotAsWrittenAreRefused) {
  folder_.Write("results/reconstruct/run1/camchain.yaml", folder_.Read("runs/run1/camchain.yaml"));
  folder_.Write("results/reconstruct/run1/manifest.json",
                R"({"schema": 1, "files": {"camchain.yaml": "of what the stage wrote"}})");
  EXPECT_THAT(MessageOf<InputError>([&] { Export("kalibr"); }),
              testing::HasSubstr("run1/camchain.yaml: expected what the stage wrote, found another content"));
}

// The project's origin (here: its control points) may have moved since a result was computed.
TEST_F(Exported, CoordinatesCountFromTheOriginOfTheResult) {
  const Geodetic origin{48.1, 11.5, 500.25};  // of the solution, too
  const std::string result = "results/localize/run1/";
  folder_.Write(result + "manifest.json", R"({"schema": 1, "values": {"origin": [48.1, 11.5, 500.25]}})");
  folder_.Write(result + "panoramas.csv", "panorama,status\n");
  folder_.Write(result + "cameras.csv", "timestamp,image,camera,x,y,z\n1.0,a.jpg,cam0,10,20,30\n");
  folder_.Write(result + "cameras.tum", "1.0 10 20 30 0 0 0 1\n");
  folder_.Write(result + "cameras_odom.tum", "1.0 0 0 0 0 0 0 1\n");
  WriteSolution(MakeSolution(), folder_ / (result + kSolutionFile));
  const Project project = Project::Open(folder_.dir());
  ExportRequest request;
  request.to = "geojson";
  request.what = {"cameras"};
  request.runs = {"run1"};
  std::vector<std::string> warnings;
  const std::vector<Layer> layers = MapLayers(project, request, &warnings);
  ASSERT_EQ(layers.size(), 1u);
  const Eigen::Vector3d expected = EcefFromGeodetic(LocalFrame(origin).GeodeticFromEnu({10, 20, 30}));
  EXPECT_LT((EcefFromGeodetic(layers[0].features.at(0).geometry.at(0)) - expected).norm(), 1e-6);
  // Files in metres name it, since they cannot be used beside coordinates about the project's.
  for (const char* to : {"tum", "ply"}) {
    request.to = to;
    request.what.clear();
    request.out = folder_ / to;
    EXPECT_THAT(
        ExportResults(project, request, progress_, cancel_).warnings,
        testing::ElementsAre(testing::HasSubstr("origin of its result, 48.100000000, 11.500000000, 500.2500 m")));
  }
  EXPECT_THAT(folder_.Read("ply/points.ply"), testing::HasSubstr("origin latitude 48.100000000 deg"));
  request.to = "tum";
  request.frame = "odom";
  EXPECT_THAT(ExportResults(project, request, progress_, cancel_).warnings, testing::IsEmpty());
}

// A stitched set comes first in the solution, and after the panoramas in the table.
TEST_F(Exported, PanoramasAreNumberedByTheirRows) {
  Solution s = MakeSolution();
  s.references[0].row = "panoramas/b.jpg";  // not localized
  const fs::path result = folder_ / "results/localize/run1";
  folder_.Write("results/localize/run1/cameras_odom.tum", "1.0 0 0 0 0 0 0 1\n2.0 1 0 0 0 0 0 1\n");
  folder_.Write("results/localize/run1/panoramas.csv",
                "panorama\npanoramas/a.jpg\n" + s.references[1].row + "\n" + s.references[0].row + "\n");
  WriteSolution(s, result / kSolutionFile);
  const Trajectory panoramas = ReadTrajectory(Export("tum", "odom") / "panoramas.tum");
  ASSERT_EQ(panoramas.poses.size(), 1u);
  EXPECT_EQ(panoramas.poses[0].stamp_ns, 1'000'000'000);
  EXPECT_LT((panoramas.poses[0].target_from_body.translation - OdomFromRig(s, s.references[1].pose).translation).norm(),
            1e-8);
}

// Its geotag may contradict a set after its rig was refined.
TEST_F(Exported, RigsOfRejectedSetsHaveNoPlaceInTheWorld) {
  SetRefinement set;
  set.name = "corner";
  set.rig.rig.views.resize(1);
  Localization result;
  result.on_earth = true;
  const auto has_place = [&](AnswerStatus status) {
    result.references = {ReferenceAnswer()};
    result.references[0].registration.status = status;
    WriteRigs({set}, result, folder_.dir());
    return CsvTable::Read(folder_ / "rigs.csv", {"x"}).rows().front().Has("x");
  };
  EXPECT_TRUE(has_place(AnswerStatus::kLocalized));
  EXPECT_FALSE(has_place(AnswerStatus::kRejected));
}

TEST_F(Exported, ASetInASiteLiesAtTheMeanOfItsPhotos) {
  SiteAdjustment site;
  site.solution = MakeSolution();
  Solution& s = site.solution;
  s.runs.emplace_back().name = "run1";
  const int poses[] = {6, 5};
  for (size_t k = 0; k < 2; ++k) {
    SolutionReference& photo = s.references[k];
    photo.row = "set", photo.status = "localized", photo.pose = poses[k];
    photo.geotag = k == 0 ? "ok" : "";
    photo.geotag_difference = {0.1, -0.2, std::nan("")};  // stated without a height
  }
  site.runs_of_reference = {{0}, {0}};
  site.fit.first_tag = 0;
  const fs::path out = folder_ / "out";
  fs::create_directories(out);
  WriteSiteTables(site, out);
  const CsvTable table = CsvTable::Read(out / "panoramas.csv", {"panorama", "x", "y", "z"});
  ASSERT_EQ(table.rows().size(), 1u);
  const CsvRow& row = table.rows().front();
  const Eigen::Vector3d first = OdomFromRig(s, 6).translation;
  const Eigen::Vector3d mean = 0.5 * (first + OdomFromRig(s, 5).translation);
  ASSERT_GT((first - mean).norm(), 0.1);
  EXPECT_LT((Eigen::Vector3d(row.Number("x"), row.Number("y"), row.Number("z")) - mean).norm(), 1e-5);
  // The stated place is where it was.
  EXPECT_NEAR(row.Number("geotag_de_m"), first.x() + 0.1 - mean.x(), 1e-4);
  EXPECT_NEAR(row.Number("geotag_dn_m"), first.y() - 0.2 - mean.y(), 1e-4);
  EXPECT_FALSE(row.Has("geotag_du_m"));
  EXPECT_EQ(row.Text("geotag_status"), "ok");
  EXPECT_EQ(row.Text("runs"), "run1");
}

}  // namespace
}  // namespace trigpoint

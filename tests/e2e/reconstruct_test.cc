// The reconstruct stage: made once, shared, made again where its solution is damaged, read by what follows.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "datasets/io/camchain.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "datasets/io/trajectory.h"
#include "datasets/solution/solution_covariance.h"
#include "datasets/solution/solution_file.h"
#include "tests/support/program.h"
#include "tests/support/project_folder.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// The second run of the embedded site, with few features in the panoramas' views.
class Reconstructed : public testing::Test {
 protected:
  Reconstructed() {
    folder_.CopySecondRunOfParkingLot();
    Configure("");
  }
  void Configure(const std::string& more) const {
    folder_.Write("trigpoint.yaml",
                  "stages:\n  references: {views: {size_px: 400}, references: {max_features: 600}}\n" + more);
  }
  // What became of each stage's result.
  std::map<std::string, std::string> Stages(const std::vector<std::string>& arguments,
                                            std::string* warnings = nullptr) {
    std::vector<std::string> all = arguments;
    all.insert(all.begin() + 1, dir());
    all.push_back("--json");
    const Finished finished = Trigpoint(all);
    EXPECT_EQ(finished.exit_code, 0) << finished.err;
    if (warnings != nullptr) *warnings = finished.err;
    std::map<std::string, std::string> ends;
    const nlohmann::json summary = finished.Json();
    for (const auto& stage : summary["stages"]) {
      const std::string name = stage["name"];
      ends[stage["stage"].get<std::string>() + "/" + name] = stage.value("status", stage.value("state", ""));
    }
    return ends;
  }
  nlohmann::json Manifest(const std::string& result) const {
    return nlohmann::json::parse(folder_.Read("results/" + result + "/manifest.json"));
  }
  std::string Answers(const std::string& result) const {
    std::string text;
    for (const char* file : {"cameras.tum", "cameras_odom.tum", "cameras.csv", "panoramas.csv", "views.csv"}) {
      text += folder_.Read("results/localize/" + result + "/" + file);
    }
    return text;
  }
  // solution.db, panoramas.csv and panoramas_cov.csv of a localized run state the same.
  void ExpectCovariancesOf(const std::string& result) const {
    const fs::path folder = folder_ / ("results/localize/" + result);
    const Solution solution = ReadSolution(folder / "solution.db");
    ASSERT_TRUE(solution.georeference);
    std::map<std::string, double> sigma_x;
    const CsvTable panoramas = CsvTable::Read(folder / "panoramas.csv", {"panorama", "status"});
    for (const CsvRow& row : panoramas.rows()) {
      if (row.Text("status") == "localized") sigma_x[row.Text("panorama")] = row.Number("sigma_x_m");
    }
    size_t rows = 0;
    const CsvTable covariances = CsvTable::Read(folder / "panoramas_cov.csv", {"panorama_a", "panorama_b"});
    for (const CsvRow& row : covariances.rows()) {
      const std::string name = row.Text("panorama_a");
      EXPECT_EQ(row.Text("panorama_b"), name);
      EXPECT_NEAR(std::sqrt(row.Number("c33")), sigma_x.at(name), 1e-5);
      for (const SolutionReference& reference : solution.references) {
        if (reference.row != name) continue;
        EXPECT_NEAR(WorldCovariance(solution, reference.pose)(3, 5), row.Number("c35"), 1e-14);
        ++rows;
      }
    }
    EXPECT_EQ(rows, sigma_x.size());
    EXPECT_EQ(CsvTable::Read(folder / "cameras_cov.csv", {"image_a", "image_b", "c00", "c55"}).rows().size(),
              solution.images.size());
  }
  std::string dir() const { return folder_.dir().string(); }
  ProjectFolder folder_;
};

TEST_F(Reconstructed, IsMadeOnceAndMadeAgainWhereItIsDamaged) {
  auto ends = Stages({"reconstruct"});
  EXPECT_EQ(ends.at("reconstruct/run2"), "computed");
  EXPECT_EQ(ends.count("references/"), 0u) << "a reconstruction needs no panoramas";
  const fs::path file = folder_ / "results/reconstruct/run2/solution.db";
  const Solution solution = ReadSolution(file);
  EXPECT_EQ(solution.run, "run2");
  EXPECT_EQ(solution.images.size(), 24u);
  EXPECT_EQ(solution.problem.poses.size(), 24u);
  EXPECT_GT(solution.problem.points.size(), 500u);
  EXPECT_FALSE(solution.georeference);

  ends = Stages({"localize"});
  EXPECT_EQ(ends.at("reconstruct/run2"), "up to date");
  EXPECT_EQ(ends.at("localize/run2"), "computed");
  const std::string answers = Answers("run2");
  ASSERT_THAT(answers, HasSubstr("localized"));
  ExpectCovariancesOf("run2");
  EXPECT_EQ(Stages({"status"}).at("reconstruct/run2"), "done");

  const std::string bytes = ReadTextFile(file);
  for (const bool gone : {true, false}) {
    SCOPED_TRACE(gone ? "gone" : "changed");
    if (gone) {
      fs::remove(file);
    } else {
      WriteFileAtomically(file, bytes.substr(0, bytes.size() / 2));
    }
    EXPECT_EQ(Stages({"status"}).at("reconstruct/run2"), "out of date");
    std::string warnings;
    ends = Stages({"localize"}, &warnings);
    EXPECT_THAT(warnings, HasSubstr("solution.db is not what was written there any more"));
    EXPECT_EQ(ends.at("reconstruct/run2"), "computed");
    EXPECT_EQ(ends.at("localize/run2"), "up to date") << "the same solution changes nothing";
    EXPECT_EQ(ReadTextFile(file), bytes);
  }
  fs::remove_all(folder_ / "results/localize");
  EXPECT_EQ(Stages({"localize", "--threads", "2"}).at("localize/run2"), "computed");
  EXPECT_EQ(Answers("run2"), answers);
}

TEST_F(Reconstructed, IsSharedByVariantsThatDoNotConcernIt) {
  Configure(
      "variants:\n"
      "  strict: {localize: {registration: {min_inliers: 40}}}\n"
      "  short: {reconstruct: {tracks: {min_length: 5}}}\n");
  Stages({"localize", "--variant", "strict"});
  const std::string plain = Manifest("reconstruct/run2")["identity"];
  EXPECT_TRUE(fs::exists(folder_ / "results/localize/run2@strict/manifest.json"));
  EXPECT_FALSE(fs::exists(folder_ / "results/reconstruct/run2@strict"));
  auto ends = Stages({"localize", "--variant", "short"});
  EXPECT_EQ(ends.at("reconstruct/run2@short"), "computed");
  EXPECT_EQ(ends.count("reconstruct/run2"), 0u);
  ends = Stages({"localize", "--mode", "paper"});
  EXPECT_EQ(ends.at("reconstruct/run2@paper"), "computed");
  EXPECT_EQ(Manifest("reconstruct/run2@paper")["options"]["tracks"]["max_gap"], 1);
  EXPECT_EQ(ReadSolution(folder_ / "results/reconstruct/run2@paper/solution.db").mode, "paper");
  EXPECT_EQ(Manifest("reconstruct/run2")["identity"], plain);
  ends = Stages({"status"});
  for (const char* result : {"reconstruct/run2", "reconstruct/run2@short", "reconstruct/run2@paper",
                             "localize/run2@strict", "localize/run2@short", "localize/run2@paper"}) {
    EXPECT_EQ(ends.at(result), "done") << result;
  }
  EXPECT_EQ(ends.count("reconstruct/run2@strict"), 0u);
}

// With many points the geotag is wrong; with few nobody knows which of the two is.
TEST_F(Reconstructed, AWeakAnswerThatItsGeotagContradictsIsRefused) {
  fs::copy("datasets/parking_lot/runs/run1", folder_ / "runs/run1", fs::copy_options::recursive);  // sees four places
  fs::remove_all(folder_ / "runs/run2");
  const std::string table = folder_.Read("panoramas.csv");
  const size_t at = table.find("7.83238765");  // S110; 0.001 deg are 74 m
  ASSERT_NE(at, std::string::npos);
  folder_.Write("panoramas.csv", table.substr(0, at) + "7.83338765" + table.substr(at + 10));
  Configure(
      "variants:\n"
      "  weak: {localize: {registration: {min_contradicted_inliers: 10000}}}\n"
      "  published: {localize: {mode: paper, registration: {min_contradicted_inliers: 10000}}}\n");
  Stages({"localize"});
  Stages({"localize", "--variant", "weak"});
  const auto read = [&](const std::string& result) {
    return CsvTable::Read(folder_ / ("results/localize/" + result + "/panoramas.csv"), {"panorama", "status"});
  };
  const CsvTable plain = read("run1"), weak = read("run1@weak");
  ASSERT_EQ(plain.rows().size(), weak.rows().size());
  int contradicted = 0;
  for (size_t i = 0; i < plain.rows().size(); ++i) {
    const CsvRow &was = plain.rows()[i], &is = weak.rows()[i];
    SCOPED_TRACE(was.Text("panorama"));
    if (was.Text("geotag_status") != "outlier") {
      EXPECT_EQ(is.Text("status"), was.Text("status"));
      continue;
    }
    ++contradicted;
    EXPECT_EQ(was.Text("status"), "localized");
    EXPECT_EQ(is.Text("status"), "rejected");
    EXPECT_THAT(is.Text("reason"), HasSubstr("m from its geotag, 10000 needed where the two disagree"));
  }
  EXPECT_EQ(contradicted, 1);
  // The published method rejects none by its geotag.
  Stages({"localize", "--variant", "published"});
  int outliers = 0;
  const CsvTable published = read("run1@published");
  for (const CsvRow& row : published.rows()) {
    if (row.Text("geotag_status") != "outlier") continue;
    ++outliers;
    EXPECT_EQ(row.Text("status"), "localized") << row.Text("panorama") << ": " << row.Text("reason");
  }
  EXPECT_GT(outliers, 0);
}

// A focal length 2 % too long: what the images and odometry ask for is used, said, and kept for the stages that follow.
TEST_F(Reconstructed, ACalibrationThatImagesContradictIsRevised) {
  fs::copy("datasets/parking_lot/runs/run1", folder_ / "runs/run1", fs::copy_options::recursive);
  fs::remove_all(folder_ / "runs/run2");
  const double right = ReadCamchain(folder_ / "runs/run1/camchain.yaml").front().camera.MeanFocal();
  std::string camchain = folder_.Read("runs/run1/camchain.yaml");
  const std::string key = "intrinsics: [";
  const size_t begin = camchain.find(key) + key.size(), end = camchain.find(", ", camchain.find(", ", begin) + 2);
  camchain.replace(begin, end - begin, std::to_string(1.02 * right) + ", " + std::to_string(1.02 * right));
  folder_.Write("runs/run1/camchain.yaml", camchain);
  std::string warnings;
  Stages({"localize"}, &warnings);
  EXPECT_THAT(warnings, HasSubstr("through another lens than the calibrated one"));
  const fs::path found = folder_ / "results/reconstruct/run1/camchain.yaml";
  ASSERT_TRUE(fs::exists(found));
  EXPECT_NEAR(ReadCamchain(found).front().camera.MeanFocal(), right, 0.01 * right);
  EXPECT_NEAR(ReadSolution(folder_ / "results/localize/run1/solution.db").cameras.front().camera.MeanFocal(), right,
              0.01 * right);
}

// world_from_cam positions of cameras.tum, m.
std::vector<Eigen::Vector3d> Positions(const fs::path& file) {
  std::vector<Eigen::Vector3d> positions;
  for (const TimedPose& pose : ReadTrajectory(file).poses) positions.push_back(pose.target_from_body.translation);
  return positions;
}

TEST_F(Reconstructed, FollowsTheImagesOfARunWithoutOdometry) {
  Stages({"localize"});
  const fs::path cameras = folder_ / "results/localize/run2/cameras.tum";
  const std::vector<Eigen::Vector3d> with = Positions(cameras);
  fs::remove(folder_ / "runs/run2/odometry.tum");
  std::string warnings;
  auto ends = Stages({"localize"}, &warnings);
  EXPECT_EQ(ends.at("reconstruct/run2"), "computed");
  EXPECT_THAT(warnings, HasSubstr("run run2 has no odometry: the motion of 24 of 24 poses was found from its images"));
  EXPECT_THAT(folder_.Read("results/reconstruct/run2/motion.tum"), HasSubstr("from=images"));
  // Geotagged panoramas say how long the run is.
  const std::vector<Eigen::Vector3d> without = Positions(cameras);
  ASSERT_EQ(without.size(), with.size());
  const CsvTable stated = CsvTable::Read(folder_ / "results/localize/run2/cameras.csv", {"sigma_e_m"});
  for (size_t i = 0; i < with.size(); ++i) {
    const CsvRow& row = stated.rows()[i];
    const Eigen::Vector3d sigma(row.Number("sigma_e_m"), row.Number("sigma_n_m"), row.Number("sigma_u_m"));
    EXPECT_LT((without[i] - with[i]).norm(), 3 * sigma.norm()) << i;
    EXPECT_LT(sigma.norm(), 2) << i;
  }
  const nlohmann::json metrics = Manifest("localize/run2")["metrics"];
  EXPECT_GT(metrics["odometry_scale_sigma"], 0.005) << "nothing but the panoramas knows the length";
  const Finished paper = Trigpoint({"localize", dir(), "--mode", "paper"});
  EXPECT_EQ(paper.exit_code, 1);
  EXPECT_THAT(paper.err, HasSubstr("has no odometry, which the published method needs"));
}

// Its options were once those of localize.
TEST_F(Reconstructed, TakesItsOptionsFromWhereTheyWere) {
  Configure("  localize: {tracks: {min_length: 4}, rig: fixed}\n");
  Stages({"reconstruct"});
  EXPECT_EQ(Manifest("reconstruct/run2")["options"]["tracks"]["min_length"], 4);
  auto ends = Stages({"reconstruct", "--set", "tracks.min_length=4"});
  EXPECT_EQ(ends.at("reconstruct/run2"), "up to date");
  Configure("  localize: {tracks: {min_length: 4}, rig: fixed}\n  reconstruct: {tracks: {min_length: 3}}\n");
  ends = Stages({"localize", "--set", "tracks.min_length=4"});
  EXPECT_EQ(ends.at("reconstruct/run2"), "up to date");
  EXPECT_EQ(ends.at("localize/run2"), "computed");
  EXPECT_FALSE(Manifest("localize/run2")["options"].contains("tracks"));
  EXPECT_EQ(Manifest("localize/run2")["options"]["rig"], "fixed");
  Configure("  localize: {tracks: {min_lenth: 4}}\n");
  const Finished wrong = Trigpoint({"status", dir()});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("stages.reconstruct: unknown option 'tracks.min_lenth'"));
  Configure("  survey: {tracks: {min_length: 4}}\n");
  const Finished ties = Trigpoint({"status", dir()});
  EXPECT_EQ(ties.exit_code, 2);
  EXPECT_THAT(ties.err, HasSubstr("stages.survey: option 'tracks' is one of `reconstruct` now"));
}

}  // namespace
}  // namespace trigpoint

// evaluate, its gates, publish and compare as a user calls them, on a made site of nine stations and two runs.
#include <gmock/gmock.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <thread>

#include "app/pipeline/stages.h"
#include "calib/estimation/random.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "datasets/io/trajectory.h"
#include "datasets/project/lock.h"
#include "eval/errors/rotation_errors.h"
#include "tests/support/program.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

// Results of `localize` with errors of known size; the runs bring detections in place of images, so that nothing but
// the evaluation is computed.
class Site {
 public:
  Site() {
    std::string stations = "station,tag_id,east_m,north_m,up_m,sigma_m\n";
    std::string control = "tag_id,role,x_m,y_m,z_m,sigma_h_m,sigma_v_m\n";
    for (int i = 0; i < 9; ++i) {
      const std::string id = std::to_string(i);
      stations.append("S").append(id).append(",").append(id).append(",0,0,1,0.01\n");
      control +=
          std::to_string(i) + (i % 3 == 0 ? ",control," : ",check,") + std::to_string(5 * i) + ",0,1,0.005,0.005\n";
    }
    Write("stations.csv", stations);
    Write("control_points.csv", control);
    Write("tags.yaml", "size_m: 0.5\n");
    Write("origin.json", "{\"lat\": 48.0, \"lon\": 7.8, \"alt\": 200.0}");
    for (const char* run : {"run1", "run2"}) {
      const std::string folder = std::string("runs/") + run + "/";
      Write(folder + "odometry.tum", "0.0 0 0 0 0 0 0 1\n41.0 41 0 0 0 0 0 1\n");
      Write(folder + "run.yaml", "role: evaluation\n");
      Write(folder + "detections.csv", "timestamp,tag_id,u0,v0,u1,v1,u2,v2,u3,v3\n1.0,77,10,20,20,20,20,10,10,10\n");
      Write(folder + "camchain.yaml",
            "cam0:\n  camera_model: pinhole\n  intrinsics: [100, 100, 49.5, 49.5]\n  distortion_model: radtan\n"
            "  distortion_coeffs: [0, 0, 0, 0]\n  resolution: [100, 100]\n"
            "  T_cam_imu:\n  - [0, -1, 0, 0]\n  - [0, 0, -1, 0]\n  - [1, 0, 0, 0]\n  - [0, 0, 0, 1]\n");
      Localize(run, 0.1, run == std::string("run1") ? 1 : 2);
    }
  }

  // A result whose errors per axis have this sigma.
  void Localize(const std::string& result, double sigma, uint64_t seed, const std::string& mode = "trigpoint",
                const std::string& earth_source = "geotags") const {
    Random random(seed);
    const std::string run = result.substr(0, result.find('@')), folder = "results/localize/" + result + "/";
    std::string rows =
        "# trigpoint panoramas 1; frame=enu; datum=geotags; sigma=1\n"
        "panorama,station,status,reason,x,y,z,qx,qy,qz,qw,sigma_x_m,sigma_y_m,sigma_z_m,odom_x,odom_y,odom_z,odom_qx,"
        "odom_qy,odom_qz,odom_qw,inliers,views\n";
    for (int i = 0; i < 9; ++i) {
      char line[300];
      const double e = sigma * random.Normal(), n = sigma * random.Normal(), u = sigma * random.Normal();
      snprintf(line, sizeof line,
               "pano%d,S%d,localized,,%.6f,%.6f,%.6f,0,0,0,1,%g,%g,%g,%.6f,%.6f,%.6f,0,0,0,1,100,8\n", i, i, 5 * i + e,
               n, 2 + u, sigma, sigma, sigma, 5 * i + e, n, 2 + u);
      rows += line;
    }
    Write(folder + "panoramas.csv", rows);
    std::vector<TimedPose> cameras;
    for (int i = 0; i <= 40; ++i)
      cameras.push_back({int64_t{i} * 1'000'000'000, Rigid3d({1, 0, 0, 0}, {1.0 * i, 3, 1})});
    WriteTum(dir_ / folder / "cameras.tum", cameras, {});
    WriteTum(dir_ / folder / "cameras_odom.tum", cameras, {});
    const json manifest = {{"schema", 1},
                           {"stage", "localize"},
                           {"name", result},
                           {"version", 1},
                           {"options", {{"mode", mode}}},
                           {"metrics", {{"earth_source", earth_source}}},
                           {"files", {{"panoramas.csv", std::to_string(std::hash<std::string>{}(rows))}}},
                           {"status", "done"}};
    Write(folder + "manifest.json", manifest.dump());
  }
  // The survey's map as INTERFACE has it: the control points' places, moved by `shift` for one tag.
  void Map(const std::string& folder, double shift) const {
    std::string tags =
        "# trigpoint tags 1; frame=enu; datum=control; sigma=1\n"
        "tag_id,family,size_m,x,y,z,qx,qy,qz,qw,sigma_x_m,sigma_y_m,sigma_z_m,sigma_rx_deg,sigma_ry_deg,sigma_rz_deg,"
        "images,runs,rms_px,role,status\n";
    for (int i = 0; i < 9; ++i) {
      tags += std::to_string(i) + ",tag36h11,0.5," + std::to_string(5 * i + (i == 4 ? shift : 0)) +
              ",0,1,0,0,0,1,0.004,0.004,0.006,0.1,0.1,0.1,20,1,0.2," + (i % 3 == 0 ? "control" : "free") + ",ok\n";
    }
    Write(folder + "/tags.csv", tags);
    const json manifest = {{"schema", 1},
                           {"stage", "survey"},
                           {"name", ""},
                           {"version", 1},
                           {"values", {{"runs", {"old"}}}},
                           {"files", {{"tags.csv", std::to_string(std::hash<std::string>{}(tags))}}},
                           {"status", "done"}};
    Write(folder + "/manifest.json", manifest.dump());
  }
  // Makes a result written by hand one of its stage's: its manifest then says what it was made of.
  void Adopt(const std::string& stage, const std::string& run) const {
    const Project project = Project::Open(dir_);
    const StageInfo& info = StageNamed(stage);
    const StageTarget target{run, ""};
    const fs::path result = project.ResultDir(stage, ResultName(info, target)), kept = dir_ / "kept";
    fs::rename(result, kept);
    StageRequest request = MakeRequest(project, info, target);
    request.body = [&](StageContext& context) {
      for (const auto& entry : fs::recursive_directory_iterator(kept)) {
        const std::string name = entry.path().filename().string();
        if (entry.is_regular_file() && name != "manifest.json" && name != "log.txt")
          fs::copy_file(entry.path(), context.out / name);
      }
    };
    ProgressSink quiet;
    RunStage(project, request, 1, 1, quiet, CancelToken());
    fs::remove_all(kept);
  }
  void Write(const std::string& file, const std::string& text) const { WriteFileAtomically(dir_ / file, text); }
  std::string Read(const std::string& file) const { return ReadTextFile(dir_ / file); }
  json Summary(const std::string& folder = "results/evaluate") const {
    return json::parse(Read(folder + "/summary.json"));
  }
  json Gates() const { return json::parse(Read("results/gates/gates.json")); }
  std::string dir() const { return dir_.string(); }

 private:
  TempDir dir_;
};

json GroupOf(const json& summary, const std::string& method, const std::string& variant = "") {
  for (const json& g : summary["groups"]) {
    if (g["method"] == method && g["variant"] == variant && g["reference"] == "control") return g;
  }
  return {};
}

TEST(EvaluateCommand, GatesAnswerByTheBoundAndExitThree) {
  const Site site;
  const Finished pass = Trigpoint({"evaluate", site.dir(), "--max-median", "1"});
  EXPECT_EQ(pass.exit_code, 0) << pass.err;
  EXPECT_THAT(pass.out, HasSubstr("evaluate.max_median_m <= 1 m"));
  const Finished fail = Trigpoint({"evaluate", site.dir(), "--max-median", "0.02", "--json"});
  EXPECT_EQ(fail.exit_code, 3);
  EXPECT_EQ(fail.Json()["exit_code"], 3);
  EXPECT_EQ(site.Gates()["verdict"], "failed");
  const double median = GroupOf(site.Summary(), "single")["error_3d"]["over_answers"]["median_m"];
  const Finished open = Trigpoint({"evaluate", site.dir(), "--max-median", std::to_string(1.05 * median)});
  EXPECT_EQ(open.exit_code, 3);
  EXPECT_THAT(open.out, HasSubstr("undecided"));
  EXPECT_THAT(site.Gates()["gates"][0]["message"].get<std::string>(), HasSubstr("would decide"));

  // The project's own gates, with and without the unit in the name; the command line goes before them.
  site.Write("trigpoint.yaml", "schema: 1\ngates: {max_median: 0.02}\n");
  EXPECT_EQ(Trigpoint({"evaluate", site.dir()}).exit_code, 3);
  EXPECT_EQ(Trigpoint({"evaluate", site.dir(), "--max-median", "1"}).exit_code, 0);
  site.Write("trigpoint.yaml", "schema: 1\ngates: {max_p90_m: 1, min_answered: 0.5}\n");
  EXPECT_EQ(Trigpoint({"evaluate", site.dir()}).exit_code, 0);
  EXPECT_EQ(site.Gates()["gates"].size(), 2u);
  site.Write("trigpoint.yaml", "schema: 1\ngates: {max_medain: 1}\n");
  const Finished typo = Trigpoint({"evaluate", site.dir()});
  EXPECT_NE(typo.exit_code, 0);
  EXPECT_THAT(typo.err, HasSubstr("max_median"));
}

// Offsets that the survey measured, in place of the stated ones.
TEST(EvaluateCommand, UsesMeasuredOffsetsWhenAsked) {
  const Site site;
  EXPECT_EQ(Trigpoint({"evaluate", site.dir(), "--offsets", "guessed"}).exit_code, 2);
  const Finished missing = Trigpoint({"evaluate", site.dir(), "--offsets", "estimated"});
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_THAT(missing.err, HasSubstr("stations.csv"));
  // One station, a metre further east than stated.
  site.Write("results/survey/stations.csv",
             "station,panorama,tag_id,status,reason,stated_east_m,stated_north_m,stated_up_m,estimated_east_m,"
             "estimated_north_m,estimated_up_m,sigma_east_m,sigma_north_m,sigma_up_m\n"
             "S3,pano3,3,contradicts,,0,0,1,1,0,1,0.01,0.01,0.02\nS4,pano4,4,unseen,,0,0,1,,,,,,\n");
  ASSERT_EQ(Trigpoint({"evaluate", site.dir()}).exit_code, 0);
  const auto value = [&](const std::string& station, const char* column) {
    const CsvTable errors = CsvTable::Read(fs::path(site.dir()) / "results/evaluate/errors.csv", {});
    for (const CsvRow& row : errors.rows()) {
      if (row.Text("station") == station && row.Text("reference") == "control" && row.Text("run") == "run1")
        return row.Text(column);
    }
    return std::string("no such row");
  };
  const auto shared = [&](const std::string& station) { return value(station, "shares_evidence"); };
  const auto east = [&](const std::string& station) { return ParseDouble(value(station, "de_m")).value(); };
  const double stated = east("S3"), other = east("S4");
  EXPECT_EQ(shared("S3"), "no");
  const Finished estimated = Trigpoint({"evaluate", site.dir(), "--offsets", "estimated"});
  ASSERT_EQ(estimated.exit_code, 0) << estimated.err;
  EXPECT_THAT(site.Read("results/evaluate/tables.md"), HasSubstr("Offsets of 1 of 9 stations are estimated"));
  EXPECT_NEAR(east("S3"), stated - 1, 1e-6);
  EXPECT_NEAR(east("S4"), other, 1e-6);
  // What its own panorama measured is no independent ground truth.
  EXPECT_EQ(shared("S3"), "yes");
  EXPECT_EQ(shared("S4"), "no");
}

// A gate on what was not evaluated is undecided, and a gate that nobody set changes nothing.
TEST(EvaluateCommand, GatesOfWhatWasNotEvaluatedAreUndecided) {
  const Site site;
  fs::remove(fs::path(site.dir()) / "stations.csv");
  EXPECT_EQ(Trigpoint({"evaluate", site.dir()}).exit_code, 0);
  EXPECT_FALSE(fs::exists(fs::path(site.dir()) / "results/gates"));
  const Finished evaluated = Trigpoint({"evaluate", site.dir(), "--max-median", "0.2"});
  EXPECT_EQ(evaluated.exit_code, 3) << evaluated.err;
  EXPECT_THAT(evaluated.out, HasSubstr("undecided: evaluate.max_median_m <= 0.2 m"));
  EXPECT_THAT(site.Gates()["gates"][0]["message"].get<std::string>(), HasSubstr("evaluate was not run"));
  // Gates of other stages, in one table; JUnit takes what is undecided for an error.
  site.Write("trigpoint.yaml",
             "schema: 1\ngates: {survey: {max-check-rmse-3d: 0.02, min_check_points: 3}, localize: {min_answered: 0.5, "
             "max_sigma: 0.2}, stitch: {max_rms_px: 2}, calibration: {max_rms: 0.5}, estimates: {max_ate_m: 1}}\n");
  const Finished all = Trigpoint({"gates", site.dir(), "--json"});
  EXPECT_EQ(all.exit_code, 3) << all.err;
  std::map<std::string, std::string> verdicts;
  const json table = site.Gates();
  for (const json& gate : table["gates"]) verdicts[gate["gate"]] = gate["verdict"];
  EXPECT_EQ(verdicts.size(), 7u) << site.Gates().dump(2);
  EXPECT_EQ(verdicts["localize.min_answered"], "passed");
  EXPECT_EQ(verdicts["localize.max_sigma_m"], "passed");
  EXPECT_EQ(verdicts["survey.max_check_rmse_3d_m"], "undecided");
  EXPECT_EQ(verdicts["stitch.max_rms_px"], "undecided");
  EXPECT_EQ(verdicts["calibration.max_rms_px"], "undecided");
  EXPECT_EQ(verdicts["estimates.max_ate_m"], "undecided");
  const std::string xml = site.Read("results/gates/gates.xml");
  EXPECT_THAT(xml, HasSubstr("tests=\"9\" failures=\"0\" errors=\"5\""));
  EXPECT_THAT(xml, HasSubstr("<error type=\"undecided\""));
  // A gate of another section, or with a slip: the nearest one is named.
  site.Write("trigpoint.yaml", "schema: 1\ngates: {max_tag_sigma: 0.01}\n");
  const Finished misplaced = Trigpoint({"evaluate", site.dir()});
  EXPECT_EQ(misplaced.exit_code, 2);
  EXPECT_THAT(misplaced.err, HasSubstr("'survey.max_tag_sigma_m'"));
  site.Write("trigpoint.yaml", "schema: 1\ngates: {survey: {max_check_rsme_h: 0.01}}\n");
  EXPECT_THAT(Trigpoint({"evaluate", site.dir()}).err, HasSubstr("'survey.max_check_rmse_h_m'"));
}

TEST(EvaluateCommand, ShowsVariantsSideBySideInTheUnitAskedFor) {
  const Site site;
  site.Localize("run1@paper", 0.5, 3, "paper");
  site.Localize("run2@paper", 0.5, 4, "paper");
  const Finished metres = Trigpoint({"evaluate", site.dir(), "--paper-tables", "--verbose"});
  ASSERT_EQ(metres.exit_code, 0) << metres.err;
  EXPECT_THAT(metres.out, HasSubstr("variant paper [m]"));
  EXPECT_THAT(metres.out, HasSubstr("paper is better than default in"));
  EXPECT_THAT(metres.out, HasSubstr("Agarwal, Burgard, Spinello (2015), table I"));
  const json summary = site.Summary();
  EXPECT_EQ(GroupOf(summary, "g2", "paper")["attempts"], 18);
  EXPECT_LT(GroupOf(summary, "single")["error_3d"]["over_answers"]["median_m"],
            GroupOf(summary, "g2", "paper")["error_3d"]["over_answers"]["median_m"]);
  EXPECT_EQ(summary["comparisons"][0]["pairs"], 18);
  // The same result, shown in feet.
  const Finished feet = Trigpoint({"evaluate", site.dir(), "--paper-tables", "--units", "ft", "--verbose"});
  EXPECT_THAT(feet.err, HasSubstr("up to date"));
  EXPECT_THAT(feet.out, HasSubstr("variant paper [ft]"));
  EXPECT_THAT(feet.out, Not(HasSubstr("[m]")));
}

TEST(EvaluateCommand, RotationsAreHeldAgainstTheTagsThatAPanoramaShows) {
  const Site site;
  site.Map("results/survey", 0);
  // One degree about the vertical; the site's answers have no rotation.
  site.Write("results/survey/stations.csv",
             "# trigpoint stations 1; frame=enu\npanorama,status,qx,qy,qz,qw,sigma_rot_deg\n"
             "pano2,agrees,0,0,0.008726535,0.999961923,0.3\npano3,unseen,,,,,\n");
  const Project project = Project::Open(site.dir());
  EvaluatedRun run;
  run.run = "run1";
  run.sigma_rot_rad["pano2"] = 0.4 * EIGEN_PI / 180;
  for (const char* name : {"pano2", "pano3"}) {
    PanoramaResult answer;
    answer.panorama = name;
    answer.world_from_pano = Rigid3d();
    run.result.panoramas.push_back(answer);
  }
  Evaluation evaluation;
  for (const char* name : {"pano2", "pano3"}) {
    ErrorRow row{.run = "run1", .method = "single", .panorama = name, .reference = "survey", .kind = "absolute"};
    row.error_3d_m = 0.1;
    evaluation.rows.push_back(row);
  }
  FillRotationErrors(project, {run}, &evaluation);
  ASSERT_TRUE(evaluation.rows[0].error_rot_deg && evaluation.rows[0].sigma_rot_deg);
  EXPECT_NEAR(*evaluation.rows[0].error_rot_deg, 1, 1e-4);
  EXPECT_NEAR(*evaluation.rows[0].sigma_rot_deg, 0.5, 1e-9);
  EXPECT_FALSE(evaluation.rows[1].error_rot_deg);
}

TEST(EvaluateCommand, SaysWhatEachNumberRestsOnAndWhetherItIsConsistent) {
  const Site site;
  ASSERT_EQ(Trigpoint({"evaluate", site.dir()}).exit_code, 0);
  const json group = GroupOf(site.Summary(), "single");
  EXPECT_FALSE(group["shares_evidence"]);
  EXPECT_THAT(group["reference_rests_on"].dump(), HasSubstr("control:0"));
  EXPECT_THAT(group["reference_rests_on"].dump(), HasSubstr("check:1"));
  EXPECT_THAT(group["estimate_rests_on"].dump(), HasSubstr("geotag:pano3"));
  EXPECT_EQ(group["nees"]["count"], 18);
  EXPECT_TRUE(group["nees"]["horizontal"]["inside"]) << group["nees"].dump();
  EXPECT_TRUE(group["nees"]["vertical"]["inside"]) << group["nees"].dump();
  EXPECT_EQ(group["nees"]["by_station"].size(), 9u);
  EXPECT_EQ(group["dominant"], "localization");
  EXPECT_NEAR(group["error_budget_sigma_m"]["localization"], std::sqrt(3.0) * 0.1, 1e-9);
  EXPECT_NEAR(group["error_budget_sigma_m"]["tag map"], std::sqrt(3.0) * 0.005, 1e-9);
  EXPECT_TRUE(group["intervals"]["h"]["over_answers"]["median_m"].is_array());
}

TEST(EvaluateCommand, AFitToGeotagsAndGpsRestsOnBoth) {
  const Site site;
  site.Localize("run1", 0.1, 1, "trigpoint", "geotags and gps");
  ASSERT_EQ(Trigpoint({"evaluate", site.dir()}).exit_code, 0);
  const std::string rests_on = GroupOf(site.Summary(), "single")["estimate_rests_on"].dump();
  EXPECT_THAT(rests_on, HasSubstr("gps:run1"));
  EXPECT_THAT(rests_on, HasSubstr("geotag:pano3"));
  EXPECT_THAT(rests_on, Not(HasSubstr("gps:run2")));
}

TEST(EvaluateCommand, BadInputIsToldAndTheRestGoesOn) {
  const Site site;
  // A run whose result is of another kind, NaN sigmas, no answer at all.
  site.Write("results/localize/run2/panoramas.csv", "panorama,answer\nx,1\n");
  const Finished broken = Trigpoint({"evaluate", site.dir()});
  EXPECT_EQ(broken.exit_code, 0) << broken.err;
  EXPECT_THAT(broken.err, HasSubstr("run run2 takes no part: "));
  EXPECT_EQ(GroupOf(site.Summary(), "single")["attempts"], 9);
  site.Write("results/localize/run2/panoramas.csv",
             "panorama,station,status,x,y,z,qx,qy,qz,qw,sigma_x_m,sigma_y_m,sigma_z_m,odom_x,odom_y,odom_z\n"
             "pano1,S1,localized,5,0,2,0,0,0,1,nan,nan,nan,,,\npano2,S2,rejected,,,,,,,,,,,,,\n");
  site.Write("results/localize/run2/manifest.json",
             R"({"schema":1,"stage":"localize","name":"run2","version":1,"files":{"x":"1"},"status":"done"})");
  const Finished nan = Trigpoint({"evaluate", site.dir(), "--min-answered", "0.1"});
  EXPECT_EQ(nan.exit_code, 0) << nan.err;
  EXPECT_EQ(GroupOf(site.Summary(), "single")["attempts"], 18);
  EXPECT_THAT(nan.err, HasSubstr("1 of 1 answers have no finite sigma_x_m"));
  // An older result whose repetition failed does not pass for the new one.
  site.Write("results/localize/.failed-run1/manifest.json", R"({"schema":1,"status":"failed"})");
  const Finished older = Trigpoint({"evaluate", site.dir()});
  EXPECT_THAT(older.err, HasSubstr("run run1 are of an older result"));
  EXPECT_THAT(older.out, HasSubstr("run run1 are of an older result"));
  fs::remove_all(site.dir() + "/results/localize/.failed-run1");
  const Finished unknown = Trigpoint({"evaluate", site.dir(), "--reference", "contrl"});
  EXPECT_EQ(unknown.exit_code, 1);
  EXPECT_THAT(unknown.err, HasSubstr("nearest: 'control'"));
  // An estimate without reference poses.
  site.Write("estimates/slam/run1.tum", "0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n");
  site.Write("estimates/slam/run9.tum", "0 0 0 0 0 0 0 1\n");
  const Finished estimate = Trigpoint({"evaluate", site.dir()});
  EXPECT_EQ(estimate.exit_code, 0) << estimate.err;
  EXPECT_THAT(estimate.err, HasSubstr("there are no reference poses of run1"));
  EXPECT_THAT(estimate.err, HasSubstr("there is no run 'run9'"));
}

TEST(EvaluateCommand, OneStationDecidesNothing) {
  const Site site;
  site.Write("stations.csv", "station,tag_id,east_m,north_m,up_m,sigma_m\nS3,3,0,0,1,0.01\n");
  const Finished one = Trigpoint({"evaluate", site.dir(), "--max-median", "0.2"});
  EXPECT_EQ(one.exit_code, 3) << one.err;
  EXPECT_THAT(one.out, HasSubstr("undecided"));
  EXPECT_EQ(GroupOf(site.Summary(), "single")["answers"], 2);
}

TEST(PublishCommand, FreezesAMapThatLaterRunsAreHeldAgainst) {
  const Site site;
  site.Write("runs/old/odometry.tum", site.Read("runs/run1/odometry.tum"));
  site.Write("runs/old/camchain.yaml", site.Read("runs/run1/camchain.yaml"));
  site.Write("runs/old/detections.csv", site.Read("runs/run1/detections.csv"));
  site.Write("runs/old/run.yaml", "role: survey\n");
  site.Map("results/survey", 0);
  site.Write("results/survey/report_m.md", "# Survey\n");
  for (const char* stage : {"detect", "references"}) ASSERT_EQ(Trigpoint({stage, site.dir()}).exit_code, 0);
  // Results that nothing vouches for are not published.
  const Finished unknown = Trigpoint({"publish", site.dir(), "--name", "may"});
  EXPECT_EQ(unknown.exit_code, 1);
  EXPECT_THAT(unknown.err, HasSubstr("localize/run1: out of date"));
  EXPECT_THAT(unknown.err, HasSubstr("survey: out of date"));
  const auto adopt = [&] {
    for (const char* run : {"run1", "run2"}) site.Adopt("localize", run);
    site.Adopt("survey", "");
  };
  adopt();
  const Finished first = Trigpoint({"evaluate", site.dir()});
  ASSERT_EQ(first.exit_code, 0) << first.err;
  const Finished may = Trigpoint({"publish", site.dir(), "--name", "may", "--json"});
  ASSERT_EQ(may.exit_code, 0) << may.err;
  EXPECT_EQ(may.Json()["tags"], 9);
  const Finished again = Trigpoint({"publish", site.dir(), "--name", "may"});
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.err, HasSubstr("never overwritten"));

  // The survey changes; the release does not.
  site.Map("results/survey", 0.1);
  site.Adopt("survey", "");
  const Finished stale = Trigpoint({"publish", site.dir(), "--name", "june"});
  EXPECT_EQ(stale.exit_code, 1);
  EXPECT_THAT(stale.err, HasSubstr("evaluate: out of date"));
  ASSERT_EQ(Trigpoint({"evaluate", site.dir()}).exit_code, 0);
  const Finished june = Trigpoint({"publish", site.dir(), "--name", "june"});
  ASSERT_EQ(june.exit_code, 0) << june.err;
  const Finished held = Trigpoint({"evaluate", site.dir(), "--reference", "may", "--verbose"});
  ASSERT_EQ(held.exit_code, 0) << held.err;
  EXPECT_EQ(site.Summary()["groups"][0]["reference"], "may");
  EXPECT_FALSE(site.Summary()["groups"][0]["shares_evidence"]);
  EXPECT_THAT(site.Summary()["groups"][0]["reference_rests_on"].dump(), HasSubstr("tags:old"));
  EXPECT_THAT(held.out, HasSubstr("Accuracy (no evidence shared)"));

  const Finished compared = Trigpoint({"compare", site.dir() + "/releases/may", site.dir() + "/releases/june"});
  ASSERT_EQ(compared.exit_code, 0) << compared.err;
  EXPECT_THAT(compared.out, HasSubstr("moved or turned: 1 of 9: 4\n"));
  const json parsed =
      Trigpoint({"compare", site.dir() + "/releases/may", site.dir() + "/releases/june", "--json"}).Json();
  EXPECT_EQ(parsed["comparisons"][0]["map"]["moved"], json::array({4}));

  // What was published must be what is there.
  fs::permissions(site.dir() + "/releases/may/map/tags.csv", fs::perms::owner_write, fs::perm_options::add);
  site.Map("releases/may/map", 0.3);
  const Finished forged = Trigpoint({"evaluate", site.dir(), "--reference", "may"});
  EXPECT_EQ(forged.exit_code, 1);
  EXPECT_THAT(forged.err, HasSubstr("was changed after it was published"));
}

TEST(CompareCommand, PairsVariantsAndSaysWhatChanged) {
  const Site site;
  site.Localize("run1@paper", 0.5, 3, "paper");
  site.Localize("run2@paper", 0.5, 4, "paper");
  ASSERT_EQ(Trigpoint({"evaluate", site.dir()}).exit_code, 0);
  const Finished compared = Trigpoint({"compare", site.dir(), site.dir() + "@paper"});
  ASSERT_EQ(compared.exit_code, 0) << compared.err;
  EXPECT_THAT(compared.out, HasSubstr("localize/run1: option mode \"trigpoint\" -> \"paper\""));
  EXPECT_THAT(compared.out, HasSubstr("of 18 pairs"));
  // One that was never made is an error, not a table of zeros.
  const Finished never = Trigpoint({"compare", site.dir(), site.dir() + "@trial"});
  EXPECT_EQ(never.exit_code, 1);
  EXPECT_THAT(never.err, HasSubstr("variant 'trial' has no results; expected one of paper"));
  const Finished alone = Trigpoint({"compare", site.dir()});
  EXPECT_EQ(alone.exit_code, 2);
  EXPECT_EQ(Trigpoint({"compare", site.dir(), "/nowhere"}).exit_code, 1);
}

// Many sites at once: one is broken, one is ended by a signal on the way.
TEST(BatchCommand, KeepsFailuresApartAndGoesOn) {
  std::vector<std::unique_ptr<Site>> sites;
  std::string list = "# sites\n";
  for (int i = 0; i < 4; ++i) {
    sites.push_back(std::make_unique<Site>());
    list += sites.back()->dir() + "\n";
  }
  sites[1]->Write("trigpoint.yaml", "schema: 1\nruns: [run7]\n");
  sites[2]->Write("trigpoint.yaml", "schema: 1\ngates: {max_median: 0.001}\n");
  sites[0]->Write("list.txt", list);
  const std::string file = sites[0]->dir() + "/list.txt", out = sites[0]->dir() + "/out";
  const Finished batch = Trigpoint({"batch", file, "--jobs", "2", "--out", out, "--json"});
  EXPECT_EQ(batch.exit_code, 1) << batch.err;
  const json summary = json::parse(ReadTextFile(out + "/summary.json"));
  EXPECT_EQ(summary["done"], 3);
  EXPECT_EQ(summary["gate"], 1);
  EXPECT_EQ(summary["failed"], 1);
  EXPECT_EQ(summary["entries"][1]["status"], "failed");
  EXPECT_THAT(summary["entries"][1]["error"].get<std::string>(), HasSubstr("run7"));
  EXPECT_EQ(summary["entries"][2]["exit_code"], 3);
  EXPECT_THAT(ReadTextFile(out + "/summary.md"), HasSubstr("3 of 4 done"));
  EXPECT_TRUE(fs::exists(out + "/summary.csv"));
  EXPECT_THAT(ReadTextFile(out + "/index.html"), HasSubstr("4 projects"));

  // The same again: nothing is computed twice.
  sites[1]->Write("trigpoint.yaml", "schema: 1\n");
  const Finished resumed = Trigpoint({"batch", file, "--jobs", "2", "--out", out, "--json"});
  EXPECT_EQ(resumed.exit_code, 3) << resumed.err;
  for (const json& stage : resumed.Json()["entries"][0]["stages"])
    EXPECT_NE(stage["status"], "computed") << stage.dump();

  const auto one_line = [](const Finished& f, int exit_code, const std::string& part) {
    EXPECT_EQ(f.exit_code, exit_code);
    EXPECT_EQ(std::count(f.err.begin(), f.err.end(), '\n'), 1) << f.err;
    EXPECT_THAT(f.err, HasSubstr(part));
  };
  one_line(Trigpoint({"batch", "/nowhere"}), 1, "/nowhere");
  one_line(Trigpoint({"batch", file, "--memory", "much"}), 2, "4G");
  one_line(Trigpoint({"batch", sites[0]->dir() + "/none*"}), 1, "no folder matches");
}

// Who runs, submits or cancels the tasks of a batch keeps others out; tasks and `status` need no lock.
TEST(BatchCommand, OneAtATimeHasTheFolder) {
  const Site site;
  site.Write("list.txt", site.dir() + "\n");
  const std::string file = site.dir() + "/list.txt", out = site.dir() + "/out";
  const Finished first = Trigpoint({"batch", file, "--out", out});
  ASSERT_EQ(first.exit_code, 0) << first.err;
  auto lock = std::make_unique<BatchLock>(out);
  const auto refused = [&](const std::vector<std::string>& words) {
    const Finished f = Trigpoint(words);
    EXPECT_EQ(f.exit_code, 1);
    EXPECT_EQ(std::count(f.err.begin(), f.err.end(), '\n'), 1) << f.err;
    EXPECT_THAT(f.err, HasSubstr("batch " + out + " is in use by process " + std::to_string(getpid())));
  };
  const std::string plan = site.Read("out/batch.json");
  refused({"batch", file, "--out", out});
  refused({"batch", "resume", out});
  EXPECT_EQ(site.Read("out/batch.json"), plan);
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"batch", "status", out}, std::vector<std::string>{"batch", "task", out, "0"}}) {
    const Finished f = Trigpoint(words);
    EXPECT_EQ(f.exit_code, 0) << f.err;
  }
  // A batch on this machine is asked to stop.
  std::thread runs([&] {
    for (int i = 0; i < 600 && !fs::exists(out + "/cancel"); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    lock.reset();
  });
  const Finished cancelled = Trigpoint({"batch", "cancel", out});
  runs.join();
  EXPECT_EQ(cancelled.exit_code, 0) << cancelled.err;
  EXPECT_FALSE(fs::exists(out + "/cancel"));
  // One that is being submitted is left alone.
  json submitted = json::parse(plan);
  submitted["settings"]["engine"] = "slurm";
  site.Write("out/batch.json", submitted.dump());
  lock = std::make_unique<BatchLock>(out);
  refused({"batch", "cancel", out});
  EXPECT_FALSE(fs::exists(out + "/cancel"));
}

// Its folder is a batch's, although no task ever ran there.
TEST(BatchCommand, ASubmissionThatFailedCanBeTriedAgain) {
  const Site site;
  site.Write("list.txt", site.dir() + "\n");
  const std::string file = site.dir() + "/list.txt", out = site.dir() + "/out", path = std::getenv("PATH");
  ASSERT_EQ(setenv("PATH", site.dir().c_str(), 1), 0);  // no Slurm there
  const Finished failed = Trigpoint({"batch", file, "--out", out, "--engine", "slurm"});
  ASSERT_EQ(setenv("PATH", path.c_str(), 1), 0);
  EXPECT_EQ(failed.exit_code, 1);
  EXPECT_THAT(failed.err, HasSubstr("not found in PATH"));
  const Finished again = Trigpoint({"batch", file, "--out", out});
  EXPECT_EQ(again.exit_code, 0) << again.err;
}

// What the first command was given stays, unless `resume` is given another value.
TEST(BatchCommand, ResumeKeepsTheSettings) {
  const Site site;
  site.Write("list.txt", site.dir() + "\n");
  const std::string file = site.dir() + "/list.txt", out = site.dir() + "/out";
  const auto settings = [&](const std::vector<std::string>& words) {
    const Finished f = Trigpoint(words);
    EXPECT_EQ(f.exit_code, 0) << f.err;
    return json::parse(site.Read("out/batch.json"))["settings"];
  };
  json expected = {{"engine", "local"},   {"threads", 1},
                   {"jobs", 2},           {"memory", "6G"},
                   {"task_memory", "3G"}, {"task_minutes", 20.5},
                   {"partition", "main"}, {"account", "survey"},
                   {"container", ""},     {"sbatch", json::array({"--qos=low", "--hold"})}};
  EXPECT_EQ(settings({"batch",
                      file,
                      "--out",
                      out,
                      "--threads",
                      "1",
                      "--jobs",
                      "2",
                      "--memory",
                      "6G",
                      "--task-memory",
                      "3G",
                      "--task-minutes",
                      "20.5",
                      "--partition",
                      "main",
                      "--account",
                      "survey",
                      "--sbatch=--qos=low",
                      "--sbatch=--hold"}),
            expected);
  EXPECT_EQ(settings({"batch", "resume", out}), expected);
  expected["jobs"] = 3;
  expected["sbatch"] = json::array({"--qos=high"});
  EXPECT_EQ(settings({"batch", "resume", out, "--jobs", "3", "--sbatch=--qos=high"}), expected);
}

TEST(BatchCommand, StopsWhatNeedsTooMuchMemory) {
  const Site site;
  site.Write("list.txt", site.dir() + "\n");
  const Finished batch = Trigpoint({"batch", site.dir() + "/list.txt", "--memory", "1M", "--out", site.dir() + "/out"});
  EXPECT_EQ(batch.exit_code, 1);
  EXPECT_THAT(batch.out, HasSubstr("needs more than the memory limit"));
}

}  // namespace
}  // namespace trigpoint

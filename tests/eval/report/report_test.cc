#include "eval/report/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "eval/scene/scene_model.h"
#include "tests/support/project_folder.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kErrorHeader =
    "run,variant,method,station,panorama,tag_id,reference,kind,status,reason,error_3d_m,error_h_m,error_v_m,de_m,dn_m,"
    "du_m,"
    "error_rot_deg,sigma_e_m,sigma_n_m,sigma_u_m,nees,dof\n";
constexpr const char* kPanoramaHeader =
    "panorama,station,status,reason,x,y,z,qx,qy,qz,qw,sigma_x_m,sigma_y_m,sigma_z_m,view_matches,inliers,views,odom_x,"
    "odom_y,"
    "odom_z,odom_qx,odom_qy,odom_qz,odom_qw,latitude_deg,longitude_deg,height_m,heading_deg,pitch_deg,roll_deg,geotag_"
    "de_m,"
    "geotag_dn_m,geotag_du_m,geotag_status\n";

nlohmann::json Group(const char* kind, int answers) {
  nlohmann::json g = {{"variant", ""},
                      {"method", "single"},
                      {"reference", kind == std::string("absolute") ? "control" : "self"},
                      {"kind", kind},
                      {"shares_evidence", kind == std::string("relative")},
                      {"attempts", 2},
                      {"answers", answers},
                      {"median_interval_m", nullptr},
                      {"p90_interval_m", nullptr},
                      {"estimate_rests_on", {"geotag:a"}},
                      {"reference_rests_on", {"control:1"}},
                      {"cumulative", nlohmann::json::array()},
                      {"nees", {{"count", 0}, {"mean_per_dof", nullptr}, {"bounds", nullptr}}}};
  if (answers > 0) {
    g["error_3d"] = {{"over_answers", {{"median_m", 0.1234}, {"p90_m", 0.3}, {"mean_m", 0.2}, {"max_m", 0.4}}},
                     {"over_attempts", {{"median_m", 0.4}, {"p90_m", nullptr}}}};
    g["cumulative"].push_back({{"error_m", 0.1234}, {"share", 0.5}, {"low", 0.1}, {"high", 0.9}});
  }
  return g;
}

// A project whose results were written by hand; every test breaks something in it.
class ReportTest : public ::testing::Test {
 protected:
  void WriteResults() {
    site_.Write("stations.csv", "station,tag_id,east_m,north_m,up_m,sigma_m\nS1,1,0,0,1,0.01\nS2,2,0,0,1,0.01\n");
    site_.Write(
        "results/localize/run1/panoramas.csv",
        std::string("# trigpoint panoramas 1; frame=enu\n") + kPanoramaHeader +
            "p1.jpg,S1,localized,,1,2,3,0,0,0,1,0.1,0.1,0.2,300,200,3,1,2,3,0,0,0,1,48,7.8,240,0,0,0,0.5,0.1,0,ok\n"
            "p2.jpg,S2,rejected,\"too <few> matches\",,,,,,,,,,,12,3,0,,,,,,,,,,,,,,,,,unused\n");
    std::string odom = "# trigpoint trajectory 1; frame=odom\n";
    for (int i = 0; i < 5; ++i) odom += std::to_string(i + 1) + ".0 " + std::to_string(i) + " 0 1 0 0 0 1\n";
    site_.Write("results/localize/run1/cameras_odom.tum", odom);
    site_.Write("results/localize/run1/cameras.tum", odom);
    site_.Write(
        "results/evaluate/errors.csv",
        std::string("# trigpoint errors 1; unit=m\n") + kErrorHeader +
            "run1,,single,S1,p1.jpg,1,control,absolute,localized,,0.1234,0.1,0.07,0.1,0.02,0.07,,0.05,0.05,0.05,6.5,3\n"
            "run1,,single,S2,p2.jpg,2,control,absolute,rejected,too <few> matches,,,,,,,,,,,,\n");
    site_.Write(
        "results/evaluate/summary.json",
        nlohmann::json({{"schema", "trigpoint evaluate 1"}, {"confidence", 0.95}, {"groups", {Group("absolute", 1)}}})
            .dump());
  }
  // The report of what is there; its index.html.
  std::string Report(ReportOptions options = {}) {
    const Project project = Project::Open(site_.dir());
    options.scene_px = 160;
    ReportInput input;
    input.project = &project;
    input.command = "trigpoint report site";
    for (const char* name : {"run1", "run2"}) {
      const bool there = fs::exists(project.ResultDir("localize", name));
      nlohmann::json manifest;
      if (there)
        manifest = {{"end", "2026-05-12T09:43:20Z"},
                    {"wall_seconds", 3.5},
                    {"version", 1},
                    {"seed", 1},
                    {"threads", 2},
                    {"options", {{"mode", "trigpoint"}}},
                    {"inputs", {{"runs/run1/odometry.tum", std::string(64, 'a')}}},
                    {"metrics", {{"images", 5}, {"on_earth", true}, {"earth_source", "geotags"}}}};
      input.stages.push_back({"localize", name, there ? "done" : "missing", "", manifest});
    }
    fs::remove_all(site_ / "out");
    fs::create_directories(site_ / "out");
    ProgressSink progress;
    summary_ = WriteReport(input, options, {"m", 1}, site_ / "out", progress, CancelToken());
    EXPECT_TRUE(fs::exists(site_ / "out/report.md"));
    EXPECT_TRUE(nlohmann::json::accept(site_.Read("out/report.json")));
    return site_.Read("out/index.html");
  }

  ProjectFolder site_;
  ReportSummary summary_;
};

TEST_F(ReportTest, ShowsNumbersReasonsAndProvenance) {
  WriteResults();
  const std::string html = Report();
  EXPECT_THAT(html, HasSubstr("0.12 m"));
  EXPECT_THAT(html, HasSubstr("0.123"));
  EXPECT_THAT(html, HasSubstr("too &lt;few&gt; matches"));
  EXPECT_THAT(html, HasSubstr("accuracy against a reference that the tested runs had no part in"));
  EXPECT_THAT(html, HasSubstr("trigpoint report site"));
  EXPECT_THAT(html, HasSubstr(std::string(64, 'a')));
  EXPECT_THAT(html, HasSubstr("2026-05-12T09:43:20Z"));
  EXPECT_THAT(site_.Read("out/tables/stations.csv"), HasSubstr("S1,1,0,0.123,,2.2"));
  EXPECT_TRUE(fs::exists(site_ / "out/figures/cumulative_absolute.png"));
  EXPECT_FALSE(fs::exists(site_ / "out/report.pdf"));
}

// The first screen: what it is, how good, the plan, what to look at, before any chapter of details.
TEST_F(ReportTest, BeginsWithTheVerdict) {
  WriteResults();
  const std::string html = Report();
  const size_t verdict = html.find("id=\"summary\""), accuracy = html.find("id=\"accuracy\"");
  ASSERT_NE(verdict, std::string::npos);
  ASSERT_LT(verdict, accuracy);
  const std::string screen = html.substr(verdict, accuracy - verdict);
  for (const char* part :
       {"1 run (5 images) localized against", ">Located<", "<b>1 of 2</b>", "Absolute error, 3D", "0.12 m",
        "against surveyed control", "3D error of each run at each station", "aria-label=\"Plan, north up",
        "Look at these first", "<a href=\"#station-2\">Refused: run1 at S2, too &lt;few&gt; matches</a>"}) {
    EXPECT_THAT(screen, HasSubstr(part));
  }
  // Rendered scenes are thumbnails, behind the numbers.
  EXPECT_GT(html.find("id=\"map\""), html.find("id=\"runs\""));
  // Panoramas with their matches: a chapter in its place, not behind everything.
  EXPECT_GT(html.find("id=\"stations\""), html.find("id=\"map\""));
  EXPECT_GT(html.find("id=\"provenance\""), html.find("id=\"station-2\""));
  EXPECT_THAT(html, HasSubstr("<caption>"));
  EXPECT_THAT(html, HasSubstr("<th scope=col>"));
}

// Without tags: sigmas, agreement of runs, outlying geotags.
TEST_F(ReportTest, WithoutTagsItSaysWhatCanBeSaid) {
  WriteResults();
  fs::remove_all(site_ / "results/evaluate");
  const std::string text = site_.Read("results/localize/run1/panoramas.csv");
  std::string other = text;
  other.replace(other.find(",1,2,3,0,0,0,1,"), 6, ",1,2.5,3");
  other.replace(other.find(",0,ok\n"), 6, ",0,outlier\n");
  site_.Write("results/localize/run2/panoramas.csv", other);
  const std::string html = Report();
  EXPECT_THAT(html, HasSubstr("their accuracy is not measured here"));
  EXPECT_THAT(html, HasSubstr("<span>Stated uncertainty</span><b>0.20 m</b>"));
  EXPECT_THAT(html, HasSubstr("<span>Agreement of runs</span><b>0.50 m</b>"));
  EXPECT_THAT(html, HasSubstr("Outlying geotag: p1.jpg, 0.51 m horizontally"));
}

// An outlier by its own gate is warned of only if not even the farthest of all geotags lies so far off by chance.
TEST_F(ReportTest, AGeotagThatChanceExplainsIsNoWarning) {
  WriteResults();
  fs::remove_all(site_ / "results/evaluate");
  cv::imwrite((site_ / "p1.jpg").string(), cv::Mat(64, 128, CV_8UC3, {40, 120, 200}));
  const std::string head =
      "file,station,latitude_deg,longitude_deg,height_m,sigma_h_m,sigma_v_m\np1.jpg,S1,48,7.8,240,";
  std::string text = site_.Read("results/localize/run1/panoramas.csv");
  text.replace(text.find(",0,ok\n"), 6, ",0,outlier\n");
  site_.Write("results/localize/run1/panoramas.csv", text);
  site_.Write("panoramas.csv", head + "0.2,0.5\n");  // 0.51 m are 2.3 sigma
  EXPECT_THAT(Report(), Not(HasSubstr("Outlying geotag: ")));
  site_.Write("panoramas.csv", head + "0.02,0.5\n");  // 5.0 sigma
  EXPECT_THAT(Report(), HasSubstr("Outlying geotag: p1.jpg, 0.51 m horizontally"));
}

TEST_F(ReportTest, ShowsAStitchedPanorama) {
  fs::remove_all(site_ / "runs");
  site_.Write("results/stitch/corner/manifest.json",
              R"({"metrics": {"photos": 12, "placed": 11, "covered_share": 0.5, "panorama": "panorama.png"}})");
  cv::imwrite((site_ / "results/stitch/corner/panorama.png").string(), cv::Mat(100, 200, CV_8UC3, {40, 120, 200}));
  const std::string html = Report();
  EXPECT_THAT(html, HasSubstr("Panorama of the photo set corner"));
  EXPECT_THAT(html, HasSubstr("<td>11"));
  EXPECT_THAT(html, Not(HasSubstr("Next: trigpoint run")));
  // No chapters about runs, and no links to them.
  for (const char* chapter : {"accuracy", "consistency", "runs", "map", "stations"}) {
    EXPECT_THAT(html, Not(HasSubstr("id=\"" + std::string(chapter) + "\"")));
    EXPECT_THAT(html, Not(HasSubstr("href=\"#" + std::string(chapter) + "\"")));
  }
  EXPECT_TRUE(fs::exists(site_ / "out/figures/stitched_1.png"));
}

TEST_F(ReportTest, NamesThePanoramaWhereAStationHasSeveral) {
  WriteResults();
  const char* file = "results/localize/run1/panoramas.csv";
  site_.Write(file, site_.Read(file) + "set_1,S1,unmatched,nothing alike,,,,,,,,,,,0,0,0,,,,,,,,,,,,,,,,,unused\n");
  const std::string html = Report();
  EXPECT_THAT(html, HasSubstr("Not matched: run1 at S1 set_1, nothing alike"));
  EXPECT_THAT(html, HasSubstr("Largest error: run1 at S1 p1.jpg"));
  EXPECT_THAT(html, HasSubstr("Refused: run1 at S2, too"));
}

TEST_F(ReportTest, TheSameResultsGiveTheSameBytes) {
  WriteResults();
  ReportOptions options;
  options.pdf = true;
  const auto all = [&] {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(site_ / "out")) {
      if (entry.is_regular_file())
        files[entry.path().string()] = site_.Read(fs::relative(entry.path(), site_.dir()).string());
    }
    return files;
  };
  Report(options);
  const auto first = all();
  EXPECT_GT(first.size(), 8u);
  Report(options);
  EXPECT_EQ(first, all());
}

TEST_F(ReportTest, WithoutResultsItSaysSo) {
  const std::string html = Report();
  EXPECT_THAT(html, HasSubstr("No run of this project is localized yet"));
  EXPECT_THAT(html, HasSubstr("There is nothing to draw yet"));
}

TEST_F(ReportTest, AgreementIsNotCalledAccuracy) {
  WriteResults();
  site_.Write(
      "results/evaluate/summary.json",
      nlohmann::json({{"schema", "trigpoint evaluate 1"}, {"confidence", 0.95}, {"groups", {Group("relative", 1)}}})
          .dump());
  const std::string html = Report();
  EXPECT_THAT(html, HasSubstr("agreement, not accuracy"));
  EXPECT_THAT(html, Not(HasSubstr("accuracy against a reference that")));
}

TEST_F(ReportTest, WithoutEvaluationTheAnswersAreStillThere) {
  WriteResults();
  fs::remove_all(site_ / "results/evaluate");
  const std::string html = Report();
  EXPECT_THAT(html, HasSubstr("Nothing was evaluated"));
  EXPECT_THAT(html, HasSubstr("too &lt;few&gt; matches"));
}

TEST_F(ReportTest, ZeroAnswersAreNoGoodNews) {
  WriteResults();
  site_.Write("results/evaluate/summary.json",
              nlohmann::json({{"schema", "trigpoint evaluate 1"}, {"groups", {Group("absolute", 0)}}}).dump());
  site_.Write(
      "results/evaluate/errors.csv",
      std::string(kErrorHeader) + "run1,,single,S1,p1.jpg,1,control,absolute,unmatched,nothing alike,,,,,,,,,,,,\n");
  const std::string html = Report();
  EXPECT_THAT(html, HasSubstr("so their accuracy is not measured here"));
  EXPECT_THAT(html, HasSubstr("nothing alike"));
}

TEST_F(ReportTest, OlderAndBrokenResultsAreNamedAndTheRestIsShown) {
  WriteResults();
  // An older version: other schema, fewer columns; NaN and rubbish in cells; a binary file for a trajectory.
  site_.Write("results/evaluate/summary.json", R"({"schema": "trigpoint evaluate 0", "groups": [{"method": 3}, 7]})");
  site_.Write("results/evaluate/errors.csv",
              "run,station,status,error_3d_m,nees,dof\nrun1,S1,localized,0.5,nan,3\nrun1,S2,localized,rubbish,inf,x\n");
  site_.Write("results/localize/run1/cameras.tum", std::string("\x00\x01\xff", 3));
  site_.Write("results/localize/run1/sparse/points3D.bin", "short");
  site_.Write("results/localize/run1/sparse/images.bin", "short");
  site_.Write("results/localize/run1/sparse/cameras.bin", "short");
  site_.Write("review.jsonl",
              "{\"action\": \"exclude\", \"object\": \"tag:1\", \"reason\": \"<b>moved</b>\"}\nno json\n");
  const std::string html = Report();
  EXPECT_THAT(html, HasSubstr("of another version"));
  EXPECT_THAT(html, HasSubstr("0.500"));
  EXPECT_THAT(html, HasSubstr("&lt;b&gt;moved&lt;/b&gt;"));
  EXPECT_THAT(html, HasSubstr("review.jsonl:2"));
  EXPECT_THAT(html, HasSubstr("sparse"));
  site_.Write("results/evaluate/summary.json", "{ cut");
  site_.Write("results/evaluate/errors.csv", "");
  EXPECT_THAT(Report(), HasSubstr("errors.csv"));
}

TEST_F(ReportTest, TagsOfAMapThatIsNotOnTheEarthAreNotDrawnThere) {
  WriteResults();
  const std::string rows =
      "tag_id,family,size_m,x,y,z,qx,qy,qz,qw,role,status\n1,tag36h11,0.5,3.4,5.0,0.5,0,0,0,1,free,ok\n";
  const Project project = Project::Open(site_.dir());
  site_.Write("results/survey/tags.csv", "# trigpoint tags 1; frame=enu; datum=control; sigma=1\n" + rows);
  EXPECT_EQ(LoadScene(project).tags.size(), 1U);
  site_.Write("results/survey/tags.csv", "# trigpoint tags 1; frame=map; datum=free; sigma=1\n" + rows);
  EXPECT_TRUE(LoadScene(project).tags.empty());
}

TEST_F(ReportTest, AReleaseIsDrawnFromWhatItFroze) {
  WriteResults();
  const std::string rows =
      "tag_id,family,size_m,x,y,z,qx,qy,qz,qw,role,status\n1,tag36h11,0.5,3.4,5.0,0.5,0,0,0,1,free,ok\n";
  site_.Write("releases/v1/release.json", "{}");
  site_.Write("releases/v1/map/tags.csv", "# trigpoint tags 1; frame=enu; datum=control; sigma=1\n" + rows);
  fs::copy(site_ / "results/localize", site_ / "releases/v1/localize", fs::copy_options::recursive);
  fs::copy(site_ / "results/evaluate", site_ / "releases/v1/evaluate", fs::copy_options::recursive);
  fs::remove_all(site_ / "results");
  const Project project = Project::Open(site_.dir());
  EXPECT_TRUE(LoadScene(project).panoramas.empty());
  SceneOptions options;
  options.release = "v1";
  const SceneModel frozen = LoadScene(project, options);
  EXPECT_EQ(frozen.panoramas.size(), 1U);
  EXPECT_EQ(frozen.errors.size(), 1U);
  EXPECT_EQ(frozen.tags.size(), 1U);
}

TEST_F(ReportTest, AnEvaluationsFolderSaysWhoseItIs) {
  WriteResults();
  site_.Write("releases/v1/release.json", "{}");
  const std::string dir = site_.dir().string();
  EXPECT_EQ(SceneSourceOf(dir), (SceneSource{dir, "", ""}));
  EXPECT_EQ(SceneSourceOf(dir + "@paper"), (SceneSource{dir, "paper", ""}));
  EXPECT_EQ(SceneSourceOf(dir + "/results/evaluate/"), (SceneSource{dir, "", ""}));
  EXPECT_EQ(SceneSourceOf(dir + "/releases/v1"), (SceneSource{dir, "", "v1"}));
  EXPECT_EQ(SceneSourceOf(dir + "/releases/v1/evaluate"), (SceneSource{dir, "", "v1"}));
  EXPECT_FALSE(SceneSourceOf(dir + "/elsewhere/evaluate").has_value());
  EXPECT_FALSE(SceneSourceOf("/").has_value());
}

TEST_F(ReportTest, ABrokenPictureLeavesTheRest) {
  WriteResults();
  site_.Write("panoramas.csv", "file,station,latitude_deg,longitude_deg,height_m\np1.jpg,S1,48.0001,7.8001,241\n");
  site_.Write("p1.jpg", "this is no picture");
  site_.Write("results/localize/run1/matches.csv",
              "panorama,view,image,u_image,v_image,u_view,v_view\np1.jpg,0,images/a.jpg,1,2,3,4\np1.jpg,0,images/"
              "a.jpg,5,6,7,8\n");
  const std::string html = Report();
  EXPECT_THAT(html, HasSubstr("cannot be drawn"));
  EXPECT_EQ(summary_.match_pictures, 0);
  ReportOptions options;
  options.images = false;
  EXPECT_THAT(Report(options), HasSubstr("left out on request"));
}

TEST_F(ReportTest, VariantsSideBySideKeepTheirNames) {
  WriteResults();
  site_.Write("results/evaluate/errors.csv",
              std::string(kErrorHeader) +
                  "run1,,single,S1,p1.jpg,1,control,absolute,localized,,0.1,0.1,0,0.1,0,0,,0.1,0.1,0.1,1,3\n"
                  "run1,paper,g2,S1,p1.jpg,1,control,absolute,localized,,9.5,9.5,0,9.5,0,0,,0.1,0.1,0.1,9000,3\n");
  EXPECT_THAT(Report(), HasSubstr("run1@paper"));
  EXPECT_THAT(site_.Read("out/tables/worst_cells.csv"), HasSubstr("S1,p1.jpg,run1@paper,panorama (G2)"));
}

TEST_F(ReportTest, SharedEvidenceHasItsOwnCurvesOfConsistency) {
  WriteResults();
  std::string header = kErrorHeader;
  header.insert(header.size() - 1, ",shares_evidence");
  site_.Write("results/evaluate/errors.csv",
              header +
                  "run1,,single,S1,p1.jpg,1,control,absolute,localized,,0.1,0.1,0,0.1,0,0,,0.1,0.1,0.1,1,3,no\n"
                  "run1,,single,S2,p2.jpg,2,control,absolute,localized,,0.2,0.2,0,0.2,0,0,,0.1,0.1,0.1,4,3,yes\n");
  site_.Write("results/evaluate/coverage_risk.csv",
              "variant,method,reference,kind,shares_evidence,coverage,depth_sigma_m,median_m,p90_m,max_m\n"
              ",single,control,absolute,no,1,0.1,0.1,0.1,0.1\n,single,control,absolute,yes,1,0.1,0.2,0.2,0.2\n");
  const std::string html = Report();
  const std::string independent = "panorama (G2) against surveyed control, absolute",
                    shared = independent + ", shared evidence";
  for (const std::string& name : {independent, shared}) {
    EXPECT_THAT(html, HasSubstr(">" + name + " (n = 1)<"));  // of the histogram
    EXPECT_THAT(html, HasSubstr(">" + name + "<"));          // of the trust curve and of coverage and risk
  }
  EXPECT_THAT(html, Not(HasSubstr("(n = 2)<")));
}

TEST_F(ReportTest, StatesTheConfidenceOfTheIntervals) {
  WriteResults();
  nlohmann::json summary = nlohmann::json::parse(site_.Read("results/evaluate/summary.json"));
  summary["confidence"] = 0.9;
  site_.Write("results/evaluate/summary.json", summary.dump());
  const std::string html = Report();
  EXPECT_THAT(html, HasSubstr("Median, its 90 % interval"));
  EXPECT_THAT(html, Not(HasSubstr("its 95 % interval, mean")));
}

// How often sigmas hold is only known of a system that states them.
TEST_F(ReportTest, SigmasOfTheReferenceAloneSayNothingOfASystem) {
  WriteResults();
  nlohmann::json systems = nlohmann::json::array();
  for (const char* system : {"bare", "stating"}) {
    systems.push_back({{"system", system}, {"run", "run1"}, {"attempts", 2}, {"answers", 2}, {"rmse_m", 0.03}});
  }
  site_.Write("results/evaluate/estimates.json", nlohmann::json({{"estimates", systems}}).dump());
  site_.Write("results/evaluate/estimates.csv",
              "system,run,timestamp,de_m,dn_m,du_m,reference_sigma_e_m,reference_sigma_n_m,reference_sigma_u_m,"
              "sigma_e_m,sigma_n_m,sigma_u_m\n"
              "bare,run1,1,0.03,0,0,0.01,0.01,0.01,,,\n"
              "bare,run1,2,0.03,0,0,0.01,0.01,0.01,,,\n"
              "stating,run1,1,0.03,0,0,0.01,0.01,0.01,0.02,0.02,0.02\n"
              "stating,run1,2,0.03,0,0,0.01,0.01,0.01,0.02,0.02,0.02\n");
  const std::string html = Report();
  const std::string table = site_.Read("out/tables/cameras.csv");
  EXPECT_THAT(table, testing::ContainsRegex("\nbare,run1,[^\n]*,\n"));
  EXPECT_THAT(table, testing::ContainsRegex("\nstating,run1,[^\n]*,100\\.0\n"));
  EXPECT_THAT(html, HasSubstr("the system states no sigmas"));
}

// JSON has no infinity: null stands for it.
TEST_F(ReportTest, IntervalsMayBeOpen) {
  WriteResults();
  const auto gate = [](const char* of, const nlohmann::json& low, const nlohmann::json& high) {
    return nlohmann::json{
        {"gate", "survey.max_rmse_h_m"}, {"of", of},           {"unit", "m"}, {"limit", 0.5},
        {"interval", {low, high}},       {"confidence", 0.95}, {"n", 3},      {"verdict", "undecided"}};
  };
  const nlohmann::json gates = {gate("above", 0.1, nullptr), gate("below", nullptr, 0.3), gate("both", 0.1, 0.3),
                                gate("neither", nullptr, nullptr)};
  site_.Write("results/gates/gates.json", nlohmann::json({{"verdict", "undecided"}, {"gates", gates}}).dump());
  const nlohmann::json system = {{"system", "open"}, {"run", "run1"},  {"attempts", 2},
                                 {"answers", 2},     {"rmse_m", 0.03}, {"own_rmse_interval_m", {0.02, nullptr}}};
  site_.Write("results/evaluate/estimates.json",
              nlohmann::json({{"estimates", nlohmann::json::array({system})}}).dump());
  site_.Write("results/evaluate/estimates.csv", "system,run,timestamp\nopen,run1,1\n");
  Report();
  const std::string table = site_.Read("out/tables/gates.csv");
  EXPECT_THAT(table, HasSubstr(",above,undecided,,from 0.1 m (95 %),"));
  EXPECT_THAT(table, HasSubstr(",below,undecided,,up to 0.3 m (95 %),"));
  EXPECT_THAT(table, HasSubstr(",both,undecided,,0.1 m to 0.3 m (95 %),"));
  EXPECT_THAT(table, HasSubstr(",neither,undecided,,,"));
  EXPECT_THAT(site_.Read("out/tables/cameras.csv"), HasSubstr("\nopen,run1,2,2,0.030,0.020,,"));
}

TEST_F(ReportTest, HostileNamesStayText) {
  WriteResults();
  const std::string evil = "<img src=x onerror=alert(1)>";
  site_.Write("results/evaluate/errors.csv", std::string(kErrorHeader) + "run1,,single," + evil +
                                                 ",p1.jpg,1,control,absolute,localized," + evil +
                                                 ",0.1,0.1,0.1,0,0,0,,,,,,\n");
  site_.Write("results/evaluate/further.csv", "# " + evil + "\n" + evil + "\n" + evil + "\n");
  const std::string html = Report();
  EXPECT_THAT(html, Not(HasSubstr("<img src=x")));
  EXPECT_THAT(html, HasSubstr("&lt;img src=x onerror=alert(1)&gt;"));
}

TEST(ReportOptionsTest, NamesWhatIsWrong) {
  ReportOptions options;
  options.paper = "a3", options.units = "yd", options.pictures_mb = -1;
  EXPECT_EQ(options.Check().size(), 3u);
}

}  // namespace
}  // namespace trigpoint

// survey as a user calls it, on a made wall of tags that two runs pass: its tables, its gates and its chapter.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <Eigen/Core>
#include <cmath>
#include <map>

#include "calib/estimation/random.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "tests/support/program.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;

constexpr int kTags = 9;
constexpr double kSize = 0.5, kFocal = 600, kNoisePx = 0.1;

Eigen::Vector3d TagPlace(int id) { return {1.0 * id, id % 2 == 0 ? 4.0 : 4.8, id % 3 == 0 ? 1.2 : 2.0}; }

// A camera that looks north (y) passes tags on a wall that face it.
class Wall {
 public:
  Wall() {
    Write("origin.json", R"({"lat": 48.0, "lon": 7.8, "alt": 200.0})");
    Write("trigpoint.yaml", "schema: 1\ncrs: EPSG:32632\n");
    Write("tags.yaml", "size_m: 0.5\n");
    Control(0);
    Write("distances.csv", "from,to,distance_m,sigma_m,role\n0,8," +
                               std::to_string((TagPlace(8) - TagPlace(0)).norm() + 0.001) + ",0.002,check\n");
    Run("run1", 0, 1);
    Run("run2", -1, 2);
  }

  // Every third tag is control; the check point of tag 4 is off by `error` upwards.
  void Control(double error) const {
    Random random(7);
    std::string control = "tag_id,role,x_m,y_m,z_m,sigma_h_m,sigma_v_m\n";
    for (int id = 0; id < kTags; ++id) {
      Eigen::Vector3d p = TagPlace(id) + 0.002 * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal());
      if (id == 4) p.z() += error;
      control += std::to_string(id) + (id % 3 == 0 || id == 8 ? ",control," : ",check,") + std::to_string(p.x()) + "," +
                 std::to_string(p.y()) + "," + std::to_string(p.z()) + ",0.002,0.002\n";
    }
    Write("control_points.csv", control);
  }

  void Run(const std::string& run, double y, uint64_t seed) const {
    Random random(seed);
    const std::string folder = "runs/" + run + "/";
    std::string odometry, detections = "timestamp,tag_id,u0,v0,u1,v1,u2,v2,u3,v3\n";
    for (int i = 0; i <= 50; ++i) {
      const double t = 0.4 * i, x = -1 + 0.2 * i;
      char line[200];
      snprintf(line, sizeof line, "%.3f %.6f %.6f 1.5 0 0 0.70710678118 0.70710678118\n", t, x, y);
      odometry += line;
      for (int id = 0; id < kTags; ++id) {
        const Eigen::Vector3d p = TagPlace(id);
        std::string row = std::to_string(t) + "," + std::to_string(id);
        bool inside = true;
        // Bottom-left, bottom-right, top-right, top-left.
        for (const auto& [dx, dz] : {std::pair(-1, -1), std::pair(1, -1), std::pair(1, 1), std::pair(-1, 1)}) {
          const double depth = p.y() - y;
          const double u = kFocal * (p.x() + 0.5 * dx * kSize - x) / depth + 499.5 + kNoisePx * random.Normal();
          const double v = -kFocal * (p.z() + 0.5 * dz * kSize - 1.5) / depth + 399.5 + kNoisePx * random.Normal();
          inside = inside && u > 5 && u < 994 && v > 5 && v < 794;
          for (const double pixel : {u, v}) row.append(",").append(std::to_string(pixel));
        }
        if (inside) detections += row + "\n";
      }
    }
    Write(folder + "odometry.tum", odometry);
    Write(folder + "detections.csv", detections);
    Write(folder + "run.yaml",
          "role: survey\ndate: " + std::string(run == "run1" ? "2026-05-12" : "2026-05-13") + "\n");
    Write(folder + "camchain.yaml",
          "cam0:\n  camera_model: pinhole\n  intrinsics: [600, 600, 499.5, 399.5]\n  distortion_model: radtan\n"
          "  distortion_coeffs: [0, 0, 0, 0]\n  resolution: [1000, 800]\n"
          "  T_cam_imu:\n  - [0, -1, 0, 0]\n  - [0, 0, -1, 0]\n  - [1, 0, 0, 0]\n  - [0, 0, 0, 1]\n");
  }

  void Write(const std::string& file, const std::string& text) const { WriteFileAtomically(dir_ / file, text); }
  std::string Read(const std::string& file) const { return ReadTextFile(dir_ / file); }
  CsvTable Table(const std::string& name) const {
    return CsvTable::Read(dir_ / "results/survey" / (name + ".csv"), {});
  }
  std::string dir() const { return dir_.string(); }

 private:
  TempDir dir_;
};

TEST(SurveyCommand, WritesControlCheckResidualsDistancesAndSessions) {
  const Wall wall;
  const Finished survey = Trigpoint({"survey", wall.dir(), "--threads", "1"});
  ASSERT_EQ(survey.exit_code, 0) << survey.err;
  const json summary = json::parse(wall.Read("results/survey/summary.json"));
  // Check points: map minus stated, in the columns as in space.
  double squares = 0, chi2 = 0;
  const CsvTable check = wall.Table("check");
  ASSERT_EQ(check.rows().size(), 5u);
  for (const CsvRow& row : check.rows()) {
    EXPECT_EQ(row.Text("status"), "check");
    EXPECT_NEAR(row.Number("x") - row.Number("stated_x"), row.Number("de_m"), 2e-5);
    EXPECT_NEAR(row.Number("z") - row.Number("stated_z"), row.Number("du_m"), 2e-5);
    EXPECT_NEAR(std::hypot(row.Number("error_h_m"), row.Number("error_v_m")), row.Number("error_3d_m"), 2e-5);
    EXPECT_NEAR(row.Number("du_m") / row.Number("sigma_u_m"), row.Number("standardised_u"), 0.05);
    EXPECT_GT(row.Number("sigma_u_m"), 0.002);  // the point's own and the map's
    EXPECT_LT((Eigen::Vector3d(row.Number("x"), row.Number("y"), row.Number("z")) -
               TagPlace(static_cast<int>(row.Integer("tag_id"))))
                  .norm(),
              0.02);
    squares += std::pow(row.Number("error_3d_m"), 2);
    chi2 += row.Number("chi2_3dof");
  }
  EXPECT_NEAR(std::sqrt(squares / 5), summary["check"]["differences_rmse_3d_m"].get<double>(), 2e-5);
  EXPECT_LT(chi2, 37.7);  // 15 degrees of freedom, 99.9 %
  const CsvTable control = wall.Table("control");
  ASSERT_EQ(control.rows().size(), 4u);
  int left_out = 0;
  for (const CsvRow& row : control.rows()) {
    EXPECT_EQ(row.Text("status"), "used");
    if (!row.Has("left_out_du_m")) continue;
    ++left_out;
    // Without the point the map is further off it than with it, and less certain.
    EXPECT_GE(std::abs(row.Number("left_out_du_m")) + 1e-5, std::abs(row.Number("du_m")));
    EXPECT_GT(row.Number("left_out_sigma_u_m"), row.Number("sigma_u_m"));
  }
  EXPECT_GE(left_out, 3);
  // Every detection has its residual, and those of a run are its rms.
  std::map<std::string, std::pair<double, int>> of_run;
  const CsvTable residuals = wall.Table("residuals");
  for (const CsvRow& row : residuals.rows()) {
    if (row.Text("status") != "used") continue;
    of_run[row.Text("run")].first += std::pow(row.Number("rms_px"), 2);
    ++of_run[row.Text("run")].second;
  }
  const CsvTable sessions = wall.Table("sessions");
  ASSERT_EQ(sessions.rows().size(), 2u);
  for (const CsvRow& row : sessions.rows()) {
    const auto& [sum, n] = of_run[row.Text("run")];
    EXPECT_EQ(row.Integer("observations"), n);
    EXPECT_NEAR(row.Number("rms_px"), std::sqrt(sum / n), 1e-3);
    EXPECT_EQ(row.Text("session"), row.Text("run") == "run1" ? "2026-05-12" : "2026-05-13");
    EXPECT_GT(row.Number("repeatability_m"), 0);
    EXPECT_LT(row.Number("repeatability_m"), 0.02);
  }
  const CsvRow distance = wall.Table("distances").rows().at(0);
  EXPECT_EQ(distance.Text("status"), "check");
  EXPECT_NEAR(distance.Number("map_m") - distance.Number("measured_m"), distance.Number("difference_m"), 2e-5);
  const CsvRow tag = wall.Table("tags_crs").rows().at(0);
  EXPECT_NEAR(tag.Number("northing_m"), 5316595, 3000);  // 48 north, 7.8 east in zone 32
  EXPECT_NEAR(tag.Number("height_m"), 200 + tag.Number("z"), 0.01);
}

// Positions of panoramas at stations are no control points: what was asked for is never replaced by something else.
TEST(SurveyCommand, RefusesADatumThatIsNotThere) {
  const Wall wall;
  wall.Write("control_points.csv", "tag_id,role,x_m,y_m,z_m,sigma_h_m,sigma_v_m\n0,check,0,4,1.2,0.002,0.002\n");
  wall.Write("stations.csv", "station,tag_id,east_m,north_m,up_m,sigma_m\nS0,0,0,-1,0,0.01\n");
  wall.Write("panoramas.csv", "file,station,latitude_deg,longitude_deg,height_m\npano.jpg,S0,48.00003,7.80001,201.5\n");
  wall.Write("pano.jpg", "not read by survey");
  const Finished control = Trigpoint({"survey", wall.dir(), "--datum", "control"});
  EXPECT_EQ(control.exit_code, 1);
  EXPECT_THAT(control.err, testing::HasSubstr("datum control: no surveyed point can be used as control"));
  wall.Control(0);
  wall.Write("stations.csv", "station,tag_id,east_m,north_m,up_m,sigma_m\nS9,9,0,-1,0,0.01\n");
  const Finished geotags = Trigpoint({"survey", wall.dir(), "--datum", "geotags"});
  EXPECT_EQ(geotags.exit_code, 1);
  EXPECT_THAT(geotags.err, testing::HasSubstr("datum geotags: no panorama with a position belongs to a station"));
}

// A plan says how many of its pictures a tag needs: as many, spread as they are, give the sigma that it promises.
TEST(PlanCommand, SoManyPicturesAreNeeded) {
  const Wall wall;
  wall.Write(
      "plan.csv",
      "kind,name,east_m,north_m,up_m,heading_deg,size_mm\n"
      "tag,0,0,12,1.5,180,160\ntag,1,14,3,1.5,270,160\ntag,2,7,12,1.5,180,160\ntag,3,14,9,1.5,270,160\n"
      "control,0,,,,,\ncontrol,1,,,,,\ncontrol,2,,,,,\n"
      "path,lap,2,2,1.2,,\npath,lap,11,2,1.2,,\npath,lap,11,10,1.2,,\npath,lap,2,10,1.2,,\npath,lap,2,2,1.2,,\n");
  struct Planned {
    int images = 0, needed = 0;  // 0: no number of pictures is enough
    double sigma_m = 0;
  };
  const auto plan = [&](const std::vector<std::string>& settings) {
    std::vector<std::string> command = {"plan", wall.dir()};
    for (const std::string& setting : settings) command.insert(command.end(), {"--set", setting});
    const Finished done = Trigpoint(command);
    EXPECT_EQ(done.exit_code, 0) << done.err;
    const CsvTable tags = CsvTable::Read(wall.dir() + "/results/plan/tags.csv", {});
    for (const CsvRow& row : tags.rows()) {
      if (row.Integer("tag_id") != 3) continue;
      const Eigen::Vector3d sigma(row.Number("sigma_x_m"), row.Number("sigma_y_m"), row.Number("sigma_z_m"));
      return Planned{static_cast<int>(row.Integer("images")), static_cast<int>(row.Integer("images_needed", 0)),
                     sigma.norm()};
    }
    return Planned{};
  };
  const Planned all = plan({"rate_hz=8"});
  ASSERT_GT(all.images, 40);
  ASSERT_GT(all.needed, 1);
  ASSERT_LT(all.needed, all.images / 2);
  const Planned few = plan({fmt::format("rate_hz={:.3f}", 8.0 * all.needed / all.images)});
  EXPECT_NEAR(few.images, all.needed, 4);
  EXPECT_LT(few.sigma_m, 1.1 * all.sigma_m);
  EXPECT_GT(few.sigma_m, all.sigma_m);
  // Control alone is worse than that: pictures do not help.
  EXPECT_EQ(plan({"rate_hz=8", "max_tag_sigma_m=0.001"}).needed, 0);
}

// Without a datum no gate passes, what is missing is said each time, and a wrong number leaves no project behind.
TEST(PlanCommand, WithoutADatumGatesAreUndecided) {
  const Wall wall;
  fs::remove(fs::path(wall.dir()) / "trigpoint.yaml");
  for (const char* count : {"0", "-1", "21"}) {
    const Finished wrong = Trigpoint({"plan", wall.dir(), "--suggest", "control", count});
    EXPECT_EQ(wrong.exit_code, 2) << wrong.err;
    EXPECT_THAT(wrong.err, testing::HasSubstr("from 1 to 20"));
  }
  EXPECT_FALSE(fs::exists(fs::path(wall.dir()) / "trigpoint.yaml"));
  wall.Write(
      "plan.csv",
      "kind,name,east_m,north_m,up_m,heading_deg,size_mm\n"
      "tag,0,0,12,1.5,180,160\ntag,1,14,3,1.5,270,160\ntag,2,7,12,1.5,180,160\ntag,3,14,9,1.5,270,160\n"
      "path,lap,2,2,1.2,,\npath,lap,11,2,1.2,,\npath,lap,11,10,1.2,,\npath,lap,2,10,1.2,,\npath,lap,2,2,1.2,,\n");
  for (int again = 0; again < 2; ++again) {
    const Finished plan = Trigpoint({"plan", wall.dir(), "--gates", "--set", "max_tag_sigma_m=50"});
    EXPECT_EQ(plan.exit_code, 3) << plan.err;
    EXPECT_THAT(plan.out + plan.err, testing::HasSubstr("undecided"));
    EXPECT_THAT(plan.out + plan.err, testing::HasSubstr("relative to the first camera")) << again;
  }
  const Finished few = Trigpoint({"plan", wall.dir(), "--suggest", "control", "1"});
  EXPECT_EQ(few.exit_code, 0) << few.err;
  EXPECT_THAT(few.out + few.err, testing::HasSubstr("a datum needs at least 3 more control points, 1 asked for"));
  const Finished many = Trigpoint({"plan", wall.dir(), "--suggest", "control", "6"});
  EXPECT_THAT(many.out + many.err, testing::HasSubstr("6 asked for, 4 proposed"));
}

TEST(PlanCommand, TagsThatTheFamilyLacksAreRefused) {
  const Wall wall;
  const std::string header = "kind,name,east_m,north_m,up_m,heading_deg,size_mm\n";
  const std::string path = "path,lap,2,2,1.2,,\npath,lap,11,2,1.2,,\n";
  wall.Write("plan.csv", header + "tag,0,0,12,1.5,180,160\ntag,999,14,3,1.5,270,160\n" + path);
  for (const char* command : {"plan", "check"}) {
    const Finished done = Trigpoint({command, wall.dir()});
    EXPECT_NE(done.exit_code, 0) << command;
    EXPECT_THAT(done.out + done.err, HasSubstr("plan.csv:3: tag 999 is not in tag36h11, which has the ids 0 to 586"));
  }
  wall.Write("tags.yaml", "size_m: 0.5\nsizes_m:\n  0: 0.5\n  30: 0.16\nfamilies: {30: tag16h5}\n");
  for (const char* command : {"survey", "detect", "plan"}) {
    const Finished done = Trigpoint({command, wall.dir()});
    EXPECT_EQ(done.exit_code, 1) << command;
    EXPECT_THAT(done.err, HasSubstr("tags.yaml:5: key 'families.30': tag 30 is not in tag16h5, which has the ids 0 "));
  }
}

// Rotation sigmas are about the tags' own axes, as in the survey: the site turned by 90 degrees has the same.
TEST(PlanCommand, ATurnedSiteHasTheSameRotationSigmas) {
  const Wall wall;
  const auto sigmas = [&](bool turned) {
    std::string plan = "kind,name,east_m,north_m,up_m,heading_deg,size_mm\n";
    const auto row = [&](const std::string& name, double x, double y, const char* up, double heading) {
      if (turned) std::swap(x, y), x = -x, heading -= 90;
      plan += fmt::format("{},{:g},{:g},{}", name, x, y, up);
      plan += name.starts_with("tag") ? fmt::format(",{:g},160\n", heading) : ",,\n";
    };
    row("tag,0", 0, 12, "1.5", 180), row("tag,1", 14, 3, "1.5", 270), row("tag,2", 7, 12, "1.5", 180);
    row("tag,3", 14, 9, "1.5", 270);
    plan += "control,0,,,,,\ncontrol,1,,,,,\ncontrol,2,,,,,\n";
    for (const auto& [x, y] : {std::pair(2, 2), std::pair(11, 2), std::pair(11, 10), std::pair(2, 10)}) {
      row("path,lap", x, y, "1.2", 0);
    }
    wall.Write("plan.csv", plan);
    const Finished done = Trigpoint({"plan", wall.dir()});
    EXPECT_EQ(done.exit_code, 0) << done.err;
    std::vector<Eigen::Vector3d> rotation;
    const CsvTable tags = CsvTable::Read(wall.dir() + "/results/plan/tags.csv", {});
    for (const CsvRow& tag : tags.rows()) {
      if (tag.Text("status") != "ok") continue;
      rotation.emplace_back(tag.Number("sigma_rx_deg"), tag.Number("sigma_ry_deg"), tag.Number("sigma_rz_deg"));
    }
    return rotation;
  };
  const std::vector<Eigen::Vector3d> as_is = sigmas(false), turned = sigmas(true);
  ASSERT_EQ(as_is.size(), turned.size());
  ASSERT_GE(as_is.size(), 3U);
  double apart = 1;  // of the axes that the turn exchanges in the world
  for (size_t i = 0; i < as_is.size(); ++i) {
    EXPECT_LT((as_is[i] - turned[i]).norm(), 0.01 * as_is[i].norm()) << as_is[i] << "\n" << turned[i];
    apart = std::max(apart, as_is[i].x() / as_is[i].z());
  }
  EXPECT_GT(apart, 1.1);
}

// What to do next depends on what was asked for and on the gates.
TEST(PlanCommand, NextFollowsFromTheResult) {
  const Wall wall;
  wall.Write(
      "plan.csv",
      "kind,name,east_m,north_m,up_m,heading_deg,size_mm\n"
      "tag,0,0,12,1.5,180,160\ntag,1,14,3,1.5,270,160\ntag,2,7,12,1.5,180,160\ntag,3,14,9,1.5,270,160\n"
      "candidate,4,0,6,1.5,90,160\ncontrol,0,,,,,\ncontrol,1,,,,,\ncontrol,2,,,,,\n"
      "path,lap,2,2,1.2,,\npath,lap,11,2,1.2,,\npath,lap,11,10,1.2,,\npath,lap,2,10,1.2,,\npath,lap,2,2,1.2,,\n");
  const auto next = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"plan", wall.dir()});
    const std::string out = Trigpoint(arguments).out;
    return out.substr(std::min(out.size(), out.find("\nNext ")));
  };
  const std::string print = "--ids 0-3 --size 160", accept = "suggestions.csv in the sketch (rows ";
  EXPECT_THAT(next({}), HasSubstr("trigpoint print"));
  EXPECT_THAT(next({}), HasSubstr(print));
  EXPECT_THAT(next({"--gates", "--set", "max_tag_sigma_m=0.5"}), HasSubstr(print));
  EXPECT_THAT(next({"--suggest", "tags", "1"}), HasSubstr(accept + "tag,ID,...), then trigpoint plan"));
  EXPECT_THAT(next({"--suggest", "control", "1"}), HasSubstr(accept + "control,ID)"));
  EXPECT_THAT(next({"--set", "max_tag_sigma_m=0.001"}), HasSubstr("--suggest control 2   (the gates are not reached)"));
  EXPECT_THAT(next({"--suggest", "control", "1", "--set", "max_tag_sigma_m=0.001"}), HasSubstr(accept));
}

// A sketch without tags adds to the site as it was surveyed: one more path lowers the sigmas, and without the earlier
// runs it stands alone. Candidate paths are proposed.
TEST(PlanCommand, ANewEpochOfASurveyedSite) {
  const Wall wall;
  ASSERT_EQ(Trigpoint({"survey", wall.dir(), "--threads", "1"}).exit_code, 0);
  const auto rms = [&](const std::vector<std::string>& more) {
    std::vector<std::string> command = {"plan", wall.dir()};
    command.insert(command.end(), more.begin(), more.end());
    const Finished done = Trigpoint(command);
    EXPECT_EQ(done.exit_code, 0) << done.err;
    const json summary = json::parse(wall.Read("results/plan/summary.json"));
    EXPECT_EQ(summary["tags"], kTags) << done.err;
    return summary["rms_tag_sigma_m"].get<double>();
  };
  const double surveyed = rms({});
  const std::string path = "path,new,-1,-0.5,1.5\npath,new,9,-0.5,1.5\n", header = "kind,name,east_m,north_m,up_m\n";
  wall.Write("plan.csv", header + path);
  const double added = rms({}), alone = rms({"--set", "earlier_runs=false"});
  EXPECT_LT(added, surveyed);
  EXPECT_GT(alone, added);
  wall.Write("plan.csv", header + "candidate_path,wide,-1,-2,1.5\ncandidate_path,wide,9,-2,1.5\n");
  rms({"--suggest", "path"});
  EXPECT_THAT(wall.Read("results/plan/gains.csv"), HasSubstr("pass wide"));
  EXPECT_THAT(wall.Read("results/plan/gains.csv"), testing::Not(HasSubstr("straight")));
}

// Two pillars are known; tags are read from one of them and from a place between, and are check points besides.
TEST(SurveyCommand, ATotalStationHoldsTheMap) {
  const Wall wall;
  const std::map<std::string, Eigen::Vector3d> marks = {
      {"A", {4, -6, 0}}, {"B", {-4, -2, 0.5}}, {"free", {1, -3, 0.1}}};
  std::string control = "point,tag_id,role,x_m,y_m,z_m,sigma_h_m,sigma_v_m\n";
  for (const char* name : {"A", "B"}) {
    const Eigen::Vector3d& p = marks.at(name);
    control += fmt::format("{},,control,{:.4f},{:.4f},{:.4f},0.002,0.002\n", name, p.x(), p.y(), p.z());
  }
  for (int id = 0; id < kTags; ++id) {
    const Eigen::Vector3d p = TagPlace(id);
    control += fmt::format(",{},check,{:.4f},{:.4f},{:.4f},0.002,0.002\n", id, p.x(), p.y(), p.z());
  }
  wall.Write("control_points.csv", control);
  Random random(3);
  std::string readings = "setup,target,direction_gon,zenith_deg,slope_distance_m,instrument_height_m\n";
  int lines = 1;
  for (const std::string setup : {"A", "free"}) {
    const Eigen::Vector3d instrument = marks.at(setup) + Eigen::Vector3d(0, 0, 1.55);
    std::map<std::string, Eigen::Vector3d> targets = {{"B", marks.at("B")}};
    if (setup == "free") targets["A"] = marks.at("A");
    for (int id = 0; id < kTags; ++id) targets["tag:" + std::to_string(id)] = TagPlace(id);
    for (const auto& [name, at] : targets) {
      const Eigen::Vector3d d = at - instrument;
      double direction = (std::atan2(d.x(), d.y()) - 1.3) * 200 / M_PI + 0.001 * random.Normal();
      if (direction < 0) direction += 400;
      const double zenith = std::atan2(d.head<2>().norm(), d.z()) * 180 / M_PI + 0.0009 * random.Normal();
      readings += fmt::format("{},{},{:.4f},{:.5f},{:.4f},1.55\n", setup, name, direction, zenith,
                              d.norm() + 0.002 * random.Normal());
      ++lines;
    }
  }
  readings += "A,tag:1,12.0000,271.5,9.1,1.55\n";  // the second face
  wall.Write("total_station.csv", readings);
  const Finished survey = Trigpoint({"survey", wall.dir(), "--threads", "1"});
  ASSERT_EQ(survey.exit_code, 0) << survey.err;
  EXPECT_THAT(survey.err, HasSubstr(fmt::format("total_station.csv:{}", lines + 1)));
  EXPECT_THAT(survey.err, HasSubstr("second face"));
  EXPECT_EQ(wall.Table("station_residuals").rows().size(), 3u * static_cast<size_t>(lines - 1));
  const CsvTable check = wall.Table("check");
  ASSERT_EQ(check.rows().size(), static_cast<size_t>(kTags));
  double chi2 = 0;
  for (const CsvRow& row : check.rows()) {
    EXPECT_LT(row.Number("error_3d_m"), 0.012) << row.Text("tag_id");
    chi2 += row.Number("chi2_3dof");
  }
  EXPECT_LT(chi2, 55.5);  // 27 degrees of freedom, 99.9 %
}

TEST(SurveyCommand, ExportsSurveyedPointsAsLayers) {
  const Wall wall;
  ASSERT_EQ(Trigpoint({"survey", wall.dir(), "--threads", "1"}).exit_code, 0);
  const Finished exported =
      Trigpoint({"export", wall.dir(), "--to", "geojson", "--what", "check", "--out", wall.dir() + "/check.geojson"});
  ASSERT_EQ(exported.exit_code, 0) << exported.err;
  const json check = json::parse(wall.Read("check.geojson"));
  ASSERT_EQ(check["features"].size(), 5u);
  const CsvRow row = wall.Table("check").rows().at(0);
  const json& properties = check["features"][0]["properties"];
  EXPECT_NEAR(properties["error_3d_m"].get<double>(), row.Number("error_3d_m"), 1e-5);
  EXPECT_NEAR(properties["sigma_u_m"].get<double>(), row.Number("sigma_u_m"), 1e-5);
}

TEST(SurveyCommand, IsJudgedByItsGatesAndHasAChapter) {
  const Wall wall;
  const std::string common = "schema: 1\ngates: {survey: {min_check_points: 5, max_tag_sigma: 0.05, ";
  wall.Write("trigpoint.yaml", common + "max_check_rmse_3d: 0.05, max_standardised_residual: 4.5}}\n");
  const Finished passed = Trigpoint({"survey", wall.dir(), "--threads", "1"});
  EXPECT_EQ(passed.exit_code, 0) << passed.err << passed.out;
  EXPECT_EQ(json::parse(wall.Read("results/gates/gates.json"))["verdict"], "passed");
  // Nobody measured the panoramas: that gate is undecided, and no matter of this command.
  wall.Write("trigpoint.yaml", common + "max_check_rmse_3d: 0.05}, evaluate: {max_median: 0.2}}\n");
  EXPECT_EQ(Trigpoint({"survey", wall.dir()}).exit_code, 0);
  EXPECT_EQ(json::parse(wall.Read("results/gates/gates.json"))["verdict"], "undecided");
  EXPECT_EQ(Trigpoint({"gates", wall.dir()}).exit_code, 3);
  // A check point half a metre off.
  wall.Control(0.5);
  const Finished failed = Trigpoint({"survey", wall.dir(), "--threads", "1"});
  EXPECT_EQ(failed.exit_code, 3);
  EXPECT_THAT(failed.out, HasSubstr("survey.max_check_rmse_3d_m"));
  ASSERT_EQ(Trigpoint({"report", wall.dir()}).exit_code, 0);
  const std::string html = wall.Read("results/report/index.html");
  for (const char* part : {"id=\"survey\"", "they ask for 30 check points, the map has 5", "RMSE_3D"})
    EXPECT_THAT(html, HasSubstr(part));
  const json report = json::parse(wall.Read("results/report/report.json"));
  EXPECT_EQ(report["tables"]["survey_check"]["rows"].size(), 5u);
  EXPECT_EQ(report["tables"]["survey_control"]["rows"].size(), 4u);
  EXPECT_TRUE(fs::exists(fs::path(wall.dir()) / "results/report/figures/survey_plan.svg"));
  // A PDF that was asked for is up to date, and the next report keeps it.
  ASSERT_EQ(Trigpoint({"report", wall.dir(), "--pdf"}).exit_code, 0);
  const json status = Trigpoint({"status", wall.dir(), "--json"}).Json();
  for (const json& stage : status["stages"]) {
    if (stage["stage"] == "report") {
      EXPECT_EQ(stage["state"], "done") << stage.dump();
    }
  }
  wall.Control(0);
  ASSERT_EQ(Trigpoint({"survey", wall.dir(), "--threads", "1"}).exit_code, 0);
  ASSERT_EQ(Trigpoint({"report", wall.dir()}).exit_code, 0);
  EXPECT_TRUE(fs::exists(fs::path(wall.dir()) / "results/report/report.pdf"));
}

}  // namespace
}  // namespace trigpoint

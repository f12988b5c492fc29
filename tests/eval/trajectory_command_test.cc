// `trigpoint trajectory` as a user calls it.
#include <gmock/gmock.h>

#include <cmath>

#include "calib/estimation/random.h"
#include "calib/geo/geodetic.h"
#include "datasets/io/camchain.h"
#include "datasets/io/text.h"
#include "datasets/io/trajectory.h"
#include "tests/eval/shared_data.h"
#include "tests/support/program.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;

class TrajectoryCommand : public ::testing::Test {
 protected:
  std::string Write(const std::string& name, const std::string& text) const { return dir_.Write(name, text).string(); }
  // A winding path at 10 Hz, moved in time, space and shifted in its body.
  std::string Path(const std::string& name, double clock_s, const Eigen::Vector3d& shift, double scale = 1,
                   const Eigen::Vector3d& lever = Eigen::Vector3d::Zero()) const {
    std::vector<TimedPose> poses;
    for (int i = 0; i < 300; ++i) {
      const double t = 0.1 * i;
      const double s = t + 0;
      const Rigid3d pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.2 * s, Eigen::Vector3d::UnitZ())),
                         Eigen::Vector3d(10 * std::cos(0.2 * s), 8 * std::sin(0.3 * s), 0.1 * s));
      poses.push_back(
          {static_cast<int64_t>(std::llround((t + clock_s) * 1e9)), {pose.rotation, scale * (pose * lever) + shift}});
    }
    WriteTum(dir_ / name, poses, {});
    return (dir_ / name).string();
  }
  static json Estimate(const std::vector<std::string>& arguments) {
    std::vector<std::string> all = arguments;
    all.insert(all.begin(), "trajectory");
    all.push_back("--json");
    const Finished run = Trigpoint(all);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return run.Json().at("estimates").at(0);
  }
  TempDir dir_;
};

TEST_F(TrajectoryCommand, AlignsOnlyWhenAsked) {
  const std::string truth = Path("truth.tum", 0, {0, 0, 0});
  const std::string moved = Path("moved.tum", 0, {3, 4, 0}, 1.1);
  EXPECT_GT(Estimate({truth, moved})["ate_m"]["rmse"], 4.0);
  EXPECT_NEAR(Estimate({truth, moved, "--align", "sim3"})["ate_m"]["rmse"], 0, 1e-8);
  const double rigid = Estimate({truth, moved, "--align", "se3"})["ate_m"]["rmse"];
  EXPECT_GT(rigid, 0.3);
  EXPECT_LE(rigid, Estimate({truth, moved, "--align", "yaw"})["ate_m"]["rmse"].get<double>() + 1e-12);
  EXPECT_GT(Estimate({truth, moved, "--align", "origin"})["ate_m"]["rmse"], rigid);
}

TEST_F(TrajectoryCommand, FindsAndAppliesAClockThatIsOff) {
  const std::string truth = Path("truth.tum", 0, {0, 0, 0});
  const std::string late = Path("late.tum", 0.1, {0, 0, 0});
  const Finished told = Trigpoint({"trajectory", truth, late, "--interpolate"});
  EXPECT_THAT(told.out, HasSubstr("fits better with its clock moved by -0.1"));
  const json fixed = Estimate({truth, late, "--interpolate", "--offset", "auto"});
  EXPECT_NEAR(fixed["applied_offset_s"], -0.1, 0.002);
  EXPECT_LT(fixed["ate_m"]["rmse"], 0.01);
  EXPECT_NEAR(Estimate({truth, late, "--offset", "-0.1"})["ate_m"]["rmse"], 0, 1e-8);
}

TEST_F(TrajectoryCommand, AClockThatIsMovedLeavesPairs) {
  const std::string truth = Path("truth.tum", 0, {0, 0, 0});
  const json moved = Estimate({truth, Path("late.tum", 0.04, {0, 0, 0}), "--offset", "auto"});
  EXPECT_NEAR(moved["applied_offset_s"], -0.04, 0.002);
  EXPECT_GT(moved["pairs"], 290);
  EXPECT_LT(moved["ate_m"]["rmse"], 0.02);
}

TEST_F(TrajectoryCommand, AnOffsetThatMayBeNoneIsNotApplied) {
  const std::string truth = Path("truth.tum", 0, {0, 0, 0});
  Random random(3);
  int chance = 0;  // offsets that would leave no stamps beside each other
  for (int draw = 0; draw < 10; ++draw) {
    std::vector<TimedPose> noisy = ReadTrajectory(truth).poses;
    noisy.resize(20);
    for (TimedPose& pose : noisy) {
      for (int k = 0; k < 3; ++k) pose.target_from_body.translation[k] += 0.2 * random.Normal();
    }
    WriteTum(dir_ / "noisy.tum", noisy, {});
    const json e = Estimate({truth, (dir_ / "noisy.tum").string(), "--offset", "auto"});
    ASSERT_TRUE(e.contains("time_offset"));
    const json& found = e["time_offset"];
    chance += !found["significant"] && std::abs(found["offset_s"].get<double>()) > 0.01;
    EXPECT_EQ(e["applied_offset_s"], found["significant"] ? found["offset_s"] : json(0.0));
    EXPECT_GE(e["pairs"], 18);
  }
  EXPECT_GT(chance, 0);
}

TEST_F(TrajectoryCommand, RelativeErrorsByFramesMetresAndSeconds) {
  const std::string truth = Path("truth.tum", 0, {0, 0, 0});
  const std::string scaled = Path("scaled.tum", 0, {0, 0, 0}, 1.01);
  const json rpe = Estimate({truth, scaled, "--rpe", "1f", "--rpe", "10m", "--rpe", "5s", "--all-pairs"})["rpe"];
  ASSERT_EQ(rpe.size(), 3u);
  EXPECT_EQ(rpe[0]["m"]["count"], 299);
  EXPECT_EQ(rpe[2]["m"]["count"], 255);  // the last ones within a tenth of the length
  EXPECT_GT(rpe[1]["m"]["median"], rpe[0]["m"]["median"]);
  EXPECT_NEAR(rpe[1]["deg"]["max"], 0, 1e-5);
}

TEST_F(TrajectoryCommand, AGpsTrackIsAReference) {
  const LocalFrame frame({48, 8, 200});
  const Eigen::Vector3d antenna(0.3, 0, 1.5);
  const std::string body = Path("body.tum", 0, {0, 0, 0});
  std::string gps = "timestamp_s,latitude_deg,longitude_deg,height_m,sigma_h_m,sigma_v_m\n";
  for (const TimedPose& pose : ReadTrajectory(body).poses) {
    const Geodetic g = frame.GeodeticFromEnu(pose.target_from_body * antenna + Eigen::Vector3d(0.3, 0.4, 2));
    char line[200];
    snprintf(line, sizeof line, "%.1f,%.11f,%.11f,%.4f,2,4\n", 1e-9 * static_cast<double>(pose.stamp_ns),
             g.latitude_deg, g.longitude_deg, g.height_m);
    gps += line;
  }
  const std::string track = Write("gps.csv", gps);
  const json e = Estimate({track, body, "--origin", "48", "8", "200", "--lever-arm", "0.3", "0", "1.5"});
  EXPECT_NEAR(e["ate_h_m"]["mean"], 0.5, 1e-3);
  EXPECT_NEAR(e["ate_v_m"]["mean"], 2, 1e-3);
  EXPECT_EQ(e["reference_sigma_h_m"], 2.0);
  EXPECT_TRUE(e["ate_deg"].is_null());
}

// run.yaml states the antenna in the body frame, on the body's clock; results of cameras count from the camera.
TEST_F(TrajectoryCommand, TheAntennaOfARunIsOnItsBody) {
  const LocalFrame frame({48, 8, 200});
  const Eigen::Vector3d antenna(0.3, -0.2, 1.5);
  const fs::path run = dir_ / "runs/walk";
  std::vector<BodyCamera> cameras(2);
  for (size_t c = 0; c < cameras.size(); ++c) {
    const double side = c == 0 ? 0.0 : 0.4;
    cameras[c].name = "cam" + std::to_string(c);
    cameras[c].camera = Camera(CameraModel::kPinhole, 100, 100, {100, 100, 49.5, 49.5});
    cameras[c].cam_from_body = LevelForwardCamera();
    cameras[c].cam_from_body.translation = Eigen::Vector3d(0.1 - side, 1.1, -0.2);
    cameras[c].has_extrinsics = true;
    cameras[c].time_offset_s = 0.05;
  }
  fs::create_directories(run);
  WriteCamchain(run / "camchain.yaml", cameras);
  Write("origin.json", "{\"lat\": 48.0, \"lon\": 8.0, \"alt\": 200.0}");
  Write("tags.yaml", "size_m: 0.5\n");
  Write("runs/walk/detections.csv", "timestamp,tag_id,u0,v0,u1,v1,u2,v2,u3,v3\n1.0,77,10,20,20,20,20,10,10,10\n");
  Write("runs/walk/run.yaml", "gps: {lever_arm_m: [0.3, -0.2, 1.5], time_offset_s: 0.3}\n");
  const std::string body = Path("body.tum", 1, {0, 0, 0});
  std::string gps = "timestamp_s,latitude_deg,longitude_deg,height_m,sigma_h_m,sigma_v_m\n";
  std::vector<std::vector<TimedPose>> of_cameras(cameras.size());
  for (const TimedPose& pose : ReadTrajectory(body).poses) {
    const Geodetic g = frame.GeodeticFromEnu(pose.target_from_body * antenna);
    char line[200];
    snprintf(line, sizeof line, "%.1f,%.11f,%.11f,%.4f,2,4\n", 1e-9 * static_cast<double>(pose.stamp_ns) - 0.3,
             g.latitude_deg, g.longitude_deg, g.height_m);
    gps += line;
    for (size_t c = 0; c < cameras.size(); ++c) {
      of_cameras[c].push_back({pose.stamp_ns - 50'000'000, pose.target_from_body * cameras[c].cam_from_body.Inverse()});
    }
  }
  const std::string track = Write("runs/walk/gps.csv", gps);
  const auto worst = [&](const std::string& estimate, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {track, estimate};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Estimate(arguments)["ate_m"]["max"].get<double>();
  };
  // The track's last digits are 0.1 mm.
  EXPECT_LT(worst(body), 1e-3);
  for (const auto& [camera, of] :
       {std::pair<size_t, const char*>{0, "world_from_cam0"}, {0, "world_from_cam"}, {1, "world_from_cam1"}}) {
    WriteTum(
        dir_ / "cameras.tum", of_cameras[camera],
        {std::string("trigpoint trajectory 1; frame=enu; datum=gps; pose=") + of, "timestamp tx ty tz qx qy qz qw"});
    EXPECT_LT(worst((dir_ / "cameras.tum").string()), 1e-3) << of;
  }
  // An arm on the command line counts in the estimate's own axes; the camera's clock is the same.
  EXPECT_LT(worst(body, {"--lever-arm", "0.3", "-0.2", "1.5"}), 1e-3);
  const Eigen::Vector3d in_cam1 = cameras[1].cam_from_body * antenna;
  EXPECT_LT(worst((dir_ / "cameras.tum").string(), {"--lever-arm", std::to_string(in_cam1.x()),
                                                    std::to_string(in_cam1.y()), std::to_string(in_cam1.z())}),
            1e-3);
  EXPECT_GT(worst(body, {"--lever-arm", "0", "0", "0"}), 1.4);
}

TEST_F(TrajectoryCommand, BadInputIsOneLineAndTheOthersGoOn) {
  const std::string truth = Path("truth.tum", 0, {0, 0, 0}), good = Path("good.tum", 0, {0, 0, 0});
  const std::string broken = Write("broken.tum", "0 1 2 nan 0 0 0 1\n");
  const std::string other_clock = Path("other.tum", 1e6, {0, 0, 0});
  const auto one_line = [](const Finished& f, int exit_code, const std::string& part) {
    EXPECT_EQ(f.exit_code, exit_code) << f.err;
    EXPECT_EQ(std::count(f.err.begin(), f.err.end(), '\n'), 1) << f.err;
    EXPECT_THAT(f.err, HasSubstr(part));
  };
  one_line(Trigpoint({"trajectory", truth, broken}), 1, "broken.tum:1");
  one_line(Trigpoint({"trajectory", truth, other_clock}), 1, "check the clocks");
  one_line(Trigpoint({"trajectory", truth, "/nowhere.tum"}), 1, "/nowhere.tum");
  one_line(Trigpoint({"trajectory", truth, good, "--align", "affine"}), 2, "none, origin, yaw, se3 or sim3");
  one_line(Trigpoint({"trajectory", truth, good, "--rpe", "10"}), 2, "10m");
  one_line(Trigpoint({"trajectory", truth, good, "--offset", "soon"}), 2, "auto");
  const Finished mixed = Trigpoint({"trajectory", truth, broken, good});
  EXPECT_EQ(mixed.exit_code, 1);
  EXPECT_THAT(mixed.out, HasSubstr("good.tum"));
}

TEST_F(TrajectoryCommand, NamesFramesThatDifferAndProposesAnAlignment) {
  const std::string truth = Path("truth.tum", 0, {0, 0, 0});
  const Finished moved = Trigpoint({"trajectory", truth, Path("moved.tum", 0, {300, 40, 0})});
  EXPECT_THAT(moved.out, HasSubstr("Frames    moved.tum: the frames differ by 0.0 deg, 302.65 m"));
  EXPECT_THAT(moved.out, HasSubstr("--align yaw applies it"));
  const Finished scaled = Trigpoint({"trajectory", truth, Path("scaled.tum", 0, {30, 40, 0}, 1.5)});
  EXPECT_THAT(scaled.out, HasSubstr("a scale of 0.6667"));
  EXPECT_THAT(scaled.out, HasSubstr("--align sim3 applies it"));
  const json same = Estimate({truth, Path("same.tum", 0, {0, 0, 0})});
  EXPECT_FALSE(same.contains("frames"));
  EXPECT_NEAR(Estimate({truth, Path("moved.tum", 0, {300, 40, 0})})["frames"]["rmse_before_m"], 302.65, 0.01);
  EXPECT_FALSE(Estimate({truth, Path("moved.tum", 0, {300, 40, 0}), "--align", "se3"}).contains("frames"));
}

TEST_F(TrajectoryCommand, DrawsPlotsOnRequest) {
  const std::string truth = Path("truth.tum", 0, {0, 0, 0}), other = Path("a<b>.tum", 0, {1, 0, 0});
  for (const char* ending : {"svg", "png"}) {
    const std::string plot = (dir_ / "plots" / (std::string("plan.") + ending)).string();
    const Finished drawn = Trigpoint({"trajectory", truth, other, "--plot", plot});
    EXPECT_EQ(drawn.exit_code, 0) << drawn.err;
    EXPECT_THAT(drawn.out, HasSubstr("Plot      " + plot));
    for (const std::string& name : {std::string("plan."), std::string("plan_axes."), std::string("plan_errors.")}) {
      const std::string text = ReadTextFile(dir_ / "plots" / (name + ending));
      EXPECT_THAT(text, testing::StartsWith(ending == std::string("svg") ? "<svg xmlns" : "\x89PNG"));
      if (ending == std::string("svg") && name == "plan.") {
        EXPECT_THAT(text, HasSubstr("a&lt;b&gt;.tum"));
      }
    }
  }
  EXPECT_EQ(Trigpoint({"trajectory", truth, other, "--plot", (dir_ / "plan.gif").string()}).exit_code, 2);
}

// evo's own numbers, through the command.
TEST(TrajectoryCommandEvo, AgreesToOneMillionth) {
  const auto dir = SharedData("trajectories");
  if (!dir) GTEST_SKIP() << "no trajectories at hand";
  const json expected = json::parse(ReadTextFile(*dir / "expected_evo.json"));
  const std::map<std::string, std::string> references = {{"freiburg1", "freiburg1_xyz-groundtruth.txt"},
                                                         {"fr2_desk", "fr2_desk_groundtruth.txt"},
                                                         {"KITTI_00", "KITTI_00_gt.txt"},
                                                         {"V102", "V102_groundtruth.csv"}};
  int compared = 0;
  for (const auto& [key, numbers] : expected.items()) {
    const std::string name = key.substr(0, key.find(' '));
    std::string reference;
    for (const auto& [prefix, file] : references) {
      if (name.starts_with(prefix)) reference = file;
    }
    ASSERT_FALSE(reference.empty()) << key;
    const auto has = [&](const char* text) { return key.find(text) != std::string::npos; };
    std::vector<std::string> arguments = {"trajectory",
                                          (*dir / reference).string(),
                                          (*dir / name).string(),
                                          "--json",
                                          "--align",
                                          has("Sim3")  ? "sim3"
                                          : has("SE3") ? "se3"
                                                       : "none"};
    if (has("delta 1 frame")) arguments.insert(arguments.end(), {"--rpe", "1f"});
    if (has("delta 1 m ")) arguments.insert(arguments.end(), {"--rpe", "1m"});
    if (has("delta 10 m")) arguments.insert(arguments.end(), {"--rpe", "10m"});
    if (has("delta 100 m")) arguments.insert(arguments.end(), {"--rpe", "100m"});
    if (has("all_pairs")) arguments.push_back("--all-pairs");
    const Finished run = Trigpoint(arguments);
    ASSERT_EQ(run.exit_code, 0) << key << run.err;
    const json found = run.Json()["estimates"][0];
    const bool relative = has("RPE");
    const json m = relative ? found["rpe"][0]["m"] : found["ate_m"];
    const json deg = relative ? found["rpe"][0]["deg"] : found["ate_deg"];
    const std::string kind = relative ? "RPE" : "APE";
    for (const char* statistic : {"rmse", "mean", "median", "std", "min", "max"}) {
      EXPECT_NEAR(m[statistic], numbers[kind + "_translation_part"][statistic], 1e-6) << key << ' ' << statistic;
      EXPECT_NEAR(deg[statistic], numbers[kind + "_rotation_angle_deg"][statistic], 1e-6) << key << ' ' << statistic;
      compared += 2;
    }
  }
  EXPECT_EQ(compared, 12 * static_cast<int>(expected.size()));
}

}  // namespace
}  // namespace trigpoint

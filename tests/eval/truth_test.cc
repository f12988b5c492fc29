#include "eval/truth/truth.h"

#include <gtest/gtest.h>

#include <cmath>

#include "calib/base/error.h"
#include "eval/statistics/statistics.h"

namespace trigpoint {
namespace {

const std::filesystem::path kData = "tests/eval/testdata";

double Rounded(double value) { return std::round(value * 1e4) / 1e4; }

// The expected numbers are those of an independent program (numpy); it rounds errors of panoramas to 0.1 mm.
// The cameras near station 118 stand on a line: a fit of their centres alone leaves the roll open and gives 1.395 m.
TEST(EvaluateAgainstTruth, AgreesWithAnIndependentProgram) {
  const auto dir = kData / "localize_run3";
  const TruthEvaluation e = EvaluateAgainstTruth(ReadLocalizeResult(dir), ReadTruth(kData / "truth", "run3"));
  EXPECT_EQ(e.frames_truth, 62);
  EXPECT_EQ(e.frames_out, 62);
  EXPECT_EQ(e.expected, (std::vector<int>{57, 59, 65, 75, 99, 110}));
  EXPECT_EQ(e.missing, std::vector<int>{65});
  const std::map<int, std::pair<double, double>> expected{{57, {0.0115, 0.2522}},  {59, {0.0794, 0.1971}},
                                                          {75, {0.0718, 0.1863}},  {99, {0.0454, 0.2745}},
                                                          {110, {0.2505, 0.1403}}, {118, {0.1296, 0.2424}}};
  std::vector<double> relative;
  ASSERT_EQ(e.answers.size(), expected.size());
  for (const TruthError& error : e.answers) {
    EXPECT_NEAR(Rounded(error.relative_m), expected.at(error.station).first, 1e-6) << error.station;
    EXPECT_NEAR(Rounded(*error.world_h_m), expected.at(error.station).second, 1e-6) << error.station;
    relative.push_back(Rounded(error.relative_m));
  }
  EXPECT_NEAR(Quantile(relative, 0.5), 0.0756, 1e-6);
  EXPECT_NEAR(Quantile(relative, 0.9), 0.19005, 1e-6);
  EXPECT_NEAR(*e.relative_median_m, 0.0756, 1e-4);
  EXPECT_NEAR(*e.relative_p90_m, 0.19005, 1e-4);
  EXPECT_NEAR(*e.relative_max_m, 0.2505, 1e-4);
  EXPECT_NEAR(*e.camera_rmse_h_m, 0.2263453796214741, 1e-6);
  EXPECT_NEAR(*e.camera_rmse_v_m, 0.15049163871316423, 1e-6);
  EXPECT_NEAR(*e.ate_se3_m, 0.09813787608163231, 1e-6);
  EXPECT_NEAR(*e.ate_sim3_m, 0.03927639235963168, 1e-6);
  EXPECT_NEAR(*e.scale_error, 0.00591202514084177, 1e-6);
  EXPECT_NEAR(*e.camera_nees_per_dof, 0.5263938468355785, 1e-6);
  EXPECT_NEAR(*e.panorama_anees_per_dof, 0.6429839375366907, 1e-6);
}

TEST(EvaluateAgainstTruth, RotationIsThatOfTheFittedPose) {
  const auto dir = kData / "localize_run3";
  LocalizeResult result = ReadLocalizeResult(dir);
  result.images.clear();  // no sigmas of cameras
  const TruthEvaluation e = EvaluateAgainstTruth(result, ReadTruth(kData / "truth", "run3"));
  // The made-up answers have the true rotation, so what is left is the fit's: small where cameras surround the station.
  ASSERT_EQ(e.answers[0].station, 57);
  EXPECT_LT(e.answers[0].relative_rot_deg, 1);
  EXPECT_FALSE(e.camera_nees_per_dof);
}

TEST(EvaluateAgainstTruth, WithoutAnyAnswerSaysSo) {
  LocalizeResult result;
  const TruthEvaluation e = EvaluateAgainstTruth(result, ReadTruth(kData / "truth", "run3"));
  EXPECT_EQ(e.missing, e.expected);
  EXPECT_FALSE(e.relative_median_m);
  EXPECT_FALSE(e.ate_se3_m);
  EXPECT_FALSE(e.camera_rmse_h_m);
  result.panoramas.push_back({.panorama = "p", .station = "S7", .status = "localized", .odom_from_pano = Rigid3d()});
  EXPECT_THROW(EvaluateAgainstTruth(result, ReadTruth(kData / "truth", "run3")), InputError);
}

}  // namespace
}  // namespace trigpoint

#include "calib/estimation/loss.h"

#include <gtest/gtest.h>

#include <cmath>

#include "calib/base/error.h"
#include "calib/estimation/huber_by_median.h"
#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

class Loss : public testing::TestWithParam<const char*> {};

TEST_P(Loss, DerivativesAreRightOnBothSidesOfTheKnee) {
  for (const double knee : {0.5, 1.0, 9.21}) {
    const auto loss = MakeLoss(GetParam(), knee);
    for (const double factor : {0.01, 0.3, 0.9, 0.99, 1.01, 1.1, 2.0, 10.0, 1000.0}) {
      const double s = factor * knee, h = 1e-5 * s;
      double at[3], above[3], below[3];
      loss->Evaluate(s, at), loss->Evaluate(s + h, above), loss->Evaluate(s - h, below);
      EXPECT_NEAR(at[1], (above[0] - below[0]) / (2 * h), 1e-8) << GetParam() << " s=" << s;
      EXPECT_NEAR(at[2], (above[1] - below[1]) / (2 * h), 1e-7) << GetParam() << " s=" << s;
    }
  }
}

TEST_P(Loss, StartsAsLeastSquaresAndNeverRewardsALargerResidual) {
  const auto loss = MakeLoss(GetParam(), 3.0);
  double rho[3];
  loss->Evaluate(0, rho);
  EXPECT_EQ(rho[0], 0);
  EXPECT_EQ(rho[1], 1);
  double last = 0;
  for (double s = 0; s < 1e4; s = s * 1.1 + 1e-3) {
    loss->Evaluate(s, rho);
    EXPECT_GE(rho[1], 0);
    EXPECT_LE(rho[1], 1);
    EXPECT_LE(rho[2], 0);
    EXPECT_GE(rho[0], last);
    EXPECT_LE(rho[0], s + 1e-12);
    last = rho[0];
  }
}

TEST_P(Loss, IsContinuousAtTheKnee) {
  const double knee = 4.0;
  const auto loss = MakeLoss(GetParam(), knee);
  double below[3], above[3];
  loss->Evaluate(knee * (1 - 1e-12), below), loss->Evaluate(knee * (1 + 1e-12), above);
  EXPECT_NEAR(below[0], above[0], 1e-10);
  EXPECT_NEAR(below[1], above[1], 1e-10);
}

INSTANTIATE_TEST_SUITE_P(All, Loss, testing::Values("huber", "cauchy", "tukey", "dcs"),
                         [](const auto& p) { return std::string(p.param); });

TEST(DcsLoss, WeighsByTheSquareOfTheSwitchAndIsItsIntegral) {
  const double phi = 2.5;
  const DcsLoss loss(phi);
  double integral = 0, at = 0;
  for (const double chi2 : {0.1, 1.0, 2.5, 2.6, 7.0, 100.0}) {
    const auto weight = [&](double s) { return std::pow(std::min(1.0, 2 * phi / (phi + s)), 2); };
    for (const double h = 1e-4; at < chi2 - h / 2; at += h) integral += h * weight(at + h / 2);
    double rho[3];
    loss.Evaluate(chi2, rho);
    EXPECT_NEAR(rho[1], weight(chi2), 1e-12);
    EXPECT_NEAR(rho[0], integral, 1e-5);
    EXPECT_LT(rho[0], 3 * phi);
  }
}

TEST(TukeyLoss, IsConstantBeyondTheCutOff) {
  const TukeyChi2Loss loss(3);
  double rho[3];
  loss.Evaluate(50, rho);
  EXPECT_EQ(rho[0], 1);
  EXPECT_EQ(rho[1], 0);
}

TEST(HuberByMedian, FindsTheNoiseOfComponentsWhateverTheirNumber) {
  constexpr double kNoise = 2;  // in stated sigmas
  constexpr int kResiduals = 10000;
  Random random(1);
  for (const size_t components : {1U, 2U, 3U}) {
    HuberByMedian huber;
    for (int i = 0; i < kResiduals; ++i) {
      double squares = 0;
      for (size_t k = 0; k < components; ++k) squares += std::pow(kNoise * random.Normal(), 2);
      huber.Weight(std::sqrt(squares), components);
    }
    huber.EndRound();
    EXPECT_NEAR(huber.noise(), kNoise, 0.05 * kNoise) << components;  // four sigmas of a median
  }
}

TEST(MakeLoss, KnowsNoneAndRefusesWhatItDoesNotKnow) {
  EXPECT_EQ(MakeLoss("none", 1), nullptr);
  EXPECT_THROW(MakeLoss("dsc", 1), OptionError);
}

}  // namespace
}  // namespace trigpoint

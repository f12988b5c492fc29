// What depth shading does to a picture: steps in depth are outlined, all else stays as it is.
#include "app/desktop/depth_shading.h"

#include <QVTKOpenGLNativeWidget.h>
#include <gtest/gtest.h>
#include <vtkActor.h>
#include <vtkCamera.h>
#include <vtkGenericOpenGLRenderWindow.h>
#include <vtkNew.h>
#include <vtkRenderStepsPass.h>
#include <vtkRenderer.h>

#include <Eigen/Core>
#include <QColor>
#include <QImage>
#include <QTest>

#include "eval/scene/props.h"

namespace trigpoint {
namespace {

constexpr double kEye_m = 100;

// A floor with a plate 5 m above it, as bright, both seen from above; points over nothing.
class DepthShadingTest : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    window_->SetMultiSamples(0);
    widget_.setRenderWindow(window_);
    window_->AddRenderer(renderer_);
    renderer_->SetBackground(1, 1, 1);
    const auto square = [&](double half, double z) {
      renderer_->AddViewProp(
          FlatActor(Polygon({{-half, -half, z}, {half, -half, z}, {half, half, z}, {-half, half, z}}), kGrey, 1));
    };
    square(20, 0);
    square(8, 5);
    // Two pixels beside the far point another one, a fifth of the way nearer.
    const Eigen::Vector3d beside = kFar + Eigen::Vector3d(0.4, 0, 0), eye(0, 0, kEye_m);
    const Eigen::Vector3d above = beside + Eigen::Vector3d(0, 0, 20), along = eye + 0.8 * (beside - eye);
    renderer_->AddViewProp(FlatActor(Dots({kAlone, kFar, GetParam() ? above : along}), kGrey, 2));
    vtkCamera* camera = renderer_->GetActiveCamera();
    camera->SetPosition(0, 0, kEye_m);
    camera->SetFocalPoint(0, 0, 0);
    camera->SetViewUp(0, 1, 0);
    camera->SetParallelProjection(GetParam() ? 1 : 0);
    camera->SetParallelScale(30);
    camera->SetViewAngle(35);
    widget_.resize(400, 300);
    widget_.show();
    ASSERT_TRUE(QTest::qWaitForWindowExposed(&widget_));
    renderer_->ResetCameraClippingRange();
    plain_ = Draw();
    vtkNew<vtkRenderStepsPass> steps;
    vtkNew<DepthShading> shading;
    shading->SetDelegatePass(steps);
    renderer_->SetPass(shading);
    shaded_ = Draw();
  }
  void TearDown() override {
    widget_.makeCurrent();
    if (renderer_->GetPass() != nullptr) renderer_->GetPass()->ReleaseGraphicsResources(window_);
    renderer_->SetPass(nullptr);
  }
  QImage Draw() {
    window_->Render();
    return widget_.grabFramebuffer();
  }
  QPoint At(const Eigen::Vector3d& p) {
    renderer_->SetWorldPoint(p.x(), p.y(), p.z(), 1);
    renderer_->WorldToDisplay();
    const double* d = renderer_->GetDisplayPoint();
    return {static_cast<int>(d[0]), window_->GetSize()[1] - 1 - static_cast<int>(d[1])};
  }
  // Shaded by plain brightness.
  double Share(const QPoint& at) const {
    return static_cast<double>(qGray(shaded_.pixel(at))) / qGray(plain_.pixel(at));
  }

  static constexpr Colour kGrey{0.8, 0.8, 0.8};
  const Eigen::Vector3d kAlone{26, 5, 0}, kFar{26, -5, 0};
  vtkNew<vtkGenericOpenGLRenderWindow> window_;
  vtkNew<vtkRenderer> renderer_;
  QVTKOpenGLNativeWidget widget_;
  QImage plain_, shaded_;
};

TEST_P(DepthShadingTest, AStepIsDarkOnItsFarSideAndFlatPartsStay) {
  const QPoint edge = At({8, 0, 5});
  int darkest = 0;
  double least = 2;
  for (int dx = -10; dx <= 10; ++dx) {
    const double share = Share(edge + QPoint(dx, 0));
    if (share < least) least = share, darkest = dx;
  }
  EXPECT_LT(least, 0.8);
  EXPECT_GE(darkest, 0);  // on the floor, not on the plate
  EXPECT_LE(darkest, 2);
  EXPECT_NEAR(Share(edge - QPoint(4, 0)), 1, 0.01);
  EXPECT_NEAR(Share(edge + QPoint(6, 0)), 1, 0.01);
  EXPECT_NEAR(Share(At({0, 0, 5})), 1, 0.01);
  EXPECT_NEAR(Share(At({14, 14, 0})), 1, 0.01);
  EXPECT_NEAR(Share({5, 5}), 1, 0.01);  // the background
}

TEST_P(DepthShadingTest, NothingLosesMoreThanHalfOfItsBrightness) {
  double least = 2;
  for (int y = 0; y < plain_.height(); ++y) {
    for (int x = 0; x < plain_.width(); ++x) least = std::min(least, Share({x, y}));
  }
  EXPECT_GT(least, 0.49);
  EXPECT_NEAR(Share(At(kAlone)), 1, 0.01);  // nothing stands before it
  double beside = 2;                        // another one
  for (int dx = -1; dx <= 1; ++dx) beside = std::min(beside, Share(At(kFar) + QPoint(dx, 0)));
  EXPECT_LT(beside, 0.8);
}

INSTANTIATE_TEST_SUITE_P(PerspectiveAndParallel, DepthShadingTest, testing::Bool());

}  // namespace
}  // namespace trigpoint

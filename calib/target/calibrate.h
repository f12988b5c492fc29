// Cameras from pictures of a board: intrinsics, a rig's extrinsics, on request the board's own shape, by bundle
// adjustment, with covariances.
//
// Minimises  sum |pixel(camera_c, cam_from_rig_c * rig_from_board_f * point_i) - observed|^2 / sigma_c^2
// over intrinsics, cam_from_rig of all cameras but the first, one rig_from_board per frame, and what is asked for of
// the board's shape. Start: for each camera the focal length whose planar poses (Collins and Bartoli, "Infinitesimal
// plane-based pose estimation", IJCV 2014) fit best, then in steps from few parameters to all (as Zhang, "A flexible
// new technique for camera calibration", PAMI 2000, section 3.2). A robust loss finds the outliers, the last solution
// is least squares over the rest, so that its covariance is the textbook one: sigma^2 (J'J)^-1, the board poses
// eliminated, sigma from the residuals themselves.
//
// Gauge: rig = first camera. The board's size fixes the scale; a wrong one scales poses and baselines and nothing else.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/base/option.h"
#include "calib/base/progress.h"
#include "calib/camera/camera.h"
#include "calib/geometry/rigid3.h"
#include "calib/target/detect.h"
#include "calib/target/target.h"

namespace trigpoint {

struct CalibrateOptions {
  std::string model = "radtan5";
  bool square_pixels = false;
  bool board_shape = false;
  bool reject = true;
  double reject_sigmas = 4.5;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.model, {"model", "", 0, 0,
                       "pinhole, radtan (k1 k2 p1 p2), radtan5 (and k3), rational (8 coefficients), kannala_brandt "
                       "(fisheye); for several cameras one each, separated by commas"});
    visit(self.square_pixels, {"square_pixels", "", 0, 1, "one focal length for both directions"});
    visit(self.board_shape, {"board_shape", "", 0, 1, "estimate how the board is bent and twisted, too"});
    visit(self.reject,
          {"reject", "", 0, 1, "leave out points and pictures that don't fit; false: least squares of all"});
    visit(self.reject_sigmas, {"reject_sigmas", "", 3.0, 100.0, "a point this many sigmas off is left out"});
  }
  std::vector<std::string> Check() const;
};

// A picture in which the board was found.
struct CalibrationView {
  int camera = 0;
  int frame = 0;      // pictures of one frame were taken at one time
  std::string image;  // its name in messages and tables
  std::vector<BoardPoint> points;
};

struct CalibrationInput {
  struct CameraSize {
    std::string name;
    int width = 0, height = 0;
  };
  Target target;
  std::vector<CameraSize> cameras;
  std::vector<std::string> frames;     // names
  std::vector<CalibrationView> views;  // any order
};

// How the board differs from its description. Along x and y from -1 to 1 over the board:
//   z = bend_x (1 - x^2) + bend_y (1 - y^2) + twist x y, towards the board's z (metres);
// in the plane: places along y grow by (1 + stretch), and x by shear * y; AprilGrid: gaps between tags grow by `gap`
// (metres).
struct BoardShape {
  static constexpr int kSize = 6;
  static const char* const kNames[kSize];  // bend_x_m, bend_y_m, twist_m, stretch, shear, gap_m
  Eigen::Matrix<double, kSize, 1> values = Eigen::Matrix<double, kSize, 1>::Zero();
  Eigen::Matrix<double, kSize, 1> sigma = Eigen::Matrix<double, kSize, 1>::Zero();  // 1 sigma; 0: not estimated
};

struct CalibratedCamera {
  std::string name;
  Camera camera;
  std::vector<std::string> parameters;  // of `camera`, in its order
  Eigen::MatrixXd covariance;           // of all of them, px and 1; zero rows where not estimated
  Rigid3d cam_from_rig;
  Matrix6d cam_from_rig_covariance = Matrix6d::Zero();
  double sigma_px = 0;    // of one coordinate of one point, from the residuals
  double rms_px = 0;      // root mean square distance of the points used, as OpenCV counts it
  double rms_all_px = 0;  // of all points, left-out ones too
  int views = 0, views_used = 0;
  int points = 0, points_used = 0;
  Eigen::VectorXd Sigmas() const { return covariance.diagonal().cwiseMax(0).cwiseSqrt(); }
};

struct PointResidual {
  int view = 0;  // index into CalibrationInput::views
  int point = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();     // observed
  Eigen::Vector2d residual = Eigen::Vector2d::Zero();  // predicted - observed, px; NaN: cannot be predicted
  bool used = false;
};

struct ViewSummary {
  bool used = false;
  std::string reason;  // why not
  int points = 0, points_used = 0;
  double rms_px = 0;       // of the points used; of all where the view is not used
  double tilt_rad = 0;     // between the board's normal and the optical axis
  double distance_m = 0;   // from the camera to the board's middle
  double azimuth_rad = 0;  // in which direction of the picture the board's normal leans
};

struct Calibration {
  std::vector<CalibratedCamera> cameras;
  std::vector<Rigid3d> rig_from_board;  // of each frame
  std::vector<bool> frame_used;
  BoardShape board;
  std::vector<PointResidual> residuals;  // of every point, view by view
  std::vector<ViewSummary> views;        // of every view
  bool determined = true;                // false: some parameters cannot be told from these pictures
  int iterations = 0;
  double cost_before = 0, cost_after = 0;  // 1/2 sum of squared whitened residuals of the last solution

  // Covariance of the cameras' parameters, then cam_from_rig (tangents) of all cameras but the first; `labels` name
  // its rows ("cam0 fx", "cam1 rx", ...). Rows of what was not estimated are left out.
  Eigen::MatrixXd covariance;
  std::vector<std::string> labels;
  // What the textbook sigmas were multiplied by, since two halves of the pictures differ by so much more (quality.h).
  double sigma_factor = 1;
};

// Throws InputError where there is too little to begin with (fewer than three views of a camera, cameras that share no
// frame), naming what is needed; NumericError if no start is found; OptionError; Cancelled. One thread; the same input
// gives the same result.
Calibration CalibrateCameras(const CalibrationInput& input, const CalibrateOptions& options, ProgressSink& progress,
                             const CancelToken& cancel);

// Again, from a solution, with only the frames for which `keep` is true and the points used in it; the same parameters,
// and those of the board's shape named by `free_shape` (indices of BoardShape). Plain least squares.
Calibration Recalibrate(const CalibrationInput& input, const CalibrateOptions& options, const Calibration& start,
                        const std::vector<bool>& keep, const std::vector<int>& free_shape, const CancelToken& cancel);

// How well `part`, made from some of the frames of `all`, predicts `frames`, which had no part in it: their board poses
// are solved with its cameras held fixed; points and start values are those of `all`. Root mean square distance of the
// points used, px; of every camera.
std::vector<double> HoldOutRms(const CalibrationInput& input, const Calibration& all, const Calibration& part,
                               const std::vector<bool>& frames, const CancelToken& cancel);

}  // namespace trigpoint

// Central camera models: pixels to rays and back.
//
// Pixels: the centre of the top-left pixel is (0, 0). Camera frame: x right, y down, z forward.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint {

enum class CameraModel {
  kPinhole,         // fx fy cx cy
  kRadtan,          // fx fy cx cy k1 k2 p1 p2 [k3]: Brown-Conrady, as OpenCV and Kalibr's radtan
  kRational,        // fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6: OpenCV's rational model
  kKannalaBrandt,   // fx fy cx cy k1 k2 k3 k4: theta_d = theta (1 + k1 theta^2 + ...), Kalibr's equidistant
  kEquirectangular  // no parameters: u over [0, width) spans 360 deg, the image centre looks along +z
};

// "pinhole", "radtan", "rational", "kannala_brandt", "equirectangular".
std::string_view CameraModelName(CameraModel model);

// A central camera. A value; thread safe when const.
class Camera {
 public:
  Camera() = default;
  // Throws InputError if sizes or parameter counts are off, or a focal length is not positive.
  Camera(CameraModel model, int width, int height, std::vector<double> params);

  // A perfect pinhole: horizontal field of view (rad), principal point at the image centre ((w-1)/2, (h-1)/2).
  static Camera FromFieldOfView(int width, int height, double hfov_rad);
  static Camera Equirectangular(int width, int height);

  CameraModel model() const { return model_; }
  int width() const { return width_; }
  int height() const { return height_; }
  const std::vector<double>& params() const { return params_; }

  // Mean focal length, px (equirectangular: width / 2 pi).
  double MeanFocal() const;

  // Unit ray of a pixel in the camera frame; nothing where the model has no ray (outside the valid radius).
  std::optional<Eigen::Vector3d> Unproject(const Eigen::Vector2d& pixel) const;

  // Pixel of a point in the camera frame; nothing behind the camera or beyond the model's valid angle.
  // The result may lie outside the image. `jacobian`, if given: d pixel / d point, 2 x 3.
  std::optional<Eigen::Vector2d> Project(const Eigen::Vector3d& point,
                                         Eigen::Matrix<double, 2, 3>* jacobian = nullptr) const;

  bool Contains(const Eigen::Vector2d& pixel) const {
    return pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() < width_ - 0.5 && pixel.y() < height_ - 0.5;
  }

  // Whitening of a bearing residual: W (2 x 3) such that W * predicted_ray has unit covariance where the
  // pixel has isotropic standard deviation `sigma_px` and predicted_ray is near this pixel's ray.
  // W * ray(pixel) = 0. Throws NumericError where the pixel has no ray.
  Eigen::Matrix<double, 2, 3> BearingSqrtInfo(const Eigen::Vector2d& pixel, double sigma_px) const;

  // The same camera for an image resized to round(width * factor) x round(height * factor); the image's edges stay
  // its edges, as cv::resize to that size does it.
  Camera Scaled(double factor) const;

 private:
  CameraModel model_ = CameraModel::kPinhole;
  int width_ = 0;
  int height_ = 0;
  std::vector<double> params_;
  double max_theta_ = 0;   // largest valid angle from the axis, rad
  double max_radius_ = 0;  // its tangent
};

}  // namespace trigpoint

#include "calib/camera/camera.h"

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

#include "calib/base/error.h"
#include "calib/camera/projection.h"
#include "calib/geometry/bearing.h"

namespace trigpoint {
namespace {

constexpr double kPi = std::numbers::pi;

// Distortion of normalised image coordinates (Brown-Conrady, rational) with its 2 x 2 Jacobian.
Eigen::Vector2d Distort(const std::vector<double>& p, const Eigen::Vector2d& x, Eigen::Matrix2d* jacobian) {
  const auto k = [&](size_t i) { return i < p.size() ? p[i] : 0.0; };
  const double k1 = k(4), k2 = k(5), p1 = k(6), p2 = k(7), k3 = k(8), k4 = k(9), k5 = k(10), k6 = k(11);
  const double r2 = x.squaredNorm();
  const double num = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double den = 1 + r2 * (k4 + r2 * (k5 + r2 * k6));
  const double radial = num / den;
  const double u = x.x(), v = x.y();
  const Eigen::Vector2d out(u * radial + 2 * p1 * u * v + p2 * (r2 + 2 * u * u),
                            v * radial + p1 * (r2 + 2 * v * v) + 2 * p2 * u * v);
  if (jacobian != nullptr) {
    const double dnum = k1 + r2 * (2 * k2 + 3 * r2 * k3);
    const double dden = k4 + r2 * (2 * k5 + 3 * r2 * k6);
    const double dradial = (dnum * den - num * dden) / (den * den);  // d radial / d r2
    (*jacobian)(0, 0) = radial + 2 * u * u * dradial + 2 * p1 * v + 6 * p2 * u;
    (*jacobian)(0, 1) = 2 * u * v * dradial + 2 * p1 * u + 2 * p2 * v;
    (*jacobian)(1, 0) = 2 * u * v * dradial + 2 * p1 * u + 2 * p2 * v;
    (*jacobian)(1, 1) = radial + 2 * v * v * dradial + 6 * p1 * v + 2 * p2 * u;
  }
  return out;
}

// d pixel / d coefficients of Distort at `x`: the columns from 4 on.
void DistortByParams(const std::vector<double>& p, const Eigen::Vector2d& x,
                     Eigen::Matrix<double, 2, Eigen::Dynamic>* by_params) {
  const double r2 = x.squaredNorm(), u = x.x(), v = x.y();
  const auto k = [&](size_t i) { return i < p.size() ? p[i] : 0.0; };
  const double num = 1 + r2 * (k(4) + r2 * (k(5) + r2 * k(8)));
  const double den = 1 + r2 * (k(9) + r2 * (k(10) + r2 * k(11)));
  const double r4 = r2 * r2, r6 = r4 * r2;
  for (size_t i = 4; i < p.size(); ++i) {
    Eigen::Vector2d d;
    switch (i) {
      case 4: d << u * r2 / den, v * r2 / den; break;
      case 5: d << u * r4 / den, v * r4 / den; break;
      case 6: d << 2 * u * v, r2 + 2 * v * v; break;
      case 7: d << r2 + 2 * u * u, 2 * u * v; break;
      case 8: d << u * r6 / den, v * r6 / den; break;
      default: {
        const double power = i == 9 ? r2 : i == 10 ? r4 : r6;
        d << -u * num * power / (den * den), -v * num * power / (den * den);
      }
    }
    by_params->col(static_cast<Eigen::Index>(i)) << p[0] * d.x(), p[1] * d.y();
  }
}

double KannalaBrandt(const std::vector<double>& p, double theta, double* derivative) {
  const double t2 = theta * theta;
  const double poly = 1 + t2 * (p[4] + t2 * (p[5] + t2 * (p[6] + t2 * p[7])));
  if (derivative != nullptr) *derivative = 1 + t2 * (3 * p[4] + t2 * (5 * p[5] + t2 * (7 * p[6] + t2 * 9 * p[7])));
  return theta * poly;
}

// The angle up to which the radial mapping grows: beyond it projections fold back.
double MaxTheta(CameraModel model, const std::vector<double>& p) {
  if (model == CameraModel::kEquirectangular) return kPi;
  if (model == CameraModel::kPinhole) return 0.5 * kPi - 1e-3;
  if (model == CameraModel::kKannalaBrandt) {
    double derivative = 1;
    for (double theta = 0.01; theta < kPi; theta += 0.01) {
      KannalaBrandt(p, theta, &derivative);
      if (derivative <= 0) return theta - 0.01;
    }
    return kPi - 1e-6;
  }
  for (double theta = 0.01; theta < 0.5 * kPi - 0.01; theta += 0.01) {
    const double r = std::tan(theta);
    std::vector<double> radial_only = p;
    radial_only[6] = radial_only[7] = 0;
    Eigen::Matrix2d jacobian;
    Distort(radial_only, {r, 0}, &jacobian);
    if (jacobian(0, 0) <= 0) return theta - 0.01;
  }
  return 0.5 * kPi - 1e-3;
}

}  // namespace

std::string_view CameraModelName(CameraModel model) {
  switch (model) {
    case CameraModel::kPinhole: return "pinhole";
    case CameraModel::kRadtan: return "radtan";
    case CameraModel::kRational: return "rational";
    case CameraModel::kKannalaBrandt: return "kannala_brandt";
    case CameraModel::kEquirectangular: return "equirectangular";
  }
  return "unknown";
}

std::vector<std::string> CameraParameterNames(CameraModel model, size_t count) {
  std::vector<std::string> names = {"fx", "fy", "cx", "cy"};
  switch (model) {
    case CameraModel::kEquirectangular: return {};
    case CameraModel::kPinhole: break;
    case CameraModel::kRadtan:
    case CameraModel::kRational: names.insert(names.end(), {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}); break;
    case CameraModel::kKannalaBrandt: names.insert(names.end(), {"k1", "k2", "k3", "k4"}); break;
  }
  names.resize(std::min(names.size(), count));
  return names;
}

bool ProjectByParams(CameraModel model, const std::vector<double>& p, const Eigen::Vector3d& point,
                     Eigen::Vector2d* pixel, Eigen::Matrix<double, 2, 3>* by_point,
                     Eigen::Matrix<double, 2, Eigen::Dynamic>* by_params) {
  const double x = point.x(), y = point.y(), z = point.z();
  const Eigen::Vector2d f(p[0], p[1]), c(p[2], p[3]);
  Eigen::Vector2d d;  // distorted, normalised
  if (model == CameraModel::kKannalaBrandt) {
    const double r = std::hypot(x, y), theta = std::atan2(r, z);
    if (r < 1e-12 && z <= 0) return false;
    double derivative = 1;
    const double theta_d = KannalaBrandt(p, theta, &derivative);
    const bool on_axis = r <= 1e-9 * std::abs(z);
    const double s = on_axis ? 1.0 / z : theta_d / r;
    d = s * point.head<2>();
    if (by_point != nullptr) {
      const double n2 = r * r + z * z;
      const Eigen::Vector3d dtheta =
          r > 1e-12 ? Eigen::Vector3d(x * z / (r * n2), y * z / (r * n2), -r / n2) : Eigen::Vector3d(0, 0, 0);
      const Eigen::Vector3d dr = r > 1e-12 ? Eigen::Vector3d(x / r, y / r, 0) : Eigen::Vector3d(0, 0, 0);
      const Eigen::Vector3d ds =
          on_axis ? Eigen::Vector3d(0, 0, -1.0 / (z * z)) : Eigen::Vector3d((derivative * dtheta - s * dr) / r);
      by_point->row(0) = f.x() * (x * ds + s * Eigen::Vector3d::UnitX()).transpose();
      by_point->row(1) = f.y() * (y * ds + s * Eigen::Vector3d::UnitY()).transpose();
    }
    if (by_params != nullptr) {
      by_params->setZero(2, static_cast<Eigen::Index>(p.size()));
      double power = on_axis ? 0 : theta / r;
      for (Eigen::Index i = 4; i < 8; ++i) {
        power *= theta * theta;
        by_params->col(i) << f.x() * (power * x), f.y() * (power * y);
      }
    }
  } else {
    if (z <= 1e-9) return false;
    const Eigen::Vector2d n(x / z, y / z);
    const bool distorts = model != CameraModel::kPinhole;
    Eigen::Matrix2d dd = Eigen::Matrix2d::Identity();
    d = distorts ? Distort(p, n, by_point != nullptr ? &dd : nullptr) : n;
    if (by_point != nullptr) {
      Eigen::Matrix<double, 2, 3> dn;
      dn << 1 / z, 0, -n.x() / z, 0, 1 / z, -n.y() / z;
      *by_point = f.asDiagonal() * dd * dn;
    }
    if (by_params != nullptr) {
      by_params->setZero(2, static_cast<Eigen::Index>(p.size()));
      if (distorts) DistortByParams(p, n, by_params);
    }
  }
  *pixel = f.cwiseProduct(d) + c;
  if (by_params != nullptr) {
    (*by_params)(0, 0) = d.x();
    (*by_params)(1, 1) = d.y();
    (*by_params)(0, 2) = (*by_params)(1, 3) = 1;
  }
  return true;
}

Camera::Camera(CameraModel model, int width, int height, std::vector<double> params)
    : model_(model), width_(width), height_(height), params_(std::move(params)) {
  const auto fail = [&](const std::string& what) {
    throw InputError("camera (" + std::string(CameraModelName(model_)) + "): " + what);
  };
  if (width_ <= 0 || height_ <= 0) fail("image size must be positive");
  size_t least = 4, most = 4;
  switch (model_) {
    case CameraModel::kPinhole: break;
    case CameraModel::kRadtan: least = 8, most = 9; break;
    case CameraModel::kRational: least = most = 12; break;
    case CameraModel::kKannalaBrandt: least = most = 8; break;
    case CameraModel::kEquirectangular: least = most = 0; break;
  }
  if (params_.size() < least || params_.size() > most) {
    fail("expected " + std::to_string(least) + " parameters, found " + std::to_string(params_.size()));
  }
  for (double p : params_) {
    if (!std::isfinite(p)) fail("a parameter is not a finite number");
    if (std::abs(p) > 1e9) fail("expected parameters up to 1e9, found one beyond");
  }
  if (least > 0 && (params_[0] <= 0 || params_[1] <= 0)) fail("focal lengths must be positive");
  max_theta_ = MaxTheta(model_, params_);
  max_radius_ = std::tan(max_theta_);
}

Camera Camera::FromFieldOfView(int width, int height, double hfov_rad) {
  const double f = 0.5 * width / std::tan(0.5 * hfov_rad);
  return {CameraModel::kPinhole, width, height, {f, f, 0.5 * (width - 1), 0.5 * (height - 1)}};
}

Camera Camera::Equirectangular(int width, int height) { return {CameraModel::kEquirectangular, width, height, {}}; }

double Camera::MeanFocal() const {
  if (model_ == CameraModel::kEquirectangular) return width_ / (2 * kPi);
  return 0.5 * (params_[0] + params_[1]);
}

std::optional<Eigen::Vector3d> Camera::Unproject(const Eigen::Vector2d& pixel) const {
  if (!pixel.allFinite()) return std::nullopt;
  if (model_ == CameraModel::kEquirectangular) {
    const double lon = ((pixel.x() + 0.5) / width_ - 0.5) * 2 * kPi;
    const double lat = (0.5 - (pixel.y() + 0.5) / height_) * kPi;
    return Eigen::Vector3d(std::cos(lat) * std::sin(lon), -std::sin(lat), std::cos(lat) * std::cos(lon));
  }
  const Eigen::Vector2d m((pixel.x() - params_[2]) / params_[0], (pixel.y() - params_[3]) / params_[1]);
  if (model_ == CameraModel::kPinhole) return Eigen::Vector3d(m.x(), m.y(), 1).normalized();
  if (model_ == CameraModel::kKannalaBrandt) {
    const double theta_d = m.norm();
    if (theta_d < 1e-12) return Eigen::Vector3d::UnitZ();
    double theta = std::min(theta_d, max_theta_);
    for (int i = 0; i < 50; ++i) {
      double derivative = 1;
      const double error = KannalaBrandt(params_, theta, &derivative) - theta_d;
      const double step = error / std::max(derivative, 1e-3);
      theta = std::clamp(theta - step, 0.0, max_theta_);
      if (std::abs(step) < 1e-14) break;
    }
    if (std::abs(KannalaBrandt(params_, theta, nullptr) - theta_d) > 1e-9) return std::nullopt;
    const double s = std::sin(theta) / theta_d;
    return Eigen::Vector3d(m.x() * s, m.y() * s, std::cos(theta));
  }
  // Newton with the exact Jacobian; converges from the distorted point inside the valid radius.
  Eigen::Vector2d x = m;
  if (x.norm() > max_radius_) x *= max_radius_ / x.norm();
  for (int i = 0; i < 50; ++i) {
    Eigen::Matrix2d jacobian;
    const Eigen::Vector2d error = Distort(params_, x, &jacobian) - m;
    if (std::abs(jacobian.determinant()) < 1e-9) return std::nullopt;
    const Eigen::Vector2d step = jacobian.inverse() * error;
    x -= step;
    if (step.squaredNorm() < 1e-28) break;
  }
  if (!x.allFinite() || x.norm() > max_radius_ * 1.0001) return std::nullopt;
  if ((Distort(params_, x, nullptr) - m).norm() > 1e-9) return std::nullopt;
  return Eigen::Vector3d(x.x(), x.y(), 1).normalized();
}

std::optional<Eigen::Vector2d> Camera::Project(const Eigen::Vector3d& point,
                                               Eigen::Matrix<double, 2, 3>* jacobian) const {
  if (!point.allFinite()) return std::nullopt;
  const double x = point.x(), y = point.y(), z = point.z();
  if (model_ == CameraModel::kEquirectangular) {
    const double rho2 = x * x + z * z, rho = std::sqrt(rho2), n2 = rho2 + y * y;
    if (n2 < 1e-24) return std::nullopt;
    const double lon = std::atan2(x, z), lat = std::atan2(-y, rho);
    if (jacobian != nullptr) {
      const double su = width_ / (2 * kPi), sv = -height_ / kPi;
      const double r = std::max(rho, 1e-12);
      jacobian->row(0) << su * z / (r * r), 0, -su * x / (r * r);
      jacobian->row(1) << sv * y * x / (r * n2), -sv * r / n2, sv * y * z / (r * n2);
    }
    return Eigen::Vector2d((lon / (2 * kPi) + 0.5) * width_ - 0.5, (0.5 - lat / kPi) * height_ - 0.5);
  }
  if (model_ == CameraModel::kKannalaBrandt) {
    const double r = std::hypot(x, y);
    if (std::atan2(r, z) > max_theta_ || (r < 1e-12 && z <= 0)) return std::nullopt;
  } else if (z <= 1e-9 || x * x + y * y > z * z * max_radius_ * max_radius_) {
    return std::nullopt;
  }
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  if (!ProjectByParams(model_, params_, point, &pixel, jacobian)) return std::nullopt;
  return pixel;
}

Eigen::Matrix<double, 2, 3> Camera::BearingSqrtInfo(const Eigen::Vector2d& pixel, double sigma_px) const {
  const std::optional<Eigen::Vector3d> ray = Unproject(pixel);
  Eigen::Matrix<double, 2, 3> jacobian;
  if (!ray || !Project(*ray, &jacobian)) throw NumericError("no ray for this pixel");
  // d pixel / d ray restricted to the tangent plane whitens pixel noise; J * ray = 0 for central models.
  const Eigen::Matrix<double, 2, 3> basis = TangentBasis(*ray);
  return (jacobian * basis.transpose()) * basis / sigma_px;
}

Camera Camera::Scaled(double factor) const {
  Camera c = *this;
  c.width_ = std::max(1, static_cast<int>(std::lround(width_ * factor)));
  c.height_ = std::max(1, static_cast<int>(std::lround(height_ * factor)));
  if (c.params_.size() >= 4) {
    const double sx = static_cast<double>(c.width_) / width_, sy = static_cast<double>(c.height_) / height_;
    c.params_[0] *= sx;
    c.params_[1] *= sy;
    c.params_[2] = (c.params_[2] + 0.5) * sx - 0.5;
    c.params_[3] = (c.params_[3] + 0.5) * sy - 0.5;
  }
  return c;
}

}  // namespace trigpoint

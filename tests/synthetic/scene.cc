#include "tests/synthetic/scene.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "calib/base/error.h"
#include "calib/base/parallel.h"

namespace trigpoint {
namespace {

// A plane prepared for rays d that share one origin. From origin + x d = corner + s right + t down, with
// n = right x down and offset = origin - corner, by Cramer's rule:
//   x = -(offset . n) / (d . n),  s = d . (offset x down) / (d . n),  t = d . (right x offset) / (d . n).
struct PreparedPlane {
  Eigen::Vector3f normal;  // n, not unit
  Eigen::Vector3f s_vector, t_vector;
  float n_offset;
  float inv_normal_norm;
  float shade;
  float texels_per_m_s, texels_per_m_t;
  Eigen::Vector3f to_centre;  // unit, to the middle of the plane
  float angular_radius;       // of the sphere around it, rad; pi where the origin is within
};

PreparedPlane Prepare(const TexturedPlane& plane, const Eigen::Vector3d& origin, const Scene& scene) {
  const Eigen::Vector3d n = plane.right.cross(plane.down), offset = origin - plane.corner;
  PreparedPlane p;
  p.normal = n.cast<float>();
  p.inv_normal_norm = static_cast<float>(1 / n.norm());
  p.n_offset = static_cast<float>(-offset.dot(n));
  p.s_vector = offset.cross(plane.down).cast<float>();
  p.t_vector = plane.right.cross(offset).cast<float>();
  const double lambert = std::abs(scene.sun.normalized().dot(n.normalized()));
  p.shade = static_cast<float>(scene.ambient + (1 - scene.ambient) * lambert);
  p.texels_per_m_s = static_cast<float>(plane.texture->width() / plane.right.norm());
  p.texels_per_m_t = static_cast<float>(plane.texture->height() / plane.down.norm());
  const Eigen::Vector3d centre = 0.5 * (plane.right + plane.down) - offset;
  const double radius = 0.5 * std::max((plane.right + plane.down).norm(), (plane.right - plane.down).norm());
  p.to_centre = centre.normalized().cast<float>();
  p.angular_radius = static_cast<float>(centre.norm() > radius ? std::asin(radius / centre.norm()) : M_PI);
  return p;
}

// Of the planes listed in `candidates`, the first one hit by the ray d, or -1.
int Nearest(const std::vector<PreparedPlane>& planes, const std::vector<int>& candidates, const Eigen::Vector3f& d,
            float* distance, float* s, float* t) {
  int best = -1;
  *distance = std::numeric_limits<float>::max();
  for (const int i : candidates) {
    const PreparedPlane& p = planes[i];
    const float dn = d.dot(p.normal);
    if (std::abs(dn) < 1e-12F) continue;
    const float inv = 1 / dn, x = p.n_offset * inv;
    if (!(x > 1e-4F && x < *distance)) continue;
    const float ss = d.dot(p.s_vector) * inv;
    if (!(ss >= 0 && ss <= 1)) continue;
    const float tt = d.dot(p.t_vector) * inv;
    if (!(tt >= 0 && tt <= 1)) continue;
    *distance = x, *s = ss, *t = tt, best = i;
  }
  return best;
}

std::vector<int> AllOf(const std::vector<PreparedPlane>& planes) {
  std::vector<int> all(planes.size());
  for (size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
  return all;
}

// The planes that any of `count` neighbouring rays may hit: those that reach into the cone around them.
void Candidates(const std::vector<PreparedPlane>& planes, const Eigen::Vector3f* rays, int count,
                std::vector<int>* candidates) {
  candidates->clear();
  const Eigen::Vector3f axis = rays[count / 2];
  float least = 1;
  bool complete = true;
  for (int i = 0; i < count; ++i) {
    least = std::min(least, axis.dot(rays[i]));
    complete = complete && !rays[i].isZero();
  }
  const float cone = complete ? std::acos(std::clamp(least, -1.0F, 1.0F)) + 1e-3F : static_cast<float>(M_PI);
  for (size_t i = 0; i < planes.size(); ++i) {
    const float reach = cone + planes[i].angular_radius;
    if (reach >= static_cast<float>(M_PI) || axis.dot(planes[i].to_centre) >= std::cos(reach)) {
      candidates->push_back(static_cast<int>(i));
    }
  }
}

std::vector<PreparedPlane> PrepareAll(const Scene& scene, const Eigen::Vector3d& origin) {
  std::vector<PreparedPlane> planes;
  for (const TexturedPlane& plane : scene.planes) planes.push_back(Prepare(plane, origin, scene));
  return planes;
}

cv::Vec3f Bilinear(const cv::Mat& image, float u, float v) {
  u = std::clamp(u, 0.0F, static_cast<float>(image.cols - 1));
  v = std::clamp(v, 0.0F, static_cast<float>(image.rows - 1));
  const int x = std::min(static_cast<int>(u), std::max(0, image.cols - 2));
  const int y = std::min(static_cast<int>(v), std::max(0, image.rows - 2));
  const int dx = image.cols > 1 ? 3 : 0;
  const float fx = u - static_cast<float>(x), fy = v - static_cast<float>(y);
  const uchar* a = image.ptr<uchar>(y) + 3 * x;
  const uchar* b = image.rows > 1 ? image.ptr<uchar>(y + 1) + 3 * x : a;
  cv::Vec3f out;
  for (int c = 0; c < 3; ++c) {
    const float top = static_cast<float>(a[c]) + fx * static_cast<float>(a[c + dx] - a[c]);
    const float low = static_cast<float>(b[c]) + fx * static_cast<float>(b[c + dx] - b[c]);
    out[c] = top + fy * (low - top);
  }
  return out;
}

}  // namespace

Texture::Texture(const cv::Mat& bgr) {
  if (bgr.empty() || bgr.type() != CV_8UC3) throw InputError("texture: expected an 8-bit BGR picture");
  levels_.push_back(bgr.clone());
  while (levels_.back().cols > 1 || levels_.back().rows > 1) {
    cv::Mat half;
    cv::resize(levels_.back(), half,
               {std::max(1, (levels_.back().cols + 1) / 2), std::max(1, (levels_.back().rows + 1) / 2)}, 0, 0,
               cv::INTER_AREA);
    levels_.push_back(half);
  }
}

cv::Vec3f Texture::Sample(float u, float v, float footprint) const {
  const float level = std::clamp(std::log2(std::max(footprint, 1.0F)), 0.0F, static_cast<float>(levels_.size() - 1));
  const size_t low = std::min(static_cast<size_t>(level), levels_.size() - 1);
  const auto at = [&](size_t l) {
    const cv::Mat& image = levels_[l];
    const float su = static_cast<float>(image.cols) / static_cast<float>(width());
    const float sv = static_cast<float>(image.rows) / static_cast<float>(height());
    return Bilinear(image, (u + 0.5F) * su - 0.5F, (v + 0.5F) * sv - 0.5F);
  };
  const float blend = level - static_cast<float>(low);
  const cv::Vec3f fine = at(low);
  if (blend < 1e-3F || low + 1 >= levels_.size()) return fine;
  return fine + blend * (at(low + 1) - fine);
}

int FirstHit(const Scene& scene, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double* distance) {
  float d = 0, s = 0, t = 0;
  const std::vector<PreparedPlane> planes = PrepareAll(scene, origin);
  const int hit = Nearest(planes, AllOf(planes), direction.cast<float>(), &d, &s, &t);
  if (distance != nullptr) *distance = d;
  return hit;
}

cv::Mat Render(const Scene& scene, const Camera& camera, const Rigid3d& world_from_cam, const RenderOptions& options) {
  if (options.supersample < 1) throw OptionError("option supersample is below 1");
  const int n = options.supersample;
  const std::vector<PreparedPlane> planes = PrepareAll(scene, world_from_cam.translation);
  const Eigen::Matrix3d rotation = world_from_cam.rotation.toRotationMatrix();
  cv::Mat image(camera.height(), camera.width(), CV_8UC3, cv::Scalar(0, 0, 0));
  const int wide = camera.width() * n;

  const auto row = [&](int64_t y) {
    std::vector<cv::Vec3f> sum(static_cast<size_t>(camera.width()), cv::Vec3f(0, 0, 0));
    std::vector<Eigen::Vector3f> rays(static_cast<size_t>(wide));
    std::vector<int> candidates;
    constexpr int kSegment = 64;
    for (int sub = 0; sub < n; ++sub) {
      const double v = static_cast<double>(y) + (sub + 0.5) / n - 0.5;
      for (int x = 0; x < wide; ++x) {
        const std::optional<Eigen::Vector3d> ray = camera.Unproject({(x + 0.5) / n - 0.5, v});
        rays[x] = ray ? Eigen::Vector3f((rotation * *ray).cast<float>()) : Eigen::Vector3f::Zero();
      }
      for (int x = 0; x < wide; ++x) {
        if (x % kSegment == 0) Candidates(planes, &rays[x], std::min(kSegment, wide - x), &candidates);
        const Eigen::Vector3f& d = rays[x];
        if (d.isZero()) continue;
        float distance = 0, s = 0, t = 0;
        const int hit = Nearest(planes, candidates, d, &distance, &s, &t);
        cv::Vec3f colour;
        if (hit < 0) {
          const float up = std::clamp(d.z(), 0.0F, 1.0F);
          colour = scene.sky_low + up * (scene.sky_high - scene.sky_low);
        } else {
          const PreparedPlane& p = planes[hit];
          const Texture& texture = *scene.planes[hit].texture;
          // The ray's footprint is an ellipse stretched by the slant; its geometric mean picks the mipmap.
          const Eigen::Vector3f& next = rays[x + 1 < wide ? x + 1 : x - 1];
          const float angle = next.isZero() ? 0 : (next - d).norm();
          const float slant = std::max(0.05F, std::abs(d.dot(p.normal)) * p.inv_normal_norm);
          const float footprint = distance * angle * std::sqrt(p.texels_per_m_s * p.texels_per_m_t) / std::sqrt(slant);
          colour = p.shade * texture.Sample(s * static_cast<float>(texture.width()) - 0.5F,
                                            t * static_cast<float>(texture.height()) - 0.5F, footprint);
        }
        sum[x / n] += colour;
      }
    }
    const float scale = static_cast<float>(options.gain / (n * n));
    cv::Vec3b* out = image.ptr<cv::Vec3b>(static_cast<int>(y));
    for (int x = 0; x < camera.width(); ++x) out[x] = scale * sum[x];
  };
  ParallelFor(camera.height(), options.threads, CancelToken(), row);

  if (options.blur_sigma_px > 0) cv::GaussianBlur(image, image, {}, options.blur_sigma_px);
  if (options.noise_sigma > 0) {
    cv::RNG rng(options.seed * 2 + 1);
    cv::Mat noise(image.size(), CV_16SC3), noisy;
    rng.fill(noise, cv::RNG::NORMAL, 0.0, options.noise_sigma);
    cv::add(image, noise, noisy, cv::noArray(), CV_8U);
    image = noisy;
  }
  return image;
}

}  // namespace trigpoint

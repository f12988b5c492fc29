#include "eval/depth.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <numeric>

#include "calib/base/error.h"
#include "calib/geo/geodetic.h"
#include "datasets/io/text.h"
#include "eval/statistics.h"

namespace trigpoint {
namespace {

static_assert(std::endian::native == std::endian::little, "COLMAP's files are little-endian");

class Bytes {
 public:
  explicit Bytes(const std::filesystem::path& file) : file_(file), data_(ReadTextFile(file)) {}
  template <typename T>
  T Get() {
    T value;
    if (data_.size() - at_ < sizeof(T)) Fail();
    std::memcpy(&value, data_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }
  void Skip(uint64_t bytes) {
    if (data_.size() - at_ < bytes) Fail();
    at_ += bytes;
  }
  void SkipText() {
    while (Get<char>() != 0) {
    }
  }

 private:
  [[noreturn]] void Fail() const {
    throw InputError(file_.string() + ": expected a complete COLMAP binary file, found its end; localize again");
  }
  std::filesystem::path file_;
  std::string data_;
  size_t at_ = 0;
};

}  // namespace

std::vector<StructurePoint> ReadStructure(const std::filesystem::path& sparse_dir) {
  std::vector<StructurePoint> points;
  if (!std::filesystem::exists(sparse_dir / "points3D.bin")) return points;
  std::map<uint32_t, Eigen::Vector3d> centres;
  Bytes images(sparse_dir / "images.bin");
  for (auto n = images.Get<uint64_t>(); n > 0; --n) {
    const auto id = images.Get<uint32_t>();
    double v[7];
    for (double& x : v) x = images.Get<double>();
    images.Skip(sizeof(uint32_t));
    images.SkipText();
    const auto pixels = images.Get<uint64_t>();
    if (pixels > (uint64_t{1} << 40)) images.Skip(~uint64_t{0});
    images.Skip(pixels * 24);
    const Eigen::Quaterniond q = Eigen::Quaterniond(v[0], v[1], v[2], v[3]).normalized();
    centres[id] = -(q.conjugate() * Eigen::Vector3d(v[4], v[5], v[6]));
  }
  Bytes file(sparse_dir / "points3D.bin");
  for (auto n = file.Get<uint64_t>(); n > 0; --n) {
    file.Skip(8);
    StructurePoint point;
    for (int i = 0; i < 3; ++i) point.position[i] = file.Get<double>();
    file.Skip(3 + 8);
    std::vector<Eigen::Vector3d> rays;
    for (auto length = file.Get<uint64_t>(); length > 0; --length) {
      const auto centre = centres.find(file.Get<uint32_t>());
      file.Skip(4);
      if (centre != centres.end()) rays.push_back((point.position - centre->second).normalized());
    }
    // Cameras move along a path: the widest angle has the first or the last one at an end.
    double least = 1;
    for (const Eigen::Vector3d& ray : rays) least = std::min({least, ray.dot(rays.front()), ray.dot(rays.back())});
    point.parallax_rad = std::acos(std::clamp(least, -1.0, 1.0));
    if (rays.size() >= 2) points.push_back(point);
  }
  return points;
}

std::optional<DepthSupport> SupportAt(const std::vector<StructurePoint>& points, const Eigen::Vector3d& odom_position,
                                      double radius_m, double ray_sigma_rad) {
  std::vector<double> distance, parallax, sigma;
  for (const StructurePoint& p : points) {
    const double d = (p.position - odom_position).norm();
    if (d > radius_m) continue;
    distance.push_back(d);
    parallax.push_back(p.parallax_rad);
    sigma.push_back(d / std::max(1e-4, p.parallax_rad) * ray_sigma_rad);
  }
  if (distance.size() < 10) return std::nullopt;
  return DepthSupport{Quantile(distance, 0.5), kRadToDeg * Quantile(parallax, 0.5), Quantile(sigma, 0.5)};
}

std::vector<RiskPoint> CoverageRisk(const std::vector<double>& order, const std::vector<double>& errors) {
  std::vector<size_t> index(order.size());
  std::iota(index.begin(), index.end(), size_t{0});
  std::stable_sort(index.begin(), index.end(), [&](size_t a, size_t b) { return order[a] < order[b]; });
  std::vector<RiskPoint> curve;
  std::vector<double> kept;
  for (const size_t i : index) {
    kept.push_back(errors[i]);
    curve.push_back({static_cast<double>(kept.size()) / static_cast<double>(order.size()), order[i],
                     Quantile(kept, 0.5), Quantile(kept, 0.9), *std::max_element(kept.begin(), kept.end())});
  }
  return curve;
}

}  // namespace trigpoint

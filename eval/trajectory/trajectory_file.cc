#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "calib/base/error.h"
#include "datasets/io/lines.h"
#include "datasets/io/pose_rows.h"
#include "datasets/io/text.h"
#include "eval/statistics/statistics.h"
#include "eval/trajectory/trajectory.h"

namespace trigpoint {
namespace {

template <size_t kCount>
std::array<double, kCount> Numbers(const std::vector<std::string_view>& fields, size_t begin,
                                   const std::string& where) {
  std::array<double, kCount> numbers{};
  for (size_t i = 0; i < kCount; ++i) {
    const std::optional<double> value = ParseDouble(fields[begin + i]);
    if (!value || !std::isfinite(*value)) {
      throw InputError(fmt::format("{}: field {} is '{}', expected a number", where, begin + i + 1, fields[begin + i]));
    }
    numbers[i] = *value;
  }
  return numbers;
}

MatrixPose KittiPose(const std::array<double, 12>& v, const std::string& where) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> m(v.data());
  MatrixPose pose;
  pose.rotation = m.leftCols<3>();
  pose.translation = m.col(3);
  if (!(pose.rotation.transpose() * pose.rotation).isIdentity(1e-3) || pose.rotation.determinant() < 0) {
    throw InputError(where + ": expected a 3 x 4 pose matrix, row by row; the first three columns are no rotation");
  }
  return pose;
}

MatrixPose QuaternionPose(const std::array<double, 7>& v, bool w_first, const std::string& where) {
  const Eigen::Quaterniond q =
      w_first ? Eigen::Quaterniond(v[3], v[4], v[5], v[6]) : Eigen::Quaterniond(v[6], v[3], v[4], v[5]);
  if (std::abs(q.norm() - 1) > 1e-2) {
    throw InputError(fmt::format("{}: expected a unit quaternion, found one of norm {:.6f}", where, q.norm()));
  }
  return Rigid3d(q, {v[0], v[1], v[2]});
}

// Stable: poses of the same time stay in the file's order.
void SortByTime(const std::string& file, PoseSequence* sequence) {
  std::vector<size_t> order(sequence->poses.size());
  std::iota(order.begin(), order.end(), size_t{0});
  const std::vector<int64_t> stamps = sequence->stamps_ns;
  if (!std::is_sorted(stamps.begin(), stamps.end())) {
    sequence->warnings.push_back(file + ": timestamps are out of order; the poses were sorted by time");
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return stamps[a] < stamps[b]; });
    const std::vector<MatrixPose> poses = sequence->poses;
    for (size_t i = 0; i < order.size(); ++i) {
      sequence->stamps_ns[i] = stamps[order[i]];
      sequence->poses[i] = poses[order[i]];
    }
  }
  int doubled = 0;
  for (size_t i = 1; i < stamps.size(); ++i) doubled += sequence->stamps_ns[i] == sequence->stamps_ns[i - 1];
  if (doubled > 0)
    sequence->warnings.push_back(fmt::format("{}: {} timestamps stand twice; all are used", file, doubled));
}

}  // namespace

PoseSequence ReadPoseSequence(const std::filesystem::path& file) {
  const std::string text = ReadTextFile(file);
  PoseSequence sequence;
  const PoseRows rows = HasKittiRows(text) ? PoseRows{DataLines(text), false} : FindPoseRows(file, text);
  size_t columns = 0;
  for (const auto& [line, number] : rows.lines) {
    const std::string where = FileLine(file, number);
    const bool csv = line.find(',') != std::string_view::npos;
    const std::vector<std::string_view> fields = PoseFields(line);
    if (sequence.poses.empty()) columns = fields.size();
    if (fields.size() != columns || (csv ? columns < 8 : columns != 8 && columns != 12)) {
      throw InputError(fmt::format("{}: expected {}, found {} fields", where,
                                   sequence.poses.empty()
                                       ? "8 numbers (TUM), 12 numbers (KITTI) or at least 8 after commas (EuRoC)"
                                       : fmt::format("{} fields as in the lines before", columns),
                                   fields.size()));
    }
    if (columns == 12 && !csv) {
      sequence.poses.push_back(KittiPose(Numbers<12>(fields, 0, where), where));
    } else {
      sequence.poses.push_back(QuaternionPose(Numbers<7>(fields, 1, where), rows.w_first, where));
      try {
        sequence.stamps_ns.push_back(ParseSecondsToNs(fields[0]));
      } catch (const InputError& e) {
        throw InputError(where + ": " + e.what());
      }
    }
  }
  if (sequence.poses.empty()) throw InputError(file.string() + ": expected a trajectory, found no pose");
  if (sequence.HasTimes()) SortByTime(file.string(), &sequence);
  return sequence;
}

PoseSequence PoseSequenceFromGps(const std::vector<GpsFix>& fixes, const LocalFrame& frame) {
  if (fixes.empty()) throw InputError("the GPS track has no fix");
  PoseSequence sequence;
  sequence.positions_only = true;
  std::vector<double> h, v;
  for (const GpsFix& fix : fixes) {
    sequence.stamps_ns.push_back(fix.stamp_ns);
    sequence.poses.emplace_back(Rigid3d(Eigen::Quaterniond::Identity(), frame.EnuFromGeodetic(fix.position)));
    h.push_back(fix.sigma_h_m);
    v.push_back(fix.sigma_v_m);
  }
  sequence.sigma_h_m = Quantile(h, 0.5);
  sequence.sigma_v_m = Quantile(v, 0.5);
  return sequence;
}

}  // namespace trigpoint

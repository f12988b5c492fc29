#include "datasets/io/trajectory.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "datasets/io/lines.h"
#include "datasets/io/midnight.h"
#include "datasets/io/pose_rows.h"
#include "datasets/io/readable.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

constexpr int64_t kNsPerSecond = 1'000'000'000;

Rigid3d ParsePose(const std::vector<std::string_view>& fields, bool w_first) {
  double v[7];
  for (size_t i = 0; i < 7; ++i) {
    const std::optional<double> value = ParseDouble(fields[i + 1]);
    if (!value) throw InputError("expected a number, found '" + Excerpt(fields[i + 1]) + "'");
    if (!std::isfinite(*value)) throw InputError("the pose holds '" + Excerpt(fields[i + 1]) + "'");
    v[i] = *value;
  }
  const Eigen::Quaterniond q =
      w_first ? Eigen::Quaterniond(v[3], v[4], v[5], v[6]) : Eigen::Quaterniond(v[6], v[3], v[4], v[5]);
  if (std::abs(q.norm() - 1) > 1e-3) {
    throw InputError("expected a unit quaternion, found one of length " + std::to_string(q.norm()));
  }
  return {q, {v[0], v[1], v[2]}};
}

// Sorts, drops doubled stamps, and says so.
void PutInOrder(const std::filesystem::path& file, Trajectory* trajectory) {
  const auto earlier = [](const TimedPose& a, const TimedPose& b) { return a.stamp_ns < b.stamp_ns; };
  auto& poses = trajectory->poses;
  if (!std::is_sorted(poses.begin(), poses.end(), earlier)) {
    std::vector<int64_t> stamps;
    for (const TimedPose& pose : poses) stamps.push_back(pose.stamp_ns);
    RequireNoMidnight(file, stamps);
    std::stable_sort(poses.begin(), poses.end(), earlier);
    trajectory->warnings.push_back(file.string() + ": timestamps are out of order; the poses were sorted by time");
  }
  const auto same = [](const TimedPose& a, const TimedPose& b) { return a.stamp_ns == b.stamp_ns; };
  const auto doubled = std::unique(poses.begin(), poses.end(), same);
  if (doubled != poses.end()) {
    trajectory->warnings.push_back(file.string() + ": dropped " + Counted(poses.end() - doubled, "pose") +
                                   " with a timestamp seen before; the first of each is kept");
    poses.erase(doubled, poses.end());
  }
}

void WarnIfConstant(const std::filesystem::path& file, Trajectory* trajectory) {
  const auto& poses = trajectory->poses;
  if (poses.size() < 2) return;
  const auto still = [&](const TimedPose& pose) {
    return pose.target_from_body.Minus(poses.front().target_from_body).norm() < 1e-9;
  };
  if (std::all_of(poses.begin(), poses.end(), still)) {
    trajectory->warnings.push_back(file.string() + ": all " + std::to_string(poses.size()) +
                                   " poses are the same; expected a moving body");
  }
}

// Bad rows are named, but not all of a thousand.
class BadRows {
 public:
  explicit BadRows(const std::filesystem::path& file) : file_(file) {}
  void Add(int line, const std::string& what) {
    if (count_++ == 0) first_ = FileLine(file_, line) + ": " + what;
    if (count_ <= kNamed) named_.push_back(FileLine(file_, line) + ": " + what + "; the row is skipped");
  }
  void Finish(Trajectory* trajectory) const {
    if (trajectory->poses.empty()) {
      throw InputError(count_ > 0 ? first_ + "; no row of the file is usable"
                                  : file_.string() +
                                        ":1: the trajectory is empty; expected rows of 'timestamp tx ty "
                                        "tz qx qy qz qw'");
    }
    trajectory->warnings.insert(trajectory->warnings.end(), named_.begin(), named_.end());
    if (count_ > kNamed) {
      trajectory->warnings.push_back(file_.string() + ": " + "skipped " + Counted(count_ - kNamed, "more bad row"));
    }
  }

 private:
  static constexpr int kNamed = 5;
  std::filesystem::path file_;
  std::string first_;
  std::vector<std::string> named_;
  int count_ = 0;
};

}  // namespace

std::optional<Rigid3d> Trajectory::At(int64_t stamp_ns, int64_t max_gap_ns) const {
  const auto after = std::lower_bound(poses.begin(), poses.end(), stamp_ns,
                                      [](const TimedPose& pose, int64_t stamp) { return pose.stamp_ns < stamp; });
  if (after == poses.end()) return std::nullopt;
  if (after->stamp_ns == stamp_ns) return after->target_from_body;
  if (after == poses.begin()) return std::nullopt;
  const auto before = after - 1;
  if (after->stamp_ns - before->stamp_ns > max_gap_ns) return std::nullopt;
  const double s =
      static_cast<double>(stamp_ns - before->stamp_ns) / static_cast<double>(after->stamp_ns - before->stamp_ns);
  return Interpolate(before->target_from_body, after->target_from_body, s);
}

Trajectory ReadTrajectory(const std::filesystem::path& file) {
  const std::string text = ReadTextFile(file);
  const PoseRows rows = FindPoseRows(file, text);
  Trajectory trajectory;
  trajectory.poses.reserve(rows.lines.size());
  BadRows bad(file);
  for (const DataLine& line : rows.lines) {
    const std::vector<std::string_view> fields = PoseFields(line.text);
    const bool has_comma = line.text.find(',') != std::string_view::npos;
    // EuRoC rows go on with velocity and biases; a TUM row has eight fields and no more.
    if (fields.size() < 8 || (!has_comma && fields.size() > 8)) {
      bad.Add(line.number,
              "expected 8 numbers 'timestamp tx ty tz qx qy qz qw', found " + Counted(fields.size(), "field"));
      continue;
    }
    try {
      trajectory.poses.push_back({ParseSecondsToNs(fields[0]), ParsePose(fields, rows.w_first)});
    } catch (const InputError& e) {
      bad.Add(line.number, e.what());
    }
  }
  bad.Finish(&trajectory);
  PutInOrder(file, &trajectory);
  WarnIfConstant(file, &trajectory);
  return trajectory;
}

Trajectory ReadKittiTrajectory(const std::filesystem::path& file, const std::filesystem::path& times) {
  const std::string text = ReadTextFile(file), times_text = ReadTextFile(times);
  const std::vector<DataLine> rows = DataLines(text), stamps = DataLines(times_text);
  if (rows.size() != stamps.size()) {
    throw InputError(file.string() + ": " + std::to_string(rows.size()) + " poses, but " + times.string() + " has " +
                     std::to_string(stamps.size()) + " times; expected one time for each pose");
  }
  Trajectory trajectory;
  trajectory.poses.reserve(rows.size());
  BadRows bad(file);
  for (size_t i = 0; i < rows.size(); ++i) {
    const std::vector<std::string_view> fields = SplitFields(rows[i].text);
    Eigen::Matrix<double, 3, 4> m;
    bool good = fields.size() == 12;
    for (size_t k = 0; good && k < 12; ++k) {
      const std::optional<double> value = ParseDouble(fields[k]);
      good = value && std::isfinite(*value);
      if (good) m(static_cast<Eigen::Index>(k / 4), static_cast<Eigen::Index>(k % 4)) = *value;
    }
    if (!good) {
      bad.Add(rows[i].number, "expected 12 finite numbers, a 3 x 4 matrix row by row");
      continue;
    }
    const Eigen::Matrix3d r = m.leftCols<3>();
    if ((r.transpose() * r - Eigen::Matrix3d::Identity()).norm() > 1e-2 || r.determinant() < 0) {
      bad.Add(rows[i].number, "the matrix holds no rotation");
      continue;
    }
    try {
      trajectory.poses.push_back({ParseSecondsToNs(stamps[i].text), Rigid3d(Eigen::Quaterniond(r), m.col(3))});
    } catch (const InputError& e) {
      throw InputError(FileLine(times, stamps[i].number) + ": " + e.what());
    }
  }
  bad.Finish(&trajectory);
  PutInOrder(file, &trajectory);
  WarnIfConstant(file, &trajectory);
  return trajectory;
}

void WriteTum(const std::filesystem::path& file, const std::vector<TimedPose>& poses,
              const std::vector<std::string>& header) {
  std::string text;
  for (const std::string& line : header) text.append("# ").append(line).append("\n");
  for (const TimedPose& pose : poses) {
    const Eigen::Vector3d& t = pose.target_from_body.translation;
    const Eigen::Quaterniond& q = pose.target_from_body.rotation;
    char buffer[400];
    std::snprintf(buffer, sizeof(buffer), " %.9f %.9f %.9f %.12f %.12f %.12f %.12f\n", t.x(), t.y(), t.z(), q.x(),
                  q.y(), q.z(), q.w());
    text += FormatNsAsSeconds(pose.stamp_ns) + buffer;
  }
  WriteFileAtomically(file, text);
}

int64_t ParseSecondsToNs(std::string_view text) {
  const std::string_view whole = Trim(text);
  const auto fail = [&](const char* why) {
    throw InputError("expected a time in seconds (or whole nanoseconds), found '" + Excerpt(whole) + "'" + why);
  };
  // Digits, a point, an exponent: taken apart by hand, as a double holds a Unix time to 200 ns only.
  std::string_view rest = whole;
  const bool negative = rest.starts_with('-');
  if (negative || rest.starts_with('+')) rest.remove_prefix(1);
  std::string digits;
  int point = -1;
  size_t at = 0;
  for (; at < rest.size(); ++at) {
    if (rest[at] >= '0' && rest[at] <= '9') {
      digits += rest[at];
    } else if (rest[at] == '.' && point < 0) {
      point = static_cast<int>(digits.size());
    } else {
      break;
    }
  }
  if (digits.empty()) fail("");
  int64_t exponent = 0;
  const bool has_exponent = at < rest.size() && (rest[at] == 'e' || rest[at] == 'E');
  if (has_exponent) {
    const std::optional<int64_t> parsed = ParseInt(rest.substr(at + 1));
    if (!parsed || std::abs(*parsed) > 40) fail("");
    exponent = *parsed;
  } else if (at != rest.size()) {
    fail("");
  }
  // 15 digits and more without a point are nanoseconds: in seconds that would be 30 million years.
  const bool nanoseconds = point < 0 && !has_exponent && digits.size() >= 15;
  int64_t before_point = (point < 0 ? static_cast<int64_t>(digits.size()) : point) + exponent + (nanoseconds ? 0 : 9);
  int64_t value = 0;
  for (int64_t i = 0; i < before_point; ++i) {
    const int digit = i < static_cast<int64_t>(digits.size()) ? digits[static_cast<size_t>(i)] - '0' : 0;
    if (value > (INT64_MAX - 9) / 10) fail("; it does not fit 64 bits of nanoseconds");
    value = 10 * value + digit;
  }
  if (before_point >= 0 && before_point < static_cast<int64_t>(digits.size()) &&
      digits[static_cast<size_t>(before_point)] >= '5') {
    ++value;
  }
  return negative ? -value : value;
}

std::string FormatNsAsSeconds(int64_t ns, int decimals) {
  decimals = std::clamp(decimals, 0, 9);
  int64_t unit = 1;
  for (int i = decimals; i < 9; ++i) unit *= 10;
  const bool negative = ns < 0;
  const uint64_t magnitude = negative ? 0 - static_cast<uint64_t>(ns) : static_cast<uint64_t>(ns);
  const uint64_t rounded = (magnitude + static_cast<uint64_t>(unit) / 2) / static_cast<uint64_t>(unit);
  const uint64_t per_second = static_cast<uint64_t>(kNsPerSecond / unit);
  std::string text = std::to_string(rounded / per_second);
  if (negative && rounded > 0) text.insert(text.begin(), '-');
  if (decimals > 0) {
    const std::string fraction = std::to_string(rounded % per_second);
    text += '.' + std::string(static_cast<size_t>(decimals) - fraction.size(), '0') + fraction;
  }
  return text;
}

}  // namespace trigpoint

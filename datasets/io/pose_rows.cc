#include "datasets/io/pose_rows.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>

#include "calib/base/error.h"
#include "calib/geometry/rigid3.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

constexpr size_t kPose = 8;         // columns of a pose
constexpr size_t kEurocState = 17;  // of EuRoC's: pose, velocity, two biases

bool HasComma(const DataLine& line) { return line.text.find(',') != std::string_view::npos; }

// The axis that a column's name gives for a quaternion: qx, q_x, q_RS_x; 0 for any other name.
char QuaternionAxis(std::string_view name) {
  const auto other = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; };
  while (!name.empty() && other(name.back())) name.remove_suffix(1);
  while (!name.empty() && other(name.front())) name.remove_prefix(1);
  if (name.size() < 2 || name.front() != 'q') return 0;
  const bool separate = name.size() > 2 && (name[1] == '_' || name[1] == '.') && other(name[name.size() - 2]);
  if (name.size() > 2 && !separate) return 0;
  return std::string_view("xyzw").find(name.back()) != std::string_view::npos ? name.back() : '\0';
}

// Whether w comes first in a header that names all four columns of the quaternion; nothing for any other line.
std::optional<bool> OrderOfHeader(const std::string& where, std::string_view header) {
  std::string axes, words(header);
  for (char& c : words) c = c == ',' ? ' ' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const std::string_view name : SplitFields(words)) {
    if (const char axis = QuaternionAxis(name); axis != 0) axes += axis;
  }
  std::string sorted = axes;
  std::sort(sorted.begin(), sorted.end());
  if (sorted != "wxyz") return std::nullopt;
  if (axes == "xyzw" || axes == "wxyz") return axes.front() == 'w';
  throw InputError(where + ": the header names the quaternion's columns in the order " + axes +
                   "; expected x y z w (TUM) or w x y z (EuRoC)");
}

// Nothing for a row that holds no pose: the reader names it.
std::optional<Rigid3d> PoseOf(const std::vector<std::string_view>& fields, bool w_first) {
  constexpr double kUnit = 1e-2;
  double v[kPose - 1];
  if (fields.size() < kPose) return std::nullopt;
  for (size_t i = 0; i + 1 < kPose; ++i) {
    const std::optional<double> value = ParseDouble(fields[i + 1]);
    if (!value || !std::isfinite(*value)) return std::nullopt;
    v[i] = *value;
  }
  const Eigen::Quaterniond q =
      w_first ? Eigen::Quaterniond(v[3], v[4], v[5], v[6]) : Eigen::Quaterniond(v[6], v[3], v[4], v[5]);
  if (std::abs(q.norm() - 1) > kUnit) return std::nullopt;
  return Rigid3d(q, {v[0], v[1], v[2]});
}

// How well the body's direction of travel agrees over the trajectory, 0 to 1; nothing without enough motion.
std::optional<double> TravelAgreement(const std::vector<DataLine>& lines, bool w_first) {
  std::vector<Rigid3d> poses;
  for (const DataLine& line : lines) {
    if (const auto pose = PoseOf(PoseFields(line.text), w_first)) poses.push_back(*pose);
  }
  if (poses.empty()) return std::nullopt;
  double reach = 0;
  for (const Rigid3d& pose : poses) {
    reach = std::max(reach, (pose.translation - poses.front().translation).norm());
  }
  constexpr int kLeastSteps = 8;
  const double step = reach / 50;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int steps = 0;
  const Rigid3d* last = &poses.front();
  for (const Rigid3d& pose : poses) {
    const Eigen::Vector3d moved = pose.translation - last->translation;
    if (!(moved.norm() > step)) continue;
    sum += (last->rotation.conjugate() * moved).normalized();
    last = &pose;
    ++steps;
  }
  if (steps < kLeastSteps) return std::nullopt;
  return sum.norm() / steps;
}

// Of rows with commas and no header.
bool OrderOfRows(const std::filesystem::path& file, const std::vector<DataLine>& lines) {
  constexpr double kAgrees = 0.9, kApart = 0.2;
  const std::optional<double> tum = TravelAgreement(lines, false), euroc = TravelAgreement(lines, true);
  if (tum && euroc) {
    if (*tum > kAgrees && *euroc < *tum - kApart) return false;
    if (*euroc > kAgrees && *tum < *euroc - kApart) return true;
  }
  const auto is_state = [](const DataLine& line) { return PoseFields(line.text).size() == kEurocState; };
  if (std::all_of(lines.begin(), lines.end(), is_state)) return true;
  throw InputError(file.string() +
                   ": rows with commas and no header: the motion does not show whether the quaternion's w comes "
                   "first (EuRoC) or last (TUM); expected a header line such as 'timestamp,tx,ty,tz,qx,qy,qz,qw'");
}

// `0,5 1,25`: numbers written with a decimal comma.
bool HasDecimalCommas(const DataLine& line) {
  const std::vector<std::string_view> words = SplitFields(line.text);
  const auto decimal = [](std::string_view word) {
    const size_t comma = word.find(',');
    return comma != std::string_view::npos && comma > 0 && comma + 1 < word.size() &&
           word.find_first_not_of("+-0123456789,eE") == std::string_view::npos;
  };
  return words.size() > 1 && std::count_if(words.begin(), words.end(), decimal) > 1;
}

}  // namespace

std::vector<std::string_view> PoseFields(std::string_view row) {
  if (row.find(',') == std::string_view::npos) return SplitFields(row);
  std::vector<std::string_view> fields = SplitAt(row, ',');
  while (fields.back().empty() && fields.size() > 1) fields.pop_back();
  return fields;
}

PoseRows FindPoseRows(const std::filesystem::path& file, std::string_view text) {
  std::vector<std::string_view> comments;
  PoseRows rows{DataLines(text, &comments), false};
  std::optional<bool> w_first;
  for (const std::string_view comment : comments) {
    if (!w_first) w_first = OrderOfHeader(file.string(), comment);
  }
  if (!rows.lines.empty()) {  // a header row without '#'
    const DataLine& first = rows.lines.front();
    if (const auto named = OrderOfHeader(FileLine(file, first.number), first.text)) {
      w_first = named;
      rows.lines.erase(rows.lines.begin());
    }
  }
  const auto decimal = std::find_if(rows.lines.begin(), rows.lines.end(), HasDecimalCommas);
  if (decimal != rows.lines.end()) {
    throw InputError(FileLine(file, decimal->number) + ": found numbers with a decimal comma; expected a dot");
  }
  if (!w_first && std::any_of(rows.lines.begin(), rows.lines.end(), HasComma)) w_first = OrderOfRows(file, rows.lines);
  rows.w_first = w_first.value_or(false);
  return rows;
}

}  // namespace trigpoint

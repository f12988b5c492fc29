#include "localize/reconstruct/frames.h"

#include <algorithm>
#include <set>

#include "calib/base/median.h"
#include "calib/geometry/path.h"

namespace trigpoint {

std::vector<int> NextOfCamera(const LocalizeInput& input) {
  std::vector<int> next(input.images.size(), -1), last(input.cameras.size(), -1);
  for (size_t i = 0; i < input.images.size(); ++i) {
    int& before = last[static_cast<size_t>(input.images[i].camera)];
    if (before >= 0) next[static_cast<size_t>(before)] = static_cast<int>(i);
    before = static_cast<int>(i);
  }
  return next;
}

double MedianStep(const LocalizeInput& input) {
  const std::vector<int> next = NextOfCamera(input);
  const auto place = [&](size_t image) -> const Eigen::Vector3d& {
    return input.odom_from_body[static_cast<size_t>(input.images[image].pose)].translation;
  };
  std::vector<double> steps;
  for (size_t i = 0; i < next.size(); ++i) {
    if (next[i] >= 0) steps.push_back((place(static_cast<size_t>(next[i])) - place(i)).norm());
  }
  return Median(std::move(steps));
}

std::vector<double> PathToImages(const LocalizeInput& input, const std::vector<Rigid3d>& body_from_odom) {
  std::vector<Rigid3d> of_images;
  for (const FrameImage& image : input.images) {
    of_images.push_back(body_from_odom[static_cast<size_t>(image.pose)].Inverse());
  }
  return PathLengths(of_images);
}

std::vector<int> MomentsOfPoses(const LocalizeInput& input) {
  constexpr double kPart = 0.2;  // of the time between images of a camera: four cameras that take turns stay apart
  const std::vector<int> next = NextOfCamera(input);
  const auto pose = [&](size_t image) { return static_cast<size_t>(input.images[image].pose); };
  std::vector<double> intervals_ns;
  std::vector<std::set<int>> cameras(input.pose_stamps.size());
  for (size_t i = 0; i < next.size(); ++i) {
    cameras[pose(i)].insert(input.images[i].camera);
    if (next[i] < 0) continue;
    const int64_t after = input.pose_stamps[pose(static_cast<size_t>(next[i]))];
    intervals_ns.push_back(static_cast<double>(after - input.pose_stamps[pose(i)]));
  }
  const double near_ns = kPart * Median(std::move(intervals_ns));
  std::vector<int> moments(cameras.size(), 0);
  std::set<int> shown;  // cameras of the moment
  size_t first = 0;     // pose of the moment
  for (size_t k = 0; k < cameras.size(); ++k) {
    const bool again = std::any_of(cameras[k].begin(), cameras[k].end(), [&](int c) { return shown.count(c) > 0; });
    const bool later = static_cast<double>(input.pose_stamps[k] - input.pose_stamps[first]) >= near_ns;
    if (k > 0 && (again || later)) first = k, shown.clear();
    shown.insert(cameras[k].begin(), cameras[k].end());
    if (k > 0) moments[k] = moments[k - 1] + (first == k ? 1 : 0);
  }
  return moments;
}

}  // namespace trigpoint

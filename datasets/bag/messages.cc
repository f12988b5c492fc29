#include "datasets/bag/messages.h"

#include <cmath>
#include <map>

#include "calib/base/error.h"
#include "datasets/io/byte_cursor.h"

namespace trigpoint {
namespace {

// ROS 1: little-endian, packed. CDR: four bytes that state endianness and version, then aligned numbers (to 8 bytes, in
// version 2 to 4), texts with a final zero.
class Message {
 public:
  Message(const BagTopic& topic, std::span<const uint8_t> bytes)
      : ros1_(topic.encoding == BagEncoding::kRos1), cursor_(Open(topic, bytes)) {}

  template <typename T>
  T Number() {
    return cursor_.Number<T>();
  }
  double Real() { return cursor_.Number<double>(); }
  std::string Text() {
    std::string_view text = cursor_.Text();
    while (!text.empty() && text.back() == '\0') text.remove_suffix(1);
    constexpr size_t kLongest = 1024;
    if (text.size() > kLongest) throw InputError("expected a name, found a text of " + std::to_string(text.size()));
    return std::string(text);
  }
  std::string Frame() {
    std::string frame = Text();
    return frame.starts_with('/') ? frame.substr(1) : frame;
  }
  std::vector<double> Reals(size_t count) {
    std::vector<double> values(count);
    for (double& value : values) value = Real();
    return values;
  }
  RosHeader Header() {
    if (ros1_) Number<uint32_t>();  // its number
    RosHeader header;
    const int64_t seconds = ros1_ ? static_cast<int64_t>(Number<uint32_t>()) : Number<int32_t>();
    header.stamp_ns = seconds * 1'000'000'000 + Number<uint32_t>();
    header.frame = Frame();
    return header;
  }
  Eigen::Vector3d Vector() {
    const std::vector<double> v = Reals(3);
    return {v[0], v[1], v[2]};
  }
  // x y z w; not normalised.
  Eigen::Quaterniond Rotation() {
    const std::vector<double> q = Reals(4);
    return {q[3], q[0], q[1], q[2]};
  }
  Rigid3d Pose() {
    const Eigen::Vector3d t = Vector();
    const Eigen::Quaterniond q = Rotation();
    if (!t.allFinite() || !(std::abs(q.norm() - 1) < 1e-2)) throw InputError("expected a finite pose, found none");
    return {q, t};
  }
  std::span<const uint8_t> Block() { return cursor_.Block(); }
  bool ros1() const { return ros1_; }

 private:
  static ByteCursor Open(const BagTopic& topic, std::span<const uint8_t> bytes) {
    if (topic.encoding == BagEncoding::kRos1) return ByteCursor(bytes);
    if (topic.encoding != BagEncoding::kCdr) throw InputError("expected a message of ROS 1 or in CDR");
    ByteCursor head(bytes);
    head.Number<uint8_t>();
    const auto kind = head.Number<uint8_t>();
    const bool first = kind <= 1, second = kind == 6 || kind == 7;
    if (!first && !second) throw InputError("expected plain CDR, found encapsulation " + std::to_string(kind));
    head.Bytes(2);
    return ByteCursor(bytes.subspan(4), first ? 8 : 4, kind % 2 == 0);
  }

  bool ros1_;
  ByteCursor cursor_;
};

}  // namespace

BagRole RoleOf(const BagTopic& topic) {
  static const std::map<std::string, BagRole> kRoles = {
      {"sensor_msgs/Image", BagRole::kImage},
      {"sensor_msgs/CompressedImage", BagRole::kImage},
      {"sensor_msgs/CameraInfo", BagRole::kCameraInfo},
      {"nav_msgs/Odometry", BagRole::kPose},
      {"geometry_msgs/PoseStamped", BagRole::kPose},
      {"geometry_msgs/PoseWithCovarianceStamped", BagRole::kPose},
      {"geometry_msgs/TransformStamped", BagRole::kPose},
      {"tf2_msgs/TFMessage", BagRole::kTransforms},
      {"tf/tfMessage", BagRole::kTransforms},
      {"sensor_msgs/NavSatFix", BagRole::kFix},
      {"sensor_msgs/Imu", BagRole::kImu},
  };
  const auto it = kRoles.find(topic.type);
  return it != kRoles.end() && topic.encoding != BagEncoding::kOther ? it->second : BagRole::kNone;
}

RosImage ReadRosImage(const BagTopic& topic, std::span<const uint8_t> bytes) {
  Message message(topic, bytes);
  RosImage image;
  image.header = message.Header();
  const bool raw = topic.type == "sensor_msgs/Image";
  if (raw) {
    image.height = message.Number<uint32_t>();
    image.width = message.Number<uint32_t>();
  }
  image.encoding = message.Text();
  if (raw) {
    image.big_endian = message.Number<uint8_t>() != 0;
    image.step = message.Number<uint32_t>();
  }
  image.data = message.Block();
  return image;
}

RosCameraInfo ReadRosCameraInfo(const BagTopic& topic, std::span<const uint8_t> bytes) {
  Message message(topic, bytes);
  RosCameraInfo info;
  info.header = message.Header();
  info.height = message.Number<uint32_t>();
  info.width = message.Number<uint32_t>();
  info.distortion_model = message.Text();
  constexpr uint32_t kMostCoefficients = 64;
  const auto count = message.Number<uint32_t>();
  if (count > kMostCoefficients) throw InputError("expected distortion coefficients, found " + std::to_string(count));
  info.d = message.Reals(count);
  info.k = message.Reals(9);
  message.Reals(9);  // rectification
  info.p = message.Reals(12);
  for (uint32_t* value :
       {&info.binning_x, &info.binning_y, &info.roi_x, &info.roi_y, &info.roi_height, &info.roi_width}) {
    *value = message.Number<uint32_t>();
  }
  return info;
}

RosPose ReadRosPose(const BagTopic& topic, std::span<const uint8_t> bytes) {
  Message message(topic, bytes);
  RosPose pose;
  pose.header = message.Header();
  if (topic.type == "nav_msgs/Odometry" || topic.type == "geometry_msgs/TransformStamped") pose.child = message.Frame();
  pose.pose = message.Pose();
  return pose;
}

std::vector<RosPose> ReadRosTransforms(const BagTopic& topic, std::span<const uint8_t> bytes) {
  Message message(topic, bytes);
  std::vector<RosPose> transforms;
  for (auto left = message.Number<uint32_t>(); left > 0; --left) {
    RosPose transform;
    transform.header = message.Header();
    transform.child = message.Frame();
    transform.pose = message.Pose();
    transforms.push_back(std::move(transform));
  }
  return transforms;
}

RosFix ReadRosFix(const BagTopic& topic, std::span<const uint8_t> bytes) {
  Message message(topic, bytes);
  RosFix fix;
  fix.header = message.Header();
  fix.valid = message.Number<int8_t>() >= 0;
  message.Number<uint16_t>();  // which satellites
  fix.position.latitude_deg = message.Real();
  fix.position.longitude_deg = message.Real();
  fix.position.height_m = message.Real();
  const std::vector<double> covariance = message.Reals(9);  // m^2, east north up
  const bool known = message.Number<uint8_t>() != 0;
  const auto sigma = [&](double variance) {
    return known && variance > 0 && variance < 1e12 ? std::sqrt(variance) : 0;
  };
  fix.sigma_h_m = sigma(0.5 * (covariance[0] + covariance[4]));
  fix.sigma_v_m = sigma(covariance[8]);
  fix.valid = fix.valid && std::abs(fix.position.latitude_deg) <= 90 && std::abs(fix.position.longitude_deg) <= 180;
  return fix;
}

RosOrientation ReadRosOrientation(const BagTopic& topic, std::span<const uint8_t> bytes) {
  Message message(topic, bytes);
  RosOrientation orientation;
  orientation.header = message.Header();
  orientation.rotation = message.Rotation();
  // A first covariance of -1 states that the sensor has no orientation.
  orientation.valid = message.Real() != -1 && std::abs(orientation.rotation.norm() - 1) < 1e-2;
  return orientation;
}

}  // namespace trigpoint

// The messages of ROS that a run is made of, from the bytes of ROS 1 and of CDR (ROS 2) alike: the fields are the same.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "calib/geo/geodetic.h"
#include "calib/geometry/rigid3.h"
#include "datasets/bag/bag.h"

namespace trigpoint {

// What a topic is for, by its type.
enum class BagRole { kNone, kImage, kCameraInfo, kPose, kTransforms, kFix, kImu };
BagRole RoleOf(const BagTopic& topic);

struct RosHeader {
  int64_t stamp_ns = 0;
  std::string frame;  // without a leading '/'
};

// sensor_msgs/Image, or CompressedImage (height 0, `encoding` its format). The pixels are the message's own bytes.
struct RosImage {
  RosHeader header;
  uint32_t height = 0, width = 0, step = 0;  // step: bytes of a row
  std::string encoding;
  bool big_endian = false;
  std::span<const uint8_t> data;
};

struct RosCameraInfo {
  RosHeader header;
  uint32_t height = 0, width = 0;
  std::string distortion_model;
  std::vector<double> d, k, p;  // k: 3 x 3, p: 3 x 4, by rows; all 0 where the camera is not calibrated
  // Pixels of the sensor that one of the picture stands for (0: 1), and the part of it that is seen (0: all of it).
  uint32_t binning_x = 0, binning_y = 0, roi_x = 0, roi_y = 0, roi_width = 0, roi_height = 0;
};

// frame_from_child, frame being the header's. child is empty where the message has none.
struct RosPose {
  RosHeader header;
  std::string child;
  Rigid3d pose;
};

struct RosFix {
  RosHeader header;
  bool valid = false;
  Geodetic position;                    // height NaN: not known
  double sigma_h_m = 0, sigma_v_m = 0;  // 0: not known
};

// world_from_sensor of an IMU that computes one.
struct RosOrientation {
  RosHeader header;
  bool valid = false;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
};

// Each throws InputError for bytes that are too few or another message's.
RosImage ReadRosImage(const BagTopic& topic, std::span<const uint8_t> bytes);
RosCameraInfo ReadRosCameraInfo(const BagTopic& topic, std::span<const uint8_t> bytes);
// nav_msgs/Odometry, geometry_msgs/PoseStamped, PoseWithCovarianceStamped, TransformStamped.
RosPose ReadRosPose(const BagTopic& topic, std::span<const uint8_t> bytes);
std::vector<RosPose> ReadRosTransforms(const BagTopic& topic, std::span<const uint8_t> bytes);
RosFix ReadRosFix(const BagTopic& topic, std::span<const uint8_t> bytes);
RosOrientation ReadRosOrientation(const BagTopic& topic, std::span<const uint8_t> bytes);

}  // namespace trigpoint

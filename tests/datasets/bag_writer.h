// Bags as their public specifications describe them, for tests and benchmarks.
#pragma once

#include <cstring>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "calib/geometry/rigid3.h"
#include "datasets/bag/bag.h"

namespace trigpoint {

// A message on its way: ROS 1 (packed) or CDR (aligned).
class RosBytes {
 public:
  explicit RosBytes(BagEncoding encoding) : cdr_(encoding == BagEncoding::kCdr) {
    if (cdr_) bytes_.assign({'\0', '\1', '\0', '\0'});
  }
  template <typename T>
  RosBytes& Put(T value) {
    while (cdr_ && (bytes_.size() - 4) % sizeof(T) != 0) bytes_ += '\0';
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
    return *this;
  }
  RosBytes& Text(const std::string& text) {
    Put(static_cast<uint32_t>(text.size() + (cdr_ ? 1 : 0)));
    bytes_ += text;
    if (cdr_) bytes_ += '\0';
    return *this;
  }
  RosBytes& Block(std::span<const uint8_t> data) {
    Put(static_cast<uint32_t>(data.size()));
    bytes_.append(reinterpret_cast<const char*>(data.data()), data.size());
    return *this;
  }
  RosBytes& Header(int64_t stamp_ns, const std::string& frame) {
    if (!cdr_) Put(uint32_t{7});
    return Put(static_cast<uint32_t>(stamp_ns / 1'000'000'000))
        .Put(static_cast<uint32_t>(stamp_ns % 1'000'000'000))
        .Text(frame);
  }
  RosBytes& Reals(const std::vector<double>& values) {
    for (double value : values) Put(value);
    return *this;
  }
  RosBytes& Pose(const Rigid3d& pose) {
    const auto& t = pose.translation;
    const auto& q = pose.rotation;
    return Reals({t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()});
  }
  const std::string& bytes() const { return bytes_; }

 private:
  bool cdr_;
  std::string bytes_;
};

// One bag being written. Types are ROS 1's ("sensor_msgs/Image"); ROS 2's bags get their "/msg".
class BagWriter {
 public:
  virtual ~BagWriter() = default;
  BagEncoding encoding() const { return encoding_; }
  virtual void Add(const std::string& topic, const std::string& type, int64_t logged_ns, const std::string& bytes) = 0;
  virtual void Close() = 0;

 protected:
  explicit BagWriter(BagEncoding encoding) : encoding_(encoding) {}
  BagEncoding encoding_;
};

// compression: "none", "bz2" or "lz4".
std::unique_ptr<BagWriter> WriteRos1Bag(const std::filesystem::path& file, const std::string& compression);
// compression: "", "lz4" or "zstd".
std::unique_ptr<BagWriter> WriteMcap(const std::filesystem::path& file, const std::string& compression,
                                     BagEncoding encoding = BagEncoding::kCdr);
// Each message may be compressed by zstd.
std::unique_ptr<BagWriter> WriteSqliteBag(const std::filesystem::path& file, bool compressed);

}  // namespace trigpoint

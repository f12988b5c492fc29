// Recordings of ROS, read without ROS: bags of ROS 1 (version 2.0), and of ROS 2 as SQLite (.db3) or MCAP.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/base/progress.h"

namespace trigpoint {

// How messages are written: by ROS 1, or as CDR by ROS 2.
enum class BagEncoding { kRos1, kCdr, kOther };

struct BagTopic {
  std::string name;
  std::string type;  // "sensor_msgs/Image"; ROS 2's "/msg" is left out
  BagEncoding encoding = BagEncoding::kOther;
  int64_t messages = 0;
};

struct BagContents {
  std::string format;            // "ROS 1 bag", "MCAP", "ROS 2 SQLite"
  std::vector<BagTopic> topics;  // by name
  int64_t begin_ns = 0, end_ns = 0;
  std::vector<std::string> warnings;
};

struct BagMessage {
  int64_t logged_ns = 0;           // when it was recorded
  std::span<const uint8_t> bytes;  // valid during the call
};

// Is `path` a bag by its first bytes, or a folder with a ROS 2 bag?
bool IsBag(const std::filesystem::path& path);

// What is in the bag: from its index where it has one, else by reading it through. Throws InputError if it is no bag.
BagContents ListBag(const std::filesystem::path& path, const CancelToken& cancel);

// Calls `use(topic, message)` for the messages of the wanted topics, in the order in which they were recorded. Memory:
// one chunk (at most 128 MiB, else InputError) and its compressed form. A file that is cut off is read as far as it
// goes and named in the warnings that are returned; other damage throws InputError naming file and byte. Reports the
// bytes read to `progress`. An InputError of `use` is not caught.
std::vector<std::string> ReadBag(const std::filesystem::path& path,
                                 const std::function<bool(const BagTopic&)>& is_wanted,
                                 const std::function<void(const BagTopic&, const BagMessage&)>& use,
                                 ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint

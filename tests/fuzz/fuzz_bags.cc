// Input: a letter that says which kind of recording, then its bytes.
#include "calib/base/progress.h"
#include "datasets/bag/bag.h"
#include "datasets/bag/messages.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

using namespace trigpoint;

void Decode(const BagTopic& topic, std::span<const uint8_t> bytes) {
  switch (RoleOf(topic)) {
    case BagRole::kImage: ReadRosImage(topic, bytes); break;
    case BagRole::kCameraInfo: ReadRosCameraInfo(topic, bytes); break;
    case BagRole::kPose: ReadRosPose(topic, bytes); break;
    case BagRole::kTransforms: ReadRosTransforms(topic, bytes); break;
    case BagRole::kFix: ReadRosFix(topic, bytes); break;
    case BagRole::kImu: ReadRosOrientation(topic, bytes); break;
    case BagRole::kNone: break;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  static constexpr const char* kNames[] = {"b.bag", "b.mcap", "b.db3"};
  const std::filesystem::path file = FuzzFile(kNames[data[0] % std::size(kNames)], data + 1, size - 1);
  ProgressSink progress;
  const auto all = [](const BagTopic&) { return true; };
  const auto decode = [](const BagTopic& topic, const BagMessage& message) {
    try {
      Decode(topic, message.bytes);
    } catch (const Error& e) {
      ExpectOneSentence(e);  // the next message may be whole
    }
  };
  try {
    if (!IsBag(file)) return 0;
    ListBag(file, {});
    ReadBag(file, all, decode, progress, {});
  } catch (const Error& e) {
    ExpectOneSentence(e);
  }
  return 0;
}

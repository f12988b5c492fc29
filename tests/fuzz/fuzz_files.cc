// Input: a letter that says which reader, then a file of that kind: calibrations, tags, results, rigs, visual words,
// what pictures and videos say of themselves.
#include <nlohmann/json.hpp>

#include "datasets/calibration/camera_files.h"
#include "datasets/calibration/target_file.h"
#include "datasets/io/exif.h"
#include "datasets/io/gopro_gps.h"
#include "datasets/io/rig_file.h"
#include "datasets/io/run_parts.h"
#include "datasets/io/tag_layout.h"
#include "datasets/solution/solution_file.h"
#include "localize/references/retrieval.h"
#include "survey/tags/tag_files.h"
#include "tests/fuzz/fuzz_input.h"

namespace trigpoint {
namespace {

// rig.csv with a rig.json that fits, or the other way round: two photos of one lens.
void ReadRig(const std::filesystem::path& file) {
  constexpr const char* kRow =
      "photo,tx,ty,tz,qx,qy,qz,qw,focal_px\na.jpg,0,0,0,0,0,0,1,500\nb.jpg,0,0,0,0,1,0,0,500\n";
  static const std::string kSidecar = [] {
    nlohmann::json photos = nlohmann::json::array();
    for (const char* name : {"a.jpg", "b.jpg"}) {
      const nlohmann::json row(6, 0);
      photos.push_back({{"photo", name},
                        {"lens", 0},
                        {"width_px", 640},
                        {"height_px", 480},
                        {"covariance_rotation_rad_translation_m", {row, row, row, row, row, row}}});
    }
    return nlohmann::json{{"photos", photos},
                          {"lenses", {{{"model", "radtan"}, {"k1", 0}, {"k2", 0}}}},
                          {"circle", {{"radius_m", 0.1}, {"log_sigma", 0.1}}}}
        .dump();
  }();
  const bool csv = file.filename() == "rig.csv";
  std::ofstream(file.parent_path() / (csv ? "rig.json" : "rig.csv")) << (csv ? kSidecar : kRow);
  ReadRigFiles(file.parent_path());
}

// Lists of a codebook of one word. Its fingerprint is put in place, or no input would get past it.
void ReadWords(const std::filesystem::path& file) {
  static const auto kCodebook = std::make_shared<const Vocabulary>(TrainVocabulary(0, {}, {}, 1, 1, {}));
  constexpr std::streamoff kFingerprintAt = 40;
  if (std::filesystem::file_size(file) >= kFingerprintAt + sizeof(uint64_t)) {
    const uint64_t fingerprint = kCodebook->fingerprint();
    std::fstream stream(file, std::ios::binary | std::ios::in | std::ios::out);
    stream.seekp(kFingerprintAt);
    stream.write(reinterpret_cast<const char*>(&fingerprint), sizeof fingerprint);
  }
  RetrievalIndex(kCodebook, {MapWordLists(file, *kCodebook)});
}

}  // namespace
}  // namespace trigpoint

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace trigpoint;
  if (size == 0) return 0;
  static constexpr const char* kNames[] = {"camera.yaml", "camera.xml",     "camera.json", "target.yaml", "layout.json",
                                           "images.txt",  "detections.csv", "solution.db", "video.mp4",   "photo.jpg",
                                           "rig.csv",     "rig.json",       "words.bin",   "codebook.bin"};
  const size_t kind = data[0] % std::size(kNames);
  const std::filesystem::path file = FuzzFile(kNames[kind], data + 1, size - 1);
  std::vector<std::string> warnings;
  Run run;
  run.dir = file.parent_path();
  try {
    switch (kind) {
      case 0:
      case 1:
      case 2: ReadCameraFile(file); break;
      case 3: ReadTargetFile(file); break;
      case 4: ReadTagLayout(file); break;
      case 5: ReadImageList(file.parent_path(), &run); break;
      case 6: ReadDetections(file, 1, &warnings); break;
      case 7: ReadSolution(file); break;
      case 8:
        IsSphericalVideo(file);
        VideoCreationUtcNs(file);
        ReadGoProGps(file);
        break;
      case 9: ReadPhotoMetadata(file); break;
      case 10:
      case 11: ReadRig(file); break;
      case 12: ReadWords(file); break;
      default: Vocabulary::Read(file);
    }
  } catch (const Error& e) {
    if (std::string(e.what()).empty()) std::abort();
  }
  return 0;
}

// Input: a letter that says which reader, then a file of that kind: calibrations, tags, results, what pictures and
// videos say of themselves.
#include "datasets/calibration/camera_files.h"
#include "datasets/calibration/target_file.h"
#include "datasets/io/exif.h"
#include "datasets/io/gopro_gps.h"
#include "datasets/io/run_parts.h"
#include "datasets/io/tag_layout.h"
#include "datasets/solution/solution_file.h"
#include "survey/tags/tag_files.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace trigpoint;
  if (size == 0) return 0;
  static constexpr const char* kNames[] = {"camera.yaml", "camera.xml",     "camera.json", "target.yaml", "layout.json",
                                           "images.txt",  "detections.csv", "solution.db", "video.mp4",   "photo.jpg"};
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
      default: ReadPhotoMetadata(file);
    }
  } catch (const Error& e) {
    if (std::string(e.what()).empty()) std::abort();
  }
  return 0;
}

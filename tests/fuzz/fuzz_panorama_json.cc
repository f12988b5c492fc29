// Input: a metadata JSON of a folder of panoramas.
#include "datasets/import/panorama_provider.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::filesystem::path file = trigpoint::FuzzFile("m.json", data, size);
  try {
    for (const auto& record :
         trigpoint::OpenPanoramaFolder(file.parent_path())->Find(trigpoint::Geodetic{48, 7, 0}, 1e6)) {
      if (record.id.empty()) std::abort();
    }
  } catch (const trigpoint::Error& e) {
    trigpoint::ExpectOneSentence(e);
  }
  return 0;
}

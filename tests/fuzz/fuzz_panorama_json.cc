// Input: a metadata JSON of a folder of panoramas.
#include "datasets/import/panorama_provider.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::filesystem::path file = trigpoint::FuzzFile("m.json", data, size);
  try {
    const auto folder = trigpoint::OpenPanoramaFolder(file.parent_path());
    for (const auto& record : folder->Find({{{48, 7, 0}}, 1e6}, trigpoint::CancelToken())) {
      if (record.id.empty()) std::abort();
    }
  } catch (const trigpoint::Error& e) {
    trigpoint::ExpectOneSentence(e);
  }
  return 0;
}

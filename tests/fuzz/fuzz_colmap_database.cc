// Input: an SQLite file.
#include "datasets/colmap/database.h"
#include "datasets/colmap/database_cameras.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::filesystem::path file = trigpoint::FuzzFile("d.db", data, size);
  try {
    const auto database = trigpoint::ColmapDatabase::OpenRead(file);
    try {
      trigpoint::ReadDatabaseCameras(file);
    } catch (const trigpoint::Error& e) {
      trigpoint::ExpectOneSentence(e);
    }
    for (const auto& image : database.Images()) database.ReadFeatures(image.id);
  } catch (const trigpoint::Error& e) {
    trigpoint::ExpectOneSentence(e);
  }
  return 0;
}

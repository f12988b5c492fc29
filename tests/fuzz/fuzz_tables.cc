// Input: a letter that says which reader, then a file of that kind.
#include "datasets/import/phone_files.h"
#include "datasets/io/camchain.h"
#include "datasets/io/csv.h"
#include "datasets/io/gps.h"
#include "datasets/io/run_parts.h"
#include "datasets/io/survey_tables.h"
#include "datasets/io/tables.h"
#include "datasets/io/trajectory.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace trigpoint;
  if (size == 0) return 0;
  static constexpr const char* kNames[] = {"t.tum",        "c.yaml",    "p.csv",       "g.gpx",    "n.nmea",
                                           "g.csv",        "gcp.txt",   "gcp.json",    "data.csv", "distances.csv",
                                           "marks.csv",    "tags.yaml", "origin.json", "run.yaml", "panoramas.csv",
                                           "stations.csv", "photos.csv"};
  const size_t kind = data[0] % std::size(kNames);
  const std::filesystem::path file = FuzzFile(kNames[kind], data + 1, size - 1);
  std::vector<std::string> warnings;
  try {
    switch (kind) {
      case 0: ReadTrajectory(file); break;
      case 1: ReadCamchain(file); break;
      case 2: ReadControlPoints(file, &warnings); break;
      case 3: ReadGpx(file, {}); break;
      case 4: ReadNmea(file, {std::nullopt, "2026-05-12"}); break;
      case 5: ReadGpsCsv(file); break;
      case 8: ReadTrajectory(file); break;  // EuRoC's form
      case 9: ReadDistances(file, &warnings); break;
      case 10: ReadControlObservations(file, &warnings); break;
      case 11: ReadTagSizes(file); break;
      case 12: ReadOrigin(file); break;
      case 13: ReadRunSettings(file.parent_path(), file.parent_path()); break;
      case 14: ReadPanoramaTable(file, file.parent_path(), &warnings); break;
      case 15: ReadStations(file, &warnings); break;
      case 16: ReadPhotoTable(file, file.parent_path(), &warnings); break;
      default: {
        const std::filesystem::path site = file.parent_path() / "site";
        std::filesystem::remove_all(site);
        ImportOpenSfmGcp(site, file, file.parent_path());
      }
    }
  } catch (const Error& e) {
    if (std::string(e.what()).empty()) std::abort();
  }
  return 0;
}

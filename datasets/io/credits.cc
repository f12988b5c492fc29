#include "datasets/io/credits.h"

#include "calib/base/error.h"
#include "datasets/io/csv.h"

namespace trigpoint {

std::map<std::string, PictureCredit> ReadCredits(const std::filesystem::path& site) {
  std::map<std::string, PictureCredit> credits;
  for (const char* name : {"panoramas.csv", "photos.csv"}) {
    if (!std::filesystem::exists(site / name)) continue;
    try {
      const CsvTable table =
          CsvTable::Read(site / name, {"file"}, {"source", "captured_at", "licence", "attribution", "keep_until"});
      for (const CsvRow& row : table.rows()) {
        const PictureCredit credit{row.Text("source"), row.Text("captured_at"), row.Text("licence"),
                                   row.Text("attribution"), row.Text("keep_until")};
        if (credit.source.empty() && credit.licence.empty() && credit.attribution.empty()) continue;
        credits.emplace(row.Text("file"), credit);
      }
    } catch (const InputError&) {
      continue;
    }
  }
  return credits;
}

}  // namespace trigpoint

#include "datasets/import/panorama_table.h"

#include <algorithm>
#include <utility>

#include "calib/base/error.h"
#include "datasets/io/csv.h"
#include "datasets/io/exif.h"
#include "datasets/io/kept_input.h"
#include "datasets/io/source_quality.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> Columns() {
  std::vector<std::string> columns = {"file",      "station",     "latitude_deg",      "longitude_deg",
                                      "height_m",  "heading_deg", "pitch_deg",         "roll_deg",
                                      "sigma_h_m", "sigma_v_m",   "sigma_heading_deg", "sigma_tilt_deg"};
  columns.insert(columns.end(), kCreditColumns.begin(), kCreditColumns.end());
  return columns;
}

}  // namespace

PanoramaTable::PanoramaTable(const fs::path& site)
    : site_(site), file_(site / "panoramas.csv"), columns_(Columns()), comments_{"trigpoint panoramas 1"} {
  if (!fs::exists(file_)) {
    for (const fs::path& picture : PicturesIn(site / "panoramas")) {
      if (IsPictureOfAService(picture.filename().string())) continue;  // of an import that was killed, which goes on
      const std::string name = "panoramas/" + picture.filename().string();
      files_.emplace(name, rows_.size());
      bare_.insert(name);
      rows_.push_back({{"file", name}, {"station", picture.stem().string()}});
    }
    return;
  }
  const CsvTable table = CsvTable::Read(file_, {"file"}, columns_);
  comments_ = table.comments();
  columns_ = table.columns();
  for (const std::string& column : Columns()) {
    if (std::find(columns_.begin(), columns_.end(), column) == columns_.end()) columns_.push_back(column);
  }
  for (const CsvRow& row : table.rows()) {
    std::map<std::string, std::string> cells;
    for (const std::string& column : table.columns()) cells[column] = row.Text(column);
    files_.emplace(row.Text("file"), rows_.size());
    rows_.push_back(std::move(cells));
  }
}

void PanoramaTable::Put(std::map<std::string, std::string> row) {
  const std::string file = row.at("file");
  const auto [at, added] = files_.emplace(file, rows_.size());
  last_ = file;
  before_.reset();
  if (added) {
    rows_.push_back(std::move(row));
  } else {
    before_ = std::exchange(rows_[at->second], std::move(row));
  }
  bare_.erase(file);
  changed_ = true;
}

void PanoramaTable::SetEnd(const std::string& file, const std::string& keep_until) {
  std::map<std::string, std::string> row = rows_[files_.at(file)];
  row["keep_until"] = keep_until;
  Put(std::move(row));
}

void PanoramaTable::TakeBack() {
  if (before_) {
    rows_[files_.at(last_)] = *before_;
  } else {
    rows_.pop_back();
    files_.erase(last_);
  }
  changed_ = true;
}

fs::path PanoramaTable::Save() {
  if (!saved_) kept_ = KeepInputFile(site_, "panoramas.csv");
  CsvWriter csv(columns_, comments_);
  for (const auto& row : rows_) {
    for (const std::string& column : columns_) {
      const auto cell = row.find(column);
      csv.Text(cell == row.end() ? "" : cell->second);
    }
    csv.EndRow();
  }
  csv.Save(file_);
  changed_ = false;
  saved_ = true;
  return file_;
}

}  // namespace trigpoint

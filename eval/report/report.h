// A project's results as pages: index.html, report.pdf, report.md, report.json, tables/*.csv, figures/*.png.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/base/option.h"
#include "eval/errors/evaluation_files.h"
#include "eval/report/report_data.h"

namespace trigpoint {

struct ReportOptions {
  bool pdf = false;          // also report.pdf
  std::string paper = "a4";  // of report.pdf
  bool images = true;        // false: nothing that shows the place, neither photographs nor the aerial image
  std::string units = "m";   // of lengths that people read
  int max_pictures = 60;     // of matches; the worst and the gate-failing cells come first
  double pictures_mb = 8;    // of all photographs together, as stored
  int scene_px = 1280;       // width of the scene's pictures
  bool dated = false;        // says when it was written: no longer the same bytes each time

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.pdf, {"pdf", "", 0, 1, "write report.pdf, too"});
    visit(self.paper, {"paper", "", 0, 0, "paper size of report.pdf: a4 or letter"});
    visit(self.images, {"images", "", 0, 1, "include photographs and the aerial image of the site"});
    visit(self.units, {"units", "", 0, 0, "unit of lengths: m, ft, us-ft"});
    visit(self.max_pictures,
          {"max_pictures", "", 0, 10000, "largest number of pictures of matches; the worst cells come first"});
    visit(self.pictures_mb, {"pictures_mb", "MB", 0, 1000, "largest size of all photographs together"});
    visit(self.scene_px, {"scene_px", "px", 160, 4096, "width of the scene's pictures"});
    visit(self.dated,
          {"dated", "", 0, 1, "state when it was written; without it the same results give the same bytes"});
  }
  std::vector<std::string> Check() const;
};

struct ReportSummary {
  uintmax_t html_bytes = 0;
  int figures = 0, match_pictures = 0, match_pictures_left_out = 0;
  std::string renderer;            // of the scenes; empty: there was none
  std::vector<std::string> notes;  // what could not be shown, and why
};

// Writes into the existing folder `out`. Whatever is missing or broken among the results is named in the report.
// Throws IoError, Cancelled.
ReportSummary WriteReport(const ReportInput& input, const ReportOptions& options, const DisplayUnit& unit,
                          const std::filesystem::path& out, ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint

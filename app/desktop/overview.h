// What the overview shows of a project: the report's first screen as values. No Qt here.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "app/desktop/charts.h"
#include "app/desktop/snapshot.h"
#include "eval/report/chapter_verdict.h"
#include "eval/report/document.h"
#include "eval/report/plan.h"
#include "eval/report/report_data.h"
#include "eval/text/display_unit.h"

namespace trigpoint {

struct OverviewWarning {
  std::string text;
  std::string object = {};  // that it is about, as the review names objects; may be empty
};

// What a run answers for a panorama.
struct OverviewAnswer {
  std::string run, variant, panorama, station, status, reason;
  std::optional<double> sigma_m;  // stated, of the largest axis
};

// Of the matrix of errors: a panorama at a station.
struct OverviewRow {
  std::string station, panorama;
  std::string title;   // the station; of one with several panoramas the panorama's file too
  std::string object;  // that it selects: the panorama where the title names it
};

struct Overview {
  bool has_project_file = false;
  std::vector<std::string> found, missing;  // of a folder without trigpoint.yaml
  std::vector<OverviewWarning> warnings;    // of the inputs, of the geotags, of the results and of reading them
  std::vector<Block> verdict;               // facts, paragraphs and headings; a station's anchor is its object
  std::string comparison;                   // what the matrix is of; empty: nothing is evaluated
  std::vector<std::string> stations, runs;  // of the matrix
  std::vector<OverviewRow> rows;            // of the matrix
  PlaceNames places;                        // where a station has several panoramas
  std::vector<ErrorRecord> matrix;          // its errors
  std::vector<ErrorRecord> errors;          // of all sets of results
  std::vector<OverviewAnswer> answers;      // of all sets of results, whether there is a reference or not
  std::vector<std::string> panoramas;       // of the first set's answers; the matrix' rows where nothing is evaluated
  std::vector<std::string> stale;           // as StaleOf, when it was read
  PaintedDrawing plan;                      // nothing: there is nothing to draw
  std::string plan_caption;
};

// The results as the report reads them; `points`: with the runs' sparse models, which takes a while.
ReportInput ReportInputOf(const Snapshot& snapshot, const std::vector<SnapshotResult>& results, bool points);
ReportInput ReportInputOf(const Snapshot& snapshot, bool points);  // states that take long to find are not known

// Reads what is there; what is missing or broken is left out, or named in `warnings`. `results`: with their states.
Overview LoadOverview(const Snapshot& snapshot, const std::vector<SnapshotResult>& results, const DisplayUnit& unit);

// Of what the overview's numbers come from, the results that belong to earlier inputs, each with its state.
std::vector<std::string> StaleOf(const std::vector<SnapshotResult>& results);

// Of what is selected and what belongs to it the station whose numbers are shown: one that the results know before
// others, else a panorama; empty: neither.
std::string StationShown(const Overview* overview, const std::set<std::string>& related, const std::string& selected);

// What to do next, as `status` shows it.
struct NextStep {
  enum class Kind { kNone, kCreate, kChecking, kRunning, kRun, kReport };  // kChecking: states are not all known
  Kind kind = Kind::kNone;
  std::string title;   // of the result that runs or comes first; empty for the other kinds
  std::string reason;  // of a failure
  int results = 0;     // that are missing, out of date or failed
  int failed = 0;
};
NextStep NextOf(const Snapshot& snapshot, const std::vector<SnapshotResult>& results, bool has_project_file);

}  // namespace trigpoint

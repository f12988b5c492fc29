// A project's results in the few numbers that a reader takes away: the last lines of a command and the first screen of
// the report are made of the same ones.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "eval/errors/comparison.h"
#include "eval/report/document.h"
#include "eval/report/report_data.h"

namespace trigpoint {

// Squared errors in units of the stated covariance, and where their mean lies if the sigmas are right.
struct SigmaTest {
  double anees = 0, low = 0, high = 0;
  bool Consistent() const { return anees >= low && anees <= high; }
  const char* Words() const { return anees < low ? "too large" : anees > high ? "too small" : "consistent"; }
};

// Of a group of summary.json: with the joint covariance of its errors, of results without one as if they were
// independent.
std::optional<SigmaTest> SigmasOf(const nlohmann::json& group);

// One comparison of the evaluation, with its numbers.
struct VerdictErrors : Comparison {
  std::optional<SigmaTest> Sigmas() const;
  nlohmann::json group;  // of summary.json
  int attempts = 0;
  std::optional<double> median_m, p90_m, worst_m;
  // Length of the mean difference in space over at least three answers: what moving every answer alike would remove.
  std::optional<double> common_shift_m;
  std::map<std::string, double> run_median_m;
  bool Holds(const ErrorRecord& e) const {
    return e.variant == variant && e.method == method && e.reference == reference && e.kind == kind &&
           e.shares_evidence == shares_evidence;
  }
};

struct VerdictRun {
  std::string run;
  int images = 0;
  int localized = 0, rejected = 0, unmatched = 0;
  bool georeferenced = false;
  std::string source;  // geotags, gps; else why it is not georeferenced
  int Asked() const { return localized + rejected + unmatched; }
};

struct VerdictRefusal {
  std::string run, panorama, station, status, reason;
};

// A geotag that the runs contradict: its largest offset over the runs, horizontal or vertical, in sigmas.
struct VerdictGeotag {
  std::string panorama, station, run;
  double off_m = 0;
  std::string direction = "horizontally";
  std::optional<double> sigmas;  // off_m in the combined 1 sigma of geotag and estimate
};

struct ProjectVerdict {
  std::vector<VerdictRun> runs;
  int panoramas = 0, photos = 0;  // of the site; photo sets count as panoramas
  std::vector<VerdictRefusal> refused;
  std::optional<VerdictErrors> relative, absolute, g1_relative, g1_absolute;
  std::optional<VerdictErrors> paper_relative, paper_absolute;  // beside the default results: of the variant paper
  std::vector<VerdictGeotag> geotags;                           // outlying ones, the worst first
  // What can be said without tags: the median 1 sigma that answers state (largest axis), and the median distance
  // between the places that two runs give the same panorama.
  std::optional<double> stated_sigma_m, runs_agree_m;
  int agreeing_pairs = 0;
  std::string gates;                                              // passed, failed, undecided; empty: none set
  bool default_gates = false;                                     // the project sets none: the report's own
  std::vector<std::pair<std::string, std::string>> gate_results;  // verdict, message

  int Images() const;
  std::string ReferenceWord() const;  // panoramas, photos, panoramas and photos
  // Where absolute sigmas are judged and relative ones are not consistent, what these are; else empty.
  std::string RelativeSigmas() const;
  std::string CountedReferences() const;  // "3 panoramas and 1 photo"
  int Localized() const;
  int Asked() const;
  // Accuracy where there is one, else agreement.
  const VerdictErrors* Best() const { return absolute ? &*absolute : relative ? &*relative : nullptr; }
};

// The colour of passed, failed, undecided.
Tone GateTone(const std::string& verdict);

// Of one set of results; `variant` empty: of the default ones.
ProjectVerdict MakeVerdict(const ReportInput& input, const ReportData& data, const std::string& variant = "");

}  // namespace trigpoint

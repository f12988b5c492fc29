// From a project's results to files of other programs.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "calib/geo/geodetic.h"
#include "datasets/project/project.h"

namespace trigpoint {

struct ExportRequest {
  std::string to;                 // a name of ExportFormats()
  std::vector<std::string> what;  // layers or parts; empty: all that the format takes
  std::vector<std::string> runs;  // empty: all that have results
  std::string variant;
  std::string crs;            // "", "EPSG:N", "utm"
  std::string heights;        // "", "ellipsoidal", a geoid
  std::string frame;          // "", "world", "odom": of scenes and trajectories; "": world where there is one
  double confidence = 0.95;   // of ellipses
  double ellipse_scale = 1;   // ellipses are drawn so many times larger
  std::filesystem::path out;  // file or folder; empty: results/export/...
  bool force = false;         // replace files of an earlier export that were changed since
};

struct ExportReport {
  std::vector<std::filesystem::path> files;
  std::vector<std::string> lines;     // what is in them, for people
  std::vector<std::string> warnings;  // what is missing and why
};

struct ExportFormat {
  std::string name;                  // "gpkg"
  std::vector<std::string> aliases;  // "geopackage"
  std::string help;
  std::vector<std::string> what;  // what it takes, in order
};
const std::vector<ExportFormat>& ExportFormats();

// Writes the files, all or none of them, and never onto one that Trigpoint did not write (datasets/project/outputs.h).
// `variant_of`: the variant whose reconstruction a run's results rest on. Throws OptionError for what cannot be asked
// for, InputError when the results it needs are missing (naming the command that makes them).
ExportReport ExportResults(const Project& project, const ExportRequest& request,
                           const std::function<std::string(const std::string& run)>& variant_of, ProgressSink& progress,
                           const CancelToken& cancel);

// The site ENU that a result's coordinates are in: about the origin that its manifest states, from which the project's
// may have moved since; about the project's where it states none.
LocalFrame FrameOfResult(const Project& project, const std::string& stage, const std::string& name);
// Warns, in the name of `what`, of coordinates in a frame about another origin than the project's.
void WarnOfOtherOrigin(const Project& project, const LocalFrame& frame, const std::string& what,
                       std::vector<std::string>* warnings);

}  // namespace trigpoint

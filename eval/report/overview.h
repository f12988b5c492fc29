// One page over many projects: a row each, linked to their own reports.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "eval/errors/evaluation_files.h"

namespace trigpoint {

struct OverviewProject {
  std::filesystem::path dir;
  std::string status;   // "done", "failed", ...: what became of it
  std::string reason;   // why it failed
  std::string name;     // what the row is called; empty: the folder's name
  std::string variant;  // of its results; empty: the first set
};

// Writes `file` (HTML, one self-contained page) beside which links to the projects' reports are relative. Numbers are
// those of each project's own evaluation of that variant; what is missing or broken stays blank, with the reason.
// Throws IoError.
void WriteOverview(const std::vector<OverviewProject>& projects, const DisplayUnit& unit,
                   const std::filesystem::path& file);

}  // namespace trigpoint

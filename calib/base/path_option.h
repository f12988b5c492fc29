// Options that name files or folders, so that a form can offer a dialog for them.
//
//   visit(self.sketch, PathOption({"sketch", "", 0, 0, "the sketch; empty: plan.csv"}, PathKind::kFile));
#pragma once

#include "calib/base/option.h"

namespace trigpoint {

enum class PathKind {
  kNone,             // any other option
  kFile,             // that is there; the option may take other words, too
  kFolder,           // that is there
  kFileOrFolder,     // that is there
  kNewFile,          // to be written
  kNewFileOrFolder,  // to be written
  kPattern           // of files in one folder: board/*.jpg
};

// For a visitor that does not ask it is an OptionInfo like others.
struct PathOption : OptionInfo {
  PathOption(const OptionInfo& info, PathKind kind_of_path) : OptionInfo(info), kind(kind_of_path) {}
  PathKind kind;
};

}  // namespace trigpoint

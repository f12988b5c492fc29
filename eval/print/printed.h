// Sheets to print, and what is noted about them in the project's folder.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "eval/print/sheets.h"

namespace trigpoint {

struct PrintRequest {
  std::filesystem::path dir;
  std::string what = "tags";  // tags, board, scale-bar
  std::string family;         // empty: that of tags.yaml, else tag36h11
  std::vector<int> ids;
  double size_mm = 0;    // of a tag, as declared in tags.yaml
  double length_mm = 0;  // scale-bar: distance of the two tags' centres
  std::string target;    // board: a file, or one line as `calibrate --target` takes it
  SheetOptions sheets;
  std::filesystem::path out;  // empty: DIR/print/<what it is>.pdf
  bool force = false;         // replace a PDF that was changed since it was written
};

struct PrintOutcome {
  std::filesystem::path pdf, points;  // where each corner lies on the paper
  PrintedSheets sheets;
  int entries_added = 0;      // to tags.yaml
  std::filesystem::path old;  // tags.yaml as it was, if it was there and changed
  std::vector<std::string> checks;
  std::vector<std::string> warnings;  // where tags.yaml and the sheets differ
};

// "0-9,12" ascending and without repetition; throws OptionError.
std::vector<int> ParseIds(const std::string& text);

// Writes the PDF, then the entries of tags.yaml and a line for each tag in DIR/print/printed.csv. A tag that was
// printed in this size before keeps the entry it has, with a warning where that is another size (a measured one).
// Throws OptionError, InputError (a tag that tags.yaml lists with another size), IoError.
PrintOutcome PrintSheetsFor(const PrintRequest& request);

struct MeasuredPrint {
  std::vector<int> ids;
  double factor = 1;  // size on the paper / size that was asked for
  std::filesystem::path old;
  std::vector<std::string> warnings;
};

// Writes what was measured on the paper into sizes_m: size = asked for * mean(measured) / nominal. `ids` empty: the
// tags of the newest PDF; else the newest print of each. `measured_mm`: of a bar or tag's edge across, or across and
// up. `nominal_mm`: of the same as printed; 0 throws OptionError naming the lengths on the sheets. Throws OptionError
// (a factor nobody prints with, lengths that differ by over 1 %), InputError (nothing was printed, an entry that was
// changed by hand).
MeasuredPrint EnterMeasuredPrint(const std::filesystem::path& dir, const std::vector<int>& ids,
                                 const std::vector<double>& measured_mm, double nominal_mm);

}  // namespace trigpoint

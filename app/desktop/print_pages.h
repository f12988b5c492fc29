// What would be printed, as pictures: the very PDF that `trigpoint print` writes, made in a folder of its own. Nothing
// is written into the site's.
#pragma once

#include <QImage>
#include <QTemporaryDir>

#include "eval/print/printed.h"

namespace trigpoint {

class PrintPages {
 public:
  // Throws as PrintSheetsFor does, IoError where there is no room for it.
  explicit PrintPages(const PrintRequest& request);
  const PrintedSheets& sheets() const { return outcome_.sheets; }
  const PaperSize& paper() const { return paper_; }
  // Page from 0 to pages - 1, its longer side about `side_px`, at 200 dpi at most. Throws IoError. Thread safe.
  QImage Page(int page, int side_px) const;

 private:
  QTemporaryDir folder_;  // removed with the object
  PaperSize paper_;
  PrintOutcome outcome_;
};

}  // namespace trigpoint

// Owners of what GDAL opens and says.
#pragma once

#include <cpl_error.h>
#include <gdal_priv.h>

#include <memory>

namespace trigpoint {

struct CloseDataset {
  void operator()(GDALDataset* d) const { GDALClose(d); }
};
using GdalDataset = std::unique_ptr<GDALDataset, CloseDataset>;

// GDAL prints to standard error by itself; while this lives its last message is kept for ours.
class QuietGdal {
 public:
  QuietGdal() { CPLPushErrorHandler(CPLQuietErrorHandler); }
  ~QuietGdal() { CPLPopErrorHandler(); }
  QuietGdal(const QuietGdal&) = delete;
  QuietGdal& operator=(const QuietGdal&) = delete;
};

}  // namespace trigpoint

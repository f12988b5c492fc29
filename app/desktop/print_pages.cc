// The PDF is drawn by GDAL's PDF driver, which the program is linked with for aerial images already.
#include "app/desktop/print_pages.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "calib/base/error.h"
#include "datasets/calibration/target_file.h"
#include "eval/scene/gdal_guards.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

constexpr double kMmPerInch = 25.4;
constexpr double kMostDpi = 200;

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  for (size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size())) {
    text.replace(at, from.size(), to);
  }
  return text;
}

}  // namespace

PrintPages::PrintPages(const PrintRequest& request) : paper_(request.sheets.paper) {
  if (!folder_.isValid()) {
    throw IoError(folder_.path().toStdString() +
                  ": the folder for the preview cannot be made: " + folder_.errorString().toStdString());
  }
  const fs::path own = folder_.path().toStdString();
  try {
    PrintRequest mine = request;
    mine.dir = own;
    mine.out = request.out.empty() ? fs::path() : own / "print" / request.out.filename();
    // What the site's own files refuse is refused here, too.
    fs::create_directory(own / "print");
    for (const char* file : {"tags.yaml", "print/printed.csv"}) {
      if (fs::exists(request.dir / file)) fs::copy_file(request.dir / file, own / file);
    }
    const fs::path board = TargetFileOf(request.target, request.dir);
    if (!board.empty()) mine.target = fs::absolute(board).string();
    outcome_ = PrintSheetsFor(mine);
  } catch (const std::exception& e) {
    throw InputError(Replaced(e.what(), own.string(), request.dir.string()));
  }
}

QImage PrintPages::Page(int page, int side_px) const {
  const QuietGdal quiet;
  GDALAllRegister();
  const double longer = std::max(paper_.width_mm, paper_.height_mm);
  const int dpi = static_cast<int>(std::clamp(side_px * kMmPerInch / longer, 1.0, kMostDpi));
  const std::string resolution = fmt::format("DPI={}", dpi);
  const char* const drivers[] = {"PDF", nullptr};
  const char* const options[] = {resolution.c_str(), nullptr};
  const GdalDataset data(
      static_cast<GDALDataset*>(GDALOpenEx(fmt::format("PDF:{}:{}", page + 1, outcome_.pdf.string()).c_str(),
                                           GDAL_OF_RASTER | GDAL_OF_READONLY, drivers, options, nullptr)));
  if (data) {
    QImage image(data->GetRasterXSize(), data->GetRasterYSize(), QImage::Format_RGB888);
    int bands[] = {1, 2, 3};
    if (!image.isNull() && data->GetRasterCount() >= 3 &&
        data->RasterIO(GF_Read, 0, 0, image.width(), image.height(), image.bits(), image.width(), image.height(),
                       GDT_Byte, 3, bands, 3, image.bytesPerLine(), 1, nullptr) == CE_None) {
      return image;
    }
  }
  throw IoError(fmt::format("page {}: cannot be drawn: {}; the PDF itself can be written", page + 1,
                            GetGDALDriverManager()->GetDriverByName("PDF") == nullptr
                                ? "GDAL was built without its PDF driver"
                                : CPLGetLastErrorMsg()));
}

}  // namespace trigpoint

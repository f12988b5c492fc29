#include <ogr_spatialref.h>

#include <algorithm>
#include <memory>
#include <opencv2/imgproc.hpp>

#include "calib/base/error.h"
#include "eval/scene/gdal_guards.h"
#include "eval/scene/scene_model.h"

namespace trigpoint {
namespace {

// The bands as 8-bit BGR of the wanted size; other depths are stretched over their range.
cv::Mat ReadBands(GDALDataset& data, const cv::Size& size, const std::string& file) {
  const int bands = data.GetRasterCount();
  if (bands < 1) throw InputError(file + ": has no picture in it; expected a GeoTIFF with one or three bands");
  cv::Mat channels[3];
  for (int k = 0; k < 3; ++k) {
    GDALRasterBand& band = *data.GetRasterBand(bands >= 3 ? 3 - k : 1);
    const bool eight = band.GetRasterDataType() == GDT_Byte;
    cv::Mat plane(size, eight ? CV_8U : CV_32F);
    GDALRasterIOExtraArg extra;
    INIT_RASTERIO_EXTRA_ARG(extra);
    extra.eResampleAlg = GRIORA_Average;
    if (band.RasterIO(GF_Read, 0, 0, data.GetRasterXSize(), data.GetRasterYSize(), plane.data, size.width, size.height,
                      eight ? GDT_Byte : GDT_Float32, 0, 0, &extra) != CE_None) {
      throw InputError(file + ": cannot be read: " + CPLGetLastErrorMsg());
    }
    if (!eight) {
      cv::patchNaNs(plane, 0);
      cv::normalize(plane, plane, 0, 255, cv::NORM_MINMAX);
      plane.convertTo(plane, CV_8U);
    }
    channels[k] = plane;
  }
  cv::Mat picture;
  cv::merge(channels, 3, picture);
  return picture;
}

}  // namespace

SceneAerial ReadAerial(const std::filesystem::path& file, const LocalFrame& frame, double z, int max_px) {
  const QuietGdal quiet;
  GDALAllRegister();
  const char* const drivers[] = {"GTiff", nullptr};
  const GdalDataset data(static_cast<GDALDataset*>(
      GDALOpenEx(file.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY, drivers, nullptr, nullptr)));
  if (!data) throw InputError(file.string() + ": is no GeoTIFF that can be read: " + CPLGetLastErrorMsg());
  double t[6];
  const OGRSpatialReference* system = data->GetSpatialRef();
  if (data->GetGeoTransform(t) != CE_None || !system) {
    throw InputError(file.string() +
                     ": has no georeference; expected a GeoTIFF with a coordinate system and a "
                     "geotransform (gdal_translate -a_srs -a_ullr)");
  }
  OGRSpatialReference source(*system), geographic;
  source.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  geographic.SetWellKnownGeogCS("WGS84");
  geographic.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  const std::unique_ptr<OGRCoordinateTransformation> to_degrees(
      OGRCreateCoordinateTransformation(&source, &geographic));
  if (!to_degrees) throw InputError(file.string() + ": its coordinate system cannot be converted to WGS 84");

  SceneAerial aerial;
  aerial.file = file.filename().string();
  const int width = data->GetRasterXSize(), height = data->GetRasterYSize();
  const double factor = std::min(1.0, static_cast<double>(max_px) / std::max(width, height));
  aerial.picture =
      ReadBands(*data, {std::max(1, static_cast<int>(width * factor)), std::max(1, static_cast<int>(height * factor))},
                file.string());
  aerial.columns = aerial.rows = 9;  // a grid, since a map's projection is neither ENU's scale nor its north
  for (int r = 0; r < aerial.rows; ++r) {
    for (int c = 0; c < aerial.columns; ++c) {
      const double u = width * static_cast<double>(c) / (aerial.columns - 1);
      const double v = height * static_cast<double>(r) / (aerial.rows - 1);
      double x = t[0] + t[1] * u + t[2] * v, y = t[3] + t[4] * u + t[5] * v;
      if (!to_degrees->Transform(1, &x, &y)) {
        throw InputError(file.string() + ": its corner cannot be converted to WGS 84");
      }
      Eigen::Vector3d p = frame.EnuFromGeodetic({y, x, frame.origin().height_m + z});
      p.z() = z;
      aerial.vertices.push_back(p);
    }
  }
  return aerial;
}

}  // namespace trigpoint

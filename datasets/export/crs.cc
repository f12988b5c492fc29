#include "datasets/export/crs.h"

#include <fmt/format.h>

#include <cmath>

#include "calib/base/error.h"
#include "datasets/io/text.h"

#ifdef TRIGPOINT_HAVE_PROJ
#include <proj.h>
#endif

namespace trigpoint {
namespace {

constexpr const char* kWgs84Wkt =
    R"(GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,AUTHORITY["EPSG","7030"]],)"
    R"(AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],UNIT["degree",0.0174532925199433,)"
    R"(AUTHORITY["EPSG","9122"]],AXIS["Latitude",NORTH],AXIS["Longitude",EAST],AUTHORITY["EPSG","4326"]])";

std::string UtmWkt(int zone, bool north) {
  return fmt::format(
      R"(PROJCS["WGS 84 / UTM zone {}{}",{},PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],)"
      R"(PARAMETER["central_meridian",{}],PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],)"
      R"(PARAMETER["false_northing",{}],UNIT["metre",1,AUTHORITY["EPSG","9001"]],AXIS["Easting",EAST],)"
      R"(AXIS["Northing",NORTH],AUTHORITY["EPSG","{}"]])",
      zone, north ? 'N' : 'S', kWgs84Wkt, 6 * zone - 183, north ? 0 : 10000000, (north ? 32600 : 32700) + zone);
}

int EpsgOf(const std::string& code, const Geodetic& near) {
  if (code.empty()) return 4326;
  if (code == "utm") return UtmFromGeodetic(near).EpsgCode();
  const std::string_view digits = std::string_view(code).substr(code.find(':') + 1);
  const auto number = ParseInt(digits);
  const std::string authority = code.substr(0, code.size() - digits.size());
  if (!number || *number < 1 || *number > 1'000'000 || (authority != "EPSG:" && authority != "epsg:")) {
    throw OptionError("--crs " + code + ": expected EPSG:N, e.g. EPSG:4326 or EPSG:32632, or utm");
  }
  return static_cast<int>(*number);
}

}  // namespace

struct Crs::Proj {
#ifdef TRIGPOINT_HAVE_PROJ
  ~Proj() {
    proj_destroy(transform);
    proj_context_destroy(context);
  }
  PJ_CONTEXT* context = nullptr;
  PJ* transform = nullptr;
#endif
};

Crs::Crs() = default;
Crs::~Crs() = default;
Crs::Crs(Crs&&) noexcept = default;

#ifdef TRIGPOINT_HAVE_PROJ
void Crs::OpenProj(const std::string& code, const Geodetic& near) {
  const std::string name = fmt::format("EPSG:{}", epsg_);
  proj_ = std::make_unique<Proj>();
  PJ_CONTEXT* context = proj_->context = proj_context_create();
  proj_log_level(context, PJ_LOG_NONE);
  PJ* target = proj_create(context, name.c_str());
  const PJ_TYPE type = target == nullptr ? PJ_TYPE_UNKNOWN : proj_get_type(target);
  if (type != PJ_TYPE_PROJECTED_CRS && type != PJ_TYPE_GEOGRAPHIC_2D_CRS) {
    proj_destroy(target);
    throw OptionError("--crs " + code +
                      (type == PJ_TYPE_UNKNOWN ? ": PROJ knows no such system"
                                               : ": expected a projected or geographic system of two axes; heights are "
                                                 "chosen by --heights"));
  }
  geographic_ = type == PJ_TYPE_GEOGRAPHIC_2D_CRS;
  name_ = proj_get_name(target);
  const char* wkt = proj_as_wkt(context, target, PJ_WKT1_GDAL, nullptr);
  wkt_ = wkt == nullptr ? "undefined" : wkt;
  proj_destroy(target);
  ChooseTransform(code, near);
}

void Crs::ChooseTransform(const std::string& code, const Geodetic& near) {
  PJ_CONTEXT* context = proj_->context;
  const std::string name = fmt::format("EPSG:{}", epsg_);
  PJ_AREA* area = proj_area_create();
  proj_area_set_bbox(area, near.longitude_deg - 0.01, near.latitude_deg - 0.01, near.longitude_deg + 0.01,
                     near.latitude_deg + 0.01);
  // Operations that hold here; else, near the border of where they do, any that there is. One that only takes the
  // numbers over from one datum to the other ("ballpark") is off by up to hundreds of metres.
  bool ballpark = true;
  for (PJ_AREA* where : {area, static_cast<PJ_AREA*>(nullptr)}) {
    if (!ballpark) break;
    PJ* raw = proj_create_crs_to_crs(context, "EPSG:4326", name.c_str(), where);
    if (raw == nullptr) continue;
    proj_destroy(proj_->transform);
    proj_->transform = proj_normalize_for_visualization(context, raw);
    proj_destroy(raw);
    if (proj_->transform == nullptr) continue;
    FromGeodetic(near);  // chooses the operation that holds here
    if (PJ* used = proj_trans_get_last_used_operation(proj_->transform)) {
      ballpark = proj_coordoperation_has_ballpark_transformation(context, used) != 0;
      const double accuracy = proj_coordoperation_get_accuracy(context, used);
      accuracy_m_ = accuracy > 0 ? std::optional<double>(accuracy) : std::nullopt;
      proj_destroy(used);
    }
  }
  proj_area_destroy(area);
  if (proj_->transform == nullptr) throw OptionError("--crs " + code + ": PROJ cannot reach it from WGS 84");
  if (ballpark) {
    throw OptionError("--crs " + code + ": PROJ knows no change of datum from WGS 84 to it, without which positions " +
                      "may be off by hundreds of metres; install its grids (apt install proj-data, or projsync)");
  }
}
#else
void Crs::OpenProj(const std::string& code, const Geodetic&) {
  throw OptionError("--crs " + code +
                    ": this build knows WGS 84 (EPSG:4326) and UTM on it (EPSG:326zz, 327zz) only; install libproj-dev "
                    "and build again for the others");
}
#endif

Crs Crs::Named(const std::string& code, const Geodetic& near) {
  Crs crs;
  crs.epsg_ = EpsgOf(code, near);
  if (crs.epsg_ == 4326) {
    crs.name_ = "WGS 84";
    crs.wkt_ = kWgs84Wkt;
    return crs;
  }
  crs.geographic_ = false;
  const int zone = crs.epsg_ % 100;
  if ((crs.epsg_ / 100 == 326 || crs.epsg_ / 100 == 327) && zone >= 1 && zone <= 60) {
    const bool north = crs.epsg_ / 100 == 326;
    crs.utm_zone_ = north ? zone : -zone;
    crs.name_ = fmt::format("WGS 84 / UTM zone {}{}", zone, north ? 'N' : 'S');
    crs.wkt_ = UtmWkt(zone, north);
    return crs;
  }
  crs.OpenProj(code, near);
  return crs;
}

Eigen::Vector2d Crs::FromGeodetic(const Geodetic& g) const {
  if (epsg_ == 4326) return {g.longitude_deg, g.latitude_deg};
  if (utm_zone_ != 0) {
    const Utm utm = UtmFromGeodetic(g, std::abs(utm_zone_));
    const double other = utm.north == (utm_zone_ > 0) ? 0 : utm.north ? 1e7 : -1e7;  // across the equator
    return {utm.easting_m, utm.northing_m + other};
  }
#ifdef TRIGPOINT_HAVE_PROJ
  proj_errno_reset(proj_->transform);
  const PJ_COORD out = proj_trans(proj_->transform, PJ_FWD, proj_coord(g.longitude_deg, g.latitude_deg, 0, HUGE_VAL));
  if (std::isfinite(out.xy.x) && std::isfinite(out.xy.y)) return {out.xy.x, out.xy.y};
#endif
  throw InputError(fmt::format("latitude {:.6f}, longitude {:.6f} has no coordinates in EPSG:{} ({})", g.latitude_deg,
                               g.longitude_deg, epsg_, name_));
}

}  // namespace trigpoint

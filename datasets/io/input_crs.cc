#include "datasets/io/input_crs.h"

#include <algorithm>
#include <cmath>

#include "calib/base/error.h"
#include "datasets/io/text.h"

#ifdef TRIGPOINT_HAVE_PROJ
#include <proj.h>
#include <proj_experimental.h>
#endif

namespace trigpoint {

namespace {

std::string Shown(const std::string& text) { return text.size() > 80 ? text.substr(0, 77) + "..." : text; }

// The code of "EPSG:25832", "epsg:25832" or "25832", else 0.
int EpsgCode(const std::string& text) {
  std::string digits = text;
  if (text.starts_with("EPSG:") || text.starts_with("epsg:")) digits.erase(0, 5);
  const auto code = ParseInt(digits);
  return code && *code > 0 && *code < 1'000'000 ? static_cast<int>(*code) : 0;
}

}  // namespace

std::optional<double> LengthUnit(const std::string& name) {
  if (name == "m") return 1;
  if (name == "ft") return 0.3048;
  if (name == "us-ft") return 1200.0 / 3937.0;
  return std::nullopt;
}

struct InputCrs::Proj {
#ifdef TRIGPOINT_HAVE_PROJ
  Proj() {
    proj_log_level(context, PJ_LOG_NONE);
    proj_context_set_enable_network(context, 0);  // what is installed, so that the same input gives the same numbers
  }
  ~Proj() {
    for (PJ* object : {source, target, transform}) proj_destroy(object);
    proj_context_destroy(context);
  }
  // Grids of the best operation that are not installed, with commas.
  std::string MissingGrids() const {
    PJ_OPERATION_FACTORY_CONTEXT* factory = proj_create_operation_factory_context(context, nullptr);
    proj_operation_factory_context_set_grid_availability_use(context, factory, PROJ_GRID_AVAILABILITY_IGNORED);
    proj_operation_factory_context_set_spatial_criterion(context, factory, PROJ_SPATIAL_CRITERION_PARTIAL_INTERSECTION);
    PJ_OBJ_LIST* list = proj_create_operations(context, source, target, factory);
    std::string missing;
    for (int i = 0; list != nullptr && missing.empty() && i < proj_list_get_count(list); ++i) {
      PJ* operation = proj_list_get(context, list, i);
      for (int k = 0; k < proj_coordoperation_get_grid_used_count(context, operation); ++k) {
        const char *name = nullptr, *full = nullptr, *package = nullptr, *url = nullptr;
        int direct = 0, open = 0, available = 0;
        proj_coordoperation_get_grid_used(context, operation, k, &name, &full, &package, &url, &direct, &open,
                                          &available);
        if (name != nullptr && available == 0) missing += (missing.empty() ? "" : ", ") + std::string(name);
      }
      proj_destroy(operation);
    }
    proj_list_destroy(list);
    proj_operation_factory_context_destroy(factory);
    return missing;
  }
  struct Axes {
    int count = 0;
    bool degrees = false;        // longitude and latitude
    double unit[3] = {1, 1, 1};  // in metres, where they are lengths
  };
  Axes AxesOf(PJ* part) const {
    Axes axes;
    PJ* system = proj_crs_get_coordinate_system(context, part);
    if (system == nullptr) return axes;
    axes.count = std::min(proj_cs_get_axis_count(context, system), 3);
    axes.degrees = proj_cs_get_type(context, system) == PJ_CS_TYPE_ELLIPSOIDAL;
    for (int k = 0; k < axes.count; ++k) {
      proj_cs_get_axis_info(context, system, k, nullptr, nullptr, nullptr, &axes.unit[k], nullptr, nullptr, nullptr);
    }
    proj_destroy(system);
    return axes;
  }
  // Makes the transformation from `source`.
  void Connect() {
    target = proj_create(context, "EPSG:4979");
    PJ* raw = source == nullptr || target == nullptr
                  ? nullptr
                  : proj_create_crs_to_crs_from_pj(context, source, target, nullptr, nullptr);
    if (raw != nullptr) transform = proj_normalize_for_visualization(context, raw);
    proj_destroy(raw);
  }
  // Is the ellipsoid that of WGS 84 or GRS 80, to a tenth of a millimetre the same?
  bool HasModernEllipsoid() const {
    PJ* ellipsoid = proj_get_ellipsoid(context, source);
    double semi_major = 0, inverse_flattening = 0;
    if (ellipsoid != nullptr)
      proj_ellipsoid_get_parameters(context, ellipsoid, &semi_major, nullptr, nullptr, &inverse_flattening);
    proj_destroy(ellipsoid);
    return std::abs(semi_major - 6378137) < 1e-3 && std::abs(inverse_flattening - 298.257223) < 1e-5;
  }
  PJ_CONTEXT* context = proj_context_create();
  PJ *source = nullptr, *target = nullptr, *transform = nullptr;
#endif
};

InputCrs::InputCrs() = default;
InputCrs::~InputCrs() = default;
InputCrs::InputCrs(InputCrs&&) noexcept = default;

InputCrs InputCrs::Named(const std::string& text) {
  InputCrs crs;
  crs.text_ = text;
  const int code = EpsgCode(text), zone = code % 100;
  crs.name_ = code > 0 ? "EPSG:" + std::to_string(code) : Shown(text);
  if (code == 4326 || code == 4979) return crs;
  const bool etrs89 = code >= 25828 && code <= 25838;
  if (etrs89 || ((code / 100 == 326 || code / 100 == 327) && zone >= 1 && zone <= 60)) {
    crs.utm_zone_ = etrs89 || code / 100 == 326 ? zone : -zone;
    crs.geographic_ = false;
    return crs;
  }
#ifdef TRIGPOINT_HAVE_PROJ
  crs.proj_ = std::make_unique<Proj>();
  Proj& proj = *crs.proj_;
  std::string written = code > 0 ? crs.name_ : text;
  if (written.starts_with("+") && written.find("+type=crs") == std::string::npos) written += " +type=crs";
  PJ* given = proj_create(proj.context, written.c_str());
  if (given == nullptr || proj_is_crs(given) == 0) {
    proj_destroy(given);
    throw InputError("expected a coordinate reference system (an EPSG code, a PROJ string or WKT), found '" +
                     Shown(text) + "', which PROJ does not know");
  }
  const PJ_TYPE type = proj_get_type(given);
  crs.has_vertical_ =
      type == PJ_TYPE_COMPOUND_CRS || type == PJ_TYPE_GEOGRAPHIC_3D_CRS || type == PJ_TYPE_GEOCENTRIC_CRS;
  // Axes and units are those of the horizontal and the vertical part.
  PJ* horizontal = type == PJ_TYPE_COMPOUND_CRS ? proj_crs_get_sub_crs(proj.context, given, 0) : nullptr;
  PJ* vertical = type == PJ_TYPE_COMPOUND_CRS ? proj_crs_get_sub_crs(proj.context, given, 1) : nullptr;
  if (type == PJ_TYPE_BOUND_CRS) horizontal = proj_get_source_crs(proj.context, given);
  const Proj::Axes axes = proj.AxesOf(horizontal != nullptr ? horizontal : given);
  crs.geographic_ = axes.degrees;
  crs.unit_m_ = axes.unit[0];
  crs.has_vertical_ = crs.has_vertical_ || axes.count == 3;
  if (crs.has_vertical_) crs.height_unit_m_ = vertical != nullptr ? proj.AxesOf(vertical).unit[0] : axes.unit[2];
  proj_destroy(horizontal);
  proj_destroy(vertical);
  if (const char* name = proj_get_name(given); name != nullptr && std::string(name) != "unknown") {
    crs.name_ = code > 0 ? crs.name_ + " (" + name + ")" : name;
  }
  // Heights of a system without them are above the ellipsoid.
  if (!crs.has_vertical_) {
    proj.source = proj_crs_promote_to_3D(proj.context, nullptr, given);
    proj_destroy(given);
  } else {
    proj.source = given;
  }
  proj.Connect();
  if (proj.transform == nullptr) throw InputError(crs.name_ + ": PROJ has no transformation from it to WGS 84");
  return crs;
#else
  throw InputError(crs.name_ +
                   ": this build knows WGS 84 (EPSG:4326), UTM on it (EPSG:326zz, 327zz) and on ETRS89 (EPSG:258zz) "
                   "only; install libproj-dev and build again for the others");
#endif
}

Geodetic InputCrs::ToWgs84(double x, double y, double z) const {
  if (utm_zone_ != 0) return GeodeticFromUtm({std::abs(utm_zone_), utm_zone_ > 0, x, y}, z);
  if (proj_ == nullptr) return {y, x, z};
#ifdef TRIGPOINT_HAVE_PROJ
  proj_errno_reset(proj_->transform);
  PJ_COORD out = proj_trans(proj_->transform, PJ_FWD, proj_coord(x, y, z, HUGE_VAL));
  // Without heights of its own a system gives easting and northing: the height is that above the ellipsoid of WGS 84,
  // and the one above the system's own ellipsoid is searched for.
  double own = z;
  for (int i = 0; !has_vertical_ && i < 3 && std::isfinite(out.xyz.z) && out.xyz.z != z; ++i) {
    own += z - out.xyz.z;
    out = proj_trans(proj_->transform, PJ_FWD, proj_coord(x, y, own, HUGE_VAL));
  }
  PJ* used = proj_trans_get_last_used_operation(proj_->transform);
  bool ballpark = used == nullptr;
  if (used != nullptr) {
    ballpark = proj_coordoperation_has_ballpark_transformation(proj_->context, used) != 0;
    const double accuracy = proj_coordoperation_get_accuracy(proj_->context, used);
    accuracy_m_ = accuracy > 0 ? std::optional<double>(accuracy) : std::nullopt;
    proj_destroy(used);
  }
  const bool finite = std::isfinite(out.xyz.x) && std::isfinite(out.xyz.y) && std::isfinite(out.xyz.z);
  if (finite && !ballpark) return {out.xyz.y, out.xyz.x, out.xyz.z};
  const std::string missing = proj_->MissingGrids();
  if (!missing.empty() && (has_vertical_ || !proj_->HasModernEllipsoid())) {
    throw InputError(name_ + ": its transformation to WGS 84 needs the grid " + missing +
                     ", which is not installed; get it by: apt install proj-data, or projsync --file " +
                     missing.substr(0, missing.find(',')));
  }
  if (finite && ballpark && !has_vertical_ && proj_->HasModernEllipsoid()) {
    datum_assumed_ = true;
    return {out.xyz.y, out.xyz.x, out.xyz.z};
  }
  if (finite && has_vertical_) {
    throw InputError(name_ +
                     ": PROJ has no transformation from its heights to ellipsoidal heights; give the crs without "
                     "them, and height_system: ellipsoidal, a geoid's name or its grid's file");
  }
  if (finite) {
    throw InputError(name_ +
                     ": PROJ knows no change of datum from it to WGS 84, without which positions may be off by "
                     "hundreds of metres; name the datum (an EPSG code, or +towgs84=)");
  }
#endif
  throw InputError("x " + std::to_string(x) + ", y " + std::to_string(y) + ", height " + std::to_string(z) +
                   " is no position of " + name_ + "; are easting and northing (longitude and latitude) swapped?");
}

}  // namespace trigpoint

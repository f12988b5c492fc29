// Mapillary's Graph API, version 4, as documented at mapillary.com/developer/api-documentation: images by box (at most
// 0.01 deg a side, 2000 an answer), a token in the Authorization header, picture addresses that expire.
#include <fmt/format.h>

#include <cmath>

#include "calib/base/error.h"
#include "calib/geometry/so3.h"
#include "datasets/import/providers/listing_service.h"
#include "datasets/io/capture_date.h"

namespace trigpoint {
namespace {

using nlohmann::json;

constexpr double kMapillaryBox_deg = 0.0099;
constexpr size_t kItemsPerAnswer = 2000;
const char* const kFields =
    "id,captured_at,geometry,computed_geometry,compass_angle,computed_compass_angle,computed_rotation,is_pano,"
    "camera_type,width,height,creator";

std::string DateOf(std::optional<double> captured_at_ms) {
  if (!captured_at_ms || *captured_at_ms < 0 || *captured_at_ms > 4e12) return "";
  return UtcOfSeconds(std::llround(*captured_at_ms) / 1000);
}

// The tilt that the reconstruction has computed: a rotation vector from the world's axes (east, north, up) to the
// camera's (right, down, forward). Left out where its heading is not the computed one: then the axes are others.
void TakeTilt(const json& image, PanoramaRecord* record) {
  constexpr double kSame_rad = 5 * kDegToRad;
  const auto vector = image.find("computed_rotation");
  if (!record->heading_deg || vector == image.end() || !vector->is_array() || vector->size() != 3) return;
  Eigen::Vector3d cam_from_world;
  for (Eigen::Index k = 0; k < 3; ++k) {
    const json& value = (*vector)[static_cast<size_t>(k)];
    if (!value.is_number() || !(std::abs(value.get<double>()) < 10)) return;
    cam_from_world[k] = value.get<double>();
  }
  const Attitude attitude = AttitudeOf(ExpSO3(cam_from_world).conjugate());
  if (std::abs(WrapAngle(attitude.heading_rad - *record->heading_deg * kDegToRad)) > kSame_rad) return;
  record->pitch_deg = attitude.pitch_rad * kRadToDeg;
  record->roll_deg = attitude.roll_rad * kRadToDeg;
}

class Mapillary final : public ListingService {
 public:
  // Positions and headings that Mapillary's reconstruction has computed, where there are any.
  explicit Mapillary(const ServiceOptions& options) : ListingService("mapillary", "Mapillary", options) {
    client_.AddHeader("Authorization", "OAuth " + options.token);
  }

  PanoramaPicture Load(const PanoramaRecord& record, int width, const CancelToken& cancel) override {
    // Addresses hold for a while only: asked for when they are used.
    const std::string field = width > 0 && width <= 2048 ? "thumb_2048_url" : "thumb_original_url";
    const json answer =
        GetJson(client_, Name(), fmt::format("{}/{}?fields={}", client_.base(), record.id, field), cancel);
    const auto url = answer.find(field);
    if (url == answer.end() || !url->is_string()) {
      throw InputError("mapillary: panorama " + record.id + " has no " + field);
    }
    return GetPicture(client_, Name(), record.id, url->get<std::string>(), width, cancel);
  }

 private:
  void Search(const SearchArea& area, const CancelToken& cancel) override {
    for (const Box& box : BoxesOf(area, kMapillaryBox_deg)) FindInBox(box, 0, cancel);
  }

  // A box whose answer is full is cut into four: the service has no pages.
  void FindInBox(const Box& box, int halvings, const CancelToken& cancel) {
    const auto [west, south, east, north] = box;
    const std::string url = fmt::format("{}/images?is_pano=true&fields={}&limit={}&bbox={:.7f},{:.7f},{:.7f},{:.7f}",
                                        client_.base(), kFields, kItemsPerAnswer, west, south, east, north);
    const json answer = GetJson(client_, Name(), url, cancel);
    const json& data = ListIn(answer, "data", url);
    if (data.size() >= kItemsPerAnswer &&
        Divide(box, halvings, [&](const Box& quarter) { FindInBox(quarter, halvings + 1, cancel); })) {
      return;
    }
    for (const json& image : data) Take(image);
  }

  void Take(const json& image) {
    if (!image.is_object()) return;
    const auto pano = image.find("is_pano");
    const std::string camera = TextIn(image, "camera_type");
    if (pano == image.end() || *pano != true ||
        (!camera.empty() && camera != "spherical" && camera != "equirectangular")) {
      return;
    }
    PanoramaRecord record;
    record.id = TextIn(image, "id");
    const json* computed = ObjectIn(image, "computed_geometry");
    const json* stated = ObjectIn(image, "geometry");
    auto position = computed != nullptr ? PointOf(*computed) : std::nullopt;
    auto heading = NumberIn(image, position ? "computed_compass_angle" : "compass_angle");
    if (!heading) heading = NumberIn(image, "compass_angle");
    record.heading_deg = HeadingOf(heading);
    if (position) TakeTilt(image, &record);
    if (!position && stated != nullptr) position = PointOf(*stated);
    record.date = DateOf(NumberIn(image, "captured_at"));
    if (const json* creator = ObjectIn(image, "creator")) record.owner = TextIn(*creator, "username");
    record.licence = kByTerms;
    record.width_px = WidthOf(NumberIn(image, "width"));
    Keep(std::move(record), position, true);
  }
};

}  // namespace

std::unique_ptr<PanoramaProvider> OpenMapillary(const ServiceOptions& options) {
  return std::make_unique<Mapillary>(options);
}

}  // namespace trigpoint

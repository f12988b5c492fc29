#include "datasets/io/exif.h"

#include <algorithm>
#include <cmath>
#include <exiv2/exiv2.hpp>
#include <mutex>
#include <nlohmann/json.hpp>

#include "calib/base/error.h"
#include "datasets/io/exif_positions.h"
#include "datasets/io/natural_order.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

constexpr double kLongSide35mm = 36;

class Tags {
 public:
  explicit Tags(const Exiv2::ExifData& data) : data_(data) {}
  const Exiv2::Exifdatum* Find(const char* key) const {
    const auto it = data_.findKey(Exiv2::ExifKey(key));
    return it == data_.end() || it->count() == 0 ? nullptr : &*it;
  }
  std::optional<double> Number(const char* key, long index = 0) const {
    const Exiv2::Exifdatum* datum = Find(key);
    if (datum == nullptr || datum->count() <= index) return std::nullopt;
    const Exiv2::Rational r = datum->toRational(index);
    const double value = r.second != 0 ? static_cast<double>(r.first) / r.second : datum->toFloat(index);
    return std::isfinite(value) && r.second != 0 ? std::optional<double>(value) : std::nullopt;
  }
  std::string Text(const char* key) const {
    const Exiv2::Exifdatum* datum = Find(key);
    if (datum == nullptr) return "";
    std::string text = datum->toString();
    text.erase(std::find(text.begin(), text.end(), '\0'), text.end());
    return std::string(Trim(text));
  }

 private:
  const Exiv2::ExifData& data_;
};

// Degrees, minutes, seconds with the hemisphere's letter.
std::optional<double> Angle(const Tags& tags, const char* key, const char* ref_key, char negative) {
  const std::optional<double> degrees = tags.Number(key, 0);
  if (!degrees) return std::nullopt;
  const double value = *degrees + tags.Number(key, 1).value_or(0) / 60 + tags.Number(key, 2).value_or(0) / 3600;
  return tags.Text(ref_key).starts_with(negative) ? -value : value;
}

// GPSAltitudeRef 0 and 1 are above and below the sea up to EXIF 2.32, and above and below the ellipsoid from EXIF 3.0
// on, which has 2 and 3 for the sea (CIPA DC-008-2023, 4.6.7.1.6). The GPS tags state a version of their own, 2.4 in
// EXIF 3.0; it decides where it is stated, since programs that know EXIF 2 alone add GPS tags to pictures of newer
// cameras.
bool IsAboveSea(const Tags& tags, double altitude_ref) {
  if (altitude_ref >= 2) return true;
  const auto major = tags.Number("Exif.GPSInfo.GPSVersionID", 0), minor = tags.Number("Exif.GPSInfo.GPSVersionID", 1);
  if (major && minor) return *major != 2 || *minor < 4;
  const auto tens = tags.Number("Exif.Photo.ExifVersion", 0), ones = tags.Number("Exif.Photo.ExifVersion", 1);
  return !tens || !ones || 10 * (*tens - '0') + (*ones - '0') < 3;  // "0300": a digit a byte
}

void ReadGps(const Tags& tags, PhotoMetadata* metadata) {
  const auto latitude = Angle(tags, "Exif.GPSInfo.GPSLatitude", "Exif.GPSInfo.GPSLatitudeRef", 'S');
  const auto longitude = Angle(tags, "Exif.GPSInfo.GPSLongitude", "Exif.GPSInfo.GPSLongitudeRef", 'W');
  // Phones without a fix write 0, 0.
  if (latitude && longitude && std::abs(*latitude) <= 90 && std::abs(*longitude) <= 180 &&
      (*latitude != 0 || *longitude != 0)) {
    metadata->position = Geodetic{*latitude, *longitude, 0};
    if (const auto height = tags.Number("Exif.GPSInfo.GPSAltitude")) {
      const auto ref = tags.Number("Exif.GPSInfo.GPSAltitudeRef");
      metadata->position->height_m = ref == 1 || ref == 3 ? -*height : *height;
      metadata->has_height = true;
      metadata->height_above_sea = ref && IsAboveSea(tags, *ref);
    }
    const auto error = tags.Number("Exif.GPSInfo.GPSHPositioningError");
    if (error && *error > 0) metadata->sigma_h_m = error;
    const auto dilution = tags.Number("Exif.GPSInfo.GPSDOP");
    constexpr double kMostDilution = 100;  // beyond it the tag holds something else
    if (dilution && *dilution > 0 && *dilution < kMostDilution) metadata->dilution = dilution;
  }
  const std::string north = tags.Text("Exif.GPSInfo.GPSImgDirectionRef");
  if (!north.starts_with('M')) metadata->heading_deg = tags.Number("Exif.GPSInfo.GPSImgDirection");
}

void ReadTime(const Tags& tags, PhotoMetadata* metadata) {
  std::string time = tags.Text("Exif.Photo.DateTimeOriginal");
  if (time.size() < 19) return;
  time = time.substr(0, 19);
  time[4] = time[7] = '-';
  const std::string subsec = tags.Text("Exif.Photo.SubSecTimeOriginal");
  if (!subsec.empty() && subsec.find_first_not_of("0123456789") == std::string::npos) time += "." + subsec;
  const std::string zone = tags.Text("Exif.Photo.OffsetTimeOriginal");
  metadata->taken_utc_ns = ParseUtcToNs(time + zone);
  metadata->taken_zone_known = !zone.empty() && metadata->taken_utc_ns.has_value();
  if (!metadata->taken_utc_ns) metadata->taken_utc_ns = ParseUtcToNs(time);
}

void ReadFocal(const Tags& tags, PhotoMetadata* metadata) {
  const double width = metadata->width, height = metadata->height;
  if (width <= 0 || height <= 0) return;
  const auto equivalent = tags.Number("Exif.Photo.FocalLengthIn35mmFilm");
  if (equivalent && *equivalent > 0) {
    metadata->focal_px = *equivalent / kLongSide35mm * std::max(width, height);
    return;
  }
  const auto focal_mm = tags.Number("Exif.Photo.FocalLength");
  const auto resolution = tags.Number("Exif.Photo.FocalPlaneXResolution");
  if (!focal_mm || !resolution || *focal_mm <= 0 || *resolution <= 0) return;
  const int unit = static_cast<int>(tags.Number("Exif.Photo.FocalPlaneResolutionUnit").value_or(2));
  const double unit_mm = unit == 3 ? 10 : unit == 4 ? 1 : unit == 5 ? 1e-3 : 25.4;
  // The resolution counts pixels of the picture as taken; a smaller copy keeps the tag and says its old size. A copy
  // that was turned upright keeps it, too: the long sides are compared.
  const double taken_width = tags.Number("Exif.Photo.PixelXDimension").value_or(width);
  const auto taken_height = tags.Number("Exif.Photo.PixelYDimension");
  const bool both = taken_height && *taken_height > 0;
  const double now = both ? std::max(width, height) : width;
  const double taken = both ? std::max(taken_width, *taken_height) : taken_width;
  metadata->focal_px = *focal_mm * *resolution / unit_mm * (taken > 0 ? now / taken : 1);
}

std::optional<GPano> ReadGPano(const Exiv2::XmpData& xmp) {
  GPano pano;
  bool found = false;
  const auto text = [&](const char* name) -> std::string {
    const auto it = xmp.findKey(Exiv2::XmpKey(std::string("Xmp.GPano.") + name));
    if (it == xmp.end()) return "";
    found = true;
    return it->toString();
  };
  const auto number = [&](const char* name) {
    const auto value = ParseDouble(text(name));
    return value && std::isfinite(*value) ? value : std::nullopt;
  };
  const auto pixels = [&](const char* name) {
    return static_cast<int>(std::clamp(number(name).value_or(0), -1e9, 1e9));
  };
  pano.projection = text("ProjectionType");
  pano.heading_deg = number("PoseHeadingDegrees");
  pano.pitch_deg = number("PosePitchDegrees");
  pano.roll_deg = number("PoseRollDegrees");
  pano.full_width = pixels("FullPanoWidthPixels");
  pano.full_height = pixels("FullPanoHeightPixels");
  pano.crop_left = pixels("CroppedAreaLeftPixels");
  pano.crop_top = pixels("CroppedAreaTopPixels");
  pano.crop_width = pixels("CroppedAreaImageWidthPixels");
  pano.crop_height = pixels("CroppedAreaImageHeightPixels");
  return found ? std::optional<GPano>(pano) : std::nullopt;
}

// Mapillary's tools put what the phone knew into the description, as JSON.
void ReadMapillary(const std::string& description, PhotoMetadata* metadata) {
  if (description.find("MAPLatitude") == std::string::npos) return;
  const nlohmann::json map = nlohmann::json::parse(description, nullptr, false);
  if (!map.is_object()) return;
  const auto number = [](const nlohmann::json& object, const char* key) -> std::optional<double> {
    const auto it = object.find(key);
    return it != object.end() && it->is_number() ? std::optional<double>(it->get<double>()) : std::nullopt;
  };
  const auto latitude = number(map, "MAPLatitude"), longitude = number(map, "MAPLongitude");
  if (latitude && longitude && std::abs(*latitude) <= 90 && std::abs(*longitude) <= 180) {
    const auto altitude = number(map, "MAPAltitude");
    metadata->position = Geodetic{*latitude, *longitude, altitude.value_or(0)};
    metadata->has_height = altitude.has_value();
    metadata->height_above_sea = altitude.has_value();
    if (const auto accuracy = number(map, "MAPGPSAccuracyMeters"); accuracy && *accuracy > 0)
      metadata->sigma_h_m = accuracy;
  }
  const auto compass = map.find("MAPCompassHeading");
  if (compass != map.end() && compass->is_object()) {
    if (const auto heading = number(*compass, "TrueHeading")) metadata->heading_deg = heading;
  }
  // 2016_08_05_14_31_17_512, UTC.
  const std::string time = map.contains("MAPCaptureTime") && map["MAPCaptureTime"].is_string()
                               ? map["MAPCaptureTime"].get<std::string>()
                               : "";
  if (time.size() >= 19 && !metadata->taken_utc_ns) {
    std::string utc = time.substr(0, 4) + "-" + time.substr(5, 2) + "-" + time.substr(8, 2) + "T" + time.substr(11, 2) +
                      ":" + time.substr(14, 2) + ":" + time.substr(17, 2);
    if (time.size() > 20) utc += "." + time.substr(20);
    metadata->taken_utc_ns = ParseUtcToNs(utc + "Z");
    metadata->taken_zone_known = metadata->taken_utc_ns.has_value();
  }
}

}  // namespace

PhotoMetadata ReadPhotoMetadata(const std::filesystem::path& file) {
  std::error_code error;
  const auto size = std::filesystem::file_size(file, error);
  if (error) throw InputError(file.string() + ": there is no such picture");
  if (size == 0) throw InputError(file.string() + ": the picture is empty (0 bytes)");
  // Exiv2's XMP parser has global state.
  static std::mutex mutex;
  const std::lock_guard<std::mutex> lock(mutex);
  static const bool quiet = [] {
    Exiv2::XmpParser::initialize();
    Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute);
    return true;
  }();
  static_cast<void>(quiet);
  PhotoMetadata metadata;
  try {
    const auto image = Exiv2::ImageFactory::open(file.string());
    image->readMetadata();
    metadata.width = image->pixelWidth();
    metadata.height = image->pixelHeight();
    const Tags tags(image->exifData());
    const double orientation = tags.Number("Exif.Image.Orientation").value_or(1);
    if (orientation >= 1 && orientation <= 8) metadata.orientation = static_cast<int>(orientation);
    ReadFocal(tags, &metadata);
    ReadGps(tags, &metadata);
    ReadTime(tags, &metadata);
    ReadMapillary(tags.Text("Exif.Image.ImageDescription"), &metadata);
    metadata.gpano = ReadGPano(image->xmpData());
  } catch (const Exiv2::AnyError& e) {
    throw InputError(file.string() + ": its headers cannot be read as a picture's: " + e.what());
  }
  return metadata;
}

std::optional<Camera> CameraFromMetadata(const PhotoMetadata& metadata) {
  if (!metadata.focal_px || metadata.width <= 0 || metadata.height <= 0) return std::nullopt;
  const cv::Size shown = metadata.ShownSize();
  return Camera(CameraModel::kPinhole, shown.width, shown.height,
                {*metadata.focal_px, *metadata.focal_px, 0.5 * (shown.width - 1), 0.5 * (shown.height - 1)});
}

GeoTag GeoTagFromMetadata(const PhotoMetadata& metadata, const std::filesystem::path& file,
                          std::vector<std::string>* warnings) {
  GeoTag tag;
  if (metadata.position) {
    tag.has_position = true;
    tag.position = *metadata.position;
    tag.has_height = metadata.has_height;
    tag.sigma_h_m = metadata.sigma_h_m.value_or(tag.sigma_h_m);
    if (metadata.has_height && metadata.height_above_sea) {
      warnings->push_back(file.string() +
                          ": EXIF marks the height as above sea level; it is taken as above the ellipsoid. If it is "
                          "not, list the picture in a table with height_m above the ellipsoid");
    }
  }
  if (metadata.gpano && metadata.gpano->heading_deg) {
    tag.has_heading = true;
    tag.attitude.heading_rad = *metadata.gpano->heading_deg * kDegToRad;
  } else if (metadata.heading_deg) {
    tag.has_heading = true;
    tag.attitude.heading_rad = *metadata.heading_deg * kDegToRad;
  }
  if (metadata.gpano && (metadata.gpano->pitch_deg || metadata.gpano->roll_deg)) {
    tag.has_tilt = true;
    tag.attitude.pitch_rad = metadata.gpano->pitch_deg.value_or(0) * kDegToRad;
    tag.attitude.roll_rad = metadata.gpano->roll_deg.value_or(0) * kDegToRad;
  }
  return tag;
}

bool IsPictureName(const std::filesystem::path& file) {
  const std::string extension = Lower(file.extension().string());
  return extension == ".jpg" || extension == ".jpeg" || extension == ".png" || extension == ".tif" ||
         extension == ".tiff";
}

bool IsVideoName(const std::filesystem::path& file) {
  static const std::vector<std::string> known = {".mp4", ".mov", ".avi", ".mkv", ".m4v", ".webm", ".mpg", ".mpeg",
                                                 ".ts",  ".mts", ".wmv", ".3gp", ".ogv", ".insv", ".360"};
  return std::find(known.begin(), known.end(), Lower(file.extension().string())) != known.end();
}

std::vector<std::filesystem::path> PicturesIn(const std::filesystem::path& dir) {
  std::vector<std::filesystem::path> pictures;
  if (!std::filesystem::is_directory(dir)) return pictures;
  for (const auto& entry : std::filesystem::directory_iterator(dir)) {
    if (entry.is_regular_file() && IsPictureName(entry.path()) && !entry.path().filename().string().starts_with('.')) {
      pictures.push_back(entry.path());
    }
  }
  std::sort(pictures.begin(), pictures.end(),
            [](const auto& a, const auto& b) { return NaturalLess(a.filename().string(), b.filename().string()); });
  return pictures;
}

}  // namespace trigpoint

#include "datasets/io/image.h"

#include <fmt/format.h>

#include <climits>
#include <cmath>
#include <cstring>
#include <fstream>
#include <new>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include "calib/base/error.h"
#include "datasets/io/exif.h"
#include "datasets/io/picture_parts.h"
#include "datasets/io/video.h"

namespace trigpoint {
namespace {

std::string Size(int width, int height) { return std::to_string(width) + " x " + std::to_string(height); }

std::vector<uchar> ReadBytes(const std::filesystem::path& file) {
  const uintmax_t size = PictureFileSize(file);
  std::vector<uchar> bytes(size);
  std::ifstream in(file, std::ios::binary);
  if (!in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size))) {
    throw IoError(file.string() + ": the picture cannot be read");
  }
  return bytes;
}

// Where a JPEG's coded pixels begin, past headers, thumbnails and previews; 0 if there are none.
size_t JpegScanBegin(const std::vector<uchar>& b) {
  constexpr uchar kStartOfScan = 0xDA, kFill = 0xFF;
  for (size_t at = 2; at + 4 <= b.size() && b[at] == 0xFF;) {
    const uchar marker = b[at + 1];
    if (marker == kFill) {
      ++at;
      continue;
    }
    at += 2 + (static_cast<size_t>(b[at + 2]) << 8 | b[at + 3]);
    if (marker == kStartOfScan) return at <= b.size() ? at : 0;
  }
  return 0;
}

bool IsTiff(const std::vector<uchar>& b) {
  return b.size() > 4 && (std::memcmp(b.data(), "II*", 4) == 0 || std::memcmp(b.data(), "MM\0*", 4) == 0);
}

// Pixels across and down as stored, from the header of a PNG, JPEG or TIFF; nothing for other kinds.
std::optional<cv::Size> StoredSize(const std::filesystem::path& file, const std::vector<uchar>& b) {
  if (IsTiff(b)) {
    try {
      const PhotoMetadata metadata = ReadPhotoMetadata(file);
      if (metadata.width > 0 && metadata.height > 0) return cv::Size(metadata.width, metadata.height);
    } catch (const InputError&) {  // said by who decodes it
    }
    return std::nullopt;
  }
  const auto number = [&](size_t at, size_t bytes) {
    int64_t value = 0;
    for (size_t k = 0; k < bytes; ++k) value = value << 8 | b[at + k];
    return static_cast<int>(std::min<int64_t>(value, INT_MAX));
  };
  constexpr size_t kPngWidth = 16, kPngHeight = 20;
  if (b.size() >= kPngHeight + 4 && std::memcmp(b.data(), "\x89PNG", 4) == 0) {
    return cv::Size(number(kPngWidth, 4), number(kPngHeight, 4));
  }
  if (b.size() < 4 || b[0] != 0xFF || b[1] != 0xD8) return std::nullopt;
  for (size_t at = 2; at + 9 < b.size() && b[at] == 0xFF;) {
    const uchar marker = b[at + 1];
    if (marker == 0xFF) {
      ++at;
      continue;
    }
    // Start of frame: 0xC0 to 0xCF, but tables.
    if (marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC) {
      return cv::Size(number(at + 7, 2), number(at + 5, 2));
    }
    at += 2 + static_cast<size_t>(number(at + 2, 2));
  }
  return std::nullopt;
}

// A block of 8 x 8 pixels takes a bit at least, in its first scan. A few bytes may state gigabytes otherwise.
bool HoldsItsBlocks(const std::vector<uchar>& jpeg, const cv::Size& size) {
  return 8 * 64 * static_cast<double>(jpeg.size()) >= static_cast<double>(size.width) * size.height;
}

// libjpeg fills what is missing with grey and calls it a success: look for the end marker ourselves.
void CheckComplete(const std::filesystem::path& file, const std::vector<uchar>& b) {
  const auto truncated = [&] {
    throw InputError(file.string() + ": the picture is cut off (" + std::to_string(b.size()) +
                     " bytes, its end is missing); copy it again");
  };
  if (b.size() >= 3 && b[0] == 0xFF && b[1] == 0xD8) {
    if (const auto size = StoredSize(file, b); size && !HoldsItsBlocks(b, *size)) {
      throw InputError(fmt::format("{}: the picture is cut off: {} bytes are too few for {} x {} pixels; copy it again",
                                   file.string(), b.size(), size->width, size->height));
    }
    if (b[b.size() - 2] == 0xFF && b[b.size() - 1] == 0xD9) return;  // the usual case
    const size_t begin = JpegScanBegin(b);
    if (begin == 0 || memmem(b.data() + begin, b.size() - begin, "\xFF\xD9", 2) == nullptr) truncated();
  } else if (b.size() >= 8 && std::memcmp(b.data(), "\x89PNG", 4) == 0) {
    if (memmem(b.data() + 8, b.size() - 8, "IEND", 4) == nullptr) truncated();
  }
}

// 16 bit to 8 by the bits in use: cameras store 10, 12 or 14 bits in 16.
cv::Mat ToEightBits(const std::filesystem::path& file, const cv::Mat& picture) {
  if (picture.depth() == CV_8U) return picture;
  if (picture.depth() != CV_16U) {
    throw InputError(file.string() + ": expected 8 or 16 bits a channel, found another kind of pixel");
  }
  double most = 0;
  cv::minMaxLoc(picture.reshape(1), nullptr, &most);
  int bits = 16;
  for (int candidate : {14, 12, 10, 8}) {
    if (most < (1 << candidate)) bits = candidate;
  }
  cv::Mat eight;
  picture.convertTo(eight, CV_8U, 255.0 / ((1 << bits) - 1));
  return eight;
}

// EXIF 1..8, as stored to as shown.
cv::Mat Oriented(const cv::Mat& stored, int orientation) {
  cv::Mat shown = stored;
  if (orientation >= 5) cv::transpose(stored, shown);
  if (orientation == 2 || orientation == 6) cv::flip(shown, shown, 1);
  if (orientation == 3 || orientation == 7) cv::flip(shown, shown, -1);
  if (orientation == 4 || orientation == 8) cv::flip(shown, shown, 0);
  return shown;
}

cv::Mat Decode(const std::filesystem::path& file, const std::vector<uchar>& bytes, bool grey, bool raw_orientation) {
  constexpr int64_t kMostPixels = int64_t{1} << 30;  // what OpenCV decodes
  if (const auto size = StoredSize(file, bytes); size && int64_t{size->width} * size->height > kMostPixels) {
    throw InputError(file.string() + ": expected a picture of at most 2^30 pixels, found " +
                     Size(size->width, size->height));
  }
  int flags = (grey ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR) | cv::IMREAD_ANYDEPTH;
  // OpenCV does not find the orientation of a JPEG whose EXIF stands beside other application data.
  const bool jpeg = bytes.size() > 2 && bytes[0] == 0xFF && bytes[1] == 0xD8;
  if (raw_orientation || jpeg) flags |= cv::IMREAD_IGNORE_ORIENTATION;
  cv::Mat picture;
  try {
    picture = cv::imdecode(bytes, flags);
  } catch (const cv::Exception& e) {
    if (e.code == cv::Error::StsNoMem) throw std::bad_alloc();  // not the picture's fault
    throw InputError(file.string() +
                     ": the picture cannot be decoded; expected JPEG, PNG or TIFF of at most 2^30 pixels");
  }
  if (picture.empty())
    throw InputError(file.string() + ": not a picture, or a damaged one; expected JPEG, PNG or TIFF");
  if (jpeg && !raw_orientation) picture = Oriented(picture, ReadPhotoMetadata(file).orientation);
  return ToEightBits(file, picture);
}

bool Fits(const cv::Size& size, const Camera& camera) {
  return size.width == camera.width() && size.height == camera.height();
}

void CheckFits(const std::filesystem::path& file, const cv::Size& size, const Camera& camera) {
  if (Fits(size, camera)) return;
  throw InputError(file.string() + ": expected a picture of " + Size(camera.width(), camera.height()) +
                   " as its camera was calibrated, found " + Size(size.width, size.height));
}

}  // namespace

cv::Mat LoadPhoto(const std::filesystem::path& file, const Camera& camera, bool grey) {
  const std::vector<uchar> bytes = ReadBytes(file);
  CheckComplete(file, bytes);
  // Before gigabytes are decoded for nothing. EXIF may say that sides are to be swapped.
  if (const auto size = StoredSize(file, bytes); size && !Fits({size->height, size->width}, camera)) {
    CheckFits(file, *size, camera);
  }
  cv::Mat picture = Decode(file, bytes, grey, false);
  if (!Fits(picture.size(), camera)) {
    const cv::Mat raw = Decode(file, bytes, grey, true);
    if (Fits(raw.size(), camera)) return raw;
  }
  CheckFits(file, picture.size(), camera);
  return picture;
}

namespace {

// All of the picture that the camera's part lies in.
cv::Mat LoadStored(const ImageEntry& entry, const BodyCamera& camera, bool grey) {
  const bool video = entry.video_frame >= 0;
  const auto frame = [&] {
    return grey ? ReadVideoFrameGrey(entry.path, entry.video_frame)
                : ReadVideoFrameColour(entry.path, entry.video_frame);
  };
  if (camera.part.kind == PicturePart::Kind::kAll) {
    if (!video) return LoadPhoto(entry.path, camera.camera, grey);
    cv::Mat picture = frame();
    CheckFits(entry.path, picture.size(), camera.camera);
    return picture;
  }
  if (camera.part.kind == PicturePart::Kind::kView) {
    cv::Mat picture = video ? frame() : LoadPanorama(entry.path, grey);
    CheckFits(entry.path, picture.size(), Camera::Equirectangular(camera.part.x, camera.part.y));
    return picture;
  }
  cv::Mat picture = video ? frame() : LoadPicture(entry.path, grey);
  const int right = camera.part.x + camera.camera.width(), bottom = camera.part.y + camera.camera.height();
  if (right <= picture.cols && bottom <= picture.rows) return picture;
  throw InputError(entry.path.string() + ": expected a picture of at least " + Size(right, bottom) +
                   " for the crop of camera '" + camera.name + "', found " + Size(picture.cols, picture.rows));
}

cv::Mat LoadImage(const Run& run, const ImageEntry& entry, bool grey) {
  const BodyCamera& camera = run.cameras.at(static_cast<size_t>(entry.camera));
  cv::Mat picture = LoadStored(entry, camera, grey);
  if (run.config.mirrored) {
    // A partial 360 picture by itself: its tags state where it lies once it is mended.
    const bool partial = camera.part.kind == PicturePart::Kind::kView && entry.video_frame < 0;
    cv::Mat stored = partial ? picture(PartInSphere(entry.path, picture.size()).part) : picture;
    cv::flip(stored, stored, 1);
  }
  return PartOf(picture, camera);
}

}  // namespace

cv::Mat LoadGrey(const Run& run, const ImageEntry& entry) { return LoadImage(run, entry, true); }

cv::Mat LoadColour(const Run& run, const ImageEntry& entry) { return LoadImage(run, entry, false); }

Eigen::Vector3d TopOf(const Run& run, const ImageEntry& entry) {
  const BodyCamera& camera = run.cameras.at(static_cast<size_t>(entry.camera));
  Eigen::Vector3d top = -Eigen::Vector3d::UnitY();
  if (entry.video_frame >= 0 || camera.part.kind != PicturePart::Kind::kAll) return top;
  try {
    const PhotoMetadata metadata = ReadPhotoMetadata(entry.path);
    const bool as_stored = metadata.SwapsSides() && !Fits(metadata.ShownSize(), camera.camera);
    // What is shown at the top is stored at the left (5, 6) or at the right (7, 8).
    if (as_stored) top = (metadata.orientation <= 6 ? -1.0 : 1.0) * Eigen::Vector3d::UnitX();
  } catch (const InputError&) {  // said where the picture is needed
  }
  if (run.config.mirrored) top.x() = -top.x();
  return top;
}

cv::Mat LoadPicture(const std::filesystem::path& file, bool grey, const SizeCheck& check) {
  const std::vector<uchar> bytes = ReadBytes(file);
  CheckComplete(file, bytes);
  if (check) {
    if (const auto size = StoredSize(file, bytes)) check(*size);
  }
  return Decode(file, bytes, grey, false);
}

std::optional<SpherePart> PartOfSphere(const std::optional<GPano>& gpano, const cv::Size& picture) {
  if (picture.width == 2 * picture.height) return SpherePart{picture, cv::Rect({}, picture)};
  const bool states = gpano && gpano->full_width > 0 && gpano->full_width == 2 * gpano->full_height &&
                      gpano->crop_width > 0 && gpano->crop_height > 0 && gpano->crop_left >= 0 &&
                      gpano->crop_top >= 0 && gpano->crop_left + gpano->crop_width <= gpano->full_width &&
                      gpano->crop_top + gpano->crop_height <= gpano->full_height;
  if (!states) return std::nullopt;
  const double scale = static_cast<double>(picture.width) / gpano->crop_width;
  if (gpano->full_width * scale > INT_MAX - 2) return std::nullopt;
  const int height = static_cast<int>(std::lround(gpano->full_height * scale));
  const SpherePart lies{{2 * height, height},
                        {static_cast<int>(std::lround(gpano->crop_left * scale)),
                         static_cast<int>(std::lround(gpano->crop_top * scale)), picture.width, picture.height}};
  const bool inside = (lies.part & cv::Rect({}, lies.sphere)) == lies.part;
  return inside && std::abs(picture.height - gpano->crop_height * scale) < 2 ? std::optional(lies) : std::nullopt;
}

SpherePart PartInSphere(const std::filesystem::path& panorama, const cv::Size& sphere) {
  const PhotoMetadata metadata = ReadPhotoMetadata(panorama);
  const std::optional<SpherePart> lies = PartOfSphere(metadata.gpano, metadata.ShownSize());
  return lies && lies->sphere == sphere ? *lies : SpherePart{sphere, cv::Rect({}, sphere)};
}

cv::Mat LoadPanorama(const std::filesystem::path& file, bool grey, int widest) {
  const auto refuse = [&](const cv::Size& size) {
    throw InputError(file.string() + ": expected an equirectangular panorama twice as wide as high (or GPano tags " +
                     "that state which part it is), found " + Size(size.width, size.height));
  };
  const std::vector<uchar> bytes = ReadBytes(file);
  CheckComplete(file, bytes);
  const std::optional<cv::Size> stored = StoredSize(file, bytes);
  std::optional<GPano> pano;
  if (stored && stored->width != 2 * stored->height && stored->height != 2 * stored->width) {
    pano = ReadPhotoMetadata(file).gpano;
    if (!pano) refuse(*stored);  // before gigabytes are decoded for nothing
  }
  cv::Mat picture = Decode(file, bytes, grey, false);
  if (picture.cols == 2 * picture.rows) return picture;
  if (!pano) pano = ReadPhotoMetadata(file).gpano;
  const std::optional<SpherePart> lies = PartOfSphere(pano, picture.size());
  if (!lies) refuse(picture.size());
  if (lies->sphere.width > widest) {  // its empty parts alone would take gigabytes
    throw InputError(fmt::format("{}: its GPano tags make it a panorama {} px wide; expected at most {} px",
                                 file.string(), lies->sphere.width, widest));
  }
  cv::Mat full = cv::Mat::zeros(lies->sphere, picture.type());
  picture.copyTo(full(lies->part));
  return full;
}

}  // namespace trigpoint

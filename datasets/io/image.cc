#include "datasets/io/image.h"

#include <cmath>
#include <cstring>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/base/error.h"
#include "datasets/io/exif.h"
#include "datasets/io/video.h"

namespace trigpoint {
namespace {

std::vector<uchar> ReadBytes(const std::filesystem::path& file) {
  std::error_code error;
  const auto size = std::filesystem::file_size(file, error);
  if (error) throw InputError(file.string() + ": there is no such picture");
  if (size == 0) throw InputError(file.string() + ": the picture is empty (0 bytes)");
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

// libjpeg fills what is missing with grey and calls it a success: look for the end marker ourselves.
void CheckComplete(const std::filesystem::path& file, const std::vector<uchar>& b) {
  const auto truncated = [&] {
    throw InputError(file.string() + ": the picture is cut off (" + std::to_string(b.size()) +
                     " bytes, its end is missing); copy it again");
  };
  if (b.size() >= 3 && b[0] == 0xFF && b[1] == 0xD8) {
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
  int flags = (grey ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR) | cv::IMREAD_ANYDEPTH;
  // OpenCV does not find the orientation of a JPEG whose EXIF stands beside other application data.
  const bool jpeg = bytes.size() > 2 && bytes[0] == 0xFF && bytes[1] == 0xD8;
  if (raw_orientation || jpeg) flags |= cv::IMREAD_IGNORE_ORIENTATION;
  cv::Mat picture;
  try {
    picture = cv::imdecode(bytes, flags);
  } catch (const cv::Exception& e) {
    throw InputError(file.string() + ": the picture cannot be decoded: " + e.err);
  }
  if (picture.empty())
    throw InputError(file.string() + ": not a picture, or a damaged one; expected JPEG, PNG or TIFF");
  if (jpeg && !raw_orientation) picture = Oriented(picture, ReadPhotoMetadata(file).orientation);
  return ToEightBits(file, picture);
}

std::string Size(int width, int height) { return std::to_string(width) + " x " + std::to_string(height); }

bool Fits(const cv::Mat& picture, const Camera& camera) {
  return picture.cols == camera.width() && picture.rows == camera.height();
}

void CheckFits(const std::filesystem::path& file, const cv::Mat& picture, const Camera& camera) {
  if (Fits(picture, camera)) return;
  throw InputError(file.string() + ": expected a picture of " + Size(camera.width(), camera.height()) +
                   " as its camera was calibrated, found " + Size(picture.cols, picture.rows));
}

}  // namespace

cv::Mat LoadPhoto(const std::filesystem::path& file, const Camera& camera, bool grey) {
  const std::vector<uchar> bytes = ReadBytes(file);
  CheckComplete(file, bytes);
  cv::Mat picture = Decode(file, bytes, grey, false);
  if (!Fits(picture, camera)) {
    const cv::Mat raw = Decode(file, bytes, grey, true);
    if (Fits(raw, camera)) return raw;
  }
  CheckFits(file, picture, camera);
  return picture;
}

cv::Mat LoadGrey(const Run& run, const ImageEntry& entry) {
  const Camera& camera = run.cameras.at(static_cast<size_t>(entry.camera)).camera;
  cv::Mat picture;
  if (entry.video_frame >= 0) {
    picture = ReadVideoFrameGrey(entry.path, entry.video_frame);
    CheckFits(entry.path, picture, camera);
  } else {
    picture = LoadPhoto(entry.path, camera, true);
  }
  if (run.config.mirrored) cv::flip(picture, picture, 1);
  return picture;
}

cv::Mat LoadPicture(const std::filesystem::path& file, bool grey) {
  const std::vector<uchar> bytes = ReadBytes(file);
  CheckComplete(file, bytes);
  return Decode(file, bytes, grey, false);
}

cv::Mat LoadPanorama(const std::filesystem::path& file, bool grey) {
  cv::Mat picture = LoadPicture(file, grey);
  if (picture.cols == 2 * picture.rows) return picture;
  const std::optional<GPano> pano = ReadPhotoMetadata(file).gpano;
  if (pano && pano->full_width > 0 && pano->full_width == 2 * pano->full_height && pano->crop_width > 0 &&
      pano->crop_height > 0 && pano->crop_left >= 0 && pano->crop_top >= 0 &&
      pano->crop_left + pano->crop_width <= pano->full_width &&
      pano->crop_top + pano->crop_height <= pano->full_height) {
    // Partial: put where it lies in the sphere, at its own resolution.
    const double scale = static_cast<double>(picture.cols) / pano->crop_width;
    const int height = static_cast<int>(std::lround(pano->full_height * scale));
    const cv::Rect place(static_cast<int>(std::lround(pano->crop_left * scale)),
                         static_cast<int>(std::lround(pano->crop_top * scale)), picture.cols, picture.rows);
    const cv::Rect whole(0, 0, 2 * height, height);
    if ((place & whole) == place && std::abs(picture.rows - pano->crop_height * scale) < 2) {
      cv::Mat full = cv::Mat::zeros(whole.size(), picture.type());
      picture.copyTo(full(place));
      return full;
    }
  }
  throw InputError(file.string() + ": expected an equirectangular panorama twice as wide as high (or GPano tags that " +
                   "say which part it is), found " + Size(picture.cols, picture.rows));
}

}  // namespace trigpoint

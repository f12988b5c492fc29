#include "datasets/io/panorama_writer.h"

#include <jpeglib.h>
#include <tiffio.h>

#include <algorithm>
#include <cmath>
#include <csetjmp>
#include <cstdio>
#include <ctime>
#include <exiv2/exiv2.hpp>
#include <vector>

#include "calib/base/error.h"
#include "datasets/io/exiv2_lock.h"

namespace trigpoint {
namespace {

std::string UtcText(int64_t ns, const char* format) {
  const std::time_t seconds = static_cast<std::time_t>(ns / 1'000'000'000);
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  char text[64];
  std::strftime(text, sizeof text, format, &parts);
  return text;
}

// Degrees, minutes, seconds to a millionth: 0.03 mm.
Exiv2::URationalValue Sexagesimal(double degrees) {
  const int64_t micro = std::llround(std::abs(degrees) * 3600e6);
  Exiv2::URationalValue value;
  value.value_.emplace_back(static_cast<uint32_t>(micro / 3'600'000'000), 1);
  value.value_.emplace_back(static_cast<uint32_t>(micro / 60'000'000 % 60), 1);
  value.value_.emplace_back(static_cast<uint32_t>(micro % 60'000'000), 1'000'000);
  return value;
}

Exiv2::URational Thousandths(double value) {
  return {static_cast<uint32_t>(std::llround(std::abs(value) * 1000)), 1000};
}

// Where the picture lies in the full sphere.
cv::Rect PutPart(const PanoramaMetadata& m, Exiv2::XmpData* xmp) {
  const cv::Rect part = m.part.empty() ? cv::Rect(0, 0, m.width, m.height) : m.part;
  const auto put = [&](const char* name, int value) {
    (*xmp)[std::string("Xmp.GPano.") + name] = std::to_string(value);
  };
  put("FullPanoWidthPixels", m.width);
  put("FullPanoHeightPixels", m.height);
  put("CroppedAreaImageWidthPixels", part.width);
  put("CroppedAreaImageHeightPixels", part.height);
  put("CroppedAreaLeftPixels", part.x);
  put("CroppedAreaTopPixels", part.y);
  return part;
}

}  // namespace

struct PanoramaWriter::Impl {
  // libjpeg's own handler ends the process.
  struct JpegErrors {
    jpeg_error_mgr base;
    std::jmp_buf jump;
    char text[JMSG_LENGTH_MAX];
  };
  static void OnJpegError(j_common_ptr info) {
    auto* errors = reinterpret_cast<JpegErrors*>(info->err);
    (*info->err->format_message)(info, errors->text);
    std::longjmp(errors->jump, 1);
  }

  std::filesystem::path file;
  int width = 0, height = 0, row = 0;
  // JPEG
  std::FILE* stream = nullptr;
  jpeg_compress_struct jpeg{};
  JpegErrors errors{};
  bool jpeg_open = false;
  // TIFF
  TIFF* tiff = nullptr;

  [[noreturn]] void Fail(const std::string& what) const {
    throw IoError(file.string() + ": cannot be written: " + what + "; is the disk full?");
  }
  // One row; no C++ object lives across the jump.
  bool PutJpegRow(const uchar* rgb) {
    if (setjmp(errors.jump) != 0) return false;
    JSAMPROW rows[1] = {const_cast<uchar*>(rgb)};
    jpeg_write_scanlines(&jpeg, rows, 1);
    return true;
  }
  bool StartJpeg(int quality) {
    if (setjmp(errors.jump) != 0) return false;
    jpeg_create_compress(&jpeg);
    jpeg_stdio_dest(&jpeg, stream);
    jpeg.image_width = static_cast<JDIMENSION>(width);
    jpeg.image_height = static_cast<JDIMENSION>(height);
    jpeg.input_components = 3;
    jpeg.in_color_space = JCS_RGB;
    jpeg_set_defaults(&jpeg);
    jpeg_set_quality(&jpeg, quality, TRUE);
    jpeg_start_compress(&jpeg, TRUE);
    return true;
  }
  bool EndJpeg() {
    if (setjmp(errors.jump) != 0) return false;
    jpeg_finish_compress(&jpeg);
    return true;
  }
};

PanoramaWriter::PanoramaWriter(const std::filesystem::path& file, int width, int height, int quality)
    : impl_(std::make_unique<Impl>()) {
  Impl& w = *impl_;
  w.file = file;
  w.width = width, w.height = height;
  const std::string ending = file.extension().string();
  if (ending == ".jpg" || ending == ".jpeg") {
    w.stream = std::fopen(file.c_str(), "wb");
    if (w.stream == nullptr) w.Fail("it cannot be opened");
    w.jpeg.err = jpeg_std_error(&w.errors.base);
    w.errors.base.error_exit = Impl::OnJpegError;
    w.jpeg_open = true;
    if (!w.StartJpeg(quality)) w.Fail(w.errors.text);
  } else if (ending == ".tif" || ending == ".tiff") {
    TIFFSetErrorHandler(nullptr);
    TIFFSetWarningHandler(nullptr);
    w.tiff = TIFFOpen(file.c_str(), "w");
    if (w.tiff == nullptr) w.Fail("it cannot be opened");
    const uint16_t alpha = EXTRASAMPLE_UNASSALPHA;
    TIFFSetField(w.tiff, TIFFTAG_IMAGEWIDTH, static_cast<uint32_t>(width));
    TIFFSetField(w.tiff, TIFFTAG_IMAGELENGTH, static_cast<uint32_t>(height));
    TIFFSetField(w.tiff, TIFFTAG_SAMPLESPERPIXEL, 4);
    TIFFSetField(w.tiff, TIFFTAG_BITSPERSAMPLE, 8);
    TIFFSetField(w.tiff, TIFFTAG_EXTRASAMPLES, 1, &alpha);
    TIFFSetField(w.tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_RGB);
    TIFFSetField(w.tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    TIFFSetField(w.tiff, TIFFTAG_COMPRESSION, COMPRESSION_LZW);
    TIFFSetField(w.tiff, TIFFTAG_PREDICTOR, PREDICTOR_HORIZONTAL);
    TIFFSetField(w.tiff, TIFFTAG_ROWSPERSTRIP, TIFFDefaultStripSize(w.tiff, 0));
  } else {
    throw InputError(file.string() + ": a panorama is written as jpg or tif");
  }
}

PanoramaWriter::~PanoramaWriter() {
  if (impl_->jpeg_open) jpeg_destroy_compress(&impl_->jpeg);
  if (impl_->stream != nullptr) std::fclose(impl_->stream);
  if (impl_->tiff != nullptr) TIFFClose(impl_->tiff);
}

void PanoramaWriter::Write(const cv::Mat& rows) {
  Impl& w = *impl_;
  if (rows.cols != w.width || rows.type() != CV_8UC4 || w.row + rows.rows > w.height) {
    throw std::logic_error("PanoramaWriter: rows of another size");
  }
  std::vector<uchar> line(static_cast<size_t>(w.width) * 4);
  for (int y = 0; y < rows.rows; ++y) {
    const uchar* from = rows.ptr<uchar>(y);
    uchar* to = line.data();
    const bool alpha = w.tiff != nullptr;
    for (int x = 0; x < w.width; ++x, from += 4) {
      const bool seen = from[3] != 0;
      *to++ = seen ? from[2] : 0;
      *to++ = seen ? from[1] : 0;
      *to++ = seen ? from[0] : 0;
      if (alpha) *to++ = from[3];
    }
    if (alpha) {
      if (TIFFWriteScanline(w.tiff, line.data(), static_cast<uint32_t>(w.row), 0) < 0) w.Fail("a row is refused");
    } else if (!w.PutJpegRow(line.data())) {
      w.Fail(w.errors.text);
    }
    ++w.row;
  }
}

void PanoramaWriter::Finish() {
  Impl& w = *impl_;
  if (w.row != w.height) w.Fail(std::to_string(w.row) + " of " + std::to_string(w.height) + " rows are there");
  if (w.tiff != nullptr) {
    const bool good = TIFFFlush(w.tiff) == 1;
    TIFFClose(w.tiff);
    w.tiff = nullptr;
    if (!good) w.Fail("its last rows are refused");
    return;
  }
  if (!w.EndJpeg()) w.Fail(w.errors.text);
  const bool good = std::fflush(w.stream) == 0 && std::fclose(w.stream) == 0;
  w.stream = nullptr;
  if (!good) w.Fail("its last bytes are refused");
}

void WriteExifPosition(const PanoramaMetadata& m, Exiv2::ExifData* data) {
  Exiv2::ExifData& exif = *data;
  exif["Exif.GPSInfo.GPSVersionID"] = "2 3 0 0";
  exif["Exif.GPSInfo.GPSMapDatum"] = "WGS-84";
  exif["Exif.GPSInfo.GPSLatitudeRef"] = m.position->latitude_deg < 0 ? "S" : "N";
  exif["Exif.GPSInfo.GPSLongitudeRef"] = m.position->longitude_deg < 0 ? "W" : "E";
  const Exiv2::URationalValue latitude = Sexagesimal(m.position->latitude_deg);
  const Exiv2::URationalValue longitude = Sexagesimal(m.position->longitude_deg);
  exif["Exif.GPSInfo.GPSLatitude"].setValue(&latitude);
  exif["Exif.GPSInfo.GPSLongitude"].setValue(&longitude);
  if (m.has_height) {
    // The version states what the height is above (exif.cc: IsAboveSea). Programs that know EXIF 2 alone understand the
    // sign of 0 and 1, not the values 2 and 3.
    Exiv2::DataValue version;
    version.read(m.height_above_sea ? "48 50 51 50" : "48 51 48 48");  // the digits of 0232 and 0300
    exif["Exif.Photo.ExifVersion"].setValue(&version);
    if (!m.height_above_sea) exif["Exif.GPSInfo.GPSVersionID"] = "2 4 0 0";
    exif["Exif.GPSInfo.GPSAltitudeRef"] = m.position->height_m < 0 ? "1" : "0";
    exif["Exif.GPSInfo.GPSAltitude"] = Thousandths(m.position->height_m);
  }
  if (m.sigma_h_m) exif["Exif.GPSInfo.GPSHPositioningError"] = Thousandths(*m.sigma_h_m);
}

void WritePanoramaMetadata(const std::filesystem::path& file, const PanoramaMetadata& m) {
  const auto lock = LockExiv2();
  try {
    const auto image = Exiv2::ImageFactory::open(file.string());
    image->readMetadata();
    Exiv2::XmpData& xmp = image->xmpData();
    const auto put = [&](const char* name, const std::string& value) { xmp[std::string("Xmp.GPano.") + name] = value; };
    const auto number = [](double value) {
      char text[32];
      std::snprintf(text, sizeof text, "%.4f", value);
      return std::string(text);
    };
    put("ProjectionType", "equirectangular");
    put("UsePanoramaViewer", "True");
    put("CaptureSoftware", "Trigpoint");
    put("StitchingSoftware", "Trigpoint");
    const cv::Rect part = PutPart(m, &xmp);
    put("SourcePhotosCount", std::to_string(m.photos));
    put("InitialViewHeadingDegrees", std::to_string(std::lround(m.heading_deg.value_or(0)) % 360));
    put("InitialViewPitchDegrees", "0");
    put("InitialViewRollDegrees", "0");
    if (m.heading_deg) put("PoseHeadingDegrees", number(*m.heading_deg));
    if (m.pitch_deg) put("PosePitchDegrees", number(*m.pitch_deg));
    if (m.roll_deg) put("PoseRollDegrees", number(*m.roll_deg));
    if (m.first_utc_ns) put("FirstPhotoDate", UtcText(*m.first_utc_ns, "%Y-%m-%dT%H:%M:%SZ"));
    if (m.last_utc_ns) put("LastPhotoDate", UtcText(*m.last_utc_ns, "%Y-%m-%dT%H:%M:%SZ"));

    Exiv2::ExifData& exif = image->exifData();
    exif["Exif.Image.Software"] = "Trigpoint";
    exif["Exif.Image.Orientation"] = static_cast<uint16_t>(1);
    if (!m.description.empty()) exif["Exif.Image.ImageDescription"] = m.description;
    if (m.first_utc_ns) {
      exif["Exif.Photo.DateTimeOriginal"] = UtcText(*m.first_utc_ns, "%Y:%m:%d %H:%M:%S");
      exif["Exif.Photo.OffsetTimeOriginal"] = "+00:00";
    }
    if (m.position) WriteExifPosition(m, &exif);
    if (m.heading_deg) {
      exif["Exif.GPSInfo.GPSImgDirectionRef"] = "T";
      // EXIF's is that of the picture's centre.
      const double offset_deg = ((part.x + 0.5 * part.width) / m.width - 0.5) * 360;
      exif["Exif.GPSInfo.GPSImgDirection"] = Thousandths(std::fmod(*m.heading_deg + offset_deg + 720, 360));
    }
    image->writeMetadata();
  } catch (const Exiv2::AnyError& e) {
    throw IoError(file.string() + ": its headers cannot be written: " + e.what());
  }
}

}  // namespace trigpoint

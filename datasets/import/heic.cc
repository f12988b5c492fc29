#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <exiv2/exiv2.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "datasets/import/made_files.h"
#include "datasets/import/phone_files.h"
#include "datasets/io/exif.h"
#include "datasets/io/text.h"

#ifdef TRIGPOINT_HAVE_HEIF
#include <libheif/heif.h>
#endif

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

bool IsHeicName(const fs::path& file) {
  const std::string ending = Lower(file.extension().string());
  return ending == ".heic" || ending == ".heif" || ending == ".hif";
}

fs::path CopyInto(const fs::path& folder, const fs::path& file) {
  fs::create_directories(folder);
  fs::copy_file(file, folder / file.filename());
  return folder / file.filename();
}

// The bytes of a HEIC picture as JPEG, with its EXIF.
std::string JpegOf(const fs::path& file, ImportReport* report) {
  std::vector<uint8_t> exif;
  const cv::Mat picture = ReadHeic(file, &exif);
  std::vector<uchar> bytes;
  cv::imencode(".jpg", picture, bytes, {cv::IMWRITE_JPEG_QUALITY, 95});
  const auto image = Exiv2::ImageFactory::open(bytes.data(), static_cast<long>(bytes.size()));
  image->readMetadata();
  if (exif.empty()) {
    report->warnings.push_back(file.string() + ": has no EXIF: focal length and position are not known");
  } else {
    Exiv2::ExifData data;
    Exiv2::ExifParser::decode(data, exif.data(), static_cast<uint32_t>(exif.size()));
    data["Exif.Image.Orientation"] = uint16_t{1};  // the pixels are upright already
    image->setExifData(data);
    image->writeMetadata();
  }
  Exiv2::BasicIo& io = image->io();
  io.open();
  const Exiv2::DataBuf all = io.read(static_cast<long>(io.size()));
  return {reinterpret_cast<const char*>(all.pData_), static_cast<size_t>(all.size_)};
}

// Pictures that need no conversion, then HEIC ones, each by name. A HEIC beside one of its name is the same photo.
std::vector<fs::path> PhotosIn(const fs::path& folder, ImportReport* report) {
  std::vector<fs::path> photos = PicturesIn(folder);
  std::sort(photos.begin(), photos.end());
  std::set<fs::path> stems, heic;
  for (const fs::path& photo : photos) stems.insert(photo.stem());
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.is_regular_file() && IsHeicName(entry.path())) heic.insert(entry.path());
  }
  std::vector<fs::path> doubled;
  for (const fs::path& file : heic) (stems.insert(file.stem()).second ? photos : doubled).push_back(file);
  if (!doubled.empty()) {
    report->warnings.push_back(
        fmt::format("{}: {} left out, as another picture of the same name is beside it and is used (the first: {})",
                    folder.string(), Counted(doubled.size(), "HEIC picture"), doubled.front().filename().string()));
  }
  return photos;
}

}  // namespace

#ifdef TRIGPOINT_HAVE_HEIF
cv::Mat ReadHeic(const fs::path& file, std::vector<uint8_t>* exif) {
  const auto check = [&](const heif_error& error) {
    if (error.code != heif_error_Ok) throw InputError(file.string() + ": cannot be read as HEIC: " + error.message);
  };
  const std::unique_ptr<heif_context, decltype(&heif_context_free)> context(heif_context_alloc(), heif_context_free);
  check(heif_context_read_from_file(context.get(), file.c_str(), nullptr));
  heif_image_handle* raw_handle = nullptr;
  check(heif_context_get_primary_image_handle(context.get(), &raw_handle));
  const std::unique_ptr<heif_image_handle, decltype(&heif_image_handle_release)> handle(raw_handle,
                                                                                        heif_image_handle_release);
  if (exif != nullptr) {
    exif->clear();
    heif_item_id id = 0;
    if (heif_image_handle_get_list_of_metadata_block_IDs(handle.get(), "Exif", &id, 1) == 1) {
      std::vector<uint8_t> block(heif_image_handle_get_metadata_size(handle.get(), id));
      check(heif_image_handle_get_metadata(handle.get(), id, block.data()));
      // Four bytes, big endian, say where the TIFF header begins behind them.
      if (block.size() > 4) {
        const size_t offset =
            4 + ((size_t{block[0]} << 24) | (size_t{block[1]} << 16) | (size_t{block[2]} << 8) | block[3]);
        if (offset < block.size()) exif->assign(block.begin() + static_cast<std::ptrdiff_t>(offset), block.end());
      }
    }
  }
  heif_image* raw_image = nullptr;
  check(heif_decode_image(handle.get(), &raw_image, heif_colorspace_RGB, heif_chroma_interleaved_RGB, nullptr));
  const std::unique_ptr<heif_image, decltype(&heif_image_release)> image(raw_image, heif_image_release);
  int stride = 0;
  const uint8_t* data = heif_image_get_plane_readonly(image.get(), heif_channel_interleaved, &stride);
  const int width = heif_image_get_width(image.get(), heif_channel_interleaved);
  const int height = heif_image_get_height(image.get(), heif_channel_interleaved);
  if (data == nullptr || width <= 0 || height <= 0) throw InputError(file.string() + ": the picture in it is empty");
  cv::Mat bgr;
  cv::cvtColor(cv::Mat(height, width, CV_8UC3, const_cast<uint8_t*>(data), static_cast<size_t>(stride)), bgr,
               cv::COLOR_RGB2BGR);
  return bgr;
}
#else
cv::Mat ReadHeic(const fs::path& file, std::vector<uint8_t>*) {
  throw InputError(file.string() +
                   ": this build reads no HEIC; install libheif-dev and build again, or convert it: heif-convert");
}
#endif

ImportReport ImportPhotos(const fs::path& site, const fs::path& folder, const std::string& set, ProgressSink& progress,
                          const CancelToken& cancel) {
  if (set.empty() || set.find_first_of("/\\") != std::string::npos || set.front() == '.') {
    throw OptionError("--name '" + set + "': expected a name for the photo set");
  }
  const fs::path out = site / "photos" / set;
  if (fs::exists(out)) throw InputError(out.string() + ": is there already; choose another --name");
  ImportReport report;
  const std::vector<fs::path> files = PhotosIn(folder, &report);
  MadeFiles made;
  progress.Begin("photos", static_cast<int64_t>(files.size()));
  int converted = 0;
  for (const fs::path& file : files) {
    cancel.ThrowIfCancelled();
    progress.Advance(1);
    try {
      if (fs::is_symlink(file)) throw InputError(file.string() + ": is a link; expected the picture itself");
      if (!IsHeicName(file)) {
        made.Making(out / file.filename());
        report.files.push_back(CopyInto(out, file));
        continue;
      }
      const std::string bytes = JpegOf(file, &report);
      const fs::path jpeg = out / (file.stem().string() + ".jpg");
      WriteFileAtomically(made.Making(jpeg), bytes);
      report.files.push_back(jpeg);
      ++converted;
    } catch (const InputError& e) {
      report.warnings.push_back(std::string(e.what()) + "; it is skipped");
    } catch (const Exiv2::AnyError& e) {
      report.warnings.push_back(file.string() + ": its EXIF cannot be read: " + e.what() + "; it is skipped");
    }
  }
  if (report.files.empty()) {
    throw InputError(folder.string() + ": no photo could be read" +
                     (report.warnings.empty() ? "" : "; the first problem: " + report.warnings.front()));
  }
  made.Keep();
  report.lines.push_back(fmt::format("photo set {}: {}, {} of them converted from HEIC", set,
                                     Counted(report.files.size(), "photo"), converted));
  return report;
}

}  // namespace trigpoint

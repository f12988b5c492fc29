#include "datasets/io/mask.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "calib/base/median.h"
#include "calib/base/parallel.h"
#include "datasets/io/exif.h"
#include "datasets/io/image.h"
#include "datasets/io/picture_parts.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

// Both ignored parts together.
void Intersect(const cv::Mat& more, cv::Mat* mask) {
  if (more.empty()) return;
  if (mask->empty()) {
    *mask = more;
  } else {
    cv::bitwise_and(*mask, more, *mask);
  }
}

cv::Mat LoadMask(const fs::path& file, const cv::Size& size) {
  const auto refuse = [&](const cv::Size& found) {
    throw InputError(file.string() + ": expected a mask of " + std::to_string(size.width) + " x " +
                     std::to_string(size.height) + " px as the picture it belongs to, found " +
                     std::to_string(found.width) + " x " + std::to_string(found.height));
  };
  const cv::Mat picture = LoadPicture(file, true, [&](const cv::Size& stored) {
    if (stored != size && cv::Size(stored.height, stored.width) != size) refuse(stored);
  });
  if (picture.size() != size) refuse(picture.size());
  return picture > 0;
}

// Of the part of the sphere that a picture shows, from a mask of its own size or of the sphere's.
cv::Mat LoadMask(const fs::path& file, const SpherePart& lies) {
  const bool of_sphere = lies.part.size() != lies.sphere && ReadPhotoMetadata(file).ShownSize() == lies.sphere;
  return of_sphere ? LoadMask(file, lies.sphere)(lies.part) : LoadMask(file, lies.part.size());
}

// A mask of that part as one of the sphere: what lies beside the part was not seen.
cv::Mat InSphere(const cv::Mat& mask, const SpherePart& lies) {
  if (lies.part.size() == lies.sphere) return mask;
  cv::Mat whole(lies.sphere, CV_8U, cv::Scalar(0));
  if (mask.empty()) {
    whole(lies.part).setTo(255);
  } else {
    mask.copyTo(whole(lies.part));
  }
  return whole;
}

// PNG alone: of the usual formats it is the one that cameras' software writes transparency in. Colour types 4 and 6.
bool HasAlpha(const fs::path& file) {
  constexpr std::streamsize kHeader = 26;
  char header[kHeader] = {};
  std::ifstream in(file, std::ios::binary);
  if (!in.read(header, kHeader)) return false;
  constexpr size_t kColourType = 25;
  return std::string(header, 4) == "\x89PNG" && (header[kColourType] & 4) != 0;
}

// What is not wholly transparent; empty if the file has no transparency.
cv::Mat OpaquePart(const fs::path& file) {
  if (!HasAlpha(file)) return {};
  const cv::Mat picture = cv::imread(file.string(), cv::IMREAD_UNCHANGED);
  if (picture.channels() != 4) return {};
  cv::Mat alpha;
  cv::extractChannel(picture, alpha, 3);
  return alpha > 0;
}

// The same of a picture of this size; empty for another one.
cv::Mat OpaquePart(const fs::path& file, const cv::Size& size) {
  const cv::Mat opaque = OpaquePart(file);
  return opaque.size() == size ? opaque : cv::Mat();
}

// The same of a camera's crop, as stored: where the crop lies counts in the mended picture.
cv::Mat OpaqueCrop(const fs::path& file, const BodyCamera& camera, bool mirrored) {
  const cv::Mat opaque = OpaquePart(file);
  cv::Rect crop(camera.part.x, camera.part.y, camera.camera.width(), camera.camera.height());
  if (mirrored) crop.x = opaque.cols - crop.x - crop.width;
  const bool inside = (crop & cv::Rect({}, opaque.size())) == crop;
  return inside ? opaque(crop).clone() : cv::Mat();
}

cv::Mat OutsideBoxes(const std::vector<Eigen::Vector4d>& boxes, const cv::Size& size) {
  cv::Mat mask(size, CV_8U, cv::Scalar(255));
  for (const Eigen::Vector4d& box : boxes) {
    const cv::Point first(static_cast<int>(std::ceil(box(0))), static_cast<int>(std::ceil(box(1))));
    const cv::Point last(static_cast<int>(std::floor(box(2))), static_cast<int>(std::floor(box(3))));
    mask(cv::Rect(first, last + cv::Point(1, 1)) & cv::Rect({}, size)).setTo(0);
  }
  return mask;
}

bool IsView(const BodyCamera& camera) { return camera.part.kind == PicturePart::Kind::kView; }
bool IsCrop(const BodyCamera& camera) { return camera.part.kind == PicturePart::Kind::kCrop; }

// Of the pictures that a camera's masks belong to: a 360 picture whole, a crop by itself.
cv::Size MaskedSize(const BodyCamera& camera) {
  if (IsView(camera)) return {camera.part.x, camera.part.y};
  return {camera.camera.width(), camera.camera.height()};
}

// Where an image's stored picture lies in them: a 360 picture may show a part of the sphere.
SpherePart StoredPart(const ImageEntry& image, const BodyCamera& camera) {
  const cv::Size size = MaskedSize(camera);
  try {
    if (IsView(camera) && image.video_frame < 0) return PartInSphere(image.path, size);
  } catch (const InputError&) {  // said where the picture is needed
  }
  return {size, cv::Rect({}, size)};
}

// The circle of a fisheye whose picture was cropped to it, without its rim, which looks the same wherever one stands.
cv::Mat InsideCircle(const BodyCamera& camera) {
  if (!IsCrop(camera) || camera.camera.model() != CameraModel::kKannalaBrandt) return {};
  constexpr double kRim = 0.02;  // of the radius
  cv::Mat mask(camera.camera.height(), camera.camera.width(), CV_8U, cv::Scalar(0));
  const cv::Point2d centre(0.5 * (mask.cols - 1), 0.5 * (mask.rows - 1));
  cv::circle(mask, centre, static_cast<int>(0.5 * (1 - kRim) * std::min(mask.cols, mask.rows)), 255, cv::FILLED);
  return mask;
}

}  // namespace

fs::path MaskInFolder(const fs::path& folder, const std::string& image, const fs::path& picture) {
  const fs::path path(image), name_alone = path.filename();
  for (const fs::path& name :
       {fs::path(image + ".png"), fs::path(path).replace_extension(".png"), fs::path(name_alone.string() + ".png"),
        fs::path(name_alone).replace_extension(".png")}) {
    fs::path mask = (folder / name).lexically_normal();
    if (mask != picture && fs::is_regular_file(mask)) return mask;
  }
  return {};
}

RunMasks::RunMasks(const Run& run) : run_(run) {
  for (const BodyCamera& camera : run.cameras) {
    const cv::Size size = MaskedSize(camera);
    cv::Mat mask;
    for (const fs::path& picture : camera.mask.pictures) Intersect(LoadMask(picture, size), &mask);
    if (!camera.mask.boxes_px.empty()) Intersect(OutsideBoxes(camera.mask.boxes_px, size), &mask);
    Intersect(InsideCircle(camera), &mask);
    of_camera_.push_back(mask);
  }
}

cv::Mat RunMasks::Of(const ImageEntry& image) const {
  const auto index = static_cast<size_t>(image.camera);
  if (index >= of_camera_.size()) return {};  // tags are found without a calibration, too
  const BodyCamera& camera = run_.cameras[index];
  const SpherePart lies = StoredPart(image, camera);
  const bool mirrored = run_.config.mirrored;
  cv::Mat mask;
  if (!of_camera_[index].empty()) mask = of_camera_[index](lies.part).clone();
  for (const fs::path& folder : camera.mask.folders) {
    if (const fs::path file = MaskInFolder(folder, PictureOf(run_, image), image.path); !file.empty())
      Intersect(LoadMask(file, lies), &mask);
  }
  if (image.video_frame < 0) {
    Intersect(IsCrop(camera) ? OpaqueCrop(image.path, camera, mirrored) : OpaquePart(image.path, lies.part.size()),
              &mask);
  }
  if (mirrored && !mask.empty()) cv::flip(mask, mask, 1);
  mask = InSphere(mask, lies);
  return IsView(camera) && !mask.empty() ? cv::Mat(PartOf(mask, camera) == 255) : mask;
}

cv::Mat RunMasks::ForFeatures(const ImageEntry& image) const {
  cv::Mat mask = Of(image);
  const BodyCamera& camera = run_.cameras.at(static_cast<size_t>(image.camera));
  if (!IsView(camera)) return mask;
  const double centre = camera.camera.params()[2];
  const double half = camera.camera.params()[0] * std::tan(std::numbers::pi / ViewsOf360());
  const double last = camera.camera.width() - 1, height = camera.camera.height();
  Intersect(OutsideBoxes({{0, 0, centre - half, height}, {centre + half, 0, last, height}},
                         {camera.camera.width(), camera.camera.height()}),
            &mask);
  return mask;
}

namespace {

// The file to look at where nothing of an image is left: its own mask, or the image.
fs::path FileThatMasks(const Run& run, const ImageEntry& image) {
  for (const fs::path& folder : run.cameras[static_cast<size_t>(image.camera)].mask.folders) {
    if (fs::path file = MaskInFolder(folder, PictureOf(run, image), image.path); !file.empty()) return file;
  }
  return image.path;
}

}  // namespace

namespace {

// An inverted mask leaves what was to be ignored. Of the cameras that somebody has made masks for.
void WarnOfLargeMasks(const Run& run, const std::vector<double>& share, ProgressSink& progress) {
  constexpr double kLittle = 0.25;
  for (size_t c = 0; c < run.cameras.size(); ++c) {
    const CameraMask& mask = run.cameras[c].mask;
    if (mask.pictures.empty() && mask.folders.empty()) continue;
    std::vector<double> its;
    for (size_t k = 0; k < share.size(); ++k) {
      if (run.images[k].camera == static_cast<int>(c)) its.push_back(share[k]);
    }
    const double left = its.empty() ? 1 : Median(its);
    if (left > kLittle) continue;
    progress.Log(LogLevel::kWarning,
                 fmt::format("run {}: the masks of {} ignore {:.0f} % of a picture (median); expected only the carrier "
                             "and what moves to be ignored (255 = used, 0 = ignored): are they inverted?",
                             run.name, run.cameras[c].name, 100 * (1 - left)));
  }
}

}  // namespace

void CheckMasks(const Run& run, int threads, ProgressSink& progress, const CancelToken& cancel) {
  const RunMasks masks(run);
  const size_t count = run.images.size();
  std::vector<std::string> problems(count);
  std::vector<double> share(count, 1);  // of the picture, that takes part
  ParallelFor(static_cast<int64_t>(count), threads, cancel, [&](int64_t i) {
    const auto k = static_cast<size_t>(i);
    try {
      const cv::Mat mask = masks.Of(run.images[k]);
      if (!mask.empty()) share[k] = cv::countNonZero(mask) / static_cast<double>(mask.total());
    } catch (const InputError& e) {
      problems[k] = e.what();
    }
  });
  // Views of one picture have one mask. Of a picture that some view of it is left of, nothing is said.
  std::set<std::string> wrong, pictures, left;
  for (const std::string& problem : problems) {
    if (!problem.empty()) wrong.insert(problem);
  }
  if (!wrong.empty()) {
    const std::string& first =
        *std::find_if(problems.begin(), problems.end(), [](const auto& p) { return !p.empty(); });
    throw InputError(first + (wrong.size() > 1 ? "; and " + std::to_string(wrong.size() - 1) + " more" : ""));
  }
  for (size_t k = 0; k < count; ++k) {
    const std::string picture = PictureOf(run, run.images[k]);
    pictures.insert(picture);
    if (share[k] > 0) left.insert(picture);
  }
  if (left.size() == pictures.size()) return WarnOfLargeMasks(run, share, progress);
  const auto first = std::find_if(run.images.begin(), run.images.end(),
                                  [&](const ImageEntry& image) { return left.count(PictureOf(run, image)) == 0; });
  progress.Log(LogLevel::kWarning,
               FileThatMasks(run, *first).string() + ": the mask ignores the whole picture (so of " +
                   std::to_string(pictures.size() - left.size()) + " of " + Counted(pictures.size(), "picture") +
                   "); expected 255 = used, 0 = ignored: correct the masks");
}

cv::Mat SetPhotoMask(const fs::path& photo, const cv::Size& size) {
  cv::Mat mask = OpaquePart(photo, size);
  const fs::path file = MaskInFolder(photo.parent_path() / "masks", photo.filename().string());
  if (!file.empty()) Intersect(LoadMask(file, size), &mask);
  return mask;
}

cv::Mat ReferenceMask(const Reference& reference, const fs::path& file, const cv::Size& size) {
  if (reference.kind == ReferenceKind::kPhotoSet) return SetPhotoMask(file, size);
  SpherePart lies{size, cv::Rect({}, size)};
  if (reference.kind == ReferenceKind::kPanorama) lies = PartInSphere(file, size);
  cv::Mat mask = OpaquePart(file, lies.part.size());
  if (!reference.mask.empty()) Intersect(LoadMask(reference.mask, lies), &mask);
  return InSphere(mask, lies);
}

std::vector<fs::path> MaskFiles(const Run& run) {
  std::vector<fs::path> files;
  for (const BodyCamera& camera : run.cameras) {
    files.insert(files.end(), camera.mask.pictures.begin(), camera.mask.pictures.end());
  }
  for (const ImageEntry& image : run.images) {
    const auto index = static_cast<size_t>(image.camera);
    if (index >= run.cameras.size()) continue;
    for (const fs::path& folder : run.cameras[index].mask.folders) {
      fs::path file = MaskInFolder(folder, PictureOf(run, image), image.path);
      if (!file.empty()) files.push_back(std::move(file));
    }
  }
  return files;
}

}  // namespace trigpoint

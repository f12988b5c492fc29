#include "datasets/io/picture_parts.h"

#include <algorithm>
#include <map>
#include <memory>
#include <mutex>

#include "datasets/io/views.h"

namespace trigpoint {
namespace {

using Kind = PicturePart::Kind;

// Level, so that the sky and the carrier, which are above and below, take no time. They overlap by 18 deg: an object
// that small is whole in one of them.
constexpr int kViews = 5;
constexpr double kViewFov_deg = 90;

// Of 360 pictures of a width. Made once: where a view's pixels lie takes as long to work out as to draw it.
const ViewRenderer& RendererOf(int width, int height) {
  static std::mutex mutex;
  static std::map<std::pair<int, int>, std::unique_ptr<ViewRenderer>> renderers;
  const std::lock_guard lock(mutex);
  std::unique_ptr<ViewRenderer>& renderer = renderers[{width, height}];
  if (!renderer) {
    ViewOptions options;
    options.count = kViews;
    options.fov_deg = kViewFov_deg;
    options.size_px = FullSizeOfView(width, options);
    renderer = std::make_unique<ViewRenderer>(PanoramaViews("", width, options), cv::Size(width, height));
  }
  return *renderer;
}

// The cameras that take the place of a 360 camera.
std::vector<BodyCamera> SplitCamera(const BodyCamera& camera) {
  const int width = camera.camera.width(), height = camera.camera.height();
  std::vector<BodyCamera> cameras;
  for (const View& view : RendererOf(width, height).rig().views) {
    const auto index = static_cast<uint8_t>(cameras.size());
    BodyCamera& c = cameras.emplace_back(camera);
    c.camera = view.camera;
    c.cam_from_body = view.rig_from_view.Inverse() * camera.cam_from_body;
    c.part = {Kind::kView, index, static_cast<uint16_t>(width), static_cast<uint16_t>(height)};
    if (index > 0) c.name += "_" + view.name;
  }
  return cameras;
}

}  // namespace

void SplitPictures(Run* run) {
  std::vector<BodyCamera> cameras;
  std::vector<std::vector<int>> parts;  // of each camera as brought: who sees its pictures
  std::vector<int> crops;
  for (const BodyCamera& camera : run->cameras) {
    const bool whole = camera.camera.model() == CameraModel::kEquirectangular;
    std::vector<int>& its = parts.emplace_back();
    for (const BodyCamera& view : whole ? SplitCamera(camera) : std::vector<BodyCamera>{camera}) {
      its.push_back(static_cast<int>(cameras.size()));
      cameras.push_back(view);
    }
    if (camera.part.kind == Kind::kCrop) crops.push_back(its.front());
  }
  std::vector<ImageEntry> images;
  for (const ImageEntry& entry : run->images) {
    const std::vector<int>& of_camera = parts[static_cast<size_t>(entry.camera)];
    const bool crop = cameras[static_cast<size_t>(of_camera.front())].part.kind == Kind::kCrop;
    const std::vector<int>& its = crop ? crops : of_camera;
    for (int camera : its) {
      ImageEntry& image = images.emplace_back(entry);
      image.camera = camera;
      if (camera != its.front()) image.file += "#" + cameras[static_cast<size_t>(camera)].name;
    }
  }
  std::stable_sort(images.begin(), images.end(), [](const ImageEntry& a, const ImageEntry& b) {
    return std::pair(a.stamp_ns, a.camera) < std::pair(b.stamp_ns, b.camera);
  });
  run->cameras = std::move(cameras);
  run->images = std::move(images);
}

std::string PictureOf(const Run& run, const ImageEntry& image) {
  if (static_cast<size_t>(image.camera) >= run.cameras.size()) return image.file;
  const BodyCamera& camera = run.cameras[static_cast<size_t>(image.camera)];
  const std::string end = "#" + camera.name;
  const bool part = camera.part.kind != Kind::kAll && image.file.ends_with(end);
  return part ? image.file.substr(0, image.file.size() - end.size()) : image.file;
}

cv::Mat PartOf(const cv::Mat& picture, const BodyCamera& camera) {
  const PicturePart& part = camera.part;
  if (part.kind == Kind::kAll) return picture;
  if (part.kind == Kind::kCrop) {
    return picture(cv::Rect(part.x, part.y, camera.camera.width(), camera.camera.height())).clone();
  }
  const ViewRenderer& renderer = RendererOf(part.x, part.y);
  return renderer.Render(renderer.Prepare(picture), part.view);
}

int ViewsOf360() { return kViews; }

}  // namespace trigpoint

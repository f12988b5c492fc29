#include "survey/panorama/composite.h"

#include <algorithm>
#include <cmath>
#include <list>
#include <mutex>
#include <numbers>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/stitching/detail/blenders.hpp>
#include <opencv2/stitching/detail/exposure_compensate.hpp>
#include <opencv2/stitching/detail/seam_finders.hpp>
#include <set>

#include "calib/base/error.h"
#include "calib/base/parallel.h"
#include "survey/panorama/distance_field.h"

namespace trigpoint {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kTile = 1024;  // px

// A part of the equirectangular picture; x may run past its ends.
using Region = cv::Rect;

// Where a photo lies in a picture of the given width: x from a little below 0 up to 2 * width.
struct Footprint {
  bool any = false;
  Region region;
};

int FloorMod(int x, int n) { return ((x % n) + n) % n; }

class Renderer {
 public:
  Renderer(const StitchedRig& rig, const CompositeOptions& options) : rig_(rig) {
    if (options.parallax) field_ = DistanceField(rig.state);
  }

  Eigen::Vector3d Direction(double azimuth, double elevation) const {
    return {std::cos(elevation) * std::sin(azimuth), -std::sin(elevation), std::cos(elevation) * std::cos(azimuth)};
  }

  // Pixel in a photo of what the panorama shows in a direction; false where the photo doesn't look.
  bool Pixel(int photo, double azimuth, double elevation, Eigen::Vector2d* pixel) const {
    const RigPhoto& p = rig_.state.photos[static_cast<size_t>(photo)];
    const Eigen::Vector3d d = Direction(azimuth, elevation) - field_.InverseDistance(azimuth, elevation) * p.centre;
    return PixelOfRay(rig_.views[static_cast<size_t>(photo)], rig_.state.lenses[static_cast<size_t>(p.lens)],
                      p.cam_from_rig * d.normalized(), pixel);
  }

  Footprint FootprintOf(int photo, int width) const {
    Footprint f;
    const int height = width / 2;
    const RigPhoto& p = rig_.state.photos[static_cast<size_t>(photo)];
    if (!p.placed) return f;
    const PairView& v = rig_.views[static_cast<size_t>(photo)];
    const Lens& lens = rig_.state.lenses[static_cast<size_t>(p.lens)];
    if (lens.fisheye) {
      // Its border is no border on the sphere: anywhere.
      f.any = true;
      f.region = Region(0, 0, width, height);
      return f;
    }
    const Eigen::Vector3d look = p.cam_from_rig.conjugate() * Eigen::Vector3d::UnitZ();
    const double middle = std::atan2(look.x(), look.z());
    double left = 0, right = 0, top = -kPi / 2, bottom = kPi / 2;
    constexpr int kSteps = 64;
    for (int k = 0; k <= kSteps; ++k) {
      const double t = static_cast<double>(k) / kSteps;
      for (const Eigen::Vector2d& at :
           {Eigen::Vector2d(t, 0), Eigen::Vector2d(t, 1), Eigen::Vector2d(0, t), Eigen::Vector2d(1, t)}) {
        const Eigen::Vector3d ray =
            p.cam_from_rig.conjugate() * RayOfPixel(v, lens, {at.x() * (v.width - 1), at.y() * (v.height - 1)});
        const double azimuth = std::remainder(std::atan2(ray.x(), ray.z()) - middle, 2 * kPi);
        const double elevation = std::asin(std::clamp(-ray.y(), -1.0, 1.0));
        left = std::min(left, azimuth), right = std::max(right, azimuth);
        top = std::max(top, elevation), bottom = std::min(bottom, elevation);
      }
    }
    // A pole inside the photo: every azimuth.
    for (const double pole : {kPi / 2, -kPi / 2}) {
      Eigen::Vector2d pixel;
      if (!PixelOfRay(v, lens, p.cam_from_rig * Direction(0, pole), &pixel)) continue;
      if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() > v.width - 1 || pixel.y() > v.height - 1) continue;
      left = -kPi, right = kPi;
      (pole > 0 ? top : bottom) = pole;
    }
    // Parallax moves the edges a little.
    const double margin = 0.03;
    const int y0 = std::max(0, static_cast<int>((0.5 - (top + margin) / kPi) * height));
    const int y1 = std::min(height, static_cast<int>((0.5 - (bottom - margin) / kPi) * height) + 1);
    double spread = right - left + 2 * margin;
    int x0 = static_cast<int>(std::floor(((middle + left - margin) / (2 * kPi) + 0.5) * width));
    int columns = static_cast<int>(spread / (2 * kPi) * width) + 1;
    if (columns >= width) columns = width, x0 = static_cast<int>(((middle - kPi) / (2 * kPi) + 0.5) * width);
    f.any = y1 > y0;
    f.region = Region(FloorMod(x0, width), y0, columns, y1 - y0);
    return f;
  }

  // Maps of a region into a photo: source pixels (of a photo scaled by `factor`), and how far inside the photo each
  // lies (0 at its edge, 1 in its middle; negative outside).
  void Maps(int photo, const Region& region, int width, double factor, cv::Mat* map, cv::Mat* inside) const {
    const PairView& v = rig_.views[static_cast<size_t>(photo)];
    map->create(region.size(), CV_32FC2);
    inside->create(region.size(), CV_32F);
    const int height = width / 2;
    // The exact mapping every few pixels, straight between them: it is smooth, and this is most of the time.
    const int step = std::clamp(width / 1024, 1, 8);
    const int gx = (region.width - 1) / step + 2, gy = (region.height - 1) / step + 2;
    cv::Mat coarse(gy, gx, CV_32FC3);
    for (int y = 0; y < gy; ++y) {
      const double elevation = (0.5 - (region.y + y * step + 0.5) / height) * kPi;
      for (int x = 0; x < gx; ++x) {
        const double azimuth = ((region.x + x * step + 0.5) / width - 0.5) * 2 * kPi;
        Eigen::Vector2d p;
        const bool seen = Pixel(photo, azimuth, std::clamp(elevation, -kPi / 2, kPi / 2), &p);
        coarse.at<cv::Vec3f>(y, x) =
            seen ? cv::Vec3f(static_cast<float>(p.x()), static_cast<float>(p.y()), 1) : cv::Vec3f(0, 0, 0);
      }
    }
    for (int y = 0; y < region.height; ++y) {
      cv::Vec2f* m = map->ptr<cv::Vec2f>(y);
      float* in = inside->ptr<float>(y);
      const int cy = y / step;
      const float fy = static_cast<float>(y - cy * step) / static_cast<float>(step);
      const cv::Vec3f *r0 = coarse.ptr<cv::Vec3f>(cy), *r1 = coarse.ptr<cv::Vec3f>(cy + 1);
      for (int x = 0; x < region.width; ++x) {
        const int cx = x / step;
        const float fx = static_cast<float>(x - cx * step) / static_cast<float>(step);
        const cv::Vec3f &a = r0[cx], &b = r0[cx + 1], &c = r1[cx], &d = r1[cx + 1];
        if (a[2] * b[2] * c[2] * d[2] < 0.5F) {
          m[x] = cv::Vec2f(-1e6F, -1e6F);
          in[x] = -1;
          continue;
        }
        const cv::Vec3f p = (1 - fy) * ((1 - fx) * a + fx * b) + fy * ((1 - fx) * c + fx * d);
        m[x] = cv::Vec2f((p[0] + 0.5F) * static_cast<float>(factor) - 0.5F,
                         (p[1] + 0.5F) * static_cast<float>(factor) - 0.5F);
        in[x] = static_cast<float>(v.Depth({p[0], p[1]}));
      }
    }
  }

 private:
  const StitchedRig& rig_;
  DistanceField field_;
};

// Decoded photos, the least recently used go first.
class PhotoCache {
 public:
  PhotoCache(const StitchedRig& rig, const std::function<cv::Mat(const Photo&)>& load, size_t bytes)
      : rig_(rig), load_(load), bytes_(bytes) {}
  cv::Mat Get(int photo) {
    {
      const std::lock_guard lock(mutex_);
      for (auto it = items_.begin(); it != items_.end(); ++it) {
        if (it->first == photo) {
          items_.splice(items_.begin(), items_, it);
          return items_.front().second;
        }
      }
    }
    cv::Mat picture = load_(rig_.photos[static_cast<size_t>(photo)]);
    const std::lock_guard lock(mutex_);
    items_.emplace_front(photo, picture);
    size_t sum = 0;
    for (auto it = items_.begin(); it != items_.end();) {
      sum += it->second.total() * it->second.elemSize();
      it = sum > bytes_ && it != items_.begin() ? items_.erase(it) : std::next(it);
    }
    return picture;
  }

 private:
  const StitchedRig& rig_;
  const std::function<cv::Mat(const Photo&)>& load_;
  size_t bytes_;
  std::mutex mutex_;
  std::list<std::pair<int, cv::Mat>> items_;
};

// A photo in the low-resolution picture where seams are found.
struct LowPhoto {
  int photo = 0;
  Region region;
  cv::Mat picture;  // 8-bit BGR
  cv::Mat inside;   // as Renderer::Maps
  cv::Mat mask;     // 8-bit
};

std::vector<LowPhoto> RenderLow(const StitchedRig& rig, const Renderer& renderer, PhotoCache* cache, int width,
                                int threads, const CancelToken& cancel) {
  std::vector<LowPhoto> all(rig.photos.size());
  ParallelFor(static_cast<int64_t>(rig.photos.size()), threads, cancel, [&](int64_t i) {
    LowPhoto& low = all[static_cast<size_t>(i)];
    low.photo = static_cast<int>(i);
    const Footprint f = renderer.FootprintOf(low.photo, width);
    if (!f.any) return;
    low.region = f.region;
    const RigPhoto& p = rig.state.photos[static_cast<size_t>(i)];
    const double factor =
        std::min(1.0, 1.2 * width / (2 * kPi) / rig.state.lenses[static_cast<size_t>(p.lens)].focal_px);
    cv::Mat small;
    const cv::Mat picture = cache->Get(low.photo);
    cv::resize(picture, small, cv::Size(), factor, factor, cv::INTER_AREA);
    cv::Mat map;
    renderer.Maps(low.photo, low.region, width, factor, &map, &low.inside);  // OpenCV's scale; its size is rounded
    cv::remap(small, low.picture, map, cv::Mat(), cv::INTER_LINEAR, cv::BORDER_REFLECT);
    low.mask = low.inside > 0.004;
  });
  std::erase_if(all, [](const LowPhoto& l) { return l.picture.empty() || cv::countNonZero(l.mask) == 0; });
  return all;
}

// Best `inside` of all photos in the wrapped picture.
cv::Mat BestInside(const std::vector<LowPhoto>& photos, int width) {
  cv::Mat best(width / 2, width, CV_32F, cv::Scalar(-1));
  for (const LowPhoto& l : photos) {
    for (int y = 0; y < l.region.height; ++y) {
      float* b = best.ptr<float>(l.region.y + y);
      const float* in = l.inside.ptr<float>(y);
      for (int x = 0; x < l.region.width; ++x) {
        float& at = b[FloorMod(l.region.x + x, width)];
        at = std::max(at, in[x]);
      }
    }
  }
  return best;
}

// Gains that make overlaps alike. A photo that crosses the picture's end is given twice, once on each side.
std::vector<Eigen::Vector3d> FindGains(const StitchedRig& rig, const std::vector<LowPhoto>& photos, int width,
                                       const std::string& kind) {
  std::vector<Eigen::Vector3d> gains(rig.photos.size(), Eigen::Vector3d::Ones());
  if (kind == "none" || photos.size() < 2) return gains;
  std::vector<cv::Point> corners;
  std::vector<cv::UMat> pictures;
  std::vector<std::pair<cv::UMat, uchar>> masks;
  std::vector<int> of;
  for (const LowPhoto& l : photos) {
    for (const int shift : {0, -width}) {
      if (shift != 0 && l.region.x + l.region.width <= width) continue;
      corners.emplace_back(l.region.x + shift, l.region.y);
      cv::UMat picture, mask;
      l.picture.copyTo(picture);
      l.mask.copyTo(mask);
      pictures.push_back(picture);
      masks.emplace_back(mask, 255);
      of.push_back(l.photo);
    }
  }
  std::vector<Eigen::Vector3d> sum(rig.photos.size(), Eigen::Vector3d::Zero());
  std::vector<int> count(rig.photos.size(), 0);
  if (kind == "channels") {
    cv::detail::ChannelsCompensator compensator(2);
    compensator.feed(corners, pictures, masks);
    const std::vector<cv::Scalar> found = compensator.gains();
    for (size_t k = 0; k < of.size(); ++k) {
      sum[static_cast<size_t>(of[k])] += Eigen::Vector3d(found[k][0], found[k][1], found[k][2]);
      ++count[static_cast<size_t>(of[k])];
    }
  } else {
    cv::detail::GainCompensator compensator(2);
    compensator.feed(corners, pictures, masks);
    const std::vector<double> found = compensator.gains();
    for (size_t k = 0; k < of.size(); ++k) {
      sum[static_cast<size_t>(of[k])] += Eigen::Vector3d::Constant(found[k]);
      ++count[static_cast<size_t>(of[k])];
    }
  }
  for (size_t i = 0; i < gains.size(); ++i) {
    if (count[i] > 0) gains[i] = (sum[i] / count[i]).cwiseMax(0.2).cwiseMin(5.0);
  }
  return gains;
}

cv::Mat WithGain(const cv::Mat& picture, const Eigen::Vector3d& gain) {
  if ((gain - Eigen::Vector3d::Ones()).norm() < 1e-3) return picture;
  cv::Mat out;
  cv::multiply(picture, cv::Scalar(gain(0), gain(1), gain(2)), out);
  return out;
}

// Pair by pair: what two photos' masks have in common is left to one of them.
void CutSeams(std::vector<LowPhoto>* photos, int width, const std::string& kind,
              const std::vector<Eigen::Vector3d>& gains, const CancelToken& cancel) {
  std::vector<cv::UMat> pictures(photos->size()), masks(photos->size());
  for (size_t k = 0; k < photos->size(); ++k) {
    WithGain((*photos)[k].picture, gains[static_cast<size_t>((*photos)[k].photo)]).convertTo(pictures[k], CV_32F);
    (*photos)[k].mask.copyTo(masks[k]);
  }
  cv::Ptr<cv::detail::SeamFinder> finder;
  if (kind == "graphcut") {
    finder = cv::makePtr<cv::detail::GraphCutSeamFinder>(cv::detail::GraphCutSeamFinderBase::COST_COLOR);
  } else {
    finder = cv::makePtr<cv::detail::DpSeamFinder>(cv::detail::DpSeamFinder::COLOR);
  }
  for (size_t a = 0; a < photos->size(); ++a) {
    for (size_t b = a + 1; b < photos->size(); ++b) {
      cancel.ThrowIfCancelled();
      for (const int shift : {-width, 0, width}) {
        const Region ra = (*photos)[a].region;
        Region rb = (*photos)[b].region;
        rb.x += shift;
        if ((ra & rb).area() <= 0) continue;
        std::vector<cv::UMat> two = {pictures[a], pictures[b]}, two_masks = {masks[a], masks[b]};
        finder->find(two, {ra.tl(), rb.tl()}, two_masks);
        masks[a] = two_masks[0], masks[b] = two_masks[1];
      }
    }
  }
  for (size_t k = 0; k < photos->size(); ++k) masks[k].copyTo((*photos)[k].mask);
}

// Which photo each pixel of the low-resolution picture is taken from; -1: none.
cv::Mat FindSeams(std::vector<LowPhoto>* photos, int width, const std::string& kind,
                  const std::vector<Eigen::Vector3d>& gains, const CancelToken& cancel) {
  const cv::Mat best = BestInside(*photos, width);
  // The middle of a photo is better than its edge: a photo may take a pixel only where it is not far behind the best.
  for (LowPhoto& l : *photos) {
    for (int y = 0; y < l.region.height; ++y) {
      const float* b = best.ptr<float>(l.region.y + y);
      const float* in = l.inside.ptr<float>(y);
      uchar* m = l.mask.ptr<uchar>(y);
      for (int x = 0; x < l.region.width; ++x) {
        if (in[x] < 0.35F * b[FloorMod(l.region.x + x, width)]) m[x] = 0;
      }
    }
  }
  if (kind != "none") CutSeams(photos, width, kind, gains, cancel);
  // What is left with several photos, or with none after a chain of decisions, goes to the one it lies deepest in.
  cv::Mat label(width / 2, width, CV_16S, cv::Scalar(-1));
  cv::Mat depth(width / 2, width, CV_32F, cv::Scalar(0));
  for (const bool chosen : {true, false}) {
    const cv::Mat before = label.clone();
    for (const LowPhoto& l : *photos) {
      for (int y = 0; y < l.region.height; ++y) {
        const uchar* m = l.mask.ptr<uchar>(y);
        const float* in = l.inside.ptr<float>(y);
        for (int x = 0; x < l.region.width; ++x) {
          if (chosen ? m[x] == 0 : in[x] <= 0.004F) continue;
          const int at = FloorMod(l.region.x + x, width), row = l.region.y + y;
          if (!chosen && before.at<short>(row, at) >= 0) continue;
          float& d = depth.at<float>(row, at);
          if (in[x] <= d) continue;
          d = in[x];
          label.at<short>(row, at) = static_cast<short>(l.photo);
        }
      }
    }
  }
  return label;
}

// The full sphere, unless a part of the horizon is not seen and what is lies within the ends of the picture: then the
// box about it. `coverage` is a smaller picture of the full sphere.
cv::Rect FilledPart(const cv::Mat& coverage, int width) {
  const cv::Rect whole(0, 0, width, width / 2);
  cv::Mat columns;
  cv::reduce(coverage, columns, 0, cv::REDUCE_MAX);
  const int unseen = coverage.cols - cv::countNonZero(columns);
  constexpr int kLeastGap = 16;  // of the horizon, 1 part of so many
  if (unseen * kLeastGap < coverage.cols || unseen == coverage.cols) return whole;
  const cv::Rect box = cv::boundingRect(coverage);
  if (box.x == 0 || box.br().x == coverage.cols) return whole;
  const double scale = static_cast<double>(width) / coverage.cols;
  const cv::Point first(static_cast<int>((box.x - 1) * scale), static_cast<int>(std::max(0, box.y - 1) * scale));
  const cv::Point last(static_cast<int>((box.br().x + 1) * scale), static_cast<int>((box.br().y + 1) * scale));
  cv::Rect part = cv::Rect(first, last) & whole;
  if (part.width == 2 * part.height) part.height -= 1;  // a picture twice as wide as high is taken for a full sphere
  return part;
}

// Coverage, what each photo fills, and the part of the sphere that is worth a picture.
void MeasureCoverage(const cv::Mat& label, Composite* result) {
  result->coverage = label >= 0;
  double seen = 0, all = 0;
  for (int y = 0; y < label.rows; ++y) {
    const double area = std::cos((0.5 - (y + 0.5) / label.rows) * kPi);
    for (int x = 0; x < label.cols; ++x) {
      all += area;
      const short l = label.at<short>(y, x);
      if (l < 0) continue;
      seen += area;
      result->share[static_cast<size_t>(l)] += area;
    }
  }
  for (double& s : result->share) s /= all;
  result->covered = seen / all;
  result->part = FilledPart(result->coverage, result->width);
}

// Draws the panorama at full resolution, a tile at a time; several threads may do so at once.
class TilePainter {
 public:
  TilePainter(const Renderer& renderer, PhotoCache* cache, const Composite& composite, const cv::Mat& label, int bands)
      : renderer_(renderer), cache_(cache), composite_(composite), label_(label), bands_(bands) {}

  // `to`: BGRA, as large as the tile; untouched where no photo is.
  void Paint(const Region& tile, cv::Mat to) const {
    const int top = std::max(0, tile.y - margin_), bottom = std::min(composite_.height, tile.br().y + margin_);
    const Region region(tile.x - margin_, top, tile.width + 2 * margin_, bottom - top);
    cv::Mat labels(region.size(), CV_16S);
    const std::set<short> used = FindLabels(region, &labels);
    if (used.empty()) return;
    cv::Ptr<cv::detail::Blender> blender;
    if (bands_ > 0) {
      blender = cv::makePtr<cv::detail::MultiBandBlender>(0, bands_, CV_32F);
    } else {
      blender = cv::detail::Blender::createDefault(cv::detail::Blender::NO, false);
    }
    blender->prepare(region);
    for (const short photo : used) Feed(photo, region, labels == photo, blender.get());
    cv::Mat blended, mask;
    blender->blend(blended, mask);
    const Region interior(margin_, tile.y - top, tile.width, tile.height);
    cv::Mat eight;
    blended(interior).convertTo(eight, CV_8U);
    const int channels[] = {0, 0, 1, 1, 2, 2, 3, 3};
    const std::vector<cv::Mat> from = {eight, mask(interior)};
    cv::mixChannels(from.data(), from.size(), &to, 1, channels, 4);
  }

 private:
  // Labels of a region: the nearest low-resolution pixel, with seams smoothed by the blending. Those that occur.
  std::set<short> FindLabels(const Region& region, cv::Mat* labels) const {
    const double scale = static_cast<double>(label_.cols) / composite_.width;
    std::set<short> used;
    for (int y = 0; y < region.height; ++y) {
      const short* from = label_.ptr<short>(std::min(label_.rows - 1, static_cast<int>((region.y + y + 0.5) * scale)));
      short* to = labels->ptr<short>(y);
      for (int x = 0; x < region.width; ++x) {
        const int at = static_cast<int>((FloorMod(region.x + x, composite_.width) + 0.5) * scale);
        to[x] = from[std::min(at, label_.cols - 1)];
        if (to[x] >= 0) used.insert(to[x]);
      }
    }
    return used;
  }

  // The part of the region that the photo can fill, and what the pyramid needs around it.
  void Feed(short photo, const Region& region, const cv::Mat& mine, cv::detail::Blender* blender) const {
    Region box = cv::boundingRect(mine);
    box.x = std::max(0, box.x - margin_), box.y = std::max(0, box.y - margin_);
    box.width = std::min(region.width, cv::boundingRect(mine).br().x + margin_) - box.x;
    box.height = std::min(region.height, cv::boundingRect(mine).br().y + margin_) - box.y;
    const Region place(region.x + box.x, region.y + box.y, box.width, box.height);
    cv::Mat map, inside, warped, signed16;
    renderer_.Maps(photo, place, composite_.width, 1.0, &map, &inside);
    cv::remap(cache_->Get(photo), warped, map, cv::Mat(), cv::INTER_LINEAR, cv::BORDER_REFLECT);
    const cv::Mat mask = mine(box) & (inside > 0);
    WithGain(warped, composite_.gains[static_cast<size_t>(photo)]).convertTo(signed16, CV_16S);
    blender->feed(signed16, mask, place.tl());
  }

  const Renderer& renderer_;
  PhotoCache* cache_;
  const Composite& composite_;
  const cv::Mat& label_;  // of the low-resolution picture
  int bands_, margin_ = bands_ > 0 ? 4 << bands_ : 0;
};

}  // namespace

std::vector<std::string> CompositeOptions::Check() const {
  std::vector<std::string> problems = CheckRanges(*this);
  const auto one_of = [&](const char* name, const std::string& value, const std::set<std::string>& known,
                          const char* text) {
    if (known.count(value) == 0)
      problems.push_back("option " + std::string(name) + " is '" + value + "', expected " + text);
  };
  one_of("format", format, {"jpg", "tif"}, "jpg or tif");
  one_of("seams", seams, {"graphcut", "dp", "none"}, "graphcut, dp or none");
  one_of("exposure", exposure, {"channels", "gain", "none"}, "channels, gain or none");
  if (width != 0 && (width < 256 || width % 2 != 0))
    problems.push_back("option width is " + std::to_string(width) + ", expected 0 or an even number from 256 px");
  return problems;
}

int NativeWidth(const StitchedRig& rig) {
  double focal = 0;
  for (const RigPhoto& p : rig.state.photos) {
    if (p.placed) focal = std::max(focal, rig.state.lenses[static_cast<size_t>(p.lens)].focal_px);
  }
  return std::clamp(static_cast<int>(std::lround(2 * kPi * focal / 32)) * 32, 512, 16384);
}

Composite CompositePanorama(const StitchedRig& rig, const std::function<cv::Mat(const Photo&)>& load,
                            const CompositeOptions& options, int threads, const StripSink& sink, ProgressSink& progress,
                            const CancelToken& cancel) {
  cv::setNumThreads(1);  // whole tiles in parallel use the cores better
  Composite result;
  result.width = options.width > 0 ? options.width : NativeWidth(rig);
  result.height = result.width / 2;
  const int width = result.width;
  const Renderer renderer(rig, options);
  PhotoCache cache(rig, load, static_cast<size_t>(options.memory_mb) << 20);

  const int low_width = std::min(options.seam_width, width) & ~1;
  progress.Begin("exposure and seams", 0);
  std::vector<LowPhoto> low = RenderLow(rig, renderer, &cache, low_width, threads, cancel);
  result.gains = FindGains(rig, low, low_width, options.exposure);
  const cv::Mat label = FindSeams(&low, low_width, options.seams, result.gains, cancel);
  low.clear();
  result.share.assign(rig.photos.size(), 0.0);
  MeasureCoverage(label, &result);
  sink.begin(result);

  const TilePainter painter(renderer, &cache, result, label, options.bands);
  const cv::Rect& part = result.part;
  const int strips = (part.height + kTile - 1) / kTile, columns = (part.width + kTile - 1) / kTile;
  progress.Begin("panorama", static_cast<int64_t>(strips) * columns);
  for (int strip = 0; strip < strips; ++strip) {
    const int y0 = part.y + strip * kTile, rows = std::min(kTile, part.br().y - y0);
    cv::Mat out(rows, part.width, CV_8UC4, cv::Scalar::all(0));
    ParallelFor(columns, threads, cancel, [&](int64_t c) {
      const int x0 = part.x + static_cast<int>(c) * kTile, cols = std::min(kTile, part.br().x - x0);
      painter.Paint(Region(x0, y0, cols, rows), out(cv::Rect(x0 - part.x, 0, cols, rows)));
      progress.Advance(1);
    });
    sink.rows(out);
  }
  return result;
}

}  // namespace trigpoint

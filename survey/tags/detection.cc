#include "survey/tags/detection.h"

#include <apriltag/apriltag.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <opencv2/imgproc.hpp>
#include <tuple>

#include "calib/base/error.h"
#include "calib/base/parallel.h"
#include "calib/camera/pixel_convention.h"
#include "datasets/io/tag_families.h"
#include "survey/tags/corner_refinement.h"
#include "survey/tags/tag_family.h"
#include "survey/tags/tag_finder.h"

namespace trigpoint {
namespace {

// The families that are looked for.
struct Families {
  explicit Families(const DetectTagsOptions& options) : wanted(options.family) {
    for (const std::string& name : wanted.names()) all.push_back(std::make_unique<TagFamily>(name));
  }
  const TagFamily& Named(const apriltag_family* family) const {
    return **std::find_if(all.begin(), all.end(), [&](const auto& f) { return f->get() == family; });
  }
  TagFamilies wanted;
  std::vector<std::unique_ptr<TagFamily>> all;
};

// A detector of the library, for one thread at a time. The families' tables of codes, which the first one fills, are
// read by all.
class Detector {
 public:
  Detector(const DetectTagsOptions& options, const Families& families)
      : options_(options), families_(families), detector_(apriltag_detector_create(), apriltag_detector_destroy) {
    for (const auto& family : families.all) {
      apriltag_detector_add_family_bits(detector_.get(), family->get(),
                                        std::min(options.max_hamming, family->Correctable()));
    }
    detector_->nthreads = 1;
    detector_->quad_decimate = static_cast<float>(std::max(1.0, options.quad_decimate));
    detector_->quad_sigma = static_cast<float>(options.quad_sigma);
  }

  ImageTags Detect(const cv::Mat& grey, const Camera* camera, int64_t* refused) {
    ImageTags out;
    out.usable = true;
    // The library only shrinks pictures. Enlarged ones show it edges of tags that are a few pixels wide.
    const double enlarged = 1 / std::min(1.0, options_.quad_decimate);
    cv::Mat searched = grey;
    if (enlarged > 1) cv::resize(grey, searched, {}, enlarged, enlarged, cv::INTER_CUBIC);
    // The library works on the picture's own memory and does not write to it.
    image_u8_t image{searched.cols, searched.rows, static_cast<int32_t>(searched.step[0]), searched.data};
    const std::unique_ptr<zarray_t, void (*)(zarray_t*)> found(apriltag_detector_detect(detector_.get(), &image),
                                                               apriltag_detections_destroy);
    for (int i = 0; i < zarray_size(found.get()); ++i) {
      apriltag_detection_t* d = nullptr;
      zarray_get(found.get(), i, &d);
      const TagFamily& family = families_.Named(d->family);
      // The same number in another family is another tag, and none of the site's.
      if (families_.wanted.Of(d->id) != family.name()) continue;
      TagDetection tag;
      tag.family = family.name();
      tag.id = d->id;
      tag.hamming = d->hamming;
      tag.margin = d->decision_margin;
      double side = 1e300;
      for (int k = 0; k < 4; ++k) {
        tag.corners[k] = FromAprilTagPixel(Eigen::Vector2d(d->p[k][0], d->p[k][1]) / enlarged);
      }
      for (int k = 0; k < 4; ++k) side = std::min(side, (tag.corners[(k + 1) % 4] - tag.corners[k]).norm());
      tag.corner_sigma_px.fill(options_.raw_sigma_px * std::max(1.0, options_.quad_decimate));
      if (tag.hamming > std::min(options_.max_hamming, family.Correctable()) || tag.margin < options_.min_margin ||
          side < options_.min_side_px) {
        ++*refused;
        continue;
      }
      if (options_.refine) {
        const CornerRefinement fit = RefineCorners(grey, family.Pattern(tag.id), tag.corners, camera);
        if (fit.ok) {
          tag.corners = fit.corners;
          tag.corner_sigma_px = fit.sigma_px;
          tag.refined = true;
        }
      }
      out.detections.push_back(tag);
    }
    std::sort(out.detections.begin(), out.detections.end(), [](const TagDetection& a, const TagDetection& b) {
      return std::tuple(a.id, a.corners[0].x(), a.corners[0].y()) <
             std::tuple(b.id, b.corners[0].x(), b.corners[0].y());
    });
    return out;
  }

 private:
  const DetectTagsOptions& options_;
  const Families& families_;
  std::unique_ptr<apriltag_detector_t, void (*)(apriltag_detector_t*)> detector_;
};

}  // namespace

// Detectors are handed out to threads and given back.
struct TagFinder::Pool {
  explicit Pool(const DetectTagsOptions& its) : options(its), families(options) {
    Give(std::make_unique<Detector>(options, families));
  }
  std::unique_ptr<Detector> Take() {
    {
      const std::lock_guard lock(mutex);
      if (!idle.empty()) {
        std::unique_ptr<Detector> detector = std::move(idle.back());
        idle.pop_back();
        return detector;
      }
    }
    return std::make_unique<Detector>(options, families);
  }
  void Give(std::unique_ptr<Detector> detector) {
    const std::lock_guard lock(mutex);
    idle.push_back(std::move(detector));
  }
  const DetectTagsOptions options;
  Families families;
  std::mutex mutex;
  std::vector<std::unique_ptr<Detector>> idle;
};

TagFinder::TagFinder(const DetectTagsOptions& options) {
  if (const std::vector<std::string> problems = options.Check(); !problems.empty()) throw OptionError(problems.front());
  pool_ = std::make_unique<Pool>(options);
}
TagFinder::~TagFinder() = default;

bool IsMasked(const TagDetection& tag, const cv::Mat& mask) {
  const cv::Rect whole({}, mask.size());
  return std::any_of(tag.corners.begin(), tag.corners.end(), [&](const Eigen::Vector2d& corner) {
    const cv::Point at(cvRound(corner.x()), cvRound(corner.y()));
    return whole.contains(at) && mask.at<uint8_t>(at) == 0;
  });
}

ImageTags TagFinder::Find(const std::function<cv::Mat()>& picture, const Camera* camera, int64_t* refused) {
  ImageTags tags;
  try {
    const cv::Mat grey = picture();
    if (grey.empty() || grey.type() != CV_8UC1) throw InputError("the picture is not a grey 8-bit one");
    std::unique_ptr<Detector> detector = pool_->Take();
    tags = detector->Detect(grey, camera, refused);
    pool_->Give(std::move(detector));
  } catch (const InputError& error) {
    tags.problem = error.what();
  }
  return tags;
}

double TagDetection::SigmaPx() const {
  double sum = 0;
  for (double s : corner_sigma_px) sum += s * s;
  return std::sqrt(sum / 4);
}

double TagDetection::ShortestSide() const {
  double side = 1e300;
  for (int k = 0; k < 4; ++k) side = std::min(side, (corners[(k + 1) % 4] - corners[k]).norm());
  return side;
}

Eigen::Vector3d TagCorner(double size_m, int k) {
  const double h = 0.5 * size_m;
  return {k == 1 || k == 2 ? h : -h, k < 2 ? h : -h, 0};
}

std::vector<std::string> DetectTagsOptions::Check() const {
  std::vector<std::string> problems = CheckRanges(*this);
  try {
    const std::vector<std::string> known = TagFamilyNames();
    const TagFamilies wanted(family);
    for (const std::string& name : wanted.names()) {
      if (std::find(known.begin(), known.end(), name) != known.end()) continue;
      problems.push_back(fmt::format("option family is \"{}\", expected one of {}", name, fmt::join(known, ", ")));
    }
  } catch (const OptionError& e) {
    problems.push_back(std::string("option family: ") + e.what());
  }
  return problems;
}

DetectTagsResult DetectTags(int64_t count, const PictureSource& picture, const CameraSource& camera,
                            const DetectTagsOptions& options, int threads, ProgressSink& progress,
                            const CancelToken& cancel) {
  TagFinder finder(options);
  DetectTagsResult result;
  result.images.resize(count);
  std::vector<int64_t> refused(count, 0);
  progress.Begin("detecting tags", count);
  ParallelFor(count, threads, cancel, [&](int64_t i) {
    result.images[i] = finder.Find([&] { return picture(i); }, camera ? camera(i) : nullptr, &refused[i]);
    progress.Advance(1);
  });
  for (int64_t i = 0; i < count; ++i) {
    const ImageTags& image = result.images[i];
    result.unusable += image.usable ? 0 : 1;
    result.refused += refused[i];
    result.detections += static_cast<int64_t>(image.detections.size());
    for (const TagDetection& tag : image.detections) result.unrefined += options.refine && !tag.refined ? 1 : 0;
  }
  return result;
}

}  // namespace trigpoint

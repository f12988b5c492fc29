#include "localize/references/align_views.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>

#include "calib/base/parallel.h"
#include "localize/reconstruct/patch.h"
#include "localize/reconstruct/surface_warp.h"

namespace trigpoint {
namespace {

constexpr size_t kAtATime = 100'000;  // patches of 2 KiB

// An observation of a reference, and the run's observation whose picture is looked for in it.
struct Sought {
  size_t in_view = 0, in_image = 0;
  std::unique_ptr<const Patch> patch;  // none: the image shows nothing there
  bool readable = false;               // the image
};

void Append(const AlignedViews& some, AlignedViews* all) {
  all->tried += some.tried;
  all->observations.insert(all->observations.end(), some.observations.begin(), some.observations.end());
  all->elsewhere.insert(all->elsewhere.end(), some.elsewhere.begin(), some.elsewhere.end());
  all->pixels.insert(all->pixels.end(), some.pixels.begin(), some.pixels.end());
}

// Whether a patch about the pixel lies in the picture, whatever its feature's scale.
bool HasRoomForPatch(const Camera& camera, const Eigen::Vector2d& pixel) {
  constexpr double kLargest_px = 15;
  const Eigen::Vector2d end = Eigen::Vector2d(camera.width(), camera.height()).array() - kLargest_px;
  return pixel.minCoeff() > kLargest_px && pixel.x() < end.x() && pixel.y() < end.y();
}

// Of some references, all of whose patches are in memory.
class ViewAligner {
 public:
  ViewAligner(const LocalizeInput& input, const std::vector<ReferenceViews>& references,
              const std::vector<int>& first_view, const Reconstruction& r)
      : input_(input), references_(references), first_view_(first_view), r_(r), p_(r.problem) {}

  // The observations of each reference.
  AlignedViews Run(const std::vector<std::vector<size_t>>& of_reference, int threads, const CancelToken& cancel) const {
    std::vector<std::vector<Sought>> sought(of_reference.size());
    std::map<int, std::vector<Sought*>> of_image;
    AlignedViews all;
    for (size_t i = 0; i < of_reference.size(); ++i) {
      for (const size_t k : of_reference[i]) {
        if (const auto best = MostAlike(k)) {
          sought[i].push_back({k, *best});
        } else if (!ReadByRows(k)) {
          all.elsewhere.push_back(k);
        }
      }
      for (Sought& s : sought[i]) of_image[r_.image_of[s.in_image]].push_back(&s);
    }
    const std::vector<std::pair<int, std::vector<Sought*>>> images(of_image.begin(), of_image.end());
    ParallelFor(static_cast<int64_t>(images.size()), threads, cancel, [&](int64_t k) {
      const auto& [image, its] = images[static_cast<size_t>(k)];
      CutPatches(image, its);
    });
    std::vector<AlignedViews> found(sought.size());
    ParallelFor(static_cast<int64_t>(sought.size()), threads, cancel,
                [&](int64_t i) { found[static_cast<size_t>(i)] = AlignReference(sought[static_cast<size_t>(i)]); });
    for (const AlignedViews& f : found) Append(f, &all);
    return all;
  }

 private:
  PlacedCamera PlacedOf(size_t k) const {
    const BearingObservation& o = p_.observations[k];
    const Rigid3d from_world = p_.views[static_cast<size_t>(o.view)] * p_.poses[static_cast<size_t>(o.pose)];
    if (r_.image_of[k] >= 0) return {input_.cameras[static_cast<size_t>(o.view)].camera, from_world};
    return {references_[ReferenceOf(r_, k)].rig.views[ViewOf(k)].camera, from_world};
  }
  // Of its reference.
  size_t ViewOf(size_t k) const {
    return static_cast<size_t>(p_.observations[k].view - first_view_[ReferenceOf(r_, k)]);
  }
  const Eigen::Vector3d& PointOf(size_t k) const { return p_.points[static_cast<size_t>(p_.observations[k].point)]; }

  // Calls `visit` with each believed observation of the same point by an image of the run.
  template <typename Visit>
  void VisitImages(size_t k, Visit&& visit) const {
    const auto same = [&](size_t j) { return p_.observations[j].point == p_.observations[k].point; };
    const auto consider = [&](size_t j) {
      if (r_.image_of[j] >= 0 && p_.observations[j].active) visit(j);
    };
    for (size_t j = k; j > 0 && same(j - 1); --j) consider(j - 1);
    for (size_t j = k + 1; j < p_.observations.size() && same(j); ++j) consider(j);
  }
  // By a camera whose images are not aligned.
  bool IsReadByRows(size_t j) const {
    return input_.cameras[static_cast<size_t>(p_.observations[j].view)].readout_s != 0;
  }
  bool ReadByRows(size_t k) const {
    bool any = false;
    VisitImages(k, [&](size_t j) { any = any || IsReadByRows(j); });
    return any;
  }

  // The run's observation of the same point that sees it most alike: from about the same side and as large.
  std::optional<size_t> MostAlike(size_t k) const {
    const Eigen::Vector3d& y = PointOf(k);
    const PlacedCamera view = PlacedOf(k);
    const Eigen::Vector3d to_view = view.from_world.TargetOriginInSource() - y;
    std::optional<size_t> best;
    double least = 0;
    VisitImages(k, [&](size_t j) {
      if (IsReadByRows(j)) return;
      const PlacedCamera camera = PlacedOf(j);
      const auto pixel = camera.camera.Project(p_.observations[j].ray.cast<double>());
      if (!pixel || !HasRoomForPatch(camera.camera, *pixel)) return;
      const Eigen::Vector3d to_camera = camera.from_world.TargetOriginInSource() - y;
      const double angle = std::atan2(to_view.cross(to_camera).norm(), to_view.dot(to_camera));
      const double ratio = camera.camera.MeanFocal() / to_camera.norm() / (view.camera.MeanFocal() / to_view.norm());
      const double unlike = angle + std::abs(std::log(ratio));
      if (!best || unlike < least) best = j, least = unlike;
    });
    return best;
  }

  void CutPatches(int image, const std::vector<Sought*>& its) const {
    const cv::Mat grey = input_.image_picture(image);
    if (grey.empty()) return;
    const cv::Mat smooth = SmoothForPatches(grey);
    const std::vector<float> scales = input_.image_features(image).scales;
    for (Sought* s : its) {
      s->readable = true;
      const PlacedCamera camera = PlacedOf(s->in_image);
      const auto pixel = camera.camera.Project(p_.observations[s->in_image].ray.cast<double>());
      if (!pixel) continue;
      const double distance = (camera.from_world * PointOf(s->in_image)).norm();
      auto patch = std::make_unique<Patch>();
      const float scale = scales[static_cast<size_t>(r_.feature_of[s->in_image])];
      if (patch->Cut(smooth, pixel->cast<float>(), PatchRadius(scale), distance / camera.camera.MeanFocal()))
        s->patch = std::move(patch);
    }
  }

  // View by view: pictures of many photos are large.
  AlignedViews AlignReference(std::vector<Sought>& sought) const {
    AlignedViews out;
    std::stable_sort(sought.begin(), sought.end(),
                     [&](const Sought& a, const Sought& b) { return ViewOf(a.in_view) < ViewOf(b.in_view); });
    std::unique_ptr<const ReferencePictures> pictures;
    cv::Mat smooth;
    for (size_t k = 0; k < sought.size(); ++k) {
      const Sought& s = sought[k];
      const size_t view = ViewOf(s.in_view);
      if (!pictures) pictures = input_.reference_pictures(static_cast<int>(ReferenceOf(r_, s.in_view)));
      if (k == 0 || view != ViewOf(sought[k - 1].in_view)) {
        const cv::Mat grey = pictures->View(static_cast<int>(view));
        smooth = grey.empty() ? cv::Mat() : SmoothForPatches(grey);
      }
      if (smooth.empty() || !s.readable) continue;
      ++out.tried;
      const std::optional<Eigen::Vector2f> pixel = s.patch ? AlignOne(s, smooth) : std::nullopt;
      (pixel ? out.observations : out.elsewhere).push_back(s.in_view);
      if (pixel) out.pixels.push_back(*pixel);
    }
    return out;
  }

  // The surface may face the run's camera, or both, or be level: which it does is seen where the pictures agree best.
  std::optional<Eigen::Vector2f> AlignOne(const Sought& s, const cv::Mat& smooth) const {
    const PlacedCamera camera = PlacedOf(s.in_image), view = PlacedOf(s.in_view);
    const Eigen::Vector3d& y = PointOf(s.in_view);
    const auto warp = WarpBetween(camera, view, y);
    const auto start = view.camera.Project(p_.observations[s.in_view].ray.cast<double>());
    if (!warp || !start) return {};
    const Eigen::Vector3d to_camera = (camera.from_world.TargetOriginInSource() - y).normalized();
    const Eigen::Vector3d to_view = (view.from_world.TargetOriginInSource() - y).normalized();
    // Where the run's frame is not level, a panorama is about so, and a photo held upright.
    const Eigen::Quaterniond& of_reference = p_.poses[static_cast<size_t>(p_.observations[s.in_view].pose)].rotation;
    const Eigen::Vector3d up =
        input_.levelled ? Eigen::Vector3d(0, 0, 1) : of_reference.conjugate() * Eigen::Vector3d(0, -1, 0);
    std::optional<Eigen::Vector2f> best;
    float most = 0;
    for (const Eigen::Vector3d& normal : {to_camera, Eigen::Vector3d(to_camera + to_view), up}) {
      const std::optional<ExpectedPlane> plane = PlaneBetween(camera, view, y, normal);
      if (!plane) continue;
      Patch patch = *s.patch;
      Eigen::Vector2f pixel = start->cast<float>();
      const std::optional<float> correlation = patch.AlignPlane(smooth, *warp, *plane, &pixel);
      if (!correlation || *correlation <= most || !view.camera.Unproject(pixel.cast<double>())) continue;
      best = pixel, most = *correlation;
    }
    return best;
  }

  const LocalizeInput& input_;
  const std::vector<ReferenceViews>& references_;
  const std::vector<int>& first_view_;
  const Reconstruction& r_;
  const BundleProblem& p_;
};

}  // namespace

AlignedViews AlignViews(const LocalizeInput& input, const std::vector<ReferenceViews>& references,
                        const std::vector<int>& first_view, const Reconstruction& r, int threads,
                        ProgressSink& progress, const CancelToken& cancel) {
  std::map<size_t, std::vector<size_t>> of_reference;
  for (size_t k = 0; k < r.problem.observations.size(); ++k) {
    if (r.image_of[k] >= 0 || !r.problem.observations[k].active) continue;
    const size_t reference = ReferenceOf(r, k);
    if (first_view[reference] >= 0) of_reference[reference].push_back(k);
  }
  progress.Begin("aligning the pictures of references", static_cast<int64_t>(of_reference.size()));
  const ViewAligner aligner(input, references, first_view, r);
  AlignedViews all;
  std::vector<std::vector<size_t>> some;
  size_t patches = 0;
  for (auto at = of_reference.begin(); at != of_reference.end();) {
    patches += at->second.size();
    some.push_back(std::move(at->second));
    if (++at != of_reference.end() && patches + at->second.size() <= kAtATime) continue;
    Append(aligner.Run(some, threads, cancel), &all);
    progress.Advance(static_cast<int64_t>(some.size()));
    some.clear();
    patches = 0;
  }
  return all;
}

}  // namespace trigpoint

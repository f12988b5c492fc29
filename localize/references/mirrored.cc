#include "localize/references/mirrored.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

namespace trigpoint {
namespace {

constexpr int kCells = 4, kOrientations = 8;  // of a SIFT descriptor: rows and columns of cells, bins of each
constexpr size_t kMostTried = 40;             // of a city's panoramas, the first ones tell

// Left and right exchanged, the orientation of a feature stays the axis of its descriptor: what lies on one side of the
// axis comes to the other.
void MirrorDescriptor(const uint8_t* from, uint8_t* to) {
  for (int row = 0; row < kCells; ++row) {
    for (int col = 0; col < kCells; ++col) {
      for (int o = 0; o < kOrientations; ++o) {
        const int mirrored = ((kCells - 1 - row) * kCells + col) * kOrientations + (kOrientations - o) % kOrientations;
        to[(row * kCells + col) * kOrientations + o] = from[mirrored];
      }
    }
  }
}

// The rig of a picture whose mirror image has these views.
ViewRig MirroredRig(ViewRig rig) {
  const Eigen::Vector3d flip(-1, 1, 1);
  for (View& view : rig.views) {
    const Eigen::Matrix3d r = view.rig_from_view.rotation.toRotationMatrix();
    view.rig_from_view.rotation = Eigen::Quaterniond(Eigen::Matrix3d(flip.asDiagonal() * r * flip.asDiagonal()));
    view.rig_from_view.translation = flip.cwiseProduct(view.rig_from_view.translation);
  }
  return rig;
}

}  // namespace

FeatureSet MirroredFeatures(FeatureSet features, int width) {
  for (Eigen::Vector2f& p : features.points) p.x() = static_cast<float>(width - 1) - p.x();
  for (float& angle : features.angles) angle = std::numbers::pi_v<float> - angle;
  const cv::Mat as_seen = features.descriptors;
  features.descriptors = cv::Mat(as_seen.size(), CV_8U);
  for (int k = 0; k < as_seen.rows; ++k)
    MirrorDescriptor(as_seen.ptr<uint8_t>(k), features.descriptors.ptr<uint8_t>(k));
  return features;
}

std::optional<std::string> FindMirroredPanoramas(const LocalizeInput& input, const Reconstruction& reconstruction,
                                                 const RetrievalOptions& retrieval, const RegistrationOptions& options,
                                                 int threads, uint64_t seed, ProgressSink& progress,
                                                 const CancelToken& cancel) {
  LocalizeInput mirrored = input;
  mirrored.references.clear();
  std::vector<int> chosen;  // indices into input.references
  for (size_t i = 0; i < input.references.size() && chosen.size() < kMostTried; ++i) {
    if (input.references[i].kind != ReferenceKind::kPanorama) continue;
    chosen.push_back(static_cast<int>(i));
    mirrored.references.push_back(input.references[i]);
    mirrored.references.back().rig = MirroredRig(input.references[i].rig);
  }
  if (chosen.empty()) return std::nullopt;
  mirrored.view_features = [&](int reference, int view) {
    const int of_input = chosen[static_cast<size_t>(reference)];
    const ViewRig& rig = input.references[static_cast<size_t>(of_input)].rig;
    return MirroredFeatures(input.view_features(of_input, view), rig.views[static_cast<size_t>(view)].camera.width());
  };
  mirrored.view_index = nullptr;
  const Retrieval views =
      RetrieveViews(mirrored, {}, retrieval, options.max_distance_m, false, seed, threads, progress, cancel);
  const std::vector<Registration> found =
      RegisterReferences(mirrored, reconstruction, views, options, false, threads, seed, progress, cancel);
  std::string names;
  int count = 0;
  for (size_t k = 0; k < found.size(); ++k) {
    if (found[k].status != AnswerStatus::kLocalized) continue;
    if (++count <= 3) names += (names.empty() ? "" : ", ") + mirrored.references[k].name;
  }
  if (count == 0) return std::nullopt;
  return fmt::format(
      "no panorama is localized, but {} of {} are with left and right of their pictures exchanged ({}{}): the pictures "
      "are mirrored; expected panoramas as seen from within; flip these files left-right",
      count, found.size(), names, count > 3 ? ", ..." : "");
}

}  // namespace trigpoint

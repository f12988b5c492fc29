#include "localize/references/stitched_sets.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "calib/base/error.h"
#include "localize/references/match_noise.h"

namespace trigpoint {
namespace {

// The run's own observations, without those of the references; the points as all of them have it.
Reconstruction RunAlone(const Reconstruction& r) {
  Reconstruction out = r;
  out.problem.observations.clear();
  out.image_of.clear();
  out.feature_of.clear();
  for (size_t k = 0; k < r.problem.observations.size(); ++k) {
    if (r.image_of[k] < 0) continue;
    out.problem.observations.push_back(r.problem.observations[k]);
    out.image_of.push_back(r.image_of[k]);
    out.feature_of.push_back(r.feature_of[k]);
  }
  return out;
}

// Sizes of a rig against the stitched one, in sigmas of the stitched size's logarithm: worth a try, and believed.
constexpr double kLikelySize = 2, kPossibleSize = 3;

// One reference by itself, with another rig.
class SetRegistrar {
 public:
  SetRegistrar(const LocalizeInput& input, const Reconstruction& reconstruction, const Retrieval& retrieval,
               const RegistrationOptions& options, size_t reference, uint64_t seed, const CancelToken& cancel)
      : input_(input), reconstruction_(reconstruction), options_(options), seed_(seed), cancel_(cancel) {
    input_.references = {input.references[reference]};
    const int index = static_cast<int>(reference);
    input_.view_features = [all = input.view_features, index](int, int view) { return all(index, view); };
    retrieval_.of_image.resize(retrieval.of_image.size());
    for (size_t i = 0; i < retrieval_.of_image.size(); ++i) {
      for (Retrieval::Hit hit : retrieval.of_image[i]) {
        if (hit.reference != index) continue;
        hit.reference = 0;
        retrieval_.of_image[i].push_back(hit);
      }
    }
  }
  Registration Register(const ViewRig& rig) {
    input_.references[0].rig = rig;
    ProgressSink silent;
    return RegisterReferences(input_, reconstruction_, retrieval_, options_, false, 1, seed_, silent, cancel_).front();
  }

 private:
  LocalizeInput input_;
  const Reconstruction& reconstruction_;
  const RegistrationOptions& options_;
  uint64_t seed_;
  const CancelToken& cancel_;
  Retrieval retrieval_;
};

ViewRig Scaled(ViewRig rig, double factor) {
  for (View& v : rig.views) v.rig_from_view.translation *= factor;
  return rig;
}

RefineRigInput MakeInput(const Reconstruction& reconstruction, const std::vector<Eigen::Matrix3d>& covariances,
                         const Registration& g, const StitchedShape& shape, const ViewRig& rig, double scale) {
  RefineRigInput in;
  in.rig = Scaled(rig, scale);
  in.shape_covariance = shape.covariance;
  for (Eigen::Index r = 0; r < in.shape_covariance.rows(); ++r) {
    for (Eigen::Index c = 0; c < in.shape_covariance.cols(); ++c) {
      in.shape_covariance(r, c) *= (r % 6 >= 3 ? scale : 1) * (c % 6 >= 3 ? scale : 1);
    }
  }
  in.log_scale_sigma = shape.log_scale_sigma;
  in.rig_from_world = g.rig_from_odom;
  for (const ViewObservation& o : g.inliers) {
    const auto point = static_cast<size_t>(o.point);
    in.points.push_back({o.view, o.pixel.cast<double>(), reconstruction.problem.points[point], covariances[point]});
  }
  return in;
}

// The search for a set's pose and size.
class SetSearch {
 public:
  SetSearch(const Reconstruction& reconstruction, const std::vector<Eigen::Matrix3d>& covariances,
            const StitchedShape& shape, const RegistrationOptions& options, ViewRig stitched, SetRegistrar registrar)
      : reconstruction_(reconstruction),
        covariances_(covariances),
        shape_(shape),
        options_(options),
        stitched_(std::move(stitched)),
        registrar_(std::move(registrar)) {}

  // With the size as stitched, or where that gives no pose, others.
  void Begin() {
    best_ = registrar_.Register(stitched_);  // the points have moved since
    attempts_ = {best_};
    if (IsFound()) return;
    for (const double factor : {0.5, 2.0, 0.25, 4.0}) {
      if (std::abs(std::log(factor)) > kLikelySize * shape_.log_scale_sigma) continue;
      const Registration other = registrar_.Register(Scaled(stitched_, factor));
      attempts_.push_back(other);
      if (other.status == AnswerStatus::kLocalized && (!IsFound() || other.support > best_.support)) {
        best_ = other, scale_ = factor;
      }
    }
  }

  // The size first, and with it again which points are seen.
  void FindSize() {
    for (int round = 0; round < 2; ++round) {
      const RefinedRig sized = RefineRig(Input(), RigFreedom::kScaled);
      scale_ = std::clamp(scale_ * sized.scale, 0.02, 30.0);
      const Registration again = registrar_.Register(Scaled(stitched_, scale_));
      // A size that loses more points than chance explains (3 sigma of a count) has led to a wrong pose.
      if (again.status != AnswerStatus::kLocalized || again.support < best_.support - 3 * std::sqrt(best_.support))
        break;
      best_ = again;
    }
  }

  std::optional<std::string> WhyRefused() const {
    // A pose elsewhere that another size leads to is a second hypothesis like any other.
    const Eigen::Vector3d centre = best_.rig_from_odom.TargetOriginInSource();
    std::optional<std::string> why;
    for (const Registration& other : attempts_) {
      const double apart = (other.rig_from_odom.TargetOriginInSource() - centre).norm();
      if (apart < 1 || other.agreeing <= options_.rival_share * best_.agreeing) continue;
      why = fmt::format("ambiguous: another pose, {:.1f} m away, explains {} matches against {}", apart, other.agreeing,
                        best_.agreeing);
    }
    if (why) return why;
    // At a wrong pose the photos fit best with a small rig, so a size that stitching excludes is refused.
    const double possible = std::exp(kPossibleSize * shape_.log_scale_sigma);
    if (scale_ <= possible && scale_ >= 1 / possible) return std::nullopt;
    return fmt::format(
        "the distances between its photos would have to be {:.2g} times those found by stitching, expected {:.2g} "
        "to {:.2g} times (3 sigma)",
        scale_, 1 / possible, possible);
  }

  void Refine(const std::string& mode, SetRefinement* set) const {
    const RefineRigInput input = Input();
    set->freedom = mode == "scaled"  ? RigFreedom::kScaled
                   : mode == "prior" ? RigFreedom::kPrior
                   : mode == "free"  ? RigFreedom::kFree
                                     : ChooseFreedom(input, &set->hold_out);
    // "fixed" is chosen against the size just found, which is what it then stands for.
    if (set->freedom == RigFreedom::kFixed) set->freedom = RigFreedom::kScaled;
    set->rig = RefineRig(input, set->freedom);
    set->rig.scale *= scale_;
  }

  bool IsFound() const { return best_.status == AnswerStatus::kLocalized; }
  const Registration& best() const { return best_; }
  const Registration& as_stitched() const { return attempts_.front(); }

 private:
  RefineRigInput Input() const { return MakeInput(reconstruction_, covariances_, best_, shape_, stitched_, scale_); }

  const Reconstruction& reconstruction_;
  const std::vector<Eigen::Matrix3d>& covariances_;
  const StitchedShape& shape_;
  const RegistrationOptions& options_;
  ViewRig stitched_;
  SetRegistrar registrar_;
  Registration best_;
  std::vector<Registration> attempts_;
  double scale_ = 1;
};

}  // namespace

std::vector<SetRefinement> RefineSets(const LocalizeInput& input, const std::map<int, StitchedShape>& shapes,
                                      const RegistrationOptions& options, const std::string& mode,
                                      const Reconstruction& reconstruction, const Retrieval& retrieval, uint64_t seed,
                                      ProgressSink& progress, const CancelToken& cancel,
                                      std::vector<ReferenceViews>* references,
                                      std::vector<Registration>* registrations) {
  std::vector<SetRefinement> sets;
  if (mode == "fixed" || shapes.empty()) return sets;
  const std::vector<Eigen::Matrix3d> covariances = PointCovariances(reconstruction.problem);
  const Reconstruction run_alone = RunAlone(reconstruction);
  for (const auto& [index, shape] : shapes) {
    const auto i = static_cast<size_t>(index);
    ReferenceViews& reference = (*references)[i];
    Registration& answer = (*registrations)[i];
    cancel.ThrowIfCancelled();
    progress.Begin("rig of " + reference.name, 0);
    SetSearch search(reconstruction, covariances, shape, options, reference.rig,
                     SetRegistrar(input, run_alone, retrieval, options, i, seed, cancel));
    search.Begin();
    answer = search.best();
    if (!search.IsFound()) continue;
    try {
      search.FindSize();
      if (const auto why = search.WhyRefused()) {
        answer.status = AnswerStatus::kRejected;
        answer.reason = *why;
        continue;
      }
      SetRefinement set;
      set.reference = index;
      set.name = reference.name;
      search.Refine(mode, &set);
      answer = search.best();
      answer.rig_from_odom = set.rig.rig_from_world;
      answer.covariance = set.rig.covariance;
      reference.rig = set.rig.rig;
      if (set.rig.view_covariance.size() > 0) reference.errors.poses = set.rig.view_covariance;
      sets.push_back(std::move(set));
    } catch (const NumericError& e) {
      answer = search.as_stitched();  // what another size led to is not the stitched rig's
      progress.Log(LogLevel::kWarning, "the rig of " + reference.name + " is used as stitched: " + e.what());
    }
  }
  return sets;
}

}  // namespace trigpoint

#include "app/pipeline/set_localization.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/base/error.h"
#include "datasets/io/csv.h"
#include "datasets/io/photo_sets.h"

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

}  // namespace

std::vector<SetRefinement> RefineSets(const LocalizeJob& job, const RegistrationOptions& options,
                                      const std::string& mode, const Reconstruction& reconstruction,
                                      const Retrieval& retrieval, uint64_t seed, ProgressSink& progress,
                                      const CancelToken& cancel, std::vector<ReferenceViews>* references,
                                      std::vector<Registration>* registrations) {
  std::vector<SetRefinement> sets;
  if (mode == "fixed" || job.shapes.empty()) return sets;
  const std::vector<Eigen::Matrix3d> covariances = PointCovariances(reconstruction.problem);
  const Reconstruction run_alone = RunAlone(reconstruction);
  for (const auto& [index, shape] : job.shapes) {
    const auto i = static_cast<size_t>(index);
    cancel.ThrowIfCancelled();
    progress.Begin("rig of " + job.references[i].name, 0);
    const ViewRig stitched = (*references)[i].rig;
    SetRegistrar registrar(job.input, run_alone, retrieval, options, i, seed, cancel);
    Registration& answer = (*registrations)[i];
    Registration g = registrar.Register(stitched);  // the points have moved since
    std::vector<Registration> attempts = {g};
    double scale = 1;
    if (g.status != AnswerStatus::kLocalized) {
      for (const double factor : {0.5, 2.0, 0.25, 4.0}) {
        if (std::abs(std::log(factor)) > kLikelySize * shape.log_scale_sigma) continue;
        const Registration other = registrar.Register(Scaled(stitched, factor));
        attempts.push_back(other);
        if (other.status == AnswerStatus::kLocalized &&
            (g.status != AnswerStatus::kLocalized || other.support > g.support)) {
          g = other, scale = factor;
        }
      }
    }
    answer = g;
    if (g.status != AnswerStatus::kLocalized) continue;
    try {
      // The size first, and with it again which points are seen.
      for (int round = 0; round < 2; ++round) {
        const RefinedRig sized =
            RefineRig(MakeInput(reconstruction, covariances, g, shape, stitched, scale), RigFreedom::kScaled);
        scale = std::clamp(scale * sized.scale, 0.02, 30.0);
        const Registration again = registrar.Register(Scaled(stitched, scale));
        // A size that loses more points than chance explains (3 sigma of a count) has led to a wrong pose.
        if (again.status != AnswerStatus::kLocalized || again.support < g.support - 3 * std::sqrt(g.support)) break;
        g = again;
      }
      // A pose elsewhere that another size leads to is a second hypothesis like any other.
      const Eigen::Vector3d centre = g.rig_from_odom.TargetOriginInSource();
      for (const Registration& other : attempts) {
        const double apart = (other.rig_from_odom.TargetOriginInSource() - centre).norm();
        if (apart < 1 || other.agreeing <= options.rival_share * g.agreeing) continue;
        answer.status = AnswerStatus::kRejected;
        answer.reason = fmt::format("ambiguous: another pose, {:.1f} m away, explains {} matches against {}", apart,
                                    other.agreeing, g.agreeing);
      }
      if (answer.status == AnswerStatus::kRejected) continue;
      // At a wrong pose the photos fit best with a small rig, so a size that stitching excludes is refused.
      const double possible = std::exp(kPossibleSize * shape.log_scale_sigma);
      if (scale > possible || scale < 1 / possible) {
        answer.status = AnswerStatus::kRejected;
        answer.reason = fmt::format(
            "the distances between its photos would have to be {:.2g} times those found by stitching, expected {:.2g} "
            "to {:.2g} times (3 sigma)",
            scale, 1 / possible, possible);
        continue;
      }
      SetRefinement set;
      set.reference = index;
      set.name = job.references[i].name;
      const RefineRigInput input = MakeInput(reconstruction, covariances, g, shape, stitched, scale);
      set.freedom = mode == "scaled"  ? RigFreedom::kScaled
                    : mode == "prior" ? RigFreedom::kPrior
                    : mode == "free"  ? RigFreedom::kFree
                                      : ChooseFreedom(input, &set.hold_out);
      // "fixed" is chosen against the size just found, which is what it then stands for.
      if (set.freedom == RigFreedom::kFixed) set.freedom = RigFreedom::kScaled;
      set.rig = RefineRig(input, set.freedom);
      set.rig.scale *= scale;
      answer = g;
      answer.rig_from_odom = set.rig.rig_from_world;
      answer.covariance = set.rig.covariance;
      (*references)[i].rig = set.rig.rig;
      if (set.rig.view_covariance.size() > 0) (*references)[i].errors.poses = set.rig.view_covariance;
      sets.push_back(std::move(set));
    } catch (const NumericError& e) {
      answer = attempts.front();  // what another size led to is not the stitched rig's
      progress.Log(LogLevel::kWarning, "the rig of " + job.references[i].name + " is used as stitched: " + e.what());
    }
  }
  return sets;
}

void WriteRigs(const std::vector<SetRefinement>& sets, const Localization& result, const std::filesystem::path& dir) {
  if (sets.empty()) return;
  CsvWriter csv(
      {"panorama",   "photo",      "freedom",    "tx", "ty", "tz", "qx",       "qy",       "qz",       "qw",
       "sigma_tx_m", "sigma_ty_m", "sigma_tz_m", "x",  "y",  "z",  "world_qx", "world_qy", "world_qz", "world_qw"},
      {"trigpoint rigs 1; tx..qw: rig_from_cam, origin=mean of the photos' centres, metres by the run's points; "
       "x..world_qw: world_from_cam, site ENU, empty if not known or the set is rejected; sigma=1, relative to the "
       "origin"});
  for (const SetRefinement& set : sets) {
    const Registration& g = result.references[static_cast<size_t>(set.reference)].registration;
    for (const View& view : set.rig.rig.views) {
      csv.Text(set.name).Text(view.name).Text(RigFreedomName(set.freedom));
      const auto put = [&](const Rigid3d& pose) {
        for (int k = 0; k < 3; ++k) csv.Number(pose.translation(k), 6);
        csv.Number(pose.rotation.x(), 9)
            .Number(pose.rotation.y(), 9)
            .Number(pose.rotation.z(), 9)
            .Number(pose.rotation.w(), 9);
      };
      put(view.rig_from_view);
      for (int k = 3; k < 6; ++k) csv.Number(std::sqrt(std::max(0.0, view.covariance(k, k))), 5);
      if (result.on_earth && g.status == AnswerStatus::kLocalized) {
        put(result.geo.world_from_odom.TransformPose(g.rig_from_odom.Inverse() * view.rig_from_view));
      } else {
        csv.Empty(7);
      }
      csv.EndRow();
    }
  }
  csv.Save(dir / "rigs.csv");
}

std::map<std::string, std::filesystem::path> StitchedRigs(const Project& project) {
  std::map<std::string, std::filesystem::path> rigs;
  for (const std::filesystem::path& set : PhotoSetFolders(project.dir())) {
    const std::string name = set.filename().string();
    rigs[name] = project.ResultDir("stitch", name);
  }
  return rigs;
}

}  // namespace trigpoint

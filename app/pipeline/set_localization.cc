#include "app/pipeline/set_localization.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/base/error.h"
#include "datasets/io/csv.h"
#include "datasets/io/photo_sets.h"

namespace trigpoint {
namespace {

// The run's own observations and points, without the references that the joint solution added.
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

// One reference by itself, with another rig.
class SetRegistrar {
 public:
  SetRegistrar(const LocalizeJob& job, const Localization& result, const LocalizeOptions& options, size_t reference,
               uint64_t seed, const CancelToken& cancel)
      : reconstruction_(RunAlone(result.reconstruction)), options_(options), seed_(seed), cancel_(cancel) {
    input_ = job.input;
    input_.references = {job.input.references[reference]};
    const int index = static_cast<int>(reference);
    input_.view_features = [all = job.input.view_features, index](int, int view) { return all(index, view); };
    retrieval_.of_image.resize(result.retrieval.of_image.size());
    for (size_t i = 0; i < retrieval_.of_image.size(); ++i) {
      for (Retrieval::Hit hit : result.retrieval.of_image[i]) {
        if (hit.reference != index) continue;
        hit.reference = 0;
        retrieval_.of_image[i].push_back(hit);
      }
    }
  }
  Registration Register(const ViewRig& rig) {
    input_.references[0].rig = rig;
    ProgressSink silent;
    return RegisterReferences(input_, reconstruction_, retrieval_, options_.registration, false, 1, seed_, silent,
                              cancel_)
        .front();
  }

 private:
  Reconstruction reconstruction_;
  LocalizeOptions options_;
  uint64_t seed_;
  const CancelToken& cancel_;
  LocalizeInput input_;
  Retrieval retrieval_;
};

ViewRig Scaled(ViewRig rig, double factor) {
  for (View& v : rig.views) v.rig_from_view.translation *= factor;
  return rig;
}

RefineRigInput MakeInput(const Localization& result, const Registration& g, const StitchedShape& shape,
                         const ViewRig& rig, double scale) {
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
    in.points.push_back(
        {o.view, o.pixel.cast<double>(), result.reconstruction.problem.points[static_cast<size_t>(o.point)]});
  }
  return in;
}

}  // namespace

std::vector<SetRefinement> RefineSets(const LocalizeJob& job, const LocalizeOptions& options, const std::string& mode,
                                      int threads, uint64_t seed, ProgressSink& progress, const CancelToken& cancel,
                                      Localization* result) {
  static_cast<void>(threads);
  std::vector<SetRefinement> sets;
  if (mode == "fixed") return sets;
  for (size_t i = 0; i < job.references.size(); ++i) {
    const auto shape = job.shapes.find(static_cast<int>(i));
    if (shape == job.shapes.end()) continue;
    cancel.ThrowIfCancelled();
    progress.Begin("rig of " + job.references[i].name, 0);
    const ViewRig& stitched = job.input.references[i].rig;
    SetRegistrar registrar(job, *result, options, i, seed, cancel);
    Registration g = result->references[i].registration;
    double scale = 1;
    if (g.status != AnswerStatus::kLocalized) {
      for (const double factor : {0.5, 2.0, 0.05, 3.5}) {
        const Registration other = registrar.Register(Scaled(stitched, factor));
        if (other.status == AnswerStatus::kLocalized &&
            (g.status != AnswerStatus::kLocalized || other.support > g.support)) {
          g = other, scale = factor;
        }
      }
    }
    if (g.status != AnswerStatus::kLocalized) continue;
    try {
      // The size first, and with it again which points are seen.
      for (int round = 0; round < 2; ++round) {
        const RefinedRig sized = RefineRig(MakeInput(*result, g, shape->second, stitched, scale), RigFreedom::kScaled);
        scale = std::clamp(scale * sized.scale, 0.02, 30.0);
        const Registration again = registrar.Register(Scaled(stitched, scale));
        if (again.status != AnswerStatus::kLocalized) break;
        g = again;
      }
      SetRefinement set;
      set.reference = static_cast<int>(i);
      set.name = job.references[i].name;
      const RefineRigInput input = MakeInput(*result, g, shape->second, stitched, scale);
      set.freedom = mode == "scaled"  ? RigFreedom::kScaled
                    : mode == "prior" ? RigFreedom::kPrior
                    : mode == "free"  ? RigFreedom::kFree
                                      : ChooseFreedom(input, &set.hold_out);
      // "fixed" is chosen against the size just found, which is what it then stands for.
      if (set.freedom == RigFreedom::kFixed) set.freedom = RigFreedom::kScaled;
      set.rig = RefineRig(input, set.freedom);
      set.rig.scale *= scale;
      ReferenceAnswer& answer = result->references[i];
      answer.registration = g;
      answer.registration.rig_from_odom = set.rig.rig_from_world;
      answer.registration.covariance = set.rig.covariance;
      if (result->on_earth) {
        const Rigid3d odom_from_rig = set.rig.rig_from_world.Inverse();
        answer.world.world_from_x = result->geo.world_from_odom.TransformPose(odom_from_rig);
        size_t nearest = 0;
        double least = std::numeric_limits<double>::infinity();
        for (size_t k = 0; k < result->cameras.size(); ++k) {
          const double d = (result->cameras[k].world_from_x.translation - answer.world.world_from_x.translation).norm();
          if (d < least) least = d, nearest = k;
        }
        Matrix6d turn = Matrix6d::Zero();
        turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() =
            result->geo.world_from_odom.rotation.toRotationMatrix();
        answer.world.covariance =
            turn * InverseCovariance(set.rig.rig_from_world, set.rig.covariance) * turn.transpose();
        if (!result->cameras.empty()) {
          const PoseEstimate& camera = result->cameras[nearest];
          Matrix6d carried = Matrix6d::Identity();
          carried.bottomLeftCorner<3, 3>() =
              -Skew(answer.world.world_from_x.translation - camera.world_from_x.translation);
          answer.world.covariance += carried * camera.covariance * carried.transpose();
        }
      }
      sets.push_back(std::move(set));
    } catch (const NumericError& e) {
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
       "x..world_qw: world_from_cam, site ENU, empty if not known; sigma=1, relative to the origin"});
  for (const SetRefinement& set : sets) {
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
      if (result.on_earth) {
        put(result.geo.world_from_odom.TransformPose(set.rig.rig_from_world.Inverse() * view.rig_from_view));
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

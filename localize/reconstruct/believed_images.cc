#include "localize/reconstruct/believed_images.h"

#include <memory>

#include "calib/estimation/loss.h"

namespace trigpoint {
namespace {

std::shared_ptr<const ceres::LossFunction> LossTimes(const std::shared_ptr<const ceres::LossFunction>& loss,
                                                     double factor) {
  const auto* const known = dynamic_cast<const Chi2Loss*>(loss.get());
  if (known == nullptr) return loss;
  return MakeLoss(known->name(), factor * known->threshold());
}

}  // namespace

std::optional<BelievedImages> BelieveImages(const Reconstruction& r, int threads, const CancelToken& cancel) {
  const double narrower = WiderThanExplained(r);
  if (!(narrower > 1)) return std::nullopt;
  BelievedImages believed{r.problem};
  BundleProblem& p = believed.problem;
  for (BearingObservation& o : p.observations) o.w *= static_cast<float>(narrower);
  p.loss = LossTimes(p.loss, narrower * narrower);
  BundleOptions bundle;
  bundle.threads = threads;
  ProgressSink silent;
  believed.cost = SolveBundle(p, bundle, silent, cancel).final_cost;
  return believed;
}

}  // namespace trigpoint

// Views of a panorama that are turned against each other (docs/method.md section 4). A panorama is put together from
// pictures: mistakes of the stitching and, as their lenses stand apart, parallax turn these by some hundredths to
// tenths of a degree, from panorama to panorama differently. All points of a view are off alike then, and count for
// less than their number.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "calib/estimation/bundle.h"

namespace trigpoint {

// The views of a panorama, a rig, in a bundle problem.
struct RigViews {
  int pose = 0;
  int first_view = 0, views = 0;  // of BundleProblem::views
};

// 1 sigma of a view's turn about each axis, rad, by the marginal likelihood of the residuals of `p`, which is solved,
// with no pose_shifts: a variance component, one for all of the rigs, each of which is looked at with the others as
// they are. Nothing if chance explains the residuals in more than one case of twenty. Throws NumericError if the data
// do not determine `p`.
std::optional<double> FindViewTurns(const std::vector<RigViews>& rigs, const BundleProblem& p, int threads,
                                    const CancelToken& cancel);

// Whether the factor ties a view's own pose to that of its rig, and by which sigma of its turn, rad.
inline bool IsTie(const PoseFactor& f) { return f.kind == PoseFactor::Kind::kBetween && f.scale < 0 && f.b < f.a; }
inline double SigmaOfTie(const PoseFactor& f) { return 1 / f.sqrt_info(0, 0); }

// A view's own pose in a bundle problem: that of the rig as this view shows it.
struct TurnedView {
  int pose = 0;
  int factor = 0;  // that ties it to the rig's pose: index into BundleProblem::factors
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // of the view, rig axes
};

// The view of a rig that an observation belongs to, if it gets a pose of its own.
struct ViewToFree {
  int view = 0;          // of the rig, whatever it is called in the problem
  double sigma_rad = 0;  // of its turn
  Rigid3d turn;          // own_from_rig, where the solution begins
};

// Views that see a point get poses of their own at the end of `p`, turned against the rig's about the view's centre by
// unknowns of these sigmas. `of`: of each observation of `p`.
std::vector<TurnedView> FreeViews(const std::function<std::optional<ViewToFree>(size_t)>& of, BundleProblem* p);

// All views of these rigs.
std::vector<TurnedView> FreeViews(const std::vector<RigViews>& rigs, double sigma_rad, BundleProblem* p);

struct TurnsShown {
  double sigma_rad = 0;
  double unknowns = 0;  // that the data determine, of three a view: they take as many degrees of freedom
};

// The sigma by the turns that `p`, solved with these views, shows and what it leaves open of them
// (expectation-maximisation): the factors get it.
TurnsShown UpdateTurns(const std::vector<TurnedView>& views, int threads, const CancelToken& cancel, BundleProblem* p);

}  // namespace trigpoint

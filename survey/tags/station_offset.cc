#include "survey/tags/station_offset.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>

#include "calib/base/error.h"
#include "calib/estimation/loss.h"
#include "calib/estimation/sparse_least_squares.h"
#include "datasets/io/csv.h"
#include "survey/tags/map_start.h"
#include "survey/tags/planar_pose.h"
#include "survey/tags/survey_costs.h"

namespace trigpoint {
namespace {

constexpr double kStartPx = 20;      // a tag that the start contradicts by more is another one
constexpr double kHuberChi2 = 15.5;  // 95 % of chi-square with 8 degrees of freedom
constexpr double kGateChi2 = 31.8;   // 99.99 %
constexpr int kIterations = 50;

struct Sight {
  TagSight sight;
  const TagEstimate* tag = nullptr;
  Rigid3d view_from_pano;
  Eigen::Matrix3d centre = Eigen::Matrix3d::Zero();  // covariance, panorama's frame
  bool rejected = false;
};

// Of each tag of the map its picture nearest the middle of a view.
std::vector<Sight> ChooseSights(const std::vector<PanoramaTag>& seen, const std::vector<TagEstimate>& map,
                                const TagPosesOptions& options) {
  std::map<int, std::pair<double, Sight>> best;
  for (const PanoramaTag& s : seen) {
    const auto tag = std::find_if(map.begin(), map.end(), [&](const TagEstimate& t) {
      return t.tag_id == s.detection.id && t.HasPose() && (t.status == "ok" || t.status == "weak");
    });
    if (tag == map.end()) continue;
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& c : s.detection.corners) middle += 0.25 * c;
    if ((s.detection.corners[0] - s.detection.corners[2]).norm() < std::sqrt(2.0) * options.min_side_px) continue;
    const double off = (middle - 0.5 * Eigen::Vector2d(s.camera->width() - 1, s.camera->height() - 1)).norm();
    const auto it = best.find(tag->tag_id);
    if (it != best.end() && it->second.first <= off) continue;
    try {
      Sight sight;
      sight.sight = MakeTagSight(*s.camera, s.detection, options.extra_sigma_px);
      sight.tag = &*tag;
      sight.view_from_pano = s.pano_from_view.Inverse();
      sight.centre = s.centre_covariance;
      best[tag->tag_id] = {off, sight};
    } catch (const NumericError&) {  // a corner without a ray
    }
  }
  std::vector<Sight> sights;
  for (auto& [id, entry] : best) sights.push_back(std::move(entry.second));
  return sights;
}

double Pixels(const Sight& s, const Rigid3d& world_from_pano, const Rigid3d& world_from_tag) {
  return ResidualPx(s.sight, TagResidual(s.sight, s.tag->size_m, s.view_from_pano, world_from_pano, world_from_tag));
}

// The planar solution of one of them that most agree with.
std::optional<Rigid3d> Start(const std::vector<Sight>& sights) {
  std::optional<Rigid3d> best;
  double best_score = -1;
  for (const Sight& s : sights) {
    for (const PlanarPose& p : EstimatePlanarPoses(s.sight, s.tag->size_m)) {
      const Rigid3d pano = *s.tag->world_from_tag * p.cam_from_tag.Inverse() * s.view_from_pano;
      double score = 0;
      for (const Sight& t : sights) score += std::max(0.0, 1 - Pixels(t, pano, *t.tag->world_from_tag) / kStartPx);
      if (score > best_score) best_score = score, best = pano;
    }
  }
  return best;
}

Vector6d Sigmas(const Matrix6d& covariance) { return covariance.diagonal().cwiseMax(1e-14).cwiseSqrt(); }

// The panorama's pose by the sights that are not rejected, with tags that may move within their covariances.
class Adjustment {
 public:
  Adjustment(const Rigid3d& start, const std::vector<Sight>& sights) : panorama_(solver_.AddPose(start)) {
    const int shift = solver_.AddNumbers({0});
    solver_.unknowns.back().constant = true;
    for (const Sight& s : sights) {
      if (s.rejected) continue;
      solver_.AddFactor(new TagCost(s.sight, s.tag->size_m, s.view_from_pano, &believed_), &loss_,
                        {panorama_, UnknownOf(s.tag), shift});
      ++used_;
    }
  }

  void Solve(const TagEstimate& own) {
    own_ = UnknownOf(&own);
    ProgressSink silent;
    const CancelToken never;
    solver_.Solve(kIterations, 1, silent, never);
    solver_.Linearise(1, never, true);
  }

  int used() const { return used_; }
  Rigid3d Panorama() const { return solver_.Pose(panorama_); }
  Rigid3d Tag(const TagEstimate* tag) const { return solver_.Pose(tags_.at(tag)); }

  // The panorama's pose and how far it is from the own tag; `centre`: covariance of its views' centre.
  void SetOffset(const Eigen::Matrix3d& centre, StationOffset* out) const {
    const Rigid3d pano = Panorama();
    out->offset_m = pano.translation - solver_.Pose(own_).translation;
    out->world_from_pano = pano;
    out->sigma_rot_rad = std::sqrt(std::max(0.0, solver_.PoseCovariance(panorama_).topLeftCorner<3, 3>().trace() / 3));
    const int at = solver_.Offset(panorama_), of = solver_.Offset(own_);
    const Eigen::MatrixXd columns = solver_.CovarianceColumns(at + 3, 3);
    const Eigen::Matrix3d cross = columns.middleRows(of + 3, 3);
    out->covariance = columns.middleRows(at + 3, 3) - cross - cross.transpose() +
                      solver_.PoseCovariance(own_).bottomRightCorner<3, 3>();
    // Photos of a hand-held set share the error of their rig: it does not average out.
    const Eigen::Matrix3d turn = pano.rotation.toRotationMatrix();
    out->covariance += turn * centre * turn.transpose();
  }

 private:
  int UnknownOf(const TagEstimate* tag) {
    const auto [it, fresh] = tags_.try_emplace(tag, 0);
    if (fresh) {
      it->second = solver_.AddPose(*tag->world_from_tag);
      solver_.AddFactor(new PosePriorCost(*tag->world_from_tag, Sigmas(tag->covariance)), nullptr, {it->second});
    }
    return it->second;
  }

  const HuberChi2Loss loss_{kHuberChi2};
  const double believed_ = 1;  // corner factor: stated sigmas
  SparseLeastSquares solver_;
  int panorama_, own_ = -1, used_ = 0;
  std::map<const TagEstimate*, int> tags_;
};

// How well the sights agree; the one that contradicts the others most, nothing if none does.
Sight* Judge(const Adjustment& adjustment, std::vector<Sight>* sights, StationOffset* out) {
  double square = 0, worst = kGateChi2;
  Sight* bad = nullptr;
  for (Sight& s : *sights) {
    if (s.rejected) continue;
    const Vector8d r =
        TagResidual(s.sight, s.tag->size_m, s.view_from_pano, adjustment.Panorama(), adjustment.Tag(s.tag));
    square += std::pow(ResidualPx(s.sight, r), 2);
    if (adjustment.used() > 1 && r.squaredNorm() > worst) worst = r.squaredNorm(), bad = &s;
  }
  out->tags = adjustment.used();
  out->rejected = static_cast<int>(sights->size()) - adjustment.used();
  out->rms_px = std::sqrt(square / adjustment.used());
  return bad;
}

void SetStated(const Station& station, const Rigid3d& world_from_tag, StationOffset* out) {
  SurveyPoint point;
  point.offset_in_tag_frame = true;
  for (int k = 0; k < 3; ++k) {
    point.offset_m = Eigen::Vector3d::Unit(k);
    out->world_from_level.col(k) = OffsetInWorld(point, world_from_tag);
  }
  out->stated_m = out->combined_m = OffsetInWorld(station, world_from_tag);
  out->combined = station.sigma_m * station.sigma_m * Eigen::Matrix3d::Identity();
}

// `combined`: the stated offset's covariance before, of both after.
void CombineWithStated(StationOffset* out) {
  const Eigen::Matrix3d stated = out->combined;
  const Eigen::Vector3d off = *out->offset_m - out->stated_m;
  out->chi2 = off.dot((out->covariance + stated).ldlt().solve(off));
  if (out->Contradicts()) return;
  const Eigen::Matrix3d gain = stated * (out->covariance + stated).inverse();
  out->combined_m = out->stated_m + gain * off;
  out->combined = stated - gain * stated;
}

}  // namespace

StationOffset EstimateStationOffset(const Station& station, const std::string& panorama,
                                    const std::vector<PanoramaTag>& seen, const std::vector<TagEstimate>& map,
                                    const TagPosesOptions& options) {
  StationOffset out;
  out.station = station.name;
  out.panorama = panorama;
  out.tag_id = station.tag_id;
  out.stated_sigma_m = station.sigma_m;
  const auto own = std::find_if(map.begin(), map.end(),
                                [&](const TagEstimate& t) { return t.tag_id == station.tag_id && t.HasPose(); });
  if (own == map.end()) {
    out.reason = fmt::format("tag {} is not in the map", station.tag_id);
    return out;
  }
  SetStated(station, *own->world_from_tag, &out);
  std::vector<Sight> sights = ChooseSights(seen, map, options);
  const std::optional<Rigid3d> start = Start(sights);
  if (!start) {
    out.reason = "no tag of the map is seen in it";
    return out;
  }
  for (Sight& s : sights) s.rejected = Pixels(s, *start, *s.tag->world_from_tag) > kStartPx;
  Rigid3d pano = *start;
  while (true) {
    Adjustment adjustment(pano, sights);
    if (adjustment.used() == 0) {
      out.reason = "the tags seen in it contradict the map";
      return out;
    }
    adjustment.Solve(*own);
    pano = adjustment.Panorama();
    if (Sight* const bad = Judge(adjustment, &sights, &out)) {
      bad->rejected = true;
      continue;
    }
    Eigen::Matrix3d centre = Eigen::Matrix3d::Zero();
    for (const Sight& s : sights) {
      if (s.rejected) continue;
      out.own_tag |= s.tag == &*own;
      centre += s.centre / adjustment.used();
    }
    adjustment.SetOffset(centre, &out);
    CombineWithStated(&out);
    return out;
  }
}

void WriteStationOffsets(const std::filesystem::path& file, const std::vector<StationOffset>& offsets,
                         const std::string& frame) {
  std::vector<std::string> columns = {"station", "panorama", "tag_id", "status", "reason"};
  for (const char* what : {"stated", "estimated", "sigma", "combined", "combined_sigma"}) {
    for (const char* axis : {"east", "north", "up"}) columns.push_back(fmt::format("{}_{}_m", what, axis));
  }
  for (const char* c : {"right_m", "out_m", "up_m", "sigma_right_m", "sigma_out_m", "chi2", "tags", "own_tag",
                        "rejected", "rms_px", "qx", "qy", "qz", "qw", "sigma_rot_deg"}) {
    columns.emplace_back(c);
  }
  CsvWriter csv(columns, {"trigpoint stations 1; frame=" + frame +
                          "; sigma=1; centre minus the tag's centre; right_m, out_m, up_m: the estimate in the tag's "
                          "levelled frame; q: rotation of world_from_pano by the tags"});
  const auto vector = [&](const Eigen::Vector3d& v) {
    for (int k = 0; k < 3; ++k) csv.Number(v[k], 4);
  };
  const auto sigma = [](const Eigen::Matrix3d& c) { return Eigen::Vector3d(c.diagonal().cwiseMax(0).cwiseSqrt()); };
  for (const StationOffset& o : offsets) {
    csv.Text(o.station).Text(o.panorama).Integer(o.tag_id);
    csv.Text(!o.offset_m ? "unseen" : o.Contradicts() ? "contradicts" : "agrees").Text(o.reason);
    vector(o.stated_m);
    if (!o.offset_m) {
      for (size_t k = 8; k < columns.size(); ++k) csv.Text("");
      csv.EndRow();
      continue;
    }
    vector(*o.offset_m);
    vector(sigma(o.covariance));
    vector(o.combined_m);
    vector(sigma(o.combined));
    const Eigen::Matrix3d level = o.world_from_level.transpose();
    vector(level * *o.offset_m);
    const Eigen::Vector3d its = sigma(level * o.covariance * level.transpose());
    csv.Number(its[0], 4).Number(its[1], 4).Number(o.chi2, 2);
    csv.Integer(o.tags).Integer(o.own_tag ? 1 : 0).Integer(o.rejected).Number(o.rms_px, 3);
    const Eigen::Quaterniond& q = o.world_from_pano.rotation;
    csv.Number(q.x(), 9).Number(q.y(), 9).Number(q.z(), 9).Number(q.w(), 9).Number(o.sigma_rot_rad * kRadToDeg, 5);
    csv.EndRow();
  }
  csv.Save(file);
}

}  // namespace trigpoint

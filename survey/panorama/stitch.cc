#include "survey/panorama/stitch.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "calib/base/error.h"
#include "calib/base/median.h"
#include "calib/base/parallel.h"
#include "calib/estimation/random.h"
#include "calib/geo/geodetic.h"
#include "datasets/io/mask.h"
#include "survey/panorama/levelling.h"
#include "survey/panorama/patch_alignment.h"
#include "survey/panorama/photo_graph.h"
#include "survey/panorama/rig_report.h"

namespace trigpoint {
namespace {

// How far a pair may be off the others while the focal length is only guessed: 3 % of it opens a ring by 11 deg.
constexpr double kRingSlack = 14 * kDegToRad;
// A ring's focal length while distortion is found: held, 1 sigma, share of it.
constexpr double kRingSigma = 1e-5;
// A set is hardly a panorama if one point in twenty is displaced by more; an arm's length at 15 m leaves about one deg.
constexpr double kWideParallax = 3 * kDegToRad;
constexpr double kScaleAlike = 0.02;  // photos of one zoom differ by less, with parallax
constexpr double kZoomSigma = 0.15;   // 1 sigma of a photo's own focal length about the common one, share of it
constexpr double kSameZoom = 0.03;    // focal lengths that differ by less are alike
constexpr double kZoomGain = 0.5;     // part of the cost that lenses of their own may leave, to be believed
constexpr size_t kMostZooms = 4;      // more are no zooms, but something else
// Parallax of a scene, radius / distance (rad): a street, which it begins with; none to speak of; a narrow room.
constexpr double kFirstParallax = 0.01, kLeastParallax = 1e-4, kMostParallax = 0.05;
// Observations are not believed to be better than this: what the model leaves out moves them together.
constexpr double kLeastNoisePx = 0.1;
// 1 sigma of a detected feature, and of a point's position as predicted by the rig, px of the feature's scale.
constexpr double kDetectorSigma = 0.5, kForetoldSigma = 2;
constexpr double kAlignedShare = 0.4;    // of a photo's observations, else patches are no help there
constexpr double kDetectorWeight = 0.3;  // against a patch's: a third of a pixel, a tenth
// So far from a picture's edge, share of its half, a patch is expected to be seen.
constexpr double kForetoldDepth = 0.05;
constexpr int kMissed = 2;            // photos that should show a point seen twice, and do not
constexpr double kBeside = 0.04;      // of a picture's long side
constexpr double kStrongPull = 0.01;  // share of all that points say of where a photo stands
constexpr double kAsFar = 0.3;        // share that inverse distances of neighbours may differ by
constexpr double kTukey = 4.685;      // cut-off in sigmas: 95 % of least squares' efficiency with normal noise

// So few fisheyes are matched with all their features.
constexpr int kFewFisheyes = 20;
// Straight lenses are seldom shorter than this share of the picture's long side: 85 deg of view.
constexpr double kShortShare = 0.55;
// A fisheye without a circle must explain this much more than a straight lens does.
constexpr double kFisheyeGain = 1.3;

int LongSide(const PairView& v) { return std::max(v.width, v.height); }

std::string Degrees(double rad) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f deg", rad * kRadToDeg);
  return text;
}

// Work in progress: the steps fill it one after the other.
class Stitcher {
 public:
  Stitcher(const PhotoSet& set, const StitchOptions& options, int threads, uint64_t seed, ProgressSink& progress,
           const CancelToken& cancel)
      : o_(options), threads_(threads), seed_(seed), progress_(progress), cancel_(cancel) {
    out_.photos = set.photos;
    out_.left_out = set.left_out;
    pair_options_.ratio = options.ratio;
    pair_options_.all_pairs_up_to = options.all_pairs_up_to;
    pair_options_.seed = seed;
  }

  void FindFeatures(const std::function<cv::Mat(const Photo&)>& load_grey) {
    std::vector<PhotoFeatures> features(out_.photos.size());
    std::vector<std::string> problem(out_.photos.size());
    std::vector<std::optional<ImageCircle>> circles(out_.photos.size());
    std::vector<PatchImage> patches(out_.photos.size());
    std::vector<cv::Mat> masks(out_.photos.size());
    progress_.Begin("features", static_cast<int64_t>(out_.photos.size()));
    ParallelFor(static_cast<int64_t>(out_.photos.size()), threads_, cancel_, [&](int64_t i) {
      const size_t k = static_cast<size_t>(i);
      try {
        const cv::Mat grey = load_grey(out_.photos[k]);
        if (o_.lens != "rectilinear") circles[k] = FindImageCircle(grey);
        const ShrunkPicture small(grey, o_.feature_size_px);
        masks[k] = SetPhotoMask(out_.photos[k].file, grey.size());
        features[k] = FindPhotoFeatures(small, o_.max_features, circles[k], masks[k]);
        patches[k] = PatchImage(small);
      } catch (const InputError& e) {
        problem[k] = e.what();
      }
      progress_.Advance(1);
    });
    // A copy adds no information and would be blended with its original.
    for (size_t b = 0; b < features.size(); ++b) {
      for (size_t a = 0; a < b && problem[b].empty(); ++a) {
        if (!problem[a].empty() || out_.photos[a].width != out_.photos[b].width ||
            out_.photos[a].height != out_.photos[b].height)
          continue;
        if (std::abs(features[a].size() - features[b].size()) > 0.02 * features[a].size()) continue;
        if (ShareOfEqualFeatures(features[a], features[b]) > 0.9) problem[b] = "is a copy of " + out_.photos[a].name;
      }
    }
    std::vector<Photo> photos;
    std::vector<PairView> views;  // of the photos that are kept, without their features
    for (size_t i = 0; i < features.size(); ++i) {
      if (problem[i].empty()) {
        photos.push_back(out_.photos[i]);
        out_.features.push_back(std::move(features[i]));
        patches_.push_back(std::move(patches[i]));
        views.push_back({photos.back().width, photos.back().height, nullptr, circles[i], masks[i],
                         photos.back().metadata.orientation});
      } else {
        out_.left_out.push_back({out_.photos[i].name, problem[i]});
      }
    }
    out_.photos = std::move(photos);
    RequireTwo("a panorama needs at least two photos that can be used");
    out_.views = std::move(views);
    for (size_t i = 0; i < out_.photos.size(); ++i) out_.views[i].features = &out_.features[i];
    out_.reason.resize(out_.photos.size());
    out_.state.photos.resize(out_.photos.size());
  }

  // Photos of one size and one EXIF focal length share a lens; a fisheye's circle tells it from others.
  void MakeLenses() {
    std::map<std::tuple<int, int, int, bool>, int> lens_of;
    for (size_t i = 0; i < out_.photos.size(); ++i) {
      const Photo& p = out_.photos[i];
      const int bucket = p.focal_px ? static_cast<int>(std::lround(std::log(*p.focal_px) / 0.01)) : -1;
      const bool fisheye = o_.lens == "fisheye" || out_.views[i].circle;
      const auto key = std::make_tuple(std::max(p.width, p.height), std::min(p.width, p.height), bucket, fisheye);
      const auto [it, fresh] = lens_of.try_emplace(key, static_cast<int>(out_.state.lenses.size()));
      if (fresh) {
        out_.state.lenses.push_back(StartLens(p.focal_px.value_or(0), fisheye));
        out_.state.lens_priors.push_back({p.focal_px.value_or(0), o_.focal_sigma});
      }
      out_.state.photos[i].lens = it->second;
    }
    // Fisheyes back to back share a narrow rim, and the strongest features lie elsewhere.
    if (Fisheye() && Count() <= kFewFisheyes) pair_options_.coarse_features = o_.max_features;
  }

  void Pair() {
    const std::vector<std::pair<int, int>> candidates = CandidatePairs(out_.views, pair_options_, threads_, cancel_);
    out_.pairs_tried = static_cast<int>(candidates.size());
    tried_ = MatchPairs(out_.views, candidates, pair_options_, threads_, progress_, cancel_);
    const RigState begun = out_.state;
    FindFocal();
    if (o_.lens == "auto" && !Fisheye() && CouldBeFisheye(begun)) {
      const double score = TotalScore();
      const RigState straight = std::move(out_.state);
      const std::vector<PhotoPair> accepted = accepted_;
      const std::vector<std::string> warnings = out_.warnings;
      const bool from_exif = out_.focal_from_exif;
      out_.state = begun;
      for (Lens& lens : out_.state.lenses) lens = StartLens(lens.focal_px, true);
      FindFocal();
      if (TotalScore() < kFisheyeGain * score) {
        out_.state = straight, accepted_ = accepted, out_.warnings = warnings, out_.focal_from_exif = from_exif;
      }
    }
    CloseRing();
    out_.focal_start_px = out_.state.lenses.front().focal_px;
  }

  bool Fisheye() const {
    return std::any_of(out_.state.lenses.begin(), out_.state.lenses.end(), [](const Lens& l) { return l.fisheye; });
  }

  // No focal length is known, or one so short that a straight lens would be a rare one.
  bool CouldBeFisheye(const RigState& begun) const {
    for (size_t i = 0; i < begun.photos.size(); ++i) {
      const double focal = begun.lenses[static_cast<size_t>(begun.photos[i].lens)].focal_px;
      if (focal < kShortShare * LongSide(out_.views[i])) return true;
    }
    return false;
  }

  // Focal lengths of lenses that have none, or a wrong one, by what turns of the camera explain; verifies the pairs.
  void FindFocal() {
    const bool any_missing =
        std::any_of(out_.state.lenses.begin(), out_.state.lenses.end(), [](const Lens& l) { return l.focal_px <= 0; });
    out_.focal_from_exif = !any_missing;
    if (any_missing) FindMissingFocal();
    Verify();
    if (!any_missing) DoubtExif();
  }

  // A ring that closes fixes the focal length, which its pairs one by one leave open: they are laid end to end and the
  // focal length is changed until they make one turn.
  void CloseRing() {
    const std::vector<Lens> begun = out_.state.lenses;
    const std::vector<PhotoPair> accepted = accepted_;
    const double score = TotalScore();
    for (int round = 0; round < 6; ++round) {
      const RingClosure ring = FindClosure(Count(), accepted_);
      if (!ring.closed) break;
      ring_closed_ = true;
      // Parallax opens a ring by a degree or two: no reason to doubt what EXIF says.
      if (std::abs(ring.turns - 1) < (out_.focal_from_exif ? 0.015 : 0.001)) return;
      for (Lens& lens : out_.state.lenses) lens.focal_px *= ring.turns;
      Verify();
    }
    if (ring_closed_ && TotalScore() > 0.6 * score) return;
    ring_closed_ = false;
    out_.state.lenses = begun, accepted_ = accepted;
  }

  void Orient() {
    // Parallax leaves a gap in a ring even with the right focal length, and averaging puts it where it costs least.
    const double limit = !out_.focal_from_exif ? kRingSlack : (ring_closed_ ? 8 : 3) * kDegToRad;
    PhotoGraph graph = BuildPhotoGraph(Count(), accepted_, limit);
    if (std::none_of(graph.placed.begin(), graph.placed.end(), [](bool p) { return p; })) {
      throw InputError(
          "no two of the " + std::to_string(Count()) +
          " photos overlap in a way that a turn of the camera explains; neighbours should share a third of "
          "their picture, be sharp, and be taken from one place");
    }
    for (int i = 0; i < Count(); ++i) {
      RigPhoto& p = out_.state.photos[static_cast<size_t>(i)];
      p.placed = graph.placed[static_cast<size_t>(i)];
      p.cam_from_rig = graph.cam_from_rig[static_cast<size_t>(i)];
    }
    for (const PhotoPair& p : graph.contradicting) {
      out_.warnings.push_back("the match of " + Name(p.a) + " with " + Name(p.b) +
                              " contradicts the others and is dropped (repeated texture?)");
    }
    out_.pairs = std::move(graph.pairs);
    SolveCentral({200, 40, 10, 5}, out_.pairs);
    RecheckPairs();
    Rescue();
    TellZooms();
    const auto apart = [&](const PhotoPair& p) {
      return !out_.state.photos[static_cast<size_t>(p.a)].placed && !out_.state.photos[static_cast<size_t>(p.b)].placed;
    };
    if (std::any_of(accepted_.begin(), accepted_.end(), apart)) {
      out_.warnings.emplace_back("the photos fall into parts that do not overlap; only the largest is stitched");
    }
  }

  // With the focal length adjusted, what still contradicts does so for good.
  void RecheckPairs() {
    std::vector<PhotoPair> kept;
    for (PhotoPair& p : out_.pairs) {
      const Eigen::Quaterniond said = out_.state.photos[static_cast<size_t>(p.b)].cam_from_rig *
                                      out_.state.photos[static_cast<size_t>(p.a)].cam_from_rig.conjugate();
      // By the lens as it is known now: distortion turns pairs that meet at their edges by degrees.
      const PairRotation own = FindRotation(out_.views, p, LensOf(p.a), LensOf(p.b), Threshold(p.b), 500, seed_);
      if (own.accepted) p.b_from_a = own.b_from_a;
      if (said.angularDistance(p.b_from_a) < 6 * kDegToRad) {
        kept.push_back(std::move(p));
      } else {
        out_.warnings.push_back("the match of " + Name(p.a) + " with " + Name(p.b) +
                                " contradicts the others and is dropped (repeated texture?)");
      }
    }
    if (kept.size() == out_.pairs.size() || kept.empty()) {
      out_.pairs = std::move(kept);
      return;
    }
    out_.pairs = std::move(kept);
    SolveCentral({10, 5}, out_.pairs);
  }

  // Photos that no pair accepted may have been taken at another zoom: each tries focal lengths of its own against those
  // that are placed.
  void Rescue() {
    bool again = true;
    while (again) {
      again = false;
      for (int i = 0; i < Count(); ++i) {
        RigPhoto& photo = out_.state.photos[static_cast<size_t>(i)];
        if (photo.placed) continue;
        PhotoPair best_pair;
        double best_focal = 0;
        const double guess = LensOf(i).focal_px;
        for (const PhotoPair& tried : tried_) {
          if (tried.a != i && tried.b != i) continue;
          const int other = tried.a == i ? tried.b : tried.a;
          if (!out_.state.photos[static_cast<size_t>(other)].placed || tried.matches.size() < 15) continue;
          for (double factor = 0.4; factor < 3; factor *= 1.04) {
            const Lens own = StartLens(guess * factor, LensOf(i).fisheye);
            const PairRotation r = FindRotation(out_.views, tried, tried.a == i ? own : LensOf(other),
                                                tried.a == i ? LensOf(other) : own, Threshold(tried.b), 200, seed_);
            if (!r.accepted || r.score <= best_pair.score || r.inliers.size() < 20) continue;
            best_pair = Accepted(tried, r);
            best_focal = own.focal_px;
          }
        }
        if (best_pair.score <= 0) continue;
        const bool is_a = best_pair.a == i;
        const RigPhoto& other = out_.state.photos[static_cast<size_t>(is_a ? best_pair.b : best_pair.a)];
        photo.cam_from_rig = (is_a ? best_pair.b_from_a.conjugate() : best_pair.b_from_a) * other.cam_from_rig;
        photo.placed = true;
        if (std::abs(best_focal / guess - 1) > 0.06) {
          photo.lens = static_cast<int>(out_.state.lenses.size());
          out_.state.lenses.push_back(StartLens(best_focal, LensOf(i).fisheye));
          out_.state.lens_priors.push_back({0, o_.focal_sigma});
          out_.warnings.push_back(Name(i) + " was taken at another zoom: it gets a focal length of its own");
        }
        out_.pairs.push_back(best_pair);
        again = true;
      }
      if (again) SolveCentral({30, 8}, out_.pairs);
    }
  }

  // The largest change of scale between two photos that a turn leaves.
  double LargestScale() const {
    double largest = 0;
    for (const PhotoPair& pair : out_.pairs) {
      const size_t a = static_cast<size_t>(pair.a), b = static_cast<size_t>(pair.b);
      const Eigen::Quaterniond b_from_a =
          out_.state.photos[b].cam_from_rig * out_.state.photos[a].cam_from_rig.conjugate();
      std::vector<Eigen::Vector2d> predicted, found;
      Eigen::Vector2d middle = Eigen::Vector2d::Zero(), shift = Eigen::Vector2d::Zero();
      for (const auto& [i, j] : pair.matches) {
        Eigen::Vector2d at;
        const Eigen::Vector2d p = out_.features[a].points[static_cast<size_t>(i)].cast<double>();
        if (!PixelOfRay(out_.views[b], LensOf(pair.b), b_from_a * RayOfPixel(out_.views[a], LensOf(pair.a), p), &at))
          continue;
        predicted.push_back(at);
        found.push_back(out_.features[b].points[static_cast<size_t>(j)].cast<double>());
        middle += at, shift += found.back();
      }
      if (predicted.size() < 20) continue;
      const double n = static_cast<double>(predicted.size());
      double along = 0, square = 0;
      for (size_t k = 0; k < predicted.size(); ++k) {
        const Eigen::Vector2d p = predicted[k] - middle / n;
        along += p.dot(found[k] - shift / n);
        square += p.squaredNorm();
      }
      largest = std::max(largest, std::abs(along / square - 1));
    }
    return largest;
  }

  // Photos whose zoom changed only a little still fit each other, badly: one lens for all leaves residuals that lenses
  // of their own do not. Those alike then share one.
  void TellZooms() {
    RigState& s = out_.state;
    if (Fisheye() || out_.pairs.empty() || LargestScale() < kScaleAlike) return;
    const RigState shared = s;
    const double one = SolveCentral({5}, out_.pairs);
    std::vector<int> order;
    for (int i = 0; i < Count(); ++i) {
      RigPhoto& p = s.photos[static_cast<size_t>(i)];
      if (!p.placed) continue;
      const double focal = LensOf(i).focal_px;
      s.lenses.push_back(LensOf(i));
      s.lens_priors.push_back({focal, kZoomSigma});
      p.lens = static_cast<int>(s.lenses.size()) - 1;
      order.push_back(i);
    }
    const double own = SolveCentral({20, 5}, out_.pairs, false);
    std::sort(order.begin(), order.end(), [&](int a, int b) { return LensOf(a).focal_px < LensOf(b).focal_px; });
    std::vector<std::vector<int>> zooms;
    double last = 0;
    for (int i : order) {
      if (zooms.empty() || LensOf(i).focal_px > (1 + kSameZoom) * last) zooms.emplace_back();
      zooms.back().push_back(i);
      last = LensOf(i).focal_px;
    }
    if (own > kZoomGain * one || zooms.size() < 2 || zooms.size() > kMostZooms) {
      s = shared;
      return;
    }
    // That of most comes first; what EXIF says is true of it.
    std::iter_swap(zooms.begin(), std::max_element(zooms.begin(), zooms.end(),
                                                   [](const auto& a, const auto& b) { return a.size() < b.size(); }));
    std::vector<Lens> lenses;
    std::vector<LensPrior> priors;
    for (const std::vector<int>& zoom : zooms) {
      const int first = zoom.front();
      lenses.push_back(LensOf(first));
      priors.push_back(shared.lens_priors[static_cast<size_t>(shared.photos[static_cast<size_t>(first)].lens)]);
      if (lenses.size() > 1) priors.back().focal_px = 0;
    }
    for (RigPhoto& p : s.photos) p.lens = 0;  // photos that are not placed: not known
    for (size_t z = 0; z < zooms.size(); ++z) {
      for (int i : zooms[z]) s.photos[static_cast<size_t>(i)].lens = static_cast<int>(z);
    }
    s.lenses = std::move(lenses);
    s.lens_priors = std::move(priors);
    if (SolveCentral({5}, out_.pairs, false) > kZoomGain * one) {
      s = shared;
      return;
    }
    for (int i = 0; i < Count(); ++i) {
      // Those of lenses of their own are named already.
      if (s.photos[static_cast<size_t>(i)].lens == 0 || shared.photos[static_cast<size_t>(i)].lens != 0) continue;
      other_zoom_.push_back(i);
    }
  }

  // With the rotations known every overlap is searched for more matches, near where a turn of the camera predicts them.
  void MatchGuided() {
    std::vector<std::pair<int, int>> overlaps;
    for (int a = 0; a < Count(); ++a) {
      for (int b = a + 1; b < Count(); ++b) {
        if (!out_.state.photos[static_cast<size_t>(a)].placed || !out_.state.photos[static_cast<size_t>(b)].placed)
          continue;
        const double reach = HalfView(out_.views[static_cast<size_t>(a)], LensOf(a)) +
                             HalfView(out_.views[static_cast<size_t>(b)], LensOf(b));
        // Straight photos that meet corner to corner share nothing; fisheyes back to back share their whole rim.
        if (AngleBetween(Look(a), Look(b)) < (LensOf(a).fisheye ? 1.0 : 0.9) * reach) overlaps.emplace_back(a, b);
      }
    }
    std::vector<PhotoPair> pairs(overlaps.size());
    progress_.Begin("match overlaps", static_cast<int64_t>(overlaps.size()));
    ParallelFor(static_cast<int64_t>(overlaps.size()), threads_, cancel_, [&](int64_t k) {
      PhotoPair& pair = pairs[static_cast<size_t>(k)];
      std::tie(pair.a, pair.b) = overlaps[static_cast<size_t>(k)];
      const size_t a = static_cast<size_t>(pair.a), b = static_cast<size_t>(pair.b);
      pair.b_from_a = out_.state.photos[b].cam_from_rig * out_.state.photos[a].cam_from_rig.conjugate();
      const Lens &la = LensOf(pair.a), &lb = LensOf(pair.b);
      const auto predict = [&](const Eigen::Vector2f& p, Eigen::Vector2d* at) {
        return PixelOfRay(out_.views[b], lb, pair.b_from_a * RayOfPixel(out_.views[a], la, p.cast<double>()), at);
      };
      pair.matches = MatchPredicted(*out_.views[a].features, *out_.views[b].features, predict,
                                    o_.guided_share * LongSide(out_.views[b]), o_.ratio, lb.focal_px / la.focal_px);
      pair.candidates = static_cast<int>(pair.matches.size());
      progress_.Advance(1);
    });
    std::erase_if(pairs, [](const PhotoPair& p) { return p.matches.size() < 10; });
    out_.pairs = std::move(pairs);
  }

  // Matches that agree with their neighbours: parallax varies smoothly over most of a picture, a wrong match sticks
  // out.
  void DropLonelyMatches() {
    for (PhotoPair& pair : out_.pairs) {
      const size_t n = pair.matches.size();
      std::vector<Eigen::Vector2d> at(n), shift(n);
      const size_t a = static_cast<size_t>(pair.a), b = static_cast<size_t>(pair.b);
      const Eigen::Quaterniond b_from_a =
          out_.state.photos[b].cam_from_rig * out_.state.photos[a].cam_from_rig.conjugate();
      for (size_t k = 0; k < n; ++k) {
        const auto [i, j] = pair.matches[k];
        at[k] = out_.features[a].points[static_cast<size_t>(i)].cast<double>();
        Eigen::Vector2d predicted;
        if (!PixelOfRay(out_.views[b], LensOf(pair.b), b_from_a * RayOfPixel(out_.views[a], LensOf(pair.a), at[k]),
                        &predicted))
          predicted.setConstant(1e9);
        shift[k] = out_.features[b].points[static_cast<size_t>(j)].cast<double>() - predicted;
      }
      const double reach = 0.12 * LongSide(out_.views[a]), close = 0.0035 * LongSide(out_.views[b]);
      PhotoMatches kept;
      for (size_t k = 0; k < n; ++k) {
        int near = 0, agree = 0;
        for (size_t l = 0; l < n; ++l) {
          if (l == k || (at[l] - at[k]).squaredNorm() > reach * reach) continue;
          ++near;
          agree += (shift[l] - shift[k]).norm() < close ? 1 : 0;
        }
        // A match without neighbours must be where a turn alone predicts it.
        if (near >= 3 ? agree >= 2 && agree >= 0.15 * near : shift[k].norm() < close) kept.push_back(pair.matches[k]);
      }
      pair.matches = std::move(kept);
    }
    std::erase_if(out_.pairs, [](const PhotoPair& p) { return p.matches.size() < 8; });
  }

  // A share of the matches is kept apart: whole tracks, so that nothing of them is used.
  std::vector<RigPoint> SplitHoldOut(std::vector<RigPoint> points) {
    if (o_.hold_out <= 0) return points;
    Random random(seed_ + 99);
    std::vector<RigPoint> used;
    for (RigPoint& p : points) {
      if (random.Uniform() >= o_.hold_out) {
        used.push_back(std::move(p));
        continue;
      }
      for (size_t k = 1; k < p.observations.size(); ++k) {
        const RigObservation &a = p.observations[k - 1], &b = p.observations[k];
        out_.held_out.push_back({a.photo, b.photo, a.pixel, b.pixel});
      }
    }
    return used;
  }

  void RequireSupport() {
    std::vector<int> seen(out_.photos.size(), 0);
    for (const RigPoint& p : out_.state.points) {
      for (const RigObservation& o : p.observations) ++seen[static_cast<size_t>(o.photo)];
    }
    for (size_t i = 0; i < seen.size(); ++i) {
      if (out_.state.photos[i].placed && seen[i] < 8) out_.state.photos[i].placed = false;
    }
    for (RigPoint& p : out_.state.points) {
      std::erase_if(p.observations,
                    [&](const RigObservation& o) { return !out_.state.photos[static_cast<size_t>(o.photo)].placed; });
    }
    std::erase_if(out_.state.points, [](const RigPoint& p) { return p.observations.size() < 2; });
  }

  void SolveRigOfSet() {
    RigState& s = out_.state;
    s.points = SplitHoldOut(BuildRigPoints(out_.views, s, out_.pairs));
    RequireSupport();
    RigBundleOptions b = BundleOptionsOfSet();
    b.huber_px = 4;
    progress_.Begin("rotations", 0);
    b.max_iterations = 20;
    const std::vector<LensPrior> priors = HoldRing();
    RigBundleResult central = SolveRig(out_.views, b, false, cancel_, &s);
    s.lens_priors = priors;
    out_.parallax.rms_central_px = central.rms_px;
    DropOutliers(o_.guided_share * 1600);
    progress_.Begin("rig", 0);
    b.centres = true;
    s.radius_m = o_.radius_m;
    b.max_iterations = 30;
    for (int round = 0; round < 4; ++round) {
      // Repeated structure gives many wrong matches with small errors: once the photos are nearly aligned, a kernel
      // that gives them no weight replaces Huber's.
      b.huber_px = round == 0 ? 4.0 : 0;
      if (round == 1) AlignPatches();
      if (round > 0) b.tukey_px = kTukey * NoisePx();
      b.up = UpFromPhotos(s);
      if (s.photos.empty()) break;
      if (round == 0) StartOnCircle(b.up);
      b.parallax = parallax_;
      SolveRig(out_.views, b, false, cancel_, &s);
      DropOutliers(round == 0 ? 10.0 : (round == 3 ? 1 : 2) * b.tukey_px);  // what may still come back stays
      if (round > 0) DropLonelyPoints(b.tukey_px / kTukey);
      MeasureParallax();
    }
    RequireSupport();
  }

  // Moves each observation to where the patch around it matches best, and weighs it by the covariance of that match.
  // Photos with too few such matches (too blurred, too noisy) keep the detector's positions.
  void AlignPatches() {
    std::vector<RigPoint>& points = out_.state.points;
    std::vector<RigPoint> aligned = points;
    progress_.Begin("align", static_cast<int64_t>(aligned.size()));
    ParallelFor(static_cast<int64_t>(aligned.size()), threads_, cancel_, [&](int64_t j) {
      AlignPoint(&aligned[static_cast<size_t>(j)]);
      progress_.Advance(1);
    });
    patches_.clear();
    std::vector<int> before(out_.photos.size(), 0), after(out_.photos.size(), 0);
    std::vector<double> sizes;
    for (size_t j = 0; j < points.size(); ++j) {
      for (const RigObservation& o : points[j].observations) ++before[static_cast<size_t>(o.photo)];
      if (aligned[j].observations.size() < 2) continue;
      for (const RigObservation& o : aligned[j].observations) {
        ++after[static_cast<size_t>(o.photo)];
        sizes.push_back(std::sqrt(std::abs(o.weight.determinant())));
      }
    }
    if (sizes.empty()) return;
    const double typical = Median(sizes);
    for (size_t j = 0; j < points.size(); ++j) {
      const bool helped = std::all_of(points[j].observations.begin(), points[j].observations.end(), [&](const auto& o) {
        const size_t i = static_cast<size_t>(o.photo);
        return after[i] >= kAlignedShare * before[i];
      });
      if (helped) points[j].observations = std::move(aligned[j].observations);
      // The typical one counts as it did, a detector's place for less.
      for (RigObservation& o : points[j].observations) o.weight *= helped ? 1 / typical : kDetectorWeight;
    }
    std::erase_if(points, [](const RigPoint& p) { return p.observations.size() < 2; });
  }

  // Keeps the observations whose patch looks like that of the one nearest to its picture's middle; their weights are
  // the inverse roots of the patches' covariances.
  void AlignPoint(RigPoint* point) const {
    const auto depth = [&](const RigObservation& o) { return out_.views[static_cast<size_t>(o.photo)].Depth(o.pixel); };
    const RigObservation from = *std::max_element(point->observations.begin(), point->observations.end(),
                                                  [&](const auto& a, const auto& b) { return depth(a) < depth(b); });
    const size_t a = static_cast<size_t>(from.photo);
    const double scale = out_.features[a].scales[static_cast<size_t>(from.feature)];
    std::vector<RigObservation> kept;
    Eigen::Matrix2d own = Eigen::Matrix2d::Zero();  // covariance, in the first photo
    int foretold = 0;                               // photos that should show it, though no detector said so
    std::vector<const RigObservation*> detected(out_.photos.size(), nullptr);
    for (const RigObservation& o : point->observations) detected[static_cast<size_t>(o.photo)] = &o;
    for (int photo = 0; photo < Count(); ++photo) {
      const size_t b = static_cast<size_t>(photo);
      if (photo == from.photo || !out_.state.photos[b].placed) continue;
      RigObservation o{photo, -1, {}};
      if (detected[b] != nullptr) {
        o = *detected[b];
      } else if (!ProjectRigPoint(out_.views, out_.state, *point, photo, &o.pixel) ||
                 out_.views[b].Depth(o.pixel) < kForetoldDepth) {
        continue;
      } else {
        ++foretold;
      }
      const Eigen::Quaterniond turn = out_.state.photos[b].cam_from_rig * out_.state.photos[a].cam_from_rig.conjugate();
      Eigen::Vector2d at, right, below;
      const auto seen = [&](const Eigen::Vector2d& pixel, Eigen::Vector2d* in_b) {
        return PixelOfRay(out_.views[b], LensOf(o.photo), turn * RayOfPixel(out_.views[a], LensOf(from.photo), pixel),
                          in_b);
      };
      if (!seen(from.pixel, &at) || !seen(from.pixel + Eigen::Vector2d(1, 0), &right) ||
          !seen(from.pixel + Eigen::Vector2d(0, 1), &below))
        continue;
      Eigen::Matrix2d b_from_a;
      b_from_a << right - at, below - at;
      const auto found = AlignPatch(patches_[a], from.pixel, patches_[b], o.pixel, b_from_a, scale,
                                    detected[b] != nullptr ? kDetectorSigma : kForetoldSigma);
      if (!found) continue;
      const Eigen::Matrix2d back = b_from_a.inverse();
      own += back * found->covariance * back.transpose();
      // Both patches have noise: each bears half.
      kept.push_back({o.photo, o.feature, found->pixel, WeightOf(0.5 * found->covariance)});
    }
    if (!kept.empty()) {
      kept.push_back({from.photo, from.feature, from.pixel, WeightOf(0.5 * own / static_cast<double>(kept.size()))});
    }
    // Two photos alone agree on anything along their line; where others should see the same, one of them must.
    if (kept.size() == 2 && foretold >= kMissed) kept.clear();
    point->observations = std::move(kept);
  }

  // W with W^T W the inverse.
  static Eigen::Matrix2d WeightOf(const Eigen::Matrix2d& covariance) {
    return covariance.llt().matrixL().solve(Eigen::Matrix2d::Identity());
  }

  // The scene's own spread of parallax becomes its prior: without any, distances die out instead of fitting the noise.
  // Not in an open sweep, where a longer lens and a nearer scene look alike: there both stay as free as they are.
  void MeasureParallax() {
    std::vector<double> angles;
    for (const RigPoint& p : out_.state.points) angles.push_back(std::abs(p.inverse_distance) * out_.state.radius_m);
    if (angles.empty() || !ring_closed_) return;
    parallax_ = std::clamp(1.4826 * Median(std::move(angles)), kLeastParallax, kMostParallax);
  }

  void Finish(const std::function<cv::Mat(const Photo&)>& load_grey) {
    RigState& s = out_.state;
    int placed = 0;
    for (const RigPhoto& p : s.photos) placed += p.placed ? 1 : 0;
    if (placed < 2)
      throw InputError("only " + std::to_string(placed) + " photo is left after the adjustment; two are needed");
    out_.placed = placed;
    LevelRig(load_grey, o_.level, threads_, cancel_, &out_);
    RigBundleOptions b = BundleOptionsOfSet();
    b.centres = true;
    b.huber_px = 0;
    b.up = -Eigen::Vector3d::UnitY();
    b.sigma_px = NoisePx();
    b.tukey_px = kTukey * b.sigma_px;
    b.parallax = parallax_;
    b.max_iterations = 20;
    out_.bundle = SolveRig(out_.views, b, true, cancel_, &s);
    out_.parallax.rms_rig_px = out_.bundle.rms_px;
    CentreRig(&out_);
    DescribeParallax(&out_);
    const double wide_rad = out_.parallax.p95_px / s.lenses.front().focal_px;
    if (wide_rad > kWideParallax) {
      out_.warnings.push_back(fmt::format(
          "the photos were hardly taken from one place: with one centre for all, 5 % of the points are off by "
          "{:.0f} px ({:.1f} deg) or more, and near things will be seen twice. Frames of a camera that "
          "moves along are a run (runs/NAME/images), not a panorama",
          out_.parallax.p95_px, wide_rad * kRadToDeg));
    }
    for (int i : other_zoom_) {
      out_.warnings.push_back(
          fmt::format("{} was taken at another zoom: focal length {:.0f} px, that of most is {:.0f} px", Name(i),
                      LensOf(i).focal_px, s.lenses[0].focal_px));
    }
    DescribeClosure(&out_);
    for (int i = 0; i < Count(); ++i) {
      if (s.photos[static_cast<size_t>(i)].placed) continue;
      out_.reason[static_cast<size_t>(i)] = WhyNotPlaced(i);
      out_.warnings.push_back(Name(i) + " is not placed: " + out_.reason[static_cast<size_t>(i)]);
    }
    for (const LeftOutPhoto& p : out_.left_out) out_.warnings.push_back(p.name + " is left out: " + p.reason);
    if (!out_.closure.full_turn && out_.closure.largest_gap_deg > 0) {
      out_.warnings.push_back("the photos do not cover the whole horizon: the largest gap is " +
                              Degrees(out_.closure.largest_gap_deg * kDegToRad));
    }
  }

  StitchedRig Take() { return std::move(out_); }

 private:
  int Count() const { return static_cast<int>(out_.photos.size()); }
  const std::string& Name(int i) const { return out_.photos[static_cast<size_t>(i)].name; }
  const Lens& LensOf(int i) const {
    return out_.state.lenses[static_cast<size_t>(out_.state.photos[static_cast<size_t>(i)].lens)];
  }
  Eigen::Vector3d Look(int i) const {
    return out_.state.photos[static_cast<size_t>(i)].cam_from_rig.conjugate() * Eigen::Vector3d::UnitZ();
  }
  double Threshold(int photo) const {
    return pair_options_.coarse_px * LongSide(out_.views[static_cast<size_t>(photo)]) / 1600;
  }
  static double AngleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return std::atan2(a.cross(b).norm(), a.dot(b));
  }

  void RequireTwo(const std::string& what) const {
    if (out_.photos.size() >= 2) return;
    std::string text = what + ", found " + std::to_string(out_.photos.size());
    for (const LeftOutPhoto& p : out_.left_out) text += "; " + p.name + ": " + p.reason;
    throw InputError(text);
  }

  PhotoPair Accepted(const PhotoPair& tried, const PairRotation& r) const {
    PhotoPair pair = tried;
    pair.b_from_a = r.b_from_a;
    pair.candidates = r.candidates;
    pair.score = r.score;
    pair.matches.clear();
    for (int k : r.inliers) pair.matches.push_back(tried.matches[static_cast<size_t>(k)]);
    return pair;
  }

  // What EXIF said of the lens is given up.
  void SetFocal(size_t lens, double share) {
    int side = 0;
    for (size_t i = 0; i < out_.photos.size(); ++i) {
      if (out_.state.photos[i].lens == static_cast<int>(lens)) side = std::max(side, LongSide(out_.views[i]));
    }
    out_.state.lenses[lens].focal_px = share * side;
    out_.state.lens_priors[lens].focal_px = 0;
  }

  void SetMissingFocal(double share) {
    for (size_t l = 0; l < out_.state.lenses.size(); ++l) {
      if (out_.state.lens_priors[l].focal_px <= 0) SetFocal(l, share);
    }
  }

  // Narrow photos fit many focal lengths pair by pair; a ring, or photos that meet three at a time, only one.
  void FindMissingFocal() {
    double share = 0.9, most = -1;
    for (const FocalScore& candidate : SearchFocal(out_.views, tried_, Fisheye(), pair_options_, threads_, cancel_)) {
      cancel_.ThrowIfCancelled();
      SetMissingFocal(candidate.share);
      Verify();
      const PhotoGraph graph = BuildPhotoGraph(Count(), accepted_, kRingSlack);
      double score = 0;
      for (const PhotoPair& p : graph.pairs) score += p.score;
      for (const PhotoPair& p : graph.contradicting) score -= p.score;
      if (score > most) most = score, share = candidate.share;
    }
    SetMissingFocal(share);
  }

  // EXIF may be wrong (a cropped or re-scaled copy): it is not used if another focal length fits far more matches.
  void DoubtExif() {
    const double by_exif = TotalScore();
    const std::vector<FocalScore> found = SearchFocal(out_.views, tried_, Fisheye(), pair_options_, threads_, cancel_);
    if (found.empty() || out_.state.lenses.size() != 1) return;
    const std::vector<Lens> lenses = out_.state.lenses;
    const std::vector<LensPrior> priors = out_.state.lens_priors;
    const std::vector<PhotoPair> accepted = accepted_;
    const double share = found.front().share, exif_share = lenses.front().focal_px / LongSide(out_.views.front());
    // EXIF holds for a fisheye's axis only; near the rim the focal length that fits there is taken.
    const bool rim = Fisheye();
    if (!rim && !(std::abs(std::log(share / exif_share)) > 0.25)) return;
    SetFocal(0, share);
    Verify();
    if (rim && TotalScore() > by_exif) {
      out_.state.lens_priors = priors;
    } else if (TotalScore() > 1.5 * by_exif) {
      out_.focal_from_exif = false;
      out_.warnings.push_back("the focal length of EXIF (" + std::to_string(std::lround(lenses.front().focal_px)) +
                              " px) does not explain the photos; it is estimated instead");
    } else {
      out_.state.lenses = lenses, out_.state.lens_priors = priors, accepted_ = accepted;
    }
  }

  void Verify() {
    std::vector<PairRotation> rotations(tried_.size());
    ParallelFor(static_cast<int64_t>(tried_.size()), threads_, cancel_, [&](int64_t k) {
      const PhotoPair& p = tried_[static_cast<size_t>(k)];
      rotations[static_cast<size_t>(k)] =
          FindRotation(out_.views, p, LensOf(p.a), LensOf(p.b), Threshold(p.b), 1000, seed_ + static_cast<uint64_t>(k));
    });
    accepted_.clear();
    for (size_t k = 0; k < tried_.size(); ++k) {
      if (rotations[k].accepted) accepted_.push_back(Accepted(tried_[k], rotations[k]));
    }
  }
  double TotalScore() const {
    double sum = 0;
    for (const PhotoPair& p : accepted_) sum += p.score;
    return sum;
  }

  RigBundleOptions BundleOptionsOfSet() const {
    RigBundleOptions b;
    b.distortion = o_.distortion;
    b.radius_m = o_.radius_m;
    b.radius_factor = o_.radius_factor;
    b.circle_share = o_.circle_share;
    return b;
  }

  // One centre for all, from rough to fine. The cost of the last. `hold`: as HoldRing.
  double SolveCentral(const std::vector<double>& knees, const std::vector<PhotoPair>& pairs, bool hold = true) {
    RigState& s = out_.state;
    s.points = BuildRigPoints(out_.views, s, pairs);
    RigBundleOptions b = BundleOptionsOfSet();
    b.max_iterations = 20;
    const std::vector<LensPrior> priors = hold ? HoldRing() : s.lens_priors;
    double cost = 0;
    for (double knee : knees) {
      b.huber_px = knee;
      b.distortion = o_.distortion && ring_closed_;
      cost = SolveRig(out_.views, b, false, cancel_, &s).cost;
      s.points = BuildRigPoints(out_.views, s, pairs);
    }
    s.lens_priors = priors;
    return cost;
  }

  // One pair closes a ring, many would be served as well by another focal length and a gap: what the closure said is
  // kept while distortion, which is what they ask for, is found. Returns the priors to be put back.
  std::vector<LensPrior> HoldRing() {
    RigState& s = out_.state;
    const std::vector<LensPrior> priors = s.lens_priors;
    for (size_t l = 0; l < s.lenses.size() && ring_closed_ && !out_.focal_from_exif; ++l) {
      s.lens_priors[l] = {s.lenses[l].focal_px, kRingSigma};
    }
    return priors;
  }

  void StartOnCircle(const Eigen::Vector3d& up) {
    for (RigPhoto& p : out_.state.photos) {
      Eigen::Vector3d look = p.cam_from_rig.conjugate() * Eigen::Vector3d::UnitZ();
      look -= up * up.dot(look);
      p.centre = look.norm() > 0.2 ? Eigen::Vector3d(o_.radius_m * look.normalized()) : Eigen::Vector3d::Zero();
    }
  }

  // Observations beyond `limit_px` (weighted), points nearer than believed or behind, points left with one observation.
  void DropOutliers(double limit_px) {
    RigState& s = out_.state;
    for (RigPoint& p : s.points) {
      std::erase_if(p.observations, [&](const RigObservation& o) {
        Eigen::Vector2d pixel;
        const double limit = limit_px * std::max(0.5, LongSide(out_.views[static_cast<size_t>(o.photo)]) / 1600.0);
        return !ProjectRigPoint(out_.views, s, p, o.photo, &pixel) || (o.weight * (pixel - o.pixel)).norm() > limit;
      });
    }
    std::erase_if(s.points, [&](const RigPoint& p) {
      return p.observations.size() < 2 || p.inverse_distance > 1 / o_.min_distance_m;
    });
  }

  // A point seen twice may lie anywhere on its line, and one that is matched wrongly pulls at its photos the harder the
  // nearer it seems: it must be about as far as something beside it.
  void DropLonelyPoints(double noise_px) {
    RigState& s = out_.state;
    struct Seen {
      Eigen::Vector2d pixel;
      double inverse_distance, sigma;
    };
    std::vector<std::vector<Seen>> seen(s.photos.size());
    // An observation's information on its photo's position, relative to others.
    const auto pull = [](const RigPoint& p, const RigObservation& o) {
      return p.inverse_distance * p.inverse_distance * o.weight.squaredNorm();
    };
    std::vector<double> pulls(s.photos.size(), 0);
    for (RigPoint& p : s.points) {
      p.sigma = noise_px * SigmaOfDistance(out_.views, s, p);
      for (const RigObservation& o : p.observations) {
        seen[static_cast<size_t>(o.photo)].push_back({o.pixel, p.inverse_distance, p.sigma});
        pulls[static_cast<size_t>(o.photo)] += pull(p, o);
      }
    }
    std::erase_if(s.points, [&](const RigPoint& p) {
      if (p.observations.size() > 2) return false;
      const bool strong = std::any_of(p.observations.begin(), p.observations.end(), [&](const RigObservation& o) {
        return pull(p, o) > kStrongPull * pulls[static_cast<size_t>(o.photo)];
      });
      if (!strong) return false;
      int near = 0, agree = 0;
      for (const RigObservation& o : p.observations) {
        const double reach = kBeside * LongSide(out_.views[static_cast<size_t>(o.photo)]);
        for (const Seen& other : seen[static_cast<size_t>(o.photo)]) {
          if ((other.pixel - o.pixel).squaredNorm() > reach * reach) continue;
          ++near;
          const double alike = kAsFar * std::max(std::abs(other.inverse_distance), std::abs(p.inverse_distance));
          agree += std::abs(other.inverse_distance - p.inverse_distance) < alike + 3 * std::hypot(other.sigma, p.sigma);
        }
      }
      return agree < 4 || agree < 0.1 * near;  // itself twice
    });
  }

  // Noise of an observation (weighted px), from the residuals: median of |r|, over those that a third observation makes
  // more than a fit.
  double NoisePx() const {
    std::vector<double> r2;
    double dof = 0;
    for (const RigPoint& p : out_.state.points) {
      if (p.observations.size() < 2) continue;
      dof += 2.0 * static_cast<double>(p.observations.size()) - 3;
      for (const RigObservation& o : p.observations) {
        Eigen::Vector2d pixel;
        if (ProjectRigPoint(out_.views, out_.state, p, o.photo, &pixel))
          r2.push_back((o.weight * (pixel - o.pixel)).squaredNorm());
      }
    }
    if (r2.size() < 20 || dof <= 0) return 1;
    const double share = dof / (2.0 * static_cast<double>(r2.size()));  // of the noise that fitting leaves visible
    return std::clamp(std::sqrt(Median(std::move(r2)) / kMediansOfChi2[2] / std::max(0.2, share)), kLeastNoisePx, 5.0);
  }

  std::string WhyNotPlaced(int i) const {
    int best = 0, with = -1;
    for (const PhotoPair& p : tried_) {
      if (p.a != i && p.b != i) continue;
      if (static_cast<int>(p.matches.size()) > best)
        best = static_cast<int>(p.matches.size()), with = p.a == i ? p.b : p.a;
    }
    if (out_.features[static_cast<size_t>(i)].size() < 30) {
      return "only " + std::to_string(out_.features[static_cast<size_t>(i)].size()) +
             " features (blurred, dark, or of a plain wall)";
    }
    for (const PhotoPair& p : accepted_) {
      if (p.a == i || p.b == i)
        return "fits " + Name(p.a == i ? p.b : p.a) + ", but neither overlaps the photos that are stitched";
    }
    if (with < 0) return "none of its features is found in another photo";
    return "does not belong: at most " + std::to_string(best) + " features are found again (in " + Name(with) +
           "), and no turn of the camera explains them";
  }

  const StitchOptions& o_;
  int threads_;
  uint64_t seed_;
  ProgressSink& progress_;
  const CancelToken& cancel_;
  PairOptions pair_options_;
  std::vector<PatchImage> patches_;  // of the photos, until they are used
  std::vector<PhotoPair> tried_, accepted_;
  std::vector<int> other_zoom_;  // photos that have a lens of their own by what they show
  double parallax_ = kFirstParallax;
  bool ring_closed_ = false;  // the photos go all the way round, and their focal length is the one that fits it
  StitchedRig out_;
};

}  // namespace

std::vector<std::string> StitchOptions::Check() const {
  std::vector<std::string> problems = CheckRanges(*this);
  static const std::set<std::string> kLevels = {"auto", "tags", "lines", "horizon", "none"};
  if (kLevels.count(level) == 0) {
    problems.push_back("option level is '" + level + "', expected auto, tags, lines, horizon or none");
  }
  static const std::set<std::string> kLenses = {"auto", "rectilinear", "fisheye"};
  if (kLenses.count(lens) == 0) {
    problems.push_back("option lens is '" + lens + "', expected auto, rectilinear or fisheye");
  }
  return problems;
}

StitchedRig StitchPhotos(const PhotoSet& set, const std::function<cv::Mat(const Photo&)>& load_grey,
                         const StitchOptions& options, int threads, uint64_t seed, ProgressSink& progress,
                         const CancelToken& cancel) {
  Stitcher s(set, options, threads, seed, progress, cancel);
  s.FindFeatures(load_grey);
  s.MakeLenses();
  s.Pair();
  s.Orient();
  s.MatchGuided();
  s.DropLonelyMatches();
  s.SolveRigOfSet();
  s.Finish(load_grey);
  return s.Take();
}

Rigid3d RigFromCam(const RigPhoto& photo) { return {photo.cam_from_rig.conjugate(), photo.centre}; }

Camera CameraOf(const StitchedRig& rig, int photo) {
  const PairView& v = rig.views[static_cast<size_t>(photo)];
  const Lens& l = rig.state.lenses[static_cast<size_t>(rig.state.photos[static_cast<size_t>(photo)].lens)];
  const Eigen::Vector2d p = l.fisheye ? Eigen::Vector2d::Zero() : DecentringIn(v, {l.p1, l.p2});
  return {l.fisheye ? CameraModel::kKannalaBrandt : CameraModel::kRadtan,
          v.width,
          v.height,
          {l.focal_px, l.focal_px, v.Principal().x(), v.Principal().y(), l.k1, l.k2, p.x(), p.y()}};
}

}  // namespace trigpoint

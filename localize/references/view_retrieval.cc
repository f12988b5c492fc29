#include "localize/references/view_retrieval.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>

#include "calib/base/median.h"
#include "calib/base/parallel.h"
#include "calib/geometry/path.h"

namespace trigpoint {
namespace {

// Photos of one hand-held set that an image is compared with, at most.
constexpr int kViewsOfSet = 3;

// An image's best views, those of hand-held sets left out (paper: no difference is made).
std::vector<Retrieval::Hit> BestViews(const LocalizeInput& input, const ViewIndex& index,
                                      const std::vector<RetrievalHit>& ranked, int top_k, bool paper) {
  std::vector<Retrieval::Hit> hits;
  for (const RetrievalHit& hit : ranked) {
    if (static_cast<int>(hits.size()) >= top_k) break;
    const auto& [r, v] = index.views[static_cast<size_t>(hit.document)];
    if (paper || !OfSet(input.references[static_cast<size_t>(r)])) hits.push_back({r, v, hit.score});
  }
  return hits;
}

// A photo of a hand-held set shows less than a panorama's view and scores lower, and it must not take a panorama's
// place either: sets are named where they are among the image's best places, by their best photos, with what they
// exceed the first place left out by.
void AppendBestPhotos(const LocalizeInput& input, const ViewIndex& index, const std::vector<RetrievalHit>& ranked,
                      int top_k, std::vector<Retrieval::Hit>* hits) {
  std::vector<Retrieval::Hit> photos;
  std::map<int, int> views_of;  // place -> views seen
  float floor = 0;
  for (const RetrievalHit& hit : ranked) {
    if (static_cast<int>(views_of.size()) > top_k) break;
    const auto& [r, v] = index.views[static_cast<size_t>(hit.document)];
    const ReferenceViews& reference = input.references[static_cast<size_t>(r)];
    const int place = reference.set < 0 ? r : -1 - reference.set;
    const auto [views, fresh] = views_of.try_emplace(place, 0);
    if (fresh && static_cast<int>(views_of.size()) > top_k) floor = hit.score;
    if (OfSet(reference) && ++views->second <= kViewsOfSet) photos.push_back({r, v, hit.score});
  }
  for (const Retrieval::Hit& photo : photos) {
    if (photo.score > floor) hits->push_back({photo.reference, photo.view, photo.score - floor});
  }
}

ViewIndex IndexOf(const LocalizeInput& input, uint64_t seed, int threads, const CancelToken& cancel) {
  std::vector<std::pair<int, int>> views;
  for (size_t r = 0; r < input.references.size(); ++r) {
    for (size_t v = 0; v < input.references[r].rig.views.size(); ++v) views.emplace_back(r, v);
  }
  const auto descriptors = [&](int document) {
    const auto& [r, v] = views[static_cast<size_t>(document)];
    return DescriptorBlock(input.view_features(r, v).descriptors);
  };
  return {IndexInMemory(static_cast<int>(views.size()), descriptors, {}, seed, threads, cancel), views};
}

// Of every image, among the tested references (empty: all).
void Query(const LocalizeInput& input, const ViewIndex& index, int top_k, bool paper, int threads,
           ProgressSink& progress, const CancelToken& cancel, Retrieval* result) {
  std::vector<char> wanted(index.views.size());
  for (size_t d = 0; d < wanted.size(); ++d) {
    const int r = index.views[d].first;
    wanted[d] = r >= 0 && (result->tested.empty() || result->tested[static_cast<size_t>(r)] != 0);
  }
  const bool with_sets = !paper && std::any_of(input.references.begin(), input.references.end(), OfSet);
  result->of_image.assign(input.images.size(), {});
  progress.Begin("retrieval", static_cast<int64_t>(input.images.size()));
  ParallelFor(static_cast<int64_t>(input.images.size()), threads, cancel, [&](int64_t i) {
    const DescriptorBlock block(input.image_features(static_cast<int>(i)).descriptors);
    const std::vector<RetrievalHit> ranked = index.words.Query(block, with_sets ? index.words.size() : top_k, wanted);
    std::vector<Retrieval::Hit>& hits = result->of_image[static_cast<size_t>(i)];
    hits = BestViews(input, index, ranked, top_k, paper);
    if (with_sets) AppendBestPhotos(input, index, ranked, top_k, &hits);
    progress.Advance(1);
  });
}

// Where a reference is said to stand, in the plane of the site's frame.
std::optional<Eigen::Vector2d> PlaceOf(const LocalizeInput& input, const ReferenceViews& r) {
  if (!input.has_frame || !r.geotag.has_position) return std::nullopt;
  return input.frame.EnuFromGeodetic(r.geotag.position).head<2>();
}

constexpr double kUnknownLength_m = 100;  // of a run, or what is left of it, that has no odometry

// How far from each fix the run can have been: half the way to the next one, all of it to the run's ends.
std::vector<double> Unfixed(const LocalizeInput& input, const std::vector<GpsPlace>& gps) {
  const std::vector<double> path = PathLengths(input.odom_from_body);
  const auto between = [&](int a, int b) {
    return std::abs(path[static_cast<size_t>(b)] - path[static_cast<size_t>(a)]);
  };
  const int last = static_cast<int>(path.size()) - 1;
  std::vector<double> unfixed;
  for (size_t i = 0; i < gps.size(); ++i) {
    const bool first = i == 0, final = i + 1 == gps.size();
    const int before = first ? 0 : gps[i - 1].pose, after = final ? last : gps[i + 1].pose;
    // Between two fixes one of them is at most half the way off.
    const double far =
        std::max((first ? 1 : 0.5) * between(before, gps[i].pose), (final ? 1 : 0.5) * between(gps[i].pose, after));
    const bool every = gps[i].pose - before <= 1 && after - gps[i].pose <= 1;
    unfixed.push_back(input.has_odometry ? far : every ? 0 : kUnknownLength_m);
  }
  return unfixed;
}

// References that the run can have been near by GPS; those without a place are, too. They are in the order of x, and
// each fix looks at those in its reach.
std::vector<char> NearGps(const LocalizeInput& input, const std::vector<GpsPlace>& gps, double reach_m) {
  const std::vector<double> unfixed = Unfixed(input, gps);
  std::vector<char> near(input.references.size(), 1);
  std::multimap<double, std::pair<double, size_t>> by_x;  // x -> y, reference
  double widest_m = 0;
  for (size_t r = 0; r < near.size(); ++r) {
    const std::optional<Eigen::Vector2d> place = PlaceOf(input, input.references[r]);
    if (!place) continue;
    near[r] = 0;
    by_x.insert({place->x(), {place->y(), r}});
    widest_m = std::max(widest_m, input.references[r].geotag.sigma_h_m);
  }
  for (size_t i = 0; i < gps.size(); ++i) {
    const double reach = reach_m + unfixed[i], x = gps[i].position.x();
    const double most = reach + 3 * std::hypot(gps[i].sigma_h_m, widest_m);
    const auto end = by_x.upper_bound(x + most);
    for (auto it = by_x.lower_bound(x - most); it != end; ++it) {
      const auto [y, r] = it->second;
      const double sigma = std::hypot(gps[i].sigma_h_m, input.references[r].geotag.sigma_h_m);
      if (std::hypot(it->first - x, y - gps[i].position.y()) < reach + 3 * sigma) near[r] = 1;
    }
  }
  return near;
}

// How much each reference stands out in what the images look like. Most of what is listed is listed by chance: a score
// counts by how far it exceeds the typical one.
std::vector<double> VotesOf(const Retrieval& listed, const std::vector<ReferenceViews>& references) {
  // Those of hand-held sets are on a scale of their own.
  std::array<std::vector<double>, 2> scores;
  const auto kind = [&](const Retrieval::Hit& h) {
    return OfSet(references[static_cast<size_t>(h.reference)]) ? 1U : 0U;
  };
  for (const auto& hits : listed.of_image) {
    for (const Retrieval::Hit& h : hits) scores[kind(h)].push_back(h.score);
  }
  const std::array<double, 2> typical{Median(std::move(scores[0])), Median(std::move(scores[1]))};
  std::vector<double> votes(references.size(), 0);
  for (const auto& hits : listed.of_image) {
    for (const Retrieval::Hit& h : hits)
      votes[static_cast<size_t>(h.reference)] += std::pow(std::max(0.0, h.score - typical[kind(h)]), 2);
  }
  return votes;
}

// How far from each other the references of a run can stand: its extent, and the reach to both sides.
double ExtentOf(const LocalizeInput& input, double reach_m) {
  if (!input.has_odometry) return kUnknownLength_m;
  Eigen::AlignedBox3d box;
  for (const Rigid3d& pose : input.odom_from_body) box.extend(pose.translation);
  return box.diagonal().norm() + 2 * reach_m;
}

// The votes within a distance of each reference's place; its own where it has none.
std::vector<double> VotesAround(const std::vector<std::optional<Eigen::Vector2d>>& places,
                                const std::vector<double>& votes, double distance_m) {
  std::map<std::pair<int64_t, int64_t>, std::vector<size_t>> of_cell;
  const auto cell = [&](const Eigen::Vector2d& p) {
    return std::pair(static_cast<int64_t>(std::floor(p.x() / distance_m)),
                     static_cast<int64_t>(std::floor(p.y() / distance_m)));
  };
  for (size_t r = 0; r < votes.size(); ++r) {
    if (places[r] && votes[r] > 0) of_cell[cell(*places[r])].push_back(r);
  }
  std::vector<double> sums = votes;
  for (size_t r = 0; r < votes.size(); ++r) {
    if (!places[r]) continue;
    const auto [x, y] = cell(*places[r]);
    sums[r] = 0;
    for (int64_t i = x - 1; i <= x + 1; ++i) {
      for (int64_t j = y - 1; j <= y + 1; ++j) {
        const auto others = of_cell.find({i, j});
        if (others == of_cell.end()) continue;
        for (const size_t o : others->second) sums[r] += (*places[o] - *places[r]).norm() < distance_m ? votes[o] : 0;
      }
    }
  }
  return sums;
}

// How likely the run has been near each reference: by the votes as far as the run extends, which tell its region, times
// those in its reach. One without a place may be in any region.
std::vector<double> Likelihoods(const LocalizeInput& input, const std::vector<double>& votes, double reach_m) {
  std::vector<std::optional<Eigen::Vector2d>> places;
  for (const ReferenceViews& r : input.references) places.push_back(PlaceOf(input, r));
  std::vector<double> regional = VotesAround(places, votes, ExtentOf(input, reach_m));
  const std::vector<double> near = VotesAround(places, votes, reach_m);
  const double most = *std::max_element(regional.begin(), regional.end());
  for (size_t r = 0; r < regional.size(); ++r) regional[r] = (places[r] ? regional[r] : most) * near[r];
  return regional;
}

// The `most` references with the highest values, of those that are flagged.
std::vector<char> Highest(const std::vector<double>& values, const std::vector<char>& flagged, size_t most) {
  std::vector<size_t> order(values.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::erase_if(order, [&](size_t r) { return flagged[r] == 0; });
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return values[a] > values[b]; });
  std::vector<char> chosen(values.size(), 0);
  for (size_t k = 0; k < std::min(most, order.size()); ++k) chosen[order[k]] = 1;
  return chosen;
}

}  // namespace

Retrieval RetrieveViews(const LocalizeInput& input, const std::vector<GpsPlace>& gps, const RetrievalOptions& options,
                        double reach_m, bool paper, uint64_t seed, int threads, ProgressSink& progress,
                        const CancelToken& cancel) {
  Retrieval result;
  result.of_image.resize(input.images.size());
  if (input.references.empty()) return result;
  std::shared_ptr<const ViewIndex> index = input.view_index ? input.view_index() : nullptr;
  if (!index) {
    progress.Begin("codebook", 0);
    index = std::make_shared<const ViewIndex>(IndexOf(input, seed, threads, cancel));
  }
  result.words = index->words.words();
  result.memory_mib = static_cast<double>(index->words.MemoryBytes()) / 1048576.0;
  const auto query = [&] { Query(input, *index, options.top_k, paper, threads, progress, cancel, &result); };
  const size_t most = std::max(static_cast<size_t>(options.most_references), input.images.size());
  if (input.references.size() > most) {
    std::vector<char> near(input.references.size(), 1);
    if (!gps.empty()) near = NearGps(input, gps, reach_m);
    const auto left = static_cast<size_t>(std::count(near.begin(), near.end(), 1));
    // GPS that is far from all references is wrong, which is for the georeferencing to find.
    if (left == 0) near.assign(near.size(), 1);
    result.tested = near;
    if (left == 0 || left > most) {
      query();
      const std::vector<double> votes = VotesOf(result, input.references);
      result.tested = Highest(Likelihoods(input, votes, reach_m), near, most);
    }
  }
  query();
  return result;
}

}  // namespace trigpoint

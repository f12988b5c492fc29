#include "survey/field/findings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "calib/base/counted.h"
#include "calib/base/median.h"

namespace trigpoint {
namespace {

// Blur is in pixels of the picture at kQualitySide_px.
constexpr double kBlurred_px = 1.6;    // beyond this corners of tags and features suffer
constexpr double kBlurredTimes = 1.8;  // of the sharp quarter of the same camera's pictures
constexpr double kSmearedTimes = 1.6;  // a part of the picture against the rest of it, a lens against another
constexpr double kLeastSmear_px = 1;   // a lens is not called smeared below this
constexpr double kTooMany = 0.1;       // share of pictures that is worth a finding
constexpr size_t kLeastPictures = 8;   // of a camera, before its lens is judged
constexpr size_t kLatest = 12;         // pictures that show what the lens is like now
// A spot of the picture that is never sharp, though its surroundings are. In fewer pictures a cell may have seen
// nothing but the sky or a smooth car.
constexpr size_t kLatestOfSpots = 36, kLeastOfSpots = 24;
constexpr double kSpotTimes = 2.5;    // against its surroundings
constexpr float kLeastEnergy = 0.5F;  // below it a cell shows nothing but noise and slow changes of brightness
// Cells: from the middle cell of a disc of 20 % and of 40 % of the width to what lies outside it. Larger ones show in
// the parts of the picture.
constexpr double kRingsFrom[] = {1.9, 3.8}, kRingWidth = 1.4;
constexpr double kLeastRing = 0.4;  // share of the ring with texture; a corner's ring is cut to 46 %
constexpr double kDarkMean = 40, kBrightMean = 215, kMostDark = 0.5, kMostBright = 0.3;
constexpr size_t kTagsNamed = 8;     // of one finding
constexpr int kRealId = 3;           // pictures of an id that nobody planned, before it counts as being there
constexpr double kSmallTag_px = 24;  // tags seen no larger than this have poor corners

double Quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<size_t>(share * static_cast<double>(values.size() - 1))];
}

// Of one camera of a run, in order of time.
struct CameraPictures {
  std::string name;  // "run1", "run1 cam0"
  std::vector<const FieldPicture*> pictures;
  std::vector<double> blurs;  // of those with one
};

std::vector<CameraPictures> ByCamera(const FieldFacts& facts) {
  std::vector<CameraPictures> cameras;
  for (const FieldRun& run : facts.runs) {
    const size_t count = std::max<size_t>(1, run.run->cameras.size());
    for (size_t c = 0; c < count; ++c) {
      CameraPictures camera;
      camera.name = count > 1 ? run.run->name + " " + run.run->cameras[c].name : run.run->name;
      for (const FieldPicture& picture : run.pictures) {
        if (picture.camera != static_cast<int>(c) || !picture.quality) continue;
        camera.pictures.push_back(&picture);
        if (picture.quality->blur_px) camera.blurs.push_back(*picture.quality->blur_px);
      }
      if (!camera.pictures.empty()) cameras.push_back(std::move(camera));
    }
  }
  return cameras;
}

void FindUnusable(const FieldFacts& facts, std::vector<SiteFinding>* findings) {
  for (const FieldRun& run : facts.runs) {
    std::vector<std::string> names;
    std::string first;
    for (const FieldPicture& picture : run.pictures) {
      if (picture.problem.empty()) continue;
      if (names.empty()) first = picture.problem;
      names.push_back(picture.image);
    }
    if (!names.empty()) {
      findings->push_back({Light::kAmber, "files",
                           fmt::format("{}: {} cannot be used: {}; the first: {}; copy what is broken again",
                                       run.run->name, Counted(names.size(), "picture"), SomeOf(names), first)});
    }
    if (run.waiting > 0) {
      findings->push_back({Light::kGreen, "files",
                           fmt::format("{}: still being copied or waiting to be looked at: {}", run.run->name,
                                       Counted(run.waiting, "picture"))});
    }
  }
  if (!facts.plan_problem.empty()) findings->push_back({Light::kRed, "files", facts.plan_problem});
  for (const auto& [run, why] : facts.site->broken_runs) {
    if (why.find("there is no file") != std::string::npos) {  // its list came first
      findings->push_back({Light::kAmber, "files", run + ": none of the pictures of its list has been copied yet"});
      continue;
    }
    if (const auto video = facts.videos_arriving.find(run); video != facts.videos_arriving.end()) {
      findings->push_back(
          {Light::kAmber, "files",
           fmt::format("{}: video {}, still being copied: it is looked at when it is complete", run, video->second)});
      continue;
    }
    if (const auto video = facts.videos_unreadable.find(run); video != facts.videos_unreadable.end()) {
      findings->push_back({Light::kRed, "files",
                           fmt::format("{}: video {}, cannot be read yet: its end is missing, or it is no MP4 (H.264); "
                                       "wait until it is copied, else copy or convert it again",
                                       run, video->second)});
      continue;
    }
    findings->push_back({Light::kRed, "files", fmt::format("{}: nothing of this run can be used: {}", run, why)});
  }
}

// Pictures that are blurred against the same camera's sharp ones: walked too fast, shaken.
void FindBlurred(const CameraPictures& camera, std::vector<SiteFinding>* findings) {
  if (camera.blurs.empty()) return;
  const double sharp = Quantile(camera.blurs, 0.25), limit = std::max(kBlurred_px, kBlurredTimes * sharp);
  std::vector<std::string> names;
  for (const FieldPicture* picture : camera.pictures) {
    if (picture->quality->blur_px.value_or(0) > limit) names.push_back(picture->image);
  }
  const auto n = static_cast<double>(camera.pictures.size());
  if (static_cast<double>(names.size()) <= kTooMany * n) return;
  findings->push_back(
      {Light::kAmber, "blur",
       fmt::format("{}: {} of {} pictures are blurred (more than {:.1f} px; the sharp ones have {:.1f} px): {}; walk "
                   "slower, or bring more light, and pass these places again",
                   camera.name, names.size(), camera.pictures.size(), limit, sharp, SomeOf(names, 3))});
}

// The latest pictures only: the lens may have been cleaned since the earlier ones.
std::vector<const FieldPicture*> Latest(const CameraPictures& camera, size_t most = kLatest) {
  const size_t n = std::min(most, camera.pictures.size());
  return {camera.pictures.end() - static_cast<std::ptrdiff_t>(n), camera.pictures.end()};
}

std::optional<double> MedianBlur(const std::vector<const FieldPicture*>& pictures) {
  std::vector<double> blurs;
  for (const FieldPicture* picture : pictures) {
    if (picture->quality->blur_px) blurs.push_back(*picture->quality->blur_px);
  }
  if (blurs.size() < kLeastPictures) return std::nullopt;
  return Median(std::move(blurs));
}

// The lens as a whole: against a fixed limit, its own earlier pictures, and the other cameras.
bool FindBlurredLens(const CameraPictures& camera, const std::vector<CameraPictures>& all,
                     std::vector<SiteFinding>* findings) {
  const std::optional<double> now = MedianBlur(Latest(camera));
  if (!now || *now < kLeastSmear_px) return false;
  std::string against;
  if (*now > kBlurred_px) against = fmt::format("more than {:.1f} px", kBlurred_px);
  const std::vector<const FieldPicture*> first(
      camera.pictures.begin(),
      camera.pictures.begin() + static_cast<std::ptrdiff_t>(std::min(kLatest, camera.pictures.size())));
  if (const auto before = MedianBlur(first); before && *now > kSmearedTimes * *before) {
    against = fmt::format("{:.1f} px when it began", *before);
  }
  for (const CameraPictures& other : all) {
    const auto its = &other == &camera ? std::nullopt : MedianBlur(Latest(other));
    if (its && *now > kSmearedTimes * *its) against = fmt::format("{:.1f} px in {}", *its, other.name);
  }
  if (against.empty()) return false;
  findings->push_back({Light::kAmber, "lens",
                       fmt::format("{}: the lens is smeared or out of focus: its latest pictures have a blur of {:.1f} "
                                   "px ({}); clean it, check the focus, and record again",
                                   camera.name, *now, against)});
  return true;
}

// Blur of each cell, px, of all these pictures together: one that shows something sharp there decides. 0: no texture.
std::vector<double> PooledBlurs(const std::vector<const FieldPicture*>& pictures, int* rows) {
  std::vector<double> sharp, reblurred;
  double count = 0;
  for (const FieldPicture* picture : pictures) {
    const GradientEnergy& energy = picture->quality->energy;
    if (sharp.empty()) sharp.resize(energy.sharp.size()), reblurred.resize(energy.sharp.size());
    if (energy.sharp.empty() || energy.sharp.size() != sharp.size()) continue;
    for (size_t k = 0; k < sharp.size(); ++k) sharp[k] += energy.sharp[k], reblurred[k] += energy.reblurred[k];
    *rows = energy.rows;
    ++count;
  }
  std::vector<double> blurs(sharp.size(), 0);
  if (count < kLeastOfSpots) return blurs;
  for (size_t k = 0; k < sharp.size(); ++k) {
    if (!(reblurred[k] > kLeastEnergy * count)) continue;
    const double ratio = sharp[k] / reblurred[k];
    blurs[k] = kReblur_px / std::sqrt(std::max(1e-4, ratio * ratio - 1));
  }
  return blurs;
}

// A blur that a tenth of the cells round this one exceed; 0: too few of them have texture.
double BlurAround(const std::vector<double>& blurs, int rows, int row, int column, double from) {
  std::vector<double> around;
  int ring = 0;
  const double to = from + kRingWidth;
  const int reach = static_cast<int>(to);
  for (int dy = -reach; dy <= reach; ++dy) {
    for (int dx = -reach; dx <= reach; ++dx) {
      const double away = std::hypot(dx, dy);
      if (away < from || away > to) continue;
      ++ring;
      const int y = row + dy, x = column + dx;
      if (y < 0 || y >= rows || x < 0 || x >= kEnergyColumns) continue;
      const double blur = blurs[static_cast<size_t>(kEnergyColumns * y + x)];
      if (blur > 0) around.push_back(blur);
    }
  }
  return static_cast<double>(around.size()) < kLeastRing * ring ? 0 : Quantile(std::move(around), 0.9);
}

// A drop or a fingerprint: too small to show in the parts of the picture.
void FindSmearedSpot(const CameraPictures& camera, std::vector<SiteFinding>* findings) {
  int rows = 0;
  const std::vector<double> blurs = PooledBlurs(Latest(camera, kLatestOfSpots), &rows);
  double most = kSpotTimes, blur = 0, around = 0;
  int at = -1;
  for (int k = 0; k < static_cast<int>(blurs.size()); ++k) {
    const double its = blurs[static_cast<size_t>(k)];
    if (its < kLeastSmear_px) continue;
    for (const double from : kRingsFrom) {
      const double its_around = BlurAround(blurs, rows, k / kEnergyColumns, k % kEnergyColumns, from);
      if (!(its_around > 0) || its < most * its_around) continue;
      most = its / its_around, blur = its, around = its_around, at = k;
    }
  }
  if (at < 0) return;
  const double right = (at % kEnergyColumns + 0.5) / kEnergyColumns, down = (at / kEnergyColumns + 0.5) / rows;
  const auto third = [](double share) { return static_cast<size_t>(std::min(2.0, std::floor(3 * share))); };
  static constexpr const char* kPlaces[] = {"at the upper left", "at the top",      "at the upper right",
                                            "at the left",       "near the centre", "at the right",
                                            "at the lower left", "at the bottom",   "at the lower right"};
  findings->push_back(
      {Light::kAmber, "lens",
       fmt::format("{}: the lens is smeared in a spot {} of the picture ({:.0f} % of its width from the left, {:.0f} % "
                   "of its height from the top): a blur of {:.1f} px, around it {:.1f} px; clean it and record again",
                   camera.name, kPlaces[3 * third(down) + third(right)], 100 * right, 100 * down, blur, around)});
}

// A part of the picture that is always less sharp than the rest.
bool FindSmearedPart(const CameraPictures& camera, std::vector<SiteFinding>* findings) {
  static constexpr const char* kParts[] = {"upper left",   "upper middle", "upper right",  "middle left", "middle",
                                           "middle right", "lower left",   "lower middle", "lower right"};
  const std::vector<const FieldPicture*> latest = Latest(camera);
  std::vector<std::string> parts;
  double worst = 0, rest = 0;
  for (size_t k = 0; k < std::size(kParts); ++k) {
    std::vector<double> blurs, ratios;
    for (const FieldPicture* picture : latest) {
      std::vector<double> others;
      for (size_t j = 0; j < std::size(kParts); ++j) {
        const auto& its = picture->quality->cell_blur_px[j];
        if (j != k && its) others.push_back(*its);
      }
      const auto& own = picture->quality->cell_blur_px[k];
      if (!own || others.size() < 4) continue;
      blurs.push_back(*own);
      ratios.push_back(*own / std::max(0.3, Median(others)));
    }
    if (blurs.size() < kLeastPictures) continue;
    // Nearly all of the pictures, whatever they show.
    if (Quantile(ratios, 0.2) < kSmearedTimes || Median(blurs) < kLeastSmear_px) continue;
    parts.emplace_back(kParts[k]);
    if (Median(blurs) > worst) worst = Median(blurs), rest = worst / Median(ratios);
  }
  if (parts.empty()) return false;
  findings->push_back({Light::kAmber, "lens",
                       fmt::format("{}: the lens is smeared in the {} of the picture: a blur of {:.1f} px, elsewhere "
                                   "{:.1f} px; clean it and record again",
                                   camera.name, SomeOf(parts), worst, rest)});
  return true;
}

void FindExposure(const CameraPictures& camera, std::vector<SiteFinding>* findings) {
  std::vector<std::string> dark, bright;
  for (const FieldPicture* picture : camera.pictures) {
    const PictureQuality& q = *picture->quality;
    if (q.mean < kDarkMean || q.dark > kMostDark) dark.push_back(picture->image);
    if (q.mean > kBrightMean || q.bright > kMostBright) bright.push_back(picture->image);
  }
  const double most = kTooMany * static_cast<double>(camera.pictures.size());
  const auto tell = [&](const std::vector<std::string>& names, const char* how, const char* what) {
    if (static_cast<double>(names.size()) <= most) return;
    findings->push_back({Light::kAmber, "exposure",
                         fmt::format("{}: {} of {} pictures are too {}: {}; {}", camera.name, names.size(),
                                     camera.pictures.size(), how, SomeOf(names, 3), what)});
  };
  tell(dark, "dark", "expose longer, or bring more light");
  tell(bright, "bright", "expose shorter, with the sun behind you");
}

// Also states what is in order.
void StateQuality(const CameraPictures& camera, std::vector<SiteFinding>* findings) {
  if (camera.blurs.empty()) return;
  std::vector<double> means;
  for (const FieldPicture* picture : camera.pictures) means.push_back(picture->quality->mean);
  findings->push_back({Light::kGreen, "pictures",
                       fmt::format("{}: {} pictures, blur {:.1f} px (median), brightness {:.0f} of 255", camera.name,
                                   camera.pictures.size(), Median(camera.blurs), Median(std::move(means)))});
}

// Pictures in a row that share too little: walked or turned too fast, nothing but a bare wall.
void FindOverlap(const FieldRun& run, std::vector<SiteFinding>* findings) {
  std::vector<double> shared;
  std::vector<std::string> broken, unexplained;
  for (const FieldPair& pair : run.pairs) {
    if (pair.loop || pair.shared < 0) continue;
    shared.push_back(pair.shared);
    if (pair.shared >= kLeastSharedInARow) continue;
    (pair.matched < kLeastSharedInARow ? broken : unexplained).push_back(pair.from + " to " + pair.to);
  }
  if (shared.empty()) return;
  if (!unexplained.empty()) {
    findings->push_back({Light::kAmber, "overlap",
                         fmt::format("{}: at {} of {} pictures at least {} features match those of the one before, but "
                                     "no motion of the camera explains {} of them ({}); is there traffic or a repeated "
                                     "pattern? Pass there again",
                                     run.run->name, unexplained.size(), shared.size(), kLeastSharedInARow,
                                     kLeastSharedInARow, SomeOf(unexplained, 2))});
  }
  if (broken.empty() && unexplained.empty()) {
    findings->push_back({Light::kGreen, "overlap",
                         fmt::format("{}: pictures in a row share {:.0f} features (median), {:.0f} at least",
                                     run.run->name, Median(shared), *std::min_element(shared.begin(), shared.end()))});
    return;
  }
  if (broken.empty()) return;
  findings->push_back(
      {Light::kAmber, "overlap",
       fmt::format("{}: at {} of {} pictures fewer than {} features are shared with the one before "
                   "({}); walk and turn slower there",
                   run.run->name, broken.size(), shared.size(), kLeastSharedInARow, SomeOf(broken, 2))});
}

void FindMissingTags(const FieldFacts& facts, std::vector<SiteFinding>* findings) {
  std::vector<std::string> missing, unknown;
  for (const TagCoverage& tag : CoverTags(facts)) {
    const auto planned = facts.planned.find(tag.tag_id);
    const std::string id = std::to_string(tag.tag_id);
    if (tag.pictures == 0) {
      const bool named = planned != facts.planned.end() && !planned->second.what.empty();
      missing.push_back(named ? id + " (" + planned->second.what + ")" : id);
    } else if (planned == facts.planned.end() && !facts.planned.empty()) {
      if (tag.pictures >= kRealId) unknown.push_back(id);
    } else if (tag.largest_px < kSmallTag_px) {
      findings->push_back(
          {Light::kAmber, "tags",
           fmt::format("tag {} is seen from afar only, {:.0f} px at most; go nearer", id, tag.largest_px)});
    }
  }
  if (!missing.empty()) {
    const bool one = missing.size() == 1;
    findings->push_back({Light::kRed, "tags",
                         fmt::format("{} {} {} planned and in no picture; check that {} up, then photograph {}",
                                     one ? "tag" : "tags", SomeOf(missing, kTagsNamed), one ? "is" : "are",
                                     one ? "it is" : "they are", one ? "it" : "them")});
  }
  if (!unknown.empty()) {
    const bool one = unknown.size() == 1;
    findings->push_back(
        {Light::kAmber, "tags",
         fmt::format("{} {} {} in pictures and in no plan, station, control point or entry of tags.yaml; enter {}, or "
                     "take {} down",
                     one ? "tag" : "tags", SomeOf(unknown, kTagsNamed), one ? "is" : "are", one ? "it" : "them",
                     one ? "it" : "them")});
  }
}

void FindUnsizedTags(const FieldFacts& facts, std::vector<SiteFinding>* findings) {
  std::set<int> unsized;
  for (const FieldRun& run : facts.runs) {
    std::map<int, int> pictures;
    for (const FieldPicture& picture : run.pictures) {
      for (const TagDetection& d : picture.tags) {
        if (!(facts.site->tags.SizeOf(d.id) > 0) && ++pictures[d.id] >= kRealId) unsized.insert(d.id);
      }
    }
  }
  if (unsized.empty()) return;
  std::vector<std::string> ids;
  for (const int id : unsized) ids.push_back(std::to_string(id));
  findings->push_back({Light::kRed, "tags",
                       fmt::format("{} {} {} no size in tags.yaml and {} no part in the map; measure the edge of the "
                                   "black square and enter it as size_m, or in sizes_m by id",
                                   ids.size() == 1 ? "tag" : "tags", SomeOf(ids, kTagsNamed),
                                   ids.size() == 1 ? "has" : "have", ids.size() == 1 ? "takes" : "take")});
}

// Panoramas and photos with a geotag each: what localization is held to the world by.
void FindInReferences(const FieldFacts& facts, std::vector<SiteFinding>* findings) {
  int panoramas = 0;
  std::vector<std::string> unplaced, unheaded, unreadable;
  for (const Reference& reference : facts.site->references) {
    if (reference.kind == ReferenceKind::kPhotoSet) continue;
    ++panoramas;
    if (!reference.geotag.has_position) unplaced.push_back(reference.name);
    if (!reference.geotag.has_heading) unheaded.push_back(reference.name);
    if (facts.unreadable.contains(reference.name)) {
      unreadable.push_back(reference.name + " (" + facts.unreadable.at(reference.name) + ")");
    }
  }
  if (panoramas == 0) return;
  const auto add = [&](const std::vector<std::string>& names, Light light, const char* what) {
    if (names.empty()) return;
    findings->push_back(
        {light, "panoramas",
         fmt::format("{} of {} {}: {}", names.size(), Counted(panoramas, "panorama"), what, SomeOf(names, 3))});
  };
  add(unreadable, Light::kRed, "cannot be read; copy them again");
  add(unplaced, Light::kAmber, "have no position; enter it into panoramas.csv");
  add(unheaded, Light::kAmber, "have no heading; it is found only where the pictures show it");
  if (unreadable.empty() && unplaced.empty() && unheaded.empty()) {
    findings->push_back({Light::kGreen, "panoramas",
                         fmt::format("{}: readable, with position and heading", Counted(panoramas, "panorama"))});
  }
}

void FindInSets(const FieldFacts& facts, std::vector<SiteFinding>* findings) {
  for (const FieldSet& set : facts.sets) {
    const std::string name = "photo set " + set.name;
    if (!set.problem.empty()) {
      findings->push_back({Light::kRed, "photo sets", name + ": " + set.problem});
      continue;
    }
    if (set.placed < set.photos) {
      findings->push_back({Light::kAmber, "photo sets",
                           fmt::format("{}: {} of {} photos overlap with no other; take more between them", name,
                                       set.photos - set.placed, set.photos)});
    }
    if (set.full_turn) {
      findings->push_back(
          {Light::kGreen, "photo sets", fmt::format("{}: the ring of {} photos is closed", name, set.placed)});
    } else {
      findings->push_back({Light::kRed, "photo sets",
                           fmt::format("{}: the ring is open: {}; photograph on until the first photo overlaps with "
                                       "the last",
                                       name, WhyOpen(set))});
    }
  }
}

}  // namespace

std::string WhyOpen(const FieldSet& set) {
  const bool named = !set.before_gap.empty();
  if (set.gap_deg >= 0.5) {
    return fmt::format("{:.0f} deg of the horizon are not seen{}", set.gap_deg,
                       named ? fmt::format(", between {} and {}", set.before_gap, set.after_gap) : "");
  }
  return fmt::format("{} do not match, though the photos see the whole horizon",
                     named ? fmt::format("{} and {}", set.before_gap, set.after_gap) : "the first and the last photo");
}

const char* LightName(Light light) {
  return light == Light::kGreen ? "green" : light == Light::kAmber ? "amber" : "red";
}

std::string SomeOf(const std::vector<std::string>& names, size_t most) { return Listed(names, most); }

LengthText SomeOf(const std::vector<LengthText>& names, size_t most) {
  LengthText text;
  for (size_t k = 0; k < std::min(most, names.size()); ++k) text += (k > 0 ? ", " : "") + names[k];
  return names.size() > most ? text + fmt::format(" and {} more", names.size() - most) : text;
}

std::vector<SiteFinding> FindInPictures(const FieldFacts& facts) {
  std::vector<SiteFinding> findings;
  FindUnusable(facts, &findings);
  const std::vector<CameraPictures> cameras = ByCamera(facts);
  for (const CameraPictures& camera : cameras) {
    if (!FindBlurredLens(camera, cameras, &findings)) {
      FindBlurred(camera, &findings);
      if (!FindSmearedPart(camera, &findings)) FindSmearedSpot(camera, &findings);
    }
    FindExposure(camera, &findings);
    StateQuality(camera, &findings);
  }
  for (const FieldRun& run : facts.runs) FindOverlap(run, &findings);
  FindMissingTags(facts, &findings);
  FindUnsizedTags(facts, &findings);
  FindInReferences(facts, &findings);
  FindInSets(facts, &findings);
  return findings;
}

}  // namespace trigpoint

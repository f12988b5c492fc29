#include "localize/reconstruct/track_table.h"

#include <algorithm>
#include <iterator>

namespace trigpoint {
namespace {

bool Earlier(const TrackObservation& a, const TrackObservation& b) { return a.image < b.image; }

}  // namespace

TrackTable::TrackTable(const TrackSet& tracks) {
  for (const TrackObservation& o : tracks.observations) {
    TrackOf(o) = o.track;
    tracks_[o.track].push_back(o);
  }
  next_ = tracks.tracks;
}

int& TrackTable::TrackOf(const TrackObservation& o) {
  std::vector<int>& of_image = track_of_[o.image];
  const auto feature = static_cast<size_t>(o.feature);
  if (of_image.size() <= feature) of_image.resize(feature + 1, kNone);
  return of_image[feature];
}

int TrackTable::Begin(const TrackObservation& o) {
  tracks_[next_] = {o};
  return next_++;
}

bool TrackTable::Join(const TrackObservation& a, const TrackObservation& b) {
  if (TrackOf(a) == kNone) TrackOf(a) = Begin(a);
  if (TrackOf(b) == kNone) TrackOf(b) = Begin(b);
  const int kept = TrackOf(a), gone = TrackOf(b);
  if (kept == gone) return true;
  Track &into = tracks_.at(kept), &from = tracks_.at(gone);
  Track merged;
  merged.reserve(into.size() + from.size());
  std::merge(into.begin(), into.end(), from.begin(), from.end(), std::back_inserter(merged), Earlier);
  const auto same = [](const TrackObservation& x, const TrackObservation& y) { return x.image == y.image; };
  if (std::adjacent_find(merged.begin(), merged.end(), same) != merged.end()) return false;
  for (const TrackObservation& o : from) {
    const auto image = track_of_.find(o.image);
    if (image != track_of_.end()) image->second[static_cast<size_t>(o.feature)] = kept;
  }
  into = std::move(merged);
  tracks_.erase(gone);
  return true;
}

void TrackTable::Close(int image, const Keep& keep, TrackSet* out) {
  track_of_.erase(track_of_.begin(), track_of_.lower_bound(image));
  for (auto it = tracks_.begin(); it != tracks_.end();) {
    Track& track = it->second;
    if (track.back().image >= image) {
      ++it;
      continue;
    }
    if (keep(track)) {
      for (TrackObservation& o : track) o.track = out->tracks;
      out->observations.insert(out->observations.end(), track.begin(), track.end());
      ++out->tracks;
    }
    it = tracks_.erase(it);
  }
}

}  // namespace trigpoint

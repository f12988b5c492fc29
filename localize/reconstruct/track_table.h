// Tracks that may still grow: sets of features of different images that show one point.
#pragma once

#include <functional>
#include <map>
#include <vector>

#include "localize/reconstruct/tracks.h"

namespace trigpoint {

// A track never holds two features of one image: a match that would make it do so is refused.
class TrackTable {
 public:
  using Track = std::vector<TrackObservation>;  // by image
  using Keep = std::function<bool(const Track&)>;

  TrackTable() = default;
  // Goes on with finished tracks.
  explicit TrackTable(const TrackSet& tracks);

  // Room for the features of an image; ascending images.
  void AddImage(int image, size_t features) { track_of_[image].assign(features, kNone); }

  // A feature of an image and one of another image are the same. False where their tracks contradict it.
  bool Join(const TrackObservation& a, const TrackObservation& b);

  // No image before `image` will be matched again: the tracks that end there are done. Those that `keep` wants are
  // appended to `out`.
  void Close(int image, const Keep& keep, TrackSet* out);

 private:
  static constexpr int kNone = -1;
  int Begin(const TrackObservation& o);
  int& TrackOf(const TrackObservation& o);

  std::map<int, std::vector<int>> track_of_;  // image -> of each feature
  std::map<int, Track> tracks_;               // in the order they were begun
  int next_ = 0;
};

}  // namespace trigpoint

// Positions in the EXIF of pictures: where a run went, and whether photos are from one spot.
#pragma once

#include <string>
#include <vector>

#include "datasets/io/exif.h"
#include "datasets/io/gps.h"

namespace trigpoint {

// Sigma of an EXIF position whose file states none, m per axis: that of a phone in the open.
constexpr double kExifPositionSigma_m = 5;

// A fix for each image that has a position of its own, at the image's time. Of images with the same position the first
// alone counts: receivers repeat a fix until there is a new one.
GpsTrack ReadImagePositions(const Run& run);

// Why photos cannot be a hand-held set, taken from about one spot: half of them lie farther from the middle than
// arm's reach and the errors of their positions explain, or six or more move on in the order of their times farther
// than drifting errors do (5.1 sigma; in a straight line 3.3 sigma). Together less than 2 % of sets from one spot are
// refused, however the errors are correlated. "" if they may be, or if fewer than four have a position.
std::string WhyNotFromOneSpot(const std::vector<PhotoMetadata>& photos);

}  // namespace trigpoint

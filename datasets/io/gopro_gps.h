// The GPS track that GoPro cameras write into their videos.
#pragma once

#include <filesystem>

#include "datasets/io/gps.h"

namespace trigpoint {

// The GPMF track of an MP4 (GPS5 of HERO5 to HERO10, GPS9 since): stamps from the video's first frame, each payload's
// fixes spread over its time. Fixes without 3D or with a DOP above 5 are counted and skipped. Heights above the sea
// (GPSA MSLV) count with kUnknownGeoidSigma. Empty for other videos. Throws InputError for a GPMF track that is
// damaged.
GpsTrack ReadGoProGps(const std::filesystem::path& video);

// When an MP4 says that it was made (mvhd), ns since 1970; nothing if it doesn't. Some cameras state the beginning of
// the recording, others its end.
std::optional<int64_t> VideoCreationUtcNs(const std::filesystem::path& video);

// Whether an MP4 states that it is a 360 video in equirectangular projection: Google's spherical video metadata, as XML
// in a box uuid (version 1) or as boxes sv3d and equi (version 2). False for what is no MP4.
bool IsSphericalVideo(const std::filesystem::path& video);

}  // namespace trigpoint

// The steps of ReadRun, for the site's reader: settings must be right, data may be partly broken.
#pragma once

#include <string>
#include <vector>

#include "datasets/io/site.h"

namespace trigpoint {

// run.yaml and the cameras. Throws InputError for anything wrong in them: a typo there changes what everything means.
Run ReadRunSettings(const std::filesystem::path& run_dir, const std::filesystem::path& site_dir);

// Images, odometry, GPS into `run`. Throws InputError if none of it can be used.
void ReadRunData(const std::filesystem::path& site_dir, Run* run);

// A TIFF that says where on the Earth it lies?
bool IsGeoTiff(const std::filesystem::path& file);

// Takes the positions out that lie at latitude 0, longitude 0 or far from the rest of the site, with a warning that
// names the cause where it shows (latitude and longitude swapped).
void LeaveOutFarPlaces(Site* site);

// Finds the run's images: images.txt, else folders of pictures, else videos. Ascending time, then camera.
void ReadImageList(const std::filesystem::path& site_dir, Run* run);

// Frame times of a video, ns from its first frame. Throws InputError if it cannot be opened.
std::vector<int64_t> VideoFrameTimes(const std::filesystem::path& file);

}  // namespace trigpoint

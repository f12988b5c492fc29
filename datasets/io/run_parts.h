// The steps of ReadRun, for the site's reader: settings must be right, data may be partly broken.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "datasets/io/gps.h"
#include "datasets/io/site.h"

namespace trigpoint {

// run.yaml; defaults where there is none. Throws InputError.
RunConfig ReadRunConfig(const std::filesystem::path& file);

// run.yaml and the cameras. Throws InputError for anything wrong in them: a typo there changes what everything means.
Run ReadRunSettings(const std::filesystem::path& run_dir, const std::filesystem::path& site_dir);

// Images, odometry, GPS into `run`. Throws InputError if none of it can be used.
void ReadRunData(const std::filesystem::path& site_dir, Run* run);

// The run's table or track of GPS, if there is one.
std::optional<std::filesystem::path> GpsFile(const std::filesystem::path& run_dir);

// Its fixes, without the clock's offset of run.yaml. Throws InputError.
GpsTrack ReadGpsFile(const std::filesystem::path& file, const RunConfig& config);

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

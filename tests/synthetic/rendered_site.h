// Synthetic sites with pictures: the drive of a SyntheticSite past textured walls, written in the layout that users
// bring, with its truth beside it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "calib/base/progress.h"
#include "tests/synthetic/scene.h"
#include "tests/synthetic/synthetic_site.h"

namespace trigpoint {

struct RenderedSiteOptions {
  double px_per_m = 64;      // of facades
  double variety = 0.5;      // of their windows, 0: all alike (FacadeOptions)
  int distinct_facades = 4;  // fewer than walls: the same pictures repeat round the site
  int cars = 12;             // parked along the drive; their places and the light belong to the day
  uint64_t day = 1;
  bool tags = true;          // a tag 36h11 on a post below every panorama, id = its index
  double tag_size_m = 0.5;   // edge of the black square
  double tag_below_m = 0.9;  // its centre below the panorama's
  int panorama_width = 4096;
  int photo_sets = 0;  // hand-held sets of 12 photos, each 3 m in front of the tag below a panorama
  double arm_m = 0.3;  // their photos' centres lie on a circle of this radius about the holder
  int supersample = 2;
  double blur_sigma_px = 0.4;
  double noise_sigma = 2;  // grey values
  std::string run = "run1";

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.px_per_m, {"px_per_m", "px/m", 1, 1000, "resolution of the facades"});
    visit(self.variety, {"variety", "", 0, 1, "how much windows differ"});
    visit(self.distinct_facades, {"distinct_facades", "", 1, 1000, "number of facade pictures"});
    visit(self.cars, {"cars", "", 0, 1000, "parked cars"});
    visit(self.tags, {"tags", "", 0, 1, "a tag below every panorama"});
    visit(self.tag_size_m, {"tag_size_m", "m", 0.01, 10, "edge of the black square"});
    visit(self.tag_below_m, {"tag_below_m", "m", 0, 10, "tag's centre below the panorama's"});
    visit(self.panorama_width, {"panorama_width", "px", 64, 16384, "width of an equirectangular panorama"});
    visit(self.photo_sets, {"photo_sets", "", 0, 1000, "hand-held photo sets, in front of the first tags"});
    visit(self.arm_m, {"arm_m", "m", 0, 2, "radius of their photos' centres about the holder"});
    visit(self.supersample, {"supersample", "", 1, 8, "rays per pixel edge"});
    visit(self.blur_sigma_px, {"blur_sigma_px", "px", 0, 20, "defocus"});
    visit(self.noise_sigma, {"noise_sigma", "", 0, 100, "sensor noise, grey values"});
    visit(self.run, {"run", "", 0, 0, "name of the run"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

// The tag below panorama i: upright, facing the nearest place of the drive.
Rigid3d SyntheticWorldFromTag(const SyntheticSite& site, const RenderedSiteOptions& options, size_t panorama);

// Walls, ground and tags from the site and `seed`; cars and light from options.day besides.
Scene MakeScene(const SyntheticSite& site, const RenderedSiteOptions& options, uint64_t seed);

// Renders images and panoramas and writes `dir` (runs/<run>/ with images, odometry, camchain, GPS and run.yaml;
// panoramas, photos/<set>/, stations, control points, tags, origin) and `truth` (tags.csv, panoramas.tum,
// photos/<set>.tum by the photos' numbers, runs/<run>_cameras.tum of the first camera). Geotags, odometry and GPS are
// the site's. Calling it again with another drive of the same geometry and another options.run adds that run. Throws
// IoError, OptionError, Cancelled.
void WriteRenderedSite(const SyntheticSite& site, const RenderedSiteOptions& options, uint64_t seed,
                       const std::filesystem::path& dir, const std::filesystem::path& truth, int threads,
                       ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint

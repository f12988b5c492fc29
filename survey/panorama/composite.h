// A rig's photos as one equirectangular picture, made in tiles so that memory stays bounded.
//
// Seams, exposure and blending are OpenCV's (modules/stitching): gains per photo and channel, graph-cut seams found at
// a low resolution, pyramids of bands (Burt & Adelson 1983) at full resolution. What lies at both ends of the picture
// is handled as neighbours: every photo has its own, unwrapped azimuths.
#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "calib/base/option.h"
#include "calib/base/progress.h"
#include "survey/panorama/stitch.h"

namespace trigpoint {

struct CompositeOptions {
  int width = 0;                      // px of the full turn; 0: the photos' own resolution, at most 16384
  std::string format = "jpg";         // jpg, tif (holes are transparent)
  int quality = 92;                   // of a JPEG
  int bands = 5;                      // of the blending pyramid; 0: no blending
  std::string seams = "graphcut";     // graphcut, dp, none (nearest photo)
  std::string exposure = "channels";  // channels (gain of each colour), gain, none
  bool parallax = true;               // show each photo from the panorama's centre, by the points' distances
  int seam_width = 1600;              // px of the full turn at which seams are found
  int memory_mb = 1024;               // for decoded photos

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.width,
          {"width", "px", 0, 16384, "width of the full turn; 0: the photos' own resolution, at most 16384"});
    visit(self.format, {"format", "", 0, 0, "jpg (holes are black), or tif (holes are transparent)"});
    visit(self.quality, {"quality", "", 1, 100, "quality of the JPEG"});
    visit(self.bands, {"bands", "", 0, 8, "bands of the blending pyramid; 0: hard seams"});
    visit(self.seams,
          {"seams", "", 0, 0, "how seams are found: graphcut, dp, or none (each pixel from the nearest photo)"});
    visit(self.exposure,
          {"exposure", "", 0, 0, "exposure compensation: channels (a gain for each colour), gain (one for all), none"});
    visit(self.parallax,
          {"parallax", "", 0, 1,
           "correct parallax: draw each photo as seen from the panorama's centre, by the points' distances"});
    visit(self.seam_width, {"seam_width", "px", 256, 4096, "width of the full turn at which seams are found"});
    visit(self.memory_mb, {"memory_mb", "MiB", 64, 65536, "memory for decoded photos"});
  }
  std::vector<std::string> Check() const;
};

struct Composite {
  int width = 0, height = 0;  // of the full sphere
  cv::Rect part;              // of it that is the picture: all of it, or what is filled where that is no full turn
  double covered = 0;         // share of the sphere's solid angle
  std::vector<Eigen::Vector3d> gains;  // B, G, R of each photo; 1 where it takes no part
  std::vector<double> share;           // of the picture that each photo fills
  cv::Mat coverage;                    // 8-bit, low resolution: 255 where there is a picture
};

struct StripSink {
  std::function<void(const Composite&)> begin;    // its size and part are known now
  std::function<void(const cv::Mat& rows)> rows;  // from top to bottom, 8-bit BGRA, as wide as the part; alpha 0: hole
};

// `load` gives a photo 8-bit BGR, orientation applied; called from several threads.
Composite CompositePanorama(const StitchedRig& rig, const std::function<cv::Mat(const Photo&)>& load,
                            const CompositeOptions& options, int threads, const StripSink& sink, ProgressSink& progress,
                            const CancelToken& cancel);

// Width for the photos' own resolution: 2 pi f of the longest lens, a multiple of 32, at most 16384.
int NativeWidth(const StitchedRig& rig);

}  // namespace trigpoint

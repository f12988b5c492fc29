// Makes inputs with truth from others, for tests by hand and for benchmarks:
//   make_inputs street_view SITE TRUTH OUT OUT_TRUTH [SEED]   panoramas as street-level imagery comes
//   make_inputs mirrored SITE RUN OUT                          a run seen through a mirror
//   make_inputs rendered OUT OUT_TRUTH [SEED [PATH [SETS]]]    a synthetic site, PATH loop or street, SETS photo sets
//   make_inputs distractors OUT N [SEED]                       panoramas of other streets
//   make_inputs boards OUT [SEED]                              pictures of a checkerboard, for `calibrate`
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "calib/base/error.h"
#include "tests/calib/target_rendering.h"
#include "tests/synthetic/distractors.h"
#include "tests/synthetic/rendered_site.h"
#include "tests/synthetic/site_writer.h"
#include "tests/synthetic/street_view.h"

namespace trigpoint {
namespace {

// Twelve pictures of a 9 x 6 checkerboard of 25 mm by a camera with distortion.
void MakeBoards(const std::string& out, uint64_t seed) {
  constexpr double kTexels = 4000, kSquare = 0.025, kMargin = 0.05;  // a metre; m
  const Camera camera(CameraModel::kRadtan, 960, 600, {652, 650, 483, 297, -0.21, 0.06, 0.0005, -0.0003});
  Target target;
  target.cols = 9;
  target.rows = 6;
  target.spacing_x_m = target.spacing_y_m = kSquare;
  const auto texels = [&](double metres) { return static_cast<int>(std::lround(kTexels * metres)); };
  cv::Mat texture(texels(7 * kSquare + 2 * kMargin), texels(10 * kSquare + 2 * kMargin), CV_8U, cv::Scalar(235));
  const double first = kMargin + kSquare;  // of the inner corners
  for (int r = 0; r < 7; ++r) {
    for (int c = r % 2; c < 10; c += 2) {
      cv::rectangle(
          texture,
          cv::Rect(texels(kMargin + c * kSquare), texels(kMargin + r * kSquare), texels(kSquare), texels(kSquare)),
          cv::Scalar(20), cv::FILLED);
    }
  }
  Random random(seed);
  int number = 0;
  for (const Rigid3d& view : SpreadViews(camera, target, 12, 0.35, random)) {
    WritePicture(std::filesystem::path(out) / ("board_" + std::to_string(number++) + ".png"),
                 RenderBoard(camera, view, texture, kTexels, kTexels * Eigen::Vector2d(first, first), false));
  }
}

int Main(const std::vector<std::string>& args) {
  const auto seed = [&](size_t i) { return i < args.size() ? std::stoull(args[i]) : 1ULL; };
  const std::string what = args.empty() ? "" : args[0];
  ProgressSink progress;
  const CancelToken cancel;
  if (what == "street_view" && (args.size() == 5 || args.size() == 6)) {
    MakeStreetViewSite(args[1], args[2], args[3], args[4], {}, seed(5), progress, cancel);
  } else if (what == "mirrored" && args.size() == 4) {
    MakeMirroredSite(args[1], args[2], args[3], progress, cancel);
  } else if (what == "rendered" && args.size() >= 3 && args.size() <= 6) {
    SyntheticOptions options;
    options.panoramas_left = true;  // the default camera looks to the left
    if (args.size() >= 5) options.path = args[4];
    RenderedSiteOptions rendered;
    if (args.size() == 6) rendered.photo_sets = std::stoi(args[5]);
    WriteRenderedSite(MakeSyntheticSite(options, seed(3)), rendered, seed(3), args[1], args[2], 0, progress, cancel);
  } else if (what == "distractors" && (args.size() == 3 || args.size() == 4)) {
    const int n = std::stoi(args[2]);
    for (int i = 0; i < n; ++i) {
      WritePicture(std::filesystem::path(args[1]) / ("distractor_" + std::to_string(i) + ".jpg"),
                   MakeDistractorPanorama({}, seed(3) * 100000 + static_cast<uint64_t>(i), 0));
    }
  } else if (what == "boards" && (args.size() == 2 || args.size() == 3)) {
    MakeBoards(args[1], seed(2));
  } else {
    std::fprintf(stderr,
                 "usage: make_inputs street_view SITE TRUTH OUT OUT_TRUTH [SEED]\n"
                 "       make_inputs mirrored SITE RUN OUT\n"
                 "       make_inputs rendered OUT OUT_TRUTH [SEED [loop|street [SETS]]]\n"
                 "       make_inputs distractors OUT N [SEED]\n"
                 "       make_inputs boards OUT [SEED]\n");
    return 2;
  }
  return 0;
}

}  // namespace
}  // namespace trigpoint

int main(int argc, char** argv) {
  try {
    return trigpoint::Main({argv + 1, argv + argc});
  } catch (const trigpoint::Error& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return e.ExitCode();
  }
}

// Makes inputs with truth from others, for tests by hand and for benchmarks:
//   make_inputs street_view SITE TRUTH OUT OUT_TRUTH [SEED]   panoramas as street-level imagery comes
//   make_inputs mirrored SITE RUN OUT                          a run seen through a mirror
//   make_inputs rendered OUT OUT_TRUTH [SEED [PATH]]           a synthetic site, PATH loop or street
//   make_inputs distractors OUT N [SEED]                       panoramas of other streets
#include <cstdio>
#include <string>
#include <vector>

#include "calib/base/error.h"
#include "datasets/synthetic/distractors.h"
#include "datasets/synthetic/rendered_site.h"
#include "datasets/synthetic/site_writer.h"
#include "datasets/synthetic/street_view.h"

namespace trigpoint {
namespace {

int Main(const std::vector<std::string>& args) {
  const auto seed = [&](size_t i) { return i < args.size() ? std::stoull(args[i]) : 1ULL; };
  const std::string what = args.empty() ? "" : args[0];
  ProgressSink progress;
  const CancelToken cancel;
  if (what == "street_view" && (args.size() == 5 || args.size() == 6)) {
    MakeStreetViewSite(args[1], args[2], args[3], args[4], {}, seed(5), progress, cancel);
  } else if (what == "mirrored" && args.size() == 4) {
    MakeMirroredSite(args[1], args[2], args[3], progress, cancel);
  } else if (what == "rendered" && args.size() >= 3 && args.size() <= 5) {
    SyntheticOptions options;
    options.panoramas_left = true;  // the default camera looks to the left
    if (args.size() == 5) options.path = args[4];
    WriteRenderedSite(MakeSyntheticSite(options, seed(3)), {}, seed(3), args[1], args[2], 0, progress, cancel);
  } else if (what == "distractors" && (args.size() == 3 || args.size() == 4)) {
    const int n = std::stoi(args[2]);
    for (int i = 0; i < n; ++i) {
      WritePicture(std::filesystem::path(args[1]) / ("distractor_" + std::to_string(i) + ".jpg"),
                   MakeDistractorPanorama({}, seed(3) * 100000 + static_cast<uint64_t>(i), 0));
    }
  } else {
    std::fprintf(stderr,
                 "usage: make_inputs street_view SITE TRUTH OUT OUT_TRUTH [SEED]\n"
                 "       make_inputs mirrored SITE RUN OUT\n"
                 "       make_inputs rendered OUT OUT_TRUTH [SEED [loop|street]]\n"
                 "       make_inputs distractors OUT N [SEED]\n");
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

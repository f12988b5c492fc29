// Is the stated uncertainty real? Localizes a synthetic site many times, the same geometry with new noise each time,
// and compares errors with their covariances:
//   nees_redraws [--redraws 50] [--path loop|street] [--seed 1] [--threads 0]
// Prints the mean normalised estimation error squared (NEES) of the global fit, the odometry's scale, panoramas and
// cameras, each with the 95 % band that independent redraws give it; and memory and processor time, which long drives
// (--length 5000) show.
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <Eigen/Cholesky>
#include <cmath>
#include <cstdio>
#include <map>
#include <numeric>
#include <opencv2/core/utility.hpp>

#include "calib/base/error.h"
#include "localize/localize.h"
#include "localize/reconstruct/reconstruct_run.h"
#include "tests/synthetic/synthetic_features.h"

namespace trigpoint {
namespace {

LocalizeInput InputOf(const SyntheticSite& site) {
  LocalizeInput input;
  input.cameras = site.cameras;
  for (size_t i = 0; i < site.images.size(); ++i) {
    const SyntheticImage& image = site.images[i];
    input.images.push_back({image.stamp_ns, std::to_string(i), image.camera, image.step});
  }
  for (const TimedPose& pose : site.odometry.poses) {
    input.pose_stamps.push_back(pose.stamp_ns);
    input.odom_from_body.push_back(pose.target_from_body);
  }
  for (const SyntheticPanorama& panorama : site.panoramas) {
    input.references.push_back(
        {panorama.name, panorama.name, ReferenceKind::kPanorama, panorama.rig, panorama.geotag, "", -1});
  }
  input.image_features = [&site](int i) { return SyntheticImageFeatures(site, i); };
  input.view_features = [&site](int p, int v) { return SyntheticViewFeatures(site, p, v); };
  input.has_frame = true;
  input.frame = site.frame;
  input.scale_sigma = site.options.odometry_scale_sigma;
  return input;
}

// The noise as it is: nothing is estimated that is known.
ReconstructRunOptions RunOptionsOf(const SyntheticOptions& site, bool estimate) {
  ReconstructRunOptions options;
  ReconstructOptions& r = options.reconstruct;
  r.sigma_px = site.pixel_sigma_px;
  // The site's parts add up, those of the options in quadrature: all steps have one length, so one number says both.
  const Vector6d step = OdometrySigma(site, site.step_m);
  r.odometry_rotation_deg = step(0) * kRadToDeg;
  r.odometry_translation_m = step(3);
  r.odometry_rotation_deg_m = r.odometry_translation_part = 0;
  r.estimate_sigma = r.estimate_odometry = estimate;
  return options;
}

template <int N>
double Nees(const Eigen::Matrix<double, N, 1>& error, const Eigen::Matrix<double, N, N>& covariance) {
  return error.dot(covariance.ldlt().solve(error));
}

// Over independent redraws, a quantity with `dof` degrees of freedom: its mean and the 95 % band of that. One value a
// redraw: chi-square (Wilson, Hilferty 1931). Several (all panoramas hang on one fit to the Earth, so that they err
// together): from how the redraws' means spread.
struct Pool {
  int dof = 1;
  std::map<int, std::vector<double>> values;  // of each redraw
  void Print(const std::string& name) const {
    if (values.empty()) return std::printf("%-28s no values\n", name.c_str()), void();
    double sum = 0;
    size_t count = 0;
    std::vector<double> means;
    for (const auto& [redraw, some] : values) {
      const double of_redraw = std::accumulate(some.begin(), some.end(), 0.0);
      means.push_back(of_redraw / static_cast<double>(some.size()) / dof);
      sum += of_redraw, count += some.size();
    }
    const double redraws = static_cast<double>(values.size()), n = redraws * dof;
    const double mean = sum / static_cast<double>(count) / dof;
    const auto bound = [&](double z) {
      if (count == values.size()) return std::pow(1 - 2 / (9 * n) + z * std::sqrt(2 / (9 * n)), 3);
      double square = 0;
      for (const double m : means) square += (m - mean) * (m - mean);
      return 1 + z * std::sqrt(square / std::max(1.0, redraws - 1) / redraws);
    };
    const double low = bound(-1.96), high = bound(1.96);
    std::printf("%-28s dof %d  n %3zu  mean NEES per dof %.3f  band %.3f to %.3f  %s\n", name.c_str(), dof, count, mean,
                low, high, mean >= low && mean <= high ? "in" : "OUT");
  }
};

struct Usage {
  double peak_mib = 0, cpu_s = 0;
};
Usage UsageNow() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return {static_cast<double>(usage.ru_maxrss) / 1024, seconds(usage.ru_utime) + seconds(usage.ru_stime)};
}

int Main(int argc, char** argv) {
  CLI::App app("Normalised estimation errors over redraws of a synthetic site's noise");
  int redraws = 50, threads = 0;
  uint64_t seed = 1;
  bool estimate = false, verbose = false;
  SyntheticOptions synthetic;
  app.add_option("--redraws", redraws, "new noise so many times");
  app.add_option("--path", synthetic.path, "loop or street");
  app.add_option("--length", synthetic.length_m, "of the drive, m");
  app.add_option("--points", synthetic.points_per_image, "tracks alive in an image");
  app.add_option("--pixel-sigma", synthetic.pixel_sigma_px, "noise of an observation, px");
  app.add_option("--panoramas", synthetic.panoramas, "along the drive");
  app.add_option("--seed", seed, "of the geometry; noise has seeds of its own");
  app.add_option("--threads", threads, "0: all cores");
  app.add_flag("--estimate-noise", estimate, "let the localization estimate the noise instead of telling it");
  app.add_flag("--verbose", verbose, "a line a redraw");
  CLI11_PARSE(app, argc, argv);
  cv::setNumThreads(1);
  const SyntheticSite first = MakeSyntheticSite(synthetic, seed);
  const ReconstructRunOptions run_options = RunOptionsOf(synthetic, estimate);
  LocalizeOptions options;
  options.registration.sigma_px = synthetic.view_pixel_sigma_px;
  std::map<std::string, Pool> pools;
  int answers = 0, wrong = 0, unsolved = 0;
  const Usage at_first = UsageNow();
  for (int k = 0; k < redraws; ++k) {
    const auto add = [&](const std::string& name, int dof, double value) {
      pools[name].dof = dof;
      pools[name].values[k].push_back(value);
    };
    const SyntheticSite site = RedrawNoise(first, 1000 + static_cast<uint64_t>(k));
    ProgressSink progress;
    const LocalizeInput input = InputOf(site);
    RunReconstruction run = ReconstructRun(input, run_options, false, threads, 1, progress, {});
    const Localization result = Localize(input, std::move(run.reconstruction), {}, options, threads, 1, progress, {});
    if (!result.on_earth) {
      ++unsolved;
      for (size_t i = 0; verbose && i < result.references.size(); ++i) {
        std::printf("redraw %2d: %s: %s\n", k, input.references[i].name.c_str(),
                    result.references[i].registration.reason.c_str());
      }
      std::printf("redraw %d: not on the Earth: %s\n", k, result.earth_reason.c_str());
      continue;
    }
    // The run's frame is the first body pose; what is left of its scale is the fit's.
    const Rigid3d& truth = site.truth.world_from_body.front();
    Eigen::Matrix<double, 7, 1> fit;
    fit << LogSO3(result.geo.world_from_odom.rotation * truth.rotation.conjugate()),
        result.geo.world_from_odom.translation - truth.translation,
        result.geo.world_from_odom.scale * result.odometry_scale * site.truth.odometry_scale - 1;
    add("global fit", 7, Nees<7>(fit, result.geo.covariance));
    add("global fit, rotation", 3, Nees<3>(fit.head<3>(), result.geo.covariance.topLeftCorner<3, 3>()));
    add("global fit, translation", 3, Nees<3>(fit.segment<3>(3), result.geo.covariance.block<3, 3>(3, 3)));
    add("odometry scale", 1, std::pow(fit[6], 2) / result.geo.covariance(6, 6));
    for (size_t i = 0; i < result.references.size(); ++i) {
      const ReferenceAnswer& answer = result.references[i];
      if (answer.registration.status != AnswerStatus::kLocalized) {
        if (verbose)
          std::printf("redraw %2d: %s: %s\n", k, input.references[i].name.c_str(), answer.registration.reason.c_str());
        continue;
      }
      ++answers;
      const Vector6d e = answer.world.world_from_x.Minus(site.truth.world_from_pano[i]);
      wrong += e.tail<3>().norm() > 2;
      add("panoramas", 6, Nees<6>(e, answer.world.covariance));
      add("panorama " + std::to_string(i) + ", position", 3,
          Nees<3>(e.tail<3>(), answer.world.covariance.bottomRightCorner<3, 3>()));
    }
    for (const size_t i : {size_t{0}, result.cameras.size() / 3, 2 * result.cameras.size() / 3}) {
      const Vector6d e = result.cameras[i].world_from_x.Minus(site.WorldFromCam(site.images[i]));
      add("camera " + std::to_string(i) + ", position", 3,
          Nees<3>(e.tail<3>(), result.cameras[i].covariance.bottomRightCorner<3, 3>()));
    }
    if (verbose) {
      std::printf("redraw %2d: scale error %+.5f +- %.5f, fit %.1f (7)\n", k, fit[6],
                  std::sqrt(result.geo.covariance(6, 6)), pools["global fit"].values[k].front());
      std::fflush(stdout);
    }
  }
  std::printf(
      "%d redraws of a %s of %.0f m: %d of %zu panoramas answered, %d wrong by more than 2 m, %d not on the Earth\n",
      redraws, synthetic.path.c_str(), synthetic.length_m, answers,
      first.panoramas.size() * static_cast<size_t>(redraws), wrong, unsolved);
  for (const auto& [name, pool] : pools) pool.Print(name);
  const Usage at_last = UsageNow();
  std::printf("%zu images: peak memory %.0f MiB, %.0f MiB of it with the site alone; %.0f CPU-seconds a redraw\n",
              first.images.size(), at_last.peak_mib, at_first.peak_mib, (at_last.cpu_s - at_first.cpu_s) / redraws);
  return 0;
}

}  // namespace
}  // namespace trigpoint

int main(int argc, char** argv) {
  try {
    return trigpoint::Main(argc, argv);
  } catch (const trigpoint::Error& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return e.ExitCode();
  }
}

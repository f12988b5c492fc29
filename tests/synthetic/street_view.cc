#include "tests/synthetic/street_view.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>

#include "calib/base/error.h"
#include "calib/base/parallel.h"
#include "calib/estimation/random.h"
#include "datasets/io/image.h"
#include "datasets/io/site.h"
#include "tests/synthetic/site_writer.h"
#include "tests/synthetic/texture.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
constexpr double kPi = std::numbers::pi;

void CopyTree(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::create_directories(to.parent_path(), error);
  fs::copy(from, to, fs::copy_options::recursive | fs::copy_options::overwrite_existing, error);
  if (error) throw IoError(to.string() + ": cannot be copied from " + from.string() + ": " + error.message());
}

// Stations are matched to the truth by their number: S57 is 57.
int StationNumber(const std::string& station) {
  std::string digits;
  for (const char c : station) {
    if (c >= '0' && c <= '9') digits += c;
  }
  if (digits.empty() || digits.size() > 8)
    throw InputError("station '" + station + "' has no number to find its truth by");
  return std::stoi(digits);
}

int RowOf(double elevation_deg, int height) {
  return std::clamp(static_cast<int>(std::lround((0.5 - elevation_deg / 180) * height)), 0, height);
}

void HideBelow(cv::Mat* panorama, double below_deg, bool roof) {
  const int w = panorama->cols, h = panorama->rows, top = RowOf(-below_deg, h);
  if (!roof) {
    panorama->rowRange(top, h).setTo(cv::Scalar(0, 0, 0));
    return;
  }
  // The vehicle's roof: reaches highest ahead and behind, with rails, a mast and dirt; the same in all pictures.
  const cv::Mat dirt = ValueNoise({w, h}, w / 32.0, 6, 7);
  for (int x = 0; x < w; ++x) {
    const double along = std::abs(std::cos(2 * kPi * (x + 0.5) / w));
    const int edge = top + static_cast<int>((1 - along) * (h - top) * 0.35);
    for (int y = edge; y < h; ++y) {
      const double grey = (y - edge < h / 200 + 1 ? 60 : 165) + 25 * dirt.at<float>(y, x);
      panorama->at<cv::Vec3b>(y, x) = cv::Vec3b::all(cv::saturate_cast<uchar>(grey));
    }
  }
  for (const double rail : {0.2, 0.3, 0.7, 0.8}) {
    cv::line(*panorama, {static_cast<int>(rail * w), top + (h - top) / 3}, {static_cast<int>(rail * w), h},
             cv::Scalar(40, 40, 40), std::max(1, w / 300), cv::LINE_AA);
  }
}

void DrawLogo(cv::Mat* panorama, double below_deg) {
  const int w = panorama->cols, h = panorama->rows;
  const int bottom = RowOf(-below_deg, h), top = RowOf(-below_deg + 4, h);
  cv::Mat strip = panorama->rowRange(top, bottom);
  if (strip.empty()) return;
  cv::Mat dark = strip * 0.45;
  dark.copyTo(strip);
  for (int i = 0; i < 8; ++i) {
    cv::putText(strip, "(c) Example Imagery", {w / 8 * i + w / 80, strip.rows * 3 / 4}, cv::FONT_HERSHEY_DUPLEX,
                strip.rows / 45.0, cv::Scalar(245, 245, 245), std::max(1, strip.rows / 24), cv::LINE_AA);
  }
}

// Poses by station number: `station tx ty tz qx qy qz qw`.
std::map<int, Rigid3d> ReadTruth(const fs::path& file) {
  std::map<int, Rigid3d> poses;
  std::ifstream in(file);
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    int station = 0;
    Eigen::Vector3d t;
    Eigen::Quaterniond q;
    if (!(fields >> station >> t.x() >> t.y() >> t.z() >> q.x() >> q.y() >> q.z() >> q.w())) {
      throw InputError(fmt::format("{}:{}: expected a station number and seven values", file.string(), number));
    }
    poses[station] = Rigid3d(q, t);
  }
  return poses;
}

}  // namespace

std::vector<std::string> StreetViewOptions::Check() const {
  std::vector<std::string> problems = CheckRanges(*this);
  if (hidden_by != "black" && hidden_by != "roof" && hidden_by != "both") {
    problems.push_back("option hidden_by is '" + hidden_by + "', expected black, roof or both");
  }
  if (position_p90_m <= position_median_m) problems.push_back("option position_p90_m must exceed position_median_m");
  return problems;
}

cv::Mat RotatePanorama(const cv::Mat& panorama, const Eigen::Quaterniond& old_from_new) {
  const Camera camera = Camera::Equirectangular(panorama.cols, panorama.rows);
  const Eigen::Matrix3d rotation = old_from_new.toRotationMatrix();
  // A border of a few columns beyond the seam, so that interpolation never sees it.
  constexpr int kBorder = 8;
  cv::Mat padded;
  cv::copyMakeBorder(panorama, padded, 0, 0, kBorder, kBorder, cv::BORDER_WRAP);
  cv::Mat map(panorama.size(), CV_32FC2), turned;
  ParallelFor(panorama.rows, 0, CancelToken(), [&](int64_t y) {
    cv::Vec2f* row = map.ptr<cv::Vec2f>(static_cast<int>(y));
    for (int x = 0; x < panorama.cols; ++x) {
      const Eigen::Vector2d p =
          *camera.Project(rotation * *camera.Unproject({static_cast<double>(x), static_cast<double>(y)}));
      row[x] = {static_cast<float>(p.x() + kBorder), static_cast<float>(p.y())};
    }
  });
  cv::remap(padded, turned, map, cv::noArray(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  return turned;
}

void MakeStreetViewSite(const fs::path& site_dir, const fs::path& truth, const fs::path& out, const fs::path& out_truth,
                        const StreetViewOptions& options, uint64_t seed, ProgressSink& progress,
                        const CancelToken& cancel) {
  std::string problems;
  for (const std::string& problem : options.Check()) problems += (problems.empty() ? "" : "; ") + problem;
  if (!problems.empty()) throw OptionError("street view: " + problems);
  const Site site = ReadSite(site_dir);
  if (!site.origin)
    throw InputError(site_dir.string() + "/origin.json: expected, the truth's frame is not known without");
  const LocalFrame frame(*site.origin);

  std::vector<std::string> truth_files;
  for (const fs::directory_entry& entry : fs::directory_iterator(truth)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind("panoramas", 0) == 0 && entry.path().extension() == ".tum") truth_files.push_back(name);
  }
  if (truth_files.empty()) throw InputError(truth.string() + ": no panoramas.tum, nothing is known of the panoramas");
  std::sort(truth_files.begin(), truth_files.end());

  CopyTree(truth, out_truth);
  for (const Run& run : site.runs) CopyTree(run.dir, out / fs::relative(run.dir, site_dir));
  CopyTree(site_dir / "origin.json", out / "origin.json");

  std::vector<const Reference*> panoramas;
  for (const Reference& reference : site.references) {
    if (reference.kind == ReferenceKind::kPanorama) panoramas.push_back(&reference);
  }
  Random random(Random(seed).Next());
  std::vector<size_t> order(panoramas.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  random.Shuffle(order);
  std::map<size_t, bool> outlier;
  for (size_t i = 0; i < std::min(order.size(), static_cast<size_t>(options.outliers)); ++i) outlier[order[i]] = true;
  const double log_sigma = std::log(options.position_p90_m / options.position_median_m) / 1.2815515655446004;

  std::map<std::string, std::map<int, Rigid3d>> poses;
  for (const std::string& file : truth_files) poses[file] = ReadTruth(truth / file);
  const std::map<int, Rigid3d>& first = poses[truth_files.front()];
  std::map<int, Eigen::Quaterniond> old_from_new;
  std::vector<PanoramaRow> rows;
  progress.Begin("street view panoramas", static_cast<int64_t>(panoramas.size()));
  for (size_t i = 0; i < panoramas.size(); ++i) {
    cancel.ThrowIfCancelled();
    const Reference& reference = *panoramas[i];
    const int number = StationNumber(reference.station);
    const auto pose = first.find(number);
    if (pose == first.end()) {
      throw InputError(fmt::format("{}: no pose of station {}", (truth / truth_files.front()).string(), number));
    }
    Attitude attitude = AttitudeOf(pose->second.rotation);
    attitude.roll_rad = 0;
    attitude.pitch_rad = random.Uniform(-1, 1) * options.max_pitch_deg * kDegToRad;
    const Eigen::Quaterniond world_from_new = WorldFromCamRotation(attitude);
    old_from_new[number] = pose->second.rotation.conjugate() * world_from_new;

    cv::Mat picture = RotatePanorama(LoadPicture(reference.files.front(), false), old_from_new[number]);
    const bool roof = options.hidden_by == "roof" || (options.hidden_by == "both" && i % 2 == 1);
    if (options.hidden_below_deg < 90) HideBelow(&picture, options.hidden_below_deg, roof);
    if (options.logo) DrawLogo(&picture, options.hidden_below_deg);
    PanoramaRow row;
    row.file = "panoramas/" + reference.files.front().stem().string() + ".jpg";
    row.station = reference.station;
    WritePicture(out / row.file, picture);

    const double length =
        outlier[i] ? options.outlier_m : options.position_median_m * std::exp(log_sigma * random.Normal());
    const double direction = random.Uniform(0, 2 * kPi);
    GeoTag& g = row.geotag;
    g.has_position = g.has_heading = g.has_tilt = true;
    g.position = frame.GeodeticFromEnu(pose->second.translation +
                                       length * Eigen::Vector3d(std::cos(direction), std::sin(direction), 0));
    g.sigma_h_m = options.sigma_h_m;
    g.attitude.heading_rad = attitude.heading_rad + options.heading_sigma_deg * kDegToRad * random.Normal();
    g.sigma_heading_rad = std::max(options.heading_sigma_deg, 0.01) * kDegToRad;
    // Said to be level; the claim's sigma is that of the uniform distribution.
    g.sigma_tilt_rad = std::max(options.max_pitch_deg / std::sqrt(3.0), 0.1) * kDegToRad;
    rows.push_back(row);
    progress.Advance(1);
  }
  WritePanoramasCsv(out / "panoramas.csv", rows);
  for (const auto& [file, table] : poses) {
    std::string text = "# station tx ty tz qx qy qz qw: optical frame at the image centre, in site ENU\n";
    for (const auto& [number, turn] : old_from_new) {
      const auto pose = table.find(number);
      if (pose == table.end()) continue;
      const Eigen::Vector3d& t = pose->second.translation;
      const Eigen::Quaterniond q = pose->second.rotation * turn;
      text += fmt::format("{} {:.6f} {:.6f} {:.6f} {:.9f} {:.9f} {:.9f} {:.9f}\n", number, t.x(), t.y(), t.z(), q.x(),
                          q.y(), q.z(), q.w());
    }
    WriteText(out_truth / file, text);
  }
}

void MakeMirroredSite(const fs::path& site_dir, const std::string& run_name, const fs::path& out,
                      ProgressSink& progress, const CancelToken& cancel) {
  CopyTree(site_dir, out);
  const fs::path run_dir = out / "runs" / run_name;
  const Run run = ReadRun(run_dir, out);
  if (run.config.mirrored) throw InputError(run_dir.string() + ": is mirrored already");
  progress.Begin("mirrored images", static_cast<int64_t>(run.images.size()));
  ParallelFor(static_cast<int64_t>(run.images.size()), 0, cancel, [&](int64_t i) {
    cv::Mat picture = cv::imread(run.images[i].path.string(), cv::IMREAD_UNCHANGED), flipped;
    if (picture.empty()) throw InputError(run.images[i].path.string() + ": is not a picture");
    cv::flip(picture, flipped, 1);
    WritePicture(run.images[i].path, flipped);
    progress.Advance(1);
  });
  std::string text;
  const fs::path yaml = run_dir / "run.yaml";
  if (fs::exists(yaml)) {
    std::ifstream in(yaml, std::ios::binary);
    text.assign(std::istreambuf_iterator<char>(in), {});
    if (!text.empty() && text.back() != '\n') text += '\n';
  }
  WriteText(yaml, text + "mirrored: true\n");
}

}  // namespace trigpoint

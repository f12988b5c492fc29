// Panoramas stitched of hand-held photos.
#include <fmt/format.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "eval/report/chapters.h"

namespace trigpoint {
namespace {

constexpr int kWidth = 1200;  // px of a picture

// Smaller, as the page holds it; nothing if the file cannot be read.
std::optional<Picture> Shown(const std::filesystem::path& file) {
  const cv::Mat whole = cv::imread(file.string(), cv::IMREAD_COLOR);
  if (whole.empty()) return std::nullopt;
  cv::Mat small;
  cv::resize(whole, small, {kWidth, std::max(1, kWidth * whole.rows / whole.cols)}, 0, 0, cv::INTER_AREA);
  std::vector<uchar> bytes;
  cv::imencode(".jpg", small, bytes, {cv::IMWRITE_JPEG_QUALITY, 80});
  return Picture{std::string(bytes.begin(), bytes.end()), true, small.cols, small.rows};
}

}  // namespace

void AddStitched(const ChapterContext& c, bool images, std::vector<Block>* blocks) {
  if (c.data.stitched.empty()) return;
  blocks->push_back(Heading{2, "Stitched panoramas", "stitched"});
  Table table{"stitched",
              "Panoramas of hand-held photos. Residual: root mean square over matched features; spread: of the photos' "
              "centres about their mean; level: 1 sigma of pitch and roll.",
              {{"set"},
               {"photos", true},
               {"used", true},
               {"sphere covered (%)", true},
               {"residual (px)", true},
               {"spread (" + c.unit.name + ")", true},
               {"level (deg)", true},
               {"full turn"}},
              {}};
  for (const StitchedSet& set : c.data.stitched) {
    const auto number = [&](const char* key, int decimals, double factor) {
      const auto v = At(set.metrics, {key});
      return NumberCell(v ? std::optional<double>(factor * *v) : std::nullopt, decimals);
    };
    table.rows.push_back({{set.name},
                          number("photos", 0, 1),
                          number("placed", 0, 1),
                          number("covered_share", 1, 100),
                          number("rms_px", 2, 1),
                          number("centres_rms_m", 3, 1 / c.unit.metres),
                          number("level_sigma_deg", 2, 1),
                          {FlagAt(set.metrics, "full_turn") ? "yes" : "no"}});
  }
  blocks->push_back(table);
  if (!images) return;
  for (size_t i = 0; i < c.data.stitched.size(); ++i) {
    const StitchedSet& set = c.data.stitched[i];
    if (set.panorama.empty()) continue;
    if (auto picture = Shown(set.panorama)) {
      blocks->push_back(Figure{fmt::format("stitched_{}", i + 1),
                               "Panorama of the photo set " + set.name + ", equirectangular.", std::move(*picture),
                               false, c.data.stitched.size() > 1});
    }
  }
}

}  // namespace trigpoint

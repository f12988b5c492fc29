#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/base/counted.h"
#include "eval/report/chapters.h"
#include "eval/report/charts.h"
#include "eval/statistics/statistics.h"

namespace trigpoint {
namespace {

constexpr size_t kChartRuns = 7;  // outlines in one histogram

std::optional<double> ResidualOf(const RunData::PointQuality& point) { return point.residual_px; }
std::optional<double> TrackLengthOf(const RunData::PointQuality& point) { return point.track_length; }

// The values of the points that have one.
Sample SampleOf(const RunData& run, std::optional<double> (*value)(const RunData::PointQuality&)) {
  Sample sample{ResultNameOf(run.run, run.variant), {}, {}};
  for (const RunData::PointQuality& point : run.points) {
    const std::optional<double> of_point = value(point);
    if (!of_point) continue;
    sample.values.push_back(*of_point);
    sample.objects.push_back(point.object);
  }
  return sample;
}

void AddRunTable(const ChapterContext& c, std::vector<Block>* blocks) {
  Table table{"runs",
              "Each run. Scale: of the odometry, estimated; 1 sigma. Residual: median over points of "
              "their mean reprojection "
              "error.",
              {{"run"},
               {"images", true},
               {"answers", true, "no reference was asked for"},
               {"refused", true, "no reference was asked for"},
               {"no match", true, "no reference was asked for"},
               {"georeferenced"},
               {"odometry scale"},
               {"points", true},
               {"residual (px)", true}},
              {}};
  for (const RunData& run : c.data.runs) {
    int localized = 0, rejected = 0, unmatched = 0;
    for (const RunData::Answer& a : run.answers)
      ++(a.status == "localized" ? localized : a.status == "rejected" ? rejected : unmatched);
    const nlohmann::json& metrics = ObjectAt(run.manifest, "metrics");
    const auto number = [&](const char* key) { return At(metrics, {key}); };
    const bool on_earth = FlagAt(metrics, "on_earth");
    std::string scale;
    if (number("odometry_scale")) {
      scale = fmt::format("{:.4f}", *number("odometry_scale"));
      if (const auto sigma = number("odometry_scale_sigma")) scale += fmt::format(" ± {:.4f}", *sigma);
    }
    TableCell residual;
    if (const Sample residuals = SampleOf(run, ResidualOf); !residuals.values.empty()) {
      const double median = Quantile(residuals.values, 0.5);
      residual = {fmt::format("{:.2f}", median), median};
    }
    const auto answers = [&](int count, Tone tone) -> TableCell {
      if (run.answers.empty()) return {};
      return {std::to_string(count), count, tone};
    };
    table.rows.push_back({{c.RunName(run.run, run.variant)},
                          NumberCell(number("images"), 0),
                          answers(localized, localized == 0 ? Tone::kBad : Tone::kPlain),
                          answers(rejected, Tone::kPlain),
                          answers(unmatched, Tone::kPlain),
                          {on_earth          ? "from " + TextAt(metrics, "earth_source")
                           : metrics.empty() ? "unknown"
                                             : "none: " + TextAt(metrics, "earth_reason")},
                          {scale},
                          NumberCell(number("tracks"), 0),
                          residual});
  }
  blocks->push_back(table);
}

void AddHistograms(const ChapterContext& c, std::vector<Block>* blocks) {
  std::vector<Sample> residuals, lengths;
  for (const RunData& run : c.data.runs) {
    if (Sample sample = SampleOf(run, ResidualOf); !sample.values.empty()) residuals.push_back(std::move(sample));
    if (Sample sample = SampleOf(run, TrackLengthOf); !sample.values.empty()) lengths.push_back(std::move(sample));
  }
  const auto pool = [](std::vector<Sample>* samples) {
    if (samples->size() <= kChartRuns) return;
    Sample all{fmt::format("{} results together", samples->size()), {}, {}};
    for (const Sample& s : *samples) {
      all.values.insert(all.values.end(), s.values.begin(), s.values.end());
      all.objects.insert(all.objects.end(), s.objects.begin(), s.objects.end());
    }
    *samples = {std::move(all)};
  };
  pool(&residuals), pool(&lengths);
  if (!residuals.empty()) {
    std::vector<double> everything;
    for (const Sample& s : residuals) everything.insert(everything.end(), s.values.begin(), s.values.end());
    const double limit = std::max(0.5, std::ceil(2 * Quantile(everything, 0.98)) / 2);
    blocks->push_back(
        Figure{"residuals",
               "Residuals of the runs' own points: mean reprojection error of each point over its images (px); the "
               "last bin holds "
               "everything beyond. They measure how well images and points agree, not how accurate a position is.",
               HistogramChart(residuals, 40, limit, "mean reprojection error of a point (px)", nullptr, kHalfWidth),
               false, true});
  }
  if (!lengths.empty()) {
    std::vector<double> everything;
    for (const Sample& s : lengths) everything.insert(everything.end(), s.values.begin(), s.values.end());
    const double limit = std::max(8.0, std::ceil(Quantile(everything, 0.98)));
    blocks->push_back(Figure{
        "track_lengths", "Track lengths: the number of images that see a point; the last bin holds everything beyond.",
        HistogramChart(lengths, std::min(40, static_cast<int>(limit)), limit, "images that see a point", nullptr,
                       kHalfWidth),
        false, true});
  }
}

// Where a run's images and points agree less than elsewhere.
void AddResidualsOverTime(const ChapterContext& c, std::vector<Block>* blocks) {
  constexpr size_t kMostPoints = 400;  // of a line
  std::vector<Series> series;
  for (const RunData& run : c.data.runs) {
    if (run.image_residuals.empty() || series.size() == kChartRuns) continue;
    Series& s = series.emplace_back(Series{c.RunName(run.run, run.variant), {}});
    const size_t step = run.image_residuals.size() / kMostPoints + 1;
    // Of images that fall together the worst one is shown.
    for (size_t i = 0; i < run.image_residuals.size(); i += step) {
      const RunData::ImageResidual* worst = &run.image_residuals[i];
      for (size_t k = i; k < std::min(i + step, run.image_residuals.size()); ++k) {
        if (run.image_residuals[k].mean_px > worst->mean_px) worst = &run.image_residuals[k];
      }
      s.points.push_back({worst->time_s, worst->mean_px, {}, {}, worst->object});
    }
  }
  if (series.empty()) return;
  blocks->push_back(
      Figure{"residuals_over_time",
             "Residuals over time: of each image the mean, over the points it sees, of their reprojection "
             "errors (px).",
             LineChart(series, "time since the run began (s)", "mean reprojection error (px)", false)});
}

// A dot a tag and source: which tags' corners fit their images badly.
void AddTagResiduals(const ChapterContext& c, std::vector<Block>* blocks) {
  constexpr size_t kMostTags = 40;
  std::map<int, double> worst;
  for (const TagLine& tag : c.data.tags) {
    if (tag.rms_px) worst[tag.id] = std::max(worst[tag.id], *tag.rms_px);
  }
  if (worst.empty()) return;
  std::vector<std::pair<int, double>> tags(worst.begin(), worst.end());
  std::string which = "every tag";
  if (tags.size() > kMostTags) {
    which = fmt::format("the {} tags with the largest of {}", kMostTags, tags.size());
    std::stable_sort(tags.begin(), tags.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
    tags.resize(kMostTags);
  }
  std::vector<std::string> names;
  std::map<int, int> column;
  for (const auto& [id, rms] : tags) {
    column[id] = static_cast<int>(names.size());
    names.push_back(std::to_string(id));
  }
  std::vector<DotSeries> series;
  for (const TagLine& tag : c.data.tags) {
    if (!tag.rms_px || column.count(tag.id) == 0) continue;
    const auto of = std::find_if(series.begin(), series.end(), [&](const auto& s) { return s.name == tag.source; });
    DotSeries& s = of == series.end() ? series.emplace_back(DotSeries{tag.source, {}}) : *of;
    s.dots.emplace_back(column[tag.id], *tag.rms_px);
  }
  blocks->push_back(Figure{"tag_residuals",
                           "Residuals of tags: root mean square over the corners of a tag in its images (px, "
                           "logarithmic); " +
                               which + ".",
                           DotChart(names, series, "corner residual (px)", "tag")});
}

void AddTags(const ChapterContext& c, std::vector<Block>* blocks) {
  if (c.data.tags.empty()) return;
  const std::string u = " (" + c.unit.name + ")";
  Table table{"tags",
              "Tags: edge of the black square; sigma: 1 sigma of the largest axis of its centre, in the map's frame "
              "(survey: site ENU; cameras of "
              "a run: that run's own frame). The residual of corners measures how well images agree, not how accurate "
              "the position is.",
              {{"tag", true},
               {"source"},
               {"role"},
               {"status"},
               {"edge" + u, true},
               {"sigma" + u, true},
               {"corner residual (px)", true},
               {"images", true},
               {"runs", true}},
              {}};
  for (const TagLine& t : c.data.tags) {
    table.rows.push_back({{std::to_string(t.id), t.id},
                          {t.source},
                          {t.role},
                          {t.status, {}, t.status == "ok" || t.status.empty() ? Tone::kPlain : Tone::kWarning},
                          c.LengthCell(t.size_m > 0 ? std::optional<double>(t.size_m) : std::nullopt),
                          c.LengthCell(t.sigma_m, 4),
                          NumberCell(t.rms_px, 2),
                          {std::to_string(t.images), t.images},
                          {std::to_string(t.runs), t.runs}});
  }
  blocks->push_back(FoldBegin{fmt::format("Tags ({})", c.data.tags.size())});
  blocks->push_back(table);
  blocks->push_back(FoldEnd{});
}

}  // namespace

void AddRuns(const ChapterContext& c, std::vector<Block>* blocks) {
  blocks->push_back(Heading{2, "Runs", "runs"});
  if (c.data.runs.empty()) {
    blocks->push_back(Paragraph{"No run is localized."});
  } else {
    AddRunTable(c, blocks);
    AddHistograms(c, blocks);
    AddResidualsOverTime(c, blocks);
  }
  AddTagResiduals(c, blocks);
  AddTags(c, blocks);
}

}  // namespace trigpoint

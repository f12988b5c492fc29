#include "app/desktop/charts.h"

#include "app/desktop/overview.h"
#include "app/desktop/report_text.h"
#include "eval/report/chapters.h"

namespace trigpoint {

namespace {

constexpr double kScale = 2;  // pixels a unit of the drawing

// A caption's beginning: what is drawn, before how to read it.
std::string TitleOf(const std::string& caption) {
  std::string title = caption.substr(0, caption.find_first_of(":;"));
  for (const std::string& end : {std::string(", by direction"), std::string(". ")}) {
    title = title.substr(0, title.find(end));
  }
  return title;
}

}  // namespace

PaintedDrawing PaintDrawing(const Drawing& drawing, double scale) {
  PaintedDrawing painted{PngOf(InWindowLanguage(drawing), scale), drawing.spots, drawing.groups};
  for (Spot& spot : painted.spots) spot.x *= scale, spot.y *= scale;
  for (SpotGroup& g : painted.groups) g.x *= scale, g.y *= scale, g.width *= scale, g.height *= scale;
  return painted;
}

std::vector<NamedChart> LoadCharts(const Snapshot& snapshot, const DisplayUnit& unit) {
  const ReportInput input = ReportInputOf(snapshot, true);
  ProgressSink progress;
  const ReportData data = ReadReportData(input, progress, {});
  ChapterContext context{input, data, unit, {}, {}};
  std::vector<Block> blocks;
  AddAccuracy(context, &blocks);
  AddConsistency(context, &blocks);
  AddCameras(context, &blocks);
  AddSurvey(context, &blocks);
  AddRuns(context, &blocks);
  std::vector<NamedChart> charts;
  for (const Block& block : blocks) {
    const auto* figure = std::get_if<Figure>(&block);
    const Drawing* drawing = figure == nullptr ? nullptr : std::get_if<Drawing>(&figure->content);
    if (drawing == nullptr) continue;
    charts.push_back({figure->name, TitleOf(figure->caption), figure->caption, PaintDrawing(*drawing, kScale)});
  }
  return charts;
}

}  // namespace trigpoint

#include "eval/report/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "eval/report/chapters.h"
#include "eval/report/document.h"
#include "eval/report/match_pictures.h"
#include "eval/report/scenes.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

// Keys of the cells: those with errors, worst first, then answers that nothing is known about.
std::vector<std::string> CellsWorstFirst(const ChapterContext& c) {
  std::vector<std::string> cells;
  std::set<std::string> listed;
  const auto list = [&](const std::string& key) {
    if (listed.insert(key).second) cells.push_back(key);
  };
  for (const ErrorRecord* e : WorstFirst(c.data)) list(CellKey(e->run, e->variant, e->panorama));
  for (const RunData& run : c.data.runs) {
    for (const RunData::Answer& a : run.answers) {
      if (a.status == "localized") list(CellKey(run.run, run.variant, a.panorama));
    }
  }
  return cells;
}

// Pictures of matches within the budget, the worst cells first; drawn in the order of runs and panoramas, so that each
// file is opened once.
void DrawMatches(ChapterContext* c, const ReportOptions& options, std::vector<std::string>* notes,
                 ReportSummary* summary, ProgressSink& progress, const CancelToken& cancel) {
  const std::vector<std::string> cells = CellsWorstFirst(*c);
  const size_t most = std::min(cells.size(), static_cast<size_t>(options.max_pictures));
  const std::set<std::string> chosen(cells.begin(), cells.begin() + static_cast<ptrdiff_t>(most));
  summary->match_pictures_left_out = static_cast<int>(cells.size() - chosen.size());
  progress.Begin("pictures of matches", static_cast<int64_t>(chosen.size()));
  double bytes = 0;
  bool without = false;
  for (const RunData& run : c->data.runs) {
    std::vector<std::string> wanted;
    for (const RunData::Answer& a : run.answers) {
      if (chosen.count(CellKey(run.run, run.variant, a.panorama)) > 0 && a.status == "localized")
        wanted.push_back(a.panorama);
    }
    if (wanted.empty()) continue;
    const std::string result = ResultNameOf(run.run, run.variant);
    try {
      MatchPictures pictures(*c->input.project, run.run, result, c->input.views);
      without = without || !pictures.HasMatches();
      for (const std::string& panorama : wanted) {
        cancel.ThrowIfCancelled();
        progress.Advance(1);
        if (!pictures.Has(panorama)) continue;
        try {
          MatchPicture m = pictures.Draw(panorama);
          bytes += static_cast<double>(m.picture.bytes.size());
          if (bytes > options.pictures_mb * 1e6) {
            ++summary->match_pictures_left_out;
            continue;
          }
          const std::string name = fmt::format("matches_{:03}", c->match_figures.size() + 1);
          c->match_figures[CellKey(run.run, run.variant, panorama)] =
              Figure{name, result + ": " + m.caption, std::move(m.picture), true};
        } catch (const Cancelled&) {
          throw;
        } catch (const std::exception& e) {
          notes->push_back("the matches of " + panorama + " in " + result + " cannot be drawn: " + e.what());
        }
      }
    } catch (const Cancelled&) {
      throw;
    } catch (const std::exception& e) {
      notes->push_back("matches of " + result + ": " + e.what());
    }
  }
  if (without)
    notes->push_back(
        "some results of localize are of a version that kept no matches; localize again to see them drawn");
  summary->match_pictures = static_cast<int>(c->match_figures.size());
}

void WriteFigures(const Document& document, const fs::path& out, ReportSummary* summary) {
  std::set<std::string> written;
  for (const Block& block : document.blocks) {
    const auto* figure = std::get_if<Figure>(&block);
    if (figure == nullptr || figure->name.empty() || !written.insert(figure->name).second) continue;
    std::string png;
    if (const auto* drawing = std::get_if<Drawing>(&figure->content)) {
      png = PngOf(*drawing, 2);
      WriteFileAtomically(out / "figures" / (figure->name + ".svg"), SvgFileOf(*drawing, figure->caption));
    } else {
      const Picture& picture = std::get<Picture>(figure->content);
      png = picture.bytes;
      if (picture.jpeg) {
        const cv::Mat coded(1, static_cast<int>(png.size()), CV_8U, png.data());
        std::vector<uchar> bytes;
        cv::imencode(".png", cv::imdecode(coded, cv::IMREAD_COLOR), bytes);
        png.assign(bytes.begin(), bytes.end());
      }
    }
    WriteFileAtomically(out / "figures" / (figure->name + ".png"), png);
    ++summary->figures;
  }
}

void AddChapters(const ChapterContext& context, bool images, Scenes scenes, std::vector<Block>* blocks) {
  AddVerdict(context, std::move(scenes.plan), blocks);
  if (context.input.project->site().runs.empty()) {  // photos only: chapters about runs would be empty
    AddStitched(context, images, blocks);
    AddCalibrations(context, blocks);
    AddProvenance(context, blocks);
    return;
  }
  AddAccuracy(context, blocks);
  AddConsistency(context, blocks);
  AddSurvey(context, blocks);
  AddCameras(context, blocks);
  AddRuns(context, blocks);
  blocks->push_back(Heading{2, "Scene", "map"});
  if (scenes.pictures.size() > 1) {
    blocks->push_back(Paragraph{
        "The site in three dimensions as the results have it: from above, from the side, and single stations, "
        "those with the largest differences first."});
  }
  blocks->insert(blocks->end(), std::make_move_iterator(scenes.pictures.begin()),
                 std::make_move_iterator(scenes.pictures.end()));
  AddStations(context, blocks);
  AddStitched(context, images, blocks);
  AddCalibrations(context, blocks);
  AddCrosschecks(context, blocks);
  AddProvenance(context, blocks);
}

// Rows of a table below those of another of its name: columns of the same name are one.
void Append(const Table& table, const std::string& heading, Table* all) {
  std::vector<size_t> place;
  for (const TableColumn& column : table.columns) {
    const auto at = std::find_if(all->columns.begin() + 1, all->columns.end(),
                                 [&](const TableColumn& c) { return c.name == column.name; });
    place.push_back(static_cast<size_t>(at - all->columns.begin()));
    if (at == all->columns.end()) all->columns.push_back(column);
  }
  for (const auto& row : table.rows) {
    std::vector<TableCell> cells(all->columns.size());
    cells[0] = {heading};
    for (size_t k = 0; k < std::min(row.size(), place.size()); ++k) cells[place[k]] = row[k];
    all->rows.push_back(std::move(cells));
  }
}

// Every number of the pages by name: the tables, those of one name put together with the headings they stand under,
// and as `statements` what stands in facts, sentences and captions.
std::vector<Table> TablesOf(const Document& document) {
  std::map<std::string, int> count;
  for (const Block& block : document.blocks) {
    if (const auto* table = std::get_if<Table>(&block)) ++count[table->name];
  }
  std::vector<Table> tables;
  Table statements{"statements", "facts, sentences and captions of the report", {{"under"}, {"what"}, {"text"}}, {}};
  std::string heading = document.title;
  const auto state = [&](const std::string& what, const std::string& text) {
    if (!text.empty()) statements.rows.push_back({{heading}, {what}, {text}});
  };
  state("title", document.title);
  state("title", document.subtitle);
  for (const Block& block : document.blocks) {
    if (const auto* h = std::get_if<Heading>(&block)) {
      heading = h->text;
      state("heading", h->text);
    } else if (const auto* paragraph = std::get_if<Paragraph>(&block)) {
      state("sentence", paragraph->text);
    } else if (const auto* facts = std::get_if<Facts>(&block)) {
      for (const Fact& fact : facts->facts) {
        state(fact.label, fact.value);
        state(fact.label + ", more", fact.detail);
      }
    } else if (const auto* figure = std::get_if<Figure>(&block)) {
      state("figure " + figure->name, figure->caption);
    } else if (const auto* fold = std::get_if<FoldBegin>(&block)) {
      state("fold", fold->title);
    } else if (const auto* table = std::get_if<Table>(&block)) {
      state("table " + table->name, table->caption);
      if (table->name.empty()) continue;
      if (count[table->name] == 1) {
        tables.push_back(*table);
        continue;
      }
      auto all = std::find_if(tables.begin(), tables.end(), [&](const Table& t) { return t.name == table->name; });
      if (all == tables.end()) all = tables.insert(tables.end(), Table{table->name, table->caption, {{"under"}}, {}});
      Append(*table, heading, &*all);
    }
  }
  tables.push_back(std::move(statements));
  return tables;
}

nlohmann::json JsonOf(const Document& document, const std::vector<Table>& named, const ReportData& data) {
  nlohmann::json tables = nlohmann::json::object(), figures = nlohmann::json::array();
  for (const Table& table : named) {
    nlohmann::json rows = nlohmann::json::array();
    for (const auto& row : table.rows) {
      nlohmann::json cells = nlohmann::json::array();
      for (const TableCell& cell : row) cells.push_back(CleanText(cell.text));
      rows.push_back(std::move(cells));
    }
    nlohmann::json columns = nlohmann::json::array();
    for (const TableColumn& column : table.columns) columns.push_back(CleanText(column.name));
    tables[table.name] = {{"caption", CleanText(table.caption)}, {"columns", columns}, {"rows", rows}};
  }
  for (const Block& block : document.blocks) {
    if (const auto* figure = std::get_if<Figure>(&block))
      figures.push_back({{"file", "figures/" + figure->name + ".png"}, {"caption", CleanText(figure->caption)}});
  }
  nlohmann::json evaluations = nlohmann::json::object();
  for (const VariantData& v : data.variants) evaluations[v.variant.empty() ? "first" : v.variant] = v.summary;
  return {{"schema", "trigpoint report 1"},
          {"title", CleanText(document.title)},
          {"newest_input", document.date},
          {"tables", tables},
          {"figures", figures},
          {"evaluations", evaluations},
          {"notes", data.notes}};
}

}  // namespace

std::vector<std::string> ReportOptions::Check() const {
  std::vector<std::string> problems = CheckRanges(*this);
  if (paper != "a4" && paper != "letter") problems.push_back("paper: expected a4 or letter, found '" + paper + "'");
  if (units != "m" && units != "ft" && units != "us-ft")
    problems.push_back("units: expected m, ft or us-ft, found '" + units + "'");
  return problems;
}

ReportSummary WriteReport(const ReportInput& input, const ReportOptions& options, const DisplayUnit& unit,
                          const fs::path& out, ProgressSink& progress, const CancelToken& cancel) {
  ReportSummary summary;
  ReportData data = ReadReportData(input, progress, cancel);
  ChapterContext context{input, data, unit, {}, {}};
  for (size_t i = 0; i < data.stations.size(); ++i)
    context.station_anchor[data.stations[i]] = fmt::format("station-{}", i + 1);
  Scenes scenes =
      DrawScenes(input, unit, options.images, options.scene_px, &data.notes, &summary.renderer, progress, cancel);
  if (options.images) {
    DrawMatches(&context, options, &data.notes, &summary, progress, cancel);
    if (summary.match_pictures_left_out > 0) {
      data.notes.push_back(fmt::format(
          "{} pictures of matches are drawn, of the worst cells first; {} are left out to keep the report small. All "
          "numbers are here.",
          summary.match_pictures, summary.match_pictures_left_out));
    }
  } else {
    data.notes.push_back("Photographs are left out on request (--no-images).");
  }
  progress.Begin("writing the report", 0);
  Document document;
  document.title = "Trigpoint report: " + input.project->name();
  document.date = data.newest;
  document.subtitle = data.newest.empty() ? "No results yet."
                                          : "From results up to " + data.newest + " (UTC). Lengths in " + unit.name +
                                                "; sigmas are 1 sigma, one standard deviation.";
  if (options.dated) document.subtitle += " Written " + UtcTimeText() + ".";
  document.footer = "Made by Trigpoint. All numbers are also in tables/, report.json and report.md beside this file.";
  AddChapters(context, options.images, std::move(scenes), &document.blocks);
  cancel.ThrowIfCancelled();

  const std::string html = HtmlOf(document);
  summary.html_bytes = html.size();
  WriteFileAtomically(out / "index.html", html);
  WriteFileAtomically(out / "report.md", MarkdownOf(document));
  const std::vector<Table> tables = TablesOf(document);
  WriteFileAtomically(out / "report.json", DumpJson(JsonOf(document, tables, data), 1) + "\n");
  for (const Table& table : tables) WriteFileAtomically(out / "tables" / (table.name + ".csv"), CsvOf(table));
  WriteFigures(document, out, &summary);
  cancel.ThrowIfCancelled();
  if (options.pdf) {
    progress.Begin("setting the pages", 0);
    WritePdf(document, options.paper == "letter" ? Paper::kLetter : Paper::kA4, (out / "report.pdf").string());
  }
  summary.notes = data.notes;
  return summary;
}

}  // namespace trigpoint

#include "eval/report/overview.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "datasets/io/text.h"
#include "eval/report/chapters.h"
#include "eval/report/charts.h"
#include "eval/report/document.h"
#include "eval/report/verdict.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

// A relative path as an address: what is neither letter, digit nor "-._~/" is written %XX. "./" keeps a name with a
// colon from being taken for a protocol.
std::string Address(const fs::path& path) {
  std::string address = "./";
  for (unsigned char c : path.generic_string()) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       std::string_view("-._~/").find(static_cast<char>(c)) != std::string_view::npos;
    address += plain ? std::string(1, static_cast<char>(c)) : fmt::format("%{:02X}", c);
  }
  return address;
}

nlohmann::json ReadJson(const fs::path& file) {
  try {
    return nlohmann::json::parse(ReadTextFile(file));
  } catch (const std::exception&) {
    return nlohmann::json();
  }
}

struct OverviewRow {
  std::string name;
  std::vector<TableCell> cells;
  bool evaluated = false;
  std::optional<double> median;  // 3D difference, in the unit
};

OverviewRow RowOf(const OverviewProject& project, const DisplayUnit& unit, const fs::path& file) {
  OverviewRow row;
  const fs::path dir = fs::absolute(project.dir).lexically_normal();
  const std::string folder = (dir.has_filename() ? dir : dir.parent_path()).filename().string();
  row.name = project.name.empty() ? folder : project.name;
  const std::string evaluate = project.variant.empty() ? "evaluate" : "evaluate@" + project.variant;
  ReportData data;
  data.variants.push_back({project.variant, ReadJson(dir / "results" / evaluate / "summary.json"), {}, {}});
  if (!data.variants.front().summary.is_object()) data.variants.front().summary = nlohmann::json::object();
  const Headline headline = FindHeadline(data);
  const nlohmann::json& g = headline.group;
  TableCell title{row.name};
  const fs::path report = dir / "results" / "report" / "index.html";
  if (fs::exists(report)) title.link = Address(fs::relative(report, fs::absolute(file).parent_path()));
  const bool bad = project.status == "failed";
  row.cells = {title, {project.status, {}, bad ? Tone::kBad : Tone::kPlain}};
  const auto length = [&](const char* key) {
    const auto v = At(g, {"error_3d", "over_answers", key});
    return TableCell{NumberText(v, 3, "", unit.metres), v};
  };
  if (g.is_object()) {
    row.evaluated = true;
    for (const char* key : {"answers", "attempts"}) {
      row.cells.push_back(NumberCell(At(g, {key}), 0));
    }
    for (const char* key : {"median_m", "p90_m", "max_m"}) row.cells.push_back(length(key));
    row.cells.push_back({GroupTitle(g)});
    row.cells.push_back({FlagAt(g, "shares_evidence") ? "shared: agreement" : "independent"});
    if (const auto median = At(g, {"error_3d", "over_answers", "median_m"})) row.median = *median / unit.metres;
  } else {
    row.cells.insert(row.cells.end(), 7, TableCell{});
  }
  const std::string gates = project.variant.empty() ? "gates" : "gates@" + project.variant;
  const std::string verdict = TextAt(ReadJson(dir / "results" / gates / "gates.json"), "verdict");
  row.cells.push_back({verdict, {}, verdict.empty() ? Tone::kPlain : GateTone(verdict)});
  row.cells.push_back(
      {project.reason.empty() && !fs::exists(report) ? "no report yet: trigpoint report" : project.reason});
  return row;
}

}  // namespace

void WriteOverview(const std::vector<OverviewProject>& projects, const DisplayUnit& unit, const fs::path& file) {
  const std::string u = " (" + unit.name + ")";
  Table table{"projects",
              "A row a project; press a name to open its report. Median and P90 of 3D differences over answers, "
              "against what the column names; independent: the reference shares no data with the answers.",
              {{"project"},
               {"status"},
               {"answers", true},
               {"attempts", true},
               {"median" + u, true},
               {"P90" + u, true},
               {"largest" + u, true},
               {"against"},
               {"evidence"},
               {"gates"},
               {"reason"}},
              {}};
  int failed = 0, evaluated = 0;
  std::vector<std::pair<std::string, double>> medians;
  for (const OverviewProject& project : projects) {
    OverviewRow row = RowOf(project, unit, file);
    failed += project.status == "failed";
    evaluated += row.evaluated;
    if (row.median) medians.emplace_back(row.name, *row.median);
    table.rows.push_back(std::move(row.cells));
  }
  Document document;
  document.title = "Trigpoint: " + std::to_string(projects.size()) + (projects.size() == 1 ? " project" : " projects");
  document.subtitle = "Lengths in " + unit.name + ".";
  document.footer = "Made by Trigpoint.";
  document.blocks.push_back(Heading{2, "Projects", "projects"});
  document.blocks.push_back(Facts{{{"Projects", std::to_string(projects.size()), ""},
                                   {"Failed", std::to_string(failed), "", failed > 0 ? Tone::kBad : Tone::kGood},
                                   {"With an evaluation", std::to_string(evaluated), ""}}});
  document.blocks.push_back(table);
  if (medians.size() > 1 && medians.size() <= 60) {
    document.blocks.push_back(Figure{"medians", "Median 3D difference of each project" + u + ", over its answers.",
                                     BarChart(medians, "median 3D difference" + u, 3)});
  }
  WriteFileAtomically(file, HtmlOf(document));
}

}  // namespace trigpoint

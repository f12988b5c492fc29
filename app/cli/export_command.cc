// export: results as files of other programs.
#include "app/cli/interchange_commands.h"
#include "app/pipeline/export.h"

namespace trigpoint {
namespace {

int Export(Session& session, const std::string& dir, const ExportRequest& request) {
  const Project project = OpenProject(session, dir);
  Terminal terminal = session.MakeTerminal();
  const ExportReport report = ExportResults(project, request, terminal, *session.cancel);
  terminal.ClearProgress();
  for (const std::string& warning : report.warnings) terminal.Log(LogLevel::kWarning, warning);
  nlohmann::json files = nlohmann::json::array();
  Ending ending("Exported " + request.to + " in " + session.Taken() + ": " + Counted(report.files.size(), "file"));
  constexpr size_t kOneEach = 5;
  if (report.lines.size() > kOneEach) {
    ending.Fact("Contents", Listed(report.lines, report.lines.size()));
  } else {
    for (const std::string& line : report.lines) ending.Fact("Contents", line);
  }
  for (const auto& file : report.files) {
    files.push_back(file.string());
    ending.Row("Wrote     " + ShownPath(file));
  }
  session.End(ending);
  session.PrintJson({{"command", "export"},
                     {"ok", true},
                     {"files", files},
                     {"contents", report.lines},
                     {"warnings", report.warnings}});
  return 0;
}

}  // namespace

void AddExportCommand(CLI::App& app, Session& session) {
  std::string formats = "Formats:\n";
  for (const ExportFormat& format : ExportFormats()) {
    formats += "  " + format.name + std::string(10 - format.name.size(), ' ') + format.help + "\n";
  }
  CLI::App& command = AddCommand(
      app, session, "export", "write results as files of other programs",
      formats +
          "Layers of the maps (gpkg, geojson, kml, gpx, csv): tags, control, check, stations, panoramas, "
          "cameras,\n"
          "trajectories, ellipses, residuals. Uncertainties are 1 sigma unless a column names another confidence.\n\n"
          "Examples:\n"
          "  trigpoint export my_site --to gpkg --crs EPSG:25832\n"
          "  trigpoint export my_site --to geojson --what panoramas,tags --out site.geojson\n"
          "  trigpoint export my_site --to kml --heights egm96\n"
          "  trigpoint export my_site --to colmap --run run1 --out model");
  const auto dir = std::make_shared<std::string>();
  const auto request = std::make_shared<ExportRequest>();
  const auto out = std::make_shared<std::string>();
  command.add_option("DIR", *dir, "the project")->required();
  command.add_option("--to", request->to, "format, see below")->required();
  command.add_option("--what", request->what, "layers or parts, separated by commas; default: all")
      ->delimiter(',')
      ->allow_extra_args(false);
  command.add_option("--run", request->runs, "only this run (may be given several times)")->allow_extra_args(false);
  command.add_option("--variant", request->variant, "results of this variant");
  command.add_option("--crs", request->crs, "EPSG:N, or utm for the zone of the site; default: EPSG:4326 (WGS 84)");
  command.add_option("--heights", request->heights,
                     "ellipsoidal, or above a geoid: egm84, egm96, egm2008; default: ellipsoidal");
  command.add_option("--frame", request->frame,
                     "frame of scenes and trajectories: world (site ENU) or odom (the run's own)");
  command.add_option("--confidence", request->confidence, "confidence of the error ellipses, 0.01 to 0.9999")
      ->check(CLI::Range(0.01, 0.9999))
      ->capture_default_str();
  command
      .add_option("--ellipse-scale", request->ellipse_scale, "factor by which ellipses are drawn larger than they are")
      ->check(CLI::Range(0.001, 1e6))
      ->capture_default_str();
  command.add_option("--out", *out, "file (gpkg, geojson, kml, gpx) or folder; default: results/export/");
  command.add_flag("--force", request->force,
                   "replace files of an earlier export that were changed since; other files are never replaced");
  command.callback([&session, dir, request, out] {
    session.action = [dir, request, out](Session& s) {
      request->out = *out;
      return Export(s, *dir, *request);
    };
  });
}

}  // namespace trigpoint

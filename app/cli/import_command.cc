// import: other people's data into a site's folder, as files that every command reads.
#include <fmt/format.h>

#include "app/cli/interchange_commands.h"
#include "datasets/import/panorama_provider.h"
#include "datasets/import/phone_files.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string dir, from, as, name, images;
  std::vector<double> near;
  double radius_m = 1000;
  double scale = 0;
};

// What lies at `from`, by its contents.
std::string Guess(const fs::path& from) {
  const std::string ending = from.extension().string();
  if (HasColmapModel(from)) return "colmap";
  if (ending == ".db") return "colmap-database";
  if (!fs::exists(from)) throw InputError(from.string() + ": there is no such file or folder");
  if (fs::is_regular_file(from) && (ending == ".json" || ending == ".txt")) return "gcp";
  if (fs::is_directory(from)) {
    bool json = false;
    for (const auto& entry : fs::directory_iterator(from)) json = json || entry.path().extension() == ".json";
    return json ? "panoramas" : "photos";
  }
  throw InputError(from.string() + ": what it is cannot be told from its name; say it by --as");
}

ImportReport Import(const Arguments& a, const std::string& as, ProgressSink& progress, const CancelToken& cancel) {
  if (as == "colmap" || as == "colmap-database") {
    ColmapRunOptions options;
    options.run = a.name;
    options.images = a.images;
    if (a.scale > 0) options.scale = a.scale;
    return as == "colmap" ? ImportColmapRun(a.dir, a.from, options) : ImportColmapDatabase(a.dir, a.from, options);
  }
  if (as == "panoramas") {
    PanoramaImportOptions options;
    if (!a.near.empty()) options.near = Geodetic{a.near.at(0), a.near.at(1), 0};
    options.radius_m = a.radius_m;
    return ImportPanoramas(a.dir, *OpenPanoramaFolder(a.from), options, progress, cancel);
  }
  if (as == "photos") return ImportPhotos(a.dir, a.from, a.name, progress, cancel);
  const fs::path images = a.images.empty() ? fs::path(a.from).parent_path() / "images" : fs::path(a.images);
  return ImportOpenSfmGcp(a.dir, a.from, images);
}

int TakeIn(Session& session, const Arguments& a) {
  const std::string as = a.as.empty() ? Guess(a.from) : a.as;
  Terminal terminal = session.MakeTerminal();
  const ImportReport report = Import(a, as, terminal, *session.cancel);
  terminal.ClearProgress();
  for (const std::string& warning : report.warnings) terminal.Log(LogLevel::kWarning, warning);
  std::string text;
  nlohmann::json files = nlohmann::json::array();
  for (const std::string& line : report.lines) text += line + "\n";
  for (const fs::path& file : report.files) files.push_back(file.string());
  text += fmt::format("Wrote {} files below {}\nNext: trigpoint init {}\n", report.files.size(), a.dir, a.dir);
  session.Print(text);
  session.PrintJson({{"command", "import"},
                     {"ok", true},
                     {"as", as},
                     {"files", files},
                     {"contents", report.lines},
                     {"warnings", report.warnings}});
  return 0;
}

}  // namespace

void AddImportCommand(CLI::App& app, Session& session) {
  CLI::App& command = AddCommand(
      app, session, "import",
      "take in other people's data: COLMAP, Street View style panoramas, photos, control points",
      "Writes new files into DIR as docs/file_formats.md describes them, and never over one that is there.\n"
      "  colmap           a model (binary or text, COLMAP 3.x or 4.x) as a run: cameras, poses as odometry, images\n"
      "  colmap-database  its cameras and images as a run without poses\n"
      "  panoramas        a folder of panoramas, tiles or faces with metadata JSON (id, latitude, longitude, heading, "
      "date)\n"
      "  photos           a folder of HEIC (and other) photos as a hand-held set\n"
      "  gcp              ground control points of OpenSfM: ground_control_points.json or gcp_list.txt\n"
      "Photos with Mapillary's EXIF description need no import: every command reads it.\n\n"
      "Examples:\n"
      "  trigpoint import my_site --from sparse/0 --images images --name walk\n"
      "  trigpoint import my_site --from street_view --near 48.0126,7.8323 --radius 300\n"
      "  trigpoint import my_site --from iphone --as photos --name corner\n"
      "  trigpoint import my_site --from ground_control_points.json");
  const auto a = std::make_shared<Arguments>();
  command.add_option("DIR", a->dir, "the project, made if it isn't there")->required();
  command.add_option("--from", a->from, "file or folder to take in")->required();
  command.add_option("--as", a->as, "what it is; default: told by its contents")
      ->check(CLI::IsMember({"colmap", "colmap-database", "panoramas", "photos", "gcp"}));
  command.add_option("--name", a->name, "colmap: the new run; photos: the new set");
  command.add_option("--images", a->images, "colmap: the folder its image names begin in; gcp: the pictures");
  command.add_option("--scale", a->scale, "colmap: metres per unit of the model; default: from EXIF positions")
      ->check(CLI::PositiveNumber);
  command.add_option("--near", a->near, "panoramas: only those around LATITUDE,LONGITUDE (deg)")
      ->delimiter(',')
      ->expected(2);
  command.add_option("--radius", a->radius_m, "panoramas: within so many metres of --near")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command.callback([&session, a] { session.action = [a](Session& s) { return TakeIn(s, *a); }; });
}

}  // namespace trigpoint

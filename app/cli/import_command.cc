// import: other people's data into a site's folder, as files that every command reads.
#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "app/cli/interchange_commands.h"
#include "app/pipeline/command_line.h"
#include "datasets/import/panorama_provider.h"
#include "datasets/import/phone_files.h"
#include "datasets/import/providers/services.h"
#include "datasets/import/run_track.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string dir, from, as, name, images;
  std::vector<double> near;
  double radius_m = 0;  // 0: not given
  double scale = 0;
  // Panoramas of services.
  std::string along, url, token_file;
  PanoramaImportOptions panoramas;
  int width = -1;  // not given
  bool list = false;
};

PanoramaImportOptions PanoramaOptions(const Arguments& a, bool service) {
  constexpr double kServiceRadius_m = 150, kFolderRadius_m = 1000;
  constexpr int kServiceWidth = 4096;
  PanoramaImportOptions options = a.panoramas;
  options.area.radius_m = a.radius_m > 0 ? a.radius_m : service ? kServiceRadius_m : kFolderRadius_m;
  options.width = a.width >= 0 ? a.width : service ? kServiceWidth : 0;
  if (!a.near.empty() && !a.along.empty()) throw OptionError("--near and --along: give one of them");
  if (!a.near.empty()) options.area.points = {Geodetic{a.near.at(0), a.near.at(1), 0}};
  if (!a.along.empty()) options.area = AreaAlongRun(a.dir, a.along, options.area.radius_m);
  return options;
}

std::unique_ptr<PanoramaProvider> OpenService(const Service& service, const Arguments& a) {
  ServiceOptions options;
  options.url = a.url.empty() ? service.url : a.url;
  options.token = ReadToken(service, a.token_file);
  return service.open(options);
}

// The nearest first.
Ending ListEnding(const std::vector<PanoramaRecord>& records, const SearchArea& area) {
  std::vector<PanoramaRecord> nearest = records;
  std::stable_sort(nearest.begin(), nearest.end(), [&](const PanoramaRecord& x, const PanoramaRecord& y) {
    return area.Distance_m(x.position) < area.Distance_m(y.position);
  });
  std::map<std::string, int> years;
  for (const PanoramaRecord& r : records) ++years[r.date.empty() ? "undated" : r.date.substr(0, 4)];
  std::string text = fmt::format("{} panoramas:", records.size());
  for (const auto& [year, count] : years) text += fmt::format(" {} of {},", count, year);
  text.pop_back();
  std::vector<std::vector<std::string>> rows;
  for (const PanoramaRecord& r : nearest) {
    rows.push_back({r.id, fmt::format("{:.0f} m", area.Distance_m(r.position)), r.date.substr(0, 10),
                    r.heading_deg ? fmt::format("{:.0f} deg", *r.heading_deg) : "-",
                    r.width_px > 0 ? fmt::format("{} px", r.width_px) : "-", r.licence, r.owner});
  }
  return Ending(text)
      .Rows(TableText({"panorama", "away", "taken", "heading", "width", "licence", "owner"}, rows))
      .Next("the same without --list imports them; nothing was written");
}

nlohmann::json ListJson(const std::vector<PanoramaRecord>& records) {
  nlohmann::json list = nlohmann::json::array();
  const auto number = [](const std::optional<double>& value) {
    return value ? nlohmann::json(*value) : nlohmann::json(nullptr);
  };
  for (const PanoramaRecord& r : records) {
    list.push_back({{"id", r.id},
                    {"latitude_deg", r.position.latitude_deg},
                    {"longitude_deg", r.position.longitude_deg},
                    {"heading_deg", number(r.heading_deg)},
                    {"sigma_h_m", number(r.sigma_h_m)},
                    {"captured_at", r.date},
                    {"width_px", r.width_px},
                    {"owner", r.owner},
                    {"licence", r.licence},
                    {"attribution", r.attribution}});
  }
  return list;
}

// Says what a service has, and takes nothing.
int List(Session& session, const Arguments& a, const Service& service) {
  const auto provider = OpenService(service, a);
  const PanoramaImportOptions options = PanoramaOptions(a, true);
  Terminal terminal = session.MakeTerminal();
  const std::vector<PanoramaRecord> records = ChoosePanoramas(*provider, options, *session.cancel);
  for (const std::string& warning : provider->Warnings()) terminal.Log(LogLevel::kWarning, warning);
  session.End(ListEnding(records, options.area));
  session.PrintJson({{"command", "import"}, {"ok", true}, {"as", service.name}, {"panoramas", ListJson(records)}});
  return 0;
}

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
    return ImportPanoramas(a.dir, *OpenPanoramaFolder(a.from), PanoramaOptions(a, false), progress, cancel);
  }
  if (const Service* service = ServiceNamed(as)) {
    return ImportPanoramas(a.dir, *OpenService(*service, a), PanoramaOptions(a, true), progress, cancel);
  }
  if (as == "photos") return ImportPhotos(a.dir, a.from, a.name, progress, cancel);
  const fs::path images = a.images.empty() ? fs::path(a.from).parent_path() / "images" : fs::path(a.images);
  return ImportOpenSfmGcp(a.dir, a.from, images);
}

int TakeIn(Session& session, const Arguments& a) {
  const Service* service = a.as.empty() ? ServiceNamed(a.from) : nullptr;
  if (service == nullptr && (a.list || !a.url.empty() || !a.token_file.empty())) {
    throw OptionError("--list, --url and --token-file are for services; --from " + a.from + " is none");
  }
  if (service != nullptr && a.near.empty() && a.along.empty()) {
    throw OptionError("--from " + service->name + ": where? Give --near LAT,LON or --along RUN");
  }
  if (service != nullptr && a.list) return List(session, a, *service);
  const std::string as = service != nullptr ? service->name : a.as.empty() ? Guess(a.from) : a.as;
  Terminal terminal = session.MakeTerminal();
  const ImportReport report = Import(a, as, terminal, *session.cancel);
  terminal.ClearProgress();
  for (const std::string& warning : report.warnings) terminal.Log(LogLevel::kWarning, warning);
  Ending ending(fmt::format("Imported {} in {}: {} below {}", as, session.Taken(),
                            Counted(static_cast<int64_t>(report.files.size()), "new file", "new files"),
                            ShownPath(a.dir)));
  nlohmann::json files = nlohmann::json::array();
  for (const std::string& line : report.lines) ending.Fact("Contents", line);
  for (const fs::path& file : report.files) files.push_back(file.string());
  session.End(ending.Next("trigpoint init " + ShellWord(a.dir)));
  session.PrintJson({{"command", "import"},
                     {"ok", true},
                     {"as", as},
                     {"files", files},
                     {"contents", report.lines},
                     {"warnings", report.warnings}});
  return 0;
}

std::string ServiceLines() {
  std::string text;
  for (const Service& service : Services()) {
    text += fmt::format("  {:<16} {}{}\n", service.name, service.help,
                        service.token_env.empty() ? "" : " (" + service.token_env + " or --token-file)");
  }
  return text + "Files and folders:\n";
}

}  // namespace

void AddImportCommand(CLI::App& app, Session& session) {
  CLI::App& command = AddCommand(
      app, session, "import",
      "take in other people's data: panoramas of services and folders, COLMAP, photos, control points",
      "Writes new files into DIR as docs/file_formats.md describes them, and never over one that is there; rows are "
      "added to panoramas.csv.\n"
      "Panoramas of a service, around a place or along a run:\n" +
          ServiceLines() +
          "  colmap           a model (binary or text, COLMAP 3.x or 4.x) as a run: cameras, poses as odometry, "
          "images\n"
          "  colmap-database  its cameras and images as a run without poses\n"
          "  panoramas        a folder of panoramas, tiles or faces with metadata JSON (id, latitude, longitude, "
          "heading, "
          "date)\n"
          "  photos           a folder of HEIC (and other) photos as a hand-held set\n"
          "  gcp              ground control points of OpenSfM: ground_control_points.json or gcp_list.txt\n"
          "Photos with Mapillary's EXIF description need no import: every command reads it.\n\n"
          "Examples:\n"
          "  trigpoint import my_site --from panoramax --near 48.0126,7.8323 --radius 150 --list\n"
          "  trigpoint import my_site --from panoramax --along run1 --radius 30 --since 2024\n"
          "  trigpoint import my_site --from sparse/0 --images images --name walk\n"
          "  trigpoint import my_site --from street_view --near 48.0126,7.8323 --radius 300\n"
          "  trigpoint import my_site --from iphone --as photos --name corner\n"
          "  trigpoint import my_site --from ground_control_points.json");
  const auto a = std::make_shared<Arguments>();
  command.add_option("DIR", a->dir, "the project, made if it isn't there")->required();
  command.add_option("--from", a->from, "file or folder to take in, or a service: panoramax, mapillary")->required();
  command.add_option("--as", a->as, "what it is; default: told by its contents")
      ->check(CLI::IsMember({"colmap", "colmap-database", "panoramas", "photos", "gcp"}));
  command.add_option("--name", a->name, "colmap: the new run; photos: the new set");
  command.add_option("--images", a->images, "colmap: the folder its image names begin in; gcp: the pictures");
  command.add_option("--scale", a->scale, "colmap: metres per unit of the model; default: from EXIF positions")
      ->check(CLI::PositiveNumber);
  command.add_option("--near", a->near, "panoramas: only those around LATITUDE,LONGITUDE (deg)")
      ->delimiter(',')
      ->expected(2);
  command
      .add_option("--radius", a->radius_m,
                  "panoramas: within so many metres; default: 1000 for folders, 150 for services")
      ->check(CLI::Range(1.0, 100e3));
  command.add_option("--along", a->along, "panoramas: along this run: its GPS, or its cameras where it is localized");
  command
      .add_option("--width", a->width,
                  "panoramas: shrink wider pictures to so many px; 0: as they are, default for folders; services: 4096")
      ->check(CLI::Range(0, 65536));
  command.add_option("--limit", a->panoramas.limit, "panoramas: the nearest so many; 0: all")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command.add_option("--since", a->panoramas.since, "panoramas: taken on this day or later: 2024, 2024-05, 2024-05-12");
  command.add_option("--until", a->panoramas.until, "panoramas: taken on this day or earlier");
  command.add_flag("--list", a->list, "services: say what is there and take nothing");
  command.add_option("--url", a->url, "services: another server of the same kind");
  command.add_option("--token-file", a->token_file,
                     "services: file (mode 0600) with the token, in place of the environment");
  command.callback([&session, a] { session.action = [a](Session& s) { return TakeIn(s, *a); }; });
}

}  // namespace trigpoint

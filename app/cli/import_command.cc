// import: other people's data into a site's folder, as files that every command reads.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "app/cli/interchange_commands.h"
#include "app/pipeline/command_line.h"
#include "datasets/colmap/database.h"
#include "datasets/colmap/model.h"
#include "datasets/import/dataset_run.h"
#include "datasets/import/import_files.h"
#include "datasets/import/providers/services.h"
#include "datasets/import/run_track.h"
#include "datasets/import/source_links.h"
#include "datasets/io/capture_date.h"
#include "datasets/io/csv.h"
#include "datasets/io/exif.h"
#include "datasets/io/tag_layout.h"
#include "datasets/io/text.h"
#include "eval/text/json_values.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

struct Arguments : FileImport {
  std::string as;
  std::vector<double> near;
  double radius_m = 0;  // 0: not given
  int width = -1;       // not given
  bool list = false;
  // Panoramas of services.
  std::string along, url, token_file;
  bool permitted = false;
};

PanoramaImportOptions PanoramaOptions(const Arguments& a, bool service) {
  constexpr double kServiceRadius_m = 150, kFolderRadius_m = 1000;
  constexpr int kServiceWidth = 4096;
  PanoramaImportOptions options = a.panoramas;
  options.area.radius_m = a.radius_m != 0 ? a.radius_m : service ? kServiceRadius_m : kFolderRadius_m;
  options.width = a.width >= 0 ? a.width : service ? kServiceWidth : 0;
  if (!a.near.empty() && !a.along.empty()) throw OptionError("--near and --along: give one of them");
  if (!a.near.empty()) options.area.points = {Geodetic{a.near.at(0), a.near.at(1), 0}};
  if (!a.along.empty()) {
    options.area = AreaAlongRun(a.dir, a.along, options.area.radius_m);
    options.near_date = DateOfRun(ReadRun(fs::path(a.dir) / "runs" / a.along, a.dir));
  }
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
  std::string text = Counted(records.size(), "panorama") + ":";
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
  for (const PanoramaRecord& r : records) {
    list.push_back({{"id", r.id},
                    {"latitude_deg", r.position.latitude_deg},
                    {"longitude_deg", r.position.longitude_deg},
                    {"heading_deg", OrNull(r.heading_deg)},
                    {"sigma_h_m", OrNull(r.sigma_h_m)},
                    {"captured_at", r.date},
                    {"width_px", r.width_px},
                    {"owner", r.owner},
                    {"licence", r.licence},
                    {"attribution", r.attribution}});
  }
  return list;
}

// What a service or a folder has; nothing is imported.
int ListPanoramas(Session& session, const Arguments& a, const std::string& as, PanoramaProvider* provider) {
  const PanoramaImportOptions options = PanoramaOptions(a, ServiceNamed(as) != nullptr);
  Terminal terminal = session.MakeTerminal();
  const std::vector<PanoramaRecord> records = ChoosePanoramas(*provider, options, *session.cancel);
  for (const std::string& warning : provider->Warnings()) terminal.Log(LogLevel::kWarning, warning);
  session.End(ListEnding(records, options.area));
  session.PrintJson({{"command", "import"}, {"ok", true}, {"as", as}, {"panoramas", ListJson(records)}});
  return 0;
}

// What each topic of a bag becomes.
std::vector<std::vector<std::string>> TopicRows(const BagContents& contents, const BagChoice& choice) {
  std::map<std::string, std::string> uses;
  for (size_t i = 0; i < choice.images.size(); ++i) {
    uses[choice.images[i].name] = fmt::format("images of cam{}", i);
    if (const BagTopic* info = CameraInfoOf(contents, choice.images[i].name)) {
      uses[info->name] = fmt::format("calibration of cam{}", i);
    }
  }
  if (choice.pose) uses[choice.pose->name] = "odometry";
  if (choice.fix) uses[choice.fix->name] = "GPS";
  if (choice.imu) uses[choice.imu->name] = "check of the odometry's level";
  const double seconds = 1e-9 * static_cast<double>(contents.end_ns - contents.begin_ns);
  std::vector<std::vector<std::string>> rows;
  for (const BagTopic& topic : contents.topics) {
    std::string use = RoleOf(topic) == BagRole::kTransforms ? "where cameras sit" : uses[topic.name];
    if (use.empty()) use = RoleOf(topic) == BagRole::kNone ? "-" : "by --topic";
    rows.push_back({topic.name, topic.type, std::to_string(topic.messages),
                    seconds > 0 ? fmt::format("{:.1f} Hz", static_cast<double>(topic.messages) / seconds) : "-", use});
  }
  return rows;
}

// What is in a bag; nothing is imported.
int ListTopics(Session& session, const Arguments& a) {
  RequireFilesInside(a.from);
  const BagContents contents = ListBag(a.from, *session.cancel);
  const BagChoice choice = ChooseTopics(contents, a.bag.topics);
  Terminal terminal = session.MakeTerminal();
  for (const std::string& warning : contents.warnings) terminal.Log(LogLevel::kWarning, warning);
  if (!choice.problem.empty()) terminal.Log(LogLevel::kWarning, choice.problem);
  const std::vector<std::vector<std::string>> rows = TopicRows(contents, choice);
  nlohmann::json topics = nlohmann::json::array();
  for (size_t i = 0; i < rows.size(); ++i) {
    const BagTopic& topic = contents.topics[i];
    topics.push_back({{"topic", topic.name}, {"type", topic.type}, {"messages", topic.messages}, {"use", rows[i][4]}});
  }
  session.End(Ending(fmt::format("{}, {:.1f} s, {}:", contents.format,
                                 1e-9 * static_cast<double>(contents.end_ns - contents.begin_ns),
                                 Counted(rows.size(), "topic")))
                  .Rows(TableText({"topic", "type", "messages", "rate", "becomes"}, rows))
                  .Next("the same with --name RUN in place of --list imports them; nothing was written"));
  session.PrintJson({{"command", "import"}, {"ok", true}, {"as", "bag"}, {"topics", topics}});
  return 0;
}

ImportReport Import(const Arguments& a, const std::string& as, ProgressSink& progress, const CancelToken& cancel) {
  if (const Service* service = ServiceNamed(as)) {
    return ImportPanoramas(a.dir, *OpenService(*service, a), PanoramaOptions(a, true), progress, cancel);
  }
  FileImport request = a;
  request.panoramas = PanoramaOptions(a, false);
  return ImportFiles(request, as, progress, cancel);
}

// What would be imported; nothing is.
int List(Session& session, const Arguments& a, const std::string& as, const Service* service) {
  if (as == "bag") return ListTopics(session, a);
  if (service != nullptr) return ListPanoramas(session, a, as, OpenService(*service, a).get());
  if (as == "stac") return ListPanoramas(session, a, as, OpenStacFile(a.from).get());
  if (as == "panoramas") return ListPanoramas(session, a, as, OpenPanoramaFolder(a.from).get());
  std::string contents;
  bool needs_name = true;
  if (as == "colmap") {
    RequireFilesInside(a.from);
    const SparseModel model = ReadColmapModel(a.from);
    contents = fmt::format("COLMAP model: {}, {}, {}", Counted(model.cameras.size(), "camera"),
                           Counted(model.images.size(), "image"), Counted(model.points.size(), "point"));
  } else if (as == "colmap-database") {
    contents = "COLMAP database: " + Counted(ColmapDatabase::OpenRead(a.from).Images().size(), "image");
  } else if (as == "tag-layout") {
    contents = "tag layout: " + Counted(ReadTagLayout(a.from).size(), "tag");
    needs_name = false;
  } else if (as == "dataset") {
    contents = DescribeDataset(a.from);
  } else if (as == "video") {
    contents = DescribeVideo(a.from);
  } else if (as == "gcp") {
    contents = "ground control points of OpenSfM";
    needs_name = false;
  } else {
    contents = as;
    if (as == "photos") {
      int64_t pictures = 0;
      for (const auto& entry : fs::directory_iterator(a.from)) {
        const std::string ending = entry.path().extension().string();
        pictures += IsPictureName(entry.path()) || ending == ".heic" || ending == ".HEIC";
      }
      if (pictures == 0) {
        throw InputError(a.from +
                         ": found none of what import takes in: expected photos, panoramas with metadata JSON, "
                         "a COLMAP model, a bag, or a folder of EuRoC, TUM RGB-D, KITTI odometry (with image_0/) or "
                         "Record3D");
      }
      contents = "folder of " + Counted(pictures, "photo");
    }
  }
  session.End(Ending(a.from + ": " + contents)
                  .Next(std::string("the same ") + (needs_name ? "with --name NAME in place of" : "without") +
                        " --list imports it; nothing was written"));
  session.PrintJson({{"command", "import"}, {"ok", true}, {"as", as}, {"contents", contents}});
  return 0;
}

// Rows of panoramas.csv that are not in its earlier copy.
std::vector<std::string> AddedPanoramas(const fs::path& kept, const fs::path& table) {
  const CsvTable before = CsvTable::Read(kept, {"file"}), now = CsvTable::Read(table, {"file"});
  std::set<std::string> known;
  for (const CsvRow& row : before.rows()) known.insert(row.Text("file"));
  std::vector<std::string> added;
  for (const CsvRow& row : now.rows()) {
    if (known.count(row.Text("file")) == 0) added.push_back("row of " + row.Text("file") + " in panoramas.csv");
  }
  return added;
}

// `--from stac --url FILE` is `--from FILE --as stac`.
Arguments WithStacFile(Arguments a) {
  if (a.from != "stac" || fs::exists(a.from)) return a;
  if (a.url.empty() || !fs::exists(a.url)) {
    throw OptionError("--from stac: expected a STAC file, as in --from items.json, or --from stac --url items.json" +
                      (a.url.empty() ? std::string() : "; --url names no file") +
                      "; for a STAC server: --from panoramax --url ADDRESS");
  }
  a.from = std::exchange(a.url, "");
  a.as = "stac";
  return a;
}

int TakeIn(Session& session, const Arguments& given) {
  const Arguments a = WithStacFile(given);
  const Service* service = a.as.empty() ? ServiceNamed(a.from) : nullptr;
  // A folder may be called Panoramax.
  if (service != nullptr && a.from != service->name && fs::exists(a.from)) service = nullptr;
  const std::string as = service != nullptr ? service->name : a.as.empty() ? ImportKindOf(a.from) : a.as;
  if (service == nullptr && (!a.url.empty() || !a.token_file.empty())) {
    throw OptionError("--url and --token-file are for services; --from " + a.from + " is none");
  }
  if (service != nullptr && a.near.empty() && a.along.empty()) {
    throw OptionError("--from " + service->name + ": expected --near LAT,LON or --along RUN");
  }
  if (a.along.empty()) PanoramaOptions(a, service != nullptr).Check();  // before a token is asked for
  if (a.list) return List(session, a, as, service);
  if (service != nullptr && !service->permission.empty() && !a.permitted) {
    throw OptionError(
        "--from " + service->name + ": " + service->permission +
        "; if your agreement with it permits this use, state so by --permitted (--list needs no permission)");
  }
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
  if (!report.kept.empty()) {
    ShowChange(report.kept, AddedPanoramas(report.kept, fs::path(a.dir) / "panoramas.csv"), &ending);
  }
  session.End(ending.Next("trigpoint init " + ShellWord(a.dir)));
  session.PrintJson({{"command", "import"},
                     {"ok", true},
                     {"as", as},
                     {"files", files},
                     {"contents", report.lines},
                     {"kept", report.kept.string()},
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
          "  bag              a recording of ROS 1 (.bag) or ROS 2 (.db3, .mcap, or their folder) as a run: images, "
          "cameras, odometry, GPS\n"
          "  dataset          a folder of EuRoC, TUM RGB-D, KITTI odometry or Record3D as a run\n"
          "  video            a video as a run, with the GPX or NMEA track of its name beside it\n"
          "  colmap           a model (binary or text, COLMAP 3.x or 4.x) as a run: cameras, poses as odometry, "
          "images\n"
          "  colmap-database  its cameras and images as a run without poses\n"
          "  panoramas        a folder of panoramas, tiles or faces with metadata JSON (id, latitude, longitude, "
          "heading, "
          "date)\n"
          "  stac             a file with STAC items: panoramas below its folder or at http(s) addresses\n"
          "  photos           a folder of HEIC (and other) photos as a hand-held set\n"
          "  gcp              ground control points of OpenSfM: ground_control_points.json or gcp_list.txt\n"
          "  tag-layout       a field layout of WPILib or an fmap: tags whose places are known, as control points\n"
          "Photos with Mapillary's EXIF description need no import: every command reads it.\n\n"
          "Examples:\n"
          "  trigpoint import my_site --from panoramax --near 48.0126,7.8323 --radius 150 --list\n"
          "  trigpoint import my_site --from panoramax --along run1 --radius 30 --since 2024\n"
          "  trigpoint import my_site --from drive.bag --list\n"
          "  trigpoint import my_site --from drive.bag --name drive --every 5\n"
          "  trigpoint import my_site --from sparse/0 --images images --name walk\n"
          "  trigpoint import my_site --from street_view --near 48.0126,7.8323 --radius 300\n"
          "  trigpoint import my_site --from iphone --as photos --name corner\n"
          "  trigpoint import my_site --from ground_control_points.json");
  const auto a = std::make_shared<Arguments>();
  command.add_option("DIR", a->dir, "the project, made if it isn't there")->required();
  command
      .add_option("--from", a->from,
                  "file or folder to take in, or a service (in any case): panoramax, mapillary, kartaview, google")
      ->required();
  command.add_option("--as", a->as, "what it is; default: recognised by its contents")
      ->check(CLI::IsMember(ImportKinds()));
  command.add_option("--name", a->name, "bag, dataset, video, colmap: the new run; photos: the new set");
  command.add_option("--images", a->images, "colmap: the folder its image names begin in; gcp: the pictures");
  command.add_option("--scale", a->scale, "colmap: metres per unit of the model; default: from EXIF positions")
      ->check(CLI::PositiveNumber);
  command.add_option("--tag-size", a->tag_size_m, "tag-layout: edge of the black square (m), where the file has none")
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
                  "panoramas: shrink wider pictures to so many px (even, 256 to 65536); 0: as they are, default for "
                  "folders; services: 4096")
      ->check(CLI::Range(0, 65536));
  command
      .add_option("--limit", a->panoramas.limit,
                  "panoramas: the nearest so many, of the season of --along's run first; 0: all")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command.add_option("--id", a->panoramas.ids, "panoramas: these alone, by the ids of --list; once for each");
  command.add_option("--since", a->panoramas.since, "panoramas: taken on this day or later: 2024, 2024-05, 2024-05-12");
  command.add_option("--until", a->panoramas.until, "panoramas: taken on this day or earlier");
  command.add_option("--topic", a->bag.topics, "bag: take this topic and no others; once for each");
  command.add_option("--every", a->bag.every, "bag, dataset, video: of each camera every n-th image")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command.add_option(
      "--cameras", a->bag.cameras,
      "bag, dataset, video: camchain.yaml or another calibration in place of camera_info, in the order of the topics");
  command.add_option("--odometry", a->odometry,
                     "dataset, video: poses (TUM, EuRoC, KITTI, or a log of ARCore or ARKit) to be the run's odometry");
  command.add_flag("--list", a->list, "show what is there; import nothing");
  command.add_flag("--permitted", a->permitted,
                   "google: your agreement with it permits computing from its pictures, which its policies forbid");
  command.add_option("--url", a->url, "services: another server of the same kind");
  command.add_option("--token-file", a->token_file,
                     "services: file (mode 0600) with the token or key, in place of the environment");
  command.callback([&session, a] { session.action = [a](Session& s) { return TakeIn(s, *a); }; });
}

}  // namespace trigpoint

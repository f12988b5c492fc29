// doctor: is everything there that a computation needs?
#include <ceres/version.h>
#include <fmt/format.h>
#include <unistd.h>

#include <fstream>
#include <opencv2/core/utility.hpp>
#include <thread>

#include "app/cli/command.h"
#include "app/pipeline/command_line.h"
#include "calib/base/memory.h"
#include "datasets/export/crs.h"
#include "datasets/export/proj_installation.h"
#include "datasets/io/text.h"
#include "datasets/project/child_process.h"
#include "datasets/project/description.h"
#include "eval/scene/offscreen.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr double kGiB = 1 << 30;
constexpr double kLeastMemory_GiB = 2;  // a run of a few hundred images of 1 megapixel takes less
constexpr double kLeastDisk_GiB = 2;

// A value of a file of KEY=value lines, without its quotes.
std::string ValueIn(const fs::path& file, const std::string& key) {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with(key + "=")) continue;
    std::string value = line.substr(key.size() + 1);
    std::erase(value, '"');
    return value;
  }
  return "";
}

int64_t AllMemoryBytes() { return int64_t{sysconf(_SC_PHYS_PAGES)} * sysconf(_SC_PAGESIZE); }

// The first line that COLMAP says of itself, "3.8"; empty: it isn't there.
std::string ColmapVersion(const fs::path& program, const CancelToken& cancel) {
  if (program.empty()) return "";
  const fs::path log = fs::temp_directory_path() / fmt::format("trigpoint-doctor-{}", getpid());
  std::string version = "of unknown version";
  try {
    RunChild({program.string(), "help"}, log, 20, cancel);
    std::ifstream in(log);
    for (std::string line; std::getline(in, line);) {
      if (!line.starts_with("COLMAP ")) continue;
      version = line.substr(7, line.find(' ', 7) - 7);
      break;
    }
  } catch (const IoError&) {  // said as unknown
  }
  std::error_code ignored;
  fs::remove(log, ignored);
  return version;
}

class Doctor {
 public:
  Doctor(const Session& session, std::string version, std::string dir)
      : session_(session), version_(std::move(version)), dir_(std::move(dir)) {}

  int Examine() {
    Versions();
    Machine();
    Disk();
    Display();
    Colmap();
    Grids();
    if (!dir_.empty()) Folder();
    const std::string subject = dir_.empty() ? "This installation" : ShownPath(dir_);
    ending_.Headline(problems_ == 0 ? subject + ": everything needed is there"
                                    : subject + ": " + Counted(problems_, "thing") + " to look at");
    session_.End(ending_);
    json_["command"] = "doctor";
    json_["ok"] = problems_ == 0;
    session_.PrintJson(json_);
    return 0;
  }

 private:
  void Fact(const std::string& label, const std::string& text) {
    ending_.Fact(label, text);
    json_["found"].push_back(label + ": " + text);
  }
  void Problem(const std::string& label, const std::string& text) {
    ending_.Problem(label, text);
    json_["problems"].push_back(label + ": " + text);
    ++problems_;
  }

  void Versions() {
    const std::string system = ValueIn("/etc/os-release", "PRETTY_NAME");
    const ProjInstallation proj = FindProj();
    Fact("Versions", fmt::format("trigpoint {}, OpenCV {}, Ceres {}{}{}", version_, cv::getVersionString(),
                                 CERES_VERSION_STRING, proj.version.empty() ? ", no PROJ" : ", PROJ " + proj.version,
                                 system.empty() ? "" : "; " + system));
  }

  void Machine() {
    const double free = static_cast<double>(AvailableMemoryBytes()) / kGiB;
    const std::string text =
        fmt::format("{:.1f} of {:.1f} GiB free", free, static_cast<double>(AllMemoryBytes()) / kGiB);
    if (free < kLeastMemory_GiB) {
      Problem("Memory",
              text + fmt::format(": long runs need more than {:.0f} GiB; close other programs", kLeastMemory_GiB));
    } else {
      Fact("Memory", text + ", " + Counted(std::max(1U, std::thread::hardware_concurrency()), "core", "cores"));
    }
  }

  void Disk() {
    const fs::path where = dir_.empty() ? fs::current_path() : fs::path(dir_);
    std::error_code failure;
    const fs::space_info space = fs::space(where, failure);
    if (failure) return;  // the folder isn't there, which is said below
    const double free = static_cast<double>(space.available) / kGiB;
    const std::string text = fmt::format("{:.1f} GiB free in {}", free, ShownPath(where));
    if (access(where.c_str(), W_OK) != 0) {
      Problem("Disk", ShownPath(where) + " cannot be written to by this user; results go to results/ in it");
    } else if (free < kLeastDisk_GiB) {
      Problem("Disk", text + fmt::format(": results of a long run need more than {:.0f} GiB", kLeastDisk_GiB));
    } else {
      Fact("Disk", text);
    }
  }

  void Display() {
    std::string reason;
    const auto window = OffscreenWindow::Create(&reason);
    const std::string screen = EnvironmentText("DISPLAY") + EnvironmentText("WAYLAND_DISPLAY");
    const std::string desktop =
        screen.empty() ? "no screen, so trigpoint-desktop cannot open a window" : "screen " + screen;
    if (window == nullptr) {
      Problem("Display", "the report's scenes cannot be rendered: " + reason);
      Fact("Display", desktop);
    } else {
      Fact("Display", desktop + "; the report's scenes are rendered by " + window->Device());
    }
  }

  void Colmap() {
    const fs::path program = FindProgram("colmap");
    const std::string version = ColmapVersion(program, *session_.cancel);
    Fact("COLMAP", version.empty() ? "not installed; only `crosscheck` needs it (apt install colmap)"
                                   : version + " (" + program.string() + ")");
  }

  void Grids() {
    std::vector<std::string> there, missing;
    for (const char* name : {"egm84", "egm96", "egm2008"}) {
      try {
        there.push_back(HeightSystem::Named(name).name());
      } catch (const OptionError&) {
        missing.emplace_back(name);
      }
    }
    const std::string use = "; only heights above sea level need them (geographiclib-get-geoids egm96-5)";
    Fact("Geoids", there.empty()     ? "none installed" + use
                   : missing.empty() ? Listed(there)
                                     : Listed(there) + "; not installed: " + Listed(missing));
    const ProjInstallation proj = FindProj();
    if (!proj.version.empty()) {
      Fact("Grids",
           proj.grids > 0
               ? Counted(proj.grids, "grid") + " of PROJ"
               : "no PROJ grids installed: datum transformations are accurate to about 1 m (apt install proj-data)");
    }
  }

  void Folder() {
    const InitReport report = DescribeFolder(dir_);
    Fact("Found", Listed(report.found, 3));
    for (const std::string& line : report.missing) Problem("Missing", line);
    for (const std::string& line : report.warnings) Problem("Warning", line);
    const std::string dir = ShellWord(dir_);
    ending_.Next(fs::exists(report.file) ? "trigpoint run " + dir : "trigpoint init " + dir);
  }

  const Session& session_;
  const std::string version_, dir_;
  Ending ending_{""};
  int problems_ = 0;
  nlohmann::json json_ = {{"found", nlohmann::json::array()}, {"problems", nlohmann::json::array()}};
};

}  // namespace

void AddDoctorCommand(CLI::App& app, Session& session, const std::string& version) {
  CLI::App& command = AddCommand(app, session, "doctor",
                                 "check versions, memory, disk, display, COLMAP, geoids, and what a project lacks",
                                 "Reads only; works before `init` and while another process computes.\n\n"
                                 "Examples:\n  trigpoint doctor\n  trigpoint doctor my_site");
  const auto dir = std::make_shared<std::string>();
  command.add_option("DIR", *dir, "also look at this project or folder");
  command.callback([&session, dir, version] {
    session.action = [dir, version](Session& s) { return Doctor(s, version, *dir).Examine(); };
  });
}

}  // namespace trigpoint

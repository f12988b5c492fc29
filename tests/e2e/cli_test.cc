#include <gmock/gmock.h>
#include <sys/mount.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "datasets/io/text.h"
#include "datasets/project/project.h"
#include "tests/support/program.h"
#include "tests/support/project_folder.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

int Lines(const std::string& text) { return static_cast<int>(std::count(text.begin(), text.end(), '\n')); }

// One clear line on standard error, nothing on standard output.
void ExpectOneLine(const Finished& finished, int exit_code, const std::vector<std::string>& parts) {
  EXPECT_EQ(finished.exit_code, exit_code) << finished.err;
  EXPECT_EQ(finished.out, "");
  EXPECT_EQ(Lines(finished.err), 1) << finished.err;
  for (const std::string& part : parts) EXPECT_THAT(finished.err, HasSubstr(part));
}

std::map<std::string, std::string> States(const fs::path& dir) {
  const Finished status = Trigpoint({"status", dir.string(), "--json"});
  EXPECT_EQ(status.exit_code, 0) << status.err;
  std::map<std::string, std::string> states;
  const auto summary = status.Json();
  for (const auto& stage : summary.at("stages")) {
    states[stage["stage"].get<std::string>() + "/" + stage["name"].get<std::string>()] = stage["state"];
  }
  return states;
}

TEST(Cli, HelpNamesWhatIsBuiltAndNothingElse) {
  const Finished help = Trigpoint({"--help"});
  EXPECT_EQ(help.exit_code, 0);
  for (const char* command : {"demo", "init", "status", "run", "detect", "print", "plan", "check"}) {
    EXPECT_THAT(help.out, HasSubstr(std::string("\n  ") + command + " "));
    const Finished own = Trigpoint({command, "--help"});
    EXPECT_EQ(own.exit_code, 0);
    for (const char* part :
         {"--quiet", "--verbose", "--log-level", "--threads", "--seed", "--units", "--json", "Example", "130"}) {
      EXPECT_THAT(own.out, HasSubstr(part)) << command;
    }
  }
}

TEST(Cli, UsageErrorsAreOneLineAndExitTwo) {
  const ProjectFolder folder;
  const std::string dir = folder.dir().string();
  ExpectOneLine(Trigpoint({"stauts", dir}), 2, {"stauts", "nearest: 'status'"});
  ExpectOneLine(Trigpoint({}), 2, {"--help"});
  ExpectOneLine(Trigpoint({"run"}), 2, {"DIR"});
  ExpectOneLine(Trigpoint({"run", dir, "--fast"}), 2, {"--fast"});
  ExpectOneLine(Trigpoint({"run", dir, "--threads", "many"}), 2, {"--threads"});
  ExpectOneLine(Trigpoint({"run", dir, "--units", "yards"}), 2, {"yards"});
  ExpectOneLine(Trigpoint({"detect", dir, "--set", "min_margn=3"}), 2, {"min_margn", "'min_margin'"});
  ExpectOneLine(Trigpoint({"detect", dir, "--set", "min_margin=high"}), 2, {"min_margin", "a number", "high"});
  ExpectOneLine(Trigpoint({"detect", dir, "--set", "min_margin=-1"}), 2, {"min_margin", "-1"});
  ExpectOneLine(Trigpoint({"run", dir, "--set", "min_margin=1"}), 2, {"stage.option"});
  ExpectOneLine(Trigpoint({"run", dir, "--run", ""}), 2, {"--run '': expected a name"});
  ExpectOneLine(Trigpoint({"export", dir, "--to", ""}), 2, {"--to '': expected a name"});
}

TEST(Cli, LongTextsOfTheCommandLineAreCut) {
  const ProjectFolder folder;
  const std::string dir = folder.dir().string(), text(5000, 'a');
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{text},
                                                    {"run", text},
                                                    {"run", dir, "--run", text},
                                                    {"run", dir, "--units", text},
                                                    {"detect", dir, "--set", text},
                                                    {"detect", dir, "--set", "min_margin=" + text},
                                                    {"export", dir, "--to", text},
                                                    {"localize", dir, "--variant", text},
                                                    {"review", dir, "exclude", text},
                                                    {"print", dir, "--ids", "1," + text}}) {
    const Finished run = Trigpoint(arguments);
    EXPECT_THAT(run.exit_code, testing::AnyOf(1, 2));
    EXPECT_LT(run.err.size(), 1000u) << arguments.front();
    EXPECT_THAT(run.err, testing::Not(HasSubstr("unexpected error"))) << arguments.front();
  }
}

TEST(Cli, InitRunStatusOnFoldersOfAnyName) {
  for (const char* name : {"plain", "with space", "Straße \"Süd\"", "it's"}) {
    SCOPED_TRACE(name);
    const ProjectFolder folder(name);
    const Finished init = Trigpoint({"init", folder.dir().string()});
    EXPECT_EQ(init.exit_code, 0) << init.err;
    EXPECT_THAT(init.out, HasSubstr("Found     run run1"));
    EXPECT_EQ(States(folder.dir())["detect/run1"], "missing");
    const Finished run = Trigpoint({"detect", folder.dir().string(), "--json"});
    EXPECT_EQ(run.exit_code, 0) << run.err;
    EXPECT_EQ(run.Json()["stages"][0]["status"], "computed");
    EXPECT_EQ(States(folder.dir())["detect/run1"], "done");
    EXPECT_TRUE(fs::exists(folder / "results/detect/run2/detections.csv"));
    EXPECT_EQ(Trigpoint({"detect", folder.dir().string(), "--json"}).Json()["stages"][0]["status"], "up to date");
    folder.Write("runs/run1/detections.csv", folder.Read("runs/run1/detections.csv") + "# new\n");
    EXPECT_EQ(States(folder.dir())["detect/run1"], "out of date");
    EXPECT_EQ(States(folder.dir())["detect/run2"], "done");
  }
}

TEST(Cli, WhatIsPrintedMustArrive) {
  const ProjectFolder folder;
  const std::string program = TRIGPOINT_PROGRAM, dir = folder.dir().string();
  for (const std::string& arguments : {"status '" + dir + "'", std::string("--help"), std::string("--version")}) {
    const int status = std::system((program + " " + arguments + " > /dev/full 2> '" + dir + "/err'").c_str());
    EXPECT_EQ(WEXITSTATUS(status), 1) << arguments;
    EXPECT_THAT(folder.Read("err"), HasSubstr("standard output cannot be written"));
  }
}

TEST(Cli, AFileBeyondItsLimitIsAnError) {
  const ProjectFolder folder;
  const std::string dir = folder.dir().string();
  const int status = std::system(
      ("ulimit -f 0; " + std::string(TRIGPOINT_PROGRAM) + " init '" + dir + "' > /dev/null 2> /dev/null").c_str());
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 1);
  EXPECT_FALSE(fs::exists(folder / "trigpoint.yaml"));
}

TEST(Cli, QuietSaysNothing) {
  const ProjectFolder folder;
  const Finished run = Trigpoint({"detect", folder.dir().string(), "--quiet"});
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_EQ(run.out + run.err, "");
}

TEST(Cli, BadProjectFilesAreOneLine) {
  const struct {
    const char* yaml;
    int exit_code;
    std::vector<std::string> parts;
  } kFiles[] = {
      {"stages:\n  detct: {}\n", 2, {"trigpoint.yaml", "detct", "'detect'"}},
      {"stages:\n  detect: {min_margn: 3}\n", 2, {"trigpoint.yaml", "min_margn", "'min_margin'"}},
      {"stages:\n  detect: {min_margin: high, max_hamming: 1.5}\n", 2, {"min_margin", "max_hamming", "a whole number"}},
      {"variants: {v: {detect: {min_margin: -3}}}\n", 2, {"variants.v", "min_margin", "-3"}},
      {"stages:\n\tdetect: {}\n", 1, {"trigpoint.yaml:2", "tab"}},
      {"nme: x\n", 1, {"trigpoint.yaml:1", "nme", "'name'"}},
      {"runs: [../../other]\n", 1, {"trigpoint.yaml:1", "../../other", "leaves the project"}},
  };
  for (const auto& file : kFiles) {
    SCOPED_TRACE(file.yaml);
    const ProjectFolder folder;
    folder.Write("trigpoint.yaml", file.yaml);
    for (const char* command : {"status", "run"}) {
      ExpectOneLine(Trigpoint({command, folder.dir().string()}), file.exit_code, file.parts);
    }
    EXPECT_FALSE(fs::exists(folder / "results"));
  }
}

TEST(Cli, AFolderWithoutRunsIsRefused) {
  const ProjectFolder folder;
  fs::remove_all(folder.dir() / "runs");
  for (const char* command : {"detect", "localize"}) {
    ExpectOneLine(Trigpoint({command, folder.dir().string()}), 1,
                  {folder.dir().string(), "no run", command, "runs/<run>/"});
  }
}

TEST(Cli, OneBrokenRunIsNamedAndTheOtherIsDone) {
  const ProjectFolder folder;
  folder.Write("runs/run1/detections.csv", "timestamp,tag\n");
  const Finished run = Trigpoint({"detect", folder.dir().string()});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.err, HasSubstr("detect/run1: failed"));
  EXPECT_EQ(States(folder.dir())["detect/run1"], "failed");
  EXPECT_EQ(States(folder.dir())["detect/run2"], "done");
}

TEST(Cli, SecondWriterIsRefusedReadersWork) {
  const ProjectFolder folder;
  const Project project = Project::Open(folder.dir());
  {
    const auto lock = project.Lock();
    ExpectOneLine(Trigpoint({"run", folder.dir().string()}), 1, {"in use by process " + std::to_string(getpid())});
    EXPECT_THAT(Trigpoint({"status", folder.dir().string()}).out, HasSubstr("in use by process"));
  }
  EXPECT_EQ(Trigpoint({"detect", folder.dir().string()}).exit_code, 0);
}

TEST(Cli, FullAndReadOnlyResultsAreOneLine) {
  const ProjectFolder folder;
  const fs::path results = folder / "results";
  fs::create_directories(results);
  if (mount("tmpfs", results.c_str(), "tmpfs", 0, "size=64k") != 0) {
    GTEST_SKIP() << "needs the right to mount a small file system";
  }
  std::ofstream(results / "filler") << std::string(1 << 20, 'x');
  const Finished full = Trigpoint({"detect", folder.dir().string()});
  EXPECT_EQ(full.exit_code, 1);
  EXPECT_THAT(full.err, HasSubstr("No space left on device"));
  EXPECT_EQ(Trigpoint({"status", folder.dir().string()}).exit_code, 0);
  fs::remove(results / "filler");
  EXPECT_EQ(Trigpoint({"detect", folder.dir().string()}).exit_code, 0);

  EXPECT_EQ(mount("tmpfs", results.c_str(), "tmpfs", MS_REMOUNT | MS_RDONLY, ""), 0);
  ExpectOneLine(Trigpoint({"detect", folder.dir().string()}), 1, {"Read-only file system"});
  EXPECT_EQ(States(folder.dir())["detect/run1"], "done");
  umount(results.c_str());
}

// The embedded site with its second run only and coarse views, so that the whole of it takes seconds.
class SmallSite {
 public:
  SmallSite() {
    folder_.CopySecondRunOfParkingLot();
    folder_.Write("trigpoint.yaml",
                  "stages:\n"
                  "  references: {views: {size_px: 400}, references: {max_features: 600}}\n"
                  "  survey: {tie_points: false}\n");
  }
  const fs::path& dir() const { return folder_.dir(); }

 private:
  ProjectFolder folder_;
};

TEST(Cli, ZeroAnswersAndUselessTablesEndWithOne) {
  const SmallSite site;
  const std::string dir = site.dir().string();
  const std::string table = ReadTextFile(site.dir() / "panoramas.csv");
  std::string spaces = table;
  std::replace(spaces.begin(), spaces.end(), ',', ' ');
  for (const std::string& text : {spaces, std::string(), std::string("file,station\n")}) {
    WriteFileAtomically(site.dir() / "panoramas.csv", text);
    const Finished finished = Trigpoint({"localize", dir, "--json"});
    EXPECT_EQ(finished.exit_code, 1) << text;
    EXPECT_THAT(finished.err, HasSubstr("panoramas.csv"));
    EXPECT_THAT(finished.err, HasSubstr("nothing of this file is used"));
    EXPECT_FALSE(finished.Json()["ok"]);
    EXPECT_EQ(Trigpoint({"detect", dir}).exit_code, 0) << "needs no panorama";
  }
  WriteFileAtomically(site.dir() / "panoramas.csv", table);
  EXPECT_EQ(Trigpoint({"localize", dir}).exit_code, 0);
  for (const auto& [file, text] :
       {std::pair{"distances.csv", "from,to,distance_m\n"}, std::pair{"control_observations.csv", "points,image,u,v\n"},
        std::pair{"runs/run2/gps.csv", "timestamp_s,latitude_deg,longitude_deg\n"}}) {
    const fs::path path = site.dir() / file;
    const std::string before = fs::exists(path) ? ReadTextFile(path) : "";
    WriteFileAtomically(path, text);
    const Finished finished = Trigpoint({"localize", dir});
    EXPECT_EQ(finished.exit_code, 1) << file;
    EXPECT_THAT(finished.err, HasSubstr(std::string(file) + ":"));
    before.empty() ? (void)fs::remove(path) : WriteFileAtomically(path, before);
  }
}

TEST(Cli, CtrlCLeavesNoHarm) {
  const SmallSite site;
  const Program program({"run", site.dir().string()});
  const auto is_computing = [&] {
    if (!fs::exists(site.dir() / "results")) return false;
    for (const auto& entry : fs::recursive_directory_iterator(site.dir() / "results")) {
      if (entry.path().filename().string().starts_with(".tmp-") && entry.is_directory()) return true;
    }
    return false;
  };
  for (int i = 0; i < 12000 && !is_computing(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  program.Signal(SIGINT);
  const Finished finished = program.Wait();
  EXPECT_EQ(finished.exit_code, 130) << finished.err;
  EXPECT_THAT(finished.err, HasSubstr("cancelled"));
  EXPECT_FALSE(is_computing());
  EXPECT_EQ(Trigpoint({"status", site.dir().string()}).exit_code, 0);
}

}  // namespace
}  // namespace trigpoint

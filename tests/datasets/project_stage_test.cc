#include <gmock/gmock.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <opencv2/core.hpp>
#include <system_error>
#include <thread>

#include "datasets/project/files.h"
#include "datasets/project/forked.h"
#include "datasets/project/hash.h"
#include "datasets/project/manifest.h"
#include "datasets/project/stage.h"
#include "tests/support/project_folder.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

TEST(Hash, KnownAnswers) {  // FIPS 180-2, appendix B
  EXPECT_EQ(Sha256(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(Sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  const ProjectFolder folder;
  folder.Write("million", std::string(1000000, 'a'));
  EXPECT_EQ(Sha256OfFile(folder / "million"), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
  EXPECT_THAT(MessageOf<IoError>([&] { Sha256OfFile(folder / "none"); }), HasSubstr("none"));
}

TEST(FileHashes, KeepsOldFilesAndNoticesChanges) {
  const ProjectFolder folder;
  const auto an_hour_ago = fs::file_time_type::clock::now() - std::chrono::hours(1);
  folder.Write("old", "one");
  folder.Write("fresh", "one");
  fs::last_write_time(folder / "old", an_hour_ago);
  FileHashes hashes(folder.dir(), folder / ".hashes");
  EXPECT_EQ(hashes.Of(folder / "old"), Sha256("one"));
  EXPECT_EQ(hashes.Of(folder / "fresh"), Sha256("one"));
  hashes.Save();
  EXPECT_THAT(folder.Read(".hashes"), HasSubstr(" old\n"));
  EXPECT_THAT(folder.Read(".hashes"), testing::Not(HasSubstr("fresh")));  // could still change within its time stamp

  // Same size and time: the kept hash is believed, which shows that the file isn't read again.
  folder.Write("old", "two");
  fs::last_write_time(folder / "old", an_hour_ago);
  FileHashes again(folder.dir(), folder / ".hashes");
  EXPECT_EQ(again.Of(folder / "old"), Sha256("one"));
  fs::last_write_time(folder / "old", an_hour_ago + std::chrono::seconds(1));
  EXPECT_EQ(again.Of(folder / "old"), Sha256("two"));
}

// A project with one stage that writes its option into a file.
class StageTest : public testing::Test {
 protected:
  StageTest() : project_(Project::Open(folder_.dir())) {
    request_.stage = "toy";
    request_.name = "run1";
    request_.options = {{"size", 1}};
    request_.inputs = {folder_ / "control_points.csv", folder_ / "runs/run1"};
    request_.body = [this](StageContext& context) {
      ++computed_;
      std::ofstream(context.out / "result.txt") << context.seed;
      context.metrics["answers"] = 42;
      context.progress.Log(LogLevel::kWarning, "a bit odd");
    };
  }
  StageOutcome Run(uint64_t seed = 1) { return RunStage(project_, request_, 1, seed, progress_, cancel_); }
  StageState State(uint64_t seed = 1) { return StateOf(project_, request_, seed); }
  fs::path Result() const { return project_.ResultDir("toy", "run1"); }

  // Everything but the lock and the hashes that lies below results/.
  std::vector<std::string> Leftovers() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(project_.results() / "toy")) {
      names.push_back(entry.path().filename());
    }
    return names;
  }

  ProjectFolder folder_;
  Project project_;
  StageRequest request_;
  ProgressSink progress_;
  CancelToken cancel_;
  int computed_ = 0;
};

TEST_F(StageTest, ComputesOnceAndSaysEverythingInTheManifest) {
  EXPECT_EQ(State(), StageState::kMissing);
  const StageOutcome first = Run();
  EXPECT_TRUE(first.computed);
  EXPECT_EQ(State(), StageState::kDone);
  const nlohmann::json& m = first.manifest;
  EXPECT_EQ(m["schema"], 2);
  EXPECT_EQ(m["stage"], "toy");
  EXPECT_EQ(m["name"], "run1");
  EXPECT_EQ(m["options"]["size"], 1);
  EXPECT_EQ(m["inputs"]["control_points.csv"], Sha256(folder_.Read("control_points.csv")));
  EXPECT_EQ(m["inputs"]["runs/run1/odometry.tum"], Sha256(folder_.Read("runs/run1/odometry.tum")));
  EXPECT_EQ(m["files"]["result.txt"], Sha256("1"));
  EXPECT_EQ(m["seed"], 1);
  EXPECT_EQ(m["threads"], 1);
  EXPECT_EQ(m["metrics"]["answers"], 42);
  EXPECT_EQ(m["warnings"][0], "a bit odd");
  EXPECT_EQ(m["status"], "done");
  EXPECT_TRUE(m["error"].is_null());
  EXPECT_GT(m["peak_memory_bytes"], 1 << 20);
  EXPECT_GE(m["wall_seconds"], 0);
  EXPECT_GE(m["cpu_seconds"], 0);
  EXPECT_THAT(m["start"].get<std::string>(), testing::MatchesRegex("20..-..-..T..:..:..Z"));
  EXPECT_THAT(folder_.Read("results/toy/run1/log.txt"), HasSubstr("warning a bit odd"));
  EXPECT_EQ(ReadManifest(project_, "toy", "run1"), m);

  const StageOutcome second = Run();
  EXPECT_FALSE(second.computed);
  EXPECT_EQ(second.manifest, m);
  EXPECT_EQ(computed_, 1);
}

TEST_F(StageTest, EachPartOfTheIdentityCounts) {
  const std::pair<const char*, std::function<void()>> kChanges[] = {
      {"option", [&] { request_.options["size"] = 2; }},
      {"version", [&] { request_.version = 2; }},
      {"value", [&] { request_.values["origin"] = 1.5; }},
      {"input's content", [&] { folder_.Write("control_points.csv", folder_.Read("control_points.csv") + "# x\n"); }},
      {"new file in an input folder", [&] { folder_.Write("runs/run1/gps.csv", "x"); }},
      {"another input", [&] { request_.inputs.push_back(folder_ / "later.csv"); }},
      {"input that comes to be", [&] { folder_.Write("later.csv", "x"); }},
      {"artefact lost", [&] { fs::remove(Result() / "result.txt"); }},
      {"artefact changed", [&] { std::ofstream(Result() / "result.txt") << "edited"; }},
  };
  Run();
  for (const auto& [what, change] : kChanges) {
    SCOPED_TRACE(what);
    change();
    EXPECT_EQ(State(), StageState::kOutOfDate);
    EXPECT_TRUE(Run().computed);
    EXPECT_EQ(State(), StageState::kDone);
    EXPECT_FALSE(Run().computed);
  }
  EXPECT_EQ(State(2), StageState::kOutOfDate);  // seed
  EXPECT_TRUE(RunStage(project_, request_, 2, 2, progress_, cancel_).computed);
  EXPECT_FALSE(RunStage(project_, request_, 1, 2, progress_, cancel_).computed);  // threads don't count
}

TEST_F(StageTest, TheResultBeforeADecisionIsKeptAndBroughtBack) {
  const nlohmann::json first = Run().manifest;
  request_.values["review"] = {{"exclude", "tag:7"}};
  const nlohmann::json second = Run().manifest;
  EXPECT_EQ(computed_, 2);
  request_.values.erase("review");
  EXPECT_EQ(State(), StageState::kOutOfDate);
  EXPECT_EQ(Run().manifest, first);  // taken back
  EXPECT_EQ(State(), StageState::kDone);
  request_.values["review"] = {{"exclude", "tag:7"}};
  EXPECT_EQ(Run().manifest, second);  // and made again
  EXPECT_EQ(computed_, 2);
  // One that was changed is no result.
  folder_.Write("results/toy/.before-run1/result.txt", "changed");
  request_.values.erase("review");
  Run();
  EXPECT_EQ(computed_, 3);
  // Other options are no decision: nothing is kept for them.
  request_.options["size"] = 2;
  Run();
  request_.options["size"] = 1;
  Run();
  EXPECT_EQ(computed_, 5);
}

TEST_F(StageTest, EarlierResultCountsByWhatItHolds) {
  StageRequest later = request_;
  later.stage = "later";
  later.inputs = {Result() / "manifest.json"};
  Run();
  EXPECT_TRUE(RunStage(project_, later, 1, 1, progress_, cancel_).computed);
  request_.options["size"] = 2;  // made again, the same came out
  EXPECT_TRUE(Run().computed);
  EXPECT_FALSE(RunStage(project_, later, 1, 1, progress_, cancel_).computed);
  EXPECT_TRUE(Run(7).computed);  // another content
  EXPECT_TRUE(RunStage(project_, later, 1, 1, progress_, cancel_).computed);
}

TEST_F(StageTest, FailureKeepsTheOldResultAndLeavesARecord) {
  Run();
  request_.options["size"] = 2;
  const auto good = request_.body;
  request_.body = [](StageContext& context) {
    std::ofstream(context.out / "half.txt") << "half";
    throw InputError("images.txt:3: expected a picture");
  };
  EXPECT_THAT(MessageOf<InputError>([&] { Run(); }), HasSubstr("images.txt:3"));
  EXPECT_EQ(State(), StageState::kFailed);
  EXPECT_EQ(folder_.Read("results/toy/run1/result.txt"), "1");
  const auto record = ReadFailure(project_, "toy", "run1");
  ASSERT_TRUE(record);
  EXPECT_EQ((*record)["status"], "failed");
  EXPECT_EQ((*record)["error"], "images.txt:3: expected a picture");
  EXPECT_THAT(folder_.Read("results/toy/.failed-run1/log.txt"), HasSubstr("error images.txt:3"));
  EXPECT_FALSE(fs::exists(folder_ / "results/toy/.failed-run1/half.txt"));

  request_.options["size"] = 1;  // back to what the old result was made of
  EXPECT_EQ(State(), StageState::kDone);
  Run();
  EXPECT_FALSE(ReadFailure(project_, "toy", "run1"));
  request_.options["size"] = 2;
  EXPECT_THAT(MessageOf<InputError>([&] { Run(); }), HasSubstr("images.txt:3"));
  EXPECT_TRUE(ReadFailure(project_, "toy", "run1"));
  request_.body = good;
  Run();
  EXPECT_EQ(State(), StageState::kDone);
  EXPECT_THAT(Leftovers(), testing::ElementsAre("run1"));
}

TEST_F(StageTest, ForeignExceptionsBecomeErrors) {
  request_.body = [](StageContext&) { throw std::out_of_range("vector::at"); };
  EXPECT_THAT(MessageOf<Error>([&] { Run(); }), HasSubstr("vector::at"));
  request_.body = [](StageContext&) { throw std::bad_alloc(); };
  EXPECT_THAT(MessageOf<MemoryError>([&] { Run(); }), HasSubstr("memory"));
  request_.body = [](StageContext&) { throw cv::Exception(cv::Error::StsNoMem, "4 bytes", "", "alloc.cpp", 73); };
  EXPECT_EQ(MessageOf<MemoryError>([&] { Run(); }), "not enough memory; use fewer --threads or smaller images");
  request_.body = [](StageContext&) { throw std::system_error(EAGAIN, std::generic_category()); };
  EXPECT_THAT(MessageOf<MemoryError>([&] { Run(); }), HasSubstr("not enough memory for another thread"));
  request_.body = [](StageContext& c) { fs::copy_file(c.out / "none", c.out / "x"); };
  EXPECT_THAT(MessageOf<IoError>([&] { Run(); }), HasSubstr("none"));
}

TEST_F(StageTest, CancellationLeavesOnlyTheOldResult) {
  Run();
  request_.options["size"] = 2;
  request_.body = [this](StageContext& context) {
    std::ofstream(context.out / "half.txt") << "half";
    cancel_.Cancel();
    context.cancel.ThrowIfCancelled();
  };
  EXPECT_THROW(Run(), Cancelled);
  EXPECT_THAT(Leftovers(), testing::ElementsAre("run1"));
  EXPECT_EQ(State(), StageState::kOutOfDate);
}

TEST_F(StageTest, SecondWriterIsRefusedReadersWork) {
  request_.body = [&](StageContext&) {
    const Project other = Project::Open(folder_.dir());
    const std::string message = MessageOf<IoError>([&] { RunStage(other, request_, 1, 1, progress_, CancelToken()); });
    EXPECT_THAT(message, HasSubstr("in use by process " + std::to_string(getpid())));
    EXPECT_THAT(message, HasSubstr("toy/run1"));
    EXPECT_EQ(StateOf(other, request_, 1), StageState::kRunning);
  };
  Run();
  EXPECT_EQ(State(), StageState::kDone);
  EXPECT_FALSE(ProjectLock::Holder(project_.results()));
}

// Runs `body` in a child process that is killed as soon as it has created `sign`.
void KillWhenThere(const fs::path& sign, const std::function<void()>& body) {
  const pid_t child = fork();
  if (child == 0) {
    body();
    _exit(0);
  }
  for (int i = 0; i < 2000 && !fs::exists(sign); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  ASSERT_TRUE(fs::exists(sign));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
}

TEST_F(StageTest, KilledHolderLeavesNoLockAndNoHalfResult) {
  Run();
  request_.options["size"] = 2;
  const auto good = request_.body;
  request_.body = [](StageContext& context) {
    std::ofstream(context.out / "half.txt") << "half";
    std::this_thread::sleep_for(std::chrono::minutes(1));
  };
  KillWhenThere(folder_ / "results/toy/.tmp-run1/half.txt", [&] { Run(); });
  EXPECT_TRUE(fs::exists(folder_ / "results/toy/.tmp-run1"));
  EXPECT_NE(folder_.Read("results/.lock"), "");  // the dead holder's words
  EXPECT_FALSE(ProjectLock::Holder(project_.results()));
  EXPECT_EQ(State(), StageState::kOutOfDate);
  EXPECT_EQ(folder_.Read("results/toy/run1/result.txt"), "1");

  request_.body = good;
  EXPECT_TRUE(Run().computed);
  EXPECT_THAT(Leftovers(), testing::ElementsAre("run1"));
}

TEST_F(StageTest, ReplacementCutBetweenItsStepsIsUndone) {
  Run();
  fs::rename(Result(), folder_ / "results/toy/.old-run1");  // a file system that cannot exchange names, and a kill
  EXPECT_FALSE(Run().computed);
  EXPECT_EQ(folder_.Read("results/toy/run1/result.txt"), "1");
}

TEST_F(StageTest, OnlyWhatAStageWroteIsRemoved) {
  Run();
  folder_.Write("results/toy/run1/notes/mine.txt", "mine");
  EXPECT_FALSE(RemoveResult(project_, "toy", "run1"));
  EXPECT_EQ(State(), StageState::kDone);
  fs::remove_all(Result() / "notes");
  const std::string manifest = folder_.Read("results/toy/run1/manifest.json");
  folder_.Write("results/toy/run1/manifest.json", "{}");
  EXPECT_FALSE(RemoveResult(project_, "toy", "run1"));
  EXPECT_TRUE(fs::exists(Result() / "result.txt"));
  folder_.Write("results/toy/run1/manifest.json", manifest);
  EXPECT_TRUE(RemoveResult(project_, "toy", "run1"));
  EXPECT_THAT(Leftovers(), testing::IsEmpty());
  EXPECT_FALSE(RemoveResult(project_, "toy", "run1"));
}

TEST_F(StageTest, FilesOfTheUserInAResultAreKept) {
  Run();
  folder_.Write("results/toy/run1/notes/mine.txt", "mine");
  request_.options["size"] = 2;
  Run();
  EXPECT_EQ(folder_.Read("results/toy/run1/notes/mine.txt"), "mine");
  fs::remove_all(folder_ / "results/toy/run1");
  folder_.Write("results/toy/run1/mine.txt", "mine");
  EXPECT_THAT(MessageOf<InputError>([&] { Run(); }), HasSubstr("did not write"));
  EXPECT_EQ(folder_.Read("results/toy/run1/mine.txt"), "mine");
}

TEST_F(StageTest, ADamagedManifestIsNoticedAndSaid) {
  Run();
  const std::string whole = folder_.Read("results/toy/run1/manifest.json");
  EXPECT_EQ(ManifestDamage(project_, "toy", "run1"), "");
  const std::vector<std::pair<std::string, std::string>> damages = {{"\"stage\": \"toy\"", "\"stage\": 7"},
                                                                    {"\"answers\": 42", "\"answers\": 43"},
                                                                    {"a bit odd", "a bit old"},
                                                                    {"{", "["}};
  for (const auto& [from, to] : damages) {
    std::string damaged = whole;
    ASSERT_NE(damaged.find(from), std::string::npos) << from;
    folder_.Write("results/toy/run1/manifest.json", damaged.replace(damaged.find(from), from.size(), to));
    EXPECT_NE(ManifestDamage(project_, "toy", "run1"), "") << to;
    EXPECT_EQ(State(), StageState::kMissing) << to;
    struct Listener final : ProgressSink {
      void Log(LogLevel level, std::string_view line) override {
        if (level == LogLevel::kWarning) text += line;
      }
      std::string text;
    } listener;
    EXPECT_TRUE(RunStage(project_, request_, 1, 1, listener, cancel_).computed);
    EXPECT_THAT(listener.text, HasSubstr("manifest.json: expected a manifest as it was written, found a damaged one"));
  }
}

// Of itself and of each file. Older versions, whose schema is 1, had none of itself.
TEST_F(StageTest, AManifestWithoutHashesIsDamaged) {
  const std::string file = "results/toy/run1/manifest.json";
  using nlohmann::json;
  const std::vector<std::pair<std::function<void(json*)>, std::string>> changes = {
      {[](json* m) { m->erase("sha256"); }, "it has no SHA-256 of itself"},
      {[](json* m) { m->erase("files"); }, "it does not list the result's files, each with its SHA-256"},
      {[](json* m) { (*m)["files"]["result.txt"] = nullptr; }, "it does not list the result's files"},
      {[](json* m) { (*m)["files"]["../x"] = (*m)["files"]["result.txt"]; }, "it does not list the result's files"},
      {[](json* m) { (*m)["schema"] = 3; }, "its schema is 3, not 2"}};
  for (const auto& [change, why] : changes) {
    Run();
    json manifest = json::parse(folder_.Read(file));
    change(&manifest);
    if (manifest.contains("sha256")) {
      manifest.erase("sha256");
      manifest["sha256"] = Sha256(DumpJson(manifest));
    }
    folder_.Write(file, manifest.dump());
    EXPECT_THAT(ManifestDamage(project_, "toy", "run1"), HasSubstr(why));
    EXPECT_EQ(State(), StageState::kMissing) << why;
    EXPECT_TRUE(Run().computed) << why;
  }
  json old = json::parse(folder_.Read(file));
  old.erase("sha256");
  old["schema"] = 1;
  folder_.Write(file, old.dump());
  EXPECT_EQ(State(), StageState::kDone);
}

TEST_F(StageTest, ARepeatedWarningIsSaidOnceWithItsCount) {
  request_.body = [](StageContext& context) {
    for (int i = 0; i < 3; ++i) context.progress.Log(LogLevel::kWarning, "the same");
    context.progress.Log(LogLevel::kWarning, "another");
  };
  struct Listener final : ProgressSink {
    void Log(LogLevel level, std::string_view) override { warnings += level == LogLevel::kWarning ? 1 : 0; }
    int warnings = 0;
  } listener;
  const StageOutcome outcome = RunStage(project_, request_, 1, 1, listener, cancel_);
  EXPECT_EQ(listener.warnings, 2);
  EXPECT_EQ(outcome.manifest["warnings"], (nlohmann::json{"the same (3 times)", "another"}));
}

TEST_F(StageTest, BrokenManifestCountsAsNone) {
  Run();
  folder_.Write("results/toy/run1/manifest.json", "{\"schema\": 1, ");
  EXPECT_EQ(State(), StageState::kMissing);
  EXPECT_TRUE(Run().computed);
  EXPECT_EQ(State(), StageState::kDone);
}

// A small file system of its own at results/; skips the test where this user may not mount one.
class MountedResults {
 public:
  explicit MountedResults(const fs::path& results) : results_(results) {
    fs::create_directories(results_);
    mounted_ = mount("tmpfs", results_.c_str(), "tmpfs", 0, "size=256k") == 0;
  }
  ~MountedResults() {
    if (mounted_) umount(results_.c_str());
  }
  bool mounted() const { return mounted_; }
  void MakeReadOnly() const { mount("tmpfs", results_.c_str(), "tmpfs", MS_REMOUNT | MS_RDONLY, ""); }

 private:
  fs::path results_;
  bool mounted_ = false;
};

TEST_F(StageTest, FullDiskIsNamedAndTheOldResultStays) {
  const MountedResults disk(project_.results());
  if (!disk.mounted()) GTEST_SKIP() << "needs the right to mount a small file system";
  Run();
  request_.options["size"] = 2;
  request_.body = [](StageContext& context) {  // a writer that doesn't look at its stream
    std::ofstream(context.out / "large.bin") << std::string(1 << 20, 'x');
  };
  EXPECT_THAT(MessageOf<IoError>([&] { Run(); }), HasSubstr("No space left on device; free some space"));
  EXPECT_EQ(folder_.Read("results/toy/run1/result.txt"), "1");
  request_.options["size"] = 1;
  EXPECT_EQ(State(), StageState::kDone);
}

TEST_F(StageTest, ReadOnlyResultsAreNamedAndCanBeRead) {
  const MountedResults disk(project_.results());
  if (!disk.mounted()) GTEST_SKIP() << "needs the right to mount a small file system";
  Run();
  disk.MakeReadOnly();
  EXPECT_EQ(State(), StageState::kDone);
  request_.options["size"] = 2;
  EXPECT_THAT(MessageOf<IoError>([&] { Run(); }), HasSubstr("Read-only file system"));
  EXPECT_EQ(State(), StageState::kOutOfDate);
}

}  // namespace
}  // namespace trigpoint

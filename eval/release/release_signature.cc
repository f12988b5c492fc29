#include "eval/release/release_signature.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <sstream>
#include <thread>

#include "datasets/io/text.h"
#include "datasets/project/child_process.h"
#include "datasets/project/files.h"
#include "datasets/project/release_files.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

constexpr const char* kNamespace = "trigpoint-release";  // SSH: what the signature is for

// A folder of our own that goes with the object.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name = (fs::temp_directory_path() / "trigpoint-signature-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw IoErrorFor(name, "created", errno);
    folder_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  fs::path operator/(const char* file) const { return folder_ / file; }

 private:
  fs::path folder_;
};

struct ToolResult {
  int exit_code = -1;
  std::string text;  // what it printed
};

// The program in our own process group, so that it can ask for a passphrase on the terminal.
ToolResult RunTool(std::vector<std::string> argv, const fs::path& input, const fs::path& log,
                   const CancelToken& cancel) {
  std::vector<char*> arguments;
  for (std::string& argument : argv) arguments.push_back(argument.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, input.c_str(), O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  pid_t child = 0;
  const int error = posix_spawn(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) throw IoErrorFor(argv[0], "started", error);
  int status = 0;
  while (waitpid(child, &status, WNOHANG) == 0) {
    if (cancel.IsCancelled()) kill(child, SIGTERM);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  cancel.ThrowIfCancelled();
  return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), ReadTextFile(log)};
}

std::string Program(const char* name, const char* package) {
  const fs::path program = FindProgram(name);
  if (program.empty()) {
    throw InputError(fmt::format("{} is needed for signatures and is not installed: apt install {}", name, package));
  }
  return program.string();
}

std::string FirstLine(const std::string& text) {
  std::istringstream in(text);
  std::string line;
  while (std::getline(in, line) && Trim(line).empty()) {
  }
  return CleanPath(std::string(Trim(line)));
}

// "[GNUPG:] WORD rest" among gpg's status lines; nothing if there is none.
std::optional<std::string> Status(const std::string& text, const std::string& word) {
  std::istringstream in(text);
  const std::string begin = "[GNUPG:] " + word + " ";
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with(begin)) return CleanPath(line.substr(begin.size()));
  }
  return std::nullopt;
}

fs::path DefaultSshKey() {
  const char* home = std::getenv("HOME");
  for (const char* name : {"id_ed25519", "id_ecdsa", "id_rsa"}) {
    const fs::path key = fs::path(home == nullptr ? "" : home) / ".ssh" / name;
    if (home != nullptr && fs::exists(key)) return key;
  }
  throw OptionError("--sign: there is no key in ~/.ssh; give the file of an SSH key, or gpg:KEY");
}

// Does the file list who may sign, in the form of ssh-keygen(1)? A public key alone is turned into one.
fs::path AllowedSigners(const fs::path& signers, const ScratchFolder& scratch) {
  std::istringstream in(ReadTextFile(signers));
  std::string allowed;
  for (std::string line; std::getline(in, line);) {
    const std::string_view text = Trim(line);
    if (text.empty() || text.front() == '#') continue;
    const bool is_key = text.starts_with("ssh-") || text.starts_with("ecdsa-") || text.starts_with("sk-");
    if (!is_key) return signers;
    std::istringstream words{std::string(text)};
    std::string type, key, comment;
    words >> type >> key >> comment;
    allowed += (comment.empty() ? "signer" : comment) + " " + type + " " + key + "\n";
  }
  if (allowed.empty()) throw InputError(signers.string() + ": expected public keys or an allowed_signers file");
  WriteFileAtomically(scratch / "allowed", allowed);
  return scratch / "allowed";
}

Signature CheckSsh(const fs::path& record, const fs::path& file, const std::string& signers,
                   const CancelToken& cancel) {
  const std::string program = Program("ssh-keygen", "openssh-client");
  const ScratchFolder scratch;
  Signature signature;
  const ToolResult check = RunTool({program, "-Y", "check-novalidate", "-n", kNamespace, "-s", file.string()}, record,
                                   scratch / "log", cancel);
  if (check.exit_code != 0) {
    signature.state = Signature::State::kBroken;
    signature.reason = FirstLine(check.text);
    return signature;
  }
  signature.state = Signature::State::kHolds;
  const size_t with = check.text.find(" with ");
  if (with != std::string::npos) signature.key = FirstLine(check.text.substr(with + 6));
  if (signers.empty()) return signature;
  const std::string allowed = AllowedSigners(signers, scratch).string();
  const ToolResult found =
      RunTool({program, "-Y", "find-principals", "-s", file.string(), "-f", allowed}, record, scratch / "log", cancel);
  signature.signer = found.exit_code == 0 ? FirstLine(found.text) : "";
  const ToolResult verified =
      RunTool({program, "-Y", "verify", "-f", allowed, "-I", signature.signer, "-n", kNamespace, "-s", file.string()},
              record, scratch / "log", cancel);
  if (found.exit_code != 0 || verified.exit_code != 0) {
    signature.state = Signature::State::kBroken;
    signature.signer.clear();
    signature.reason = "made by a key that " + signers + " does not name";
    return signature;
  }
  signature.is_trusted = true;
  return signature;
}

Signature CheckGpg(const fs::path& record, const fs::path& file, const std::string& signers,
                   const CancelToken& cancel) {
  const std::string program = Program("gpg", "gnupg");
  const ScratchFolder scratch;
  std::vector<std::string> argv = {program, "--batch", "--no-tty"};
  if (!signers.empty()) {
    fs::create_directories(scratch / "home");
    fs::permissions(scratch / "home", fs::perms::owner_all);
    argv.insert(argv.end(), {"--homedir", (scratch / "home").string()});
    std::vector<std::string> import = argv;
    import.insert(import.end(), {"--import", signers});
    const ToolResult done = RunTool(import, "/dev/null", scratch / "log", cancel);
    if (done.exit_code != 0) throw InputError(signers + ": expected OpenPGP public keys: " + FirstLine(done.text));
  }
  argv.insert(argv.end(), {"--status-fd", "1", "--verify", file.string(), record.string()});
  const ToolResult check = RunTool(argv, "/dev/null", scratch / "log", cancel);
  Signature signature;
  const std::optional<std::string> good = Status(check.text, "GOODSIG"), valid = Status(check.text, "VALIDSIG");
  if (check.exit_code != 0 || !good || !valid) {
    signature.state = Signature::State::kBroken;
    signature.reason = Status(check.text, "NO_PUBKEY")
                           ? "made by the OpenPGP key " + *Status(check.text, "NO_PUBKEY") + ", which is not known" +
                                 (signers.empty() ? "; import it, or give its file by --signers" : " to " + signers)
                           : FirstLine(check.text);
    if (Status(check.text, "BADSIG")) signature.reason = "release.json is not what was signed";
    return signature;
  }
  signature.state = Signature::State::kHolds;
  signature.key = "OpenPGP key " + valid->substr(0, valid->find(' '));
  signature.signer = good->substr(std::min(good->find(' ') + 1, good->size()));
  signature.is_trusted = !signers.empty();
  return signature;
}

}  // namespace

void SignRelease(const fs::path& release, const std::string& key, const CancelToken& cancel) {
  const fs::path record = release / kReleaseRecord;
  const ScratchFolder scratch;
  ToolResult done;
  fs::path made;
  if (key.starts_with("gpg:")) {
    made = release / kGpgSignature;
    done = RunTool({Program("gpg", "gnupg"), "--armor", "--detach-sign", "--local-user", key.substr(4), "--output",
                    made.string(), record.string()},
                   "/dev/null", scratch / "log", cancel);
  } else {
    const fs::path file = key.empty() ? DefaultSshKey() : fs::path(key);
    if (!fs::is_regular_file(file)) {
      throw OptionError("--sign " + key + ": expected the file of an SSH key, or gpg:KEY, found no such file");
    }
    made = release / kSshSignature;
    done = RunTool(
        {Program("ssh-keygen", "openssh-client"), "-Y", "sign", "-f", file.string(), "-n", kNamespace, record.string()},
        "/dev/null", scratch / "log", cancel);
  }
  if (done.exit_code != 0 || !fs::exists(made)) {
    throw InputError("the release was not signed and not published: " + FirstLine(done.text));
  }
  const Signature check = CheckSignature(release, "", cancel);
  if (check.state != Signature::State::kHolds) {
    throw InputError("the release was not published, its signature does not hold: " + check.reason);
  }
  fs::permissions(made, fs::perms::owner_read | fs::perms::group_read | fs::perms::others_read);
}

Signature CheckSignature(const fs::path& release, const std::string& signers, const CancelToken& cancel) {
  if (!signers.empty() && !fs::is_regular_file(signers)) {
    throw InputError(signers + ": expected a file with public keys, found none");
  }
  constexpr uintmax_t kLargest = 1'000'000;  // bytes of a signature
  for (const char* name : {kSshSignature, kGpgSignature}) {
    std::error_code failure;
    if (!fs::exists(fs::symlink_status(release / name, failure))) continue;
    const std::optional<fs::path> file = PlainFile(release, name);
    Signature signature;
    if (!file || fs::file_size(*file, failure) > kLargest) {
      signature.state = Signature::State::kBroken;
      signature.reason = std::string(name) + " is no signature file";
      return signature;
    }
    const bool ssh = name == std::string(kSshSignature);
    return ssh ? CheckSsh(release / kReleaseRecord, *file, signers, cancel)
               : CheckGpg(release / kReleaseRecord, *file, signers, cancel);
  }
  return {};
}

}  // namespace trigpoint

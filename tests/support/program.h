// The program under test as a child process.
#pragma once

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

namespace trigpoint {

struct Finished {
  int exit_code = -1;  // 128 + signal, if a signal ended it
  std::string out, err;
  nlohmann::json Json() const { return nlohmann::json::parse(out, nullptr, false); }
};

class Program {
 public:
  explicit Program(std::vector<std::string> arguments) {
    static int count = 0;
    base_ = std::filesystem::temp_directory_path() /
            ("trigpoint_e2e_" + std::to_string(getpid()) + "_" + std::to_string(count++));
    arguments.insert(arguments.begin(), TRIGPOINT_PROGRAM);
    child_ = fork();
    if (child_ != 0) return;
    Redirect(STDOUT_FILENO, File(".out"));
    Redirect(STDERR_FILENO, File(".err"));
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    execv(argv[0], argv.data());
    _exit(127);
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
  ~Program() {
    std::error_code ignored;
    for (const char* end : {".out", ".err"}) std::filesystem::remove(File(end), ignored);
  }

  void Signal(int signal) const { kill(child_, signal); }
  Finished Wait() const {
    int status = 0;
    waitpid(child_, &status, 0);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), Read(File(".out")), Read(File(".err"))};
  }

 private:
  std::filesystem::path File(const char* end) const { return base_.string() + end; }
  static void Redirect(int to, const std::filesystem::path& file) {
    dup2(open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), to);
  }
  static std::string Read(const std::filesystem::path& file) {
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
  }

  std::filesystem::path base_;
  pid_t child_ = -1;
};

inline Finished Trigpoint(const std::vector<std::string>& arguments) { return Program(arguments).Wait(); }

}  // namespace trigpoint

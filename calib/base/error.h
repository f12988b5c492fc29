// The errors that cross a public boundary. A message names the file, line or id, what was expected,
// what was found, and what to do; the launcher turns it into one line and an exit code.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

namespace trigpoint {

// The text of files, other libraries and users in a message cannot break it into lines: control characters become
// spaces.
class Error : public std::runtime_error {
 public:
  explicit Error(std::string message) : std::runtime_error(OneLine(std::move(message))) {}
  // Process exit code, as fixed for every command: 1 failed, 2 usage, 3 a gate failed, 130 cancelled.
  virtual int ExitCode() const { return 1; }

 private:
  static std::string OneLine(std::string text) {
    for (char& c : text) {
      if ((c >= 0 && c < ' ') || c == '\x7f') c = ' ';
    }
    return text;
  }
};

// What the user brought cannot be used as it is.
class InputError : public Error {
 public:
  using Error::Error;
};

// An option is unknown, of the wrong type, or out of range.
class OptionError : public Error {
 public:
  using Error::Error;
  int ExitCode() const override { return 2; }
};

// A file or folder cannot be read or written.
class IoError : public Error {
 public:
  using Error::Error;
};

// An estimation problem has no usable answer (singular, diverged).
class NumericError : public Error {
 public:
  using Error::Error;
};

class Cancelled : public Error {
 public:
  Cancelled() : Error("cancelled; finished stages are kept, run the same command again to go on") {}
  int ExitCode() const override { return 130; }
};

}  // namespace trigpoint

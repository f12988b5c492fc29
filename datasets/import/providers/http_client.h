// HTTP as services of panoramas need it: TLS verified, sizes bounded, rate limits kept, failures retried.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/base/error.h"
#include "calib/base/progress.h"

namespace trigpoint {

struct HttpOptions {
  int attempts = 5;            // of one request, the first included
  double first_wait_s = 1;     // before the second; doubled each time, unless the server names a time
  double longest_wait_s = 60;  // a server that asks for more is given up
  double connect_timeout_s = 15;
  double stall_timeout_s = 30;  // without a byte
  double requests_per_s = 10;   // at most
};

// The host cannot be reached, or the transfer breaks off each time.
class NetworkError : public Error {
 public:
  using Error::Error;
};

struct HttpAnswer {
  int status = 0;
  std::string body;
  // By Cache-Control, s; 0: it must not be stored; nothing: not stated.
  std::optional<int64_t> max_age_s;
  std::optional<double> retry_after_s;  // of a refusal: when the server wants to be asked again
};

// One server at a time, from one thread. Proxies are those of the environment (https_proxy, http_proxy, no_proxy).
// Messages name addresses without their query, so that no key shows.
class HttpClient {
 public:
  // `source` begins the messages; `base` is the service's address: over https, or http on this machine alone.
  HttpClient(std::string source, const std::string& base, const HttpOptions& options);
  ~HttpClient();
  HttpClient(const HttpClient&) = delete;
  HttpClient& operator=(const HttpClient&) = delete;

  // A header for requests to the base address, such as a token. It is sent nowhere else.
  void AddHeader(const std::string& name, const std::string& value);

  // GETs `url`, or POSTs `json` to it unless that is empty. A transfer that breaks off is resumed where it broke if the
  // server can. Statuses 429 and 5xx are retried; what is left of them and 4xx are returned. Throws NetworkError,
  // InputError if the body is longer than `max_bytes` or the address is not one to be trusted, Cancelled.
  HttpAnswer Get(const std::string& url, size_t max_bytes, const CancelToken& cancel, const std::string& json = "");

  const std::string& base() const { return base_; }

 private:
  struct Transfer;
  void WaitForTurn(const CancelToken& cancel);
  void Perform(const std::string& url, const std::string& json, Transfer* transfer);

  std::string source_, base_;
  HttpOptions options_;
  void* curl_ = nullptr;
  std::vector<std::string> headers_;
  std::chrono::steady_clock::time_point next_;
};

// The address without user, password, query and fragment, for messages.
std::string WithoutQuery(const std::string& url);
// With %XX as the characters they stand for.
std::string Unescaped(const std::string& text);
// Is that the http address of a server on this machine?
bool IsOnThisMachine(const std::string& origin);
// "https://host:port" of an address, "" if it is none.
std::string OriginOf(const std::string& url);

}  // namespace trigpoint

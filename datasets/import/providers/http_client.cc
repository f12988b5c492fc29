#include "datasets/import/providers/http_client.h"

#include <curl/curl.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <mutex>
#include <optional>
#include <thread>

#include "datasets/io/readable.h"
#include "datasets/io/text.h"

namespace trigpoint {

using Clock = std::chrono::steady_clock;

namespace {

// RFC 9111, as far as it limits a private cache.
std::optional<int64_t> MaxAgeOf(const std::string& cache_control) {
  std::optional<int64_t> age;
  for (const std::string_view part : SplitAt(cache_control, ',')) {
    constexpr std::string_view kMaxAge = "max-age=";
    if (part == "no-store") return 0;
    if (part.starts_with(kMaxAge)) age = ParseInt(part.substr(kMaxAge.size()));
  }
  return age;
}

// RFC 9110: seconds, or a date.
std::optional<double> RetryAfterOf(const std::string& value) {
  const auto seconds = ParseDouble(value);
  if (seconds) return std::isfinite(*seconds) ? seconds : std::nullopt;
  const time_t until = curl_getdate(value.c_str(), nullptr);
  if (until < 0) return std::nullopt;
  return std::max(0.0, std::difftime(until, std::time(nullptr)));
}

}  // namespace

// One attempt after the other of one request.
struct HttpClient::Transfer {
  std::string body;
  size_t max_bytes = 0;
  const CancelToken* cancel = nullptr;
  CURL* curl = nullptr;
  // Of the attempt under way:
  bool begun = false;  // its first byte was here
  bool too_long = false;
  size_t from = 0;    // bytes of the body that earlier attempts brought
  std::string range;  // Content-Range
  std::optional<double> retry_after_s;
  std::optional<int64_t> max_age_s;
  CURLcode code = CURLE_OK;
  char reason[CURL_ERROR_SIZE] = "";

  long Status() const {
    long status = 0;
    curl_easy_getinfo(curl, CURLINFO_RESPONSE_CODE, &status);
    return status;
  }
  static size_t OnHeader(char* data, size_t size, size_t count, void* user) {
    auto* transfer = static_cast<Transfer*>(user);
    const std::string line(data, size * count);
    const std::string name = LowerCase(line.substr(0, line.find(':')));
    const std::string value(line.size() > name.size() ? Trim(std::string_view(line).substr(name.size() + 1)) : "");
    if (name == "retry-after") transfer->retry_after_s = RetryAfterOf(value);
    if (name == "content-range") transfer->range = value;
    if (name == "cache-control") transfer->max_age_s = MaxAgeOf(value);
    return size * count;
  }
  static size_t OnBody(char* data, size_t size, size_t count, void* user) {
    auto* transfer = static_cast<Transfer*>(user);
    if (!transfer->begun) {
      transfer->begun = true;
      const bool goes_on =
          transfer->Status() == 206 && transfer->range.starts_with("bytes " + std::to_string(transfer->from) + "-");
      if (!goes_on) transfer->body.clear();
    }
    if (transfer->body.size() + size * count > transfer->max_bytes) {
      transfer->too_long = true;
      return 0;
    }
    transfer->body.append(data, size * count);
    return size * count;
  }
  static int OnProgress(void* user, curl_off_t, curl_off_t, curl_off_t, curl_off_t) {
    return static_cast<Transfer*>(user)->cancel->IsCancelled() ? 1 : 0;
  }
};

namespace {

void SleepFor(double seconds, const CancelToken& cancel) {
  const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  while (Clock::now() < end) {
    cancel.ThrowIfCancelled();
    std::this_thread::sleep_for(std::min<Clock::duration>(end - Clock::now(), std::chrono::milliseconds(50)));
  }
}

bool IsTransient(int status) { return status == 429 || status == 408 || status >= 500; }

}  // namespace

bool IsOnThisMachine(const std::string& origin) {
  for (const char* host : {"http://127.0.0.1", "http://localhost", "http://[::1]"}) {
    const std::string prefix(host);
    if (origin == prefix || origin.starts_with(prefix + ":")) return true;
  }
  return false;
}

std::string WithoutQuery(const std::string& url) {
  const size_t scheme = url.find("://"), host = scheme == std::string::npos ? 0 : scheme + 3;
  const size_t at = url.rfind('@'), query = url.find_first_of("?#");
  // A password may hold any of these, against the rules: what could be one is not shown.
  if (at == std::string::npos || at < host) return url.substr(0, query);
  if (query != std::string::npos && query < at) return url.substr(0, host) + "...";
  return url.substr(0, host) + url.substr(at + 1, query == std::string::npos ? query : query - at - 1);
}

std::string Unescaped(const std::string& text) {
  int length = 0;
  char* decoded = curl_easy_unescape(nullptr, text.c_str(), static_cast<int>(text.size()), &length);
  if (decoded == nullptr) return text;
  std::string result(decoded, static_cast<size_t>(length));
  curl_free(decoded);
  return result;
}

std::string OriginOf(const std::string& url) {
  std::string origin;
  CURLU* parsed = curl_url();
  char *scheme = nullptr, *host = nullptr, *port = nullptr, *user = nullptr;
  if (curl_url_set(parsed, CURLUPART_URL, url.c_str(), 0) == CURLUE_OK &&
      curl_url_get(parsed, CURLUPART_SCHEME, &scheme, 0) == CURLUE_OK &&
      curl_url_get(parsed, CURLUPART_HOST, &host, 0) == CURLUE_OK &&
      curl_url_get(parsed, CURLUPART_USER, &user, 0) != CURLUE_OK) {
    origin = std::string(scheme) + "://" + host;
    if (curl_url_get(parsed, CURLUPART_PORT, &port, CURLU_NO_DEFAULT_PORT) == CURLUE_OK) {
      origin += std::string(":") + port;
    }
  }
  for (char* part : {scheme, host, port, user}) curl_free(part);
  curl_url_cleanup(parsed);
  return origin;
}

HttpClient::HttpClient(std::string source, const std::string& base, const HttpOptions& options)
    : source_(std::move(source)), base_(base), options_(options) {
  static std::once_flag once;
  std::call_once(once, [] { curl_global_init(CURL_GLOBAL_DEFAULT); });
  while (base_.ends_with('/')) base_.pop_back();
  const std::string origin = OriginOf(base_);
  if (base_.find('@') != std::string::npos) {
    throw OptionError("--url " + WithoutQuery(base_) + ": expected an address without user and password");
  }
  if (!origin.starts_with("https://") && !IsOnThisMachine(origin)) {
    throw OptionError("--url " + WithoutQuery(base_) + ": expected an address that begins with https://");
  }
  curl_ = curl_easy_init();
  if (curl_ == nullptr) throw IoError("libcurl cannot be initialised");
}

HttpClient::~HttpClient() { curl_easy_cleanup(static_cast<CURL*>(curl_)); }

void HttpClient::AddHeader(const std::string& name, const std::string& value) {
  headers_.push_back(name + ": " + value);
}

void HttpClient::WaitForTurn(const CancelToken& cancel) {
  const auto now = Clock::now();
  if (next_ > now) SleepFor(std::chrono::duration<double>(next_ - now).count(), cancel);
  next_ = std::max(next_, now) +
          std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1 / options_.requests_per_s));
}

void HttpClient::Perform(const std::string& url, const std::string& json, Transfer* transfer) {
  CURL* curl = transfer->curl = static_cast<CURL*>(curl_);
  curl_easy_reset(curl);  // keeps connections
  // A server elsewhere may not send a request back to this machine, or on without encryption.
  const bool local = IsOnThisMachine(OriginOf(base_)) && IsOnThisMachine(OriginOf(url));
  const char* protocols = local ? "http,https" : "https";
  const auto milliseconds = [](double seconds) { return std::lround(1000 * seconds); };
  curl_easy_setopt(curl, CURLOPT_URL, url.c_str());
  curl_easy_setopt(curl, CURLOPT_PROTOCOLS_STR, protocols);
  curl_easy_setopt(curl, CURLOPT_REDIR_PROTOCOLS_STR, protocols);
  curl_easy_setopt(curl, CURLOPT_FOLLOWLOCATION, 1L);
  curl_easy_setopt(curl, CURLOPT_MAXREDIRS, 5L);
  curl_easy_setopt(curl, CURLOPT_SSL_VERIFYPEER, 1L);
  curl_easy_setopt(curl, CURLOPT_SSL_VERIFYHOST, 2L);
  curl_easy_setopt(curl, CURLOPT_CONNECTTIMEOUT_MS, milliseconds(options_.connect_timeout_s));
  curl_easy_setopt(curl, CURLOPT_LOW_SPEED_LIMIT, 1L);
  curl_easy_setopt(curl, CURLOPT_LOW_SPEED_TIME, std::max(1L, std::lround(options_.stall_timeout_s)));
  curl_easy_setopt(curl, CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(curl, CURLOPT_USERAGENT, "trigpoint");
  curl_easy_setopt(curl, CURLOPT_ERRORBUFFER, transfer->reason);
  curl_easy_setopt(curl, CURLOPT_HEADERFUNCTION, &Transfer::OnHeader);
  curl_easy_setopt(curl, CURLOPT_HEADERDATA, transfer);
  curl_easy_setopt(curl, CURLOPT_WRITEFUNCTION, &Transfer::OnBody);
  curl_easy_setopt(curl, CURLOPT_WRITEDATA, transfer);
  curl_easy_setopt(curl, CURLOPT_NOPROGRESS, 0L);
  curl_easy_setopt(curl, CURLOPT_XFERINFOFUNCTION, &Transfer::OnProgress);
  curl_easy_setopt(curl, CURLOPT_XFERINFODATA, transfer);
  curl_slist* headers = nullptr;
  if (!json.empty()) {
    curl_easy_setopt(curl, CURLOPT_COPYPOSTFIELDS, json.c_str());
    headers = curl_slist_append(headers, "Content-Type: application/json");
  }
  if (OriginOf(url) == OriginOf(base_)) {
    for (const std::string& header : headers_) headers = curl_slist_append(headers, header.c_str());
  }
  if (headers != nullptr) curl_easy_setopt(curl, CURLOPT_HTTPHEADER, headers);
  transfer->begun = transfer->too_long = false;
  transfer->from = transfer->body.size();
  transfer->range.clear();
  transfer->retry_after_s.reset();
  transfer->max_age_s.reset();
  const std::string range = std::to_string(transfer->from) + "-";
  if (transfer->from > 0) curl_easy_setopt(curl, CURLOPT_RANGE, range.c_str());
  transfer->code = curl_easy_perform(curl);
  curl_slist_free_all(headers);
}

HttpAnswer HttpClient::Get(const std::string& url, size_t max_bytes, const CancelToken& cancel,
                           const std::string& json) {
  const std::string origin = OriginOf(url), shown = WithoutQuery(url);
  if (!origin.starts_with("https://") && !(IsOnThisMachine(origin) && IsOnThisMachine(OriginOf(base_)))) {
    throw InputError(source_ + ": names the address '" + Excerpt(shown) + "'; expected one that begins with https://");
  }
  Transfer transfer;
  transfer.max_bytes = max_bytes;
  transfer.cancel = &cancel;
  double wait_s = options_.first_wait_s;
  for (int attempt = 1;; ++attempt) {
    WaitForTurn(cancel);
    Perform(url, json, &transfer);
    cancel.ThrowIfCancelled();
    if (transfer.too_long) {
      throw InputError(fmt::format("{}: {} sends more than {} bytes, which is refused", source_, shown, max_bytes));
    }
    const int status = static_cast<int>(transfer.Status());
    if (transfer.code == CURLE_OK && !IsTransient(status)) {
      return {status, std::move(transfer.body), transfer.max_age_s, {}};
    }
    const bool unreachable = transfer.code == CURLE_COULDNT_RESOLVE_HOST || transfer.code == CURLE_COULDNT_CONNECT ||
                             transfer.code == CURLE_COULDNT_RESOLVE_PROXY;
    const bool untrusted = transfer.code == CURLE_PEER_FAILED_VERIFICATION ||
                           transfer.code == CURLE_SSL_CACERT_BADFILE || transfer.code == CURLE_SSL_CONNECT_ERROR ||
                           transfer.code == CURLE_UNSUPPORTED_PROTOCOL || transfer.code == CURLE_TOO_MANY_REDIRECTS;
    const double wanted_s = std::max(0.0, transfer.retry_after_s.value_or(wait_s));
    if (attempt >= (unreachable ? std::min(2, options_.attempts) : options_.attempts) || untrusted ||
        wanted_s > options_.longest_wait_s) {
      if (transfer.code == CURLE_OK) return {status, std::move(transfer.body), {}, transfer.retry_after_s};
      throw NetworkError(fmt::format("{}: {} {}: {}; check the connection{}", source_, shown,
                                     unreachable ? "cannot be reached" : "cannot be read",
                                     transfer.reason[0] != '\0' ? transfer.reason : curl_easy_strerror(transfer.code),
                                     untrusted ? "" : " and the proxy (https_proxy), and run the same command again"));
    }
    // What came of an answer that is an error is no part of the body.
    if (transfer.code == CURLE_OK) transfer.body.clear();
    SleepFor(std::min(wanted_s, options_.longest_wait_s), cancel);
    wait_s = std::min(2 * wait_s, options_.longest_wait_s);
  }
}

}  // namespace trigpoint

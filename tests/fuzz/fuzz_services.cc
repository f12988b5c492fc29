// Input: a letter that says which service, then its answers, divided by a zero byte; the last one is repeated. A server
// on this machine gives them, so that all between the service's search and the network is under test; SERVER in them
// stands for its address. The first letter may also stand for a STAC file.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <mutex>
#include <thread>

#include "datasets/import/providers/services.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

using namespace trigpoint;

// More requests than this of one search are refused: what pages without end do is known, and takes long.
constexpr int kMostAnswers = 12;
constexpr std::string_view kOwn = "SERVER";

class Server {
 public:
  Server() : socket_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof address;
    if (bind(socket_, reinterpret_cast<sockaddr*>(&address), length) != 0 || listen(socket_, 16) != 0 ||
        getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &length) != 0) {
      std::abort();
    }
    url_ = "http://127.0.0.1:" + std::to_string(ntohs(address.sin_port));
    std::thread([this] { Serve(); }).detach();
  }
  const std::string& url() const { return url_; }
  void Answer(std::string bytes) {
    const std::lock_guard guard(mutex_);
    answers_.clear();
    for (size_t at = 0; at <= bytes.size();) {
      const size_t end = std::min(bytes.find('\0', at), bytes.size());
      std::string answer = bytes.substr(at, end - at);
      for (size_t own = answer.find(kOwn); own != std::string::npos; own = answer.find(kOwn, own + url_.size())) {
        answer.replace(own, kOwn.size(), url_);
      }
      answers_.push_back(std::move(answer));
      at = end + 1;
    }
    given_ = 0;
  }

 private:
  std::string Next() {
    const std::lock_guard guard(mutex_);
    if (given_ >= kMostAnswers || answers_.empty()) {
      return "HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n";
    }
    const std::string& body = answers_[std::min<size_t>(static_cast<size_t>(given_++), answers_.size() - 1)];
    return "HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nConnection: close\r\nContent-Length: " +
           std::to_string(body.size()) + "\r\n\r\n" + body;
  }

  void Serve() {
    for (;;) {
      const int peer = accept(socket_, nullptr, nullptr);
      if (peer < 0) continue;
      // The head and, of a POST, its body, so that closing the connection loses no answer.
      std::string request;
      size_t wanted = std::string::npos;
      char part[4096];
      while (request.size() < wanted) {
        const ssize_t got = recv(peer, part, sizeof part, 0);
        if (got <= 0) break;
        request.append(part, static_cast<size_t>(got));
        const size_t head = request.find("\r\n\r\n"), stated = request.find("Content-Length: ");
        if (head == std::string::npos) continue;
        wanted = head + 4 + (stated < head ? std::strtoul(request.c_str() + stated + 16, nullptr, 10) : 0);
      }
      const std::string answer = Next();
      send(peer, answer.data(), answer.size(), MSG_NOSIGNAL);
      close(peer);
    }
  }

  int socket_;
  std::string url_;
  std::mutex mutex_;
  std::vector<std::string> answers_;
  int given_ = 0;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  // It outlives the thread that serves.
  static Server& server = *new Server;
  const SearchArea area{{{48, 7, 0}}, 20};
  const size_t kind = data[0] % (Services().size() + 1);
  const std::string bytes(reinterpret_cast<const char*>(data + 1), size - 1);
  try {
    std::unique_ptr<PanoramaProvider> provider;
    if (kind == Services().size()) {
      const std::filesystem::path file = FuzzFile("items.json", data + 1, size - 1);
      IsStacFile(file);
      provider = OpenStacFile(file);
    } else {
      server.Answer(bytes);
      ServiceOptions options{server.url(), "key", {}};
      options.http.attempts = 1;
      options.http.requests_per_s = 1e9;
      provider = Services()[kind].open(options);
    }
    for (const PanoramaRecord& record : provider->Find(area, CancelToken())) {
      if (record.id.empty() || record.id.find('/') != std::string::npos || !area.Contains(record.position)) {
        std::abort();
      }
    }
    for (const std::string& warning : provider->Warnings()) {
      if (warning.find('\n') != std::string::npos) std::abort();
    }
  } catch (const Error& e) {
    ExpectOneSentence(e);
  }
  return 0;
}

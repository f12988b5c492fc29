// What strangers' servers answer, taken with care.
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "datasets/import/panorama_provider.h"
#include "datasets/import/providers/http_client.h"

namespace trigpoint {

// No answer with more is believed.
constexpr size_t kMostJsonBytes = 64u << 20;
constexpr size_t kMostPictureBytes = 128u << 20;
constexpr size_t kMostRecords = 100'000;
constexpr int kMostPages = 1000;

// The JSON at `url`. Throws InputError for another status (401 and 403 as a matter of the token, 429 of the rate) and
// for what is no object, NetworkError as the client does.
// `post`: JSON to be POSTed, or empty.
nlohmann::json GetJson(HttpClient& client, const std::string& source, const std::string& url, const CancelToken& cancel,
                       const std::string& post = "");

// The JSON object in `text`, at most 64 levels deep; `what` names it in the InputError of one that is none.
nlohmann::json ParseObject(const std::string& text, const std::string& what);

// Members of the right type, or nothing; texts at most 300 bytes, as UTF-8 in one line; numbers finite.
std::optional<double> NumberIn(const nlohmann::json& object, const char* key);
std::string TextIn(const nlohmann::json& object, const char* key);
const nlohmann::json* ObjectIn(const nlohmann::json& object, const char* key);

// GeoJSON's [longitude, latitude, ...], if it is on the Earth and not at 0, 0.
std::optional<Geodetic> PointOf(const nlohmann::json& geometry);

// An id that a file can be named by, behind a service's name: letters, digits, - and _, at most 128.
bool IsPlainId(const std::string& id);

// The picture at `url`, decoded as any input is; at most `width` px wide unless 0. A part of a sphere that states where
// it lies is put into a black sphere.
PanoramaPicture GetPicture(HttpClient& client, const std::string& source, const std::string& id, const std::string& url,
                           int width, const CancelToken& cancel);

// The same of its bytes; `what` names it in the InputError. From 512 to 32,768 px wide.
PanoramaPicture TakePicture(std::string bytes, const std::string& what, int width);

// The bytes of a picture, decoded as any input is (BGR); `what` names it in the InputError of one that is none.
cv::Mat DecodeDownload(const std::string& bytes, const std::string& what);

// Boxes (west, south, east, north) of at most `most_deg` a side that cover an area; throws InputError for an area that
// needs more than 10,000.
std::vector<std::array<double, 4>> BoxesOf(const SearchArea& area, double most_deg);

}  // namespace trigpoint

// What services share that list their panoramas by place.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "datasets/import/providers/answers.h"
#include "datasets/import/providers/services.h"

namespace trigpoint {

// A STAC item with the extensions view, perspective imagery and quality, as Panoramax has them.
struct StacItem {
  PanoramaRecord record;  // without position
  std::optional<Geodetic> position;
  std::string full, small;  // addresses of its picture, and of a smaller one
  bool whole_turn = false;  // it states 360 deg
  bool part = false;        // it states another field of view
};
std::optional<StacItem> ReadStacItem(const nlohmann::json& item);

class ListingService : public PanoramaProvider {
 public:
  std::string Name() const override { return name_; }
  std::string Prefix() const override { return name_ + "-"; }
  SourceQuality Sigmas() const override { return *QualityOfSource(name_); }
  std::vector<std::string> Warnings() const override { return warnings_; }
  std::vector<PanoramaRecord> Find(const SearchArea& area, const CancelToken& cancel) final;
  // Of a stated width, px; 0: not known.
  static int WidthOf(std::optional<double> stated) {
    return stated && *stated > 0 && *stated < 1e6 ? static_cast<int>(*stated) : 0;
  }

 protected:
  static constexpr const char* kByTerms = "CC-BY-SA-4.0";  // of all pictures, by the terms of use of some services
  // Cameras without a compass state a negative heading.
  static std::optional<double> HeadingOf(std::optional<double> stated) {
    return stated && *stated >= 0 ? stated : std::nullopt;
  }
  // `credit` stands in the attributions, behind the owner.
  ListingService(std::string name, std::string credit, const ServiceOptions& options)
      : client_(name, options.url, options.http), name_(std::move(name)), credit_(std::move(credit)) {}
  // Asks for what lies in the area, and calls Keep.
  virtual void Search(const SearchArea& area, const CancelToken& cancel) = 0;
  // Takes a record in if it lies in the area, with its attribution. One without a usable id, position or file is
  // counted. Returns whether it was taken in.
  bool Keep(PanoramaRecord record, const std::optional<Geodetic>& position, bool has_file);
  using Box = std::array<double, 4>;
  // Searches the quarters of a box whose answer was full. Returns false, and notes that the list is cut, if the box has
  // been halved often enough.
  bool Divide(const Box& box, int halvings, const std::function<void(const Box&)>& search);
  void NoteCut() { cut_ = true; }
  void NotePart() { ++parts_; }
  bool Full() const { return found_.size() > kMostRecords; }
  // The list `key` of an answer; throws InputError if there is none.
  const nlohmann::json& ListIn(const nlohmann::json& answer, const char* key, const std::string& url) const;

  HttpClient client_;

 private:
  std::string name_, credit_;
  const SearchArea* area_ = nullptr;  // during Find
  std::map<std::string, PanoramaRecord> found_;
  int unusable_ = 0, impossible_ = 0, parts_ = 0;
  bool cut_ = false;
  std::vector<std::string> warnings_;
};

}  // namespace trigpoint

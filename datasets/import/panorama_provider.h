// Where panoramas come from: folders (here) and services (providers/) behind one interface.
#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "datasets/import/colmap_run.h"
#include "datasets/io/site.h"
#include "datasets/io/source_quality.h"

namespace trigpoint {

// What a source states of a panorama. Angles of the image centre, degrees; height is rarely of use.
struct PanoramaRecord {
  std::string id;
  Geodetic position;
  bool has_height = false;
  std::optional<double> heading_deg, pitch_deg, roll_deg;
  std::optional<double> sigma_h_m;  // 1 sigma per axis, if the source states the position's error
  std::string date;                 // of capture, as stated
  std::string owner;                // who took it
  std::string licence;              // its short name
  std::string attribution;          // what to write beside the picture
  int width_px = 0;                 // of the full turn; 0: not stated
};

// Takes out what cannot be: a heading beyond any turn (others are brought to [0, 360)), a pitch or roll outside +-90
// and +-180 deg, a height outside -500 to 9000 m, a sigma outside 0.01 to 1000 m. Returns how many values.
int TakeOutImpossible(PanoramaRecord* record);
// What is to be said of so many values that were taken out.
std::string ImpossibleValues(const std::string& source, int count);

// Around points, such as one place or a run's track; no point: everywhere.
struct SearchArea {
  std::vector<Geodetic> points;
  double radius_m = 0;
  // Distance from the nearest point, m; 0 without points. Heights take no part.
  double Distance_m(const Geodetic& position) const;
  bool Contains(const Geodetic& position) const { return points.empty() || Distance_m(position) <= radius_m; }
};

// An equirectangular picture, 2:1: its file's bytes where they are to be kept as they came, else pixels (BGR).
struct PanoramaPicture {
  std::string jpeg;
  cv::Mat pixels;
  std::optional<int64_t> keep_until_s;  // UTC: the source forbids to keep it longer; empty: it does not
};

class PanoramaProvider {
 public:
  virtual ~PanoramaProvider() = default;
  virtual std::string Name() const = 0;
  // What begins the names of its pictures' files; empty: nothing.
  virtual std::string Prefix() const { return ""; }
  virtual SourceQuality Sigmas() const = 0;
  // Its terms forbid to keep pictures and positions: they have an end, and are gone after it.
  virtual bool ForSessionOnly() const { return false; }
  // Those that lie in the area, in the order of their ids.
  virtual std::vector<PanoramaRecord> Find(const SearchArea& area, const CancelToken& cancel) = 0;
  // The picture of a record that Find gave, at most `width` px wide unless 0. Throws InputError naming what is missing
  // or wrong with this one; other errors mean that the next one would fail, too.
  virtual PanoramaPicture Load(const PanoramaRecord& record, int width, const CancelToken& cancel) = 0;
  // What is wrong with single ones, one sentence each.
  virtual std::vector<std::string> Warnings() const { return {}; }
};

// A folder with metadata JSON: one object per file, a list, or {"panoramas": [...]}. Read are, in any of these
// spellings, id | pano_id | panoId; latitude | lat, longitude | lng | lon, also inside location | position |
// coordinate; heading | heading_deg | yaw | compass_angle; pitch | tilt - 90; roll; altitude | elevation; date |
// captured_at; licence | license; attribution | copyright. Pictures: <id>.jpg (.png, ...), or <id>/ with tiles
// <x>_<y>.jpg (tile_<x>_<y>, columns and rows from 0), or with the faces front, right, back, left, up, down (or 0 to 5
// in this order; 90 deg each, up and down may be missing).
std::unique_ptr<PanoramaProvider> OpenPanoramaFolder(const std::filesystem::path& dir);

struct PanoramaImportOptions {
  SearchArea area;
  int width = 0;             // px at most; 0: as the source has it
  std::string since, until;  // capture dates (2024, 2024-05, 2024-05-12), both included; empty: all
  int limit = 0;             // the nearest so many; 0: all
  // Of those whose distances differ less than their positions are known, the ones taken in the season of this day, then
  // the ones taken near it in time, count as nearer; empty: the day is not known.
  std::string near_date;
  std::vector<std::string> ids;  // these alone; empty: all

  // Throws OptionError that names the option, what it holds and what is expected.
  void Check() const;
};

// Those of the provider that the options ask for. Throws OptionError, and InputError if there are none.
std::vector<PanoramaRecord> ChoosePanoramas(PanoramaProvider& provider, const PanoramaImportOptions& options,
                                            const CancelToken& cancel);

// Writes SITE/panoramas/<prefix><id>.jpg and adds their rows to SITE/panoramas.csv, whose old form is kept in
// SITE/results/replaced/. A picture that is there is not loaded again, unless an import narrowed it to less than
// options.width: the wider one replaces it once it has arrived. A row that is there is left as it is. When the source
// fails on the way, what has arrived is kept and the error thrown.
ImportReport ImportPanoramas(const std::filesystem::path& site, PanoramaProvider& provider,
                             const PanoramaImportOptions& options, ProgressSink& progress, const CancelToken& cancel);

// Puts tiles or faces together; for the providers and their tests.
cv::Mat AssembleTiles(const std::vector<std::vector<cv::Mat>>& rows);
// Faces front, right, back, left, up, down, square, 90 deg each; empty ones stay black. `width`: of the panorama.
cv::Mat AssembleFaces(const std::vector<cv::Mat>& faces, int width);

}  // namespace trigpoint

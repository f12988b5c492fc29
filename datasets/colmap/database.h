// The feature and match store: a COLMAP 3.x database, readable by COLMAP's own tools.
//
// Pixels are ours (centre of the first pixel is (0, 0)) on this side; COLMAP's +0.5 is applied inside.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "calib/camera/camera.h"

struct sqlite3;

namespace trigpoint {

// Local features of one image.
struct FeatureSet {
  std::vector<Eigen::Vector2f> points;  // px
  std::vector<float> scales;            // px
  std::vector<float> angles;            // rad
  cv::Mat descriptors;                  // n x 128, CV_8U: SIFT as published (not RootSIFT)
  size_t size() const { return points.size(); }
};

struct DatabaseImage {
  uint32_t id = 0;
  std::string name;
  uint32_t camera_id = 0;
};

// One connection; not thread safe. Throws IoError naming the file.
class ColmapDatabase {
 public:
  static ColmapDatabase Create(const std::filesystem::path& file);    // replaces an existing file
  static ColmapDatabase OpenRead(const std::filesystem::path& file);  // throws InputError if it is no COLMAP database
  ColmapDatabase(ColmapDatabase&&) noexcept;
  ~ColmapDatabase();

  void Begin();
  void Commit();

  uint32_t AddCamera(const Camera& camera);
  uint32_t AddImage(const std::string& name, uint32_t camera_id);
  void WriteFeatures(uint32_t image_id, const FeatureSet& features);
  // matches: rows of (feature of a, feature of b), in the order of ids given.
  void WriteVerifiedMatches(uint32_t image_a, uint32_t image_b, const std::vector<std::pair<int, int>>& matches);

  // The features of an image of another database as they are, byte for byte. Returns how many. Throws InputError for an
  // image without features there.
  int64_t CopyFeatures(const ColmapDatabase& from, uint32_t from_image, uint32_t image_id);

  std::vector<DatabaseImage> Images() const;
  FeatureSet ReadFeatures(uint32_t image_id) const;

 private:
  explicit ColmapDatabase(sqlite3* db, std::string file) : db_(db), file_(std::move(file)) {}
  void Execute(const char* sql) const;
  sqlite3* db_ = nullptr;
  std::string file_;
};

}  // namespace trigpoint

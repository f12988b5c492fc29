#include "datasets/colmap/database.h"

#include <sqlite3.h>

#include <cstring>
#include <utility>

#include "calib/base/error.h"
#include "calib/camera/pixel_convention.h"
#include "datasets/colmap/camera_models.h"
#include "datasets/io/sqlite_statement.h"

namespace trigpoint {
namespace {

// COLMAP 3.8's schema.
constexpr const char* kSchema = R"sql(
CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, model INTEGER NOT NULL,
  width INTEGER NOT NULL, height INTEGER NOT NULL, params BLOB, prior_focal_length INTEGER NOT NULL);
CREATE TABLE images (image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, name TEXT NOT NULL UNIQUE,
  camera_id INTEGER NOT NULL, prior_qw REAL, prior_qx REAL, prior_qy REAL, prior_qz REAL, prior_tx REAL,
  prior_ty REAL, prior_tz REAL, CONSTRAINT image_id_check CHECK(image_id >= 0 and image_id < 2147483647),
  FOREIGN KEY(camera_id) REFERENCES cameras(camera_id));
CREATE UNIQUE INDEX index_name ON images(name);
CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL,
  data BLOB, FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE descriptors (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL,
  data BLOB, FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE matches (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB);
CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
  cols INTEGER NOT NULL, data BLOB, config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB);
PRAGMA user_version = 3800;
)sql";

}  // namespace

ColmapDatabase::ColmapDatabase(ColmapDatabase&& other) noexcept
    : db_(std::exchange(other.db_, nullptr)), file_(std::move(other.file_)) {}

ColmapDatabase::~ColmapDatabase() { sqlite3_close(db_); }

void ColmapDatabase::Execute(const char* sql) const {
  char* message = nullptr;
  if (sqlite3_exec(db_, sql, nullptr, nullptr, &message) != SQLITE_OK) {
    const std::string text = message == nullptr ? "unknown error" : message;
    sqlite3_free(message);
    throw IoError("database " + file_ + ": " + text);
  }
}

ColmapDatabase ColmapDatabase::Create(const std::filesystem::path& file) {
  std::error_code ignored;
  std::filesystem::remove(file, ignored);
  sqlite3* db = nullptr;
  if (sqlite3_open(file.c_str(), &db) != SQLITE_OK) {
    sqlite3_close(db);
    throw IoError("database " + file.string() + ": cannot be created");
  }
  ColmapDatabase database(db, file.string());
  // The stage writes into a temporary folder that is renamed when complete: no journal is needed.
  database.Execute("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF;");
  database.Execute(kSchema);
  return database;
}

ColmapDatabase ColmapDatabase::OpenRead(const std::filesystem::path& file) {
  sqlite3* db = nullptr;
  if (sqlite3_open_v2(file.c_str(), &db, SQLITE_OPEN_READONLY, nullptr) != SQLITE_OK) {
    sqlite3_close(db);
    throw IoError("database " + file.string() + ": cannot be opened");
  }
  ColmapDatabase database(db, file.string());
  sqlite3_busy_timeout(db, 2000);
  try {
    Statement check(db, "SELECT count(*) FROM images, cameras WHERE images.camera_id = cameras.camera_id",
                    database.file_);
    check.Step();
  } catch (const IoError& e) {
    const bool busy = sqlite3_errcode(db) == SQLITE_BUSY || sqlite3_errcode(db) == SQLITE_LOCKED;
    throw InputError(std::string(e.what()) + (busy ? ": another program writes it; end that and try again"
                                                   : "; expected a COLMAP 3.x database"));
  }
  return database;
}

void ColmapDatabase::Begin() { Execute("BEGIN"); }
void ColmapDatabase::Commit() { Execute("COMMIT"); }

uint32_t ColmapDatabase::AddCamera(const Camera& camera) {
  const ColmapCamera c = ToColmap(camera);
  Statement s(db_, "INSERT INTO cameras(model, width, height, params, prior_focal_length) VALUES(?, ?, ?, ?, 1)",
              file_);
  s.Int(1, c.model_id), s.Int(2, c.width), s.Int(3, c.height);
  s.Blob(4, c.params.data(), c.params.size() * sizeof(double));
  s.Step();
  return static_cast<uint32_t>(sqlite3_last_insert_rowid(db_));
}

uint32_t ColmapDatabase::AddImage(const std::string& name, uint32_t camera_id) {
  Statement s(db_, "INSERT INTO images(name, camera_id) VALUES(?, ?)", file_);
  s.Text(1, name), s.Int(2, camera_id);
  s.Step();
  return static_cast<uint32_t>(sqlite3_last_insert_rowid(db_));
}

void ColmapDatabase::WriteFeatures(uint32_t image_id, const FeatureSet& features) {
  std::vector<float> rows(features.size() * 4);
  for (size_t i = 0; i < features.size(); ++i) {
    const Eigen::Vector2d p = ToColmapPixel(features.points[i].cast<double>());
    rows[4 * i] = static_cast<float>(p.x());
    rows[4 * i + 1] = static_cast<float>(p.y());
    rows[4 * i + 2] = features.scales[i];
    rows[4 * i + 3] = features.angles[i];
  }
  Statement k(db_, "INSERT INTO keypoints(image_id, rows, cols, data) VALUES(?, ?, 4, ?)", file_);
  k.Int(1, image_id), k.Int(2, static_cast<int64_t>(features.size()));
  k.Blob(3, rows.data(), rows.size() * sizeof(float));
  k.Step();
  Statement d(db_, "INSERT INTO descriptors(image_id, rows, cols, data) VALUES(?, ?, 128, ?)", file_);
  d.Int(1, image_id), d.Int(2, static_cast<int64_t>(features.size()));
  d.Blob(3, features.descriptors.data, features.size() * 128);
  d.Step();
}

int64_t ColmapDatabase::CopyFeatures(const ColmapDatabase& from, uint32_t from_image, uint32_t image_id) {
  int64_t rows = 0;
  for (const std::string table : {"keypoints", "descriptors"}) {
    Statement in(from.db_, ("SELECT rows, cols, data FROM " + table + " WHERE image_id = ?").c_str(), from.file_);
    in.Int(1, from_image);
    if (!in.Step()) {
      throw InputError("database " + from.file_ + ": image " + std::to_string(from_image) + " has no " + table);
    }
    rows = in.ColumnInt(0);
    Statement out(db_, ("INSERT INTO " + table + "(image_id, rows, cols, data) VALUES(?, ?, ?, ?)").c_str(), file_);
    out.Int(1, image_id), out.Int(2, rows), out.Int(3, in.ColumnInt(1));
    out.Blob(4, in.ColumnBlob(2), in.ColumnBytes(2));
    out.Step();
  }
  return rows;
}

void ColmapDatabase::WriteVerifiedMatches(uint32_t image_a, uint32_t image_b,
                                          const std::vector<std::pair<int, int>>& matches) {
  const bool swap = image_a > image_b;
  const int64_t pair_id =
      static_cast<int64_t>(swap ? image_b : image_a) * 2147483647 + static_cast<int64_t>(swap ? image_a : image_b);
  std::vector<uint32_t> rows;
  rows.reserve(matches.size() * 2);
  for (const auto& [a, b] : matches) {
    rows.push_back(static_cast<uint32_t>(swap ? b : a));
    rows.push_back(static_cast<uint32_t>(swap ? a : b));
  }
  Statement m(db_, "INSERT INTO matches(pair_id, rows, cols, data) VALUES(?, ?, 2, ?)", file_);
  m.Int(1, pair_id), m.Int(2, static_cast<int64_t>(matches.size()));
  m.Blob(3, rows.data(), rows.size() * sizeof(uint32_t));
  m.Step();
  // config 2: calibrated.
  Statement g(db_, "INSERT INTO two_view_geometries(pair_id, rows, cols, data, config) VALUES(?, ?, 2, ?, 2)", file_);
  g.Int(1, pair_id), g.Int(2, static_cast<int64_t>(matches.size()));
  g.Blob(3, rows.data(), rows.size() * sizeof(uint32_t));
  g.Step();
}

std::vector<DatabaseImage> ColmapDatabase::Images() const {
  std::vector<DatabaseImage> images;
  Statement s(db_, "SELECT image_id, name, camera_id FROM images ORDER BY image_id", file_);
  while (s.Step()) {
    images.push_back({static_cast<uint32_t>(s.ColumnInt(0)), s.ColumnText(1), static_cast<uint32_t>(s.ColumnInt(2))});
  }
  return images;
}

FeatureSet ColmapDatabase::ReadFeatures(uint32_t image_id) const {
  FeatureSet features;
  Statement k(db_, "SELECT rows, cols, data FROM keypoints WHERE image_id = ?", file_);
  k.Int(1, image_id);
  if (!k.Step()) return features;
  const int64_t rows = k.ColumnInt(0), cols = k.ColumnInt(1);
  const auto damaged = [&] {
    return InputError("database " + file_ + ": features of image " + std::to_string(image_id) +
                      " are damaged; extract them again");
  };
  if (rows < 0 || cols < 2 || cols > 6 || rows > 100'000'000 ||
      k.ColumnBytes(2) != static_cast<size_t>(rows * cols) * sizeof(float)) {
    throw damaged();
  }
  const float* data = static_cast<const float*>(k.ColumnBlob(2));
  features.points.resize(static_cast<size_t>(rows));
  features.scales.resize(static_cast<size_t>(rows), 1);
  features.angles.resize(static_cast<size_t>(rows), 0);
  for (int64_t i = 0; i < rows; ++i) {
    const float* row = data + i * cols;
    const size_t j = static_cast<size_t>(i);
    features.points[j] = FromColmapPixel({row[0], row[1]}).cast<float>();
    if (cols == 4) {
      features.scales[j] = row[2];
      features.angles[j] = row[3];
    } else if (cols == 6) {  // affine: a11 a12 a21 a22
      features.scales[j] = std::sqrt(std::abs(row[2] * row[5] - row[3] * row[4]));
      features.angles[j] = std::atan2(row[4], row[2]);
    }
  }
  Statement d(db_, "SELECT rows, cols, data FROM descriptors WHERE image_id = ?", file_);
  d.Int(1, image_id);
  features.descriptors = cv::Mat::zeros(static_cast<int>(rows), 128, CV_8U);
  if (!d.Step()) return features;
  if (d.ColumnInt(0) != rows || d.ColumnInt(1) != 128 || d.ColumnBytes(2) != static_cast<size_t>(rows) * 128) {
    throw damaged();
  }
  if (rows > 0) std::memcpy(features.descriptors.data, d.ColumnBlob(2), static_cast<size_t>(rows) * 128);
  return features;
}

}  // namespace trigpoint

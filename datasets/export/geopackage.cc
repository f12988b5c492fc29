// GeoPackage 1.3 (OGC 12-128r17), written with SQLite alone.
#include <fmt/format.h>
#include <sqlite3.h>

#include <cmath>
#include <cstring>

#include "calib/base/error.h"
#include "datasets/export/layer_files.h"
#include "datasets/export/layer_text.h"
#include "datasets/io/readable.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSchema = R"sql(
PRAGMA application_id = 1196444487; PRAGMA user_version = 10300; PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF;
CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT NOT NULL, srs_id INTEGER PRIMARY KEY NOT NULL,
  organization TEXT NOT NULL, organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT);
CREATE TABLE gpkg_contents (table_name TEXT PRIMARY KEY NOT NULL, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
  description TEXT DEFAULT '', last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
  min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
  CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (table_name TEXT NOT NULL, column_name TEXT NOT NULL,
  geometry_type_name TEXT NOT NULL, srs_id INTEGER NOT NULL, z TINYINT NOT NULL, m TINYINT NOT NULL,
  CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name), CONSTRAINT uk_gc_table_name UNIQUE (table_name),
  CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name),
  CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys (srs_id));
CREATE TABLE layer_styles (id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, f_table_catalog TEXT, f_table_schema TEXT,
  f_table_name TEXT, f_geometry_column TEXT, styleName TEXT, styleQML TEXT, styleSLD TEXT, useAsDefault BOOLEAN,
  description TEXT, owner TEXT, ui TEXT, update_time DATETIME DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')));
INSERT INTO gpkg_spatial_ref_sys VALUES
  ('Undefined cartesian SRS', -1, 'NONE', -1, 'undefined', 'undefined cartesian coordinate reference system'),
  ('Undefined geographic SRS', 0, 'NONE', 0, 'undefined', 'undefined geographic coordinate reference system');
INSERT INTO gpkg_contents (table_name, data_type, identifier) VALUES ('layer_styles', 'attributes', 'layer_styles');
)sql";

class Database {
 public:
  explicit Database(const fs::path& file) : file_(file) {
    if (sqlite3_open(file.c_str(), &db_) != SQLITE_OK) Fail();
  }
  ~Database() { sqlite3_close(db_); }
  Database(const Database&) = delete;
  void Run(const std::string& sql) const {
    if (sqlite3_exec(db_, sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) Fail();
  }
  // Runs one statement with its values; geometry, if any, is the blob of the first place.
  void Insert(const std::string& sql, const std::vector<LayerValue>& values, const std::string* blob = nullptr) const {
    sqlite3_stmt* statement = nullptr;
    if (sqlite3_prepare_v2(db_, sql.c_str(), -1, &statement, nullptr) != SQLITE_OK) Fail();
    int at = 1;
    if (blob != nullptr) {
      if (!blob->empty()) sqlite3_bind_blob64(statement, at, blob->data(), blob->size(), SQLITE_TRANSIENT);
      ++at;
    }
    for (const LayerValue& value : values) {
      if (const auto* i = std::get_if<int64_t>(&value)) sqlite3_bind_int64(statement, at, *i);
      if (const auto* s = std::get_if<std::string>(&value)) {
        const std::string text = ValidUtf8(*s);
        sqlite3_bind_text(statement, at, text.c_str(), -1, SQLITE_TRANSIENT);
      }
      const auto* d = std::get_if<double>(&value);
      if (d != nullptr && std::isfinite(*d)) sqlite3_bind_double(statement, at, *d);
      ++at;
    }
    const int code = sqlite3_step(statement);
    sqlite3_finalize(statement);
    if (code != SQLITE_DONE) Fail();
  }

 private:
  [[noreturn]] void Fail() const { throw IoError(file_.string() + ": cannot be written: " + sqlite3_errmsg(db_)); }
  fs::path file_;
  sqlite3* db_ = nullptr;
};

struct Bounds {
  double min_x = INFINITY, min_y = INFINITY, max_x = -INFINITY, max_y = -INFINITY;
  void Add(const Eigen::Vector2d& p) {
    min_x = std::min(min_x, p.x()), min_y = std::min(min_y, p.y());
    max_x = std::max(max_x, p.x()), max_y = std::max(max_y, p.y());
  }
};

template <typename T>
void Put(std::string* out, T value) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  out->append(bytes, sizeof value);
}

// GeoPackage header (little endian, envelope x y) and ISO WKB with z.
std::string Blob(const LayerFeature& feature, LayerGeometry kind, const LayerFrame& frame, Bounds* layer_bounds) {
  if (feature.geometry.empty()) return "";
  std::vector<Eigen::Vector3d> vertices;
  Bounds bounds;
  for (const Geodetic& g : feature.geometry) {
    const Eigen::Vector2d p = frame.crs.FromGeodetic(g);
    vertices.emplace_back(p.x(), p.y(), frame.heights.FromEllipsoidal(g));
    bounds.Add(p);
    layer_bounds->Add(p);
  }
  if (kind == LayerGeometry::kPolygon) vertices.push_back(vertices.front());
  std::string out("GP\0\x03", 4);  // version 1, little endian, envelope 1
  Put<int32_t>(&out, frame.crs.epsg());
  for (double v : {bounds.min_x, bounds.max_x, bounds.min_y, bounds.max_y}) Put(&out, v);
  out += '\x01';
  Put<uint32_t>(&out, kind == LayerGeometry::kPoint ? 1001 : kind == LayerGeometry::kLine ? 1002 : 1003);
  if (kind == LayerGeometry::kPolygon) Put<uint32_t>(&out, 1);
  if (kind != LayerGeometry::kPoint) Put(&out, static_cast<uint32_t>(vertices.size()));
  for (const Eigen::Vector3d& v : vertices) Put(&out, v.x()), Put(&out, v.y()), Put(&out, v.z());
  return out;
}

// What QGIS 3 reads from layer_styles: one symbol, and the name as a label beside points.
std::string QgisStyle(const Layer& layer) {
  const auto prop = [](const char* key, const std::string& value) {
    return fmt::format("<prop k=\"{}\" v=\"{}\"/>", key, value);
  };
  const int r = std::stoi(layer.colour.substr(1, 2), nullptr, 16),
            g = std::stoi(layer.colour.substr(3, 2), nullptr, 16),
            b = std::stoi(layer.colour.substr(5, 2), nullptr, 16);
  const std::string solid = fmt::format("{},{},{},255", r, g, b), light = fmt::format("{},{},{},60", r, g, b);
  std::string type, symbol;
  switch (layer.geometry) {
    case LayerGeometry::kPoint:
      type = "marker";
      symbol = "<layer class=\"SimpleMarker\" enabled=\"1\" pass=\"0\" locked=\"0\">" + prop("name", "circle") +
               prop("color", solid) + prop("outline_color", "255,255,255,255") + prop("size", "2.4") +
               prop("size_unit", "MM");
      break;
    case LayerGeometry::kLine:
      type = "line";
      symbol = "<layer class=\"SimpleLine\" enabled=\"1\" pass=\"0\" locked=\"0\">" + prop("line_color", solid) +
               prop("line_width", "0.5") + prop("line_width_unit", "MM");
      break;
    case LayerGeometry::kPolygon:
      type = "fill";
      symbol = "<layer class=\"SimpleFill\" enabled=\"1\" pass=\"0\" locked=\"0\">" + prop("color", light) +
               prop("outline_color", solid) + prop("outline_width", "0.26") + prop("style", "solid");
      break;
  }
  const bool labels = layer.geometry == LayerGeometry::kPoint && layer.features.size() <= 200;
  return "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n<qgis version=\"3.22.0\" "
         "styleCategories=\"Symbology|Labeling\" labelsEnabled=\"" +
         std::string(labels ? "1" : "0") +
         "\"><renderer-v2 type=\"singleSymbol\" enableorderby=\"0\" forceraster=\"0\" symbollevels=\"0\"><symbols>"
         "<symbol type=\"" +
         type + "\" name=\"0\" alpha=\"1\" clip_to_extent=\"1\">" + symbol +
         "</layer></symbol></symbols></renderer-v2>" +
         (labels ? "<labeling type=\"simple\"><settings><text-style fieldName=\"name\" fontSize=\"8\" "
                   "textColor=\"0,0,0,255\"/>"
                   "<placement placement=\"1\" dist=\"1\" distUnits=\"MM\"/></settings></labeling>"
                 : "") +
         "</qgis>";
}

const char* SqlType(FieldType type) {
  return type == FieldType::kInteger ? "INTEGER" : type == FieldType::kReal ? "DOUBLE" : "TEXT";
}

void AddLayer(const Database& db, const Layer& layer, const LayerFrame& frame) {
  std::string columns = "fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom BLOB, name TEXT";
  std::string names = "geom, name", places = "?, ?";
  for (const LayerField& field : layer.fields) {
    columns += fmt::format(", \"{}\" {}", field.name, SqlType(field.type));
    names += fmt::format(", \"{}\"", field.name);
    places += ", ?";
  }
  const char* kind = layer.geometry == LayerGeometry::kPoint  ? "POINT"
                     : layer.geometry == LayerGeometry::kLine ? "LINESTRING"
                                                              : "POLYGON";
  db.Run(fmt::format("CREATE TABLE \"{}\" ({})", layer.name, columns));
  Bounds bounds;
  for (const LayerFeature& feature : layer.features) {
    const std::string blob = Blob(feature, layer.geometry, frame, &bounds);
    std::vector<LayerValue> values = {feature.name};
    values.insert(values.end(), feature.values.begin(), feature.values.end());
    db.Insert(fmt::format("INSERT INTO \"{}\" ({}) VALUES ({})", layer.name, names, places), values, &blob);
  }
  const int64_t srs = frame.crs.epsg();
  db.Insert(
      "INSERT INTO gpkg_contents (table_name, data_type, identifier, description, min_x, min_y, max_x, max_y, srs_id) "
      "VALUES (?, 'features', ?, ?, ?, ?, ?, ?, ?)",
      {layer.name, layer.name, layer.title + "; z: heights " + frame.heights.name() + "; " + frame.about, bounds.min_x,
       bounds.min_y, bounds.max_x, bounds.max_y, srs});
  db.Insert("INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, 1, 0)", {layer.name, std::string(kind), srs});
  db.Insert(
      "INSERT INTO layer_styles (f_table_name, f_geometry_column, styleName, styleQML, styleSLD, useAsDefault, "
      "description, owner) VALUES (?, 'geom', ?, ?, '', 1, ?, 'trigpoint')",
      {layer.name, layer.name, QgisStyle(layer), layer.title});
}

}  // namespace

void WriteGeoPackage(const fs::path& file, const std::vector<Layer>& layers, const LayerFrame& frame) {
  const fs::path absolute = fs::absolute(file);
  std::error_code error;
  fs::create_directories(absolute.parent_path(), error);
  const fs::path temporary = absolute.parent_path() / (std::string(kTemporaryPrefix) + absolute.filename().string());
  fs::remove(temporary, error);
  try {
    const Database db(temporary);
    db.Run(kSchema);
    db.Run("BEGIN");
    std::vector<std::pair<int64_t, std::pair<std::string, std::string>>> systems = {
        {4326, {"WGS 84", Crs::Named("", {}).wkt()}}};
    if (frame.crs.epsg() != 4326) systems.push_back({frame.crs.epsg(), {frame.crs.name(), frame.crs.wkt()}});
    for (const auto& [id, names] : systems) {
      db.Insert("INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, 'EPSG', ?, ?, '')",
                {names.first, id, id, names.second});
    }
    for (const Layer& layer : layers) AddLayer(db, layer, frame);
    db.Run("COMMIT");
  } catch (const Error&) {
    fs::remove(temporary, error);
    throw;
  }
  fs::rename(temporary, absolute, error);
  if (error) throw IoErrorFor(file, "written", error.value());
}

}  // namespace trigpoint

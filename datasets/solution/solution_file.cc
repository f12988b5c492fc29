#include "datasets/solution/solution_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <map>
#include <memory>

#include "calib/base/error.h"
#include "calib/estimation/loss.h"
#include "datasets/project/files.h"
#include "datasets/solution/solution_check.h"
#include "datasets/solution/solution_table.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using solution_table::Cells;
using solution_table::HashChain;
using solution_table::Table;

constexpr int kApplicationId = 0x54725053;  // "TrPS", in the header of the SQLite file

// Robust kernels as text: "huber 22.5", "none". The number is the shortest that reads back to the same.
using Loss = std::shared_ptr<const ceres::LossFunction>;

std::string LossText(const Loss& loss) {
  if (loss == nullptr) return "none";
  const auto* known = dynamic_cast<const Chi2Loss*>(loss.get());
  if (known == nullptr) throw Error("a solution holds the robust kernels of calib/estimation/loss.h only");
  return fmt::format("{} {}", known->name(), known->threshold());
}

bool SetLoss(const std::string& text, Loss* loss) {
  const size_t space = text.find(' ');
  try {
    *loss =
        MakeLoss(text.substr(0, space), space == std::string::npos ? 0 : std::strtod(text.c_str() + space, nullptr));
  } catch (const OptionError&) {
    return false;
  }
  return true;
}

Table RunTable(Solution& s) {
  Table t{"run", 1, [](size_t) {}, {}};
  BundleProblem& p = s.problem;
  t.AddOne("name", s.run);
  t.AddOne("mode", s.mode);
  t.AddOne("sigma_px", s.sigma_px);
  t.AddOne("correlation_inflation", s.correlation_inflation);
  t.AddOne("odometry_noise_factor", s.odometry_noise_factor);
  t.AddMade(
      "loss", [&](size_t) { return LossText(p.loss); },
      [&](size_t, const std::string& text) { return SetLoss(text, &p.loss); });
  OdometryScale& scale = p.scales.front();
  t.AddOne("scale", scale.value);
  t.AddOne("scale_constant", scale.constant);
  t.AddOne("scale_prior", scale.prior);
  t.AddOne("scale_sigma", scale.sigma);
  t.AddOne("points_constant", p.points_constant);
  t.AddOne("initial_cost", s.summary.initial_cost);
  t.AddOne("final_cost", s.summary.final_cost);
  t.AddOne("iterations", s.summary.iterations);
  t.AddOne("converged", s.summary.converged);
  t.AddOne("dropped_observations", s.dropped_observations);
  return t;
}

CameraModel ModelNamed(const std::string& name) {
  for (CameraModel model : {CameraModel::kPinhole, CameraModel::kRadtan, CameraModel::kRational,
                            CameraModel::kKannalaBrandt, CameraModel::kEquirectangular}) {
    if (CameraModelName(model) == name) return model;
  }
  throw InputError("unknown camera model '" + name + "'");
}

Table CameraTable(Solution& s, int version) {
  Table t{"cameras", s.cameras.size(), [&](size_t n) { s.cameras.resize(n); }, {}};
  struct Parts {
    std::string model;
    int width = 0, height = 0;
  };
  const auto parts = std::make_shared<Parts>();  // of the row that is being read
  const auto camera = [&](size_t i) -> Camera& { return s.cameras[i].camera; };
  t.Add("name", s.cameras, &BodyCamera::name);
  t.AddMade(
      "model", [=](size_t i) { return std::string(CameraModelName(camera(i).model())); },
      [=](size_t, const std::string& v) { return parts->model = v, true; });
  t.AddMade(
      "width", [=](size_t i) { return camera(i).width(); }, [=](size_t, int v) { return parts->width = v, true; });
  t.AddMade(
      "height", [=](size_t i) { return camera(i).height(); }, [=](size_t, int v) { return parts->height = v, true; });
  t.AddMade(
      "params", [=](size_t i) { return camera(i).params(); },
      [=](size_t i, std::vector<double> v) {
        try {
          camera(i) = Camera(ModelNamed(parts->model), parts->width, parts->height, std::move(v));
        } catch (const InputError&) {
          return false;
        }
        return true;
      });
  t.AddRigid(
      "cam_from_body_", [&](size_t i) -> auto& { return s.cameras[i].cam_from_body; });
  t.Add("has_extrinsics", s.cameras, &BodyCamera::has_extrinsics);
  t.Add("time_offset_s", s.cameras, &BodyCamera::time_offset_s);
  if (version > 2) {
    const auto part = [&](size_t i) -> PicturePart& { return s.cameras[i].part; };
    t.AddMade(
        "view", [=](size_t i) { return static_cast<int>(part(i).view); },
        [=](size_t i, int v) {
          part(i).view = static_cast<uint8_t>(v);
          return v >= 0 && v <= std::numeric_limits<uint8_t>::max();
        });
  }
  return t;
}

Table ImageTable(Solution& s) {
  Table t{"images", s.images.size(), [&](size_t n) { s.images.resize(n); }, {}};
  t.Add("stamp_ns", s.images, &SolutionImage::stamp_ns);
  t.Add("name", s.images, &SolutionImage::name);
  t.Add("camera", s.images, &SolutionImage::camera);
  t.Add("pose", s.images, &SolutionImage::pose);
  return t;
}

Table StampTable(Solution& s) {
  Table t{"body_poses", s.pose_stamps.size(), [&](size_t n) { s.pose_stamps.resize(n); }, {}};
  t.Add("stamp_ns", s.pose_stamps);
  return t;
}

Table PoseTable(Solution& s) {
  BundleProblem& p = s.problem;
  const auto resize = [&](size_t n) { p.poses.resize(n), p.pose_constant.resize(n); };
  Table t{"poses", p.poses.size(), resize, {}};
  t.AddRigid(
      "rig_from_odom_", [&](size_t i) -> auto& { return p.poses[i]; });
  t.AddMade(
      "constant", [&](size_t i) { return !p.pose_constant.empty() && p.pose_constant[i]; },
      [&](size_t i, bool v) { return p.pose_constant[i] = v, true; });
  return t;
}

Table LensTable(const char* name, std::vector<LensParameters>& lenses) {
  Table t{name, lenses.size(), [&](size_t n) { lenses.resize(n); }, {}};
  t.AddMade(
      "errors", [&](size_t i) { return std::vector<double>(lenses[i].begin(), lenses[i].end()); },
      [&](size_t i, const std::vector<double>& v) {
        if (v.size() != lenses[i].size()) return false;
        std::copy(v.begin(), v.end(), lenses[i].begin());
        return true;
      });
  return t;
}

Table ShiftTable(Solution& s) {
  Eigen::MatrixXd& shifts = s.problem.pose_shifts;
  const auto resize = [&](size_t n) { shifts.resize(6 * static_cast<Eigen::Index>(n), 0); };
  Table t{"pose_shifts", static_cast<size_t>(shifts.rows() / 6), resize, {}};
  t.AddMade(
      "shifts",
      [&](size_t i) {
        const Eigen::MatrixXd own = shifts.middleRows<6>(6 * static_cast<Eigen::Index>(i));
        return std::vector<double>(own.data(), own.data() + own.size());
      },
      [&](size_t i, const std::vector<double>& v) {
        const auto errors = static_cast<Eigen::Index>(v.size() / 6);
        if (i == 0) shifts.setZero(shifts.rows(), errors);
        if (errors == 0 || 6 * shifts.cols() != static_cast<Eigen::Index>(v.size())) return false;
        shifts.middleRows<6>(6 * static_cast<Eigen::Index>(i)) = Eigen::Map<const Eigen::MatrixXd>(v.data(), 6, errors);
        return true;
      });
  return t;
}

Table CovarianceTable(Solution& s) {
  Table t{"covariances", s.covariances.size(), [&](size_t n) { s.covariances.resize(n); }, {}};
  t.Add("covariance", s.covariances);
  return t;
}

Table ViewTable(Solution& s) {
  std::vector<Rigid3d>& views = s.problem.views;
  Table t{"views", views.size(), [&](size_t n) { views.resize(n); }, {}};
  t.AddRigid(
      "view_from_rig_", [&](size_t i) -> auto& { return views[i]; });
  return t;
}

Table PointTable(Solution& s) {
  std::vector<Eigen::Vector3d>& points = s.problem.points;
  const auto resize = [&](size_t n) { points.resize(n), s.depth_m.resize(n), s.point_valid.resize(n); };
  Table t{"points", points.size(), resize, {}};
  t.Add(
      "x", [&](size_t i) -> auto& { return points[i].x(); });
  t.Add(
      "y", [&](size_t i) -> auto& { return points[i].y(); });
  t.Add(
      "z", [&](size_t i) -> auto& { return points[i].z(); });
  t.Add("depth_m", s.depth_m);
  t.Add("valid", [&](size_t i) { return s.point_valid[i]; });
  return t;
}

Table ObservationTable(Solution& s) {
  std::vector<BearingObservation>& o = s.problem.observations;
  Table t{"observations", o.size(), [&](size_t n) { o.resize(n), s.image_of.resize(n), s.feature_of.resize(n); }, {}};
  t.Add("point", o, &BearingObservation::point);
  t.Add("pose", o, &BearingObservation::pose);
  t.Add("view", o, &BearingObservation::view);
  t.Add("image", s.image_of);
  t.Add("feature", s.feature_of);
  t.Add("active", o, &BearingObservation::active);
  t.Add("ray", o, &BearingObservation::ray);
  t.Add("w", o, &BearingObservation::w);
  return t;
}

Table FactorTable(Solution& s) {
  std::vector<PoseFactor>& f = s.problem.factors;
  static const std::map<PoseFactor::Kind, std::string> kKinds = {
      {PoseFactor::Kind::kBetween, "between"},   {PoseFactor::Kind::kPrior, "prior"},
      {PoseFactor::Kind::kGeotag, "geotag"},     {PoseFactor::Kind::kTwoView, "two_view"},
      {PoseFactor::Kind::kPosition, "position"}, {PoseFactor::Kind::kRigPoint, "rig_point"}};
  Table t{"factors", f.size(), [&](size_t n) { f.resize(n); }, {}};
  t.AddMade(
      "kind", [&](size_t i) { return kKinds.at(f[i].kind); },
      [&](size_t i, const std::string& v) {
        for (const auto& [kind, name] : kKinds) {
          if (v != name) continue;
          f[i].kind = kind;
          return true;
        }
        return false;
      });
  t.Add("a", f, &PoseFactor::a);
  t.Add("b", f, &PoseFactor::b);
  // 0: metric; else the number of its scale, the first of them 1.
  t.AddMade(
      "scaled", [&](size_t i) { return f[i].scale + 1; }, [&](size_t i, int v) { return f[i].scale = v - 1, v >= 0; });
  t.AddRigid(
      "measured_", [&](size_t i) -> auto& { return f[i].measured; });
  t.Add("arm", f, &PoseFactor::arm);
  t.Add("view_a", f, &PoseFactor::view_a);
  t.Add("view_b", f, &PoseFactor::view_b);
  t.Add("sqrt_info", f, &PoseFactor::sqrt_info);
  t.AddMade(
      "loss", [&](size_t i) { return LossText(f[i].loss); },
      [&](size_t i, const std::string& text) { return SetLoss(text, &f[i].loss); });
  t.Add("weight", f, &PoseFactor::weight);
  return t;
}

Table CountTable(Solution& s) {
  Table t{"counts", s.counts.size(), [&](size_t n) { s.counts.resize(n); }, {}};
  using Count = SolutionCounts::value_type;
  t.Add("name", s.counts, &Count::first);
  t.Add("value", s.counts, &Count::second);
  return t;
}

Table ReferenceTable(Solution& s) {
  std::vector<SolutionReference>& r = s.references;
  Table t{"refs", r.size(), [&](size_t n) { r.resize(n); }, {}};  // `references` is a word of SQL
  t.Add("name", r, &SolutionReference::name);
  t.Add("row", r, &SolutionReference::row);
  t.Add("station", r, &SolutionReference::station);
  t.Add("status", r, &SolutionReference::status);
  t.Add("reason", r, &SolutionReference::reason);
  t.Add("pose", r, &SolutionReference::pose);
  t.Add("view_matches", r, &SolutionReference::view_matches);
  t.Add("agreeing", r, &SolutionReference::agreeing);
  t.Add("second", r, &SolutionReference::second);
  t.Add("support", r, &SolutionReference::support);
  t.Add("inlier_ratio", r, &SolutionReference::inlier_ratio);
  t.Add("distance_m", r, &SolutionReference::distance_m);
  t.Add("geotag", r, &SolutionReference::geotag);
  t.Add("geotag_difference", r, &SolutionReference::geotag_difference);
  return t;
}

Table GeoreferenceTable(Solution& s) {
  Table t{"georeference",
          s.georeference ? 1u : 0u,
          [&](size_t n) {
            if (n > 0) s.georeference.emplace();
          },
          {}};
  const auto geo = [&](size_t) -> SolutionGeoreference& { return *s.georeference; };
  t.Add(
      "source", [=](size_t i) -> auto& { return geo(i).source; });
  t.Add(
      "origin_latitude_deg", [=](size_t i) -> auto& { return geo(i).origin.latitude_deg; });
  t.Add(
      "origin_longitude_deg", [=](size_t i) -> auto& { return geo(i).origin.longitude_deg; });
  t.Add(
      "origin_height_m", [=](size_t i) -> auto& { return geo(i).origin.height_m; });
  t.AddRigid(
      "world_from_odom_", [=](size_t i) -> auto& { return geo(i).world_from_odom; });
  t.Add(
      "world_from_odom_scale", [=](size_t i) -> auto& { return geo(i).world_from_odom.scale; });
  t.Add(
      "covariance", [=](size_t i) -> auto& { return geo(i).covariance; });
  return t;
}

Table GeoreferenceCrossTable(Solution& s) {
  Table t{"georeference_poses",
          s.georeference ? s.georeference->with_poses.size() : 0,
          [&](size_t n) {
            if (s.georeference) s.georeference->with_poses.resize(n);
          },
          {}};
  t.Add(
      "covariance", [&](size_t i) -> auto& { return s.georeference->with_poses[i]; });
  return t;
}

Table EvidenceTable(Solution& s) {
  Table t{"evidence",
          s.georeference ? s.georeference->evidence.size() : 0,
          [&](size_t n) {
            if (s.georeference) s.georeference->evidence.resize(n);
          },
          {}};
  t.Add(
      "name", [&](size_t i) -> auto& { return s.georeference->evidence[i]; });
  return t;
}

// A row for each rig of the map, with its six rows of the root of the information.
Table MapTable(Solution& s) {
  std::optional<MapFactor>& map = s.problem.map;
  const auto resize = [&](size_t n) {
    if (n == 0) return;
    map.emplace();
    map->rigs.resize(n), map->measured.resize(n);
    map->sqrt_info.setZero(6 * static_cast<Eigen::Index>(n), 6 * static_cast<Eigen::Index>(n));
  };
  Table t{"map", map ? map->rigs.size() : 0, resize, {}};
  t.Add(
      "pose", [&](size_t i) -> auto& { return map->rigs[i]; });
  t.AddMade(
      "frame", [&](size_t) { return map->frame; }, [&](size_t, int v) { return map->frame = v, true; });
  t.AddRigid(
      "world_from_rig_", [&](size_t i) -> auto& { return map->measured[i]; });
  t.AddMade(
      "sqrt_info",
      [&](size_t i) {
        const Eigen::MatrixXd rows = map->sqrt_info.middleRows<6>(6 * static_cast<Eigen::Index>(i));
        return std::vector<double>(rows.data(), rows.data() + rows.size());
      },
      [&](size_t i, const std::vector<double>& v) {
        auto rows = map->sqrt_info.middleRows<6>(6 * static_cast<Eigen::Index>(i));
        if (static_cast<Eigen::Index>(v.size()) != rows.size()) return false;
        rows = Eigen::Map<const Eigen::MatrixXd>(v.data(), 6, rows.cols());
        return true;
      });
  return t;
}

// The runs of a site, with their scales.
Table SiteRunTable(Solution& s) {
  Table t{
      "runs", s.runs.size(), [&](size_t n) { s.runs.resize(n), s.problem.scales.resize(std::max<size_t>(1, n)); }, {}};
  std::vector<SolutionRun>& r = s.runs;
  std::vector<OdometryScale>& scales = s.problem.scales;
  t.Add("name", r, &SolutionRun::name);
  t.Add("first_camera", r, &SolutionRun::first_camera);
  t.Add("first_image", r, &SolutionRun::first_image);
  t.Add("first_pose", r, &SolutionRun::first_pose);
  t.Add("sigma_px", r, &SolutionRun::sigma_px);
  t.Add("correlation_inflation", r, &SolutionRun::correlation_inflation);
  t.Add("odometry_noise_factor", r, &SolutionRun::odometry_noise_factor);
  t.Add("scale", scales, &OdometryScale::value);
  t.Add("scale_constant", scales, &OdometryScale::constant);
  t.Add("scale_prior", scales, &OdometryScale::prior);
  t.Add("scale_sigma", scales, &OdometryScale::sigma);
  return t;
}

int VersionOf(const Solution& s) {
  const auto is_view = [](const BodyCamera& camera) { return camera.IsFurtherView(); };
  if (!s.lens_roots.empty()) return 5;
  if (!s.lens_errors.empty() || s.problem.pose_shifts.size() > 0) return 4;
  if (!s.runs.empty() || std::any_of(s.cameras.begin(), s.cameras.end(), is_view)) return 3;
  return s.problem.map || (s.georeference && !s.georeference->evidence.empty()) ? 2 : 1;
}

std::vector<Table> Tables(Solution& s, int version) {
  std::vector<Table> tables = {RunTable(s),          CameraTable(s, version),
                               ImageTable(s),        StampTable(s),
                               PoseTable(s),         ViewTable(s),
                               CovarianceTable(s),   PointTable(s),
                               ObservationTable(s),  FactorTable(s),
                               CountTable(s),        ReferenceTable(s),
                               GeoreferenceTable(s), GeoreferenceCrossTable(s)};
  if (version > 1) {
    tables.push_back(EvidenceTable(s));
    tables.push_back(MapTable(s));
  }
  if (version > 2) tables.push_back(SiteRunTable(s));
  if (version > 3) {
    tables.push_back(LensTable("lens_errors", s.lens_errors));
    tables.push_back(ShiftTable(s));
  }
  if (version > 4) tables.push_back(LensTable("lens_roots", s.lens_roots));
  return tables;
}

std::string ColumnNames(const Table& table) {
  std::string names;
  for (const solution_table::Column& c : table.columns) names += (names.empty() ? "" : ", ") + c.name;
  return names;
}

// What SQLite says when it fails; the caller names the file.
struct SqliteFailure {
  int code = 0;
  std::string what;
};

class Database {
 public:
  Database(const fs::path& file, int flags) {
    if (sqlite3_open_v2(file.c_str(), &db_, flags, nullptr) != SQLITE_OK) {
      const SqliteFailure failure = Failure();
      sqlite3_close(db_);
      throw failure;
    }
    sqlite3_busy_timeout(db_, 2000);
  }
  ~Database() { sqlite3_close(db_); }
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;
  void Run(const std::string& sql) const {
    if (sqlite3_exec(db_, sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) throw Failure();
  }
  std::shared_ptr<sqlite3_stmt> Prepare(const std::string& sql) const {
    sqlite3_stmt* statement = nullptr;
    if (sqlite3_prepare_v2(db_, sql.c_str(), -1, &statement, nullptr) != SQLITE_OK) throw Failure();
    return {statement, sqlite3_finalize};
  }
  bool Step(sqlite3_stmt* statement) const {
    const int code = sqlite3_step(statement);
    if (code != SQLITE_ROW && code != SQLITE_DONE) throw Failure();
    return code == SQLITE_ROW;
  }
  int64_t Integer(const std::string& sql) const {
    const auto statement = Prepare(sql);
    return Step(statement.get()) ? sqlite3_column_int64(statement.get(), 0) : 0;
  }
  std::string Text(const std::string& sql) const {
    const auto statement = Prepare(sql);
    if (!Step(statement.get()) || sqlite3_column_type(statement.get(), 0) != SQLITE_TEXT) return "";
    return reinterpret_cast<const char*>(sqlite3_column_text(statement.get(), 0));
  }

 private:
  SqliteFailure Failure() const { return {sqlite3_errcode(db_), sqlite3_errmsg(db_)}; }
  sqlite3* db_ = nullptr;
};

void WriteTable(const Database& db, const Table& table, HashChain* hash) {
  std::string places;
  for (size_t k = 0; k < table.columns.size(); ++k) places += k == 0 ? "?" : ", ?";
  db.Run("CREATE TABLE " + table.name + " (" + ColumnNames(table) + ")");
  const auto insert = db.Prepare("INSERT INTO " + table.name + " VALUES (" + places + ")");
  Cells cells(insert.get(), hash);
  for (size_t row = 0; row < table.rows; ++row) {
    for (size_t k = 0; k < table.columns.size(); ++k) table.columns[k].put(cells, static_cast<int>(k), row);
    db.Step(insert.get());
    sqlite3_reset(insert.get());
  }
}

void ReadTable(const Database& db, const Table& table, HashChain* hash) {
  const int64_t rows = db.Integer("SELECT count(*) FROM " + table.name);
  if (table.name == "run" && rows != 1) throw InputError(fmt::format("table run has {} rows, expected 1", rows));
  table.resize(static_cast<size_t>(rows));
  const auto select = db.Prepare("SELECT " + ColumnNames(table) + " FROM " + table.name + " ORDER BY rowid");
  Cells cells(select.get(), hash);
  for (size_t row = 0; row < static_cast<size_t>(rows); ++row) {
    if (!db.Step(select.get())) throw InputError("table " + table.name + " ends early");
    for (size_t k = 0; k < table.columns.size(); ++k) {
      if (table.columns[k].get(cells, static_cast<int>(k), row)) continue;
      throw InputError(fmt::format("table {}, row {}: {} is of another kind than expected", table.name, row + 1,
                                   table.columns[k].name));
    }
  }
}

Solution ReadTables(const Database& db, int version) {
  Solution solution;
  HashChain hash;
  for (const Table& table : Tables(solution, version)) ReadTable(db, table, &hash);
  if (hash.Hex() != db.Text("SELECT sha256 FROM checksum")) throw InputError("its checksum does not match its values");
  CheckSolution(solution);
  return solution;
}

}  // namespace

void WriteSolution(const Solution& solution, const fs::path& file) {
  CheckSolution(solution);
  std::error_code ignored;
  fs::remove(file, ignored);
  try {
    const Database db(file, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
    // A stage's folder is renamed when it is complete, so that no journal is needed.
    db.Run(
        fmt::format("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; PRAGMA application_id = {}; "
                    "PRAGMA user_version = {}; BEGIN",
                    kApplicationId, VersionOf(solution)));
    HashChain hash;
    // The description serves reading, too; writing changes nothing.
    for (const Table& table : Tables(const_cast<Solution&>(solution), VersionOf(solution)))
      WriteTable(db, table, &hash);
    db.Run("CREATE TABLE checksum (sha256); INSERT INTO checksum VALUES ('" + hash.Hex() + "'); COMMIT");
  } catch (const SqliteFailure& e) {
    throw IoError(file.string() + ": cannot be written: " + e.what);
  }
}

Solution ReadSolution(const fs::path& file) {
  errno = 0;
  if (!std::ifstream(file)) throw IoErrorFor(file, "read", errno);
  const char* const kRemedy = "; compute it again by `trigpoint run`";
  const auto unusable = [&](const std::string& why) { return InputError(file.string() + ": " + why + kRemedy); };
  try {
    const Database db(file, SQLITE_OPEN_READONLY);
    const int64_t application = db.Integer("PRAGMA application_id"), version = db.Integer("PRAGMA user_version");
    if (application != kApplicationId) throw unusable("is another kind of database, expected a solution of Trigpoint");
    if (version > kSolutionVersion) {
      throw unusable(fmt::format("has format version {}, this program reads up to {}: use the Trigpoint that wrote it",
                                 version, kSolutionVersion) +
                     ", or");
    }
    try {
      return ReadTables(db, static_cast<int>(version));
    } catch (const InputError& e) {
      throw unusable(std::string("is damaged: ") + e.what());
    }
  } catch (const SqliteFailure& e) {
    const bool busy = e.code == SQLITE_BUSY || e.code == SQLITE_LOCKED;
    if (busy) throw IoError(file.string() + ": another program writes it; end that and try again");
    throw unusable("is damaged or no solution: " + e.what);
  }
}

}  // namespace trigpoint

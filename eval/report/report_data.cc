#include "eval/report/report_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>

#include "datasets/colmap/model.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "eval/errors/evaluate.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr size_t kFurtherRows = 100000;  // of a table that has no chapter of its own
constexpr size_t kSampleSize = 200000;   // of the points of a run

// An empty, missing or unusable cell is "not given".
std::optional<double> Number(const CsvTable& table, const CsvRow& row, const char* column) {
  if (!table.HasColumn(column) || !row.Has(column)) return std::nullopt;
  const auto value = ParseDouble(row.Text(column));
  return value && std::isfinite(*value) ? value : std::nullopt;
}

std::string Text(const CsvTable& table, const CsvRow& row, const char* column) {
  return table.HasColumn(column) ? row.Text(column) : "";
}

int Whole(const CsvTable& table, const CsvRow& row, const char* column, int missing) {
  const auto value = Number(table, row, column);
  return value ? static_cast<int>(*value) : missing;
}

std::optional<double> Largest(std::initializer_list<std::optional<double>> values) {
  std::optional<double> most;
  for (const auto& v : values) {
    if (!v) return std::nullopt;
    most = most ? std::max(*most, *v) : *v;
  }
  return most;
}

class Reader {
 public:
  Reader(const ReportInput& input, const CancelToken& cancel)
      : input_(input), project_(*input.project), cancel_(cancel) {}

  ReportData Read() {
    for (const std::string& variant : input_.variants) ReadVariant(variant);
    for (const ResultRecord& stage : input_.stages) {
      data_.newest = std::max(data_.newest, TextAt(stage.manifest, "end"));
      if (stage.stage == "localize") ReadRun(stage);
    }
    ReadTags();
    ReadStitched();
    CollectStations();
    ReadReviews();
    for (const std::string& warning : project_.warnings()) data_.notes.push_back(warning);
    for (const auto& [run, why] : project_.site().broken_runs) {
      data_.notes.push_back("run " + run + " cannot be used: " + why);
    }
    return std::move(data_);
  }

 private:
  template <typename Fn>
  void Guard(const std::string& what, Fn&& fn) {
    cancel_.ThrowIfCancelled();
    try {
      fn();
    } catch (const Cancelled&) {
      throw;
    } catch (const std::exception& e) {
      data_.notes.push_back(what + ": " + e.what());
    }
  }
  // A row that cannot be used is left out and the first such is named.
  void EachRow(const CsvTable& table, const std::string& what, const std::function<void(const CsvRow&)>& use) {
    size_t bad = 0;
    std::string first;
    for (const CsvRow& row : table.rows()) {
      try {
        use(row);
      } catch (const InputError& e) {
        if (bad++ == 0) first = e.what();
      }
    }
    if (bad > 0) data_.notes.push_back(fmt::format("{}: {} rows cannot be used; the first: {}", what, bad, first));
  }

  void ReadVariant(const std::string& variant) {
    const fs::path dir = project_.ResultDir("evaluate", ResultNameOf("", variant));
    if (!fs::exists(dir)) return;
    VariantData& v = data_.variants.emplace_back();
    v.variant = variant;
    const std::string name = variant.empty() ? "evaluate" : "evaluate@" + variant;
    if (fs::exists(dir / "summary.json")) {
      Guard(name, [&] { v.summary = nlohmann::json::parse(ReadTextFile(dir / "summary.json")); });
      const std::string schema = TextAt(v.summary, "schema");
      if (v.summary.is_object() && schema != "trigpoint evaluate 1") {
        data_.notes.push_back(name + ": summary.json is of another version ('" + schema +
                              "'); only what could be read is shown. Run `trigpoint evaluate` again.");
      }
    } else {
      data_.notes.push_back(name + ": has no summary.json; run `trigpoint evaluate` again");
    }
    if (!v.summary.is_object()) v.summary = nlohmann::json::object();
    if (const auto groups = v.summary.find("groups"); groups != v.summary.end() && groups->is_array()) {
      groups->erase(std::remove_if(groups->begin(), groups->end(),
                                   [&](const nlohmann::json& g) { return HasItsOwn(TextAt(g, "variant"), variant); }),
                    groups->end());
    }
    Guard(name, [&] { ReadErrors(dir / "errors.csv", name, &v); });
    Guard(name, [&] { ReadFurther(dir, &v); });
    if (variant.empty()) Guard(name, [&] { ReadTrajectories(dir); });
  }

  // The first evaluation shows all variants side by side; one that has an evaluation of its own is taken from there.
  bool HasItsOwn(const std::string& variant, const std::string& read) const {
    return !variant.empty() && variant != read && fs::exists(project_.ResultDir("evaluate", "@" + variant));
  }

  void ReadErrors(const fs::path& file, const std::string& name, VariantData* v) {
    const CsvTable table = CsvTable::Read(file, {"run", "station", "status"});
    EachRow(table, name + "/errors.csv", [&](const CsvRow& row) {
      ErrorRecord e;
      e.run = row.Text("run"), e.station = row.Text("station"), e.status = row.Text("status");
      e.variant = Text(table, row, "variant");
      if (e.variant.empty()) e.variant = v->variant;
      if (HasItsOwn(e.variant, v->variant)) return;
      e.method = Text(table, row, "method"), e.panorama = Text(table, row, "panorama");
      e.reference = Text(table, row, "reference"), e.kind = Text(table, row, "kind");
      e.reason = Text(table, row, "reason"), e.dominant = Text(table, row, "dominant");
      e.trusted = Text(table, row, "trusted");
      e.tag_id = Whole(table, row, "tag_id", -1);
      e.error_3d_m = Number(table, row, "error_3d_m");
      e.error_h_m = Number(table, row, "error_h_m"), e.error_v_m = Number(table, row, "error_v_m");
      e.sigma_e_m = Number(table, row, "sigma_e_m"), e.sigma_n_m = Number(table, row, "sigma_n_m");
      e.sigma_u_m = Number(table, row, "sigma_u_m"), e.depth_sigma_m = Number(table, row, "depth_sigma_m");
      e.nees = Number(table, row, "nees");
      const auto de = Number(table, row, "de_m"), dn = Number(table, row, "dn_m"), du = Number(table, row, "du_m");
      if (de && dn && du) e.error_enu_m = {*de, *dn, *du};
      e.dof = Whole(table, row, "dof", 0);
      e.shares_evidence =
          table.HasColumn("shares_evidence") ? row.Text("shares_evidence") == "yes" : e.reference == "self";
      v->errors.push_back(std::move(e));
    });
  }

  void ReadTrajectories(const fs::path& dir) {
    if (!fs::exists(dir / "estimates.json") || !fs::exists(dir / "estimates.csv")) return;
    const nlohmann::json all = nlohmann::json::parse(ReadTextFile(dir / "estimates.json"));
    std::map<std::pair<std::string, std::string>, size_t> at;
    for (const nlohmann::json& entry : all.value("estimates", nlohmann::json::array())) {
      at[{TextAt(entry, "system"), TextAt(entry, "run")}] = data_.trajectories.size();
      data_.trajectories.push_back({entry, {}});
    }
    std::map<size_t, int64_t> first;
    const CsvTable table = CsvTable::Read(dir / "estimates.csv", {"system", "run", "timestamp"});
    EachRow(table, "evaluate/estimates.csv", [&](const CsvRow& row) {
      const auto it = at.find({row.Text("system"), row.Text("run")});
      if (it == at.end()) return;
      const int64_t stamp = row.StampNs("timestamp");
      ErrorAlong e;
      e.time_s = 1e-9 * static_cast<double>(stamp - first.try_emplace(it->second, stamp).first->second);
      const auto vector = [&](const std::string& before, const char* after) -> std::optional<Eigen::Vector3d> {
        Eigen::Vector3d v;
        for (int k = 0; k < 3; ++k) {
          const auto value = Number(table, row, (before + "enu"[k] + after).c_str());
          if (!value) return std::nullopt;
          v[k] = *value;
        }
        return v;
      };
      if (const std::string image = Text(table, row, "image"); !image.empty()) {
        e.object = "image:" + row.Text("run") + "/" + image;
      }
      e.error_m = vector("d", "_m");
      const auto reference = vector("reference_sigma_", "_m"), own = vector("sigma_", "_m");
      e.stated = own.has_value();
      if (reference) {
        e.sigma_m = own ? Eigen::Vector3d((reference->cwiseAbs2() + own->cwiseAbs2()).cwiseSqrt()) : *reference;
      }
      data_.trajectories[it->second].images.push_back(std::move(e));
    });
  }

  void ReadFurther(const fs::path& dir, VariantData* v) {
    std::set<fs::path> files;
    for (const auto& entry : fs::directory_iterator(dir)) files.insert(entry.path());
    for (const fs::path& file : files) {
      const std::string name = file.filename().string();
      if (file.extension() != ".csv" || name == "errors.csv" || name == "histogram.csv" || name == "estimates.csv")
        continue;
      if (name.starts_with("table_") || name.starts_with("tags_")) continue;
      Guard("evaluate/" + name, [&] {
        const CsvTable table = CsvTable::Read(file, {});
        FurtherTable& further = v->further.emplace_back();
        further.name = file.stem().string();
        if (!table.comments().empty()) further.comment = table.comments().front();
        further.columns = table.columns();
        for (const CsvRow& row : table.rows()) {
          if (further.rows.size() == kFurtherRows) {
            ++further.left_out;
            continue;
          }
          std::vector<std::string>& cells = further.rows.emplace_back();
          for (const std::string& column : further.columns) cells.push_back(row.Text(column));
        }
      });
    }
  }

  void ReadRun(const ResultRecord& stage) {
    const fs::path dir = project_.ResultDir("localize", stage.name);
    if (!fs::exists(dir)) return;
    RunData& run = data_.runs.emplace_back();
    const size_t at = stage.name.find('@');
    run.run = stage.name.substr(0, at);
    if (at != std::string::npos) run.variant = stage.name.substr(at + 1);
    run.manifest = stage.manifest;
    Guard("localize/" + stage.name, [&] {
      const CsvTable table = CsvTable::Read(dir / "panoramas.csv", {"panorama", "status"});
      EachRow(table, "localize/" + stage.name + "/panoramas.csv", [&](const CsvRow& row) {
        RunData::Answer a;
        a.panorama = row.Text("panorama"), a.status = row.Text("status");
        a.station = Text(table, row, "station"), a.reason = Text(table, row, "reason");
        // A photo set goes with the station it is of, as in the evaluation.
        if (const std::string meant = StationNamed(a.station, project_.site().stations); !meant.empty())
          a.station = meant;
        a.geotag_status = Text(table, row, "geotag_status");
        a.inliers = Whole(table, row, "inliers", 0), a.matches = Whole(table, row, "view_matches", 0);
        a.views = Whole(table, row, "views", 0);
        a.sigma_m = Largest(
            {Number(table, row, "sigma_x_m"), Number(table, row, "sigma_y_m"), Number(table, row, "sigma_z_m")});
        const auto de = Number(table, row, "geotag_de_m"), dn = Number(table, row, "geotag_dn_m");
        if (de && dn) a.geotag_off_m = std::hypot(*de, *dn);
        a.geotag_up_m = Number(table, row, "geotag_du_m");
        a.sigma_v_m = Number(table, row, "sigma_z_m");
        const auto x = Number(table, row, "x"), y = Number(table, row, "y"), z = Number(table, row, "z");
        if (x && y && z) a.place_m = {*x, *y, *z};
        a.sigma_h_m = Largest({Number(table, row, "sigma_x_m"), Number(table, row, "sigma_y_m")});
        run.answers.push_back(std::move(a));
      });
    });
    if (!input_.points || !HasColmapModel(dir / "sparse")) return;
    Guard("localize/" + stage.name + "/sparse", [&] {
      const SparseModel model = ReadColmapModel(dir / "sparse");
      const size_t step = model.points.size() / kSampleSize + 1;
      for (size_t i = 0; i < model.points.size(); i += step) {
        const ModelPoint& point = model.points[i];
        RunData::PointQuality& quality = run.points.emplace_back();
        if (std::isfinite(point.error_px)) quality.residual_px = point.error_px;
        quality.track_length = static_cast<double>(point.track.size());
        if (run.variant.empty()) quality.object = "point:" + run.run + "/" + std::to_string(point.id);
      }
      ReadImageResiduals(model, &run);
    });
  }

  void ReadImageResiduals(const SparseModel& model, RunData* run) const {
    std::map<uint32_t, std::pair<double, int>> sums;  // by image
    for (const ModelPoint& point : model.points) {
      if (!std::isfinite(point.error_px)) continue;
      for (const auto& [image, pixel] : point.track) sums[image].first += point.error_px, ++sums[image].second;
    }
    std::map<std::string, int64_t> stamps;
    for (const ImageEntry& image : project_.run(run->run).images) stamps.emplace(image.file, image.stamp_ns);
    for (const ModelImage& image : model.images) {
      const auto sum = sums.find(image.id);
      const auto stamp = stamps.find(image.name);
      if (sum == sums.end() || stamp == stamps.end()) continue;
      run->image_residuals.push_back(
          {1e-9 * static_cast<double>(stamp->second - project_.run(run->run).images[0].stamp_ns),
           sum->second.first / sum->second.second, "image:" + run->run + "/" + image.name});
    }
    std::sort(run->image_residuals.begin(), run->image_residuals.end(),
              [](const auto& a, const auto& b) { return a.time_s < b.time_s; });
  }

  void ReadTags() {
    const auto read = [&](const fs::path& file, const std::string& source) {
      if (!fs::exists(file)) return;
      Guard("tags of " + source, [&] {
        const CsvTable table = CsvTable::Read(file, {"tag_id"});
        EachRow(table, source + "/" + file.filename().string(), [&](const CsvRow& row) {
          TagLine tag;
          tag.id = Whole(table, row, "tag_id", -1);
          tag.source = source;
          tag.role = Text(table, row, "role"), tag.status = Text(table, row, "status");
          tag.size_m = Number(table, row, "size_m").value_or(0);
          tag.sigma_m = Largest(
              {Number(table, row, "sigma_x_m"), Number(table, row, "sigma_y_m"), Number(table, row, "sigma_z_m")});
          const auto vector = [&](const char* x, const char* y, const char* z) -> std::optional<Eigen::Vector3d> {
            const auto a = Number(table, row, x), b = Number(table, row, y), c = Number(table, row, z);
            if (!a || !b || !c) return std::nullopt;
            return Eigen::Vector3d(*a, *b, *c);
          };
          tag.place_m = vector("x", "y", "z");
          tag.sigmas_m = vector("sigma_x_m", "sigma_y_m", "sigma_z_m");
          tag.rms_px = Number(table, row, "rms_px");
          tag.images = Whole(table, row, "images", 0), tag.runs = Whole(table, row, "runs", 0);
          data_.tags.push_back(std::move(tag));
        });
      });
    };
    for (const std::string& variant : input_.variants) {
      const std::string suffix = ResultNameOf("", variant);
      read(project_.ResultDir("survey", suffix) / "tags.csv", "survey" + suffix);
    }
    for (const Run& run : project_.site().runs) {
      read(project_.ResultDir("evaluate", "") / ("tags_" + run.name + ".csv"), "cameras of " + run.name);
    }
    for (const std::string& variant : input_.variants) {
      const std::string suffix = ResultNameOf("", variant);
      const fs::path gates = project_.ResultDir("gates", suffix) / "gates.json";
      if (!fs::exists(gates)) continue;
      Guard("gates" + suffix, [&] { data_.gates.emplace_back(variant, nlohmann::json::parse(ReadTextFile(gates))); });
    }
    const fs::path survey = project_.ResultDir("survey", "") / "summary.json";
    if (!fs::exists(survey)) return;
    Guard("survey", [&] { data_.survey = nlohmann::json::parse(ReadTextFile(survey)); });
  }

  void ReadStitched() {
    std::error_code ignored;
    std::set<fs::path> folders;
    for (fs::directory_iterator it(project_.results() / "stitch", ignored), end; it != end; it.increment(ignored)) {
      if (it->path().filename().string().front() != '.') folders.insert(it->path());
    }
    for (const fs::path& folder : folders) {
      Guard("stitch/" + folder.filename().string(), [&] {
        const nlohmann::json manifest = nlohmann::json::parse(ReadTextFile(folder / "manifest.json"));
        StitchedSet set{folder.filename().string(), ObjectAt(manifest, "metrics"), {}};
        if (const std::string file = TextAt(set.metrics, "panorama"); !file.empty()) set.panorama = folder / file;
        data_.newest = std::max(data_.newest, TextAt(manifest, "end"));
        data_.stitched.push_back(std::move(set));
      });
    }
  }

  void CollectStations() {
    std::set<std::string> known;
    const auto add = [&](const std::string& station) {
      if (!station.empty() && known.insert(station).second) data_.stations.push_back(station);
    };
    for (const Station& station : project_.site().stations) add(station.name);
    for (const VariantData& v : data_.variants) {
      for (const ErrorRecord& e : v.errors) add(e.station);
    }
    for (const RunData& run : data_.runs) {
      for (const RunData::Answer& a : run.answers) {
        if (a.status != "unmatched") add(a.station);
      }
    }
  }

  void ReadReviews() {
    std::ifstream file(project_.dir() / "review.jsonl");
    std::string line;
    int number = 0;
    while (std::getline(file, line)) {
      ++number;
      if (Trim(line).empty()) continue;
      nlohmann::json entry = nlohmann::json::parse(line, nullptr, false);
      if (entry.is_object()) {
        data_.reviews.push_back(std::move(entry));
      } else {
        data_.notes.push_back(fmt::format("review.jsonl:{}: is no JSON object and is left out", number));
      }
    }
  }

  const ReportInput& input_;
  const Project& project_;
  const CancelToken& cancel_;
  ReportData data_;
};

}  // namespace

ReportData ReadReportData(const ReportInput& input, ProgressSink& progress, const CancelToken& cancel) {
  progress.Begin("reading results", 0);
  return Reader(input, cancel).Read();
}

}  // namespace trigpoint

#include "eval/exchange/colmap_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "datasets/colmap/camera_models.h"
#include "datasets/io/credits.h"
#include "datasets/io/exif.h"
#include "datasets/io/image.h"
#include "datasets/io/text.h"
#include "localize/reconstruct/feature_store.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

std::string Params(const ColmapCamera& camera) {
  std::string text;
  for (double p : camera.params) {
    if (!text.empty()) text += ',';
    text += fmt::format("{:.17g}", p);
  }
  return text;
}

// The picture as calibrated under a name COLMAP can use: a link where the file is that picture, else a mended copy.
void PutImage(const Run& run, const ImageEntry& entry, const fs::path& file) {
  fs::create_directories(file.parent_path());
  const bool plain = entry.video_frame < 0 && !run.config.mirrored &&
                     run.cameras[static_cast<size_t>(entry.camera)].part.kind == PicturePart::Kind::kAll &&
                     ReadPhotoMetadata(entry.path).orientation == 1;
  if (plain) {
    fs::create_symlink(fs::absolute(entry.path), file);
  } else if (!cv::imwrite(file.string(), LoadGrey(run, entry), {cv::IMWRITE_JPEG_QUALITY, 98})) {
    throw IoError(file.string() + ": cannot be written; is the disk full?");
  }
}

// The model that a mapper has left in `dir`, or why there is none.
void TakeModel(const fs::path& dir, ColmapSolution* solution) {
  try {
    solution->model = ReadColmapModel(dir);
    solution->models = 1;
    solution->status = "done";
  } catch (const InputError& e) {
    solution->status = "failed";
    solution->reason = e.what();
  }
}

}  // namespace

std::vector<std::string> CrosscheckOptions::Check() const {
  std::vector<std::string> problems = CheckRanges(*this);
  if (solver != "triangulate" && solver != "mapper") {
    problems.push_back("option solver is '" + solver + "', expected triangulate or mapper");
  }
  if (matcher != "auto" && matcher != "exhaustive" && matcher != "sequential") {
    problems.push_back("option matcher is '" + matcher + "', expected auto, exhaustive or sequential");
  }
  return problems;
}

ColmapRun::ColmapRun(const Project& project, const std::string& run, const RunScene& scene,
                     const CrosscheckOptions& options, const ViewOptions& views, const fs::path& work,
                     const fs::path& log, int threads, ProgressSink& progress, const CancelToken& cancel)
    : project_(project),
      run_(run),
      scene_(scene),
      options_(options),
      views_(views),
      work_(work),
      log_(log),
      threads_(threads),
      progress_(progress),
      cancel_(cancel),
      program_(FindProgram("colmap")) {
  if (program_.empty()) return;
  const fs::path help = log.parent_path() / "colmap_version.txt";
  RunChild({program_.string(), "help"}, help, 60, cancel);
  std::ifstream in(help);
  for (std::string line; version_.empty() && std::getline(in, line);) {
    if (line.starts_with("COLMAP ")) version_ = line.substr(7, line.find(' ', 7) - 7);
  }
  in.close();
  fs::remove(help);
  if (version_.empty()) version_ = "unknown";
  int major = 0, minor = 0;
  if (std::sscanf(version_.c_str(), "%d.%d", &major, &minor) == 2) {
    new_option_names_ = major > 3 || (major == 3 && minor >= 12);
  }
}

bool ColmapRun::Step(ColmapSolution* solution, const std::string& name, const std::vector<std::string>& arguments) {
  progress_.Begin("COLMAP " + solution->depth + ": " + name, 0);
  std::vector<std::string> argv = {program_.string()};
  argv.insert(argv.end(), arguments.begin(), arguments.end());
  {
    std::ofstream out(log_, std::ios::app);
    out << "\n$";
    for (const std::string& argument : argv) out << ' ' << argument;
    out << '\n';
  }
  ColmapStep step{solution->depth, name, RunChild(argv, log_, 60 * options_.timeout_min, cancel_)};
  steps_.push_back(step);
  if (step.result.exit_code == 0) return true;
  solution->status = "failed";
  solution->reason =
      fmt::format("COLMAP's {} ended with code {}: {}", name, step.result.exit_code, step.result.last_line);
  return false;
}

// "SiftExtraction.use_gpu" under the name that this version has for it.
std::string ColmapRun::Option(const std::string& sift) const {
  return new_option_names_ ? fmt::format("--Feature{}", sift.substr(4)) : fmt::format("--{}", sift);
}

bool ColmapRun::ExtractFeatures(ColmapSolution* solution, const std::string& name, const fs::path& database,
                                const fs::path& images, const std::vector<std::string>& names, const Camera& camera) {
  const fs::path list = work_ / "list.txt";
  std::string text;
  for (const std::string& image : names) text += image + "\n";
  WriteFileAtomically(list, text);
  const ColmapCamera c = ToColmap(camera);
  return Step(solution, name,
              {"feature_extractor", "--database_path", database.string(), "--image_path", images.string(),
               "--image_list_path", list.string(), "--ImageReader.single_camera", "1", "--ImageReader.camera_model",
               c.model_name, "--ImageReader.camera_params", Params(c), Option("SiftExtraction.use_gpu"), "0",
               Option("SiftExtraction.num_threads"), std::to_string(threads_)});
}

// Of the numbered models the mapper left, the one with the most images.
bool ColmapRun::PickModel(ColmapSolution* solution, const fs::path& dir) {
  for (const auto& entry : fs::directory_iterator(dir)) {
    if (!entry.is_directory() || !HasColmapModel(entry.path())) continue;
    ++solution->models;
    try {
      SparseModel model = ReadColmapModel(entry.path());
      if (model.images.size() <= solution->model.images.size()) continue;
      solution->model = std::move(model);
      fs::copy(entry.path(), work_ / ("best_" + solution->depth),
               fs::copy_options::recursive | fs::copy_options::overwrite_existing);
    } catch (const InputError& e) {
      solution->reason = e.what();
    }
  }
  if (solution->model.images.empty()) {
    solution->status = "failed";
    if (solution->reason.empty()) solution->reason = "COLMAP found no model: no pair of images to begin with";
    return false;
  }
  solution->status = "done";
  if (solution->models > 1) {
    solution->reason =
        fmt::format("COLMAP split the run into {} models; the largest one, with {} of {} images, is compared",
                    solution->models, solution->model.images.size(), solution->images);
  }
  return true;
}

ColmapSolution ColmapRun::Features() {
  ColmapSolution solution;
  solution.depth = "a";
  solution.images = static_cast<int>(scene_.model.images.size());
  const fs::path dir = work_ / "a", database = dir / "database.db";
  fs::create_directories(dir);
  WriteSceneDatabase(scene_, database, cancel_);
  for (const ModelImage& image : scene_.model.images) solution.name_of[image.name] = image.name;
  const std::string threads = std::to_string(threads_);
  if (options_.solver == "mapper") {
    fs::create_directories(dir / "models");
    if (Step(&solution, "mapper",
             {"mapper", "--database_path", database.string(), "--image_path", dir.string(), "--output_path",
              (dir / "models").string(), "--Mapper.ba_refine_focal_length", "0", "--Mapper.ba_refine_extra_params", "0",
              "--Mapper.extract_colors", "0", "--Mapper.num_threads", threads})) {
      PickModel(&solution, dir / "models");
    }
    return solution;
  }
  // Our cameras with the database's ids, which go up from 1 in the model's order; no points.
  SparseModel start;
  std::map<uint32_t, uint32_t> camera_ids;
  for (const auto& [id, camera] : scene_.model.cameras) {
    camera_ids[id] = static_cast<uint32_t>(start.cameras.size() + 1);
    start.cameras.emplace_back(camera_ids[id], camera);
  }
  for (const ModelImage& image : scene_.model.images) {
    ModelImage copy;
    copy.id = static_cast<uint32_t>(start.images.size() + 1);
    copy.name = image.name;
    copy.camera_id = camera_ids.at(image.camera_id);
    copy.cam_from_world = image.cam_from_world;
    start.images.push_back(std::move(copy));
  }
  WriteColmapModel(start, dir / "start");
  fs::create_directories(dir / "points");
  fs::create_directories(dir / "adjusted");
  if (!Step(&solution, "point_triangulator",
            {"point_triangulator", "--database_path", database.string(), "--image_path", dir.string(), "--input_path",
             (dir / "start").string(), "--output_path", (dir / "points").string(), "--Mapper.extract_colors", "0",
             "--Mapper.num_threads", threads}) ||
      !Step(&solution, "bundle_adjuster",
            {"bundle_adjuster", "--input_path", (dir / "points").string(), "--output_path", (dir / "adjusted").string(),
             "--BundleAdjustment.refine_focal_length", "0", "--BundleAdjustment.refine_principal_point", "0",
             "--BundleAdjustment.refine_extra_params", "0"})) {
    return solution;
  }
  TakeModel(dir / "adjusted", &solution);
  return solution;
}

ColmapSolution ColmapRun::Images() {
  ColmapSolution solution;
  solution.depth = "b";
  const Run& run = project_.run(run_);
  const fs::path dir = work_ / "b", database = dir / "database.db", images = work_ / "images";
  fs::create_directories(dir / "models");
  std::set<std::string> localized;
  for (const ModelImage& image : scene_.model.images) localized.insert(image.name);
  std::vector<std::vector<std::string>> names(run.cameras.size());
  int number = 0;
  for (const ImageEntry& entry : run.images) {
    if (localized.count(entry.file) == 0) continue;
    const std::string name = fmt::format("run/cam{}_{:06d}.jpg", entry.camera, number++);
    PutImage(run, entry, images / name);
    solution.name_of[name] = entry.file;
    names[static_cast<size_t>(entry.camera)].push_back(name);
  }
  solution.images = number;
  for (size_t c = 0; c < names.size(); ++c) {
    if (names[c].empty()) continue;
    if (!ExtractFeatures(&solution, "feature_extractor", database, images, names[c], run.cameras[c].camera))
      return solution;
  }
  const bool exhaustive =
      options_.matcher == "exhaustive" || (options_.matcher == "auto" && number <= options_.exhaustive_below);
  const std::string matcher = exhaustive ? "exhaustive_matcher" : "sequential_matcher";
  if (!Step(&solution, matcher,
            {matcher, "--database_path", database.string(), Option("SiftMatching.use_gpu"), "0",
             Option("SiftMatching.num_threads"), std::to_string(threads_)}) ||
      !Step(&solution, "mapper",
            {"mapper", "--database_path", database.string(), "--image_path", images.string(), "--output_path",
             (dir / "models").string(), "--Mapper.ba_refine_focal_length", "0", "--Mapper.ba_refine_extra_params", "0",
             "--Mapper.extract_colors", "0", "--Mapper.num_threads", std::to_string(threads_)})) {
    return solution;
  }
  PickModel(&solution, dir / "models");
  return solution;
}

// COLMAP's names of images that a panorama is matched with: over the whole run, so that a wrong answer or refusal of
// ours does not decide where it is looked for, and near our answer, where there is one.
std::set<std::string> ColmapRun::Candidates(const ColmapSolution& images,
                                            const std::optional<Eigen::Vector3d>& answer) const {
  std::map<std::string, std::string> colmap_name;  // ours -> COLMAP's
  for (const ModelImage& image : images.model.images) {
    const auto name = images.name_of.find(image.name);
    if (name != images.name_of.end()) colmap_name[name->second] = image.name;
  }
  std::vector<std::string> all;  // that it registered, in the run's order
  std::vector<std::pair<double, std::string>> nearest;
  for (const ModelImage& image : scene_.model.images) {
    const auto name = colmap_name.find(image.name);
    if (name == colmap_name.end()) continue;
    all.push_back(name->second);
    if (answer) nearest.emplace_back((image.cam_from_world.TargetOriginInSource() - *answer).norm(), name->second);
  }
  std::set<std::string> chosen;
  const size_t spread = std::min(all.size(), static_cast<size_t>(options_.spread));
  for (size_t k = 0; k < spread; ++k) chosen.insert(all[(2 * k + 1) * all.size() / (2 * spread)]);
  std::sort(nearest.begin(), nearest.end());
  nearest.resize(std::min(nearest.size(), static_cast<size_t>(options_.candidates)));
  for (const auto& [distance, name] : nearest) chosen.insert(name);
  return chosen;
}

// The views of the panoramas as pictures for COLMAP, and with which images each is matched.
ColmapRun::PanoramaViews ColmapRun::RenderViews(const ColmapSolution& images, const fs::path& pictures,
                                                ColmapSolution* solution) {
  // Our answers, by which candidates are chosen.
  std::map<std::string, Eigen::Vector3d> answers;
  for (const SolutionReference& r : scene_.solution.references) {
    if (r.pose >= 0) answers[r.row] = OdomFromRig(scene_.solution, r.pose).translation;
  }
  PanoramaViews out;
  std::vector<std::string> warnings;
  int number = 0;
  const std::map<std::string, PictureCredit> credits = ReadCredits(project_.dir());
  for (const PreparedReference& p : PrepareReferences(project_.site(), views_, &warnings)) {
    cancel_.ThrowIfCancelled();
    const Reference& reference = project_.site().references[static_cast<size_t>(p.reference)];
    if (reference.kind != ReferenceKind::kPanorama) continue;
    const auto credit = credits.find(reference.name);
    if (credit != credits.end() && !credit->second.keep_until.empty()) {
      solution->reason = "panoramas that must not be copied are left out";
      continue;
    }
    if (!out.cameras.empty() && out.cameras.begin()->second.width() != p.rig.views.front().camera.width()) {
      solution->reason = "panoramas of another size than the first are left out";  // one COLMAP camera per view index
      continue;
    }
    const auto answer = answers.find(reference.name);
    const std::set<std::string> candidates =
        Candidates(images, answer == answers.end() ? std::nullopt : std::optional(answer->second));
    const cv::Mat picture = LoadPanorama(reference.files.front(), true);
    for (size_t v = 0; v < p.rig.views.size(); ++v) {
      const std::string name = fmt::format("view{}/{:04d}.jpg", v, number);
      fs::create_directories((pictures / name).parent_path());
      if (!cv::imwrite((pictures / name).string(), RenderView(picture, p.rig.views[v]),
                       {cv::IMWRITE_JPEG_QUALITY, 98})) {
        throw IoError((pictures / name).string() + ": cannot be written; is the disk full?");
      }
      out.names[v].push_back(name);
      out.cameras.emplace(v, p.rig.views[v].camera);
      out.rig_from_view.emplace(v, p.rig.views[v].rig_from_view);
      out.panorama[name] = {reference.name, v};
      for (const std::string& image : candidates) out.pairs += name + " " + image + "\n";
    }
    ++number;
  }
  return out;
}

bool ColmapRun::RegisterViews(const PanoramaViews& views, const fs::path& dir, const fs::path& pictures,
                              ColmapSolution* solution) {
  const fs::path database = dir / "database.db";
  for (const auto& [v, list] : views.names) {
    if (!ExtractFeatures(solution, "feature_extractor", database, pictures, list, views.cameras.at(v))) return false;
  }
  WriteFileAtomically(dir / "pairs.txt", views.pairs);
  return Step(solution, "matches_importer",
              {"matches_importer", "--database_path", database.string(), "--match_list_path",
               (dir / "pairs.txt").string(), "--match_type", "pairs", Option("SiftMatching.use_gpu"), "0",
               Option("SiftMatching.num_threads"), std::to_string(threads_)}) &&
         Step(solution, "image_registrator",
              {"image_registrator", "--database_path", database.string(), "--input_path", (work_ / "best_b").string(),
               "--output_path", (dir / "registered").string(), "--Mapper.ba_refine_focal_length", "0",
               "--Mapper.ba_refine_extra_params", "0", "--Mapper.extract_colors", "0"}) &&
         Step(solution, "bundle_adjuster",
              {"bundle_adjuster", "--input_path", (dir / "registered").string(), "--output_path",
               (dir / "adjusted").string(), "--BundleAdjustment.refine_focal_length", "0",
               "--BundleAdjustment.refine_principal_point", "0", "--BundleAdjustment.refine_extra_params", "0"});
}

// The model of dir/adjusted once more with the views of a panorama as a rig: one COLMAP camera a view index, found by
// the images' folders. Only views of which COLMAP registered one may be members.
bool ColmapRun::AdjustAsRigs(const PanoramaViews& views, const std::set<size_t>& registered, const fs::path& dir,
                             ColmapSolution* solution) {
  std::map<std::string, uint32_t> camera_of;
  const ColmapDatabase read = ColmapDatabase::OpenRead(dir / "database.db");
  for (const DatabaseImage& image : read.Images()) camera_of[image.name] = image.camera_id;
  nlohmann::json rig;
  const Rigid3d first_from_rig = views.rig_from_view.at(*registered.begin()).Inverse();
  rig["ref_camera_id"] = camera_of.at(views.names.at(*registered.begin()).front());
  for (const size_t v : registered) {
    const Rigid3d view_from_first = (first_from_rig * views.rig_from_view.at(v)).Inverse();
    const Eigen::Quaterniond& q = view_from_first.rotation;
    const Eigen::Vector3d& t = view_from_first.translation;
    rig["cameras"].push_back({{"camera_id", camera_of.at(views.names.at(v).front())},
                              {"image_prefix", fmt::format("view{}/", v)},
                              {"rel_qvec", {q.w(), q.x(), q.y(), q.z()}},
                              {"rel_tvec", {t.x(), t.y(), t.z()}}});
  }
  WriteFileAtomically(dir / "rig.json", nlohmann::json::array({rig}).dump(1) + "\n");
  fs::create_directories(dir / "rigged");
  ColmapSolution rigged = *solution;
  if (Step(
          &rigged, "rig_bundle_adjuster",
          {"rig_bundle_adjuster", "--input_path", (dir / "adjusted").string(), "--output_path",
           (dir / "rigged").string(), "--rig_config_path", (dir / "rig.json").string(), "--estimate_rig_relative_poses",
           "0", "--RigBundleAdjustment.refine_relative_poses", "0", "--BundleAdjustment.refine_focal_length", "0",
           "--BundleAdjustment.refine_principal_point", "0", "--BundleAdjustment.refine_extra_params", "0"}) &&
      HasColmapModel(dir / "rigged")) {
    return true;
  }
  solution->reason = "as pinhole images, not as rigs: " + rigged.reason;
  return false;
}

ColmapSolution ColmapRun::Panoramas(const ColmapSolution& images,
                                    std::map<std::string, std::pair<std::string, size_t>>* panorama) {
  ColmapSolution solution;
  solution.depth = "c";
  const auto end = [&](const char* status, const std::string& reason) {
    solution.status = status;
    solution.reason = reason;
    return solution;
  };
  if (images.status != "done") return end("skipped", "depth b made no model to add panoramas to");
  const fs::path dir = work_ / "c", pictures = work_ / "images";
  fs::create_directories(dir / "registered");
  fs::create_directories(dir / "adjusted");
  fs::copy_file(work_ / "b/database.db", dir / "database.db");
  solution.images = images.images;
  solution.name_of = images.name_of;
  const PanoramaViews views = RenderViews(images, pictures, &solution);
  *panorama = views.panorama;
  if (views.names.empty()) return end("skipped", "the project has no panorama");
  if (!RegisterViews(views, dir, pictures, &solution)) return solution;
  std::set<size_t> registered;  // view indices
  try {
    for (const ModelImage& image : ReadColmapModel(dir / "adjusted").images) {
      const auto view = views.panorama.find(image.name);
      if (view != views.panorama.end()) registered.insert(view->second.second);
    }
  } catch (const InputError& e) {
    return end("failed", e.what());
  }
  if (registered.empty()) return end("failed", "COLMAP registered no view of a panorama");
  const bool rigged = options_.rig && registered.size() > 1 && AdjustAsRigs(views, registered, dir, &solution);
  TakeModel(dir / (rigged ? "rigged" : "adjusted"), &solution);
  return solution;
}

}  // namespace trigpoint

// inspect, mark: single images and points, as the desktop shows them.
#include <fmt/format.h>

#include <cmath>

#include "app/cli/command.h"
#include "app/pipeline/drawn_views.h"
#include "datasets/io/kept_input.h"
#include "datasets/io/text.h"
#include "datasets/project/marking.h"
#include "datasets/project/reference_parts.h"
#include "eval/inspect/run_inspector.h"
#include "eval/truth/marked_point.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

nlohmann::json Pixel(const Eigen::Vector2d& p) { return {p.x(), p.y()}; }

struct InspectArguments {
  std::string dir, run, image, panorama, variant;
  int64_t point = -1;
};

int Inspect(const Session& session, const InspectArguments& a) {
  const Project project = OpenProject(session, a.dir);
  RunInspector inspector(project, a.run, a.variant);
  if (const std::string older = OlderLocalization(project, a.run, a.variant); !older.empty()) {
    session.MakeTerminal().Log(LogLevel::kWarning, older + "; only the values of its tables are shown");
  }
  if (a.point >= 0) {
    const std::vector<std::string> images = inspector.ImagesOf(a.point);
    Ending ending(fmt::format("Point {} of {} is observed in {}", a.point, a.run, Counted(images.size(), "image")));
    for (const std::string& image : images) ending.Row(image);
    session.End(ending);
    session.PrintJson({{"command", "inspect"}, {"ok", true}, {"point", a.point}, {"images", images}});
    return 0;
  }
  const InspectedImage image = inspector.Image(a.image);
  Ending ending(fmt::format("{}/{}: {} x {} px{}", a.run, a.image, image.width, image.height,
                            image.excluded ? ", excluded by the review" : ""));
  nlohmann::json tags = nlohmann::json::array(), points = nlohmann::json::array(), matches = nlohmann::json::array();
  for (const InspectedTag& tag : image.tags) {
    ending.Row(fmt::format("tag {} at {:.2f} {:.2f} px (its first corner), sigma {:.2f} px (1 sigma){}", tag.id,
                           tag.corners[0].x(), tag.corners[0].y(), tag.sigma_px, tag.excluded ? ", excluded" : ""));
    tags.push_back({{"tag_id", tag.id}, {"sigma_px", tag.sigma_px}, {"excluded", tag.excluded}});
    for (const Eigen::Vector2d& corner : tag.corners) tags.back()["corners"].push_back(Pixel(corner));
  }
  for (const InspectedPoint& point : image.points) {
    points.push_back({{"point", point.id},
                      {"seen", Pixel(point.seen)},
                      {"predicted", Pixel(point.predicted)},
                      {"images", point.track_length}});
  }
  if (image.rms_px) {
    ending.Fact("Points", fmt::format("{} of the model, root mean square reprojection error {:.2f} px",
                                      image.points.size(), *image.rms_px));
  }
  int inliers = 0;
  if (!a.panorama.empty()) {
    for (const InspectedMatch& match :
         inspector.Matches(a.image, a.panorama, ReferenceResults(project), ViewOptionsOf(project))) {
      inliers += match.inlier ? 1 : 0;
      matches.push_back({{"image", Pixel(match.image)},
                         {"panorama", Pixel(match.panorama)},
                         {"view", match.view},
                         {"error_px", std::isfinite(match.error_px) ? nlohmann::json(match.error_px) : nullptr},
                         {"inlier", match.inlier}});
    }
    ending.Fact("Matches", fmt::format("{} with {}, {} of them inliers (3 px from their epipolar lines)",
                                       matches.size(), a.panorama, inliers));
  }
  session.End(ending);
  session.PrintJson({{"command", "inspect"},
                     {"ok", true},
                     {"excluded", image.excluded},
                     {"rms_px", image.rms_px ? nlohmann::json(*image.rms_px) : nullptr},
                     {"tags", tags},
                     {"points", points},
                     {"matches", matches}});
  return 0;
}

struct MarkArguments {
  std::string dir, point, image, at, variant;
  bool remove = false;
};

Eigen::Vector2d ParsePixel(const std::string& text) {
  const size_t comma = text.find(',');
  const auto u = ParseDouble(Trim(text.substr(0, comma)));
  const auto v = comma == std::string::npos ? std::nullopt : ParseDouble(Trim(text.substr(comma + 1)));
  if (!u || !v) throw OptionError("--at " + text + ": expected U,V in pixels, such as 412.5,230");
  return {*u, *v};
}

int Mark(const Session& session, const MarkArguments& a) {
  const Project project = OpenProject(session, a.dir);
  fs::path kept;
  if (a.remove) {
    RemovePointMark(project, a.point, a.image, &kept);
  } else if (!a.image.empty()) {
    if (a.at.empty()) throw OptionError("mark: expected --at U,V beside --image");
    SavePointMark(project, a.point, a.image, ParsePixel(a.at), &kept);
  }
  nlohmann::json json = {{"command", "mark"}, {"ok", true}, {"point", a.point}};
  Ending ending("");
  try {
    const PointSolution solution = PredictPoint(project, a.point, a.variant);
    const DisplayUnit unit = DisplayUnitNamed(session.options.units);
    const Eigen::Vector3d sigma = solution.covariance.diagonal().cwiseSqrt() / unit.metres;
    const Eigen::Vector3d at = solution.world_m / unit.metres;
    ending.Headline(fmt::format(
        "{}: {:.3f} {:.3f} {:.3f} {} (site east, north, up; 1 sigma {:.3f} {:.3f} {:.3f}, cameras held), {}, "
        "{:.2f} px",
        a.point, at.x(), at.y(), at.z(), unit.name, sigma.x(), sigma.y(), sigma.z(), Counted(solution.marks, "mark"),
        solution.rms_px));
    std::vector<std::vector<std::string>> rows;
    json["world_m"] = {solution.world_m.x(), solution.world_m.y(), solution.world_m.z()};
    json["rms_px"] = solution.rms_px;
    json["images"] = nlohmann::json::array();
    for (const PredictedMark& p : solution.images) {
      const double spread = std::sqrt(p.covariance_px2.trace() / 2);
      rows.push_back({p.run + "/" + p.file, fmt::format("{:.2f}", p.pixel.x()), fmt::format("{:.2f}", p.pixel.y()),
                      fmt::format("{:.2f}", spread), p.marked ? "marked" : ""});
      json["images"].push_back(
          {{"run", p.run}, {"image", p.file}, {"predicted", Pixel(p.pixel)}, {"sigma_px", spread}});
      if (p.marked) json["images"].back()["marked"] = Pixel(*p.marked);
    }
    ending.Rows(TableText({"image", "u px", "v px", "1 sigma px", ""}, rows));
  } catch (const InputError& e) {
    if (a.image.empty()) throw;
    ending.Headline(std::string(a.remove ? "Removed. " : "Saved. ") + e.what());  // too few marks of the point
    json["predicted"] = nullptr;
  }
  if (!kept.empty()) {
    const fs::path table = project.dir() / "control_observations.csv";
    const bool any = fs::exists(table);  // the last mark takes the file along
    ShowChange(kept, any ? AddedLines(kept, table) : std::vector<std::string>(), &ending);
    json["kept"] = kept.string();
  }
  session.End(ending);
  session.PrintJson(json);
  return 0;
}

}  // namespace

void AddInspectCommand(CLI::App& app, Session& session) {
  CLI::App& command = AddCommand(
      app, session, "inspect", "what a solution contains about one image: tags, points, matches with a panorama",
      "Examples:\n  trigpoint inspect my_site --run run1 --image images/000012.jpg\n"
      "  trigpoint inspect my_site --run run1 --image images/000012.jpg --panorama panoramas/pano_057.jpg --json");
  const auto a = std::make_shared<InspectArguments>();
  command.add_option("DIR", a->dir, "the project")->required();
  command.add_option("--run", a->run, "the image's run")->required();
  auto* image = command.add_option_group("what");
  image->add_option("--image", a->image, "the image, as in images.txt");
  image->add_option("--point", a->point, "a point of the run's sparse model, by its number: which images see it");
  image->require_option(1);
  command.add_option("--panorama", a->panorama, "match it with this panorama or photo");
  command.add_option("--variant", a->variant, "read the results of this variant");
  command.callback([&session, a] { session.action = [a](Session& s) { return Inspect(s, *a); }; });
}

void AddMarkCommand(CLI::App& app, Session& session) {
  CLI::App& command = AddCommand(
      app, session, "mark", "mark a surveyed point in images, and compute where it lies in the others",
      "Marks are kept in control_observations.csv (point, image, u, v); pixels count from the centre of the first.\n"
      "Once a point is marked in two localized images, every other image that must show it is listed, with the\n"
      "predicted pixel to confirm and its uncertainty (1 sigma, for marks with a sigma of 1 px).\n\n"
      "Examples:\n  trigpoint mark my_site P1 --image run1/images/000012.jpg --at 412.5,230\n"
      "  trigpoint mark my_site P1");
  const auto a = std::make_shared<MarkArguments>();
  command.add_option("DIR", a->dir, "the project")->required();
  command.add_option("POINT", a->point, "name of the point")->required();
  command.add_option("--image", a->image, "RUN/FILE, or the path below the project");
  command.add_option("--at", a->at, "U,V in pixels");
  command.add_flag("--remove", a->remove, "remove the mark in --image")->needs("--image");
  command.add_option("--variant", a->variant, "predict with the results of this variant");
  command.callback([&session, a] { session.action = [a](Session& s) { return Mark(s, *a); }; });
}

}  // namespace trigpoint

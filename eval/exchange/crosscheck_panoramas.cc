#include "eval/exchange/crosscheck_panoramas.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "datasets/io/csv.h"
#include "eval/text/number_text.h"

namespace trigpoint {
namespace {

std::string OursOf(const std::string& panorama, const std::vector<PanoramaResult>& answers) {
  for (const PanoramaResult& answer : answers) {
    if (answer.panorama == panorama) return answer.status + (answer.reason.empty() ? "" : ": " + answer.reason);
  }
  return "no answer";
}

std::optional<double> Metres(const PanoramaJudgement& j) {
  return j.difference_m ? std::optional(j.difference_m->norm()) : std::nullopt;
}

}  // namespace

std::vector<CrossPanorama> PanoramasOf(const SparseModel& model,
                                       const std::map<std::string, std::pair<std::string, size_t>>& views,
                                       const std::vector<PanoramaResult>& answers,
                                       const std::set<std::string>& changed) {
  std::map<std::string, CrossPanorama> panoramas;
  for (const auto& [image, view] : views) {
    panoramas[view.first].name = view.first;
    panoramas[view.first].changed = changed.count(view.first) > 0;
  }
  std::map<std::string, Eigen::Vector3d> sums;
  for (const ModelImage& image : model.images) {
    const auto view = views.find(image.name);
    if (view == views.end()) continue;
    const auto seen = std::count_if(image.points.begin(), image.points.end(), [](int64_t p) { return p >= 0; });
    if (seen == 0) continue;
    CrossPanorama& panorama = panoramas[view->second.first];
    ++panorama.views;
    panorama.points += static_cast<int>(seen);
    const auto sum = sums.try_emplace(panorama.name, Eigen::Vector3d::Zero()).first;
    sum->second += static_cast<double>(seen) * image.cam_from_world.TargetOriginInSource();
  }
  for (const auto& [name, sum] : sums) panoramas[name].theirs = sum / panoramas[name].points;
  for (const PanoramaResult& answer : answers) {
    const auto at = panoramas.find(answer.panorama);
    if (at == panoramas.end() || answer.status != "localized" || !answer.odom_from_pano) continue;
    at->second.ours = answer.odom_from_pano->translation;
    if (answer.odom_sigma_m) at->second.covariance = Eigen::Matrix3d(answer.odom_sigma_m->cwiseAbs2().asDiagonal());
  }
  std::vector<CrossPanorama> all;
  for (auto& [name, panorama] : panoramas) all.push_back(std::move(panorama));
  return all;
}

std::set<std::string> ChangedAnswers(const std::vector<PanoramaResult>& table,
                                     const std::vector<PanoramaResult>& computed) {
  constexpr double kRounding_m = 1e-5;  // tables have six decimals
  const auto moved = [](const std::optional<Rigid3d>& a, const std::optional<Rigid3d>& b) {
    if (a.has_value() != b.has_value()) return true;
    return a && !((a->translation - b->translation).norm() < kRounding_m);
  };
  std::set<std::string> changed;
  for (const PanoramaResult& now : table) {
    for (const PanoramaResult& was : computed) {
      if (was.panorama != now.panorama) continue;
      const bool same = was.status == now.status && !moved(now.odom_from_pano, was.odom_from_pano) &&
                        !moved(now.world_from_pano, was.world_from_pano);
      if (!same) changed.insert(now.panorama);
    }
  }
  return changed;
}

void WritePanoramaVerdicts(const std::vector<PanoramaJudgement>& judged, const std::vector<PanoramaResult>& answers,
                           const std::filesystem::path& file) {
  CsvWriter csv(
      {"panorama", "verdict", "ours", "views", "points", "x", "y", "z", "dx_m", "dy_m", "dz_m", "length_m",
       "chi2_3dof"},
      {"trigpoint crosscheck_panoramas 1; frame=odom; x, y, z: COLMAP's centre after the sim3 alignment of the "
       "cameras; d: COLMAP's minus ours; views, points: of it, that COLMAP registered and saw"});
  const auto three = [&](const std::optional<Eigen::Vector3d>& v) {
    for (int k = 0; k < 3; ++k) v ? csv.Number((*v)[k], 6) : csv.Empty();
  };
  for (const PanoramaJudgement& j : judged) {
    csv.Text(j.name).Text(CrossVerdictName(j.verdict)).Text(OursOf(j.name, answers)).Integer(j.views).Integer(j.points);
    three(j.theirs);
    three(j.difference_m);
    const auto length = Metres(j);
    length ? csv.Number(*length, 6) : csv.Empty();
    j.chi2 ? csv.Number(*j.chi2, 3) : csv.Empty();
    csv.EndRow();
  }
  csv.Save(file);
}

std::string FormatPanoramaVerdicts(const std::vector<PanoramaJudgement>& judged,
                                   const std::vector<PanoramaResult>& answers) {
  if (judged.empty()) return "";
  std::string text =
      "\nCOLMAP looked for every panorama over the whole run, whether Trigpoint localized it or not. *contradicts*: "
      "the two answers differ by more than both errors explain (99.9 % of chi-square, 3 degrees of freedom); *found "
      "by them alone*: COLMAP alone found it, perhaps Trigpoint refused it wrongly.\n\n"
      "| panorama | verdict | ours | their views | their points | apart m | chi2 |\n|---|---|---|---|---|---|---|\n";
  for (const PanoramaJudgement& j : judged) {
    const auto length = Metres(j);
    text += fmt::format("| {} | {} | {} | {} | {} | {} | {} |\n", j.name, CrossVerdictName(j.verdict),
                        OursOf(j.name, answers), j.views, j.points, NumberText(length, 3), NumberText(j.chi2, 1));
  }
  return text;
}

nlohmann::json PanoramaVerdictsJson(const std::vector<PanoramaJudgement>& judged,
                                    const std::vector<PanoramaResult>& answers) {
  nlohmann::json rows = nlohmann::json::array();
  for (const PanoramaJudgement& j : judged) {
    rows.push_back({{"panorama", j.name},
                    {"verdict", CrossVerdictName(j.verdict)},
                    {"ours", OursOf(j.name, answers)},
                    {"views", j.views},
                    {"points", j.points}});
    if (const auto length = Metres(j)) rows.back()["length_m"] = *length;
    if (j.chi2) rows.back()["chi2_3dof"] = *j.chi2;
  }
  return rows;
}

std::vector<std::string> PanoramaWarnings(const std::vector<PanoramaJudgement>& judged,
                                          const std::vector<PanoramaResult>& answers) {
  std::vector<std::string> warnings;
  for (const PanoramaJudgement& j : judged) {
    const std::string found = fmt::format("COLMAP registered {} of its views with {} points", j.views, j.points);
    if (j.verdict == CrossVerdict::kContradicts) {
      warnings.push_back(
          fmt::format("panorama {}: COLMAP's answer is {:.3f} m from Trigpoint's, beyond both errors (chi-square "
                      "{:.0f}, 16.3 is 99.9 %): one of the two is wrong; {}",
                      j.name, j.difference_m->norm(), *j.chi2, found));
    } else if (j.verdict == CrossVerdict::kChanged) {
      warnings.push_back("panorama " + j.name +
                         ": its answer in panoramas.csv is not the one that was computed (solution.db): the table was "
                         "changed since; compute it again by `trigpoint run`");
    } else if (j.verdict == CrossVerdict::kOnlyTheirs) {
      warnings.push_back(
          fmt::format("panorama {}: COLMAP found it at {:.2f}, {:.2f}, {:.2f} m (odom), Trigpoint did not localize it "
                      "({}), perhaps wrongly; {}",
                      j.name, j.theirs->x(), j.theirs->y(), j.theirs->z(), OursOf(j.name, answers), found));
    }
  }
  return warnings;
}

}  // namespace trigpoint

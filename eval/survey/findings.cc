#include "eval/survey/findings.h"

#include <cmath>
#include <utility>

#include "datasets/io/text.h"
#include "eval/errors/results.h"

namespace trigpoint {

std::string StatusOf(const PointAgreement& p) {
  if (p.used) return "used";
  if (p.excluded) return "taken out";
  if (p.role == PointRole::kCheck) return p.checked ? "check" : "moved";
  return "not used";
}

ReportedAccuracy ReportedOf(const CheckSummary& check) {
  const double h = std::hypot(check.rmse_h_m, check.stated_h_m), v = std::hypot(check.rmse_v_m, check.stated_v_m);
  return {h, v, std::hypot(h, v)};
}

SurveyEpochs EpochsAgainst(const std::filesystem::path& file, const SurveyResult& result) {
  // "# trigpoint tags 1; frame=enu; datum=control; sigma=1"
  const std::string text = ReadTextFile(file);
  const std::string header = text.substr(0, text.find('\n'));
  std::vector<TagEstimate> before;
  for (const TagResult& tag : ReadTagResults(file, file.parent_path() / "tags_cov.csv")) {
    TagEstimate t;
    t.tag_id = tag.tag_id;
    t.world_from_tag = tag.map_from_tag;
    t.covariance.diagonal().tail<3>() = tag.sigma_m.value_or(Eigen::Vector3d::Zero()).cwiseAbs2();
    if (tag.covariance) t.covariance = *tag.covariance;
    before.push_back(std::move(t));
  }
  return TestEpochs(before, result.tags,
                    result.in_world && header.find("datum=" + result.datum + ";") != std::string::npos);
}

}  // namespace trigpoint

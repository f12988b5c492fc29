#include "app/pipeline/plan_stage.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "app/pipeline/plan_report.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

constexpr size_t kMostPlaces = 16;  // for tags, tried at a time
constexpr double kAside_m = 4;      // of such a place from the path
constexpr double kApart_m = 2;      // from the tags that are there
constexpr int kFirstNewId = 1000000;

// Sketched places, else places beside the paths, facing them, evenly spread.
std::map<std::string, Rigid3d> Places(const PlanLayout& layout) {
  if (!layout.candidates.empty()) return layout.candidates;
  std::vector<double> heights;
  for (const auto& [id, pose] : layout.network.world_from_tag) heights.push_back(pose.translation.z());
  std::sort(heights.begin(), heights.end());
  const double height = heights[heights.size() / 2];
  std::map<std::string, Rigid3d> places;
  for (const PlannedPass& pass : layout.network.passes) {
    const size_t n = pass.world_from_body.size();
    const size_t step = std::max<size_t>(1, n * layout.network.passes.size() * 2 / kMostPlaces);
    for (size_t k = step / 2; k < n; k += step) {
      const Rigid3d& body = pass.world_from_body[k].target_from_body;
      for (const double side : {1.0, -1.0}) {
        Eigen::Vector3d out = body.rotation * Eigen::Vector3d(0, side, 0);
        out.z() = 0;
        // Ahead of the body, where its cameras look at it from several places.
        Eigen::Vector3d at =
            body.translation + kAside_m * (out.normalized() + body.rotation * Eigen::Vector3d::UnitX());
        at.z() = height;
        const bool near = std::any_of(layout.network.world_from_tag.begin(), layout.network.world_from_tag.end(),
                                      [&](const auto& t) { return (t.second.translation - at).norm() < kApart_m; });
        if (near || places.size() >= kMostPlaces) continue;
        const Eigen::Vector3d face = body.translation - at;
        places[fmt::format("{:.1f}, {:.1f}, {:.1f}", at.x(), at.y(), at.z())] =
            UprightTag(at, std::atan2(face.x(), face.y()));
      }
    }
  }
  return places;
}

// A pass once more, on another day; `back`: the other way round.
PlannedPass Again(const PlannedPass& pass, bool back) {
  PlannedPass again = pass;
  again.name += back ? " (back)" : " (again)";
  again.date += again.name;
  if (!back) return again;
  const int64_t begin = pass.world_from_body.front().stamp_ns, end = pass.world_from_body.back().stamp_ns;
  std::reverse(again.world_from_body.begin(), again.world_from_body.end());
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()));
  for (TimedPose& pose : again.world_from_body) {
    pose.stamp_ns = begin + end - pose.stamp_ns;
    pose.target_from_body.rotation = pose.target_from_body.rotation * turn;
  }
  return again;
}

class Planner {
 public:
  Planner(const PlanOptions& options, PlanFindings* findings, StageContext& context)
      : options_(options), findings_(*findings), context_(context), layout_(findings->layout.network) {}

  void Run() {
    context_.progress.Begin("prediction", 0);
    findings_.prediction = Predict(layout_);
    for (const std::string& warning : findings_.prediction.warnings) {
      context_.progress.Log(LogLevel::kWarning, warning);
    }
    CountImagesNeeded();
    findings_.panoramas =
        PredictPanoramas(layout_, findings_.layout.noise, context_.seed, context_.threads, context_.cancel);
    findings_.gains = OneMoreControl();
    for (const PlanGain& gain : OneMore(PassChoices(), "passes")) findings_.gains.push_back(gain);
    for (const PlanGain& gain : OneMore(TagChoices(), "places for tags")) findings_.gains.push_back(gain);
    std::stable_sort(findings_.gains.begin(), findings_.gains.end(),
                     [](const PlanGain& a, const PlanGain& b) { return a.rms_after_m < b.rms_after_m; });
    Suggest();
    Gates();
  }

 private:
  // A layout with one thing more.
  struct Choice {
    PlanGain gain;
    NetworkLayout layout;
  };

  NetworkPrediction Predict(const NetworkLayout& layout) const {
    return PredictNetwork(layout, findings_.layout.noise, context_.seed, context_.threads, context_.cancel);
  }

  // How many of a tag's pictures, thinned evenly, leave its sigma at what the gate allows, or without one within 10 %
  // of what all of them give. Half as many are as many with twice the variance, so that the variance is that of a
  // second prediction less the first's over the number, and a part that pictures do not change.
  void CountImagesNeeded() {
    constexpr double kWithin = 1.1;
    NetworkOptions half = findings_.layout.noise;
    for (double* sigma : {&half.corner_sigma_px, &half.extra_sigma_px, &half.tie_sigma_px}) *sigma *= std::sqrt(2.0);
    const NetworkPrediction fewer = PredictNetwork(layout_, half, context_.seed, context_.threads, context_.cancel);
    for (size_t i = 0; i < findings_.prediction.tags.size(); ++i) {
      const TagPrediction& tag = findings_.prediction.tags[i];
      if (!tag.tied || !fewer.tags[i].tied) continue;
      const double variance = std::pow(TagSigma(tag), 2);
      const double by_pictures = std::pow(TagSigma(fewer.tags[i]), 2) - variance;
      const double wanted = options_.max_tag_sigma_m > 0 ? options_.max_tag_sigma_m : kWithin * TagSigma(tag);
      const double left = wanted * wanted - (variance - by_pictures);
      if (!(left > 0)) continue;
      findings_.images_needed[tag.tag_id] = std::max(1, static_cast<int>(std::ceil(tag.images * by_pictures / left)));
    }
  }

  std::vector<PlanGain> OneMoreControl() const {
    std::vector<PlanGain> gains;
    for (const TagPrediction& tag : findings_.prediction.tags) {
      if (!tag.tied || tag.role == "control") continue;
      NetworkPrediction only = findings_.prediction;
      for (TagPrediction& t : only.tags) t.role = t.tag_id == tag.tag_id ? "free" : "control";
      const ControlSuggestion s = SuggestControl(only, 1, options_.control_sigma_h_m, options_.control_sigma_v_m);
      PlanGain gain;
      gain.what = fmt::format("control on tag {}", tag.tag_id);
      gain.rms_after_m = s.rms_after_m;
      gain.world_m = tag.world_m;
      gains.push_back(gain);
    }
    return gains;
  }

  std::vector<Choice> PassChoices() const {
    std::vector<Choice> choices;
    for (const PlannedPass& pass : findings_.layout.network.passes) {
      for (const bool back : {false, true}) {
        Choice choice;
        choice.gain.what = fmt::format("pass {} once more{}", pass.name, back ? ", the other way round" : "");
        choice.layout = layout_;
        choice.layout.passes.push_back(Again(pass, back));
        choices.push_back(std::move(choice));
      }
    }
    return choices;
  }

  std::vector<Choice> TagChoices() const {
    std::vector<Choice> choices;
    for (const auto& [name, pose] : Places(findings_.layout)) {
      const Eigen::Vector3d face = -(pose.rotation * Eigen::Vector3d::UnitZ());
      Choice choice;
      choice.gain.what = "a tag at " + name;
      choice.gain.world_m = pose.translation;
      choice.gain.heading_rad = std::atan2(face.x(), face.y());
      choice.layout = layout_;
      const int id = kFirstNewId + static_cast<int>(layout_.world_from_tag.size());
      choice.layout.world_from_tag[id] = pose;
      choice.layout.sizes.sizes_m[id] = findings_.layout.candidate_size_m;
      choices.push_back(std::move(choice));
    }
    return choices;
  }

  std::vector<PlanGain> OneMore(std::vector<Choice> choices, const std::string& what) const {
    context_.progress.Begin("one more of " + what, static_cast<int64_t>(choices.size()));
    std::vector<PlanGain> gains;
    for (Choice& choice : choices) {
      choice.gain.rms_after_m = Predict(choice.layout).RmsSigmaOf(findings_.prediction);
      gains.push_back(choice.gain);
      context_.progress.Advance(1);
    }
    return gains;
  }

  void Suggest() {
    if (options_.suggest.empty()) return;
    if (options_.suggest == "control") {
      SuggestKnownPoints();
      return;
    }
    // One after the other: each is the best beside those before it.
    for (int step = 0; step < options_.count; ++step) {
      std::vector<Choice> choices = options_.suggest == "tags" ? TagChoices() : PassChoices();
      double best = std::numeric_limits<double>::infinity();
      Choice* chosen = nullptr;
      for (Choice& choice : choices) {
        const bool taken = std::any_of(findings_.suggestions.begin(), findings_.suggestions.end(),
                                       [&](const PlanGain& g) { return g.what == choice.gain.what; });
        if (taken && options_.suggest == "tags") continue;
        choice.gain.rms_after_m = Predict(choice.layout).RmsSigmaOf(findings_.prediction);
        if (choice.gain.rms_after_m < best) best = choice.gain.rms_after_m, chosen = &choice;
      }
      if (chosen == nullptr) break;
      findings_.suggestions.push_back(chosen->gain);
      layout_ = chosen->layout;
    }
    // All choices at once: what no selection of them can be below.
    NetworkLayout all = findings_.layout.network;
    layout_ = all;
    int id = kFirstNewId;
    for (const Choice& choice : options_.suggest == "tags" ? TagChoices() : PassChoices()) {
      if (options_.suggest == "path") {
        for (int k = 0; k < options_.count; ++k) all.passes.push_back(choice.layout.passes.back());
        continue;
      }
      all.world_from_tag[id] = choice.layout.world_from_tag.rbegin()->second;
      all.sizes.sizes_m[id++] = findings_.layout.candidate_size_m;
    }
    findings_.suggestion_note = fmt::format(
        "chosen one after the other among the {} tried; no choice of {} among them gives less than {:.1f} mm",
        options_.suggest == "tags" ? "places" : "passes", options_.count,
        1e3 * Predict(all).RmsSigmaOf(findings_.prediction));
  }

  void SuggestKnownPoints() {
    const ControlSuggestion s =
        SuggestControl(findings_.prediction, options_.count, options_.control_sigma_h_m, options_.control_sigma_v_m);
    for (size_t k = 0; k < s.tag_ids.size(); ++k) {
      const Rigid3d& tag = layout_.world_from_tag.at(s.tag_ids[k]);
      PlanGain gain;
      gain.what = fmt::format("control on tag {}", s.tag_ids[k]);
      gain.rms_after_m = s.rms_steps_m[k];
      gain.world_m = tag.translation;
      findings_.suggestions.push_back(gain);
    }
    findings_.suggestion_note =
        s.exact ? "all choices were tried: none is better"
                : fmt::format("chosen one after the other; no choice of {} gives less than {:.1f} mm", options_.count,
                              1e3 * s.bound_m);
  }

  void Gates() {
    const NetworkPrediction& p = findings_.prediction;
    const auto add = [&](const std::string& gate, double value, bool passed) {
      findings_.gates.push_back({gate, value, passed});
    };
    if (options_.max_tag_sigma_m > 0) {
      double worst = 0;
      for (const TagPrediction& tag : p.tags) {
        worst = std::max(worst, tag.tied ? TagSigma(tag) : std::numeric_limits<double>::infinity());
      }
      add(fmt::format("3D sigma of the weakest tag at most {:g} m", options_.max_tag_sigma_m), worst,
          worst <= options_.max_tag_sigma_m);
    }
    if (options_.max_camera_sigma_m > 0) {
      std::vector<double> sigmas;
      for (const BodyPrediction& body : p.bodies) sigmas.push_back(BodySigma(body));
      const double p95 = Percentile(sigmas, 0.95);
      add(fmt::format("95th percentile of the cameras' 3D sigma at most {:g} m", options_.max_camera_sigma_m), p95,
          p95 <= options_.max_camera_sigma_m);
    }
    if (options_.min_redundancy > 0) {
      double least = p.in_world ? 1 : 0;
      for (const PointPrediction& point : p.points) {
        if (point.used) least = std::min({least, point.horizontal.redundancy, point.vertical.redundancy});
      }
      add(fmt::format("redundancy of the least controlled known point at least {:g}", options_.min_redundancy), least,
          least >= options_.min_redundancy);
    }
  }

  const PlanOptions& options_;
  PlanFindings& findings_;
  StageContext& context_;
  NetworkLayout layout_;  // with what was chosen so far
};

void MakePlan(const PlanOptions& options, StageContext& context) {
  PlanFindings findings;
  findings.layout = MakePlanLayout(context.project, options, context);
  for (const std::string& note : findings.layout.notes) context.progress.Log(LogLevel::kWarning, note);
  Planner(options, &findings, context).Run();
  WritePlan(findings, context.out);
  const nlohmann::json summary = nlohmann::json::parse(ReadTextFile(context.out / "summary.json"));
  for (const char* key : {"source", "tags", "rms_tag_sigma_m", "weakest_tag", "datum"}) {
    context.metrics[key] = summary.at(key);
  }
  if (findings.gates.empty()) return;
  const bool passed =
      std::all_of(findings.gates.begin(), findings.gates.end(), [](const PlanGate& g) { return g.passed; });
  context.metrics["gates"] = passed ? "PASS" : "FAIL";
}

}  // namespace

StageInfo PlanStage() {
  StageInfo info;
  info.name = "plan";
  info.help = "predict the accuracy of a survey before the trip, and what would improve it";
  info.per_run = false;
  info.metric = "rms_tag_sigma_m";
  UseOptions<PlanOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const auto options = ResolveOptions<PlanOptions>(project, "plan", target);
    StageRequest request;
    request.version = 3;
    request.options = JsonFromOptions(options);
    request.inputs = PlanInputs(project, options);
    if (project.has_frame()) {
      const Geodetic& origin = project.frame().origin();
      request.values["origin"] = {origin.latitude_deg, origin.longitude_deg, origin.height_m};
    }
    request.body = [options](StageContext& context) { MakePlan(options, context); };
    return request;
  };
  info.summary = [](const StageOutcome& outcome, const DisplayUnit& unit) {
    return PlanSummary(nlohmann::json::parse(ReadTextFile(outcome.dir / "summary.json")), unit);
  };
  return info;
}

}  // namespace trigpoint

#include "eval/plan/findings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "eval/plan/choices.h"
#include "eval/scene/scene_model.h"

namespace trigpoint {
namespace {

constexpr int kFirstNewId = 1000000;

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
    for (const TagPrediction& tag : findings_.prediction.tags) {
      if (!tag.tied) findings_.unseen[tag.tag_id] = WhyLost(tag.tag_id);
    }
    CountImagesNeeded();
    findings_.panoramas =
        PredictPanoramas(layout_, findings_.layout.noise, context_.seed, context_.threads, context_.cancel);
    findings_.gains = OneMoreControl();
    for (const PlanGain& gain : OneMore(MorePasses(1), "passes")) findings_.gains.push_back(gain);
    for (const PlanGain& gain : OneMore(MoreTags(), "places for tags")) findings_.gains.push_back(gain);
    std::stable_sort(findings_.gains.begin(), findings_.gains.end(), [](const PlanGain& a, const PlanGain& b) {
      return a.in_world != b.in_world ? a.in_world : a.rms_after_m < b.rms_after_m;
    });
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

  std::string WhyLost(int tag_id) const {
    const auto pass = findings_.prediction.apart.find(tag_id);
    if (pass != findings_.prediction.apart.end()) {
      return fmt::format("only pass {} sees it, which shares no tag with the others", pass->second);
    }
    const std::string why = WhyUnseen(layout_, findings_.layout.noise, tag_id);
    return "no planned picture sees it" + (why.empty() ? "" : ": " + why);
  }

  // Without a datum one point gains nothing: the smallest set that gives one is named.
  std::vector<PlanGain> OneMoreControl() const {
    std::vector<PlanGain> gains;
    const ControlSuggestion s = Control(1);
    if (!findings_.prediction.in_world) {
      if (s.tag_ids.empty()) return gains;
      PlanGain gain;
      gain.kind = "control";
      gain.what = s.tag_ids.size() == 1 ? "control on tag " + Names(s.tag_ids) + ", which gives a datum with the others"
                                        : "control on tags " + Names(s.tag_ids) + ", which together give a datum";
      gain.rms_after_m = s.rms_after_m;
      return {gain};
    }
    for (const auto& [tag_id, rms_m] : s.each) {
      PlanGain gain;
      gain.kind = "control";
      gain.what = fmt::format("control on tag {}", tag_id);
      gain.rms_after_m = rms_m;
      gain.world_m = layout_.world_from_tag.at(tag_id).translation;
      gains.push_back(gain);
    }
    return gains;
  }

  static std::string Names(const std::vector<int>& tag_ids) { return fmt::format("{}", fmt::join(tag_ids, ", ")); }

  ControlSuggestion Control(int count) const {
    NetworkLayout without = findings_.layout.network;
    without.points.clear();
    return SuggestControl(findings_.prediction.in_world ? Predict(without) : findings_.prediction, layout_.points,
                          count, options_.control_sigma_h_m, options_.control_sigma_v_m);
  }

  std::vector<Choice> MorePasses(int copy) const {
    std::vector<Choice> choices;
    for (const PassChoice& more : PassChoices(findings_.layout, copy)) {
      Choice choice;
      choice.gain.kind = "path";
      choice.gain.what = more.what;
      for (const TimedPose& pose : more.pass.world_from_body) {
        choice.gain.way_m.push_back(pose.target_from_body.translation);
      }
      choice.layout = layout_;
      choice.layout.passes.push_back(more.pass);
      choices.push_back(std::move(choice));
    }
    return choices;
  }

  std::vector<Choice> MoreTags() const {
    std::vector<Choice> choices;
    int id = kFirstNewId;  // of a place: what is drawn for it does not depend on what else was chosen
    for (const auto& [name, pose] : TagPlaces(findings_.layout)) {
      const Eigen::Vector3d face = -(pose.rotation * Eigen::Vector3d::UnitZ());
      Choice choice;
      choice.gain.kind = "tags";
      choice.gain.what = "a tag at " + name;
      choice.gain.world_m = pose.translation;
      choice.gain.heading_rad = std::atan2(face.x(), face.y());
      choice.layout = layout_;
      choice.layout.world_from_tag[id] = pose;
      choice.layout.sizes.sizes_m[id++] = findings_.layout.candidate_size_m;
      choices.push_back(std::move(choice));
    }
    return choices;
  }

  std::vector<PlanGain> OneMore(std::vector<Choice> choices, const std::string& what) const {
    context_.progress.Begin("one more of " + what, static_cast<int64_t>(choices.size()));
    std::vector<PlanGain> gains;
    for (Choice& choice : choices) {
      Evaluate(&choice);
      gains.push_back(choice.gain);
      context_.progress.Advance(1);
    }
    return gains;
  }

  // RMS of the plan as it is; infinite without a datum, which a choice may bring.
  double RmsBefore() const { return PlanGain{}.Before(findings_.prediction); }

  void Evaluate(Choice* choice) const {
    const NetworkPrediction after = Predict(choice->layout);
    choice->gain.rms_after_m = after.RmsSigmaOf(findings_.prediction);
    choice->gain.in_world = after.in_world;
  }

  void Suggest() {
    if (options_.suggest.empty()) return;
    if (options_.suggest == "control") {
      SuggestKnownPoints();
      return;
    }
    // One after the other: each is the best beside those before it.
    for (int step = 0; step < options_.count; ++step) {
      std::vector<Choice> choices = options_.suggest == "tags" ? MoreTags() : MorePasses(step + 1);
      const double now = findings_.suggestions.empty() ? RmsBefore() : findings_.suggestions.back().rms_after_m;
      double best = kSameRms * now;  // what improves nothing is not proposed
      Choice* chosen = nullptr;
      for (Choice& choice : choices) {
        const bool taken = std::any_of(findings_.suggestions.begin(), findings_.suggestions.end(),
                                       [&](const PlanGain& g) { return g.what == choice.gain.what; });
        if (taken && options_.suggest == "tags") continue;
        Evaluate(&choice);
        if (choice.gain.rms_after_m < best) best = choice.gain.rms_after_m, chosen = &choice;
      }
      if (chosen == nullptr) break;
      findings_.suggestions.push_back(chosen->gain);
      layout_ = chosen->layout;
    }
    SayHowGood();
  }

  // Compared with all choices together, which bound every selection of them from below.
  void SayHowGood() {
    NetworkLayout all = findings_.layout.network;
    layout_ = all;
    if (options_.suggest == "tags") {
      for (const Choice& choice : MoreTags()) {
        all.world_from_tag.insert(choice.layout.world_from_tag.begin(), choice.layout.world_from_tag.end());
        all.sizes.sizes_m.insert(choice.layout.sizes.sizes_m.begin(), choice.layout.sizes.sizes_m.end());
      }
    }
    for (int copy = 1; options_.suggest == "path" && copy <= options_.count; ++copy) {
      for (const Choice& choice : MorePasses(copy)) all.passes.push_back(choice.layout.passes.back());
    }
    const std::string kind = options_.suggest == "tags" ? "places" : "passes";
    const double bound = Predict(all).RmsSigmaOf(findings_.prediction);
    findings_.suggestion_note = fmt::format("chosen one after the other among the {} tried", kind);
    if (std::isfinite(bound)) {
      findings_.suggestion_note +=
          fmt::format("; no choice of {} among them gives less than {:.1f} mm", options_.count, 1e3 * bound);
    }
    if (!findings_.prediction.in_world) findings_.suggestion_note += "; relative to the first camera: no datum";
    SayHowFew(findings_.suggestions.size(), "no other place or pass among those tried is left that helps");
  }

  void SayHowFew(size_t proposed, const std::string& why) {
    if (proposed >= static_cast<size_t>(options_.count)) return;
    findings_.suggestion_note += fmt::format("; {} asked for, {} proposed: {}", options_.count, proposed, why);
  }

  void SuggestKnownPoints() {
    const ControlSuggestion s = Control(options_.count);
    if (!s.reachable) {
      findings_.suggestion_note =
          "no set of the tags that are seen, and are neither control nor check points, gives a datum: it takes three "
          "that are not on one line; plan more tags, or paths that see more of them";
      return;
    }
    if (static_cast<size_t>(options_.count) < s.needed) {
      findings_.suggestion_note =
          fmt::format("a datum needs at least {} more control points, {} asked for; the best choice: tags {}", s.needed,
                      options_.count, Names(s.tag_ids));
      return;
    }
    for (size_t k = 0; k < s.tag_ids.size(); ++k) {
      PlanGain gain;
      gain.kind = "control";
      gain.what = fmt::format("control on tag {}", s.tag_ids[k]);
      gain.rms_after_m = s.rms_steps_m[k];
      gain.world_m = layout_.world_from_tag.at(s.tag_ids[k]).translation;
      findings_.suggestions.push_back(gain);
    }
    findings_.suggestion_note =
        s.exact ? "all choices were tried: none is better"
                : fmt::format("chosen one after the other; no choice of {} gives less than {:.1f} mm", options_.count,
                              1e3 * s.bound_m);
    SayHowFew(s.tag_ids.size(), "the other tags are control or check points already, or are not seen");
  }

  void Gates() {
    const NetworkPrediction& p = findings_.prediction;
    const auto add = [&](const std::string& gate, double value, bool passed) {
      findings_.gates.push_back({gate, value, p.in_world && passed, !p.in_world});
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
      // Cameras of a pass that is left out have no accuracy in this frame.
      const double p95 = p.left_out.empty() ? Percentile(sigmas, 0.95) : std::numeric_limits<double>::infinity();
      add(fmt::format("95th percentile of the cameras' 3D sigma at most {:g} m", options_.max_camera_sigma_m), p95,
          p95 <= options_.max_camera_sigma_m);
    }
    if (options_.min_redundancy > 0) {
      double least = 1;
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

// Under a map in the site's frame. A sketch is drawn in it; what was surveyed without a datum is not.
std::shared_ptr<const SceneAerial> AerialUnder(const PlanFindings& findings, StageContext& context) {
  constexpr int kMost_px = 2048;
  const Project& project = context.project;
  if (project.site().aerial.empty() || !project.has_frame()) return nullptr;
  if (findings.layout.learned && !findings.prediction.in_world) return nullptr;
  try {
    return std::make_shared<const SceneAerial>(ReadAerial(project.site().aerial, project.frame(), 0, kMost_px));
  } catch (const InputError& e) {
    context.progress.Log(LogLevel::kWarning, std::string("no aerial image under the map: ") + e.what());
    return nullptr;
  }
}

}  // namespace

double PlanGain::Before(const NetworkPrediction& plan) const {
  return in_world == plan.in_world ? plan.RmsSigma() : std::numeric_limits<double>::infinity();
}

bool PlanGain::Helps(const NetworkPrediction& plan) const { return rms_after_m < kSameRms * Before(plan); }

double TagSigma(const TagPrediction& tag) { return tag.Sigma().norm(); }
double BodySigma(const BodyPrediction& body) {
  return std::sqrt(std::max(0.0, body.covariance.diagonal().tail<3>().sum()));
}

double Percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<size_t>(share * static_cast<double>(values.size() - 1) + 0.5)];
}

PlanFindings FindPlan(const PlanOptions& options, PlanLayout layout, StageContext& context) {
  PlanFindings findings;
  findings.layout = std::move(layout);
  for (const std::string& note : findings.layout.notes) context.progress.Log(LogLevel::kWarning, note);
  Planner(options, &findings, context).Run();
  findings.aerial = AerialUnder(findings, context);
  return findings;
}

}  // namespace trigpoint

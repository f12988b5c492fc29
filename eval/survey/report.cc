#include "eval/survey/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "calib/base/counted.h"

namespace trigpoint {
namespace {

class Report {
 public:
  explicit Report(const DisplayUnit& unit) : unit_(unit) {}
  std::string Length(double metres) const { return fmt::format("{:.3f}", metres / unit_.metres); }
  std::string With(double metres) const { return Length(metres) + " " + unit_.name; }
  void Line(const std::string& line) { text_ += line + "\n"; }
  const std::string& name() const { return unit_.name; }
  const std::string& text() const { return text_; }

 private:
  const DisplayUnit& unit_;
  std::string text_;
};

void TagTable(const SurveyResult& result, Report& out) {
  out.Line(fmt::format("| tag | role | images | runs | sigma x, y, z ({}, 1 sigma) | rms px | status |", out.name()));
  out.Line("|---|---|---|---|---|---|---|");
  for (const TagEstimate& t : result.tags) {
    std::string sigma;
    for (int i = 3; t.HasPose() && i < 6; ++i) {
      if (i > 3) sigma += ", ";
      sigma += out.Length(std::sqrt(std::max(0.0, t.covariance(i, i))));
    }
    out.Line(fmt::format("| {} | {} | {} | {} | {} | {:.2f} | {} |", t.tag_id, t.role, t.images, t.runs, sigma,
                         t.rms_px, t.status));
  }
}

void Points(const SurveyResult& result, Report& out) {
  bool left_out = false, check = false;
  for (const PointAgreement& p : result.points) {
    check |= p.role == PointRole::kCheck;
    left_out |= p.left_out_m.has_value();
  }
  if (check) {
    out.Line(fmt::format(
        "\n| check point | map - stated: de, dn, du ({0}) | sigma h, v ({0}, 1 sigma) | standardised |", out.name()));
    out.Line("|---|---|---|---|");
    for (const PointAgreement& p : result.points) {
      if (p.role != PointRole::kCheck) continue;
      out.Line(fmt::format("| {} | {}, {}, {} | {}, {} | {:.1f} |", p.name, out.Length(p.error_m.x()),
                           out.Length(p.error_m.y()), out.Length(p.error_m.z()), out.Length(p.sigma_h_m),
                           out.Length(p.sigma_v_m), std::sqrt(p.chi2)));
    }
  }
  if (left_out) {
    out.Line(
        fmt::format("\n| control point | map made without it, minus stated: de, dn, du ({0}) | sigma ({0}, 1 sigma) "
                    "| standardised residual |",
                    out.name()));
    out.Line("|---|---|---|---|");
    for (const PointAgreement& p : result.points) {
      if (!p.left_out_m) continue;
      // A direction that this point alone determines has no value without it.
      std::string off, sigma;
      for (int k = 0; k < 3; ++k) {
        const bool known = p.LeftOutKnown(k);
        const char* const comma = k > 0 ? ", " : "";
        off += fmt::format("{}{}", comma, known ? out.Length((*p.left_out_m)[k]) : "-");
        sigma += fmt::format("{}{}", comma, known ? out.Length(p.left_out_sigma_m[k]) : "-");
      }
      out.Line(fmt::format("| {} | {} | {} | {:.1f} |", p.name, off, sigma, std::sqrt(std::max(0.0, p.chi2))));
    }
  }
}

void Accuracies(const SurveyResult& result, const SurveyFindings& findings, Report& out) {
  const CheckSummary& check = result.check;
  if (check.n > 0) {
    const ReportedAccuracy a = ReportedOf(check);
    out.Line(
        fmt::format("\nAccuracy at check points (they took no part; their own sigma in quadrature): RMSE_H {}, "
                    "RMSE_V {}, RMSE_3D {}, n = {}",
                    out.With(a.h), out.With(a.v), out.With(a.d), check.n));
    out.Line(fmt::format("  differences alone: {}, {}, {}; the check points' own: {}, {}", out.With(check.rmse_h_m),
                         out.With(check.rmse_v_m), out.With(check.rmse_3d_m), out.With(check.stated_h_m),
                         out.With(check.stated_v_m)));
    out.Line(check.n < kConformantChecks
                 ? fmt::format("  not conformant, n = {} (ASPRS Positional Accuracy Standards, edition 2, ask for {})",
                               check.n, kConformantChecks)
                 : "  tested as the ASPRS Positional Accuracy Standards, edition 2, ask for");
    if (findings.nssda) {
      out.Line(fmt::format("  NSSDA, 95 %: horizontal {}, vertical {}{}", out.With(kNssdaHorizontal * a.h),
                           out.With(kNssdaVertical * a.v), check.n < 20 ? " (NSSDA asks for 20 points)" : ""));
    }
  }
  if (!findings.check_note.empty()) out.Line("\n" + findings.check_note);
  if (result.fit) {
    out.Line(fmt::format(
        "\nSurveyed points after a least-squares rigid fit of the map to all {} of them: median {}, "
        "RMS {}, largest {}",
        result.fit->n, out.With(result.fit->median_m), out.With(result.fit->rmse_m), out.With(result.fit->max_m)));
    for (const auto& [name, distance] : result.fit->worst) {
      out.Line(fmt::format("  {}: {}, more than three times the median: check how it was surveyed", name,
                           out.With(distance)));
    }
  }
  if (findings.repeats.repeatability && findings.repeats.repeatability->differences > 0) {
    out.Line(
        fmt::format("\nRepeatability, maps of all runs but one against the map of all: RMS {} over {} tags of {} maps",
                    out.With(findings.repeats.repeatability->rms_m), findings.repeats.repeatability->differences,
                    findings.repeats.repeatability->maps));
  }
  if (findings.repeats.reproducibility && findings.repeats.reproducibility->differences > 0) {
    out.Line(fmt::format("Reproducibility between days, maps of single days against each other: RMS {} over {} tags",
                         out.With(findings.repeats.reproducibility->rms_m),
                         findings.repeats.reproducibility->differences));
  }
}

void Stations(const SurveyFindings& findings, Report& out) {
  bool any = false;
  for (const StationOffset& o : findings.stations) {
    if (!o.offset_m) continue;
    if (!std::exchange(any, true)) {
      out.Line(
          fmt::format("\n| station, panorama | tags it shows | centre - tag as stated: e, n, u ({0}) | by the tags: e, "
                      "n, u ({0}) | "
                      "sigma ({0}, 1 sigma) | standardised |",
                      out.name()));
      out.Line("|---|---|---|---|---|---|");
    }
    const auto three = [&](const Eigen::Vector3d& v) {
      return fmt::format("{}, {}, {}", out.Length(v.x()), out.Length(v.y()), out.Length(v.z()));
    };
    out.Line(fmt::format("| {}, {} | {}{} | {} | {} | {} | {:.1f} |", o.station, o.panorama, o.tags,
                         o.own_tag ? ", its own" : "", three(o.stated_m), three(*o.offset_m),
                         three(o.covariance.diagonal().cwiseSqrt()), std::sqrt(o.chi2)));
  }
}

std::string RunLine(const RunAgreement& r) {
  std::string line =
      fmt::format("{}{}: {}, {} of tags, {} rejected, corners {:.2f} px rms", r.stills ? "Photo set " : "Run ", r.name,
                  Counted(r.frames, "picture"), Counted(r.sights, "detection"), r.rejected, r.rms_px);
  if (r.stills && r.scale_sigma > 0) {
    line += fmt::format("; rig: size {:.3f} +- {:.3f} of the stitched size (1 sigma)", r.scale, r.scale_sigma);
  } else if (!r.stills && r.scale_sigma > 0) {
    line += fmt::format("; odometry: scale {:.4f} +- {:.4f}, heading drift {:.3f} +- {:.3f} deg/m (1 sigma)", r.scale,
                        r.scale_sigma, r.heading_drift_deg_m, r.heading_drift_sigma_deg_m);
  }
  if (r.stills && !r.jumps_ns.empty()) {
    line +=
        fmt::format("; {} contradicting the stitched rig get almost no weight", Counted(r.jumps_ns.size(), "photo"));
  } else if (!r.jumps_ns.empty()) {
    constexpr size_t kMostNamed = 5;
    std::string when;
    for (size_t i = 0; i < std::min(kMostNamed, r.jumps_ns.size()); ++i)
      when += fmt::format("{}{:.1f}", i > 0 ? ", " : "", 1e-9 * static_cast<double>(r.jumps_ns[i]));
    line += fmt::format("; odometry jumped in {}, at {}{} s: almost no weight there",
                        Counted(r.jumps_ns.size(), "step"), when, r.jumps_ns.size() > kMostNamed ? " ..." : "");
  }
  if (r.corner_shift_sigma_px > 0) {
    line += fmt::format("; corners drawn {:.3f} +- {:.3f} px towards the tag's centre", r.corner_shift_px,
                        r.corner_shift_sigma_px);
  }
  if (r.camera) {
    const std::vector<double>& p = r.camera->params();
    line += fmt::format(
        "; self-calibrated: f {:.1f} +- {:.1f} px, cx {:.1f} +- {:.1f}, cy {:.1f} +- {:.1f}, k1 {:.4f} "
        "+- {:.4f}, k2 {:.4f} +- {:.4f} (1 sigma)",
        p[0], p[0] * r.camera_sigma[0], p[2], r.camera_sigma[1], p[3], r.camera_sigma[2], p[4], r.camera_sigma[3], p[5],
        r.camera_sigma[4]);
  }
  return line;
}

void Others(const SurveyResult& result, Report& out) {
  for (const DistanceAgreement& d : result.distances) {
    out.Line(fmt::format("Distance {} - {} ({}): measured {}, map {}, sigma of the difference {} (1 sigma)",
                         d.stated.from, d.stated.to,
                         d.stated.check ? "check"
                         : d.excluded   ? "taken out"
                                        : "used",
                         out.With(d.stated.distance_m), out.With(d.map_m), out.With(d.sigma_m)));
  }
  for (const PlaneAgreement& p : result.plane) {
    out.Line(fmt::format("Plane: tag {} lies {} above it{}", p.tag_id, out.With(p.height_m),
                         p.sigma_m > 0 ? fmt::format(", sigma of that {} (1 sigma)", out.With(p.sigma_m))
                                       : ": the plane alone determines its height"));
  }
  for (const DatumShift& s : result.shifts) {
    const Eigen::Vector3d &m = s.stated_minus_map_m, &e = s.sigma_m;
    bool real = false;
    for (int k = 0; k < 3; ++k) real |= std::abs(m[k]) > 3 * e[k];
    out.Line(
        fmt::format("Shift of {} against the map ({} of them): {}, {}, {} {} east, north, up, sigma {}, {}, {} (1 "
                    "sigma){}",
                    s.of, s.n, out.Length(m.x()), out.Length(m.y()), out.Length(m.z()), out.name(), out.Length(e.x()),
                    out.Length(e.y()), out.Length(e.z()),
                    real ? ": another datum or height system than the map's" : ": not significant"));
  }
  for (const RunAgreement& r : result.runs) out.Line(RunLine(r));
}

// What moved since other epochs.
void Moves(const SurveyFindings& findings, Report& out) {
  for (const EpochDifference& d : findings.control.epoch_differences) {
    out.Line(fmt::format("Point {}, epoch {} minus epoch {}: {}, {}, {} {}, sigma {}, {}, {} (1 sigma){}", d.point,
                         d.used, d.earlier, out.Length(d.difference_m.x()), out.Length(d.difference_m.y()),
                         out.Length(d.difference_m.z()), out.name(), out.Length(d.sigma_m.x()),
                         out.Length(d.sigma_m.y()), out.Length(d.sigma_m.z()), d.Moved() ? ": moved (99.9 %)" : ""));
  }
  if (!findings.epochs) return;
  const SurveyEpochs& test = *findings.epochs;
  out.Line(fmt::format("\nAgainst {}{}: {}", findings.against,
                       test.aligned ? " (datums of their own: fitted to each other first)" : "",
                       test.problem.empty() ? fmt::format("{} tags in both", test.tags.size()) : test.problem));
  int moved = 0;
  for (const TagChange& t : test.tags) {
    if (!t.moved) continue;
    ++moved;
    out.Line(fmt::format("  tag {} moved: {}, {}, {} {}, turned {:.2f} deg; chi-square {:.0f}, 22.5 is 99.9 %",
                         t.tag_id, out.Length(t.shift_m.x()), out.Length(t.shift_m.y()), out.Length(t.shift_m.z()),
                         out.name(), t.turn_deg, t.chi2));
  }
  if (moved == 0 && test.problem.empty()) out.Line("  no tag moved (99.9 %)");
}

}  // namespace

std::string FormatSurvey(const SurveyResult& result, const SurveyFindings& findings, const DisplayUnit& unit) {
  Report out(unit);
  out.Line(fmt::format("{}; datum: {} ({})", Counted(result.tags.size(), "tag"), result.datum,
                       findings.frame == "enu"     ? "site ENU"
                       : findings.frame == "local" ? "the local frame of the surveyed points, not georeferenced"
                                                   : "a frame of its own, not georeferenced"));
  out.Line("Gauge: " + result.gauge + "\n");
  TagTable(result, out);
  Points(result, out);
  Accuracies(result, findings, out);
  Stations(findings, out);
  out.Line("");
  Others(result, out);
  Moves(findings, out);
  return out.text();
}

}  // namespace trigpoint

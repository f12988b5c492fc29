// review: what people decided about detections, images, stations and control points.
#include <fmt/format.h>

#include "app/cli/command.h"
#include "app/pipeline/command_line.h"
#include "datasets/project/files.h"
#include "eval/errors/changed_errors.h"
#include "eval/text/json_values.h"
#include "eval/text/method_name.h"
#include "eval/text/number_text.h"

namespace trigpoint {
namespace {

struct ReviewArguments {
  std::string dir, action, object, role, reason, user, variant;
};

std::string LengthText(const std::optional<double>& metres, const DisplayUnit& unit) {
  return NumberText(metres, 4, "-", unit.metres);
}

int List(const Session& session, const ReviewArguments& arguments) {
  const Project project = Project::Open(arguments.dir);
  std::vector<std::string> rows;
  nlohmann::json entries = nlohmann::json::array();
  for (const ReviewEntry& entry : project.review().entries()) {
    rows.push_back(FormatReviewEntry(entry));
    entries.push_back({{"entry", entry.number},
                       {"time", entry.time},
                       {"user", entry.user},
                       {"action", entry.action},
                       {"object", entry.object},
                       {"role", entry.role},
                       {"reason", entry.reason},
                       {"in_force", entry.in_force}});
  }
  Ending ending(rows.empty()
                    ? "No decisions yet"
                    : Counted(static_cast<int64_t>(rows.size()), "decision", "decisions") + ", the newest first");
  for (auto row = rows.rbegin(); row != rows.rend(); ++row) ending.Row(*row);
  ending.Next("trigpoint review " + ShellWord(arguments.dir) +
              (rows.empty() ? " exclude OBJECT --reason TEXT" : " solve   (computes what rests on them)"));
  session.End(ending);
  session.PrintJson({{"command", "review"},
                     {"ok", true},
                     {"entries", entries},
                     {"in_force", project.review().InForce(ReviewKinds(), "")}});
  return 0;
}

// Everything that rests on the review, and what that changed at stations and check points.
int Solve(Session& session, const ReviewArguments& arguments) {
  if (!arguments.variant.empty()) CheckVariantName(arguments.variant);
  const Project project = OpenProject(session, arguments.dir);
  const DisplayUnit unit = DisplayUnitNamed(session.options.units);
  const std::vector<ErrorRow> before = ErrorsOf(project, arguments.variant);
  const RunReport report = RunJobsShown(session, "review", project, PlanJobs(project, ReviewQuery(arguments.variant)));
  std::vector<std::vector<std::string>> rows;
  nlohmann::json changes = nlohmann::json::array();
  for (const ReviewedError& row : ChangedErrors(before, ErrorsOf(project, arguments.variant))) {
    rows.push_back({ReferenceName(row.reference), MethodName(row.method), row.run, row.station,
                    LengthText(row.before_m, unit), LengthText(row.after_m, unit), row.status_before,
                    row.status_after});
    changes.push_back({{"reference", row.reference},
                       {"method", row.method},
                       {"run", row.run},
                       {"station", row.station},
                       {"panorama", row.panorama},
                       {"before_m", OrNull(row.before_m)},
                       {"after_m", OrNull(row.after_m)},
                       {"status_before", row.status_before},
                       {"status_after", row.status_after}});
  }
  if (!rows.empty()) {
    session.PrintDetails(
        "Changed 3D errors, " + unit.name + "\n" +
        TableText({"reference", "method", "run", "station", "before", "after", "status before", "status after"}, rows));
  }
  Ending ending = EndingOf(session, "review", project, report);
  ending.Fact("Changed", rows.empty() ? "nothing at stations and check points"
                                      : Counted(static_cast<int64_t>(rows.size()), "error", "errors") +
                                            " at stations and check points (--verbose lists them)");
  session.End(ending);
  session.PrintJson({{"command", "review"}, {"ok", report.exit_code == 0}, {"changes", changes}});
  return report.exit_code;
}

int Decide(const Session& session, const ReviewArguments& arguments) {
  const Project project = OpenProject(session, arguments.dir);
  const ReviewEntry entry =
      AppendReview(project, {arguments.action, arguments.object, arguments.role, arguments.reason, arguments.user});
  session.End(Ending(FormatReviewEntry(entry)).Next("trigpoint review " + ShellWord(arguments.dir) + " solve"));
  session.PrintJson({{"command", "review"},
                     {"ok", true},
                     {"entry", entry.number},
                     {"action", entry.action},
                     {"object", entry.object},
                     {"role", entry.role},
                     {"undoes", entry.undoes},
                     {"file", (project.dir() / "review.jsonl").string()}});
  return 0;
}

int ReviewProject(Session& session, const ReviewArguments& arguments) {
  if (arguments.action == "list") return List(session, arguments);
  if (arguments.action == "solve") return Solve(session, arguments);
  if (arguments.object.empty()) throw OptionError("review " + arguments.action + ": expected an OBJECT");
  if (arguments.reason.empty()) throw OptionError("review " + arguments.action + ": expected --reason TEXT");
  return Decide(session, arguments);
}

}  // namespace

void AddReviewCommand(CLI::App& app, Session& session) {
  CLI::App& command = AddCommand(
      app, session, "review", "exclude detections, images or stations, change roles of points, and undo such decisions",
      "Each decision is appended to review.jsonl with its reason, user and time; nothing is ever removed from it.\n"
      "OBJECT: image:RUN/FILE, detection:RUN/FILE#TAG, tag:TAG (wherever it is seen), station:NAME (its errors),\n"
      "panorama:NAME (as a reference of localize), control:TAG[/CORNER] or control:POINT (for role). The kind may be\n"
      "omitted where the name is unique. undo takes an object (its last decision), an entry's number, or\n"
      "`last`. list prints the decisions; solve computes every result again that uses them, and prints what changed "
      "at\n"
      "stations and check points.\n\n"
      "Examples:\n"
      "  trigpoint review my_site exclude run1/images/000012.jpg#57 --reason \"tag half hidden by a car\"\n"
      "  trigpoint review my_site role control:57 --to check --reason \"held back for the test\"\n"
      "  trigpoint review my_site undo last --reason \"was the right tag\"\n"
      "  trigpoint review my_site solve");
  const auto arguments = std::make_shared<ReviewArguments>();
  command.add_option("DIR", arguments->dir, "the project")->required();
  command.add_option("ACTION", arguments->action, "exclude, restore, role, undo, list, solve")
      ->required()
      ->check(CLI::IsMember({"exclude", "restore", "role", "undo", "list", "solve"}));
  command.add_option("OBJECT", arguments->object, "object of the decision, see below");
  command.add_option("--reason", arguments->reason, "reason of the decision, kept in review.jsonl");
  command.add_option("--user", arguments->user, "who decided; default: the user of this process");
  command.add_option("--to", arguments->role, "role: control or check; default: the other one")
      ->check(CLI::IsMember({"control", "check"}));
  command.add_option("--variant", arguments->variant, "solve: variant whose results are computed again");
  command.callback(
      [&session, arguments] { session.action = [arguments](Session& s) { return ReviewProject(s, *arguments); }; });
}

}  // namespace trigpoint

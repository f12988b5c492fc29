// publish: releases/<name>. verify: is a release as it was published? rerun: computed again. compare: projects,
// releases or variants against each other.
#include <fmt/format.h>

#include "app/cli/command.h"
#include "app/pipeline/command_line.h"
#include "app/pipeline/publish.h"
#include "app/pipeline/rerun.h"
#include "datasets/project/hash.h"
#include "datasets/project/release_files.h"
#include "eval/release/compared.h"
#include "eval/release/release_signature.h"
#include "eval/statistics/epoch.h"
#include "eval/text/method_name.h"

namespace trigpoint {
namespace {

// "against surveyed control: median 0.34 m and 0.30 m; b better in 2 of 3 pairs, not significant".
std::string BriefOf(const ComparedGroup& g, const std::string& b, const DisplayUnit& unit) {
  constexpr double kSignificant = 0.05;
  const auto length = [&](const std::optional<double>& metres) {
    return metres ? fmt::format("{:.3f} {}", *metres / unit.metres, unit.name) : std::string("-");
  };
  std::string text =
      "against " + ReferenceName(g.reference) + ": median " + length(g.a.median) + " and " + length(g.b.median) + "; ";
  if (g.paired.pairs == 0) return text + "no answer in common";
  return text + fmt::format("{} better in {} of {}, {}", b, g.paired.b_better, Counted(g.paired.pairs, "pair"),
                            g.paired.wilcoxon_p < kSignificant ? "significant" : "not significant");
}

int Compare(const Session& session, const std::vector<std::string>& sides, double significance) {
  if (sides.size() < 2) throw OptionError("compare needs at least two projects, releases or variants");
  const DisplayUnit unit = DisplayUnitNamed(session.options.units);
  std::vector<Compared> opened;
  for (const std::string& side : sides) opened.push_back(OpenCompared(side));
  Terminal terminal = session.MakeTerminal();
  for (const Compared& side : opened) {
    for (const std::string& note : side.notes) terminal.Log(LogLevel::kWarning, note);
  }
  nlohmann::json pairs = nlohmann::json::array();
  Ending ending("");
  std::vector<std::string> others;
  const Compared& a = opened.front();
  for (size_t i = 1; i < opened.size(); ++i) {
    session.cancel->ThrowIfCancelled();
    const Compared& b = opened[i];
    const std::vector<ComparedGroup> groups = CompareErrors(a.rows, b.rows);
    std::string text = "## " + a.label + " against " + b.label + "\n\n";
    text += FormatComparison(groups, a.label, b.label, unit.name, unit.metres) + "\n";
    nlohmann::json pair = ComparisonJson(groups, a.label, b.label);
    others.push_back(b.label);
    for (const ComparedGroup& g : groups) {  // views (G1) are in the details
      if (g.answer != "view") ending.Fact(Capitalised(g.kind), BriefOf(g, b.label, unit));
    }
    if (groups.empty()) ending.Fact(b.label, "has no group of errors in common with " + a.label);
    const std::vector<std::string> changes = ChangesBetween(a, b);
    if (changes.empty()) ending.Fact("Changed", "nothing in inputs, options and versions");
    for (const std::string& change : changes) ending.Row("Changed   " + change);
    text += changes.empty() ? "Nothing changed in inputs, options and versions\n" : "### What changed\n\n";
    for (const std::string& change : changes) text += "- " + change + "\n";
    pair["changes"] = changes;
    const bool same_map = !a.map.empty() && a.map == b.map;  // both variants use the first set's
    if (!a.tags.empty() && !b.tags.empty() && !same_map) {
      const EpochTest test = TestEpoch(a.tags, b.tags, significance);
      std::vector<std::string> moved;
      for (const TagMove& t : test.tags) {
        if (t.moved || t.turned) moved.push_back(std::to_string(t.tag_id));
      }
      ending.Fact("Tags", moved.empty() ? fmt::format("none of {} moved", test.tags.size())
                                        : fmt::format("moved or turned: {} of {}: {}", moved.size(), test.tags.size(),
                                                      Listed(moved)));
      text += "\n" + FormatEpoch(test, a.label, b.label, unit.name, unit.metres);
      pair["map"] = EpochJson(test);
    }
    session.PrintDetails(text + "\n");
    pairs.push_back(std::move(pair));
  }
  ending.Headline("Compared " + a.label + " with " + Listed(others) + ": 3D errors, panorama (G2)");
  session.End(ending.Next("the same with --verbose: every comparison with its interval, every change"));
  session.PrintJson({{"command", "compare"}, {"ok", true}, {"comparisons", pairs}});
  return 0;
}

}  // namespace

void AddPublishCommand(CLI::App& app, Session& session) {
  struct Arguments {
    std::string dir, key;
    PublishOptions options;
  };
  CLI::App& command = AddCommand(
      app, session, "publish", "freeze map, tables and all they were computed from under a name",
      "A release is never overwritten and never changes: `evaluate --reference NAME` compares results with\n"
      "its map, so that next month's run does not change last month's reference; `compare` shows what changed since.\n"
      "It has tables, settings, review and calibrations of the project, options and versions of every result; pictures "
      "and\n"
      "videos as hashes, or copied with --copy-inputs. What is out of date is not published.\n\n"
      "Examples:\n"
      "  trigpoint publish my_site --name 2026-05\n"
      "  trigpoint publish my_site --name 2026-06 --copy-inputs --sign ~/.ssh/id_ed25519\n"
      "  trigpoint publish my_site --name 2026-07 --author 'A. Surveyor' --instrument 'Leica TS16, 1 arcsec'\n"
      "  trigpoint verify my_site/releases/2026-05\n"
      "  trigpoint evaluate my_site --reference 2026-05\n"
      "  trigpoint compare my_site/releases/2026-05 my_site");
  const auto arguments = std::make_shared<Arguments>();
  PublishOptions& options = arguments->options;
  command.add_option("DIR", arguments->dir, "the project")->required();
  command.add_option("--name", options.name, "the release's name, releases/NAME")->required();
  command.add_option("--variant", options.variant, "publish this variant's map and tables");
  command.add_option("--author", options.statement.author, "who is responsible, for the certificate");
  command.add_option("--instrument", options.statement.instrument,
                     "what the control was measured with, for the certificate");
  command.add_option("--note", options.statement.note, "a sentence for the certificate");
  command
      .add_option("--sign", arguments->key,
                  "sign with this key: the file of an SSH key, or gpg:KEY; without a value the first of ~/.ssh")
      ->expected(0, 1);
  command.add_flag("--copy-inputs", options.copy_inputs, "copy pictures and videos too; without it, their hashes");
  command.callback([&session, &command, arguments] {
    if (command.count("--sign") > 0) arguments->options.sign = arguments->key;
    session.action = [arguments](Session& s) {
      const Project project = OpenProjectToCompute(s, arguments->dir);
      const Release release = Publish(project, arguments->options, *s.cancel);
      const std::string dir = ShellWord(ShownPath(project.dir())), name = release.dir.filename().string();
      s.End(Ending(fmt::format("Published {}: {}, a map of {}, {}", name, Counted(release.files, "file"),
                               Counted(release.tags, "tag"),
                               release.runs.empty() ? "no run" : "runs " + Listed(release.runs)))
                .Fact("Inputs", fmt::format("{}, of which {} by hash alone{}", release.inputs, release.inputs_by_hash,
                                            release.inputs_by_hash > 0 ? " (--copy-inputs copies them)" : ""))
                .Fact("SHA-256", release.sha256 + " of release.json")
                .Fact("Signed", arguments->options.sign ? "yes" : "no (--sign signs it)")
                .Look("Release", release.dir)
                .Look("Certificate", release.dir / "certificate.pdf")
                .Next("trigpoint verify " + ShellWord(ShownPath(release.dir)) + ", or trigpoint evaluate " + dir +
                      " --reference " + name));
      s.PrintJson({{"command", "publish"},
                   {"ok", true},
                   {"dir", release.dir.string()},
                   {"sha256", release.sha256},
                   {"files", release.files},
                   {"inputs", release.inputs},
                   {"inputs_by_hash", release.inputs_by_hash},
                   {"tags", release.tags},
                   {"runs", release.runs},
                   {"evidence", release.evidence}});
      return 0;
    };
  });
}

namespace {

std::string SignatureText(const Signature& signature) {
  switch (signature.state) {
    case Signature::State::kNone: return "none: the release is not signed";
    case Signature::State::kBroken: return "does not hold: " + signature.reason;
    case Signature::State::kHolds: break;
  }
  return "holds: " + signature.key + (signature.signer.empty() ? "" : ", " + signature.signer) +
         (signature.is_trusted ? "" : "; the owner of the key is not tested without --signers");
}

int Verify(const Session& session, const std::string& dir, const std::string& signers) {
  const ReleaseRecord record = ReadReleaseRecord(dir);
  const ReleaseDifferences differences = CompareRelease(dir, record, session.options.threads, *session.cancel);
  Ending ending("");
  const auto show = [&](const char* what, const std::vector<std::string>& files) {
    for (const std::string& file : files) ending.Problem(what, file);
  };
  if (record.damaged) ending.Problem("Changed", "release.json: its content does not have the hash that it states");
  show("Changed", differences.changed);
  show("Missing", differences.missing);
  show("Added", differences.added);
  const bool as_published = !record.damaged && !differences.Any();
  const Signature signature = CheckSignature(dir, signers, *session.cancel);
  const bool missed = signature.state == Signature::State::kNone && !signers.empty();
  const bool ok = as_published && !missed && signature.state != Signature::State::kBroken;
  ending.Headline(fmt::format("Release {} of {}, published {}: {}", CleanPath(record.json.value("name", "")),
                              CleanPath(record.json.value("project", "")),
                              CleanPath(record.json.value("published", "")),
                              as_published ? "all " + Counted(record.files.size(), "file") + " as they were published"
                                           : "not as it was published"));
  ending.Fact("Signature", SignatureText(signature) + (missed ? "; expected one of --signers" : ""));
  ending.Fact("SHA-256", Sha256OfFile(std::filesystem::path(dir) / kReleaseRecord) + " of release.json");
  ending.Next(ok ? "trigpoint rerun " + ShellWord(ShownPath(dir)) + "   (computes it again and compares)"
                 : "use another copy of the release: this one cannot be relied on");
  session.End(ending);
  static const char* const kStates[] = {"none", "holds", "broken"};
  session.PrintJson({{"command", "verify"},
                     {"ok", ok},
                     {"signature",
                      {{"state", kStates[static_cast<size_t>(signature.state)]},
                       {"key", signature.key},
                       {"signer", signature.signer},
                       {"trusted", signature.is_trusted},
                       {"reason", signature.reason}}},
                     {"release", dir},
                     {"files", record.files.size()},
                     {"record_changed", record.damaged},
                     {"changed", differences.changed},
                     {"missing", differences.missing},
                     {"added", differences.added}});
  return ok ? 0 : 1;
}

}  // namespace

void AddVerifyCommand(CLI::App& app, Session& session) {
  CLI::App& command = AddCommand(
      app, session, "verify", "check that a release is as it was published; list what was changed, added, removed",
      "Reads a release's folder, wherever it came from, and names every file that was changed, is missing\n"
      "or was added. Exit code 0 if none, else 1.\n\n"
      "Examples:\n"
      "  trigpoint verify my_site/releases/2026-05\n"
      "  trigpoint verify my_site/releases/2026-05 --signers colleague.pub");
  struct Arguments {
    std::string dir, signers;
  };
  const auto arguments = std::make_shared<Arguments>();
  command.add_option("RELEASE", arguments->dir, "the release's folder")->required();
  command.add_option("--signers", arguments->signers,
                     "whose signature counts: an SSH public key, an allowed_signers file, or OpenPGP public keys");
  command.callback([&session, arguments] {
    session.action = [arguments](Session& s) { return Verify(s, arguments->dir, arguments->signers); };
  });
}

namespace {

int RerunRelease(const Session& session, const RerunOptions& options) {
  Terminal terminal = session.MakeTerminal();
  const RerunResult result = Rerun(options, session.options.threads, terminal, *session.cancel);
  terminal.ClearProgress();
  Ending ending(fmt::format("Rerun done in {}: {} of {} have the same bytes", session.Taken(), result.same_files,
                            Counted(result.same_files + result.other.size(), "file")));
  ending.Fact("Computed", Listed(result.results));
  if (!result.taken.empty()) ending.Fact("Taken", Listed(result.taken) + " (not computed again)");
  if (!result.dir.empty()) ending.Look("Project", result.dir);
  nlohmann::json differences = nlohmann::json::array();
  for (const RerunDifference& d : result.other) {
    ending.Problem("Differs", d.result + " " + d.file + ": " + d.text);
    differences.push_back({{"result", d.result},
                           {"file", d.file},
                           {"text", d.text},
                           {"only_numbers", d.only_numbers},
                           {"largest", d.largest},
                           {"columns", d.columns}});
  }
  for (const std::string& note : result.notes) ending.Problem("Note", note);
  if (!result.other.empty()) {
    ending.Fact("Verdict", result.within_tolerance
                               ? fmt::format("only numbers differ, by at most {}", options.tolerance)
                               : fmt::format("not the same: texts differ, or numbers by more than {} (--tolerance)",
                                             options.tolerance));
  }
  session.End(ending);
  session.PrintJson({{"command", "rerun"},
                     {"ok", result.within_tolerance},
                     {"same_bytes", result.other.empty()},
                     {"results", result.results},
                     {"taken_over", result.taken},
                     {"same_files", result.same_files},
                     {"differences", differences},
                     {"notes", result.notes},
                     {"dir", result.dir.string()}});
  return result.within_tolerance ? 0 : 1;
}

}  // namespace

void AddRerunCommand(CLI::App& app, Session& session) {
  CLI::App& command = AddCommand(
      app, session, "rerun", "compute a release again from its own files, and list what differs",
      "Makes a copy of the project as it was published, computes every result behind the release with the same "
      "options\n"
      "and seed, and compares the files: same bytes, or how much each column differs. Pictures that the release\n"
      "has by hash alone are taken from the project it lies in, or from --inputs. Calibrations are taken over; the\n"
      "report is not made again. Exit code 0 if nothing differs by more than --tolerance, else 1.\n\n"
      "Examples:\n"
      "  trigpoint rerun my_site/releases/2026-05\n"
      "  trigpoint rerun 2026-05 --inputs my_site --out again --tolerance 1e-6");
  const auto options = std::make_shared<RerunOptions>();
  command.add_option("RELEASE", options->release, "the release's folder")->required();
  command.add_option("--inputs", options->inputs,
                     "the project's folder with what the release has by hash alone; default: the one it lies in");
  command.add_option("--out", options->out, "keep the project that is made in this new folder");
  command
      .add_option("--tolerance", options->tolerance,
                  "numbers that differ by at most this, each in its own unit, count as equal")
      ->check(CLI::Range(0.0, 1e9))
      ->capture_default_str();
  command.callback(
      [&session, options] { session.action = [options](Session& s) { return RerunRelease(s, *options); }; });
}

void AddCompareCommand(CLI::App& app, Session& session) {
  struct Arguments {
    std::vector<std::string> sides;
    double significance = 0.01;
  };
  CLI::App& command = AddCommand(
      app, session, "compare", "paired differences between projects, releases or variants, and what changed",
      "Each side is a project, a release's folder, or either with @VARIANT. The first is compared with every other:\n"
      "errors paired by run and station with confidence, what changed in inputs, options and versions, and which tags\n"
      "moved between their maps.\n\n"
      "Examples:\n"
      "  trigpoint compare my_site my_site@paper\n"
      "  trigpoint compare my_site/releases/2026-05 my_site/releases/2026-06");
  const auto arguments = std::make_shared<Arguments>();
  command.add_option("SIDE", arguments->sides, "two or more: PROJECT, PROJECT@VARIANT or PROJECT/releases/NAME")
      ->required();
  command
      .add_option("--significance", arguments->significance,
                  "probability that a tag is reported as moved although none moved")
      ->check(CLI::Range(1e-9, 0.5))
      ->capture_default_str();
  command.callback([&session, arguments] {
    session.action = [arguments](Session& s) { return Compare(s, arguments->sides, arguments->significance); };
  });
}

}  // namespace trigpoint

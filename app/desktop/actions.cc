#include "app/desktop/actions.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <QCoreApplication>

#include "app/pipeline/export.h"
#include "app/pipeline/publish.h"
#include "calib/base/counted.h"
#include "datasets/import/import_files.h"
#include "datasets/io/text.h"
#include "datasets/project/project.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

QString Words(const char* text) { return QCoreApplication::translate("trigpoint::Action", text); }

std::vector<std::string> SplitAtCommas(const std::string& text) {
  std::vector<std::string> parts;
  for (const std::string_view part : SplitAt(text, ',')) {
    if (!part.empty()) parts.emplace_back(part);
  }
  return parts;
}

void CheckWord(const char* name, const std::string& value, const std::vector<std::string>& known,
               std::vector<std::string>* problems) {
  if (value.empty() || std::find(known.begin(), known.end(), value) != known.end()) return;
  problems->push_back(fmt::format("option {} is '{}', expected {} or {}", name, value,
                                  fmt::join(known.begin(), known.end() - 1, ", "), known.back()));
}

std::string Files(const std::vector<fs::path>& files) {
  std::string text;
  for (const fs::path& file : files) text += file.string() + "\n";
  return text;
}

struct ImportForm {
  FileImport request;
  std::string as = "auto";
  double radius_m = 0;

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.request.from, PathOption({"from", "", 0, 0, "file or folder to take in"}, PathKind::kFileOrFolder));
    visit(self.as, {"as", "", 0, 0, "what it is; auto: recognised by its contents"});
    visit(self.request.name, {"name", "", 0, 0, "name of the new run or photo set"});
    visit(self.request.images,
          PathOption({"images", "", 0, 0, "colmap, gcp: folder of the pictures; empty: beside the file"},
                     PathKind::kFolder));
    visit(self.request.odometry,
          PathOption({"odometry", "", 0, 0, "dataset, video: file with poses; empty: none"}, PathKind::kFile));
    visit(self.request.bag.every, {"every", "images", 1, 100000, "bag, dataset, video: one image of so many is taken"});
    visit(self.request.scale, {"scale", "", 0, 1e9, "colmap: metres per unit of the model; 0: from EXIF positions"});
    visit(self.request.tag_size_m, {"tag_size", "m", 0, 100, "tag-layout: black square, where the file has none"});
    visit(self.request.panoramas.width, {"width", "px", 0, 65536, "panoramas: shrink wider ones; 0: as they are"});
  }
  std::vector<std::string> Check() const {
    std::vector<std::string> problems = CheckRanges(*this), kinds = ImportKinds();
    kinds.insert(kinds.begin(), "auto");
    CheckWord("as", as, kinds, &problems);
    if (request.from.empty()) problems.push_back("option from: expected a file or folder");
    return problems;
  }
  std::string Run(const fs::path& dir, ProgressSink& progress, const CancelToken& cancel) const {
    FileImport files = request;
    files.dir = dir.string();
    const std::string kind = as == "auto" ? ImportKindOf(files.from) : as;
    const ImportReport report = ImportFiles(files, kind, progress, cancel);
    return fmt::format("{}: {}\n{}\n{}", kind, Counted(report.files.size(), "new file"), fmt::join(report.lines, "\n"),
                       fmt::join(report.warnings, "\n"));
  }
};

struct ExportForm {
  std::string to = "gpkg", what, run, variant, crs, heights, frame, out;
  double confidence = 0.95, ellipse_scale = 1;
  bool force = false;

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.to, {"to", "", 0, 0, "format"});
    visit(self.what, {"what", "", 0, 0, "layers or parts, separated by commas; empty: all"});
    visit(self.run, {"run", "", 0, 0, "only this run; empty: all"});
    visit(self.variant, {"variant", "", 0, 0, "results of this variant"});
    visit(self.crs, {"crs", "", 0, 0, "EPSG:N, or utm for the zone of the site; empty: EPSG:4326 (WGS 84)"});
    visit(self.heights, {"heights", "", 0, 0, "above the ellipsoid or a geoid"});
    visit(self.frame, {"frame", "", 0, 0, "of scenes and trajectories: world (site ENU) or odom (the run's own)"});
    visit(self.confidence, {"confidence", "", 0.01, 0.9999, "of the ellipses"});
    visit(self.ellipse_scale, {"ellipse_scale", "", 0.001, 1e6, "draw ellipses so many times larger"});
    visit(self.out,
          PathOption({"out", "", 0, 0, "file or folder; empty: below results/export"}, PathKind::kNewFileOrFolder));
    visit(self.force, {"force", "", 0, 1, "replace files of an earlier export that were changed since"});
  }
  std::vector<std::string> Check() const {
    std::vector<std::string> problems = CheckRanges(*this), formats;
    for (const ExportFormat& format : ExportFormats()) formats.push_back(format.name);
    CheckWord("to", to, formats, &problems);
    CheckWord("heights", heights, {"ellipsoidal", "egm84", "egm96", "egm2008"}, &problems);
    CheckWord("frame", frame, {"world", "odom"}, &problems);
    return problems;
  }
  std::string Run(const fs::path& dir, ProgressSink& progress, const CancelToken& cancel) const {
    ExportRequest request;
    request.to = to, request.what = SplitAtCommas(what);
    if (!run.empty()) request.runs = {run};
    request.variant = variant, request.crs = crs, request.heights = heights, request.frame = frame;
    request.confidence = confidence, request.ellipse_scale = ellipse_scale, request.out = out, request.force = force;
    const ExportReport report = ExportResults(Project::Open(dir), request, progress, cancel);
    return fmt::format("{}\n{}{}", fmt::join(report.lines, "\n"), Files(report.files),
                       fmt::join(report.warnings, "\n"));
  }
};

struct PublishForm {
  PublishOptions options;
  std::string sign;

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.options.name, {"name", "", 0, 0, "the release's name: releases/NAME"});
    visit(self.options.variant, {"variant", "", 0, 0, "publish this variant's map and tables"});
    visit(self.options.statement.author, {"author", "", 0, 0, "who is responsible, for the certificate"});
    visit(self.options.statement.instrument, {"instrument", "", 0, 0, "what the control was measured with"});
    visit(self.options.statement.note, {"note", "", 0, 0, "a sentence for the certificate"});
    visit(self.sign, PathOption({"sign", "", 0, 0, "sign with the file of an SSH key, or gpg:KEY; empty: not signed"},
                                PathKind::kFile));
    visit(self.options.copy_inputs,
          {"copy_inputs", "", 0, 1, "copy pictures and videos too; without it, their hashes"});
  }
  std::vector<std::string> Check() const {
    std::vector<std::string> problems = CheckRanges(*this);
    if (options.name.empty()) problems.push_back("option name: expected the release's name");
    return problems;
  }
  std::string Run(const fs::path& dir, ProgressSink&, const CancelToken& cancel) const {
    PublishOptions publish = options;
    if (!sign.empty()) publish.sign = sign;
    const Release release = Publish(Project::Open(dir), publish, cancel);
    return fmt::format("{}\n{}, a map of {}\nSHA-256 of release.json: {}\nInputs: {}, of which {} by hash",
                       release.dir.string(), Counted(release.files, "file"), Counted(release.tags, "tag"),
                       release.sha256, release.inputs, release.inputs_by_hash);
  }
};

template <typename Form>
std::vector<std::string> Fill(const nlohmann::json& values, Form* form) {
  std::vector<std::string> problems;
  SetOptions(values, "form", *form, problems);
  return problems.empty() ? form->Check() : problems;
}

template <typename Form>
Action ActionOf(const char* command, const QString& title, const QString& intro, const char* required) {
  Action action;
  action.command = command;
  action.required = required;
  action.title = title;
  action.intro = intro;
  action.options = DescribeOptions<Form>();
  action.check = [](const nlohmann::json& values) {
    Form form;
    return Fill(values, &form);
  };
  action.run = [](const fs::path& dir, const nlohmann::json& values, ProgressSink& progress,
                  const CancelToken& cancel) {
    Form form;
    ThrowIfAny(Fill(values, &form));
    return form.Run(dir, progress, cancel);
  };
  return action;
}

}  // namespace

Action ImportAction() {
  return ActionOf<ImportForm>("import", Words(QT_TRANSLATE_NOOP("trigpoint::Action", "Import")),
                              Words(QT_TRANSLATE_NOOP("trigpoint::Action",
                                                      "Other people's data as new files of this project. Nothing that "
                                                      "is there is replaced.")),
                              "from");
}

Action ExportAction() {
  return ActionOf<ExportForm>("export", Words(QT_TRANSLATE_NOOP("trigpoint::Action", "Export")),
                              Words(QT_TRANSLATE_NOOP("trigpoint::Action",
                                                      "Results as files of other programs: maps, models, pose "
                                                      "graphs. Files of others are never replaced.")),
                              "to");
}

Action PublishAction() {
  return ActionOf<PublishForm>(
      "publish", Words(QT_TRANSLATE_NOOP("trigpoint::Action", "Publish")),
      Words(QT_TRANSLATE_NOOP("trigpoint::Action",
                              "Freezes map, tables and all they were computed from under a name. A release is never "
                              "overwritten; what is out of date is not published.")),
      "name");
}

}  // namespace trigpoint

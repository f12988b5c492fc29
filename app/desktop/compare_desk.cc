#include "app/desktop/compare_desk.h"

#include <QCheckBox>
#include <QComboBox>
#include <QFileDialog>
#include <QHBoxLayout>
#include <QHeaderView>
#include <QLabel>
#include <QPushButton>
#include <QTabWidget>
#include <QTableWidget>
#include <QTextBrowser>
#include <algorithm>

#include "app/desktop/background.h"
#include "app/desktop/fitted_box.h"
#include "app/desktop/flow_layout.h"
#include "app/desktop/number_item.h"
#include "app/desktop/object_table.h"
#include "app/desktop/report_text.h"
#include "app/desktop/scene_desk.h"
#include "app/desktop/views_box.h"
#include "app/desktop/widgets.h"
#include "eval/errors/changed_errors.h"
#include "eval/errors/compare.h"
#include "eval/release/compared.h"
#include "eval/text/display_unit.h"
#include "eval/text/method_name.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

// Of the table of errors, by index; they stand in another order (kShownOrder).
enum Column { kReference, kAnswer, kRun, kStation, kPanorama, kA, kB, kDifference, kSigma, kStatus, kColumns };
// What is compared first, so that it is seen in a narrow window, too.
constexpr Column kShownOrder[kColumns] = {kStation,    kPanorama, kRun,    kA,         kB,
                                          kDifference, kSigma,    kStatus, kReference, kAnswer};

struct Comparison {
  std::vector<ReviewedError> rows;
  std::vector<std::string> changes;
  std::string text;
};

// Two different runs lose their names, so that their rows are paired.
void KeepRun(const std::string& run, bool rename, std::vector<ErrorRow>* rows) {
  if (run.empty()) return;
  std::erase_if(*rows, [&](const ErrorRow& row) { return row.run != run; });
  for (ErrorRow& row : *rows) {
    if (rename) row.run.clear();
  }
}

// Rows of two variants are paired by what they are of.
void ForgetVariant(std::vector<ErrorRow>* rows) {
  for (ErrorRow& row : *rows) row.variant.clear();
}

// The folder that all panoramas are in, with its slash; photo sets are in none.
QString CommonFolder(const std::vector<ReviewedError>& rows) {
  QString common;
  for (const ReviewedError& row : rows) {
    const QString name = Text(row.panorama), folder = name.left(name.lastIndexOf('/') + 1);
    if (folder.isEmpty()) continue;
    if (!common.isEmpty() && folder != common) return QString();
    common = folder;
  }
  return common;
}

// As the other desks name methods and references.
std::string PairedText(const std::vector<ErrorRow>& a, const std::vector<ErrorRow>& b, const std::string& name_a,
                       const std::string& name_b, const DisplayUnit& unit) {
  std::vector<ComparedGroup> groups = CompareErrors(a, b);
  for (ComparedGroup& group : groups) {
    group.reference = ReferenceName(group.reference);
    group.method_a = MethodName(group.method_a), group.method_b = MethodName(group.method_b);
  }
  return FormatComparison(groups, name_a, name_b, unit.name, unit.metres);
}

}  // namespace

CompareDesk::CompareDesk(Workspace* workspace, QWidget* parent) : QWidget(parent), workspace_(workspace) {
  auto* top = new FlowLayout;
  const char* names[] = {"a", "b"};
  for (int i = 0; i < 2; ++i) {
    Side& side = sides_[i];
    side.result = Named(new FittedBox(tr("Results of a variant, of a release, or of another project")),
                        QString("compare.") + names[i], i == 0 ? tr("First evaluation") : tr("Second evaluation"));
    side.run = Named(new FittedBox(tr("All runs, or the one whose answers are compared")),
                     QString("compare.run_") + names[i], i == 0 ? tr("Run of the first") : tr("Run of the second"));
    top->addWidget(new QLabel(i == 0 ? "A" : "B"));
    top->addWidget(side.result);
    top->addWidget(side.run);
    connect(side.result, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &CompareDesk::Compare);
    connect(side.run, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &CompareDesk::Compare);
  }
  auto* other = MakeButton("compare.other", tr("Other &project or release ..."),
                           tr("A folder with another project, a release, or errors.csv: becomes B"));
  top->addWidget(other);
  views_ = MakeViewsBox("compare.views");
  top->addWidget(views_);
  errors_ = MakeTable("compare.errors", tr("Errors side by side"));
  differences_ = MakeTable("compare.differences", tr("What changed in inputs, options and version"));
  for (QTableWidget* table : {errors_, differences_}) {
    table->setSortingEnabled(true);
    table->horizontalHeader()->setStretchLastSection(false);
    table->verticalHeader()->setDefaultSectionSize(table->fontMetrics().height() + 6);
  }
  errors_->setColumnCount(kColumns);
  for (int at = 0; at < kColumns; ++at) {
    errors_->horizontalHeader()->moveSection(errors_->horizontalHeader()->visualIndex(kShownOrder[at]), at);
  }
  text_ = Named(new QTextBrowser, "compare.text", tr("Paired comparison"));
  scenes_ = new QWidget;
  new QHBoxLayout(scenes_);
  tabs_ = new QTabWidget;
  tabs_->addTab(errors_, tr("Station by station"));
  tabs_->addTab(text_, tr("Paired statistics"));
  tabs_->addTab(differences_, tr("What changed"));
  tabs_->addTab(scenes_, tr("3D"));
  note_ = WrappedLabel("compare.note");
  InColumn({top, note_, {tabs_, 1}}, this);
  connect(other, &QPushButton::clicked, this, [this] {
    const QString dir = QFileDialog::getExistingDirectory(this, tr("A project, a release, or a folder of errors.csv"));
    if (!dir.isEmpty() && !Add(dir)) {
      emit workspace_->Problem(tr("%1: found no errors.csv there, nor in results/evaluate").arg(dir), "");
    }
  });
  connect(tabs_, &QTabWidget::currentChanged, this, [this] {
    if (tabs_->currentWidget() == scenes_) ShowScenes();
  });
  LinkTable(errors_, workspace_);
  connect(errors_, &QTableWidget::cellActivated, this,
          [this](int row) { emit Activated(errors_->item(row, 0)->data(Qt::UserRole).toString()); });
  connect(workspace_, &Workspace::Replaced, this, [this] { added_.clear(); });
  connect(workspace_, &Workspace::Opened, this, &CompareDesk::Refresh);
  connect(workspace_, &Workspace::Closed, this, &CompareDesk::Refresh);
  connect(workspace_, &Workspace::UnitChanged, this, &CompareDesk::Compare);
  connect(views_, &QCheckBox::toggled, this, &CompareDesk::Compare);
  Compare();
}

bool CompareDesk::Add(const QString& folder) {
  const fs::path path = folder.toStdString();
  const bool known = fs::exists(path / "errors.csv") || fs::exists(path / "release.json") ||
                     fs::is_directory(path / "results" / "evaluate");
  if (!known) return false;
  added_.push_back(path);
  Refresh();
  sides_[1].result->setCurrentIndex(sides_[1].result->count() - 1);
  return true;
}

void CompareDesk::Refresh() {
  const auto& snapshot = workspace_->snapshot();
  for (int i = 0; i < 2; ++i) {
    Side& side = sides_[i];
    const QString before = side.result->currentText(), run_before = side.run->currentText();
    const QSignalBlocker block(side.result), block_run(side.run);
    side.result->clear();
    side.run->clear();
    if (!snapshot) continue;
    const QString dir = Text(snapshot->dir.string());
    for (const std::string& variant : snapshot->variants) {
      const QString name = Text(variant);
      side.result->addItem(variant.empty() ? tr("first results") : name, variant.empty() ? dir : dir + "@" + name);
    }
    std::error_code ignored;
    for (fs::directory_iterator it(snapshot->dir / "releases", ignored), end; it != end; it.increment(ignored)) {
      if (!fs::exists(it->path() / "release.json")) continue;
      side.result->addItem(tr("release %1").arg(Text(it->path().filename().string())), Text(it->path().string()));
    }
    for (const fs::path& folder : added_) {
      side.result->addItem(Text(folder.string()), Text(folder.string()));
    }
    side.run->addItem(tr("all runs"), "");
    for (const SnapshotRun& run : snapshot->runs) {
      side.run->addItem(Text(run.name), Text(run.name));
    }
    int index = side.result->findText(before);
    if (index < 0) index = std::min(i, side.result->count() - 1);
    side.result->setCurrentIndex(index);
    side.run->setCurrentIndex(std::max(0, side.run->findText(run_before)));
  }
  Compare();
}

void CompareDesk::Compare() {
  const int generation = ++generation_;
  errors_->setRowCount(0);
  differences_->setRowCount(0);
  text_->clear();
  std::string written[2], runs[2], names[2];
  for (int i = 0; i < 2; ++i) {
    written[i] = sides_[i].result->currentData().toString().toStdString();
    runs[i] = sides_[i].run->currentData().toString().toStdString();
    names[i] = (sides_[i].result->currentText() + (runs[i].empty() ? "" : " ") + Text(runs[i])).toStdString();
    sides_[i].source = SceneSourceOf(written[i]);
  }
  if (!workspace_->snapshot()) return Note(tr("Open a project (Ctrl+O) to compare its variants, runs and releases."));
  if (written[0].empty() || written[1].empty()) {
    return Note(tr("Nothing to compare yet: no evaluation is there. Run evaluate first."));
  }
  QString note;
  if (runs[0].empty() != runs[1].empty()) {
    const QString run = Text(runs[0].empty() ? runs[1] : runs[0]);
    note = tr("One side is %1 alone: of the other side's runs only %1 is compared.").arg(run);
  } else if (written[0] == written[1] && runs[0] == runs[1]) {
    note = tr("A and B are the same results: choose another variant, run, release or project for B.");
  }
  Note(tr("Comparing ..."));
  InBackground(
      this,
      [written_a = written[0], written_b = written[1], run_a = runs[0], run_b = runs[1], name_a = names[0],
       name_b = names[1], unit = workspace_->display_unit(), views = views_->isChecked()] {
        trigpoint::Compared a = OpenCompared(written_a), b = OpenCompared(written_b);
        Comparison c;
        for (const std::string& line : a.notes) c.text += line + "\n\n";
        for (const std::string& line : b.notes) c.text += line + "\n\n";
        // Of all runs on one side the one that the other side names takes part.
        const bool rename = !run_a.empty() && !run_b.empty() && run_a != run_b;
        KeepRun(run_a.empty() ? run_b : run_a, rename, &a.rows);
        KeepRun(run_b.empty() ? run_a : run_b, rename, &b.rows);
        for (std::vector<ErrorRow>* rows : {&a.rows, &b.rows}) {
          ForgetVariant(rows);
          if (!views) std::erase_if(*rows, [](const ErrorRow& row) { return row.method == "g1"; });
        }
        c.text += PairedText(a.rows, b.rows, name_a, name_b, unit);
        // A panorama's answer is one, by whichever method.
        for (std::vector<ErrorRow>* rows : {&a.rows, &b.rows}) {
          for (ErrorRow& row : *rows) row.method = MethodName(row.method), row.reference = ReferenceName(row.reference);
        }
        c.rows = ChangedErrors(a.rows, b.rows, -1);
        c.changes = ChangesBetween(a, b);
        return c;
      },
      [this, generation, note,
       single = !runs[0].empty() && !runs[1].empty() && runs[0] != runs[1]](const Attempted<Comparison>& compared) {
        if (generation != generation_) return;
        if (!compared.error.isEmpty()) return Note(compared.error);
        Note(compared.value.rows.empty() ? tr("A and B have no panorama in common that both evaluate.") : note);
        ShowErrors(compared.value.rows, single);
        text_->setMarkdown(Text(compared.value.text));
        differences_->setColumnCount(1);
        differences_->setHorizontalHeaderLabels({tr("what changed from A to B")});
        SetHeaderHelp(differences_, {tr("inputs, options and versions of the results that differ")});
        QStringList changes;
        for (const std::string& change : compared.value.changes) changes << Text(change);
        if (changes.empty()) changes << tr("nothing: options, inputs and versions are the same");
        for (const QString& change : changes) {
          const int r = differences_->rowCount();
          differences_->insertRow(r);
          differences_->setItem(r, 0, new QTableWidgetItem(change));
        }
        differences_->resizeColumnsToContents();
        if (tabs_->currentWidget() == scenes_) ShowScenes();
        emit Compared();
      });
}

void CompareDesk::ShowErrors(const std::vector<ReviewedError>& rows, bool single) {
  const QString unit = workspace_->unit();
  const auto length = [this](const std::optional<double>& metres) {
    return metres ? QString::number(*metres / workspace_->metres_per_unit(), 'f', 4) : QString();
  };
  const QSignalBlocker block(errors_);
  errors_->setSortingEnabled(false);
  const bool one_method =
      std::all_of(rows.begin(), rows.end(), [&](const auto& row) { return row.method == rows.front().method; });
  errors_->setColumnHidden(kRun, single);
  errors_->setColumnHidden(kAnswer, one_method);
  const QString folder = CommonFolder(rows);
  errors_->setHorizontalHeaderLabels({tr("reference"), tr("answer"), tr("run"), tr("station"), tr("panorama"),
                                      QString("A (%1)").arg(unit), QString("B (%1)").arg(unit),
                                      tr("B - A (%1)").arg(unit), QString::fromUtf8("\xcf\x83 (%1)").arg(unit),
                                      tr("status")});
  SetHeaderHelp(errors_,
                {tr("what the answers are compared with"), tr("how the answer was made: panorama (G2) or view (G1)"),
                 tr("run that the panorama was localized against"), tr("station at which the panorama was taken"),
                 tr("panorama, photo or photo set"),
                 tr("distance in space between the answer of A and the reference (%1)").arg(unit),
                 tr("distance in space between the answer of B and the reference (%1)").arg(unit),
                 tr("error of B minus error of A: negative where B is better (%1)").arg(unit),
                 tr("standard deviation of the error in space, the larger one of A and B (%1)").arg(unit),
                 tr("localized, refused, no match or no reference: in A, then in B")});
  for (const ReviewedError& row : rows) {
    const int r = errors_->rowCount();
    errors_->insertRow(r);
    std::optional<double> difference;
    if (row.before_m && row.after_m) difference = *row.after_m - *row.before_m;
    const QString before = ReportText(StatusName(row.status_before)), after = ReportText(StatusName(row.status_after));
    const QString status = before == after ? before : before + " / " + after;
    const QStringList cells{ReportText(ReferenceName(row.reference)),
                            ReportText(row.method),
                            Text(row.run),
                            Text(row.station),
                            Text(row.panorama),
                            length(row.before_m),
                            length(row.after_m),
                            length(difference),
                            length(row.sigma_m),
                            status};
    for (int c = 0; c < cells.size(); ++c) {
      auto* item = c >= kA && c <= kSigma ? new NumberItem(cells[c]) : new QTableWidgetItem(cells[c]);
      if (c == kPanorama) {
        item->setToolTip(cells[c]);
        if (cells[c].startsWith(folder)) item->setText(cells[c].mid(folder.size()));
      }
      item->setData(Qt::UserRole, Text("station:" + row.station));
      item->setData(kRunRole, Text(row.run));
      errors_->setItem(r, c, item);
    }
  }
  errors_->setSortingEnabled(true);
  errors_->resizeColumnsToContents();
  ShowSelectedRows(errors_, *workspace_);
}

void CompareDesk::Note(const QString& text) {
  note_->setText(text);
  note_->setVisible(!text.isEmpty());
}

void CompareDesk::ShowScenes() {
  for (int i = 0; i < 2; ++i) {
    Side& side = sides_[i];
    if (side.scene == nullptr) {
      side.title = WrappedLabel(QString("compare.title_") + (i == 0 ? "a" : "b"));
      side.scene = new SceneDesk(workspace_, SceneDesk::Kind::kCompact);
      connect(side.scene, &SceneDesk::Loaded, this, &CompareDesk::ShowTitles);
      auto* half = Pane({side.title, {side.scene, 1}});
      half->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Expanding);  // both get half
      scenes_->layout()->addWidget(half);
    }
    side.scene->setVisible(side.source.has_value());
    if (side.source) side.scene->ShowResults(*side.source, side.run->currentData().toString());
  }
  sides_[1].scene->ShareCamera(sides_[0].scene);
  ShowTitles();
}

void CompareDesk::ShowTitles() {
  for (int i = 0; i < 2; ++i) {
    const Side& side = sides_[i];
    if (side.scene == nullptr) continue;
    QString name = QString("%1: %2, %3").arg(i == 0 ? "A" : "B", side.result->currentText(), side.run->currentText());
    if (!side.source) name = tr("%1 (has errors only, no results to draw)").arg(name);
    const bool both = i == 1 && side.source && sides_[0].source && sides_[0].scene != nullptr;
    const QString differs = both ? side.scene->DiffersFrom(*sides_[0].scene) : QString();
    side.title->setText(differs.isEmpty() ? name : name + "\n" + differs);
  }
}

}  // namespace trigpoint

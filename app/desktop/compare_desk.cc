#include "app/desktop/compare_desk.h"

#include <QComboBox>
#include <QFileDialog>
#include <QFontDatabase>
#include <QHBoxLayout>
#include <QHeaderView>
#include <QLabel>
#include <QPlainTextEdit>
#include <QPushButton>
#include <QTabWidget>
#include <QTableWidget>
#include <QVBoxLayout>

#include "app/desktop/background.h"
#include "app/desktop/scene_desk.h"
#include "app/pipeline/differences.h"
#include "app/pipeline/reviewed.h"
#include "eval/compare.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

struct Comparison {
  std::vector<ReviewedError> rows;
  std::vector<Difference> differences;
  std::string text;
};

// The rows of one run, or of all; a run of its own loses its name, so that it is paired with another one.
std::vector<ErrorRow> RowsOf(const fs::path& folder, const std::string& run) {
  std::vector<ErrorRow> rows = ReadErrors(folder / "errors.csv");
  if (run.empty()) return rows;
  std::erase_if(rows, [&](const ErrorRow& row) { return row.run != run; });
  for (ErrorRow& row : rows) row.run.clear();
  return rows;
}

QTableWidget* MakeTable(const char* name, const QString& accessible) {
  auto* table = new QTableWidget;
  table->setObjectName(name);
  table->setAccessibleName(accessible);
  table->setEditTriggers(QAbstractItemView::NoEditTriggers);
  table->setSelectionBehavior(QAbstractItemView::SelectRows);
  table->setSortingEnabled(true);
  table->verticalHeader()->setDefaultSectionSize(table->fontMetrics().height() + 6);
  return table;
}

// Sorts numbers as numbers.
class NumberItem : public QTableWidgetItem {
 public:
  explicit NumberItem(const QString& text) : QTableWidgetItem(text) {
    setTextAlignment(static_cast<int>(Qt::AlignRight | Qt::AlignVCenter));
  }
  bool operator<(const QTableWidgetItem& other) const override { return text().toDouble() < other.text().toDouble(); }
};

}  // namespace

CompareDesk::CompareDesk(Workspace* workspace, QWidget* parent) : QWidget(parent), workspace_(workspace) {
  auto* top = new QHBoxLayout;
  const char* names[] = {"a", "b"};
  for (int i = 0; i < 2; ++i) {
    Side& side = sides_[i];
    side.result = new QComboBox;
    side.result->setObjectName(QString("compare.") + names[i]);
    side.result->setAccessibleName(i == 0 ? tr("First evaluation") : tr("Second evaluation"));
    side.run = new QComboBox;
    side.run->setObjectName(QString("compare.run_") + names[i]);
    side.run->setAccessibleName(i == 0 ? tr("Run of the first") : tr("Run of the second"));
    top->addWidget(new QLabel(i == 0 ? "A" : "B"));
    top->addWidget(side.result);
    top->addWidget(side.run);
    connect(side.result, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &CompareDesk::Compare);
    connect(side.run, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &CompareDesk::Compare);
  }
  auto* other = new QPushButton(tr("Other &project or release ..."));
  other->setObjectName("compare.other");
  top->addWidget(other);
  top->addStretch();
  errors_ = MakeTable("compare.errors", tr("Errors side by side"));
  differences_ = MakeTable("compare.differences", tr("What changed in inputs, options and version"));
  text_ = new QPlainTextEdit;
  text_->setObjectName("compare.text");
  text_->setAccessibleName(tr("Paired comparison"));
  text_->setReadOnly(true);
  text_->setFont(QFontDatabase::systemFont(QFontDatabase::FixedFont));
  scenes_ = new QWidget;
  new QHBoxLayout(scenes_);
  tabs_ = new QTabWidget;
  tabs_->addTab(errors_, tr("Station by station"));
  tabs_->addTab(text_, tr("Paired statistics"));
  tabs_->addTab(differences_, tr("What changed"));
  tabs_->addTab(scenes_, tr("3D"));
  auto* all = new QVBoxLayout(this);
  all->addLayout(top);
  all->addWidget(tabs_, 1);
  connect(other, &QPushButton::clicked, this, [this] {
    const QString dir = QFileDialog::getExistingDirectory(this, tr("A project, a release, or a folder of errors.csv"));
    if (!dir.isEmpty() && !Add(dir)) {
      emit workspace_->Problem(tr("%1: found no errors.csv there, nor in results/evaluate").arg(dir), "");
    }
  });
  connect(tabs_, &QTabWidget::currentChanged, this, [this] {
    if (tabs_->currentWidget() == scenes_) ShowScenes();
  });
  connect(errors_, &QTableWidget::itemSelectionChanged, this, [this] {
    const auto items = errors_->selectedItems();
    if (!items.isEmpty()) workspace_->Select(items.front()->data(Qt::UserRole).toString());
  });
  connect(workspace_, &Workspace::Opened, this, &CompareDesk::Refresh);
  connect(workspace_, &Workspace::Closed, this, &CompareDesk::Refresh);
  connect(workspace_, &Workspace::UnitChanged, this, &CompareDesk::Compare);
}

bool CompareDesk::Add(const QString& folder) {
  for (const char* below : {"", "results/evaluate", "evaluate"}) {
    const fs::path path = fs::path(folder.toStdString()) / below;
    if (!fs::exists(path / "errors.csv")) continue;
    added_.push_back(path);
    Refresh();
    sides_[1].result->setCurrentIndex(sides_[1].result->count() - 1);
    return true;
  }
  return false;
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
    for (const std::string& variant : snapshot->variants) {
      const fs::path folder = snapshot->project->ResultDir("evaluate", variant.empty() ? "" : "@" + variant);
      if (!fs::exists(folder / "errors.csv")) continue;
      side.result->addItem(variant.empty() ? tr("first results") : QString::fromStdString(variant),
                           QString::fromStdString(folder.string()));
    }
    std::error_code ignored;
    for (fs::directory_iterator it(snapshot->dir / "releases", ignored), end; it != end; it.increment(ignored)) {
      for (const char* below : {"", "evaluate", "results/evaluate"}) {
        if (!fs::exists(it->path() / below / "errors.csv")) continue;
        side.result->addItem(tr("release %1").arg(QString::fromStdString(it->path().filename().string())),
                             QString::fromStdString((it->path() / below).string()));
      }
    }
    for (const fs::path& folder : added_) {
      side.result->addItem(QString::fromStdString(folder.string()), QString::fromStdString(folder.string()));
    }
    side.run->addItem(tr("all runs"), "");
    for (const SnapshotRun& run : snapshot->runs) {
      side.run->addItem(QString::fromStdString(run.name), QString::fromStdString(run.name));
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
  fs::path folders[2];
  std::string runs[2], names[2];
  for (int i = 0; i < 2; ++i) {
    folders[i] = sides_[i].result->currentData().toString().toStdString();
    runs[i] = sides_[i].run->currentData().toString().toStdString();
    names[i] = (sides_[i].result->currentText() + (runs[i].empty() ? "" : " ") + QString::fromStdString(runs[i]))
                   .toStdString();
    sides_[i].source = SourceOfEvaluation(folders[i]);
  }
  if (folders[0].empty() || folders[1].empty()) {
    text_->setPlainText(tr("Nothing to compare yet: there is no evaluation."));
    return;
  }
  InBackground(
      this,
      [a = folders[0], b = folders[1], run_a = runs[0], run_b = runs[1], name_a = names[0], name_b = names[1]] {
        Comparison c;
        std::vector<ErrorRow> rows_a = RowsOf(a, run_a), rows_b = RowsOf(b, run_b);
        if (run_a.empty() != run_b.empty()) throw InputError("a single run is compared with a single run");
        c.rows = ChangedErrors(rows_a, rows_b, -1);
        c.text = FormatComparison(CompareErrors(rows_a, rows_b), name_a, name_b);
        c.differences = DifferencesOf(ManifestIn(a), ManifestIn(b));
        return c;
      },
      [this, generation, single = !runs[0].empty()](const Attempted<Comparison>& compared) {
        if (generation != generation_) return;
        if (!compared.error.isEmpty()) {
          text_->setPlainText(compared.error);
          return;
        }
        const QString unit = workspace_->unit();
        const auto length = [this](const std::optional<double>& metres) {
          return metres ? QString::number(*metres / workspace_->metres_per_unit(), 'f', 4) : QString();
        };
        const QSignalBlocker block(errors_);
        errors_->setSortingEnabled(false);
        errors_->setColumnCount(9);
        errors_->setColumnHidden(2, single);
        errors_->setHorizontalHeaderLabels({tr("reference"), tr("method"), tr("run"), tr("station"), tr("panorama"),
                                            tr("A: 3D error (%1)").arg(unit), tr("B: 3D error (%1)").arg(unit),
                                            tr("B - A (%1)").arg(unit), tr("status A / B")});
        for (const ReviewedError& row : compared.value.rows) {
          const int r = errors_->rowCount();
          errors_->insertRow(r);
          std::optional<double> difference;
          if (row.before_m && row.after_m) difference = *row.after_m - *row.before_m;
          const QString status = QString::fromStdString(
              row.status_before == row.status_after ? row.status_before : row.status_before + " / " + row.status_after);
          const QStringList cells{QString::fromStdString(row.reference),
                                  QString::fromStdString(row.method),
                                  QString::fromStdString(row.run),
                                  QString::fromStdString(row.station),
                                  QString::fromStdString(row.panorama),
                                  length(row.before_m),
                                  length(row.after_m),
                                  length(difference),
                                  status};
          for (int c = 0; c < cells.size(); ++c) {
            auto* item = c >= 5 && c <= 7 ? new NumberItem(cells[c]) : new QTableWidgetItem(cells[c]);
            item->setData(Qt::UserRole, QString::fromStdString("station:" + row.station));
            errors_->setItem(r, c, item);
          }
        }
        errors_->setSortingEnabled(true);
        errors_->resizeColumnsToContents();
        text_->setPlainText(QString::fromStdString(compared.value.text));
        differences_->setColumnCount(3);
        differences_->setHorizontalHeaderLabels({tr("what"), "A", "B"});
        for (const Difference& d : compared.value.differences) {
          const int r = differences_->rowCount();
          differences_->insertRow(r);
          differences_->setItem(r, 0, new QTableWidgetItem(QString::fromStdString(d.what)));
          differences_->setItem(r, 1, new QTableWidgetItem(QString::fromStdString(d.a)));
          differences_->setItem(r, 2, new QTableWidgetItem(QString::fromStdString(d.b)));
        }
        differences_->resizeColumnsToContents();
        if (tabs_->currentWidget() == scenes_) ShowScenes();
        emit Compared();
      });
}

void CompareDesk::ShowScenes() {
  for (int i = 0; i < 2; ++i) {
    Side& side = sides_[i];
    if (side.scene == nullptr) {
      auto* half = new QWidget;
      half->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Expanding);  // both get half
      auto* column = new QVBoxLayout(half);
      column->setContentsMargins(0, 0, 0, 0);
      side.title = new QLabel;
      side.title->setObjectName(QString("compare.title_") + (i == 0 ? "a" : "b"));
      side.scene = new SceneDesk(workspace_, SceneDesk::Kind::kCompact);
      column->addWidget(side.title);
      column->addWidget(side.scene, 1);
      scenes_->layout()->addWidget(half);
    }
    const QString name =
        QString("%1: %2, %3").arg(i == 0 ? "A" : "B", side.result->currentText(), side.run->currentText());
    side.title->setText(side.source ? name : tr("%1 (errors alone, no results to draw)").arg(name));
    side.scene->setVisible(side.source.has_value());
    if (side.source) side.scene->ShowResults(*side.source, side.run->currentData().toString());
  }
  sides_[1].scene->ShareCamera(sides_[0].scene);
}

}  // namespace trigpoint

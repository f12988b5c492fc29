#include "app/desktop/run_desk.h"

#include <QApplication>
#include <QClipboard>
#include <QComboBox>
#include <QFormLayout>
#include <QHeaderView>
#include <QLabel>
#include <QLineEdit>
#include <QListWidget>
#include <QPlainTextEdit>
#include <QProgressBar>
#include <QPushButton>
#include <QSpinBox>
#include <QTabWidget>
#include <QTableWidget>
#include <QTime>
#include <cmath>

#include "app/desktop/calibration_sheet.h"
#include "app/desktop/fitted_box.h"
#include "app/desktop/object_table.h"
#include "app/desktop/question.h"
#include "app/desktop/site_tree.h"
#include "app/desktop/stage_form.h"
#include "app/desktop/stage_graph.h"
#include "app/desktop/widgets.h"
#include "app/pipeline/command_line.h"

namespace trigpoint {

namespace {

constexpr double kLong_s = 60;  // from here on one is asked before something is computed again

// The longest text of a box must not make the window wide.
QComboBox* Narrow(QComboBox* box) {
  box->setSizeAdjustPolicy(QComboBox::AdjustToMinimumContentsLengthWithIcon);
  box->setMinimumContentsLength(24);
  return box;
}

QString TextOf(const ExpectedTime& expected) {
  if (expected.unchecked_s > 0) {
    return RunDesk::tr("How long it takes is not known yet: %1 results are still checked; they took %2.")
        .arg(expected.unchecked)
        .arg(DurationText(expected.unchecked_s));
  }
  if (expected.again == 0) return "";
  QString text = RunDesk::tr("Results that are computed again: %1.").arg(expected.again);
  if (expected.seconds > 0)
    text += " " + RunDesk::tr("The last time that took %1.").arg(DurationText(expected.seconds));
  if (expected.never_made > 0) text += " " + RunDesk::tr("Never made before: %1.").arg(expected.never_made);
  return text;
}

// Nothing is known of a query that is wrong: that is said when it is run.
ExpectedTime ExpectedOf(const Workspace& workspace, const JobQuery& query, quint64 seed) {
  if (!workspace.snapshot()) return {};
  try {
    return ExpectedTimeOf(*workspace.snapshot(), workspace.results(), query, seed);
  } catch (const Error&) {
    return {};
  }
}

}  // namespace

QString DurationText(double seconds) {
  const int s = static_cast<int>(std::lround(seconds));
  return s >= 3600
             ? QString("%1:%2:%3").arg(s / 3600).arg(s / 60 % 60, 2, 10, QChar('0')).arg(s % 60, 2, 10, QChar('0'))
             : QString("%1:%2").arg(s / 60).arg(s % 60, 2, 10, QChar('0'));
}

void StartAsked(QWidget* window, const Workspace& workspace, const JobQuery& query, const std::function<void()>& start,
                quint64 seed) {
  const ExpectedTime expected = ExpectedOf(workspace, query, seed);
  if (expected.seconds + expected.unchecked_s <= kLong_s) return start();
  Ask(window, "run.ask", RunDesk::tr("Run"), TextOf(expected) + "\n" + RunDesk::tr("Run it now?"),
      QMessageBox::Yes | QMessageBox::No, [start](int answer) {
        if (answer == QMessageBox::Yes) start();
      });
}

RunDesk::RunDesk(Workspace* workspace, JobController* jobs, QWidget* parent)
    : QWidget(parent), workspace_(workspace), jobs_(jobs) {
  MakeControls();
  Arrange();
  stage_->addItem(tr("all that is out of date"), "");
  for (const StageInfo* stage : AllStages()) {
    const QString name = Text(stage->name);
    stage_->addItem(name + ": " + Text(stage->help), name);
  }
  connect(stage_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &RunDesk::ShowStage);
  connect(runs_, &QListWidget::itemChanged, this, &RunDesk::ShowCommand);
  connect(variant_, &QComboBox::currentTextChanged, this, &RunDesk::ShowStage);
  connect(threads_, QOverload<int>::of(&QSpinBox::valueChanged), this, &RunDesk::ShowCommand);
  connect(seed_, QOverload<int>::of(&QSpinBox::valueChanged), this, &RunDesk::ShowCommand);
  connect(form_, &StageForm::Changed, this, &RunDesk::ShowCommand);
  connect(copy_, &QPushButton::clicked, this, [this] { QApplication::clipboard()->setText(command_->text()); });
  connect(reset_, &QPushButton::clicked, form_, &StageForm::Reset);
  connect(run_, &QPushButton::clicked, this, &RunDesk::Run);
  connect(cancel_, &QPushButton::clicked, jobs_, &JobController::Cancel);
  connect(cancel_, &QPushButton::clicked, this, [this] { status_->setText(tr("Stopping ...")); });
  ConnectJobs();
  connect(workspace_, &Workspace::Replaced, this, &RunDesk::Forget);
  const auto show_unit = [this] {
    graph_->SetUnit(workspace_->display_unit());
    ShowResults();
  };
  connect(workspace_, &Workspace::UnitChanged, graph_, show_unit);
  connect(workspace_, &Workspace::Opened, this, &RunDesk::Refresh);
  connect(workspace_, &Workspace::Closed, this, &RunDesk::Refresh);
  connect(workspace_, &Workspace::ResultsChanged, this, [this] {
    ShowResults();
    ShowCommand();
  });
  connect(workspace_, &Workspace::StateChanged, this, [this](int result) {
    ShowResult(result);
    graph_->ShowStates(workspace_->results());
  });
  connect(results_, &QTableWidget::cellActivated, this, [this](int row) {
    const SnapshotResult& result = workspace_->results()[static_cast<size_t>(row)];
    Choose(Text(result.stage), Text(result.run), Text(result.variant));
  });
  connect(graph_, &StageGraph::Chosen, this, [this](const QString& stage) { Choose(stage, ""); });
  Refresh();
}

void RunDesk::MakeControls() {
  graph_ = new StageGraph;
  stage_ =
      Narrow(Named(new ElidedBox, "run.stage", tr("Stage"), tr("What is made: one stage, or all that is out of date")));
  runs_ = Named(new QListWidget, "run.runs", tr("Runs"),
                tr("Those that are ticked are run; all ticked: also runs that are added later"));
  runs_->setMaximumHeight(5 * fontMetrics().height());
  variant_ = Named(new QComboBox, "run.variant", tr("Variant"),
                   tr("A second set of results beside the first; empty: the first"));
  variant_->setEditable(true);
  threads_ = Named(new QSpinBox, "run.threads", tr("Threads"),
                   tr("How many threads compute; 0: one for each core. The results do not depend on it"));
  threads_->setRange(0, 4096);
  threads_->setSpecialValueText(tr("all cores"));
  seed_ = Named(new QSpinBox, "run.seed", tr("Seed"),
                tr("Where random numbers begin. Another seed makes every result anew"));
  seed_->setRange(0, 1 << 30);
  seed_->setValue(1);
  form_ = new StageForm;
  scroll_ = Named(Scrolled(form_), "run.form", tr("Options"));
  command_ = ReadOnly(Named(new QLineEdit, "run.command", tr("Equivalent command line")));
  copy_ = Named(new QPushButton(tr("Copy")), "run.copy", tr("Copy the command line"));
  problem_ = Named(new QLabel, "run.problem", tr("What is wrong with the options"));
  problem_->setWordWrap(true);
  run_ = Named(new QPushButton(tr("&Run")), "run.run", tr("Run"));
  cancel_ = Named(new QPushButton(tr("&Cancel")), "run.cancel", tr("Cancel the run"));
  cancel_->setEnabled(false);
  reset_ = Named(new QPushButton(tr("Reset options")), "run.reset", tr("Reset options"));
  bar_ = Named(new QProgressBar, "run.progress", tr("Progress"));
  status_ = Named(new QLabel(tr("Nothing runs.")), "run.status", tr("State of the run"));
  status_->setWordWrap(true);
  log_ = ReadOnly(Named(new QPlainTextEdit, "run.log", tr("Log")));
  log_->setMaximumBlockCount(5000);

  expected_ = Named(new QLabel, "run.expected", tr("How long it took the last time"));
  expected_->setWordWrap(true);
  results_ = Named(new QTableWidget(0, 4), "run.results", tr("Results and their states"));
  results_->setHorizontalHeaderLabels({tr("result"), tr("state"), tr("metric"), tr("time (s)")});
  SetHeaderHelp(results_,
                {tr("stage, and the run, photo set or variant that it is made for"),
                 tr("done, out of date, failed, running, missing, or not needed"),
                 tr("main number of the result; lengths in metres"), tr("seconds that it took the last time")});
  results_->setEditTriggers(QAbstractItemView::NoEditTriggers);
  results_->setSelectionBehavior(QAbstractItemView::SelectRows);
  results_->verticalHeader()->hide();
  results_->verticalHeader()->setDefaultSectionSize(results_->fontMetrics().height() + 6);
  results_->setToolTip(
      tr("In the order in which each needs those above it; Return or a double click chooses the stage"));
}

void RunDesk::Arrange() {
  auto* choice = new QWidget;
  auto* choices = new QFormLayout(choice);
  choices->addRow(tr("Stage"), stage_);
  runs_label_ = new QLabel;
  variant_label_ = new QLabel;
  choices->addRow(runs_label_, runs_);
  choices->addRow(variant_label_, variant_);
  choices->addRow(tr("Threads"), threads_);
  choices->addRow(tr("Seed"), seed_);
  auto* options = new QWidget;
  auto* line = InRow({new QLabel(tr("Command")), {command_, 1}, copy_});
  InColumn({choice, {scroll_, 1}, problem_, expected_, line, InRow({run_, cancel_, {}, reset_})}, options);
  auto* states = Named(new QTabWidget, "run.states", tr("Stages and results"));
  states->addTab(Scrolled(graph_), tr("Stages"));
  states->addTab(results_, tr("Results"));
  auto* below = InSplitter(Qt::Vertical, {states, log_}, {700, 100});
  auto* progress = new QWidget;
  InColumn({status_, bar_, {below, 1}}, progress);
  auto* split = InSplitter(Qt::Horizontal, {options, progress}, {600, 400});
  InColumn({split}, this)->setContentsMargins(0, 0, 0, 0);
}

void RunDesk::ConnectJobs() {
  connect(jobs_, &JobController::Started, this, [this](const QString& command) {
    run_->setEnabled(false);
    cancel_->setEnabled(true);
    bar_->setRange(0, 0);
    Expect();
    Say("$ " + command);
  });
  connect(jobs_, &JobController::Progress, this, &RunDesk::ShowProgress);
  connect(jobs_, &JobController::Log, this, [this](int level, const QString& text) {
    static const char* kLevels[] = {"debug", "info", "warning", "error"};
    if (level > 0) Say(QString(kLevels[level]) + ": " + text);
  });
  connect(jobs_, &JobController::JobBegan, this, [this](const QString& job) {
    job_ = job.toStdString();
    since_.start();
  });
  connect(jobs_, &JobController::JobEnded, this, [this](const QString& job, const QString& end, const QString& why) {
    pending_.erase(job.toStdString());
    Say(Whose() + job + ": " + end + (why.isEmpty() ? "" : ": " + why));
  });
  connect(jobs_, &JobController::Finished, this, &RunDesk::ShowEnd);
}

void RunDesk::ShowResults() {
  results_->setRowCount(0);
  for (const SnapshotResult& result : workspace_->results()) {
    const int row = results_->rowCount();
    results_->insertRow(row);
    const QStringList cells{Text(result.title), TextOfState(result.state),
                            Text(result.metric.Text(workspace_->display_unit())),
                            result.seconds > 0 ? QString::number(result.seconds, 'f', 1) : QString()};
    for (int c = 0; c < cells.size(); ++c) {
      auto* item = new QTableWidgetItem(cells[c]);
      if (c == 3) item->setTextAlignment(static_cast<int>(Qt::AlignRight | Qt::AlignVCenter));
      results_->setItem(row, c, item);
    }
    ShowResult(row);
  }
  results_->resizeColumnsToContents();
  const auto& snapshot = workspace_->snapshot();
  graph_->Show(snapshot ? StageBoxesOf(*snapshot->project, workspace_->results()) : std::vector<StageBox>());
}

void RunDesk::ShowResult(int result) {
  const SnapshotResult& shown = workspace_->results()[static_cast<size_t>(result)];
  for (int c = 0; c < results_->columnCount(); ++c) {
    results_->item(result, c)->setToolTip(Text(shown.reason));
  }
  results_->item(result, 1)->setText(TextOfState(shown.state));
  results_->item(result, 1)->setForeground(ColourOfState(shown.state));
}

void RunDesk::Choose(const QString& stage, const QString& run, const std::optional<QString>& variant) {
  stage_->setCurrentIndex(std::max(0, stage_->findData(stage)));
  if (variant) variant_->setCurrentText(*variant);
  if (stage.isEmpty()) seed_->setValue(1);  // another one would make all anew
  for (int i = 0; i < runs_->count(); ++i) {
    const bool on = run.isEmpty() || runs_->item(i)->text() == run;
    runs_->item(i)->setCheckState(on ? Qt::Checked : Qt::Unchecked);
  }
}

JobQuery RunDesk::Query() const {
  JobQuery query;
  const std::string stage = stage_->currentData().toString().toStdString();
  if (!stage.empty()) query.stages = {stage};
  int checked = 0;
  for (int i = 0; i < runs_->count(); ++i) {
    if (runs_->item(i)->checkState() != Qt::Checked) continue;
    ++checked;
    query.runs.push_back(runs_->item(i)->text().toStdString());
  }
  if (checked == runs_->count()) query.runs.clear();
  const std::string variant = variant_->currentText().trimmed().toStdString();
  query.variants = {variant};
  if (stage == "calibrate") query.runs = {variant.empty() ? "cam" : variant}, query.variants = {""};
  if (stage.empty() && variant.empty() && workspace_->snapshot()) {
    for (const auto& [name, stages] : workspace_->snapshot()->project->variants().items()) {
      query.variants.push_back(name);
    }
  }
  if (!stage.empty()) {
    const nlohmann::json changes = form_->Changes();
    if (!changes.empty()) query.overrides[stage] = changes;
  }
  return query;
}

void RunDesk::Refresh() {
  const auto& snapshot = workspace_->snapshot();
  setEnabled(snapshot != nullptr);
  form_->SetFolder(workspace_->dir());
  ListNames();
  ShowResults();
  ShowStage();
}

void RunDesk::Forget() {
  form_->Reset();
  edits_.clear();
  const QSignalBlocker block(variant_);
  variant_->clearEditText();
  runs_->clear();
  if (jobs_->running()) return;  // another project's run goes on, and says whose it is
  log_->clear();
  status_->setText(tr("Nothing runs."));
  bar_->setRange(0, 1000);
  bar_->setValue(0);
}

void RunDesk::ListNames() {
  const QString stage = stage_->currentData().toString();
  const bool stitch = stage == "stitch", calibrate = stage == "calibrate";
  const bool same = stage == listed_ || !(stitch || calibrate || listed_ == "stitch" || listed_ == "calibrate");
  listed_ = stage;
  QStringList unchecked;
  for (int i = 0; same && i < runs_->count(); ++i) {
    if (runs_->item(i)->checkState() != Qt::Checked) unchecked << runs_->item(i)->text();
  }
  const QSignalBlocker block_runs(runs_), block_variant(variant_);
  const QString variant = same ? variant_->currentText() : QString();
  runs_->clear();
  variant_->clear();
  runs_label_->setText(stitch ? tr("Photo sets") : tr("Runs"));
  variant_label_->setText(calibrate ? tr("Name") : tr("Variant"));
  runs_->setEnabled(!calibrate);
  variant_->setEnabled(!stitch);
  const auto& snapshot = workspace_->snapshot();
  if (!snapshot) return;
  const auto add = [&](const std::string& name, const std::string& broken) {
    auto* item = new QListWidgetItem(Text(name), runs_);
    item->setFlags(item->flags() | Qt::ItemIsUserCheckable);
    item->setCheckState(unchecked.contains(item->text()) ? Qt::Unchecked : Qt::Checked);
    item->setToolTip(Text(broken));
  };
  for (const SnapshotReference& reference : snapshot->references) {
    if (stitch && reference.kind == "photo set") add(reference.name, "");
  }
  for (const SnapshotRun& run : snapshot->runs) {
    if (!stitch && !calibrate) add(run.name, run.broken);
  }
  if (calibrate) {
    for (const std::string& name : CalibrationNames(snapshot->dir / "results")) {
      variant_->addItem(Text(name));
    }
  } else {
    for (const std::string& name : snapshot->variants) variant_->addItem(Text(name));
  }
  variant_->setCurrentText(variant);
}

void RunDesk::ShowStage() {
  if (stage_->currentData().toString() != listed_) ListNames();
  const std::string stage = stage_->currentData().toString().toStdString();
  form_->setVisible(!stage.empty());
  if (!stage.empty() && workspace_->snapshot()) {
    nlohmann::json values;
    try {
      const StageInfo& info = StageNamed(stage);
      StageTarget target;
      const auto& runs = workspace_->snapshot()->runs;
      for (const SnapshotRun& run : runs) {
        if (run.broken.empty() && target.run.empty()) target.run = run.name;
      }
      if (stage == "stitch" || stage == "calibrate") throw OptionError("these have no runs");
      target.variant = info.variants ? variant_->currentText().trimmed().toStdString() : "";
      values = MakeRequest(*workspace_->snapshot()->project, info, target).options;
    } catch (const Error&) {  // what is wrong with the project is shown when it is opened; the defaults serve here
    }
    // What is typed outlasts a run, a reload, another variant, and another stage.
    edits_[form_->stage()] = form_->Edits();
    form_->SetStage(stage, values);
    form_->Restore(edits_[stage]);
  }
  ShowCommand();
}

void RunDesk::ShowCommand() {
  if (!workspace_->snapshot()) {
    command_->clear();
    return;
  }
  std::vector<std::string> problems;
  if (!stage_->currentData().toString().isEmpty()) problems = form_->Problems();
  QString text;
  for (const std::string& problem : problems) text += (text.isEmpty() ? "" : "\n") + Text(problem);
  problem_->setText(text);
  problem_->setVisible(!text.isEmpty());
  run_->setEnabled(problems.empty() && !jobs_->running());
  const JobQuery query = Query();
  const QString expected = TextOf(ExpectedOf(*workspace_, query, static_cast<quint64>(seed_->value())));
  expected_->setText(expected);
  expected_->setVisible(!expected.isEmpty());
  command_->setText(Text(
      CommandLine(workspace_->dir().toStdString(), query, threads_->value(), static_cast<uint64_t>(seed_->value()))));
}

void RunDesk::Expect() {
  job_.clear();
  const ExpectedTime expected = ExpectedOf(*workspace_, jobs_->query(), jobs_->seed());
  pending_ = expected.of_job;
  at_least_ = expected.never_made + expected.unchecked > 0;
}

QString RunDesk::LeftText(double job_s) const {
  double left_s = 0;
  for (const auto& [job, seconds] : pending_) {
    left_s += job == job_ ? std::max(0.0, seconds - 1e-3 * static_cast<double>(since_.elapsed())) : seconds;
  }
  if (left_s <= std::max(0.0, job_s)) return "";
  return (at_least_ ? tr("; of all at least %1") : tr("; of all about %1")).arg(DurationText(left_s));
}

void RunDesk::Run() {
  if (!workspace_->snapshot() || !run_->isEnabled()) return;
  const auto seed = static_cast<quint64>(seed_->value());
  StartAsked(
      this, *workspace_, Query(), [this, seed] { jobs_->Start(workspace_->dir(), Query(), threads_->value(), seed); },
      seed);
}

void RunDesk::ShowProgress(const QString& job, const QString& task, qint64 done, qint64 total, double seconds_left) {
  bar_->setRange(0, total > 0 ? 1000 : 0);
  if (total > 0) bar_->setValue(static_cast<int>(1000 * done / total));
  QString text = Whose() + job + ": " + task;
  if (total > 0) text += tr(", %1 of %2").arg(done).arg(total);
  if (seconds_left >= 0) text += tr(", %1 left").arg(DurationText(seconds_left));
  status_->setText(text + LeftText(seconds_left));
}

void RunDesk::ShowEnd(JobController::End end, const QString& error) {
  cancel_->setEnabled(false);
  pending_.clear();
  bar_->setRange(0, 1000);
  bar_->setValue(end == JobController::End::kDone ? 1000 : 0);
  switch (end) {
    case JobController::End::kDone: status_->setText(Whose() + tr("Done.")); break;
    case JobController::End::kCancelled: status_->setText(Whose() + tr("Cancelled; finished stages are kept.")); break;
    case JobController::End::kFailed:
      status_->setText(Whose() + tr("Failed: %1").arg(error));
      emit workspace_->Problem(Whose() + error, log_->toPlainText());
      break;
  }
  Say(status_->text());
  ShowCommand();
}

QString RunDesk::Whose() const {
  const QString of = jobs_->OtherProject(workspace_->dir());
  return of.isEmpty() ? QString() : tr("Project %1: ").arg(of);
}

void RunDesk::Say(const QString& line) { log_->appendPlainText(QTime::currentTime().toString("HH:mm:ss ") + line); }

}  // namespace trigpoint

#include "app/desktop/review_desk.h"

#include <QCheckBox>
#include <QComboBox>
#include <QFormLayout>
#include <QHeaderView>
#include <QLineEdit>
#include <QPushButton>
#include <QTableWidget>

#include "app/desktop/decisions.h"
#include "app/desktop/fitted_box.h"
#include "app/desktop/object_table.h"
#include "app/desktop/report_text.h"
#include "app/desktop/run_desk.h"
#include "app/desktop/views_box.h"
#include "app/desktop/widgets.h"
#include "app/pipeline/jobs.h"
#include "eval/errors/changed_errors.h"
#include "eval/text/method_name.h"

namespace trigpoint {

namespace {

constexpr double kLeastChange_m = 5e-5;  // what four decimals show

void AddRow(QTableWidget* table, const QStringList& cells, const QString& object, bool dim) {
  const int row = table->rowCount();
  table->insertRow(row);
  for (int c = 0; c < cells.size(); ++c) {
    auto* item = new QTableWidgetItem(cells[c]);
    item->setData(Qt::UserRole, object);
    if (dim) item->setForeground(Qt::gray);
    table->setItem(row, c, item);
  }
}

}  // namespace

ReviewDesk::ReviewDesk(Workspace* workspace, JobController* jobs, Decisions* decisions, QWidget* parent)
    : QWidget(parent), workspace_(workspace), jobs_(jobs), decisions_(decisions) {
  object_ = Named(new QLineEdit, "review.object", tr("Object"),
                  tr("What the decision is about; what is selected on any desk is entered here"));
  object_->setPlaceholderText(tr("station:S57, detection:run1/images/000012.jpg#57, ... or select one elsewhere"));
  reason_ = Named(new QLineEdit, "review.reason", tr("Reason"), tr("Why; kept with the decision in review.jsonl"));
  user_ = Named(new QLineEdit, "review.user", tr("User"),
                tr("Who decides; kept with the decision. Empty: the name of your login"));
  user_->setPlaceholderText(tr("you"));
  exclude_ = MakeButton("review.exclude", tr("&Exclude"), tr("Leave it out of what is solved and evaluated"));
  restore_ = MakeButton("review.restore", tr("&Restore"), tr("Take it in again"));
  role_ = MakeButton("review.role", tr("Change &role"), tr("Control point to check point, or back"));
  undo_ =
      MakeButton("review.undo", tr("&Undo last"), tr("Take the last decision back (Ctrl+Z, where no text is written)"));
  redo_ = MakeButton("review.redo", tr("Re&do"), tr("Make the decision again that was taken back last (Ctrl+Shift+Z)"));
  solve_ = MakeButton("review.solve", tr("Re-&solve"), tr("Make every result anew that rests on the review"));
  variant_ = Named(new FittedBox(tr("Variant whose results are made anew and compared")), "review.variant",
                   tr("Variant to solve"));
  entries_ = MakeTable("review.entries", tr("Decisions"),
                       {tr("entry"), tr("time (UTC)"), tr("user"), tr("action"), tr("object"), tr("reason")});
  changes_ = MakeTable("review.changes", tr("What changed"),
                       {tr("reference"), tr("answer"), tr("run"), tr("station"), tr("before"), tr("after"),
                        QString::fromUtf8("\xcf\x83"), tr("status before"), tr("status after")});
  SetHeaderHelp(entries_, {tr("number of the decision in review.jsonl"), tr("when it was decided, UTC"),
                           tr("who decided"), tr("exclude, restore, role or undo"), tr("what it is about"),
                           tr("why; gray rows are no longer in force")});
  SetHeaderHelp(changes_,
                {tr("what the answers are compared with"), tr("how the answer was made: panorama (G2) or view (G1)"),
                 tr("run that the panorama was localized against"), tr("station or check point"),
                 tr("3D error before the decisions"), tr("3D error after re-solving"),
                 tr("1 sigma of the error in space, the larger of the two"),
                 tr("localized, refused, no match or no reference: before the decisions"),
                 tr("localized, refused, no match or no reference: after re-solving")});
  for (QTableWidget* table : {entries_, changes_}) {
    table->horizontalHeader()->setSectionResizeMode(QHeaderView::ResizeToContents);
    table->verticalHeader()->setDefaultSectionSize(table->fontMetrics().height() + 6);
  }
  auto* form = new QFormLayout;
  form->addRow(tr("Object"), object_);
  form->addRow(tr("Reason"), reason_);
  form->addRow(tr("User"), user_);
  auto* buttons = InFlow({exclude_, restore_, role_, undo_, redo_, variant_, solve_});
  auto* split = InSplitter(Qt::Vertical, {entries_, MakeChanges()});
  body_ = Pane({form, buttons, {split, 1}});
  empty_ = WrappedLabel("review.empty", tr("Open a project (Ctrl+O) to exclude and restore what its results rest on."));
  InColumn({empty_, {body_, 1}}, this);

  Connect();
  Refresh();
}

QWidget* ReviewDesk::MakeChanges() {
  small_changes_ = MakeCheckBox("review.small", tr("changes within 1 sigma, too"));
  views_ = MakeViewsBox("review.views");
  summary_ =
      WrappedLabel("review.summary", tr("Re-solve to see what the review changes at stations and check points."));
  return Pane({summary_, InFlow({small_changes_, views_}), {changes_, 1}});
}

void ReviewDesk::Connect() {
  connect(exclude_, &QPushButton::clicked, this, [this] { Decide("exclude"); });
  connect(restore_, &QPushButton::clicked, this, [this] { Decide("restore"); });
  connect(role_, &QPushButton::clicked, this, [this] { Decide("role"); });
  connect(undo_, &QPushButton::clicked, decisions_, &Decisions::Undo);
  connect(redo_, &QPushButton::clicked, decisions_, &Decisions::Redo);
  connect(user_, &QLineEdit::textChanged, decisions_, &Decisions::SetUser);
  connect(decisions_, &Decisions::Decided, this, [this] {
    const auto& entries = workspace_->snapshot()->project->review().entries();
    const bool taken = !entries.empty() && entries.back().reason == reason_->text().trimmed().toStdString();
    if (taken) reason_->clear();
    const bool back = !entries.empty() && (entries.back().action == "undo" || decisions_->again());
    if (back && !solved_state_.empty() && StateInForce() == earlier_state_) {
      const JobQuery query = ReviewQuery(variant_->currentData().toString().toStdString());
      AreKept(*workspace_->snapshot(), query) ? StartSolving() : Solve();
    }
    emit Reviewed();
  });
  connect(decisions_, &Decisions::Changed, this, [this] {
    undo_->setEnabled(!decisions_->UndoText().isEmpty());
    redo_->setEnabled(!decisions_->RedoText().isEmpty());
  });
  connect(solve_, &QPushButton::clicked, this, &ReviewDesk::Solve);
  for (QCheckBox* box : {small_changes_, views_}) connect(box, &QCheckBox::toggled, this, &ReviewDesk::ShowChanges);
  for (QTableWidget* table : {entries_, changes_}) LinkTable(table, workspace_);
  connect(workspace_, &Workspace::Selected, this, [this](const QString& object) {
    if (!object.isEmpty()) object_->setText(object);
  });
  connect(workspace_, &Workspace::Replaced, this, &ReviewDesk::Forget);
  connect(workspace_, &Workspace::Opened, this, &ReviewDesk::Refresh);
  connect(workspace_, &Workspace::Closed, this, &ReviewDesk::Refresh);
  connect(workspace_, &Workspace::UnitChanged, this, &ReviewDesk::ShowChanges);
  connect(jobs_, &JobController::Started, this, [this] { solve_->setEnabled(false); });
  connect(jobs_, &JobController::Finished, this, [this](JobController::End end, const QString& error) {
    solve_->setEnabled(true);
    if (!solving_) return;
    solving_ = false;
    if (end == JobController::End::kCancelled) {
      summary_->setText(tr("Cancelled."));
      return;
    }
    solved_ = true;
    failure_ = end == JobController::End::kFailed ? error : QString();
    ShowChanges();
    emit Solved();
  });
}

ReviewDesk::~ReviewDesk() = default;

void ReviewDesk::Forget() {
  before_.clear();
  solved_state_.clear();
  earlier_state_.clear();
  opened_.clear();
  solving_ = solved_ = false;
  changes_->setRowCount(0);
  summary_->setText(tr("Re-solve to see what the review changes at stations and check points."));
  object_->clear();
  reason_->clear();
}

void ReviewDesk::Decide(const char* action) {
  if (reason_->text().trimmed().isEmpty()) reason_->setFocus();
  decisions_->Decide(action, object_->text().trimmed(), reason_->text());
}

void ReviewDesk::Solve() {
  if (!workspace_->snapshot() || jobs_->running()) return;
  StartAsked(this, *workspace_, ReviewQuery(variant_->currentData().toString().toStdString()),
             [this] { StartSolving(); });
}

void ReviewDesk::StartSolving() {
  if (!workspace_->snapshot() || jobs_->running()) return;
  solving_variant_ = variant_->currentData().toString().toStdString();
  before_ = ErrorsOf(*workspace_->snapshot()->project, solving_variant_);
  solving_ = true;
  solved_ = false;
  const std::string state = StateInForce();
  if (state != solved_state_) {
    earlier_state_ = solved_state_.empty() ? opened_state_ : solved_state_;
    solved_state_ = state;
  }
  const double seconds =
      ExpectedTimeOf(*workspace_->snapshot(), workspace_->results(), ReviewQuery(solving_variant_)).seconds;
  summary_->setText(tr("Solving ...") +
                    (seconds > 1 ? " " + tr("The last time it took %1.").arg(DurationText(seconds)) : ""));
  changes_->setRowCount(0);
  jobs_->Start(workspace_->dir(), ReviewQuery(solving_variant_), 0, 1);
}

void ReviewDesk::Refresh() {
  entries_->setRowCount(0);
  const auto& snapshot = workspace_->snapshot();
  empty_->setVisible(snapshot == nullptr);
  body_->setEnabled(snapshot != nullptr);
  const QSignalBlocker block(variant_);
  const QString before = variant_->currentData().toString();
  variant_->clear();
  if (!snapshot) return;
  if (opened_ != snapshot->dir) opened_ = snapshot->dir, opened_state_ = StateInForce();
  for (const std::string& name : snapshot->variants) {
    variant_->addItem(name.empty() ? tr("first results") : Text(name), Text(name));
  }
  variant_->setCurrentIndex(std::max(0, variant_->findData(before)));
  for (const ReviewEntry& entry : snapshot->project->review().entries()) {
    QString action = Text(entry.action);
    if (entry.action == "role") action = tr("role %1").arg(Text(entry.role));
    if (entry.action == "undo") action = tr("undo %1").arg(entry.undoes);
    AddRow(entries_,
           {QString::number(entry.number), Text(entry.time), Text(entry.user), action, Text(entry.object),
            Text(entry.reason)},
           Text(entry.object), !entry.in_force);
  }
  entries_->scrollToBottom();
}

void ReviewDesk::ShowChanges() {
  if (!workspace_->snapshot() || !solved_) return;
  changes_->setRowCount(0);
  QString said = failure_.isEmpty() ? QString() : tr("Failed: %1").arg(failure_) + "\n";
  if (before_.empty()) {
    if (said.isEmpty()) said = tr("Solved. There was no evaluation before, so nothing is compared.");
    return summary_->setText(said.trimmed());
  }
  const auto text = [this](const std::optional<double>& metres) {
    return metres ? workspace_->Length(*metres, 4) : QString("-");
  };
  auto changed = ChangedErrors(before_, ErrorsOf(*workspace_->snapshot()->project, solving_variant_), kLeastChange_m);
  if (!views_->isChecked()) std::erase_if(changed, [](const ReviewedError& row) { return row.method == "g1"; });
  size_t small = 0;
  for (const ReviewedError& row : changed) {
    small += row.WithinSigma() ? 1 : 0;
    if (row.WithinSigma() && !small_changes_->isChecked()) continue;
    AddRow(changes_,
           {ReportText(ReferenceName(row.reference)), ReportText(MethodName(row.method)), Text(row.run),
            Text(row.station), text(row.before_m), text(row.after_m), text(row.sigma_m),
            ReportText(StatusName(row.status_before)), ReportText(StatusName(row.status_after))},
           Text("station:" + row.station), false);
  }
  if (changed.empty()) {
    said += failure_.isEmpty() ? tr("Nothing changed at stations and check points.")
                               : tr("The results at stations and check points are still those of before.");
  } else {
    said += tr("3D errors that changed by more than their 1 sigma, or in status: %1; by less: %2.")
                .arg(changed.size() - small)
                .arg(small);
  }
  summary_->setText(said);
}

std::string ReviewDesk::StateInForce() const {
  return workspace_->snapshot() ? workspace_->snapshot()->project->review().InForce(ReviewKinds(), "").dump() : "";
}

}  // namespace trigpoint

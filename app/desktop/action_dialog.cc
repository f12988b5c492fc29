#include "app/desktop/action_dialog.h"

#include <QLabel>
#include <QLineEdit>
#include <QPlainTextEdit>
#include <QPushButton>
#include <QTimer>

#include "app/desktop/background.h"
#include "app/desktop/path_button.h"
#include "app/desktop/polled_progress.h"
#include "app/desktop/widgets.h"
#include "app/pipeline/command_line.h"

namespace trigpoint {

namespace {

constexpr int kLook_ms = 100;  // between two looks at how far it is

}  // namespace

ActionDialog::ActionDialog(Workspace* workspace, Action action, QWidget* parent)
    : QDialog(parent), workspace_(workspace), action_(std::move(action)) {
  setObjectName("action." + Text(action_.command));
  setWindowTitle(action_.title);
  setAttribute(Qt::WA_DeleteOnClose);
  auto* intro = new QLabel(action_.intro);
  intro->setWordWrap(true);
  form_ = new StageForm;
  auto* scroll = Scrolled(form_);
  scroll->setAccessibleName(tr("Options"));
  command_ = ReadOnly(Named(new QLineEdit, "action.line", tr("Equivalent command line")));
  status_ = WrappedLabel("action.status");
  outcome_ = ReadOnly(Named(new QPlainTextEdit, "action.outcome", tr("Result")));
  outcome_->setMaximumHeight(8 * fontMetrics().height());
  outcome_->hide();
  run_ = MakeButton("action.run", action_.title);
  run_->setDefault(true);
  cancel_ = MakeButton("action.cancel", tr("Cancel"));
  cancel_->setEnabled(false);
  auto* close = MakeButton("action.close", tr("Close"));
  InColumn({intro, {scroll, 1}, command_, outcome_, InRow({{status_, 1}, run_, cancel_, close})}, this);
  resize(640, 620);
  timer_ = new QTimer(this);
  timer_->setInterval(kLook_ms);
  connect(timer_, &QTimer::timeout, this, [this] {
    if (work_) status_->setText(work_->Text());
  });
  connect(form_, &StageForm::Changed, this, &ActionDialog::ShowCommand);
  connect(run_, &QPushButton::clicked, this, &ActionDialog::Run);
  connect(cancel_, &QPushButton::clicked, this, [this] {
    if (work_) work_->cancel.Cancel();
  });
  connect(close, &QPushButton::clicked, this, &QDialog::close);
  connect(workspace_, &Workspace::Replaced, this, &QDialog::close);
  form_->SetFolder(workspace_->dir());
  form_->SetOptions(action_.options, nlohmann::json::object(), action_.check);
}

ActionDialog::~ActionDialog() {
  if (work_) work_->cancel.Cancel();
}

nlohmann::json ActionDialog::Values() const {
  nlohmann::json values = form_->Changes();
  for (const OptionDescription& option : action_.options) {
    if (option.name == action_.required && !values.contains(option.name) && option.default_value != "") {
      values[option.name] = option.default_value;
    }
    if (option.path == PathKind::kNone || !values.contains(option.name)) continue;
    const QString path = Text(values[option.name].get<std::string>());
    if (path.startsWith("gpg:")) continue;  // the name of a key
    values[option.name] = AbsolutePath(workspace_->dir(), path).toStdString();
  }
  return values;
}

void ActionDialog::ShowCommand() {
  std::string line = "trigpoint " + action_.command + " " + ShellWord(workspace_->dir().toStdString());
  const nlohmann::json values = Values();
  for (const auto& [name, value] : values.items()) {
    line += " --" + Text(name).replace('_', '-').toStdString();
    if (!value.is_boolean()) line += " " + ShellWord(value.is_string() ? value.get<std::string>() : value.dump());
  }
  command_->setText(Text(line));
  run_->setEnabled(!work_ && form_->Problems().empty());
}

void ActionDialog::Run() {
  if (work_ || !workspace_->snapshot()) return;
  work_ = std::make_shared<PolledProgress>();
  cancel_->setEnabled(true);
  status_->setText(tr("Working ..."));
  timer_->start();
  ShowCommand();
  InBackground(
      this,
      [work = work_, run = action_.run, dir = workspace_->snapshot()->dir, values = Values()] {
        return run(dir, values, *work, work->cancel);
      },
      [this](const Attempted<std::string>& outcome) {
        const bool well = outcome.error.isEmpty();
        work_.reset();
        timer_->stop();
        cancel_->setEnabled(false);
        status_->setText(well ? tr("Done.") : tr("Not done."));
        outcome_->setPlainText(well ? Text(outcome.value) : outcome.error);
        outcome_->show();
        ShowCommand();
        if (well) workspace_->Reload();
        emit Done(well);
      });
}

}  // namespace trigpoint

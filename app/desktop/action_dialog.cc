#include "app/desktop/action_dialog.h"

#include <QHBoxLayout>
#include <QLabel>
#include <QLineEdit>
#include <QPlainTextEdit>
#include <QPushButton>
#include <QScrollArea>
#include <QTimer>
#include <QVBoxLayout>

#include "app/desktop/background.h"
#include "app/desktop/path_button.h"
#include "app/desktop/polled_progress.h"
#include "app/pipeline/command_line.h"

namespace trigpoint {

namespace {

constexpr int kLook_ms = 100;  // between two looks at how far it is

}  // namespace

ActionDialog::ActionDialog(Workspace* workspace, Action action, QWidget* parent)
    : QDialog(parent), workspace_(workspace), action_(std::move(action)) {
  setObjectName("action." + QString::fromStdString(action_.command));
  setWindowTitle(action_.title);
  setAttribute(Qt::WA_DeleteOnClose);
  auto* intro = new QLabel(action_.intro);
  intro->setWordWrap(true);
  form_ = new StageForm;
  auto* scroll = new QScrollArea;
  scroll->setAccessibleName(tr("Options"));
  scroll->setWidget(form_);
  scroll->setWidgetResizable(true);
  command_ = new QLineEdit;
  command_->setObjectName("action.line");
  command_->setAccessibleName(tr("Equivalent command line"));
  command_->setReadOnly(true);
  status_ = new QLabel;
  status_->setObjectName("action.status");
  status_->setWordWrap(true);
  outcome_ = new QPlainTextEdit;
  outcome_->setObjectName("action.outcome");
  outcome_->setAccessibleName(tr("Result"));
  outcome_->setReadOnly(true);
  outcome_->setMaximumHeight(8 * fontMetrics().height());
  outcome_->hide();
  run_ = new QPushButton(action_.title);
  run_->setObjectName("action.run");
  run_->setDefault(true);
  cancel_ = new QPushButton(tr("Cancel"));
  cancel_->setObjectName("action.cancel");
  cancel_->setEnabled(false);
  auto* close = new QPushButton(tr("Close"));
  close->setObjectName("action.close");
  auto* buttons = new QHBoxLayout;
  buttons->addWidget(status_, 1);
  for (QPushButton* button : {run_, cancel_, close}) buttons->addWidget(button);
  auto* column = new QVBoxLayout(this);
  column->addWidget(intro);
  column->addWidget(scroll, 1);
  column->addWidget(command_);
  column->addWidget(outcome_);
  column->addLayout(buttons);
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
    const QString path = QString::fromStdString(values[option.name].get<std::string>());
    if (path.startsWith("gpg:")) continue;  // the name of a key
    values[option.name] = AbsolutePath(workspace_->dir(), path).toStdString();
  }
  return values;
}

void ActionDialog::ShowCommand() {
  std::string line = "trigpoint " + action_.command + " " + ShellWord(workspace_->dir().toStdString());
  const nlohmann::json values = Values();
  for (const auto& [name, value] : values.items()) {
    line += " --" + QString::fromStdString(name).replace('_', '-').toStdString();
    if (!value.is_boolean()) line += " " + ShellWord(value.is_string() ? value.get<std::string>() : value.dump());
  }
  command_->setText(QString::fromStdString(line));
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
        outcome_->setPlainText(well ? QString::fromStdString(outcome.value) : outcome.error);
        outcome_->show();
        ShowCommand();
        if (well) workspace_->Reload();
        emit Done(well);
      });
}

}  // namespace trigpoint

// A form of what a menu does, and what came of it. Works in the background; the window stays usable.
#pragma once

#include <QDialog>
#include <memory>

#include "app/desktop/actions.h"
#include "app/desktop/workspace.h"

class QLabel;
class QLineEdit;
class QPlainTextEdit;
class QPushButton;
class QTimer;

namespace trigpoint {

class PolledProgress;

class ActionDialog : public QDialog {
  Q_OBJECT

 public:
  // Of the project that is open.
  ActionDialog(Workspace* workspace, Action action, QWidget* parent);
  ~ActionDialog() override;  // cancels what goes on

 signals:
  void Done(bool well);

 private:
  void Run();
  void ShowCommand();
  // What is run, and what the command line states: paths as they are wherever it is typed.
  nlohmann::json Values() const;

  Workspace* workspace_;
  Action action_;
  StageForm* form_;
  QLineEdit* command_;
  QLabel* status_;
  QPlainTextEdit* outcome_;
  QPushButton *run_, *cancel_;
  QTimer* timer_;
  std::shared_ptr<PolledProgress> work_;  // that goes on
};

}  // namespace trigpoint

// Is what was recorded enough, while one is still on site? Looks at the project's folder once, or as pictures are
// copied into it: findings, what to photograph next, tags, a map.
#pragma once

#include <QWidget>
#include <memory>

#include "app/desktop/workspace.h"

class QLabel;
class QPushButton;
class QSplitter;
class QTableWidget;
class QThread;
class QTimer;

namespace trigpoint {

class PictureView;
class PolledProgress;
struct CheckOutcome;

class CheckDesk : public QWidget {
  Q_OBJECT

 public:
  explicit CheckDesk(Workspace* workspace, QWidget* parent = nullptr);
  ~CheckDesk() override;  // ends what goes on

  // Of the open project; `watch`: until Stop. Nothing where one goes on.
  void Start(bool watch);
  void Stop();
  bool running() const { return thread_ != nullptr; }
  // The last judgement; null: none yet.
  const std::shared_ptr<const CheckOutcome>& outcome() const { return outcome_; }
  PictureView* map() const { return map_; }

 signals:
  void Judged();  // a judgement is shown
  void Ended();

 protected:
  void resizeEvent(QResizeEvent* event) override;
  void changeEvent(QEvent* event) override;

 private:
  void MakeWidgets();
  void Show();
  void Take(std::shared_ptr<const CheckOutcome> outcome);  // and have the others read what is new
  void ShowTags();
  void ShowButtons();
  void OpenPage();

  Workspace* workspace_;
  QLabel *headline_, *status_;
  QPushButton *check_, *watch_, *stop_, *page_;
  QTableWidget *next_, *findings_, *tags_;
  PictureView* map_;
  QSplitter* split_;
  QTimer* timer_;
  QThread* thread_ = nullptr;
  std::shared_ptr<PolledProgress> work_;
  std::shared_ptr<const CheckOutcome> outcome_;
  size_t known_ = 0;  // pictures that the other desks know of, or were told to look for
};

}  // namespace trigpoint

// A problem in one readable sentence, with 'details' and 'copy', in the window's status bar: nothing pops up, nothing
// blocks, and nothing that one is about to click moves.
#pragma once

#include <QFrame>
#include <QPointer>

class QLabel;
class QPlainTextEdit;
class QPushButton;

namespace trigpoint {

class ProblemBar : public QFrame {
  Q_OBJECT

 public:
  explicit ProblemBar(QWidget* parent = nullptr);
  void Show(const QString& sentence, const QString& details);
  const QString& sentence() const { return sentence_; }

 protected:
  void resizeEvent(QResizeEvent* event) override;
  void hideEvent(QHideEvent* event) override;
  bool eventFilter(QObject* watched, QEvent* event) override;

 private:
  void ShowSentence();  // as much of it as there is room for
  void PlaceDetails();

  QString sentence_;
  QLabel* label_;
  QPointer<QPlainTextEdit> details_;  // over the window's lower part, above the bar
  QPushButton* more_;
};

}  // namespace trigpoint

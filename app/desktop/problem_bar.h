// A problem in one readable sentence, with 'details' and 'copy', above the desks: nothing pops up and nothing blocks.
#pragma once

#include <QFrame>

class QLabel;
class QPlainTextEdit;
class QPushButton;

namespace trigpoint {

class ProblemBar : public QFrame {
  Q_OBJECT

 public:
  explicit ProblemBar(QWidget* parent = nullptr);
  void Show(const QString& sentence, const QString& details);
  QString sentence() const;

 private:
  QLabel* sentence_;
  QPlainTextEdit* details_;
  QPushButton* more_;
};

}  // namespace trigpoint

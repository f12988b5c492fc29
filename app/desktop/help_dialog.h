// Keys and words: every shortcut of the menus as they are, the keys of the views, and what terms and colours mean.
#pragma once

#include <QDialog>

class QMenuBar;

namespace trigpoint {

class HelpDialog : public QDialog {
  Q_OBJECT

 public:
  HelpDialog(const QMenuBar* menus, QWidget* parent);
};

}  // namespace trigpoint

// A box as wide as its longest text, up to a limit. Its tooltip is what it is for, and the text that is chosen.
#pragma once

#include <QComboBox>
#include <QHelpEvent>
#include <QToolTip>

namespace trigpoint {

class FittedBox : public QComboBox {
 public:
  explicit FittedBox(const QString& help) {
    constexpr int kWidest = 45;  // characters
    setSizeAdjustPolicy(QComboBox::AdjustToContents);
    setMaximumWidth(kWidest * fontMetrics().averageCharWidth());
    setToolTip(help);
  }

 protected:
  bool event(QEvent* event) override {
    if (event->type() != QEvent::ToolTip || currentText().isEmpty()) return QComboBox::event(event);
    QToolTip::showText(static_cast<QHelpEvent*>(event)->globalPos(), toolTip() + "\n" + currentText(), this);
    return true;
  }
};

}  // namespace trigpoint

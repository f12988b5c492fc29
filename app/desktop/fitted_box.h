// Boxes of choices that may be narrower than their texts.
#pragma once

#include <QComboBox>
#include <QHelpEvent>
#include <QStyleOptionComboBox>
#include <QStylePainter>
#include <QToolTip>

namespace trigpoint {

// A text that does not fit ends in dots.
class ElidedBox : public QComboBox {
 protected:
  void paintEvent(QPaintEvent*) override {
    QStylePainter painter(this);
    QStyleOptionComboBox option;
    initStyleOption(&option);
    painter.drawComplexControl(QStyle::CC_ComboBox, option);
    const int room = style()->subControlRect(QStyle::CC_ComboBox, &option, QStyle::SC_ComboBoxEditField, this).width();
    const int icon = option.currentIcon.isNull() ? 0 : iconSize().width() + 4;
    option.currentText = fontMetrics().elidedText(option.currentText, Qt::ElideRight, room - icon - 2);
    painter.drawControl(QStyle::CE_ComboBoxLabel, option);
  }
};

// As wide as its longest text, up to a limit. Its tooltip is what it is for, and the text that is chosen.
class FittedBox : public ElidedBox {
 public:
  explicit FittedBox(const QString& help) {
    constexpr int kWidest = 45;  // characters
    setSizeAdjustPolicy(QComboBox::AdjustToContents);
    setMaximumWidth(kWidest * fontMetrics().averageCharWidth());
    setToolTip(help);
  }

 protected:
  bool event(QEvent* event) override {
    if (event->type() != QEvent::ToolTip || currentText().isEmpty()) return ElidedBox::event(event);
    QToolTip::showText(static_cast<QHelpEvent*>(event)->globalPos(), toolTip() + "\n" + currentText(), this);
    return true;
  }
};

}  // namespace trigpoint

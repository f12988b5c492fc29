// Widgets and their arrangement in one statement each. Texts come translated: their contexts are the callers' classes.
#pragma once

#include <QBoxLayout>
#include <QCheckBox>
#include <QLabel>
#include <QPushButton>
#include <QScrollArea>
#include <QSplitter>
#include <initializer_list>
#include <string>

#include "app/desktop/flow_layout.h"

namespace trigpoint {

inline QString Text(const std::string& text) { return QString::fromStdString(text); }

// `name`: by which tests and styles find it; `accessible`: as it is read aloud; `help`: its tooltip.
template <typename Widget>
Widget* Named(Widget* widget, const QString& name, const QString& accessible = {}, const QString& help = {}) {
  widget->setObjectName(name);
  if (!accessible.isEmpty()) widget->setAccessibleName(accessible);
  if (!help.isEmpty()) widget->setToolTip(help);
  return widget;
}

template <typename Widget>
Widget* ReadOnly(Widget* widget) {
  widget->setReadOnly(true);
  return widget;
}

inline QPushButton* MakeButton(const QString& name, const QString& text, const QString& help = {}) {
  return Named(new QPushButton(text), name, {}, help);
}

inline QCheckBox* MakeCheckBox(const QString& name, const QString& text, const QString& help = {}) {
  return Named(new QCheckBox(text), name, {}, help);
}

// Its text takes as many lines as it needs.
inline QLabel* WrappedLabel(const QString& name, const QString& text = {}) {
  auto* label = Named(new QLabel(text), name);
  label->setWordWrap(true);
  return label;
}

inline QLabel* Selectable(QLabel* label) {
  label->setTextInteractionFlags(Qt::TextSelectableByMouse);
  return label;
}

// Bold, and so many times as large.
inline void Enlarge(QLabel* label, double times) {
  QFont large = label->font();
  large.setPointSizeF(times * large.pointSizeF());
  large.setBold(true);
  label->setFont(large);
}

inline QScrollArea* Scrolled(QWidget* content) {
  auto* area = new QScrollArea;
  area->setWidget(content);
  area->setWidgetResizable(true);
  return area;
}

// What stands in a row or a column; {}: free room.
struct LayoutItem {
  LayoutItem() = default;
  LayoutItem(QWidget* it, int share = 0, Qt::Alignment side = {}) : widget(it), stretch(share), alignment(side) {}
  LayoutItem(QLayout* it, int share = 0) : layout(it), stretch(share) {}
  QWidget* widget = nullptr;
  QLayout* layout = nullptr;
  int stretch = 0;
  Qt::Alignment alignment = {};
};

template <typename Box>
Box* AddItems(Box* box, std::initializer_list<LayoutItem> items) {
  for (const LayoutItem& item : items) {
    if (item.widget != nullptr) {
      box->addWidget(item.widget, item.stretch, item.alignment);
    } else if (item.layout != nullptr) {
      box->addLayout(item.layout, item.stretch);
    } else {
      box->addStretch(item.stretch);
    }
  }
  return box;
}

inline QHBoxLayout* InRow(std::initializer_list<LayoutItem> items, QWidget* parent = nullptr) {
  return AddItems(new QHBoxLayout(parent), items);
}

inline QVBoxLayout* InColumn(std::initializer_list<LayoutItem> items, QWidget* parent = nullptr) {
  return AddItems(new QVBoxLayout(parent), items);
}

// A column without margins, as a widget.
inline QWidget* Pane(std::initializer_list<LayoutItem> items) {
  auto* pane = new QWidget;
  InColumn(items, pane)->setContentsMargins(0, 0, 0, 0);
  return pane;
}

inline FlowLayout* InFlow(std::initializer_list<QWidget*> widgets, QWidget* parent = nullptr) {
  auto* flow = new FlowLayout(parent);
  for (QWidget* widget : widgets) flow->addWidget(widget);
  return flow;
}

inline QSplitter* InSplitter(Qt::Orientation way, std::initializer_list<QWidget*> widgets,
                             const QList<int>& sizes = {}) {
  auto* splitter = new QSplitter(way);
  for (QWidget* widget : widgets) splitter->addWidget(widget);
  if (!sizes.isEmpty()) splitter->setSizes(sizes);
  return splitter;
}

// Side by side in a wide desk, one below the other in a narrow one. Has it turned?
inline bool TurnToFit(QSplitter* splitter, int width) {
  constexpr int kSideBySide = 900;  // px
  const Qt::Orientation way = width < kSideBySide ? Qt::Vertical : Qt::Horizontal;
  if (way == splitter->orientation()) return false;
  splitter->setOrientation(way);
  return true;
}

}  // namespace trigpoint

// Tables whose rows are about objects (Qt::UserRole of their cells; kRunRole: their run, if they are of one): a row
// selects its object on every desk, what is selected elsewhere is selected here, a right click asks for the object's
// menu.
#pragma once

#include <QAbstractItemView>
#include <QHeaderView>
#include <QTableWidget>

#include "app/desktop/widgets.h"
#include "app/desktop/workspace.h"

namespace trigpoint {

// A table to read and to select rows in; the last column takes the rest of the width.
inline QTableWidget* MakeTable(const char* name, const QString& accessible, const QStringList& header = {}) {
  auto* table = Named(new QTableWidget(0, header.size()), name, accessible);
  table->setHorizontalHeaderLabels(header);
  table->setEditTriggers(QAbstractItemView::NoEditTriggers);
  table->setSelectionBehavior(QAbstractItemView::SelectRows);
  table->horizontalHeader()->setStretchLastSection(true);
  table->resizeColumnsToContents();  // headers are read before there is a row
  table->verticalHeader()->hide();
  return table;
}

// What the columns mean, with their units, as tooltips of the header.
inline void SetHeaderHelp(QTableWidget* table, const QStringList& help) {
  for (int c = 0; c < help.size(); ++c) table->horizontalHeaderItem(c)->setToolTip(help[c]);
}

// A right click on an entry asks for the menu of the object that `role` holds, with `prefix` before it.
inline void AskMenuOn(QAbstractItemView* view, Workspace* workspace, int role, const QString& prefix = "") {
  view->setContextMenuPolicy(Qt::CustomContextMenu);
  QObject::connect(view, &QWidget::customContextMenuRequested, workspace, [view, workspace, role, prefix](QPoint at) {
    const QString object = view->indexAt(at).data(role).toString();
    if (!object.isEmpty()) workspace->AskMenu(prefix + object, view->viewport()->mapToGlobal(at));
  });
}

constexpr int kRunRole = Qt::UserRole + 10;

// The rows of what is selected; scrolls to the first. Nothing is selected by it.
inline void ShowSelectedRows(QTableWidget* table, const Workspace& workspace) {
  const auto data_of = [table](int row, int role) {
    const QTableWidgetItem* item = table->item(row, 0);
    return item == nullptr ? QString() : item->data(role).toString();
  };
  // How well a row fits: 0 not at all; what is selected before what belongs to it, of the run it was chosen of.
  const auto fit = [&](int row) {
    const QString object = data_of(row, Qt::UserRole), run = data_of(row, kRunRole);
    if (object.isEmpty() || workspace.related().count(object.toStdString()) == 0) return 0;
    const bool of_run = workspace.run().isEmpty() || run == workspace.run();
    return 1 + (of_run ? 1 : 0) + (object == workspace.selected() ? 2 : 0);
  };
  const auto selected = table->selectedItems();
  if (!selected.isEmpty() && fit(selected.front()->row()) == 4) return;
  const QSignalBlocker block(table);
  table->clearSelection();
  int best = -1;
  for (int row = 0; row < table->rowCount(); ++row) {
    if (fit(row) > (best < 0 ? 0 : fit(best))) best = row;
  }
  if (best < 0) return;
  table->selectRow(best);
  table->scrollToItem(table->item(best, table->horizontalHeader()->logicalIndex(0)));  // the leftmost
}

inline void LinkTable(QTableWidget* table, Workspace* workspace) {
  QObject::connect(table, &QTableWidget::itemSelectionChanged, workspace, [table, workspace] {
    const auto items = table->selectedItems();
    if (items.isEmpty()) return;
    workspace->Select(items.front()->data(Qt::UserRole).toString(), items.front()->data(kRunRole).toString());
  });
  QObject::connect(workspace, &Workspace::Selected, table, [table, workspace] { ShowSelectedRows(table, *workspace); });
  AskMenuOn(table, workspace, Qt::UserRole);
}

}  // namespace trigpoint

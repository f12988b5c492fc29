// The tables of the results: sorted, filtered, linked with the other desks, copied and exported.
#pragma once

#include <QAbstractTableModel>
#include <QWidget>
#include <memory>
#include <unordered_map>

#include "app/desktop/column_format.h"
#include "app/desktop/data_table.h"
#include "app/desktop/workspace.h"

class QLabel;
class QLineEdit;
class QSortFilterProxyModel;
class QTableView;
class QTreeWidget;
class QTreeWidgetItem;

namespace trigpoint {

// A table in the unit shown; sorts numbers as numbers.
class DataTableModel : public QAbstractTableModel {
 public:
  static constexpr int kSortRole = Qt::UserRole, kObjectRole = Qt::UserRole + 1;
  DataTableModel(const Workspace* workspace, QObject* parent) : QAbstractTableModel(parent), workspace_(workspace) {}
  void SetTable(std::shared_ptr<const DataTable> table);
  const DataTable* table() const { return table_.get(); }
  void ShowUnit();  // after the unit changed
  std::vector<int> RowsOf(const std::string& object) const;

  int rowCount(const QModelIndex& parent = {}) const override;
  int columnCount(const QModelIndex& parent = {}) const override;
  QVariant data(const QModelIndex& index, int role) const override;
  QVariant headerData(int section, Qt::Orientation orientation, int role) const override;

 private:
  const Workspace* workspace_;
  std::shared_ptr<const DataTable> table_;
  std::unordered_multimap<std::string, int> rows_;  // by object
  std::vector<ColumnFormat> formats_;
  std::vector<bool> numeric_;  // columns of numbers
  size_t run_ = 0;             // the column that names the row's run; past the last one: there is none
};

class BlanksLast;

class TablesDesk : public QWidget {
  Q_OBJECT

 public:
  explicit TablesDesk(Workspace* workspace, QWidget* parent = nullptr);

  // Chooses a table by its title, "evaluate/errors".
  bool Choose(const QString& title);
  // The rows shown, in their order, as CSV in metres. Throws IoError.
  void Export(const QString& file) const;
  // What is proposed for it: "evaluate_errors.csv".
  QString ExportName() const;
  // By the name that the file has; what is hidden stays so for every table that has it.
  void ShowColumn(const QString& column, bool shown);
  QString SelectionAsText() const;  // tab separated, with a header

 signals:
  void Activated(const QString& object);  // a row was opened: show what it is about

 private:
  void MakeView();
  void Refresh();
  void ShowTable();
  void ShowSelected();
  void ShowColumns();                 // all but those that somebody hid
  void ColumnMenu(const QPoint& at);  // a place of the screen
  QTreeWidgetItem* ItemOf(const QString& title) const;
  QString title() const;  // of the table chosen

  Workspace* workspace_;
  std::vector<DataTableSource> sources_;
  QTreeWidget* tree_;
  QLineEdit* filter_;
  QLabel *count_, *empty_;
  QTableView* view_;
  DataTableModel* model_;
  BlanksLast* proxy_;
  bool showing_ = false;  // the selection comes from another desk
  int generation_ = 0;
};

}  // namespace trigpoint

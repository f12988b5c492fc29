#include "app/desktop/tables_desk.h"

#include <QApplication>
#include <QClipboard>
#include <QFileDialog>
#include <QHeaderView>
#include <QLabel>
#include <QLineEdit>
#include <QMenu>
#include <QPushButton>
#include <QSettings>
#include <QShortcut>
#include <QSortFilterProxyModel>
#include <QTableView>
#include <QTreeWidget>
#include <algorithm>
#include <map>
#include <optional>
#include <string>

#include "app/desktop/background.h"
#include "app/desktop/column_help.h"
#include "app/desktop/object_table.h"
#include "app/desktop/tolerance.h"
#include "app/desktop/widgets.h"
#include "datasets/io/natural_order.h"
#include "eval/text/method_name.h"

namespace trigpoint {

namespace {

constexpr int kWidestColumn = 30;  // characters, until somebody widens it
constexpr int kMostLooked = 200;   // cells by which a column is one of numbers
constexpr const char* kHidden = "tables/hidden";

QString ObjectOf(const QModelIndex& row) { return row.data(DataTableModel::kObjectRole).toString(); }

QString RunOf(const QModelIndex& row) { return row.data(kRunRole).toString(); }

// As the other desks name it; nothing: as the file has it. A status is one of answers in these stages' tables alone.
std::optional<std::string> WordFor(const DataTable& table, const std::string& column, const std::string& text) {
  if (column == "method") return MethodName(text);
  if (column == "reference") return ReferenceName(text);
  const bool answers = table.title.starts_with("evaluate") || table.title.starts_with("localize");
  return column == "status" && answers ? std::optional(StatusName(text)) : std::nullopt;
}

}  // namespace

// What has no value comes last, whichever way one sorts.
class BlanksLast : public QSortFilterProxyModel {
 public:
  using QSortFilterProxyModel::QSortFilterProxyModel;
  // Each word must stand in one of a row's cells.
  void FilterBy(const QString& text) {
    words_ = text.split(' ', Qt::SkipEmptyParts);
    invalidateFilter();
  }

 protected:
  bool filterAcceptsRow(int row, const QModelIndex& parent) const override {
    return std::all_of(words_.begin(), words_.end(), [&](const QString& word) {
      for (int c = 0; c < sourceModel()->columnCount(parent); ++c) {
        const QString cell = sourceModel()->index(row, c, parent).data().toString();
        if (cell.contains(word, Qt::CaseInsensitive)) return true;
      }
      return false;
    });
  }
  bool lessThan(const QModelIndex& left, const QModelIndex& right) const override {
    const QVariant a = left.data(sortRole()), b = right.data(sortRole());
    const bool no_a = a.toString().isEmpty(), no_b = b.toString().isEmpty();
    if (no_a != no_b) return sortOrder() == Qt::AscendingOrder ? no_b : no_a;
    if (a.type() != QVariant::String) return QSortFilterProxyModel::lessThan(left, right);
    return NaturalLess(a.toString().toStdString(), b.toString().toStdString());
  }

 private:
  QStringList words_;
};

void DataTableModel::SetTable(std::shared_ptr<const DataTable> table) {
  beginResetModel();
  table_ = std::move(table);
  formats_.clear();
  numeric_.clear();
  for (size_t c = 0; table_ && c < table_->columns.size(); ++c) {
    bool numeric = false;
    int looked = 0;  // at cells that hold something
    for (size_t r = 0; r < table_->rows.size() && looked < kMostLooked; ++r) {
      if (table_->rows[r][c].empty()) continue;
      ++looked;
      Text(table_->rows[r][c]).toDouble(&numeric);
      if (!numeric) break;
    }
    numeric_.push_back(numeric);
    formats_.push_back(FormatOf(Text(table_->columns[c]), numeric));
  }
  run_ = 0;
  while (table_ && run_ < table_->columns.size() && table_->columns[run_] != "run") ++run_;
  rows_.clear();
  for (size_t r = 0; table_ && r < table_->objects.size(); ++r) {
    if (!table_->objects[r].empty()) rows_.emplace(table_->objects[r], static_cast<int>(r));
  }
  endResetModel();
}

std::vector<int> DataTableModel::RowsOf(const std::string& object) const {
  std::vector<int> rows;
  const auto [first, last] = rows_.equal_range(object);
  for (auto it = first; it != last; ++it) rows.push_back(it->second);
  std::sort(rows.begin(), rows.end());
  return rows;
}

void DataTableModel::ShowUnit() {
  if (rowCount() == 0) return;
  emit dataChanged(index(0, 0), index(rowCount() - 1, columnCount() - 1));
  emit headerDataChanged(Qt::Horizontal, 0, columnCount() - 1);
}

int DataTableModel::rowCount(const QModelIndex& parent) const {
  return parent.isValid() || !table_ ? 0 : static_cast<int>(table_->rows.size());
}

int DataTableModel::columnCount(const QModelIndex& parent) const {
  return parent.isValid() || !table_ ? 0 : static_cast<int>(table_->columns.size());
}

QVariant DataTableModel::data(const QModelIndex& index, int role) const {
  if (!index.isValid() || !table_) return {};
  const auto r = static_cast<size_t>(index.row()), c = static_cast<size_t>(index.column());
  const QString text = Text(table_->rows[r][c]);
  switch (role) {
    case Qt::DisplayRole:
      if (const auto word = WordFor(*table_, table_->columns[c], text.toStdString())) {
        return Text(*word);
      }
      return formats_[c].Cell(text, workspace_->display_unit());
    case Qt::ToolTipRole: return text;  // as the file has it
    case kSortRole: return numeric_[c] ? (text.isEmpty() ? QVariant() : QVariant(text.toDouble())) : QVariant(text);
    case kRunRole: return run_ < table_->columns.size() ? Text(table_->rows[r][run_]) : QString();
    case kObjectRole: return Text(table_->objects[r]);
    case Qt::TextAlignmentRole:
      return static_cast<int>((numeric_[c] ? Qt::AlignRight : Qt::AlignLeft) | Qt::AlignVCenter);
    case Qt::BackgroundRole: {  // errors by their size; what belongs to the selection
      if (formats_[c].error && !text.isEmpty()) return ColoursOfError(text.toDouble()).background;
      if (table_->objects[r].empty() || workspace_->related().count(table_->objects[r]) == 0) return {};
      QColor tint = QApplication::palette().color(QPalette::Highlight);
      tint.setAlpha(70);
      return tint;
    }
    case Qt::ForegroundRole: {
      if (formats_[c].error && !text.isEmpty()) return ColoursOfError(text.toDouble()).text;
      const std::string& object = table_->objects[r];
      const auto& snapshot = workspace_->snapshot();
      const bool out = snapshot && snapshot->excluded.count(object) > 0;
      return out ? QVariant(QColor(Qt::gray)) : QVariant();
    }
    default: return {};
  }
}

QVariant DataTableModel::headerData(int section, Qt::Orientation orientation, int role) const {
  if (!table_ || (role != Qt::DisplayRole && role != Qt::ToolTipRole)) return {};
  if (orientation == Qt::Vertical) return section + 1;
  const auto c = static_cast<size_t>(section);
  const DisplayUnit& unit = workspace_->display_unit();
  if (role == Qt::ToolTipRole) {
    return ColumnHelp(*table_, Text(table_->columns[c]), formats_[c].UnitShown(unit));
  }
  return formats_[c].Header(unit);
}

TablesDesk::TablesDesk(Workspace* workspace, QWidget* parent) : QWidget(parent), workspace_(workspace) {
  tree_ = Named(new QTreeWidget, "tables.tree", tr("Tables"));
  tree_->setHeaderHidden(true);
  tree_->setUniformRowHeights(true);
  tree_->setTextElideMode(Qt::ElideMiddle);  // many begin alike
  filter_ = Named(new QLineEdit, "tables.filter", tr("Filter of the rows"));
  filter_->setPlaceholderText(tr("filter"));
  filter_->setClearButtonEnabled(true);
  count_ = Named(new QLabel, "tables.count");
  auto* copy = MakeButton("tables.copy", tr("&Copy"), tr("Copy the selected rows (Ctrl+C)"));
  auto* save = MakeButton("tables.export", tr("&Export ..."));
  auto* columns = MakeButton("tables.columns", tr("Co&lumns ..."),
                             tr("Choose the columns that are shown; also by a right click on the header"));
  MakeView();
  auto* line = InRow({{filter_, 1}, count_, columns, copy, save});
  auto* right = Pane({line, {view_, 1}, {empty_, 1}});
  auto* split = InSplitter(Qt::Horizontal, {tree_, right}, {200, 850});
  split->setStretchFactor(1, 1);
  InColumn({split}, this);

  view_->horizontalHeader()->setContextMenuPolicy(Qt::CustomContextMenu);
  connect(view_->horizontalHeader(), &QWidget::customContextMenuRequested, this,
          [this](const QPoint& at) { ColumnMenu(view_->horizontalHeader()->viewport()->mapToGlobal(at)); });
  connect(columns, &QPushButton::clicked, this,
          [this, columns] { ColumnMenu(columns->mapToGlobal(QPoint(0, columns->height()))); });
  AskMenuOn(view_, workspace_, DataTableModel::kObjectRole);
  connect(tree_, &QTreeWidget::currentItemChanged, this, &TablesDesk::ShowTable);
  connect(filter_, &QLineEdit::textChanged, this, [this](const QString& text) {
    showing_ = true;  // rows that go take the current one along: that is no choice of anybody's
    proxy_->FilterBy(text);
    showing_ = false;
    ShowSelected();
    count_->setText(tr("%1 of %2 rows").arg(proxy_->rowCount()).arg(model_->rowCount()));
  });
  connect(copy, &QPushButton::clicked, this, [this] { QApplication::clipboard()->setText(SelectionAsText()); });
  auto* shortcut = new QShortcut(QKeySequence::Copy, view_, nullptr, nullptr, Qt::WidgetShortcut);
  connect(shortcut, &QShortcut::activated, copy, &QPushButton::click);
  connect(save, &QPushButton::clicked, this, [this] {
    QFileDialog dialog(this, tr("Export the rows shown"), QString(), tr("CSV (*.csv)"));
    dialog.setAcceptMode(QFileDialog::AcceptSave);
    dialog.setDefaultSuffix("csv");
    dialog.selectFile(ExportName());
    if (dialog.exec() != QDialog::Accepted || dialog.selectedFiles().isEmpty()) return;
    const QString file = dialog.selectedFiles().first();
    try {
      Export(file);
    } catch (const std::exception& e) {
      emit workspace_->Problem(QString::fromUtf8(e.what()), file);
    }
  });
  // Not what becomes current: that is the first row, too, when the view gets the focus.
  connect(view_->selectionModel(), &QItemSelectionModel::selectionChanged, this, [this](const QItemSelection& chosen) {
    if (showing_ || chosen.isEmpty()) return;
    const QModelIndex row = chosen.indexes().front();
    workspace_->Select(ObjectOf(row), RunOf(row));
  });
  connect(view_, &QTableView::activated, this, [this](const QModelIndex& row) { emit Activated(ObjectOf(row)); });
  connect(workspace_, &Workspace::Replaced, this, [this] {
    ++generation_;
    model_->SetTable(nullptr);
    filter_->clear();
  });
  connect(workspace_, &Workspace::Opened, this, &TablesDesk::Refresh);
  connect(workspace_, &Workspace::Closed, this, &TablesDesk::Refresh);
  connect(workspace_, &Workspace::Selected, this, &TablesDesk::ShowSelected);
  connect(workspace_, &Workspace::UnitChanged, model_, &DataTableModel::ShowUnit);
  Refresh();
}

void TablesDesk::MakeView() {
  view_ = Named(new QTableView, "tables.view", tr("Rows of the table"));
  view_->setSelectionBehavior(QAbstractItemView::SelectRows);
  view_->setSortingEnabled(true);
  view_->setAlternatingRowColors(true);
  view_->setEditTriggers(QAbstractItemView::NoEditTriggers);
  view_->verticalHeader()->setDefaultSectionSize(view_->fontMetrics().height() + 6);
  model_ = new DataTableModel(workspace_, this);
  proxy_ = new BlanksLast(this);
  proxy_->setSourceModel(model_);
  proxy_->setSortRole(DataTableModel::kSortRole);
  view_->setModel(proxy_);
  empty_ = WrappedLabel("tables.empty");
  empty_->setAlignment(Qt::AlignCenter);
  view_->sortByColumn(-1, Qt::AscendingOrder);
}

QTreeWidgetItem* TablesDesk::ItemOf(const QString& title) const {
  for (QTreeWidgetItemIterator it(tree_); *it != nullptr; ++it) {
    if ((*it)->data(0, Qt::UserRole).toString() == title && !title.isEmpty()) return *it;
  }
  return nullptr;
}

QString TablesDesk::title() const {
  return tree_->currentItem() == nullptr ? QString() : tree_->currentItem()->data(0, Qt::UserRole).toString();
}

bool TablesDesk::Choose(const QString& title) {
  QTreeWidgetItem* item = ItemOf(title);
  if (item != nullptr) tree_->setCurrentItem(item);
  return item != nullptr;
}

QString TablesDesk::ExportName() const { return title().replace('/', '_') + ".csv"; }

void TablesDesk::Refresh() {
  const QString before = title();
  {
    const QSignalBlocker block(tree_);
    QStringList open;
    for (QTreeWidgetItemIterator it(tree_); *it != nullptr; ++it) {
      if ((*it)->isExpanded()) open << (*it)->data(0, Qt::UserRole + 1).toString();
    }
    const bool first = tree_->topLevelItemCount() == 0;
    tree_->clear();
    sources_.clear();
    if (workspace_->snapshot()) sources_ = FindTables(workspace_->snapshot()->dir / "results");
    std::map<QString, QTreeWidgetItem*> folders = {{"", tree_->invisibleRootItem()}};
    for (const DataTableSource& source : sources_) {
      const QStringList parts = Text(source.title).split('/');
      QString folder;
      for (int i = 0; i + 1 < parts.size(); ++i) {  // localize, run1, panoramas
        const QString inner = folder.isEmpty() ? parts[i] : folder + "/" + parts[i];
        QTreeWidgetItem*& item = folders[inner];
        if (item == nullptr) {
          item = new QTreeWidgetItem(folders[folder], {parts[i]});
          item->setFlags(item->flags() & ~Qt::ItemIsSelectable);
          item->setData(0, Qt::UserRole + 1, inner);
          item->setExpanded(first ? inner == "evaluate" : open.contains(inner));
        }
        folder = inner;
      }
      auto* item = new QTreeWidgetItem(folders[folder], {parts.last()});
      item->setToolTip(0, Text(source.title));  // names are cut in a narrow tree
      item->setData(0, Qt::UserRole, Text(source.title));
    }
    QTreeWidgetItem* now = ItemOf(before);
    if (now == nullptr && !sources_.empty()) now = ItemOf(Text(sources_.front().title));
    tree_->setCurrentItem(now);
  }
  ShowTable();
}

void TablesDesk::ColumnMenu(const QPoint& at) {
  if (model_->table() == nullptr) return;
  auto* menu = new QMenu(this);
  menu->setObjectName("tables.column_menu");
  menu->setAttribute(Qt::WA_DeleteOnClose);
  for (int c = 0; c < model_->columnCount(); ++c) {
    const QString name = Text(model_->table()->columns[static_cast<size_t>(c)]);
    QAction* action = menu->addAction(model_->headerData(c, Qt::Horizontal, Qt::DisplayRole).toString());
    action->setCheckable(true);
    action->setChecked(!view_->isColumnHidden(c));
    connect(action, &QAction::toggled, this, [this, name](bool on) { ShowColumn(name, on); });
  }
  menu->popup(at);
}

void TablesDesk::ShowColumn(const QString& column, bool shown) {
  QSettings settings;
  QStringList hidden = settings.value(kHidden).toStringList();
  hidden.removeAll(column);
  if (!shown) hidden << column;
  settings.setValue(kHidden, hidden);
  ShowColumns();
}

void TablesDesk::ShowColumns() {
  const QStringList hidden = QSettings().value(kHidden).toStringList();
  for (int c = 0; c < model_->columnCount(); ++c) {
    view_->setColumnHidden(c, hidden.contains(Text(model_->table()->columns[static_cast<size_t>(c)])));
  }
}

void TablesDesk::ShowTable() {
  const QString wanted = title();
  if (wanted.isEmpty() && tree_->currentItem() != nullptr) return;  // a folder: the table stays
  const int generation = ++generation_;
  const auto found = std::find_if(sources_.begin(), sources_.end(),
                                  [&](const DataTableSource& source) { return Text(source.title) == wanted; });
  empty_->setVisible(found == sources_.end());
  view_->setVisible(found != sources_.end());
  if (found == sources_.end()) {
    model_->SetTable(nullptr);
    count_->clear();
    empty_->setText(workspace_->snapshot() ? tr("No tables yet: run a stage. detect, localize, survey and evaluate "
                                                "write tables into results/.")
                                           : tr("Open a project (Ctrl+O) to see the tables of its results."));
    return;
  }
  InBackground(
      this,
      [source = *found] {
        return std::shared_ptr<const DataTable>(std::make_shared<DataTable>(LoadDataTable(source)));
      },
      [this, generation](const Attempted<std::shared_ptr<const DataTable>>& table) {
        if (generation != generation_) return;
        if (!table.value) emit workspace_->Problem(table.error, tr("The table is not shown."));
        model_->SetTable(table.value);
        ShowColumns();
        count_->setText(tr("%1 of %2 rows").arg(proxy_->rowCount()).arg(model_->rowCount()));
        if (model_->rowCount() < 2000) view_->resizeColumnsToContents();
        for (int c = 0; c < model_->columnCount(); ++c) {
          view_->setColumnWidth(c, std::min(view_->columnWidth(c), kWidestColumn * fontMetrics().averageCharWidth()));
        }
        ShowSelected();
      });
}

void TablesDesk::ShowSelected() {
  view_->viewport()->update();  // what belongs to the selection is tinted
  const QString& run = workspace_->run();
  const auto is_of_run = [&](const QModelIndex& row) { return run.isEmpty() || RunOf(row) == run; };
  for (const QModelIndex& row : view_->selectionModel()->selectedRows()) {
    if (ObjectOf(row) == workspace_->selected() && is_of_run(row)) return;
  }
  showing_ = true;
  std::vector<std::string> wanted = {workspace_->selected().toStdString()};  // before what belongs to it
  wanted.insert(wanted.end(), workspace_->related().begin(), workspace_->related().end());
  QModelIndex best;
  for (const std::string& object : wanted) {
    for (const int row : model_->RowsOf(object)) {
      const QModelIndex index = proxy_->mapFromSource(model_->index(row, 0));
      if (!index.isValid()) continue;  // filtered out
      if (!best.isValid() || (!is_of_run(best) && is_of_run(index))) best = index;
    }
    if (best.isValid()) break;
  }
  if (best.isValid()) {
    view_->setCurrentIndex(best);
    view_->selectRow(best.row());
    view_->scrollTo(best);
  } else {
    view_->clearSelection();
  }
  showing_ = false;
}

void TablesDesk::Export(const QString& file) const {
  if (model_->table() == nullptr) return;
  std::vector<int> rows;
  for (int row = 0; row < proxy_->rowCount(); ++row) rows.push_back(proxy_->mapToSource(proxy_->index(row, 0)).row());
  ExportDataTable(*model_->table(), rows, file.toStdString());
}

QString TablesDesk::SelectionAsText() const {
  QStringList lines, cells;
  for (int c = 0; c < model_->columnCount(); ++c) {
    if (view_->isColumnHidden(c)) continue;
    cells << model_->headerData(c, Qt::Horizontal, Qt::DisplayRole).toString();
  }
  lines << cells.join('\t');
  for (const QModelIndex& row : view_->selectionModel()->selectedRows()) {
    cells.clear();
    for (int c = 0; c < proxy_->columnCount(); ++c) {
      if (!view_->isColumnHidden(c)) cells << row.sibling(row.row(), c).data().toString();
    }
    lines << cells.join('\t');
  }
  return lines.join('\n') + "\n";
}

}  // namespace trigpoint

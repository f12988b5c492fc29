#include "app/desktop/tables_desk.h"

#include <QApplication>
#include <QClipboard>
#include <QComboBox>
#include <QFileDialog>
#include <QHBoxLayout>
#include <QHeaderView>
#include <QLabel>
#include <QLineEdit>
#include <QPushButton>
#include <QShortcut>
#include <QSortFilterProxyModel>
#include <QTableView>
#include <QVBoxLayout>
#include <algorithm>

#include "app/desktop/background.h"

namespace trigpoint {

namespace {

constexpr int kWidestColumn = 30;  // characters, until somebody widens it

bool IsLength(const std::string& column) {
  static const std::set<std::string> kPlain = {"x", "y", "z", "odom_x", "odom_y", "odom_z", "tx", "ty", "tz"};
  return column.ends_with("_m") || kPlain.count(column) > 0;
}

}  // namespace

void DataTableModel::SetTable(std::shared_ptr<const DataTable> table) {
  beginResetModel();
  table_ = std::move(table);
  length_.clear();
  numeric_.clear();
  for (size_t c = 0; table_ && c < table_->columns.size(); ++c) {
    bool numeric = false;
    for (size_t r = 0; r < table_->rows.size() && r < 200; ++r) {
      if (table_->rows[r][c].empty()) continue;
      QString::fromStdString(table_->rows[r][c]).toDouble(&numeric);
      if (!numeric) break;
    }
    numeric_.push_back(numeric);
    length_.push_back(numeric && IsLength(table_->columns[c]));
  }
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
  const QString text = QString::fromStdString(table_->rows[r][c]);
  switch (role) {
    case Qt::DisplayRole:
      if (length_[c] && workspace_->unit() != "m" && !text.isEmpty()) {
        return QString::number(text.toDouble() / workspace_->metres_per_unit(), 'f', 4);
      }
      return text;
    case kSortRole: return numeric_[c] ? (text.isEmpty() ? QVariant() : QVariant(text.toDouble())) : QVariant(text);
    case kObjectRole: return QString::fromStdString(table_->objects[r]);
    case Qt::TextAlignmentRole:
      return static_cast<int>((numeric_[c] ? Qt::AlignRight : Qt::AlignLeft) | Qt::AlignVCenter);
    case Qt::BackgroundRole: {  // what belongs to the selection
      if (table_->objects[r].empty() || workspace_->related().count(table_->objects[r]) == 0) return {};
      QColor tint = QApplication::palette().color(QPalette::Highlight);
      tint.setAlpha(70);
      return tint;
    }
    case Qt::ForegroundRole: {
      const std::string& object = table_->objects[r];
      const auto& snapshot = workspace_->snapshot();
      const bool out = snapshot && snapshot->excluded.count(object) > 0;
      return out ? QVariant(QColor(Qt::gray)) : QVariant();
    }
    default: return {};
  }
}

QVariant DataTableModel::headerData(int section, Qt::Orientation orientation, int role) const {
  if (role != Qt::DisplayRole || !table_) return {};
  if (orientation == Qt::Vertical) return section + 1;
  const auto c = static_cast<size_t>(section);
  QString name = QString::fromStdString(table_->columns[c]);
  if (!length_[c]) return name;
  if (name.endsWith("_m")) name.chop(2);
  return name + " (" + workspace_->unit() + ")";
}

TablesDesk::TablesDesk(Workspace* workspace, QWidget* parent) : QWidget(parent), workspace_(workspace) {
  choice_ = new QComboBox;
  choice_->setObjectName("tables.choice");
  choice_->setAccessibleName(tr("Table"));
  choice_->setSizeAdjustPolicy(QComboBox::AdjustToMinimumContentsLengthWithIcon);
  choice_->setMinimumContentsLength(28);
  filter_ = new QLineEdit;
  filter_->setObjectName("tables.filter");
  filter_->setAccessibleName(tr("Filter of the rows"));
  filter_->setPlaceholderText(tr("filter"));
  filter_->setClearButtonEnabled(true);
  count_ = new QLabel;
  count_->setObjectName("tables.count");
  auto* copy = new QPushButton(tr("&Copy"));
  copy->setObjectName("tables.copy");
  copy->setToolTip(tr("Copy the selected rows (Ctrl+C)"));
  auto* save = new QPushButton(tr("&Export ..."));
  save->setObjectName("tables.export");
  view_ = new QTableView;
  view_->setObjectName("tables.view");
  view_->setAccessibleName(tr("Rows of the table"));
  view_->setSelectionBehavior(QAbstractItemView::SelectRows);
  view_->setSortingEnabled(true);
  view_->setAlternatingRowColors(true);
  view_->setEditTriggers(QAbstractItemView::NoEditTriggers);
  view_->verticalHeader()->setDefaultSectionSize(view_->fontMetrics().height() + 6);
  model_ = new DataTableModel(workspace, this);
  proxy_ = new QSortFilterProxyModel(this);
  proxy_->setSourceModel(model_);
  proxy_->setSortRole(DataTableModel::kSortRole);
  proxy_->setFilterKeyColumn(-1);
  proxy_->setFilterCaseSensitivity(Qt::CaseInsensitive);
  view_->setModel(proxy_);
  view_->sortByColumn(-1, Qt::AscendingOrder);

  auto* line = new QHBoxLayout;
  line->addWidget(choice_);
  line->addWidget(filter_, 1);
  line->addWidget(count_);
  line->addWidget(copy);
  line->addWidget(save);
  auto* all = new QVBoxLayout(this);
  all->addLayout(line);
  all->addWidget(view_, 1);

  connect(choice_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &TablesDesk::ShowTable);
  connect(filter_, &QLineEdit::textChanged, this, [this](const QString& text) {
    showing_ = true;  // rows that go take the current one along: that is no choice of anybody's
    proxy_->setFilterFixedString(text);
    showing_ = false;
    ShowSelected();
    count_->setText(tr("%1 of %2 rows").arg(proxy_->rowCount()).arg(model_->rowCount()));
  });
  connect(copy, &QPushButton::clicked, this, [this] { QApplication::clipboard()->setText(SelectionAsText()); });
  auto* shortcut = new QShortcut(QKeySequence::Copy, view_, nullptr, nullptr, Qt::WidgetShortcut);
  connect(shortcut, &QShortcut::activated, copy, &QPushButton::click);
  connect(save, &QPushButton::clicked, this, [this] {
    const QString file = QFileDialog::getSaveFileName(this, tr("Export the rows shown"), "", tr("CSV (*.csv)"));
    if (file.isEmpty()) return;
    try {
      Export(file);
    } catch (const std::exception& e) {
      emit workspace_->Problem(QString::fromUtf8(e.what()), file);
    }
  });
  connect(view_->selectionModel(), &QItemSelectionModel::currentRowChanged, this, [this](const QModelIndex& index) {
    if (!showing_ && index.isValid()) workspace_->Select(index.data(DataTableModel::kObjectRole).toString());
  });
  connect(view_, &QTableView::activated, this,
          [this](const QModelIndex& index) { emit Activated(index.data(DataTableModel::kObjectRole).toString()); });
  connect(workspace_, &Workspace::Replaced, this, [this] {
    ++generation_;
    model_->SetTable(nullptr);
    filter_->clear();
  });
  connect(workspace_, &Workspace::Opened, this, &TablesDesk::Refresh);
  connect(workspace_, &Workspace::Closed, this, &TablesDesk::Refresh);
  connect(workspace_, &Workspace::Selected, this, &TablesDesk::ShowSelected);
  connect(workspace_, &Workspace::UnitChanged, model_, &DataTableModel::ShowUnit);
}

bool TablesDesk::Choose(const QString& title) {
  const int index = choice_->findText(title);
  if (index >= 0) choice_->setCurrentIndex(index);
  return index >= 0;
}

void TablesDesk::Refresh() {
  const QString before = choice_->currentText();
  {
    const QSignalBlocker block(choice_);
    choice_->clear();
    sources_.clear();
    if (workspace_->snapshot()) sources_ = FindTables(workspace_->snapshot()->dir / "results");
    for (const DataTableSource& source : sources_) choice_->addItem(QString::fromStdString(source.title));
    choice_->setCurrentIndex(std::max(0, choice_->findText(before)));
  }
  ShowTable();
}

void TablesDesk::ShowTable() {
  const int generation = ++generation_;
  const int index = choice_->currentIndex();
  if (index < 0) {
    model_->SetTable(nullptr);
    count_->setText(tr("no tables yet"));
    return;
  }
  InBackground(
      this,
      [source = sources_[static_cast<size_t>(index)]] {
        return std::shared_ptr<const DataTable>(std::make_shared<DataTable>(LoadDataTable(source)));
      },
      [this, generation](const Attempted<std::shared_ptr<const DataTable>>& table) {
        if (generation != generation_) return;
        if (!table.value) emit workspace_->Problem(table.error, tr("The table is not shown."));
        model_->SetTable(table.value);
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
  if (view_->hasFocus() && view_->currentIndex().isValid() &&
      view_->currentIndex().data(DataTableModel::kObjectRole).toString() == workspace_->selected()) {
    return;
  }
  showing_ = true;
  std::vector<std::string> wanted = {workspace_->selected().toStdString()};  // before what belongs to it
  wanted.insert(wanted.end(), workspace_->related().begin(), workspace_->related().end());
  for (const std::string& object : wanted) {
    for (const int row : model_->RowsOf(object)) {
      const QModelIndex index = proxy_->mapFromSource(model_->index(row, 0));
      if (!index.isValid()) continue;  // filtered out
      view_->setCurrentIndex(index);
      view_->selectRow(index.row());
      view_->scrollTo(index);
      showing_ = false;
      return;
    }
  }
  view_->clearSelection();
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
    cells << model_->headerData(c, Qt::Horizontal, Qt::DisplayRole).toString();
  }
  lines << cells.join('\t');
  for (const QModelIndex& row : view_->selectionModel()->selectedRows()) {
    cells.clear();
    for (int c = 0; c < proxy_->columnCount(); ++c) cells << row.sibling(row.row(), c).data().toString();
    lines << cells.join('\t');
  }
  return lines.join('\n') + "\n";
}

}  // namespace trigpoint

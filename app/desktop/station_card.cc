#include "app/desktop/station_card.h"

#include <QCheckBox>
#include <QHeaderView>
#include <QLabel>
#include <QPushButton>
#include <QTableWidget>
#include <QVBoxLayout>
#include <algorithm>
#include <cmath>
#include <tuple>

#include "app/desktop/flow_layout.h"
#include "app/desktop/object_table.h"
#include "app/desktop/overview.h"
#include "app/desktop/tolerance.h"
#include "eval/report/verdict.h"
#include "eval/text/method_name.h"

namespace trigpoint {

namespace {

constexpr int kDecimals = 3;  // of lengths

QString Text(const std::string& text) { return QString::fromStdString(text); }

auto Group(const ErrorRecord& e) { return std::tie(e.kind, e.reference, e.method); }

std::optional<double> SigmaInSpace(const ErrorRecord& e) {
  if (!e.sigma_e_m || !e.sigma_n_m || !e.sigma_u_m) return std::nullopt;
  return std::hypot(*e.sigma_e_m, *e.sigma_n_m, *e.sigma_u_m);
}

}  // namespace

StationCard::StationCard(Workspace* workspace, QWidget* parent) : QWidget(parent), workspace_(workspace) {
  title_ = new QLabel;
  title_->setObjectName("card.title");
  title_->setWordWrap(true);
  note_ = new QLabel;
  note_->setObjectName("card.note");
  note_->setWordWrap(true);
  views_ = new QCheckBox(tr("also each &view (G1)"));
  views_->setObjectName("card.views");
  views_->setToolTip(tr("Besides the final answers, panorama (G2), those of each rectilinear view by itself"));
  table_ = new QTableWidget;
  table_->setObjectName("card.table");
  table_->setAccessibleName(tr("Errors of the selected station"));
  table_->setEditTriggers(QAbstractItemView::NoEditTriggers);
  table_->setSelectionBehavior(QAbstractItemView::SelectRows);
  table_->setWordWrap(false);
  table_->verticalHeader()->hide();
  table_->verticalHeader()->setDefaultSectionSize(table_->fontMetrics().height() + 6);
  buttons_ = new QWidget;
  auto* buttons = new FlowLayout(buttons_);
  const auto add = [&](const char* name, const QString& text, auto clicked) {
    auto* button = new QPushButton(text);
    button->setObjectName(name);
    buttons->addWidget(button);
    connect(button, &QPushButton::clicked, this, [this, button, clicked] { clicked(button); });
  };
  add("card.scene", tr("Show in &3D"), [this](QPushButton*) { emit SceneRequested(object_); });
  add("card.image", tr("Best &image"), [this](QPushButton*) { emit ImageRequested(object_); });
  add("card.decide", tr("&Decide ..."),
      [this](QPushButton* button) { workspace_->AskMenu(object_, button->mapToGlobal(QPoint(0, button->height()))); });
  auto* column = new QVBoxLayout(this);
  column->setContentsMargins(4, 4, 4, 4);
  column->addWidget(title_);
  column->addWidget(table_, 1);
  column->addWidget(note_);
  column->addWidget(views_);
  column->addWidget(buttons_);
  AskMenuOn(table_, workspace_, Qt::UserRole);
  connect(table_, &QTableWidget::cellActivated, this, [this] { emit ImageRequested(object_); });
  connect(views_, &QCheckBox::toggled, this, &StationCard::Show);
  connect(workspace_, &Workspace::Selected, this, &StationCard::Show);
  connect(workspace_, &Workspace::UnitChanged, this, &StationCard::Show);
  connect(workspace_, &Workspace::Replaced, this, [this] { SetOverview(nullptr); });
  Show();
}

void StationCard::SetOverview(std::shared_ptr<const Overview> overview) {
  overview_ = std::move(overview);
  Show();
}

void StationCard::Show() {
  object_ = Text(StationShown(overview_.get(), workspace_->related(), workspace_->selected().toStdString()));
  const auto& snapshot = workspace_->snapshot();
  table_->setRowCount(0);
  table_->clearSpans();
  const bool any = snapshot && overview_ && !object_.isEmpty();
  for (QWidget* widget : {static_cast<QWidget*>(table_), static_cast<QWidget*>(note_), buttons_}) {
    widget->setVisible(any);
  }
  views_->hide();
  if (!any) {
    title_->setText(tr("Select a station: in the plan, a table, a chart, the scene, or the tree."));
    return;
  }
  const QString name = object_.section(':', 1), unit = workspace_->unit();
  QString tag;
  for (const SnapshotStation& s : snapshot->stations) {
    if (object_ == Text("station:" + s.name) && s.tag_id >= 0) tag = tr(", tag %1").arg(s.tag_id);
  }
  title_->setText(
      "<b>" +
      (object_.startsWith("station:") ? tr("Station %1%2") : tr("Panorama %1%2")).arg(name.toHtmlEscaped(), tag) +
      "</b>");
  const QStringList header{tr("run"),    tr("3D"),      "dE", "dN", "dU", QString::fromUtf8("\xcf\x83 3D"),
                           tr("within"), tr("NEES/dof")};
  table_->setColumnCount(header.size());
  table_->setHorizontalHeaderLabels(header);
  const QStringList help{tr("run, and what was answered"),
                         tr("error in space (%1)").arg(unit),
                         tr("error to the east (%1)").arg(unit),
                         tr("error to the north (%1)").arg(unit),
                         tr("error upwards (%1)").arg(unit),
                         tr("1 sigma of the difference in space (%1)").arg(unit),
                         tr("the tolerance that the error keeps, of 0.1, 0.25, 0.5 and 1 m (%1)").arg(unit),
                         tr("squared error in its own sigmas, by degrees of freedom: about 1 if the sigmas are right")};
  SetHeaderHelp(table_, help);
  std::vector<const ErrorRecord*> rows;
  bool views = false;
  for (const ErrorRecord& e : overview_->errors) {
    if (Text(object_.startsWith("station:") ? e.station : e.panorama) != name) continue;
    views |= e.method == "g1";
    if (e.method != "g1" || views_->isChecked()) rows.push_back(&e);
  }
  views_->setVisible(views);
  // As the overview compares first: absolute before relative, final answers before views.
  const auto key = [](const ErrorRecord* e) { return std::tuple(e->method == "g1", Group(*e), e->run, e->panorama); };
  std::stable_sort(rows.begin(), rows.end(), [&](const auto* a, const auto* b) { return key(a) < key(b); });
  for (auto begin = rows.begin(); begin != rows.end();) {
    const auto end = std::find_if(begin, rows.end(), [&](const auto* e) { return Group(*e) != Group(**begin); });
    AddGroup({begin, end});
    begin = end;
  }
  table_->resizeColumnsToContents();
  int widest = table_->horizontalHeader()->sectionSizeHint(0);  // of the runs: what stands across takes all columns
  for (const ErrorRecord* e : rows) {
    widest = std::max(widest, table_->fontMetrics().horizontalAdvance(Text(e->run)) + 12);
  }
  table_->setColumnWidth(0, widest);
  table_->setVisible(!rows.empty());
  note_->setText(rows.empty() ? tr("No answer of it is evaluated: run localize, then evaluate.")
                              : tr("Lengths in %1. Absolute: in site coordinates (east, north, up), with the "
                                   "georeference's error. Relative: in the run's own frame.")
                                    .arg(unit));
}

void StationCard::AddGroup(const std::vector<const ErrorRecord*>& rows) {
  VerdictErrors group;
  group.reference = rows.front()->reference;
  const int row = table_->rowCount();
  table_->insertRow(row);
  auto* item = new QTableWidgetItem(
      Text(rows.front()->kind + ", " + MethodName(rows.front()->method) + ", against " + group.Against()));
  QFont bold = table_->font();
  bold.setBold(true);
  item->setFont(bold);
  item->setFlags(Qt::ItemIsEnabled);
  item->setToolTip(item->text());
  item->setData(Qt::UserRole, object_);
  table_->setItem(row, 0, item);
  table_->setSpan(row, 0, 1, table_->columnCount());
  for (const ErrorRecord* e : rows) AddRow(*e);
}

void StationCard::AddRow(const ErrorRecord& e) {
  const auto length = [this](const std::optional<double>& metres) {
    return metres ? QString::number(*metres / workspace_->metres_per_unit(), 'f', kDecimals) : QString();
  };
  const auto part = [&](int k) {
    return length(e.error_enu_m ? std::optional<double>((*e.error_enu_m)(k)) : std::nullopt);
  };
  const int row = table_->rowCount();
  table_->insertRow(row);
  const auto put = [&](int column, const QString& text) {
    auto* item = new QTableWidgetItem(text);
    if (column > 0) item->setTextAlignment(static_cast<int>(Qt::AlignRight | Qt::AlignVCenter));
    item->setToolTip(Text(e.panorama));
    item->setData(Qt::UserRole, object_);
    table_->setItem(row, column, item);
    return item;
  };
  put(0, Text(e.run));
  if (!e.Answered()) {
    put(1, e.reason.empty() ? Text(e.status) : Text(e.status + ": " + e.reason))
        ->setTextAlignment(static_cast<int>(Qt::AlignLeft | Qt::AlignVCenter));
    table_->item(row, 1)->setToolTip(table_->item(row, 1)->text());
    table_->setSpan(row, 1, 1, table_->columnCount() - 1);
    return;
  }
  QTableWidgetItem* error = put(1, length(e.error_3d_m));
  const ErrorColours colours = ColoursOfError(*e.error_3d_m);
  error->setBackground(colours.background);
  error->setForeground(colours.text);
  for (int k = 0; k < 3; ++k) put(2 + k, part(k));
  put(5, length(SigmaInSpace(e)));
  const std::optional<double> tolerance = ToleranceOf(*e.error_3d_m);
  put(6, tolerance ? QString::number(*tolerance / workspace_->metres_per_unit(), 'g', 3) : tr("none"));
  put(7, e.nees && e.dof > 0 ? QString::number(*e.nees / e.dof, 'f', 2) : QString());
}

}  // namespace trigpoint

#include "app/desktop/station_card.h"

#include <QCheckBox>
#include <QHeaderView>
#include <QPushButton>
#include <QTableWidget>
#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "app/desktop/decisions.h"
#include "app/desktop/flow_layout.h"
#include "app/desktop/object_table.h"
#include "app/desktop/overview.h"
#include "app/desktop/report_text.h"
#include "app/desktop/tolerance.h"
#include "app/desktop/views_box.h"
#include "app/desktop/widgets.h"
#include "datasets/project/project.h"
#include "eval/text/method_name.h"

namespace trigpoint {

namespace {

constexpr int kDecimals = 3;    // of lengths
constexpr int kBesideText = 9;  // pixels of a cell, both sides together

auto Group(const ErrorRecord& e) { return std::tie(e.kind, e.reference, e.method); }

std::optional<double> SigmaInSpace(const ErrorRecord& e) {
  if (!e.sigma_e_m || !e.sigma_n_m || !e.sigma_u_m) return std::nullopt;
  return std::hypot(*e.sigma_e_m, *e.sigma_n_m, *e.sigma_u_m);
}

}  // namespace

StationCard::StationCard(Workspace* workspace, QWidget* parent) : QWidget(parent), workspace_(workspace) {
  title_ = WrappedLabel("card.title");
  note_ = WrappedLabel("card.note");
  views_ = MakeViewsBox("card.views");
  table_ = Named(new QTableWidget, "card.table", tr("Errors of the selected station"));
  table_->setEditTriggers(QAbstractItemView::NoEditTriggers);
  table_->setSelectionBehavior(QAbstractItemView::SelectRows);
  table_->setWordWrap(false);
  table_->verticalHeader()->hide();
  table_->verticalHeader()->setDefaultSectionSize(table_->fontMetrics().height() + 6);
  buttons_ = new QWidget;
  auto* buttons = new FlowLayout(buttons_);
  const auto add = [&](const char* name, const QString& text, auto clicked) {
    auto* button = MakeButton(name, text);
    buttons->addWidget(button);
    connect(button, &QPushButton::clicked, this, [this, button, clicked] { clicked(button); });
  };
  add("card.scene", tr("Show in &3D"), [this](QPushButton*) { emit SceneRequested(object_); });
  add("card.image", tr("Best &image"), [this](QPushButton*) { emit ImageRequested(object_); });
  add("card.decide", tr("&Decide ..."),
      [this](QPushButton* button) { workspace_->AskMenu(object_, button->mapToGlobal(QPoint(0, button->height()))); });
  InColumn({title_, {table_, 1}, note_, views_, buttons_}, this)->setContentsMargins(4, 4, 4, 4);
  AskMenuOn(table_, workspace_, Qt::UserRole);
  connect(table_, &QTableWidget::cellActivated, this, [this] { emit ImageRequested(object_); });
  connect(views_, &QCheckBox::toggled, this, &StationCard::Show);
  connect(workspace_, &Workspace::Selected, this, &StationCard::Show);
  connect(workspace_, &Workspace::UnitChanged, this, &StationCard::Show);
  connect(workspace_, &Workspace::ResultsChanged, this, &StationCard::Show);
  connect(workspace_, &Workspace::Replaced, this, [this] { SetOverview(nullptr); });
  Show();
}

void StationCard::SetOverview(std::shared_ptr<const Overview> overview) {
  overview_ = std::move(overview);
  Show();
}

void StationCard::SetVariant(const QString& variant) {
  if (variant == variant_) return;
  variant_ = variant;
  Show();
}

bool StationCard::IsShown(const std::string& station, const std::string& panorama) const {
  return Text(object_.startsWith("station:") ? station : panorama) == object_.section(':', 1);
}

void StationCard::Show() {
  object_ = Text(StationShown(overview_.get(), workspace_->related(), workspace_->selected().toStdString()));
  table_->setRowCount(0);
  table_->clearSpans();
  const bool any = workspace_->snapshot() && overview_ && !object_.isEmpty();
  for (QWidget* widget : {static_cast<QWidget*>(table_), static_cast<QWidget*>(note_), buttons_}) {
    widget->setVisible(any);
  }
  views_->hide();
  if (!any) {
    title_->setText(tr("Select a station: in the plan, a table, a chart, the scene, or the tree."));
    return;
  }
  ShowTitle();
  ShowHeader();
  ShowErrors();
  const bool errors = table_->rowCount() > 0;
  if (!errors) ShowAnswers();
  const bool answers = table_->rowCount() > 0;
  for (int column = 0; column < table_->columnCount(); ++column) {
    int widest = table_->fontMetrics().horizontalAdvance(table_->horizontalHeaderItem(column)->text()) + kBesideText;
    for (int row = 0; row < table_->rowCount(); ++row) {
      const QTableWidgetItem* item = table_->item(row, column);
      // A title or a reason stands across: it makes no column wide.
      if (item == nullptr || table_->columnSpan(row, column) > 1) continue;
      widest = std::max(widest, table_->fontMetrics().horizontalAdvance(item->text()) + kBesideText);
    }
    table_->setColumnWidth(column, widest);
  }
  table_->setVisible(answers);
  note_->setText(Note(errors, answers));
}

void StationCard::ShowTitle() {
  QString tag;
  for (const SnapshotStation& s : workspace_->snapshot()->stations) {
    if (object_ == Text("station:" + s.name) && s.tag_id >= 0) tag = tr(", tag %1").arg(s.tag_id);
  }
  const QString excluded = ExclusionText(*workspace_, object_.toStdString(), true);
  title_->setText("<b>" +
                  (object_.startsWith("station:") ? tr("Station %1%2") : tr("Panorama %1%2"))
                      .arg(object_.section(':', 1).toHtmlEscaped(), tag) +
                  "</b>" + (excluded.isEmpty() ? "" : "<br>" + excluded.toHtmlEscaped()));
}

void StationCard::ShowHeader() {
  const QString unit = workspace_->unit();
  const QStringList header{tr("run"), tr("3D"),      QString::fromUtf8("\xcf\x83 3D"), tr("tol."), "dE", "dN",
                           "dU",      tr("NEES/dof")};
  table_->setColumnCount(header.size());
  table_->setHorizontalHeaderLabels(header);
  const QStringList help{tr("run, and what was answered"),
                         tr("error in space (%1)").arg(unit),
                         tr("1 sigma of the difference in space (%1)").arg(unit),
                         tr("the tolerance that the error keeps, of 0.1, 0.25, 0.5 and 1 m (%1)").arg(unit),
                         tr("error to the east (%1)").arg(unit),
                         tr("error to the north (%1)").arg(unit),
                         tr("error upwards (%1)").arg(unit),
                         tr("squared error in its own sigmas, by degrees of freedom: about 1 if the sigmas are right")};
  SetHeaderHelp(table_, help);
}

void StationCard::ShowErrors() {
  std::vector<const ErrorRecord*> rows;
  bool views = false;
  for (const ErrorRecord& e : overview_->errors) {
    if (!IsShown(e.station, e.panorama) || Text(e.variant) != variant_) continue;
    views |= e.method == "g1";
    if (e.method != "g1" || views_->isChecked()) rows.push_back(&e);
  }
  views_->setVisible(views);
  // As the overview compares first: absolute before relative, final answers before views.
  const auto key = [](const ErrorRecord* e) { return std::tuple(e->method == "g1", Group(*e), e->panorama, e->run); };
  std::stable_sort(rows.begin(), rows.end(), [&](const auto* a, const auto* b) { return key(a) < key(b); });
  for (auto begin = rows.begin(); begin != rows.end();) {
    const auto end = std::find_if(begin, rows.end(), [&](const auto* e) { return Group(*e) != Group(**begin); });
    AddGroup({begin, end});
    begin = end;
  }
}

void StationCard::ShowAnswers() {
  std::vector<const OverviewAnswer*> rows;
  for (const OverviewAnswer& a : overview_->answers) {
    if (IsShown(a.station, a.panorama) && Text(a.variant) == variant_) rows.push_back(&a);
  }
  std::stable_sort(rows.begin(), rows.end(), [](const auto* a, const auto* b) { return a->panorama < b->panorama; });
  std::string titled;
  for (const OverviewAnswer* answer : rows) {
    const OverviewAnswer& a = *answer;
    TitlePanorama(a.panorama, &titled);
    const int row = table_->rowCount();
    table_->insertRow(row);
    Put(row, 0, Text(a.run), Text(a.panorama));
    QString text = ReportText(StatusName(a.status));
    if (a.status == "localized" && a.sigma_m) {
      text += QString::fromUtf8(", \xcf\x83 ") + workspace_->Length(*a.sigma_m, kDecimals) + tr(" (largest axis)");
    }
    if (!a.reason.empty()) text += ": " + ReportText(a.reason);
    PutAcross(row, 1, text, text);
  }
}

bool StationCard::HasGroundTruth() const {
  const Site& site = workspace_->snapshot()->project->site();
  return !site.stations.empty() && (site.tags.Given() || !site.control_points.empty());
}

bool StationCard::NamesPanoramas() const {
  return object_.startsWith("station:") && overview_->places.HasSeveral(object_.section(':', 1).toStdString());
}

// In a row of its own: beside the run's name it would make the first column wide.
void StationCard::TitlePanorama(const std::string& panorama, std::string* titled) {
  if (!NamesPanoramas() || std::exchange(*titled, panorama) == panorama) return;
  const int row = table_->rowCount();
  table_->insertRow(row);
  const std::string name = overview_->places.PanoramaName(object_.section(':', 1).toStdString(), panorama);
  QTableWidgetItem* item = PutAcross(row, 0, Text(name), Text(panorama));
  const QString excluded = ExclusionText(*workspace_, "panorama:" + panorama, false);
  if (!excluded.isEmpty()) item->setToolTip(item->toolTip() + "\n" + excluded);
  QFont italic = table_->font();
  italic.setItalic(true);
  item->setFont(italic);
  item->setFlags(Qt::ItemIsEnabled);
  item->setData(Qt::UserRole, Text("panorama:" + panorama));
}

QString StationCard::Note(bool errors, bool answers) const {
  QString which;
  if (workspace_->snapshot()->variants.size() > 1) {
    which = tr("Results: %1.").arg(variant_.isEmpty() ? tr("the first ones") : tr("variant %1").arg(variant_)) + " ";
  }
  if (errors) {
    return which + tr("Lengths in %1. Absolute: in site coordinates (east, north, up), with the georeference's error. "
                      "Relative: in the run's own frame.")
                       .arg(workspace_->unit());
  }
  const auto& results = workspace_->results();
  const bool evaluated = std::any_of(results.begin(), results.end(), [](const SnapshotResult& r) {
    return r.stage == "evaluate" && (r.state == "done" || r.state == "out of date");
  });
  if (!answers) return which + tr("No run answers it: run localize.");
  if (!evaluated && !HasGroundTruth()) {
    return which + tr("Its answers are not compared: ground truth is missing (stations.csv, and tags.yaml or "
                      "control_points.csv).");
  }
  return which + (evaluated ? tr("There is no reference to compare its answers with.")
                            : tr("Its answers are not compared yet: run evaluate."));
}

QTableWidgetItem* StationCard::Put(int row, int column, const QString& text, const QString& help) {
  auto* item = new QTableWidgetItem(text);
  if (column > 0) item->setTextAlignment(static_cast<int>(Qt::AlignRight | Qt::AlignVCenter));
  item->setToolTip(help);
  item->setData(Qt::UserRole, object_);
  table_->setItem(row, column, item);
  return item;
}

QTableWidgetItem* StationCard::PutAcross(int row, int from, const QString& text, const QString& help) {
  QTableWidgetItem* item = Put(row, from, text, help);
  item->setTextAlignment(static_cast<int>(Qt::AlignLeft | Qt::AlignVCenter));
  table_->setSpan(row, from, 1, table_->columnCount() - from);
  return item;
}

// In two lines, so that it is read beside a narrow table.
void StationCard::AddTitle(const QString& text, const QString& below) {
  const int row = table_->rowCount();
  table_->insertRow(row);
  QTableWidgetItem* item = PutAcross(row, 0, text + "\n" + below, text + ", " + below);
  QFont bold = table_->font();
  bold.setBold(true);
  item->setFont(bold);
  item->setFlags(Qt::ItemIsEnabled);
  table_->setRowHeight(row, 2 * table_->fontMetrics().lineSpacing() + 6);
}

void StationCard::AddGroup(const std::vector<const ErrorRecord*>& rows) {
  const ErrorRecord& first = *rows.front();
  AddTitle(ReportText(first.kind + ", " + MethodName(first.method)),
           ReportText("against " + ReferenceName(first.reference)));
  std::string titled;
  for (const ErrorRecord* e : rows) {
    TitlePanorama(e->panorama, &titled);
    AddRow(*e);
  }
}

void StationCard::AddRow(const ErrorRecord& e) {
  const auto length = [this](const std::optional<double>& metres) {
    return metres ? QString::number(*metres / workspace_->metres_per_unit(), 'f', kDecimals) : QString();
  };
  const int row = table_->rowCount();
  table_->insertRow(row);
  const auto put = [&](int column, const QString& text) { return Put(row, column, text, Text(e.panorama)); };
  put(0, Text(e.run));
  if (!e.Answered()) {
    const QString text =
        e.reason.empty() ? ReportText(StatusName(e.status)) : ReportText(StatusName(e.status) + ": " + e.reason);
    PutAcross(row, 1, text, text);
    return;
  }
  QTableWidgetItem* error = put(1, length(e.error_3d_m));
  const ErrorColours colours = ColoursOfError(*e.error_3d_m);
  error->setBackground(colours.background);
  error->setForeground(colours.text);
  put(2, length(SigmaInSpace(e)));
  const std::optional<double> tolerance = ToleranceOf(*e.error_3d_m);
  put(3, tolerance ? QString::number(*tolerance / workspace_->metres_per_unit(), 'g', 3) : tr("none"));
  for (int k = 0; k < 3; ++k) {
    put(4 + k, length(e.error_enu_m ? std::optional<double>((*e.error_enu_m)(k)) : std::nullopt));
  }
  put(7, e.nees && e.dof > 0 ? QString::number(*e.nees / e.dof, 'f', 2) : QString());
}

}  // namespace trigpoint

#include "app/desktop/charts_desk.h"

#include <QFileDialog>
#include <QListWidget>
#include <QMenu>
#include <QPushButton>
#include <algorithm>
#include <set>

#include "app/desktop/background.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/report_text.h"
#include "app/desktop/widgets.h"

namespace trigpoint {

namespace {

constexpr double kRing_px = 18;        // about a mark, in the picture
constexpr size_t kMostListed = 30;     // objects of a bar in its menu
constexpr const char* kBars = "bars";  // layer of the bars that are marked

}  // namespace

void ShowDrawing(PictureView* view, const PaintedDrawing& drawing, const QString& title) {
  std::vector<PictureMark> marks;
  for (const Spot& spot : drawing.spots) {
    PictureMark mark;
    mark.kind = PictureMark::Kind::kCircle;
    mark.points << QPointF(spot.x, spot.y) << QPointF(kRing_px, 0);
    mark.colour = QColor(0, 0, 0, 0);  // the picture has it; what is selected gets its ring
    mark.object = Text(spot.object);
    marks.push_back(mark);
  }
  view->SetPicture(
      QImage::fromData(reinterpret_cast<const uchar*>(drawing.png.data()), static_cast<int>(drawing.png.size()), "PNG"),
      "");  // a title would cover its legend
  view->setAccessibleDescription(title);
  view->SetMarks(std::move(marks));
}

void HighlightSelected(PictureView* view, const Workspace& workspace) {
  QString marked = workspace.selected();
  const auto drawn = [view](const QString& object) {
    return std::any_of(view->marks().begin(), view->marks().end(), [&](const auto& m) { return m.object == object; });
  };
  for (const std::string& related : workspace.related()) {
    if (drawn(marked)) break;
    marked = Text(related);
  }
  view->SetHighlight(marked);
}

ChartsDesk::ChartsDesk(Workspace* workspace, QWidget* parent) : QWidget(parent), workspace_(workspace) {
  list_ = Named(new QListWidget, "charts.list", tr("Charts"));
  list_->setWordWrap(true);
  list_->setAlternatingRowColors(true);
  view_ = Named(new PictureView, "charts.view", tr("Chart"));
  caption_ = Selectable(WrappedLabel("charts.caption"));
  auto* save =
      MakeButton("charts.save", tr("&Save chart ..."), tr("The chart as PNG; the report has all of them as SVG, too"));
  auto* right = Pane({{view_, 1}, InRow({{caption_, 1}, {save, 0, Qt::AlignTop}})});
  auto* split = InSplitter(Qt::Horizontal, {list_, right}, {230, 900});
  split->setStretchFactor(1, 1);
  InColumn({split}, this);

  connect(list_, &QListWidget::currentRowChanged, this, &ChartsDesk::ShowChart);
  connect(save, &QPushButton::clicked, this, &ChartsDesk::Save);
  connect(view_, &PictureView::Clicked, this, [this](const QPointF& pixel, const QString& object) {
    if (object.isEmpty()) return ListGroup(pixel);
    workspace_->Select(object);
  });
  connect(view_, &PictureView::DoubleClicked, this, [this](const QString& object) {
    if (!object.isEmpty()) emit Activated(object);
  });
  connect(view_, &PictureView::MenuAsked, workspace_, &Workspace::AskMenu);
  connect(workspace_, &Workspace::Selected, this, &ChartsDesk::ShowSelected);
  connect(workspace_, &Workspace::Replaced, this, [this] {
    ++generation_;
    charts_.clear();
    list_->clear();
    ShowChart();
  });
  connect(workspace_, &Workspace::Opened, this, &ChartsDesk::Load);
  connect(workspace_, &Workspace::UnitChanged, this, &ChartsDesk::Load);
  ShowChart();
}

void ChartsDesk::showEvent(QShowEvent* event) {
  QWidget::showEvent(event);
  if (stale_) Load();
}

void ChartsDesk::Load() {
  const int generation = ++generation_;
  stale_ = workspace_->snapshot() && !isVisible();
  if (!workspace_->snapshot() || stale_) return;
  if (charts_.empty()) view_->SetPicture({}, tr("Drawing ..."));
  const DisplayUnit& unit = workspace_->display_unit();
  InBackground(
      this, [snapshot = workspace_->snapshot(), unit] { return LoadCharts(*snapshot, unit); },
      [this, generation](const Attempted<std::vector<NamedChart>>& loaded) {
        if (generation != generation_) return;
        if (!loaded.error.isEmpty()) emit workspace_->Problem(loaded.error, tr("The charts are not shown."));
        const QListWidgetItem* item = list_->currentItem();
        const QString before = item == nullptr ? QString() : item->data(Qt::UserRole).toString();
        charts_ = loaded.value;
        {
          const QSignalBlocker block(list_);
          list_->clear();
          for (const NamedChart& chart : charts_) {
            auto* entry = new QListWidgetItem(ReportText(chart.title), list_);
            entry->setData(Qt::UserRole, Text(chart.name));
            entry->setToolTip(ReportText(chart.caption));
          }
        }
        if (!Choose(before)) list_->setCurrentRow(0);
        ShowChart();
        emit Loaded();
      });
}

bool ChartsDesk::Choose(const QString& name) {
  for (int row = 0; row < list_->count(); ++row) {
    if (list_->item(row)->data(Qt::UserRole).toString() != name) continue;
    list_->setCurrentRow(row);
    return true;
  }
  return false;
}

const NamedChart* ChartsDesk::Chosen() const {
  const int row = list_->currentRow();
  return row < 0 || row >= static_cast<int>(charts_.size()) ? nullptr : &charts_[static_cast<size_t>(row)];
}

void ChartsDesk::ShowChart() {
  const NamedChart* chart = Chosen();
  if (chart == nullptr) {
    caption_->clear();
    view_->SetMarks({});
    view_->SetPicture({}, tr("No chart yet: run evaluate, then they are drawn here as in the report."));
    return;
  }
  ShowDrawing(view_, chart->painted, ReportText(chart->title));
  caption_->setText(ReportText(chart->caption));
  ShowSelected();
}

void ChartsDesk::ShowSelected() {
  MarkBars();
  HighlightSelected(view_, *workspace_);
}

void ChartsDesk::MarkBars() {
  const NamedChart* chart = Chosen();
  if (chart == nullptr || chart->painted.groups.empty()) return;
  std::vector<PictureMark> marks = view_->marks();
  std::erase_if(marks, [](const PictureMark& mark) { return mark.layer == kBars; });
  for (const SpotGroup& g : chart->painted.groups) {
    const std::set<std::string>& selected = workspace_->related();
    if (std::none_of(g.objects.begin(), g.objects.end(), [&](const auto& o) { return selected.count(o) > 0; })) {
      continue;
    }
    PictureMark mark;
    mark.kind = PictureMark::Kind::kOutline;
    mark.layer = kBars;
    mark.points = QPolygonF(QRectF(g.x, g.y, g.width, g.height));
    mark.colour = QColor(0, 0, 0, 0);
    mark.strong = true;
    marks.push_back(mark);
  }
  view_->SetMarks(std::move(marks));
}

void ChartsDesk::ListGroup(const QPointF& pixel) {
  const NamedChart* chart = Chosen();
  if (chart == nullptr) return;
  for (const SpotGroup& g : chart->painted.groups) {
    if (!QRectF(g.x, g.y, g.width, g.height).contains(pixel)) continue;
    auto* menu = new QMenu(this);
    menu->setObjectName("charts.group");
    menu->setAttribute(Qt::WA_DeleteOnClose);
    menu->addSection(tr("In this bar: %1").arg(g.objects.size()));
    for (size_t i = 0; i < std::min(g.objects.size(), kMostListed); ++i) {
      const QString object = Text(g.objects[i]);
      menu->addAction(object, this, [this, object] { workspace_->Select(object); });
    }
    if (g.objects.size() > kMostListed) {
      menu->addSection(
          tr("These have the largest values; %1 more are not listed.").arg(g.objects.size() - kMostListed));
    }
    menu->popup(view_->mapToGlobal(view_->WidgetAt(pixel).toPoint()));
    return;
  }
}

void ChartsDesk::Save() {
  if (view_->image().isNull()) return;
  QFileDialog dialog(this, tr("Save the chart"), QString(), tr("PNG (*.png)"));
  dialog.setAcceptMode(QFileDialog::AcceptSave);
  dialog.setDefaultSuffix("png");
  dialog.selectFile(list_->currentItem()->data(Qt::UserRole).toString() + ".png");
  if (dialog.exec() != QDialog::Accepted || dialog.selectedFiles().isEmpty()) return;
  const QString file = dialog.selectedFiles().first();
  if (!view_->image().save(file)) emit workspace_->Problem(tr("%1: cannot be written").arg(file), "");
}

}  // namespace trigpoint

#include "app/desktop/check_desk.h"

#include <QDesktopServices>
#include <QPushButton>
#include <QResizeEvent>
#include <QTableWidget>
#include <QThread>
#include <QTimer>
#include <QUrl>

#include "app/desktop/charts.h"
#include "app/desktop/charts_desk.h"
#include "app/desktop/contrast.h"
#include "app/desktop/object_table.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/polled_progress.h"
#include "app/desktop/widgets.h"
#include "app/pipeline/check_project.h"
#include "calib/base/error.h"
#include "eval/intake/watch.h"

namespace trigpoint {

namespace {

constexpr int kLook_ms = 200;    // between two looks at how far it is
constexpr double kMapScale = 2;  // pixels a unit of the drawing
constexpr uint64_t kSeed = 1;    // as the command's
constexpr double kMmPerMetre = 1e3;

QColor ColourOfLight(Light light) {
  return light == Light::kGreen   ? QColor(0, 120, 79)
         : light == Light::kAmber ? QColor(199, 124, 0)
                                  : QColor(192, 57, 43);
}

// Of runs, of photo sets, and panoramas.
size_t PicturesOf(const Snapshot& snapshot) {
  size_t pictures = snapshot.references.size();
  for (const SnapshotRun& run : snapshot.runs) pictures += run.images.size();
  for (const SnapshotReference& r : snapshot.references) pictures += r.kind == "photo set" ? r.files.size() : 0;
  return pictures;
}

size_t PicturesOf(const CheckOutcome& outcome) {
  size_t pictures = outcome.facts.site == nullptr ? 0 : outcome.facts.site->references.size();
  for (const FieldSet& set : outcome.facts.sets) pictures += static_cast<size_t>(set.photos);
  return pictures + static_cast<size_t>(outcome.pictures);
}

void AddRow(QTableWidget* table, const QStringList& cells, const QColor& first, const QString& object = "") {
  const int row = table->rowCount();
  table->insertRow(row);
  for (int c = 0; c < cells.size(); ++c) {
    auto* item = new QTableWidgetItem(cells[c]);
    item->setToolTip(cells[c]);
    if (!object.isEmpty()) item->setData(Qt::UserRole, object);
    if (c == 0 && first.isValid()) {
      item->setForeground(first);
      QFont bold = table->font();
      bold.setBold(true);
      item->setFont(bold);
    }
    table->setItem(row, c, item);
  }
}

}  // namespace

CheckDesk::CheckDesk(Workspace* workspace, QWidget* parent) : QWidget(parent), workspace_(workspace) {
  MakeWidgets();
  connect(check_, &QPushButton::clicked, this, [this] { Start(false); });
  connect(watch_, &QPushButton::clicked, this, [this] { Start(true); });
  connect(stop_, &QPushButton::clicked, this, &CheckDesk::Stop);
  connect(page_, &QPushButton::clicked, this, &CheckDesk::OpenPage);
  connect(timer_, &QTimer::timeout, this, [this] {
    if (work_ && !work_->Text().isEmpty()) status_->setText(work_->Text());
  });
  connect(map_, &PictureView::Clicked, this, [this](const QPointF&, const QString& object) {
    if (!object.isEmpty()) workspace_->Select(object);
  });
  connect(map_, &PictureView::MenuAsked, workspace_, &Workspace::AskMenu);
  LinkTable(tags_, workspace_);
  connect(workspace_, &Workspace::Selected, map_, [this] { HighlightSelected(map_, *workspace_); });
  connect(workspace_, &Workspace::UnitChanged, this, &CheckDesk::Show);
  connect(workspace_, &Workspace::Replaced, this, [this] {  // another folder: its pictures are not watched any more
    Stop();
    outcome_.reset();
    Show();
  });
  connect(workspace_, &Workspace::Opened, this, &CheckDesk::Show);
  connect(workspace_, &Workspace::Closed, this, &CheckDesk::Show);
  Show();
}

void CheckDesk::MakeWidgets() {
  headline_ = Selectable(WrappedLabel("check.headline"));
  Enlarge(headline_, 1.3);
  status_ = WrappedLabel("check.status");
  check_ =
      MakeButton("check.check", tr("&Check now"), tr("Look once at every picture that is there (trigpoint check)"));
  watch_ = MakeButton("check.watch", tr("&Watch"), tr("Go on as pictures are copied here (trigpoint check --watch)"));
  stop_ = MakeButton("check.stop", tr("S&top"), tr("What was looked at is kept; a later check goes on there"));
  page_ = MakeButton("check.page", tr("Open the &page"), tr("results/check/index.html in the browser"));
  next_ = MakeTable("check.next", tr("What to do next"), {tr("what to do next"), tr("why")});
  findings_ = MakeTable("check.findings", tr("Findings"), {tr("light"), tr("topic"), tr("finding")});
  tags_ = MakeTable("check.tags", tr("Tags"),
                    {tr("tag"), tr("status"), tr("pictures"), tr("largest (px)"), tr("nearest"), tr("from (deg)"),
                     tr("to (deg)"), tr("3D sigma (mm)"), tr("there for")});
  const QStringList help{tr("id"),
                         tr("of the tag in the map"),
                         tr("that show it"),
                         tr("its longest side in any of them"),
                         tr("distance of the nearest of them"),
                         tr("leftmost direction that the tag was photographed from, as an angle from its normal, for a "
                            "viewer who faces the tag"),
                         tr("rightmost direction that the tag was photographed from, as an angle from its normal, for "
                            "a viewer who faces the tag"),
                         tr("predicted, 1 sigma"),
                         tr("what the tag is needed for")};
  SetHeaderHelp(tags_, help);
  SetHeaderHelp(next_, {tr("what helps most comes first"), tr("what is missing, or what it improves")});
  SetHeaderHelp(findings_, {tr("red: the recordings do not suffice yet; amber: look at it before you leave; green: no "
                               "problem found"),
                            tr("what was looked at"), tr("what was found")});
  map_ = Named(new PictureView, "check.map", tr("Map of the check"));
  timer_ = new QTimer(this);
  timer_->setInterval(kLook_ms);
  auto* buttons = InFlow({check_, watch_, stop_, page_});
  auto* left = InSplitter(Qt::Vertical, {next_, findings_, tags_}, {150, 250, 220});
  split_ = InSplitter(Qt::Horizontal, {left, map_}, {600, 500});
  InColumn({headline_, buttons, status_, {split_, 1}}, this);
}

CheckDesk::~CheckDesk() {
  if (thread_ == nullptr) return;
  disconnect(thread_, nullptr, this, nullptr);
  work_->cancel.Cancel();
  thread_->wait();
  delete thread_;
}

void CheckDesk::resizeEvent(QResizeEvent* event) {
  QWidget::resizeEvent(event);
  if (TurnToFit(split_, width())) split_->setSizes({1000, 1000});
}

void CheckDesk::changeEvent(QEvent* event) {
  QWidget::changeEvent(event);
  if (event->type() == QEvent::PaletteChange) Show();
}

void CheckDesk::Start(bool watch) {
  if (thread_ != nullptr || !workspace_->snapshot()) return;
  known_ = PicturesOf(*workspace_->snapshot());
  work_ = std::make_shared<PolledProgress>();
  const auto error = std::make_shared<QString>();
  const DisplayUnit& unit = workspace_->display_unit();
  thread_ = QThread::create([this, dir = workspace_->snapshot()->dir, unit, watch, work = work_, error] {
    const auto show = [this, work](const CheckOutcome& judged) {
      QMetaObject::invokeMethod(
          this,
          [this, work, outcome = std::make_shared<const CheckOutcome>(judged)] {
            if (work == work_ && !work->cancel.IsCancelled()) Take(outcome);  // else of a folder that was closed
          },
          Qt::QueuedConnection);
    };
    try {
      SiteCheck check(dir, SourcesOfProject(), 0, kSeed);
      CheckOutcome outcome = CheckSite(check, unit, watch, *work, work->cancel);
      show(outcome);
      if (watch) {
        WatchSite(check, unit, std::move(outcome), *work, work->cancel, [&](const auto& now, size_t) { show(now); });
      }
    } catch (const Cancelled&) {
      // asked for
    } catch (const std::exception& e) {
      *error = QString::fromUtf8(e.what());
    }
  });
  connect(thread_, &QThread::finished, this, [this, error, watch] {
    thread_->deleteLater();
    thread_ = nullptr;
    work_.reset();
    timer_->stop();
    status_->setText(!error->isEmpty() ? *error : watch ? tr("Not watched any more.") : tr("Done."));
    if (!error->isEmpty()) emit workspace_->Problem(*error, tr("The folder was not checked."));
    ShowButtons();
    emit Ended();
  });
  status_->setText(tr("Looking ..."));
  timer_->start();
  thread_->start(QThread::LowPriority);
  ShowButtons();
}

void CheckDesk::Take(std::shared_ptr<const CheckOutcome> outcome) {
  outcome_ = std::move(outcome);
  Show();
  emit Judged();
  if (const size_t found = PicturesOf(*outcome_); found != known_) {
    known_ = found;
    workspace_->Reload();
  }
}

void CheckDesk::Stop() {
  if (!work_) return;
  work_->cancel.Cancel();
  status_->setText(tr("Stopping ..."));
  timer_->stop();
}

void CheckDesk::OpenPage() {
  const QString file = workspace_->dir() + "/results/check/index.html";
  if (!QDesktopServices::openUrl(QUrl::fromLocalFile(file))) {
    emit workspace_->Problem(tr("No program opens the page: %1").arg(file), "");
  }
}

void CheckDesk::ShowButtons() {
  const bool open = workspace_->snapshot() != nullptr;
  check_->setEnabled(open && !running());
  watch_->setEnabled(open && !running());
  stop_->setEnabled(running());
  page_->setEnabled(open && QFileInfo::exists(workspace_->dir() + "/results/check/index.html"));
}

void CheckDesk::Show() {
  ShowButtons();
  const QColor ground = palette().color(QPalette::Base);
  for (QTableWidget* table : {next_, findings_}) table->setRowCount(0);
  if (!outcome_) {
    headline_->setStyleSheet("");
    headline_->setText(workspace_->snapshot() ? tr("Do the recordings suffice? Watch this folder while pictures are "
                                                   "copied into it, or check it once, before you leave the site.")
                                              : tr("Open the folder that the camera's pictures are copied to."));
    map_->SetMarks({});
    map_->SetPicture({}, tr("The map of the tags and of where to stand next is drawn here."));
    return ShowTags();
  }
  headline_->setText(Text(CheckHeadline(*outcome_)));
  headline_->setStyleSheet(
      QString("color: %1;").arg(ReadableOn(palette().color(QPalette::Window), ColourOfLight(outcome_->light)).name()));
  const auto in_unit = [this](const LengthText& text) {
    return Text(text.In(workspace_->unit().toStdString(), workspace_->metres_per_unit()));
  };
  for (const Advice& advice : outcome_->advice) {
    AddRow(next_, {in_unit(advice.what), Text(advice.why)}, QColor());
  }
  if (outcome_->advice.empty()) {
    AddRow(next_, {Text(NothingNext(outcome_->facts, outcome_->light == Light::kGreen)), ""}, QColor());
  }
  for (const SiteFinding& f : outcome_->findings) {
    AddRow(findings_, {Text(LightName(f.light)), Text(f.topic), in_unit(f.text)},
           ReadableOn(ground, ColourOfLight(f.light)));
  }
  next_->setColumnWidth(0, next_->viewport()->width() / 2);
  for (int c = 0; c < 2; ++c) findings_->resizeColumnToContents(c);
  for (QTableWidget* table : {next_, findings_}) table->resizeRowsToContents();
  if (const auto map = CheckMap(*outcome_, workspace_->display_unit())) {
    ShowDrawing(map_, PaintDrawing(*map, kMapScale), tr("tags, the way so far, where to stand next"));
  } else {
    map_->SetMarks({});
    map_->SetPicture({}, outcome_->facts.map_problem.empty() ? tr("No map yet: too few tags were seen.")
                                                             : Text(outcome_->facts.map_problem));
  }
  HighlightSelected(map_, *workspace_);
  ShowTags();
}

void CheckDesk::ShowTags() {
  const QSignalBlocker block(tags_);
  tags_->setRowCount(0);
  if (!outcome_) return;
  tags_->horizontalHeaderItem(4)->setText(tr("nearest (%1)").arg(workspace_->unit()));
  const auto number = [](bool there, double value, int decimals) {
    return there ? QString::number(value, 'f', decimals) : QString("-");
  };
  for (const TagCoverage& tag : CoverTags(outcome_->facts)) {
    const auto planned = outcome_->facts.planned.find(tag.tag_id);
    const bool placed = tag.nearest_m.has_value();
    AddRow(
        tags_,
        {QString::number(tag.tag_id), Text(tag.status), QString::number(tag.pictures), number(true, tag.largest_px, 0),
         number(placed, tag.nearest_m.value_or(0) / workspace_->metres_per_unit(), 1), number(placed, tag.left_deg, 0),
         number(placed, tag.right_deg, 0),
         number(tag.sigma_m.has_value(), tag.sigma_m ? kMmPerMetre * tag.sigma_m->norm() : 0, 1),
         planned != outcome_->facts.planned.end() ? Text(planned->second.what) : tr("not planned")},
        QColor(), "tag:" + QString::number(tag.tag_id));
  }
  tags_->resizeColumnsToContents();
  ShowSelectedRows(tags_, *workspace_);
}

}  // namespace trigpoint

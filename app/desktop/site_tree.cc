#include "app/desktop/site_tree.h"

#include <QApplication>
#include <QHeaderView>
#include <QMenu>

#include "app/desktop/contrast.h"

namespace trigpoint {

namespace {

constexpr int kObject = Qt::UserRole, kStage = Qt::UserRole + 1, kRun = Qt::UserRole + 2, kVariant = Qt::UserRole + 3;
constexpr int kMostImages = 20000;  // listed below a run
constexpr int kMostUnfolded = 12;   // entries of a group that is open from the beginning

}  // namespace

QColor ColourOfState(const std::string& state) {
  const QColor colour = state == "done"          ? QColor(0, 158, 115)
                        : state == "failed"      ? QColor(213, 94, 0)
                        : state == "out of date" ? QColor(230, 159, 0)
                        : state == "running"     ? QColor(0, 114, 178)
                                                 : QColor(128, 128, 128);
  return ReadableOn(QApplication::palette().color(QPalette::Base), colour);
}

QString TextOfState(const std::string& state) {
  [[maybe_unused]] static const char* kWords[] = {
      QT_TRANSLATE_NOOP("trigpoint::SiteTree", "missing"),     QT_TRANSLATE_NOOP("trigpoint::SiteTree", "done"),
      QT_TRANSLATE_NOOP("trigpoint::SiteTree", "out of date"), QT_TRANSLATE_NOOP("trigpoint::SiteTree", "failed"),
      QT_TRANSLATE_NOOP("trigpoint::SiteTree", "running"),     QT_TRANSLATE_NOOP("trigpoint::SiteTree", "not needed")};
  return state.empty() ? SiteTree::tr("checking ...") : SiteTree::tr(state.c_str());
}

SiteTree::SiteTree(Workspace* workspace, QWidget* parent) : QTreeWidget(parent), workspace_(workspace) {
  setObjectName("site.tree");
  setAccessibleName(tr("Site"));
  setColumnCount(2);
  setHeaderLabels({tr("site"), tr("state")});
  header()->setStretchLastSection(false);
  header()->setSectionResizeMode(0, QHeaderView::Stretch);
  header()->setSectionResizeMode(1, QHeaderView::ResizeToContents);
  setTextElideMode(Qt::ElideLeft);  // of a path the end tells
  setUniformRowHeights(true);
  setMinimumWidth(30 * fontMetrics().averageCharWidth());
  setContextMenuPolicy(Qt::CustomContextMenu);
  connect(this, &QTreeWidget::customContextMenuRequested, this, &SiteTree::Menu);
  const auto select = [this](const QTreeWidgetItem* item) {
    if (!showing_ && item != nullptr && !item->data(0, kObject).toString().isEmpty()) {
      workspace_->Select(item->data(0, kObject).toString());
    }
  };
  connect(this, &QTreeWidget::currentItemChanged, this, select);
  connect(this, &QTreeWidget::itemClicked, this, select);  // also on what is marked for something that belongs to it
  connect(this, &QTreeWidget::itemActivated, this, [this](QTreeWidgetItem* item) {
    if (!item->data(0, kStage).toString().isEmpty()) {
      AskForRun(item);
    } else if (!item->data(0, kObject).toString().isEmpty()) {
      emit Activated(item->data(0, kObject).toString());
    }
  });
  connect(workspace_, &Workspace::Replaced, this, [this] {
    results_ = nullptr;
    clear();
  });
  connect(workspace_, &Workspace::Opened, this, &SiteTree::Refresh);
  connect(workspace_, &Workspace::Closed, this, &SiteTree::Refresh);
  connect(workspace_, &Workspace::ResultsChanged, this, &SiteTree::ShowStates);
  connect(workspace_, &Workspace::Selected, this, &SiteTree::ShowSelected);
}

QTreeWidgetItem* SiteTree::AddGroup(const QString& text) {
  auto* group = new QTreeWidgetItem(this, {text});
  group->setFlags(group->flags() & ~Qt::ItemIsSelectable);
  return group;
}

QTreeWidgetItem* SiteTree::AddObject(QTreeWidgetItem* group, const QString& text, const QString& object) {
  auto* item = new QTreeWidgetItem(group, {text});
  item->setData(0, kObject, object);
  if (workspace_->snapshot()->excluded.count(object.toStdString()) > 0) {
    item->setText(1, tr("excluded"));
    item->setForeground(1, ColourOfState("out of date"));
  }
  return item;
}

void SiteTree::Refresh() {
  showing_ = true;
  QStringList open;
  const auto name = [](const QTreeWidgetItem* group) { return group->text(0).section(' ', 0, 0); };
  for (int i = 0; i < topLevelItemCount(); ++i) {
    const QTreeWidgetItem* group = topLevelItem(i);
    if (group->isExpanded()) open << name(group);
    for (int k = 0; k < group->childCount(); ++k) {
      if (group->child(k)->isExpanded()) open << name(group) + "/" + group->child(k)->text(0);
    }
  }
  const bool first = topLevelItemCount() == 0;
  clear();
  results_ = nullptr;
  const auto& snapshot = workspace_->snapshot();
  if (!snapshot) {
    showing_ = false;
    return;
  }
  const auto text = [](const std::string& s) { return QString::fromStdString(s); };
  auto* runs = AddGroup(tr("runs (%1)").arg(snapshot->runs.size()));
  for (const SnapshotRun& run : snapshot->runs) {
    auto* item = new QTreeWidgetItem(runs, {text(run.name)});
    item->setToolTip(0, text(run.broken));
    item->setText(1, run.broken.empty() ? tr("%1 images").arg(run.images.size()) : tr("broken"));
    if (!run.broken.empty()) item->setForeground(1, ColourOfState("failed"));
    if (run.images.size() > kMostImages) continue;
    for (const SnapshotImage& image : run.images) {
      AddObject(item, text(image.file), text("image:" + run.name + "/" + image.file));
    }
  }
  const struct {
    QString title;
    const char* kind;
  } kKinds[] = {{tr("panoramas (%1)"), "panorama"}, {tr("photos (%1)"), "photo"}, {tr("sets (%1)"), "photo set"}};
  for (const auto& [title, kind] : kKinds) {
    std::vector<const SnapshotReference*> of_kind;
    for (const SnapshotReference& reference : snapshot->references) {
      if (reference.kind == kind) of_kind.push_back(&reference);
    }
    if (of_kind.empty()) continue;
    auto* group = AddGroup(title.arg(of_kind.size()));
    for (const SnapshotReference* reference : of_kind) {
      auto* item = AddObject(group, text(reference->name), text("panorama:" + reference->name));
      if (item->text(1).isEmpty()) item->setText(1, text(reference->station));
    }
  }
  if (!snapshot->stations.empty()) {
    auto* group = AddGroup(tr("stations (%1)").arg(snapshot->stations.size()));
    for (const SnapshotStation& station : snapshot->stations) {
      auto* item = AddObject(group, text(station.name), text("station:" + station.name));
      if (item->text(1).isEmpty()) item->setText(1, tr("tag %1").arg(station.tag_id));
    }
  }
  if (!snapshot->tags.empty()) {
    auto* group = AddGroup(tr("tags (%1)").arg(snapshot->tags.size()));
    for (const int tag : snapshot->tags) AddObject(group, QString::number(tag), "tag:" + QString::number(tag));
  }
  if (!snapshot->controls.empty()) {
    auto* group = AddGroup(tr("control (%1)").arg(snapshot->controls.size()));
    for (const SnapshotControl& control : snapshot->controls) {
      AddObject(group, text(control.name), text(control.object))->setText(1, text(control.role));
    }
  }
  results_ = AddGroup(tr("results"));
  FillResults();
  for (int i = 0; i < topLevelItemCount(); ++i) {
    QTreeWidgetItem* group = topLevelItem(i);
    group->setExpanded(first ? group->childCount() <= kMostUnfolded : open.contains(name(group)));
    for (int k = 0; k < group->childCount(); ++k) {
      group->child(k)->setExpanded(open.contains(name(group) + "/" + group->child(k)->text(0)));
    }
  }
  showing_ = false;
  ShowSelected();
}

void SiteTree::ShowStates() {
  if (results_ == nullptr) return;
  const bool open = results_->isExpanded();
  FillResults();
  results_->setExpanded(open);
}

void SiteTree::FillResults() {
  qDeleteAll(results_->takeChildren());
  for (const SnapshotResult& result : workspace_->results()) {
    auto* item = new QTreeWidgetItem(results_, {QString::fromStdString(result.title), TextOfState(result.state)});
    item->setData(0, kStage, QString::fromStdString(result.stage));
    item->setData(0, kRun, QString::fromStdString(result.run));
    item->setData(0, kVariant, QString::fromStdString(result.variant));
    item->setForeground(1, ColourOfState(result.state));
    item->setToolTip(0, QString::fromStdString(result.metric.Text(workspace_->display_unit())));
    item->setToolTip(1, QString::fromStdString(result.reason));
  }
}

void SiteTree::AskForRun(const QTreeWidgetItem* result) {
  emit RunRequested(result->data(0, kStage).toString(), result->data(0, kRun).toString(),
                    result->data(0, kVariant).toString());
}

QTreeWidgetItem* SiteTree::ResultItem(const QString& title) const {
  for (int i = 0; results_ != nullptr && i < results_->childCount(); ++i) {
    if (results_->child(i)->text(0) == title) return results_->child(i);
  }
  return nullptr;
}

QString SiteTree::StateOf(const QString& title) const {
  const QTreeWidgetItem* item = ResultItem(title);
  return item == nullptr ? "" : item->text(1);
}

void SiteTree::SetState(const QString& title, const QString& state) {
  QTreeWidgetItem* item = ResultItem(title);
  if (item == nullptr) return;
  const std::string name = state.toStdString();
  item->setText(1, TextOfState(name));
  item->setForeground(1, ColourOfState(name));
}

void SiteTree::ShowSelected() {
  if (showing_) return;
  const QString object = workspace_->selected();
  if (currentItem() != nullptr && currentItem()->data(0, kObject).toString() == object) return;
  QTreeWidgetItem* shown = nullptr;  // the object itself, else the first that belongs to it
  for (QTreeWidgetItemIterator it(this); *it != nullptr; ++it) {
    const QString of = (*it)->data(0, kObject).toString();
    if (of.isEmpty()) continue;
    if (shown == nullptr && workspace_->related().count(of.toStdString()) > 0) shown = *it;
    if (of != object) continue;
    shown = *it;
    break;
  }
  showing_ = true;
  // A folded group stays folded: a selection on another desk must not unfold a thousand images here.
  setAutoScroll(shown != nullptr && shown->parent()->isExpanded());
  setCurrentItem(shown);
  setAutoScroll(true);
  showing_ = false;
}

void SiteTree::Menu(const QPoint& at) {
  QTreeWidgetItem* item = itemAt(at);
  if (item == nullptr) return;
  const QString object = item->data(0, kObject).toString(), stage = item->data(0, kStage).toString();
  const QPoint place = viewport()->mapToGlobal(at);
  if (stage.isEmpty()) return workspace_->AskMenu(object, place);
  QMenu menu;
  menu.addAction(tr("Run ..."), this, [=, this] { AskForRun(item); });
  menu.exec(place);
}

}  // namespace trigpoint

#include "app/desktop/plan_desk.h"

#include <QComboBox>
#include <QDesktopServices>
#include <QDoubleSpinBox>
#include <QFileInfo>
#include <QPushButton>
#include <QResizeEvent>
#include <QSpinBox>
#include <QTableWidget>
#include <QUrl>
#include <algorithm>
#include <cmath>
#include <filesystem>

#include "app/desktop/flow_layout.h"
#include "app/desktop/number_item.h"
#include "app/desktop/object_table.h"
#include "app/desktop/widgets.h"
#include "app/pipeline/jobs.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "datasets/project/project.h"
#include "eval/plan/page.h"
#include "eval/report/plan.h"

namespace trigpoint {

namespace {

namespace fs = std::filesystem;

constexpr double kMmPerMetre = 1e3;
constexpr double kStationTag_m = 5;  // a station belongs to a tag that is not farther away
constexpr double kUpright_m = 1.5;   // height of a tag's centre, and of a camera that is carried
constexpr double kPrinted_mm = 200;  // size of a tag that tags.yaml does not list
constexpr quint64 kSeed = 1;         // as the command's
enum Column { kKind, kName, kEast, kNorth, kUp, kFaces, kSize, kSigmaH, kSigmaV, kTag, kColumns };

bool IsMap(const SketchItem& item) { return item.kind == "tag" || item.kind == "candidate"; }
bool IsKnown(const SketchItem& item) {
  return item.kind == "control" || item.kind == "check" || item.kind == "station";
}

QString Words(const SketchStep* step) {
  if (step == nullptr) return "";
  const QString item = Text(step->item);
  switch (step->kind) {
    case SketchStep::Kind::kAdd: return PlanDesk::tr("draw %1").arg(item);
    case SketchStep::Kind::kEdit: return PlanDesk::tr("change %1").arg(item);
    case SketchStep::Kind::kMove: return PlanDesk::tr("move %1").arg(item);
    case SketchStep::Kind::kRemove: return PlanDesk::tr("delete %1").arg(item);
  }
  return "";
}

fs::path PlanFolder(const Project& project) { return project.results() / "plan"; }

}  // namespace

PlanDesk::PlanDesk(Workspace* workspace, JobController* jobs, QWidget* parent)
    : QWidget(parent), workspace_(workspace), jobs_(jobs) {
  MakeWidgets();
  Arrange();
  Connect();
  ChooseTool("select");
  ShowUnit();
  Show();
}

void PlanDesk::MakeWidgets() {
  hint_ = WrappedLabel("plan.hint");
  prediction_ = Selectable(WrappedLabel("plan.prediction"));
  const std::vector<std::array<QString, 3>> tools = {
      {"select", tr("Select, move"), tr("Click on an item to select it, drag it to move it")},
      {"tag", tr("Tag"), tr("Click where it is, then where its printed side faces")},
      {"candidate", tr("Place for a tag"), tr("A place where one more tag could be: Suggest chooses among them")},
      {"control", tr("Control"), tr("Click on a tag that is surveyed and used as control")},
      {"check", tr("Check point"), tr("Click on a tag that is surveyed and kept apart as check point")},
      {"station", tr("Station"), tr("Click where a panorama is taken")},
      {"path", tr("Path"), tr("Click the corners of a way along which the camera is carried; a double click ends it")}};
  for (const auto& [name, text, help] : tools) {
    auto* tool = MakeButton("plan.tool_" + name, text, help);
    tool->setCheckable(true);
    tool->setAutoExclusive(true);
    tool->setProperty("tool", name);
    tools_.push_back(tool);
  }
  remove_ = MakeButton("plan.remove", tr("&Delete"), tr("The selected item; a tag with its control and check points"));
  undo_ = MakeButton("plan.undo", tr("Undo"), tr("The last change of the sketch"));
  redo_ = MakeButton("plan.redo", tr("Redo"), tr("The change of the sketch that was taken back last"));
  save_ = MakeButton("plan.save", tr("Sa&ve"), tr("Writes plan.csv; the file as it was is kept in results/replaced"));
  predict_ = MakeButton("plan.predict", tr("&Predict"), tr("Saves the sketch and runs trigpoint plan"));
  options_ = MakeButton("plan.options", tr("&Options ..."), tr("Camera, speed, noise, gates of the stage plan"));
  page_ = MakeButton("plan.page", tr("Open the &page"), tr("results/plan/index.html in the browser"));
  adopt_ = MakeButton("plan.adopt", tr("Add what is proposed"), tr("Puts the selected place into the sketch as a tag"));
  suggest_ = Named(new QComboBox, "plan.suggest", tr("What to propose"));
  suggest_->addItem(tr("propose nothing"), "");
  suggest_->addItem(tr("propose tags"), "tags");
  suggest_->addItem(tr("propose control"), "control");
  suggest_->addItem(tr("propose passes"), "path");
  count_ = Named(new QSpinBox, "plan.count", tr("How many to propose"));
  count_->setRange(1, 20);
  const auto number = [](const char* name, const QString& prefix, const QString& suffix, double low, double high,
                         double value) {
    auto* box = Named(new QDoubleSpinBox, name, prefix);
    box->setPrefix(prefix + " ");
    box->setSuffix(" " + suffix);
    box->setRange(low, high);
    box->setValue(value);
    return box;
  };
  height_ = number("plan.height", tr("up"), "", -1e5, 1e5, kUpright_m);
  height_->setToolTip(tr("Height of what is added next, site ENU"));
  size_ = number("plan.size", tr("size"), tr("mm"), 1, 1e4, kPrinted_mm);
  size_->setToolTip(tr("Black square of a tag that is added next and is not in tags.yaml"));
  items_ = MakeTable("plan.items", tr("Items of the sketch"));
  items_->setColumnCount(kColumns);
  items_->setEditTriggers(QAbstractItemView::DoubleClicked | QAbstractItemView::EditKeyPressed |
                          QAbstractItemView::AnyKeyPressed);
  tags_ = MakeTable("plan.tags", tr("Predicted sigmas of the tags"));
  tags_->setColumnCount(7);
  gains_ = MakeTable("plan.gains", tr("Gain of one more"));
  gains_->setColumnCount(4);
  HeadPrediction(false);
  for (QTableWidget* table : {items_, tags_, gains_}) table->setSelectionMode(QAbstractItemView::SingleSelection);
  map_ = Named(new PictureView, "plan.map", tr("Plan"));
}

void PlanDesk::Arrange() {
  auto* draw = new FlowLayout;
  for (QPushButton* tool : tools_) draw->addWidget(tool);
  for (QWidget* w : std::initializer_list<QWidget*>{height_, size_, remove_, undo_, redo_, save_}) draw->addWidget(w);
  auto* predict = InFlow({predict_, suggest_, count_, adopt_, options_, page_});
  auto* tables = InSplitter(Qt::Vertical, {items_, tags_, gains_}, {240, 200, 160});
  split_ = Named(InSplitter(Qt::Horizontal, {map_, tables}, {600, 500}), "plan.split");
  InColumn({draw, hint_, predict, prediction_, {split_, 1}}, this);
}

void PlanDesk::Connect() {
  for (QPushButton* tool : tools_) {
    connect(tool, &QPushButton::clicked, this, [this, tool] { ChooseTool(tool->property("tool").toString()); });
  }
  connect(map_, &PictureView::Clicked, this, &PlanDesk::Click);
  connect(map_, &PictureView::DoubleClicked, this, [this] { ended_path_ = tool_ == "path"; });
  connect(map_, &PictureView::MarkMoved, this, [this](const QString& object, const QPointF& pixel) {
    if (const auto index = IndexOf(object)) sketch_.MoveTo(*index, ground_.PlaceOf(pixel));
    Show();
  });
  connect(items_, &QTableWidget::itemChanged, this, &PlanDesk::Edit);
  connect(map_, &PictureView::MenuAsked, this, [this](const QString& object, const QPoint& at) {
    if (const auto index = IndexOf(object)) workspace_->AskMenu(ObjectOf(sketch_.items()[*index]), at);
  });
  connect(items_, &QTableWidget::itemSelectionChanged, this, [this] {
    const int index = Selected();
    if (index >= 0) map_->SetHighlight("sketch:" + QString::number(index));
    ShowButtons();
    const QString object = index < 0 ? QString() : ObjectOf(sketch_.items()[static_cast<size_t>(index)]);
    if (!object.isEmpty()) workspace_->Select(object);
  });
  connect(workspace_, &Workspace::Selected, this, &PlanDesk::ShowSelected);
  AskMenuOn(items_, workspace_, Qt::UserRole);
  connect(gains_, &QTableWidget::itemSelectionChanged, this, &PlanDesk::ShowButtons);
  LinkTable(tags_, workspace_);
  connect(remove_, &QPushButton::clicked, this, &PlanDesk::RemoveSelected);
  connect(undo_, &QPushButton::clicked, this, &PlanDesk::Undo);
  connect(redo_, &QPushButton::clicked, this, &PlanDesk::Redo);
  connect(save_, &QPushButton::clicked, this, &PlanDesk::Save);
  connect(predict_, &QPushButton::clicked, this, &PlanDesk::Predict);
  connect(adopt_, &QPushButton::clicked, this, &PlanDesk::AdoptProposal);
  connect(options_, &QPushButton::clicked, this, &PlanDesk::OptionsRequested);
  connect(page_, &QPushButton::clicked, this, [this] {
    const QString file = workspace_->dir() + "/results/plan/index.html";
    if (QDesktopServices::openUrl(QUrl::fromLocalFile(file))) return;
    emit workspace_->Problem(tr("No program opens the page: %1").arg(file), "");
  });
  connect(workspace_, &Workspace::Replaced, this, &PlanDesk::Read);
  connect(workspace_, &Workspace::Opened, this, [this] { sketch_.changed() ? ReadPrediction() : Read(); });
  connect(workspace_, &Workspace::Closed, this, &PlanDesk::Read);
  connect(workspace_, &Workspace::UnitChanged, this, [this] {
    ShowUnit();
    ground_ = PlanGround();
    ReadPrediction();
    Show();
  });
  connect(jobs_, &JobController::Started, this, &PlanDesk::ShowButtons);
  connect(jobs_, &JobController::Finished, this, [this] {
    ReadPrediction();
    Show();
  });
}

void PlanDesk::resizeEvent(QResizeEvent* event) {
  QWidget::resizeEvent(event);
  if (!TurnToFit(split_, width()) || split_->orientation() == Qt::Horizontal) return;
  split_->setSizes({700, 300});  // one draws on the map
}

void PlanDesk::ChooseTool(const QString& tool) {
  tool_ = tool;
  path_.clear();
  facing_.reset();
  for (QPushButton* button : tools_) {
    if (button->property("tool").toString() != tool) continue;
    button->setChecked(true);
    hint_->setText(button->toolTip() + ".");
  }
}

void PlanDesk::Read() {
  sketch_ = Sketch();
  trouble_.clear();
  ground_ = PlanGround();
  stale_ = false;
  if (workspace_->snapshot() && workspace_->snapshot()->project) {
    try {
      sketch_ = Sketch(*workspace_->snapshot()->project);
    } catch (const std::exception& e) {
      trouble_ = QString::fromUtf8(e.what());
    }
  }
  ReadPrediction();
  Show();
}

void PlanDesk::ReadPrediction() {
  ellipses_.clear();
  places_.clear();
  prediction_->clear();
  for (QTableWidget* table : {tags_, gains_}) table->setRowCount(0);
  if (workspace_->snapshot() && workspace_->snapshot()->project && !jobs_->running()) {
    stale_ = sketch_.changed();
    try {
      ShowPrediction();
    } catch (const std::exception& e) {
      prediction_->setText(QString::fromUtf8(e.what()));
    }
  }
  for (QTableWidget* table : {tags_, gains_}) table->setVisible(table->rowCount() > 0);  // the map needs the room
}

std::optional<size_t> PlanDesk::IndexOf(const QString& object) const {
  bool number = false;
  const int index = object.section(':', 1).toInt(&number);
  if (!object.startsWith("sketch:") || !number || index >= static_cast<int>(sketch_.items().size())) return {};
  return static_cast<size_t>(index);
}

// The desks' name of what an item will be; empty: they have none.
QString PlanDesk::ObjectOf(const SketchItem& item) {
  if (item.kind == "station") return Text("station:" + item.name);
  return item.kind == "tag" || item.kind == "control" || item.kind == "check" ? "tag:" + QString::number(item.tag_id)
                                                                              : QString();
}

void PlanDesk::ShowSelected() {
  ShowSelectedRows(items_, *workspace_);
  map_->SetHighlight(Selected() < 0 ? QString() : "sketch:" + QString::number(Selected()));
  ShowButtons();
}

void PlanDesk::Undo() {
  sketch_.Undo();
  facing_.reset();
  Show();
}

void PlanDesk::Redo() {
  sketch_.Redo();
  facing_.reset();
  Show();
}

QString PlanDesk::UndoText() const { return Words(sketch_.undone_next()); }

QString PlanDesk::RedoText() const { return Words(sketch_.redone_next()); }

int PlanDesk::Selected() const {
  const auto cells = items_->selectedItems();
  return cells.isEmpty() ? -1 : cells.front()->row();
}

void PlanDesk::Click(const QPointF& pixel, const QString& object) {
  if (!workspace_->snapshot()) return;
  const Eigen::Vector2d place = ground_.PlaceOf(pixel);
  const auto index = IndexOf(object);
  if (tool_ == "select") {
    if (!index) return;
    items_->selectRow(static_cast<int>(*index));
    return;
  }
  if (tool_ == "tag" || tool_ == "candidate") AddTag(place);
  if (tool_ == "control" || tool_ == "check") ToggleKnown(object);
  if (tool_ == "station") AddStation(place);
  if (tool_ == "path") AddCorner(place);
  Show();
}

void PlanDesk::AddTag(const Eigen::Vector2d& place) {
  if (facing_ && *facing_ < sketch_.items().size()) {  // the second click
    SketchItem item = sketch_.items()[*facing_];
    const Eigen::Vector2d towards = place - item.local_m->head<2>();
    item.heading_rad = std::atan2(towards.x(), towards.y());
    sketch_.Replace(*facing_, item);
    facing_.reset();
    hint_->setText(tr("Click where the next one is."));
    return;
  }
  SketchItem item;
  item.kind = tool_.toStdString();
  const int id = sketch_.FreeTag();
  item.tag_id = tool_ == "tag" ? id : -1;
  item.name = tool_ == "tag" ? std::to_string(id) : sketch_.FreeName("candidate", "place");
  item.local_m = Eigen::Vector3d(place.x(), place.y(), height_->value() * metres_);
  item.heading_rad = 0;
  const TagSizes& sizes = workspace_->snapshot()->project->site().tags;
  if (tool_ == "candidate" || !(sizes.SizeOf(id) > 0)) item.size_m = size_->value() / kMmPerMetre;
  sketch_.Add(item);
  facing_ = sketch_.items().size() - 1;
  hint_->setText(tr("Click where its printed side faces."));
}

void PlanDesk::AddStation(const Eigen::Vector2d& place) {
  SketchItem item;
  item.kind = "station";
  item.name = sketch_.FreeName("station", "S");
  item.local_m = Eigen::Vector3d(place.x(), place.y(), height_->value() * metres_);
  item.sigma_h_m = kSketchGeotag_h_m, item.sigma_v_m = kSketchGeotag_v_m;
  double nearest = kStationTag_m;
  for (const SketchItem& tag : sketch_.items()) {
    if (tag.kind != "tag" || !tag.local_m) continue;
    const double away = (tag.local_m->head<2>() - place).norm();
    if (away < nearest) nearest = away, item.tag_id = tag.tag_id;
  }
  sketch_.Add(item);
}

void PlanDesk::AddCorner(const Eigen::Vector2d& place) {
  if (ended_path_) {
    ended_path_ = false;
    path_.clear();
    return;
  }
  if (path_.isEmpty()) path_ = Text(sketch_.FreeName("path", "pass"));
  SketchItem item;
  item.kind = "path";
  item.name = path_.toStdString();
  item.local_m = Eigen::Vector3d(place.x(), place.y(), height_->value() * metres_);
  sketch_.Add(item);
}

void PlanDesk::ToggleKnown(const QString& object) {
  const auto index = IndexOf(object);
  if (!index || sketch_.items()[*index].tag_id < 0) {
    hint_->setText(tr("Click on a tag: control and check points are tags that are surveyed."));
    return;
  }
  const int id = sketch_.items()[*index].tag_id;
  for (size_t i = 0; i < sketch_.items().size(); ++i) {
    const SketchItem& item = sketch_.items()[i];
    if (item.tag_id != id || (item.kind != "control" && item.kind != "check")) continue;
    const bool same = item.kind == tool_.toStdString();
    SketchItem other = item;
    other.kind = tool_.toStdString();
    return same ? sketch_.Remove(i) : sketch_.Replace(i, other);
  }
  SketchItem item;
  item.kind = tool_.toStdString();
  item.name = std::to_string(id);
  item.tag_id = id;
  sketch_.Add(item);
}

void PlanDesk::RemoveSelected() {
  if (Selected() < 0) return;
  sketch_.Remove(static_cast<size_t>(Selected()));
  facing_.reset();
  Show();
}

void PlanDesk::Edit(QTableWidgetItem* cell) {
  const auto index = static_cast<size_t>(cell->row());
  if (index >= sketch_.items().size()) return;
  SketchItem item = sketch_.items()[index];
  const QString text = cell->text().trimmed();
  const auto value = ParseDouble(text.toStdString());
  const int column = cell->column();
  bool fits = column == kName ? !text.isEmpty() : value && std::isfinite(*value);
  const double metres = value.value_or(0) * workspace_->metres_per_unit();
  if (column == kName && (item.kind == "tag" || item.kind == "control" || item.kind == "check")) {
    const auto id = ParseInt(text.toStdString());
    fits = id && *id >= 0;
    if (fits) item.tag_id = static_cast<int>(*id);
  }
  if (column == kName) item.name = text.toStdString();
  if (column >= kEast && column <= kUp && item.local_m) (*item.local_m)[column - kEast] = metres;
  if (column == kFaces) item.heading_rad = value.value_or(0) * kDegToRad;
  if (column == kSize) fits = fits && *value > 0, item.size_m = value.value_or(0) / kMmPerMetre;
  if (column == kSigmaH || column == kSigmaV) {
    fits = fits && *value > 0;
    (column == kSigmaH ? item.sigma_h_m : item.sigma_v_m) = metres;
  }
  if (column == kTag) item.tag_id = static_cast<int>(value.value_or(-1));
  if (fits) {
    sketch_.Replace(index, item);
  } else {
    hint_->setText(
        tr("'%1' does not fit: expected %2.")
            .arg(text, column == kName ? tr("a name, or a tag's id") : tr("a number, sizes and sigmas above 0")));
  }
  QMetaObject::invokeMethod(this, &PlanDesk::Show, Qt::QueuedConnection);  // not while the cell is edited
}

void PlanDesk::AdoptProposal() {
  const auto cells = gains_->selectedItems();
  if (cells.isEmpty()) return;
  const QVariantList place = cells.front()->data(Qt::UserRole).toList();
  if (place.size() != 4) return;
  SketchItem item;
  item.kind = "tag";
  item.tag_id = sketch_.FreeTag();
  item.name = std::to_string(item.tag_id);
  item.local_m = Eigen::Vector3d(place[0].toDouble(), place[1].toDouble(), place[2].toDouble());
  item.heading_rad = place[3].toDouble() * kDegToRad;
  const TagSizes& sizes = workspace_->snapshot()->project->site().tags;
  if (!(sizes.SizeOf(item.tag_id) > 0)) item.size_m = size_->value() / kMmPerMetre;
  sketch_.Add(item);
  Show();
}

bool PlanDesk::Save() {
  if (!workspace_->snapshot()) return false;
  try {
    const fs::path kept = sketch_.Save();
    hint_->setText(kept.empty() ? tr("Saved as plan.csv.")
                                : tr("Saved as plan.csv; as it was before: %1").arg(Text(kept.string())));
  } catch (const std::exception& e) {
    emit workspace_->Problem(QString::fromUtf8(e.what()), tr("The sketch was not saved."));
  }
  ShowButtons();
  return !sketch_.changed();
}

void PlanDesk::Predict() {
  if (!workspace_->snapshot() || jobs_->running()) return;
  if (sketch_.changed() && !Save()) return;
  JobQuery query;
  query.stages = {"plan"};
  const std::string suggest = suggest_->currentData().toString().toStdString();
  if (!suggest.empty()) query.overrides["plan"] = {{"suggest", suggest}, {"count", count_->value()}};
  jobs_->Start(workspace_->dir(), query, 0, kSeed);
  prediction_->setText(tr("Predicting ..."));
}

QString PlanDesk::Length(double metres, int decimals) const {
  return QString::number(metres / workspace_->metres_per_unit(), 'f', decimals);
}

void PlanDesk::Show() {
  ShowItems();
  ShowMap();
  ShowButtons();
}

void PlanDesk::ShowButtons() {
  const bool open = workspace_->snapshot() != nullptr;
  const auto gains = gains_->selectedItems();
  remove_->setEnabled(Selected() >= 0);
  undo_->setEnabled(sketch_.undone_next() != nullptr);
  redo_->setEnabled(sketch_.redone_next() != nullptr);
  save_->setEnabled(open && sketch_.changed());
  predict_->setEnabled(open && !jobs_->running());
  adopt_->setEnabled(!gains.isEmpty() && gains.front()->data(Qt::UserRole).toList().size() == 4);
  page_->setEnabled(open && QFileInfo::exists(workspace_->dir() + "/results/plan/index.html"));
  for (QPushButton* tool : tools_) tool->setEnabled(open && trouble_.isEmpty());
  emit Changed();
}

void PlanDesk::ShowUnit() {
  const double height_m = height_->value() * metres_;
  metres_ = workspace_->metres_per_unit();
  height_->setSuffix(" " + workspace_->unit());
  height_->setValue(height_m / metres_);
}

void PlanDesk::ShowItems() {
  const QSignalBlocker block(items_);
  const int selected = Selected();
  const QString unit = workspace_->unit();
  items_->setHorizontalHeaderLabels({tr("kind"), tr("name"), tr("east (%1)").arg(unit), tr("north (%1)").arg(unit),
                                     tr("up (%1)").arg(unit), tr("faces (deg)"), tr("size (mm)"),
                                     tr("sigma h (%1)").arg(unit), tr("sigma v (%1)").arg(unit), tr("tag")});
  SetHeaderHelp(items_, {tr("what the item is; a path has a row for each corner"), tr("its name, of a tag its id"),
                         tr("site ENU, %1").arg(unit), tr("site ENU, %1").arg(unit), tr("site ENU, %1").arg(unit),
                         tr("azimuth that its printed side faces, degrees from north over east"),
                         tr("edge of a tag's black square, mm; empty: as in tags.yaml"),
                         tr("1 sigma per horizontal axis of a surveyed position, %1").arg(unit),
                         tr("1 sigma of a surveyed height, %1").arg(unit), tr("the tag that a station belongs to")});
  items_->setRowCount(static_cast<int>(sketch_.items().size()));
  for (int row = 0; row < items_->rowCount(); ++row) {
    const SketchItem& item = sketch_.items()[static_cast<size_t>(row)];
    QStringList cells{Text(item.kind), Text(item.name)};
    for (int k = 0; k < 3; ++k) cells << (item.local_m ? Length((*item.local_m)[k], 3) : QString());
    cells << (item.heading_rad ? QString::number(*item.heading_rad * kRadToDeg, 'f', 1) : QString());
    cells << (IsMap(item) && item.size_m > 0 ? QString::number(item.size_m * kMmPerMetre, 'f', 1) : QString());
    cells << (IsKnown(item) ? Length(item.sigma_h_m, 4) : QString());
    cells << (IsKnown(item) ? Length(item.sigma_v_m, 4) : QString());
    cells << (item.kind == "station" && item.tag_id >= 0 ? QString::number(item.tag_id) : QString());
    for (int c = 0; c < kColumns; ++c) {
      auto* cell = c < kEast ? new QTableWidgetItem(cells[c]) : new NumberItem(cells[c]);
      const bool editable = c == kName || (c >= kEast && c <= kUp && item.local_m) ||
                            (c == kFaces && item.heading_rad) || (c == kSize && IsMap(item)) ||
                            (c >= kSigmaH && c <= kSigmaV && IsKnown(item)) || (c == kTag && item.kind == "station");
      cell->setData(Qt::UserRole, ObjectOf(item));
      if (!editable) cell->setFlags(cell->flags() & ~Qt::ItemIsEditable);
      items_->setItem(row, c, cell);
    }
  }
  items_->resizeColumnsToContents();
  if (selected >= 0 && selected < items_->rowCount()) items_->selectRow(selected);
}

void PlanDesk::ShowMap() {
  if (!workspace_->snapshot() || !workspace_->snapshot()->project || !trouble_.isEmpty()) {
    map_->SetMarks({});
    map_->SetPicture({}, !trouble_.isEmpty() ? trouble_ : tr("Open a project, then draw its tags and paths here."));
    return;
  }
  bool holds = !ground_.picture.isNull();
  for (size_t i = 0; holds && i < sketch_.items().size(); ++i) {
    const auto place = sketch_.PlaceOf(i);
    holds = !place || ground_.Holds(place->head<2>());
  }
  if (!holds) {
    QString problem;
    ground_ = MakePlanGround(*workspace_->snapshot()->project, sketch_, workspace_->metres_per_unit(), &problem);
    if (!problem.isEmpty()) hint_->setText(problem);
  }
  const bool current = !stale_ && !sketch_.changed();
  const double factor = current ? EllipseFactor(ellipses_, ground_) : 1;
  QString title = tr("site ENU, %1, north up").arg(workspace_->unit());
  if (current && !ellipses_.empty()) {
    title += factor == 1 ? tr("; ellipses: predicted, 95 %, at true scale")
                         : tr("; ellipses: predicted, 95 %, %1 times enlarged").arg(factor);
  }
  if (!current && !ellipses_.empty()) title += tr("; changed since the last prediction");
  map_->SetPicture(ground_.picture, title);
  map_->SetMarks(SketchMarks(sketch_, ground_, current ? ellipses_ : std::vector<PlannedEllipse>(), factor,
                             current ? places_ : std::vector<PlannedPlace>()));
}

void PlanDesk::HeadPrediction(bool proposed) {
  tags_->setHorizontalHeaderLabels(
      {tr("tag"), tr("role"), tr("pictures"), tr("passes"), tr("horizontal (mm)"), tr("up (mm)"), tr("3D (mm)")});
  SetHeaderHelp(tags_,
                {tr("id"), tr("what the tag is in the plan"), tr("number of pictures that see it"),
                 tr("number of passes that see it"), tr("predicted 1 sigma of both horizontal axes together, mm"),
                 tr("predicted 1 sigma of the height, mm"), tr("predicted 1 sigma in space, mm")});
  gains_->setHorizontalHeaderLabels({tr("rank"), proposed ? tr("proposed, one after the other") : tr("one more of"),
                                     tr("RMS of the tags (mm)"), tr("gain (%)")});
  SetHeaderHelp(gains_, {tr("the largest gain comes first"), tr("what is added to the plan"),
                         tr("RMS of the tags' predicted 3D sigmas with it, mm"),
                         tr("by how much it makes that RMS smaller, per cent")});
  for (QTableWidget* table : {tags_, gains_}) table->resizeColumnsToContents();
}

void PlanDesk::ShowPrediction() {
  const fs::path folder = PlanFolder(*workspace_->snapshot()->project);
  if (!fs::exists(folder / "summary.json")) return;
  const DisplayUnit& unit = workspace_->display_unit();
  const nlohmann::json summary = nlohmann::json::parse(ReadTextFile(folder / "summary.json"));
  prediction_->setText(Text(PlanSummary(summary, unit)).trimmed());
  const auto add = [](QTableWidget* table, const QStringList& cells, const QVariant& object) {
    const int row = table->rowCount();
    table->insertRow(row);
    for (int c = 0; c < cells.size(); ++c) {
      bool number = false;
      cells[c].toDouble(&number);
      auto* cell = number ? new NumberItem(cells[c]) : new QTableWidgetItem(cells[c]);
      cell->setData(Qt::UserRole, object);
      cell->setToolTip(cells[c]);
      table->setItem(row, c, cell);
    }
  };
  const auto mm = [](double metres) { return QString::number(kMmPerMetre * metres, 'f', 1); };
  const CsvTable tags = CsvTable::Read(folder / "tags.csv", {"tag_id", "sigma_x_m", "ellipse_a_m"});
  for (const CsvRow& row : tags.rows()) {
    const int id = static_cast<int>(row.Integer("tag_id"));
    QStringList cells{QString::number(id), Text(row.Text("role")), Text(row.Text("images")), Text(row.Text("passes"))};
    if (row.Has("sigma_x_m")) {
      const Eigen::Vector3d sigma(row.Number("sigma_x_m"), row.Number("sigma_y_m"), row.Number("sigma_z_m"));
      cells << mm(sigma.head<2>().norm()) << mm(sigma.z()) << mm(sigma.norm());
      ellipses_.push_back({id,
                           {row.Number("x"), row.Number("y")},
                           kSigmas95 * row.Number("ellipse_a_m"),
                           kSigmas95 * row.Number("ellipse_b_m"),
                           row.Number("ellipse_bearing_deg") * kDegToRad});
    } else {
      cells << tr("not seen") << ""
            << "";
    }
    add(tags_, cells, "tag:" + QString::number(id));
  }
  const bool proposed = fs::exists(folder / "suggestions.csv");
  HeadPrediction(proposed);
  const CsvTable gains = CsvTable::Read(folder / (proposed ? "suggestions.csv" : "gains.csv"), {"rank", "what"});
  for (const CsvRow& row : gains.rows()) {
    const double before = row.Number("rms_before_m", NAN),
                 after = row.Number("rms_after_m", NAN);  // NAN: not determined
    QVariantList place;
    if (row.Has("x")) {
      place << row.Number("x") << row.Number("y") << row.Number("z");
    }
    if (row.Has("x") && row.Has("heading_deg")) {  // a place for a tag; control stands on one
      place << row.Number("heading_deg");
      places_.push_back({static_cast<int>(row.Integer("rank")), {row.Number("x"), row.Number("y")}});
    }
    add(gains_,
        {Text(row.Text("rank")), Text(row.Text("what")), std::isfinite(after) ? mm(after) : "-",
         std::isfinite(after / before) ? QString::number(100 * (1 - after / before), 'f', 1) : "-"},
        place);
  }
  constexpr size_t kDrawn = 5;  // places on the map, so that it stays readable
  if (!proposed && places_.size() > kDrawn) places_.resize(kDrawn);
  for (QTableWidget* table : {tags_, gains_}) table->resizeColumnsToContents();
}

}  // namespace trigpoint

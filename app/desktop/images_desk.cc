#include "app/desktop/images_desk.h"

#include <QCheckBox>
#include <QComboBox>
#include <QLabel>
#include <QListWidget>
#include <QPushButton>
#include <QSlider>
#include <algorithm>
#include <cmath>

#include "app/desktop/background.h"
#include "app/desktop/fitted_box.h"
#include "app/desktop/inspector.h"
#include "app/desktop/match_lines.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/pictures.h"
#include "app/desktop/thumbnails.h"
#include "app/desktop/widgets.h"

namespace trigpoint {

namespace {

QPointF Point(const Eigen::Vector2d& p) { return {p.x(), p.y()}; }

QCheckBox* LayerBox(const QString& text, const char* name, bool on, const QString& help) {
  QCheckBox* box = MakeCheckBox(name, text, help);
  box->setChecked(on);
  return box;
}

}  // namespace

ImagesDesk::ImagesDesk(Workspace* workspace, QWidget* parent) : QWidget(parent), workspace_(workspace) {
  MakeControls();
  Arrange();
  ConnectViews();
  ConnectMarks();
  connect(run_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &ImagesDesk::FillImages);
  connect(images_, &QListWidget::currentRowChanged, this, [this](int row) {
    const QSignalBlocker block(slider_);
    slider_->setValue(row);
    ShowImage();
    if (row >= 0) workspace_->Select("image:" + run() + "/" + image());
  });
  // The entry that is marked already, while something else is selected.
  connect(images_, &QListWidget::itemClicked, this,
          [this](const QListWidgetItem* item) { workspace_->Select("image:" + run() + "/" + item->text()); });
  connect(slider_, &QSlider::valueChanged, images_, [this](int row) { images_->setCurrentRow(row); });
  connect(reference_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &ImagesDesk::ShowReference);
  connect(view_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &ImagesDesk::ShowView);
  connect(match_, &QPushButton::clicked, this, &ImagesDesk::ShowMatches);
  connect(next_, &QPushButton::clicked, this, &ImagesDesk::NextImageOfTag);
  connect(order_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, [this] { tag_ = -1; });
  for (QCheckBox* box : {detections_, tracks_, inliers_, outliers_}) {
    connect(box, &QCheckBox::toggled, this, &ImagesDesk::Redraw);
  }
  images_->setContextMenuPolicy(Qt::CustomContextMenu);
  connect(images_, &QWidget::customContextMenuRequested, this, [this](const QPoint& at) {
    const QListWidgetItem* item = images_->itemAt(at);
    if (item != nullptr) workspace_->AskMenu("image:" + run() + "/" + item->text(), images_->mapToGlobal(at));
  });
  connect(workspace_, &Workspace::Replaced, this, &ImagesDesk::Clear);
  connect(workspace_, &Workspace::Opened, this, &ImagesDesk::Refresh);
  connect(workspace_, &Workspace::Closed, this, &ImagesDesk::Refresh);
  connect(workspace_, &Workspace::Selected, this, &ImagesDesk::ShowSelected);
  Clear();
}

void ImagesDesk::MakeControls() {
  run_ = Named(new FittedBox(tr("Run whose images are listed")), "images.run", tr("Run"));
  images_ = Named(new QListWidget, "images.list", tr("Images of the run"));
  images_->setUniformItemSizes(true);
  images_->setMinimumWidth(images_->fontMetrics().horizontalAdvance("images/000000.jpg") + 40);
  images_->setTextElideMode(Qt::ElideLeft);
  images_->setHorizontalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
  thumbnails_ = new Thumbnails(images_);
  slider_ = new QSlider(Qt::Horizontal);
  slider_->setAccessibleName(tr("Image by time"));
  reference_ = Named(new FittedBox(tr("Panorama or photo that stands beside the image")), "images.reference",
                     tr("Panorama or photo"));
  view_ = Named(
      new QComboBox, "images.view", tr("Part of the panorama"),
      tr("All of the panorama, or one of the rectilinear views that localize matches; of a set one of its photos"));
  view_->setSizeAdjustPolicy(QComboBox::AdjustToContents);
  view_->addItem(tr("whole"));
  match_ = MakeButton("images.match", tr("&Match"),
                      tr("Match the image with the panorama, and judge the matches by the solution"));
  // Reprojection errors are drawn ten times as long as they are.
  detections_ = LayerBox(tr("detections"), "images.detections", true,
                         tr("Outlines of the tags found in the image; gray: excluded by the review"));
  tracks_ = LayerBox(tr("tracks, errors x 10"), "images.tracks", true,
                     tr("Points of the solution where the image shows them, with their reprojection errors (px) drawn "
                        "ten times as long"));
  inliers_ = LayerBox(tr("inlier matches"), "images.inliers", true,
                      tr("Matches with the panorama within 3 px of their epipolar lines"));
  outliers_ = LayerBox(tr("outlier matches"), "images.outliers", false,
                       tr("Matches with the panorama farther than 3 px from their epipolar lines"));
  linked_ = LayerBox(tr("linked zoom"), "images.linked", false,
                     tr("Moves the other picture to the same place, by the inlier matches"));
  next_ = MakeButton("images.next", tr("&Next image of the tag"),
                     tr("Goes through all images that show the selected station's tag (Ctrl+N)"));
  next_->setShortcut(QKeySequence(tr("Ctrl+N")));
  order_ = Named(new QComboBox, "images.order", tr("Order of the images of a tag"));
  order_->addItem(tr("worst residual first"), static_cast<int>(TagImageOrder::kWorstResidual));
  order_->addItem(tr("largest first"), static_cast<int>(TagImageOrder::kLargest));
  point_ = Named(new QComboBox, "images.point", tr("Name of the surveyed point"));
  point_->setEditable(true);
  point_->setMinimumContentsLength(8);
  mark_ =
      MakeButton("images.mark", tr("Mar&k by click"),
                 tr("The next click in the image marks the point; from two marks on it is predicted elsewhere. A mark "
                    "is moved by dragging it"));
  mark_->setCheckable(true);
  confirm_ = MakeButton("images.confirm", tr("C&onfirm prediction"));
  confirm_->setEnabled(false);
  remove_ = MakeButton("images.remove", tr("Re&move mark"), tr("Take the point's mark out of this image"));
  remove_->setEnabled(false);
  status_ = WrappedLabel("images.status");
  turn_ = Named(new QLabel, "images.turn");
  place_ = new QLabel;
  place_->setMinimumWidth(150);
  left_ = Named(new PictureView, "images.left", tr("Camera image"));
  right_ = Named(new PictureView, "images.right", tr("Panorama or photo"));
}

void ImagesDesk::Arrange() {
  auto* side = Pane({run_, {images_, 1}});
  panes_ = InSplitter(Qt::Horizontal, {left_, right_});
  auto* pictures = Pane({panes_});  // the splitter itself would take the lines for a third pane
  lines_ = new MatchLines(left_, right_, pictures);
  auto* top = InFlow({detections_, tracks_, inliers_, outliers_, linked_, reference_, view_, match_});
  auto* bottom = InFlow({next_, order_, new QLabel(tr("Point")), point_, mark_, confirm_, remove_});
  auto* middle = Pane({top, {pictures, 1}, slider_, bottom, InRow({{status_, 1}, turn_, place_})});
  auto* split = InSplitter(Qt::Horizontal, {side, middle}, {190, 800});
  split->setStretchFactor(1, 1);
  InColumn({split}, this);
}

void ImagesDesk::ConnectViews() {
  connect(left_, &PictureView::Clicked, this, [this](const QPointF& pixel, const QString& object) {
    if (mark_->isChecked()) {
      mark_->setChecked(false);
      Mark(pixel.x(), pixel.y());
    } else if (object.startsWith("mark:")) {
      point_->setCurrentText(object.mid(5));
    } else if (!object.isEmpty()) {
      workspace_->Select(object);
    }
  });
  for (PictureView* view : {left_, right_}) {
    PictureView* other = view == left_ ? right_ : left_;
    connect(view, &PictureView::Hovered, this, [this](const QPointF& pixel) {
      place_->setText(tr("%1, %2 px").arg(pixel.x(), 0, 'f', 1).arg(pixel.y(), 0, 'f', 1));
    });
    connect(view, &PictureView::ViewChanged, this, [this, view, other] { Follow(view, other); });
  }
  connect(right_, &PictureView::Clicked, this, [this](const QPointF&, const QString& object) {
    if (!object.isEmpty()) workspace_->Select(object);
  });
  connect(right_, &PictureView::MenuAsked, workspace_, &Workspace::AskMenu);
  connect(linked_, &QCheckBox::toggled, this, [this] { Follow(left_, right_); });
}

// To where the matches in sight lead, as much enlarged; without any the other view stays.
void ImagesDesk::Follow(const PictureView* from, PictureView* to) {
  if (following_ || !linked_->isChecked() || from->image().isNull() || to->image().isNull()) return;
  QPointF sum;
  int count = 0;
  for (const MatchPair& pair : lines_->pairs()) {
    const QPointF here = from == left_ ? pair.first : pair.second, there = from == left_ ? pair.second : pair.first;
    if (!QRectF(from->rect()).contains(from->WidgetAt(here))) continue;
    sum += there;
    ++count;
  }
  if (count == 0) return;
  following_ = true;
  to->LookAt(sum / count, to->FittedScale() * from->scale() / from->FittedScale());
  following_ = false;
}

void ImagesDesk::resizeEvent(QResizeEvent* event) {
  QWidget::resizeEvent(event);
  PlacePanes();
}

void ImagesDesk::PlacePanes() {
  // Whichever way shows more of both.
  const QSize room = panes_->size();
  const auto shown = [](const PictureView* view, double width, double height) {
    const double shape = view->image().isNull()
                             ? 4.0 / 3
                             : static_cast<double>(view->image().width()) / std::max(1, view->image().height());
    const double scale = std::min(width / shape, height);
    return scale * scale * shape;
  };
  const double beside =
      shown(left_, 0.5 * room.width(), room.height()) + shown(right_, 0.5 * room.width(), room.height());
  const double below =
      shown(left_, room.width(), 0.5 * room.height()) + shown(right_, room.width(), 0.5 * room.height());
  const Qt::Orientation way = below > 1.1 * beside ? Qt::Vertical : Qt::Horizontal;
  if (way == panes_->orientation()) return;
  panes_->setOrientation(way);
  panes_->setSizes({1000, 1000});
}

void ImagesDesk::ShowSelected() {
  const QString object = workspace_->selected();
  turn_->clear();
  for (PictureView* view : {left_, right_}) view->SetHighlight(Highlighted());
  const bool in_image = object.startsWith("detection:") || object.startsWith("image:");
  if (in_image) ShowObject(object);
  for (const std::string& related : workspace_->related()) {
    const bool other = object.startsWith("panorama:") && object.toStdString() != related;  // of the same station
    if (!related.starts_with("panorama:") || other) continue;
    ShowObject(Text(related));
    break;
  }
  behind_ = !isVisible();
  if (in_image || behind_ || Highlighted().startsWith("detection:")) return;
  for (const std::string& related : workspace_->related()) {
    if (const auto tag = TagOf(related)) return ShowTag(*tag);
  }
}

// Of a tag or station that is selected its detection in the image that is shown.
QString ImagesDesk::Highlighted() const {
  const QString object = workspace_->selected();
  if (!inspected_ || object.startsWith("detection:")) return object;
  for (const InspectedTag& tag : inspected_->tags) {
    if (workspace_->related().count("tag:" + std::to_string(tag.id)) == 0) continue;
    return "detection:" + run() + "/" + image() + "#" + QString::number(tag.id);
  }
  return object;
}

QString ImagesDesk::run() const { return run_->currentText(); }
QString ImagesDesk::image() const { return images_->currentItem() != nullptr ? images_->currentItem()->text() : ""; }

void ImagesDesk::Refresh() {
  tag_ = -1;  // found anew from other results
  const QString run_before = run_->currentText(), image_before = image(), reference = reference_->currentText();
  const QString point = point_->currentText();
  {
    const QSignalBlocker block_run(run_), block_reference(reference_), block_point(point_);
    run_->clear();
    reference_->clear();
    point_->clear();
    if (const auto& snapshot = workspace_->snapshot()) {
      for (const SnapshotRun& r : snapshot->runs) {
        if (r.broken.empty()) run_->addItem(Text(r.name));
      }
      for (const SnapshotReference& r : snapshot->references) reference_->addItem(Text(r.name));
      for (const SnapshotControl& c : snapshot->controls) point_->addItem(Text(c.name));
      point_->setCurrentText(point);
    }
    run_->setCurrentIndex(std::max(0, run_->findText(run_before)));
    reference_->setCurrentIndex(std::max(0, reference_->findText(reference)));
  }
  FillImages();
  const auto found = images_->findItems(image_before, Qt::MatchExactly);
  if (!found.isEmpty() && !image_before.isEmpty()) {
    const QSignalBlocker block(images_), block_slider(slider_);  // nobody selected it anew
    images_->setCurrentItem(found.front());
    slider_->setValue(images_->currentRow());
    ShowImage();
  }
  ShowReference();
  ShowMarks();  // predicted from other results now
}

void ImagesDesk::Clear() {
  for (int* generation : {&generation_, &reference_generation_, &view_generation_, &marks_generation_}) ++*generation;
  DropMatches();
  pictured_ = false;
  inspected_.reset();
  predictions_.clear();
  marks_.clear();
  history_.Clear();
  emit MarksChanged();
  tag_images_.clear();
  tag_ = -1;
  wanted_.clear();
  mark_->setChecked(false);
  confirm_->setEnabled(false);
  for (QLabel* label : {status_, turn_, place_}) label->clear();
  {
    const QSignalBlocker block(point_);
    point_->clearEditText();
  }
  for (PictureView* view : {left_, right_}) view->SetMarks({});
  lines_->SetPairs({});
  thumbnails_->SetSource(nullptr);
  for (PictureView* view : {left_, right_}) view->SetPicture({}, WhyEmpty(tr("Reading the picture ...")));
}

void ImagesDesk::FillImages() {
  const QSignalBlocker block(images_), block_slider(slider_);
  images_->clear();
  const SnapshotRun* r = workspace_->snapshot() ? workspace_->snapshot()->FindRun(run().toStdString()) : nullptr;
  if (r != nullptr) {
    QStringList files;
    for (const SnapshotImage& i : r->images) files << Text(i.file);
    images_->addItems(files);
    thumbnails_->SetSource([snapshot = workspace_->snapshot(), name = r->name](const QString& file) {
      return LoadRunPicture(*snapshot->project, name, file.toStdString())
          .scaled(64, 48, Qt::KeepAspectRatio, Qt::SmoothTransformation);
    });
  }
  slider_->setRange(0, std::max(0, images_->count() - 1));
  images_->setCurrentRow(images_->count() > 0 ? 0 : -1);
  ShowImage();
}

void ImagesDesk::showEvent(QShowEvent* event) {
  QWidget::showEvent(event);
  if (stale_) {
    ShowImage();
    ShowReference();
  }
  if (behind_) ShowSelected();  // what was selected on other desks meanwhile
}

void ImagesDesk::ShowImage() {
  const int generation = ++generation_;
  stale_ = !isVisible();
  if (stale_ && workspace_->snapshot()) return;
  pictured_ = false;
  inspected_.reset();
  DropMatches();
  if (!workspace_->snapshot() || image().isEmpty()) {
    left_->SetPicture({},
                      WhyEmpty(tr("This project has no image. Choose File, Import to import a run, or put the run's "
                                  "images below the folder runs.")));
    left_->SetMarks({});
    return;
  }
  const std::string r = run().toStdString(), file = image().toStdString();
  InBackground(
      this, [snapshot = workspace_->snapshot(), r, file] { return LoadRunPicture(*snapshot->project, r, file); },
      [this, generation, r, file](const Attempted<QImage>& picture) {
        if (generation != generation_) return;
        left_->SetPicture(picture.value, picture.error.isEmpty() ? Text(r + "/" + file) : picture.error);
        pictured_ = !left_->image().isNull();
        PlacePanes();
        Redraw();
      });
  std::shared_ptr<SharedInspector> inspector;
  try {
    inspector = workspace_->InspectorOf(r);
  } catch (const std::exception& e) {
    status_->setText(QString::fromUtf8(e.what()));
    return;
  }
  InBackground(
      this,
      [inspector, file] {
        const std::lock_guard guard(inspector->mutex);
        return std::shared_ptr<const InspectedImage>(
            std::make_shared<InspectedImage>(inspector->inspector.Image(file)));
      },
      [this, generation](const Attempted<std::shared_ptr<const InspectedImage>>& inspected) {
        if (generation != generation_) return;
        inspected_ = inspected.value;
        SayImage();
        if (!inspected.error.isEmpty()) status_->setText(inspected.error);
        Redraw();
        emit Shown(run() + "/" + image());
      });
}

void ImagesDesk::SayImage() {
  if (!inspected_) return status_->clear();
  QString text = tr("tags: %1, points: %2").arg(inspected_->tags.size()).arg(inspected_->points.size());
  if (inspected_->rms_px) text += tr(", reprojection RMS %1 px").arg(*inspected_->rms_px, 0, 'f', 2);
  if (inspected_->excluded) text += tr("; excluded by the review");
  status_->setText(text);
}

// Instead of a picture: `opened` while a project is open, else what to do.
QString ImagesDesk::WhyEmpty(const QString& opened) const {
  return workspace_->snapshot() ? opened : tr("No project is open. Drop its folder here, or open it (Ctrl+O).");
}

void ImagesDesk::Redraw() {
  std::vector<PictureMark> left, right;
  const QString where = run() + "/" + image();
  if (inspected_ && tracks_->isChecked()) {
    for (const InspectedPoint& point : inspected_->points) {
      const QPointF seen = Point(point.seen);
      PictureMark mark;
      mark.layer = "tracks";
      mark.kind = PictureMark::Kind::kLine;
      mark.points << seen << seen + 10 * (Point(point.predicted) - seen);
      mark.colour = QColor(213, 94, 0);
      left.push_back(mark);
      mark.kind = PictureMark::Kind::kCross;
      mark.points = QPolygonF({seen});
      mark.object = "point:" + run() + "/" + QString::number(point.id);
      mark.colour = point.track_length > 3 ? QColor(0, 158, 115) : QColor(86, 180, 233);
      left.push_back(mark);
    }
  }
  AddMatches(&left, &right);
  if (inspected_ && detections_->isChecked()) {
    for (const InspectedTag& tag : inspected_->tags) {
      PictureMark mark;
      mark.layer = "detections";
      mark.kind = PictureMark::Kind::kOutline;
      for (const Eigen::Vector2d& corner : tag.corners) mark.points << Point(corner);
      mark.colour = tag.excluded ? QColor(150, 150, 150) : QColor(0, 200, 0);
      mark.text = QString::number(tag.id) + (tag.excluded ? tr(" excluded") : "");
      mark.object = "detection:" + where + "#" + QString::number(tag.id);
      left.push_back(mark);
    }
  }
  AddMarks(&left);
  left_->SetMarks(std::move(left));
  right_->SetMarks(std::move(right));
  for (PictureView* view : {left_, right_}) view->SetHighlight(Highlighted());
  if (inspected_ && pictured_ && !wanted_.startsWith("image:")) {
    for (const PictureMark& mark : left_->marks()) {
      if (wanted_.isEmpty() || mark.object != wanted_) continue;
      wanted_.clear();
      left_->LookAt(mark.points.boundingRect());
      break;
    }
  }
}

void ImagesDesk::ShowTag(int tag_id) {
  InBackground(
      this,
      [snapshot = workspace_->snapshot(), tag_id] {
        return ImagesOfTag(*snapshot->project, tag_id, TagImageOrder::kLargest);
      },
      [this, tag_id, of = workspace_->selected()](const Attempted<std::vector<TagImage>>& images) {
        if (workspace_->selected() != of) return;  // something else was selected meanwhile
        if (images.value.empty()) {
          status_->setText(tr("Tag %1 was detected in no image.").arg(tag_id));
          return;
        }
        auto shown = std::find_if(images.value.begin(), images.value.end(), [this](const TagImage& seen) {
          return !workspace_->run().isEmpty() && seen.image.starts_with(workspace_->run().toStdString() + "/");
        });
        if (shown == images.value.end()) shown = images.value.begin();
        ShowObject(Text("detection:" + shown->image + "#" + std::to_string(tag_id)));
      });
}

bool ImagesDesk::ShowPoint(const QString& object) {
  const QString run_name = object.section(':', 1).section('/', 0, 0);
  const int64_t id = object.section('/', -1).toLongLong();
  if (run_->findText(run_name) < 0) return false;
  InBackground(
      this,
      [inspector = workspace_->InspectorOf(run_name.toStdString()), id] {
        const std::lock_guard guard(inspector->mutex);
        return inspector->inspector.ImagesOf(id);
      },
      [this, object, run_name](const Attempted<std::vector<std::string>>& images) {
        if (images.value.empty()) {
          status_->setText(images.error);
          return;
        }
        ShowObject("image:" + run_name + "/" + Text(images.value.front()));
        wanted_ = object;
        Redraw();
      });
  return true;
}

bool ImagesDesk::ShowObject(const QString& object) {
  const auto& snapshot = workspace_->snapshot();
  if (!snapshot) return false;
  const QString name = object.section(':', 1);
  if (object.startsWith("panorama:")) {
    const int index = reference_->findText(name);
    if (index >= 0) reference_->setCurrentIndex(index);
    return index >= 0;
  }
  if (object.startsWith("station:") || object.startsWith("tag:")) {
    bool shown = false;
    for (const std::string& related : snapshot->Related(object.toStdString())) {
      if (related.starts_with("panorama:")) shown |= ShowObject(Text(related));
      if (const auto tag = TagOf(related)) {
        ShowTag(*tag);
        shown = true;
      }
    }
    return shown;
  }
  if (object.startsWith("point:")) return ShowPoint(object);
  if (!object.startsWith("image:") && !object.startsWith("detection:")) return false;
  QString file = name.section('/', 1);
  if (object.startsWith("detection:")) file = file.section('#', 0, -2);
  const int run_index = run_->findText(name.section('/', 0, 0));
  if (run_index < 0) return false;
  wanted_ = object;
  if (run_->currentIndex() != run_index) run_->setCurrentIndex(run_index);
  const auto found = images_->findItems(file, Qt::MatchExactly);
  if (found.isEmpty()) return false;
  if (images_->currentItem() == found.front()) {
    Redraw();
  } else {
    const QSignalBlocker block(images_), block_slider(slider_);
    images_->setCurrentItem(found.front());
    slider_->setValue(images_->currentRow());
    ShowImage();
  }
  return true;
}

}  // namespace trigpoint

#include "app/desktop/images_desk.h"

#include <QCheckBox>
#include <QComboBox>
#include <QHBoxLayout>
#include <QLabel>
#include <QListWidget>
#include <QPushButton>
#include <QSlider>
#include <QSplitter>
#include <QVBoxLayout>
#include <algorithm>
#include <cmath>

#include "app/desktop/background.h"
#include "app/desktop/flow_layout.h"
#include "app/desktop/inspector.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/pictures.h"
#include "app/pipeline/marking.h"
#include "app/pipeline/stages.h"
#include "survey/tags/tag_files.h"

namespace trigpoint {

namespace {

constexpr double kMostTagZoom = 6;  // screen pixels a picture pixel when a tag is looked at
constexpr double kTagShare = 0.4;   // of the view that it then fills

QPointF Point(const Eigen::Vector2d& p) { return {p.x(), p.y()}; }

QCheckBox* LayerBox(const QString& text, const char* name, bool on) {
  auto* box = new QCheckBox(text);
  box->setObjectName(name);
  box->setChecked(on);
  return box;
}

// The image in which a tag is seen largest: RUN/FILE, or empty.
std::string BestImageOf(const Project& project, int tag_id) {
  std::string best;
  double largest = 0;
  for (const Run& run : project.site().runs) {
    StageTarget target;
    target.run = run.name;
    const std::filesystem::path file = ResultOf(project, "detect", target) / "detections.csv";
    if (!std::filesystem::exists(file)) continue;
    std::vector<std::string> warnings;
    for (const ImageDetections& image : ReadDetections(file, 0.2, &warnings)) {
      for (const TagDetection& tag : image.detections) {
        const double side = (tag.corners[0] - tag.corners[2]).norm();
        if (tag.id == tag_id && side > largest) largest = side, best = run.name + "/" + image.image;
      }
    }
  }
  return best;
}

}  // namespace

ImagesDesk::ImagesDesk(Workspace* workspace, QWidget* parent) : QWidget(parent), workspace_(workspace) {
  run_ = new QComboBox;
  run_->setObjectName("images.run");
  run_->setAccessibleName(tr("Run"));
  images_ = new QListWidget;
  images_->setObjectName("images.list");
  images_->setAccessibleName(tr("Images of the run"));
  images_->setUniformItemSizes(true);
  images_->setMinimumWidth(images_->fontMetrics().horizontalAdvance("images/000000.jpg") + 40);
  images_->setTextElideMode(Qt::ElideLeft);
  images_->setHorizontalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
  slider_ = new QSlider(Qt::Horizontal);
  slider_->setAccessibleName(tr("Image by time"));
  reference_ = new QComboBox;
  reference_->setObjectName("images.reference");
  reference_->setSizeAdjustPolicy(QComboBox::AdjustToMinimumContentsLengthWithIcon);
  reference_->setMinimumContentsLength(14);
  reference_->setAccessibleName(tr("Panorama or photo"));
  auto* match = new QPushButton(tr("&Match"));
  match->setObjectName("images.match");
  match->setToolTip(tr("Match the image with the panorama, and judge the matches by the solution"));
  // Reprojection errors are drawn ten times as long as they are.
  detections_ = LayerBox(tr("detections"), "images.detections", true);
  tracks_ = LayerBox(tr("tracks, errors x 10"), "images.tracks", true);
  inliers_ = LayerBox(tr("inlier matches"), "images.inliers", true);
  outliers_ = LayerBox(tr("outlier matches"), "images.outliers", false);
  point_ = new QComboBox;
  point_->setObjectName("images.point");
  point_->setAccessibleName(tr("Name of the surveyed point"));
  point_->setEditable(true);
  point_->setMinimumContentsLength(8);
  mark_ = new QPushButton(tr("Mar&k by click"));
  mark_->setObjectName("images.mark");
  mark_->setCheckable(true);
  mark_->setToolTip(tr("The next click in the image marks the point; from two marks on it is predicted elsewhere"));
  confirm_ = new QPushButton(tr("C&onfirm prediction"));
  confirm_->setObjectName("images.confirm");
  confirm_->setEnabled(false);
  status_ = new QLabel;
  status_->setObjectName("images.status");
  status_->setWordWrap(true);
  place_ = new QLabel;
  place_->setMinimumWidth(150);
  left_ = new PictureView;
  left_->setObjectName("images.left");
  left_->setAccessibleName(tr("Camera image"));
  right_ = new PictureView;
  right_->setObjectName("images.right");
  right_->setAccessibleName(tr("Panorama or photo"));

  auto* side = new QWidget;
  auto* column = new QVBoxLayout(side);
  column->setContentsMargins(0, 0, 0, 0);
  column->addWidget(run_);
  column->addWidget(images_, 1);
  auto* pictures = new QSplitter;
  pictures->addWidget(left_);
  pictures->addWidget(right_);
  auto* middle = new QWidget;
  auto* rows = new QVBoxLayout(middle);
  rows->setContentsMargins(0, 0, 0, 0);
  auto* top = new FlowLayout;
  for (QWidget* w : std::initializer_list<QWidget*>{detections_, tracks_, inliers_, outliers_, reference_, match}) {
    top->addWidget(w);
  }
  rows->addLayout(top);
  rows->addWidget(pictures, 1);
  rows->addWidget(slider_);
  auto* bottom = new FlowLayout;
  for (QWidget* w : std::initializer_list<QWidget*>{new QLabel(tr("Point")), point_, mark_, confirm_}) {
    bottom->addWidget(w);
  }
  rows->addLayout(bottom);
  auto* below = new QHBoxLayout;
  below->addWidget(status_, 1);
  below->addWidget(place_);
  rows->addLayout(below);
  auto* split = new QSplitter;
  split->addWidget(side);
  split->addWidget(middle);
  split->setStretchFactor(1, 1);
  split->setSizes({160, 800});
  auto* all = new QVBoxLayout(this);
  all->addWidget(split);

  connect(run_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &ImagesDesk::FillImages);
  connect(images_, &QListWidget::currentRowChanged, this, [this](int row) {
    const QSignalBlocker block(slider_);
    slider_->setValue(row);
    ShowImage();
    if (row >= 0) workspace_->Select("image:" + run() + "/" + image());
  });
  connect(slider_, &QSlider::valueChanged, images_, [this](int row) { images_->setCurrentRow(row); });
  connect(reference_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &ImagesDesk::ShowReference);
  connect(match, &QPushButton::clicked, this, &ImagesDesk::ShowMatches);
  for (QCheckBox* box : {detections_, tracks_, inliers_, outliers_}) {
    connect(box, &QCheckBox::toggled, this, &ImagesDesk::Redraw);
  }
  connect(left_, &PictureView::Clicked, this, [this](const QPointF& pixel, const QString& object) {
    if (mark_->isChecked()) {
      mark_->setChecked(false);
      Mark(pixel.x(), pixel.y());
    } else if (!object.isEmpty()) {
      workspace_->Select(object);
    }
  });
  for (PictureView* view : {left_, right_}) {
    connect(view, &PictureView::Hovered, this, [this](const QPointF& pixel) {
      place_->setText(tr("%1, %2 px").arg(pixel.x(), 0, 'f', 1).arg(pixel.y(), 0, 'f', 1));
    });
  }
  connect(confirm_, &QPushButton::clicked, this, [this] {
    for (const Prediction& p : predictions_) {
      if (p.image == run() + "/" + image()) return Mark(p.u, p.v);
    }
  });
  connect(point_, &QComboBox::currentTextChanged, this, &ImagesDesk::ShowMarks);
  connect(workspace_, &Workspace::Replaced, this, &ImagesDesk::Clear);
  connect(workspace_, &Workspace::Opened, this, &ImagesDesk::Refresh);
  connect(workspace_, &Workspace::Closed, this, &ImagesDesk::Refresh);
  connect(workspace_, &Workspace::Selected, this, [this](const QString& object) {
    left_->SetHighlight(object);
    if (object.startsWith("detection:") || object.startsWith("image:")) ShowObject(object);
  });
}

QString ImagesDesk::run() const { return run_->currentText(); }
QString ImagesDesk::image() const { return images_->currentItem() != nullptr ? images_->currentItem()->text() : ""; }

void ImagesDesk::Refresh() {
  const QString run_before = run_->currentText(), image_before = image(), reference = reference_->currentText();
  const QString point = point_->currentText();
  {
    const QSignalBlocker block_run(run_), block_reference(reference_), block_point(point_);
    run_->clear();
    reference_->clear();
    point_->clear();
    if (const auto& snapshot = workspace_->snapshot()) {
      for (const SnapshotRun& r : snapshot->runs) {
        if (r.broken.empty()) run_->addItem(QString::fromStdString(r.name));
      }
      for (const SnapshotReference& r : snapshot->references) reference_->addItem(QString::fromStdString(r.name));
      for (const SnapshotControl& c : snapshot->controls) point_->addItem(QString::fromStdString(c.name));
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
  ++generation_;
  ++reference_generation_;
  inspected_.reset();
  matches_.reset();
  predictions_.clear();
  wanted_.clear();
  mark_->setChecked(false);
  confirm_->setEnabled(false);
  status_->clear();
  place_->clear();
  {
    const QSignalBlocker block(point_);
    point_->clearEditText();
  }
  for (PictureView* view : {left_, right_}) view->SetMarks({});
  left_->SetPicture({}, tr("no image"));
  right_->SetPicture({}, tr("no panorama"));
}

void ImagesDesk::FillImages() {
  const QSignalBlocker block(images_), block_slider(slider_);
  images_->clear();
  const SnapshotRun* r = workspace_->snapshot() ? workspace_->snapshot()->FindRun(run().toStdString()) : nullptr;
  if (r != nullptr) {
    QStringList files;
    for (const SnapshotImage& i : r->images) files << QString::fromStdString(i.file);
    images_->addItems(files);
  }
  slider_->setRange(0, std::max(0, images_->count() - 1));
  images_->setCurrentRow(images_->count() > 0 ? 0 : -1);
  ShowImage();
}

void ImagesDesk::showEvent(QShowEvent* event) {
  QWidget::showEvent(event);
  if (!stale_) return;
  ShowImage();
  ShowReference();
}

void ImagesDesk::ShowImage() {
  const int generation = ++generation_;
  stale_ = !isVisible();
  if (stale_ && workspace_->snapshot()) return;
  inspected_.reset();
  matches_.reset();
  if (!workspace_->snapshot() || image().isEmpty()) {
    left_->SetPicture({}, tr("no image"));
    left_->SetMarks({});
    return;
  }
  const std::string r = run().toStdString(), file = image().toStdString();
  InBackground(
      this, [snapshot = workspace_->snapshot(), r, file] { return LoadRunPicture(*snapshot->project, r, file); },
      [this, generation, r, file](const Attempted<QImage>& picture) {
        if (generation != generation_) return;
        left_->SetPicture(picture.value,
                          picture.error.isEmpty() ? QString::fromStdString(r + "/" + file) : picture.error);
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
        if (!inspected.error.isEmpty()) {
          status_->setText(inspected.error);
        } else {
          QString text = tr("tags: %1, points: %2").arg(inspected_->tags.size()).arg(inspected_->points.size());
          if (inspected_->rms_px) text += tr(", reprojection RMS %1 px").arg(*inspected_->rms_px, 0, 'f', 2);
          if (inspected_->excluded) text += tr("; excluded by the review");
          status_->setText(text);
        }
        Redraw();
        emit Shown(run() + "/" + image());
      });
}

void ImagesDesk::ShowReference() {
  const int generation = ++reference_generation_;
  right_->SetMarks({});
  const auto& snapshot = workspace_->snapshot();
  const int index = reference_->currentIndex();
  if (!snapshot || index < 0 || index >= static_cast<int>(snapshot->references.size())) {
    right_->SetPicture({}, tr("no panorama"));
    return;
  }
  const SnapshotReference& reference = snapshot->references[static_cast<size_t>(index)];
  matches_.reset();
  Redraw();
  if (stale_) return;
  InBackground(
      this,
      [file = reference.files.empty() ? std::filesystem::path() : reference.files.front()] {
        return LoadAnyPicture(file, 0);
      },
      [this, generation, name = QString::fromStdString(reference.name)](const Attempted<QImage>& picture) {
        if (generation != reference_generation_) return;
        right_->SetPicture(picture.value, picture.error.isEmpty() ? name : picture.error);
      });
}

void ImagesDesk::ShowMatches() {
  if (!workspace_->snapshot() || image().isEmpty() || reference_->currentText().isEmpty()) return;
  const int generation = generation_;
  status_->setText(tr("Matching ..."));
  const std::shared_ptr<SharedInspector> inspector = workspace_->InspectorOf(run().toStdString());
  InBackground(
      this,
      [inspector, file = image().toStdString(), panorama = reference_->currentText().toStdString()] {
        const std::lock_guard guard(inspector->mutex);
        return std::shared_ptr<const std::vector<InspectedMatch>>(
            std::make_shared<std::vector<InspectedMatch>>(inspector->inspector.Matches(file, panorama)));
      },
      [this, generation](const Attempted<std::shared_ptr<const std::vector<InspectedMatch>>>& matches) {
        if (generation != generation_) return;
        if (!matches.value) {
          status_->setText(matches.error);
          return;
        }
        matches_ = matches.value;
        const auto inliers = std::count_if(matches_->begin(), matches_->end(), [](const auto& m) { return m.inlier; });
        status_->setText(tr("%1 matches, %2 of them within 3 px of their epipolar lines")
                             .arg(matches_->size())
                             .arg(static_cast<int>(inliers)));
        Redraw();
      });
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
  if (matches_) {
    int number = 0;
    for (const InspectedMatch& match : *matches_) {
      if (!(match.inlier ? inliers_ : outliers_)->isChecked()) continue;
      ++number;
      PictureMark mark;
      mark.layer = match.inlier ? "inliers" : "outliers";
      mark.kind = PictureMark::Kind::kCircle;
      mark.colour = match.inlier ? QColor(240, 228, 66) : QColor(204, 121, 167);
      if (number % 20 == 1) mark.text = QString::number(number);  // the same in both pictures
      mark.points << Point(match.image) << QPointF(3, 0);
      left.push_back(mark);
      mark.points.clear();
      mark.points << Point(match.panorama) << QPointF(3, 0);
      right.push_back(mark);
    }
  }
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
  confirm_->setEnabled(false);
  for (const Prediction& p : predictions_) {
    if (p.image != where) continue;
    PictureMark mark;
    mark.layer = "marks";
    mark.kind = PictureMark::Kind::kCircle;
    mark.points << QPointF(p.u, p.v) << QPointF(2 * p.sigma_px, 0);
    mark.colour = p.marked ? QColor(0, 114, 178) : QColor(230, 159, 0);
    mark.text = point_->currentText() + (p.marked ? "" : tr(" predicted"));
    left.push_back(mark);
    confirm_->setEnabled(!p.marked);
  }
  left_->SetMarks(std::move(left));
  right_->SetMarks(std::move(right));
  left_->SetHighlight(workspace_->selected());
  if (inspected_ && !left_->image().isNull() && !wanted_.startsWith("image:")) {
    for (const PictureMark& mark : left_->marks()) {
      if (wanted_.isEmpty() || mark.object != wanted_) continue;
      const QRectF box = mark.points.boundingRect();
      wanted_.clear();
      const double side = std::max({1.0, box.width(), box.height()});
      left_->LookAt(box.center(), std::min(kMostTagZoom, kTagShare * std::min(left_->width(), left_->height()) / side));
      break;
    }
  }
}

void ImagesDesk::Mark(double u, double v) {
  const std::string point = point_->currentText().trimmed().toStdString();
  InBackground(
      this,
      [snapshot = workspace_->snapshot(), point, where = (run() + "/" + image()).toStdString(), u, v] {
        SavePointMark(*snapshot->project, point, where, {u, v});
        return true;
      },
      [this](const Attempted<bool>& saved) {
        if (!saved.error.isEmpty()) emit workspace_->Problem(saved.error, tr("The mark was not saved."));
        ShowMarks();
      });
}

void ImagesDesk::ShowMarks() {
  predictions_.clear();
  const std::string point = point_->currentText().trimmed().toStdString();
  if (!workspace_->snapshot() || point.empty()) return Redraw();
  struct Answer {
    std::vector<Prediction> predictions;
    QString text;
  };
  InBackground(
      this,
      [snapshot = workspace_->snapshot(), point] {
        Answer answer;
        try {
          const PointSolution solution = PredictPoint(*snapshot->project, point, "");
          for (const PointPrediction& p : solution.images) {
            answer.predictions.push_back({QString::fromStdString(p.run + "/" + p.file), p.pixel.x(), p.pixel.y(),
                                          std::sqrt(p.covariance_px2.trace() / 2), p.marked.has_value()});
          }
          answer.text = tr("%1 marks, %2 px; it must show in %3 images")
                            .arg(solution.marks)
                            .arg(solution.rms_px, 0, 'f', 2)
                            .arg(solution.images.size());
        } catch (const Error& e) {
          answer.text = QString::fromUtf8(e.what());
        }
        return answer;
      },
      [this, point, of = workspace_->snapshot()](const Attempted<Answer>& answer) {
        if (of != workspace_->snapshot() || point_->currentText().trimmed().toStdString() != point) return;
        predictions_ = answer.value.predictions;
        status_->setText(answer.error.isEmpty() ? answer.value.text : answer.error);
        Redraw();
      });
}

void ImagesDesk::ShowTag(int tag_id) {
  InBackground(
      this, [snapshot = workspace_->snapshot(), tag_id] { return BestImageOf(*snapshot->project, tag_id); },
      [this, tag_id](const Attempted<std::string>& best) {
        if (best.value.empty()) {
          status_->setText(tr("Tag %1 was detected in no image.").arg(tag_id));
          return;
        }
        ShowObject(QString::fromStdString("detection:" + best.value + "#" + std::to_string(tag_id)));
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
        ShowObject("image:" + run_name + "/" + QString::fromStdString(images.value.front()));
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
      if (related.starts_with("panorama:")) shown |= ShowObject(QString::fromStdString(related));
      if (related.starts_with("tag:")) {
        ShowTag(std::stoi(related.substr(4)));
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

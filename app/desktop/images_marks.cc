// The images desk's marks of surveyed points, and the way from one image of a tag to the next.
#include <QCheckBox>
#include <QComboBox>
#include <QLabel>
#include <QMenu>
#include <QPushButton>
#include <algorithm>
#include <cmath>

#include "app/desktop/background.h"
#include "app/desktop/images_desk.h"
#include "app/desktop/picture_view.h"
#include "calib/base/error.h"
#include "datasets/io/text.h"
#include "datasets/project/marking.h"
#include "eval/truth/marked_point.h"

namespace trigpoint {

namespace {

constexpr double kMarkRing_px = 4;  // about a mark, in the picture

// Whether an image below the project is the one that `where` names: the same path, or RUN/FILE.
bool IsOf(const QString& image, const QString& where) { return NamesPath(where.toStdString(), image.toStdString()); }

QString Words(const MarkStep* step) {
  if (step == nullptr) return QString();
  const QString words = !step->before  ? ImagesDesk::tr("mark %1 in %2")
                        : !step->after ? ImagesDesk::tr("remove the mark of %1 in %2")
                                       : ImagesDesk::tr("move the mark of %1 in %2");
  return words.arg(step->point, step->image);
}

}  // namespace

void ImagesDesk::ConnectMarks() {
  connect(left_, &PictureView::MenuAsked, this, [this](const QString& object, const QPoint& at) {
    if (!object.startsWith("mark:")) return workspace_->AskMenu(object, at);
    auto* menu = new QMenu(this);
    menu->setObjectName("mark.menu");
    menu->setAttribute(Qt::WA_DeleteOnClose);
    menu->addAction(tr("Remove the mark of %1").arg(object.mid(5)), this,
                    [this, object] { RemoveMark(object.mid(5)); });
    menu->popup(at);
  });
  connect(left_, &PictureView::MarkMoved, this, [this](const QString& object, const QPointF& pixel) {
    if (!object.startsWith("mark:")) return;
    point_->setCurrentText(object.mid(5));
    Mark(pixel.x(), pixel.y());
  });
  connect(confirm_, &QPushButton::clicked, this, [this] {
    for (const Prediction& p : predictions_) {
      if (IsOf(p.image, Here())) return Mark(p.u, p.v);
    }
  });
  connect(remove_, &QPushButton::clicked, this, [this] { RemoveMark(point_->currentText().trimmed()); });
  connect(point_, &QComboBox::currentTextChanged, this, &ImagesDesk::ShowMarks);
}

void ImagesDesk::ForgetPrediction(const QString& where) {
  predictions_.erase(std::remove_if(predictions_.begin(), predictions_.end(),
                                    [&](const Prediction& p) { return IsOf(p.image, where); }),
                     predictions_.end());
}

void ImagesDesk::Mark(double u, double v) {
  ForgetPrediction(Here());
  Change(point_->currentText().trimmed(), MarkPlace{{u, v}});
}

void ImagesDesk::RemoveMark(const QString& point) {
  if (point == point_->currentText().trimmed()) ForgetPrediction(Here());
  Change(point, std::nullopt);
}

void ImagesDesk::Change(const QString& point, const std::optional<MarkPlace>& after) {
  MarkStep step;
  step.point = point, step.image = Here(), step.after = after;
  for (const PlacedMark& mark : marks_) {
    if (mark.point == point && IsOf(mark.image, step.image)) step.before = mark.place;
  }
  step.number = history_.Add(step);
  Apply(step, MarkHistory::Way::kDone);
}

// Draws what was changed at once; the file follows, one change after the other.
void ImagesDesk::Apply(const MarkStep& step, MarkHistory::Way way) {
  const std::optional<MarkPlace> place = way == MarkHistory::Way::kUndone ? step.before : step.after;
  marks_.erase(
      std::remove_if(marks_.begin(), marks_.end(),
                     [&](const PlacedMark& mark) { return mark.point == step.point && IsOf(mark.image, step.image); }),
      marks_.end());
  if (place) marks_.push_back({step.point, step.image, *place});
  ++marks_generation_;  // what is being read is older
  Redraw();
  changes_.push_back(
      {[snapshot = workspace_->snapshot(), place, point = step.point.toStdString(), where = step.image.toStdString()] {
         if (!place) return RemovePointMark(*snapshot->project, point, where);
         SavePointMark(*snapshot->project, point, where, {place->pixel.x(), place->pixel.y()}, nullptr,
                       place->sigma_px);
       },
       step.number, way});
  emit MarksChanged();
  if (changes_.size() == 1) WriteNextMarks();
}

void ImagesDesk::WriteNextMarks() {
  InBackground(
      this,
      [write = changes_.front().write] {
        write();
        return true;
      },
      [this](const Attempted<bool>& written) {
        const MarksChange change = std::move(changes_.front());
        changes_.pop_front();
        if (!written.error.isEmpty()) {
          history_.Fail(change.number, change.way);
          emit workspace_->Problem(written.error, tr("The change of the mark was not saved."));
          emit MarksChanged();
        }
        if (!changes_.empty()) return WriteNextMarks();
        workspace_->CheckStates();
        ShowMarks();  // as the file has them: what was not written is taken back
      });
}

void ImagesDesk::Undo() {
  if (!workspace_->snapshot() || history_.undone_next() == nullptr) return;
  const MarkStep step = history_.Undo();
  ShowStep(step);
  Apply(step, MarkHistory::Way::kUndone);
}

void ImagesDesk::Redo() {
  if (!workspace_->snapshot() || history_.redone_next() == nullptr) return;
  const MarkStep step = history_.Redo();
  ShowStep(step);
  Apply(step, MarkHistory::Way::kRedone);
}

void ImagesDesk::ShowStep(const MarkStep& step) {
  if (Here() != step.image) {
    workspace_->Select("image:" + step.image);
    ShowObject("image:" + step.image);  // it may have been selected already
  }
  point_->setCurrentText(step.point);
  ForgetPrediction(step.image);
}

QString ImagesDesk::UndoText() const { return Words(history_.undone_next()); }
QString ImagesDesk::RedoText() const { return Words(history_.redone_next()); }

void ImagesDesk::ShowMarks() {
  if (!changes_.empty()) return;  // then they are read when those are written
  const int generation = ++marks_generation_;
  predictions_.clear();
  if (!workspace_->snapshot()) {
    marks_.clear();
    return Redraw();
  }
  InBackground(
      this,
      [snapshot = workspace_->snapshot()] {
        std::vector<PlacedMark> marks;
        for (const PointMark& mark : ReadPointMarks(*snapshot->project)) {
          marks.push_back({QString::fromStdString(mark.point),
                           QString::fromStdString(mark.image),
                           {{mark.pixel.x(), mark.pixel.y()}, mark.sigma_px}});
        }
        return marks;
      },
      [this, generation](const Attempted<std::vector<PlacedMark>>& marks) {
        if (generation != marks_generation_) return;
        marks_ = marks.value;
        Redraw();
        if (!marks.error.isEmpty()) return status_->setText(marks.error);
        ShowPredictions();
      });
}

void ImagesDesk::ShowPredictions() {
  const std::string point = point_->currentText().trimmed().toStdString();
  if (point.empty()) return;
  struct Answer {
    std::vector<Prediction> predictions;
    QString text;
  };
  InBackground(
      this,
      [snapshot = workspace_->snapshot(), point] {
        Answer answer;
        const PointSolution solution = PredictPoint(*snapshot->project, point, "");
        for (const PredictedMark& p : solution.images) {
          answer.predictions.push_back({QString::fromStdString(p.run + "/" + p.file), p.pixel.x(), p.pixel.y(),
                                        std::sqrt(p.covariance_px2.trace() / 2),
                                        p.marked ? (*p.marked - p.pixel).norm() : -1});
        }
        answer.text = tr("%1 marks, %2 px; it must show in %3 images")
                          .arg(solution.marks)
                          .arg(solution.rms_px, 0, 'f', 2)
                          .arg(solution.images.size());
        return answer;
      },
      [this, generation = marks_generation_](const Attempted<Answer>& answer) {
        if (generation != marks_generation_) return;
        predictions_ = answer.value.predictions;
        status_->setText(answer.error.isEmpty() ? answer.value.text : answer.error);
        Redraw();
      });
}

void ImagesDesk::AddMarks(std::vector<PictureMark>* marks) {
  const QString point = point_->currentText().trimmed();
  confirm_->setEnabled(false);
  remove_->setEnabled(false);
  const Prediction* predicted = nullptr;
  for (const Prediction& p : predictions_) {
    if (IsOf(p.image, Here())) predicted = &p;
  }
  for (const PlacedMark& placed : marks_) {
    if (!IsOf(placed.image, Here())) continue;
    PictureMark mark;
    mark.layer = "marks";
    mark.kind = PictureMark::Kind::kCircle;
    mark.points << placed.place.pixel << QPointF(kMarkRing_px, 0);
    mark.colour = QColor(0, 114, 178);
    mark.text = placed.point;
    mark.object = "mark:" + placed.point;
    mark.movable = true;
    if (placed.point == point) {
      remove_->setEnabled(true);
      if (predicted != nullptr && predicted->off_px >= 0)
        mark.text += tr(", %1 px off").arg(predicted->off_px, 0, 'f', 2);
    }
    marks->push_back(mark);
  }
  if (predicted == nullptr || predicted->off_px >= 0) return;
  PictureMark mark;
  mark.layer = "marks";
  mark.kind = PictureMark::Kind::kCircle;
  mark.points << QPointF(predicted->u, predicted->v) << QPointF(2 * predicted->sigma_px, 0);
  mark.colour = QColor(230, 159, 0);
  mark.text = point + tr(" predicted");
  marks->push_back(mark);
  confirm_->setEnabled(true);
}

std::optional<int> ImagesDesk::TagOf(const std::string& object) {
  if (!object.starts_with("tag:")) return std::nullopt;
  const std::optional<int64_t> number = ParseInt(object.substr(4));
  return number ? std::optional<int>(static_cast<int>(*number)) : std::nullopt;
}

int ImagesDesk::SelectedTag() const {
  for (const std::string& related : workspace_->related()) {
    if (const auto tag = TagOf(related)) return *tag;
  }
  return -1;
}

void ImagesDesk::NextImageOfTag() {
  const int tag = SelectedTag();
  if (!workspace_->snapshot() || tag < 0) {
    status_->setText(tr("Select a station or a tag first."));
    return;
  }
  const auto show = [this, tag](size_t at) {
    if (tag_images_.empty()) return status_->setText(tr("Tag %1 was detected in no image.").arg(tag));
    tag_at_ = at % tag_images_.size();
    const TagImage& seen = tag_images_[tag_at_];
    workspace_->Select(QString::fromStdString("detection:" + seen.image + "#" + std::to_string(tag)));
    turn_->setText(tr("tag %1: %2 of %3").arg(tag).arg(tag_at_ + 1).arg(tag_images_.size()) +
                   (seen.rms_px ? tr(", residual %1 px").arg(*seen.rms_px, 0, 'f', 2) : QString()));
  };
  if (tag == tag_) return show(tag_at_ + 1);
  InBackground(
      this,
      [snapshot = workspace_->snapshot(), tag, order = static_cast<TagImageOrder>(order_->currentData().toInt())] {
        return ImagesOfTag(*snapshot->project, tag, order);
      },
      [this, tag, show](const Attempted<std::vector<TagImage>>& images) {
        if (SelectedTag() != tag) return;  // something else was selected meanwhile
        if (!images.error.isEmpty()) return status_->setText(images.error);
        tag_ = tag;
        tag_images_ = images.value;
        show(0);
      });
}

}  // namespace trigpoint

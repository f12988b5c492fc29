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
#include "app/pipeline/marking.h"
#include "calib/base/error.h"

namespace trigpoint {

namespace {

constexpr double kMarkRing_px = 4;  // about a mark, in the picture

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
      if (IsHere(p.image)) return Mark(p.u, p.v);
    }
  });
  connect(remove_, &QPushButton::clicked, this, [this] { RemoveMark(point_->currentText().trimmed()); });
  connect(point_, &QComboBox::currentTextChanged, this, &ImagesDesk::ShowMarks);
}

bool ImagesDesk::IsHere(const QString& of) const {
  const QString where = run() + "/" + image();
  return of == where || of.endsWith("/" + where);
}

void ImagesDesk::ForgetPrediction() {
  predictions_.erase(
      std::remove_if(predictions_.begin(), predictions_.end(), [this](const Prediction& p) { return IsHere(p.image); }),
      predictions_.end());
}

void ImagesDesk::Mark(double u, double v) {
  const QString point = point_->currentText().trimmed(), where = run() + "/" + image();
  const auto drawn = std::find_if(marks_.begin(), marks_.end(),
                                  [&](const PlacedMark& mark) { return mark.point == point && IsHere(mark.image); });
  if (drawn != marks_.end()) {
    drawn->u = u, drawn->v = v;
  } else {
    marks_.push_back({point, where, u, v});
  }
  ForgetPrediction();
  WriteMarks(
      [snapshot = workspace_->snapshot(), point = point.toStdString(), where = where.toStdString(), u, v] {
        SavePointMark(*snapshot->project, point, where, {u, v});
      },
      tr("The mark was not saved."));
}

void ImagesDesk::RemoveMark(const QString& point) {
  marks_.erase(std::remove_if(marks_.begin(), marks_.end(),
                              [&](const PlacedMark& mark) { return mark.point == point && IsHere(mark.image); }),
               marks_.end());
  if (point == point_->currentText().trimmed()) ForgetPrediction();
  WriteMarks([snapshot = workspace_->snapshot(), point = point.toStdString(),
              where = (run() + "/" + image()).toStdString()] { RemovePointMark(*snapshot->project, point, where); },
             tr("The mark was not removed."));
}

// Draws what was changed at once; the file follows, one change after the other.
void ImagesDesk::WriteMarks(std::function<void()> write, const QString& failed) {
  ++marks_generation_;  // what is being read is older
  Redraw();
  changes_.push_back({std::move(write), failed});
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
        if (!written.error.isEmpty()) emit workspace_->Problem(written.error, changes_.front().failed);
        changes_.pop_front();
        if (!changes_.empty()) return WriteNextMarks();
        ShowMarks();  // as the file has them: what was not written is taken back
      });
}

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
          marks.push_back(
              {QString::fromStdString(mark.point), QString::fromStdString(mark.image), mark.pixel.x(), mark.pixel.y()});
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
    if (IsHere(p.image)) predicted = &p;
  }
  for (const PlacedMark& placed : marks_) {
    if (!IsHere(placed.image)) continue;
    PictureMark mark;
    mark.layer = "marks";
    mark.kind = PictureMark::Kind::kCircle;
    mark.points << QPointF(placed.u, placed.v) << QPointF(kMarkRing_px, 0);
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

int ImagesDesk::SelectedTag() const {
  for (const std::string& related : workspace_->related()) {
    if (related.starts_with("tag:")) return std::stoi(related.substr(4));
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

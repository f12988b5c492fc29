// The images desk's marks of surveyed points, its matches, and the way from one image of a tag to the next.
#include <QCheckBox>
#include <QComboBox>
#include <QLabel>
#include <QMenu>
#include <QPushButton>
#include <algorithm>
#include <cmath>

#include "app/desktop/background.h"
#include "app/desktop/images_desk.h"
#include "app/desktop/inspector.h"
#include "app/desktop/match_lines.h"
#include "app/desktop/picture_view.h"
#include "app/pipeline/marking.h"
#include "calib/base/error.h"

namespace trigpoint {

namespace {

constexpr double kMarkRing_px = 4;  // about a mark, in the picture
constexpr size_t kMostLines = 250;  // between the pictures; more cover them
constexpr int kNumberEvery = 20;    // of the matches one in so many has its number in both pictures

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
      if (p.image == run() + "/" + image()) return Mark(p.u, p.v);
    }
  });
  connect(remove_, &QPushButton::clicked, this, [this] { RemoveMark(point_->currentText().trimmed()); });
  connect(point_, &QComboBox::currentTextChanged, this, &ImagesDesk::ShowMarks);
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

void ImagesDesk::RemoveMark(const QString& point) {
  InBackground(
      this,
      [snapshot = workspace_->snapshot(), point = point.toStdString(), where = (run() + "/" + image()).toStdString()] {
        RemovePointMark(*snapshot->project, point, where);
        return true;
      },
      [this](const Attempted<bool>& removed) {
        if (!removed.error.isEmpty()) emit workspace_->Problem(removed.error, tr("The mark was not removed."));
        ShowMarks();
      });
}

void ImagesDesk::ShowMarks() {
  predictions_.clear();
  if (!workspace_->snapshot()) {
    marks_.clear();
    return Redraw();
  }
  const std::string point = point_->currentText().trimmed().toStdString();
  struct Answer {
    std::vector<PlacedMark> marks;
    std::vector<Prediction> predictions;
    QString text;
  };
  InBackground(
      this,
      [snapshot = workspace_->snapshot(), point] {
        Answer answer;
        for (const PointMark& mark : ReadPointMarks(*snapshot->project)) {
          answer.marks.push_back(
              {QString::fromStdString(mark.point), QString::fromStdString(mark.image), mark.pixel.x(), mark.pixel.y()});
        }
        if (point.empty()) return answer;
        try {
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
        } catch (const Error& e) {
          answer.text = QString::fromUtf8(e.what());
        }
        return answer;
      },
      [this, point, of = workspace_->snapshot()](const Attempted<Answer>& answer) {
        if (of != workspace_->snapshot() || point_->currentText().trimmed().toStdString() != point) return;
        marks_ = answer.value.marks;
        predictions_ = answer.value.predictions;
        if (!point.empty() || !answer.error.isEmpty()) {
          status_->setText(answer.error.isEmpty() ? answer.value.text : answer.error);
        }
        Redraw();
      });
}

void ImagesDesk::AddMarks(std::vector<PictureMark>* marks) {
  const QString where = run() + "/" + image(), point = point_->currentText().trimmed();
  confirm_->setEnabled(false);
  remove_->setEnabled(false);
  const Prediction* predicted = nullptr;
  for (const Prediction& p : predictions_) {
    if (p.image == where) predicted = &p;
  }
  for (const PlacedMark& placed : marks_) {
    if (!placed.image.endsWith("/" + where) && placed.image != where) continue;
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

void ImagesDesk::AddMatches(std::vector<PictureMark>* left, std::vector<PictureMark>* right) {
  std::vector<MatchPair> pairs;
  int number = 0;
  const size_t step = matches_ ? matches_->size() / kMostLines + 1 : 1;
  for (size_t i = 0; matches_ && i < matches_->size(); ++i) {
    const InspectedMatch& match = (*matches_)[i];
    if (!(match.inlier ? inliers_ : outliers_)->isChecked()) continue;
    ++number;
    PictureMark mark;
    mark.layer = match.inlier ? "inliers" : "outliers";
    mark.kind = PictureMark::Kind::kCircle;
    mark.colour = match.inlier ? QColor(240, 228, 66) : QColor(204, 121, 167);
    if (number % kNumberEvery == 1) mark.text = QString::number(number);  // the same in both pictures
    const QPointF here(match.image.x(), match.image.y()), there(match.panorama.x(), match.panorama.y());
    mark.points << here << QPointF(3, 0);
    left->push_back(mark);
    mark.points.clear();
    mark.points << there << QPointF(3, 0);
    right->push_back(mark);
    QColor faint = mark.colour;
    faint.setAlpha(140);
    if (i % step == 0) pairs.push_back({here, there, faint});
  }
  lines_->SetPairs(std::move(pairs));
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
    place_->setText(tr("tag %1: %2 of %3").arg(tag).arg(tag_at_ + 1).arg(tag_images_.size()) +
                    (seen.rms_px ? tr(", residual %1 px").arg(*seen.rms_px, 0, 'f', 2) : QString()));
  };
  if (tag == tag_) return show(tag_at_ + 1);
  InBackground(
      this,
      [snapshot = workspace_->snapshot(), tag, order = static_cast<TagImageOrder>(order_->currentData().toInt())] {
        return ImagesOfTag(*snapshot->project, tag, order);
      },
      [this, tag, show](const Attempted<std::vector<TagImage>>& images) {
        if (!images.error.isEmpty()) return status_->setText(images.error);
        tag_ = tag;
        tag_images_ = images.value;
        show(0);
      });
}

}  // namespace trigpoint

// Camera image and panorama side by side: detections, tracks with their reprojection errors, matches, marked points.
#pragma once

#include <QImage>
#include <QWidget>
#include <memory>

#include "app/desktop/workspace.h"

class QCheckBox;
class QComboBox;
class QLabel;
class QListWidget;
class QPushButton;
class QSlider;

namespace trigpoint {

class PictureView;
struct InspectedImage;
struct InspectedMatch;

class ImagesDesk : public QWidget {
  Q_OBJECT

 public:
  explicit ImagesDesk(Workspace* workspace, QWidget* parent = nullptr);

  // Shows an image, a detection, the best image of a tag or station, the first of a point, or a panorama. False if
  // there is none.
  bool ShowObject(const QString& object);
  QString run() const;
  QString image() const;
  PictureView* left() const { return left_; }
  PictureView* right() const { return right_; }

 signals:
  void Shown(const QString& image);  // the picture and what was found in it are there

 protected:
  void showEvent(QShowEvent* event) override;

 private:
  void Refresh();
  void Clear();  // nothing of a project that is no longer open stays
  void FillImages();
  void ShowImage();
  void ShowReference();
  void ShowMatches();
  void ShowMarks();
  void Mark(double u, double v);
  void Redraw();
  void ShowTag(int tag_id);
  bool ShowPoint(const QString& object);

  Workspace* workspace_;
  bool stale_ = false;  // to be loaded when it is seen
  QComboBox* run_;
  QListWidget* images_;
  QSlider* slider_;
  QComboBox* reference_;
  QComboBox* point_;
  QPushButton* mark_;
  QPushButton* confirm_;
  QCheckBox *detections_, *tracks_, *inliers_, *outliers_;
  QLabel* status_;
  QLabel* place_;
  PictureView* left_;
  PictureView* right_;
  std::shared_ptr<const InspectedImage> inspected_;
  std::shared_ptr<const std::vector<InspectedMatch>> matches_;
  struct Prediction {
    QString image;  // RUN/FILE
    double u = 0, v = 0, sigma_px = 0;
    bool marked = false;
  };
  std::vector<Prediction> predictions_;
  QString wanted_;  // object to look at when its image is there
  int generation_ = 0, reference_generation_ = 0;
};

}  // namespace trigpoint

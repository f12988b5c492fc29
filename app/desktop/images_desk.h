// Camera image and panorama side by side: detections, tracks with their reprojection errors, matches, marked points.
#pragma once

#include <QImage>
#include <QWidget>
#include <deque>
#include <functional>
#include <memory>
#include <optional>

#include "app/desktop/mark_history.h"
#include "app/desktop/tag_images.h"
#include "app/desktop/workspace.h"
#include "calib/camera/rig.h"

class QCheckBox;
class QComboBox;
class QLabel;
class QListWidget;
class QPushButton;
class QSlider;
class QSplitter;

namespace trigpoint {

class MatchLines;
class PictureView;
class Thumbnails;
struct InspectedImage;
struct InspectedMatch;
struct PictureMark;

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
  MatchLines* lines() const { return lines_; }
  // The next image that shows the selected tag, in the order chosen; the first again after the last.
  void NextImageOfTag();
  // Undo takes back the last mark that was set, moved or removed here, on disk too; Redo makes it again. Both show the
  // mark's image.
  void Undo();
  void Redo();
  // What they would do, in words; empty: nothing.
  QString UndoText() const;
  QString RedoText() const;

 signals:
  void Shown(const QString& image);  // the picture and what was found in it are there
  void MarksChanged();               // what can be undone or made again

 protected:
  void showEvent(QShowEvent* event) override;
  void resizeEvent(QResizeEvent* event) override;

 private:
  void MakeControls();
  void Arrange();
  void ConnectViews();
  void PlacePanes();                                      // side by side or stacked, as there is room
  void Follow(const PictureView* from, PictureView* to);  // linked zoom
  void Refresh();
  void Clear();  // nothing of a project that is no longer open stays
  void FillImages();
  void ShowImage();
  void ShowReference();
  void ShowView();  // what is chosen of the panorama
  void ShowPart(int part, const QImage& picture, const QString& title);
  void ShowPhoto(int index);  // of a set
  void ShowMatchedPhoto();    // of a set the one with the most matches
  std::optional<QPointF> InShownView(const InspectedMatch& match) const;
  void ShowMatches();
  void DropMatches();  // another image or panorama is shown
  void SayImage();     // what was found in it
  QString WhyEmpty(const QString& opened) const;
  void ShowMarks();
  void ShowPredictions();
  void Mark(double u, double v);
  void RemoveMark(const QString& point);
  void Change(const QString& point, const std::optional<MarkPlace>& after);  // in this image; it can be undone
  // Draws and writes the step's mark: as it was before the step if that is undone, else as it is after it.
  void Apply(const MarkStep& step, MarkHistory::Way way);
  void ShowStep(const MarkStep& step);          // its image, its point
  void ForgetPrediction(const QString& where);  // in an image, until it is predicted anew
  void WriteNextMarks();
  QString Here() const { return run() + "/" + image(); }
  void ConnectMarks();
  void AddMarks(std::vector<PictureMark>* marks);  // to what is drawn
  void AddMatches(std::vector<PictureMark>* left, std::vector<PictureMark>* right);
  // The number of a tag's object; nothing for others, and for surveyed points, which have names.
  static std::optional<int> TagOf(const std::string& object);
  int SelectedTag() const;  // -1: none
  void Redraw();
  void ShowSelected();  // on any desk
  QString Highlighted() const;
  void ShowTag(int tag_id);
  bool ShowPoint(const QString& object);

  Workspace* workspace_;
  bool pictured_ = false;  // the image that is named is the one that is seen
  bool stale_ = false;     // to be loaded when it is seen
  bool behind_ = false;    // what is selected is followed when it is seen
  QComboBox* run_;
  QListWidget* images_;
  QSlider* slider_;
  QComboBox *reference_, *view_;
  QComboBox* point_;
  QPushButton *match_, *mark_, *confirm_, *remove_, *next_;
  QComboBox* order_;  // of the images of a tag
  QCheckBox *detections_, *tracks_, *inliers_, *outliers_, *linked_;
  QLabel* status_;
  QLabel* turn_;  // which of the images of a tag is shown
  QLabel* place_;
  PictureView* left_;
  PictureView* right_;
  QSplitter* panes_;
  MatchLines* lines_;
  Thumbnails* thumbnails_;
  bool following_ = false;
  QImage reference_picture_;                   // all of it
  std::vector<View> views_;                    // that localize matches of it; none of a photo
  std::vector<std::filesystem::path> photos_;  // of a set
  int view_shown_ = -1;                        // or of a set the photo; -1: all of it
  std::shared_ptr<const InspectedImage> inspected_;
  std::shared_ptr<const std::vector<InspectedMatch>> matches_;
  struct Prediction {
    QString image;  // RUN/FILE
    double u = 0, v = 0, sigma_px = 0;
    double off_px = -1;  // of the mark from the prediction; -1: not marked there
  };
  std::vector<Prediction> predictions_;  // of the point that is named
  struct PlacedMark {
    QString point, image;  // image: below the project, or RUN/FILE
    MarkPlace place;
  };
  std::vector<PlacedMark> marks_;  // of all points
  struct MarksChange {
    std::function<void()> write;
    int number;  // of its step
    MarkHistory::Way way;
  };
  std::deque<MarksChange> changes_;  // drawn already; the first is being written
  MarkHistory history_;
  std::vector<TagImage> tag_images_;
  int tag_ = -1;       // whose images those are
  size_t tag_at_ = 0;  // the one that is shown
  QString wanted_;     // object to look at when its image is there
  int generation_ = 0, reference_generation_ = 0, view_generation_ = 0, match_generation_ = 0, marks_generation_ = 0;
  bool matching_ = false;
};

}  // namespace trigpoint

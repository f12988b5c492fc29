// Photo sets: the photos, which of them match, their refined centres, the stitched panorama.
#pragma once

#include <QWidget>

#include "app/desktop/workspace.h"

class QComboBox;
class QLabel;
class QTableWidget;

namespace trigpoint {

class PictureView;
struct PhotoSetView;

class PanoramaDesk : public QWidget {
  Q_OBJECT

 public:
  explicit PanoramaDesk(Workspace* workspace, QWidget* parent = nullptr);
  PictureView* panorama() const { return panorama_; }
  PictureView* graph() const { return graph_; }

 signals:
  void StitchRequested();  // show the run desk with the stage

 protected:
  void showEvent(QShowEvent* event) override;

 private:
  void Refresh();
  void ShowSet();
  void ShowPhotos(const PhotoSetView& set);
  QString Object() const;  // the set or panorama that is shown; empty: none
  void ShowSelected();
  void ShowPhoto(int row);
  void Clear();

  Workspace* workspace_;
  bool stale_ = false;  // to be loaded when it is seen
  QComboBox* set_;
  QLabel* text_;
  QTableWidget* photos_;
  PictureView *panorama_, *graph_, *photo_;
  int generation_ = 0;
};

}  // namespace trigpoint

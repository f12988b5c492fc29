// Calibrations: coverage, residuals, parameters with their uncertainty, what to photograph next.
#pragma once

#include <QWidget>
#include <memory>

#include "app/desktop/workspace.h"

class QComboBox;
class QLabel;
class QScrollArea;
class QTableWidget;

namespace trigpoint {

class PictureView;
struct CalibrationSheet;

class CalibrationDesk : public QWidget {
  Q_OBJECT

 public:
  explicit CalibrationDesk(Workspace* workspace, QWidget* parent = nullptr);
  PictureView* residuals() const { return residuals_; }

 signals:
  void CalibrateRequested();

 private:
  void Refresh();
  void Load();
  void ShowCamera();

  Workspace* workspace_;
  QComboBox *name_, *camera_;
  QLabel *text_, *next_;
  QScrollArea* advice_;  // holds next_
  PictureView *residuals_, *coverage_, *map_;
  QTableWidget* parameters_;
  std::shared_ptr<const CalibrationSheet> view_;
  int generation_ = 0;
};

}  // namespace trigpoint

#include "app/desktop/calibration_desk.h"

#include <QComboBox>
#include <QHeaderView>
#include <QPainter>
#include <QPushButton>
#include <QTableWidget>
#include <algorithm>

#include "app/desktop/background.h"
#include "app/desktop/calibration_sheet.h"
#include "app/desktop/fitted_box.h"
#include "app/desktop/object_table.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/pictures.h"
#include "app/desktop/widgets.h"
#include "calib/base/grid.h"

namespace trigpoint {

namespace {

constexpr double kResidualScale = 50;  // residuals are drawn this much longer

QImage CoveragePicture(const CalibrationCamera& camera) {
  QImage image(camera.width, camera.height, QImage::Format_RGB32);
  image.fill(Qt::white);
  if (camera.coverage.empty()) return image;
  const int most = std::max(1, *std::max_element(camera.coverage.begin(), camera.coverage.end()));
  QPainter painter(&image);
  QFont font;
  font.setPixelSize(std::max(8, camera.height / camera.rows / 5));
  painter.setFont(font);
  for (int row = 0; row < camera.rows; ++row) {
    for (int column = 0; column < camera.columns; ++column) {
      const size_t cell = CellIndex(row, column, camera.columns);
      const int x = column * camera.width / camera.columns, y = row * camera.height / camera.rows;
      const QRect box(x, y, (column + 1) * camera.width / camera.columns - x,
                      (row + 1) * camera.height / camera.rows - y);
      const double share = static_cast<double>(camera.coverage[cell]) / most;
      painter.fillRect(box, camera.coverage[cell] == 0 ? QColor(230, 159, 0)
                                                       : QColor::fromRgbF(0.9 - 0.8 * share, 0.95 - 0.45 * share, 1.0));
      painter.setPen(share > 0.6 ? Qt::white : Qt::black);
      const int points = camera.coverage[cell];
      const QString residual = QString::number(camera.residual_px[cell], 'f', 2);
      painter.drawText(box, Qt::AlignCenter, points > 0 ? QObject::tr("%1\n%2 px").arg(points).arg(residual) : "0");
    }
  }
  return image;
}

}  // namespace

CalibrationDesk::CalibrationDesk(Workspace* workspace, QWidget* parent) : QWidget(parent), workspace_(workspace) {
  name_ = Named(new FittedBox(tr("Calibration that is shown")), "calibration.name", tr("Calibration"));
  camera_ = Named(new FittedBox(tr("Camera of the calibration")), "calibration.camera", tr("Camera"));
  text_ = WrappedLabel("calibration.text");
  next_ = WrappedLabel("calibration.next");
  next_->setAlignment(Qt::AlignTop);
  next_->setMargin(4);
  advice_ = Scrolled(next_);  // a low window has no room for all of it
  advice_->setFrameShape(QFrame::NoFrame);
  advice_->setHorizontalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
  advice_->setMinimumWidth(30 * fontMetrics().averageCharWidth());
  residuals_ = Named(new PictureView, "", tr("Residuals over the image"));
  coverage_ = Named(new PictureView, "", tr("Points in each part of the image"));
  map_ = Named(new PictureView, "", tr("Uncertainty over the image"));
  parameters_ = Named(new QTableWidget(0, 3), "calibration.parameters", tr("Parameters"));
  parameters_->setHorizontalHeaderLabels({tr("parameter"), tr("value"), tr("1 sigma")});
  SetHeaderHelp(parameters_,
                {tr("parameter of the camera model, as in calibration.json: focal lengths and principal point (px), "
                    "distortion (without unit)"),
                 tr("estimated value, in the parameter's unit"),
                 tr("1 sigma (standard deviation) of the value, in the parameter's unit")});
  parameters_->setEditTriggers(QAbstractItemView::NoEditTriggers);
  parameters_->verticalHeader()->setDefaultSectionSize(parameters_->fontMetrics().height() + 6);
  parameters_->verticalHeader()->hide();
  parameters_->resizeColumnsToContents();
  auto* calibrate = MakeButton("calibration.calibrate", tr("Calibra&te ..."));
  connect(calibrate, &QPushButton::clicked, this, &CalibrationDesk::CalibrateRequested);
  auto* top = InRow({name_, camera_, {text_, 1}, calibrate});
  auto* upper = InSplitter(Qt::Horizontal, {coverage_, residuals_});
  auto* lower = InSplitter(Qt::Horizontal, {parameters_, map_, advice_});
  auto* split = InSplitter(Qt::Vertical, {upper, lower}, {350, 350});
  lower->setSizes({420, 340, 340});
  InColumn({top, {split, 1}}, this);
  connect(name_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &CalibrationDesk::Load);
  connect(camera_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &CalibrationDesk::ShowCamera);
  connect(workspace_, &Workspace::Replaced, this, [this] {
    ++generation_;
    view_.reset();
    camera_->clear();
    ShowCamera();
  });
  connect(workspace_, &Workspace::Opened, this, &CalibrationDesk::Refresh);
  connect(workspace_, &Workspace::Closed, this, &CalibrationDesk::Refresh);
  ShowCamera();
}

void CalibrationDesk::Refresh() {
  const QString before = name_->currentText();
  {
    const QSignalBlocker block(name_);
    name_->clear();
    if (workspace_->snapshot()) {
      for (const std::string& name : CalibrationNames(workspace_->snapshot()->dir / "results")) {
        name_->addItem(Text(name));
      }
    }
    name_->setCurrentIndex(std::max(0, name_->findText(before)));
  }
  Load();
}

void CalibrationDesk::Load() {
  const int generation = ++generation_;
  view_.reset();
  if (!workspace_->snapshot() || name_->currentText().isEmpty()) {
    const QSignalBlocker block(camera_);
    camera_->clear();
    ShowCamera();
    return;
  }
  const std::filesystem::path dir =
      workspace_->snapshot()->dir / "results" / "calibrate" / name_->currentText().toStdString();
  InBackground(
      this,
      [dir] {
        return std::shared_ptr<const CalibrationSheet>(std::make_shared<CalibrationSheet>(LoadCalibration(dir)));
      },
      [this, generation](const Attempted<std::shared_ptr<const CalibrationSheet>>& loaded) {
        if (generation != generation_) return;
        view_ = loaded.value;
        const QSignalBlocker block(camera_);
        camera_->clear();
        if (view_) {
          for (const CalibrationCamera& camera : view_->cameras) camera_->addItem(Text(camera.name));
        }
        ShowCamera();
      });
}

void CalibrationDesk::ShowCamera() {
  parameters_->setRowCount(0);
  next_->clear();
  advice_->setVisible(view_ != nullptr);
  const auto index = static_cast<size_t>(std::max(0, camera_->currentIndex()));
  if (!view_ || index >= view_->cameras.size()) {
    coverage_->SetPicture({}, tr("Which parts of the image have points is drawn here."));
    residuals_->SetPicture({}, tr("The residuals over the image are drawn here."));
    map_->SetPicture({}, tr("The uncertainty over the image is drawn here."));
    for (PictureView* picture : {residuals_, coverage_, map_}) picture->SetMarks({});
    QString text = workspace_->snapshot() ? tr("No calibration yet: press Calibrate, and give the pictures of a board "
                                               "and the board's target.")
                                          : tr("Open a project (Ctrl+O) to see its calibrations.");
    if (view_ && !view_->problems.empty()) text = Text(view_->problems.front());
    text_->setText(text);
    return;
  }
  const CalibrationCamera& camera = view_->cameras[index];
  text_->setText(
      tr("%1, %2 x %3 px, %4 of %5 pictures used, residual RMS %6 px (how well the model fits, not how accurate "
         "it is)")
          .arg(Text(camera.model))
          .arg(camera.width)
          .arg(camera.height)
          .arg(camera.views_used)
          .arg(camera.views)
          .arg(camera.rms_px, 0, 'f', 3));
  for (const CalibrationParameter& p : camera.parameters) {
    const int row = parameters_->rowCount();
    parameters_->insertRow(row);
    parameters_->setItem(row, 0, new QTableWidgetItem(Text(p.name)));
    parameters_->setItem(row, 1, new QTableWidgetItem(QString::number(p.value, 'f', 5)));
    parameters_->setItem(row, 2, new QTableWidgetItem(QString::number(p.sigma, 'g', 3)));
  }
  parameters_->resizeColumnsToContents();
  parameters_->setMaximumWidth(parameters_->horizontalHeader()->length() + 2 * parameters_->frameWidth() +
                               style()->pixelMetric(QStyle::PM_ScrollBarExtent));
  QStringList next;
  for (const std::string& sentence : camera.next) next << "- " + Text(sentence);
  next_->setText(tr("What to photograph next") + "\n" +
                 (next.isEmpty() ? tr("Every part of the image has points.") : next.join("\n")));
  if (camera.width > 0 && camera.height > 0) {
    coverage_->SetPicture(CoveragePicture(camera), tr("points, mean residual"));
    QImage paper(camera.width, camera.height, QImage::Format_RGB32);
    paper.fill(Qt::white);
    residuals_->SetPicture(paper, tr("residuals, %1 x").arg(kResidualScale));
    std::vector<PictureMark> marks;
    for (const CalibrationPoint& p : camera.points) {
      PictureMark mark;
      mark.kind = PictureMark::Kind::kLine;
      mark.points << QPointF(p.u, p.v) << QPointF(p.u + kResidualScale * p.du, p.v + kResidualScale * p.dv);
      mark.colour = p.used ? QColor(0, 114, 178) : QColor(213, 94, 0);
      marks.push_back(mark);
    }
    residuals_->SetMarks(std::move(marks));
  }
  map_->SetPicture({}, tr("No uncertainty map: run calibrate again to make it."));
  if (!std::filesystem::exists(camera.uncertainty)) return;
  InBackground(
      this, [file = camera.uncertainty] { return LoadAnyPicture(file, 0); },
      [this, view = view_, index](const Attempted<QImage>& image) {
        if (view != view_ || static_cast<int>(index) != std::max(0, camera_->currentIndex())) return;
        map_->SetPicture(image.value, image.error.isEmpty() ? tr("uncertainty") : image.error);
      });
}

}  // namespace trigpoint

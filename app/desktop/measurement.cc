#include "app/desktop/measurement.h"

#include <QHeaderView>
#include <QMenu>
#include <cmath>

#include "app/desktop/workspace.h"
#include "datasets/io/csv.h"

namespace trigpoint {

namespace {

constexpr double kDegrees = 180 / M_PI;

}  // namespace

Measurement MeasureBetween(const MeasuredPlace& from, const MeasuredPlace& to, bool has_north,
                           const std::optional<Eigen::Matrix3d>& between) {
  Measurement m;
  m.from = from, m.to = to, m.joint = between.has_value();
  const Eigen::Vector3d d = to.position - from.position;
  m.slope_m = d.norm();
  m.horizontal_m = d.head<2>().norm();
  m.height_m = d.z();
  if (has_north && m.horizontal_m > 0) {
    m.azimuth_deg = std::fmod(std::atan2(d.x(), d.y()) * kDegrees + 360, 360);
  }
  const bool known = from.sigma_m && to.sigma_m && from.sigma_m->allFinite() && to.sigma_m->allFinite();
  if (!between && !known) return m;
  const Eigen::Matrix3d c =
      between ? *between : Eigen::Matrix3d((from.sigma_m->cwiseAbs2() + to.sigma_m->cwiseAbs2()).asDiagonal());
  const auto along = [&](const Eigen::Vector3d& direction) { return std::sqrt(direction.dot(c * direction)); };
  m.sigma_height_m = along(Eigen::Vector3d::UnitZ());
  if (m.slope_m > 0) m.sigma_slope_m = along(d / m.slope_m);
  if (m.horizontal_m > 0) {
    m.sigma_horizontal_m = along(Eigen::Vector3d(d.x(), d.y(), 0) / m.horizontal_m);
    const Eigen::Vector3d across(-d.y() / m.horizontal_m, d.x() / m.horizontal_m, 0);
    if (m.azimuth_deg) m.sigma_azimuth_deg = along(across) / m.horizontal_m * kDegrees;
  }
  return m;
}

MeasurementList::MeasurementList(Workspace* workspace, QWidget* parent) : QTableWidget(parent), workspace_(workspace) {
  setObjectName("scene.measurements");
  setAccessibleName(tr("Measurements"));
  setToolTip(
      tr("1 sigma behind each value: from the joint covariance of two cameras or panoramas of one run, or of two tags; "
         "other places are taken as independent (last column); points, paths and geotags have no sigma of their own. "
         "Right click: save, clear."));
  setEditTriggers(QAbstractItemView::NoEditTriggers);
  setSelectionBehavior(QAbstractItemView::SelectRows);
  verticalHeader()->hide();
  verticalHeader()->setDefaultSectionSize(fontMetrics().height() + 6);
  setContextMenuPolicy(Qt::CustomContextMenu);
  connect(this, &QWidget::customContextMenuRequested, this, [this](const QPoint& at) {
    QMenu menu;
    menu.addAction(tr("&Save as CSV ..."), this, &MeasurementList::SaveRequested);
    menu.addAction(tr("&Clear"), this, &MeasurementList::ClearRequested);
    menu.exec(viewport()->mapToGlobal(at));
  });
  connect(workspace_, &Workspace::UnitChanged, this, &MeasurementList::Show);
  hide();
}

int MeasurementList::Add(const Measurement& measurement) {
  all_.push_back(measurement);
  Show();
  scrollToBottom();
  return cleared_ + static_cast<int>(all_.size()) - 1;
}

bool MeasurementList::Complete(int number, const Measurement& measurement) {
  if (number < cleared_) return false;
  all_.at(static_cast<size_t>(number - cleared_)) = measurement;
  ShowRow(number - cleared_);
  resizeColumnsToContents();
  return true;
}

void MeasurementList::Clear() {
  cleared_ += static_cast<int>(all_.size());
  all_.clear();
  Show();
}

void MeasurementList::Show() {
  setVisible(!all_.empty());
  emit Filled(!all_.empty());
  setRowCount(static_cast<int>(all_.size()));
  const QString unit = workspace_->unit();
  const QStringList header{tr("from"),
                           tr("to"),
                           tr("slope (%1)").arg(unit),
                           tr("horizontal (%1)").arg(unit),
                           tr("height difference (%1)").arg(unit),
                           tr("azimuth (deg)"),
                           tr("sigmas")};
  setColumnCount(header.size());
  setHorizontalHeaderLabels(header);
  for (int row = 0; row < rowCount(); ++row) ShowRow(row);
  resizeColumnsToContents();
}

void MeasurementList::ShowRow(int row) {
  const auto value = [](const std::optional<double>& v, const std::optional<double>& sigma, double scale) {
    QString text = v ? QString::number(*v / scale, 'f', 3) : QString();
    if (v && sigma) text += QString::fromUtf8(" \xc2\xb1 ") + QString::number(*sigma / scale, 'f', 3);
    return text;
  };
  const double metres = workspace_->metres_per_unit();
  const Measurement& m = all_[static_cast<size_t>(row)];
  const QStringList cells{m.from.name,
                          m.to.name,
                          value(m.slope_m, m.sigma_slope_m, metres),
                          value(m.horizontal_m, m.sigma_horizontal_m, metres),
                          value(m.height_m, m.sigma_height_m, metres),
                          value(m.azimuth_deg, m.sigma_azimuth_deg, 1),
                          m.pending           ? tr("being computed ...")
                          : !m.sigma_height_m ? tr("not known")
                          : m.joint           ? tr("joint")
                                              : tr("independent")};
  for (int c = 0; c < cells.size(); ++c) setItem(row, c, new QTableWidgetItem(cells[c]));
}

void MeasurementList::Save(const QString& file, const QString& frame) const {
  CsvWriter csv({"from", "to", "from_x", "from_y", "from_z", "to_x", "to_y", "to_z", "slope_m", "sigma_slope_m",
                 "horizontal_m", "sigma_horizontal_m", "height_difference_m", "sigma_height_difference_m",
                 "azimuth_deg", "sigma_azimuth_deg", "sigmas"},
                {"trigpoint measurements 1; frame=" + frame.toStdString() + "; unit=m; sigma=1"});
  const auto put = [&](const std::optional<double>& v, int decimals) { v ? csv.Number(*v, decimals) : csv.Empty(); };
  for (const Measurement& m : all_) {
    csv.Text(m.from.name.toStdString()).Text(m.to.name.toStdString());
    for (const MeasuredPlace* place : {&m.from, &m.to}) {
      for (int k = 0; k < 3; ++k) csv.Number(place->position(k), 4);
    }
    put(m.slope_m, 4), put(m.sigma_slope_m, 5);
    put(m.horizontal_m, 4), put(m.sigma_horizontal_m, 5);
    put(m.height_m, 4), put(m.sigma_height_m, 5);
    put(m.azimuth_deg, 4), put(m.sigma_azimuth_deg, 5);
    csv.Text(m.pending ? "pending" : !m.sigma_height_m ? "" : m.joint ? "joint" : "independent");
    csv.EndRow();
  }
  csv.Save(file.toStdString());
}

}  // namespace trigpoint

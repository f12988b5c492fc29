// Distances between things of the scene, with what their sigmas make of them; a list of them, and as CSV.
#pragma once

#include <Eigen/Core>
#include <QTableWidget>
#include <optional>
#include <vector>

class QMenu;

namespace trigpoint {

class Workspace;

struct MeasuredPlace {
  QString name;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // scene frame, m
  std::optional<Eigen::Vector3d> sigma_m;              // per axis
};

struct Measurement {
  MeasuredPlace from, to;
  double slope_m = 0, horizontal_m = 0, height_m = 0;
  std::optional<double> azimuth_deg;  // clockwise from north; not given where the frame has no north
  // 1 sigma, the two places taken as independent; not given unless both have theirs.
  std::optional<double> sigma_slope_m, sigma_horizontal_m, sigma_height_m, sigma_azimuth_deg;
};

Measurement MeasureBetween(const MeasuredPlace& from, const MeasuredPlace& to, bool has_north);

class MeasurementList : public QTableWidget {
  Q_OBJECT

 public:
  explicit MeasurementList(Workspace* workspace, QWidget* parent = nullptr);
  void Add(const Measurement& measurement);
  void Clear();
  const std::vector<Measurement>& measurements() const { return all_; }
  // In metres and degrees. Throws IoError.
  void Save(const QString& file, const QString& frame) const;

 signals:
  void SaveRequested();
  void ClearRequested();

 private:
  void Show();

  Workspace* workspace_;
  std::vector<Measurement> all_;
};

}  // namespace trigpoint

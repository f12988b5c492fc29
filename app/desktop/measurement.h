// Distances between things of the scene, with what their sigmas make of them; a list of them, and as CSV.
#pragma once

#include <Eigen/Core>
#include <QTableWidget>
#include <optional>
#include <vector>

#include "eval/scene/scene_pairs.h"

class QMenu;

namespace trigpoint {

class Workspace;

struct MeasuredPlace {
  QString name;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // scene frame, m
  std::optional<Eigen::Vector3d> sigma_m;              // per axis
  std::optional<SceneThing> thing;                     // whose place it is, where results know it
};

struct Measurement {
  MeasuredPlace from, to;
  double slope_m = 0, horizontal_m = 0, height_m = 0;
  std::optional<double> azimuth_deg;  // clockwise from north; not given where the frame has no north
  bool joint = false;    // sigmas from the joint covariance of both places; else these are taken as independent
  bool pending = false;  // the joint covariance is being computed: no sigma is shown yet
  // 1 sigma; not given unless both places have theirs.
  std::optional<double> sigma_slope_m, sigma_horizontal_m, sigma_height_m, sigma_azimuth_deg;
};

// `between`: covariance (m^2) of the vector between the two places, where it is known; else their own sigmas count.
Measurement MeasureBetween(const MeasuredPlace& from, const MeasuredPlace& to, bool has_north,
                           const std::optional<Eigen::Matrix3d>& between = std::nullopt);

class MeasurementList : public QTableWidget {
  Q_OBJECT

 public:
  explicit MeasurementList(Workspace* workspace, QWidget* parent = nullptr);
  // Returns the number by which it is known.
  int Add(const Measurement& measurement);
  // In its place what is known now; false: the list was cleared meanwhile, and nothing happens.
  bool Complete(int number, const Measurement& measurement);
  void Clear();
  const std::vector<Measurement>& measurements() const { return all_; }
  // In metres and degrees; `sigmas` is "pending" where they are being computed. Throws IoError.
  void Save(const QString& file, const QString& frame) const;

 signals:
  void SaveRequested();
  void ClearRequested();
  void Filled(bool filled);  // or emptied

 private:
  void Show();
  void ShowRow(int row);

  Workspace* workspace_;
  std::vector<Measurement> all_;
  int cleared_ = 0;  // measurements that were in the list before
};

}  // namespace trigpoint

// Measuring in the scene: what is measured, its line, and its sigmas, which are solved off the window's thread.
#include <QFileDialog>

#include "app/desktop/background.h"
#include "app/desktop/measurement.h"
#include "app/desktop/scene_vtk.h"

namespace trigpoint {

// A true place, named for what it is: of an error the reference or the estimate, never the enlarged tip.
MeasuredPlace SceneDesk::PlaceMeasured(const ScenePick& pick) const {
  const SceneModel& model = *vtk_->model();
  const QString name = QString::fromStdString(pick.name), run = QString::fromStdString(pick.run);
  MeasuredPlace place{name, pick.position, pick.sigma_m, std::nullopt};
  const auto of_run = [&](SceneThing::Kind kind) {
    place.thing = SceneThing{kind, pick.run, pick.name, pick.position};
    if (model.runs.size() > 1) place.name = tr("%1 by %2").arg(name, run);
  };
  if (pick.layer == "cameras") {
    of_run(SceneThing::Kind::kCamera);
  } else if (pick.layer == "panoramas") {
    of_run(SceneThing::Kind::kPanorama);
  } else if (pick.layer == "tags") {
    place.thing = SceneThing{SceneThing::Kind::kTag, pick.run, pick.name, pick.position};
    place.name = tr("tag %1").arg(name);
  } else if (pick.layer == "geotags") {
    place.name = tr("geotag of %1").arg(name);
  } else if (pick.layer == "control") {
    place.name = tr("surveyed point %1").arg(name);
  } else if (pick.layer != "errors") {  // points, paths
    place.name = (pick.layer == "points" ? tr("point %1 of %2") : tr("%1 of %2")).arg(name, run);
  } else {
    const SceneError& error = model.errors[static_cast<size_t>(pick.index)];
    place.sigma_m.reset();  // the pick's is that of the difference
    if (pick.position == error.reference_position) {
      place.name = tr("reference of %1 (%2)").arg(name, QString::fromStdString(error.reference));
      return place;
    }
    of_run(SceneThing::Kind::kPanorama);
    for (const ScenePanorama& p : model.panoramas) {
      if (p.run == pick.run && p.panorama == pick.name) place.sigma_m = p.sigma_m;
    }
  }
  return place;
}

QString SceneDesk::MeasureTo(const ScenePick& pick) {
  const MeasuredPlace place = PlaceMeasured(pick);
  if (measured_from_) {
    const MeasuredPlace from = *measured_from_;
    ForgetMeasured();
    measured_ = std::make_unique<Measurement>(MeasureBetween(from, place, vtk_->model()->on_earth));
    SolveMeasured();
    return ShowMeasured();
  }
  ForgetMeasured();
  measured_from_ = std::make_unique<MeasuredPlace>(place);
  vtk_->AddRing(vtk_->measure, place.position, 0.3);
  Note(tr("from %1").arg(place.name));
  Render();
  return note_->text();
}

// Lists it; a joint covariance takes seconds for thousands of images and follows.
void SceneDesk::SolveMeasured() {
  Measurement m = *measured_;
  // Results of another project, or of a release, are drawn, not solved.
  m.pending = m.from.thing && m.to.thing && workspace_->snapshot() && !source_;
  if (m.pending) m.sigma_slope_m = m.sigma_horizontal_m = m.sigma_height_m = m.sigma_azimuth_deg = std::nullopt;
  const int number = measurements_->Add(m);
  if (!m.pending) return;
  const bool on_earth = vtk_->model()->on_earth;
  InBackground(
      this,
      [pairs = pairs_, snapshot = workspace_->snapshot(), variant = variant_->currentData().toString().toStdString(),
       on_earth, from = *m.from.thing,
       to = *m.to.thing] { return pairs->Between(*snapshot->project, variant, on_earth, from, to); },
      [this, number, m, on_earth](const Attempted<std::optional<Eigen::Matrix3d>>& between) {
        if (!measurements_->Complete(number, MeasureBetween(m.from, m.to, on_earth, between.value))) return;
        if (between.error.isEmpty()) return;
        emit workspace_->Problem(between.error, tr("The two places are taken as independent."));
      });
}

QString SceneDesk::ShowMeasured() {
  if (!measured_) return "";
  vtk_->Clear(vtk_->measure);
  const Measurement& m = *measured_;
  const QString length = workspace_->Length(m.slope_m);
  vtk_->AddLine(m.from.position, m.to.position, length.toStdString());
  QString text = tr("%1 from %2 to %3").arg(length, m.from.name, m.to.name);
  text +=
      "\n" +
      tr("horizontal %1, height difference %2").arg(workspace_->Length(m.horizontal_m), workspace_->Length(m.height_m));
  if (m.azimuth_deg) text += tr(", azimuth %1 deg").arg(*m.azimuth_deg, 0, 'f', 3);
  Note(text);
  Render();
  return note_->text();
}

void SceneDesk::ForgetMeasured() {
  vtk_->Clear(vtk_->measure);
  measured_from_.reset();
  measured_.reset();
}

void SceneDesk::SaveMeasurements() {
  QFileDialog dialog(this, tr("Save the measurements"), QString(), tr("CSV (*.csv)"));
  dialog.setAcceptMode(QFileDialog::AcceptSave);
  dialog.setDefaultSuffix("csv");
  dialog.selectFile("measurements.csv");
  if (dialog.exec() != QDialog::Accepted || dialog.selectedFiles().isEmpty()) return;
  try {
    measurements_->Save(dialog.selectedFiles().first(),
                        vtk_->model() == nullptr ? "" : QString::fromStdString(vtk_->model()->frame));
  } catch (const std::exception& e) {
    emit workspace_->Problem(QString::fromUtf8(e.what()), "");
  }
}

}  // namespace trigpoint

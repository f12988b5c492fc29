#include "app/desktop/workspace.h"

#include <utility>

#include "app/desktop/background.h"
#include "app/desktop/inspector.h"
#include "eval/text/display_unit.h"

namespace trigpoint {

QString Workspace::dir() const { return snapshot_ ? QString::fromStdString(snapshot_->dir.string()) : QString(); }

void Workspace::Open(const QString& dir) { Load(dir, false); }

void Workspace::Reload() {
  reload_ = snapshot_ && opening_ > 0 && !again_;
  if (snapshot_ && !reload_) Load(dir(), true);
}

void Workspace::Close() {
  ++generation_;
  snapshot_.reset();
  results_.clear();
  live_.clear();
  inspectors_.clear();
  Select("");
  emit Replaced();
  emit Closed();
}

void Workspace::Load(const QString& dir, bool again) {
  const int generation = ++generation_;
  ++opening_;
  again_ = again;
  InBackground(
      this, [path = dir.toStdString()] { return OpenSnapshot(path); },
      [this, generation, again](const Attempted<std::shared_ptr<const Snapshot>>& opened) {
        --opening_;
        if (generation != generation_) return;  // another project was asked for meanwhile
        if (!opened.value) {
          emit Problem(opened.error, tr("The project was not opened."));
          if (reload_) Reload();
          return;
        }
        const bool other = snapshot_ && snapshot_->dir != opened.value->dir;
        if (std::exchange(reload_, false) && !other)
          return Load(this->dir(), true);  // it was read before it was written
        snapshot_ = opened.value;
        inspectors_.clear();
        results_ = ResultsOfSnapshot(*snapshot_);
        live_.clear();
        const bool cleared = !again && !selected_.isEmpty();
        if (cleared) selected_.clear(), run_.clear();
        if (other) emit Replaced();
        related_ = snapshot_->Related(selected_.toStdString());
        for (const std::string& problem : snapshot_->problems) {
          emit Problem(QString::fromStdString(problem), tr("The rest of the project is open."));
        }
        emit Opened();
        if (cleared && selected_.isEmpty()) emit Selected(selected_);
        CheckStates();
      });
}

void Workspace::CheckStates() {
  if (!snapshot_) return;
  InBackground(
      this, [snapshot = snapshot_] { return StatesOfSnapshot(*snapshot); },
      [this, generation = generation_, asked = ++states_](const Attempted<std::vector<SnapshotResult>>& states) {
        if (generation != generation_ || asked != states_) return;
        if (!states.error.isEmpty()) {
          emit Problem(states.error, tr("What is out of date is not known."));
          return;
        }
        results_ = states.value;
        for (SnapshotResult& result : results_) {  // a run went on while they were looked at
          const auto live = live_.find(result.title);
          if (live != live_.end()) result.state = live->second.state, result.reason = live->second.reason;
        }
        emit ResultsChanged();
      });
}

void Workspace::SetState(const QString& title, const QString& state, const QString& reason) {
  for (size_t i = 0; i < results_.size(); ++i) {
    SnapshotResult& result = results_[i];
    if (result.title != title.toStdString()) continue;
    result.state = state.toStdString(), result.reason = reason.toStdString();
    live_[result.title] = result;
    emit StateChanged(static_cast<int>(i));
  }
}

std::shared_ptr<SharedInspector> Workspace::InspectorOf(const std::string& run, const std::string& variant) {
  std::shared_ptr<SharedInspector>& pointer = inspectors_[run + "@" + variant];
  if (!pointer) pointer = std::make_shared<SharedInspector>(*snapshot_->project, run, variant);
  return pointer;
}

void Workspace::Select(const QString& object, const QString& run) {
  if (object == selected_ && (run.isEmpty() || run == run_)) return;
  selected_ = object;
  run_ = run;
  related_.clear();
  if (snapshot_ && !object.isEmpty()) related_ = snapshot_->Related(object.toStdString());
  emit Selected(object);
}

void Workspace::AskMenu(const QString& object, const QPoint& at) {
  if (object.isEmpty() || !snapshot_) return;
  Select(object);
  emit MenuAsked(object, at);
}

void Workspace::SetUnit(const QString& name) {
  if (name == unit()) return;
  unit_ = DisplayUnitNamed(name.toStdString());
  emit UnitChanged();
}

QString Workspace::Length(double metres, int decimals) const {
  return QString::number(metres / unit_.metres, 'f', decimals) + " " + unit();
}

}  // namespace trigpoint

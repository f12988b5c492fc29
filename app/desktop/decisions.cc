#include "app/desktop/decisions.h"

#include <QInputDialog>
#include <QMenu>
#include <algorithm>

#include "app/desktop/background.h"
#include "datasets/project/project.h"

namespace trigpoint {

namespace {

constexpr int kMostLately = 3;  // reasons given lately that are offered again

const ReviewEntry* LastInForce(const Snapshot& snapshot) {
  const auto& entries = snapshot.project->review().entries();
  const auto found = std::find_if(entries.rbegin(), entries.rend(),
                                  [](const ReviewEntry& entry) { return entry.in_force && entry.action != "undo"; });
  return found == entries.rend() ? nullptr : &*found;
}

QString Words(const ReviewEntry& entry) {
  const QString object = QString::fromStdString(entry.object);
  if (entry.action == "role") {
    return Decisions::tr("make %1 a %2 point").arg(object, QString::fromStdString(entry.role));
  }
  return (entry.action == "exclude" ? Decisions::tr("exclude %1") : Decisions::tr("restore %1")).arg(object);
}

// Why an object is left out: what the last decision about it in force says.
QString ReasonOf(const Snapshot& snapshot, const std::string& object) {
  const auto& entries = snapshot.project->review().entries();
  const auto found = std::find_if(entries.rbegin(), entries.rend(), [&](const ReviewEntry& entry) {
    return entry.in_force && entry.action == "exclude" && entry.object == object;
  });
  return found == entries.rend() ? QString() : QString::fromStdString(found->reason);
}

}  // namespace

QString ExclusionText(const Workspace& workspace, const std::string& object, bool others) {
  const auto& snapshot = workspace.snapshot();
  if (!snapshot) return {};
  QStringList parts;
  const auto add = [&](const std::string& of) {
    if (snapshot->excluded.count(of) == 0) return;
    const QString text = Decisions::tr("excluded by the review: %1").arg(ReasonOf(*snapshot, of));
    parts << (of == object ? text : QString::fromStdString(of) + " " + text);
  };
  add(object);
  if (others) {
    for (const std::string& of : snapshot->Related(object)) {
      if (of != object) add(of);
    }
  }
  if (parts.isEmpty()) return {};
  const auto& results = workspace.results();
  const bool older =
      std::any_of(results.begin(), results.end(), [](const SnapshotResult& r) { return r.state == "out of date"; });
  return parts.join("; ") + (older ? Decisions::tr("; solve again to see its effect") : QString());
}

Decisions::Decisions(Workspace* workspace, QObject* parent) : QObject(parent), workspace_(workspace) {
  connect(workspace_, &Workspace::Replaced, this, [this] { undone_.clear(); });
  connect(workspace_, &Workspace::Opened, this, &Decisions::Changed);
  connect(workspace_, &Workspace::Closed, this, &Decisions::Changed);
}

void Decisions::Decide(const QString& action, const QString& object, const QString& reason) {
  ReviewRequest request;
  request.action = action.toStdString();
  request.object = object.toStdString();
  request.reason = reason.trimmed().toStdString();
  Append(request, false);
}

void Decisions::Undo() {
  if (UndoText().isEmpty()) return;
  ReviewRequest request;
  request.action = "undo";
  request.object = "last";
  request.reason = tr("taken back").toStdString();
  Append(request, false);
}

void Decisions::Redo() {
  if (undone_.empty()) return;
  const ReviewEntry& entry = undone_.back();
  ReviewRequest request;
  request.action = entry.action;
  request.object = entry.object;
  request.role = entry.role;
  request.reason = entry.reason;
  Append(request, true);
}

QString Decisions::UndoText() const {
  const ReviewEntry* last = workspace_->snapshot() ? LastInForce(*workspace_->snapshot()) : nullptr;
  return last == nullptr ? QString() : Words(*last);
}

QString Decisions::RedoText() const { return undone_.empty() ? QString() : Words(undone_.back()); }

void Decisions::Append(const ReviewRequest& wanted, bool again) {
  if (!workspace_->snapshot() || busy_) return;
  if (wanted.reason.empty()) {
    emit workspace_->Problem(tr("A decision needs a reason: write it beside 'Reason'."),
                             tr("Nothing was written to review.jsonl."));
    return;
  }
  busy_ = true;
  ReviewRequest request = wanted;
  request.user = user_.trimmed().toStdString();
  struct Written {
    ReviewEntry entry, undone;
  };
  InBackground(
      this,
      [snapshot = workspace_->snapshot(), request] {
        // As it is now: somebody may have written since the snapshot was made.
        const Project project = Project::Open(snapshot->dir);
        Written written;
        written.entry = AppendReview(project, request);
        for (const ReviewEntry& entry : project.review().entries()) {
          if (entry.number == written.entry.undoes) written.undone = entry;
        }
        return written;
      },
      [this, again, dir = workspace_->dir()](const Attempted<Written>& written) {
        busy_ = false;
        if (!written.error.isEmpty()) {
          emit workspace_->Problem(written.error, tr("Nothing was written to review.jsonl."));
          return;
        }
        if (workspace_->dir() != dir) return;  // another project was opened meanwhile
        again_ = again;
        if (written.value.entry.action == "undo") {
          undone_.push_back(written.value.undone);
        } else if (again) {
          undone_.pop_back();
        } else {
          undone_.clear();
        }
        const auto connection = std::make_shared<QMetaObject::Connection>();
        *connection = connect(workspace_, &Workspace::Opened, this, [this, connection, dir] {
          disconnect(*connection);
          if (workspace_->dir() == dir) emit Decided();
        });
        workspace_->Reload();
      });
}

QStringList Decisions::Reasons(const QString& action, const QString& kind) const {
  QStringList reasons;
  if (action == "restore") {
    reasons << tr("excluded by mistake") << tr("put right since");
  } else if (action == "role") {
    reasons << tr("held back to check the map") << tr("needed to hold the map");
  } else if (kind == "detection") {
    reasons << tr("half hidden") << tr("blurred") << tr("a reflection") << tr("another tag's id");
  } else if (kind == "image") {
    reasons << tr("blurred") << tr("badly exposed") << tr("the lens was covered");
  } else if (kind == "panorama") {
    reasons << tr("stitched badly") << tr("taken elsewhere");
  } else {
    reasons << tr("was moved") << tr("damaged") << tr("surveyed badly");
  }
  if (!workspace_->snapshot()) return reasons;
  const auto& entries = workspace_->snapshot()->project->review().entries();
  const int most = static_cast<int>(reasons.size()) + kMostLately;
  for (auto entry = entries.rbegin(); entry != entries.rend() && reasons.size() < most; ++entry) {
    const QString reason = QString::fromStdString(entry->reason);
    if (entry->action == action.toStdString() && !reasons.contains(reason)) reasons << reason;
  }
  return reasons;
}

void Decisions::AskReason(const QString& action, const QString& object) {
  bool ok = false;
  const QString reason =
      QInputDialog::getText(nullptr, tr("Reason"), tr("Reason of the decision; it is stored in review.jsonl."),
                            QLineEdit::Normal, QString(), &ok);
  if (ok) Decide(action, object, reason);
}

void Decisions::AddAction(QMenu* menu, const QString& action, const QString& object) {
  const QString title = action == "exclude"   ? tr("Exclude %1")
                        : action == "restore" ? tr("Restore %1")
                                              : tr("Change the role of %1");
  QMenu* reasons = menu->addMenu(title.arg(object));
  reasons->setObjectName(action + " " + object);
  for (const QString& reason : Reasons(action, object.section(':', 0, 0))) {
    reasons->addAction(reason, this, [this, action, object, reason] { Decide(action, object, reason); });
  }
  reasons->addSeparator();
  reasons->addAction(tr("Another reason ..."), this, [this, action, object] { AskReason(action, object); });
}

void Decisions::AddTo(QMenu* menu, const QString& object) {
  const auto& snapshot = workspace_->snapshot();
  if (!snapshot) return;
  std::vector<std::string> objects = {object.toStdString()};
  for (const std::string& related : snapshot->Related(object.toStdString())) {
    if (related != objects.front()) objects.push_back(related);
  }
  for (const std::string& name : objects) {
    const QString of = QString::fromStdString(name);
    const auto& kinds = ReviewKinds();
    if (std::find(kinds.begin(), kinds.end(), of.section(':', 0, 0).toStdString()) == kinds.end()) continue;
    const bool control = name.starts_with("control:");
    AddAction(menu, control ? "role" : snapshot->excluded.count(name) > 0 ? "restore" : "exclude", of);
  }
}

}  // namespace trigpoint

// Marks of surveyed points that were set, moved and removed, to be taken back and made again. No widgets here.
#pragma once

#include <QPointF>
#include <QString>
#include <optional>
#include <vector>

namespace trigpoint {

struct MarkPlace {
  QPointF pixel;
  double sigma_px = 1;
};

struct MarkStep {
  QString point, image;                    // image: RUN/FILE
  std::optional<MarkPlace> before, after;  // none: not marked
  int number = 0;
};

class MarkHistory {
 public:
  enum class Way { kDone, kUndone, kRedone };

  // What Undo takes back, and Redo makes again; null: nothing.
  const MarkStep* undone_next() const { return done_.empty() ? nullptr : &done_.back(); }
  const MarkStep* redone_next() const { return undone_.empty() ? nullptr : &undone_.back(); }

  // What was undone cannot be made again then. Returns the step's number.
  int Add(const MarkStep& step);
  // The step that was undone or made again; there must be one.
  MarkStep Undo();
  MarkStep Redo();
  // The step could not be written: the file does not have it, or still has it.
  void Fail(int number, Way way);
  void Clear();

 private:
  std::vector<MarkStep> done_, undone_;
  int last_ = 0;
};

}  // namespace trigpoint

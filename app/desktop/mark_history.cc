#include "app/desktop/mark_history.h"

#include <algorithm>

namespace trigpoint {

namespace {

std::vector<MarkStep>::iterator Find(std::vector<MarkStep>* steps, int number) {
  return std::find_if(steps->begin(), steps->end(), [&](const MarkStep& step) { return step.number == number; });
}

// Back to where it was, among those that were made in the meantime.
void PutBack(int number, std::vector<MarkStep>* from, std::vector<MarkStep>* to) {
  const auto step = Find(from, number);
  if (step == from->end()) return;
  to->push_back(*step);
  from->erase(step);
}

}  // namespace

int MarkHistory::Add(const MarkStep& step) {
  undone_.clear();
  done_.push_back(step);
  done_.back().number = ++last_;
  return last_;
}

MarkStep MarkHistory::Undo() {
  undone_.push_back(done_.back());
  done_.pop_back();
  return undone_.back();
}

MarkStep MarkHistory::Redo() {
  done_.push_back(undone_.back());
  undone_.pop_back();
  return done_.back();
}

void MarkHistory::Fail(int number, Way way) {
  if (way == Way::kUndone) return PutBack(number, &undone_, &done_);
  if (way == Way::kRedone) return PutBack(number, &done_, &undone_);
  for (std::vector<MarkStep>* steps : {&done_, &undone_}) {
    const auto found = Find(steps, number);
    if (found == steps->end()) continue;
    const MarkStep failed = *found;
    // The next step of the same mark did not start from this one.
    MarkStep* next = nullptr;
    for (std::vector<MarkStep>* later : {&done_, &undone_}) {
      for (MarkStep& step : *later) {
        if (step.number <= number || step.point != failed.point || step.image != failed.image) continue;
        if (next == nullptr || step.number < next->number) next = &step;
      }
    }
    if (next != nullptr) next->before = failed.before;
    steps->erase(found);
    return;
  }
}

void MarkHistory::Clear() {
  done_.clear();
  undone_.clear();
}

}  // namespace trigpoint

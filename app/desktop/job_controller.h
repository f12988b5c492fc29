// One worker thread that runs stages; everything it says comes as queued signals by value.
#pragma once

#include <QObject>
#include <QString>
#include <memory>

#include "app/pipeline/jobs.h"

class QThread;

namespace trigpoint {

class CancelToken;

class JobController : public QObject {
  Q_OBJECT

 public:
  enum class End { kDone, kFailed, kCancelled };

  explicit JobController(QObject* parent = nullptr);
  ~JobController() override;  // cancels, and waits for the worker

  bool running() const { return thread_ != nullptr; }
  // Of the run that goes on, or went on last.
  const QString& dir() const { return dir_; }
  const JobQuery& query() const { return query_; }
  quint64 seed() const { return seed_; }
  // Its name if it is another one than that in `open`; else empty.
  QString OtherProject(const QString& open) const;
  // The same runner as `trigpoint run`. False if a run is going on.
  bool Start(const QString& dir, const JobQuery& query, int threads, quint64 seed);
  void Cancel();

 signals:
  void Started(const QString& command);
  void JobBegan(const QString& job);
  // `total` 0: unknown; seconds_left < 0: not known yet.
  void Progress(const QString& job, const QString& task, qint64 done, qint64 total, double seconds_left);
  void Log(int level, const QString& text);
  void JobEnded(const QString& job, const QString& end, const QString& reason);
  void Finished(trigpoint::JobController::End end, const QString& error);

 private:
  QString dir_;
  JobQuery query_;
  quint64 seed_ = 1;
  std::shared_ptr<CancelToken> cancel_;
  QThread* thread_ = nullptr;
};

}  // namespace trigpoint

Q_DECLARE_METATYPE(trigpoint::JobController::End)

#include "app/desktop/job_controller.h"

#include <QThread>
#include <chrono>
#include <mutex>

#include "app/pipeline/command_line.h"

namespace trigpoint {

namespace {

constexpr double kReportSeconds = 0.1;  // between two progress signals

// Turns progress into signals, no faster than people see.
class SignalSink final : public ProgressSink {
 public:
  explicit SignalSink(JobController* controller) : controller_(controller) {}

  void SetJob(const std::string& job) {
    const std::lock_guard guard(mutex_);
    job_ = QString::fromStdString(job);
  }
  void Begin(std::string_view task, int64_t total) override {
    const std::lock_guard guard(mutex_);
    task_ = QString::fromUtf8(task.data(), static_cast<int>(task.size()));
    total_ = total, done_ = 0;
    begun_ = Clock::now();
    Report(true);
  }
  void Advance(int64_t steps) override {
    const std::lock_guard guard(mutex_);
    done_ += steps;
    Report(done_ == total_);
  }
  void Log(LogLevel level, std::string_view text) override {
    emit controller_->Log(static_cast<int>(level), QString::fromUtf8(text.data(), static_cast<int>(text.size())));
  }

 private:
  using Clock = std::chrono::steady_clock;
  void Report(bool at_once) {
    const auto now = Clock::now();
    if (!at_once && std::chrono::duration<double>(now - reported_).count() < kReportSeconds) return;
    reported_ = now;
    const double spent = std::chrono::duration<double>(now - begun_).count();
    const double left = total_ > 0 && done_ > 0 ? spent * static_cast<double>(total_ - done_) / done_ : -1;
    emit controller_->Progress(job_, task_, done_, total_, left);
  }

  JobController* controller_;
  std::mutex mutex_;
  QString job_, task_;
  int64_t total_ = 0, done_ = 0;
  Clock::time_point begun_, reported_;
};

struct Ending {
  JobController::End end = JobController::End::kDone;
  QString error;
};

Ending Work(JobController* controller, const std::string& dir, const JobQuery& query, int threads, uint64_t seed,
            const CancelToken& cancel) {
  Ending ending;
  SignalSink sink(controller);
  JobCallbacks callbacks;
  callbacks.begun = [&](const Job& job) {
    sink.SetJob(job.Title());
    emit controller->JobBegan(QString::fromStdString(job.Title()));
  };
  callbacks.ended = [&](const JobResult& result) {
    emit controller->JobEnded(QString::fromStdString(result.job.Title()),
                              QString::fromStdString(std::string(JobEndName(result.end))),
                              QString::fromStdString(result.reason));
  };
  try {
    const Project project = Project::OpenToCompute(dir);
    CheckProjectOptions(project);
    for (const JobResult& result :
         RunJobs(project, AskedJobs(project, query), threads, seed, sink, cancel, callbacks)) {
      if (result.end != JobEnd::kFailed) continue;
      ending.end = JobController::End::kFailed;
      if (ending.error.isEmpty()) {
        ending.error = QString::fromStdString(result.job.Title() + ": " + result.reason);
      }
    }
  } catch (const Cancelled&) {
    ending.end = JobController::End::kCancelled;
  } catch (const std::exception& e) {
    ending = {JobController::End::kFailed, QString::fromUtf8(e.what())};
  }
  return ending;
}

}  // namespace

JobController::JobController(QObject* parent) : QObject(parent) {
  qRegisterMetaType<trigpoint::JobController::End>("trigpoint::JobController::End");
}

JobController::~JobController() {
  if (thread_ == nullptr) return;
  Cancel();
  thread_->wait();
  delete thread_;
}

bool JobController::Start(const QString& dir, const JobQuery& query, int threads, quint64 seed) {
  if (thread_ != nullptr) return false;
  dir_ = dir;
  query_ = query;
  seed_ = seed;
  cancel_ = std::make_shared<CancelToken>();
  const auto ending = std::make_shared<Ending>();
  thread_ = QThread::create([this, path = dir.toStdString(), query, threads, seed, cancel = cancel_, ending] {
    *ending = Work(this, path, query, threads, seed, *cancel);
  });
  connect(thread_, &QThread::finished, this, [this, ending] {
    thread_->deleteLater();
    thread_ = nullptr;
    cancel_.reset();
    emit Finished(ending->end, ending->error);
  });
  emit Started(QString::fromStdString(CommandLine(dir.toStdString(), query, threads, seed)));
  thread_->start(QThread::LowPriority);
  return true;
}

QString JobController::OtherProject(const QString& open) const {
  return dir_ == open ? QString() : dir_.section('/', -1);
}

void JobController::Cancel() {
  if (cancel_) cancel_->Cancel();
}

}  // namespace trigpoint

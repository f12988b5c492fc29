// Work off the window's thread: `work` runs in a pool, `then` in the thread of `owner` with its result, unless the
// owner has gone meanwhile.
#pragma once

#include <QFutureWatcher>
#include <QObject>
#include <QString>
#include <QtConcurrent/QtConcurrentRun>
#include <exception>
#include <functional>
#include <memory>
#include <utility>

namespace trigpoint {

// What came out: a value, or one readable sentence.
template <typename Value>
struct Attempted {
  Value value{};
  QString error;
};

template <typename Work, typename Then>
void InBackground(QObject* owner, Work work, Then then) {
  using Value = std::invoke_result_t<Work>;
  using Result = std::shared_ptr<Attempted<Value>>;
  auto* watcher = new QFutureWatcher<Result>(owner);
  QObject::connect(watcher, &QFutureWatcher<Result>::finished, owner, [watcher, then] {
    then(*watcher->result());
    watcher->deleteLater();
  });
  watcher->setFuture(QtConcurrent::run([work]() -> Result {
    const auto result = std::make_shared<Attempted<Value>>();
    try {
      result->value = work();
    } catch (const std::exception& e) {
      result->error = QString::fromUtf8(e.what());
    }
    return result;
  }));
}

}  // namespace trigpoint

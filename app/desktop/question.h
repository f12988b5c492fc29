// A question in a box of its own, which the window waits for without stopping its event loop.
#pragma once

#include <QMessageBox>
#include <functional>

namespace trigpoint {

// `answered` gets the button. While the same question (by its name) is open it is not asked again.
inline void Ask(QWidget* window, const char* name, const QString& title, const QString& text,
                QMessageBox::StandardButtons buttons, const std::function<void(int button)>& answered) {
  if (window->findChild<QMessageBox*>(name) != nullptr) return;
  auto* ask = new QMessageBox(QMessageBox::Question, title, text, buttons, window);
  ask->setObjectName(name);
  ask->setAttribute(Qt::WA_DeleteOnClose);
  QObject::connect(ask, &QMessageBox::finished, window, answered);
  ask->open();
}

}  // namespace trigpoint

#include "app/desktop/path_button.h"

#include <QCoreApplication>
#include <QDir>
#include <QFileDialog>
#include <QFileInfo>
#include <QLineEdit>
#include <QMenu>
#include <QToolButton>

#include "app/desktop/widgets.h"

namespace trigpoint {

namespace {

QString Words(const char* text) { return QCoreApplication::translate("trigpoint::PathButton", text); }

void Enter(const QString& chosen, PathKind kind, const QString& folder, QLineEdit* field) {
  const QFileInfo file(chosen);
  const QString path = kind == PathKind::kPattern ? file.path() + "/*." + file.suffix() : chosen;
  const QString relative = folder.isEmpty() ? path : QDir(folder).relativeFilePath(path);
  field->setText(relative.startsWith("..") ? path : relative);
  emit field->textEdited(field->text());  // as if it was typed
}

void OpenDialog(QLineEdit* field, PathKind kind, bool is_folder, const QString& folder) {
  const bool is_new = kind == PathKind::kNewFile || kind == PathKind::kNewFileOrFolder;
  const QFileInfo now(field->text().isEmpty() ? folder : AbsolutePath(folder, field->text()));
  auto* dialog = new QFileDialog(field->window(),
                                 is_folder ? Words(QT_TRANSLATE_NOOP("trigpoint::PathButton", "Choose a folder"))
                                           : Words(QT_TRANSLATE_NOOP("trigpoint::PathButton", "Choose a file")),
                                 now.isDir() ? now.filePath() : now.path());
  dialog->setObjectName("path.dialog");
  dialog->setAttribute(Qt::WA_DeleteOnClose);
  dialog->setFileMode(is_folder ? QFileDialog::Directory : is_new ? QFileDialog::AnyFile : QFileDialog::ExistingFile);
  dialog->setOption(QFileDialog::ShowDirsOnly, is_folder);
  if (is_new && !is_folder) dialog->setAcceptMode(QFileDialog::AcceptSave);
  dialog->setOption(QFileDialog::DontConfirmOverwrite);  // what writes the file replaces none of others
  QObject::connect(dialog, &QFileDialog::fileSelected, field,
                   [field, kind, folder](const QString& chosen) { Enter(chosen, kind, folder, field); });
  dialog->open();
}

}  // namespace

QToolButton* MakePathButton(QLineEdit* field, PathKind kind, const std::function<QString()>& folder) {
  auto* button = Named(new QToolButton, field->objectName() + "_browse",
                       Words(QT_TRANSLATE_NOOP("trigpoint::PathButton", "Choose: %1")).arg(field->accessibleName()),
                       Words(QT_TRANSLATE_NOOP("trigpoint::PathButton", "Choose a file or a folder")));
  button->setText(Words(QT_TRANSLATE_NOOP("trigpoint::PathButton", "...")));
  const auto open = [field, kind, folder](bool is_folder) { OpenDialog(field, kind, is_folder, folder()); };
  if (kind == PathKind::kFileOrFolder || kind == PathKind::kNewFileOrFolder) {
    auto* menu = new QMenu(button);
    menu->addAction(Words(QT_TRANSLATE_NOOP("trigpoint::PathButton", "F&ile ...")), [open] { open(false); });
    menu->addAction(Words(QT_TRANSLATE_NOOP("trigpoint::PathButton", "F&older ...")), [open] { open(true); });
    button->setMenu(menu);
    button->setPopupMode(QToolButton::InstantPopup);
  } else {
    QObject::connect(button, &QToolButton::clicked, field, [open, kind] { open(kind == PathKind::kFolder); });
  }
  return button;
}

QString AbsolutePath(const QString& folder, const QString& path) {
  if (path.isEmpty()) return path;
  if (path.startsWith("~/")) return QDir::homePath() + path.mid(1);
  return QDir::cleanPath(QDir(folder).absoluteFilePath(path));
}

}  // namespace trigpoint

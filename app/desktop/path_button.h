// Paths in forms: a button beside a field opens a dialog for a file or a folder and enters what was chosen, relative to
// the project's folder where it lies inside.
#pragma once

#include <QString>
#include <functional>

#include "calib/base/path_option.h"

class QLineEdit;
class QToolButton;

namespace trigpoint {

// `folder`: the project's, at the moment of the click. Its object name is the field's with "_browse" after it.
QToolButton* MakePathButton(QLineEdit* field, PathKind kind, const std::function<QString()>& folder);

// What a form's path means to a program that runs elsewhere; empty stays empty.
QString AbsolutePath(const QString& folder, const QString& path);

}  // namespace trigpoint

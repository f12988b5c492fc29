// The program's own icons, drawn in the text's colour: the same set in light and dark, sharp at any size.
#pragma once

#include <QIcon>

namespace trigpoint {

// "overview", "run", "scene", "images", "tables", "charts", "compare", "review", "panoramas", "calibration", "open",
// "reload", "report", "export", "publish", "undo", "redo", "cancel", "print", "plan", "help". An empty icon
// for another name.
QIcon IconNamed(const QString& name);

}  // namespace trigpoint

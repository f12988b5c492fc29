// Whether answers of single views are listed besides the final ones, as on the station's card.
#pragma once

#include <QCoreApplication>

#include "app/desktop/widgets.h"

namespace trigpoint {

inline QCheckBox* MakeViewsBox(const char* name) {
  return MakeCheckBox(name, QCoreApplication::translate("trigpoint::StationCard", "also each &view (G1)"),
                      QCoreApplication::translate(
                          "trigpoint::StationCard",
                          "Besides the final answers, panorama (G2), those of each rectilinear view by itself"));
}

}  // namespace trigpoint

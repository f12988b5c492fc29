// Whether answers of single views are listed besides the final ones, as on the station's card.
#pragma once

#include <QCheckBox>
#include <QCoreApplication>

namespace trigpoint {

inline QCheckBox* MakeViewsBox(const char* name) {
  auto* box = new QCheckBox(QCoreApplication::translate("trigpoint::StationCard", "also each &view (G1)"));
  box->setObjectName(name);
  box->setToolTip(QCoreApplication::translate(
      "trigpoint::StationCard", "Besides the final answers, panorama (G2), those of each rectilinear view by itself"));
  return box;
}

}  // namespace trigpoint

// How a column of a results table is shown: its unit in the header, as many decimals as mean something. No widgets
// here.
#pragma once

#include <QString>

#include "eval/text/display_unit.h"

namespace trigpoint {

struct ColumnFormat {
  QString name;         // without its unit
  QString unit;         // as the file has it: "m", "deg", "px", ...; empty: none
  bool length = false;  // metres, shown in the unit chosen
  bool error = false;   // coloured by its size
  int decimals = -1;    // -1: as in the file

  QString UnitShown(const DisplayUnit& shown) const;  // empty: none
  QString Header(const DisplayUnit& shown) const;
  QString Cell(const QString& text, const DisplayUnit& shown) const;
};

ColumnFormat FormatOf(const QString& column, bool numeric);

}  // namespace trigpoint

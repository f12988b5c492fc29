// What the columns of the results' tables mean, as docs/file_formats.md and docs/evaluation.md say it, in the
// window's language. No widgets here.
#pragma once

#include <QString>

#include "app/desktop/data_table.h"

namespace trigpoint {

// The meaning of a column with its unit, its frame and its name in the file; of an unknown one the name alone. `unit`:
// in which it is shown; empty: none.
QString ColumnHelp(const DataTable& table, const QString& column, const QString& unit);

}  // namespace trigpoint

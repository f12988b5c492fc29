#include "app/desktop/column_format.h"

#include <QSet>
#include <cmath>

namespace trigpoint {

ColumnFormat FormatOf(const QString& column, bool numeric) {
  static const QSet<QString> kLengths = {"x", "y", "z", "odom_x", "odom_y", "odom_z", "tx", "ty", "tz"};
  static const QSet<QString> kRotations = {"qx", "qy", "qz", "qw", "odom_qx", "odom_qy", "odom_qz", "odom_qw"};
  static const QSet<QString> kPixels = {"u",  "v",  "u0", "v0",      "u1",      "v1",     "u2",
                                        "v2", "u3", "v3", "u_image", "v_image", "u_view", "v_view"};
  // Endings of names, their units, and what is worth showing of them.
  static const struct {
    const char* end;
    const char* unit;
    int decimals;
  } kUnits[] = {{"_m", "m", 4}, {"_deg", "deg", 4},      {"_px", "px", 3},     {"_px2", "px\xc2\xb2", 4},
                {"_s", "s", 4}, {"_m2", "m\xc2\xb2", 6}, {"_mrad", "mrad", 3}, {"_ns", "ns", -1}};
  ColumnFormat format;
  format.name = column;
  if (!numeric) return format;
  for (const auto& [end, unit, decimals] : kUnits) {
    if (!column.endsWith(end)) continue;
    format.name = column.chopped(static_cast<int>(qstrlen(end)));
    format.unit = QString::fromUtf8(unit);
    format.decimals = decimals;
  }
  if (column.endsWith("_deg_m")) {  // no length: it stays as the file has it, whatever unit is shown
    format.name = column.chopped(static_cast<int>(qstrlen("_deg_m")));
    format.unit = "deg/m";
  }
  if (kLengths.contains(column)) format.unit = "m", format.decimals = 4;
  if (kPixels.contains(column)) format.unit = "px", format.decimals = 3;
  if (column == "timestamp") format.unit = "s", format.decimals = 3;
  if (kRotations.contains(column)) format.decimals = 6;
  if (column == "latitude_deg" || column == "longitude_deg") format.decimals = 8;  // a millimetre
  if (column == "nees" || column == "nees_h" || column == "nees_v") format.decimals = 2;
  format.length = format.unit == "m";
  format.error = column == "error_3d_m" || column == "error_h_m" || column == "error_v_m";
  return format;
}

QString ColumnFormat::UnitShown(const DisplayUnit& shown) const {
  return length ? QString::fromStdString(shown.name) : unit;
}

QString ColumnFormat::Header(const DisplayUnit& shown) const {
  return unit.isEmpty() ? name : name + " (" + UnitShown(shown) + ")";
}

QString ColumnFormat::Cell(const QString& text, const DisplayUnit& shown) const {
  if (decimals < 0 || text.isEmpty()) return text;
  bool number = false;
  const double value = text.toDouble(&number) / (length ? shown.metres : 1);
  if (!number || !std::isfinite(value)) return text;
  const bool small = value != 0 && std::abs(value) < 0.5 * std::pow(10, -decimals);
  return small ? QString::number(value, 'g', 2) : QString::number(value, 'f', decimals);
}

}  // namespace trigpoint

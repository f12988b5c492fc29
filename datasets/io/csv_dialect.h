// Tables as spreadsheets and other programs write them: what separates cells, decimal commas, other names of columns.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace trigpoint {

// What separates the cells of a header row: the most frequent of comma, semicolon, tab and bar outside quotes.
char DelimiterOf(std::string_view header);

// Is `text` a number with a decimal comma, or with a decimal point ("-7,25", "+.5"; no exponent)?
bool IsNumberWith(char decimal, std::string_view text);

// The known name that a column is meant by: in any case, with spaces or brackets ("Latitude [deg]"), without its unit,
// or another common name ("lng"); "" if none. x, y, z are metres in a local frame (x_m, y_m, z_m) where a table knows
// those and `projected` is false, else easting, northing and height.
std::string KnownColumn(std::string_view column, const std::vector<std::string>& known, bool projected);

// Gives columns the known names they are meant by, each name once: of several columns for one the first in the order
// of preference. Returns what was understood, "latitude_deg from 'lat'".
std::vector<std::string> UseKnownColumns(const std::vector<std::string>& known, std::vector<std::string>* columns);

}  // namespace trigpoint

// What the report's code and the stages write in English, in the window's language.
#pragma once

#include <QString>
#include <optional>
#include <string>

#include "eval/report/drawing.h"

namespace trigpoint {

// Nothing where the catalogue has no words for all of it: half a translation is worse than none. Of a longer text the
// sentences and clauses are looked up one by one.
std::optional<QString> TranslatedReportText(const QString& text);

// The text itself where it is not translated.
QString ReportText(const std::string& text);

// With its words translated. Those that stand beside a point are set smaller, all alike, so that each stays in the room
// that was made for the English ones.
Drawing InWindowLanguage(Drawing drawing);

}  // namespace trigpoint

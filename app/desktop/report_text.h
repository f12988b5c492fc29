// What the report's code and the stages write in English, in the window's language.
#pragma once

#include <QString>
#include <optional>
#include <string>

#include "eval/report/drawing.h"

namespace trigpoint {

// Nothing if a part of the text is not in the catalogue: half a translation is worse than none. The sentences and
// clauses of a longer text are looked up one by one.
std::optional<QString> TranslatedReportText(const QString& text);

// The text itself where it is not translated.
QString ReportText(const std::string& text);

// The drawing with its texts translated. Texts to the right of a point, such as those of legends, are all made smaller
// by the same factor, so that none is wider than in English.
Drawing InWindowLanguage(Drawing drawing);

}  // namespace trigpoint

#include "app/desktop/report_text.h"

#include <QCoreApplication>
#include <QRegularExpression>
#include <algorithm>
#include <vector>

#include "app/desktop/report_words.h"

namespace trigpoint {

namespace {

// A text with places for names, numbers and texts of their own: "%1 of %2 located".
struct Template {
  const char* source;
  QRegularExpression pattern;
  int letters;  // outside of its places
};

std::vector<Template> MakeTemplates() {
  std::vector<Template> templates;
  for (const char* source : ReportWords()) {
    QString pattern = QRegularExpression::escape(QString::fromUtf8(source));
    const int places = pattern.count(QRegularExpression("\\\\%[1-9]"));
    pattern.replace(QRegularExpression("\\\\%[1-9]"), "(.+?)");
    templates.push_back({source, QRegularExpression(QRegularExpression::anchoredPattern(pattern)),
                         static_cast<int>(qstrlen(source)) - 2 * places});
  }
  // The one that says most is tried first.
  std::stable_sort(templates.begin(), templates.end(),
                   [](const auto& a, const auto& b) { return a.letters > b.letters; });
  return templates;
}

// Names and numbers with their unit are the same in every language; words of English are not taken for one.
bool IsName(const QString& text) {
  const bool digit = std::any_of(text.begin(), text.end(), [](QChar c) { return c.isDigit(); });
  return text.count(' ') <= (digit ? 1 : 0) && !text.endsWith(',') && !text.endsWith(':');
}

QString Filled(const QString& text, const std::vector<QString>& values) {
  QString filled;
  for (int i = 0; i < text.size(); ++i) {
    const int place = text[i] == '%' && i + 1 < text.size() ? text[i + 1].digitValue() : -1;
    if (place < 1 || place > static_cast<int>(values.size())) {
      filled += text[i];
    } else {
      filled += values[static_cast<size_t>(place - 1)];
      ++i;
    }
  }
  return filled;
}

std::optional<QString> FromTemplate(const QString& text) {
  static const std::vector<Template> templates = MakeTemplates();
  for (const Template& t : templates) {
    const QRegularExpressionMatch match = t.pattern.match(text);
    if (!match.hasMatch()) continue;
    std::vector<QString> values;
    for (int i = 1; i <= match.lastCapturedIndex(); ++i) {
      const QString value = match.captured(i);
      const std::optional<QString> translated = TranslatedReportText(value);
      if (!translated && !IsName(value)) break;
      values.push_back(translated.value_or(value));
    }
    if (static_cast<int>(values.size()) < match.lastCapturedIndex()) continue;
    return Filled(QCoreApplication::translate("Report", t.source), values);
  }
  return {};
}

// Taken apart: each part must be translated, or, where `names` are allowed, be one.
std::optional<QString> FromParts(const QString& text, const char* between, bool names) {
  const QStringList parts = text.split(between);
  QStringList translated;
  bool any = false;
  for (const QString& part : parts) {
    const std::optional<QString> words = TranslatedReportText(part);
    if (!words && !(names && IsName(part))) return {};
    any = any || words.has_value();
    translated << words.value_or(part);
  }
  return any ? std::optional<QString>(translated.join(between)) : std::nullopt;
}

}  // namespace

std::optional<QString> TranslatedReportText(const QString& text) {
  const bool english = QCoreApplication::translate("Report", "language") == "language";
  if (english || text.isEmpty()) return {};
  // Sentences and clauses stand for themselves.
  for (const char* between : {". ", "; "}) {
    if (text.contains(between)) return FromParts(text, between, false);
  }
  if (std::optional<QString> whole = FromTemplate(text)) return whole;
  if (text.endsWith('.')) {
    const std::optional<QString> sentence = TranslatedReportText(text.left(text.size() - 1));
    return sentence ? std::optional<QString>(*sentence + ".") : std::nullopt;
  }
  for (const char* between : {": ", ", "}) {
    if (!text.contains(between)) continue;
    if (std::optional<QString> parts = FromParts(text, between, true)) return parts;
  }
  return {};
}

QString ReportText(const std::string& text) {
  const QString english = QString::fromStdString(text);
  return TranslatedReportText(english).value_or(english);
}

Drawing InWindowLanguage(Drawing drawing) {
  std::vector<Shape*> beside;  // a point, as in a legend
  double smaller = 1;
  for (Shape& shape : drawing.shapes) {
    if (shape.kind != Shape::Kind::kText) continue;
    const double before = TextWidth(shape.text, shape.size);
    shape.text = ReportText(shape.text).toStdString();
    if (shape.anchor >= 0) continue;
    smaller = std::min(smaller, before / std::max(before, TextWidth(shape.text, shape.size)));
    beside.push_back(&shape);
  }
  for (Shape* shape : beside) shape->size *= smaller;
  return drawing;
}

}  // namespace trigpoint

#include "app/desktop/stage_form.h"

#include <QCheckBox>
#include <QFormLayout>
#include <QHBoxLayout>
#include <QLabel>
#include <QLineEdit>
#include <QRegularExpression>
#include <QVBoxLayout>
#include <cmath>

#include "app/pipeline/stages.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {

using nlohmann::json;

struct StageForm::Field {
  OptionDescription option;
  json start;  // what it was set to
  QCheckBox* check = nullptr;
  QLineEdit* edit = nullptr;

  // As text in the field; null if that is no value of the option's type.
  json Value() const {
    if (check != nullptr) return check->isChecked();
    const std::string text = edit->text().toStdString();
    if (option.type == "a whole number") {
      const auto number = ParseInt(Trim(text));
      return number ? json(*number) : json();
    }
    if (option.type == "a number") {
      const auto number = ParseDouble(Trim(text));
      return number && std::isfinite(*number) ? json(*number) : json();
    }
    return text;
  }
};

namespace {

// 0.8, not 0.80000000000000004.
QString ShortText(const json& value) {
  if (value.is_string()) return QString::fromStdString(value.get<std::string>());
  return QString::fromStdString(DumpJson(value));
}

QString RangeText(const OptionDescription& option) {
  if (option.type != "a number" && option.type != "a whole number") return "";
  QString text;
  if (std::isfinite(option.min)) text = StageForm::tr("from %1").arg(option.min);
  if (std::isfinite(option.max)) text += (text.isEmpty() ? "" : " ") + StageForm::tr("to %1").arg(option.max);
  return text;
}

json::json_pointer PointerOf(const std::string& name) {
  std::string path = "/" + name;
  for (char& c : path) c = c == '.' ? '/' : c;
  return json::json_pointer(path);
}

}  // namespace

StageForm::StageForm(QWidget* parent) : QWidget(parent) { new QVBoxLayout(this); }

StageForm::~StageForm() = default;

void StageForm::SetStage(const std::string& stage, const json& values) {
  stage_ = stage;
  fields_.clear();
  QLayoutItem* item = nullptr;
  while ((item = layout()->takeAt(0)) != nullptr) {
    delete item->widget();
    delete item;
  }
  auto* content = new QWidget;
  auto* form = new QFormLayout(content);
  form->setFieldGrowthPolicy(QFormLayout::AllNonFixedFieldsGrow);
  for (const OptionDescription& option : StageNamed(stage).options("")) {
    Field field;
    field.option = option;
    const json::json_pointer pointer = PointerOf(option.name);
    field.start = values.is_object() && values.contains(pointer) ? values.at(pointer) : option.default_value;
    if (field.start.is_object()) continue;
    AddField(field, form);
  }
  if (fields_.empty()) form->addRow(new QLabel(tr("This stage has no options.")));
  layout()->addWidget(content);
  emit Changed();
}

void StageForm::AddField(const Field& given, QFormLayout* form) {
  Field field = given;
  const OptionDescription& option = field.option;
  const QString help = QString::fromStdString(option.help);
  const QString unit = QString::fromStdString(option.unit);
  const QString range = RangeText(option);
  const QString name = QString::fromStdString(option.name);
  auto* row = new QWidget;
  auto* line = new QHBoxLayout(row);
  line->setContentsMargins(0, 0, 0, 0);
  QWidget* input = nullptr;
  if (option.type == "true or false") {
    input = field.check = new QCheckBox;
    field.check->setChecked(field.start.is_boolean() && field.start.get<bool>());
    connect(field.check, &QCheckBox::toggled, this, &StageForm::Changed);
  } else {
    input = field.edit = new QLineEdit(ShortText(field.start));
    field.edit->setMaximumWidth(12 * fontMetrics().averageCharWidth() + 40);
    connect(field.edit, &QLineEdit::textEdited, this, &StageForm::Changed);
  }
  input->setObjectName("option." + name);
  input->setAccessibleName(name);
  input->setAccessibleDescription(help);
  const QString facts = QStringList{unit, range, tr("default %1").arg(ShortText(option.default_value))}
                            .filter(QRegularExpression("."))
                            .join(", ");
  input->setToolTip(help + "\n" + facts);
  line->addWidget(input);
  auto* text = new QLabel(QString("<small>%1<br><i>%2</i></small>").arg(facts.toHtmlEscaped(), help.toHtmlEscaped()));
  text->setWordWrap(true);
  line->addWidget(text, 1);
  auto* label = new QLabel(name);
  label->setBuddy(input);
  form->addRow(label, row);
  fields_.push_back(field);
}

json StageForm::Changes() const {
  json changes = json::object();
  for (const Field& field : fields_) {
    const json value = field.Value();
    if (!value.is_null() && value != field.start) changes[PointerOf(field.option.name)] = value;
  }
  return changes;
}

std::map<std::string, QString> StageForm::Edits() const {
  std::map<std::string, QString> edits;
  for (const Field& field : fields_) {
    if (field.Value() == field.start) continue;
    edits[field.option.name] =
        field.check != nullptr ? QString(field.check->isChecked() ? "1" : "0") : field.edit->text();
  }
  return edits;
}

void StageForm::Restore(const std::map<std::string, QString>& edits) {
  for (const Field& field : fields_) {
    const auto edit = edits.find(field.option.name);
    if (edit == edits.end()) continue;
    if (field.check != nullptr) field.check->setChecked(edit->second == "1");
    if (field.edit != nullptr) field.edit->setText(edit->second);
  }
  emit Changed();
}

std::vector<std::string> StageForm::Problems() const {
  std::vector<std::string> problems;
  for (const Field& field : fields_) {
    if (!field.Value().is_null()) continue;
    problems.push_back(field.option.name + ": expected " + field.option.type + ", found '" +
                       field.edit->text().toStdString() + "'");
  }
  if (problems.empty() && !stage_.empty()) StageNamed(stage_).check(Changes(), "form", problems);
  return problems;
}

void StageForm::Reset() {
  for (const Field& field : fields_) {
    if (field.check != nullptr) field.check->setChecked(field.start.is_boolean() && field.start.get<bool>());
    if (field.edit != nullptr) field.edit->setText(ShortText(field.start));
  }
  emit Changed();
}

}  // namespace trigpoint

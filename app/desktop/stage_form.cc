#include "app/desktop/stage_form.h"

#include <QCheckBox>
#include <QComboBox>
#include <QFormLayout>
#include <QGroupBox>
#include <QHBoxLayout>
#include <QLabel>
#include <QLineEdit>
#include <QRegularExpression>
#include <QToolButton>
#include <QVBoxLayout>
#include <cmath>

#include "app/desktop/path_button.h"
#include "app/desktop/widgets.h"
#include "app/pipeline/stages.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {

using nlohmann::json;

struct StageForm::Field {
  OptionDescription option;
  json start;  // what it was set to
  QStringList choices;
  QCheckBox* check = nullptr;
  QComboBox* box = nullptr;
  QLineEdit* edit = nullptr;
  QWidget *label = nullptr, *row = nullptr;
  QLabel* problem = nullptr;

  // As text in the field; null if that is no value of the option's type.
  json Value() const {
    if (check != nullptr) return check->isChecked();
    if (box != nullptr) return box->currentText().toStdString();
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
  QString Text() const {
    if (check != nullptr) return check->isChecked() ? "1" : "0";
    return box != nullptr ? box->currentText() : edit->text();
  }
  void SetText(const QString& text) const {
    if (check != nullptr) check->setChecked(text == "1");
    if (box != nullptr) box->setCurrentText(text);
    if (edit != nullptr) edit->setText(text);
  }
  std::string Group() const {
    const size_t dot = option.name.rfind('.');
    return dot == std::string::npos ? "" : option.name.substr(0, dot);
  }
  std::string Name() const { return option.name.substr(option.name.rfind('.') + 1); }
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

bool HasWord(const std::string& text, const std::string& word) {
  return QRegularExpression("\\b" + QRegularExpression::escape(QString::fromStdString(word)) + "\\b")
      .match(QString::fromStdString(text))
      .hasMatch();
}

}  // namespace

QStringList ChoicesOf(const OptionDescription& option, const StageForm::Check& check) {
  if (option.type != "text" || !check) return {};
  json probe = json::object();
  probe[PointerOf(option.name)] = "?";
  for (const std::string& problem : check(probe)) {
    const QString text = QString::fromStdString(problem);
    if (!text.contains("?") || !HasWord(problem, option.name.substr(option.name.rfind('.') + 1))) continue;
    QString list = text.section("expected ", 1).section(QRegularExpression(", found|;"), 0, 0);
    if (list.startsWith("one of ")) list = list.mid(7);
    const QStringList choices = list.split(QRegularExpression(", | or "));
    const QRegularExpression word("^[A-Za-z0-9_-]+$");
    const QString standard = ShortText(option.default_value);
    if (choices.size() < 2 || !(standard.isEmpty() || choices.contains(standard))) return {};
    for (const QString& choice : choices) {
      if (!word.match(choice).hasMatch()) return {};
    }
    return standard.isEmpty() ? QStringList("") + choices : choices;
  }
  return {};
}

StageForm::StageForm(QWidget* parent) : QWidget(parent) {
  filter_ = Named(new QLineEdit, "option.filter", tr("Find an option"));
  filter_->setPlaceholderText(tr("find an option by name or meaning"));
  filter_->setClearButtonEnabled(true);
  none_ = new QLabel(tr("This stage has no options."));
  column_ = InColumn({filter_, none_, {}}, this);
  connect(filter_, &QLineEdit::textChanged, this, &StageForm::Find);
  connect(this, &StageForm::Changed, this, &StageForm::ShowProblems);
}

StageForm::~StageForm() = default;

void StageForm::SetStage(const std::string& stage, const json& values) {
  const StageInfo& info = StageNamed(stage);
  const auto check = [&info](const json& changes) {
    std::vector<std::string> problems;
    info.check(changes, "form", problems);
    return problems;
  };
  SetOptions(info.options(""), values, check);
  stage_ = stage;
}

void StageForm::SetOptions(const std::vector<OptionDescription>& options, const json& values, Check check) {
  stage_.clear();
  check_ = std::move(check);
  fields_.clear();
  groups_.clear();
  delete content_;
  content_ = new QWidget;
  auto* groups = new QVBoxLayout(content_);
  groups->setContentsMargins(0, 0, 0, 0);
  column_->insertWidget(1, content_);
  for (const OptionDescription& option : options) {
    Field field;
    field.option = option;
    const json::json_pointer pointer = PointerOf(option.name);
    field.start = values.is_object() && values.contains(pointer) ? values.at(pointer) : option.default_value;
    if (field.start.is_object()) continue;
    field.choices = ChoicesOf(option, check_);
    AddField(field, FormOf(field.Group()));
  }
  none_->setVisible(fields_.empty());
  filter_->setVisible(fields_.size() > 8);
  filter_->clear();
  emit Changed();
}

QFormLayout* StageForm::FormOf(const std::string& group) {
  QFormLayout*& form = groups_[group];
  if (form != nullptr) return form;
  auto* box = new QGroupBox(QString::fromStdString(group));
  box->setFlat(group.empty());
  form = new QFormLayout(box);
  form->setFieldGrowthPolicy(QFormLayout::AllNonFixedFieldsGrow);
  content_->layout()->addWidget(box);
  return form;
}

void StageForm::AddField(const Field& given, QFormLayout* form) {
  Field field = given;
  const OptionDescription& option = field.option;
  const QString help = QString::fromStdString(option.help);
  const QString unit = QString::fromStdString(option.unit);
  const QString range = RangeText(option);
  const QString name = QString::fromStdString(option.name);
  field.row = new QWidget;
  auto* line = new QHBoxLayout(field.row);
  line->setContentsMargins(0, 0, 0, 0);
  QWidget* input = nullptr;
  if (option.type == "true or false") {
    input = field.check = new QCheckBox;
    field.check->setChecked(field.start.is_boolean() && field.start.get<bool>());
    connect(field.check, &QCheckBox::toggled, this, &StageForm::Changed);
  } else if (!field.choices.isEmpty()) {
    input = field.box = new QComboBox;
    field.box->addItems(field.choices);
    if (field.box->findText(ShortText(field.start)) < 0) field.box->addItem(ShortText(field.start));
    field.box->setCurrentText(ShortText(field.start));
    connect(field.box, &QComboBox::currentTextChanged, this, &StageForm::Changed);
  } else {
    input = field.edit = new QLineEdit(ShortText(field.start));
    if (option.type != "text") field.edit->setMaximumWidth(12 * fontMetrics().averageCharWidth() + 40);
    connect(field.edit, &QLineEdit::textEdited, this, &StageForm::Changed);
  }
  input->setObjectName("option." + name);
  input->setAccessibleName(name);
  input->setAccessibleDescription(help);
  const QString standard = ShortText(option.default_value);
  const QString facts = QStringList{unit, range, standard.isEmpty() ? QString() : tr("default %1").arg(standard)}
                            .filter(QRegularExpression("."))
                            .join(", ");
  input->setToolTip(help + "\n" + facts);
  line->addWidget(input);
  if (field.edit != nullptr && option.path != PathKind::kNone) {
    line->addWidget(MakePathButton(field.edit, option.path, [this] { return folder_; }));
  }
  auto* text = new QLabel(QString("<small>%1<br><i>%2</i></small>").arg(facts.toHtmlEscaped(), help.toHtmlEscaped()));
  text->setWordWrap(true);
  field.problem = WrappedLabel("problem." + name);
  field.problem->setStyleSheet("color: #d03020;");
  field.problem->hide();
  auto* texts = InColumn({text, field.problem});
  texts->setSpacing(0);
  line->addLayout(texts, 1);
  auto* label = new QLabel(QString::fromStdString(field.Name()));
  label->setBuddy(input);
  field.label = label;
  form->addRow(label, field.row);
  fields_.push_back(field);
}

void StageForm::Find(const QString& text) {
  std::map<std::string, bool> any;
  for (const Field& field : fields_) {
    const bool found = QString::fromStdString(field.option.name).contains(text, Qt::CaseInsensitive) ||
                       QString::fromStdString(field.option.help).contains(text, Qt::CaseInsensitive);
    field.label->setVisible(found);
    field.row->setVisible(found);
    any[field.Group()] |= found;
  }
  for (const auto& [group, form] : groups_) form->parentWidget()->setVisible(any[group]);
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
    if (field.Value() != field.start) edits[field.option.name] = field.Text();
  }
  return edits;
}

void StageForm::Restore(const std::map<std::string, QString>& edits) {
  for (const Field& field : fields_) {
    const auto edit = edits.find(field.option.name);
    if (edit != edits.end()) field.SetText(edit->second);
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
  if (problems.empty() && check_) problems = check_(Changes());
  return problems;
}

// At the field that each is about.
void StageForm::ShowProblems() {
  const std::vector<std::string> problems = Problems();
  for (const Field& field : fields_) {
    QString text;
    for (const std::string& problem : problems) {
      const bool its = HasWord(problem, field.Name()) && (field.Group().empty() || HasWord(problem, field.Group()));
      if (its && text.isEmpty()) text = QString::fromStdString(problem);
    }
    if (field.problem->text() == text) continue;
    field.problem->setText(text);
    field.problem->setVisible(!text.isEmpty());
    if (field.edit != nullptr) field.edit->setStyleSheet(text.isEmpty() ? "" : "border: 1px solid #d03020;");
  }
}

void StageForm::Reset() {
  for (const Field& field : fields_) {
    if (field.check != nullptr) field.check->setChecked(field.start.is_boolean() && field.start.get<bool>());
    if (field.check == nullptr) field.SetText(ShortText(field.start));
  }
  emit Changed();
}

}  // namespace trigpoint

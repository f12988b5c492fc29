// A form of options, generated from what they say of themselves: unit, range, default, help; in their groups, found by
// a word, with what is wrong beside the field.
#pragma once

#include <QStringList>
#include <QWidget>
#include <functional>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

class QFormLayout;
class QLabel;
class QLineEdit;
class QVBoxLayout;

namespace trigpoint {

struct OptionDescription;

class StageForm : public QWidget {
  Q_OBJECT

 public:
  // What is wrong with {option: value}, nested; one sentence each.
  using Check = std::function<std::vector<std::string>(const nlohmann::json& values)>;

  explicit StageForm(QWidget* parent = nullptr);
  ~StageForm() override;

  // Shows a stage's options with `values` (nested, as in a manifest) in place: the project's own.
  void SetStage(const std::string& stage, const nlohmann::json& values);
  // Any other options.
  void SetOptions(const std::vector<OptionDescription>& options, const nlohmann::json& values, Check check);
  const std::string& stage() const { return stage_; }
  // Of the project: paths in it are entered relative to it.
  void SetFolder(const QString& folder) { folder_ = folder; }
  // {option: value}, nested: what differs from the values it was set to.
  nlohmann::json Changes() const;
  // What stands in the fields that were changed, by option, whether it is a value or not; and back into them.
  std::map<std::string, QString> Edits() const;
  void Restore(const std::map<std::string, QString>& edits);
  // What is wrong with it, one sentence each; empty: it can be run.
  std::vector<std::string> Problems() const;
  // Back to what it was set to.
  void Reset();
  // Only options whose name or help holds the text.
  void Find(const QString& text);

 signals:
  void Changed();

 private:
  struct Field;
  void AddField(const Field& field, QFormLayout* form);
  QFormLayout* FormOf(const std::string& group);
  void ShowProblems();

  std::string stage_;
  QString folder_;
  Check check_;
  std::vector<Field> fields_;
  QLineEdit* filter_;
  QLabel* none_;
  QVBoxLayout* column_;
  QWidget* content_ = nullptr;
  std::map<std::string, QFormLayout*> groups_;
};

// The words that a text option takes, by its own check's answer to one that it does not; empty: any text.
QStringList ChoicesOf(const OptionDescription& option, const StageForm::Check& check);

}  // namespace trigpoint

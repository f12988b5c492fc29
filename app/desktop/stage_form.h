// A form of a stage's options, generated from what the options say of themselves: unit, range, default, help.
#pragma once

#include <QWidget>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

class QFormLayout;
class QLineEdit;

namespace trigpoint {

class StageForm : public QWidget {
  Q_OBJECT

 public:
  explicit StageForm(QWidget* parent = nullptr);
  ~StageForm() override;

  // Shows a stage's options with `values` (nested, as in a manifest) in place: the project's own.
  void SetStage(const std::string& stage, const nlohmann::json& values);
  const std::string& stage() const { return stage_; }
  // {option: value}, nested: what differs from the values it was set to.
  nlohmann::json Changes() const;
  // What stands in the fields that were changed, by option, whether it is a value or not; and back into them.
  std::map<std::string, QString> Edits() const;
  void Restore(const std::map<std::string, QString>& edits);
  // What is wrong with it, one sentence each; empty: it can be run.
  std::vector<std::string> Problems() const;
  // Back to what it was set to.
  void Reset();

 signals:
  void Changed();

 private:
  struct Field;
  void AddField(const Field& field, QFormLayout* form);

  std::string stage_;
  std::vector<Field> fields_;
};

}  // namespace trigpoint

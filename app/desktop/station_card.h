// The numbers of the selected station, the same beside every desk: run by run its error east, north, up and in space,
// 1 sigma, and the tolerance it keeps.
#pragma once

#include <QWidget>
#include <memory>
#include <vector>

#include "app/desktop/workspace.h"

class QCheckBox;
class QLabel;
class QTableWidget;

namespace trigpoint {

struct ErrorRecord;
struct Overview;

class StationCard : public QWidget {
  Q_OBJECT

 public:
  explicit StationCard(Workspace* workspace, QWidget* parent = nullptr);
  // What the errors are taken from; null: nothing is known.
  void SetOverview(std::shared_ptr<const Overview> overview);
  // Which set of results is shown; empty: the first.
  void SetVariant(const QString& variant);
  // Whose numbers are shown: "station:S57", "panorama:..." for one without a station; empty: nobody's.
  const QString& object() const { return object_; }

 signals:
  void ImageRequested(const QString& object);
  void SceneRequested(const QString& object);

 private:
  void Show();
  void ShowTitle();
  void ShowHeader();
  void ShowErrors();
  void ShowAnswers();           // of a panorama that nothing is compared with
  bool HasGroundTruth() const;  // that the project's answers can be compared with
  // Whether the rows of what is shown name the panorama that they are of.
  bool NamesPanoramas() const;
  // Before its first row, where the station has several; `titled`: the panorama of the rows before.
  void TitlePanorama(const std::string& panorama, std::string* titled);
  QString Note(bool errors, bool answers) const;
  bool IsShown(const std::string& station, const std::string& panorama) const;
  QTableWidgetItem* Put(int row, int column, const QString& text, const QString& help);
  QTableWidgetItem* PutAcross(int row, int from, const QString& text, const QString& help);
  void AddTitle(const QString& text, const QString& below);
  void AddGroup(const std::vector<const ErrorRecord*>& rows);
  void AddRow(const ErrorRecord& error);

  Workspace* workspace_;
  std::shared_ptr<const Overview> overview_;
  QLabel *title_, *note_;
  QTableWidget* table_;
  QCheckBox* views_;
  QWidget* buttons_;
  QString object_, variant_;
};

}  // namespace trigpoint

// Panoramas that services have along a run: a map of what is there by source and year, picked and loaded. The same as
// `trigpoint import --from SERVICE --along RUN`. Works in the background; the window stays usable.
#pragma once

#include <QDialog>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "app/desktop/services_map.h"
#include "app/desktop/workspace.h"
#include "datasets/import/providers/services.h"

class QCheckBox;
class QComboBox;
class QLabel;
class QLineEdit;
class QPushButton;
class QSpinBox;
class QTableWidget;
class QTimer;

namespace trigpoint {

class PolledProgress;

class ServicesDialog : public QDialog {
  Q_OBJECT

 public:
  // How a service is reached; another way for tests.
  using Open = std::function<std::unique_ptr<PanoramaProvider>(const Service& service, const ServiceOptions& options)>;

  // Of the project that is open.
  ServicesDialog(Workspace* workspace, QWidget* parent, Open open = nullptr);
  ~ServicesDialog() override;  // cancels what goes on

  const std::vector<FoundPanorama>& found() const { return found_; }

 signals:
  void Searched(bool well);
  void Loaded(bool well);

 private:
  struct Query;  // what the fields ask for, by value
  Query Asked() const;
  void MakeFields();
  void MakeTable();
  void Search();
  void Load();
  void Begin(const QString& status);
  void End(const QString& status);
  void TakeIn(const std::string& service, const SearchArea& area, std::vector<PanoramaRecord> records);
  void ShowFound();
  void ShowRows();  // of the table
  void Pick(int index, bool picked);
  void ShowState();  // the buttons, the command line

  Workspace* workspace_;
  Open open_;
  std::vector<FoundPanorama> found_;
  std::vector<Geodetic> track_;
  QComboBox *service_, *run_;
  QSpinBox* radius_;
  QLineEdit *since_, *until_, *key_file_, *url_;
  QCheckBox* permitted_;
  ServicesMap* map_;
  QTableWidget* table_;
  QLineEdit* command_;
  QLabel* status_;
  QPushButton *search_, *load_, *cancel_, *all_, *none_;
  QTimer* timer_;
  std::shared_ptr<PolledProgress> work_;  // that goes on
  bool filling_ = false;                  // the table changes by itself
};

}  // namespace trigpoint

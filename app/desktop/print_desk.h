// Tags, boards and scale bars to print: a form, the pages as the PDF has them, what was printed for this site, and the
// length that a ruler shows. The same as `trigpoint print`.
#pragma once

#include <QWidget>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "app/desktop/workspace.h"

class QCheckBox;
class QComboBox;
class QDoubleSpinBox;
class QFormLayout;
class QLabel;
class QLineEdit;
class QPushButton;
class QSpinBox;
class QTableWidget;
class QTimer;

namespace trigpoint {

class PictureView;
class PrintPages;
struct PrintRequest;

class PrintDesk : public QWidget {
  Q_OBJECT

 public:
  explicit PrintDesk(Workspace* workspace, QWidget* parent = nullptr);

  PictureView* view() const { return view_; }
  int page() const { return page_; }  // from 0
  int pages() const;                  // 0: there is no preview
  void ShowPage(int page);

 signals:
  void Previewed();       // a page is shown, or what is wrong with the form
  void Ended(bool well);  // of writing a PDF or entering a length

 protected:
  void showEvent(QShowEvent* event) override;

 private:
  // Tags of one PDF that have one size and one measured length.
  struct Printed {
    std::string printed, file, family;
    double size_mm = 0, measured_mm = 0;  // 0: not measured
    double bar_mm = 0;                    // 0: not noted
    std::vector<int> ids;                 // ascending
  };

  void MakeForm();
  void MakeOutput();  // buttons, messages, pages, table
  void Arrange();
  void Connect();
  void Opened();
  void Changed();  // of the form: the pages follow a moment later
  void ShowFields();
  void ShowCommand();
  void ShowButtons();
  void ShowChosen();
  PrintRequest Request() const;  // throws OptionError
  void Preview();
  void ShowProblem(const QString& problem);
  void Print();
  void EnterMeasure();
  // Of work in `dir`, which another project may have replaced meanwhile.
  void Ends(const QString& dir, const QString& done, const QString& error, const QString& not_done);
  void ReadPrinted();
  const Printed* Chosen() const;  // selected, else the newest; null: nothing was printed
  QString PdfToOpen() const;      // the selected one, else the last one; empty: there is none
  void OpenPdf();

  Workspace* workspace_;
  QFormLayout* form_;
  QComboBox *what_, *family_, *paper_;
  QLineEdit *ids_, *target_, *out_, *command_;
  QWidget* target_row_;
  QDoubleSpinBox *size_, *length_, *margin_, *across_, *up_, *nominal_;
  QSpinBox* per_sheet_;
  QCheckBox* force_;
  QPushButton *print_, *open_, *enter_, *back_, *forward_;
  QLabel *problem_, *status_, *lengths_;
  QTableWidget* printed_;
  PictureView* view_;
  QTimer* timer_;
  QString dir_;  // of the project that the form is for
  QString pdf_;  // written last; empty: none since it was opened
  std::vector<Printed> records_;
  std::shared_ptr<const PrintPages> pages_;
  int page_ = 0;
  bool stale_ = false;       // to be drawn again
  bool previewing_ = false;  // one at a time
  bool working_ = false;     // writes into the site's folder
  bool failed_ = false;      // the last writing
};

}  // namespace trigpoint

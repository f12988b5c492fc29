#include "app/desktop/print_desk.h"

#include <fmt/format.h>

#include <QCheckBox>
#include <QComboBox>
#include <QDateTime>
#include <QDesktopServices>
#include <QDir>
#include <QDoubleSpinBox>
#include <QFileInfo>
#include <QFormLayout>
#include <QGridLayout>
#include <QGroupBox>
#include <QLabel>
#include <QLineEdit>
#include <QPushButton>
#include <QSpinBox>
#include <QTableWidget>
#include <QTimer>
#include <QToolButton>
#include <QUrl>
#include <algorithm>
#include <tuple>

#include "app/desktop/background.h"
#include "app/desktop/contrast.h"
#include "app/desktop/number_item.h"
#include "app/desktop/object_table.h"
#include "app/desktop/path_button.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/print_pages.h"
#include "app/desktop/widgets.h"
#include "app/pipeline/command_line.h"
#include "datasets/io/csv.h"
#include "survey/tags/tag_family.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

constexpr int kPause_ms = 300;       // after the last key before the pages are drawn
constexpr double kSize_mm = 160;     // one on a sheet of A4
constexpr int kLeastSide_px = 1200;  // of a page
constexpr int kFirstTags = 4;        // proposed for a site
constexpr double kLength_mm = 1000, kNominal_mm = 100;

QDoubleSpinBox* Millimetres(const char* name, const QString& accessible, double low, double high, double value,
                            const QString& help) {
  auto* box = Named(new QDoubleSpinBox, name, accessible, help);
  box->setRange(low, high);
  box->setValue(value);
  box->setSuffix(PrintDesk::tr(" mm"));
  return box;
}

// "0-3, 7" of ascending ids.
QString Ranges(const std::vector<int>& ids) {
  QStringList parts;
  for (size_t begin = 0, end = 0; begin < ids.size(); begin = end) {
    for (end = begin + 1; end < ids.size() && ids[end] == ids[end - 1] + 1;) ++end;
    parts << QString::number(ids[begin]) + (end > begin + 1 ? "-" + QString::number(ids[end - 1]) : QString());
  }
  return parts.join(", ");
}

QString Number(double value) { return Text(fmt::format("{:g}", value)); }

}  // namespace

PrintDesk::PrintDesk(Workspace* workspace, QWidget* parent) : QWidget(parent), workspace_(workspace) {
  MakeForm();
  MakeOutput();
  Arrange();
  Connect();
  Opened();
}

void PrintDesk::MakeForm() {
  what_ = Named(new QComboBox, "print.what", tr("What is printed"));
  what_->addItem(tr("tags"), "tags");
  what_->addItem(tr("calibration board"), "board");
  what_->addItem(tr("scale bar"), "scale-bar");
  family_ = Named(new QComboBox, "print.family", tr("Tag family"));
  family_->addItem(tr("as in tags.yaml, else tag36h11"), "");
  family_->setSizeAdjustPolicy(QComboBox::AdjustToMinimumContentsLengthWithIcon);  // cut in a narrow desk
  family_->setMinimumContentsLength(12);
  for (const std::string& name : TagFamilyNames()) family_->addItem(Text(name), Text(name));
  ids_ = Named(new QLineEdit, "print.ids", tr("Ids of the tags"), tr("As 0-9,12; a scale bar has two"));
  size_ = Millimetres("print.size", tr("Size of a tag"), 5, 5000, kSize_mm,
                      tr("As tags.yaml declares it: the edge of the black square, corner 0 to corner 1"));
  length_ = Millimetres("print.length", tr("Length of the scale bar"), 10, 20000, kLength_mm,
                        tr("Distance of the two tags' centres"));
  target_ = Named(new QLineEdit, "print.target", tr("Board"),
                  tr("A file, or one line:\n"
                     "checkerboard:9x6:0.025 (inner corners, square in m)\n"
                     "charuco:8x6:0.03:0.022:DICT_4X4_50 (squares, square and marker in m, dictionary)\n"
                     "aprilgrid:6x6:0.088:0.3 (tags, tag in m, gap / tag)\n"
                     "circles:4x11:0.02, asymmetric_circles:4x11:0.02 (columns x rows, spacing in m)"));
  target_->setText("checkerboard:9x6:0.025");
  paper_ = Named(new QComboBox, "print.paper", tr("Paper"), tr("A size by its name, or WIDTHxHEIGHT in mm as 300x500"));
  paper_->setEditable(true);
  for (const PaperSize& paper : KnownPapers()) paper_->addItem(Text(paper.name));
  paper_->addItem("300x500");
  paper_->setCurrentText(Text(PaperSize().name));
  margin_ = Millimetres("print.margin", tr("Margin"), 0, 100, SheetOptions().margin_mm,
                        tr("Edge of the paper that the printer leaves white"));
  per_sheet_ = Named(new QSpinBox, "print.per_sheet", tr("Most tags on a sheet"));
  per_sheet_->setRange(0, 1000);
  per_sheet_->setSpecialValueText(tr("as many as fit"));
  out_ = Named(new QLineEdit, "print.out", tr("File"), tr("The PDF, relative to the site's folder"));
  out_->setPlaceholderText(tr("below print/, named by what it holds"));
  force_ = Named(new QCheckBox(tr("Replace a changed PDF")), "print.force", tr("Replace a changed PDF"),
                 tr("One that was changed since it was written"));
  command_ = ReadOnly(Named(new QLineEdit, "print.command", tr("Equivalent command line")));
  form_ = new QFormLayout;
  form_->setRowWrapPolicy(QFormLayout::WrapLongRows);
  form_->addRow(tr("Print"), what_);
  form_->addRow(tr("Ids"), ids_);
  form_->addRow(tr("Size of a tag"), size_);
  form_->addRow(tr("Centre to centre"), length_);
  form_->addRow(tr("Family"), family_);
  const auto with_button = [this](QLineEdit* field, PathKind kind) {
    auto* row = new QWidget;
    QWidget* button = MakePathButton(field, kind, [this] { return dir_; });
    InRow({{field, 1}, button}, row)->setContentsMargins(0, 0, 0, 0);
    return row;
  };
  target_row_ = with_button(target_, PathKind::kFile);
  form_->addRow(tr("Board"), target_row_);
  form_->addRow(tr("Paper"), paper_);
  form_->addRow(tr("Margin"), margin_);
  form_->addRow(tr("On a sheet"), per_sheet_);
  form_->addRow(tr("File"), with_button(out_, PathKind::kNewFile));
  form_->addRow("", force_);
}

void PrintDesk::MakeOutput() {
  print_ = MakeButton("print.print", tr("&Write the PDF"), tr("And adds its tags to tags.yaml (trigpoint print)"));
  open_ = MakeButton("print.open", tr("&Open the PDF"), tr("The selected one, else the last one that was written"));
  back_ = MakeButton("print.back", tr("Previous page"), tr("One page back"));
  forward_ = MakeButton("print.forward", tr("Next page"), tr("One page on"));
  enter_ = MakeButton("print.enter", tr("&Enter"), tr("Corrects sizes_m in tags.yaml: size x measured / nominal"));
  const QString measured = tr("As a ruler shows it");
  across_ = Millimetres("print.across", tr("Measured across"), 0, 5000, 0, measured);
  up_ = Millimetres("print.up", tr("Measured up"), 0, 5000, 0, measured);
  for (QDoubleSpinBox* box : {across_, up_}) box->setSpecialValueText(tr("not measured"));
  nominal_ = Millimetres("print.nominal", tr("Nominal"), 1, 5000, kNominal_mm,
                         tr("As it should be: of the bar, or of the tag's edge"));
  problem_ = Selectable(WrappedLabel("print.problem"));
  status_ = Selectable(WrappedLabel("print.status"));
  lengths_ = Selectable(WrappedLabel("print.lengths"));
  printed_ = MakeTable(
      "print.printed", tr("Printed for this site"),
      {tr("tags"), tr("size (mm)"), tr("measured (mm)"), tr("factor (%)"), tr("printed"), tr("family"), tr("file")});
  printed_->setSelectionMode(QAbstractItemView::SingleSelection);
  const QStringList help{tr("ids"),
                         tr("that was asked for"),
                         tr("size on the paper, from the bar's measured length; empty: not measured"),
                         tr("measured / asked for"),
                         tr("when"),
                         tr("of the tags"),
                         tr("relative to the site's folder")};
  SetHeaderHelp(printed_, help);
  view_ = Named(new PictureView, "print.view", tr("Page of the PDF"));
  timer_ = new QTimer(this);
  timer_->setSingleShot(true);
  timer_->setInterval(kPause_ms);
}

void PrintDesk::Arrange() {
  auto* fields = new QWidget;
  InColumn({form_}, fields)->addStretch(1);
  auto* scroll = Named(Scrolled(fields), "print.form", tr("What to print"));
  scroll->setFrameShape(QFrame::NoFrame);
  scroll->setHorizontalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
  auto* upper = Pane({{scroll, 1}, problem_, command_, InFlow({print_, open_}), status_});
  auto* measure = new QGroupBox(tr("Measured on the paper"));
  auto* bars = new QGridLayout(measure);
  const std::vector<std::pair<QString, QWidget*>> lengths = {
      {tr("Across"), across_}, {tr("Up"), up_}, {tr("Nominal"), nominal_}};
  for (int k = 0; k < 3; ++k) {
    bars->addWidget(new QLabel(lengths[static_cast<size_t>(k)].first), 0, k);
    bars->addWidget(lengths[static_cast<size_t>(k)].second, 1, k);
  }
  bars->addWidget(lengths_, 2, 0, 1, 3);
  bars->addWidget(enter_, 3, 0, 1, 3);
  lengths_->setMinimumHeight(2 * fontMetrics().lineSpacing());  // a splitter asks for no more than one line
  auto* left = InSplitter(Qt::Vertical, {upper, measure, printed_}, {440, 130, 130});
  auto* right = Pane({InFlow({back_, forward_}), {view_, 1}});
  auto* split = Named(InSplitter(Qt::Horizontal, {left, right}, {460, 520}), "print.split");
  InColumn({{split, 1}}, this);
}

void PrintDesk::Connect() {
  for (QComboBox* box : {what_, family_, paper_}) {
    connect(box, &QComboBox::currentTextChanged, this, &PrintDesk::Changed);
  }
  for (QLineEdit* line : {ids_, target_, out_}) connect(line, &QLineEdit::textChanged, this, &PrintDesk::Changed);
  for (QDoubleSpinBox* box : {size_, length_, margin_}) {
    connect(box, QOverload<double>::of(&QDoubleSpinBox::valueChanged), this, &PrintDesk::Changed);
  }
  connect(per_sheet_, QOverload<int>::of(&QSpinBox::valueChanged), this, &PrintDesk::Changed);
  connect(force_, &QCheckBox::toggled, this, &PrintDesk::ShowCommand);
  connect(across_, QOverload<double>::of(&QDoubleSpinBox::valueChanged), this, &PrintDesk::ShowButtons);
  connect(what_, &QComboBox::currentTextChanged, this, [this] { page_ = 0; });
  connect(timer_, &QTimer::timeout, this, &PrintDesk::Preview);
  connect(print_, &QPushButton::clicked, this, &PrintDesk::Print);
  connect(open_, &QPushButton::clicked, this, &PrintDesk::OpenPdf);
  connect(enter_, &QPushButton::clicked, this, &PrintDesk::EnterMeasure);
  connect(back_, &QPushButton::clicked, this, [this] { ShowPage(page_ - 1); });
  connect(forward_, &QPushButton::clicked, this, [this] { ShowPage(page_ + 1); });
  connect(printed_, &QTableWidget::itemSelectionChanged, this, &PrintDesk::ShowChosen);
  connect(workspace_, &Workspace::Opened, this, &PrintDesk::Opened);
  connect(workspace_, &Workspace::Closed, this, &PrintDesk::Opened);
}

void PrintDesk::showEvent(QShowEvent* event) {
  QWidget::showEvent(event);
  if (stale_) Preview();
}

void PrintDesk::Opened() {
  const bool other = dir_ != workspace_->dir() || dir_.isEmpty();
  if (other) {
    dir_ = workspace_->dir();
    pages_.reset();
    status_->clear();
    pdf_.clear();
    const std::vector<int> known = workspace_->snapshot() ? workspace_->snapshot()->tags : std::vector<int>();
    const int first = known.empty() ? 0 : known.back() + 1;
    ids_->setText(QString("%1-%2").arg(first).arg(first + kFirstTags - 1));
  }
  ReadPrinted();
  if (other) ShowChosen();
  Changed();
}

int PrintDesk::pages() const { return pages_ ? pages_->sheets().pages : 0; }

void PrintDesk::Changed() {
  ShowFields();
  ShowCommand();
  ShowButtons();
  stale_ = true;
  timer_->start();
}

void PrintDesk::ShowFields() {
  const QString what = what_->currentData().toString();
  const bool board = what == "board";
  const auto show = [this](QWidget* field, bool shown) {
    field->setVisible(shown);
    form_->labelForField(field)->setVisible(shown);
  };
  show(ids_, !board);
  show(size_, !board);
  show(family_, !board);
  show(length_, what == "scale-bar");
  show(target_row_, board);
  show(per_sheet_, what == "tags");
}

void PrintDesk::ShowCommand() {
  const QString what = what_->currentData().toString();
  const bool board = what == "board";
  QString line = "trigpoint print " + Text(ShellWord(dir_.toStdString()));
  const auto add = [&line](const char* option, const QString& value, bool wanted) {
    if (wanted) line += QString(" --%1 %2").arg(option, Text(ShellWord(value.toStdString())));
  };
  add("what", what, what != "tags");
  add("ids", ids_->text(), !board && !ids_->text().isEmpty());
  add("size", Number(size_->value()), !board);
  add("length", Number(length_->value()), what == "scale-bar");
  add("family", family_->currentText(), !board && family_->currentIndex() > 0);
  add("target", target_->text(), board);
  add("paper", paper_->currentText(), paper_->currentText() != Text(PaperSize().name));
  add("margin", Number(margin_->value()), margin_->value() != SheetOptions().margin_mm);
  add("per-sheet", QString::number(per_sheet_->value()), what == "tags" && per_sheet_->value() > 0);
  add("out", AbsolutePath(dir_, out_->text()), !out_->text().isEmpty());
  command_->setText(line + (force_->isChecked() ? " --force" : ""));
  command_->setCursorPosition(0);
}

void PrintDesk::ShowButtons() {
  const bool open = workspace_->snapshot() != nullptr;
  const Printed* chosen = Chosen();
  print_->setEnabled(open && !working_);
  open_->setEnabled(open && !PdfToOpen().isEmpty());
  enter_->setEnabled(open && !working_ && chosen != nullptr && across_->value() > 0);
  back_->setEnabled(page_ > 0);
  forward_->setEnabled(page_ + 1 < pages());
}

// What the next entry is for, and the lengths that its sheets have.
void PrintDesk::ShowChosen() {
  constexpr int kLongest = 24;  // letters
  const Printed* chosen = Chosen();
  const QString ids = chosen == nullptr ? QString() : Ranges(chosen->ids);
  enter_->setText(ids.isEmpty()            ? tr("&Enter")
                  : ids.size() <= kLongest ? tr("&Enter for tags %1").arg(ids)
                                           : tr("&Enter for %1 tags").arg(chosen->ids.size()));
  across_->setValue(0);
  up_->setValue(0);
  nominal_->setValue(chosen == nullptr ? kNominal_mm : std::max(chosen->bar_mm, chosen->size_mm));
  if (chosen == nullptr) {
    lengths_->setText(tr("Nothing was printed yet."));
  } else {
    const QString bars = chosen->bar_mm > 0 ? tr("bars of %1 mm").arg(Number(chosen->bar_mm)) : tr("bars");
    lengths_->setText(tr("On these sheets: %1, tags of %2 mm. Half a millimetre on the ruler is %3 % of %4 mm.")
                          .arg(bars, Number(chosen->size_mm))
                          .arg(ReadingPercent(nominal_->value()), 0, 'g', 2)
                          .arg(Number(nominal_->value())));
  }
  ShowButtons();
}

PrintRequest PrintDesk::Request() const {
  PrintRequest request;
  request.dir = dir_.toStdString();
  request.what = what_->currentData().toString().toStdString();
  request.sheets.paper = PaperNamed(paper_->currentText().trimmed().toStdString());
  request.sheets.margin_mm = margin_->value();
  request.out = AbsolutePath(dir_, out_->text()).toStdString();
  request.force = force_->isChecked();
  if (request.what == "board") {
    request.target = target_->text().trimmed().toStdString();
    return request;
  }
  request.ids = ParseIds(ids_->text().toStdString());
  request.family = family_->currentData().toString().toStdString();
  request.size_mm = size_->value();
  if (request.what == "tags") request.sheets.per_sheet = per_sheet_->value();
  if (request.what == "scale-bar") request.length_mm = length_->value();
  return request;
}

void PrintDesk::Preview() {
  if (!isVisible() || previewing_) return;  // seen later, or when those that are made now are there
  stale_ = false;
  if (!workspace_->snapshot()) {
    pages_.reset();
    return ShowProblem("");
  }
  PrintRequest request;
  try {
    request = Request();
  } catch (const std::exception& e) {
    return ShowProblem(QString::fromUtf8(e.what()));
  }
  previewing_ = true;
  problem_->hide();
  if (!pages_) view_->SetPicture({}, tr("Drawing ..."));
  InBackground(
      this, [request] { return std::make_shared<const PrintPages>(request); },
      [this](const Attempted<std::shared_ptr<const PrintPages>>& made) {
        previewing_ = false;
        if (stale_) return Preview();
        if (!made.error.isEmpty()) return ShowProblem(made.error);
        pages_ = made.value;
        if (failed_) status_->clear();  // mended
        failed_ = false;
        ShowPage(page_);
      });
}

// Pages of what the form held before stay in sight no longer.
void PrintDesk::ShowProblem(const QString& problem) {
  pages_.reset();
  page_ = 0;
  problem_->setStyleSheet(
      QString("color: %1;").arg(ReadableOn(palette().color(QPalette::Window), QColor(208, 48, 32)).name()));
  problem_->setText(problem);
  problem_->setVisible(!problem.isEmpty());
  view_->SetPicture({}, workspace_->snapshot() ? tr("No page; the form shows the reason.")
                                               : tr("Open the folder of a site; its sheets are drawn here."));
  ShowButtons();
  emit Previewed();
}

void PrintDesk::ShowPage(int page) {
  if (!pages_) return;
  page_ = std::clamp(page, 0, pages() - 1);
  const PrintedSheets& sheets = pages_->sheets();
  QString text = tr("Page %1 of %2, %3").arg(page_ + 1).arg(sheets.pages).arg(Text(pages_->paper().name));
  if (sheets.per_sheet > 0) text += tr("; at most %1 on a sheet").arg(sheets.per_sheet);
  if (sheets.tiles > 0) text += tr("; cut into %1 sheets").arg(sheets.tiles);
  if (!sheets.one_sheet.empty()) text += tr(" (one of %1)").arg(Text(sheets.one_sheet));
  ShowButtons();
  // Twice what is seen, for a sharp picture when it is enlarged.
  const int side_px = std::max(kLeastSide_px, 2 * std::max(view_->width(), view_->height()));
  InBackground(
      this, [pages = pages_, page = page_, side_px] { return pages->Page(page, side_px); },
      [this, pages = pages_, page = page_, text](const Attempted<QImage>& drawn) {
        if (pages != pages_ || page != page_ || stale_ || previewing_) return;  // others follow
        view_->SetPicture(drawn.value, drawn.error.isEmpty() ? text : drawn.error);
        emit Previewed();
      });
}

void PrintDesk::Print() {
  PrintRequest request;
  try {
    request = Request();
  } catch (const std::exception& e) {
    return Ends(dir_, "", QString::fromUtf8(e.what()), tr("Nothing was printed."));
  }
  working_ = true;
  ShowButtons();
  InBackground(
      this, [request] { return PrintSheetsFor(request); },
      [this, request](const Attempted<PrintOutcome>& made) {
        const PrintOutcome& outcome = made.value;
        QString done = tr("%1, pages: %2. Print at 100 %, not fitted to the page. Bars: %3 mm.")
                           .arg(QDir(dir_).relativeFilePath(Text(outcome.pdf.string())))
                           .arg(outcome.sheets.pages)
                           .arg(outcome.sheets.bar_mm);
        for (const std::string& warning : outcome.warnings) done += "\n" + Text(warning);
        for (const std::string& check : outcome.checks) done += "\n" + tr("Measure: %1.").arg(Text(check));
        if (request.what == "board")
          done += "\n" + tr("Sizes of the target for a calibration: times measured / nominal.");
        if (request.what != "board") done += "\n" + tr("Tags added to tags.yaml: %1.").arg(outcome.entries_added);
        if (request.what == "scale-bar") {
          done += "\n" + tr("For distances.csv, measured: %1,%2,DISTANCE_M,SIGMA_M,control.")
                             .arg(request.ids.front())
                             .arg(request.ids.back());
        }
        if (made.error.isEmpty() && Text(request.dir.string()) == dir_) {
          printed_->clearSelection();
          pdf_ = Text(outcome.pdf.string());
        }
        Ends(Text(request.dir.string()), done, made.error, tr("Nothing was printed."));
      });
}

void PrintDesk::EnterMeasure() {
  std::vector<int> ids;  // none: the newest PDF's
  if (!printed_->selectedItems().isEmpty()) ids = Chosen()->ids;
  std::vector<double> measured{across_->value()};
  if (up_->value() > 0) measured.push_back(up_->value());
  working_ = true;
  ShowButtons();
  InBackground(
      this,
      [dir = fs::path(dir_.toStdString()), ids, measured, nominal = nominal_->value()] {
        return EnterMeasuredPrint(dir, ids, measured, nominal);
      },
      [this, dir = dir_](const Attempted<MeasuredPrint>& entered) {
        QString done = tr("Tags %1: %2 % of the size asked for; entered in tags.yaml.")
                           .arg(Ranges(entered.value.ids))
                           .arg(100 * entered.value.factor, 0, 'f', 2);
        for (const std::string& warning : entered.value.warnings) done += "\n" + Text(warning);
        Ends(dir, done, entered.error, tr("No length was entered."));
      });
}

void PrintDesk::Ends(const QString& dir, const QString& done, const QString& error, const QString& not_done) {
  working_ = false;
  if (dir != dir_) return ShowButtons();
  failed_ = !error.isEmpty();
  const bool said = problem_->isVisible() && problem_->text() == error;
  status_->setText(error.isEmpty() ? done : said ? not_done : error);
  if (error.isEmpty()) {
    ReadPrinted();
    ShowChosen();
    workspace_->Reload();
  } else {
    emit workspace_->Problem(error, not_done);
  }
  ShowButtons();
  emit Ended(error.isEmpty());
}

void PrintDesk::ReadPrinted() {
  records_.clear();
  const fs::path file = fs::path(dir_.toStdString()) / "print" / "printed.csv";
  try {
    if (!dir_.isEmpty() && fs::exists(file)) {
      const CsvTable table =
          CsvTable::Read(file, {"printed", "file", "family", "tag_id", "size_mm", "measured_mm"}, {"bar_mm"});
      for (const CsvRow& row : table.rows()) {
        const Printed one{row.Text("printed"),
                          row.Text("file"),
                          row.Text("family"),
                          row.Number("size_mm"),
                          row.Number("measured_mm", 0),
                          row.Number("bar_mm", 0),
                          {static_cast<int>(row.Integer("tag_id"))}};
        const auto same = std::find_if(records_.begin(), records_.end(), [&](const Printed& p) {
          return std::tie(p.printed, p.file, p.family, p.size_mm, p.measured_mm) ==
                 std::tie(one.printed, one.file, one.family, one.size_mm, one.measured_mm);
        });
        same == records_.end() ? records_.push_back(one) : same->ids.push_back(one.ids.front());
      }
    }
  } catch (const std::exception& e) {
    records_.clear();
    status_->setText(QString::fromUtf8(e.what()));
  }
  std::reverse(records_.begin(), records_.end());                                             // the newest first
  if (printed_->rowCount() != static_cast<int>(records_.size())) printed_->clearSelection();  // it was of another
  printed_->setRowCount(static_cast<int>(records_.size()));
  for (int row = 0; row < printed_->rowCount(); ++row) {
    Printed& r = records_[static_cast<size_t>(row)];
    std::sort(r.ids.begin(), r.ids.end());
    const bool measured = r.measured_mm > 0;
    const QStringList cells{
        Ranges(r.ids),
        Number(r.size_mm),
        measured ? QString::number(r.measured_mm, 'f', 2) : QString(),
        measured ? QString::number(100 * r.measured_mm / r.size_mm, 'f', 2) : QString(),
        QDateTime::fromString(Text(r.printed), Qt::ISODate).toLocalTime().toString("yyyy-MM-dd hh:mm"),
        Text(r.family),
        Text(r.file)};
    for (int c = 0; c < cells.size(); ++c) {
      auto* item = c >= 1 && c <= 3 ? new NumberItem(cells[c]) : new QTableWidgetItem(cells[c]);
      item->setToolTip(cells[c]);
      printed_->setItem(row, c, item);
    }
  }
  printed_->resizeColumnsToContents();
}

const PrintDesk::Printed* PrintDesk::Chosen() const {
  const auto cells = printed_->selectedItems();
  const size_t row = cells.isEmpty() ? 0 : static_cast<size_t>(cells.front()->row());
  return row < records_.size() ? &records_[row] : nullptr;
}

QString PrintDesk::PdfToOpen() const {
  if (printed_->selectedItems().isEmpty() && !pdf_.isEmpty()) return pdf_;
  return Chosen() == nullptr ? QString() : QDir(dir_).absoluteFilePath(Text(Chosen()->file));
}

void PrintDesk::OpenPdf() {
  const QString file = PdfToOpen();
  if (QFileInfo::exists(file) && QDesktopServices::openUrl(QUrl::fromLocalFile(file))) return;
  emit workspace_->Problem(QFileInfo::exists(file) ? tr("No program opens the PDF: %1").arg(file)
                                                   : tr("The PDF is not there any more: %1").arg(file),
                           "");
}

}  // namespace trigpoint

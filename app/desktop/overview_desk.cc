#include "app/desktop/overview_desk.h"

#include <QApplication>
#include <QCryptographicHash>
#include <QDir>
#include <QFileInfo>
#include <QHeaderView>
#include <QLabel>
#include <QPushButton>
#include <QResizeEvent>
#include <QScrollArea>
#include <QScrollBar>
#include <QSettings>
#include <QStandardPaths>
#include <QTableWidget>
#include <QTimer>
#include <QVBoxLayout>
#include <algorithm>
#include <cmath>
#include <utility>

#include "app/desktop/background.h"
#include "app/desktop/charts_desk.h"
#include "app/desktop/decisions.h"
#include "app/desktop/flow_layout.h"
#include "app/desktop/object_table.h"
#include "app/desktop/overview.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/report_text.h"
#include "app/desktop/tolerance.h"
#include "app/desktop/widgets.h"
#include "eval/text/method_name.h"

namespace trigpoint {

namespace {

constexpr int kTileWidth = 196;
constexpr int kHighestMatrix = 420;   // px, then it scrolls
constexpr size_t kMostWarnings = 12;  // until all are asked for
constexpr int kWidestReason = 24;     // characters of a refusal in the matrix
constexpr int kThumbnail_px = 96;     // of a project's plan on the welcome page

const char* ToneColour(Tone tone) {
  switch (tone) {
    case Tone::kGood: return "#00784f";
    case Tone::kWarning: return "#c77c00";
    case Tone::kBad: return "#c0392b";
    case Tone::kPlain: return "#8a949d";
  }
  return "";
}

QLabel* Wrapped(const QString& text) {
  auto* label = new QLabel(text);
  label->setWordWrap(true);
  label->setTextInteractionFlags(Qt::TextBrowserInteraction);
  return label;
}

QWidget* Tile(const Fact& fact) {
  auto* tile = Named(new QFrame, "tile", "", ReportText(fact.detail));
  tile->setStyleSheet(
      QString("QFrame#tile { background: palette(base); border-left: 4px solid %1; }").arg(ToneColour(fact.tone)));
  tile->setFixedWidth(kTileWidth);
  tile->setSizePolicy(QSizePolicy::Fixed, QSizePolicy::Expanding);
  auto* value = Selectable(new QLabel(ReportText(fact.value)));
  Enlarge(value, 1.5);
  auto* detail = new QLabel(QString("<small>%1</small>").arg(ReportText(fact.detail).toHtmlEscaped()));
  detail->setWordWrap(true);
  auto* column = InColumn({new QLabel(ReportText(fact.label)), value, detail, {}}, tile);
  column->setContentsMargins(10, 6, 8, 6);
  column->setSpacing(1);
  return tile;
}

// Where the plan of a project is kept, small.
QString ThumbnailOf(const QString& dir) {
  const QByteArray name = QCryptographicHash::hash(dir.toUtf8(), QCryptographicHash::Sha1).toHex();
  return QStandardPaths::writableLocation(QStandardPaths::CacheLocation) + "/" + QString::fromLatin1(name) + ".png";
}

}  // namespace

OverviewDesk::OverviewDesk(Workspace* workspace, QWidget* parent) : QWidget(parent), workspace_(workspace) {
  title_ = Named(new QLabel, "overview.title");
  Enlarge(title_, 1.3);
  next_text_ = WrappedLabel("overview.next_text");
  next_ = Named(new QPushButton, "overview.next");
  next_->setDefault(true);
  scroll_ = Named(new QScrollArea, "overview.scroll", tr("Verdict"));
  scroll_->setWidgetResizable(true);
  scroll_->setFrameShape(QFrame::NoFrame);
  plan_ = Named(new PictureView, "overview.plan", tr("Plan"));
  auto* top = InRow({title_, {next_text_, 1}, next_});
  split_ = InSplitter(Qt::Horizontal, {scroll_, plan_}, {560, 560});
  InColumn({top, {split_, 1}}, this);

  connect(plan_, &PictureView::Clicked, this, [this](const QPointF&, const QString& object) { Choose(object); });
  connect(plan_, &PictureView::DoubleClicked, this, [this](const QString& object) {
    if (!object.isEmpty()) emit SceneRequested(object);
  });
  connect(plan_, &PictureView::MenuAsked, workspace_, &Workspace::AskMenu);
  connect(next_, &QPushButton::clicked, this, [this] { Follow(next_->property("anchor").toString()); });
  connect(workspace_, &Workspace::Replaced, this, [this] {
    ++generation_;
    overview_.reset();
    place_ = {};
    Show();
  });
  connect(workspace_, &Workspace::Opened, this, &OverviewDesk::Load);
  connect(workspace_, &Workspace::Closed, this, &OverviewDesk::Show);
  connect(workspace_, &Workspace::ResultsChanged, this, [this] {
    ShowNext();
    if (overview_ && overview_->stale != StaleOf(workspace_->results())) Load();
  });
  connect(workspace_, &Workspace::StateChanged, this, &OverviewDesk::ShowNext);
  connect(workspace_, &Workspace::UnitChanged, this, &OverviewDesk::Load);
  connect(workspace_, &Workspace::Selected, this, &OverviewDesk::ShowSelected);
  Show();
}

void OverviewDesk::resizeEvent(QResizeEvent* event) {
  QWidget::resizeEvent(event);
  if (TurnToFit(split_, width())) split_->setSizes({1000, 1000});
}

void OverviewDesk::changeEvent(QEvent* event) {
  QWidget::changeEvent(event);
  if (event->type() != QEvent::PaletteChange || std::exchange(recolouring_, true)) return;
  // Style sheets keep the colours of before. Later: Qt is still telling the widgets that Show replaces.
  QTimer::singleShot(0, this, [this] {
    Show();
    recolouring_ = false;
  });
}

void OverviewDesk::Load() {
  const int generation = ++generation_;
  if (!workspace_->snapshot()) return;
  if (!overview_) title_->setText(tr("Reading ..."));
  const DisplayUnit& unit = workspace_->display_unit();
  InBackground(
      this,
      [snapshot = workspace_->snapshot(), results = workspace_->results(), unit] {
        return std::shared_ptr<const Overview>(std::make_shared<Overview>(LoadOverview(*snapshot, results, unit)));
      },
      [this, generation](const Attempted<std::shared_ptr<const Overview>>& loaded) {
        if (generation != generation_) return;
        if (!loaded.value) emit workspace_->Problem(loaded.error, tr("The overview is not shown."));
        // States that became known meanwhile are said by the verdict.
        if (loaded.value && loaded.value->stale != StaleOf(workspace_->results())) return Load();
        overview_ = loaded.value;
        Show();
        SaveThumbnail();
        emit Loaded();
      });
}

void OverviewDesk::Show() {
  if (overview_ && matrix_ != nullptr && !returning_) place_ = PlaceNow();
  matrix_ = nullptr;
  auto* content = new QWidget;
  auto* column = new QVBoxLayout(content);
  column->setContentsMargins(0, 0, 6, 0);
  const auto& snapshot = workspace_->snapshot();
  title_->setText(snapshot ? Text(snapshot->name) : tr("Trigpoint"));
  if (overview_) {
    if (!overview_->has_project_file) ShowFolder(column);
    ShowVerdict(column);
    ShowWarnings(column);
  } else if (!snapshot) {
    ShowWelcome(column);
  }
  column->addStretch();
  scroll_->setWidget(content);  // deletes the one before
  split_->widget(1)->setVisible(snapshot != nullptr);
  ShowPlan();
  ShowNext();
  ShowSelected();
  if (overview_) ReturnTo(place_);
}

OverviewDesk::Place OverviewDesk::PlaceNow() const {
  Place place;
  const QWidget* content = scroll_->widget();
  const QWidget* focus = QApplication::focusWidget();
  if (content != nullptr && focus != nullptr && content->isAncestorOf(focus)) place.focus = focus->objectName();
  place.scrolled = scroll_->verticalScrollBar()->value();
  if (matrix_ == nullptr) return place;
  place.column = matrix_->currentColumn();
  place.row_scrolled = matrix_->verticalScrollBar()->value();
  return place;
}

void OverviewDesk::ReturnTo(const Place& place) {
  QWidget* content = scroll_->widget();
  if (matrix_ != nullptr) {
    showing_ = true;
    if (place.column >= 0 && place.column < matrix_->columnCount() && matrix_->currentRow() >= 0) {
      matrix_->setCurrentCell(matrix_->currentRow(), place.column);
    }
    showing_ = false;
  }
  QWidget* focus = place.focus.isEmpty() ? nullptr : content->findChild<QWidget*>(place.focus);
  if (focus != nullptr) focus->setFocus();
  returning_ = true;
  const auto settle = [this, place] {  // as soon as the new content has its size
    if (!returning_) return;
    scroll_->verticalScrollBar()->setValue(place.scrolled);
    if (matrix_ != nullptr) matrix_->verticalScrollBar()->setValue(place.row_scrolled);
    if (scroll_->verticalScrollBar()->value() == place.scrolled) returning_ = false;
  };
  connect(scroll_->verticalScrollBar(), &QScrollBar::rangeChanged, content, settle);
  QTimer::singleShot(0, content, settle);
  constexpr int kLaidOut_ms = 500;
  QTimer::singleShot(kLaidOut_ms, content, [this] { returning_ = false; });
}

void OverviewDesk::ShowWelcome(QVBoxLayout* column) {
  column->addWidget(
      Wrapped(tr("Localizes panoramas and photos against a camera's run, surveys tags, and measures how "
                 "good the answers are.")));
  auto* open = MakeButton("overview.open", tr("&Open a project ..."));
  connect(open, &QPushButton::clicked, this, &OverviewDesk::OpenRequested);
  auto* example = MakeButton("overview.example", tr("Make the &example ..."),
                             tr("Copies a small site with two runs into a new folder and opens it"));
  connect(example, &QPushButton::clicked, this, &OverviewDesk::ExampleRequested);
  auto* row = new QWidget;
  InFlow({open, example}, row);
  column->addWidget(row);
  QStringList recent;
  for (const QString& dir : QSettings().value("recent").toStringList()) {
    if (QFileInfo::exists(dir)) recent << dir;
  }
  QString text =
      tr("A folder can also be dropped into the window. It is only read; nothing is written without asking.");
  text += "<br><br><b>" + tr("Recent projects") + "</b>";
  if (recent.isEmpty()) {
    text += "<br>" + tr("None yet. Begin with the example.");
  }
  text += "<table cellspacing=\"6\">";
  for (const QString& dir : recent) {
    const QString picture = ThumbnailOf(dir), name = dir.section('/', -1).toHtmlEscaped();
    text += QString("<tr><td>%1</td><td valign=\"middle\"><a href=\"open:%2\">%3</a><br><small>%2</small></td></tr>")
                .arg(QFile::exists(picture) ? QString("<img src=\"%1\">").arg(picture) : QString(), dir.toHtmlEscaped(),
                     name);
  }
  text += "</table>";
  QLabel* label = Wrapped(text);
  label->setObjectName("overview.recent");
  connect(label, &QLabel::linkActivated, this, &OverviewDesk::Follow);
  column->addWidget(label);
}

void OverviewDesk::ShowFolder(QVBoxLayout* column) {
  const auto list = [&](const QString& title, const std::vector<std::string>& lines) {
    if (lines.empty()) return;
    QString text = "<b>" + title + "</b><ul>";
    for (const std::string& line : lines) text += "<li>" + ReportText(line).toHtmlEscaped() + "</li>";
    column->addWidget(Wrapped(text + "</ul>"));
  };
  column->addWidget(Wrapped(tr("This folder has no trigpoint.yaml. Nothing is written into it until you ask for it.")));
  list(tr("Found"), overview_->found);
  list(tr("Missing"), overview_->missing);
}

void OverviewDesk::ShowVerdict(QVBoxLayout* column) {
  bool matrix = overview_->matrix.empty() && overview_->panoramas.empty();
  for (const Block& block : overview_->verdict) {
    if (const auto* heading = std::get_if<Heading>(&block)) {
      column->addWidget(new QLabel("<b>" + ReportText(heading->text) + "</b>"));
    } else if (const auto* paragraph = std::get_if<Paragraph>(&block)) {
      const QString anchor = Text(paragraph->anchor), words = ReportText(paragraph->text).toHtmlEscaped();
      QLabel* label =
          Wrapped(anchor.contains(':') ? QString("<a href=\"%1\">%2</a>").arg(anchor.toHtmlEscaped(), words) : words);
      if (paragraph->tone != Tone::kPlain) {
        label->setStyleSheet(QString("background: palette(base); border-left: 4px solid %1; padding: 4px 6px;")
                                 .arg(ToneColour(paragraph->tone)));
      }
      connect(label, &QLabel::linkActivated, this, &OverviewDesk::Follow);
      column->addWidget(label);
    } else if (const auto* facts = std::get_if<Facts>(&block)) {
      auto* row = new QWidget;
      auto* tiles = new FlowLayout(row);
      for (const Fact& fact : facts->facts) tiles->addWidget(Tile(fact));
      column->addWidget(row);
      if (!std::exchange(matrix, true)) ShowMatrix(column);
    }
  }
}

void OverviewDesk::Choose(const QString& object, const QString& run) {
  if (object.isEmpty()) return;
  workspace_->Select(object, run);
  emit LookRequested(object);
}

QString OverviewDesk::Elided(const QString& reason) const {
  const QFontMetrics metrics = matrix_->fontMetrics();
  return metrics.elidedText(reason, Qt::ElideRight, kWidestReason * metrics.averageCharWidth());
}

QString OverviewDesk::SigmaText(double sigma_m) const {
  return QString::fromUtf8("\xcf\x83 ") + QString::number(sigma_m / workspace_->metres_per_unit(), 'f', 3);
}

QTableWidgetItem* OverviewDesk::MatrixItem(const ErrorRecord& e) const {
  const double metres = workspace_->metres_per_unit();
  auto* item = new QTableWidgetItem;
  item->setTextAlignment(Qt::AlignCenter);
  item->setToolTip(QString("%1, %2, %3: %4").arg(Text(e.run), Text(e.station), Text(e.panorama), Text(e.status)) +
                   (e.reason.empty() ? "" : "\n" + ReportText(e.reason)));
  QString text, below;
  if (e.Answered()) {
    text = QString::number(*e.error_3d_m / metres, 'f', 3);
    if (e.sigma_e_m && e.sigma_n_m && e.sigma_u_m) {
      const double sigma = std::hypot(*e.sigma_e_m, *e.sigma_n_m, *e.sigma_u_m);
      below = SigmaText(sigma);
    }
    if (e.nees && e.dof > 0) below += (below.isEmpty() ? "" : "  ") + QString::number(*e.nees / e.dof, 'f', 1);
    const ErrorColours colours = ColoursOfError(*e.error_3d_m);
    item->setBackground(colours.background);
    item->setForeground(colours.text);
  } else {
    text = ReportText(StatusName(e.status));
    below = Elided(ReportText(e.reason));
  }
  item->setText(below.isEmpty() ? text : text + "\n" + below);
  return item;
}

QTableWidgetItem* OverviewDesk::AnswerItem(const OverviewAnswer& answer) const {
  const bool located = answer.status == "localized";
  auto* item = new QTableWidgetItem(ReportText(StatusName(answer.status)));
  item->setData(Qt::UserRole + 1, Text("panorama:" + answer.panorama));
  item->setTextAlignment(Qt::AlignCenter);
  const QString sigma = answer.sigma_m ? SigmaText(*answer.sigma_m) : QString();
  const QString below = located ? sigma : Elided(ReportText(answer.reason));
  if (!below.isEmpty()) item->setText(item->text() + "\n" + below);
  item->setToolTip(QString("%1, %2: %3").arg(Text(answer.run), Text(answer.panorama), Text(answer.status)) +
                   (answer.reason.empty() ? "" : "\n" + ReportText(answer.reason)));
  return item;
}

bool OverviewDesk::HasReference() const { return !overview_->matrix.empty(); }

int OverviewDesk::Rows() const {
  return static_cast<int>(HasReference() ? overview_->rows.size() : overview_->panoramas.size());
}

QString OverviewDesk::RowTitle(int row) const {
  const auto at = static_cast<size_t>(row);
  return Text(HasReference() ? overview_->rows[at].title : overview_->panoramas[at]);
}

QString OverviewDesk::RowObject(int row) const {
  const auto at = static_cast<size_t>(row);
  return Text(HasReference() ? overview_->rows[at].object : "panorama:" + overview_->panoramas[at]);
}

// Of the panorama, or else of its station.
QString OverviewDesk::RowExclusion(int row) const {
  const auto at = static_cast<size_t>(row);
  const QString of = ExclusionText(
      *workspace_, "panorama:" + (HasReference() ? overview_->rows[at].panorama : overview_->panoramas[at]), false);
  return of.isEmpty() && HasReference() ? ExclusionText(*workspace_, "station:" + overview_->rows[at].station, false)
                                        : of;
}

void OverviewDesk::ShowRowHeader() {
  for (int row = 0; row < Rows(); ++row) {
    const QString title = RowTitle(row), excluded = RowExclusion(row);
    auto* item = new QTableWidgetItem(excluded.isEmpty() ? title : tr("%1 (excluded)").arg(title));
    if (!excluded.isEmpty()) item->setToolTip(title + ": " + excluded);
    matrix_->setVerticalHeaderItem(row, item);
    for (int column = 0; column < matrix_->columnCount() && !excluded.isEmpty(); ++column) {
      if (QTableWidgetItem* cell = matrix_->item(row, column)) cell->setToolTip(cell->toolTip() + "\n" + excluded);
    }
  }
}

void OverviewDesk::ShowMatrix(QVBoxLayout* column) {
  const QString unit = workspace_->unit();
  column->addWidget(Wrapped(
      HasReference() ? tr("<b>3D error (%1)</b>, %2. Below it 1 sigma of the difference, and NEES per degree of "
                          "freedom (about 1 if the sigmas are right).")
                           .arg(unit, ReportText(overview_->comparison).toHtmlEscaped())
                     : tr("<b>Answers</b>, without a reference to compare them with. Below each the 1 sigma that it "
                          "states, of its largest axis (%1), or why there is none.")
                           .arg(unit)));
  matrix_ = Named(new QTableWidget(Rows(), static_cast<int>(overview_->runs.size())), "overview.matrix",
                  HasReference() ? tr("Errors by station and run") : tr("Answers by panorama and run"));
  matrix_->setEditTriggers(QAbstractItemView::NoEditTriggers);
  matrix_->setSelectionMode(QAbstractItemView::SingleSelection);
  QStringList names;
  for (const std::string& run : overview_->runs) names << Text(run);
  matrix_->setHorizontalHeaderLabels(names);
  FillMatrix();
  ShowRowHeader();
  matrix_->resizeColumnsToContents();
  matrix_->resizeRowsToContents();
  const int height = matrix_->verticalHeader()->length() + matrix_->horizontalHeader()->sizeHint().height() + 4;
  matrix_->setFixedHeight(std::min(height + 14, kHighestMatrix));
  const auto run_of = [this](int at) { return matrix_->horizontalHeaderItem(at)->text(); };
  connect(matrix_, &QTableWidget::currentCellChanged, this, [this, run_of](int row, int at) {
    if (showing_ || row < 0) return;
    // While a button is pressed, the click that follows makes the scene look.
    if (QApplication::mouseButtons() == Qt::NoButton) return Choose(RowObject(row), run_of(at));
    workspace_->Select(RowObject(row), run_of(at));
  });
  connect(matrix_, &QTableWidget::cellClicked, this,
          [this, run_of](int row, int at) { Choose(RowObject(row), run_of(at)); });
  connect(matrix_, &QTableWidget::cellActivated, this, [this] { emit SceneRequested(workspace_->selected()); });
  AskMenuOn(matrix_, workspace_, Qt::UserRole + 1);
  column->addWidget(matrix_);
}

void OverviewDesk::FillMatrix() {
  const auto index = [](const std::vector<std::string>& all, const std::string& name) {
    return static_cast<int>(std::find(all.begin(), all.end(), name) - all.begin());
  };
  for (const ErrorRecord& e : overview_->matrix) {
    const auto& rows = overview_->rows;
    const auto found = std::find_if(rows.begin(), rows.end(), [&](const OverviewRow& r) {
      return r.station == e.station && r.panorama == e.panorama;
    });
    const int row = static_cast<int>(found - rows.begin());
    QTableWidgetItem* item = MatrixItem(e);
    item->setData(Qt::UserRole + 1, RowObject(row));
    matrix_->setItem(row, index(overview_->runs, e.run), item);
  }
  if (HasReference()) return;
  for (const OverviewAnswer& a : overview_->answers) {
    if (!a.variant.empty()) continue;
    matrix_->setItem(index(overview_->panoramas, a.panorama), index(overview_->runs, a.run), AnswerItem(a));
  }
}

QString OverviewDesk::WarningsText(size_t most) const {
  const std::vector<OverviewWarning>& warnings = overview_->warnings;
  QString text = "<b>" + tr("Warnings (%1)").arg(warnings.size()) + "</b><ul>";
  for (size_t i = 0; i < std::min(most, warnings.size()); ++i) {
    const QString words = ReportText(warnings[i].text).toHtmlEscaped(),
                  object = Text(warnings[i].object).toHtmlEscaped();
    text += "<li>" + (object.isEmpty() ? words : QString("<a href=\"%1\">%2</a>").arg(object, words)) + "</li>";
  }
  text += "</ul>";
  if (warnings.size() <= most) return text;
  return text + "<a href=\"do:warnings\">" + tr("Show the other %1").arg(warnings.size() - most) + "</a>";
}

void OverviewDesk::ShowWarnings(QVBoxLayout* column) {
  if (overview_->warnings.empty()) return;
  QLabel* label = Wrapped(WarningsText(kMostWarnings));
  label->setObjectName("overview.warnings");
  label->setStyleSheet(QString("background: palette(base); border-left: 4px solid %1; padding: 4px 6px;")
                           .arg(ToneColour(Tone::kWarning)));
  connect(label, &QLabel::linkActivated, this, [this, label](const QString& anchor) {
    if (anchor != "do:warnings") return Follow(anchor);
    label->setText(WarningsText(overview_->warnings.size()));
  });
  column->addWidget(label);
}

void OverviewDesk::ShowPlan() {
  const PaintedDrawing plan = overview_ ? overview_->plan : PaintedDrawing();
  ShowDrawing(plan_, plan, plan.png.empty() ? tr("Nothing to draw yet.") : tr("plan"));
  if (overview_) plan_->setToolTip(ReportText(overview_->plan_caption));
}

void OverviewDesk::SaveThumbnail() const {
  if (plan_->image().isNull()) return;
  const QString file = ThumbnailOf(workspace_->dir());
  QDir().mkpath(QFileInfo(file).path());
  plan_->image().scaled(kThumbnail_px, kThumbnail_px, Qt::KeepAspectRatio, Qt::SmoothTransformation).save(file);
}

void OverviewDesk::ShowNext() {
  const auto& snapshot = workspace_->snapshot();
  NextStep next;
  if (snapshot && overview_) next = NextOf(*snapshot, workspace_->results(), overview_->has_project_file);
  QString text, button;
  const char* anchor = "";
  switch (next.kind) {
    case NextStep::Kind::kCreate:
      text = tr("Not a project yet.");
      button = tr("&Make it a project (write trigpoint.yaml)");
      anchor = "do:create";
      break;
    case NextStep::Kind::kChecking: text = tr("Checking what is up to date ..."); break;
    case NextStep::Kind::kRunning: text = tr("Running: %1").arg(Text(next.title)); break;
    case NextStep::Kind::kRun:
      text = next.failed > 0 ? tr("Failed results: %1. %2").arg(next.failed).arg(Text(next.reason))
             : next.results == 1
                 ? tr("One result is missing or out of date: %1.").arg(Text(next.title))
                 : tr("%1 results are missing or out of date; %2 is first.").arg(next.results).arg(Text(next.title));
      button = next.failed > 0 ? tr("&Run again what failed") : tr("&Run what is out of date");
      anchor = "do:run";
      break;
    case NextStep::Kind::kReport:
      text = tr("Every result is up to date.");
      button = tr("Open the &report");
      anchor = "do:report";
      break;
    case NextStep::Kind::kNone: break;
  }
  next_text_->setText(text);
  next_->setText(button);
  next_->setProperty("anchor", anchor);
  next_->setVisible(!button.isEmpty());
}

void OverviewDesk::ShowSelected() {
  HighlightSelected(plan_, *workspace_);
  const QString object =
      Text(StationShown(overview_.get(), workspace_->related(), workspace_->selected().toStdString()));
  if (matrix_ == nullptr) return;
  const QString selected = workspace_->selected();
  const auto is_shown = [&](int row) {
    if (!HasReference()) return workspace_->related().count(RowObject(row).toStdString()) > 0;
    return Text("station:" + overview_->rows[static_cast<size_t>(row)].station) == object;
  };
  int best = -1;  // the object itself, else the first that belongs to it
  for (int row = 0; row < matrix_->rowCount(); ++row) {
    if (is_shown(row) && (best < 0 || (RowObject(row) == selected && RowObject(best) != selected))) best = row;
  }
  const auto& runs = overview_->runs;
  const auto chosen = std::find(runs.begin(), runs.end(), workspace_->run().toStdString());
  const int column = chosen == runs.end() ? 0 : static_cast<int>(chosen - runs.begin());
  const int current = matrix_->currentRow();
  const bool exact = best >= 0 && RowObject(best) == selected;
  const bool in_run = chosen == runs.end() || matrix_->currentColumn() == column;
  if (current >= 0 && is_shown(current) && in_run && (!exact || current == best)) return;
  showing_ = true;
  matrix_->setCurrentItem(nullptr);
  if (best >= 0) matrix_->setCurrentCell(best, column);
  showing_ = false;
}

void OverviewDesk::Follow(const QString& anchor) {
  if (anchor == "do:run") {
    emit RunRequested();
  } else if (anchor == "do:create") {
    emit CreateRequested(workspace_->dir());
  } else if (anchor == "do:report") {
    emit ReportRequested();
  } else if (anchor.startsWith("open:")) {
    emit ProjectRequested(anchor.section(':', 1));
  } else if (anchor.contains(':')) {
    Choose(anchor);
  }
}

}  // namespace trigpoint

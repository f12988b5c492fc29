#include "app/desktop/services_dialog.h"

#include <fmt/format.h>

#include <QCheckBox>
#include <QComboBox>
#include <QFormLayout>
#include <QHBoxLayout>
#include <QHeaderView>
#include <QLineEdit>
#include <QPushButton>
#include <QSpinBox>
#include <QTableWidget>
#include <QTimer>
#include <QToolButton>

#include "app/desktop/background.h"
#include "app/desktop/object_table.h"
#include "app/desktop/path_button.h"
#include "app/desktop/polled_progress.h"
#include "app/desktop/widgets.h"
#include "app/pipeline/command_line.h"
#include "datasets/import/run_track.h"
#include "datasets/io/capture_date.h"

namespace trigpoint {

namespace {

constexpr int kLook_ms = 100;    // between two looks at how far it is
constexpr int kWidth_px = 4096;  // of pictures, as `import` loads them
enum Column { kPicked, kService, kPanorama, kTaken, kAway, kHeading, kWide, kLicence, kOwner, kColumns };

}  // namespace

struct ServicesDialog::Query {
  const Service* service = nullptr;
  ServiceOptions options;
  std::string key_file, run, dir;
  double radius_m = 0;
  PanoramaImportOptions import;

  std::unique_ptr<PanoramaProvider> Reach(const Open& open) const {
    ServiceOptions how = options;
    if (open) return open(*service, how);
    how.token = ReadToken(*service, key_file);
    return service->open(how);
  }
  PanoramaImportOptions WithArea() const {
    PanoramaImportOptions all = import;
    all.area = AreaAlongRun(dir, run, radius_m);
    all.near_date = DateOfRun(ReadRun(std::filesystem::path(dir) / "runs" / run, dir));
    all.width = kWidth_px;
    return all;
  }
};

ServicesDialog::ServicesDialog(Workspace* workspace, QWidget* parent, Open open)
    : QDialog(parent), workspace_(workspace), open_(std::move(open)) {
  setObjectName("services");
  setWindowTitle(tr("Panoramas of services"));
  setAttribute(Qt::WA_DeleteOnClose);
  MakeFields();
  MakeTable();
  map_ = new ServicesMap;
  auto* split =
      InSplitter(Qt::Vertical, {map_, table_}, {3000, 2000});  // a ratio: the splitter scales them to its height
  command_ = ReadOnly(Named(new QLineEdit, "services.line", tr("Equivalent command line")));
  status_ = WrappedLabel("services.status", tr("Search lists what a service has along the run; it downloads nothing."));
  auto* buttons = new QHBoxLayout;
  const auto button = [&](const QString& text, const char* name, auto&& done) {
    auto* made = MakeButton(name, text);
    made->setAutoDefault(false);
    connect(made, &QPushButton::clicked, this, done);
    buttons->addWidget(made);
    return made;
  };
  all_ = button(tr("Pick all"), "services.all", [this] {
    for (size_t i = 0; i < found_.size(); ++i) Pick(static_cast<int>(i), true);
  });
  none_ = button(tr("Pick none"), "services.none", [this] {
    for (size_t i = 0; i < found_.size(); ++i) Pick(static_cast<int>(i), false);
  });
  buttons->addStretch();
  search_ = button(tr("Search"), "services.search", [this] { Search(); });
  load_ = button(tr("Download"), "services.load", [this] { Load(); });
  cancel_ = button(tr("Cancel"), "services.cancel", [this] {
    if (work_) work_->cancel.Cancel();
  });
  button(tr("Close"), "services.close", [this] { close(); });
  auto* fields = findChild<QWidget*>("services.fields");
  InColumn({fields, {split, 1}, command_, status_, buttons}, this);
  resize(900, 760);
  timer_ = new QTimer(this);
  timer_->setInterval(kLook_ms);
  connect(timer_, &QTimer::timeout, this, [this] {
    if (work_ && !work_->Text().isEmpty()) status_->setText(work_->Text());
  });
  connect(map_, &ServicesMap::Clicked, this,
          [this](int index) { Pick(index, !found_[static_cast<size_t>(index)].picked); });
  connect(workspace_, &Workspace::Replaced, this, &QDialog::close);
  connect(workspace_, &Workspace::UnitChanged, this, &ServicesDialog::ShowRows);
  ShowState();
}

ServicesDialog::~ServicesDialog() {
  if (work_) work_->cancel.Cancel();
}

void ServicesDialog::MakeFields() {
  auto* fields = new QWidget(this);
  fields->setObjectName("services.fields");
  service_ = new QComboBox;
  for (const Service& service : Services()) service_->addItem(Text(service.name + ": " + service.help));
  run_ = new QComboBox;
  for (const SnapshotRun& run : workspace_->snapshot()->runs) run_->addItem(Text(run.name));
  radius_ = new QSpinBox;
  radius_->setRange(1, 5000);
  radius_->setValue(30);
  radius_->setSuffix(" m");
  const auto edit = [](const QString& hint) {
    auto* made = new QLineEdit;
    made->setPlaceholderText(hint);
    return made;
  };
  since_ = edit(tr("2024, 2024-05 or 2024-05-12"));
  until_ = edit(since_->placeholderText());
  key_file_ = edit("");
  url_ = edit(tr("the public one"));
  permitted_ = new QCheckBox(tr("My agreement with the service permits computing from its pictures"));
  auto* form = new QFormLayout(fields);
  form->setContentsMargins(0, 0, 0, 0);
  const auto row = [&](const QString& label, const std::vector<std::pair<const char*, QWidget*>>& widgets) {
    auto* line = new QHBoxLayout;
    for (const auto& [name, widget] : widgets) {
      widget->setObjectName(name);
      widget->setAccessibleName(label);
      line->addWidget(widget, 1);
    }
    form->addRow(label, line);
    return line;
  };
  row(tr("Service"), {{"services.service", service_}});
  row(tr("Along run, within"), {{"services.run", run_}, {"services.radius", radius_}});
  row(tr("Taken since, until"), {{"services.since", since_}, {"services.until", until_}});
  row(tr("File with the key"), {{"services.key", key_file_}})
      ->addWidget(MakePathButton(key_file_, PathKind::kFile, [this] { return workspace_->dir(); }));
  row(tr("Server"), {{"services.url", url_}});
  row("", {{"services.permitted", permitted_}});
  connect(service_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &ServicesDialog::ShowState);
  connect(run_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, [this] {
    found_.clear();
    track_.clear();
    ShowFound();
  });
  connect(radius_, QOverload<int>::of(&QSpinBox::valueChanged), this, &ServicesDialog::ShowState);
  for (QLineEdit* line : {since_, until_, key_file_, url_}) {
    connect(line, &QLineEdit::textChanged, this, &ServicesDialog::ShowState);
  }
  connect(permitted_, &QCheckBox::toggled, this, &ServicesDialog::ShowState);
}

void ServicesDialog::MakeTable() {
  table_ = Named(new QTableWidget(0, kColumns), "services.table", tr("Panoramas that were found"));
  table_->setHorizontalHeaderLabels({tr("Pick"), tr("Source"), tr("Panorama"), tr("Taken"), tr("Away"), tr("Heading"),
                                     tr("Width"), tr("Licence"), tr("Owner")});
  SetHeaderHelp(table_,
                {tr("Picked panoramas are downloaded"), tr("Service that has the panorama"),
                 tr("Name of the panorama at its service"), tr("Day on which the panorama was taken"),
                 tr("Distance from the run's path, in the unit shown"),
                 tr("Direction of the panorama's centre as the service states it, clockwise from true north (deg)"),
                 tr("Width of the picture at the service (px)"), tr("Licence under which the picture may be used"),
                 tr("Who took the picture")});
  table_->setEditTriggers(QAbstractItemView::NoEditTriggers);
  table_->setSelectionBehavior(QAbstractItemView::SelectRows);
  table_->verticalHeader()->hide();
  table_->verticalHeader()->setDefaultSectionSize(table_->fontMetrics().height() + 8);
  table_->horizontalHeader()->setStretchLastSection(true);
  connect(table_, &QTableWidget::itemChanged, this, [this](QTableWidgetItem* item) {
    if (!filling_ && item->column() == kPicked) Pick(item->row(), item->checkState() == Qt::Checked);
  });
  connect(table_, &QTableWidget::cellActivated, this,
          [this](int row) { Pick(row, !found_[static_cast<size_t>(row)].picked); });
}

ServicesDialog::Query ServicesDialog::Asked() const {
  Query query;
  query.service = &Services()[static_cast<size_t>(service_->currentIndex())];
  query.options.url = url_->text().isEmpty() ? query.service->url : url_->text().toStdString();
  if (!query.service->token_env.empty()) {
    query.key_file = AbsolutePath(workspace_->dir(), key_file_->text()).toStdString();
  }
  query.run = run_->currentText().toStdString();
  query.dir = workspace_->snapshot()->dir.string();
  query.radius_m = radius_->value();
  query.import.since = since_->text().toStdString();
  query.import.until = until_->text().toStdString();
  return query;
}

void ServicesDialog::Begin(const QString& status) {
  work_ = std::make_shared<PolledProgress>();
  status_->setText(status);
  timer_->start();
  ShowState();
}

void ServicesDialog::End(const QString& status) {
  work_.reset();
  timer_->stop();
  status_->setText(status);
  ShowState();
}

void ServicesDialog::Search() {
  if (work_ || run_->count() == 0) return;
  Begin(tr("Searching ..."));
  struct Answer {
    PanoramaImportOptions options;
    std::vector<PanoramaRecord> records;
    std::vector<std::string> warnings;
  };
  InBackground(
      this,
      [work = work_, query = Asked(), open = open_] {
        const std::unique_ptr<PanoramaProvider> provider = query.Reach(open);
        Answer answer;
        answer.options = query.WithArea();
        answer.records = ChoosePanoramas(*provider, answer.options, work->cancel);
        answer.warnings = provider->Warnings();
        return answer;
      },
      [this, service = Asked().service->name](const Attempted<Answer>& answer) {
        const bool well = answer.error.isEmpty();
        if (well) TakeIn(service, answer.value.options.area, answer.value.records);
        QString text =
            well ? tr("%1 has %2 panoramas there.").arg(Text(service)).arg(answer.value.records.size()) : answer.error;
        for (const std::string& warning : answer.value.warnings) text += " " + Text(warning);
        End(text);
        emit Searched(well);
      });
}

// In place of what the same service had before.
void ServicesDialog::TakeIn(const std::string& service, const SearchArea& area, std::vector<PanoramaRecord> records) {
  std::erase_if(found_, [&](const FoundPanorama& f) { return f.service == service; });
  for (PanoramaRecord& record : records) found_.push_back({service, std::move(record), false});
  track_ = area.points;
  std::stable_sort(found_.begin(), found_.end(), [&](const FoundPanorama& a, const FoundPanorama& b) {
    return area.Distance_m(a.record.position) < area.Distance_m(b.record.position);
  });
  ShowFound();
}

void ServicesDialog::ShowFound() {
  ShowRows();
  map_->Show(track_, found_);
  ShowState();
}

void ServicesDialog::ShowRows() {
  filling_ = true;
  map_->SetUnit(workspace_->display_unit());
  SearchArea area;
  area.points = track_;
  table_->setRowCount(static_cast<int>(found_.size()));
  for (int row = 0; row < table_->rowCount(); ++row) {
    const FoundPanorama& f = found_[static_cast<size_t>(row)];
    const PanoramaRecord& r = f.record;
    auto* pick = new QTableWidgetItem;
    pick->setFlags(Qt::ItemIsEnabled | Qt::ItemIsUserCheckable | Qt::ItemIsSelectable);
    pick->setCheckState(f.picked ? Qt::Checked : Qt::Unchecked);
    table_->setItem(row, kPicked, pick);
    const QString texts[] = {Text(f.service),
                             Text(r.id),
                             Text(r.date.substr(0, 10)),
                             workspace_->Length(area.Distance_m(r.position), 0),
                             r.heading_deg ? QString::fromUtf8("%1 deg").arg(*r.heading_deg, 0, 'f', 0) : "-",
                             r.width_px > 0 ? QString("%1 px").arg(r.width_px) : "-",
                             Text(r.licence),
                             Text(r.owner)};
    for (int k = 0; k < kColumns - 1; ++k) table_->setItem(row, k + 1, new QTableWidgetItem(texts[k]));
  }
  table_->resizeColumnsToContents();
  filling_ = false;
}

void ServicesDialog::Pick(int index, bool picked) {
  found_[static_cast<size_t>(index)].picked = picked;
  filling_ = true;
  table_->item(index, kPicked)->setCheckState(picked ? Qt::Checked : Qt::Unchecked);
  filling_ = false;
  map_->Mark(found_);
  ShowState();
}

void ServicesDialog::Load() {
  if (work_) return;
  Query query = Asked();
  for (const FoundPanorama& f : found_) {
    if (f.picked && f.service == query.service->name) query.import.ids.push_back(f.record.id);
  }
  if (query.import.ids.empty()) return;
  Begin(tr("Loading ..."));
  InBackground(
      this,
      [work = work_, query, open = open_] {
        const std::unique_ptr<PanoramaProvider> provider = query.Reach(open);
        return ImportPanoramas(query.dir, *provider, query.WithArea(), *work, work->cancel);
      },
      [this](const Attempted<ImportReport>& report) {
        const bool well = report.error.isEmpty();
        QString text = well ? "" : report.error;
        for (const std::string& line : report.value.lines) text += Text(line) + ". ";
        for (const std::string& warning : report.value.warnings) text += Text(warning) + ". ";
        End(text);
        if (well) workspace_->Reload();
        emit Loaded(well);
      });
}

void ServicesDialog::ShowState() {
  const Query query = Asked();
  const bool needs_key = !query.service->token_env.empty(), needs_permission = !query.service->permission.empty();
  for (QWidget* w : {static_cast<QWidget*>(key_file_), findChild<QWidget*>("services.key_browse")})
    w->setEnabled(needs_key);
  key_file_->setPlaceholderText(needs_key ? tr("empty: the environment variable %1").arg(Text(query.service->token_env))
                                          : tr("none is needed"));
  permitted_->setVisible(needs_permission);
  permitted_->setToolTip(Text(query.service->permission));
  std::string line = fmt::format("trigpoint import {} --from {} --along {} --radius {}", ShellWord(query.dir),
                                 query.service->name, ShellWord(query.run), query.radius_m);
  const auto add = [&](const char* option, const std::string& value) {
    if (!value.empty()) line += std::string(" --") + option + " " + ShellWord(value);
  };
  add("since", query.import.since);
  add("until", query.import.until);
  add("token-file", query.key_file);
  add("url", url_->text().toStdString());
  if (needs_permission && permitted_->isChecked()) line += " --permitted";
  int picked = 0;
  for (const FoundPanorama& f : found_) {
    if (!f.picked || f.service != query.service->name) continue;
    add("id", f.record.id);
    ++picked;
  }
  if (picked == 0) line += " --list";
  command_->setText(Text(line));
  search_->setEnabled(!work_ && run_->count() > 0);
  load_->setEnabled(!work_ && picked > 0 && (!needs_permission || permitted_->isChecked()));
  load_->setText(picked > 0 ? tr("Download %1").arg(picked) : tr("Download"));
  cancel_->setEnabled(work_ != nullptr);
  all_->setEnabled(!found_.empty());
  none_->setEnabled(!found_.empty());
}

}  // namespace trigpoint

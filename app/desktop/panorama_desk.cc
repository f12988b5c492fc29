#include "app/desktop/panorama_desk.h"

#include <QComboBox>
#include <QHeaderView>
#include <QPushButton>
#include <QTableWidget>
#include <algorithm>
#include <cmath>

#include "app/desktop/background.h"
#include "app/desktop/fitted_box.h"
#include "app/desktop/object_table.h"
#include "app/desktop/photo_set_view.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/pictures.h"
#include "app/desktop/widgets.h"

namespace trigpoint {

namespace {

constexpr int kGraphSize = 600;  // px
constexpr int kLongestPanorama = 8192;

// The photos on a ring by where they look, joined where they match.
std::vector<PictureMark> GraphMarks(const PhotoSetView& set) {
  std::vector<PictureMark> marks;
  std::map<std::string, QPointF> places;
  const double middle = kGraphSize / 2.0, radius = 0.4 * kGraphSize;
  // What all names begin with says nothing: IMG_0015.jpg is 15.
  std::string common = set.photos.empty() ? "" : std::filesystem::path(set.photos.front().name).stem().string();
  for (const PlacedPhoto& photo : set.photos) {
    const std::string stem = std::filesystem::path(photo.name).stem().string();
    while (!stem.starts_with(common)) common.pop_back();
  }
  for (size_t i = 0; i < set.photos.size(); ++i) {
    const PlacedPhoto& photo = set.photos[i];
    const double angle =
        photo.placed ? photo.azimuth_rad : 2 * M_PI * static_cast<double>(i) / static_cast<double>(set.photos.size());
    const QPointF at(middle + radius * std::sin(angle), middle - radius * std::cos(angle));
    const std::string name = std::filesystem::path(photo.name).filename().string();
    places[name] = at;
    PictureMark mark;
    mark.kind = PictureMark::Kind::kCircle;
    mark.points << at << QPointF(7, 0);
    mark.colour = photo.placed ? QColor(0, 114, 178) : QColor(213, 94, 0);
    mark.text = Text(std::filesystem::path(name).stem().string().substr(common.size()));
    marks.push_back(mark);
  }
  int most = 1;
  for (const auto& [pair, count] : set.pairs) most = std::max(most, count);
  for (const auto& [pair, count] : set.pairs) {
    const auto a = places.find(std::filesystem::path(pair.first).filename().string());
    const auto b = places.find(std::filesystem::path(pair.second).filename().string());
    if (a == places.end() || b == places.end()) continue;
    PictureMark line;
    line.kind = PictureMark::Kind::kLine;
    line.points << a->second << b->second;
    line.colour = QColor(0, 158, 115, 60 + 195 * count / most);
    marks.insert(marks.begin(), line);
  }
  return marks;
}

}  // namespace

PanoramaDesk::PanoramaDesk(Workspace* workspace, QWidget* parent) : QWidget(parent), workspace_(workspace) {
  set_ = Named(new FittedBox(tr("Panorama or photo set that is shown")), "panorama.set", tr("Panorama or photo set"));
  auto* stitch = MakeButton("panorama.stitch", tr("&Stitch ..."));
  text_ = WrappedLabel("panorama.text");
  photos_ = Named(new QTableWidget(0, 6), "panorama.photos", tr("Photos of the set and their refined centres"));
  photos_->setEditTriggers(QAbstractItemView::NoEditTriggers);
  photos_->setSelectionBehavior(QAbstractItemView::SelectRows);
  photos_->verticalHeader()->setDefaultSectionSize(photos_->fontMetrics().height() + 6);
  panorama_ = Named(new PictureView, "panorama.picture", tr("Panorama"));
  graph_ = Named(new PictureView, "panorama.graph", tr("Which photos match, by where they look"));
  photo_ = Named(new PictureView, "panorama.photo", tr("Photo"));
  auto* top = InRow({set_, {text_, 1}, stitch});
  auto* lower = InSplitter(Qt::Horizontal, {graph_, photos_, photo_});
  auto* split = InSplitter(Qt::Vertical, {panorama_, lower}, {350, 350});
  lower->setSizes({250, 400, 250});
  InColumn({top, {split, 1}}, this);
  connect(set_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &PanoramaDesk::ShowSet);
  connect(set_, QOverload<int>::of(&QComboBox::activated), this, [this] {
    if (!Object().isEmpty()) workspace_->Select(Object());
  });
  AskMenuOn(photos_, workspace_, Qt::UserRole);
  for (QWidget* widget : std::initializer_list<QWidget*>{set_, panorama_, graph_, photo_}) {
    widget->setContextMenuPolicy(Qt::CustomContextMenu);
    connect(widget, &QWidget::customContextMenuRequested, this,
            [this, widget](const QPoint& at) { workspace_->AskMenu(Object(), widget->mapToGlobal(at)); });
  }
  connect(workspace_, &Workspace::Selected, this, &PanoramaDesk::ShowSelected);
  connect(stitch, &QPushButton::clicked, this, &PanoramaDesk::StitchRequested);
  connect(photos_, &QTableWidget::currentCellChanged, this, &PanoramaDesk::ShowPhoto);
  connect(workspace_, &Workspace::Replaced, this, &PanoramaDesk::Clear);
  connect(workspace_, &Workspace::Opened, this, &PanoramaDesk::Refresh);
  connect(workspace_, &Workspace::Closed, this, &PanoramaDesk::Refresh);
  connect(workspace_, &Workspace::UnitChanged, this, &PanoramaDesk::ShowSet);
  Clear();
}

void PanoramaDesk::Refresh() {
  const QString before = set_->currentText();
  {
    const QSignalBlocker block(set_);
    set_->clear();
    if (const auto& snapshot = workspace_->snapshot()) {
      for (int pass = 0; pass < 2; ++pass) {  // photo sets first
        for (size_t i = 0; i < snapshot->references.size(); ++i) {
          const SnapshotReference& r = snapshot->references[i];
          if ((r.kind == "photo set") != (pass == 0)) continue;
          set_->addItem(Text(r.name + " (" + r.kind + ")"), static_cast<int>(i));
        }
      }
    }
    set_->setCurrentIndex(std::max(0, set_->findText(before)));
  }
  ShowSet();
}

QString PanoramaDesk::Object() const {
  const auto& snapshot = workspace_->snapshot();
  if (!snapshot || set_->currentIndex() < 0) return "";
  return Text("panorama:" + snapshot->references[static_cast<size_t>(set_->currentData().toInt())].name);
}

void PanoramaDesk::ShowSelected() {
  const auto& snapshot = workspace_->snapshot();
  if (!snapshot) return;
  const auto belongs = [&](int i) {
    const auto index = static_cast<size_t>(set_->itemData(i).toInt());
    return workspace_->related().count("panorama:" + snapshot->references[index].name) > 0;
  };
  for (int i = 0; i < set_->count(); ++i) {  // itself before another one of its station
    const auto index = static_cast<size_t>(set_->itemData(i).toInt());
    const std::string object = "panorama:" + snapshot->references[index].name;
    if (object == workspace_->selected().toStdString()) return set_->setCurrentIndex(i);
  }
  if (set_->currentIndex() >= 0 && belongs(set_->currentIndex())) return;
  for (int i = 0; i < set_->count(); ++i) {
    if (belongs(i)) return set_->setCurrentIndex(i);
  }
}

void PanoramaDesk::ShowPhoto(int row) {
  const auto& snapshot = workspace_->snapshot();
  const auto index = static_cast<size_t>(set_->currentData().toInt());
  if (!snapshot || row < 0 || index >= snapshot->references.size()) return;
  const auto& files = snapshot->references[index].files;
  if (static_cast<size_t>(row) >= files.size()) return;
  InBackground(
      this, [file = files[static_cast<size_t>(row)]] { return LoadAnyPicture(file, 2048); },
      [this, row, generation = generation_,
       name = Text(files[static_cast<size_t>(row)].filename().string())](const Attempted<QImage>& image) {
        if (generation != generation_ || photos_->currentRow() != row) return;
        photo_->SetPicture(image.value, image.error.isEmpty() ? name : image.error);
      });
}

void PanoramaDesk::Clear() {
  ++generation_;
  photos_->setRowCount(0);
  graph_->SetMarks({});
  graph_->SetPicture({}, tr("Which photos of a set match is drawn here."));
  photo_->SetPicture({}, tr("Select a photo in the table."));
  panorama_->SetPicture(
      {}, workspace_->snapshot()
              ? tr("No panorama yet: put pictures into panoramas/ or photos/, and read the project again.")
              : tr("Open a project (Ctrl+O) to see its panoramas and photo sets."));
  text_->clear();
}

void PanoramaDesk::showEvent(QShowEvent* event) {
  QWidget::showEvent(event);
  if (stale_) ShowSet();
}

void PanoramaDesk::ShowSet() {
  stale_ = !isVisible();
  if (stale_ && workspace_->snapshot()) return;
  Clear();
  const auto& snapshot = workspace_->snapshot();
  if (!snapshot || set_->currentIndex() < 0) return;
  panorama_->SetPicture({}, tr("reading %1 ...").arg(set_->currentText()));
  const SnapshotReference reference = snapshot->references[static_cast<size_t>(set_->currentData().toInt())];
  const bool is_set = reference.kind == "photo set";
  std::vector<std::string> names;
  for (const auto& file : reference.files) names.push_back(file.string());
  const std::filesystem::path result = snapshot->dir / "results" / "stitch" / reference.name;
  struct Loaded {
    PhotoSetView set;
    QImage picture;
  };
  InBackground(
      this,
      [is_set, names, result] {
        Loaded loaded;
        if (is_set) loaded.set = LoadPhotoSet(result, names);
        const std::filesystem::path file = is_set ? loaded.set.panorama : std::filesystem::path(names.front());
        if (!file.empty()) loaded.picture = LoadAnyPicture(file, kLongestPanorama);
        return loaded;
      },
      [this, reference, is_set, shown = set_->currentText(),
       generation = generation_](const Attempted<Loaded>& loaded) {
        if (generation != generation_) return;
        const PhotoSetView& set = loaded.value.set;
        panorama_->SetPicture(loaded.value.picture, !loaded.error.isEmpty() ? loaded.error
                                                    : loaded.value.picture.isNull()
                                                        ? tr("Not stitched yet: press Stitch.")
                                                        : shown);
        QStringList facts{tr("%1 photos").arg(reference.files.size())};
        if (set.closure_deg) facts << tr("closure error %1 deg").arg(*set.closure_deg, 0, 'f', 3);
        if (set.covered_share) facts << tr("%1 % of the sphere covered").arg(100 * *set.covered_share, 0, 'f', 0);
        if (set.parallax_median_px) facts << tr("median parallax %1 px").arg(*set.parallax_median_px, 0, 'f', 1);
        for (const std::string& problem : set.problems) facts << Text(problem);
        text_->setText(is_set ? facts.join(", ") : Text(reference.station));
        QImage paper(kGraphSize, kGraphSize, QImage::Format_RGB32);
        paper.fill(Qt::white);
        graph_->SetPicture(is_set ? paper : QImage(), is_set ? tr("pairs, by direction") : tr("This is no photo set."));
        graph_->SetMarks(is_set ? GraphMarks(set) : std::vector<PictureMark>());
        ShowPhotos(set);
      });
}

void PanoramaDesk::ShowPhotos(const PhotoSetView& set) {
  const QString unit = workspace_->unit();
  photos_->setHorizontalHeaderLabels({tr("photo"), tr("right (%1)").arg(unit), tr("down (%1)").arg(unit),
                                      tr("forward (%1)").arg(unit), tr("1 sigma (%1)").arg(unit),
                                      tr("focal length (px)")});
  SetHeaderHelp(
      photos_, {tr("file of the photo"), tr("centre of the photo to the right of the panorama's centre (%1)").arg(unit),
                tr("centre of the photo below the panorama's centre (%1)").arg(unit),
                tr("centre of the photo in front of the panorama's centre (%1)").arg(unit),
                tr("1 sigma of the photo's centre relative to the panorama's, the largest axis (%1)").arg(unit),
                tr("focal length as estimated (px)")});
  const QString object = Object();
  photos_->setRowCount(0);
  for (const PlacedPhoto& photo : set.photos) {
    const int row = photos_->rowCount();
    photos_->insertRow(row);
    const auto number = [&](double metres) {
      return photo.placed ? QString::number(metres / workspace_->metres_per_unit(), 'f', 4) : QString();
    };
    const double sigma = std::max({photo.sigma_x, photo.sigma_y, photo.sigma_z});
    const QStringList cells{Text(std::filesystem::path(photo.name).filename().string()),
                            number(photo.x),
                            number(photo.y),
                            number(photo.z),
                            number(sigma),
                            photo.placed ? QString::number(photo.focal_px, 'f', 1) : tr("not placed")};
    for (int c = 0; c < cells.size(); ++c) {
      auto* item = new QTableWidgetItem(cells[c]);
      item->setData(Qt::UserRole, object);
      photos_->setItem(row, c, item);
    }
  }
  photos_->resizeColumnsToContents();
}

}  // namespace trigpoint

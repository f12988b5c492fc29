// The images desk's panorama: all of it or one of the rectilinear views that localize matches, and its matches.
#include <QCheckBox>
#include <QComboBox>
#include <QLabel>
#include <algorithm>
#include <cmath>
#include <map>

#include "app/desktop/background.h"
#include "app/desktop/images_desk.h"
#include "app/desktop/inspector.h"
#include "app/desktop/match_lines.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/pictures.h"
#include "app/pipeline/drawn_views.h"
#include "calib/base/error.h"
#include "calib/geo/geodetic.h"

namespace trigpoint {

namespace {

constexpr size_t kMostLines = 250;  // between the pictures; more cover them
constexpr int kNumberEvery = 20;    // of the matches one in so many has its number in both pictures
constexpr double kSameFeature_px = 0.5;
constexpr const char* kSet = "photo set";

struct LoadedReference {
  QImage picture;  // none of a set
  std::vector<View> views;
};

LoadedReference Load(const Project& project, const SnapshotReference& reference) {
  const std::filesystem::path file = reference.files.empty() ? std::filesystem::path() : reference.files.front();
  LoadedReference loaded;
  if (reference.kind == kSet) return loaded;
  if (reference.kind != "panorama") {
    loaded.picture = LoadAnyPicture(file, 0);
    return loaded;
  }
  loaded.picture = LoadPanoramaPicture(file);
  try {
    const ViewOptions options = ViewOptionsOf(project);
    loaded.views = PanoramaViews(reference.name, loaded.picture.width(), options).views;
  } catch (const OptionError&) {  // said when the project was opened; all of the panorama can be seen
  }
  return loaded;
}

QString TitleOf(const QString& reference, int number, const View& view) {
  const Eigen::Vector3d axis = view.rig_from_view.rotation * Eigen::Vector3d::UnitZ();
  const double yaw = std::fmod(std::atan2(axis.x(), axis.z()) / kDegToRad + 360.05, 360) - 0.05;  // as it is named
  const double pitch = std::asin(std::clamp(-axis.y(), -1.0, 1.0)) / kDegToRad;
  const double fov = 2 * std::atan(0.5 * view.camera.width() / view.camera.params()[0]) / kDegToRad;
  const auto degrees = [](double value) {
    return QString::number(std::abs(value) < 0.05 ? 0 : value, 'f', 1) + QChar(0xb0);
  };
  return ImagesDesk::tr("%1, view %2: yaw %3, pitch %4, field of view %5")
      .arg(reference, QString::number(number), degrees(yaw), degrees(pitch), degrees(fov));
}

}  // namespace

void ImagesDesk::ShowReference() {
  const int generation = ++reference_generation_;
  ++view_generation_;
  reference_picture_ = {};
  view_shown_ = -1;
  right_->SetMarks({});
  DropMatches();
  const auto& snapshot = workspace_->snapshot();
  const int index = reference_->currentIndex();
  if (!snapshot || index < 0 || index >= static_cast<int>(snapshot->references.size())) {
    views_.clear();
    photos_.clear();
    right_->SetPicture({}, WhyEmpty(tr("This project has no panorama. Put panoramas into the folder panoramas, or "
                                       "choose File, Panoramas of services to load some.")));
    return;
  }
  Redraw();
  if (stale_) return;
  InBackground(
      this, [snapshot, index] { return Load(*snapshot->project, snapshot->references[static_cast<size_t>(index)]); },
      [this, generation, snapshot, index](const Attempted<LoadedReference>& loaded) {
        if (generation != reference_generation_) return;
        reference_picture_ = loaded.value.picture;
        views_ = loaded.value.views;
        const SnapshotReference& reference = snapshot->references[static_cast<size_t>(index)];
        const bool set_before = !photos_.empty();
        photos_ = reference.kind == kSet ? reference.files : std::vector<std::filesystem::path>();
        {
          const QSignalBlocker block(view_);
          const int chosen = photos_.empty() && !set_before ? view_->currentIndex() : 0;
          view_->clear();
          if (photos_.empty()) view_->addItem(tr("whole"));
          for (size_t k = 0; k < views_.size(); ++k) view_->addItem(tr("view %1").arg(k + 1));
          for (const auto& photo : photos_) view_->addItem(QString::fromStdString(photo.filename().string()));
          view_->setCurrentIndex(chosen < view_->count() ? chosen : 0);  // the same one of the next panorama
          view_->setEnabled(view_->count() > 1);
        }
        if (loaded.error.isEmpty()) return ShowView();
        view_shown_ = -1;
        right_->SetPicture({}, loaded.error);
      });
}

void ImagesDesk::ShowPart(int part, const QImage& picture, const QString& title) {
  view_shown_ = part;
  following_ = true;  // the image stays where it is
  right_->SetPicture(picture, title);
  following_ = false;
  PlacePanes();
  Redraw();
  Follow(left_, right_);
}

void ImagesDesk::ShowPhoto(int index) {
  const int generation = ++view_generation_;
  if (index < 0 || index >= static_cast<int>(photos_.size())) return;
  const std::filesystem::path photo = photos_[static_cast<size_t>(index)];
  InBackground(
      this, [photo] { return LoadAnyPicture(photo, 0); },
      [this, generation, title = reference_->currentText() + ", " + view_->itemText(index),
       index](const Attempted<QImage>& loaded) {
        if (generation != view_generation_) return;
        reference_picture_ = loaded.value;
        ShowPart(index, loaded.value, loaded.error.isEmpty() ? title : loaded.error);
      });
}

void ImagesDesk::ShowMatchedPhoto() {
  std::map<std::string, std::pair<int, int>> count;  // inliers, all
  for (const InspectedMatch& match : *matches_) {
    count[match.view].first += match.inlier ? 1 : 0;
    ++count[match.view].second;
  }
  const auto most =
      std::max_element(count.begin(), count.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  if (most != count.end()) view_->setCurrentText(QString::fromStdString(most->first));
}

void ImagesDesk::ShowView() {
  if (!photos_.empty()) return ShowPhoto(view_->currentIndex());
  const int generation = ++view_generation_;
  if (reference_picture_.isNull()) return;
  const QString name = reference_->currentText();
  const int index = view_->currentIndex() - 1;
  if (index < 0) return ShowPart(-1, reference_picture_, name);
  const View& view = views_[static_cast<size_t>(index)];
  InBackground(
      this, [whole = reference_picture_, view] { return CutView(whole, view); },
      [this, generation, index, title = TitleOf(name, index + 1, view)](const Attempted<QImage>& cut) {
        if (generation != view_generation_) return;
        ShowPart(index, cut.value, cut.error.isEmpty() ? title : cut.error);
      });
}

// Where a match is seen in the panorama; nothing if that is outside the view or photo that is shown.
std::optional<QPointF> ImagesDesk::InShownView(const InspectedMatch& match) const {
  const Eigen::Vector2d& of_panorama = match.panorama;
  if (reference_picture_.isNull()) return std::nullopt;  // the next panorama is being read
  if (!photos_.empty()) {
    const bool shown = view_shown_ >= 0 && photos_[static_cast<size_t>(view_shown_)].filename() == match.view;
    return shown ? std::optional(QPointF(of_panorama.x(), of_panorama.y())) : std::nullopt;
  }
  if (view_shown_ < 0) return QPointF(of_panorama.x(), of_panorama.y());
  const View& view = views_[static_cast<size_t>(view_shown_)];
  const Camera sphere = Camera::Equirectangular(reference_picture_.width(), reference_picture_.height());
  const auto ray = sphere.Unproject(of_panorama);
  if (!ray) return std::nullopt;
  const auto pixel = view.camera.Project(view.rig_from_view.rotation.conjugate() * *ray);
  if (!pixel || !view.camera.Contains(*pixel)) return std::nullopt;
  return QPointF(pixel->x(), pixel->y());
}

void ImagesDesk::DropMatches() {
  ++match_generation_;
  const bool said = matching_ || matches_ != nullptr;
  matching_ = false;
  matches_.reset();
  if (said) SayImage();
}

void ImagesDesk::ShowMatches() {
  if (!workspace_->snapshot() || image().isEmpty() || reference_->currentText().isEmpty()) return;
  const int generation = ++match_generation_;
  matching_ = true;
  status_->setText(tr("Matching ..."));
  const std::shared_ptr<SharedInspector> inspector = workspace_->InspectorOf(run().toStdString());
  InBackground(
      this,
      [inspector, file = image().toStdString(), panorama = reference_->currentText().toStdString()] {
        const std::lock_guard guard(inspector->mutex);
        return std::shared_ptr<const std::vector<InspectedMatch>>(
            std::make_shared<std::vector<InspectedMatch>>(inspector->Matches(file, panorama)));
      },
      [this, generation](const Attempted<std::shared_ptr<const std::vector<InspectedMatch>>>& matches) {
        if (generation != match_generation_) return;  // of another image or panorama than is shown
        matching_ = false;
        if (!matches.value) {
          status_->setText(matches.error);
          return;
        }
        matches_ = matches.value;
        const auto inliers = std::count_if(matches_->begin(), matches_->end(), [](const auto& m) { return m.inlier; });
        const bool judged = std::any_of(matches_->begin(), matches_->end(),
                                        [](const InspectedMatch& m) { return !std::isnan(m.error_px); });
        status_->setText(judged || matches_->empty()
                             ? tr("%1 matches, %2 of them within 3 px of their epipolar lines")
                                   .arg(matches_->size())
                                   .arg(static_cast<int>(inliers))
                             : tr("%1 matches; the run does not answer %2, so that they cannot be judged")
                                   .arg(matches_->size())
                                   .arg(reference_->currentText()));
        if (!photos_.empty()) ShowMatchedPhoto();
        Redraw();
      });
}

void ImagesDesk::AddMatches(std::vector<PictureMark>* left, std::vector<PictureMark>* right) {
  const auto point_at = [this](const Eigen::Vector2d& pixel) -> QString {
    if (!inspected_) return "";
    for (const InspectedPoint& point : inspected_->points) {
      if ((point.seen - pixel).norm() < kSameFeature_px) return "point:" + run() + "/" + QString::number(point.id);
    }
    return "";
  };
  std::vector<MatchPair> pairs;
  int number = 0;
  for (size_t i = 0; matches_ && i < matches_->size(); ++i) {
    const InspectedMatch& match = (*matches_)[i];
    if (!(match.inlier ? inliers_ : outliers_)->isChecked()) continue;
    ++number;
    PictureMark mark;
    mark.layer = match.inlier ? "inliers" : "outliers";
    mark.kind = PictureMark::Kind::kCircle;
    mark.colour = match.inlier ? QColor(240, 228, 66) : QColor(204, 121, 167);
    if (number % kNumberEvery == 1) mark.text = QString::number(number);  // the same in both pictures
    const QPointF here(match.image.x(), match.image.y());
    const std::optional<QPointF> there = InShownView(match);
    mark.points << here << QPointF(3, 0);
    left->push_back(mark);
    if (!there) continue;
    mark.points.clear();
    mark.points << *there << QPointF(3, 0);
    mark.object = point_at(match.image);
    right->push_back(mark);
    QColor faint = mark.colour;
    faint.setAlpha(140);
    pairs.push_back({here, *there, faint});
  }
  const size_t step = pairs.size() / kMostLines + 1;
  std::vector<MatchPair> drawn;
  for (size_t i = 0; i < pairs.size(); i += step) drawn.push_back(pairs[i]);
  lines_->SetPairs(std::move(drawn));
}

}  // namespace trigpoint

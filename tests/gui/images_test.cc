// The images desk: panes as there is room, matches with lines, linked zoom, a panorama's views, the images of a tag in
// turn, thumbnails, marks that are moved and removed.
#include <gmock/gmock.h>

#include <QAction>
#include <QCheckBox>
#include <QComboBox>
#include <QLabel>
#include <QListWidget>
#include <QMenu>
#include <QSignalSpy>
#include <QSplitter>
#include <QThreadPool>

#include "app/desktop/images_desk.h"
#include "app/desktop/inspector.h"
#include "app/desktop/mark_history.h"
#include "app/desktop/match_lines.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/tag_images.h"
#include "datasets/colmap/database.h"
#include "datasets/colmap/model.h"
#include "datasets/io/text.h"
#include "datasets/io/views.h"
#include "eval/errors/results.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

class ImagesTest : public ResultsWindowTest {
 protected:
  void SetUp() override {
    ResultsWindowTest::SetUp();
    window_->ShowDesk("images");
    images_ = window_->images();
  }
  void Show(const QString& object) {
    ASSERT_TRUE(images_->ShowObject(object));
    ASSERT_TRUE(WaitFor([&] { return !images_->left()->image().isNull() && images_->left()->marks().size() > 2; }));
    images_->left()->Fit();
  }
  void TearDown() override {
    window_.reset();
    QThreadPool::globalInstance()->waitForDone();  // what was being written
    QFile::remove(Path("control_observations.csv"));
  }
  // The mark of a point in the image that is shown; null: none.
  const PictureMark* Mark(const QString& point) const {
    for (const PictureMark& mark : images_->left()->marks()) {
      if (mark.object == "mark:" + point) return &mark;
    }
    return nullptr;
  }
  void SetMark(const QPointF& at) {
    PictureView* view = images_->left();
    Click(window_.get(), "images.mark");
    QTest::mouseClick(view, Qt::LeftButton, {}, view->WidgetAt(at).toPoint());
  }
  void Drag(const QPointF& from_pixel, const QPointF& to_pixel) {
    PictureView* view = images_->left();
    trigpoint::Drag(view, view->WidgetAt(from_pixel).toPoint(), view->WidgetAt(to_pixel).toPoint());
  }
  // The rows of the file without the header.
  std::string Rows() const {
    const std::string text = Marks();
    const size_t header = text.find("point,image,u,v");
    return header == std::string::npos ? "" : text.substr(text.find('\n', header) + 1);
  }
  std::string Marks() const {
    const QString file = Path("control_observations.csv");
    return QFile::exists(file) ? ReadTextFile(file.toStdString()) : "";
  }

  ImagesDesk* images_ = nullptr;
};

TEST_F(ImagesTest, PanesStandBesideOrBelowEachOtherAsThereIsRoom) {
  ASSERT_TRUE(WaitFor([&] { return !images_->left()->image().isNull() && !images_->right()->image().isNull(); }));
  const auto way = [&] { return qobject_cast<QSplitter*>(images_->left()->parentWidget())->orientation(); };
  window_->resize(1600, 640);
  EXPECT_TRUE(WaitFor([&] { return way() == Qt::Horizontal; }));
  Screenshot(window_.get(), "images_wide");
  window_->resize(1024, 980);
  EXPECT_TRUE(WaitFor([&] { return way() == Qt::Vertical; }));
  Screenshot(window_.get(), "images_high");
}

TEST_F(ImagesTest, TheImagesOfATagComeInTurnTheWorstResidualFirst) {
  // Tag 1 is seen in the images 6 and 9; the survey fits the first badly.
  WriteFileAtomically(Path("results/survey/residuals.csv").toStdString(),
                      "# trigpoint residuals 1\nrun,timestamp,image,camera,tag_id,status,rms_px\n"
                      "run1,1003,images/000006.jpg,cam0,1,used,0.9\nrun1,1004.5,images/000009.jpg,cam0,1,used,0.1\n");
  const Project& project = *window_->workspace()->snapshot()->project;
  const std::vector<TagImage> worst = ImagesOfTag(project, 1, TagImageOrder::kWorstResidual);
  ASSERT_EQ(worst.size(), 2u);
  EXPECT_EQ(worst[0].image, "run1/images/000006.jpg");
  EXPECT_EQ(*worst[0].rms_px, 0.9);
  EXPECT_GT(ImagesOfTag(project, 1, TagImageOrder::kLargest)[0].side_px, worst[0].side_px - 1e-9);
  window_->workspace()->Select("station:S1");
  auto* order = Child<QComboBox>(images_, "images.order");
  order->setCurrentIndex(order->findText("worst residual first"));
  const auto next = [&](const char* image) {
    Click(window_.get(), "images.next");
    return WaitFor([&] { return images_->image() == image; });
  };
  EXPECT_TRUE(next("images/000006.jpg"));
  EXPECT_EQ(window_->workspace()->selected(), "detection:run1/images/000006.jpg#1");
  EXPECT_TRUE(WaitFor([&] { return images_->left()->scale() > 3; }));  // on the tag
  EXPECT_TRUE(next("images/000009.jpg"));
  EXPECT_TRUE(next("images/000006.jpg"));  // round
  QDir(Path("results/survey")).removeRecursively();
}

TEST_F(ImagesTest, WhichImageOfATagIsShownStaysWhileTheMouseMoves) {
  window_->workspace()->Select("station:S1");
  Click(window_.get(), "images.next");
  auto* turn = Child<QLabel>(images_, "images.turn");
  ASSERT_TRUE(WaitFor([&] { return turn->text().startsWith("tag 1: 1 of 2"); }));
  emit images_->left()->Hovered({20, 30});
  EXPECT_TRUE(turn->text().startsWith("tag 1: 1 of 2"));
  window_->workspace()->Select("station:S2");
  EXPECT_EQ(turn->text(), "");
}

TEST_F(ImagesTest, TheImageThatIsMarkedIsSelectedByAClick) {
  Show("image:run1/images/000006.jpg");
  window_->workspace()->Select("detection:run1/images/000006.jpg#1");
  ClickRow(Child<QListWidget>(images_, "images.list"), 6);
  EXPECT_EQ(window_->workspace()->selected(), "image:run1/images/000006.jpg");
}

// A part that is looked at is as large as its view has room for, and stays in its middle when the view changes.
TEST_F(ImagesTest, ATagIsNearInASmallViewAndStaysSo) {
  PictureView view;
  QImage picture(1280, 800, QImage::Format_RGB32);
  picture.fill(Qt::black);
  view.SetPicture(picture, "");
  view.resize(700, 700);
  view.show();
  const QRectF tag(900, 300, 80, 60);
  view.LookAt(tag);
  const auto seen = [&] { return QRectF(view.WidgetAt(tag.topLeft()), view.WidgetAt(tag.bottomRight())); };
  for (const auto& [size, side] :
       {std::pair(QSize(700, 700), 280), {{700, 400}, 240}, {{500, 250}, 200}, {{160, 120}, 96}, {{900, 800}, 320}}) {
    view.resize(size);
    ASSERT_TRUE(WaitFor([&] { return view.size() == size; }));
    EXPECT_NEAR(seen().width(), side, 1e-6) << size.width();
    EXPECT_LT((seen().center() - QPointF(0.5 * size.width(), 0.5 * size.height())).manhattanLength(), 1e-6);
  }
  // What was moved by hand stays where it is, and nothing is enlarged beyond use.
  QTest::keyClick(&view, Qt::Key_Minus);
  const double scale = view.scale();
  view.resize(700, 700);
  ASSERT_TRUE(WaitFor([&] { return view.width() == 700; }));
  EXPECT_EQ(view.scale(), scale);
  view.LookAt(QRectF(10, 10, 4, 4));
  EXPECT_EQ(view.scale(), 6);
}

TEST_F(ImagesTest, AMarkAndItsUndoLetWhatIsOutOfDateBeCheckedAgain) {
  QSignalSpy checked(window_->workspace(), &Workspace::ResultsChanged);
  Child<QComboBox>(images_, "images.point")->setCurrentText("corner");
  Show("image:run1/images/000004.jpg");
  Click(window_.get(), "images.mark");
  QTest::mouseClick(images_->left(), Qt::LeftButton, {}, images_->left()->WidgetAt({60, 40}).toPoint());
  ASSERT_TRUE(WaitFor([&] { return QFile::exists(Path("control_observations.csv")); }));
  EXPECT_TRUE(WaitFor([&] { return checked.count() > 0; }));
  const auto before = checked.count();
  images_->Undo();
  EXPECT_TRUE(WaitFor([&] { return !QFile::exists(Path("control_observations.csv")); }));
  EXPECT_TRUE(WaitFor([&] { return checked.count() > before; }));
}

TEST_F(ImagesTest, MarksAreSeenAtOnceMovedAndRemoved) {
  auto* point = Child<QComboBox>(images_, "images.point");
  point->setCurrentText("corner");
  Show("image:run1/images/000004.jpg");
  PictureView* view = images_->left();
  Click(window_.get(), "images.mark");
  QTest::mouseClick(view, Qt::LeftButton, {}, view->WidgetAt({60, 40}).toPoint());
  ASSERT_NE(Mark("corner"), nullptr);  // before any file is written
  EXPECT_NEAR(Mark("corner")->points[0].x(), 60, 2);
  ASSERT_TRUE(WaitFor([&] { return Marks().find("corner") != std::string::npos; }));
  Screenshot(window_.get(), "images_mark");
  // Dragged to another place, and kept.
  const std::string written = Marks();
  Drag(Mark("corner")->points[0], {90, 70});
  ASSERT_TRUE(WaitFor([&] { return Mark("corner") != nullptr && std::abs(Mark("corner")->points[0].x() - 90) < 3; }));
  EXPECT_NEAR(Mark("corner")->points[0].y(), 70, 3);
  EXPECT_TRUE(WaitFor([&] { return Marks() != written && Marks().find("corner") != std::string::npos; }));
  // It is of this image alone, and goes by the button.
  Show("image:run1/images/000005.jpg");
  EXPECT_TRUE(WaitFor([&] { return Mark("corner") == nullptr; }));
  Show("image:run1/images/000004.jpg");
  ASSERT_TRUE(WaitFor([&] { return Mark("corner") != nullptr; }));
  Click(window_.get(), "images.remove");
  EXPECT_EQ(Mark("corner"), nullptr);
  EXPECT_TRUE(WaitFor([&] { return Marks().find("corner") == std::string::npos; }));
}

// Set, moved, removed: each is taken back and made again, in the file too, with the image that it is of.
TEST_F(ImagesTest, MarksAreUndoneAndMadeAgain) {
  auto* undo = Child<QAction>(window_.get(), "edit.undo");
  auto* redo = Child<QAction>(window_.get(), "edit.redo");
  const auto says = [](const QAction* action) { return action->text().remove('&').toStdString(); };
  EXPECT_FALSE(undo->isEnabled());
  Show("image:run1/images/000004.jpg");
  Child<QComboBox>(images_, "images.point")->setCurrentText("corner");
  SetMark({60, 40});
  EXPECT_EQ(says(undo), "Undo: mark corner in run1/images/000004.jpg");
  ASSERT_TRUE(WaitFor([&] { return !Rows().empty(); }));
  const std::string set = Rows();
  Drag(Mark("corner")->points[0], {90, 70});
  EXPECT_EQ(says(undo), "Undo: move the mark of corner in run1/images/000004.jpg");
  ASSERT_TRUE(WaitFor([&] { return Rows() != set; }));
  const std::string moved = Rows();
  Click(window_.get(), "images.remove");
  EXPECT_EQ(says(undo), "Undo: remove the mark of corner in run1/images/000004.jpg");
  ASSERT_TRUE(WaitFor([&] { return Rows().empty(); }));
  // From another image, by the keys.
  Show("image:run1/images/000007.jpg");
  const auto press = [&](Qt::Key key, Qt::KeyboardModifiers modifiers) {
    images_->left()->setFocus();
    QTest::keyClick(images_->left(), key, modifiers);
  };
  press(Qt::Key_Z, Qt::ControlModifier);
  EXPECT_EQ(images_->image(), "images/000004.jpg");
  EXPECT_EQ(says(redo), "Redo: remove the mark of corner in run1/images/000004.jpg");
  ASSERT_TRUE(WaitFor([&] { return Rows() == moved; })) << Rows();
  press(Qt::Key_Z, Qt::ControlModifier);
  ASSERT_TRUE(WaitFor([&] { return Rows() == set; })) << Rows();
  press(Qt::Key_Z, Qt::ControlModifier);
  ASSERT_TRUE(WaitFor([&] { return Rows().empty(); })) << Rows();
  EXPECT_FALSE(undo->isEnabled());
  EXPECT_EQ(Mark("corner"), nullptr);
  press(Qt::Key_Z, Qt::ControlModifier | Qt::ShiftModifier);
  ASSERT_TRUE(WaitFor([&] { return Rows() == set; })) << Rows();
  press(Qt::Key_Y, Qt::ControlModifier);
  ASSERT_TRUE(WaitFor([&] { return Rows() == moved; })) << Rows();
  EXPECT_TRUE(WaitFor([&] { return Mark("corner") != nullptr && std::abs(Mark("corner")->points[0].x() - 90) < 3; }));
  redo->trigger();
  ASSERT_TRUE(WaitFor([&] { return Rows().empty(); })) << Rows();
  EXPECT_FALSE(redo->isEnabled());
  window_->ShowDesk("tables");  // no decision was taken
  EXPECT_FALSE(undo->isEnabled());
}

// A mark that was not saved leaves nothing to be undone, and one that comes back has the sigma that it had.
TEST_F(ImagesTest, WhatIsUndoneIsWhatTheFileHad) {
  WriteFileAtomically(Path("control_observations.csv").toStdString(),
                      "point,image,u,v,sigma_px\nmast,runs/run1/images/000004.jpg,60.000,40.000,2.500\n");
  window_->workspace()->Reload();
  auto* undo = Child<QAction>(window_.get(), "edit.undo");
  Child<QComboBox>(images_, "images.point")->setCurrentText("mast");
  Show("image:run1/images/000004.jpg");
  ASSERT_TRUE(WaitFor([&] { return Mark("mast") != nullptr; }));
  const std::string rows = Rows();
  Click(window_.get(), "images.remove");
  ASSERT_TRUE(WaitFor([&] { return Rows().empty(); }));
  undo->trigger();
  EXPECT_TRUE(WaitFor([&] { return Rows() == rows; })) << Rows();
  EXPECT_FALSE(undo->isEnabled());
  Child<QComboBox>(images_, "images.point")->setCurrentText("");
  SetMark({80, 60});
  EXPECT_TRUE(undo->isEnabled());
  ASSERT_TRUE(WaitFor([&] { return window_->problem()->isVisible(); }));
  EXPECT_FALSE(undo->isEnabled());
  EXPECT_EQ(Rows(), rows);
}

TEST(MarkHistory, AStepThatFailedIsNotTheStartOfTheNext) {
  MarkHistory history;
  const auto step = [](std::optional<MarkPlace> before, std::optional<MarkPlace> after) {
    return MarkStep{"P", "run1/a.jpg", before, after};
  };
  const MarkPlace first{{1, 1}}, outside{{-9, 1}}, last{{3, 3}};
  history.Add(step({}, first));
  const int failed = history.Add(step(first, outside));
  history.Add(step(outside, last));
  history.Fail(failed, MarkHistory::Way::kDone);
  EXPECT_EQ(history.undone_next()->before->pixel, first.pixel);
  const MarkStep undone = history.Undo();
  history.Fail(undone.number, MarkHistory::Way::kUndone);  // it is still there
  EXPECT_EQ(history.undone_next()->number, undone.number);
  EXPECT_EQ(history.redone_next(), nullptr);
  history.Undo();
  const MarkStep redone = history.Redo();
  history.Fail(redone.number, MarkHistory::Way::kRedone);
  EXPECT_EQ(history.redone_next()->number, redone.number);
  history.Add(step(first, last));
  EXPECT_EQ(history.redone_next(), nullptr);
}

TEST_F(ImagesTest, AMarkThatIsNotSavedIsTakenBack) {
  Child<QComboBox>(images_, "images.point")->setCurrentText("nowhere");
  Show("image:run1/images/000004.jpg");
  PictureView* view = images_->left();
  Click(window_.get(), "images.mark");
  // In the view, beside the picture.
  const QPointF corner = view->WidgetAt({-0.5, -0.5});
  const QPointF beside = corner.x() > corner.y() ? QPointF(-5, 40) : QPointF(40, -5);
  QTest::mouseClick(view, Qt::LeftButton, {}, view->WidgetAt(beside).toPoint());
  EXPECT_NE(Mark("nowhere"), nullptr);
  ASSERT_TRUE(WaitFor([&] { return window_->problem()->isVisible(); }));
  EXPECT_THAT(window_->problem()->sentence().toStdString(), HasSubstr("outside the image"));
  EXPECT_TRUE(WaitFor([&] { return Mark("nowhere") == nullptr; }));
  EXPECT_EQ(Marks().find("nowhere"), std::string::npos);
}

// Several in one go are written one after the other: none is lost.
TEST_F(ImagesTest, MarksThatAreSetQuicklyAreAllKept) {
  Show("image:run1/images/000004.jpg");
  PictureView* view = images_->left();
  for (int i = 0; i < 8; ++i) {
    Child<QComboBox>(images_, "images.point")->setCurrentText(QString("quick%1").arg(i));
    Click(window_.get(), "images.mark");
    QTest::mouseClick(view, Qt::LeftButton, {}, view->WidgetAt({40.0 + 25 * i, 200}).toPoint());
  }
  for (int i = 0; i < 8; ++i) EXPECT_NE(Mark(QString("quick%1").arg(i)), nullptr) << i;
  const auto kept = [&](int i) { return Marks().find("quick" + std::to_string(i)) != std::string::npos; };
  EXPECT_TRUE(WaitFor([&] { return kept(7); }));
  for (int i = 0; i < 8; ++i) EXPECT_TRUE(kept(i)) << i;
}

TEST_F(ImagesTest, TwoMarksSolveAPointAndPredictItElsewhere) {
  Child<QComboBox>(images_, "images.point")->setCurrentText("mast");
  PictureView* view = images_->left();
  // A point 5 m east, 1.2 m north and 0.6 m above the first camera, which looks east.
  const auto seen = [](int image) {
    const double depth = 5 - 0.3 * image;
    return QPointF(159.5 - 256 * 1.2 / depth, 119.5 - 256 * 0.6 / depth);
  };
  const auto show = [&](int image) { Show(QString("image:run1/images/%1.jpg").arg(image, 6, 10, QChar('0'))); };
  const auto set = [&](int image, const QPointF& at) {
    show(image);
    Click(window_.get(), "images.mark");
    QTest::mouseClick(view, Qt::LeftButton, {}, view->WidgetAt(at).toPoint());
  };
  const auto predicted = [&]() -> QPointF {
    for (const PictureMark& mark : view->marks()) {
      if (mark.text == "mast predicted") return mark.points[0];
    }
    return {-1, -1};
  };
  set(0, seen(0));
  set(4, seen(4));
  auto* status = Child<QLabel>(images_, "images.status");
  ASSERT_TRUE(WaitFor([&] { return status->text().startsWith("2 marks, "); })) << status->text().toStdString();
  ASSERT_TRUE(WaitFor([&] { return Mark("mast") != nullptr && Mark("mast")->text.contains("px off"); }));
  show(8);
  ASSERT_TRUE(WaitFor([&] { return predicted().x() > 0; }));
  const QPointF first = predicted();
  EXPECT_LT((first - seen(8)).manhattanLength(), 8);
  EXPECT_TRUE(Child<QAbstractButton>(images_, "images.confirm")->isEnabled());
  // One mark is moved: what is confirmed then is the prediction from where it is now.
  set(4, seen(4) + QPointF(4, -4));
  ASSERT_TRUE(WaitFor([&] { return Mark("mast") != nullptr && Mark("mast")->text.contains("px off"); }));
  show(8);
  ASSERT_TRUE(WaitFor([&] { return predicted().x() > 0 && (predicted() - first).manhattanLength() > 2; }));
  const QPointF moved = predicted();
  Click(window_.get(), "images.confirm");
  ASSERT_NE(Mark("mast"), nullptr);
  EXPECT_LT((Mark("mast")->points[0] - moved).manhattanLength(), 1e-9);
  EXPECT_FALSE(Child<QAbstractButton>(images_, "images.confirm")->isEnabled());
  EXPECT_TRUE(WaitFor([&] { return status->text().startsWith("3 marks, "); })) << status->text().toStdString();
  EXPECT_TRUE(Mark("mast") != nullptr && Mark("mast")->text.contains("px off"));
}

// Features of image 6 and of panorama p001's views that show the same points of the model.
class MatchesTest : public ImagesTest {
 protected:
  struct Feature {
    int64_t point = -1;
    QPointF in_image, in_view;
    std::string view;
  };
  static constexpr const char* kImage = "images/000006.jpg";
  static constexpr const char* kPanorama = "panoramas/p001.jpg";
  static constexpr size_t kFeatures = 200;  // each has its line

  void SetUp() override {
    WriteFeatures();
    ImagesTest::SetUp();
    Show(QString("image:run1/") + kImage);
    Child<QComboBox>(images_, "images.reference")->setCurrentText(kPanorama);
    ASSERT_TRUE(WaitFor([&] { return images_->right()->image().width() == 512; }));
  }
  static FeatureSet SetOf(const std::vector<Feature>& features, bool of_image) {
    FeatureSet set;
    set.descriptors = cv::Mat(static_cast<int>(features.size()), 128, CV_8U);
    for (size_t i = 0; i < features.size(); ++i) {
      const QPointF& at = of_image ? features[i].in_image : features[i].in_view;
      set.points.emplace_back(static_cast<float>(at.x()), static_cast<float>(at.y()));
      set.scales.push_back(2);
      set.angles.push_back(0);
      auto state = static_cast<uint32_t>(features[i].point);  // the same of the same point
      for (int k = 0; k < 128; ++k) {
        state = state * 1664525U + 1013904223U;
        set.descriptors.at<uint8_t>(static_cast<int>(i), k) = static_cast<uint8_t>((state >> 24) % 90);
      }
    }
    return set;
  }
  void Write(const char* stage, const std::map<std::string, std::vector<Feature>>& pictures, bool of_image) {
    const std::filesystem::path file = Path(stage).toStdString();
    std::filesystem::create_directories(file.parent_path());
    ColmapDatabase database = ColmapDatabase::Create(file);
    const uint32_t camera = database.AddCamera(Camera::FromFieldOfView(320, 240, 1));
    for (const auto& [name, features] : pictures) {
      database.WriteFeatures(database.AddImage(name, camera), SetOf(features, of_image));
    }
  }
  void WriteFeatures() {
    const std::filesystem::path localized = Path("results/localize/run1").toStdString();
    const SparseModel model = ReadColmapModel(localized / "sparse");
    Rigid3d pano_from_odom;
    for (const PanoramaResult& answer : ReadLocalizeResult(localized).panoramas) {
      if (answer.panorama == kPanorama) pano_from_odom = answer.odom_from_pano->Inverse();
    }
    std::map<int64_t, Eigen::Vector3d> places;
    for (const ModelPoint& point : model.points) places[point.id] = point.position;
    std::map<std::string, std::vector<Feature>> views;
    for (const ModelImage& image : model.images) {
      for (size_t k = 0; image.name == kImage && k < image.pixels.size(); ++k) {
        Feature feature{image.points[k], {image.pixels[k].x(), image.pixels[k].y()}, {}, ""};
        const Eigen::Vector3d ray = pano_from_odom * places.at(feature.point);
        for (const View& view : PanoramaViews(kPanorama, 512, {}).views) {
          const auto pixel = view.camera.Project(view.rig_from_view.rotation.conjugate() * ray);
          if (!pixel || !view.camera.Contains(*pixel)) continue;
          feature.in_view = {pixel->x(), pixel->y()};
          feature.view = view.name;
          break;
        }
        if (feature.view.empty() || features_.size() == kFeatures) continue;
        features_.push_back(feature);
        views[std::string(kPanorama) + "#" + feature.view].push_back(feature);
      }
    }
    Write("results/features/run1/features.db", {{kImage, features_}}, true);
    Write("results/references/features.db", views, false);
  }
  size_t Drawn(const PictureView* view) const {
    return static_cast<size_t>(std::count_if(view->marks().begin(), view->marks().end(),
                                             [](const PictureMark& mark) { return mark.layer == "inliers"; }));
  }
  void Match() {
    Click(window_.get(), "images.match");
    ASSERT_TRUE(WaitFor([&] { return Drawn(images_->right()) > 0; }))
        << Child<QLabel>(images_, "images.status")->text().toStdString();
  }
  // Of a point that is matched, in the panorama or the view that is shown; null: none.
  const PictureMark* OnTheRight(int64_t point) const {
    for (const PictureMark& mark : images_->right()->marks()) {
      if (mark.object == "point:run1/" + QString::number(point)) return &mark;
    }
    return nullptr;
  }

  std::vector<Feature> features_;
};

TEST_F(MatchesTest, MatchDrawsWhatBothPicturesShow) {
  ASSERT_GT(features_.size(), 20U);
  Match();
  EXPECT_GT(Drawn(images_->right()), 0.9 * static_cast<double>(features_.size()));
  EXPECT_EQ(Drawn(images_->left()), Drawn(images_->right()));
  EXPECT_EQ(images_->lines()->pairs().size(), Drawn(images_->right()));
  EXPECT_THAT(Child<QLabel>(images_, "images.status")->text().toStdString(),
              HasSubstr(std::to_string(features_.size()) + " matches, "));
  // A match that is a point of the model is that point on both sides.
  const Feature& feature = features_.front();
  ASSERT_NE(OnTheRight(feature.point), nullptr);
  PictureView* right = images_->right();
  right->LookAt(OnTheRight(feature.point)->points[0], 40);
  QTest::mouseClick(right, Qt::LeftButton, {}, right->WidgetAt(OnTheRight(feature.point)->points[0]).toPoint());
  EXPECT_EQ(window_->workspace()->selected(), "point:run1/" + QString::number(feature.point));
}

TEST_F(MatchesTest, LinesLieOverBothPanes) {
  Match();
  const QWidget* panes = images_->left()->parentWidget();
  EXPECT_EQ(images_->lines()->size(), panes->size());
  ASSERT_GT(images_->lines()->InSight(), 0);
  // Between the panes nothing else has a colour.
  const QRect left = images_->left()->geometry(), right = images_->right()->geometry();
  const QRect gap = right.left() > left.right()
                        ? QRect(left.right() + 1, 0, right.left() - left.right() - 1, panes->height())
                        : QRect(0, left.bottom() + 1, panes->width(), right.top() - left.bottom() - 1);
  const QImage drawn = images_->lines()->parentWidget()->grab(gap.translated(panes->pos())).toImage();
  int coloured = 0;
  for (int y = 0; y < drawn.height(); ++y) {
    for (int x = 0; x < drawn.width(); ++x) coloured += drawn.pixelColor(x, y).saturation() > 40 ? 1 : 0;
  }
  EXPECT_GT(coloured, 0);
  Screenshot(window_.get(), "images_lines");
}

TEST_F(MatchesTest, APanoramaIsShownAsTheViewsThatLocalizeMatches) {
  Match();
  auto* part = Child<QComboBox>(images_, "images.view");
  ASSERT_EQ(part->count(), 9);  // whole, and eight around
  PictureView* right = images_->right();
  const QImage panorama = right->image();
  const ViewRig rig = PanoramaViews(kPanorama, 512, {});
  const Camera sphere = Camera::Equirectangular(512, 256);
  size_t in_views = 0;
  for (const int k : {0, 1, 7, 4}) {
    const View& view = rig.views[static_cast<size_t>(k)];
    part->setCurrentIndex(k + 1);
    const QString title =
        QString("panoramas/p001.jpg, view %1: yaw %2.0\u00b0, pitch 0.0\u00b0, field of view 90.0\u00b0")
            .arg(k + 1)
            .arg(45 * k);
    ASSERT_TRUE(WaitFor([&] { return right->accessibleDescription().startsWith(title); }))
        << right->accessibleDescription().toStdString();
    ASSERT_EQ(right->image().size(), QSize(view.camera.width(), view.camera.height()));
    // Cut from where the view looks.
    int apart = 0;
    for (int i = 0; i < 64; ++i) {
      const QPoint at(20 * (i % 8) + 10, 20 * (i / 8) + 10);
      const Eigen::Vector3d ray = view.rig_from_view.rotation * *view.camera.Unproject({at.x(), at.y()});
      const Eigen::Vector2d of = *sphere.Project(ray);
      const QColor seen = right->image().pixelColor(at);
      const QColor there = panorama.pixelColor(static_cast<int>(std::lround(of.x())) % 512, static_cast<int>(of.y()));
      apart += std::abs(seen.red() - there.red()) + std::abs(seen.green() - there.green());
    }
    EXPECT_LT(apart / 64, 30) << k;
    for (const Feature& feature : features_) {
      if (feature.view != view.name) continue;
      const PictureMark* mark = OnTheRight(feature.point);
      if (mark == nullptr) continue;  // no inlier
      EXPECT_LT((mark->points[0] - feature.in_view).manhattanLength(), 0.05) << feature.point;
      ++in_views;
    }
    EXPECT_EQ(images_->lines()->pairs().size(), Drawn(right)) << k;
  }
  EXPECT_GT(in_views, 10U);
  EXPECT_EQ(Drawn(right), 0U);  // the last view looks back
  Screenshot(window_.get(), "images_view");
}

TEST_F(MatchesTest, AViewIsClickedAndZoomedLikeThePanorama) {
  Match();
  auto* part = Child<QComboBox>(images_, "images.view");
  part->setCurrentIndex(1);
  PictureView *left = images_->left(), *right = images_->right();
  ASSERT_TRUE(WaitFor([&] { return right->image().width() < 512 && Drawn(right) > 0; }));
  const auto found = std::find_if(features_.begin(), features_.end(), [&](const Feature& feature) {
    const bool alone = std::none_of(features_.begin(), features_.end(), [&](const Feature& other) {
      const QPointF by = other.in_image - feature.in_image;
      return other.point != feature.point && std::max(std::abs(by.x()), std::abs(by.y())) < 6;
    });
    return alone && feature.view == "0" && OnTheRight(feature.point) != nullptr;
  });
  ASSERT_NE(found, features_.end());
  Child<QCheckBox>(images_, "images.linked")->setChecked(true);
  left->resize(400, 400);
  left->LookAt(found->in_image, 64);
  const QPointF middle = right->PixelAt({0.5 * right->width(), 0.5 * right->height()});
  EXPECT_LT((middle - found->in_view).manhattanLength(), 1) << found->point;
  QTest::mouseClick(right, Qt::LeftButton, {}, right->WidgetAt(found->in_view).toPoint());
  EXPECT_EQ(window_->workspace()->selected(), "point:run1/" + QString::number(found->point));
  // The same view of the next panorama, and all of it again.
  Child<QComboBox>(images_, "images.reference")->setCurrentText("panoramas/p002.jpg");
  EXPECT_TRUE(WaitFor([&] { return right->accessibleDescription().startsWith("panoramas/p002.jpg, view 1: "); }));
  part->setCurrentIndex(0);
  EXPECT_EQ(right->image().width(), 512);
}

// A set of two photos that nobody has stitched: the second one sees most of what image 6 sees.
class SetMatchesTest : public MatchesTest {
 protected:
  static constexpr const char* kSet = "photos/S2";
  void SetUp() override {
    QDir(Path(kSet)).mkpath(".");
    QImage picture(320, 240, QImage::Format_RGB32);
    picture.fill(Qt::darkGreen);
    for (const char* name : {"/a.jpg", "/b.jpg"}) ASSERT_TRUE(picture.save(Path(kSet) + name));
    MatchesTest::SetUp();
  }
  void TearDown() override {
    MatchesTest::TearDown();
    QDir(Path("photos")).removeRecursively();
  }
};

TEST_F(SetMatchesTest, AMatchShowsThePhotoThatSeesTheSame) {
  Write("results/references/features.db",
        {{std::string(kSet) + "/a.jpg#0", {features_.begin(), features_.begin() + 5}},
         {std::string(kSet) + "/b.jpg#0", {features_.begin() + 5, features_.end()}}},
        false);
  window_->workspace()->Reload();
  auto* reference = Child<QComboBox>(images_, "images.reference");
  ASSERT_TRUE(WaitFor([&] { return reference->findText("S2") >= 0; }));
  reference->setCurrentText("S2");
  const auto title = [&] { return images_->right()->accessibleDescription().toStdString(); };
  ASSERT_TRUE(WaitFor([&] { return title() == "S2, a.jpg"; })) << title();
  auto* part = Child<QComboBox>(images_, "images.view");
  EXPECT_TRUE(part->isEnabled());
  EXPECT_EQ(part->count(), 2);
  Child<QCheckBox>(images_, "images.outliers")->setChecked(true);
  Click(window_.get(), "images.match");
  ASSERT_TRUE(WaitFor([&] { return title() == "S2, b.jpg"; })) << title();
  // Of a set that is not stitched nobody knows how its photos stand.
  EXPECT_THAT(Child<QLabel>(images_, "images.status")->text().toStdString(), HasSubstr("cannot be judged"));
  const auto drawn = [&] {
    return std::count_if(images_->right()->marks().begin(), images_->right()->marks().end(),
                         [](const PictureMark& mark) { return mark.layer == "outliers"; });
  };
  EXPECT_TRUE(WaitFor([&] { return drawn() > 0.9 * static_cast<double>(features_.size() - 5); })) << drawn();
  part->setCurrentIndex(0);
  EXPECT_TRUE(WaitFor([&] { return title() == "S2, a.jpg" && drawn() == 5; })) << drawn();
  reference->setCurrentText(kPanorama);
  EXPECT_TRUE(WaitFor([&] { return title() == kPanorama && part->currentText() == "whole"; })) << title();
}

// What is found belongs to what was shown when it was asked for.
TEST_F(MatchesTest, MatchesOfAnotherPanoramaAreNotDrawn) {
  auto* status = Child<QLabel>(images_, "images.status");
  const QString before = status->text();
  auto* reference = Child<QComboBox>(images_, "images.reference");
  {
    const std::lock_guard guard(window_->workspace()->InspectorOf("run1")->mutex);
    Click(window_.get(), "images.match");
    reference->setCurrentText("panoramas/p002.jpg");
  }
  QThreadPool::globalInstance()->waitForDone();
  ASSERT_TRUE(WaitFor([&] { return images_->right()->accessibleDescription() == "panoramas/p002.jpg"; }));
  QCoreApplication::sendPostedEvents();
  EXPECT_EQ(Drawn(images_->right()), 0U);
  EXPECT_EQ(Drawn(images_->left()), 0U);
  EXPECT_TRUE(images_->lines()->pairs().empty());
  EXPECT_EQ(status->text(), before);
}

TEST(EmptyImages, SayWhatToDo) {
  QSettings().clear();
  const QTemporaryDir site;
  ResultsSiteSize size;
  size.images = 4, size.points = 50;
  WriteResultsSite(site.path().toStdString(), size);
  for (const char* part : {"/runs", "/results", "/panoramas"}) QDir(site.path() + part).removeRecursively();
  for (const char* file : {"/panoramas.csv", "/stations.csv"}) QFile::remove(site.path() + file);
  const auto window = OpenWindow("");
  window->ShowDesk("images");
  const auto left = [&] { return window->images()->left()->accessibleDescription().toStdString(); };
  const auto right = [&] { return window->images()->right()->accessibleDescription().toStdString(); };
  EXPECT_THAT(left(), HasSubstr("Ctrl+O"));
  EXPECT_THAT(right(), HasSubstr("Ctrl+O"));
  window->OpenProject(site.path());
  window->ShowDesk("images");
  EXPECT_TRUE(WaitFor([&] { return left().find("File, Import") != std::string::npos; })) << left();
  EXPECT_TRUE(WaitFor([&] { return right().find("Panoramas of services") != std::string::npos; })) << right();
}

TEST_F(ImagesTest, RowsInSightHaveThumbnails) {
  auto* list = Child<QListWidget>(images_, "images.list");
  const auto drawn = [&](int row) {
    return list->item(row)->icon().pixmap(64, 48).toImage().pixelColor(32, 24).alpha() == 255;
  };
  EXPECT_TRUE(WaitFor([&] { return drawn(0) && drawn(2); }));
  EXPECT_GE(list->visualItemRect(list->item(0)).height(), 48);
}

TEST_F(ImagesTest, LinesLeadFromOnePictureToTheOther) {
  QWidget both;
  both.resize(400, 200);
  PictureView first(&both), second(&both);
  first.setGeometry(0, 0, 200, 200);
  second.setGeometry(200, 0, 200, 200);
  QImage picture(100, 100, QImage::Format_RGB32);
  picture.fill(Qt::black);
  first.SetPicture(picture, "");
  second.SetPicture(picture, "");
  MatchLines lines(&first, &second, &both);
  both.show();
  lines.SetPairs({{{10, 50}, {90, 50}, Qt::red}, {{50, 10}, {50, 10}, Qt::red}});
  EXPECT_EQ(lines.InSight(), 2);
  const QImage drawn = both.grab().toImage();
  const double ratio = both.devicePixelRatioF();
  const int y = static_cast<int>(ratio * first.WidgetAt({10, 50}).y());
  int reddest = 0;
  for (int dy = -3; dy <= 3; ++dy) {
    const QColor colour = drawn.pixelColor(static_cast<int>(200 * ratio), y + dy);
    reddest = std::max(reddest, colour.red() - colour.blue());
  }
  EXPECT_GT(reddest, 60);
  // What is out of sight in one picture has no line.
  first.LookAt({10, 50}, 8);
  EXPECT_EQ(lines.InSight(), 1);
}

TEST_F(ImagesTest, ZoomIsLinkedByTheMatches) {
  ASSERT_TRUE(WaitFor([&] { return !images_->left()->image().isNull() && !images_->right()->image().isNull(); }));
  images_->lines()->SetPairs({{{40, 40}, {400, 100}, Qt::red}, {{250, 200}, {100, 200}, Qt::red}});
  Child<QCheckBox>(images_, "images.linked")->setChecked(true);
  images_->left()->LookAt({40, 40}, 10);
  PictureView* right = images_->right();
  const QPointF middle = right->PixelAt({0.5 * right->width(), 0.5 * right->height()});
  EXPECT_NEAR(middle.x(), 400, 2);
  EXPECT_NEAR(middle.y(), 100, 2);
  EXPECT_NEAR(right->scale() / right->FittedScale(), images_->left()->scale() / images_->left()->FittedScale(), 1e-6);
}

}  // namespace
}  // namespace trigpoint

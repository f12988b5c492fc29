// What is selected on one desk is on all; decisions from context menus, undone and made again.
#include <gmock/gmock.h>

#include <QAction>
#include <QComboBox>
#include <QHeaderView>
#include <QImage>
#include <QLabel>
#include <QLineEdit>
#include <QMenu>
#include <QSignalSpy>
#include <QSlider>
#include <QTableView>
#include <QTableWidget>
#include <QTreeWidget>
#include <map>
#include <tuple>

#include "app/desktop/column_help.h"
#include "app/desktop/decisions.h"
#include "app/desktop/images_desk.h"
#include "app/desktop/object_table.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/review_desk.h"
#include "app/desktop/site_tree.h"
#include "datasets/io/text.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

class SelectionTest : public ResultsWindowTest {
 protected:
  void TearDown() override { QFile::remove(Path("review.jsonl")); }
  QMenu* OpenedMenu() {
    for (QMenu* menu : window_->findChildren<QMenu*>("object.menu")) {
      if (menu->isVisible()) return menu;
    }
    return nullptr;
  }
  // "exclude station:S2" of the menu that is open.
  QMenu* Reasons(const char* name) {
    QMenu* menu = OpenedMenu();
    return menu == nullptr ? nullptr : menu->findChild<QMenu*>(name);
  }
  bool Excluded(const char* object) const { return window_->workspace()->snapshot()->excluded.count(object) > 0; }
};

TEST_F(SelectionTest, ATableThatIsOnlyLookedAtSelectsNothing) {
  ShowErrors();
  window_->ShowDesk("images");
  window_->workspace()->Select("image:run1/images/000004.jpg");  // has no row in the table
  window_->ShowDesk("tables");
  view_->setFocus();
  ASSERT_TRUE(WaitFor([&] { return view_->hasFocus(); }));
  EXPECT_EQ(window_->workspace()->selected(), "image:run1/images/000004.jpg");
}

TEST_F(SelectionTest, ARowIsSelectedAgainByAClick) {
  ShowErrors();
  ClickRow(view_, RowWith(view_, "S2"));
  EXPECT_EQ(window_->workspace()->selected(), "station:S2");
  window_->workspace()->Select("image:run1/images/000004.jpg");  // has no row here
  EXPECT_TRUE(view_->selectionModel()->selectedRows().isEmpty());
  ClickRow(view_, RowWith(view_, "S2"));
  EXPECT_EQ(window_->workspace()->selected(), "station:S2");
}

TEST_F(SelectionTest, TheTreeMarksWhatIsSelectedOrBelongsToIt) {
  SiteTree* tree = window_->tree();
  const auto click = [&](const char* name) {
    QTreeWidgetItem* item = tree->findItems(name, Qt::MatchExactly | Qt::MatchRecursive).front();
    tree->scrollToItem(item);
    QTest::mouseClick(tree->viewport(), Qt::LeftButton, {}, tree->visualItemRect(item).center());
  };
  click("S2");
  EXPECT_EQ(window_->workspace()->selected(), "station:S2");
  window_->workspace()->Select("detection:run1/images/000012.jpg#2");
  ASSERT_NE(tree->currentItem(), nullptr);
  EXPECT_EQ(tree->currentItem()->text(0), "images/000012.jpg");
  click("S2");
  EXPECT_EQ(window_->workspace()->selected(), "station:S2");
  // What has nothing in the tree leaves nothing marked; what is marked for another can be selected.
  window_->workspace()->Select("point:run1/7");
  EXPECT_EQ(tree->currentItem(), nullptr);
  EXPECT_TRUE(tree->selectedItems().isEmpty());
  window_->workspace()->Select("detection:run1/images/000012.jpg#2");
  tree->scrollToItem(tree->currentItem());
  QTest::mouseClick(tree->viewport(), Qt::LeftButton, {}, tree->visualItemRect(tree->currentItem()).center());
  EXPECT_EQ(window_->workspace()->selected(), "image:run1/images/000012.jpg");
}

// Every kind of table that the stages write and that names objects in another way than by its own columns alone.
TEST_F(SelectionTest, EveryTableLoadsAndLeadsToItsObjects) {
  const std::string c = ",0,0\n";
  const std::tuple<const char*, std::string, const char*> kTables[] = {
      {"localize/run1/matches",
       "panorama,view,image,u_image,v_image,u_view,v_view\npanoramas/p001.jpg,0,images/000003.jpg,9,9,9,9\n",
       "image:run1/images/000003.jpg"},
      {"localize/run1/cameras_cov", "image_a,image_b,c00,c01\nimages/000003.jpg,images/000004.jpg" + c,
       "image:run1/images/000003.jpg"},
      {"localize/run1/panoramas_cov", "panorama_a,panorama_b,c00,c01\npanoramas/p001.jpg,panoramas/p002.jpg" + c,
       "panorama:panoramas/p001.jpg"},
      {"survey/tags_cov", "tag_a,tag_b,c00,c01\n1,2" + c, "tag:1"},
      {"calibrate/cam0/residuals", "camera,image,point,u,v,du_px,dv_px,used\ncam0,board/1.jpg,0,9,9,0.1,0.1,1\n", ""},
      {"calibrate/cam0/views",
       "camera,image,frame,status,reason,points,points_used,rms_px,tilt_deg,distance_m\n"
       "cam0,board/1.jpg,1,used,,54,54,0.2,10,0.5\ncam0,board/2.jpg,,no board,none was found,,,,,\n",
       ""},
      {"stitch/station_002/rig", "photo,tx,ty,tz\na.jpg,0,0,0\n", "panorama:station_002"},
      {"stitch/station_002/pairs", "photo_a,photo_b,matches,candidates\na.jpg,b.jpg,20,40\n", "panorama:station_002"},
      {"detect/run1/unnamed", "timestamp,image,tag_id\n1000.5,,1\n", "detection:run1/@1000.500000000#1"},
      {"detect/run1/nothing", "timestamp,image,tag_id\n,,1\n", "tag:1"}};
  for (const auto& [title, text, object] : kTables) {
    WriteFileAtomically(Path("results/").toStdString() + title + ".csv", text);
  }
  std::map<std::string, DataTableSource> found;
  for (const DataTableSource& source : FindTables(Path("results").toStdString())) {
    found[source.title] = source;
    EXPECT_NO_THROW(LoadDataTable(source)) << source.title;
  }
  for (const auto& [title, text, object] : kTables) {
    const DataTable table = LoadDataTable(found.at(title));
    EXPECT_TRUE(table.warnings.empty()) << title;
    ASSERT_FALSE(table.objects.empty()) << title;
    EXPECT_EQ(table.objects.front(), object) << title;
    QFile::remove(Path("results/") + title + ".csv");
  }
  for (const char* folder : {"results/calibrate", "results/stitch", "results/survey"}) {
    QDir(Path(folder)).removeRecursively();
  }
}

TEST_F(SelectionTest, TablesShowUnitsAndSortColumnsThatBeginBlank) {
  std::string text = "timestamp,u0,v_view,left_m\n1000.123456789,7.25,8,\n";
  for (int i = 0; i < 250; ++i) text += "1000.5,1,2,\n";
  WriteFileAtomically(Path("results/evaluate/late.csv").toStdString(), text + "1001,1,2,10\n1002,1,2,9\n");
  window_->workspace()->Reload();
  window_->ShowDesk("tables");
  ASSERT_TRUE(WaitFor([&] { return window_->tables()->Choose("evaluate/late"); }));
  view_ = Child<QTableView>(window_.get(), "tables.view");
  ASSERT_TRUE(WaitFor([&] { return view_->model()->columnCount() == 4; }));
  QStringList header, first;
  for (int column = 0; column < 3; ++column) {
    header << view_->model()->headerData(column, Qt::Horizontal).toString();
    first << view_->model()->index(0, column).data().toString();
  }
  EXPECT_EQ(header.join(", ").toStdString(), "timestamp (s), u0 (px), v_view (px)");
  EXPECT_EQ(first.join(", ").toStdString(), "1000.123, 7.250, 8.000");
  view_->sortByColumn(3, Qt::AscendingOrder);
  EXPECT_EQ(view_->model()->index(0, 3).data().toString(), "9.0000");
  EXPECT_EQ(Child<QTreeWidget>(window_.get(), "tables.tree")->currentItem()->toolTip(0), "evaluate/late");
  QFile::remove(Path("results/evaluate/late.csv"));
}

TEST_F(SelectionTest, EveryDeskFollows) {
  ShowScene();
  auto* panoramas = Child<QComboBox>(window_.get(), "panorama.set");
  auto* compared = Child<QTableWidget>(window_.get(), "compare.errors");
  ASSERT_TRUE(WaitFor([&] { return compared->rowCount() == 4; }));
  window_->ShowDesk("images");
  window_->workspace()->Select("station:S2");
  EXPECT_THAT(panoramas->currentText().toStdString(), HasSubstr("panoramas/p002.jpg"));
  EXPECT_EQ(Child<QComboBox>(window_.get(), "images.reference")->currentText(), "panoramas/p002.jpg");
  EXPECT_EQ(Child<QLineEdit>(window_.get(), "review.object")->text(), "station:S2");
  ASSERT_FALSE(compared->selectedItems().isEmpty());
  EXPECT_EQ(compared->selectedItems().front()->data(Qt::UserRole).toString(), "station:S2");
  // The images desk goes to the image that sees the station's tag; the scene's slider to the nearest camera.
  EXPECT_TRUE(WaitFor([&] {
    for (const PictureMark& mark : window_->images()->left()->marks()) {
      if (mark.object.startsWith("detection:") && mark.object.endsWith("#2")) return true;
    }
    return false;
  }));
  auto* time = Child<QSlider>(window_.get(), "scene.time");
  const int near_s2 = time->value();
  window_->workspace()->Select("tag:0");
  EXPECT_LT(time->value(), near_s2);
  EXPECT_THAT(panoramas->currentText().toStdString(), HasSubstr("panoramas/p000.jpg"));
  window_->workspace()->Select("image:run1/images/000009.jpg");
  EXPECT_EQ(time->value(), 9);
  EXPECT_EQ(window_->images()->image(), "images/000009.jpg");
  EXPECT_EQ(window_->workspace()->selected(), "image:run1/images/000009.jpg");
  // A desk that leads: Panoramas and Compare.
  panoramas->setCurrentIndex(panoramas->findText("panoramas/p003.jpg", Qt::MatchStartsWith));
  emit panoramas->activated(panoramas->currentIndex());
  EXPECT_EQ(window_->workspace()->selected(), "panorama:panoramas/p003.jpg");
  EXPECT_EQ(compared->selectedItems().front()->data(Qt::UserRole).toString(), "station:S3");
}

TEST_F(SelectionTest, ASetCalledByANumberIsItsStationAndTag) {
  QDir().mkpath(Path("photos/station_002"));
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg"}) {
    QImage photo(320, 240, QImage::Format_RGB32);
    photo.fill(Qt::darkGreen);
    ASSERT_TRUE(photo.save(Path("photos/station_002/") + name));
  }
  window_->workspace()->Reload();
  auto* set = Child<QComboBox>(window_.get(), "panorama.set");
  ASSERT_TRUE(WaitFor([&] { return set->findText("station_002 (photo set)") >= 0; }));
  window_->workspace()->Select("panorama:station_002");
  EXPECT_EQ(window_->workspace()->related().count("station:S2"), 1u);
  EXPECT_EQ(window_->workspace()->related().count("tag:2"), 1u);
  // Of the panoramas of a station the desks show the one that is selected.
  for (const char* name : {"panoramas/p002.jpg", "station_002", "panoramas/p002.jpg"}) {
    window_->workspace()->Select(QString("panorama:") + name);
    EXPECT_THAT(set->currentText().toStdString(), testing::StartsWith(name));
    EXPECT_EQ(Child<QComboBox>(window_.get(), "images.reference")->currentText(), name);
  }
  window_->workspace()->Select("tag:2");
  EXPECT_EQ(window_->workspace()->related().count("panorama:station_002"), 1u);
  EXPECT_EQ(window_->workspace()->related().count("station:S1"), 0u);
  QDir(Path("photos")).removeRecursively();
}

// Of a station with answers of two runs the row of the run that was chosen.
TEST_F(SelectionTest, TheRunOfWhatIsChosenBelongsToTheSelection) {
  QTableWidget table(0, 1);
  const std::vector<std::pair<const char*, const char*>> rows = {
      {"station:S1", "run1"}, {"station:S2", "run1"}, {"station:S2", "run2"}};
  for (const auto& [object, run] : rows) {
    auto* item = new QTableWidgetItem(object);
    item->setData(Qt::UserRole, object);
    item->setData(kRunRole, run);
    table.insertRow(table.rowCount());
    table.setItem(table.rowCount() - 1, 0, item);
  }
  Workspace* workspace = window_->workspace();
  LinkTable(&table, workspace);
  workspace->Select("station:S2", "run2");
  EXPECT_EQ(table.currentRow(), 2);
  EXPECT_EQ(workspace->run(), "run2");
  workspace->Select("station:S2");  // said again, by a desk that knows no run
  EXPECT_EQ(workspace->run(), "run2");
  table.selectRow(1);
  EXPECT_EQ(workspace->run(), "run1");
  workspace->Select("station:S1");
  EXPECT_EQ(workspace->run(), "");
  EXPECT_EQ(table.currentRow(), 0);
  ShowErrors();
  ClickRow(view_, RowWith(view_, "S2"));
  EXPECT_EQ(workspace->run(), "run1");  // of its column
}

TEST_F(SelectionTest, AContextMenuExcludesWithAReasonToPick) {
  ShowErrors();
  QSignalSpy decided(window_->decisions(), &Decisions::Decided);
  const QPoint at = view_->visualRect(view_->model()->index(RowWith(view_, "S2"), 0)).center();
  emit view_->customContextMenuRequested(at);
  EXPECT_EQ(window_->workspace()->selected(), "station:S2");
  QMenu* reasons = Reasons("exclude station:S2");
  ASSERT_NE(reasons, nullptr);
  EXPECT_NE(Reasons("exclude tag:2"), nullptr);
  EXPECT_NE(Reasons("role control:2"), nullptr);
  EXPECT_EQ(Reasons("exclude control:2"), nullptr);  // control points are no such objects
  const std::string reason = reasons->actions().front()->text().toStdString();
  reasons->actions().front()->trigger();
  OpenedMenu()->close();
  ASSERT_TRUE(WaitFor([&] { return decided.count() == 1; }));
  EXPECT_TRUE(Excluded("station:S2"));
  EXPECT_THAT(ReadTextFile(Path("review.jsonl").toStdString()), HasSubstr(reason));
  // The tree offers to restore it now.
  auto* tree = window_->tree();
  const auto found = tree->findItems("S2", Qt::MatchExactly | Qt::MatchRecursive);
  ASSERT_FALSE(found.isEmpty());
  tree->scrollToItem(found.front());
  emit tree->customContextMenuRequested(tree->visualItemRect(found.front()).center());
  QMenu* restore = Reasons("restore station:S2");
  ASSERT_NE(restore, nullptr);
  restore->actions().front()->trigger();
  OpenedMenu()->close();
  ASSERT_TRUE(WaitFor([&] { return decided.count() == 2; }));
  EXPECT_FALSE(Excluded("station:S2"));
}

TEST_F(SelectionTest, ThePanoramasDeskHasTheMenuOfItsPanorama) {
  window_->ShowDesk("panoramas");
  auto* set = Child<QComboBox>(window_.get(), "panorama.set");
  set->setCurrentIndex(set->findText("panoramas/p002.jpg", Qt::MatchStartsWith));
  for (const char* name : {"panorama.set", "panorama.picture", "panorama.graph", "panorama.photo"}) {
    emit Child<QWidget>(window_.get(), name)->customContextMenuRequested({5, 5});
    EXPECT_EQ(window_->workspace()->selected(), "panorama:panoramas/p002.jpg") << name;
    ASSERT_NE(Reasons("exclude panorama:panoramas/p002.jpg"), nullptr) << name;
    EXPECT_NE(Reasons("exclude station:S2"), nullptr) << name;
    OpenedMenu()->close();
  }
  auto* photos = Child<QTableWidget>(window_.get(), "panorama.photos");
  ASSERT_TRUE(WaitFor([&] { return photos->horizontalHeaderItem(1) != nullptr; }));
  EXPECT_THAT(photos->horizontalHeaderItem(1)->toolTip().toStdString(),
              HasSubstr("right of the panorama's centre (m)"));
}

TEST_F(SelectionTest, AComparedRowIsOpenedByEnter) {
  window_->ShowDesk("compare");
  auto* compared = Child<QTableWidget>(window_.get(), "compare.errors");
  ASSERT_TRUE(WaitFor([&] { return compared->rowCount() == 4; }));
  EXPECT_THAT(compared->horizontalHeaderItem(7)->toolTip().toStdString(), HasSubstr("error of B minus error of A"));
  compared->setFocus();
  compared->setCurrentCell(RowWith(compared, "S1"), 3);
  QTest::keyClick(compared, Qt::Key_Return);
  EXPECT_EQ(window_->workspace()->selected(), "station:S1");
  EXPECT_EQ(window_->desk(), "images");
}

TEST_F(SelectionTest, HeadersSayWhatColumnsMeanAndTheirMenuOpensThere) {
  ShowErrors();
  const auto help = [this](const char* column) {
    for (int c = 0; c < view_->model()->columnCount(); ++c) {
      const QString text = view_->model()->headerData(c, Qt::Horizontal, Qt::ToolTipRole).toString();
      if (text.endsWith(QString("In the file: ") + column)) return text.toStdString();
    }
    return std::string();
  };
  EXPECT_THAT(help("error_3d_m"), HasSubstr("Distance in space between the answer and the reference (m)"));
  window_->workspace()->SetUnit("ft");
  EXPECT_THAT(help("error_3d_m"), HasSubstr("(ft)"));
  // Of every table of this project; what nobody knows keeps its name.
  int columns = 0;
  for (const DataTableSource& source : FindTables(Path("results").toStdString())) {
    const DataTable table = LoadDataTable(source);
    for (const std::string& column : table.columns) {
      ++columns;
      const std::string text = ColumnHelp(table, QString::fromStdString(column), "m").toStdString();
      EXPECT_NE(text, column) << source.title;
      if (column != "x") continue;
      EXPECT_THAT(text, HasSubstr("(m)\nFrame: site: x east, y north, z up")) << source.title;
    }
  }
  EXPECT_GT(columns, 70);
  EXPECT_EQ(ColumnHelp({}, "what_a_plugin_wrote", "m"), "what_a_plugin_wrote");
  const auto* parameters = Child<QTableWidget>(window_.get(), "calibration.parameters");
  EXPECT_THAT(parameters->horizontalHeaderItem(2)->toolTip().toStdString(), HasSubstr("in the parameter's unit"));
  auto* header = view_->horizontalHeader();
  const QPoint at(view_->columnViewportPosition(1) + 10, header->height() / 2);
  emit header->customContextMenuRequested(at);
  auto* menu = Child<QMenu>(window_.get(), "tables.column_menu");
  EXPECT_EQ(menu->pos(), header->viewport()->mapToGlobal(at));
  menu->close();
}

TEST_F(SelectionTest, TablesWithoutAnySayWhatToDo) {
  window_->ShowDesk("tables");
  auto* empty = Child<QLabel>(window_.get(), "tables.empty");
  ASSERT_TRUE(WaitFor([&] { return Child<QTableView>(window_.get(), "tables.view")->isVisible(); }));
  EXPECT_FALSE(empty->isVisible());
  window_->workspace()->Close();
  EXPECT_TRUE(empty->isVisible());
  EXPECT_THAT(empty->text().toStdString(), HasSubstr("Open a project"));
  const QTemporaryDir fresh;
  WriteResultsSite(fresh.path().toStdString(), {});
  QDir(fresh.path() + "/results").removeRecursively();
  window_->OpenProject(fresh.path());
  EXPECT_TRUE(WaitFor([&] { return empty->text().contains("run a stage"); }));
}

TEST_F(SelectionTest, ManyResultsStayFolded) {
  auto* tree = window_->tree();
  const auto results = tree->findItems("results", Qt::MatchExactly);
  ASSERT_EQ(results.size(), 1);
  ASSERT_GT(results.front()->childCount(), 12);
  EXPECT_FALSE(results.front()->isExpanded());
  QSignalSpy changed(window_->workspace(), &Workspace::ResultsChanged);
  const auto refresh = [&] {
    const int before = changed.count();
    window_->workspace()->Reload();
    EXPECT_TRUE(WaitFor([&] { return changed.count() > before; }));
    return tree->findItems("results", Qt::MatchExactly).front();
  };
  EXPECT_FALSE(refresh()->isExpanded());
  tree->findItems("results", Qt::MatchExactly).front()->setExpanded(true);
  EXPECT_TRUE(refresh()->isExpanded());
}

TEST_F(SelectionTest, AControlPointAtATagsCornerBelongsToItsStation) {
  Snapshot snapshot;
  snapshot.stations = {{"S57", 57}};
  snapshot.controls = {{"control:57/2", "57/2", "control", 57}, {"control:58", "58", "check", 58}};
  for (const char* object : {"station:S57", "tag:57", "control:57/2"}) {
    EXPECT_EQ(snapshot.Related(object), (std::set<std::string>{"control:57/2", "station:S57", "tag:57"})) << object;
  }
}

TEST_F(SelectionTest, UndoOfDecisionsIsApartFromThatOfText) {
  window_->ShowDesk("review");
  QSignalSpy decided(window_->decisions(), &Decisions::Decided);
  window_->decisions()->Decide("exclude", "station:S1", "was moved");
  ASSERT_TRUE(WaitFor([&] { return decided.count() == 1; }));
  auto* undo = Child<QAction>(window_.get(), "edit.undo");
  EXPECT_THAT(undo->text().toStdString(), HasSubstr("station:S1"));
  // In the field Ctrl+Z takes back the typing, and no decision.
  auto* reason = Child<QLineEdit>(window_.get(), "review.reason");
  reason->setFocus();
  QTest::keyClicks(reason, "a thought");
  QTest::keyClick(reason, Qt::Key_Z, Qt::ControlModifier);
  EXPECT_EQ(reason->text(), "");
  QTest::keyClicks(reason, "another");
  QTest::qWait(200);
  EXPECT_EQ(decided.count(), 1);
  EXPECT_TRUE(Excluded("station:S1"));
  // Outside it takes back the decision, and leaves the text alone.
  auto* entries = Child<QTableWidget>(window_.get(), "review.entries");
  entries->setFocus();
  QTest::keyClick(entries, Qt::Key_Z, Qt::ControlModifier);
  ASSERT_TRUE(WaitFor([&] { return decided.count() == 2; }));
  EXPECT_FALSE(Excluded("station:S1"));
  EXPECT_EQ(reason->text(), "another");
  EXPECT_THAT(ReadTextFile(Path("review.jsonl").toStdString()), testing::Not(HasSubstr("another")));
  EXPECT_FALSE(undo->isEnabled());
  QTest::keyClick(entries, Qt::Key_Z, Qt::ControlModifier | Qt::ShiftModifier);
  ASSERT_TRUE(WaitFor([&] { return decided.count() == 3; }));
  EXPECT_TRUE(Excluded("station:S1"));
  EXPECT_EQ(entries->item(2, 5)->text(), "was moved");  // with its own reason
  EXPECT_FALSE(Child<QAction>(window_.get(), "edit.redo")->isEnabled());
}

}  // namespace
}  // namespace trigpoint

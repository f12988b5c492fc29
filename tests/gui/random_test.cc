// A hundred actions drawn at random with a fixed seed: nothing crashes, and after each the numbers of the selection are
// the same on the card, in the table and in the scene, and what is marked in table and scene belongs to the selection.
// TRIGPOINT_GUI_RESULTS names another project with results (it is copied), TRIGPOINT_GUI_ACTIONS another number of
// actions, TRIGPOINT_GUI_SEED another seed.
#include <QAction>
#include <QCheckBox>
#include <QComboBox>
#include <QListWidget>
#include <QSignalSpy>
#include <QSortFilterProxyModel>
#include <QSpinBox>
#include <QTableView>
#include <QTableWidget>
#include <filesystem>
#include <functional>
#include <map>
#include <random>
#include <set>
#include <tuple>

#include "app/desktop/charts_desk.h"
#include "app/desktop/decisions.h"
#include "app/desktop/images_desk.h"
#include "app/desktop/overview.h"
#include "app/desktop/overview_desk.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/plan_desk.h"
#include "app/desktop/site_tree.h"
#include "app/desktop/station_card.h"
#include "datasets/io/text.h"
#include "datasets/project/marking.h"
#include "eval/text/method_name.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

constexpr int kActions = 100;
constexpr unsigned kSeed = 20260;
constexpr double kRounding = 0.00056;  // three decimals on the card, four in the table

class RandomSession : public testing::Test {
 protected:
  void SetUp() override {
    QSettings().clear();
    const QString results = qEnvironmentVariable("TRIGPOINT_GUI_RESULTS");
    if (results.isEmpty()) {
      ResultsSiteSize size;
      size.images = 48, size.panoramas = 12;
      WriteResultsSite(site_.path().toStdString(), size);
      WriteTwoComparisons();
    } else {
      std::filesystem::copy(results.toStdString(), site_.path().toStdString(),
                            std::filesystem::copy_options::recursive);
    }
    window_ = OpenWindow(site_.path());
    window_->ShowDesk("scene");
    ASSERT_TRUE(WaitFor([&] { return window_->scene()->HasScene(); }));
    window_->ShowDesk("tables");
    ASSERT_TRUE(WaitFor([&] { return window_->tables()->Choose("evaluate/errors"); }));
    view_ = Child<QTableView>(window_.get(), "tables.view");
    ASSERT_TRUE(WaitFor([&] { return view_->model()->rowCount() > 0; }));
    ASSERT_TRUE(WaitFor([&] { return window_->overview()->overview() != nullptr; }));
    MakeActions();
  }
  // Beside the errors against control those of three panoramas against the tag map: the first are shown everywhere.
  void WriteTwoComparisons() {
    const std::filesystem::path out = site_.path().toStdString() + "/results/evaluate";
    std::string errors = ReadTextFile(out / "errors.csv");
    for (const char* panorama : {"000", "001", "002"}) {
      errors += std::string("run1,,single,S") + panorama[2] + ",panoramas/p" + panorama + ".jpg," + panorama[2] +
                ",survey,absolute,localized,,0.5,0.5,0,0.5,0,0,,0.05,0.05,0.08,1,3\n";
    }
    WriteFileAtomically(out / "errors.csv", errors);
    const char* group = R"({"variant": "", "method": "single", "reference": "%1", "kind": "absolute",
      "shares_evidence": false, "answers": %2, "attempts": %2, "error_3d": {"over_answers": {"median_m": 0.1}}})";
    const QString groups = QString(group).arg("survey").arg(3) + ", " + QString(group).arg("control").arg(12);
    WriteFileAtomically(out / "summary.json",
                        R"({"schema": "trigpoint evaluate 1", "groups": [)" + groups.toStdString() + "]}");
  }
  int Draw(int below) { return below <= 0 ? 0 : static_cast<int>(random_() % static_cast<unsigned>(below)); }
  QString AnyStation() {
    const auto& stations = window_->workspace()->snapshot()->stations;
    return QString::fromStdString("station:" +
                                  stations[static_cast<size_t>(Draw(static_cast<int>(stations.size())))].name);
  }
  void ClickMark(PictureView* view) {
    std::vector<QPoint> places;
    for (const PictureMark& mark : view->marks()) {
      const QPoint at = view->WidgetAt(mark.points[0]).toPoint();
      if (!mark.object.isEmpty() && view->rect().contains(at)) places.push_back(at);
    }
    if (!places.empty())
      QTest::mouseClick(view, Qt::LeftButton, {}, places[static_cast<size_t>(Draw(static_cast<int>(places.size())))]);
  }
  // In the image that is shown: sets a mark, moves or removes one that is there.
  QPoint AnyPlace() {
    const QImage& picture = window_->images()->left()->image();
    return window_->images()
        ->left()
        ->WidgetAt({5.0 + Draw(picture.width() - 10), 5.0 + Draw(picture.height() - 10)})
        .toPoint();
  }
  bool ShowPicture() {
    window_->ShowDesk("images");
    PictureView* view = window_->images()->left();
    const bool there = WaitFor([&] { return !view->image().isNull(); }, 5000);
    view->Fit();
    return there;
  }
  void SetMark() {
    if (!ShowPicture()) return;
    Child<QComboBox>(window_.get(), "images.point")->setCurrentText(QString("drawn%1").arg(Draw(3)));
    Child<QAbstractButton>(window_.get(), "images.mark")->setChecked(true);
    QTest::mouseClick(window_->images()->left(), Qt::LeftButton, {}, AnyPlace());
  }
  void MoveMark() {
    if (!ShowPicture()) return;
    PictureView* view = window_->images()->left();
    for (const PictureMark& mark : view->marks()) {
      if (!mark.object.startsWith("mark:")) continue;
      return Drag(view, view->WidgetAt(mark.points[0]).toPoint(), AnyPlace());
    }
  }
  void RemoveMark() {
    if (!ShowPicture()) return;
    for (const PictureMark& mark : window_->images()->left()->marks()) {
      if (!mark.object.startsWith("mark:")) continue;
      Child<QComboBox>(window_.get(), "images.point")->setCurrentText(mark.object.mid(5));
      return Child<QAbstractButton>(window_.get(), "images.remove")->click();
    }
  }
  using PlacedMarks = std::map<std::string, std::pair<double, double>>;  // pixels, by point
  PlacedMarks MarksDrawn() const;
  PlacedMarks MarksInFile() const;
  void CheckMarks();
  void ToggleOne(const char* name) {
    auto* list = Child<QListWidget>(window_.get(), name);
    if (list->count() == 0) return;
    QListWidgetItem* item = list->item(Draw(list->count()));
    item->setCheckState(item->checkState() == Qt::Checked ? Qt::Unchecked : Qt::Checked);
  }
  void MakeActions();
  // Which answer a number is of: the title of its group on the card, run, panorama.
  using Answer = std::tuple<QString, QString, QString>;
  static QString Against(const QString& method, const std::string& reference) {
    return method + ", against " + QString::fromStdString(ReferenceName(reference));
  }
  QString ObjectOf(const QModelIndex& row) const { return row.data(DataTableModel::kObjectRole).toString(); }
  // 3D errors as shown.
  std::map<Answer, double> OnCard() const;
  std::map<Answer, double> InTable(const QString& object) const;
  void CheckMarked();
  void CheckNumbers();
  void CheckMatrix(const QString& object);

  QTemporaryDir site_;
  std::unique_ptr<MainWindow> window_;
  QTableView* view_ = nullptr;
  std::mt19937 random_{qEnvironmentVariableIsSet("TRIGPOINT_GUI_SEED")
                           ? static_cast<unsigned>(qEnvironmentVariableIntValue("TRIGPOINT_GUI_SEED"))
                           : kSeed};
  std::vector<std::pair<const char*, std::function<void()>>> actions_;
  int compared_ = 0, in_scene_ = 0, marks_ = 0;
};

void RandomSession::MakeActions() {
  Workspace* workspace = window_->workspace();
  actions_ = {
      {"desk", [this] { window_->ShowDesk(kDesks[Draw(static_cast<int>(std::size(kDesks)))]); }},
      {"station", [this, workspace] { workspace->Select(AnyStation()); }},
      {"panorama",
       [this, workspace] {
         const auto& all = workspace->snapshot()->references;
         workspace->Select(
             QString::fromStdString("panorama:" + all[static_cast<size_t>(Draw(static_cast<int>(all.size())))].name));
       }},
      {"tag",
       [this, workspace] {
         const auto& tags = workspace->snapshot()->tags;
         workspace->Select("tag:" + QString::number(tags[static_cast<size_t>(Draw(static_cast<int>(tags.size())))]));
       }},
      {"row",
       [this] {
         window_->ShowDesk("tables");
         ClickRow(view_, Draw(view_->model()->rowCount()));
       }},
      {"sort",
       [this] {
         view_->sortByColumn(Draw(view_->model()->columnCount()),
                             Draw(2) == 0 ? Qt::AscendingOrder : Qt::DescendingOrder);
       }},
      {"plan",
       [this] {
         window_->ShowDesk("overview");
         ClickMark(window_->overview()->plan());
       }},
      {"drawn plan",
       [this] {
         window_->ShowDesk("plan");
         ClickMark(window_->plan()->map());
       }},
      {"chart",
       [this] {
         window_->ShowDesk("charts");
         auto* list = Child<QListWidget>(window_.get(), "charts.list");
         WaitFor([&] { return list->count() > 0; }, 3000);
         list->setCurrentRow(Draw(list->count()));
         ClickMark(window_->charts()->view());
       }},
      {"image",
       [this] {
         window_->ShowDesk("images");
         Child<QListWidget>(window_.get(), "images.list")
             ->setCurrentRow(Draw(Child<QListWidget>(window_.get(), "images.list")->count()));
       }},
      {"detection",
       [this] {
         window_->ShowDesk("images");
         ClickMark(window_->images()->left());
       }},
      {"next image", [this] { Child<QAbstractButton>(window_.get(), "images.next")->click(); }},
      {"pick",
       [this] {
         window_->ShowDesk("scene");
         const QPointF at = window_->scene()->PlaceOf(AnyStation().replace("station:", "panorama:"));
         window_->scene()->PickAt(at.x() > 0 ? at.x() : 200 + Draw(300), at.y() > 0 ? at.y() : 100 + Draw(200));
       }},
      {"inside",
       [this, workspace] {
         window_->ShowDesk("scene");
         const auto& all = workspace->snapshot()->references;
         window_->scene()->StepInside(
             QString::fromStdString(all[static_cast<size_t>(Draw(static_cast<int>(all.size())))].name));
         QTest::qWait(200);
       }},
      {"outside", [this] { window_->scene()->StepOutside(); }},
      {"measure", [this] { Child<QCheckBox>(window_.get(), "scene.measure")->toggle(); }},
      {"layer", [this] { ToggleOne("scene.layers"); }},
      {"run drawn", [this] { ToggleOne("scene.runs"); }},
      {"filter", [this] { Child<QSpinBox>(window_.get(), "scene.least_images")->setValue(Draw(6)); }},
      {"mode", [this] { window_->scene()->SetMode(Draw(2) == 0 ? "plan" : "orbit"); }},
      {"zoom",
       [this] {
         window_->scene()->ZoomAt({100.0 + Draw(400), 100.0 + Draw(200)}, Draw(2) == 0 ? 1.5 : 0.7);
       }},
      {"unit", [this, workspace] { workspace->SetUnit(Draw(2) == 0 ? "ft" : "m"); }},
      {"theme", [this] { window_->SetTheme(Draw(2) == 0 ? "dark" : "light"); }},
      {"size", [this] { Draw(2) == 0 ? window_->resize(1024, 700) : window_->resize(1400, 900); }},
      {"reload", [workspace] { workspace->Reload(); }},
      {"views", [this] { Child<QCheckBox>(window_.get(), "card.views")->toggle(); }},
      {"compare", [this] { Child<QComboBox>(window_.get(), "compare.b")->setCurrentIndex(Draw(2)); }},
      {"exclude", [this] { window_->decisions()->Decide("exclude", AnyStation(), "drawn by lot"); }},
      {"undo", [this] { window_->decisions()->Undo(); }},
      {"redo", [this] { window_->decisions()->Redo(); }},
      {"mark", [this] { SetMark(); }},
      {"mark again", [this] { SetMark(); }},
      {"move mark", [this] { MoveMark(); }},
      {"remove mark", [this] { RemoveMark(); }},
      {"undo here", [this] { Child<QAction>(window_.get(), "edit.undo")->trigger(); }},
      {"redo here", [this] { Child<QAction>(window_.get(), "edit.redo")->trigger(); }},
      {"undo mark", [this] { window_->images()->Undo(); }},
      {"redo mark", [this] { window_->images()->Redo(); }},
      {"close problem", [this] { window_->problem()->hide(); }}};
}

std::map<RandomSession::Answer, double> RandomSession::OnCard() const {
  std::map<Answer, double> answers;
  const auto* table = Child<QTableWidget>(window_.get(), "card.table");
  QString group;
  for (int row = 0; row < table->rowCount(); ++row) {
    // A station's panoramas have titles of their own below that of their group.
    const QString of = table->item(row, 0)->data(Qt::UserRole).toString();
    const bool panorama = window_->card()->object().startsWith("station:") && of.startsWith("panorama:");
    if (table->columnSpan(row, 0) > 1 && !panorama) group = table->item(row, 0)->toolTip();
    if (table->columnSpan(row, 0) > 1 || table->columnSpan(row, 1) > 1) continue;  // a title, or not answered
    const QTableWidgetItem* run = table->item(row, 0);
    const bool first =
        answers.emplace(Answer(group, run->text(), run->toolTip()), table->item(row, 1)->text().toDouble()).second;
    EXPECT_TRUE(first) << group.toStdString() << " of " << run->toolTip().toStdString() << " twice";
  }
  return answers;
}

std::map<RandomSession::Answer, double> RandomSession::InTable(const QString& object) const {
  std::map<Answer, double> answers;
  std::map<QString, int> columns;
  const auto* model = view_->model();
  for (int c = 0; c < model->columnCount(); ++c) {
    columns[model->headerData(c, Qt::Horizontal).toString().section(' ', 0, 0)] = c;
  }
  for (int row = 0; row < model->rowCount(); ++row) {
    const auto cell = [&](const char* column) { return model->index(row, columns.at(column)).data().toString(); };
    if (cell(object.startsWith("station:") ? "station" : "panorama") != object.section(':', 1)) continue;
    if (cell("status") != "localized" || !cell("variant").isEmpty() || cell("error_3d").isEmpty()) continue;
    const QString group = cell("kind") + ", " + Against(cell("method"), cell("reference").toStdString());
    answers[{group, cell("run"), cell("panorama")}] = cell("error_3d").toDouble();
  }
  return answers;
}

// What the scene surrounds and the rows that the table has selected are the selection, or belong to it.
void RandomSession::CheckMarked() {
  const auto& related = window_->workspace()->related();
  const auto belongs = [&](const QString& object) { return related.count(object.toStdString()) > 0; };
  const QStringList highlighted = window_->scene()->Highlighted();
  for (const QString& object : highlighted) EXPECT_TRUE(belongs(object)) << "highlighted " << object.toStdString();
  for (const std::string& object : related) {
    const QString name = QString::fromStdString(object);
    if (window_->scene()->ErrorsAt(name).empty()) continue;
    EXPECT_TRUE(highlighted.contains(name)) << object << " is not highlighted";
  }
  const QTreeWidgetItem* entry = window_->tree()->currentItem();
  const QString marked = entry == nullptr ? QString() : entry->data(0, Qt::UserRole).toString();
  EXPECT_TRUE(marked.isEmpty() || belongs(marked)) << "in the tree: " << marked.toStdString();
  bool any = false;
  for (int row = 0; row < view_->model()->rowCount(); ++row) any |= belongs(ObjectOf(view_->model()->index(row, 0)));
  const QModelIndexList rows = view_->selectionModel()->selectedRows();
  EXPECT_EQ(!rows.isEmpty(), any) << rows.size() << " rows are selected";
  for (const QModelIndex& row : rows) EXPECT_TRUE(belongs(ObjectOf(row))) << "row of " << ObjectOf(row).toStdString();
}

void RandomSession::CheckNumbers() {
  const QString object = window_->card()->object();
  if (object.isEmpty()) return;
  EXPECT_EQ(window_->workspace()->related().count(object.toStdString()), 1U) << "on the card";
  const std::map<Answer, double> on_card = OnCard();
  std::map<Answer, double> in_table = InTable(object);
  if (!Child<QCheckBox>(window_.get(), "card.views")->isChecked()) {
    for (auto it = in_table.begin(); it != in_table.end();) {
      it = std::get<0>(it->first).contains("(G1)") ? in_table.erase(it) : std::next(it);
    }
  }
  EXPECT_EQ(on_card.size(), in_table.size());
  for (const auto& [answer, shown] : on_card) {
    ASSERT_EQ(in_table.count(answer), 1U) << std::get<0>(answer).toStdString() << std::get<1>(answer).toStdString();
    EXPECT_NEAR(shown, in_table.at(answer), kRounding) << std::get<0>(answer).toStdString();
    ++compared_;
  }
  for (const SceneError& error : window_->scene()->ErrorsAt(object)) {
    const QString against = ", " + Against(QString::fromStdString(MethodName(error.method)), error.reference);
    int found = 0;
    for (const auto& [answer, shown] : on_card) {
      const auto& [group, run, panorama] = answer;
      if (!group.endsWith(against) || run.toStdString() != error.run || panorama.toStdString() != error.panorama)
        continue;
      ++found;
      EXPECT_NEAR(shown, error.difference.norm() / window_->workspace()->metres_per_unit(), kRounding)
          << error.run << against.toStdString();
    }
    EXPECT_EQ(found, 1) << error.run << against.toStdString() << ": of the scene, on the card";
    ++in_scene_;
  }
  CheckMatrix(object);
}

RandomSession::PlacedMarks RandomSession::MarksDrawn() const {
  PlacedMarks marks;
  for (const PictureMark& mark : window_->images()->left()->marks()) {
    if (!mark.object.startsWith("mark:")) continue;
    const bool first =
        marks.emplace(mark.object.mid(5).toStdString(), std::pair(mark.points[0].x(), mark.points[0].y())).second;
    EXPECT_TRUE(first) << mark.object.toStdString() << " twice";
  }
  return marks;
}

RandomSession::PlacedMarks RandomSession::MarksInFile() const {
  PlacedMarks marks;
  const std::string here = "/" + (window_->images()->run() + "/" + window_->images()->image()).toStdString();
  for (const PointMark& mark : ReadPointMarks(*window_->workspace()->snapshot()->project)) {
    if (mark.image.ends_with(here)) marks[mark.point] = {mark.pixel.x(), mark.pixel.y()};
  }
  return marks;
}

// The marks that the image shows are those of the file, once they are written.
void RandomSession::CheckMarks() {
  if (window_->desk() != "images") return;
  EXPECT_TRUE(WaitFor([&] { return MarksDrawn() == MarksInFile(); }))
      << MarksDrawn().size() << " are drawn, " << MarksInFile().size() << " are in the file";
  marks_ += static_cast<int>(MarksDrawn().size());
}

// What the scene draws at an object are the errors of the overview's matrix.
void RandomSession::CheckMatrix(const QString& object) {
  const std::vector<SceneError> drawn = window_->scene()->ErrorsAt(object);
  if (drawn.empty()) return;
  std::map<std::pair<std::string, std::string>, double> matrix;
  for (const ErrorRecord& e : window_->overview()->overview()->matrix) {
    const std::string name = object.section(':', 1).toStdString();
    if (e.Answered() && (object.startsWith("station:") ? e.station : e.panorama) == name)
      matrix[{e.run, e.panorama}] = *e.error_3d_m;
  }
  EXPECT_EQ(drawn.size(), matrix.size());
  for (const SceneError& error : drawn) {
    const auto of_matrix = matrix.find({error.run, error.panorama});
    ASSERT_NE(of_matrix, matrix.end()) << error.run << " " << error.panorama;
    EXPECT_NEAR(error.difference.norm(), of_matrix->second, 1e-4) << error.run << " " << error.panorama;
  }
}

TEST_F(RandomSession, AHundredActionsLeaveTheSameNumbersEverywhere) {
  const int actions = qEnvironmentVariableIntValue("TRIGPOINT_GUI_ACTIONS") > 0
                          ? qEnvironmentVariableIntValue("TRIGPOINT_GUI_ACTIONS")
                          : kActions;
  SetMark();  // some seeds draw none
  CheckMarks();
  for (int action = 0; action < actions && !HasFailure(); ++action) {
    const auto& [name, act] = actions_[static_cast<size_t>(Draw(static_cast<int>(actions_.size())))];
    SCOPED_TRACE(name);
    act();
    QTest::qWait(20);
    ASSERT_TRUE(WaitFor([&] { return !window_->workspace()->opening(); })) << action;
    // What was read anew is there again.
    ASSERT_TRUE(WaitFor([&] { return window_->overview()->overview() != nullptr && view_->model()->rowCount() > 0; }))
        << action;
    SCOPED_TRACE(QString("action %1, selected: %2").arg(action).arg(window_->workspace()->selected()).toStdString());
    CheckMarked();
    CheckNumbers();
    CheckMarks();
  }
  EXPECT_GT(compared_, actions / 4);
  EXPECT_GT(in_scene_, actions / 4);
  EXPECT_GT(marks_, 0);
}

}  // namespace
}  // namespace trigpoint

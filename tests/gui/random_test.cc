// A hundred actions drawn at random with a fixed seed: nothing crashes, and after each the numbers of the selection are
// the same on the card, in the table and in the scene. TRIGPOINT_GUI_RESULTS names another project with results (a
// copy: it is reviewed), TRIGPOINT_GUI_ACTIONS another number of actions.
#include <QCheckBox>
#include <QComboBox>
#include <QListWidget>
#include <QSignalSpy>
#include <QSortFilterProxyModel>
#include <QTableView>
#include <QTableWidget>
#include <functional>
#include <map>
#include <random>

#include "app/desktop/charts_desk.h"
#include "app/desktop/decisions.h"
#include "app/desktop/images_desk.h"
#include "app/desktop/overview_desk.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/station_card.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

constexpr int kActions = 100;
constexpr unsigned kSeed = 20260;
constexpr double kRounding = 0.00056;  // three decimals on the card, four in the table
constexpr const char* kDesks[] = {"overview", "run",    "scene",     "images",      "tables", "charts",
                                  "compare",  "review", "panoramas", "calibration", "print",  "check"};

class RandomSession : public testing::Test {
 protected:
  void SetUp() override {
    QSettings().clear();
    QString dir = qEnvironmentVariable("TRIGPOINT_GUI_RESULTS");
    if (dir.isEmpty()) {
      dir = site_.path();
      ResultsSiteSize size;
      size.images = 48, size.panoramas = 12;
      WriteResultsSite(dir.toStdString(), size);
    }
    window_ = OpenWindow(dir);
    window_->ShowDesk("scene");
    ASSERT_TRUE(WaitFor([&] { return window_->scene()->HasScene(); }));
    window_->ShowDesk("tables");
    ASSERT_TRUE(WaitFor([&] { return window_->tables()->Choose("evaluate/errors"); }));
    view_ = Child<QTableView>(window_.get(), "tables.view");
    ASSERT_TRUE(WaitFor([&] { return view_->model()->rowCount() > 0; }));
    ASSERT_TRUE(WaitFor([&] { return window_->overview()->overview() != nullptr; }));
    MakeActions();
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
  void MakeActions();
  void Check(int action);
  // Of the rows of the table of errors for these the 3D error, as shown, that is nearest to the one on the card.
  double InTable(const std::string& run, const QString& station, const QString& kind, const QString& method,
                 double on_card) const;

  QTemporaryDir site_;
  std::unique_ptr<MainWindow> window_;
  QTableView* view_ = nullptr;
  std::mt19937 random_{kSeed};
  std::vector<std::pair<const char*, std::function<void()>>> actions_;
  int compared_ = 0;
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
      {"close problem", [this] { window_->problem()->hide(); }}};
}

double RandomSession::InTable(const std::string& run, const QString& station, const QString& kind,
                              const QString& method, double on_card) const {
  double nearest = -1;
  std::map<QString, int> columns;
  const auto* model = view_->model();
  for (int c = 0; c < model->columnCount(); ++c) {
    columns[model->headerData(c, Qt::Horizontal).toString().section(' ', 0, 0)] = c;
  }
  const auto cell = [&](int row, const char* column) { return model->index(row, columns[column]).data().toString(); };
  for (int row = 0; row < model->rowCount(); ++row) {
    if (cell(row, "run").toStdString() == run && cell(row, "station") == station && cell(row, "kind") == kind &&
        cell(row, "method") == method && !cell(row, "error_3d").isEmpty()) {
      const double shown = cell(row, "error_3d").toDouble();
      if (nearest < 0 || std::abs(shown - on_card) < std::abs(nearest - on_card)) nearest = shown;
    }
  }
  return nearest;
}

void RandomSession::Check(int action) {
  const StationCard* card = window_->card();
  const auto* table = Child<QTableWidget>(window_.get(), "card.table");
  const QString object = card->object();
  bool related = object.isEmpty();
  for (const std::string& of : window_->workspace()->related()) related |= object.toStdString() == of;
  EXPECT_TRUE(related) << action << ": the card is of " << object.toStdString();
  if (object.isEmpty()) return;
  const double metres = window_->workspace()->metres_per_unit();
  std::map<std::string, std::vector<double>> of_run;
  QString group;
  for (int row = 0; row < table->rowCount(); ++row) {
    if (table->columnSpan(row, 0) > 1) {
      group = table->item(row, 0)->text();
      continue;
    }
    if (table->columnSpan(row, 1) > 1) continue;  // not answered
    const std::string run = table->item(row, 0)->text().toStdString();
    const double shown = table->item(row, 1)->text().toDouble();
    of_run[run].push_back(shown * metres);
    if (!object.startsWith("station:") || group.startsWith("relative")) continue;
    const double in_table = InTable(run, object.mid(8), group.section(", ", 0, 0), group.section(", ", 1, 1), shown);
    EXPECT_NEAR(shown, in_table, kRounding) << action << " " << object.toStdString() << " " << run;
    ++compared_;
  }
  for (const auto& [run, error] : window_->scene()->ErrorsAt(object)) {
    const auto& values = of_run[run];
    EXPECT_TRUE(std::any_of(values.begin(), values.end(), [&](double v) { return std::abs(v - error) < kRounding; }))
        << action << " " << object.toStdString() << " " << run << ": the scene has " << error;
  }
}

TEST_F(RandomSession, AHundredActionsLeaveTheSameNumbersEverywhere) {
  const int actions = qEnvironmentVariableIntValue("TRIGPOINT_GUI_ACTIONS") > 0
                          ? qEnvironmentVariableIntValue("TRIGPOINT_GUI_ACTIONS")
                          : kActions;
  for (int action = 0; action < actions && !HasFailure(); ++action) {
    const auto& [name, act] = actions_[static_cast<size_t>(Draw(static_cast<int>(actions_.size())))];
    SCOPED_TRACE(name);
    act();
    QTest::qWait(20);
    ASSERT_TRUE(WaitFor([&] { return !window_->workspace()->opening(); })) << action;
    // What was read anew is there again.
    ASSERT_TRUE(WaitFor([&] { return window_->overview()->overview() != nullptr && view_->model()->rowCount() > 0; }))
        << action;
    Check(action);
  }
  EXPECT_GT(compared_, actions / 4);
  QFile::remove(window_->workspace()->dir() + "/review.jsonl");
}

}  // namespace
}  // namespace trigpoint

// Texts of the report's code in a window of another language than English.
#include <gmock/gmock.h>

#include <QApplication>
#include <QLabel>
#include <QTableWidget>
#include <QTranslator>

#include "app/desktop/overview.h"
#include "app/desktop/overview_desk.h"
#include "app/desktop/report_text.h"
#include "app/desktop/report_words.h"
#include "datasets/io/text.h"
#include "eval/report/chapters.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

class German {
 public:
  German() {
    loaded_ = translator_.load("trigpoint_de", QApplication::applicationDirPath() + "/../share/trigpoint");
    if (loaded_) QApplication::installTranslator(&translator_);
  }
  ~German() {
    if (loaded_) QApplication::removeTranslator(&translator_);
  }
  bool loaded() const { return loaded_; }

 private:
  QTranslator translator_;
  bool loaded_ = false;
};

TEST(ReportText, IsTranslatedWholeOrNotAtAll) {
  EXPECT_EQ(ReportText("median of 8 answers; worst 0.05 m."), "median of 8 answers; worst 0.05 m.");
  const German german;
  ASSERT_TRUE(german.loaded()) << "build the target trigpoint_languages";
  EXPECT_EQ(ReportText("3 of 9 located"), "3 von 9 lokalisiert");
  EXPECT_EQ(ReportText("3 of 9 located, median absolute error; not georeferenced"),
            "3 von 9 lokalisiert, Median des Fehlers, absolut; nicht georeferenziert");
  EXPECT_EQ(ReportText("median of 8 answers; worst 0.05 m. In site coordinates, against surveyed control"),
            "Median von 8 Antworten; größter 0.05 m. In Koordinaten des Messgebiets, gegen eingemessene Passpunkte");
  EXPECT_EQ(ReportText("Refused: run1 at S36 p_1.jpg, only 1 match with points of the run"),
            "Abgelehnt: run1 an S36 p_1.jpg, nur 1 Zuordnung zu Punkten der Fahrt");
  EXPECT_EQ(
      ReportText("Default gates (trigpoint.yaml sets none): undecided, 3 of 4 passed; undecided: "
                 "evaluate.max_median_m <= 0.05 m (panorama (G2), absolute, against surveyed control): 0.02 m, "
                 "95 % interval 0.01 to 0.06 m, n = 9 answers; about 4 more stations would decide. And 1 more."),
      "Vorgegebene Grenzwerte (trigpoint.yaml setzt keine): unentschieden, 3 von 4 bestanden; unentschieden: "
      "evaluate.max_median_m <= 0.05 m (Panorama (G2), absolut, gegen eingemessene Passpunkte): 0.02 m, "
      "95-%-Intervall 0.01 bis 0.06 m, n = 9 Antworten; etwa 4 Stationen mehr würden entscheiden. Und 1 weitere.");
  // Nobody has translated the second half.
  EXPECT_EQ(ReportText("3 of 9 located; the moon was in the way"), "3 of 9 located; the moon was in the way");
  EXPECT_EQ(ReportText("Refused: run1 at S36, the moon was in the way"),
            "Refused: run1 at S36, the moon was in the way");
}

TEST(ReportText, EveryTextThatIsListedHasATranslation) {
  const German german;
  ASSERT_TRUE(german.loaded()) << "build the target trigpoint_languages";
  for (const char* text : ReportWords()) {
    EXPECT_TRUE(TranslatedReportText(QString::fromUtf8(text)).has_value()) << text;
  }
}

// Texts that are English sentences: names and numbers are left out.
void AddUntranslated(const std::string& text, std::vector<std::string>* untranslated) {
  const QString shown = QString::fromStdString(text);
  if (shown.count(' ') > 1 && !TranslatedReportText(shown)) untranslated->push_back(text);
}

void AddUntranslated(const Block& block, std::vector<std::string>* untranslated) {
  if (const auto* figure = std::get_if<Figure>(&block)) {
    const auto* drawing = std::get_if<Drawing>(&figure->content);
    if (drawing == nullptr) return;
    AddUntranslated(figure->caption, untranslated);
    for (const Shape& shape : drawing->shapes) AddUntranslated(shape.text, untranslated);
  } else if (const auto* facts = std::get_if<Facts>(&block)) {
    for (const Fact& fact : facts->facts) {
      for (const std::string& text : {fact.label, fact.value, fact.detail}) AddUntranslated(text, untranslated);
    }
  } else if (const auto* paragraph = std::get_if<Paragraph>(&block)) {
    AddUntranslated(paragraph->text, untranslated);
  } else if (const auto* heading = std::get_if<Heading>(&block)) {
    AddUntranslated(heading->text, untranslated);
  }
}

class LanguageTest : public ResultsWindowTest {
 protected:
  void SetUp() override {
    WriteFileAtomically(Path("trigpoint.yaml").toStdString(), "name: language\n");
    WriteFileAtomically(Path("results/evaluate/summary.json").toStdString(), kEvaluateSummary);
    ASSERT_TRUE(german_.loaded()) << "build the target trigpoint_languages";
    ResultsWindowTest::SetUp();
    ASSERT_TRUE(WaitFor([&] { return window_->findChild<QTableWidget*>("overview.matrix") != nullptr; }));
  }
  German german_;
};

TEST_F(LanguageTest, OverviewAndChartsAreTranslated) {
  const Snapshot& snapshot = *window_->workspace()->snapshot();
  const DisplayUnit unit = window_->workspace()->display_unit();
  std::vector<std::string> untranslated;
  const Overview overview = LoadOverview(snapshot, window_->workspace()->results(), unit);
  for (const Block& block : overview.verdict) AddUntranslated(block, &untranslated);
  AddUntranslated(overview.plan_caption, &untranslated);
  const ReportInput input = ReportInputOf(snapshot, true);
  ProgressSink progress;
  const ReportData data = ReadReportData(input, progress, {});
  std::vector<Block> blocks;
  const ChapterContext context{input, data, unit, {}, {}};
  AddAccuracy(context, &blocks);
  AddConsistency(context, &blocks);
  AddCameras(context, &blocks);
  AddRuns(context, &blocks);
  for (const Block& block : blocks) {
    if (std::holds_alternative<Figure>(block)) AddUntranslated(block, &untranslated);
  }
  EXPECT_THAT(untranslated, IsEmpty());
  QString words;
  for (const auto* label : window_->overview()->findChildren<QLabel*>()) words += label->text() + "\n";
  EXPECT_THAT(words.toStdString(), HasSubstr("Zuerst ansehen"));
  EXPECT_THAT(words.toStdString(), HasSubstr("absolut, gegen eingemessene Passpunkte"));
  Screenshot(window_.get(), "german");
}

}  // namespace
}  // namespace trigpoint

// Findings and advice while still on site: what is wrong is named, and nothing else.
#include <gmock/gmock.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <set>

#include "survey/field/advice.h"
#include "survey/field/findings.h"
#include "tests/survey/yard.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

// A lap and a bit round a yard, looking outwards at tags on its walls; three of them are known.
NetworkLayout Yard() {
  NetworkLayout layout;
  layout.sizes.size_m = 0.3;
  constexpr int kTags = 9;
  constexpr double kRadius = 6;
  for (int k = 0; k < kTags; ++k) {
    const double a = 2 * M_PI * k / kTags;
    AddTagOnWall(k, a, (kRadius + 4) * Eigen::Vector3d(std::cos(a), std::sin(a), 0) + Eigen::Vector3d(0, 0, 0.1 * k),
                 &layout);
  }
  layout.passes.push_back(Lap(60, 2.4 * M_PI, kRadius));
  return layout;
}

NetworkOptions Options() {
  NetworkOptions options;
  options.ties_per_image = 0;
  options.detected = 1;  // each tag is in as many pictures as geometry gives, whatever is drawn
  return options;
}

// The same pass again, on another day.
NetworkLayout TwoDays() {
  NetworkLayout layout = Yard();
  layout.passes.push_back(layout.passes.front());
  layout.passes.back().name = "second";
  layout.passes.front().date = "2026-05-12";
  layout.passes.back().date = "2026-05-13";
  return layout;
}

// What a check has of a survey's observations.
struct Scene {
  Site site;
  FieldFacts facts;
};

std::unique_ptr<Scene> SceneOf(const SurveyInput& input, const NetworkLayout& layout) {
  auto scene = std::make_unique<Scene>();
  FieldFacts& facts = scene->facts;
  facts.site = &scene->site;
  scene->site.tags = input.sizes;
  for (const SurveyRun& its : input.runs) {
    Run run;
    run.name = its.name;
    run.cameras = its.cameras;
    run.odometry = its.odometry;
    scene->site.runs.push_back(std::move(run));
  }
  for (size_t r = 0; r < input.runs.size(); ++r) {
    FieldRun run;
    run.run = &scene->site.runs[r];
    for (const ImageDetections& image : input.runs[r].images) {
      FieldPicture picture;
      picture.image = image.image;
      picture.stamp_ns = image.stamp_ns;
      picture.tags = image.detections;
      picture.quality = PictureQuality{120, 0, 0, 0.6, {}};
      run.pictures.push_back(picture);
    }
    facts.runs.push_back(std::move(run));
  }
  for (const auto& [id, pose] : layout.world_from_tag) {
    facts.planned[id] = {"station S" + std::to_string(id), pose.translation};
  }
  ProgressSink silent;
  facts.input = input;
  facts.map = SurveyTags(input, OptionsOfSurvey(Options()), 1, silent, CancelToken());
  facts.layout = layout;
  facts.prediction = PredictNetwork(layout, Options(), 1, 1, CancelToken());
  return scene;
}

SurveyInput Recorded(const NetworkLayout& layout) {
  Random noise(5);
  return SimulateSurvey(layout, Options(), 1, &noise);
}

// The yard, with no picture that shows these tags.
SurveyInput RecordedWithout(const std::set<int>& tags) {
  SurveyInput input = Recorded(Yard());
  for (ImageDetections& image : input.runs[0].images) {
    std::erase_if(image.detections, [&](const TagDetection& d) { return tags.contains(d.id); });
  }
  return input;
}

// The findings that ask for something.
std::vector<std::string> Wrong(const FieldFacts& facts) {
  std::vector<std::string> texts;
  for (const auto& find : {FindInPictures, FindInMap}) {
    for (const SiteFinding& f : find(facts)) {
      if (f.light != Light::kGreen) texts.push_back(f.text.In());
    }
  }
  return texts;
}

TEST(Field, NothingIsWrongWithACompleteSite) {
  const auto scene = SceneOf(Recorded(TwoDays()), TwoDays());
  EXPECT_THAT(Wrong(scene->facts), testing::IsEmpty());
}

TEST(Field, ATagInNoPictureIsNamedAndComesFirst) {
  const SurveyInput input = RecordedWithout({5});
  const auto scene = SceneOf(input, Yard());
  EXPECT_THAT(Wrong(scene->facts), testing::ElementsAre(HasSubstr("tag 5 (station S5) is planned and in no picture")));
  const std::vector<Advice> advice = WhatNext(scene->facts, Options(), 3, 1, 1, CancelToken());
  ASSERT_FALSE(advice.empty());
  EXPECT_THAT(advice[0].what.In(), HasSubstr("Photograph tag 5 (station S5), "));
  EXPECT_THAT(advice[0].why, HasSubstr("in no picture"));
}

TEST(Field, LengthsAreInTheUnitAskedFor) {
  constexpr double kFoot = 0.3048;
  const LengthText text = "tag 5 is " + LengthText(Length{0.3048, 3}) + " off, from " + Length{3, 0, false} + " to " +
                          Length{5} + ", at most " + Length{0.02, -1};
  EXPECT_EQ(text.In(), "tag 5 is 0.305 m off, from 3 to 5 m, at most 0.02 m");
  EXPECT_EQ(text.In("ft", kFoot), "tag 5 is 1.000 ft off, from 10 to 16 ft, at most 0.06562 ft");
  const SurveyInput input = RecordedWithout({5});
  const auto scene = SceneOf(input, Yard());
  std::string metres, feet;
  for (const auto& find : {FindInPictures, FindInMap}) {
    for (const SiteFinding& f : find(scene->facts)) metres += f.text.In() + "\n", feet += f.text.In("ft", kFoot) + "\n";
  }
  for (const Advice& advice : WhatNext(scene->facts, Options(), 3, 1, 1, CancelToken())) {
    metres += advice.what.In() + "\n", feet += advice.what.In("ft", kFoot) + "\n";
  }
  EXPECT_THAT(metres, testing::ContainsRegex("[0-9] m[ ,;)\n]"));
  EXPECT_THAT(feet, testing::ContainsRegex("[0-9] ft[ ,;)\n]"));
  EXPECT_THAT(feet, testing::Not(testing::ContainsRegex("[0-9] m[ ,;)\n]")));
  EXPECT_THAT(feet, HasSubstr("from 10 to 16 ft and from two sides"));
}

TEST(Field, TagsInNoPictureShareOneLine) {
  const SurveyInput input = RecordedWithout({5, 6});
  EXPECT_THAT(Wrong(SceneOf(input, Yard())->facts),
              testing::ElementsAre(HasSubstr("tags 5 (station S5), 6 (station S6) are planned and in no picture")));
}

TEST(Field, TagsWithoutASizeAreNamed) {
  const NetworkLayout layout = Yard();
  const auto scene = SceneOf(Recorded(layout), layout);
  scene->site.tags.size_m = 0;
  scene->site.tags.sizes_m[3] = 0.3;
  EXPECT_THAT(Wrong(scene->facts), testing::ElementsAre(HasSubstr("tags 0, 1, 2, 4, 5, 6, 7, 8 have no size")));
}

TEST(Field, PanoramasThatCannotBeUsedAreNamed) {
  const NetworkLayout layout = Yard();
  const auto scene = SceneOf(Recorded(layout), layout);
  for (const char* name : {"whole.jpg", "cut.jpg", "bare.jpg"}) {
    Reference reference;
    reference.name = name;
    reference.geotag.has_position = reference.geotag.has_heading = reference.name != "bare.jpg";
    scene->site.references.push_back(reference);
  }
  scene->facts.unreadable["cut.jpg"] = "its end is missing";
  EXPECT_THAT(Wrong(scene->facts), testing::ElementsAre(HasSubstr("cut.jpg (its end is missing)"),
                                                        HasSubstr("1 of 3 panoramas have no position"),
                                                        HasSubstr("1 of 3 panoramas have no heading")));
}

TEST(Field, AnIdThatStandsTwiceIsNamed) {
  SurveyInput input = Recorded(Yard());
  for (ImageDetections& image : input.runs[0].images) {
    for (TagDetection& d : image.detections) d.id = d.id == 6 ? 2 : d.id;
  }
  const auto scene = SceneOf(input, Yard());
  EXPECT_THAT(Wrong(scene->facts), testing::Contains(HasSubstr("tag 2 stands at two places")));
  EXPECT_THAT(Wrong(scene->facts), testing::Contains(HasSubstr("tag 6 (station S6) is planned and in no picture")));
}

TEST(Field, ATagThatMovedBetweenDaysIsNamed) {
  NetworkLayout first = TwoDays(), second = TwoDays();
  second.world_from_tag[5].translation += Eigen::Vector3d(0.3, 0.4, 0);
  SurveyInput input = Recorded(first);
  input.runs[1] = Recorded(second).runs[1];
  const auto scene = SceneOf(input, first);
  EXPECT_THAT(Wrong(scene->facts), testing::Contains(HasSubstr("tag 5 moved")));
  // One cause, one finding: what points say on and beside it follows from it.
  EXPECT_THAT(Wrong(scene->facts), testing::Not(testing::Contains(HasSubstr("(moved)"))));
  ASSERT_TRUE(scene->facts.map);
  const size_t before = Wrong(scene->facts).size();
  const auto off = [&](int tag_id, double metres) {
    PointAgreement point;
    point.role = PointRole::kCheck;
    point.tag_id = tag_id;
    point.name = std::to_string(tag_id);
    point.error_m.x() = metres;
    scene->facts.map->points.push_back(point);
    scene->facts.map->warnings.push_back({"more than its sigma allows; check its coordinates", -1, point.name});
  };
  off(5, 0.5);
  EXPECT_EQ(Wrong(scene->facts).size(), before);
  off(8, 0.2);
  EXPECT_THAT(Wrong(scene->facts), testing::Contains("check point 8 is 0.200 m off the map, which may follow from tag "
                                                     "5: mend that first, then check again"));
  EXPECT_THAT(Wrong(scene->facts), testing::Not(testing::Contains(HasSubstr("check its coordinates"))));
}

TEST(Field, ARunThatOthersHoldHasNoOpenLoop) {
  NetworkLayout layout = TwoDays();
  for (PlannedPass& pass : layout.passes) pass.world_from_body.resize(pass.world_from_body.size() * 3 / 4);
  const auto scene = SceneOf(Recorded(layout), layout);
  for (trigpoint::Run& run : scene->site.runs) {
    for (TimedPose& pose : run.odometry.poses) pose.target_from_body.translation *= 2;
  }
  std::vector<std::string> green;
  for (const SiteFinding& f : FindInMap(scene->facts)) {
    if (f.light == Light::kGreen) green.push_back(f.text.In());
  }
  EXPECT_THAT(green, testing::Contains(HasSubstr("that other runs share; it needs no loop of its own")));
  EXPECT_THAT(green, testing::Not(testing::Contains(HasSubstr("the loop is open"))));
}

TEST(Field, ARunThatNeverLooksBackIsNamed) {
  NetworkLayout layout = Yard();
  auto& poses = layout.passes[0].world_from_body;
  poses.resize(poses.size() * 3 / 4);
  for (SurveyPoint& p : layout.points) p.sigma_h_m = 0.01;
  const auto open = SceneOf(Recorded(layout), layout);
  // 33 m are no long way: the run is stretched until a loop is due.
  for (TimedPose& pose : open->site.runs[0].odometry.poses) pose.target_from_body.translation *= 2;
  EXPECT_THAT(Wrong(open->facts), testing::Contains(HasSubstr("without coming back to a tag: the loop is open")));
  const auto closed = SceneOf(Recorded(Yard()), Yard());
  std::vector<std::string> texts;
  for (const SiteFinding& f : FindInMap(closed->facts)) texts.push_back(f.text.In());
  EXPECT_THAT(texts, testing::Contains(HasSubstr("loop closed")));
}

TEST(Field, ASiteWithoutTagsMissesNone) {
  NetworkLayout layout = Yard();
  auto& poses = layout.passes[0].world_from_body;
  poses.resize(poses.size() * 3 / 4);
  const auto scene = SceneOf(Recorded(layout), layout);
  for (TimedPose& pose : scene->site.runs[0].odometry.poses) pose.target_from_body.translation *= 2;
  scene->site.tags = {};
  scene->facts.planned.clear();
  scene->facts.layout.reset();
  scene->facts.prediction.reset();
  scene->facts.map.reset();
  for (FieldPicture& picture : scene->facts.runs[0].pictures) picture.tags.clear();
  EXPECT_THAT(Wrong(scene->facts), testing::Contains(HasSubstr("pass the beginning again at the end")));
  EXPECT_THAT(Wrong(scene->facts), testing::Not(testing::Contains(HasSubstr("tag"))));
  scene->site.references.resize(2);
  for (Reference& panorama : scene->site.references) panorama.geotag.has_position = true;
  EXPECT_THAT(Wrong(scene->facts), testing::Not(testing::Contains(HasSubstr("loop"))));
}

TEST(Field, ASmearedLensIsNamed) {
  const auto scene = SceneOf(Recorded(TwoDays()), TwoDays());
  for (FieldPicture& p : scene->facts.runs[1].pictures) p.quality->blur_px = 1.3;
  EXPECT_THAT(Wrong(scene->facts), testing::ElementsAre(HasSubstr("second: the lens is smeared or out of focus")));
  for (FieldPicture& p : scene->facts.runs[1].pictures) {
    p.quality->blur_px = 0.6;
    p.quality->cell_blur_px.fill(0.6);
    p.quality->cell_blur_px[8] = 1.5;
  }
  EXPECT_THAT(Wrong(scene->facts), testing::ElementsAre(HasSubstr("second: the lens is smeared in the lower right")));
}

TEST(Field, PicturesOfACameraThatStandsStillOrOfTrafficAreNotTooFast) {
  const auto scene = SceneOf(Recorded(TwoDays()), TwoDays());
  std::vector<FieldPair>& pairs = scene->facts.runs[0].pairs;
  pairs = {{"1.jpg", "2.jpg", 80, false, 0, 90}, {"2.jpg", "3.jpg", 0, false, 0, 40}};
  EXPECT_THAT(Wrong(scene->facts),
              testing::ElementsAre(testing::AllOf(HasSubstr("no motion of the camera explains"),
                                                  HasSubstr("2.jpg to 3.jpg"), testing::Not(HasSubstr("slower")))));
  pairs[1].matched = 15;
  EXPECT_THAT(Wrong(scene->facts), testing::ElementsAre(HasSubstr("walk and turn slower")));
  pairs[1].shared = 60;
  EXPECT_THAT(Wrong(scene->facts), testing::IsEmpty());
}

// The panorama's geotag says where its station's tag is to be found.
TEST(Field, ATagInNoPictureHasThePlaceOfItsStation) {
  const SurveyInput input = RecordedWithout({5});
  const auto scene = SceneOf(input, Yard());
  scene->facts.prediction->in_world = true;
  const Eigen::Vector3d at = *scene->facts.planned[5].world_m;
  scene->facts.planned[5].world_m.reset();
  scene->facts.layout->world_from_tag.erase(5);
  const auto first = [&] { return WhatNext(scene->facts, Options(), 1, 1, 1, CancelToken()).at(0); };
  EXPECT_FALSE(first().at);
  SurveyPoint point;
  point.role = PointRole::kGeotag;
  point.tag_id = 5;
  point.offset_m = Eigen::Vector3d(0, 0, 0.8);
  point.world_m = at + point.offset_m;
  scene->facts.input->points.push_back(point);
  ASSERT_TRUE(first().at);
  EXPECT_LT((*first().at - at).norm(), 1e-9);
  EXPECT_THAT(first().what.In(),
              testing::MatchesRegex("Photograph tag 5 \\(station S5\\), [0-9]+ m .* of tag [46], .*"));
}

TEST(Field, ControlThatNoPictureShowsIsNamed) {
  SurveyInput input = RecordedWithout({4});
  ASSERT_EQ(input.points.size(), 3U);
  EXPECT_THAT(Wrong(SceneOf(input, Yard())->facts),
              testing::Contains(HasSubstr("of 3 control points hold the map, three are needed to fix it: no picture "
                                          "shows the tag of control point 4; photograph it")));
  input = Recorded(Yard());
  input.points.pop_back();
  EXPECT_THAT(Wrong(SceneOf(input, Yard())->facts),
              testing::Contains(HasSubstr("of 2 control points hold the map, three are needed to fix it; measure 1 "
                                          "more")));
}

TEST(Field, ExposureAndUnreadablePicturesAreNamed) {
  const auto scene = SceneOf(Recorded(Yard()), Yard());
  std::vector<FieldPicture>& pictures = scene->facts.runs[0].pictures;
  for (size_t k = 0; k < pictures.size() / 2; ++k) pictures[k].quality->mean = 20;
  pictures.back().problem = "truncated";
  EXPECT_THAT(Wrong(scene->facts),
              testing::UnorderedElementsAre(HasSubstr("are too dark"), HasSubstr("1 picture cannot be used: ")));
}

TEST(Field, AnOpenRingOfPhotosIsNamed) {
  const auto scene = SceneOf(Recorded(Yard()), Yard());
  scene->facts.sets.push_back({"S3", 11, 11, false, 42, "IMG_9.jpg", "IMG_1.jpg", ""});
  EXPECT_THAT(Wrong(scene->facts),
              testing::ElementsAre(HasSubstr("photo set S3: the ring is open: 42 deg of the "
                                             "horizon are not seen, between IMG_9.jpg and IMG_1")));
  scene->facts.sets[0].gap_deg = 0;
  EXPECT_THAT(Wrong(scene->facts), testing::ElementsAre(HasSubstr("IMG_9.jpg and IMG_1.jpg do not match")));
  scene->facts.sets[0].full_turn = true;
  EXPECT_THAT(Wrong(scene->facts), testing::IsEmpty());
}

TEST(Field, OdometryElsewhereInTimeIsNamed) {
  const auto scene = SceneOf(Recorded(Yard()), Yard());
  for (TimedPose& pose : scene->site.runs[0].odometry.poses) pose.stamp_ns += 1'000'000'000'000;
  EXPECT_THAT(Wrong(scene->facts), testing::Contains(HasSubstr("odometry covers 0 of")));
  scene->facts.runs[0].clock = {0.4, 0.05, false, true};
  EXPECT_THAT(Wrong(scene->facts), testing::Contains(HasSubstr("time_offset_s: 0.40")));
}

TEST(Field, OdometryThatIsMeantOtherwiseIsNamedAndNothingElseIsBlamed) {
  const auto scene = SceneOf(Recorded(Yard()), Yard());
  const std::string problem = "odometry.tum contradicts the pictures: its quaternions are written w x y z";
  scene->facts.map.reset();
  FieldRun& run = scene->facts.runs[0];
  for (std::string* its : {&run.reading_problem, &run.unit_problem}) {
    *its = problem;
    EXPECT_THAT(Wrong(scene->facts), testing::Contains(HasSubstr(problem)));
    for (const SiteFinding& f : FindInMap(scene->facts)) {
      EXPECT_THAT(f.text.In(), testing::Not(HasSubstr("odometry agrees")));
      EXPECT_THAT(f.text.In(), testing::Not(HasSubstr("no tag with a size is in any picture")));
    }
    its->clear();
  }
}

// An offset far beyond its sigma that fits better than none, but not clearly, is no agreement.
TEST(Field, AClockThatRotationsDoNotDecideIsNotSaidToAgree) {
  const auto scene = SceneOf(Recorded(Yard()), Yard());
  const auto about_the_clock = [&] {
    std::vector<std::string> texts;
    for (const SiteFinding& f : FindInMap(scene->facts)) {
      if (f.topic == "clock") texts.push_back(f.text.In());
    }
    return texts;
  };
  scene->facts.runs[0].clock = {0.01, 0.05, true, false};
  EXPECT_THAT(about_the_clock(),
              testing::ElementsAre(HasSubstr("odometry's clock agrees with the pictures' (-0.01 s")));
  scene->facts.runs[0].clock = {3.3, 0.37, false, false};
  EXPECT_THAT(about_the_clock(), testing::ElementsAre(HasSubstr("do not show whether odometry's clock agrees")));
  scene->facts.runs[0].clock = {0.1, 0.9, true, false};
  EXPECT_THAT(about_the_clock(), testing::IsEmpty());
}

// Without tags the pictures and the way alone say what to do next.
TEST(Field, AdviceWithoutTagsNamesGapsAndTheOpenLoop) {
  const auto scene = SceneOf(Recorded(Yard()), Yard());
  FieldFacts& facts = scene->facts;
  facts.map.reset(), facts.layout.reset(), facts.prediction.reset(), facts.input.reset();
  facts.planned.clear();
  scene->site.tags = {};
  FieldRun& run = facts.runs[0];
  for (FieldPicture& picture : run.pictures) picture.tags.clear();
  const size_t half = run.pictures.size() / 2;
  for (size_t k = 1; k < run.pictures.size(); ++k) {
    const int shared = k == 3 ? 12 : k == half ? 9 : k == half + 1 ? 4 : 80;
    run.pairs.push_back({run.pictures[k - 1].image, run.pictures[k].image, shared, false, 0, 100});
  }
  for (TimedPose& pose : scene->site.runs[0].odometry.poses) pose.target_from_body.translation *= 2;  // 75 m and more
  const auto next = [&] { return WhatNext(facts, Options(), 3, 1, 1, CancelToken()); };
  const std::vector<Advice> advice = next();
  ASSERT_EQ(advice.size(), 3U);
  const auto way = [&](size_t from, size_t to) {
    return "from picture " + run.pictures[from].image + " to " + run.pictures[to].image + " again";
  };
  EXPECT_THAT(advice[0].what.In(), HasSubstr(way(half - 1, half + 1)));  // the weakest comes first
  EXPECT_THAT(advice[0].why, HasSubstr("share 4 features"));
  EXPECT_THAT(advice[1].what.In(), HasSubstr(way(2, 3)));
  EXPECT_THAT(advice[2].what.In(), HasSubstr("go on to where it began (picture " + run.pictures[0].image));
  run.pairs.push_back({run.pictures[0].image, run.pictures.back().image, 60, true, 0, 100});  // the loop is closed
  EXPECT_EQ(next().size(), 2U);
  for (FieldPair& pair : run.pairs) pair.shared = 80;
  EXPECT_THAT(next(), testing::IsEmpty());
  EXPECT_THAT(NothingNext(facts, false), HasSubstr("the findings say what to do"));
  EXPECT_THAT(NothingNext(facts, true), testing::Not(HasSubstr("would improve")));
}

TEST(Field, AdviceLeadsInFrontOfAWeakTagAndImprovesIt) {
  const auto scene = SceneOf(Recorded(Yard()), Yard());
  const std::vector<Advice> advice = WhatNext(scene->facts, Options(), 3, 1, 1, CancelToken());
  ASSERT_FALSE(advice.empty());
  double before = scene->facts.prediction->RmsSigma();
  for (const Advice& a : advice) {
    ASSERT_TRUE(a.from && a.at && a.heading_rad);
    EXPECT_LT(a.rms_after_m, scene->facts.prediction->RmsSigma());
    EXPECT_GE(a.rms_after_m, before * (&a == &advice.front() ? 0 : 1));  // the best comes first
    before = a.rms_after_m;
    const Eigen::Vector3d line = *a.at - *a.from;
    EXPECT_NEAR(std::atan2(line.x(), line.y()), *a.heading_rad, 1e-9);
    EXPECT_LT(line.head<2>().norm(), 6.01);
    EXPECT_LT(a.from->head<2>().norm(), a.at->head<2>().norm());  // on the side that the tag's print faces
  }
}

// What pictures showed takes the place of what geometry says.
TEST(Field, PredictionTakesTheObservationsThatAreThere) {
  NetworkLayout layout = Yard();
  const NetworkPrediction all = PredictNetwork(layout, Options(), 1, 1, CancelToken());
  std::vector<PlannedSight> seen = PlanSights(layout, Options(), 1);
  layout.passes[0].seen = seen;
  EXPECT_DOUBLE_EQ(PredictNetwork(layout, Options(), 1, 1, CancelToken()).RmsSigma(), all.RmsSigma());
  for (PlannedSight& sight : *layout.passes[0].seen) sight.detection.corner_sigma_px.fill(1);
  EXPECT_GT(PredictNetwork(layout, Options(), 1, 1, CancelToken()).RmsSigma(), 1.2 * all.RmsSigma());
  std::erase_if(*layout.passes[0].seen, [](const PlannedSight& sight) { return sight.tag_id == 3; });
  EXPECT_FALSE(PredictNetwork(layout, Options(), 1, 1, CancelToken()).tags[3].tied);
}

// Tilted squares drawn large, blurred, and shrunk: edges of known width.
cv::Mat Squares(double blur_px) {
  constexpr int kScale = 4;
  cv::Mat large(600 * kScale, 960 * kScale, CV_8U, cv::Scalar(60));
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 8; ++x) {
      const cv::RotatedRect square(cv::Point2f((60.F + 120 * x) * kScale, (60.F + 120 * y) * kScale),
                                   cv::Size2f(70 * kScale, 70 * kScale), 5);
      cv::Point2f corners[4];
      square.points(corners);
      const std::vector<cv::Point> points(corners, corners + 4);
      cv::fillConvexPoly(large, points, 200);
    }
  }
  const int size = 2 * cvCeil(5 * blur_px * kScale) + 1;  // by itself OpenCV cuts an 8-bit one at three sigmas
  large.convertTo(large, CV_32F);
  cv::GaussianBlur(large, large, {size, size}, blur_px * kScale);
  cv::Mat small;
  cv::resize(large, small, {960, 600}, 0, 0, cv::INTER_AREA);
  small.convertTo(small, CV_8U);
  return small;
}

TEST(PictureQuality, BlurIsThatOfTheEdges) {
  for (const double blur : {0.1, 0.4, 0.6, 1.0, 2.0, 3.0}) {
    const PictureQuality quality = MeasurePicture(Squares(blur));
    ASSERT_TRUE(quality.blur_px);
    // A pixel's square and the difference over two pixels add to the variance.
    const double sampled = std::sqrt(blur * blur + 1.0 / 12 + 4.0 / 12);
    EXPECT_NEAR(*quality.blur_px, sampled, 0.025 + 0.01 * blur);
    for (const auto& cell : quality.cell_blur_px) EXPECT_NEAR(*cell, sampled, 0.025 + 0.02 * blur);
  }
  EXPECT_FALSE(MeasurePicture(cv::Mat(600, 960, CV_8U, cv::Scalar(100))).blur_px);
}

TEST(PictureQuality, MotionInOneDirectionCounts) {
  cv::Mat moved;
  cv::blur(Squares(0.6), moved, {9, 1});
  // An edge moved over nine pixels is as steep as one that a Gaussian of 9 / sqrt(2 pi) px blurred.
  EXPECT_NEAR(*MeasurePicture(moved).blur_px, 9 / std::sqrt(2 * M_PI), 0.3);
}

TEST(PictureQuality, MaskedPartsDoNotCount) {
  const cv::Mat picture = Squares(0.6);
  const cv::Rect ignored(0, 0, picture.cols, 240);
  cv::Mat other = picture.clone(), mask(picture.size(), CV_8U, cv::Scalar(255));
  cv::GaussianBlur(other(ignored), other(ignored), {}, 3);
  cv::line(other, {100, 20}, {860, 20}, 0, 30);
  mask(ignored) = 0;
  const PictureQuality whole = MeasurePicture(picture), masked = MeasurePicture(other, mask);
  EXPECT_NEAR(*masked.blur_px, *whole.blur_px, 0.01);
  EXPECT_GT(*MeasurePicture(other).blur_px, *whole.blur_px + 0.05);
  EXPECT_NEAR(masked.mean, cv::mean(picture.rowRange(240, picture.rows))[0], 0.5);
  EXPECT_EQ(masked.dark, 0);
  EXPECT_GT(MeasurePicture(other).dark, 0.02);
  for (size_t k = 0; k < 3; ++k) EXPECT_FALSE(masked.cell_blur_px[k]);
  EXPECT_FALSE(MeasurePicture(picture, cv::Mat::zeros(picture.size(), CV_8U)).blur_px);
}

// A disc of a fifth of the width that is never sharp is named with its place, wherever it is.
TEST(PictureQuality, ASmearedSpotIsNamed) {
  cv::RNG random(4);
  const auto found = [&](cv::Point at, double sigma_px) {
    Site site;
    trigpoint::Run run;
    run.name = "walk";
    FieldFacts facts;
    facts.site = &site;
    facts.runs.push_back({&run});
    for (int k = 0; k < 24; ++k) {
      // Gravel: most edges of a third of the picture are sharp, even where the spot is.
      cv::Mat stones(150, 240, CV_8U), picture;
      random.fill(stones, cv::RNG::UNIFORM, 40, 200);
      cv::resize(stones, picture, {960, 600}, 0, 0, cv::INTER_NEAREST);
      if (sigma_px > 0) {
        cv::Mat smeared, disc = cv::Mat::zeros(picture.size(), CV_8U);
        cv::GaussianBlur(picture, smeared, {}, sigma_px);
        cv::circle(disc, at, picture.cols / 10, 255, cv::FILLED);
        smeared.copyTo(picture, disc);
      }
      FieldPicture seen;
      seen.image = std::to_string(k);
      seen.quality = MeasurePicture(picture);
      facts.runs[0].pictures.push_back(seen);
    }
    std::vector<std::string> texts;
    for (const SiteFinding& f : FindInPictures(facts)) {
      if (f.topic == "lens") texts.push_back(f.text.In());
    }
    return texts;
  };
  EXPECT_THAT(found({}, 0), testing::IsEmpty());
  for (const double sigma_px : {3.0, 8.0}) {
    EXPECT_THAT(found({500, 330}, sigma_px),
                testing::ElementsAre(HasSubstr("walk: the lens is smeared in a spot near the centre of the picture")));
  }
  EXPECT_THAT(found({150, 130}, 5), testing::ElementsAre(HasSubstr("at the upper left")));
  EXPECT_THAT(found({840, 450}, 5), testing::ElementsAre(HasSubstr("at the lower right")));
}

TEST(PictureQuality, DarkAndBrightPixelsAreCounted) {
  cv::Mat picture(100, 100, CV_8U, cv::Scalar(100));
  picture.rowRange(0, 25) = 0;
  picture.rowRange(25, 35) = 255;
  const PictureQuality quality = MeasurePicture(picture);
  EXPECT_NEAR(quality.dark, 0.25, 1e-9);
  EXPECT_NEAR(quality.bright, 0.1, 1e-9);
  EXPECT_NEAR(quality.mean, 90.5, 1e-9);
}

}  // namespace
}  // namespace trigpoint

#include <gmock/gmock.h>

#include <cmath>
#include <set>

#include "calib/base/error.h"
#include "datasets/io/tag_families.h"
#include "survey/tags/corner_refinement.h"
#include "survey/tags/detection.h"
#include "survey/tags/tag_family.h"
#include "tests/survey/tags_rendering.h"

namespace trigpoint {
namespace {

// A tag before the camera: distance for a given side in pixels, tilted by `tilt`, off the centre by a fraction of a
// pixel that depends on the seed.
Rigid3d TagPose(const Camera& camera, double size_m, double side_px, double tilt, uint64_t seed) {
  Random random(seed);
  const double z = size_m * camera.MeanFocal() / side_px;
  const Eigen::Vector3d w(tilt * std::cos(1.0 * seed), tilt * std::sin(1.0 * seed), random.Uniform(-0.6, 0.6));
  const double pixel = z / camera.MeanFocal();
  return {ExpSO3(w), Eigen::Vector3d(pixel * random.Uniform(-3, 3), pixel * random.Uniform(-3, 3), z)};
}

struct Errors {
  double radial = 0, square = 0, nees = 0, raw_radial = 0, gamma = 0;
  int n = 0, missed = 0, unrefined = 0;
};

Errors Measure(const Camera& camera, double side_px, TagPicture picture, bool with_camera, int count,
               double decimate = 1) {
  TagFamily family("tag36h11");
  Errors e;
  for (int i = 0; i < count; ++i) {
    picture.seed = 100 + i;
    const int id = 7 * i + 1;
    const Rigid3d pose = TagPose(camera, picture.size_m, side_px, 0.5, i + 1);
    const cv::Mat grey = RenderTag(family.Pattern(id), camera, pose, picture);
    DetectTagsOptions options;
    options.quad_decimate = decimate;
    ProgressSink progress;
    const CancelToken cancel;
    const auto detect = [&](bool refine) {
      options.refine = refine;
      return DetectTags(
                 1, [&](int64_t) { return grey; }, [&](int64_t) { return with_camera ? &camera : nullptr; }, options, 1,
                 progress, cancel)
          .images[0];
    };
    const ImageTags tags = detect(true), raw = detect(false);
    if (tags.detections.size() != 1 || tags.detections[0].id != id) {
      ++e.missed;
      continue;
    }
    const TagDetection& d = tags.detections[0];
    if (!d.refined) ++e.unrefined;
    std::array<Eigen::Vector2d, 4> truth;
    Eigen::Vector2d centre(0, 0);
    for (int k = 0; k < 4; ++k) {
      truth[k] = *camera.Project(pose * TagCorner(picture.size_m, k));
      centre += truth[k] / 4;
    }
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector2d out = (truth[k] - centre).normalized(), error = d.corners[k] - truth[k];
      e.radial += error.dot(out);
      e.raw_radial += (raw.detections[0].corners[k] - truth[k]).dot(out);
      e.square += error.squaredNorm() / 2;
      e.nees += error.squaredNorm() / 2 / (d.corner_sigma_px[k] * d.corner_sigma_px[k]);
      ++e.n;
    }
  }
  e.radial /= e.n;
  e.raw_radial /= e.n;
  e.square /= e.n;
  e.nees /= e.n;
  return e;
}

TEST(Detection, CornersAreFreeOfShiftAtEveryBlurSizeAndToneCurve) {
  const Camera camera(CameraModel::kPinhole, 140, 140, {300, 300, 69.5, 69.5});
  for (const double gamma : {1.0, 2.2}) {
    for (const double blur : {0.0, 0.6, 1.3}) {
      for (const double side : {20.0, 35.0, 70.0}) {
        if (side / 8 < 2.2 * blur) continue;  // cells smaller than the blur: the detector does not read these
        TagPicture picture;
        picture.gamma = gamma;
        picture.blur_px = blur;
        const Errors e = Measure(camera, side, picture, false, 5);
        const std::string where = "gamma " + std::to_string(gamma) + " blur " + std::to_string(blur) + " side " +
                                  std::to_string(side) + " detector's own radial " + std::to_string(e.raw_radial);
        EXPECT_LE(e.missed, 1) << where;
        EXPECT_EQ(e.unrefined, 0) << where;
        EXPECT_LT(std::abs(e.radial), 0.05) << where;
        EXPECT_LT(std::sqrt(e.square), 0.15) << where;
        if (std::getenv("TAGS_VERBOSE") != nullptr) {
          std::printf("gamma %.1f blur %.1f side %3.0f: raw %+.3f radial %+.3f rms %.3f nees %.2f\n", gamma, blur, side,
                      e.raw_radial, e.radial, std::sqrt(e.square), e.nees);
        }
      }
    }
  }
}

// A sharp picture has its blur at the least that the model knows: the fit goes on with the others.
TEST(Detection, SharpPicturesTakeFewIterations) {
  const Camera camera(CameraModel::kPinhole, 140, 140, {300, 300, 69.5, 69.5});
  const TagFamily family("tag36h11");
  TagPicture picture;
  picture.blur_px = 0;
  constexpr int kTags = 10;
  double iterations = 0;
  for (int i = 0; i < kTags; ++i) {
    picture.seed = 100 + i;
    const Rigid3d pose = TagPose(camera, picture.size_m, 50, 0.5, i + 1);
    const TagPattern& pattern = family.Pattern(3 * i);
    std::array<Eigen::Vector2d, 4> start;
    for (int k = 0; k < 4; ++k)
      start[k] = *camera.Project(pose * TagCorner(picture.size_m, k)) + Eigen::Vector2d(0.4 - 0.2 * k, 0.3);
    const CornerRefinement found = RefineCorners(RenderTag(pattern, camera, pose, picture), pattern, start);
    EXPECT_TRUE(found.ok) << found.reason;
    iterations += static_cast<double>(found.iterations) / kTags;
  }
  EXPECT_LT(iterations, 8);
}

TEST(Detection, SearchedAtTwiceTheSizeSmallerTagsAreFound) {
  const Camera camera(CameraModel::kPinhole, 140, 140, {300, 300, 69.5, 69.5});
  TagPicture picture;
  picture.blur_px = 0.4;
  constexpr int kTags = 20;
  constexpr double kSide = 12;
  const Errors plain = Measure(camera, kSide, picture, false, kTags);
  const Errors enlarged = Measure(camera, kSide, picture, false, kTags, 0.5);
  if (std::getenv("TAGS_VERBOSE") != nullptr) {
    std::printf("missed %d, enlarged %d; radial %+.3f, detector's own %+.3f, rms %.3f\n", plain.missed, enlarged.missed,
                enlarged.radial, enlarged.raw_radial, std::sqrt(enlarged.square));
  }
  EXPECT_LT(enlarged.missed, plain.missed / 2);
  EXPECT_LT(std::abs(enlarged.radial), 0.1);
}

TEST(Detection, StatedSigmaMatchesTheErrors) {
  const Camera camera(CameraModel::kPinhole, 140, 140, {300, 300, 69.5, 69.5});
  TagPicture picture;
  picture.noise = 8;  // noise dominates what the model lacks
  const Errors e = Measure(camera, 36, picture, false, 25);
  EXPECT_EQ(e.unrefined, 0);
  EXPECT_GT(e.nees, 0.5);
  EXPECT_LT(e.nees, 1.6);
}

TEST(Detection, ALargeTagUnderDistortionNeedsTheCamera) {
  const Camera camera(CameraModel::kKannalaBrandt, 160, 160, {160, 160, 79.5, 79.5, -0.02, 0.01, 0, 0});
  TagPicture picture;
  const Errors with = Measure(camera, 90, picture, true, 2), without = Measure(camera, 90, picture, false, 2);
  EXPECT_LT(std::abs(with.radial), 0.05);
  EXPECT_LT(std::sqrt(with.square), 0.1);
  EXPECT_GT(std::sqrt(without.square), 2 * std::sqrt(with.square));
}

// The ids that files may name are those of the library.
TEST(Detection, KnownIdsAreThoseOfTheLibrary) {
  EXPECT_THAT(KnownTagFamilies(), testing::UnorderedElementsAreArray(TagFamilyNames()));
  for (const std::string& name : TagFamilyNames()) {
    const int size = TagFamily(name).size();
    EXPECT_EQ(TagIdProblem(name, size - 1), "") << name;
    EXPECT_THAT(TagIdProblem(name, size), testing::HasSubstr("the ids 0 to " + std::to_string(size - 1))) << name;
  }
}

// The families of more than 41 bits take seconds and gigabytes to set up.
TEST(Detection, OtherFamiliesReadBack) {
  const Camera camera(CameraModel::kPinhole, 220, 220, {300, 300, 109.5, 109.5});
  for (const std::string name : {"tag25h9", "tag16h5", "tagCircle21h7", "tagStandard41h12"}) {
    TagFamily family(name);
    TagPicture picture;
    picture.background = picture.bright;
    const Rigid3d pose = TagPose(camera, picture.size_m, 90, 0.3, 3);
    const int id = std::min(11, family.size() - 1);
    const cv::Mat grey = RenderTag(family.Pattern(id), camera, pose, picture);
    DetectTagsOptions options;
    options.family = name;
    ProgressSink progress;
    const CancelToken cancel;
    const ImageTags tags = DetectTags(
                               1, [&](int64_t) { return grey; }, nullptr, options, 1, progress, cancel)
                               .images[0];
    ASSERT_EQ(tags.detections.size(), 1U) << name;
    EXPECT_EQ(tags.detections[0].id, id) << name;
    EXPECT_TRUE(tags.detections[0].refined) << name;
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector2d truth = *camera.Project(pose * TagCorner(picture.size_m, k));
      EXPECT_LT((tags.detections[0].corners[k] - truth).norm(), 0.15) << name << " corner " << k;
    }
  }
}

TEST(Detection, SeveralFamiliesAreToldApartByTheirIds) {
  EXPECT_EQ(TagFamilies("tag36h11").Of(3), "tag36h11");
  const TagFamilies two("tag36h11, tag16h5:3:12,tag25h9:7");
  EXPECT_EQ(two.names(), (std::vector<std::string>{"tag36h11", "tag16h5", "tag25h9"}));
  EXPECT_EQ(two.Of(12), "tag16h5");
  EXPECT_EQ(two.Of(7), "tag25h9");
  EXPECT_EQ(two.Of(8), "tag36h11");
  EXPECT_EQ(two.Text(), "tag36h11,tag16h5:3:12,tag25h9:7");
  EXPECT_EQ(TagFamilies("tag36h11", {{12, "tag16h5"}, {3, "tag16h5"}, {4, "tag36h11"}}).Text(),
            "tag36h11,tag16h5:3:12");
  for (const char* wrong : {"", "tag36h11,tag16h5", "tag36h11:3", "tag36h11,tag36h11:3", "tag36h11,tag16h5:x",
                            "tag36h11,tag16h5:3:3", "tag36h11,:3"}) {
    EXPECT_THROW(TagFamilies{wrong}, OptionError) << wrong;
  }
  // Three tags beside each other: the third's number belongs to the other family.
  const Camera camera(CameraModel::kPinhole, 220, 220, {300, 300, 109.5, 109.5});
  std::vector<cv::Mat> row;
  for (const auto& [name, id] : {std::pair{"tag36h11", 5}, {"tag16h5", 3}, {"tag36h11", 3}}) {
    row.push_back(RenderTag(TagFamily(name).Pattern(id), camera, TagPose(camera, 0.5, 90, 0.3, 3), TagPicture{}));
  }
  cv::Mat grey;
  cv::hconcat(row, grey);
  DetectTagsOptions options;
  options.family = "tag36h11,tag16h5:3";
  ProgressSink progress;
  const ImageTags tags = DetectTags(1, [&](int64_t) { return grey; }, nullptr, options, 1, progress, {}).images[0];
  ASSERT_EQ(tags.detections.size(), 2U);
  EXPECT_EQ(tags.detections[0].id, 3);
  EXPECT_EQ(tags.detections[0].family, "tag16h5");
  EXPECT_TRUE(tags.detections[0].refined);
  EXPECT_GT(tags.detections[0].corners[0].x(), 220);
  EXPECT_EQ(tags.detections[1].id, 5);
  EXPECT_EQ(tags.detections[1].family, "tag36h11");
}

TEST(Detection, ResultsDoNotDependOnThreadsAndBadPicturesAreCounted) {
  const Camera camera(CameraModel::kPinhole, 160, 160, {300, 300, 79.5, 79.5});
  TagFamily family("tag36h11");
  std::vector<cv::Mat> pictures;
  for (int i = 0; i < 6; ++i) {
    pictures.push_back(RenderTag(family.Pattern(i), camera, TagPose(camera, 0.5, 40, 0.4, i + 1), TagPicture{}));
  }
  const auto source = [&](int64_t i) {
    if (i == 3) throw InputError("images/3.jpg: truncated");
    return pictures[i];
  };
  ProgressSink progress;
  const CancelToken cancel;
  const DetectTagsResult one = DetectTags(6, source, nullptr, {}, 1, progress, cancel);
  const DetectTagsResult two = DetectTags(6, source, nullptr, {}, 2, progress, cancel);
  EXPECT_EQ(one.unusable, 1);
  EXPECT_FALSE(one.images[3].usable);
  EXPECT_EQ(one.images[3].problem, "images/3.jpg: truncated");
  EXPECT_EQ(one.detections, 5);
  for (int i = 0; i < 6; ++i) {
    ASSERT_EQ(one.images[i].detections.size(), two.images[i].detections.size());
    for (size_t d = 0; d < one.images[i].detections.size(); ++d) {
      for (int k = 0; k < 4; ++k) {
        EXPECT_EQ(one.images[i].detections[d].corners[k], two.images[i].detections[d].corners[k]);
      }
    }
  }
}

TEST(Detection, OptionsAreChecked) {
  DetectTagsOptions options;
  options.family = "tag36h12";
  options.max_hamming = 5;
  EXPECT_EQ(options.Check().size(), 2U);
  options.family = "tag36h11,tag16h6:3";
  EXPECT_EQ(options.Check().size(), 2U);
  ProgressSink progress;
  const CancelToken cancel;
  EXPECT_THROW(DetectTags(0, nullptr, nullptr, options, 1, progress, cancel), OptionError);
  EXPECT_THROW(TagFamily("nothing"), OptionError);
  EXPECT_THROW(TagFamily("tag16h5").Pattern(30), InputError);
}

TEST(Detection, CancelEndsIt) {
  ProgressSink progress;
  CancelToken cancel;
  cancel.Cancel();
  EXPECT_THROW(DetectTags(
                   1, [](int64_t) { return cv::Mat(10, 10, CV_8U); }, nullptr, {}, 1, progress, cancel),
               Cancelled);
}

}  // namespace
}  // namespace trigpoint

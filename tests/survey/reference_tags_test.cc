// Tags in panoramas and photos to localize, for the survey.
#include "survey/input/reference_tags.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "datasets/project/project.h"
#include "tests/support/project_folder.h"
#include "tests/survey/tags_rendering.h"

namespace trigpoint {
namespace {

// A tag three metres ahead of a panorama, on something that the panorama's mask hides.
TEST(ReferenceTags, AreNotTakenFromWhatAMaskHides) {
  const ProjectFolder folder;
  const Camera sphere = Camera::Equirectangular(2048, 1024);
  TagPicture options;
  options.size_m = 1;
  const Rigid3d ahead(Eigen::Quaterniond::Identity(), {0, 0, 3});
  const cv::Mat picture = RenderTag(TagFamily("tag36h11").Pattern(7), sphere, ahead, options);
  ASSERT_TRUE(cv::imwrite((folder / "pano.png").string(), picture));
  const Project project = Project::Open(folder.dir());
  Reference reference;
  reference.name = "pano.png";
  reference.files = {folder / "pano.png"};
  ProgressSink progress;
  const CancelToken cancel;
  nlohmann::json metrics;
  const StageContext context{project, folder.dir(), 1, 1, progress, cancel, metrics};
  const auto found = [&] {
    size_t tags = 0;
    for (const ImageTags& view : FindReferenceTags(reference, {}, {}, context).tags) {
      tags += view.detections.size();
    }
    return tags;
  };
  EXPECT_GT(found(), 0u);
  cv::Mat mask(1024, 2048, CV_8U, cv::Scalar(255));
  mask(cv::Rect(900, 390, 248, 244)).setTo(0);  // the tag is 109 px wide
  ASSERT_TRUE(cv::imwrite((folder / "mask.png").string(), mask));
  reference.mask = folder / "mask.png";
  EXPECT_EQ(found(), 0u);
}

}  // namespace
}  // namespace trigpoint

// What the libraries really do, measured on pictures whose truth is known by construction.
#include "calib/camera/pixel_convention.h"

#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
#include <gtest/gtest.h>

#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/camera/camera.h"
#include "tests/support/numeric.h"

namespace trigpoint {
namespace {

// A tag seen at an angle: every pixel is the mean of 8 x 8 rays, truth by construction. `image_from_tag` takes the
// tag's black square, [-1, 1]^2 with y down, to our pixels.
cv::Mat DrawTag(const image_u8_t& cells, const apriltag_family_t& family, const Eigen::Affine2d& image_from_tag) {
  cv::Mat picture(260, 300, CV_8U);
  const Eigen::Affine2d tag_from_image = image_from_tag.inverse();
  const int border = (family.total_width - family.width_at_border) / 2;
  for (int v = 0; v < picture.rows; ++v) {
    for (int u = 0; u < picture.cols; ++u) {
      double sum = 0;
      for (int k = 0; k < 64; ++k) {
        const Eigen::Vector2d p =
            tag_from_image * Eigen::Vector2d(u - 0.5 + (k % 8 + 0.5) / 8, v - 0.5 + (k / 8 + 0.5) / 8);
        const int x = static_cast<int>(std::floor((p.x() + 1) / 2 * family.width_at_border)) + border;
        const int y = static_cast<int>(std::floor((p.y() + 1) / 2 * family.width_at_border)) + border;
        const bool inside = x >= 0 && y >= 0 && x < cells.width && y < cells.height;
        sum += inside ? cells.buf[y * cells.stride + x] : 255;
      }
      picture.at<uint8_t>(v, u) = cv::saturate_cast<uint8_t>(sum / 64);
    }
  }
  return picture;
}

TEST(PixelConvention, AprilTagCountsFromTheCornerOfTheFirstPixelAndGoesRoundFromTheBottomLeft) {
  apriltag_family_t* family = tag36h11_create();
  apriltag_detector_t* detector = apriltag_detector_create();
  apriltag_detector_add_family(detector, family);
  detector->quad_decimate = 1;
  image_u8_t* tag = apriltag_to_image(family, 7);
  const Eigen::Vector2d upright[4] = {{-1, 1}, {1, 1}, {1, -1}, {-1, -1}};

  Random random(1);
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  const int views = 30;
  for (int i = 0; i < views; ++i) {
    const double angle = random.Uniform(-0.4, 0.4), cx = random.Uniform(130, 160), cy = random.Uniform(110, 140);
    Eigen::Affine2d image_from_tag = Eigen::Translation2d(cx, cy) * Eigen::Rotation2Dd(angle);
    image_from_tag.linear() *= random.Uniform(30, 60);
    cv::Mat picture = DrawTag(*tag, *family, image_from_tag);
    image_u8_t view{picture.cols, picture.rows, static_cast<int32_t>(picture.step), picture.data};
    zarray_t* found = apriltag_detector_detect(detector, &view);
    ASSERT_EQ(zarray_size(found), 1);
    apriltag_detection_t* detection = nullptr;
    zarray_get(found, 0, &detection);
    EXPECT_EQ(detection->id, 7);
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector2d error =
          FromAprilTagPixel({detection->p[k][0], detection->p[k][1]}) - image_from_tag * upright[k];
      EXPECT_LT(error.norm(), 0.6) << "corner " << k;  // each is drawn inwards a little
      mean += error / (4 * views);
    }
    apriltag_detections_destroy(found);
  }
  EXPECT_LT(mean.norm(), 0.05) << mean.transpose() << ": a wrong convention would show as half a pixel";

  image_u8_destroy(tag);
  apriltag_detector_destroy(detector);
  tag36h11_destroy(family);
}

TEST(PixelConvention, OpenCvSiftIsAQuarterOfAPixelOff) {
  Random random(1);
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  int n = 0;
  for (const double blob : {2.0, 3.0, 5.0, 8.0}) {
    cv::Mat picture(600, 600, CV_8U);
    std::vector<Eigen::Vector2d> truth;
    for (int i = 0; i < 25; ++i) {
      const double du = random.Uniform(-0.5, 0.5), dv = random.Uniform(-0.5, 0.5);
      truth.emplace_back(60 + 120 * (i % 5) + du, 60 + 120 * (i / 5) + dv);
    }
    for (int v = 0; v < picture.rows; ++v) {
      for (int u = 0; u < picture.cols; ++u) {
        const Eigen::Vector2d& c = truth[v / 120 * 5 + u / 120];  // of this cell of 120 x 120
        const double value = 40 + 180 * std::exp(-(Eigen::Vector2d(u, v) - c).squaredNorm() / (2 * blob * blob));
        picture.at<uint8_t>(v, u) = cv::saturate_cast<uint8_t>(value);
      }
    }
    std::vector<cv::KeyPoint> keypoints;
    cv::SIFT::create()->detect(picture, keypoints);
    Eigen::Vector2d offset = Eigen::Vector2d::Zero();
    int found = 0;
    for (const Eigen::Vector2d& c : truth) {
      for (const cv::KeyPoint& k : keypoints) {
        const Eigen::Vector2d d = FromOpenCvSiftPixel({k.pt.x, k.pt.y}) - c;
        if (d.norm() > 0.5 * blob || k.size < 1.5 * blob) continue;
        offset += d;
        ++found;
        break;
      }
    }
    ASSERT_GE(found, 20) << "blobs of sigma " << blob;
    EXPECT_LT((offset / found).cwiseAbs().maxCoeff(), 0.05) << "blobs of sigma " << blob;
    sum += offset, n += found;
  }
  EXPECT_LT((sum / n).cwiseAbs().maxCoeff(), 0.03);
}

TEST(PixelConvention, ColmapCountsFromTheCornerOfTheFirstPixel) {
  // COLMAP's camera without calibration has its principal point at (w/2, h/2), ours at ((w-1)/2, (h-1)/2).
  const Camera camera = Camera::FromFieldOfView(640, 480, 1);
  EXPECT_EQ(FromColmapPixel({320, 240}), Eigen::Vector2d(camera.params()[2], camera.params()[3]));
  EXPECT_EQ(FromColmapPixel({0.5, 0.5}), Eigen::Vector2d(0, 0));
  EXPECT_EQ(ToColmapPixel(FromColmapPixel({12.25, 7})), Eigen::Vector2d(12.25, 7));
}

}  // namespace
}  // namespace trigpoint

// Targets, cameras and pictures of a calibration, as files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calib/base/error.h"
#include "datasets/calibration/calibration_images.h"
#include "datasets/calibration/camera_files.h"
#include "datasets/calibration/target_file.h"
#include "datasets/colmap/model.h"
#include "datasets/io/camchain.h"
#include "datasets/io/text.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class CalibrationFiles : public testing::Test {
 protected:
  const std::filesystem::path& dir() const { return temp_.path(); }

 private:
  TempDir temp_;
};

TEST_F(CalibrationFiles, ReadsKalibrTargets) {
  const auto read = [&](const std::string& text) {
    WriteFileAtomically(dir() / "target.yaml", text);
    return ReadTarget("target.yaml", dir());
  };
  const Target grid = read("target_type: 'aprilgrid'\ntagCols: 6\ntagRows: 5\ntagSize: 0.088\ntagSpacing: 0.3\n");
  EXPECT_EQ(grid.kind, TargetKind::kAprilGrid);
  EXPECT_EQ(grid.BoardPoints().size(), 120u);
  EXPECT_NEAR(grid.BoardPoints()[2].x(), 0.088 * 1.3, 1e-12);
  const Target board = read(
      "target_type: 'checkerboard'\ntargetCols: 6\ntargetRows: 7\nrowSpacingMeters: 0.06\ncolSpacingMeters: 0.05\n");
  EXPECT_NEAR(board.spacing_y_m, 0.06, 1e-12);
  EXPECT_EQ(board.PointColumns(), 6);
  const Target circles =
      read("target_type: 'circlegrid'\ntargetCols: 4\ntargetRows: 11\nspacingMeters: 0.02\nasymmetricGrid: True\n");
  EXPECT_EQ(circles.kind, TargetKind::kAsymmetricCircles);
  EXPECT_THAT(MessageOf<Error>([&] { read("target_type: aprilgrid\ntagCols: 6\ntagRow: 5\n"); }), HasSubstr("tagRows"));
  EXPECT_THAT(MessageOf<Error>([&] { read("target_type: dartboard\n"); }), HasSubstr("expected checkerboard"));
  EXPECT_THAT(MessageOf<Error>([&] { read("target_type: checkerboard\ntargetCols: 6\ntargetRows: 7\n"); }),
              HasSubstr("size in metres"));
}

TEST_F(CalibrationFiles, TargetsInOneLine) {
  const std::pair<const char*, const char*> targets[] = {
      {"checkerboard:9x6:0.025", "checkerboard of 9 x 6 inner corners, squares of 25 mm"},
      {"checkerboard:9x6:0.025x0.03", "checkerboard of 9 x 6 inner corners, squares of 25 x 30 mm"},
      {"charuco:8x8:0.0254:0.01905:DICT_4X4_1000",
       "ChArUco board of 8 x 8 squares of 25.4 mm, DICT_4X4_1000 markers of 19.05 mm"},
      {"aprilgrid:6x6:0.088:0.3", "AprilGrid of 6 x 6 tags of 88 mm, gaps of 26.4 mm"},
      {"asymmetric_circles:4x11:0.02", "asymmetric grid of 4 x 11 circles, spacing 20 mm"},
      {"circles:7x7:0.02", "grid of 7 x 7 circles, spacing 20 mm"}};
  for (const auto& [text, words] : targets) EXPECT_EQ(ReadTarget(text, dir()).Text(), words) << text;
  EXPECT_THAT(MessageOf<Error>([&] { ReadTarget("chequerboard:9x6:0.025", dir()); }), HasSubstr("'checkerboard'"));
  EXPECT_THAT(MessageOf<Error>([&] { ReadTarget("checkerboard:9:0.025", dir()); }), HasSubstr("columns x rows"));
  EXPECT_THAT(MessageOf<Error>([&] { ReadTarget("checkerboard:9x6:-1", dir()); }), HasSubstr("above 0"));
  EXPECT_THAT(MessageOf<Error>([&] { ReadTarget("charuco:8x8:0.02:0.03", dir()); }), HasSubstr("marker size"));
  EXPECT_THAT(MessageOf<Error>([&] { ReadTarget("charuco:8x8:0.02:0.01:DICT_9", dir()); }), HasSubstr("dictionary"));
  EXPECT_THAT(MessageOf<Error>([&] { ReadTarget("missing.yaml", dir()); }), HasSubstr("no such target file"));
}

TEST_F(CalibrationFiles, EveryCameraFormGoesOutAndBack) {
  const std::vector<Camera> cameras = {
      Camera(CameraModel::kPinhole, 640, 480, {500, 501, 320, 240}),
      Camera(CameraModel::kRadtan, 640, 480, {500, 501, 320, 240, -0.2, 0.05, 1e-3, -1e-3}),
      Camera(CameraModel::kRadtan, 640, 480, {500, 501, 320, 240, -0.2, 0.05, 1e-3, -1e-3, 0.01}),
      Camera(CameraModel::kRational, 640, 480, {500, 501, 320, 240, -0.2, 0.05, 1e-3, -1e-3, 0.01, 0.1, 0.02, 0.001}),
      Camera(CameraModel::kKannalaBrandt, 640, 480, {300, 301, 320, 240, -0.01, 0.02, -0.01, 0.001})};
  const Eigen::Vector3d point(0.21, -0.13, 1);
  for (const Camera& camera : cameras) {
    BodyCamera body;
    body.name = "cam0";
    body.camera = camera;
    WriteOpenCvCamera(dir() / "cv.yaml", body, {"comment"});
    WriteRosCameraInfo(dir() / "ros.yaml", body, {"comment"});
    WriteColmapCameras(dir() / "cameras.txt", {body}, {"comment"});
    WriteCamchain(dir() / "camchain.yaml", {body});
    for (const char* file : {"cv.yaml", "ros.yaml", "cameras.txt", "camchain.yaml"}) {
      const CameraFile back = ReadCameraFile(dir() / file);
      ASSERT_EQ(back.cameras.size(), 1u) << file;
      EXPECT_TRUE(back.related);
      EXPECT_EQ(back.cameras[0].camera.width(), 640) << file;
      EXPECT_LT((*back.cameras[0].camera.Project(point) - *camera.Project(point)).norm(), 1e-9)
          << file << " " << CameraModelName(camera.model());
    }
  }
}

TEST_F(CalibrationFiles, ARigKeepsItsBaselineWithoutABody) {
  BodyCamera left, right;
  left.name = "cam0";
  right.name = "cam1";
  left.camera = right.camera = Camera(CameraModel::kPinhole, 640, 480, {500, 500, 320, 240});
  right.cam_from_body = {Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY())), {-0.12, 0.01, 0.02}};
  WriteCamchain(dir() / "rig.yaml", {left, right});
  const std::vector<BodyCamera> back = ReadCamchain(dir() / "rig.yaml");
  const Rigid3d right_from_left = back[1].cam_from_body * back[0].cam_from_body.Inverse();
  EXPECT_LT(right_from_left.Minus(right.cam_from_body).norm(), 1e-9);
  EXPECT_FALSE(back[1].has_extrinsics);
}

// Cameras that are not related are no rig: written as one they would all stand at one place.
TEST_F(CalibrationFiles, CamerasOfOneRunAreRelated) {
  const BodyCamera one{.name = "cam0", .camera = Camera(CameraModel::kPinhole, 640, 480, {500, 501, 320, 240})};
  const std::filesystem::path file = dir() / "cameras.txt";
  WriteColmapCameras(file, {one, one}, {});
  const auto problem = [&](size_t count) {
    return MessageOf<InputError>([&] { ReadCamerasFor(file, count, "the drive"); });
  };
  EXPECT_THAT(problem(2), HasSubstr("expected how its cameras cam0, cam1 sit to each other"));
  EXPECT_THAT(problem(1), HasSubstr("expected 1 camera, as the drive has, found 2 (cam0, cam1)"));
  WriteColmapCameras(file, {one}, {});
  EXPECT_EQ(ReadCamerasFor(file, 1, "the drive").size(), 1u);
  WriteFileAtomically(dir() / "rig.yaml",
                      "left: {camera_model: pinhole, intrinsics: [50, 50, 20, 15], distortion_model: none, "
                      "distortion_coeffs: [], resolution: [40, 30]}\n"
                      "right: {camera_model: pinhole, intrinsics: [51, 51, 20, 15], distortion_model: none, "
                      "distortion_coeffs: [], resolution: [40, 30],\n"
                      "  T_cn_cnm1: [[1, 0, 0, -0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}\n");
  EXPECT_EQ(ReadCamerasFor(dir() / "rig.yaml", 2, "the drive").at(1).name, "cam1");
}

TEST_F(CalibrationFiles, AStereoPairIsARigidMotionInMetres) {
  const auto write = [&](const std::string& r, const std::string& t) {
    WriteFileAtomically(
        dir() / "stereo.yaml",
        "image_width: 640\nimage_height: 480\nM1: [500, 0, 320, 0, 500, 240, 0, 0, 1]\nD1: [0, 0, 0, 0]\n"
        "M2: [500, 0, 320, 0, 500, 240, 0, 0, 1]\nD2: [0, 0, 0, 0]\nR: " +
            r + "\nT: " + t + "\n");
    return dir() / "stereo.yaml";
  };
  const std::string one = "[1, 0, 0, 0, 1, 0, 0, 0, 1]";
  EXPECT_EQ(ReadCameraFile(write(one, "[-0.12, 0, 0]")).cameras.at(1).cam_from_body.translation.x(), -0.12);
  for (const char* r :
       {"[2, 0, 0, 0, -1, 0, 0, 0, 1]", "[1, 0, 0, 0, 1, 0, 0, 0, -1]", "[0, 0, 0, 0, 0, 0, 0, 0, 0]"}) {
    EXPECT_THAT(MessageOf<InputError>([&] { ReadCameraFile(write(r, "[-0.12, 0, 0]")); }),
                HasSubstr("stereo.yaml: key 'R': expected a rotation"));
  }
  EXPECT_THAT(MessageOf<InputError>([&] { ReadCameraFile(write(one, "[-120.5, 0, 0]")); }),
              HasSubstr("key 'T': expected metres and a baseline of at most 10 m, found one of 120.5"));
}

TEST_F(CalibrationFiles, SaysWhatAForeignFileLacks) {
  const auto read = [&](const std::string& text) {
    WriteFileAtomically(dir() / "camera.yaml", text);
    return MessageOf<Error>([&] { ReadCameraFile(dir() / "camera.yaml"); });
  };
  EXPECT_THAT(read("camera_matrix: {rows: 3, cols: 3, data: [500, 0, 320, 0, 500, 240, 0, 0, 1]}\n"),
              HasSubstr("image_width"));
  EXPECT_THAT(read("image_width: 640\nimage_height: 480\ncamera_matrix: {data: [500, 0, 320]}\n"), HasSubstr("3 x 3"));
  EXPECT_THAT(read("image_width: 640\n"), HasSubstr("no camera in it"));
  EXPECT_THAT(read("1 OPENCV 640 480 500 500 320\n"), HasSubstr("camera.yaml:1"));
  EXPECT_THAT(read("1 FOV 640 480 500 500 320 240 0.1\n"), HasSubstr("not supported"));
  EXPECT_THAT(read("%YAML:1.0\ncamera_matrix: [[\n"), HasSubstr("not valid YAML"));
  EXPECT_THAT(read("{\"cameraIntrinsics\": 3"), HasSubstr("not valid JSON"));
}

TEST_F(CalibrationFiles, PairsPicturesOfOneMoment) {
  for (const char* name :
       {"left01.png", "left02.png", "left10.png", "right01.png", "right10.png", "a/1.png", "b/1.png"}) {
    WriteFileAtomically(dir() / name, "x");
  }
  std::vector<CalibrationImages> one = FindCalibrationImages("left*.png", dir());
  EXPECT_THAT(PairFrames(&one), ElementsAre("left01", "left02", "left10"));
  std::vector<CalibrationImages> two = FindCalibrationImages("L=left*.png;R=right*.png", dir());
  PairFrames(&two);
  EXPECT_EQ(two[0].camera, "L");
  EXPECT_EQ(two[0].frame_of[2], two[1].frame_of[1]);
  EXPECT_NE(two[0].frame_of[1], two[1].frame_of[1]);
  std::vector<CalibrationImages> folders = FindCalibrationImages("a;b", dir());
  PairFrames(&folders);
  EXPECT_EQ(folders[0].frame_of[0], folders[1].frame_of[0]);
  EXPECT_THAT(MessageOf<Error>([&] { FindCalibrationImages("none*.png", dir()); }), HasSubstr("no such pictures"));
  // What the working directory has by that name is something else.
  ASSERT_TRUE(std::filesystem::exists("docs/pictures"));
  EXPECT_THAT(MessageOf<Error>([&] { FindCalibrationImages("docs/pictures/*.png", dir()); }),
              HasSubstr("no such pictures"));
}

// The equations of Agisoft's manual, evaluated here, against the camera that was read.
TEST_F(CalibrationFiles, ReadsAgisoftsLens) {
  const std::string xml =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<calibration>\n  <projection>frame</projection>\n  "
      "<width>4000</width>\n"
      "  <height>3000</height>\n  <f>3100.5</f>\n  <cx>12.5</cx>\n  <cy>-7.25</cy>\n  <b1>1.5</b1>\n  <k1>-0.08</k1>\n"
      "  <k2>0.03</k2>\n  <k3>-0.004</k3>\n  <p1>0.0007</p1>\n  <p2>-0.0004</p2>\n</calibration>\n";
  WriteFileAtomically(dir() / "lens.xml", xml);
  const CameraFile file = ReadCameraFile(dir() / "lens.xml");
  EXPECT_EQ(file.format, "Agisoft");
  const double x = 0.3, y = -0.2, r2 = x * x + y * y;
  const double radial = 1 - 0.08 * r2 + 0.03 * r2 * r2 - 0.004 * r2 * r2 * r2;
  const double xd = x * radial + 0.0007 * (r2 + 2 * x * x) + 2 * -0.0004 * x * y;
  const double yd = y * radial - 0.0004 * (r2 + 2 * y * y) + 2 * 0.0007 * x * y;
  // Half a pixel less: the first pixel's centre is at 0.5 there.
  const Eigen::Vector2d expected(2000 + 12.5 + xd * 3100.5 + xd * 1.5 - 0.5, 1500 - 7.25 + yd * 3100.5 - 0.5);
  const auto pixel = file.cameras.at(0).camera.Project({x, y, 1});
  ASSERT_TRUE(pixel.has_value());
  EXPECT_LT((*pixel - expected).norm(), 1e-9);
  std::string refused = xml;
  WriteFileAtomically(dir() / "lens.xml", refused.replace(refused.find("<k3>"), 4, "<k4>1</k4><k3>"));
  EXPECT_THAT(MessageOf<InputError>([&] { ReadCameraFile(dir() / "lens.xml"); }),
              HasSubstr("k4, p3, p4 or b2 are not supported"));
  // Without its last coefficients it would be another lens.
  WriteFileAtomically(dir() / "lens.xml", xml.substr(0, xml.find("<k3>")));
  EXPECT_THAT(MessageOf<InputError>([&] { ReadCameraFile(dir() / "lens.xml"); }), HasSubstr("lens.xml: cut off"));
  std::string huge = xml;
  WriteFileAtomically(dir() / "lens.xml", huge.replace(huge.find("0.03"), 4, "1e308"));
  EXPECT_THAT(MessageOf<InputError>([&] { ReadCameraFile(dir() / "lens.xml"); }), HasSubstr("parameters up to 1e9"));
}

// A project's sensors, each with the start and the adjusted calibration.
TEST_F(CalibrationFiles, ReadsAgisoftsSensors) {
  const auto sensor = [](const std::string& label, double f) {
    const auto lens = [](const std::string& kind, double focal) {
      return "<calibration type=\"frame\" class=\"" + kind + "\"><resolution width=\"4000\" height=\"3000\"/><f>" +
             std::to_string(focal) + "</f><cx>10</cx><k1>-0.1</k1></calibration>";
    };
    return "<sensor id=\"0\" label=\"" + label + "\" type=\"frame\"><resolution width=\"4000\" height=\"3000\"/>" +
           lens("initial", 3000) + lens("adjusted", f) + "<covariance><params>f cx</params></covariance></sensor>";
  };
  const auto write = [&](const std::string& sensors) {
    WriteFileAtomically(dir() / "cameras.xml", "<?xml version=\"1.0\"?><document version=\"1.5.0\"><chunk><sensors>" +
                                                   sensors + "</sensors></chunk></document>");
    return ReadCameraFile(dir() / "cameras.xml");
  };
  const CameraFile one = write(sensor("phone", 3100));
  EXPECT_TRUE(one.related);
  EXPECT_THAT(one.cameras.at(0).camera.params(), ElementsAre(3100, 3100, 2009.5, 1499.5, -0.1, 0, 0, 0, 0));
  const CameraFile two = write(sensor("phone", 3100) + sensor("drone", 2800));
  EXPECT_FALSE(two.related);
  EXPECT_EQ(two.cameras.at(1).camera.MeanFocal(), 2800);
  EXPECT_THAT(MessageOf<InputError>([&] { write(sensor("phone", -1)); }), HasSubstr("sensor 'phone': <f>: expected"));
}

TEST_F(CalibrationFiles, ReadsColmapsBinary) {
  SparseModel model;
  model.cameras = {{7, Camera(CameraModel::kRadtan, 640, 480, {500, 501, 320, 240, -0.2, 0.05, 1e-3, -1e-3})}};
  WriteColmapModel(model, dir() / "sparse");
  const CameraFile file = ReadCameraFile(dir() / "sparse/cameras.bin");
  EXPECT_EQ(file.format, "COLMAP");
  EXPECT_EQ(file.cameras.at(0).camera.params(), model.cameras[0].second.params());
  std::string cut = ReadTextFile(dir() / "sparse/cameras.bin");
  cut.resize(cut.size() - 4);
  WriteFileAtomically(dir() / "cameras.bin", cut);
  EXPECT_THAT(MessageOf<InputError>([&] { ReadCameraFile(dir() / "cameras.bin"); }), HasSubstr("cameras.bin: it ends"));
}

TEST_F(CalibrationFiles, ReadsEveryModelOfColmapsText) {
  const auto read = [&](const std::string& line) {
    WriteFileAtomically(dir() / "cameras.txt", "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n" + line + "\n");
    return ReadCameraFile(dir() / "cameras.txt");
  };
  for (const char* line : {"1 SIMPLE_FISHEYE 640 480 500 320 240", "1 FISHEYE 640 480 500 500 320 240",
                           "1 OPENCV_FISHEYE 640 480 500 500 320 240 0 0 0 0"}) {
    const Camera camera = read(line).cameras.at(0).camera;
    EXPECT_EQ(camera.model(), CameraModel::kKannalaBrandt) << line;
    EXPECT_THAT(camera.params(), ElementsAre(500, 500, 319.5, 239.5, 0, 0, 0, 0)) << line;
  }
  const auto message = [&](const std::string& line) { return MessageOf<InputError>([&] { read(line); }); };
  EXPECT_THAT(message("1 PINHOL 640 480 500 500 320 240"), HasSubstr("cameras.txt:2: unknown camera model PINHOL;"));
  EXPECT_THAT(message("1 EUCM 640 480 500 500 320 240 0.5 1"), HasSubstr("model EUCM (id 16) is not supported"));
  // 2^32 px more than 640 is no picture.
  EXPECT_THAT(message("1 PINHOLE 4294967936 480 500 500 320 240"), HasSubstr("cameras.txt:2: expected the size"));
}

TEST_F(CalibrationFiles, ReadsOpenCvsXml) {
  const std::string xml =
      "<?xml version=\"1.0\"?>\n<opencv_storage>\n<image_width>640</image_width>\n<image_height>480</image_height>\n"
      "<camera_matrix type_id=\"opencv-matrix\">\n  <rows>3</rows>\n  <cols>3</cols>\n  <dt>d</dt>\n  <data>500.5 0. "
      "320. 0. 501. 240. 0. 0. 1.</data></camera_matrix>\n<distortion_coefficients type_id=\"opencv-matrix\">\n"
      "<rows>1</rows>\n<cols>5</cols>\n<dt>d</dt>\n<data>-0.2 0.05 1e-3 -1e-3 0.01</data></distortion_coefficients>\n"
      "</opencv_storage>\n";
  WriteFileAtomically(dir() / "cv.xml", xml);
  const CameraFile file = ReadCameraFile(dir() / "cv.xml");
  EXPECT_THAT(file.cameras.at(0).camera.params(), ElementsAre(500.5, 501, 320, 240, -0.2, 0.05, 1e-3, -1e-3, 0.01));
  WriteFileAtomically(dir() / "cv.xml", xml.substr(0, xml.size() / 2));
  EXPECT_THAT(MessageOf<InputError>([&] { ReadCameraFile(dir() / "cv.xml"); }), HasSubstr("cut off"));
  std::string deep = "<?xml version=\"1.0\"?>\n<opencv_storage>\n";
  for (int k = 0; k < 100000; ++k) deep += "<a>";
  WriteFileAtomically(dir() / "cv.xml", deep);
  EXPECT_THAT(MessageOf<InputError>([&] { ReadCameraFile(dir() / "cv.xml"); }), HasSubstr("at most 64 levels deep"));
}

TEST_F(CalibrationFiles, SizesArePictures) {
  for (const char* size : {"[0, 480]", "[640, 1e300]", "[640.5, 480]", "[-640, 480]"}) {
    WriteFileAtomically(dir() / "camchain.yaml",
                        std::string("cam0: {camera_model: pinhole, intrinsics: [500, 500, 320, 240], distortion_model: "
                                    "none, distortion_coeffs: [], resolution: ") +
                            size + "}\n");
    EXPECT_THAT(MessageOf<InputError>([&] { ReadCamchain(dir() / "camchain.yaml"); }),
                HasSubstr("expected [width, height] of the pictures in whole pixels"))
        << size;
    WriteFileAtomically(dir() / "cv.yaml",
                        std::string("camera_matrix: [500, 0, 320, 0, 500, 240, 0, 0, 1]\nimage_size: ") + size + "\n");
    EXPECT_THAT(MessageOf<InputError>([&] { ReadCameraFile(dir() / "cv.yaml"); }),
                HasSubstr("the size of the pictures"))
        << size;
  }
}

}  // namespace
}  // namespace trigpoint

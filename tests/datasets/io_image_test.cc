// Pictures of all kinds, whole and broken; what their headers say; videos.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <exiv2/exiv2.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <thread>

#include "calib/base/error.h"
#include "datasets/io/exif.h"
#include "datasets/io/image.h"
#include "datasets/io/mask.h"
#include "datasets/io/panorama_writer.h"
#include "datasets/io/picture_parts.h"
#include "datasets/io/run_parts.h"
#include "datasets/io/text.h"
#include "datasets/io/video.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

// Dark above, bright below, and brighter to the right: tells flips and turns apart.
cv::Mat Ramp(int width, int height) {
  cv::Mat picture(height, width, CV_8U);
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u)
      picture.at<uchar>(v, u) = static_cast<uchar>(20 + 150 * v / height + 60 * u / width);
  }
  return picture;
}

double Difference(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size() || a.type() != b.type()) return 1e9;
  return cv::norm(a, b, cv::NORM_L1) / static_cast<double>(a.total());
}

trigpoint::Run RunWithCamera(int width, int height) {
  trigpoint::Run run;
  run.cameras.push_back(
      {.name = "cam0", .camera = Camera::FromFieldOfView(width, height, 1.0), .has_extrinsics = true});
  return run;
}

ImageEntry Entry(const std::filesystem::path& file) { return {0, file.filename().string(), file, 0, -1}; }

void SetExif(const std::filesystem::path& file, const std::vector<std::pair<std::string, std::string>>& values) {
  const auto image = Exiv2::ImageFactory::open(file.string());
  image->readMetadata();
  for (const auto& [key, value] : values) {
    if (key.starts_with("Xmp.")) {
      image->xmpData()[key] = value;
    } else {
      image->exifData()[key] = value;
    }
  }
  image->writeMetadata();
}

void SetOrientation(const std::filesystem::path& file, uint16_t orientation) {
  const auto image = Exiv2::ImageFactory::open(file.string());
  image->readMetadata();
  image->exifData()["Exif.Image.Orientation"] = orientation;
  image->writeMetadata();
}

// How many pixels of a mask are ignored in its left half and in its right half.
std::pair<int, int> IgnoredHalves(const cv::Mat& mask) {
  const int half = mask.cols / 2, all = half * mask.rows;
  return {all - cv::countNonZero(mask.colRange(0, half)), all - cv::countNonZero(mask.colRange(half, mask.cols))};
}

TEST(RunMasks, TakesPicturesFoldersBoxesAndTransparencyTogether) {
  const TempDir dir;
  trigpoint::Run run = RunWithCamera(64, 48);
  ASSERT_TRUE(cv::imwrite((dir / "a.png").string(), Ramp(64, 48)));
  EXPECT_TRUE(RunMasks(run).Of(Entry(dir / "a.png")).empty());

  CameraMask& mask = run.cameras[0].mask;
  mask.boxes_px = {{60, 40, 63, 47}};
  EXPECT_EQ(IgnoredHalves(RunMasks(run).Of(Entry(dir / "a.png"))), std::make_pair(0, 32));

  cv::Mat of_camera(48, 64, CV_8U, cv::Scalar(255));
  of_camera(cv::Rect(0, 0, 10, 10)).setTo(0);
  ASSERT_TRUE(cv::imwrite((dir / "camera.png").string(), of_camera));
  mask.pictures = {dir / "camera.png"};
  EXPECT_EQ(IgnoredHalves(RunMasks(run).Of(Entry(dir / "a.png"))), std::make_pair(100, 32));

  std::filesystem::create_directory(dir / "masks");
  cv::Mat of_image(48, 64, CV_8U, cv::Scalar(1));
  of_image.col(20).setTo(0);
  ASSERT_TRUE(cv::imwrite((dir / "masks/a.jpg.png").string(), of_image));
  mask.folders = {dir / "masks"};
  ASSERT_TRUE(cv::imwrite((dir / "a.jpg").string(), Ramp(64, 48)));
  EXPECT_EQ(IgnoredHalves(RunMasks(run).Of(Entry(dir / "a.jpg"))), std::make_pair(148, 32));
  ImageEntry in_folder = Entry(dir / "a.jpg");
  in_folder.file = "images/a.jpg";
  EXPECT_EQ(IgnoredHalves(RunMasks(run).Of(in_folder)), std::make_pair(148, 32)) << "as COLMAP's masks are named";
  EXPECT_EQ(IgnoredHalves(RunMasks(run).Of(Entry(dir / "a.png"))), std::make_pair(100, 32)) << "has none in the folder";

  cv::Mat transparent(48, 64, CV_8UC4, cv::Scalar(90, 90, 90, 255));
  transparent.row(30).setTo(cv::Scalar::all(0));
  ASSERT_TRUE(cv::imwrite((dir / "b.png").string(), transparent));
  EXPECT_EQ(IgnoredHalves(RunMasks(run).Of(Entry(dir / "b.png"))), std::make_pair(132, 64));

  run.config.mirrored = true;
  EXPECT_EQ(IgnoredHalves(RunMasks(run).Of(Entry(dir / "b.png"))), std::make_pair(64, 132));

  ASSERT_TRUE(cv::imwrite((dir / "masks/b.png").string(), of_image.colRange(0, 63)));
  EXPECT_THROW(RunMasks(run).Of(Entry(dir / "b.png")), InputError);
}

// The alpha channel is that of the whole picture, and where the crop lies counts in the mended one.
TEST(RunMasks, TransparentPixelsOfACropAreIgnored) {
  const TempDir dir;
  trigpoint::Run run = RunWithCamera(64, 48);
  run.cameras[0].part = {.kind = PicturePart::Kind::kCrop, .x = 64};
  cv::Mat both(48, 128, CV_8UC4, cv::Scalar(90, 90, 90, 255));
  both.colRange(70, 80).setTo(cv::Scalar::all(0));
  ASSERT_TRUE(cv::imwrite((dir / "both.png").string(), both));
  const auto ignored = [&] {
    const cv::Mat mask = RunMasks(run).Of(Entry(dir / "both.png"));
    return mask.size() == cv::Size(64, 48) ? IgnoredHalves(mask) : std::make_pair(-1, -1);
  };
  EXPECT_EQ(ignored(), std::make_pair(480, 0));
  run.config.mirrored = true;
  EXPECT_EQ(ignored(), std::make_pair(0, 0)) << "they lie in the other crop";
  run.cameras[0].part.x = 0;
  EXPECT_EQ(ignored(), std::make_pair(0, 480));
}

// Left of the sphere's middle, once as it is and once flipped: the tags state where the mended picture lies.
TEST(RunMasks, OfAPartial360PictureLieWhereThePictureLies) {
  const TempDir dir;
  const cv::Rect part(16, 0, 48, 64);
  std::filesystem::create_directory(dir / "masks");
  trigpoint::Run run;
  run.cameras.push_back({.name = "cam0", .camera = Camera::Equirectangular(128, 64)});
  run.cameras[0].mask.folders = {dir / "masks"};
  const auto write = [&](const std::string& name, const cv::Mat& picture, const cv::Mat& mask) {
    ASSERT_TRUE(cv::imwrite((dir / name).string(), picture));
    ASSERT_TRUE(cv::imwrite((dir / "masks" / name).string(), mask));
    SetExif(dir / name, {{"Xmp.GPano.FullPanoWidthPixels", "128"},
                         {"Xmp.GPano.FullPanoHeightPixels", "64"},
                         {"Xmp.GPano.CroppedAreaLeftPixels", "16"},
                         {"Xmp.GPano.CroppedAreaTopPixels", "0"},
                         {"Xmp.GPano.CroppedAreaImageWidthPixels", "48"},
                         {"Xmp.GPano.CroppedAreaImageHeightPixels", "64"}});
    run.images.push_back({static_cast<int64_t>(run.images.size()), name, dir / name, 0, -1});
  };
  cv::Mat picture, flipped, mask(part.size(), CV_8U, cv::Scalar(255)), flipped_mask;
  cv::cvtColor(Ramp(part.width, part.height), picture, cv::COLOR_GRAY2BGRA);
  picture(cv::Rect(40, 20, 4, 4)).setTo(cv::Scalar::all(0));
  mask(cv::Rect(36, 40, 4, 4)).setTo(0);
  cv::flip(picture, flipped, 1);
  cv::flip(mask, flipped_mask, 1);
  cv::Mat of_sphere(64, 128, CV_8U, cv::Scalar(255));
  mask.copyTo(of_sphere(part));
  write("a.png", picture, mask);
  write("b.png", picture, of_sphere);
  write("c.png", flipped, flipped_mask);
  write("d.png", Ramp(part.width, part.height), cv::Mat(part.size(), CV_8U, cv::Scalar(255)));
  SplitPictures(&run);
  const ImageEntry &a = run.images.at(0), &b = run.images.at(5), &c = run.images.at(10);

  const cv::Mat grey = LoadGrey(run, a), seen = RunMasks(run).Of(a);
  ASSERT_EQ(seen.size(), cv::Size(40, 40));
  EXPECT_EQ(cv::countNonZero(seen.colRange(20, 40)), 0) << "the picture ends in the view's middle";
  EXPECT_EQ(Difference(RunMasks(run).Of(b), seen), 0) << "a mask of the sphere's size";
  const int by_both = cv::countNonZero(seen);
  std::filesystem::remove(dir / "masks/a.png");
  const int by_alpha = cv::countNonZero(RunMasks(run).Of(a));
  const int whole = cv::countNonZero(RunMasks(run).Of(run.images.at(15)));
  EXPECT_LT(by_both, by_alpha);
  EXPECT_LT(by_alpha, whole);
  EXPECT_GE(whole, 19 * 40);

  run.config.mirrored = true;
  EXPECT_EQ(Difference(LoadGrey(run, c), grey), 0);
  EXPECT_EQ(Difference(RunMasks(run).Of(c), seen), 0);
}

TEST(RunMasks, AreCheckedBeforeTheyAreUsed) {
  const TempDir dir;
  trigpoint::Run run = RunWithCamera(64, 48);
  std::filesystem::create_directory(dir / "masks");
  run.cameras[0].mask.folders = {dir / "masks"};
  const auto mask = [&](const std::string& name, int width, int value) {
    ASSERT_TRUE(cv::imwrite((dir / "masks" / name).string(), cv::Mat(48, width, CV_8U, cv::Scalar(value))));
  };
  for (const char* name : {"a.png", "b.png", "c.png", "d.png"}) {
    ASSERT_TRUE(cv::imwrite((dir / name).string(), Ramp(64, 48)));
    run.images.push_back(Entry(dir / name));
    run.images.back().file = name;
    mask(name, 64, 255);
  }
  struct Listener final : ProgressSink {
    void Log(LogLevel, std::string_view line) override { lines.emplace_back(line); }
    std::vector<std::string> lines;
  } listener;
  CheckMasks(run, 2, listener, CancelToken());
  EXPECT_TRUE(listener.lines.empty());
  mask("b.png", 64, 0);
  mask("c.png", 64, 0);
  CheckMasks(run, 2, listener, CancelToken());
  ASSERT_EQ(listener.lines.size(), 1u);
  EXPECT_THAT(listener.lines[0], AllOf(HasSubstr("masks/b.png: the mask ignores the whole picture"),
                                       HasSubstr("(so of 2 of 4 pictures)")));
  listener.lines.clear();
  for (const char* name : {"a.png", "b.png", "c.png", "d.png"}) {
    cv::Mat inverted(48, 64, CV_8U, cv::Scalar(0));
    inverted.rowRange(38, 48) = 255;
    ASSERT_TRUE(cv::imwrite((dir / "masks" / name).string(), inverted));
  }
  CheckMasks(run, 2, listener, CancelToken());
  ASSERT_EQ(listener.lines.size(), 1u);
  EXPECT_THAT(listener.lines[0], HasSubstr("ignore 79 % of a picture"));
  mask("c.png", 10, 255);
  mask("d.png", 11, 255);
  EXPECT_THAT(MessageOf<InputError>([&] { CheckMasks(run, 2, listener, CancelToken()); }),
              AllOf(HasSubstr("masks/c.png: expected a mask of 64 x 48 px as the picture it belongs to, found 10 x 48"),
                    HasSubstr("and 1 more")));
}

TEST(LoadGrey, ReadsEveryKind) {
  const TempDir dir;
  const cv::Mat grey = Ramp(64, 48);
  const trigpoint::Run run = RunWithCamera(64, 48);
  cv::Mat colour, deep;
  cv::cvtColor(grey, colour, cv::COLOR_GRAY2BGR);
  grey.convertTo(deep, CV_16U, 257);
  for (const auto& [name, picture] : std::vector<std::pair<std::string, cv::Mat>>{{"grey.jpg", grey},
                                                                                  {"colour.jpg", colour},
                                                                                  {"grey.png", grey},
                                                                                  {"colour.png", colour},
                                                                                  {"grey.tif", grey},
                                                                                  {"deep.png", deep},
                                                                                  {"deep.tif", deep},
                                                                                  {"a \"b\" \xC3\xA4.jpg", grey}}) {
    ASSERT_TRUE(cv::imwrite((dir / name).string(), picture));
    EXPECT_LT(Difference(LoadGrey(run, Entry(dir / name)), grey), 1.0) << name;
    EXPECT_EQ(LoadPicture(dir / name, false).type(), CV_8UC3) << name;
  }
  // 12 bits stored in 16: seen at full contrast.
  cv::Mat twelve;
  grey.convertTo(twelve, CV_16U, 4095.0 / 255);
  cv::imwrite((dir / "twelve.png").string(), twelve);
  EXPECT_LT(Difference(LoadGrey(run, Entry(dir / "twelve.png")), grey), 1.0);
}

TEST(LoadGrey, ReadsCmyk) {
  // 16 x 8, as print programs write it (Adobe's inverted CMYK): left half no ink, right half three quarters of black.
  const std::string hex =
      "ffd8ffee000e41646f626500640000000000ffdb0043000302020302020303030304030304050805050404050a070706080c0a0c0c0b0a"
      "0b0b0d0e12100d0e110e0b0b1016101113141515150c0f171816141812141514ffc000140800080010044311004d11005911004b1100ff"
      "c4001500010100000000000000000000000000000900ffc40014100100000000000000000000000000000000ffda000e0443004d005900"
      "4b00003f0054ca99532a692002ffd9";
  std::string bytes;
  for (size_t i = 0; i < hex.size(); i += 2) bytes += static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16));
  const TempDir dir;
  const cv::Mat grey = LoadGrey(RunWithCamera(16, 8), Entry(dir.Write("cmyk.jpg", bytes)));
  EXPECT_GT(grey.at<uchar>(4, 3), 250);
  EXPECT_NEAR(grey.at<uchar>(4, 12), 64, 6);
}

TEST(LoadGrey, TurnsByExifUnlessOnlyTheRawPictureFits) {
  const TempDir dir;
  const cv::Mat stored = Ramp(64, 48);
  cv::Mat turned;
  cv::rotate(stored, turned, cv::ROTATE_90_CLOCKWISE);  // orientation 6
  cv::imwrite((dir / "a.jpg").string(), stored, {cv::IMWRITE_JPEG_QUALITY, 100});
  SetOrientation(dir / "a.jpg", 6);
  EXPECT_LT(Difference(LoadPicture(dir / "a.jpg", true), turned), 2.0);
  EXPECT_LT(Difference(LoadGrey(RunWithCamera(48, 64), Entry(dir / "a.jpg")), turned), 2.0);
  EXPECT_LT(Difference(LoadGrey(RunWithCamera(64, 48), Entry(dir / "a.jpg")), stored), 2.0);
  cv::Mat upside_down;
  cv::rotate(stored, upside_down, cv::ROTATE_180);
  SetOrientation(dir / "a.jpg", 3);
  EXPECT_LT(Difference(LoadGrey(RunWithCamera(64, 48), Entry(dir / "a.jpg")), upside_down), 2.0);
}

TEST(LoadGrey, MendsMirroredPictures) {
  const TempDir dir;
  cv::Mat flipped;
  cv::flip(Ramp(64, 48), flipped, 1);
  cv::imwrite((dir / "a.png").string(), flipped);
  trigpoint::Run run = RunWithCamera(64, 48);
  run.config.mirrored = true;
  EXPECT_EQ(Difference(LoadGrey(run, Entry(dir / "a.png")), Ramp(64, 48)), 0);
}

TEST(LoadGrey, NamesWhatIsBroken) {
  const TempDir dir;
  const trigpoint::Run run = RunWithCamera(640, 480);
  cv::Mat noise(480, 640, CV_8UC3);
  cv::randu(noise, 0, 255);
  cv::imwrite((dir / "whole.jpg").string(), noise);
  cv::imwrite((dir / "whole.png").string(), noise);
  cv::imwrite((dir / "whole.tif").string(), noise);
  cv::imwrite((dir / "small.jpg").string(), Ramp(320, 240));
  const auto message = [&](const std::filesystem::path& file) {
    return MessageOf<InputError>([&] { LoadGrey(run, Entry(file)); });
  };
  EXPECT_EQ(message(dir / "whole.jpg"), "");
  EXPECT_THAT(message(dir / "missing.jpg"), HasSubstr("missing.jpg: there is no such picture"));
  EXPECT_THAT(message(dir.Write("zero.jpg", "")), HasSubstr("zero.jpg: the picture is empty (0 bytes)"));
  EXPECT_THAT(message(dir.Write("text.jpg", "hello, I am no picture")), HasSubstr("text.jpg: not a picture"));
  EXPECT_THAT(message(dir / "small.jpg"),
              HasSubstr("small.jpg: expected a picture of 640 x 480 as its camera was calibrated, found 320 x 240"));
  for (const std::string kind : {"jpg", "png", "tif"}) {
    const std::string whole = ReadTextFile(dir / ("whole." + kind));
    for (const double part : {0.999, 0.5, 0.05}) {
      const std::string cut = whole.substr(0, static_cast<size_t>(part * static_cast<double>(whole.size())));
      EXPECT_THAT(message(dir.Write("cut." + kind, cut)), HasSubstr("cut." + kind)) << kind << " " << part;
    }
  }
  // Filled up with zeros, as a copy that broke off may be; and a whole picture with something behind it.
  const std::string jpeg = ReadTextFile(dir / "whole.jpg");
  EXPECT_THAT(message(dir.Write("filled.jpg", jpeg.substr(0, jpeg.size() / 2) + std::string(5000, '\0'))),
              HasSubstr("filled.jpg: the picture is cut off"));
  EXPECT_EQ(message(dir.Write("appended.jpg", jpeg + "a motion picture")), "");
}

TEST(LoadGrey, RefusesHugePicturesBeforeTheyAreDecoded) {
  const TempDir dir;
  // A header and no pixels: whoever decodes it says something else.
  const auto png = [](int width, int height) {
    std::string text = "\x89PNG\r\n\x1A\n";
    const auto number = [&](int value) {
      for (int shift = 24; shift >= 0; shift -= 8) text += static_cast<char>(value >> shift & 0xFF);
    };
    number(13);
    text += "IHDR";
    number(width);
    number(height);
    return text + std::string("\x08\x00\x00\x00\x00", 5) + "0000IEND";
  };
  const auto file = dir.Write("huge.png", png(20000, 20000));
  EXPECT_THAT(MessageOf<InputError>([&] { LoadGrey(RunWithCamera(64, 48), Entry(file)); }),
              HasSubstr("expected a picture of 64 x 48 as its camera was calibrated, found 20000 x 20000"));
  const auto larger = dir.Write("larger.png", png(60000, 30000));
  EXPECT_THAT(MessageOf<InputError>([&] { LoadPanorama(larger, true); }),
              HasSubstr("expected a picture of at most 2^30 pixels, found 60000 x 30000"));
  // Another format, whose size OpenCV looks at: 40,000 x 40,000.
  const std::string bmp = "BM" + std::string(16, '\0') + "\x40\x9C" + std::string(2, '\0') + "\x40\x9C" +
                          std::string(2, '\0') + "\x01" + std::string(1, '\0') + "\x18" + std::string(25, '\0');
  std::string header = bmp;
  header[10] = 54, header[14] = 40;
  const std::string said = MessageOf<InputError>([&] { LoadPanorama(dir.Write("huge.bmp", header), true); });
  EXPECT_THAT(said, HasSubstr("huge.bmp: "));
  EXPECT_THAT(said, HasSubstr("expected JPEG, PNG or TIFF"));
  EXPECT_EQ(said.find("CV_"), std::string::npos) << said;
  trigpoint::Run run = RunWithCamera(64, 48);
  run.cameras[0].mask.pictures = {file};
  EXPECT_THAT(MessageOf<InputError>([&] { RunMasks masks(run); }),
              HasSubstr("expected a mask of 64 x 48 px as the picture it belongs to, found 20000 x 20000"));
  // A whole TIFF, of a kind that OpenCV does not decode.
  cv::Mat doubles(3, 4, CV_64F, cv::Scalar(1));
  ASSERT_TRUE(cv::imwrite((dir / "doubles.tif").string(), doubles));
  EXPECT_THAT(MessageOf<InputError>([&] { LoadGrey(run, Entry(dir / "doubles.tif")); }),
              HasSubstr("as its camera was calibrated, found 4 x 3"));
  // Whoever decodes it gets gigabytes of grey and no error.
  ASSERT_TRUE(cv::imwrite((dir / "small.jpg").string(), Ramp(64, 48)));
  std::string jpeg = ReadTextFile(dir / "small.jpg");
  const size_t frame = jpeg.find("\xFF\xC0");
  ASSERT_NE(frame, std::string::npos);
  jpeg.replace(frame + 5, 4, "\x59\xD8\xB3\xB0");
  EXPECT_THAT(MessageOf<InputError>([&] { LoadPanorama(dir.Write("stretched.jpg", jpeg), true); }),
              HasSubstr("bytes are too few for 46000 x 23000 pixels"));
}

TEST(LoadGrey, WorksInManyThreads) {
  const TempDir dir;
  const trigpoint::Run run = RunWithCamera(64, 48);
  for (int i = 0; i < 8; ++i) cv::imwrite((dir / (std::to_string(i) + ".png")).string(), Ramp(64, 48) + i);
  std::vector<std::thread> threads;
  std::vector<int> good(4, 0);
  for (size_t t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 8; ++i) {
        const cv::Mat grey = LoadGrey(run, Entry(dir / (std::to_string(i) + ".png")));
        good[t] += Difference(grey, Ramp(64, 48) + i) == 0;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(good, std::vector<int>(4, 8));
}

TEST(LoadPanorama, WantsTwoToOneOrTheTagsThatSayWhere) {
  const TempDir dir;
  cv::imwrite((dir / "full.jpg").string(), Ramp(128, 64));
  EXPECT_EQ(LoadPanorama(dir / "full.jpg", true).size(), cv::Size(128, 64));
  cv::imwrite((dir / "odd.jpg").string(), Ramp(128, 48));
  EXPECT_THAT(MessageOf<InputError>([&] { LoadPanorama(dir / "odd.jpg", true); }),
              HasSubstr("odd.jpg: expected an equirectangular panorama twice as wide as high (or GPano tags that state "
                        "which part it is), found 128 x 48"));
  // The sphere without its top quarter, at half the size the tags were written for.
  SetExif(dir / "odd.jpg", {{"Xmp.GPano.FullPanoWidthPixels", "256"},
                            {"Xmp.GPano.FullPanoHeightPixels", "128"},
                            {"Xmp.GPano.CroppedAreaLeftPixels", "0"},
                            {"Xmp.GPano.CroppedAreaTopPixels", "32"},
                            {"Xmp.GPano.CroppedAreaImageWidthPixels", "256"},
                            {"Xmp.GPano.CroppedAreaImageHeightPixels", "96"}});
  const cv::Mat full = LoadPanorama(dir / "odd.jpg", true);
  ASSERT_EQ(full.size(), cv::Size(128, 64));
  EXPECT_EQ(cv::countNonZero(full.rowRange(0, 16)), 0);
  EXPECT_LT(Difference(full.rowRange(16, 64).clone(), Ramp(128, 48)), 2.0);
  SetExif(dir / "odd.jpg",
          {{"Xmp.GPano.FullPanoWidthPixels", "1000000"}, {"Xmp.GPano.FullPanoHeightPixels", "500000"}});
  EXPECT_THAT(MessageOf<InputError>([&] { LoadPanorama(dir / "odd.jpg", true); }),
              HasSubstr("make it a panorama 500000 px wide; expected at most 65534 px"));
}

// The mask of a partial panorama has its size or the sphere's. What lies beside the panorama was not seen.
TEST(ReferenceMask, OfAPartialPanoramaIsPutIntoTheSphere) {
  const TempDir dir;
  const cv::Size sphere(128, 64);
  cv::imwrite((dir / "part.jpg").string(), Ramp(128, 48));
  SetExif(dir / "part.jpg", {{"Xmp.GPano.FullPanoWidthPixels", "256"},
                             {"Xmp.GPano.FullPanoHeightPixels", "128"},
                             {"Xmp.GPano.CroppedAreaLeftPixels", "0"},
                             {"Xmp.GPano.CroppedAreaTopPixels", "32"},
                             {"Xmp.GPano.CroppedAreaImageWidthPixels", "256"},
                             {"Xmp.GPano.CroppedAreaImageHeightPixels", "96"}});
  Reference reference;
  cv::Mat seen = ReferenceMask(reference, dir / "part.jpg", sphere);
  ASSERT_EQ(seen.size(), sphere);
  EXPECT_EQ(cv::countNonZero(seen), 48 * 128);
  EXPECT_EQ(cv::countNonZero(seen.rowRange(0, 16)), 0);

  reference.mask = dir / "mask.png";
  const auto write_mask = [&](int rows, int ignored) {
    cv::Mat mask(rows, 128, CV_8U, cv::Scalar(255));
    mask.rowRange(rows - ignored, rows).setTo(0);
    ASSERT_TRUE(cv::imwrite(reference.mask.string(), mask));
  };
  for (const int rows : {48, 64}) {
    write_mask(rows, 8);
    seen = ReferenceMask(reference, dir / "part.jpg", sphere);
    EXPECT_EQ(cv::countNonZero(seen), 40 * 128) << rows;
    EXPECT_EQ(cv::countNonZero(seen.rowRange(16, 56)), 40 * 128) << rows;
  }
  write_mask(50, 8);
  EXPECT_THAT(MessageOf<InputError>([&] { ReferenceMask(reference, dir / "part.jpg", sphere); }),
              HasSubstr("expected a mask of 128 x 48 px as the picture it belongs to, found 128 x 50"));
}

TEST(PhotoMetadata, TellsWhatTheFileSays) {
  const TempDir dir;
  cv::imwrite((dir / "p.jpg").string(), Ramp(80, 60));
  SetExif(dir / "p.jpg", {{"Exif.Image.Orientation", "6"},
                          {"Exif.Photo.FocalLengthIn35mmFilm", "27"},
                          {"Exif.Photo.DateTimeOriginal", "2026:05:12 11:43:20"},
                          {"Exif.Photo.SubSecTimeOriginal", "25"},
                          {"Exif.GPSInfo.GPSLatitude", "33/1 30/1 36/1"},
                          {"Exif.GPSInfo.GPSLatitudeRef", "S"},
                          {"Exif.GPSInfo.GPSLongitude", "70/1 15/1 0/1"},
                          {"Exif.GPSInfo.GPSLongitudeRef", "W"},
                          {"Exif.GPSInfo.GPSAltitude", "5205/10"},
                          {"Exif.GPSInfo.GPSImgDirection", "270/1"},
                          {"Exif.GPSInfo.GPSImgDirectionRef", "T"}});
  const PhotoMetadata metadata = ReadPhotoMetadata(dir / "p.jpg");
  EXPECT_EQ(metadata.width, 80);
  EXPECT_EQ(metadata.height, 60);
  EXPECT_EQ(metadata.orientation, 6);
  EXPECT_EQ(metadata.ShownSize(), cv::Size(60, 80));
  ASSERT_TRUE(metadata.focal_px);
  EXPECT_NEAR(*metadata.focal_px, 60, 1e-9);  // 27 / 36 of the long side
  ASSERT_TRUE(metadata.position);
  EXPECT_NEAR(metadata.position->latitude_deg, -33.51, 1e-12);
  EXPECT_NEAR(metadata.position->longitude_deg, -70.25, 1e-12);
  EXPECT_NEAR(metadata.position->height_m, 520.5, 1e-12);
  EXPECT_FALSE(metadata.height_above_sea);
  EXPECT_EQ(metadata.taken_utc_ns, ParseUtcToNs("2026-05-12T11:43:20.25Z"));
  EXPECT_FALSE(metadata.taken_zone_known);
  const auto camera = CameraFromMetadata(metadata);
  ASSERT_TRUE(camera);
  EXPECT_EQ(camera->width(), 60);  // as shown
  EXPECT_EQ(camera->height(), 80);
  EXPECT_EQ(camera->params(), (std::vector<double>{60, 60, 29.5, 39.5}));
  std::vector<std::string> warnings;
  const GeoTag tag = GeoTagFromMetadata(metadata, dir / "p.jpg", &warnings);
  EXPECT_TRUE(tag.has_position && tag.has_height && tag.has_heading && !tag.has_tilt);
  EXPECT_NEAR(tag.attitude.heading_rad, 1.5 * M_PI, 1e-12);
  EXPECT_TRUE(warnings.empty());

  SetExif(dir / "p.jpg", {{"Exif.GPSInfo.GPSAltitudeRef", "1"}, {"Exif.Photo.OffsetTimeOriginal", "+02:00"}});
  const PhotoMetadata more = ReadPhotoMetadata(dir / "p.jpg");
  EXPECT_NEAR(more.position->height_m, -520.5, 1e-12);
  EXPECT_TRUE(more.taken_zone_known);
  EXPECT_EQ(more.taken_utc_ns, ParseUtcToNs("2026-05-12T09:43:20.25Z"));
  GeoTagFromMetadata(more, dir / "p.jpg", &warnings);
  EXPECT_THAT(Joined(warnings), HasSubstr("as above sea level"));
}

// EXIF 3.0 gave 0 and 1 of GPSAltitudeRef a new meaning; the GPS tags' own version comes before that of the picture.
TEST(PhotoMetadata, HeightsAreOfTheSeaOrTheEllipsoidByTheirVersion) {
  const TempDir dir;
  const char *k232 = "48 50 51 50", *k300 = "48 51 48 48", *k310 = "48 51 49 48";  // digits
  const struct {
    const char *exif, *gps, *ref;
    double height_m;
    bool above_sea;
  } cases[] = {
      {"", "", "0", 52.5, true},           {"", "", "1", -52.5, true},         {k232, "", "0", 52.5, true},
      {k300, "", "0", 52.5, false},        {k300, "", "1", -52.5, false},      {k310, "", "0", 52.5, false},
      {k300, "", "2", 52.5, true},         {k300, "", "3", -52.5, true},       {"", "2 3 0 0", "0", 52.5, true},
      {"", "2 4 0 0", "1", -52.5, false},  {k300, "2 3 0 0", "0", 52.5, true}, {k232, "2 4 0 0", "0", 52.5, false},
      {k232, "2 3 0 0", "3", -52.5, true}, {"", "", "", 52.5, false}};
  for (const auto& c : cases) {
    cv::imwrite((dir / "p.jpg").string(), Ramp(80, 60));
    std::vector<std::pair<std::string, std::string>> tags = {{"Exif.GPSInfo.GPSLatitude", "48/1 0/1 0/1"},
                                                             {"Exif.GPSInfo.GPSLatitudeRef", "N"},
                                                             {"Exif.GPSInfo.GPSLongitude", "7/1 0/1 0/1"},
                                                             {"Exif.GPSInfo.GPSLongitudeRef", "E"},
                                                             {"Exif.GPSInfo.GPSAltitude", "525/10"}};
    const auto add = [&](const char* key, const char* value) {
      if (*value != '\0') tags.emplace_back(key, value);
    };
    add("Exif.Photo.ExifVersion", c.exif);
    add("Exif.GPSInfo.GPSVersionID", c.gps);
    add("Exif.GPSInfo.GPSAltitudeRef", c.ref);
    SetExif(dir / "p.jpg", tags);
    const PhotoMetadata metadata = ReadPhotoMetadata(dir / "p.jpg");
    const std::string of = std::string("version '") + c.exif + "', GPS '" + c.gps + "', reference '" + c.ref + "'";
    ASSERT_TRUE(metadata.position && metadata.has_height) << of;
    EXPECT_NEAR(metadata.position->height_m, c.height_m, 1e-12) << of;
    EXPECT_EQ(metadata.height_above_sea, c.above_sea) << of;
  }
}

// The sign is right for programs that know 0 and 1 alone, and the version states what the height is above.
TEST(PhotoMetadata, WrittenPositionsAreReadAsTheyAre) {
  const TempDir dir;
  for (const bool above_sea : {true, false}) {
    for (const double height_m : {241.125, -3.5}) {
      cv::imwrite((dir / "p.jpg").string(), Ramp(80, 60));
      // A copy of a picture whose camera stated otherwise.
      SetExif(dir / "p.jpg", {{"Exif.Photo.ExifVersion", above_sea ? "48 51 48 48" : "48 50 51 50"},
                              {"Exif.GPSInfo.GPSVersionID", "2 2 0 0"},
                              {"Exif.GPSInfo.GPSAltitudeRef", "2"}});
      PanoramaMetadata m;
      m.position = Geodetic{-33.8567844, 151.2152967, height_m};
      m.has_height = true;
      m.height_above_sea = above_sea;
      const auto image = Exiv2::ImageFactory::open((dir / "p.jpg").string());
      image->readMetadata();
      WriteExifPosition(m, &image->exifData());
      EXPECT_EQ(image->exifData()["Exif.GPSInfo.GPSAltitudeRef"].toString(), height_m < 0 ? "1" : "0");
      image->writeMetadata();
      const PhotoMetadata read = ReadPhotoMetadata(dir / "p.jpg");
      ASSERT_TRUE(read.position);
      // Half a millionth of a second, half a millimetre.
      EXPECT_NEAR(read.position->latitude_deg, m.position->latitude_deg, 1.5e-10);
      EXPECT_NEAR(read.position->longitude_deg, m.position->longitude_deg, 1.5e-10);
      EXPECT_NEAR(read.position->height_m, height_m, 5.01e-4);
      EXPECT_EQ(read.height_above_sea, above_sea);
    }
  }
}

TEST(PhotoMetadata, FallsBackToTheFocalPlane) {
  const TempDir dir;
  cv::imwrite((dir / "p.jpg").string(), Ramp(100, 60));
  SetExif(dir / "p.jpg", {{"Exif.Photo.FocalLength", "5/1"},
                          {"Exif.Photo.FocalPlaneXResolution", "2540/1"},  // a tenth of a millimetre a 10 pixels
                          {"Exif.Photo.FocalPlaneResolutionUnit", "2"},
                          {"Exif.Photo.PixelXDimension", "200"}});
  EXPECT_NEAR(ReadPhotoMetadata(dir / "p.jpg").focal_px.value(), 5 * 100 * 0.5, 1e-9);
  cv::imwrite((dir / "upright.jpg").string(), Ramp(60, 100));  // turned by a program that kept the camera's tags
  SetExif(dir / "upright.jpg", {{"Exif.Photo.FocalLength", "5/1"},
                                {"Exif.Photo.FocalPlaneXResolution", "2540/1"},
                                {"Exif.Photo.FocalPlaneResolutionUnit", "2"},
                                {"Exif.Photo.PixelXDimension", "200"},
                                {"Exif.Photo.PixelYDimension", "120"}});
  EXPECT_NEAR(ReadPhotoMetadata(dir / "upright.jpg").focal_px.value(), 5 * 100 * 0.5, 1e-9);
  cv::imwrite((dir / "bare.png").string(), Ramp(100, 60));
  const PhotoMetadata bare = ReadPhotoMetadata(dir / "bare.png");
  EXPECT_EQ(bare.width, 100);
  EXPECT_FALSE(bare.focal_px || bare.position || bare.heading_deg || bare.taken_utc_ns || bare.gpano);
  EXPECT_FALSE(CameraFromMetadata(bare));
  EXPECT_THAT(MessageOf<InputError>([&] { ReadPhotoMetadata(dir.Write("x.jpg", "no")); }), HasSubstr("x.jpg"));
  EXPECT_THAT(MessageOf<InputError>([&] { ReadPhotoMetadata(dir.Write("z.jpg", "")); }), HasSubstr("0 bytes"));
}

TEST(PhotoMetadata, ReadsGPano) {
  const TempDir dir;
  cv::imwrite((dir / "p.jpg").string(), Ramp(128, 64));
  SetExif(dir / "p.jpg", {{"Xmp.GPano.ProjectionType", "equirectangular"},
                          {"Xmp.GPano.PoseHeadingDegrees", "195.14"},
                          {"Xmp.GPano.PosePitchDegrees", "-0.17"},
                          {"Xmp.GPano.PoseRollDegrees", "2.5"}});
  const PhotoMetadata metadata = ReadPhotoMetadata(dir / "p.jpg");
  ASSERT_TRUE(metadata.gpano);
  EXPECT_EQ(metadata.gpano->projection, "equirectangular");
  std::vector<std::string> warnings;
  const GeoTag tag = GeoTagFromMetadata(metadata, dir / "p.jpg", &warnings);
  EXPECT_FALSE(tag.has_position);
  EXPECT_TRUE(tag.has_heading && tag.has_tilt);
  EXPECT_NEAR(tag.attitude.heading_rad, 195.14 * kDegToRad, 1e-12);
  EXPECT_NEAR(tag.attitude.pitch_rad, -0.17 * kDegToRad, 1e-12);
  EXPECT_NEAR(tag.attitude.roll_rad, 2.5 * kDegToRad, 1e-12);
}

TEST(Pictures, ComeInTheOrderOfTheirNumbers) {
  const TempDir dir;
  for (const char* name : {"IMG_10.jpg", "IMG_9.JPG", "IMG_2.tiff", ".hidden.jpg", "notes.txt", "IMG_2b.png"}) {
    dir.Write(name, "x");
  }
  std::vector<std::string> names;
  for (const auto& file : PicturesIn(dir.path())) names.push_back(file.filename().string());
  EXPECT_EQ(names, (std::vector<std::string>{"IMG_2.tiff", "IMG_2b.png", "IMG_9.JPG", "IMG_10.jpg"}));
  EXPECT_TRUE(PicturesIn(dir / "none").empty());
}

// As a card reader copies it: the same name, more frames.
TEST(Video, OneThatGrewIsOpenedAgain) {
  const TempDir dir;
  const std::filesystem::path file = dir / "clip.avi";
  const auto write = [&](int count) {
    cv::VideoWriter writer(file.string(), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, {64, 48});
    if (!writer.isOpened()) return false;
    for (int i = 0; i < count; ++i) writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(5 * i)));
    return true;
  };
  if (!write(10)) GTEST_SKIP() << "this OpenCV writes no videos";
  EXPECT_EQ(VideoFrameTimes(file).size(), 10U);
  EXPECT_NEAR(cv::mean(ReadVideoFrameGrey(file, 8))[0], 40, 3);
  ASSERT_TRUE(write(30));
  EXPECT_EQ(VideoFrameTimes(file).size(), 30U);
  EXPECT_NEAR(cv::mean(ReadVideoFrameGrey(file, 25))[0], 125, 3);
}

TEST(Video, HasColours) {
  const TempDir dir;
  trigpoint::Run run = RunWithCamera(64, 48);
  run.config.mirrored = true;
  ImageEntry entry = Entry(dir / "clip.avi");
  cv::VideoWriter writer(entry.path.string(), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, {64, 48});
  if (!writer.isOpened()) GTEST_SKIP() << "this OpenCV writes no videos";
  for (int i = 0; i < 9; ++i) {
    cv::Mat frame(48, 64, CV_8UC3, cv::Scalar(40, 40, 20.0 * i));
    frame.colRange(32, 64).setTo(cv::Scalar(20.0 * i, 40, 40));
    writer.write(frame);
  }
  writer.release();
  for (const int i : {8, 2, 7}) {  // back, too
    entry.video_frame = i;
    const cv::Mat picture = LoadColour(run, entry);
    ASSERT_EQ(picture.type(), CV_8UC3);
    const cv::Vec3b blue = picture.at<cv::Vec3b>(24, 10), red = picture.at<cv::Vec3b>(24, 54);
    EXPECT_NEAR(blue[0], 20 * i, 8) << i;
    EXPECT_NEAR(blue[2], 40, 8) << i;
    EXPECT_NEAR(red[2], 20 * i, 8) << i;
    EXPECT_EQ(LoadGrey(run, entry).type(), CV_8U);
  }
}

class VideoTest : public testing::TestWithParam<int> {};

TEST_P(VideoTest, FramesHaveTimesAndComeInAnyOrder) {
  const TempDir dir;
  const int count = GetParam();
  const std::filesystem::path file = dir / "runs/run1/clip.avi";
  std::filesystem::create_directories(file.parent_path());
  cv::VideoWriter writer(file.string(), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, {64, 48});
  if (!writer.isOpened()) GTEST_SKIP() << "this OpenCV writes no videos";
  for (int i = 0; i < count; ++i) writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all((7 * i) % 250)));
  writer.release();
  dir.Write("runs/run1/camchain.yaml",
            "cam0:\n  camera_model: pinhole\n  intrinsics: [60, 60, 31.5, 23.5]\n  resolution: [64, 48]\n");
  dir.Write("runs/run1/run.yaml", "video:\n  start_s: 10.5\n  every: 2\n");
  const trigpoint::Run run = ReadRun(file.parent_path(), dir.path());
  ASSERT_EQ(run.images.size(), static_cast<size_t>((count + 1) / 2));
  for (size_t i = 0; i < run.images.size(); ++i) {
    EXPECT_NEAR(static_cast<double>(run.images[i].stamp_ns), 10.5e9 + static_cast<double>(i) * 80e6, 1e3);
  }
  EXPECT_EQ(run.images[3].file, "clip.avi#000006");
  EXPECT_EQ(run.images[3].video_frame, 6);
  for (const size_t i : {size_t{3}, size_t{0}, run.images.size() - 1, size_t{9}, size_t{8}}) {
    EXPECT_NEAR(cv::mean(LoadGrey(run, run.images[i]))[0], static_cast<double>((14 * i) % 250), 2) << i;
  }
  ImageEntry beyond = run.images[0];
  beyond.video_frame = count + 5;
  EXPECT_THAT(MessageOf<InputError>([&] { LoadGrey(run, beyond); }), HasSubstr("clip.avi: frame"));
}

INSTANTIATE_TEST_SUITE_P(ShortAndLong, VideoTest, testing::Values(40, 301));

TEST(Video, ThatCannotBeOpenedIsNamed) {
  const TempDir dir;
  dir.Write("runs/run1/camchain.yaml",
            "cam0:\n  camera_model: pinhole\n  intrinsics: [60, 60, 31.5, 23.5]\n  resolution: [64, 48]\n");
  dir.Write("runs/run1/clip.mp4", "not a video");
  EXPECT_THAT(MessageOf<InputError>([&] { ReadRun(dir / "runs/run1", dir.path()); }),
              HasSubstr("clip.mp4: the video cannot be opened"));
}

}  // namespace
}  // namespace trigpoint

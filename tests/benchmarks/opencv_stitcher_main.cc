// OpenCV's Stitcher on a folder of photos, for comparison: its cameras, as JSON, and CPU seconds.
//   opencv_stitcher OUT.jpg PHOTO...
#include <cstdio>
#include <ctime>
#include <iostream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/stitching.hpp>

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fputs("usage: opencv_stitcher OUT.jpg PHOTO PHOTO...\n", stderr);
    return 2;
  }
  std::vector<cv::Mat> photos;
  for (int i = 2; i < argc; ++i) photos.push_back(cv::imread(argv[i]));
  const std::clock_t begin = std::clock();
  const cv::Ptr<cv::Stitcher> stitcher = cv::Stitcher::create(cv::Stitcher::PANORAMA);
  nlohmann::json out;
  cv::Mat panorama;
  auto status = stitcher->estimateTransform(photos);
  if (status == cv::Stitcher::OK) {
    // The panorama may fail where the cameras are there: both are told.
    const auto composed = stitcher->composePanorama(panorama);
    out["composed"] = composed == cv::Stitcher::OK;
    if (composed == cv::Stitcher::OK) cv::imwrite(argv[1], panorama);
  }
  out["status"] = static_cast<int>(status);
  out["cpu_seconds"] = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  out["work_scale"] = stitcher->workScale();
  out["cameras"] = nlohmann::json::array();
  if (status == cv::Stitcher::OK) {
    const std::vector<int> used = stitcher->component();
    const std::vector<cv::detail::CameraParams> cameras = stitcher->cameras();
    for (size_t k = 0; k < cameras.size(); ++k) {
      cv::Mat r;
      cameras[k].R.convertTo(r, CV_64F);
      out["cameras"].push_back({{"index", used[k]},
                                {"focal", cameras[k].focal},
                                {"aspect", cameras[k].aspect},
                                {"ppx", cameras[k].ppx},
                                {"ppy", cameras[k].ppy},
                                {"r", std::vector<double>(r.begin<double>(), r.end<double>())}});
    }
  }
  std::cout << out.dump() << "\n";
  return status == cv::Stitcher::OK ? 0 : 1;
}

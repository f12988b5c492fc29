// A run made of a recording of ROS.
#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "datasets/bag/messages.h"
#include "datasets/import/colmap_run.h"

namespace trigpoint {

struct BagRunOptions {
  std::string run;                  // name of the run to be made
  std::vector<std::string> topics;  // what to take; empty: all cameras, and what there is one of
  std::filesystem::path cameras;    // calibrations in place of the bag's, in the order of the image topics; or empty
  int every = 1;                    // of each camera every n-th image
};

// What of a bag is taken.
struct BagChoice {
  std::vector<BagTopic> images;  // cam0, cam1, ...
  std::optional<BagTopic> pose, fix, imu;
  std::string problem;  // why this cannot be imported without --topic; or empty
};

// Without `topics`: each camera once (raw before compressed, unrectified before rectified, no depth), and odometry,
// GPS and IMU if there is one topic of each. Throws OptionError for a topic that is not there or of no use.
BagChoice ChooseTopics(const BagContents& contents, const std::vector<std::string>& topics);

// The camera_info that belongs to an image topic; null: none.
const BagTopic* CameraInfoOf(const BagContents& contents, const std::string& image_topic);

// 8- or 16-bit, grey or BGR. Throws InputError for an encoding that is no picture and for sizes that don't fit.
// `converted` holds pixels that are not the message's own; the picture is valid until the next one is put there.
cv::Mat PictureOf(const RosImage& image, cv::Mat* converted);

// Writes SITE/runs/<run>/: images/<camera>/<nanoseconds>.png (or the compressed picture as it is), images.txt,
// camchain.yaml (from camera_info and the fixed transforms to the odometry's body), odometry.tum, gps.csv, run.yaml.
// Times are those of the messages' headers. Messages that cannot be read are left out and counted. Throws InputError;
// a failed import leaves nothing.
ImportReport ImportBagRun(const std::filesystem::path& site, const std::filesystem::path& bag,
                          const BagRunOptions& options, ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint

// A run made of a folder of a public data set: EuRoC, TUM RGB-D, KITTI odometry; or of Record3D (ARKit); or of a video.
#pragma once

#include <filesystem>
#include <string>

#include "datasets/import/colmap_run.h"

namespace trigpoint {

// "euroc" (mav0/cam0/sensor.yaml, or cam0/sensor.yaml), "tum-rgbd" (rgb.txt), "kitti" (times.txt, calib.txt,
// image_0 or image_2), "record3d" (metadata, rgbd: the unpacked .r3d); "" for anything else.
std::string DatasetKind(const std::filesystem::path& folder);

// One line: kind, numbers of images, cameras and poses, ground truth. Throws InputError for what cannot be imported.
std::string DescribeDataset(const std::filesystem::path& folder);
// One line: the track that would be imported with it. Throws InputError for a file of Insta360.
std::string DescribeVideo(const std::filesystem::path& video);

// A file of Insta360's cameras as they write it: not published, not read.
bool IsInsta360File(const std::filesystem::path& file);

struct DatasetRunOptions {
  std::string run;  // name of the run to be made
  // Poses, or empty: of the body (EuRoC, Record3D), of the first camera (TUM, KITTI); or a log of ARCore or ARKit by
  // its name (ARCore_sensor_pose.txt, ARKit_camera_pose.txt), whose first pose is at the first image.
  std::filesystem::path odometry;
  std::filesystem::path cameras;  // calibrations in place of the folder's, or empty
  int every = 1;                  // of each camera every n-th image
};

// Writes SITE/runs/<run>/: images/<camera> (links), images.txt, camchain.yaml, odometry.tum. Poses are TUM's or EuRoC's
// rows, or KITTI's matrices, whose times are the folder's times.txt. Ground truth of the folder is not taken, only
// named. Throws InputError; a failed import leaves nothing.
ImportReport ImportDatasetRun(const std::filesystem::path& site, const std::filesystem::path& folder,
                              const DatasetRunOptions& options);

// Writes SITE/runs/<run>/: the video (a link), a GPX or NMEA track of the video's name beside it (a copy),
// camchain.yaml (options.cameras), odometry.tum (options.odometry), run.yaml: when the video began in UTC (its creation
// time, else the track's first time, with a warning), every n-th frame. Throws InputError; a failed import leaves
// nothing.
ImportReport ImportVideoRun(const std::filesystem::path& site, const std::filesystem::path& video,
                            const DatasetRunOptions& options);

}  // namespace trigpoint

// What a user brings, as read from the folder of docs/file_formats.md: plain values, nothing computed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calib/camera/camera.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/rigid3.h"
#include "datasets/io/trajectory.h"

namespace trigpoint {

// What of a camera's pictures is ignored, in pixels of the pictures as they are stored.
struct CameraMask {
  std::vector<std::filesystem::path> pictures;  // 8-bit, of the picture's size, 0 = ignored: for every image
  std::vector<std::filesystem::path> folders;   // of such pictures, one for each image (see MaskInFolder)
  std::vector<Eigen::Vector4d> boxes_px;        // u0, v0, u1, v1, the border included
};

// What a camera sees of the stored picture, which several cameras may share.
struct PicturePart {
  enum class Kind : uint8_t { kAll, kCrop, kView };  // all; a crop as large as its images; a view of a 360 picture
  Kind kind = Kind::kAll;
  uint8_t view = 0;       // kView: counted to the right; 0 looks along the picture's centre
  uint16_t x = 0, y = 0;  // kCrop: its first pixel; kView: width and height of the 360 picture
};

// Of BodyCamera::focal_sigma_share: from here on the focal length is hardly known.
inline constexpr double kWildGuess = 0.2;

// One camera of a camchain (Kalibr), or a view of its 360 pictures.
struct BodyCamera {
  std::string name;  // cam0, ...
  Camera camera;
  Rigid3d cam_from_body;  // body: x forward, y left, z up
  bool has_extrinsics = false;
  PicturePart part;
  double time_offset_s = 0;  // Kalibr's timeshift_cam_imu: t_imu = t_cam + shift
  // Rolling shutter: from the first row's exposure to the last one's; negative: the last row comes first. An image's
  // time is that of its middle row.
  double readout_s = 0;
  CameraMask mask;
  // Nobody calibrated it: its focal length is a guess with this 1 sigma, a share of it; 0: calibrated.
  double focal_sigma_share = 0, guessed_focal_px = 0;

  // Beside the first view of a 360 camera, which reports the pose for all of them.
  bool IsFurtherView() const { return part.view > 0; }
};

struct ImageEntry {
  int64_t stamp_ns = 0;
  std::string file;            // as written in images.txt, relative to the run
  std::filesystem::path path;  // absolute
  int camera = 0;              // index into Run::cameras
  int video_frame = -1;        // >= 0: frame of the video at `path`
};

struct GpsFix {
  int64_t stamp_ns = 0;  // on the run's clock
  Geodetic position;     // of the antenna, ellipsoidal height
  double sigma_h_m = 3;  // 1 sigma per horizontal axis
  double sigma_v_m = 5;
  double sigma_sea_m = 0;  // what of sigma_v_m is the height of the sea above the ellipsoid: one error of all fixes
};

struct RunConfig {
  std::string date;
  std::string role = "both";     // survey, evaluation, both
  std::string camera;            // name of a calibration of this project, or empty
  bool mirrored = false;         // pictures are flipped left-right; undone on loading, pixels count in the mended one
  bool equirectangular = false;  // `camera: equirectangular`: 360 pictures, which need no calibration
  std::map<std::string, CameraMask> masks;                    // by camera ("": all); folders stand among the pictures
  std::optional<int64_t> time_zero_utc_ns;                    // UTC of timestamp 0
  Eigen::Vector3d gps_lever_arm_m = Eigen::Vector3d::Zero();  // antenna in the body frame
  double gps_time_offset_s = 0;                               // already added to the fixes' stamps: gives image time
  bool odometry_levelled = false;
  double odometry_scale_sigma = 0.01;
  double odometry_time_offset_s = 0;  // already added to the poses' stamps: gives image time
  double video_start_s = 0;           // time of a video's first frame on the run's clock
  int video_every = 1;                // every n-th frame is used
};

struct Run {
  std::string name;
  std::filesystem::path dir;
  RunConfig config;
  std::vector<BodyCamera> cameras;
  std::vector<ImageEntry> images;  // ascending time, then camera
  Trajectory odometry;             // odom_from_body; empty poses: none
  std::vector<GpsFix> gps;
  std::filesystem::path detections;  // detections.csv in place of images, or empty
  std::vector<std::string> warnings;
};

// Where a reference says it was taken. Sigmas: 1 sigma, per axis.
struct GeoTag {
  bool has_position = false;
  bool has_height = false;
  bool has_heading = false;
  bool has_tilt = false;
  Geodetic position;
  Attitude attitude;  // of the optical axis / the image centre
  double sigma_h_m = 1, sigma_v_m = 2;
  double sigma_heading_rad = 2 * kDegToRad;
  double sigma_tilt_rad = 1 * kDegToRad;  // of pitch and of roll
};

enum class ReferenceKind { kPanorama, kPhoto, kPhotoSet };

// A reference as brought: a panorama, a single geotagged photo, or a hand-held set.
struct Reference {
  ReferenceKind kind = ReferenceKind::kPanorama;
  std::string name;                          // unique: the file as written in the table (or the set's folder name)
  std::string station;                       // may equal name
  std::vector<std::filesystem::path> files;  // one; for a set, all photos in order
  std::optional<Camera> camera;              // photo: its camera; panorama: none (equirectangular)
  std::filesystem::path mask;                // of its one file: 8-bit, 0 = ignored; empty: none
  GeoTag geotag;
};

struct Station {
  std::string name;
  int tag_id = -1;
  Eigen::Vector3d offset_m = Eigen::Vector3d::Zero();  // centre minus tag centre
  bool in_tag_frame = false;  // false: east, north, up; true: right, out, up in the tag's levelled frame
  double sigma_m = 0.01;
};

struct TagSizes {
  std::string family = "tag36h11";
  double size_m = 0;  // edge of the black square; 0: unknown
  std::map<int, double> sizes_m;
  bool Given() const { return size_m > 0 || !sizes_m.empty(); }
  double SizeOf(int id) const {
    const auto it = sizes_m.find(id);
    return it == sizes_m.end() ? size_m : it->second;
  }
  TagSizes Scaled(double factor) const {
    TagSizes scaled{family, factor * size_m, sizes_m};
    for (auto& [id, size] : scaled.sizes_m) size *= factor;
    return scaled;
  }
};

struct ControlPoint {
  int tag_id = -1;                         // -1: a point marked in images
  int corner = -1;                         // -1: the tag's centre
  std::string point;                       // name of a marked point
  bool control = false;                    // role: control (may be used) or check (must not)
  bool has_role = true;                    // false: the table doesn't say; control until somebody decides
  std::optional<Geodetic> geodetic;        // or
  std::optional<Eigen::Vector3d> local_m;  // x_m, y_m, z_m in site ENU
  double sigma_h_m = 0.01, sigma_v_m = 0.01;
  std::string height_system = "ellipsoidal";
  std::string epoch;
};

struct Site {
  std::filesystem::path dir;
  std::optional<Geodetic> origin;  // from origin.json
  std::vector<Run> runs;
  std::map<std::string, std::string> broken_runs;  // run -> why nothing of it can be used
  std::vector<Reference> references;
  std::vector<Station> stations;
  TagSizes tags;
  std::vector<ControlPoint> control_points;
  std::filesystem::path aerial;  // GeoTIFF or empty
  std::vector<std::string> warnings;
};

// Reads everything the layout of docs/file_formats.md knows below `dir`; what is missing is left empty, what is broken
// throws InputError only if nothing of it can be used, else a warning. Images are not opened (sizes are checked on
// use).
Site ReadSite(const std::filesystem::path& dir);
// One run of a site.
Run ReadRun(const std::filesystem::path& run_dir, const std::filesystem::path& site_dir);

}  // namespace trigpoint

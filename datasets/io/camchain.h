// Calibrated cameras as Kalibr writes them: camchain.yaml.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "datasets/io/site.h"

namespace trigpoint {

// Cameras cam0, cam1, ... in the file's order. Models: pinhole with distortion none, radtan (4, 5 or 8 coefficients in
// OpenCV's order) or equidistant; equirectangular with a resolution alone. `crop` names the part of the stored picture
// that a camera sees. T_cam_imu is cam_from_body; T_cn_cnm1 chains from the camera before; T_imu_cam is
// the inverse of T_cam_imu. Without any extrinsics the first camera is taken to look along the body's x axis and
// has_extrinsics is false. Throws InputError with file, line and key (omni and double sphere cameras are refused).
std::vector<BodyCamera> ReadCamchain(const std::filesystem::path& file);

// A transform as a calibration states it. Throws InputError "expected ..., found ..." for what is no rigid motion: a
// rotation is orthonormal with determinant 1, within 1e-3.
Rigid3d RigidFromMatrix(const Eigen::Matrix4d& m);

// A camera that looks along the body's x axis, upright: cam_from_body where nothing says how it is mounted.
Rigid3d LevelForwardCamera();

// The time of the body's pose that an image belongs to: its stamp on the camera's clock, shifted to the body's (the
// clock of odometry and GPS).
int64_t BodyStamp(int64_t image_stamp_ns, const BodyCamera& camera);

// Cameras take the lenses (models, intrinsics, how well they are known) of those of the same name, in any order; other
// cameras keep theirs. A 360 camera is known by its kind: its views keep theirs, too.
void TakeLenses(const std::vector<BodyCamera>& from, std::vector<BodyCamera>* cameras);

// Writes the same form (atomically), the views of a 360 camera as that camera; T_cam_imu where has_extrinsics, else
// T_cn_cnm1 from the camera before.
void WriteCamchain(const std::filesystem::path& file, const std::vector<BodyCamera>& cameras,
                   const std::vector<std::string>& comments = {});

}  // namespace trigpoint

// Calibrated cameras in the forms other programs write: OpenCV's YAML, ROS camera_info, COLMAP's cameras.txt, JSON of
// vision coprocessors; and Kalibr's camchain (camchain.h).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "datasets/io/site.h"

namespace trigpoint {

struct CameraFile {
  std::string format;  // "Kalibr", "OpenCV or ROS", "COLMAP", "Agisoft", "JSON"
  std::vector<BodyCamera> cameras;
  bool related = false;  // is it known how several cameras sit to each other?
};

// Reads any of them, told apart by what is in the file:
//   Kalibr       camchain.yaml
//   OpenCV, ROS  camera_matrix (or cameraMatrix, K, k), distortion_coefficients (dist_coeffs, distCoeffs, D, d),
//                image_width and image_height (width, height, image_size), distortion_model: plumb_bob, radtan,
//                rational_polynomial, equidistant or fisheye; without it by the number of coefficients (4, 5, 8).
//                Two cameras as M1, D1, M2, D2, with R, T (second from first) or without.
//                The same names in OpenCV's XML (opencv_storage).
//   COLMAP       cameras.txt or cameras.bin (by its ending); its pixels become ours
//   Agisoft      the XML of a lens (calibration: projection frame or fisheye, f, cx, cy, b1, k1 to k4, p1, p2), or
//                cameras.xml with sensors, each by its adjusted calibration
//   JSON         PhotonVision's calibration: cameraIntrinsics, distCoeffs, resolution
// `width`, `height`: of the pictures, where the file doesn't say; 0: then it must. Throws InputError naming the file
// and what is missing.
CameraFile ReadCameraFile(const std::filesystem::path& file, int width = 0, int height = 0);

// The cameras of a file for `count` of them whose pictures belong together, named cam0, cam1, ...; `of` names their
// source in messages. Throws InputError for another number of cameras, and where it is not known how they sit to each
// other: written as one rig they would all stand at one place.
std::vector<BodyCamera> ReadCamerasFor(const std::filesystem::path& file, size_t count, const std::string& of,
                                       int width = 0, int height = 0);

// A camera from K (3 x 3, by rows) and coefficients in OpenCV's order; `model` as above, "" by their number. `where`
// begins the messages of InputError.
Camera OpenCvCamera(const std::string& where, const std::vector<double>& k, std::vector<double> d, std::string model,
                    int width, int height);

// Each is written atomically. OpenCV: camera_matrix, distortion_coefficients, model by distortion_model.
void WriteOpenCvCamera(const std::filesystem::path& file, const BodyCamera& camera,
                       const std::vector<std::string>& comments);
void WriteRosCameraInfo(const std::filesystem::path& file, const BodyCamera& camera,
                        const std::vector<std::string>& comments);
void WriteColmapCameras(const std::filesystem::path& file, const std::vector<BodyCamera>& cameras,
                        const std::vector<std::string>& comments);

}  // namespace trigpoint

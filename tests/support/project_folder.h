// A small made project folder that is removed with the object.
#pragma once

#include <filesystem>
#include <string>

#include "tests/support/temp_dir.h"

namespace trigpoint {

class ProjectFolder {
 public:
  // Two runs with odometry and detections in place of images, and two control points, below a folder of the given name.
  explicit ProjectFolder(const std::string& name = "site") : dir_(root_ / name) {
    for (const char* run : {"run1", "run2"}) {
      Write(std::string("runs/") + run + "/odometry.tum", "1.0 0 0 0 0 0 0 1\n2.0 1 0 0 0 0 0 1\n");
      Write(std::string("runs/") + run + "/detections.csv",
            "timestamp,tag_id,u0,v0,u1,v1,u2,v2,u3,v3\n1.0,1,10,20,20,20,20,10,10,10\n");
      Write(std::string("runs/") + run + "/camchain.yaml",
            "cam0:\n  camera_model: pinhole\n  intrinsics: [100, 100, 49.5, 49.5]\n  distortion_model: radtan\n"
            "  distortion_coeffs: [0, 0, 0, 0]\n  resolution: [100, 100]\n"
            "  T_cam_imu:\n  - [0, -1, 0, 0]\n  - [0, 0, -1, 0]\n  - [1, 0, 0, 0]\n  - [0, 0, 0, 1]\n");
    }
    Write("control_points.csv",
          "tag_id,role,latitude_deg,longitude_deg,height_m,sigma_h_m,sigma_v_m\n"
          "1,control,48.0,7.8,240,0.01,0.01\n2,check,48.0002,7.8002,242,0.01,0.01\n");
  }

  const std::filesystem::path& dir() const { return dir_; }
  std::filesystem::path operator/(const std::filesystem::path& file) const { return dir_ / file; }
  void Write(const std::string& file, const std::string& content) const { root_.Write(dir_ / file, content); }
  // The second run of the embedded site in its place, without photos.
  void CopySecondRunOfParkingLot() const {
    std::filesystem::remove_all(dir_);
    std::filesystem::copy("datasets/parking_lot", dir_, std::filesystem::copy_options::recursive);
    for (const char* part : {"runs/run1", "photos"}) std::filesystem::remove_all(dir_ / part);
  }
  std::string Read(const std::string& file) const { return root_.Read(dir_ / file); }

 private:
  TempDir root_;
  std::filesystem::path dir_;
};

}  // namespace trigpoint

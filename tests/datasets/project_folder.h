// A small made project folder that is removed with the object.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "calib/base/error.h"

namespace trigpoint {

class ProjectFolder {
 public:
  // Two runs with odometry and detections in place of images, and two control points, below a folder of the given name.
  explicit ProjectFolder(const std::string& name = "site") {
    static int count = 0;
    root_ = std::filesystem::temp_directory_path() /
            ("trigpoint_test_" + std::to_string(getpid()) + "_" + std::to_string(count++));
    dir_ = root_ / name;
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
  ~ProjectFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(root_, ignored);
  }
  ProjectFolder(const ProjectFolder&) = delete;
  ProjectFolder& operator=(const ProjectFolder&) = delete;

  const std::filesystem::path& dir() const { return dir_; }
  std::filesystem::path operator/(const std::string& file) const { return dir_ / file; }
  void Write(const std::string& file, const std::string& content) const {
    std::filesystem::create_directories((dir_ / file).parent_path());
    std::ofstream(dir_ / file, std::ios::binary) << content;
  }
  std::string Read(const std::string& file) const {
    std::ostringstream text;
    text << std::ifstream(dir_ / file, std::ios::binary).rdbuf();
    return text.str();
  }

 private:
  std::filesystem::path root_, dir_;
};

// What a call's error says; fails the test if it throws none of that kind.
template <typename ErrorType, typename Call>
std::string MessageOf(Call&& call) {
  try {
    call();
  } catch (const ErrorType& e) {
    return e.what();
  }
  ADD_FAILURE() << "expected an error";
  return "";
}

}  // namespace trigpoint

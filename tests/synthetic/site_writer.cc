#include "tests/synthetic/site_writer.h"

#include <fmt/format.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "calib/base/error.h"

namespace trigpoint {

void WriteText(const std::filesystem::path& file, const std::string& text) {
  std::error_code ignored;
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path(), ignored);
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.close();
  if (!out) throw IoError(file.string() + ": cannot be written");
}

void WritePicture(const std::filesystem::path& file, const cv::Mat& picture) {
  std::error_code ignored;
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path(), ignored);
  const std::vector<int> parameters = {cv::IMWRITE_JPEG_QUALITY, 95, cv::IMWRITE_PNG_COMPRESSION, 1};
  if (!cv::imwrite(file.string(), picture, parameters)) throw IoError(file.string() + ": cannot be written");
}

void WritePanoramasCsv(const std::filesystem::path& file, const std::vector<PanoramaRow>& rows) {
  std::string text =
      "# equirectangular; heading: azimuth of the image centre, clockwise from north; pitch: image centre above the "
      "horizon; roll: clockwise; WGS 84, ellipsoidal height\n"
      "file,station,latitude_deg,longitude_deg,height_m,heading_deg,pitch_deg,roll_deg,sigma_h_m,sigma_v_m,"
      "sigma_heading_deg,sigma_tilt_deg\n";
  for (const PanoramaRow& row : rows) {
    const GeoTag& g = row.geotag;
    const auto field = [](bool has, double value, int decimals) {
      return has ? fmt::format("{:.{}f}", value, decimals) : std::string();
    };
    text += fmt::format(
        "{},{},{},{},{},{},{},{},{},{},{},{}\n", row.file, row.station,
        field(g.has_position, g.position.latitude_deg, 9), field(g.has_position, g.position.longitude_deg, 9),
        field(g.has_position && g.has_height, g.position.height_m, 3),
        field(g.has_heading, g.attitude.heading_rad * kRadToDeg, 3),
        field(g.has_tilt, g.attitude.pitch_rad * kRadToDeg, 3), field(g.has_tilt, g.attitude.roll_rad * kRadToDeg, 3),
        field(g.has_position, g.sigma_h_m, 3), field(g.has_position && g.has_height, g.sigma_v_m, 3),
        field(g.has_heading, g.sigma_heading_rad * kRadToDeg, 3), field(g.has_tilt, g.sigma_tilt_rad * kRadToDeg, 3));
  }
  WriteText(file, text);
}

void WriteCamchain(const std::filesystem::path& file, const std::vector<BodyCamera>& cameras) {
  std::string text;
  for (size_t i = 0; i < cameras.size(); ++i) {
    const Camera& camera = cameras[i].camera;
    const std::vector<double>& p = camera.params();
    text += fmt::format("cam{}:\n", i);
    std::string distortion, coefficients;
    switch (camera.model()) {
      case CameraModel::kPinhole:
        distortion = "radtan";
        coefficients = "0, 0, 0, 0";
        break;
      case CameraModel::kRadtan:
      case CameraModel::kKannalaBrandt:
        distortion = camera.model() == CameraModel::kRadtan ? "radtan" : "equidistant";
        coefficients = fmt::format("{:.12g}, {:.12g}, {:.12g}, {:.12g}", p[4], p[5], p[6], p[7]);
        if (p.size() == 8) break;
        [[fallthrough]];
      case CameraModel::kEquirectangular: break;
      default:
        throw InputError(fmt::format("{}: the camera model {} with {} parameters has no form in Kalibr's camchain",
                                     file.string(), CameraModelName(camera.model()), p.size()));
    }
    if (p.empty()) {
      text += "  camera_model: equirectangular\n";
    } else {
      text += fmt::format(
          "  camera_model: pinhole\n  intrinsics: [{:.9f}, {:.9f}, {:.9f}, {:.9f}]\n  distortion_model: {}\n"
          "  distortion_coeffs: [{}]\n",
          p[0], p[1], p[2], p[3], distortion, coefficients);
    }
    text += fmt::format(
        "  resolution: [{}, {}]\n  rostopic: /cam{}/image_raw\n"
        "  T_cam_imu:   # body (x forward, y left, z up) to camera\n",
        camera.width(), camera.height(), i);
    const Eigen::Matrix3d r = cameras[i].cam_from_body.rotation.toRotationMatrix();
    const Eigen::Vector3d& t = cameras[i].cam_from_body.translation;
    for (int k = 0; k < 3; ++k) {
      text += fmt::format("  - [{:.12f}, {:.12f}, {:.12f}, {:.12f}]\n", r(k, 0), r(k, 1), r(k, 2), t[k]);
    }
    text += "  - [0.0, 0.0, 0.0, 1.0]\n";
  }
  WriteText(file, text);
}

}  // namespace trigpoint

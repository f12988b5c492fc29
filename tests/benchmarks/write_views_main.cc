// The views of a project's panoramas as pictures, for other programs:
//   write_views PROJECT OUT     OUT/<panorama>_<view>.jpg, and OUT/camera.txt: size and focal length of all, px;
//                               OUT/views.txt: each view's rotation, view_from_pano, as a quaternion w x y z
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "calib/base/error.h"
#include "datasets/io/image.h"
#include "datasets/io/views.h"

namespace trigpoint {
namespace {

int Main(const std::filesystem::path& project, const std::filesystem::path& out) {
  std::filesystem::create_directories(out);
  for (const Reference& reference : ReadSite(project).references) {
    if (reference.kind != ReferenceKind::kPanorama) continue;
    const cv::Mat panorama = LoadPicture(reference.files.front(), true);
    std::ofstream rotations(out / "views.txt");
    for (const View& view : PanoramaViews(reference.name, panorama.cols, {}).views) {
      const std::string name = reference.files.front().stem().string() + "_" + view.name + ".jpg";
      if (!cv::imwrite((out / name).string(), RenderView(panorama, view), {cv::IMWRITE_JPEG_QUALITY, 95})) {
        throw IoError((out / name).string() + ": cannot be written");
      }
      const Eigen::Quaterniond q = view.rig_from_view.rotation.conjugate();
      rotations << view.name << ' ' << q.w() << ' ' << q.x() << ' ' << q.y() << ' ' << q.z() << '\n';
      std::ofstream(out / "camera.txt") << view.camera.width() << ' ' << view.camera.MeanFocal() << '\n';
    }
  }
  return 0;
}

}  // namespace
}  // namespace trigpoint

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: write_views PROJECT OUT\n");
    return 2;
  }
  try {
    return trigpoint::Main(argv[1], argv[2]);
  } catch (const trigpoint::Error& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return e.ExitCode();
  }
}

#include "app/desktop/pictures.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/base/error.h"
#include "datasets/io/image.h"
#include "datasets/io/views.h"
#include "datasets/project/project.h"

namespace trigpoint {

namespace {

QImage ToQImage(const cv::Mat& picture) {
  if (picture.channels() == 1) {
    return QImage(picture.data, picture.cols, picture.rows, static_cast<int>(picture.step), QImage::Format_Grayscale8)
        .copy();
  }
  return QImage(picture.data, picture.cols, picture.rows, static_cast<int>(picture.step), QImage::Format_BGR888).copy();
}

}  // namespace

QImage LoadRunPicture(const Project& project, const std::string& run_name, const std::string& file) {
  const Run& run = project.run(run_name);
  for (const ImageEntry& entry : run.images) {
    if (entry.file != file) continue;
    return ToQImage(LoadColour(run, entry));
  }
  throw InputError("run " + run_name + " has no image '" + file + "'");
}

QImage LoadAnyPicture(const std::filesystem::path& file, int longest) {
  cv::Mat picture = LoadPicture(file, false);
  const int side = std::max(picture.cols, picture.rows);
  if (longest > 0 && side > longest) {
    const double factor = static_cast<double>(longest) / side;
    cv::Mat small;
    cv::resize(picture, small, {}, factor, factor, cv::INTER_AREA);
    picture = small;
  }
  return ToQImage(picture);
}

QImage LoadPanoramaPicture(const std::filesystem::path& file) { return ToQImage(LoadPanorama(file, false)); }

QImage CutView(const QImage& panorama, const View& view) {
  const cv::Mat picture(panorama.height(), panorama.width(), CV_8UC3, const_cast<uchar*>(panorama.constBits()),
                        static_cast<size_t>(panorama.bytesPerLine()));
  return ToQImage(RenderView(picture, view));
}

}  // namespace trigpoint

#include "tests/synthetic/synthetic_features.h"

#include <opencv2/core/mat.hpp>

#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

// Few large entries among many small ones, as gradient histograms have; a little noise tells pictures apart.
void FillDescriptor(int point, uint64_t picture, uint8_t* row) {
  Random shape(Random(static_cast<uint64_t>(point) + 1).Next());
  Random noise(Random(picture * 0x10001 + static_cast<uint64_t>(point)).Next());
  for (int c = 0; c < 128; ++c) {
    const double u = shape.Uniform();
    const double value = 200 * u * u * u * u + noise.Uniform(0, 6);
    row[c] = static_cast<uint8_t>(value);
  }
}

void Append(const Eigen::Vector2d& pixel, int point, uint64_t picture, int row, FeatureSet* features) {
  features->points.push_back(pixel.cast<float>());
  features->scales.push_back(2);
  features->angles.push_back(0);
  FillDescriptor(point, picture, features->descriptors.ptr<uint8_t>(row));
}

}  // namespace

FeatureSet SyntheticImageFeatures(const SyntheticSite& site, int image) {
  const std::vector<SyntheticObservation>& observations = site.images[image].observations;
  FeatureSet features;
  features.descriptors = cv::Mat::zeros(static_cast<int>(observations.size()), 128, CV_8U);
  int row = 0;
  for (const SyntheticObservation& o : observations) {
    Append(o.pixel, o.point, static_cast<uint64_t>(image), row++, &features);
  }
  return features;
}

FeatureSet SyntheticViewFeatures(const SyntheticSite& site, int panorama, int view) {
  const std::vector<SyntheticViewObservation>& observations = site.panoramas[panorama].observations;
  int rows = 0;
  for (const SyntheticViewObservation& o : observations) rows += o.view == view;
  FeatureSet features;
  features.descriptors = cv::Mat::zeros(rows, 128, CV_8U);
  int row = 0;
  for (const SyntheticViewObservation& o : observations) {
    if (o.view != view) continue;
    Append(o.pixel, o.point, site.images.size() + static_cast<uint64_t>(panorama * 64 + view), row++, &features);
  }
  return features;
}

}  // namespace trigpoint

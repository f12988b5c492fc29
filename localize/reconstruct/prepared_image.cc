#include "localize/reconstruct/prepared_image.h"

namespace trigpoint {

std::unique_ptr<PreparedImage> PrepareImage(const LocalizeInput& input, int image, bool paper) {
  auto p = std::make_unique<PreparedImage>();
  p->features = input.image_features(image);
  const Camera& camera = input.cameras[static_cast<size_t>(input.images[static_cast<size_t>(image)].camera)].camera;
  if (!paper) p->descriptors = DescriptorBlock(p->features.descriptors);
  p->rays.reserve(p->features.size());
  for (const Eigen::Vector2f& pixel : p->features.points) {
    p->rays.push_back(camera.Unproject(pixel.cast<double>()).value_or(Eigen::Vector3d(0, 0, -1)));
  }
  p->grid = std::make_unique<FeatureGrid>(p->features.points, camera.width(), camera.height(), 12.0F);
  return p;
}

}  // namespace trigpoint

// Procedural pictures for synthetic scenes: facades whose windows repeat (and so mislead), ground, cars, tags.
// The same arguments give the same picture. Colours are BGR, 8 bit.
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>

namespace trigpoint {

// Sum of `octaves` layers of smoothly interpolated random values, cells from `cell_px` downwards in halves, amplitudes
// halving; CV_32F, about -1 to 1.
cv::Mat ValueNoise(cv::Size size, double cell_px, int octaves, uint64_t seed);

struct FacadeOptions {
  double width_m = 20;
  double height_m = 9;
  double px_per_m = 48;
  // 0: every window is the same picture but for light dirt; 1: each has its own curtains, blinds and reflections.
  double variety = 0.5;
  double unique_per_m = 0.12;  // posters, signs and graffiti that exist once, per metre of facade
};
cv::Mat FacadeTexture(const FacadeOptions& options, uint64_t seed);

// Asphalt with patches, cracks, stains and painted lines.
cv::Mat GroundTexture(double width_m, double height_m, double px_per_m, uint64_t seed);

// Clouds before a blue sky; cover: share of the sky, about.
cv::Mat CloudTexture(int size_px, double cover, uint64_t seed);

// A car's side seen from the right, wheels at the bottom, on a plain background of its own colour.
cv::Mat CarTexture(uint64_t seed, bool side);

// A 36h11 tag with its white border (ten cells across, the black square is eight), `cell_px` pixels a cell. Throws
// InputError for an id the family does not have.
cv::Mat TagTexture(int id, int cell_px);

}  // namespace trigpoint

#include "tests/synthetic/texture.h"

#include <apriltag/apriltag.h>
#include <apriltag/common/image_u8.h>
#include <apriltag/tag36h11.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "calib/base/error.h"
#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

cv::Scalar Colour(Random& random, double low, double high, double saturation) {
  const double grey = random.Uniform(low, high);
  const double b = random.Uniform(-1, 1), g = random.Uniform(-1, 1), r = random.Uniform(-1, 1);
  return {grey * (1 + saturation * b), grey * (1 + saturation * g), grey * (1 + saturation * r)};
}

// picture += strength * noise on all channels.
void AddNoise(cv::Mat* picture, const cv::Mat& noise, double strength) {
  cv::Mat wide, three;
  picture->convertTo(wide, CV_32FC3);
  cv::cvtColor(noise, three, cv::COLOR_GRAY2BGR);
  wide += strength * three;
  wide.convertTo(*picture, CV_8UC3);
}

// Something that exists once: a poster with text and shapes, or scribbled graffiti.
void DrawUnique(cv::Mat roi, Random& random) {
  const int w = roi.cols, h = roi.rows;
  if (w < 6 || h < 6) return;
  const bool poster = random.Uniform() < 0.6;
  if (poster) {
    roi.setTo(Colour(random, 60, 240, 0.5));
    cv::rectangle(roi, {0, 0}, {w - 1, h - 1}, Colour(random, 20, 200, 0.3), std::max(1, w / 40));
  }
  const int shapes = 4 + static_cast<int>(random.Below(8));
  for (int i = 0; i < shapes; ++i) {
    const cv::Scalar colour = Colour(random, 10, 245, 0.6);
    const cv::Point a(static_cast<int>(random.Below(w)), static_cast<int>(random.Below(h)));
    const cv::Point b(static_cast<int>(random.Below(w)), static_cast<int>(random.Below(h)));
    const uint64_t kind = random.Below(4);
    if (kind == 0) {
      cv::ellipse(roi, a, {1 + w / 6, 1 + h / 8}, random.Uniform(0, 180), 0, random.Uniform(90, 360), colour,
                  poster && random.Uniform() < 0.5 ? cv::FILLED : std::max(1, w / 30), cv::LINE_AA);
    } else if (kind == 1 && poster) {
      cv::rectangle(roi, a, b, colour, cv::FILLED);
    } else if (kind == 2) {
      std::string text;
      for (uint64_t n = 2 + random.Below(6); n > 0; --n) text += static_cast<char>('A' + random.Below(26));
      cv::putText(roi, text, {a.x / 2, std::max(a.y, h / 4)}, cv::FONT_HERSHEY_DUPLEX,
                  std::max(0.3, h / random.Uniform(60, 140)), colour, std::max(1, h / 40), cv::LINE_AA);
    } else {
      cv::line(roi, a, b, colour, std::max(1, w / 25), cv::LINE_AA);
    }
  }
}

struct WindowStyle {
  cv::Scalar frame, glass, sill;
  int columns, rows;  // panes
  double bar;         // share of the width
};

void DrawWindow(cv::Mat roi, const WindowStyle& style, double variety, Random& random) {
  const int w = roi.cols, h = roi.rows;
  if (w < 4 || h < 4) return;
  roi.setTo(style.frame);
  const int bar = std::max(1, static_cast<int>(std::lround(style.bar * w)));
  const int pane_w = (w - bar * (style.columns + 1)) / style.columns,
            pane_h = (h - bar * (style.rows + 1)) / style.rows;
  if (pane_w < 1 || pane_h < 1) return;
  for (int i = 0; i < style.columns; ++i) {
    for (int j = 0; j < style.rows; ++j) {
      cv::Mat pane = roi(cv::Rect(bar + i * (pane_w + bar), bar + j * (pane_h + bar), pane_w, pane_h));
      pane.setTo(style.glass);
      // The same reflection in all windows, another one where they differ.
      cv::line(pane, {0, pane_h / 2}, {pane_w, pane_h / 5}, style.glass * 1.5, std::max(1, pane_h / 8), cv::LINE_AA);
    }
  }
  if (random.Uniform() < variety) {
    const double lowered = random.Uniform(0.1, 0.9);  // a blind
    cv::rectangle(roi,
                  cv::Rect(bar, bar, std::max(1, w - 2 * bar), std::max(1, static_cast<int>(lowered * (h - 2 * bar)))),
                  Colour(random, 120, 230, 0.1), cv::FILLED);
  } else if (random.Uniform() < variety) {
    const cv::Scalar curtain = Colour(random, 120, 220, 0.3);
    const int depth = static_cast<int>(random.Uniform(0.1, 0.4) * w);
    cv::rectangle(roi, cv::Rect(bar, bar, std::max(1, depth), std::max(1, h - 2 * bar)), curtain, cv::FILLED);
    cv::rectangle(roi, cv::Rect(std::max(0, w - bar - depth), bar, std::max(1, depth), std::max(1, h - 2 * bar)),
                  curtain, cv::FILLED);
  }
}

void DrawStreaks(cv::Mat* picture, int count, double px_per_m, Random& random) {
  cv::Mat shade(picture->size(), CV_32F, cv::Scalar(0));
  for (int i = 0; i < count; ++i) {
    const int x = static_cast<int>(random.Below(picture->cols)), y = static_cast<int>(random.Below(picture->rows));
    const int length = static_cast<int>(random.Uniform(0.2, 2.0) * px_per_m);
    cv::line(shade, {x, y}, {x + static_cast<int>(random.Uniform(-0.05, 0.05) * length), y + length},
             cv::Scalar(random.Uniform(-1, 0.3)), std::max(1, static_cast<int>(random.Uniform(0.02, 0.15) * px_per_m)));
  }
  cv::GaussianBlur(shade, shade, {}, 0.04 * px_per_m);
  AddNoise(picture, shade, 50);
}

}  // namespace

cv::Mat ValueNoise(cv::Size size, double cell_px, int octaves, uint64_t seed) {
  // From coarse to fine: every layer is enlarged to twice its size and gets its own values, so that the whole costs
  // little more than the last layer.
  int layers = 1;
  while (layers < octaves && cell_px / (1 << layers) >= 0.99) ++layers;
  const double finest = cell_px / (1 << (layers - 1));
  std::vector<cv::Size> sizes(static_cast<size_t>(layers));
  sizes.back() = {static_cast<int>(size.width / finest) + 2, static_cast<int>(size.height / finest) + 2};
  for (int i = layers - 1; i > 0; --i) sizes[i - 1] = {sizes[i].width / 2 + 2, sizes[i].height / 2 + 2};
  cv::RNG rng(seed * 2 + 1);
  cv::Mat sum, layer;
  double amplitude = 0.6;
  for (int i = 0; i < layers; ++i, amplitude /= 2) {
    layer.create(sizes[i], CV_32F);
    rng.fill(layer, cv::RNG::UNIFORM, -amplitude, amplitude);
    if (i > 0) {
      cv::resize(sum, sum, {}, 2, 2, cv::INTER_LINEAR);
      layer += sum(cv::Rect({0, 0}, sizes[i]));
    }
    sum = layer.clone();
  }
  if (finest > 1) cv::resize(sum, sum, {}, finest, finest, cv::INTER_LINEAR);
  return sum(cv::Rect({0, 0}, size)).clone();
}

cv::Mat FacadeTexture(const FacadeOptions& options, uint64_t seed) {
  Random random(Random(seed).Next());
  const double ppm = options.px_per_m;
  const cv::Size size(std::max(8, static_cast<int>(std::lround(options.width_m * ppm))),
                      std::max(8, static_cast<int>(std::lround(options.height_m * ppm))));
  cv::Mat wall(size, CV_8UC3, Colour(random, 90, 215, 0.18));
  AddNoise(&wall, ValueNoise(size, random.Uniform(1.5, 4) * ppm, 8, random.Next()), random.Uniform(18, 45));

  if (random.Uniform() < 0.4) {  // bricks, slabs or boards
    const double course = random.Uniform() < 0.5 ? random.Uniform(0.12, 0.25) : random.Uniform(0.4, 0.8);
    const double length = course * random.Uniform(1.5, 3.5);
    const cv::Scalar joint = Colour(random, 60, 230, 0.05);
    const int rows = static_cast<int>(options.height_m / course) + 1;
    for (int r = 0; r < rows; ++r) {
      const int y = static_cast<int>(std::lround(r * course * ppm));
      cv::line(wall, {0, y}, {size.width, y}, joint, 1);
      for (double x = (r % 2) * length / 2; x < options.width_m; x += length) {
        const int px = static_cast<int>(std::lround(x * ppm));
        cv::line(wall, {px, y}, {px, y + static_cast<int>(std::lround(course * ppm))}, joint, 1);
        if (random.Uniform() < 0.15) {
          cv::Mat brick = wall(cv::Rect(px, y, static_cast<int>(length * ppm), static_cast<int>(course * ppm)) &
                               cv::Rect({0, 0}, size));
          brick *= random.Uniform(0.7, 1.2);
        }
      }
    }
  }

  const double floor_m = random.Uniform(2.7, 3.7), pitch = random.Uniform(1.8, 4.0);
  const double window_w = pitch * random.Uniform(0.3, 0.7), window_h = floor_m * random.Uniform(0.4, 0.65);
  const WindowStyle style = {Colour(random, 60, 245, 0.1),          Colour(random, 25, 90, 0.25),
                             Colour(random, 60, 200, 0.1),          1 + static_cast<int>(random.Below(3)),
                             1 + static_cast<int>(random.Below(3)), random.Uniform(0.04, 0.1)};
  const bool shutters = random.Uniform() < 0.3, cornice = random.Uniform() < 0.5;
  const cv::Scalar trim = Colour(random, 80, 230, 0.15), shutter = Colour(random, 30, 160, 0.5);
  const auto px = [&](double m) { return static_cast<int>(std::lround(m * ppm)); };
  const cv::Rect whole({0, 0}, size);
  for (int f = 0; f * floor_m < options.height_m; ++f) {
    const double sill = options.height_m - f * floor_m - 0.28 * floor_m;  // from the top
    if (cornice) {
      cv::rectangle(wall, cv::Rect(0, px(options.height_m - f * floor_m), size.width, px(0.15)) & whole, trim,
                    cv::FILLED);
    }
    if (sill - window_h < 0.2) continue;
    for (double x = (pitch - window_w) / 2; x + window_w < options.width_m; x += pitch) {
      const cv::Rect box(px(x), px(sill - window_h), px(window_w), px(window_h));
      cv::rectangle(wall, (box + cv::Size(px(0.16), px(0.16)) - cv::Point(px(0.08), px(0.08))) & whole, trim,
                    cv::FILLED);
      if (f == 0 && random.Uniform() < 0.12) {  // a door instead
        cv::Mat door = wall(cv::Rect(box.x, box.y, box.width, size.height - box.y) & whole);
        door.setTo(Colour(random, 30, 160, 0.4));
        cv::rectangle(door, {door.cols / 6, door.rows / 8}, {door.cols * 5 / 6, door.rows / 2}, style.glass,
                      cv::FILLED);
        continue;
      }
      if (shutters) {
        cv::rectangle(wall, cv::Rect(box.x - box.width / 3, box.y, box.width / 3, box.height) & whole, shutter,
                      cv::FILLED);
        cv::rectangle(wall, cv::Rect(box.x + box.width, box.y, box.width / 3, box.height) & whole, shutter, cv::FILLED);
      }
      if ((box & whole) == box) DrawWindow(wall(box), style, options.variety, random);
      cv::rectangle(wall, cv::Rect(box.x - px(0.1), box.y + box.height, box.width + px(0.2), px(0.1)) & whole,
                    style.sill, cv::FILLED);
    }
  }
  const int unique = static_cast<int>(std::lround(options.unique_per_m * options.width_m));
  for (int i = 0; i < unique; ++i) {
    const double w = random.Uniform(0.5, 2.2), h = random.Uniform(0.4, 1.6);
    const double x = random.Uniform(0, std::max(0.1, options.width_m - w));
    const double y = options.height_m - h - random.Uniform(0.2, 2.0);
    DrawUnique(wall(cv::Rect(px(x), px(y), px(w), px(h)) & whole), random);
  }
  DrawStreaks(&wall, static_cast<int>(1.5 * options.width_m), ppm, random);
  return wall;
}

cv::Mat GroundTexture(double width_m, double height_m, double px_per_m, uint64_t seed) {
  Random random(Random(seed).Next());
  const cv::Size size(std::max(8, static_cast<int>(std::lround(width_m * px_per_m))),
                      std::max(8, static_cast<int>(std::lround(height_m * px_per_m))));
  cv::Mat ground(size, CV_8UC3, Colour(random, 70, 130, 0.06));
  AddNoise(&ground, ValueNoise(size, 5 * px_per_m, 4, random.Next()), 35);
  const auto point = [&] {
    const int x = static_cast<int>(random.Below(size.width)), y = static_cast<int>(random.Below(size.height));
    return cv::Point(x, y);
  };
  const double area = width_m * height_m;
  for (int i = 0; i < static_cast<int>(area / 60); ++i) {  // patches
    const cv::Size box(static_cast<int>(random.Uniform(0.5, 3) * px_per_m),
                       static_cast<int>(random.Uniform(0.5, 3) * px_per_m));
    cv::Mat patch = ground(cv::Rect(point(), box) & cv::Rect({0, 0}, size));
    patch *= random.Uniform(0.75, 1.25);
  }
  for (int i = 0; i < static_cast<int>(area / 12); ++i) {  // stains
    cv::circle(ground, point(), 1 + static_cast<int>(random.Uniform(0.03, 0.3) * px_per_m),
               Colour(random, 30, 190, 0.1), cv::FILLED, cv::LINE_AA);
  }
  for (int i = 0; i < static_cast<int>(area / 40); ++i) {  // cracks
    cv::Point a = point();
    for (int k = 0; k < 8; ++k) {
      const int dx = static_cast<int>(random.Uniform(-0.6, 0.6) * px_per_m);
      const cv::Point b = a + cv::Point(dx, static_cast<int>(random.Uniform(-0.6, 0.6) * px_per_m));
      cv::line(ground, a, b, cv::Scalar(35, 35, 35), std::max(1, static_cast<int>(0.03 * px_per_m)), cv::LINE_AA);
      a = b;
    }
  }
  const double bay = 2.5 * px_per_m, depth = 5 * px_per_m;  // parking bays: lines that repeat
  for (double y = 0; y < size.height; y += 3 * depth) {
    for (double x = 0; x < size.width; x += bay) {
      cv::line(ground, cv::Point2d(x, y), cv::Point2d(x, y + depth), cv::Scalar(205, 210, 210),
               std::max(1, static_cast<int>(0.12 * px_per_m)), cv::LINE_AA);
    }
  }
  AddNoise(&ground, ValueNoise(size, 0.4 * px_per_m, 4, random.Next()), 30);
  // The grain of the asphalt: what corners on the ground are made of.
  AddNoise(&ground, ValueNoise(size, std::max(1.0, 0.1 * px_per_m), 2, random.Next()), 45);
  return ground;
}

cv::Mat CloudTexture(int size_px, double cover, uint64_t seed) {
  cv::Mat noise = ValueNoise({size_px, size_px}, size_px / 8.0, 6, seed) + (2 * cover - 1) * 0.6, clouds;
  cv::Mat share = cv::min(cv::max(noise * 2 + 0.5, 0.0), 1.0);
  cv::Mat channels[3];
  const double blue[3] = {220, 165, 120}, white = 235;
  for (int c = 0; c < 3; ++c) share.convertTo(channels[c], CV_8U, white - blue[c], blue[c]);
  cv::merge(channels, 3, clouds);
  return clouds;
}

cv::Mat CarTexture(uint64_t seed, bool side) {
  Random random(Random(seed).Next());
  const cv::Scalar paint = Colour(random, 40, 210, 0.5);
  cv::Mat car(96, side ? 268 : 116, CV_8UC3, paint);
  const int w = car.cols, h = car.rows;
  cv::rectangle(car, {w / 8, h / 12}, {w * 7 / 8, h * 2 / 5}, cv::Scalar(50, 45, 40), cv::FILLED);
  cv::line(car, {w / 2, h / 12}, {w / 2, h * 2 / 5}, paint, 4);
  if (side) {
    for (const int x : {w / 5, w * 4 / 5}) {
      cv::circle(car, {x, h * 5 / 6}, h / 6, cv::Scalar(20, 20, 20), cv::FILLED, cv::LINE_AA);
      cv::circle(car, {x, h * 5 / 6}, h / 11, cv::Scalar(150, 150, 150), cv::FILLED, cv::LINE_AA);
    }
    cv::line(car, {w / 2, h * 2 / 5}, {w / 2, h - 8}, paint * 0.6, 1, cv::LINE_AA);
  } else {
    cv::rectangle(car, {w / 3, h * 2 / 3}, {w * 2 / 3, h * 5 / 6}, cv::Scalar(230, 235, 235), cv::FILLED);
    std::string plate;
    for (int i = 0; i < 5; ++i) plate += static_cast<char>('A' + random.Below(26));
    cv::putText(car, plate, {w / 3 + 2, h * 5 / 6 - 3}, cv::FONT_HERSHEY_SIMPLEX, 0.33, cv::Scalar(20, 20, 20), 1,
                cv::LINE_AA);
    for (const int x : {w / 8, w * 7 / 8}) cv::circle(car, {x, h * 3 / 5}, h / 12, cv::Scalar(40, 40, 220), cv::FILLED);
  }
  AddNoise(&car, ValueNoise(car.size(), 20, 5, random.Next()), 12);
  return car;
}

cv::Mat TagTexture(int id, int cell_px) {
  apriltag_family_t* family = tag36h11_create();
  if (id < 0 || id >= static_cast<int>(family->ncodes)) {
    const std::string count = std::to_string(family->ncodes);
    tag36h11_destroy(family);
    throw InputError("tag36h11 has no tag " + std::to_string(id) + ": expected 0 to below " + count);
  }
  image_u8_t* bits = apriltag_to_image(family, static_cast<uint32_t>(id));
  cv::Mat tag;
  cv::resize(cv::Mat(bits->height, bits->width, CV_8UC1, bits->buf, static_cast<size_t>(bits->stride)), tag, {},
             cell_px, cell_px, cv::INTER_NEAREST);
  image_u8_destroy(bits);
  tag36h11_destroy(family);
  cv::cvtColor(tag, tag, cv::COLOR_GRAY2BGR);
  // Print is neither perfectly black nor white.
  tag.convertTo(tag, CV_8U, 200.0 / 255, 25);
  return tag;
}

}  // namespace trigpoint

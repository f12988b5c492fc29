#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>

#include <algorithm>
#include <memory>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "calib/base/error.h"
#include "calib/camera/pixel_convention.h"
#include "calib/target/detect_boards.h"
#include "calib/target/dictionary.h"

namespace trigpoint {
namespace {

constexpr double kBigPicture = 2.5e6;  // pixels; tags are searched at half size beyond
constexpr int kMaxHamming = 1;
constexpr double kMinMargin = 20;
constexpr double kMaxMovePx = 3;  // from a marker's fitted edges to the saddle point

using Family = std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t*)>;

// 36h11 as Kalibr prints it: the black border is two cells wide, not one.
Family WideBorderFamily() {
  Family family(tag36h11_create(), tag36h11_destroy);
  for (uint32_t i = 0; i < family->nbits; ++i) {
    ++family->bit_x[i];
    ++family->bit_y[i];
  }
  family->width_at_border += 2;
  family->total_width += 2;
  return family;
}

double Side(const BoardMarker& marker) {
  double side = 1e9;
  for (size_t k = 0; k < 4; ++k) side = std::min(side, (marker.corners[k] - marker.corners[(k + 1) % 4]).norm());
  return side;
}

cv::Point2d ToCv(const Eigen::Vector2d& p) { return {p.x(), p.y()}; }

Eigen::Vector2d Mapped(const cv::Matx33d& h, double x, double y) {
  const cv::Vec3d p = h * cv::Vec3d(x, y, 1);
  return {p[0] / p[2], p[1] / p[2]};
}

// Corners, of these points of the board, that turn out to be saddle points.
std::vector<BoardPoint> RefinedPoints(const cv::Mat& grey, const std::vector<double>& half_window,
                                      const std::vector<int>& ids, std::vector<Eigen::Vector2d> corners) {
  const std::vector<bool> good = RefineSaddles(grey, half_window, kMaxMovePx, &corners);
  std::vector<BoardPoint> points;
  for (size_t i = 0; i < corners.size(); ++i) {
    if (good[i]) points.push_back({ids[i], corners[i]});
  }
  return points;
}

}  // namespace

std::vector<BoardMarker> FindAprilTags(const cv::Mat& grey, size_t expected) {
  const Family narrow(tag36h11_create(), tag36h11_destroy);
  const Family wide = WideBorderFamily();
  const std::unique_ptr<apriltag_detector_t, void (*)(apriltag_detector_t*)> detector(apriltag_detector_create(),
                                                                                      apriltag_detector_destroy);
  apriltag_detector_add_family_bits(detector.get(), narrow.get(), kMaxHamming);
  apriltag_detector_add_family_bits(detector.get(), wide.get(), kMaxHamming);
  detector->nthreads = 1;
  detector->quad_decimate = static_cast<double>(grey.total()) > kBigPicture ? 2 : 1;
  std::vector<BoardMarker> markers;
  std::set<std::pair<int, int>> before;  // border and id of those of an earlier pass
  const auto search = [&](const cv::Mat& picture) {
    image_u8_t image{picture.cols, picture.rows, static_cast<int32_t>(picture.step), picture.data};
    const std::unique_ptr<zarray_t, void (*)(zarray_t*)> found(apriltag_detector_detect(detector.get(), &image),
                                                               apriltag_detections_destroy);
    for (int i = 0; i < zarray_size(found.get()); ++i) {
      apriltag_detection_t* tag = nullptr;
      zarray_get(found.get(), i, &tag);
      BoardMarker marker;
      marker.id = tag->id;
      marker.border_bits = tag->family == wide.get() ? 2 : 1;
      if (tag->decision_margin < kMinMargin || before.contains({marker.border_bits, marker.id})) continue;
      for (size_t k = 0; k < 4; ++k) marker.corners[k] = FromAprilTagPixel({tag->p[k][0], tag->p[k][1]});
      markers.push_back(marker);
    }
  };
  search(grey);
  for (const BoardMarker& marker : markers) before.insert({marker.border_bits, marker.id});
  // The frame of one border is now and then read as the other's: each is counted for itself.
  const auto narrow_count = std::count_if(before.begin(), before.end(), [](const auto& m) { return m.first == 1; });
  if (static_cast<size_t>(std::max<std::ptrdiff_t>(narrow_count, std::ssize(before) - narrow_count)) < expected) {
    // Seen straight on, the small squares at a tag's corners grow together with it; a brighter gap parts them. That
    // moves the corners by a pixel or so: they are measured in the picture itself later.
    cv::Mat parted;
    cv::dilate(grey, parted, cv::getStructuringElement(cv::MORPH_RECT, {3, 3}));
    search(parted);
  }
  return markers;
}

int DictionaryNamed(const std::string& name) {
  static constexpr const char* kSizes[] = {"4X4", "5X5", "6X6", "7X7"};
  static constexpr const char* kCounts[] = {"50", "100", "250", "1000"};
  int index = 0;
  for (const char* size : kSizes) {
    for (const char* count : kCounts) {
      if (name == std::string("DICT_") + size + "_" + count) return index;
      ++index;
    }
  }
  static constexpr const char* kOthers[] = {"DICT_ARUCO_ORIGINAL", "DICT_APRILTAG_16h5", "DICT_APRILTAG_25h9",
                                            "DICT_APRILTAG_36h10", "DICT_APRILTAG_36h11"};
  for (const char* other : kOthers) {
    if (name == other) return index;
    ++index;
  }
  return -1;
}

std::vector<BoardMarker> FindArucoMarkers(const cv::Mat& grey, const Target& target) {
  const int dictionary = DictionaryNamed(target.dictionary);
  if (dictionary < 0) {
    throw OptionError("unknown marker dictionary '" + target.dictionary +
                      "'; expected OpenCV's name, as DICT_4X4_50, DICT_6X6_250, DICT_APRILTAG_36h11");
  }
  const cv::Ptr<cv::aruco::DetectorParameters> parameters = cv::aruco::DetectorParameters::create();
  parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_NONE;  // it would be drawn to the squares' corners
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  cv::aruco::detectMarkers(grey, cv::aruco::getPredefinedDictionary(dictionary), corners, ids, parameters);
  std::vector<BoardMarker> markers;
  for (size_t i = 0; i < ids.size(); ++i) {
    BoardMarker marker;
    marker.id = ids[i];
    for (size_t k = 0; k < 4; ++k) marker.corners[k] = {corners[i][k].x, corners[i][k].y};
    markers.push_back(marker);
  }
  return markers;
}

std::vector<MarkerLayout> PossibleLayouts(const Target& target) {
  std::vector<MarkerLayout> layouts;
  for (const bool from_top : {false, true}) {
    for (int turn = 0; turn < (target.kind == TargetKind::kAprilGrid ? 4 : 1); ++turn) {
      layouts.push_back({turn, from_top, 1});
    }
  }
  return layouts;
}

bool MarkerOnBoard(const Target& target, const MarkerLayout& layout, int marker_id, std::array<int, 4>* ids,
                   std::array<Eigen::Vector3d, 4>* places) {
  const int index = marker_id - target.first_id;
  if (index < 0) return false;
  std::array<int, 4> board_ids{-1, -1, -1, -1};
  std::array<Eigen::Vector3d, 4> board_places;
  if (target.kind == TargetKind::kAprilGrid) {
    if (index >= target.cols * target.rows) return false;
    const int col = index % target.cols;
    const int row = layout.from_top ? target.rows - 1 - index / target.cols : index / target.cols;
    const double pitch = target.spacing_x_m * (1 + target.tag_spacing);
    static constexpr int kRight[] = {0, 1, 1, 0}, kUp[] = {0, 0, 1, 1};  // the detector's order: lower left first
    for (size_t k = 0; k < 4; ++k) {
      board_ids[k] = (2 * row + kUp[k]) * 2 * target.cols + 2 * col + kRight[k];
      board_places[k] = {col * pitch + kRight[k] * target.spacing_x_m, row * pitch + kUp[k] * target.spacing_x_m, 0};
    }
  } else {
    // The index-th white square, row by row.
    const int first_white = layout.from_top ? 0 : 1;
    int row = 0, left = index;
    for (;; ++row) {
      if (row >= target.rows) return false;
      const int in_row = (target.cols - (row + first_white) % 2 + 1) / 2;
      if (left < in_row) break;
      left -= in_row;
    }
    const int col = 2 * left + (row + first_white) % 2;
    const double s = target.spacing_x_m, h = 0.5 * target.marker_size_m;
    const Eigen::Vector3d centre((col - 0.5) * s, (row - 0.5) * s, 0);  // the origin is the first inner corner
    static constexpr int kX[] = {-1, 1, 1, -1}, kY[] = {-1, -1, 1, 1};  // ArUco's order: upper left first
    for (size_t k = 0; k < 4; ++k) board_places[k] = centre + Eigen::Vector3d(kX[k] * h, kY[k] * h, 0);
  }
  for (size_t k = 0; k < 4; ++k) {
    const size_t on_board = (k + static_cast<size_t>(layout.turn)) % 4;
    (*ids)[k] = board_ids[on_board];
    (*places)[k] = board_places[on_board];
  }
  return true;
}

double LayoutError(const Target& target, const MarkerLayout& layout,
                   const std::vector<std::vector<BoardMarker>>& pictures) {
  double sum = 0;
  int n = 0;
  for (const std::vector<BoardMarker>& markers : pictures) {
    std::vector<cv::Point2d> board, image;
    std::vector<double> side;
    for (const BoardMarker& marker : markers) {
      std::array<int, 4> ids{};
      std::array<Eigen::Vector3d, 4> places;
      if (marker.border_bits != layout.border_bits || !MarkerOnBoard(target, layout, marker.id, &ids, &places))
        continue;
      for (size_t k = 0; k < 4; ++k) {
        board.emplace_back(places[k].x() / target.spacing_x_m, places[k].y() / target.spacing_x_m);
        image.push_back(ToCv(marker.corners[k]));
        side.push_back(Side(marker));
      }
    }
    if (board.size() < 8) continue;
    const cv::Mat h = cv::findHomography(board, image, cv::LMEDS);
    for (size_t i = 0; i < board.size(); ++i) {
      const double error =
          h.empty()
              ? 1
              : (Mapped(cv::Matx33d(h), board[i].x, board[i].y) - Eigen::Vector2d(image[i].x, image[i].y)).norm() /
                    side[i];
      sum += std::min(error, 1.0);
      ++n;
    }
  }
  return n > 0 ? sum / n : 1;
}

std::vector<BoardPoint> AprilGridPoints(const cv::Mat& grey, const Target& target, const MarkerLayout& layout,
                                        const std::vector<BoardMarker>& markers) {
  std::vector<Eigen::Vector2d> corners;
  std::vector<double> half_window;
  std::vector<int> point_ids;
  // Within the window only the tag's border, the gap, and the small square that stands in it.
  const double border = layout.border_bits / (6.0 + 2 * layout.border_bits);
  for (const BoardMarker& marker : markers) {
    std::array<int, 4> ids{};
    std::array<Eigen::Vector3d, 4> places;
    if (marker.border_bits != layout.border_bits || !MarkerOnBoard(target, layout, marker.id, &ids, &places)) continue;
    for (size_t k = 0; k < 4; ++k) {
      corners.push_back(marker.corners[k]);
      half_window.push_back(0.7 * std::min(border, target.tag_spacing) * Side(marker));
      point_ids.push_back(ids[k]);
    }
  }
  std::vector<BoardPoint> points = RefinedPoints(grey, half_window, point_ids, std::move(corners));
  // A tag found twice is none: one of the two is wrong.
  std::sort(points.begin(), points.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  std::vector<BoardPoint> single;
  for (size_t i = 0; i < points.size(); ++i) {
    const bool twice =
        (i > 0 && points[i - 1].id == points[i].id) || (i + 1 < points.size() && points[i + 1].id == points[i].id);
    if (!twice) single.push_back(points[i]);
  }
  return single;
}

std::vector<BoardPoint> CharucoPoints(const cv::Mat& grey, const Target& target, const MarkerLayout& layout,
                                      const std::vector<BoardMarker>& markers) {
  struct Placed {
    std::array<Eigen::Vector3d, 4> places;
    const BoardMarker* marker;
  };
  std::vector<Placed> placed;
  for (const BoardMarker& marker : markers) {
    std::array<int, 4> ids{};
    Placed p{{}, &marker};
    if (MarkerOnBoard(target, layout, marker.id, &ids, &p.places)) placed.push_back(p);
  }
  const std::vector<Eigen::Vector3d> board = target.BoardPoints();
  const double s = target.spacing_x_m;
  std::vector<Eigen::Vector2d> corners;
  std::vector<double> half_window;
  std::vector<int> point_ids;
  for (size_t id = 0; id < board.size(); ++id) {
    // The two markers whose squares meet in this corner; without both of them it may be hidden.
    std::vector<cv::Point2d> from, to;
    double side = 0;
    int touching = 0;
    for (const Placed& p : placed) {
      const Eigen::Vector3d centre = 0.25 * (p.places[0] + p.places[1] + p.places[2] + p.places[3]);
      const double away = (centre - board[id]).cwiseAbs().maxCoeff();
      if (away > 0.6 * s) continue;
      ++touching;
      side = side == 0 ? Side(*p.marker) : std::min(side, Side(*p.marker));
      for (size_t k = 0; k < 4; ++k) {
        from.emplace_back((p.places[k].x() - board[id].x()) / s, (p.places[k].y() - board[id].y()) / s);
        to.push_back(ToCv(p.marker->corners[k]));
      }
    }
    if (touching < 2) continue;
    const cv::Mat h = cv::findHomography(from, to, 0);
    if (h.empty()) continue;
    corners.push_back(Mapped(cv::Matx33d(h), 0, 0));
    const double gap_px = 0.5 * (s - target.marker_size_m) / target.marker_size_m * side;
    half_window.push_back(0.8 * gap_px);
    point_ids.push_back(static_cast<int>(id));
  }
  return RefinedPoints(grey, half_window, point_ids, std::move(corners));
}

}  // namespace trigpoint

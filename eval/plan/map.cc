// Marks, ellipses, names that cover nothing, and a legend of what is there.
#include "eval/plan/map.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <functional>

#include "calib/base/counted.h"
#include "eval/report/plan.h"
#include "eval/scene/ground_picture.h"

namespace trigpoint {
namespace {

// Each at least 4.5:1 on white; what a mark means is in its form, too.
constexpr const char* kTag = "#0072b2";
constexpr const char* kUnseen = "#a84a00";
constexpr const char* kGreen = "#00735a";
constexpr const char* kPath = "#5a6570";
constexpr const char* kFaint = "#6b7680";
constexpr const char* kInk = "#1d2329";
constexpr double kWidth = 760, kMost = 620;
constexpr double kMark = 6, kFacing = 13, kDisc = 8;  // half a mark's width, a tag's stroke, a number's disc
constexpr double kRim = 1.3;                          // of white around what is drawn on an aerial image

using Line = std::vector<std::pair<double, double>>;

class MapPainter {
 public:
  MapPainter(const PlanFindings& findings, const MapWords& words) : findings_(findings), words_(words) {
    Rank();
    Frame();
    factor_ = Enlargement();
  }

  Drawing Draw() {
    // The height is known when the legend is.
    drawing_.Rectangle(0, 0, kWidth, height_, "#ffffff");
    Aerial();
    Paths();
    Ways();
    for (const PlanStationItem& station : findings_.layout.stations) Mark(station);
    for (const TagPrediction& tag : findings_.prediction.tags) Mark(tag);
    Suggestions();
    Names();
    drawing_.width = kWidth;
    drawing_.height = Legend(height_);
    drawing_.shapes.front().points = {{0, 0}, {kWidth, 0}, {kWidth, drawing_.height}, {0, drawing_.height}};
    return drawing_;
  }

 private:
  // A suggestion or gain that is drawn, with its number.
  struct Ranked {
    int rank = 0;
    const PlanGain* gain = nullptr;
  };

  void Rank() {
    constexpr int kOfEachKind = 3;
    ranked_by_gain_ = findings_.suggestions.empty();
    std::map<std::string, int> of_kind;
    int rank = 0;
    for (const PlanGain& gain : ranked_by_gain_ ? findings_.gains : findings_.suggestions) {
      ++rank;
      if (!gain.world_m && gain.way_m.empty()) continue;
      if (ranked_by_gain_ && (!gain.Helps(findings_.prediction) || ++of_kind[gain.kind] > kOfEachKind)) continue;
      ranked_.push_back({rank, &gain});
    }
  }

  void Frame() {
    const auto extend = [&](const Eigen::Vector3d& p) {
      low_ = low_.cwiseMin(p.head<2>());
      high_ = high_.cwiseMax(p.head<2>());
    };
    for (const auto& [id, pose] : findings_.layout.network.world_from_tag) extend(pose.translation);
    for (const PlanStationItem& station : findings_.layout.stations) extend(Centre(station));
    for (const BodyPrediction& body : findings_.prediction.bodies) extend(body.world_from_body.translation);
    for (const Ranked& ranked : ranked_) {
      if (ranked.gain->world_m) extend(*ranked.gain->world_m);
      for (const Eigen::Vector3d& at : ranked.gain->way_m) extend(at);
    }
    const double pad = 0.07 * std::max({high_.x() - low_.x(), high_.y() - low_.y(), 5.0}) + 0.5;
    low_.array() -= pad;
    high_.array() += pad;
    scale_ = std::min(kWidth / (high_.x() - low_.x()), kMost / (high_.y() - low_.y()));
    const double wider = 0.5 * (kWidth / scale_ - (high_.x() - low_.x()));  // the width is used in full
    low_.x() -= wider, high_.x() += wider;
    height_ = scale_ * (high_.y() - low_.y());
    places_ = solid_ = LabelPlaces({0, 0, kWidth, height_});
  }

  void Aerial() {
    constexpr double kDetail = 1.5;  // pixels a unit
    if (!findings_.aerial) return;
    drawing_.Photograph(0, 0, kWidth, height_, GroundPicture(*findings_.aerial, low_, high_, kDetail * scale_));
  }

  // A line with a white rim where there is a picture under it.
  void Stroke(const Line& line, const char* colour, double width, bool dashed = false) {
    if (findings_.aerial) drawing_.Line(line, "#ffffff", width + 2 * kRim);
    drawing_.Line(line, colour, width, dashed);
  }
  void Dot(double x, double y, double radius, const char* colour) {
    if (findings_.aerial) drawing_.Circle(x, y, radius + kRim, "#ffffff");
    drawing_.Circle(x, y, radius, colour);
  }
  void Filled(const Line& corners, const char* colour) {
    if (findings_.aerial) {
      Line rim = corners;
      rim.push_back(corners.front());
      drawing_.Line(rim, "#ffffff", 2 * kRim);
    }
    drawing_.Area(corners, colour);
  }
  // A mark or a number: neither names nor their lines cover it.
  void TakeMark(const DrawnBox& box) {
    places_.Take(box);
    solid_.Take(box);
  }

  // A round factor at which the largest ellipse can be seen and neighbours keep apart as far as both go together.
  double Enlargement() const {
    constexpr double kLargest = 34, kLargestOfPath = 60, kVisible = 10, kShareOfPath = 0.95;
    struct Spread {
      Eigen::Vector2d place;
      double a;
    };
    std::vector<Spread> spreads;
    double largest = 1e-6, room = 1e12;
    for (const TagPrediction& tag : findings_.prediction.tags) {
      if (!tag.tied) continue;
      const Spread spread{tag.world_m.head<2>(), kSigmas95 * EllipseOf(tag.covariance.bottomRightCorner<3, 3>()).a};
      largest = std::max(largest, spread.a);
      for (const Spread& other : spreads) {
        room = std::min(room, (spread.place - other.place).norm() / std::max(1e-9, spread.a + other.a));
      }
      spreads.push_back(spread);
    }
    std::vector<double> path;
    for (const BodyPrediction& body : findings_.prediction.bodies) {
      path.push_back(kSigmas95 * EllipseOf(body.covariance.bottomRightCorner<3, 3>()).a);
    }
    const double widest = std::max(1e-6, Percentile(path, kShareOfPath));
    return RoundDown(std::min({kLargest / (scale_ * largest), std::max(room, kVisible / (scale_ * largest)),
                               kLargestOfPath / (scale_ * widest)}));
  }

  Eigen::Vector3d Centre(const PlanStationItem& station) const {
    return findings_.layout.network.world_from_tag.at(station.tag_id).translation + station.offset_m;
  }
  std::pair<double, double> At(const Eigen::Vector3d& p) const {
    return {scale_ * (p.x() - low_.x()), scale_ * (high_.y() - p.y())};
  }
  Line EllipseLine(const Eigen::Vector3d& centre, const Matrix6d& covariance) const {
    HorizontalEllipse e = EllipseOf(covariance.bottomRightCorner<3, 3>());
    e.a *= kSigmas95, e.b *= kSigmas95;
    const Eigen::Rotation2Dd turn(e.angle);
    Line line;
    for (int k = 0; k <= 48; ++k) {
      const double t = 2 * M_PI * k / 48;
      const Eigen::Vector2d p = turn * Eigen::Vector2d(factor_ * e.a * std::cos(t), factor_ * e.b * std::sin(t));
      line.push_back(At(centre + Eigen::Vector3d(p.x(), p.y(), 0)));
    }
    return line;
  }
  static DrawnBox BoundsOf(const Line& line) {
    double x0 = 1e12, y0 = 1e12, x1 = -1e12, y1 = -1e12;
    for (const auto& [x, y] : line) {
      x0 = std::min(x0, x), x1 = std::max(x1, x);
      y0 = std::min(y0, y), y1 = std::max(y1, y);
    }
    return {x0, y0, x1 - x0, y1 - y0};
  }
  static DrawnBox Around(double x, double y, double half) { return {x - half, y - half, 2 * half, 2 * half}; }

  void Paths() {
    std::map<int, Line> lines;
    for (const BodyPrediction& body : findings_.prediction.bodies) {
      lines[body.pass].push_back(At(body.world_from_body.translation));
    }
    for (const auto& [pass, line] : lines) {
      Stroke(line, kPath, 1.4);
      places_.AvoidLine(line);
    }
    // As many ellipses along the way as keep apart from each other and from the tags' ones.
    std::vector<DrawnBox> drawn;
    for (const TagPrediction& tag : findings_.prediction.tags) {
      if (tag.tied) drawn.push_back(BoundsOf(EllipseLine(tag.world_m, tag.covariance)));
    }
    for (const BodyPrediction& body : findings_.prediction.bodies) {
      const Line line = EllipseLine(body.world_from_body.translation, body.covariance);
      const DrawnBox box = BoundsOf(line);
      if (box.x < 0 || box.y < 0 || box.x + box.width > kWidth || box.y + box.height > height_) {
        ++beyond_;
        continue;
      }
      if (std::any_of(drawn.begin(), drawn.end(), [&](const DrawnBox& b) { return b.Overlaps(box); })) continue;
      drawn.push_back(box);
      Stroke(line, kFaint, 0.9);
      places_.AvoidLine(line);
    }
  }

  // Of a planned pass, either way round: its number on the path is enough.
  bool IsPlanned(const std::vector<Eigen::Vector3d>& way) const {
    const auto same = [](const Eigen::Vector3d& a, const TimedPose& b) {
      return a.isApprox(b.target_from_body.translation);
    };
    return std::any_of(findings_.layout.network.passes.begin(), findings_.layout.network.passes.end(),
                       [&](const PlannedPass& pass) {
                         const std::vector<TimedPose>& planned = pass.world_from_body;
                         return std::equal(way.begin(), way.end(), planned.begin(), planned.end(), same) ||
                                std::equal(way.begin(), way.end(), planned.rbegin(), planned.rend(), same);
                       });
  }

  // Other passes, suggested or ranked.
  void Ways() {
    for (const Ranked& ranked : ranked_) {
      if (ranked.gain->way_m.size() < 2 || IsPlanned(ranked.gain->way_m)) continue;
      Line line;
      for (const Eigen::Vector3d& at : ranked.gain->way_m) line.push_back(At(at));
      Stroke(line, kGreen, 2, true);
      places_.AvoidLine(line);
      any_way_ = true;
    }
  }

  // Beside which the names of what is at a tag find their places.
  DrawnBox MarkOf(const TagPrediction& tag) const {
    const auto [x, y] = At(tag.world_m);
    const DrawnBox mark = Around(x, y, kMark);
    if (!tag.tied) return mark;
    const DrawnBox bounds = BoundsOf(EllipseLine(tag.world_m, tag.covariance));
    return bounds.width > mark.width && bounds.height > mark.height ? bounds : mark;
  }

  // The stroke shows which way the printed side faces.
  void Mark(const TagPrediction& tag) {
    const auto [x, y] = At(tag.world_m);
    if (tag.tied) {
      const Line ellipse = EllipseLine(tag.world_m, tag.covariance);
      Stroke(ellipse, kTag, 1.6);
      places_.TakeLine(ellipse);
    }
    const Rigid3d& pose = findings_.layout.network.world_from_tag.at(tag.tag_id);
    const Eigen::Vector2d out = -(pose.rotation * Eigen::Vector3d::UnitZ()).head<2>();
    if (out.norm() > 1e-3) {
      const Eigen::Vector2d end = kFacing * out.normalized();
      const Line stroke = {{x, y}, {x + end.x(), y - end.y()}};
      Stroke(stroke, tag.tied ? kTag : kUnseen, 2);
      places_.TakeLine(stroke);
    }
    if (!tag.tied) {
      UnseenMark(x, y);
      any_unseen_ = true;
    } else if (tag.role == "control") {
      ControlMark(x, y);
      any_control_ = true;
    } else {
      Dot(x, y, 3.5, kTag);
      any_seen_ = true;
    }
    TakeMark(Around(x, y, kMark));
    drawing_.spots.push_back({x, y, "tag:" + std::to_string(tag.tag_id)});
    names_.push_back({tag.role == "control" || !tag.tied ? 0 : 1, std::to_string(tag.tag_id), true, MarkOf(tag)});
  }
  void ControlMark(double x, double y) { Filled({{x, y - 6.5}, {x + 6, y + 4.5}, {x - 6, y + 4.5}}, kTag); }
  void UnseenMark(double x, double y) {
    Stroke({{x - 5, y - 5}, {x + 5, y + 5}, {x, y}, {x - 5, y + 5}, {x + 5, y - 5}}, kUnseen, 2.6);
  }
  void Mark(const PlanStationItem& station) {
    const auto [x, y] = At(Centre(station));
    StationMark(x, y);
    TakeMark(Around(x, y, kMark));
    drawing_.spots.push_back({x, y, "station:" + station.name});
    names_.push_back({2, station.name, false, WithTags(Around(x, y, kMark + 1))});
  }
  // Inside a tag's ellipse there is no room for a name or number: it is placed beside both.
  DrawnBox WithTags(DrawnBox mark) const {
    const DrawnBox alone = mark;
    for (const TagPrediction& tag : findings_.prediction.tags) {
      if (const DrawnBox its = MarkOf(tag); its.Overlaps(alone)) mark = Joined(mark, its);
    }
    return mark;
  }
  static DrawnBox Joined(const DrawnBox& a, const DrawnBox& b) {
    const double x = std::min(a.x, b.x), y = std::min(a.y, b.y);
    return {x, y, std::max(a.x + a.width, b.x + b.width) - x, std::max(a.y + a.height, b.y + b.height) - y};
  }
  // Open: a station often is where its tag is.
  void StationMark(double x, double y) {
    const double h = kMark;
    Stroke({{x - h, y - h}, {x + h, y - h}, {x + h, y + h}, {x - h, y + h}, {x - h, y - h}}, kGreen, 1.8);
  }

  void Arrow(double x, double y, double dx, double dy, const char* colour, double width) {
    constexpr double kHead = 7;
    const double length = std::hypot(dx, dy), ux = dx / length, uy = dy / length;
    const double bx = x + dx - kHead * ux, by = y + dy - kHead * uy;
    Stroke({{x, y}, {bx, by}}, colour, width);
    Filled({{x + dx, y + dy},
            {bx - 0.5 * kHead * uy, by + 0.5 * kHead * ux},
            {bx + 0.5 * kHead * uy, by - 0.5 * kHead * ux}},
           colour);
  }
  void Disc(double x, double y, const std::string& number) {
    Dot(x, y, kDisc, kGreen);
    drawing_.Text(x, y + 4, number, 0, 11, "#ffffff", true);
  }

  void Suggestions() {
    constexpr double kLength = 26;
    for (const auto& [rank, gain] : ranked_) {
      const auto [x, y] = gain->world_m ? At(*gain->world_m) : At(gain->way_m[gain->way_m.size() / 2]);
      DrawnBox disc = Around(x, y, kDisc);
      if (!places_.IsFree(disc)) {
        if (const auto beside = PlaceName(WithTags(disc), 2 * kDisc, 2 * kDisc)) disc = *beside;
      }
      TakeMark(disc);
      if (gain->heading_rad) {
        const double dx = kLength * std::sin(*gain->heading_rad), dy = -kLength * std::cos(*gain->heading_rad);
        Arrow(x, y, dx, dy, kGreen, 3);
        places_.TakeLine({{x, y}, {x + dx, y + dy}});
      }
      Disc(disc.x + kDisc, disc.y + kDisc, std::to_string(rank));
    }
  }

  void Names() {
    std::map<int, Line> lines;
    for (const BodyPrediction& body : findings_.prediction.bodies) {
      lines.try_emplace(body.pass, Line{At(body.world_from_body.translation)});
    }
    for (const auto& [pass, line] : lines) {
      const std::string& name = findings_.layout.network.passes[static_cast<size_t>(pass)].name;
      names_.push_back({3, name, false, Around(line.front().first, line.front().second, 2)});
    }
    std::stable_sort(names_.begin(), names_.end(), [](const Name& a, const Name& b) { return a.order < b.order; });
    constexpr double kSize = 12, kBoldWider = 1.12;
    for (const Name& name : names_) {
      const double width = (name.bold ? kBoldWider : 1) * TextWidth(name.text, kSize) + 4;
      const auto box = PlaceName(name.mark, width, kSize + 3);
      if (!box) {
        ++left_out_;
        continue;
      }
      drawing_.Rectangle(box->x, box->y, box->width, box->height, "#ffffff", 0.85);
      drawing_.Text(box->x + 0.5 * width, box->y + kSize - 0.5, name.text, 0, kSize, name.order == 3 ? kPath : kInk,
                    name.bold);
    }
  }

  // Beside the mark, else the nearest free place farther away, with a line to the mark that crosses nothing, else one
  // that crosses other lines, but neither marks nor names.
  std::optional<DrawnBox> PlaceName(const DrawnBox& mark, double width, double height) {
    constexpr double kStep = 6, kFarthest = 180;
    auto box = places_.Place(mark, width, height);
    for (const LabelPlaces* free_of : {&places_, &solid_}) {
      for (double away = kStep; !box && away <= kFarthest; away += kStep) {
        box = PlaceAway(mark, width, height, away, *free_of);
      }
    }
    if (box) solid_.Take(*box);
    return box;
  }
  std::optional<DrawnBox> PlaceAway(const DrawnBox& mark, double width, double height, double away,
                                    const LabelPlaces& free_of) {
    constexpr int kDirections = 24;
    const double x = mark.x + 0.5 * mark.width, y = mark.y + 0.5 * mark.height;
    for (int k = 0; k < kDirections; ++k) {
      const double c = std::cos(2 * M_PI * k / kDirections), s = std::sin(2 * M_PI * k / kDirections);
      const DrawnBox box{x + c * (0.5 * (mark.width + width) + away) - 0.5 * width,
                         y + s * (0.5 * (mark.height + height) + away) - 0.5 * height, width, height};
      const Line line = Leader(mark, box);
      // solid_ holds least, so it is asked first.
      if (!IsFree(line, solid_) || !places_.IsFree(box) || !IsFree(line, free_of)) continue;
      places_.Take(box);
      places_.TakeLine(line);
      Stroke(line, kInk, 0.8);
      return box;
    }
    return std::nullopt;
  }
  // From the edge of a mark to that of a name.
  static Line Leader(const DrawnBox& mark, const DrawnBox& box) {
    constexpr double kApart = 1.5;  // from both, which are taken
    const auto nearest = [](double v, double low, double size) { return std::clamp(v, low, low + size); };
    const double mx = nearest(box.x + 0.5 * box.width, mark.x - kApart, mark.width + 2 * kApart);
    const double my = nearest(box.y + 0.5 * box.height, mark.y - kApart, mark.height + 2 * kApart);
    return {
        {mx, my},
        {nearest(mx, box.x - kApart, box.width + 2 * kApart), nearest(my, box.y - kApart, box.height + 2 * kApart)}};
  }
  static bool IsFree(const Line& line, const LabelPlaces& places) {
    const auto [x0, y0] = line.front();
    const double dx = line.back().first - x0, dy = line.back().second - y0;
    const int steps = std::max(1, static_cast<int>(std::hypot(dx, dy)));
    for (int k = 0; k <= steps; ++k) {
      if (!places.IsFree({x0 + k * dx / steps - 0.5, y0 + k * dy / steps - 0.5, 1, 1})) return false;
    }
    return true;
  }

  // Below the map; returns where it ends.
  double Legend(double top) {
    const double length = RoundDown(0.25 * (high_.x() - low_.x()) / words_.unit.metres);
    const double metres = length * words_.unit.metres, y = top + 34;
    drawing_.Line({{0, top}, {kWidth, top}}, "#d5dade", 1);
    drawing_.Line({{12, y}, {12 + metres * scale_, y}}, kInk, 2);
    for (const double x : {12.0, 12 + metres * scale_}) drawing_.Line({{x, y - 4}, {x, y + 4}}, kInk, 2);
    drawing_.Text(12, y - 8, fmt::format("{:g} {}", length, words_.unit.name), -1, 12, kInk);
    const double x = kWidth - 40;
    if (findings_.prediction.in_world || findings_.aerial) {
      drawing_.Text(x, y - 16, "N", 0, 12, kInk, true);
      Arrow(x, y + 8, 0, -22, kInk, 1.8);
    } else {
      Arrow(x - 12, y + 4, 26, 0, kInk, 1.8);
      Arrow(x - 12, y + 4, 0, -26, kInk, 1.8);
      drawing_.Text(x + 20, y + 8, "x", 0, 12, kInk, true);
      drawing_.Text(x - 12, y - 25, "y", 0, 12, kInk, true);
      drawing_.Text(x - 22, y + 8, "axes of the " + findings_.prediction.datum, 1, 11, kInk);
    }
    const double end = Entries(y + 26);
    std::string note;
    if (left_out_ > 0) note = Counted(left_out_, "name") + " left out for want of room";
    if (beyond_ > 0) {
      note +=
          (note.empty() ? "" : "; ") + Counted(beyond_, "ellipse") + " of the path not drawn: beyond the map's edge";
    }
    if (!note.empty()) drawing_.Text(12, end + 14, note, -1, 11, kInk);
    return end + (note.empty() ? 4 : 24);
  }

  double Entries(double y) {
    constexpr double kLeft = 12, kSymbol = 22, kGap = 20, kRow = 21, kSize = 11.5;
    double x = kLeft;
    const auto entry = [&](bool there, const std::string& text, const std::function<void(double, double)>& draw) {
      if (!there) return;
      const double width = kSymbol + TextWidth(text, kSize);
      if (x > kLeft && x + width > kWidth - kLeft) x = kLeft, y += kRow;
      draw(x + 0.4 * kSymbol, y - 4);
      drawing_.Text(x + kSymbol, y, text, -1, kSize, kInk);
      x += width + kGap;
    };
    entry(any_control_, "control", [&](double u, double v) { ControlMark(u, v); });
    entry(any_seen_, words_.seen, [&](double u, double v) { drawing_.Circle(u, v, 3.5, kTag); });
    entry(any_unseen_, words_.unseen, [&](double u, double v) { UnseenMark(u, v); });
    entry(!findings_.layout.stations.empty(), "station", [&](double u, double v) { StationMark(u, v); });
    entry(!findings_.prediction.bodies.empty(), words_.path, [&](double u, double v) {
      drawing_.Line({{u - 8, v}, {u + 8, v}}, kPath, 1.4);
    });
    const bool passes = !ranked_.empty() && !ranked_.front().gain->world_m;
    entry(!ranked_.empty(),
          ranked_by_gain_ ? "one more tag, control or pass: its rank by gain"
          : passes        ? "suggested pass"
                          : words_.suggested,
          [&](double u, double v) { Disc(u, v, "1"); });
    entry(any_way_, "pass not planned yet", [&](double u, double v) {
      drawing_.Line({{u - 8, v}, {u + 8, v}}, kGreen, 2, true);
    });
    entry(any_control_ || any_seen_, "95 %, " + EnlargedText(factor_) + "; stroke: the way a tag faces",
          [&](double u, double v) {
            Line line;
            for (int k = 0; k <= 24; ++k)
              line.emplace_back(u + 7 * std::cos(M_PI * k / 12), v + 5 * std::sin(M_PI * k / 12));
            drawing_.Line(line, kTag, 1.6);
          });
    return y;
  }

  struct Name {
    int order = 0;  // those of low order find a place first
    std::string text;
    bool bold = false;
    DrawnBox mark;
  };

  const PlanFindings& findings_;
  const MapWords& words_;
  Drawing drawing_;
  Eigen::Vector2d low_{1e12, 1e12}, high_{-1e12, -1e12};
  double scale_ = 1, height_ = 0, factor_ = 1;
  LabelPlaces places_{{}}, solid_{{}};  // solid_: marks, numbers and names alone
  std::vector<Ranked> ranked_;
  bool ranked_by_gain_ = false;
  std::vector<Name> names_;
  bool any_control_ = false, any_seen_ = false, any_unseen_ = false, any_way_ = false;
  int left_out_ = 0, beyond_ = 0;
};

}  // namespace

HorizontalEllipse EllipseOf(const Eigen::Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(Eigen::Matrix2d(covariance.topLeftCorner<2, 2>()));
  const Eigen::Vector2d axis = solver.eigenvectors().col(1);
  return {std::sqrt(std::max(0.0, solver.eigenvalues()(1))), std::sqrt(std::max(0.0, solver.eigenvalues()(0))),
          std::atan2(axis.y(), axis.x())};
}

Drawing PlanMap(const PlanFindings& findings, const MapWords& words) { return MapPainter(findings, words).Draw(); }

}  // namespace trigpoint

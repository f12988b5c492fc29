#include "eval/report/match_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "datasets/io/credits.h"
#include "datasets/io/csv.h"
#include "datasets/io/image.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr int kHeight = 420;  // of both pictures, px
constexpr int kGap = 10;
constexpr size_t kLines = 40;  // of the matches are joined
constexpr size_t kHomographyMatches = 8;

// BGR of the report's colours.
const cv::Scalar kYellow(66, 228, 240), kVermilion(0, 94, 213), kGreen(115, 158, 0), kSky(233, 180, 86);

cv::Mat LoadImage(const Run& run, const std::string& name) {
  for (const ImageEntry& entry : run.images) {
    if (entry.file != name) continue;
    return LoadColour(run, entry);
  }
  throw InputError("run " + run.name + ": image " + name + " of its matches is not in images.txt any more");
}

cv::Mat LoadView(const Project& project, const ViewOptions& options, const std::string& panorama,
                 const std::string& view) {
  for (const Reference& reference : project.site().references) {
    if (reference.name != panorama) continue;
    if (reference.kind == ReferenceKind::kPhotoSet) {
      const std::string photo = fs::path(view).filename().string();
      for (const fs::path& file : reference.files) {
        if (file.filename() == photo) return LoadPicture(file, false);
      }
      break;
    }
    if (reference.kind == ReferenceKind::kPhoto) return LoadPicture(reference.files.front(), false);
    const cv::Mat picture = LoadPanorama(reference.files.front(), false);
    for (const View& v : PanoramaViews(panorama, picture.cols, options).views) {
      if (v.name == view) return RenderView(picture, v);
    }
  }
  throw InputError("view " + view + " of " + panorama + " is not there any more; run `trigpoint localize` again");
}

void PutLabel(cv::Mat& picture, const std::string& text, cv::Point at, const cv::Scalar& colour) {
  cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, 0.5, cv::Scalar(0, 0, 0), 3, cv::LINE_AA);
  cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, 0.5, colour, 1, cv::LINE_AA);
}

// Image (left) and view (right) at one height.
struct PairDrawing {
  PairDrawing(const cv::Mat& image, const cv::Mat& view)
      : image_size(image.size()),
        view_size(view.size()),
        image_scale(static_cast<double>(kHeight) / image.rows),
        view_scale(static_cast<double>(kHeight) / view.rows) {
    const int image_width = std::max(1, static_cast<int>(std::lround(image.cols * image_scale)));
    const int view_width = std::max(1, static_cast<int>(std::lround(view.cols * view_scale)));
    canvas = cv::Mat(kHeight, image_width + kGap + view_width, CV_8UC3, cv::Scalar(255, 255, 255));
    left = canvas(cv::Rect(0, 0, image_width, kHeight));
    cv::Mat right = canvas(cv::Rect(image_width + kGap, 0, view_width, kHeight));
    cv::resize(image, left, left.size(), 0, 0, cv::INTER_AREA);
    cv::resize(view, right, right.size(), 0, 0, cv::INTER_AREA);
  }

  // The picture's edges stay its edges: pixel centres move by half a pixel.
  cv::Point2f InImage(double u, double v) const {
    return {static_cast<float>((u + 0.5) * image_scale - 0.5), static_cast<float>((v + 0.5) * image_scale - 0.5)};
  }
  cv::Point2f InView(double u, double v) const {
    return {static_cast<float>((u + 0.5) * view_scale - 0.5 + left.cols + kGap),
            static_cast<float>((v + 0.5) * view_scale - 0.5)};
  }

  // By the homography of matches from view to image; false where that gives none.
  bool DrawOutline(const std::vector<cv::Point2f>& from, const std::vector<cv::Point2f>& to) {
    const cv::Mat h = cv::findHomography(from, to, cv::RANSAC, 4 / image_scale);
    if (h.empty()) return false;
    const float w = static_cast<float>(view_size.width) - 0.5F, b = static_cast<float>(view_size.height) - 0.5F;
    std::vector<cv::Point2f> corners = {{-0.5F, -0.5F}, {w, -0.5F}, {w, b}, {-0.5F, b}}, projected;
    cv::perspectiveTransform(corners, projected, h);
    std::vector<cv::Point> polygon;
    for (const cv::Point2f& p : projected) {
      const bool near = std::isfinite(p.x) && std::isfinite(p.y) &&
                        std::abs(p.x) < 20.0F * static_cast<float>(image_size.width) &&
                        std::abs(p.y) < 20.0F * static_cast<float>(image_size.height);
      if (!near) return false;
      polygon.emplace_back(InImage(p.x, p.y));
    }
    if (!cv::isContourConvex(polygon)) return false;
    cv::polylines(left, polygon, true, kYellow, 2, cv::LINE_AA);
    return true;
  }

  cv::Size image_size, view_size;
  double image_scale, view_scale;
  cv::Mat canvas, left;
};

}  // namespace

MatchPictures::MatchPictures(const Project& project, const std::string& run, const std::string& result,
                             const ViewOptions& views)
    : project_(project), run_(project.run(run)), views_(views) {
  const fs::path file = project.ResultDir("localize", result) / "matches.csv";
  if (fs::exists(file)) {
    std::map<std::string, std::map<std::pair<std::string, std::string>, std::vector<Match>>> pairs;
    const CsvTable table =
        CsvTable::Read(file, {"panorama", "view", "image", "u_image", "v_image", "u_view", "v_view"});
    for (const CsvRow& row : table.rows()) {
      const auto px = [&](const char* column) { return static_cast<float>(row.Number(column)); };
      pairs[row.Text("panorama")][{row.Text("view"), row.Text("image")}].push_back(
          {px("u_image"), px("v_image"), px("u_view"), px("v_view")});
    }
    for (auto& [panorama, of_pair] : pairs) {
      Pair& best = of_panorama_[panorama];
      for (auto& [names, matches] : of_pair) {
        inliers_[panorama] += static_cast<int>(matches.size());
        if (matches.size() > best.matches.size()) best = {names.first, names.second, std::move(matches)};
      }
    }
  }
  // Pictures that must not be copied.
  for (const auto& [name, credit] : ReadCredits(project.dir())) {
    if (!credit.keep_until.empty()) of_panorama_.erase(name);
  }
  fs::path detections = project.ResultDir("detect", run) / "detections.csv";
  if (!fs::exists(detections)) detections = run_.detections;
  if (detections.empty() || !fs::exists(detections)) return;
  std::set<std::string> wanted;
  for (const auto& [panorama, pair] : of_panorama_) wanted.insert(pair.image);
  const CsvTable table =
      CsvTable::Read(detections, {"tag_id", "u0", "v0", "u1", "v1", "u2", "v2", "u3", "v3"}, {"image"});
  for (const CsvRow& row : table.rows()) {
    if (!row.Has("image") || wanted.count(row.Text("image")) == 0) continue;
    Tag tag{static_cast<int>(row.Integer("tag_id")), {}, {}};
    for (int k = 0; k < 4; ++k) {
      tag.u[k] = static_cast<float>(row.Number("u" + std::to_string(k)));
      tag.v[k] = static_cast<float>(row.Number("v" + std::to_string(k)));
    }
    tags_[row.Text("image")].push_back(tag);
  }
}

MatchPicture MatchPictures::Draw(const std::string& panorama) {
  const Pair& pair = of_panorama_.at(panorama);
  const cv::Mat image = LoadImage(run_, pair.image), view = LoadView(project_, views_, panorama, pair.view);
  PairDrawing drawing(image, view);
  std::string outline = "";
  if (pair.matches.size() >= kHomographyMatches) {
    std::vector<cv::Point2f> from, to;
    for (const Match& m : pair.matches) {
      from.emplace_back(m.u_view, m.v_view);
      to.emplace_back(m.u_image, m.v_image);
    }
    if (drawing.DrawOutline(from, to)) outline = "; yellow: the view's outline by the homography of the inliers";
  }
  const size_t step = pair.matches.size() / kLines + 1;
  for (size_t i = 0; i < pair.matches.size(); i += step) {
    const Match& m = pair.matches[i];
    cv::line(drawing.canvas, drawing.InImage(m.u_image, m.v_image), drawing.InView(m.u_view, m.v_view), kSky, 1,
             cv::LINE_AA);
  }
  for (const Match& m : pair.matches) {
    cv::circle(drawing.canvas, drawing.InImage(m.u_image, m.v_image), 2, kVermilion, cv::FILLED, cv::LINE_AA);
    cv::circle(drawing.canvas, drawing.InView(m.u_view, m.v_view), 2, kVermilion, cv::FILLED, cv::LINE_AA);
  }
  std::string tags;
  if (const auto it = tags_.find(pair.image); it != tags_.end()) {
    for (const Tag& tag : it->second) {
      std::vector<cv::Point> corners;
      for (int k = 0; k < 4; ++k) corners.emplace_back(drawing.InImage(tag.u[k], tag.v[k]));
      cv::polylines(drawing.left, corners, true, kGreen, 2, cv::LINE_AA);
      PutLabel(drawing.left, std::to_string(tag.id), corners[3] - cv::Point(0, 5), cv::Scalar(220, 255, 220));
      tags += (tags.empty() ? "" : ", ") + std::to_string(tag.id);
    }
  }
  MatchPicture result;
  std::vector<uchar> jpeg;
  cv::imencode(".jpg", drawing.canvas, jpeg, {cv::IMWRITE_JPEG_QUALITY, 82});
  result.picture = {std::string(jpeg.begin(), jpeg.end()), true, drawing.canvas.cols, drawing.canvas.rows};
  result.caption = fmt::format(
      "{} of {} (left) and view {} of {} (right): {} inlier matches of this pair, of {} in all, {} joined{}{}.",
      pair.image, run_.name, pair.view, panorama, pair.matches.size(), inliers_[panorama],
      step == 1 ? "all" : fmt::format("one in {}", step), outline,
      tags.empty() ? "" : "; green: detected tags " + tags);
  return result;
}

}  // namespace trigpoint

// A reference's view beside the image of the run that it was recognised in.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "datasets/io/views.h"
#include "datasets/project/project.h"
#include "eval/report/document.h"

namespace trigpoint {

struct MatchPicture {
  Picture picture;
  std::string caption;
};

// Of the results of one run (and variant). Draws the pair of view and image with the most inliers: each inlier as a dot
// in both, some joined by lines, the view's outline in the image by the homography of its inliers, and the tags that
// were detected in the image. Pictures are decoded once per panorama if asked in the order of panoramas.
class MatchPictures {
 public:
  // `result`: "run1" or "run1@paper". Throws InputError when the matches cannot be read.
  MatchPictures(const Project& project, const std::string& run, const std::string& result, const ViewOptions& views);

  // Have the matches of this result been kept at all? (Results of older versions have none.)
  bool HasMatches() const { return !of_panorama_.empty(); }
  bool Has(const std::string& panorama) const { return of_panorama_.count(panorama) > 0; }
  // Throws InputError when one of the two pictures cannot be read.
  MatchPicture Draw(const std::string& panorama);

 private:
  struct Match {
    float u_image, v_image, u_view, v_view;
  };
  struct Pair {
    std::string view, image;
    std::vector<Match> matches;
  };
  struct Tag {
    int id;
    float u[4], v[4];
  };

  const Project& project_;
  const Run& run_;
  ViewOptions views_;
  std::map<std::string, Pair> of_panorama_;  // the pair with the most inliers
  std::map<std::string, int> inliers_;       // of all pairs of a panorama
  std::map<std::string, std::vector<Tag>> tags_;
};

}  // namespace trigpoint

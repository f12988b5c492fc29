// Maps of tags as other programs keep them: field layouts of WPILib (JSON) and fmaps of Limelight.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/geometry/rigid3.h"

namespace trigpoint {

struct LayoutTag {
  int id = -1;
  std::string family = "tag36h11";
  double size_m = 0;       // edge of the black square; 0: not stated (WPILib)
  Rigid3d world_from_tag;  // our tag: x right, y down, z into it; theirs has x out of it and z up
};

// Told apart by what is in the file: WPILib's {"tags": [{"ID", "pose"}], "field"}, fmap's {"fiducials": [{"id",
// "family", "size", "transform"}]}. Throws InputError naming the file and the tag.
std::vector<LayoutTag> ReadTagLayout(const std::filesystem::path& file);
// Does it look like one?
bool IsTagLayout(const std::filesystem::path& file);

// `field` of WPILib's is the extent of the tags from the origin. Sizes of an fmap are needed: throws InputError for a
// tag without. Both are written atomically.
void WriteWpilibLayout(const std::filesystem::path& file, const std::vector<LayoutTag>& tags);
void WriteFmap(const std::filesystem::path& file, const std::vector<LayoutTag>& tags);

}  // namespace trigpoint

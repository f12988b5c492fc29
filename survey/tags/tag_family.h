// The tag families of the AprilTag library by name, and the printed pattern of each tag.
#pragma once

#include <memory>
#include <string>
#include <vector>

struct apriltag_family;

namespace trigpoint {

// Names TagFamily knows: "tag36h11", "tag25h9", "tag16h5", ...
std::vector<std::string> TagFamilyNames();

// The printed cells of one tag, `total` x `total`, 1 white, 0 black. The square whose corners are detected spans the
// cells [margin, margin + width).
struct TagPattern {
  int total = 0;
  int width = 0;
  int margin = 0;
  std::vector<unsigned char> white;  // row-major, row 0 at the top of the upright tag
  bool At(int row, int column) const { return white[row * total + column] != 0; }
};

// Owns one family object of the library. Not thread safe: a detector needs one of its own.
class TagFamily {
 public:
  // Throws OptionError naming the known families.
  explicit TagFamily(const std::string& name);

  const std::string& name() const { return name_; }
  int size() const;  // number of ids
  // Bits that may be corrected without reading chance as a tag: codes of weak families lie close together. Of families
  // with tens of thousands of codes one bit: the library's table for two takes 3 GB.
  int Correctable() const;
  apriltag_family* get() const { return family_.get(); }
  TagPattern Pattern(int id) const;  // throws InputError for an id the family does not have

 private:
  std::string name_;
  std::unique_ptr<apriltag_family, void (*)(apriltag_family*)> family_;
};

}  // namespace trigpoint

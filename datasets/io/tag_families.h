// Which families a site's tags are of.
#pragma once

#include <map>
#include <string>
#include <vector>

namespace trigpoint {

// The families of the AprilTag library, which a tags.yaml may name.
std::vector<std::string> KnownTagFamilies();
// "tag 999 is not in tag36h11, which has the ids 0 to 586": what is wrong with an id of a known family; empty: nothing,
// or another library's family.
std::string TagIdProblem(const std::string& family, int id);

// "tag36h11", or "tag36h11,tag16h5:3:12", where the tags 3 and 12 are of tag16h5 and all others of the first. An id is
// one tag of a site.
class TagFamilies {
 public:
  // Throws OptionError naming what is wrong with the text; any name of a family is taken.
  explicit TagFamilies(const std::string& text);
  explicit TagFamilies(std::string first, std::map<int, std::string> others);

  const std::vector<std::string>& names() const { return names_; }
  const std::map<int, std::string>& others() const { return of_id_; }  // ids that are not of the first
  const std::string& Of(int id) const;
  std::string Text() const;

 private:
  std::vector<std::string> names_;
  std::map<int, std::string> of_id_;
};

}  // namespace trigpoint

// Whose pictures a site uses, and what must be written beside them.
#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace trigpoint {

struct PictureCredit {
  std::string source;       // service or folder it came from
  std::string captured_at;  // as the source states it
  std::string licence;
  std::string attribution;
  std::string keep_until;  // UTC: it must not be kept longer, nor copied; empty: it may
};

// Of each picture in SITE/panoramas.csv and photos.csv that states any of it, by the file as written there. What cannot
// be read is left out: the site's reader names it.
std::map<std::string, PictureCredit> ReadCredits(const std::filesystem::path& site);

}  // namespace trigpoint

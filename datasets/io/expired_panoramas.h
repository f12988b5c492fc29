// Pictures whose source forbids to keep them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace trigpoint {

// Seconds since 1970.
int64_t NowUtc_s();

// Is that time (UTC, as in the column keep_until) over? Text that is not a time is never over.
bool IsOver(const std::string& keep_until, int64_t now_s = NowUtc_s());

// Deletes pictures of SITE/panoramas.csv whose `keep_until` is before `now_s` (UTC), and their rows there and in
// SITE/results/replaced/; a table without another row goes as a whole, and the table as it was is kept until the next
// time. Of pictures only those that an import wrote (panoramas/<service>-<id>.jpg, no link), and none that a row of the
// present table allows; rows of others stay, and the site's reader does not use them. Returns how many there were.
// Tables that cannot be read are left as they are: the site's reader names them. Also removes what a killed import left
// of a picture being written. Throws IoError.
int ForgetExpiredPanoramas(const std::filesystem::path& site, int64_t now_s = NowUtc_s());

}  // namespace trigpoint

// Pictures of a project for the screen.
#pragma once

#include <QImage>
#include <filesystem>
#include <string>

namespace trigpoint {

class Project;

// An image of a run as the computations see it: turned by its EXIF orientation, mirroring undone. Throws InputError.
QImage LoadRunPicture(const Project& project, const std::string& run, const std::string& file);
// Any other picture, at most `longest` pixels on its longer side (0: as it is). Throws InputError.
QImage LoadAnyPicture(const std::filesystem::path& file, int longest);

}  // namespace trigpoint

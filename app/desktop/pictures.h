// Pictures of a project for the screen.
#pragma once

#include <QImage>
#include <filesystem>
#include <string>

namespace trigpoint {

class Project;
struct View;

// An image of a run as the computations see it: turned by its EXIF orientation, mirroring undone. Throws InputError.
QImage LoadRunPicture(const Project& project, const std::string& run, const std::string& file);
// Any other picture, at most `longest` pixels on its longer side (0: as it is). Throws InputError.
QImage LoadAnyPicture(const std::filesystem::path& file, int longest);
// A panorama, a partial one where it lies in the sphere. Throws InputError.
QImage LoadPanoramaPicture(const std::filesystem::path& file);
// A view as localize sees it, of such a panorama.
QImage CutView(const QImage& panorama, const View& view);

}  // namespace trigpoint

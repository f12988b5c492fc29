// Pictures as they come: JPEG, PNG, TIFF, 8 or 16 bit, grey, colour, CMYK; video frames.
#pragma once

#include <filesystem>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "datasets/io/exif.h"
#include "datasets/io/site.h"

namespace trigpoint {

// Grey 8-bit picture of an image of a run. Applies EXIF orientation unless only the raw orientation has the
// calibration's size; undoes `mirrored` (of a partial 360 picture before it is put into the sphere); draws the camera's
// part of the stored picture. Throws InputError naming the file when it is missing, empty, truncated, not a picture, or
// of another size than the calibration (expected and found sizes named).
cv::Mat LoadGrey(const Run& run, const ImageEntry& entry);
// The same in colour, BGR.
cv::Mat LoadColour(const Run& run, const ImageEntry& entry);

// Which way is up in that picture by its EXIF orientation, camera frame: (0, -1, 0), unless it is taken as stored.
Eigen::Vector3d TopOf(const Run& run, const ImageEntry& entry);

// The same of a photo with a known camera: 8-bit grey or BGR of the camera's size. Throws InputError.
cv::Mat LoadPhoto(const std::filesystem::path& file, const Camera& camera, bool grey);

// Is given the size that a picture's header states, before gigabytes are decoded for nothing; EXIF orientation may swap
// its sides. Throws to refuse it.
using SizeCheck = std::function<void(const cv::Size& stored)>;

// Colour 8-bit BGR (or grey, if `grey`) picture of any file, EXIF orientation applied. Throws InputError.
cv::Mat LoadPicture(const std::filesystem::path& file, bool grey, const SizeCheck& check = {});

// Where a panorama's picture lies in the full sphere, which has its resolution.
struct SpherePart {
  cv::Size sphere;
  cv::Rect part;
};
// By the size of the picture as shown, else by its GPano tags; nothing: it is no panorama.
std::optional<SpherePart> PartOfSphere(const std::optional<GPano>& gpano, const cv::Size& picture);
// The same of a file, in the sphere of this size that LoadPanorama puts it into: all of it where the headers do not
// state a part. Throws InputError if they cannot be read.
SpherePart PartInSphere(const std::filesystem::path& panorama, const cv::Size& sphere);

// An equirectangular panorama, 2:1. A partial one whose GPano tags say where it lies is put into a black full sphere.
// Throws InputError naming the size found for any other picture, and for a full sphere of more than `widest` px.
cv::Mat LoadPanorama(const std::filesystem::path& file, bool grey, int widest = 65534);

}  // namespace trigpoint

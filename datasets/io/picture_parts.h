// Pictures that hold what several cameras see: 360 pictures and dual fisheyes (docs/decisions/parts_of_pictures.md).
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "datasets/io/site.h"

namespace trigpoint {

// Pictures that several cameras see become an image of each of them: the crops of a dual fisheye, and a 360 picture's
// rectilinear views, which take the place of its camera (the first view looks along the picture's centre and keeps the
// camera's name and pose). The first image has the picture's name, the others "<picture>#<camera>". Ascending time,
// then camera.
void SplitPictures(Run* run);

// The stored picture of an image, as written in images.txt.
std::string PictureOf(const Run& run, const ImageEntry& image);

// What a camera sees of a stored picture, 8 bits, or of a mask of its size.
cv::Mat PartOf(const cv::Mat& picture, const BodyCamera& camera);

// How many views a 360 picture has.
int ViewsOf360();

}  // namespace trigpoint

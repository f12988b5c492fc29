// The few kinds of things a scene is drawn from. VTK only.
#pragma once

#include <vtkActor.h>
#include <vtkPolyData.h>
#include <vtkSmartPointer.h>

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

class vtkBillboardTextActor3D;
class vtkTextProperty;

namespace trigpoint {

using Colour = std::array<double, 3>;

// Okabe and Ito's colours, which colour-blind readers tell apart.
constexpr Colour kBlue{0.0, 0.447, 0.698}, kOrange{0.902, 0.624, 0.0}, kGreen{0.0, 0.62, 0.451},
    kVermilion{0.835, 0.369, 0.0}, kSky{0.337, 0.706, 0.914}, kPurple{0.8, 0.475, 0.655}, kBlack{0.1, 0.1, 0.1},
    kYellow{0.941, 0.894, 0.259}, kWhite{1, 1, 1};

// One cell a line.
vtkSmartPointer<vtkPolyData> Lines(const std::vector<std::vector<Eigen::Vector3d>>& lines);
// One cell a point.
vtkSmartPointer<vtkPolyData> Dots(const std::vector<Eigen::Vector3d>& points);
// A grid of vertices (row by row from the picture's top-left corner) under a picture.
vtkSmartPointer<vtkPolyData> TexturedGrid(const std::vector<Eigen::Vector3d>& vertices, int columns, int rows);
// A closed strip of triangles or quads.
vtkSmartPointer<vtkPolyData> Polygon(const std::vector<Eigen::Vector3d>& corners);

// Ellipsoids along the axes, all in one.
struct Ball {
  Eigen::Vector3d centre, half_axes;
};
vtkSmartPointer<vtkPolyData> Balls(const std::vector<Ball>& balls);

// Evenly lit: pictures look as taken, colours as in the legend.
vtkSmartPointer<vtkActor> FlatActor(vtkPolyData* data, const Colour& colour, double size_px);
// With light and shade.
vtkSmartPointer<vtkActor> SolidActor(vtkPolyData* data, const Colour& colour, double opacity);
// `nearest`: cells keep their edges (tags). Grey or BGR pictures.
vtkSmartPointer<vtkActor> TexturedActor(vtkPolyData* data, const cv::Mat& picture, bool nearest);

// Dark text on a light plate.
void StyleText(vtkTextProperty* text, double height_px, const Colour& colour);
// Of the text with its plate.
void FadeText(vtkTextProperty* text, double opacity);
vtkSmartPointer<vtkBillboardTextActor3D> Label(const std::string& text, const Eigen::Vector3d& at, double height_px);

}  // namespace trigpoint

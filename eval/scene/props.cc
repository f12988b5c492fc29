#include "eval/scene/props.h"

#include <vtkBillboardTextActor3D.h>
#include <vtkCellArray.h>
#include <vtkFloatArray.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkTextProperty.h>
#include <vtkTexture.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calib/base/grid.h"

namespace trigpoint {
namespace {

vtkIdType Insert(vtkPoints* points, const Eigen::Vector3d& p) { return points->InsertNextPoint(p.x(), p.y(), p.z()); }

}  // namespace

vtkSmartPointer<vtkPolyData> Lines(const std::vector<std::vector<Eigen::Vector3d>>& lines) {
  vtkNew<vtkPoints> points;
  vtkNew<vtkCellArray> cells;
  for (const auto& line : lines) {
    cells->InsertNextCell(static_cast<vtkIdType>(line.size()));
    for (const Eigen::Vector3d& p : line) cells->InsertCellPoint(Insert(points, p));
  }
  auto data = vtkSmartPointer<vtkPolyData>::New();
  data->SetPoints(points);
  data->SetLines(cells);
  return data;
}

vtkSmartPointer<vtkPolyData> Dots(const std::vector<Eigen::Vector3d>& dots) {
  vtkNew<vtkPoints> points;
  vtkNew<vtkCellArray> cells;
  for (const Eigen::Vector3d& p : dots) {
    const vtkIdType id = Insert(points, p);
    cells->InsertNextCell(1, &id);
  }
  auto data = vtkSmartPointer<vtkPolyData>::New();
  data->SetPoints(points);
  data->SetVerts(cells);
  return data;
}

vtkSmartPointer<vtkPolyData> TexturedGrid(const std::vector<Eigen::Vector3d>& vertices, int columns, int rows) {
  vtkNew<vtkPoints> points;
  vtkNew<vtkFloatArray> where;
  where->SetNumberOfComponents(2);
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      Insert(points, vertices[CellIndex(r, c, columns)]);
      where->InsertNextTuple2(static_cast<double>(c) / (columns - 1), 1 - static_cast<double>(r) / (rows - 1));
    }
  }
  vtkNew<vtkCellArray> cells;
  for (int r = 0; r + 1 < rows; ++r) {
    for (int c = 0; c + 1 < columns; ++c) {
      const vtkIdType corner = r * columns + c;
      const vtkIdType quad[4] = {corner, corner + columns, corner + columns + 1, corner + 1};
      cells->InsertNextCell(4, quad);
    }
  }
  auto data = vtkSmartPointer<vtkPolyData>::New();
  data->SetPoints(points);
  data->SetPolys(cells);
  data->GetPointData()->SetTCoords(where);
  return data;
}

vtkSmartPointer<vtkPolyData> Polygon(const std::vector<Eigen::Vector3d>& corners) {
  vtkNew<vtkPoints> points;
  vtkNew<vtkCellArray> cells;
  cells->InsertNextCell(static_cast<vtkIdType>(corners.size()));
  for (const Eigen::Vector3d& p : corners) cells->InsertCellPoint(Insert(points, p));
  auto data = vtkSmartPointer<vtkPolyData>::New();
  data->SetPoints(points);
  data->SetPolys(cells);
  return data;
}

vtkSmartPointer<vtkPolyData> Balls(const std::vector<Ball>& balls) {
  constexpr int kColumns = 16, kRows = 9;
  constexpr double kLeast_m = 5e-4;  // a disc of no height would flicker
  vtkNew<vtkPoints> points;
  vtkNew<vtkFloatArray> normals;
  normals->SetNumberOfComponents(3);
  vtkNew<vtkCellArray> cells;
  for (const Ball& ball : balls) {
    const Eigen::Vector3d half = ball.half_axes.cwiseMax(kLeast_m);
    const vtkIdType first = points->GetNumberOfPoints();
    for (int r = 0; r < kRows; ++r) {
      for (int c = 0; c < kColumns; ++c) {
        const double polar = M_PI * r / (kRows - 1), around = 2 * M_PI * c / kColumns;
        const Eigen::Vector3d d(std::sin(polar) * std::cos(around), std::sin(polar) * std::sin(around),
                                std::cos(polar));
        Insert(points, ball.centre + half.cwiseProduct(d));
        const Eigen::Vector3d out = d.cwiseQuotient(half).normalized();
        normals->InsertNextTuple3(out.x(), out.y(), out.z());
      }
    }
    for (int r = 0; r + 1 < kRows; ++r) {
      for (int c = 0; c < kColumns; ++c) {
        const vtkIdType here = first + r * kColumns, next = (c + 1) % kColumns;
        const vtkIdType quad[4] = {here + c, here + kColumns + c, here + kColumns + next, here + next};
        cells->InsertNextCell(4, quad);
      }
    }
  }
  auto data = vtkSmartPointer<vtkPolyData>::New();
  data->SetPoints(points);
  data->SetPolys(cells);
  data->GetPointData()->SetNormals(normals);
  return data;
}

vtkSmartPointer<vtkActor> FlatActor(vtkPolyData* data, const Colour& colour, double size_px) {
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputData(data);
  mapper->ScalarVisibilityOff();
  auto actor = vtkSmartPointer<vtkActor>::New();
  actor->SetMapper(mapper);
  actor->GetProperty()->SetColor(colour[0], colour[1], colour[2]);
  actor->GetProperty()->LightingOff();
  actor->GetProperty()->SetLineWidth(static_cast<float>(size_px));
  actor->GetProperty()->SetPointSize(static_cast<float>(size_px));
  return actor;
}

vtkSmartPointer<vtkActor> SolidActor(vtkPolyData* data, const Colour& colour, double opacity) {
  vtkSmartPointer<vtkActor> actor = FlatActor(data, colour, 1);
  actor->GetProperty()->LightingOn();
  actor->GetProperty()->SetAmbient(0.35);
  actor->GetProperty()->SetDiffuse(0.65);
  actor->GetProperty()->SetOpacity(opacity);
  return actor;
}

vtkSmartPointer<vtkActor> TexturedActor(vtkPolyData* data, const cv::Mat& picture, bool nearest) {
  cv::Mat rgb, upright;
  cv::cvtColor(picture, rgb, picture.channels() == 1 ? cv::COLOR_GRAY2RGB : cv::COLOR_BGR2RGB);
  cv::flip(rgb, upright, 0);  // VTK's rows go up
  vtkNew<vtkImageData> image;
  image->SetDimensions(upright.cols, upright.rows, 1);
  image->AllocateScalars(VTK_UNSIGNED_CHAR, 3);
  upright.copyTo(cv::Mat(upright.rows, upright.cols, CV_8UC3, image->GetScalarPointer()));
  vtkNew<vtkTexture> texture;
  texture->SetInputData(image);
  texture->SetInterpolate(!nearest);
  texture->SetMipmap(!nearest);
  texture->RepeatOff();
  vtkSmartPointer<vtkActor> actor = FlatActor(data, kWhite, 1);
  actor->SetTexture(texture);
  return actor;
}

void StyleText(vtkTextProperty* text, double height_px, const Colour& colour) {
  text->SetFontFamilyToArial();
  text->SetFontSize(static_cast<int>(height_px));
  text->SetColor(colour[0], colour[1], colour[2]);
  text->SetBackgroundColor(1, 1, 1);
  FadeText(text, 1);
}

void FadeText(vtkTextProperty* text, double opacity) {
  text->SetOpacity(opacity);
  text->SetBackgroundOpacity(0.75 * opacity);
}

vtkSmartPointer<vtkBillboardTextActor3D> Label(const std::string& text, const Eigen::Vector3d& at, double height_px) {
  auto label = vtkSmartPointer<vtkBillboardTextActor3D>::New();
  label->SetInput(text.c_str());
  label->SetPosition(at.x(), at.y(), at.z());
  StyleText(label->GetTextProperty(), height_px, kBlack);
  label->GetTextProperty()->SetJustificationToCentered();
  label->GetTextProperty()->SetVerticalJustificationToBottom();
  label->SetDisplayOffset(0, static_cast<int>(0.5 * height_px));
  label->PickableOff();
  return label;
}

}  // namespace trigpoint

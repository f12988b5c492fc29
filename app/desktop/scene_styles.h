// What dragging in the scene does: orbit about the place one drags, move over the plan, fly, look around.
#pragma once

#include <vtkInteractorStyle.h>
#include <vtkSmartPointer.h>

#include <Eigen/Core>
#include <string>

class vtkCamera;

namespace trigpoint {

// "orbit" about *pivot, which must outlive it; "plan", "fly", "inside".
vtkSmartPointer<vtkInteractorStyle> MakeSceneStyle(const std::string& mode, const Eigen::Vector3d* pivot);

// Turns the camera about a place, to the left and upwards, keeping +z up.
void TurnAbout(vtkCamera* camera, const Eigen::Vector3d& pivot, double left_deg, double up_deg);

}  // namespace trigpoint

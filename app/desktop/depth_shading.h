// Eye-dome lighting (Boucheny 2009): a pixel is darker the more its neighbours stand before it, so that bare points
// look solid. vtkEDLShading blackens every point of a sparse cloud that has a nearer one beside it; here a pixel keeps
// at least half of its brightness, so that colours can be read, and depths are compared by their ratio, so that near
// and far are shaded alike.
#pragma once

#include <vtkDepthImageProcessingPass.h>
#include <vtkSmartPointer.h>

#include <memory>

class vtkOpenGLQuadHelper;

namespace trigpoint {

class DepthShading : public vtkDepthImageProcessingPass {
 public:
  static DepthShading* New();
  void Render(const vtkRenderState* state) override;
  void ReleaseGraphicsResources(vtkWindow* window) override;

  DepthShading(const DepthShading&) = delete;
  DepthShading& operator=(const DepthShading&) = delete;

 protected:
  DepthShading();
  ~DepthShading() override;

 private:
  void MakeTargets(vtkOpenGLRenderWindow* window);

  vtkSmartPointer<vtkOpenGLFramebufferObject> target_;
  vtkSmartPointer<vtkTextureObject> colour_, depth_;
  std::unique_ptr<vtkOpenGLQuadHelper> quad_;
};

}  // namespace trigpoint

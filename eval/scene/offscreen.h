// Pictures from VTK without an X server: a surfaceless EGL context (Mesa's software renderer where there is no GPU, an
// EGL device where there is one).
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>

class vtkRenderer;

namespace trigpoint {

// One context, current in the thread that made it; use and destroy it there. Rendering is repeatable on one machine.
class OffscreenWindow {
 public:
  // Nothing without OpenGL 3.2; `reason` then says why in one sentence. Nothing is printed and nobody aborts.
  static std::unique_ptr<OffscreenWindow> Create(std::string* reason);
  ~OffscreenWindow();

  // The renderer everything is added to.
  vtkRenderer* renderer() const;
  // BGR, 8 bit.
  cv::Mat Render(int width, int height);
  // "llvmpipe (LLVM 15.0.6, 256 bits)" and the like.
  std::string Device() const;

 private:
  struct Parts;
  explicit OffscreenWindow(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace trigpoint

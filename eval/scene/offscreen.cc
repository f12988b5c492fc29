#include "eval/scene/offscreen.h"

#include <GL/glew.h>
// After glew.
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <vtkGenericOpenGLRenderWindow.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkObject.h>
#include <vtkObjectFactory.h>
#include <vtkRenderer.h>
#include <vtkWindowToImageFilter.h>

#include <cstring>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace trigpoint {
namespace {

// VTK's window for a context that somebody else made; glew is told not to look for X.
class SurfacelessWindow : public vtkGenericOpenGLRenderWindow {
 public:
  static SurfacelessWindow* New();

  void OpenGLInitContext() override {
    if (Initialized) return;
    glewExperimental = GL_TRUE;
    const GLenum code = glewInit();
    GlewInitValid = code == GLEW_OK || code == GLEW_ERROR_NO_GLX_DISPLAY;
    if (!GlewInitValid) return;
    Initialized = true;
    float range[2] = {1, 1};
    glGetFloatv(GL_ALIASED_LINE_WIDTH_RANGE, range);
    MaximumHardwareLineWidth = range[1];
  }
};

vtkStandardNewMacro(SurfacelessWindow);

bool Has(const char* extensions, const char* name) {
  return extensions != nullptr && std::strstr(extensions, name) != nullptr;
}

// A display that needs no X: Mesa's surfaceless one on a machine without GPU, else the first device.
std::vector<EGLDisplay> Displays() {
  std::vector<EGLDisplay> displays;
  const char* client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  const auto platform_display =
      reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(eglGetProcAddress("eglGetPlatformDisplayEXT"));
  if (platform_display == nullptr) return displays;
  if (Has(client, "EGL_EXT_platform_device")) {
    const auto query = reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(eglGetProcAddress("eglQueryDevicesEXT"));
    const auto describe =
        reinterpret_cast<PFNEGLQUERYDEVICESTRINGEXTPROC>(eglGetProcAddress("eglQueryDeviceStringEXT"));
    EGLDeviceEXT devices[16];
    EGLint count = 0;
    if (query != nullptr && describe != nullptr && query(16, devices, &count)) {
      for (EGLint i = 0; i < count; ++i) {
        // Software devices come last, by way of the surfaceless platform.
        if (Has(describe(devices[i], EGL_EXTENSIONS), "EGL_MESA_device_software")) continue;
        displays.push_back(platform_display(EGL_PLATFORM_DEVICE_EXT, devices[i], nullptr));
      }
    }
  }
  if (Has(client, "EGL_MESA_platform_surfaceless")) {
    displays.push_back(platform_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr));
  }
  return displays;
}

struct Context {
  EGLDisplay display = EGL_NO_DISPLAY;
  EGLContext context = EGL_NO_CONTEXT;

  bool Make(EGLDisplay of) {
    EGLint major = 0, minor = 0;
    if (of == EGL_NO_DISPLAY || !eglInitialize(of, &major, &minor)) return false;
    display = of;
    const EGLint wanted[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_SURFACE_TYPE, EGL_DONT_CARE, EGL_NONE};
    const EGLint version[] = {
        EGL_CONTEXT_MAJOR_VERSION,           3,       EGL_CONTEXT_MINOR_VERSION, 3, EGL_CONTEXT_OPENGL_PROFILE_MASK,
        EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE};
    EGLConfig config = nullptr;
    EGLint count = 0;
    if (eglBindAPI(EGL_OPENGL_API) && eglChooseConfig(display, wanted, &config, 1, &count) && count > 0) {
      context = eglCreateContext(display, config, EGL_NO_CONTEXT, version);
    }
    if (context != EGL_NO_CONTEXT && eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context)) return true;
    Release();
    return false;
  }
  void Release() {
    if (display == EGL_NO_DISPLAY) return;
    eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    if (context != EGL_NO_CONTEXT) eglDestroyContext(display, context);
    eglTerminate(display);
    display = EGL_NO_DISPLAY, context = EGL_NO_CONTEXT;
  }
};

}  // namespace

struct OffscreenWindow::Parts {
  Context context;
  vtkNew<SurfacelessWindow> window;
  vtkNew<vtkRenderer> renderer;
  std::string device;
};

OffscreenWindow::OffscreenWindow(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

std::unique_ptr<OffscreenWindow> OffscreenWindow::Create(std::string* reason) {
  auto parts = std::make_unique<Parts>();
  const std::vector<EGLDisplay> displays = Displays();
  if (displays.empty()) {
    *reason = "EGL offers no display that works without a screen (on Debian: libegl1, libegl-mesa0, libgl1-mesa-dri)";
    return nullptr;
  }
  bool made = false;
  for (EGLDisplay display : displays) made = made || parts->context.Make(display);
  if (!made) {
    *reason = "EGL has no OpenGL 3.3 (on Debian its software renderer is in libgl1-mesa-dri)";
    return nullptr;
  }
  vtkObject::GlobalWarningDisplayOff();
  SurfacelessWindow& window = *parts->window;
  window.SetReadyForRendering(true);
  window.SetIsCurrent(true);
  window.SetOwnContext(0);
  window.SetOffScreenRendering(1);
  window.SetMultiSamples(0);  // callers render larger and average, which is the same on every machine
  window.OpenGLInitContext();
  if (const GLubyte* name = glGetString(GL_RENDERER)) parts->device = reinterpret_cast<const char*>(name);
  window.AddRenderer(parts->renderer);
  return std::unique_ptr<OffscreenWindow>(new OffscreenWindow(std::move(parts)));
}

OffscreenWindow::~OffscreenWindow() {
  parts_->window->RemoveRenderer(parts_->renderer);
  parts_->window->Finalize();
  parts_->context.Release();
}

vtkRenderer* OffscreenWindow::renderer() const { return parts_->renderer; }

std::string OffscreenWindow::Device() const { return parts_->device; }

cv::Mat OffscreenWindow::Render(int width, int height) {
  parts_->window->SetSize(width, height);
  parts_->renderer->ResetCameraClippingRange();
  parts_->window->Render();
  vtkNew<vtkWindowToImageFilter> grab;
  grab->SetInput(parts_->window);
  grab->SetInputBufferTypeToRGB();
  grab->ReadFrontBufferOff();
  grab->ShouldRerenderOff();
  grab->Update();
  vtkImageData* image = grab->GetOutput();
  const int* size = image->GetDimensions();
  const cv::Mat rgb(size[1], size[0], CV_8UC3, image->GetScalarPointer());
  cv::Mat picture;
  cv::cvtColor(rgb, picture, cv::COLOR_RGB2BGR);
  cv::flip(picture, picture, 0);
  return picture;
}

}  // namespace trigpoint

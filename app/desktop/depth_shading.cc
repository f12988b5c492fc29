#include "app/desktop/depth_shading.h"

#include <GL/gl.h>
#include <vtkCamera.h>
#include <vtkOpenGLFramebufferObject.h>
#include <vtkOpenGLQuadHelper.h>
#include <vtkOpenGLRenderWindow.h>
#include <vtkOpenGLShaderCache.h>
#include <vtkOpenGLState.h>
#include <vtkRenderState.h>
#include <vtkRenderer.h>
#include <vtkShaderProgram.h>
#include <vtkTextureObject.h>

namespace trigpoint {

namespace {

// A pixel one per cent of its distance behind all its neighbours loses a quarter of its brightness.
constexpr const char* kShade = R"(//VTK::System::Dec
in vec2 texCoord;
uniform sampler2D colour, depth;
uniform vec2 pixel;       // its size in texture coordinates
uniform vec2 planes;      // near and far, metres
uniform int parallel;     // projection
//VTK::Output::Dec
float Distance(vec2 at) {
  float z = texture2D(depth, at).r;
  if (parallel != 0) return mix(planes.x, planes.y, z);
  return planes.x * planes.y / (planes.y - z * (planes.y - planes.x));
}
void main() {
  vec4 own = texture2D(colour, texCoord);
  float z = texture2D(depth, texCoord).r;
  float before = 0.0;
  if (z < 1.0) {
    float here = log(Distance(texCoord));
    for (int i = 0; i < 8; ++i) {
      float angle = 0.785398 * float(i);
      before += max(0.0, here - log(Distance(texCoord + 1.5 * pixel * vec2(cos(angle), sin(angle)))));
    }
  }
  gl_FragData[0] = vec4(own.rgb * max(0.5, exp(-3.6 * before)), own.a);
  gl_FragDepth = z;
}
)";

}  // namespace

DepthShading* DepthShading::New() {
  auto* pass = new DepthShading;
  pass->InitializeObjectBase();
  return pass;
}

DepthShading::DepthShading() = default;
DepthShading::~DepthShading() = default;

void DepthShading::MakeTargets(vtkOpenGLRenderWindow* window) {
  if (!target_) {
    target_ = vtkSmartPointer<vtkOpenGLFramebufferObject>::New();
    target_->SetContext(window);
    colour_ = vtkSmartPointer<vtkTextureObject>::New();
    colour_->SetContext(window);
    depth_ = vtkSmartPointer<vtkTextureObject>::New();
    depth_->SetContext(window);
    depth_->SetWrapS(vtkTextureObject::ClampToEdge);  // what lies at the other edge is no neighbour
    depth_->SetWrapT(vtkTextureObject::ClampToEdge);
    quad_ = std::make_unique<vtkOpenGLQuadHelper>(window, nullptr, kShade, "");
  }
  const auto width = static_cast<unsigned>(W), height = static_cast<unsigned>(H);
  if (colour_->GetWidth() == width && colour_->GetHeight() == height) return;
  colour_->Create2D(width, height, 4, VTK_UNSIGNED_CHAR, false);
  depth_->AllocateDepth(width, height, vtkTextureObject::Float32);
}

void DepthShading::Render(const vtkRenderState* state) {
  NumberOfRenderedProps = 0;
  ReadWindowSize(state);
  ExtraPixels = 0;
  W = Width, H = Height;
  vtkRenderer* renderer = state->GetRenderer();
  auto* window = vtkOpenGLRenderWindow::SafeDownCast(renderer->GetRenderWindow());
  MakeTargets(window);
  vtkOpenGLState* gl = window->GetState();
  gl->PushFramebufferBindings();
  RenderDelegate(state, Width, Height, W, H, target_, colour_, depth_);
  gl->PopFramebufferBindings();

  vtkOpenGLState::ScopedglViewport viewport(gl);
  vtkOpenGLState::ScopedglEnableDisable blend(gl, GL_BLEND), test(gl, GL_DEPTH_TEST);
  vtkOpenGLState::ScopedglDepthFunc compare(gl);
  vtkOpenGLState::ScopedglDepthMask written(gl);
  gl->vtkglViewport(Origin[0], Origin[1], Width, Height);
  gl->vtkglScissor(Origin[0], Origin[1], Width, Height);
  gl->vtkglDisable(GL_BLEND);
  gl->vtkglEnable(GL_DEPTH_TEST);
  gl->vtkglDepthMask(GL_TRUE);
  gl->vtkglDepthFunc(GL_ALWAYS);  // depths are written for what is drawn later
  window->GetShaderCache()->ReadyShaderProgram(quad_->Program);
  colour_->Activate();
  depth_->Activate();
  vtkShaderProgram* program = quad_->Program;
  const float pixel[2] = {1.0F / static_cast<float>(W), 1.0F / static_cast<float>(H)};
  const double* range = renderer->GetActiveCamera()->GetClippingRange();
  const float planes[2] = {static_cast<float>(range[0]), static_cast<float>(range[1])};
  program->SetUniformi("colour", colour_->GetTextureUnit());
  program->SetUniformi("depth", depth_->GetTextureUnit());
  program->SetUniform2f("pixel", pixel);
  program->SetUniform2f("planes", planes);
  program->SetUniformi("parallel", renderer->GetActiveCamera()->GetParallelProjection());
  quad_->Render();
  depth_->Deactivate();
  colour_->Deactivate();
  NumberOfRenderedProps = DelegatePass != nullptr ? DelegatePass->GetNumberOfRenderedProps() : 0;
}

void DepthShading::ReleaseGraphicsResources(vtkWindow* window) {
  if (quad_) quad_->ReleaseGraphicsResources(window);
  quad_.reset();
  target_ = nullptr;
  colour_ = nullptr;
  depth_ = nullptr;
  vtkDepthImageProcessingPass::ReleaseGraphicsResources(window);
}

}  // namespace trigpoint

#include "experiments/io/load.hpp"

#include <algorithm>
#include <cmath>

#include "experiments/io/bytes.hpp"
#include "experiments/io/obj.hpp"
#include "experiments/io/pc2.hpp"
#include "experiments/io/validate.hpp"

namespace kbvh::io {
namespace {

namespace fs = std::filesystem;

std::string lower_extension(const fs::path& file) {
  std::string text = file.extension().string();
  std::transform(text.begin(), text.end(), text.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return text;
}

}  // namespace

AnimatedMesh load_animated_mesh(const LoadRequest& request) {
  const double fps = request.frames_per_second;
  if (!std::isfinite(fps) || fps < 0) fail(request.mesh, "", "frames per second is " + text_of(fps));
  const std::string extension = lower_extension(request.mesh);
  if (extension != ".obj") fail(request.mesh, "", "has the unknown extension " + printable(extension));
  AnimatedMesh mesh = read_obj(request.mesh);
  if (!request.motion.empty()) {
    read_pc2(mesh, request.mesh, request.motion, fps);
    finish(mesh, request.motion);
  } else {
    finish(mesh, request.mesh);
  }
  return mesh;
}

}  // namespace kbvh::io

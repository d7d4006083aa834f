#include "experiments/io/load.hpp"

#include <cmath>

#include "experiments/io/bytes.hpp"
#include "experiments/io/frames.hpp"
#include "experiments/io/gltf.hpp"
#include "experiments/io/pc2.hpp"
#include "experiments/io/validate.hpp"
#include "experiments/io/weld.hpp"

namespace kbvh::io {
namespace {

void join_seams(AnimatedMesh& mesh, const std::vector<double>& rest, LoadRequest::Seams seams) {
  if (seams == LoadRequest::Seams::weld) {
    mesh.welded_vertices = weld(mesh, rest);
  } else if (const std::size_t copies = copies_at_seams(mesh, rest); copies > 0) {
    mesh.notes.push_back(std::to_string(copies) +
                         " of its vertices have the positions of another one at every keyframe, but are not "
                         "welded: faces on the two sides of a seam share no vertex");
  }
}

}  // namespace

AnimatedMesh load_animated_mesh(const LoadRequest& request) {
  const double fps = request.frames_per_second;
  if (!std::isfinite(fps) || fps < 0) fail(request.mesh, "", "frames per second is " + text_of(fps));
  const std::string extension = lower_extension(request.mesh);
  std::error_code error;
  if (!std::filesystem::exists(request.mesh, error)) fail(request.mesh, "", "no such file or folder");
  const bool is_folder = std::filesystem::is_directory(request.mesh, error);
  const bool is_mesh = !is_folder && (extension == ".obj" || extension == ".ply");
  const bool is_gltf = !is_folder && (extension == ".gltf" || extension == ".glb");
  if (!is_folder && !is_mesh && !is_gltf) {
    fail(
        request.mesh, "",
        "has the extension " + printable(extension) + ", not .obj, .ply, .gltf or .glb, and is not a folder");
  }
  if (!request.motion.empty() && !is_mesh) {
    fail(request.motion, "",
         "a point cache goes with an .obj or .ply file, not with " + request.mesh.string());
  }
  if (!request.clip.empty() && !is_gltf) {
    fail(request.mesh, "", "a clip (" + printable(request.clip) + ") can be chosen in glTF files only");
  }
  std::vector<double> rest;  // the mesh file's own positions, where its keyframes come from another file
  AnimatedMesh mesh = is_folder ? read_frames(request.mesh, fps)
                      : is_gltf ? read_gltf(request.mesh, request.clip)
                                : read_mesh_file(request.mesh);
  if (!request.motion.empty()) {
    if (lower_extension(request.motion) != ".pc2") {
      fail(request.motion, "",
           "has the extension " + printable(lower_extension(request.motion)) + ", not .pc2");
    }
    rest = mesh.positions;
    read_pc2(mesh, request.mesh, request.motion, fps);
  }
  finish(mesh, request.motion.empty() ? request.mesh : request.motion);
  // A point is a primitive of its own, whether or not another one is at the same place.
  if (!is_gltf && mesh.kind != MeshKind::points) join_seams(mesh, rest, request.seams);
  return mesh;
}

}  // namespace kbvh::io

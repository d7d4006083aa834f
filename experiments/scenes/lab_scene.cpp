#include "experiments/scenes/lab_scene.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

json lab_body(const io::AnimatedMesh& mesh) {
  const char* const shapes[] = {"polygons", "points", "control_nets"};
  json body{{"name", mesh.name},
            {"shape", shapes[std::size_t(mesh.kind)]},
            {"vertices", mesh.vertex_count},
            {"indices", mesh.primitive_vertices},
            {"times", mesh.keyframe_times}};
  bool triangles = mesh.kind == io::MeshKind::polygons;
  for (std::size_t p = 0; p < mesh.primitive_count(); ++p)
    triangles &= mesh.primitive_offsets[p + 1] - mesh.primitive_offsets[p] == 3;
  if (!triangles) body["offsets"] = mesh.primitive_offsets;
  json& keyframes = body["positions"] = json::array();
  const std::size_t size = std::size_t(3) * mesh.vertex_count;
  for (std::size_t k = 0; k < mesh.keyframe_times.size(); ++k) {
    const auto begin = mesh.positions.begin() + std::ptrdiff_t(k * size);
    keyframes.push_back(std::vector<double>(begin, begin + std::ptrdiff_t(size)));
  }
  return body;
}

}  // namespace

json lab_scene(const LoadedScene& scene, std::uint32_t frames_per_keyframe) {
  json bodies = json::array(), pairs = json::array();
  for (std::size_t a = 0; a < scene.meshes.size(); ++a) {
    bodies.push_back(lab_body(scene.meshes[a]));
    if (a < scene.self.size() && scene.self[a]) pairs.push_back({a, a});
    for (std::size_t b = a + 1; b < scene.meshes.size(); ++b) pairs.push_back({a, b});
  }
  return {{"format", "kbvh-scene"},
          {"version", 1},
          {"name", scene.name},
          {"dimension", 3},
          {"bodies", bodies},
          {"pairs", pairs},
          {"frames", {{"l", frames_per_keyframe}}}};
}

}  // namespace kbvh::experiments

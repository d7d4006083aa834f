#include <algorithm>
#include <stdexcept>
#include <utility>

#include "core/motion/admissible.hpp"
#include "core/scene/cut_polygons.hpp"
#include "core/scene/with_radius.hpp"
#include "core/topology/renumber.hpp"
#include "experiments/scenes/scene_spec.hpp"

namespace kbvh::experiments {

namespace {
PrimitiveKind kind_of(io::MeshKind kind) {
  switch (kind) {
    case io::MeshKind::points:
      return PrimitiveKind::points;
    case io::MeshKind::control_nets:
      return PrimitiveKind::control_nets;
    case io::MeshKind::polygons:
      break;
  }
  return PrimitiveKind::polygons;
}

void check_corners(const io::AnimatedMesh& mesh, const std::string& source) {
  for (std::size_t p = 0; p < mesh.primitive_count(); ++p) {
    const std::uint32_t corners = mesh.primitive_offsets[p + 1] - mesh.primitive_offsets[p];
    if (corners <= most_corners) continue;
    throw io::InputError(source + ": polygon " + std::to_string(p) + " has " + std::to_string(corners) +
                         " corners; at most " + std::to_string(most_corners) +
                         " are possible, as=triangles cuts it into triangles");
  }
}
}  // namespace

template <class S>
Scene<S> assemble_meshes(const LoadedScene& loaded) {
  Scene<S> scene;
  scene.name = loaded.name;
  for (std::uint32_t i = 0; i < loaded.meshes.size(); ++i) {
    const io::AnimatedMesh& mesh = loaded.meshes[i];
    check_corners(mesh, loaded.sources[i]);
    Primitives primitives;
    primitives.kind = kind_of(mesh.kind);
    primitives.offsets = mesh.primitive_offsets;
    primitives.vertices = mesh.primitive_vertices;
    if (!loaded.vertices_of.empty() && loaded.vertices_of[i] != i) {
      add_body_over(scene, loaded.vertices_of[i], mesh.name, std::move(primitives));
      continue;
    }
    Body<S> body;
    body.name = mesh.name;
    body.primitives = std::move(primitives);
    std::vector<SegmentBends<S>> bends;
    for (const io::AnimatedMesh::Bends& segment : mesh.bends)
      bends.push_back(
          {{segment.bend.begin(), segment.bend.end()}, {segment.twist.begin(), segment.twist.end()}});
    try {
      body.plans =
          FlightPlans<S>(mesh.vertex_count, mesh.keyframe_times,
                         std::vector<S>(mesh.positions.begin(), mesh.positions.end()), std::move(bends));
    } catch (const std::invalid_argument& problem) {
      throw io::InputError(loaded.sources[i] + ": body '" + mesh.name + "' as " +
                           (sizeof(S) == 4 ? "float" : "double") + ": " + problem.what());
    }
    scene.bodies.push_back(std::move(body));
  }
  scene.pairs = loaded.pairs ? *loaded.pairs : all_pairs(scene.bodies);
  const auto listed = [&](std::uint32_t body) {
    return loaded.pairs &&
           std::any_of(loaded.pairs->begin(), loaded.pairs->end(),
                       [body](const BodyPair& pair) { return pair.first == body && pair.second == body; });
  };
  for (std::uint32_t i = 0; i < loaded.self.size(); ++i)
    if (loaded.self[i] && !listed(i)) scene.pairs.push_back({i, i});
  validate(scene);
  cut_polygons(scene);
  if (loaded.order == VertexOrder::renumbered)
    scene = std::move(renumber_in_leaf_order(scene, BuilderConfig{}).scene);
  return scene;
}

template <class S>
Scene<S> assemble(const LoadedScene& loaded) {
  Scene<S> scene = assemble_meshes<S>(loaded);
  if (!loaded.radius) return scene;
  try {
    return with_radius(scene, *loaded.radius);
  } catch (const std::invalid_argument& problem) {
    throw io::InputError(loaded.name + ": " + problem.what());
  }
}

template Scene<float> assemble_meshes(const LoadedScene&);
template Scene<double> assemble_meshes(const LoadedScene&);
template Scene<float> assemble(const LoadedScene&);
template Scene<double> assemble(const LoadedScene&);

}  // namespace kbvh::experiments

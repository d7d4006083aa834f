#include <pybind11/stl.h>

#include "arrays.hpp"
#include "core/scene/scene.hpp"
#include "experiments/scenes/scene_spec.hpp"
#include "experiments/scenes/scripted.hpp"
#include "experiments/scenes/shape_bodies.hpp"

namespace kbvh::python {

namespace {

using namespace experiments;

const char* word(io::MeshKind kind) {
  return kind == io::MeshKind::polygons ? "polygons"
         : kind == io::MeshKind::points ? "points"
                                        : "control_nets";
}

/// Returns one coefficient of the curves of all segments, [segment][vertex][3]; None where all are zero.
py::object coefficients_of(const io::AnimatedMesh& mesh, std::vector<double> io::AnimatedMesh::Bends::*list) {
  const std::size_t scalars = std::size_t(3) * mesh.vertex_count;
  std::vector<double> all;
  bool any = false;
  for (const io::AnimatedMesh::Bends& segment : mesh.bends) {
    const std::vector<double>& values = segment.*list;
    any = any || !values.empty();
    all.insert(all.end(), values.begin(), values.end());
    all.insert(all.end(), values.empty() ? scalars : 0, 0.0);
  }
  if (!any) return py::none();
  return numbers_of(std::move(all),
                    {py::ssize_t(mesh.bends.size()), py::ssize_t(mesh.vertex_count), py::ssize_t(3)});
}

/// Hands the arrays of a mesh to numpy, without a copy but for its curves. A body over the vertices of
/// another one has the number of that body in place of positions.
py::dict body_of(LoadedScene& loaded, std::uint32_t body) {
  py::dict out;
  io::AnimatedMesh& mesh = loaded.meshes[body];
  const bool self = body < loaded.self.size() && loaded.self[body];
  const auto keyframes = py::ssize_t(mesh.keyframe_times.size()), vertices = py::ssize_t(mesh.vertex_count);
  out["name"] = mesh.name;
  out["shape"] = word(mesh.kind);
  const auto indices = py::ssize_t(mesh.primitive_vertices.size()),
             offsets = py::ssize_t(mesh.primitive_offsets.size());
  out["indices"] = numbers_of(std::move(mesh.primitive_vertices), {indices});
  out["offsets"] = numbers_of(std::move(mesh.primitive_offsets), {offsets});
  out["self_pairs"] = self;
  if (body < loaded.vertices_of.size() && loaded.vertices_of[body] != body) {
    out["over"] = loaded.vertices_of[body];
    return out;
  }
  out["bends"] = coefficients_of(mesh, &io::AnimatedMesh::Bends::bend);
  out["twists"] = coefficients_of(mesh, &io::AnimatedMesh::Bends::twist);
  out["times"] = numbers_of(std::move(mesh.keyframe_times), {keyframes});
  out["positions"] = numbers_of(std::move(mesh.positions), {keyframes, vertices, 3});
  return out;
}

/// The plan changes of a scene: (time, body, vertices, times, positions, velocities) for each step and body,
/// in order; new plans with different knots are entries of their own.
template <class S>
py::list changes_of(const PlanScript<S>& script) {
  py::list out;
  for (const auto& step : script.steps) {
    for (std::size_t begin = 0, end = 0; begin < step.changes.size(); begin = end) {
      const PlanChange<S>& first = step.changes[begin];
      while (end < step.changes.size() && step.changes[end].body == first.body &&
             step.changes[end].times == first.times)
        ++end;
      const std::size_t knots = first.times.size(), count = end - begin;
      std::vector<std::uint32_t> vertices;
      std::vector<double> positions, velocities;
      for (std::size_t i = begin; i < end; ++i) {
        vertices.push_back(step.changes[i].vertex);
        positions.insert(positions.end(), step.changes[i].positions.begin(), step.changes[i].positions.end());
        velocities.insert(velocities.end(), step.changes[i].velocity, step.changes[i].velocity + 3);
      }
      std::vector<double> times = first.times;
      out.append(py::make_tuple(step.time, first.body, numbers_of(std::move(vertices), {py::ssize_t(count)}),
                                numbers_of(std::move(times), {py::ssize_t(knots)}),
                                numbers_of(std::move(positions), {py::ssize_t(count), py::ssize_t(knots), 3}),
                                numbers_of(std::move(velocities), {py::ssize_t(count), 3})));
    }
  }
  return out;
}

template <class S>
py::tuple played(const LoadedScene& loaded, std::uint32_t per_keyframe) {
  PlanScript<S> script;
  std::vector<double> frames;
  {
    const Unlocked unlocked;
    const Scene<S> scene = assemble<S>(loaded);
    script = script_of(scene, loaded, [](const std::string&, double) { Interruptible::check(); });
    frames = frames_of(scene, loaded, script, per_keyframe);
  }
  const auto count = py::ssize_t(frames.size());
  return py::make_tuple(numbers_of(std::move(frames), {count}), changes_of(script));
}

/// Makes the scene that a plan describes: name, seed, notes and bodies. With a precision, also its frames, l
/// per interval, and its changes of plans in this precision.
py::dict make_scene(const std::string& description, const std::string& folder, const std::string& precision,
                    Whole per_keyframe) {
  const auto parsed = nlohmann::json::parse(description);
  LoadedScene loaded;
  {
    const Unlocked unlocked;
    const std::vector<SceneSpec> specs = read_scenes(parsed, "scene", folder);
    if (specs.size() != 1)
      throw io::InputError("scene: describes " + std::to_string(specs.size()) +
                           " scenes; lists of triangles, seed and order are for plans");
    if (specs[0].order == VertexOrder::renumbered)
      throw io::InputError("scene: order: renumbered depends on the precision, so it is for plans");
    loaded = load(specs[0], [](const std::string&, double) { Interruptible::check(); });
  }
  py::dict out;
  out["name"] = loaded.name;
  out["seed"] = loaded.seed;
  out["notes"] = loaded.notes;
  if (!precision.empty()) {
    if (per_keyframe == 0) throw std::invalid_argument("0 frames per keyframe interval");
    out["played"] =
        precision == "float32" ? played<float>(loaded, per_keyframe) : played<double>(loaded, per_keyframe);
    return out;
  }
  out["changes"] = loaded.reversal.has_value() || loaded.drag.has_value() || loaded.script.has_value();
  py::list bodies;
  for (std::uint32_t i = 0; i < loaded.meshes.size(); ++i) bodies.append(body_of(loaded, i));
  out["bodies"] = bodies;
  out["radius"] = loaded.radius ? py::object(py::float_(*loaded.radius)) : py::object(py::none());
  out["pairs"] = py::none();
  if (loaded.pairs) {
    py::list pairs;
    for (const BodyPair& pair : *loaded.pairs) pairs.append(py::make_tuple(pair.first, pair.second));
    out["pairs"] = pairs;
  }
  return out;
}

}  // namespace

void bind_scenes(py::module_& module) {
  using py::arg;
  module.def("make_scene", &make_scene, arg("description"), arg("folder"), arg("precision"),
             arg("per_keyframe"));
  module.def(
      "body_description", [](const std::string& text) { return body_from_text(text).dump(); }, arg("text"));
  module.def("builtin_scenes", [] {
    py::dict out;
    for (const BuiltinScene& scene : builtin_scenes()) out[py::str(scene.name)] = scene.meaning;
    return out;
  });
  module.def("shapes", [] {
    py::dict out;
    for (const ShapeKind& shape : shape_kinds()) out[py::str(shape.name)] = shape.meaning;
    return out;
  });
}

}  // namespace kbvh::python

#include "experiments/theory/theory_scenes.hpp"

#include <algorithm>
#include <filesystem>

#include "core/scene/cut_polygons.hpp"
#include "experiments/common/environment.hpp"
#include "experiments/io/load.hpp"
#include "experiments/scenes/scene_spec.hpp"
#include "experiments/scenes/shapes.hpp"

namespace kbvh::theory {

namespace {

Scene<float> only_moving(Scene<float> scene) {
  std::erase_if(scene.bodies, [](const Body<float>& body) { return !body.plans.moving(); });
  scene.pairs = all_pairs(scene.bodies);
  return scene;
}

Scene<float> scene_of(const io::AnimatedMesh& mesh) {
  experiments::LoadedScene loaded;
  loaded.name = mesh.name;
  loaded.meshes = {mesh};
  loaded.sources = {mesh.name};
  return experiments::assemble<float>(loaded);
}

experiments::SceneSpec builtin_spec(const std::string& family, std::uint32_t triangles,
                                    std::uint32_t keyframes) {
  experiments::SceneSpec spec;
  spec.builtin = spec.name = family;
  spec.options.triangles = triangles;
  spec.options.keyframes = keyframes;
  return spec;
}

io::AnimatedMesh sphere(std::uint32_t triangles) {
  // Multiples of 2^-12: steps of 2^-6 stay on the lattice, and within float's 24 bits, below 2^12.
  return scenes::snapped(scenes::icosphere(triangles, {0, 0, 0}, 1.0), 12);
}

}  // namespace

Scene<float> moving_scene(const std::string& family, std::uint32_t triangles, std::uint32_t keyframes) {
  experiments::SceneSpec spec = builtin_spec(family, triangles, keyframes);
  // Bodies at rest are left out, so they get as few triangles as possible; except for clouds, which come in
  // pairs.
  if (family != "random_soups" && family != "passing_spheres") spec.options.obstacle_triangles = 20;
  // The cloth's motion depends on its table, which keeps its usual number of triangles.
  if (family == "tablecloth") spec.options.obstacle_triangles = 0;
  return only_moving(experiments::assemble<float>(experiments::load(spec)));
}

Scene<float> colliding_scene(const std::string& family, std::uint32_t triangles, std::uint32_t keyframes) {
  experiments::SceneSpec spec = builtin_spec(family, triangles, keyframes);
  spec.options.obstacle_triangles = triangles;
  return experiments::assemble<float>(experiments::load(spec));
}

std::optional<Scene<float>> data_scene(const std::string& name, std::size_t keyframes) {
  const auto folder = experiments::data_folder() / "sequences" / name;
  std::error_code error;
  if (!std::filesystem::exists(folder / "mesh.obj", error)) return {};
  io::AnimatedMesh mesh = io::load_animated_mesh({folder / "mesh.obj", folder / "motion.pc2", "", 30});
  if (keyframes > 0 && keyframes < mesh.keyframe_times.size()) {
    mesh.keyframe_times.resize(keyframes);
    mesh.positions.resize(std::size_t(3) * keyframes * mesh.vertex_count);
  }
  Scene<float> scene = scene_of(mesh);
  scene.name = name;
  return scene;
}

Scene<float> tangents_scene(std::uint32_t vertices) {
  // The tangent of x = c s^2 at s = a, over s from 0 to 1, goes from -c a^2 to c (2 a - a^2). With a = i / 16
  // and c = 256 that is from -i^2 to 32 i - i^2: whole numbers. It is the highest tangent for s around a.
  const float scale = 32.0f;
  std::vector<float> positions;
  for (int k = 0; k < 2; ++k)
    for (std::uint32_t i = 0; i < vertices; ++i) {
      const float tangent = float(i);
      positions.push_back(float(k) * scale * tangent - tangent * tangent);
      positions.push_back(0.5f * tangent);
      positions.push_back(0);
    }
  Scene<float> scene;
  scene.name = "tangents";
  Body<float> body;
  body.name = "polygon";
  std::vector<std::uint32_t> corners(vertices);
  for (std::uint32_t i = 0; i < vertices; ++i) corners[i] = i;
  body.primitives.add(corners);
  body.plans = FlightPlans<float>(vertices, {0.0, 1.0}, std::move(positions));
  scene.bodies.push_back(std::move(body));
  validate(scene);
  cut_polygons(scene);
  return scene;
}

namespace {
/// Makes one control net, whose vertices move on these curves along x.
Scene<float> net_of_curves(const std::string& name, const std::vector<CurvedPiece<float>>& curves) {
  const std::size_t n = curves.size();
  std::vector<std::uint32_t> corners(n);
  std::vector<float> positions(6 * n, 0.0f);
  SegmentBends<float> bends{std::vector<float>(3 * n, 0.0f), std::vector<float>(3 * n, 0.0f)};
  for (std::size_t v = 0; v < n; ++v) {
    corners[v] = std::uint32_t(v);
    positions[3 * v] = curves[v].x0;
    positions[3 * (n + v)] = curves[v].x1;
    bends.bend[3 * v] = curves[v].bend;
    bends.twist[3 * v] = curves[v].twist;
  }
  if (std::all_of(bends.twist.begin(), bends.twist.end(), [](float x) { return x == 0; }))
    bends.twist.clear();
  Body<float> body;
  body.name = name;
  body.primitives.kind = PrimitiveKind::control_nets;
  body.primitives.add(corners);
  body.plans = FlightPlans<float>(std::uint32_t(n), {0.0, 1.0}, std::move(positions), {std::move(bends)});
  Scene<float> scene;
  scene.name = name;
  scene.bodies.push_back(std::move(body));
  validate(scene);
  return scene;
}
}  // namespace

Scene<float> parabolas_scene(std::uint32_t vertices) {
  // Narrow parabolas height - (s - top)^2 rise above the line x = 0 one after the other: 0 1 0 2 0 ... 0.
  std::vector<CurvedPiece<float>> curves(1);
  const double gaps = vertices - 1, height = 0.09 / (gaps * gaps);
  for (std::uint32_t v = 1; v < vertices; ++v) {
    const double top = (v - 0.5) / gaps;
    curves.push_back({0, 1, float(height - top * top), float(height - (1 - top) * (1 - top)), 1, 0});
  }
  return net_of_curves("parabolas", curves);
}

Scene<float> cubics_scene(std::uint32_t vertices) {
  // Cubics k ((s - a)^2 - w^2) (s - z) rise above the line x = 0 for a short time around s = a, one after the
  // other, and for good at s = z, each steeper than those before: 0 1 0 2 0 ... 0 1 2 3 ...
  std::vector<CurvedPiece<float>> curves(1);
  const double last = std::max<std::uint32_t>(vertices - 1, 2) - 1;
  double k = 1;
  for (std::uint32_t v = 1; v < vertices; ++v, k *= 8) {
    const double a = 0.08 + 0.36 * (v - 1) / last, w = std::min(0.05, 0.1 / last),
                 z = 0.6 + 0.2 * (v - 1) / last;
    // In powers of s.
    const double c0 = -k * z * (a * a - w * w), c1 = k * (2 * a * z + a * a - w * w), c2 = -k * (z + 2 * a);
    curves.push_back({0, 1, float(c0), float(c0 + c1 + c2 + k), float(-k - c2), float(-k)});
  }
  return net_of_curves("cubics", curves);
}

Scene<float> fan_scene(std::uint32_t triangles) {
  Scene<float> scene;
  scene.name = "fan";
  Body<float> body;
  body.name = "fan";
  std::vector<float> positions{0, 0, 0};
  for (std::uint32_t i = 0; i <= triangles; ++i) {
    const double turns = double(i) / double(triangles + 1);
    positions.push_back(float(scenes::cosine_of_turns(turns)));
    positions.push_back(float(scenes::sine_of_turns(turns)));
    positions.push_back(0);
    if (i < triangles) body.primitives.add(std::vector<std::uint32_t>{0, i + 1, i + 2});
  }
  std::vector<float> twice = positions;
  twice.insert(twice.end(), positions.begin(), positions.end());
  body.plans = FlightPlans<float>(triangles + 2, {0.0, 1.0}, std::move(twice));
  scene.bodies.push_back(std::move(body));
  validate(scene);
  return scene;
}

Scene<float> wandering_points(std::uint32_t count, std::size_t axes) {
  const scenes::SeededNoise noise(count);
  std::uint64_t index = 0;
  Body<float> body;
  body.name = "points";
  body.primitives.kind = PrimitiveKind::points;
  for (std::uint32_t p = 0; p < count; ++p) body.primitives.add(std::vector<std::uint32_t>{p});
  std::vector<float> positions;
  for (int keyframe = 0; keyframe < 4; ++keyframe)
    for (std::uint32_t p = 0; p < count; ++p)
      for (std::size_t axis = 0; axis < 3; ++axis)
        positions.push_back(axis < axes ? float(noise.signed_unit(index++)) : 0.0f);
  body.plans = FlightPlans<float>(count, {0, 1, 2, 3}, std::move(positions));
  Scene<float> scene;
  scene.name = "wandering points";
  scene.bodies.push_back(std::move(body));
  return scene;
}

namespace {
Translation translation(const io::AnimatedMesh& start, const std::array<double, 3>& from,
                        const std::array<double, 3>& step, std::uint32_t keyframes, const std::string& name) {
  Translation result;
  io::AnimatedMesh mesh = start;
  mesh.name = name;
  mesh.keyframe_times = scenes::keyframe_times(keyframes, 30.0);
  mesh.positions.clear();
  for (std::uint32_t k = 0; k < keyframes; ++k)
    for (std::size_t i = 0; i < std::size_t(3) * mesh.vertex_count; ++i) {
      // Exact in double: few bits, and a step that is a multiple of 2^-20.
      const double exact = start.positions[i] + from[i % 3] + double(k) * step[i % 3];
      const double stored = scenes::rounded_to_float(exact);
      result.rounded += stored != exact;
      mesh.positions.push_back(stored);
    }
  result.scene = scene_of(mesh);
  return result;
}
}  // namespace

Translation near_translation(std::uint32_t triangles, std::uint32_t keyframes) {
  return translation(sphere(triangles), {0, 0, 0}, {0.015625, 0.03125, -0.046875}, keyframes,
                     "translation near the origin");
}

Translation far_translation(std::uint32_t triangles, std::uint32_t keyframes) {
  // Float's spacing at 1e6 is 2^-4; the steps are multiples of 2^-12 only.
  const double unit = 0x1p-12;
  return translation(sphere(triangles), {1e6, 1e6, -1e6}, {101 * unit, 57 * unit, -83 * unit}, keyframes,
                     "translation at 1e6");
}

PlanScript<float> velocity_script(const Scene<float>& scene, std::uint32_t frames_per_keyframe,
                                  std::uint32_t changed) {
  const scenes::SeededNoise noise(2006);
  std::uint64_t index = 0;
  PlanScript<float> script;
  const std::vector<double> frames = frame_times(scene, frames_per_keyframe);
  const std::vector<double> keyframes = overlaid_keyframes(scene);
  for (std::size_t f = 1; f + 1 < frames.size(); ++f) {
    const auto after = std::upper_bound(keyframes.begin(), keyframes.end(), frames[f]);
    const std::size_t k = std::size_t(after - keyframes.begin()) - 1;
    const bool at_keyframe = keyframes[k] == frames[f];
    const std::size_t half = frames_per_keyframe / 2;
    const bool in_the_middle = !at_keyframe && f >= half && frames[f - half] == keyframes[k];
    if (!(at_keyframe && k % 4 == 2) && !(in_the_middle && k % 4 == 0)) continue;
    PlanScript<float>::Step step{frames[f], {}};
    std::vector<std::vector<bool>> taken;
    for (const auto& body : scene.bodies) taken.emplace_back(body.plans.vertex_count(), false);
    for (std::uint32_t i = 0; i < changed; ++i) {
      PlanChange<float> change;
      change.body = std::uint32_t(noise.bits(index++) % scene.bodies.size());
      change.vertex = std::uint32_t(noise.bits(index++) % scene.bodies[change.body].plans.vertex_count());
      for (float& v : change.velocity) v = float(0.25 * noise.signed_unit(index++));
      if (taken[change.body][change.vertex]) continue;
      taken[change.body][change.vertex] = true;
      step.changes.push_back(change);
    }
    script.steps.push_back(std::move(step));
  }
  return script;
}

}  // namespace kbvh::theory

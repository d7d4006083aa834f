#include "experiments/scenes/builtin_scenes.hpp"

#include <algorithm>
#include <system_error>

#include "experiments/common/environment.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/animated_mesh_cache.hpp"
#include "experiments/scenes/ageing.hpp"
#include "experiments/scenes/curves.hpp"
#include "experiments/scenes/garment.hpp"
#include "experiments/scenes/modal.hpp"
#include "experiments/scenes/shapes.hpp"
#include "experiments/scenes/tablecloth.hpp"

namespace kbvh::experiments {

namespace {

using Meshes = std::vector<io::AnimatedMesh>;

/// Reads an earlier simulation from the cache, else calls simulate(progress) and keeps its result. `what`
/// names it in reports of progress.
template <class Config, class Simulate>
Meshes simulated(const Config& config, Simulate simulate, const std::string& what,
                 const MakeProgress& progress) {
  const std::filesystem::path folder = cache_folder();
  const std::filesystem::path file = folder / (scenes::cache_key(config) + ".kbvhmesh");
  std::error_code error;
  if (!folder.empty() && std::filesystem::exists(file, error)) {
    try {
      return io::load_cache(file);
    } catch (const io::InputError& problem) {
      say(std::string("warning: ") + problem.what() + "; the scene is simulated again");
    }
  }
  const auto report = [&](double fraction) {
    if (progress)
      progress("simulating a " + what + " of " + std::to_string(config.triangles) + " triangles", fraction);
  };
  Meshes meshes = simulate(config, report);
  if (!folder.empty()) {
    try {
      io::save_cache(meshes, file);
    } catch (const io::InputError& problem) {
      say(std::string("warning: the simulated scene is not cached: ") + problem.what());
    }
  }
  return meshes;
}

Meshes tablecloth(const BuiltinOptions& options, const MakeProgress& progress) {
  scenes::TableclothConfig config;
  config.triangles = options.triangles;
  if (options.obstacle_triangles > 0) config.table_triangles = options.obstacle_triangles;
  config.seed = options.seed;
  config.keyframes = options.keyframes;
  return simulated(config, scenes::simulate_tablecloth, "tablecloth", progress);
}

// The hand holds a corner of the tablecloth and pulls it over the table, while the cloth falls. Ten frames
// per keyframe, as many as make cloth the easy case in other scenes; plans change at every frame.
DragRule dragged_corner(const BuiltinOptions& options, const Meshes& meshes) {
  constexpr std::uint32_t frames_per_keyframe = 10;
  DragRule rule;
  for (std::size_t d = 0; d < 3; ++d) rule.grip[d] = meshes.at(0).positions.at(d);
  rule.radius = 0.25;
  rule.path = {-0.6 * rule.grip[0], -0.6 * rule.grip[1], 0.15};
  rule.frames_per_second = frames_per_keyframe * scenes::TableclothConfig{}.keyframes_per_second;
  rule.frames = frames_per_keyframe * (options.keyframes - 1) + 1;
  return rule;
}

/// The obstacle has about as many triangles up to 20 000, the size for which the measurements are defined.
std::uint32_t obstacle_triangles(const BuiltinOptions& options) {
  if (options.obstacle_triangles > 0) return options.obstacle_triangles;
  return options.triangles < 20000 ? options.triangles : 20000;
}

Meshes garment(scenes::GarmentKind kind, const char* what, const BuiltinOptions& options,
               const MakeProgress& progress) {
  scenes::GarmentConfig config;
  config.kind = kind;
  config.triangles = options.triangles;
  config.avatar_triangles = obstacle_triangles(options);
  if (options.full_triangles > 0) config.full_triangles = options.full_triangles;
  config.seed = options.seed;
  config.keyframes = options.keyframes;
  return simulated(config, scenes::simulate_garment, what, progress);
}

Meshes shirt(const BuiltinOptions& options, const MakeProgress& progress) {
  return garment(scenes::GarmentKind::shirt, "shirt", options, progress);
}

Meshes dress(const BuiltinOptions& options, const MakeProgress& progress) {
  return garment(scenes::GarmentKind::dress, "dress", options, progress);
}

Meshes waving_sheet(const BuiltinOptions& options, const MakeProgress&) {
  return {scenes::waving_sheet(options.triangles, options.keyframes),
          scenes::icosphere(obstacle_triangles(options), {0.1, -0.05, 0.0}, 0.5)};
}

Meshes expanding_sphere(const BuiltinOptions& options, const MakeProgress&) {
  return {scenes::expanding_sphere(options.triangles, {0, 0, 0}, 0.2, 0.6, options.keyframes),
          scenes::icosphere(obstacle_triangles(options), {0.5, 0.1, -0.05}, 0.4)};
}

// Two spheres grow towards each other, all vertices at 0.1 m/s until a plan changes. Their centres are not
// mirror images with respect to the axes of their triangles, so contacts are in general position.
constexpr std::array<double, 3> left_centre{-0.52, 0.0, 0.0}, right_centre{0.52, 0.013, -0.007};
constexpr double first_radius = 0.5, outward_speed = 0.1;

ReversalRule reversing_rule(const BuiltinOptions& options) {
  return {.centres = {left_centre, right_centre}, .lowest_radius = first_radius, .frames = options.keyframes};
}

Meshes reversing_spheres(const BuiltinOptions& options, const MakeProgress&) {
  // The velocity field holds until it is changed: one segment, whose end no clip of up to 1000 frames
  // reaches.
  const ReversalRule rule = reversing_rule(options);
  const double seconds = double(std::max(1000u, rule.frames)) / rule.frames_per_second;
  const double last_radius = first_radius + outward_speed * seconds;
  const auto sphere = [&](std::uint32_t triangles, const std::array<double, 3>& centre) {
    return scenes::expanding_sphere(triangles, {centre[0], centre[1], centre[2]}, first_radius, last_radius,
                                    2, 1 / seconds);
  };
  return {
      sphere(options.triangles, left_centre),
      sphere(options.obstacle_triangles > 0 ? options.obstacle_triangles : options.triangles, right_centre)};
}

Meshes passing_spheres(const BuiltinOptions& options, const MakeProgress&) {
  const double last = options.keyframes > 1 ? double(options.keyframes - 1) : 1.0;
  const double path = 1.5;
  return {scenes::translated(scenes::icosphere(options.triangles, {-0.5 * path, 0.05, 0.1}, 0.4),
                             {path / last, 0, 0}, options.keyframes),
          scenes::translated(scenes::icosphere(obstacle_triangles(options), {0.5 * path, -0.05, -0.1}, 0.4),
                             {-path / last, 0, 0}, options.keyframes)};
}

Meshes turning_box(const BuiltinOptions& options, const MakeProgress&) {
  return {scenes::rotated(scenes::box(options.triangles, {-0.5, -0.4, -0.3}, {0.5, 0.4, 0.3}), {0, 0, 0},
                          1.0 / 120.0, options.keyframes),
          scenes::icosphere(obstacle_triangles(options), {0.35, 0.2, 0.05}, 0.4)};
}

Meshes random_soups(const BuiltinOptions& options, const MakeProgress&) {
  return {scenes::random_soup(options.triangles, options.seed, options.keyframes),
          scenes::random_soup(obstacle_triangles(options), options.seed + 1, options.keyframes)};
}

scenes::AgeingConfig ageing(const BuiltinOptions& options) {
  return {.triangles = options.triangles, .seed = options.seed, .keyframes = options.keyframes};
}

/// Makes a scene of two moving bodies, by default of the same size.
template <std::pair<io::AnimatedMesh, io::AnimatedMesh> (*make)(const scenes::AgeingConfig&, std::uint32_t)>
Meshes two_alike(const BuiltinOptions& options, const MakeProgress&) {
  auto [first, second] =
      make(ageing(options), options.obstacle_triangles > 0 ? options.obstacle_triangles : options.triangles);
  return {std::move(first), std::move(second)};
}

/// Makes a scene of one body.
template <io::AnimatedMesh (*make)(const scenes::AgeingConfig&)>
Meshes alone(const BuiltinOptions& options, const MakeProgress&) {
  return {make(ageing(options))};
}

Meshes flowing_soup(const BuiltinOptions& options, const MakeProgress&) {
  return {scenes::flowing_soup(ageing(options)),
          scenes::icosphere(obstacle_triangles(options), {0.46, 0.53, 0.51}, 0.2)};
}

scenes::ModalConfig modal(const BuiltinOptions& options) {
  return {.triangles = options.triangles, .seed = options.seed, .keyframes = options.keyframes};
}

Meshes morphing_ball(const BuiltinOptions& options, const MakeProgress&) {
  return {scenes::morphing_ball(modal(options)),
          scenes::icosphere(obstacle_triangles(options), {0.6, 0.25, 0.1}, 0.4)};
}

Meshes vibrating_plate(const BuiltinOptions& options, const MakeProgress&) {
  return {scenes::vibrating_plate(modal(options)),
          scenes::icosphere(obstacle_triangles(options), {0.1, -0.05, 0.0}, 0.5)};
}

Meshes dented_sheet(const BuiltinOptions& options, const MakeProgress&) {
  return {scenes::dented_sheet(modal(options)),
          scenes::icosphere(obstacle_triangles(options), {0.1, -0.05, -0.45}, 0.5)};
}

/// Hides a crowd of spinning balls behind three walls from the camera of coherent rays, which looks from +x,
/// -y, +z; every tenth ball is on the camera's side. Balls and walls share the triangles evenly.
Meshes hidden_crowd(const BuiltinOptions& options, const MakeProgress&) {
  constexpr std::uint32_t across = 6, layers = 3, balls = across * across * layers;
  constexpr double spacing = 0.3, radius = 0.12, thickness = 0.02;
  const double half = 0.5 * spacing * across, height = spacing * layers;
  const std::uint32_t each = std::max(20U, options.triangles / balls);
  const std::uint32_t of_wall =
      options.obstacle_triangles > 0 ? std::max(12U, options.obstacle_triangles / 3) : each;
  Meshes meshes{scenes::box(of_wall, {half, -half, 0}, {half + thickness, half, height}),
                scenes::box(of_wall, {-half, -half - thickness, 0}, {half, -half, height}),
                scenes::box(of_wall, {-half, -half, height}, {half, half, height + thickness})};
  for (std::uint32_t i = 0; i < balls; ++i) {
    const bool outside = i % 10 == 9;
    const scenes::Point centre{-half + spacing * (0.5 + i % across),
                               -half + spacing * (0.5 + i / across % across),
                               spacing * (0.5 + i / across / across) + (outside ? height : 0)};
    meshes.push_back(scenes::rotated(scenes::icosphere(each, centre, radius), centre,
                                     (i % 2 == 0 ? 1 : -1) / 60.0, options.keyframes));
  }
  return meshes;
}

/// Makes a thrown body and a sphere at rest on its way.
template <io::AnimatedMesh (*make)(const scenes::ThrownConfig&)>
Meshes thrown(const BuiltinOptions& options, const MakeProgress&) {
  return {make({.triangles = options.triangles, .seed = options.seed, .keyframes = options.keyframes}),
          scenes::icosphere(obstacle_triangles(options), {0.1, -0.05, 3.2}, 0.5)};
}

Meshes funnel_cloth(const BuiltinOptions& options, const MakeProgress&) {
  return {scenes::funnel_cloth(ageing(options)), scenes::funnel(obstacle_triangles(options))};
}

}  // namespace

const std::vector<BuiltinScene>& builtin_scenes() {
  static const std::vector<BuiltinScene> list{
      {"tablecloth", "a cloth, simulated, falls onto a round table and hangs over its rim", &tablecloth},
      {"shirt", "a walking man and his shirt, simulated", &shirt, nullptr, BodiesOf::several, nullptr,
       ClothLevels::two},
      {"dress", "a walking woman and her dress, simulated", &dress, nullptr, BodiesOf::several, nullptr,
       ClothLevels::two},
      {"waving_sheet", "a sheet in crossing waves cuts a sphere at rest", &waving_sheet},
      {"expanding_sphere", "a growing sphere reaches a sphere at rest", &expanding_sphere},
      {"reversing_spheres",
       "two spheres expand, and vertices of colliding triangles reverse, at 60 frames per second; keyframes: "
       "number of frames",
       &reversing_spheres, &reversing_rule},
      {"dragged_cloth",
       "a tablecloth of which a hand drags one corner over the table, 10 frames per keyframe; plans change "
       "at "
       "every frame",
       &tablecloth, nullptr, BodiesOf::several, &dragged_corner},
      {"passing_spheres", "two rigid spheres pass through each other", &passing_spheres},
      {"turning_box", "a box rotates inside a sphere at rest", &turning_box},
      {"random_soups", "two clouds of separate drifting triangles in the same cube", &random_soups},
      {"mixing_swarms", "two swarms of hundreds of soft bodies fall into each other and mix",
       &two_alike<scenes::mixing_swarms>},
      {"crossing_crowd", "people cross a square in four directions, again and again; pairs within the crowd",
       &alone<scenes::crossing_crowd>, nullptr, BodiesOf::one},
      {"shattering_balls", "two balls collide and burst into their triangles",
       &two_alike<scenes::shattering_balls>},
      {"flowing_soup", "separate triangles drift in a stirred flow, through a sphere at rest", &flowing_soup},
      {"twisted_rod",
       "a rod is twisted until it buckles and winds up into a double helix; pairs within the rod",
       &alone<scenes::twisted_rod>, nullptr, BodiesOf::one},
      {"tightening_knot", "a rope slides out of its knot, which is pulled tight; pairs within the rope",
       &alone<scenes::tightening_knot>, nullptr, BodiesOf::one},
      {"unrolling_yarns", "two balls of yarn roll over a floor and leave their threads there",
       &two_alike<scenes::unrolling_yarns>},
      {"hidden_crowd", "108 balls spin behind three walls, and some before them: what a camera does not see",
       &hidden_crowd},
      {"funnel_cloth", "a cloth is pulled through a funnel and gathers into pleats", &funnel_cloth},
      {"running_figures", "two people run on the spot, 25 keyframes per second: steps as large as triangles",
       &two_alike<scenes::running_figures>},
      {"morphing_ball", "a ball morphs between four shapes and cuts a sphere at rest: three modes",
       &morphing_ball},
      {"vibrating_plate", "a plate vibrates in eight modes and cuts a sphere at rest", &vibrating_plate},
      {"dented_sheet", "a sheet gets dents one after the other and cuts a sphere at rest: few vertices move",
       &dented_sheet},
      {"thrown_cloth", "a cloth is thrown over a sphere at rest, in gusts of wind, for two seconds: cubics",
       &thrown<scenes::thrown_cloth>},
      {"thrown_shards",
       "a ball bursts into its triangles in the air, for two seconds: parabolas, braked by drag",
       &thrown<scenes::thrown_shards>},
  };
  return list;
}

const BuiltinScene& find_builtin_scene(const std::string& name) {
  std::vector<std::string> known;
  for (const BuiltinScene& scene : builtin_scenes()) {
    if (scene.name == name) return scene;
    known.push_back(scene.name);
  }
  throw io::InputError(no_such("built-in scene", name, known));
}

}  // namespace kbvh::experiments

#include "tests/conformance/real_scenes.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "experiments/io/load.hpp"
#include "experiments/scenes/garment.hpp"
#include "experiments/scenes/shapes.hpp"
#include "experiments/scenes/tablecloth.hpp"

namespace kbvh::test {

namespace {

namespace fs = std::filesystem;
using Meshes = std::vector<io::AnimatedMesh>;

const std::vector<std::string> sequences{"diffcloth-tshirt-iter0", "codimipc-Rumba_Dancing",
                                         "mannequiny-run",         "robot-Dance",
                                         "MorphStressTest",        "AnimatedMorphSphere"};
const std::vector<std::string> blender_scenes{"tablecloth-2k", "tablecloth-16k", "dancer-skirt"};
const std::vector<std::string> ageing_scenes{"mixing_swarms",   "crossing_crowd", "shattering_balls",
                                             "flowing_soup",    "twisted_rod",    "tightening_knot",
                                             "unrolling_yarns", "funnel_cloth",   "running_figures"};

io::AnimatedMesh sequence(const std::string& name) {
  const fs::path folder = data_folder() / "sequences" / name;
  io::AnimatedMesh mesh =
      io::load_animated_mesh({.mesh = folder / "mesh.obj", .motion = folder / "motion.pc2"});
  mesh.name = name;
  return mesh;
}

/// All bodies in the folder: every OBJ, with the PC2 next to it if there is one.
Meshes several_bodies(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().extension() == ".obj") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  Meshes meshes;
  for (const fs::path& file : files) {
    fs::path motion = file;
    motion.replace_extension(".pc2");
    meshes.push_back(
        io::load_animated_mesh({.mesh = file, .motion = fs::exists(motion) ? motion : fs::path{}}));
  }
  return meshes;
}

struct Extent {
  double centre[3], radius;
};
Extent extent_at_start(const io::AnimatedMesh& mesh) {
  Box<double> box;
  for (std::size_t v = 0; v < mesh.vertex_count; ++v) box.extend(mesh.positions.data() + 3 * v);
  Extent extent{};
  for (int axis = 0; axis < 3; ++axis) {
    extent.centre[axis] = 0.5 * (box.lower[axis] + box.upper[axis]);
    extent.radius = std::max(extent.radius, 0.5 * (box.upper[axis] - box.lower[axis]));
  }
  return extent;
}

void keep_middle_keyframes(io::AnimatedMesh& mesh, std::size_t count) {
  const std::size_t total = mesh.keyframe_times.size();
  if (count == 0 || total <= count) return;
  const auto first = std::ptrdiff_t((total - count) / 2), last = first + std::ptrdiff_t(count);
  const auto stride = std::ptrdiff_t(3) * mesh.vertex_count;
  mesh.keyframe_times = {mesh.keyframe_times.begin() + first, mesh.keyframe_times.begin() + last};
  mesh.positions = {mesh.positions.begin() + first * stride, mesh.positions.begin() + last * stride};
}

}  // namespace

fs::path data_folder() {
  if (const char* folder = std::getenv("KBVH_DATA")) return folder;
  return fs::path(KBVH_SOURCE_DIR) / "../shared/data";
}

std::vector<RealScene> real_scenes() {
  std::vector<RealScene> scenes{{"tablecloth", false}, {"shirt", false}, {"dress", false}};
  for (const std::string& name : sequences) scenes.push_back({name + "+sphere", true});
  scenes.push_back({"robot-Dance+MorphStressTest", true});
  for (const std::string& name : ageing_scenes) scenes.push_back({name, false});
  for (const std::string& name : blender_scenes) scenes.push_back({"blender:" + name, true});
  return scenes;
}

experiments::LoadedScene load_real_scene(const std::string& name, std::size_t keyframes,
                                         std::size_t most_triangles) {
  experiments::LoadedScene scene;
  scene.name = name;
  if (name == "tablecloth") {
    scenes::TableclothConfig config;
    if (keyframes != 0) config.triangles = 512;
    scene.meshes = scenes::simulate_tablecloth(config);
  } else if (name == "shirt" || name == "dress") {
    scenes::GarmentConfig config;
    config.kind = name == "shirt" ? scenes::GarmentKind::shirt : scenes::GarmentKind::dress;
    config.triangles = keyframes != 0 ? 500 : 2000;
    config.avatar_triangles = keyframes != 0 ? 300 : 1000;
    scene.meshes = scenes::simulate_garment(config);
  } else if (std::find(ageing_scenes.begin(), ageing_scenes.end(), name) != ageing_scenes.end()) {
    experiments::SceneSpec spec;
    spec.builtin = name;
    spec.options.triangles = keyframes != 0 ? 160 : 2000;
    scene = experiments::load(spec);
    scene.sources.clear();
  } else if (name.rfind("blender:", 0) == 0) {
    scene.meshes = several_bodies(data_folder() / "blender" / name.substr(8));
  } else {
    const std::size_t plus = name.find('+');
    scene.meshes.push_back(sequence(name.substr(0, plus)));
    const Extent extent = extent_at_start(scene.meshes[0]);
    if (name.substr(plus + 1) == "sphere") {
      const scenes::Point centre{extent.centre[0], extent.centre[1], extent.centre[2]};
      scene.meshes.push_back(scenes::icosphere(keyframes == 0 ? 1280 : 320, centre, 0.45 * extent.radius));
    } else {
      // The second sequence is moved to the place of the first, and scaled to half its size.
      io::AnimatedMesh other = sequence(name.substr(plus + 1));
      const Extent from = extent_at_start(other);
      experiments::Placement placement;
      placement.scale = 0.5 * extent.radius / from.radius;
      for (int axis = 0; axis < 3; ++axis)
        placement.translate[axis] = extent.centre[axis] - placement.scale * from.centre[axis];
      experiments::place(other, placement);
      scene.meshes.push_back(std::move(other));
    }
  }
  std::size_t triangles = 0;
  for (io::AnimatedMesh& mesh : scene.meshes) {
    triangles += mesh.primitive_count();
    keep_middle_keyframes(mesh, keyframes);
    scene.sources.push_back(name);
  }
  if (most_triangles != 0 && triangles > most_triangles) scene.meshes.clear();
  return scene;
}

}  // namespace kbvh::test

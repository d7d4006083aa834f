#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "experiments/cli/commands.hpp"
#include "experiments/cli/options.hpp"
#include "experiments/cli/program.hpp"
#include "experiments/common/output.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/io/obj.hpp"
#include "experiments/scenes/builtin_scenes.hpp"
#include "experiments/scenes/lab_scene.hpp"
#include "experiments/scenes/scene_card.hpp"

namespace kbvh::experiments {

namespace {

constexpr const char* scene_examples = R"(Examples:
  kbvh scene shirt --triangles 32000
  kbvh scene dress --triangles 8000 --frame 30 --out dress.obj
  kbvh scene dress --triangles 8000 --out folder
  kbvh scene tablecloth --triangles 500 --keyframes 20 --out tablecloth.json
Prints counts and a measure of the motion: the share of the sides of a binary tree (one triangle per leaf) whose
realising vertex changes from one keyframe to the next. A folder gets every body as OBJ, with PC2 if it moves, and
these numbers as card.json; a file ending in .obj gets all bodies at one keyframe, one after the other; a file ending in .json is a scene for the lab. Files
hold keyframes: curves between them are not written.)";

constexpr std::uint32_t lab_frames_per_keyframe = 10;

struct SceneOptions {
  std::string name, out;
  BuiltinOptions scene;
  std::size_t frame = 0;
  bool as_json = false;
};

/// Merges all bodies into one mesh at one keyframe: bodies at rest, and bodies past their end, in their last
/// positions.
io::AnimatedMesh snapshot(const std::vector<io::AnimatedMesh>& bodies, std::size_t frame) {
  io::AnimatedMesh all;
  all.keyframe_times = {0.0};
  for (const io::AnimatedMesh& body : bodies) {
    const std::size_t k = std::min(frame, body.keyframe_times.size() - 1);
    const std::size_t size = std::size_t(3) * body.vertex_count;
    for (const std::uint32_t v : body.primitive_vertices)
      all.primitive_vertices.push_back(all.vertex_count + v);
    const std::uint32_t base = all.primitive_offsets.back();
    for (std::size_t p = 1; p < body.primitive_offsets.size(); ++p)
      all.primitive_offsets.push_back(base + body.primitive_offsets[p]);
    all.positions.insert(all.positions.end(), body.positions.begin() + std::ptrdiff_t(k * size),
                         body.positions.begin() + std::ptrdiff_t((k + 1) * size));
    all.vertex_count += body.vertex_count;
  }
  return all;
}

bool ends_in(const SceneOptions& options, const char* extension) {
  return std::filesystem::path(options.out).extension() == extension;
}

/// Rejects options that change nothing in the scene.
void check_options(const BuiltinScene& scene, const BuiltinOptions& options) {
  if (options.obstacle_triangles > 0 && scene.bodies == BodiesOf::one)
    throw io::InputError("--obstacle: the scene '" + scene.name + "' has one body");
  if (options.full_triangles == 0 || scene.levels == ClothLevels::two) return;
  std::vector<std::string> garments;
  for (const BuiltinScene& other : builtin_scenes())
    if (other.levels == ClothLevels::two) garments.push_back(other.name);
  throw io::InputError("--full-triangles: is for " + joined(garments, " and ") + ", not for '" + scene.name +
                       "'");
}

/// Rejects a --frame that no file would show.
void check_frame(const LoadedScene& scene, const SceneOptions& options) {
  if (options.frame == 0) return;
  if (!ends_in(options, ".obj"))
    throw io::InputError("--frame: goes with --out FILE.obj, which shows one keyframe");
  std::size_t keyframes = 0;
  for (const io::AnimatedMesh& body : scene.meshes)
    keyframes = std::max(keyframes, body.keyframe_times.size());
  if (options.frame >= keyframes)
    throw io::InputError("--frame: " + std::to_string(options.frame) +
                         " is not before the end, the scene has " + counted(keyframes, "keyframe") +
                         ", from 0");
}

void write(const LoadedScene& scene, const SceneOptions& options) {
  const std::filesystem::path out = options.out;
  if (ends_in(options, ".obj"))
    io::save_obj(snapshot(scene.meshes, options.frame), out);
  else if (ends_in(options, ".json"))
    io::write_file_atomically(out, lab_scene(scene, lab_frames_per_keyframe).dump() + "\n");
  else
    export_scene(scene, out, 0);
  if (!ends_in(options, ".obj") &&
      std::any_of(scene.meshes.begin(), scene.meshes.end(),
                  [](const io::AnimatedMesh& mesh) { return !mesh.bends.empty(); }))
    say("note: vertices move on curves between keyframes, which " + io::printable(options.out) +
        " does not hold");
}

void print_cards(const std::vector<BodyCard>& list) {
  for (const BodyCard& c : list) {
    std::string text = fmt::format("{}: {}, {}, {}", c.name, counted(c.primitives, "primitive"),
                                   counted(c.vertices, "vertex"), counted(c.keyframes, "keyframe"));
    if (c.keyframes > 1)
      text += fmt::format(
          " in {:.3g} s\n    {:.2f}% of the sides of {} nodes change their realiser per keyframe (at most "
          "{:.2f}%)\n"
          "    a vertex moves by {:.2f} edges per keyframe (at most {:.2f})",
          c.seconds, 100 * c.sides_changed, c.nodes, 100 * c.most_sides_changed, c.mean_step, c.largest_step);
    print(text + "\n");
  }
}

int show(const SceneOptions& options) {
  const BuiltinScene& builtin = find_builtin_scene(options.name);
  check_options(builtin, options.scene);
  SceneSpec spec;
  spec.builtin = builtin.name;
  spec.options = options.scene;
  Progress line;
  const LoadedScene scene = load(spec, [&](const std::string& what, double fraction) {
    line.show(what + ": " + std::to_string(int(100 * fraction)) + " %");
  });
  line.clear();
  check_frame(scene, options);
  if (!options.out.empty()) write(scene, options);
  const std::vector<BodyCard> list = cards(scene);
  if (!options.as_json) {
    print_cards(list);
    return success;
  }
  print(as_json(options.name, list).dump(2) + "\n");
  return success;
}

}  // namespace

void add_scene(CLI::App& program, Action& action) {
  CLI::App* command = program.add_subcommand("scene", "describe a built-in scene, and write its meshes");
  command->footer(scene_examples);
  auto o = std::make_shared<SceneOptions>();
  add_text(*command, "name", o->name, "`kbvh list` shows them")->required();
  add_whole(*command, "--triangles", o->scene.triangles, ranges::triangles,
            "triangles of the moving body (2000)");
  add_whole(*command, "--obstacle", o->scene.obstacle_triangles, ranges::triangles,
            "triangles of the other body");
  add_whole(*command, "--keyframes", o->scene.keyframes, {1, ranges::keyframes.most}, "(60)");
  add_whole(*command, "--seed", o->scene.seed, ranges::any, "seed of random choices (1)");
  add_whole(
      *command, "--full-triangles", o->scene.full_triangles, ranges::triangles,
      "shirt and dress: largest number of triangles simulated in full; above it, a second level refines");
  add_whole(*command, "--frame", o->frame, ranges::any, "keyframe of the OBJ file, from 0");
  add_text(*command, "--out", o->out, "OBJ file, JSON file or folder to write");
  command->add_flag("--json", o->as_json, "for programs");
  command->callback([&action, o] { action = [o] { return show(*o); }; });
}

}  // namespace kbvh::experiments

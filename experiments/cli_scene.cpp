#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>

#include "experiments/cli.hpp"
#include "experiments/io/obj.hpp"
#include "experiments/program.hpp"
#include "experiments/progress.hpp"
#include "experiments/scene_card.hpp"
#include "experiments/text.hpp"

namespace kbvh::experiments {

namespace {

constexpr const char* examples = R"(Examples:
  kbvh scene shirt --triangles 32000
  kbvh scene dress --triangles 8000 --frame 30 --out dress.obj
  kbvh scene dress --triangles 8000 --out folder
Prints counts and how violently the bodies move: the share of the sides of a binary tree (a triangle per leaf)
whose realising vertex changes from one keyframe to the next. A folder gets every body as OBJ, with PC2 if it
moves, and these numbers as card.json; a file ending in .obj holds all bodies at one keyframe, one after the other.)";

struct SceneOptions {
  std::string name, out;
  BuiltinOptions scene;
  std::size_t frame = 0;
  bool as_json = false;
};

/// All bodies as one mesh at one keyframe: bodies at rest, and past their end, as they are last.
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

void write(const LoadedScene& scene, const SceneOptions& options) {
  const std::filesystem::path out = options.out;
  if (out.extension() == ".obj")
    io::save_obj(snapshot(scene.meshes, options.frame), out);
  else
    export_scene(scene, out, 0);
}

void print(const std::vector<BodyCard>& list) {
  for (const BodyCard& c : list) {
    std::string text =
        fmt::format("{}: {}, {}, {}", c.name, counted(c.primitives, "primitive"),
                    std::to_string(c.vertices) + " vertices", counted(c.keyframes, "keyframe"));
    if (c.keyframes > 1)
      text += fmt::format(
          " in {:.3g} s\n    {:.2f}% of the sides of {} nodes change their realiser per keyframe (at most "
          "{:.2f}%)\n"
          "    a vertex moves by {:.2f} edges per keyframe (at most {:.2f})",
          c.seconds, 100 * c.sides_changed, c.nodes, 100 * c.most_sides_changed, c.mean_step, c.largest_step);
    std::printf("%s\n", text.c_str());
  }
}

int show(const SceneOptions& options) {
  SceneSpec spec;
  spec.builtin = find_builtin_scene(options.name).name;
  spec.options = options.scene;
  Progress line;
  const LoadedScene scene = load(spec, [&](const std::string& what, double fraction) {
    line.show(what + ": " + std::to_string(int(100 * fraction)) + " %");
  });
  line.clear();
  if (!options.out.empty()) write(scene, options);
  const std::vector<BodyCard> list = cards(scene);
  if (!options.as_json) {
    print(list);
    return success;
  }
  std::printf("%s\n", as_json(options.name, list).dump(2).c_str());
  return success;
}

}  // namespace

void add_scene(CLI::App& program, Action& action) {
  CLI::App* command = program.add_subcommand("scene", "what a built-in scene is, and its meshes as files");
  command->footer(examples);
  auto o = std::make_shared<SceneOptions>();
  command->add_option("name", o->name, "`kbvh list` shows them")->required();
  command->add_option("--triangles", o->scene.triangles, "of the moving body (2000)")
      ->check(CLI::PositiveNumber);
  command->add_option("--obstacle", o->scene.obstacle_triangles, "triangles of the body beside it")
      ->check(CLI::PositiveNumber);
  command->add_option("--keyframes", o->scene.keyframes, "(60)")->check(CLI::PositiveNumber);
  command->add_option("--seed", o->scene.seed, "of what chance decides (1)");
  command->add_option("--full-triangles", o->scene.full_triangles,
                      "garments: most triangles that are simulated in full; above, a second level refines");
  command->add_option("--frame", o->frame, "keyframe of the OBJ file, from 0");
  command->add_option("--out", o->out, "OBJ file or folder to write");
  command->add_flag("--json", o->as_json, "for programs");
  command->callback([&action, o] { action = [o] { return show(*o); }; });
}

}  // namespace kbvh::experiments

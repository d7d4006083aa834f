#include "experiments/common/json_reader.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/scenes/scene_spec.hpp"
#include "tests/fuzz/input_file.hpp"

// A script of plan changes is read, tried out on a small scene, and checked against the admissible range
// until its last frame.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kbvh;
  using namespace kbvh::experiments;
  try {
    const std::string text(reinterpret_cast<const char*>(data), size);
    const nlohmann::json said = parse_json(text, "script");
    if (said.is_string()) return 0;  // the name of another file
    LoadedScene loaded;
    loaded.script = read_script_spec(said, "script", {});
    if (loaded.script->frames > 10000) return 0;
    static const LoadedScene bodies = [] {
      const auto two = nlohmann::json::array(
          {"sphere:triangles=20,keyframes=2,step=0.1:0:0", "sphere:triangles=20,radius=0.4"});
      return load(read_scenes({{"bodies", two}}, "scene", {})[0]);
    }();
    loaded.meshes = bodies.meshes;
    loaded.sources = bodies.sources;
    const Scene<float> scene = assemble<float>(loaded);
    frames_of(scene, loaded, script_of(scene, loaded), 3);
  } catch (const io::InputError&) {
  }
  return 0;
}

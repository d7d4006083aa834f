#include "experiments/results/record.hpp"

#include "core/base/hasher.hpp"
#include "experiments/common/text.hpp"

namespace kbvh::experiments {

using nlohmann::json;

const char* word(SceneOrigin origin) {
  switch (origin) {
    case SceneOrigin::built_in:
      return "built_in";
    case SceneOrigin::files:
      return "files";
    case SceneOrigin::shapes:
      break;
  }
  return "shapes";
}

namespace {
std::uint64_t hash_of_times(std::span<const double> times) {
  Hasher hasher;
  hasher.mix(times.size());
  hasher.bytes(times.data(), times.size_bytes());
  return hasher.value();
}
}  // namespace

template <class S>
json scene_record(const Scene<S>& scene, const LoadedScene& loaded, std::uint32_t per_keyframe,
                  std::span<const double> frames, const PlanScript<S>& script) {
  json bodies = json::array();
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const Body<S>& body = scene.bodies[i];
    bodies.push_back({{"name", body.name},
                      {"primitives", body.primitives.count()},
                      {"vertices", loaded.meshes[i].vertex_count},
                      {"keyframes", body.plans.keyframe_count()},
                      {"moving", body.plans.moving()},
                      {"kind", name(body.primitives.kind)},
                      {"self", i < loaded.self.size() && loaded.self[i]},
                      {"degenerate", loaded.meshes[i].degenerate_primitives}});
    if (i < loaded.vertices_of.size() && loaded.vertices_of[i] != i)
      bodies.back()["vertices_of"] = loaded.vertices_of[i];
  }
  json record{{"name", scene.name},
              {"order", word(loaded.order)},
              {"origin", word(loaded.origin)},
              {"hash", hexadecimal(hash(scene))},
              {"scalar", sizeof(S) == 4 ? "float" : "double"},
              {"per_keyframe", per_keyframe},
              {"keyframes", overlaid_keyframes(scene).size()},
              {"frames", frames.size()},
              {"frame_times", hexadecimal(hash_of_times(frames))},
              {"primitives", scene.primitive_count()},
              {"bodies", bodies}};
  if (loaded.radius) record["radius"] = *loaded.radius;
  if (!script.empty()) record["script"] = script_record(script, frames.empty() ? 0 : frames.back());
  return record;
}

template json scene_record(const Scene<float>&, const LoadedScene&, std::uint32_t, std::span<const double>,
                           const PlanScript<float>&);
template json scene_record(const Scene<double>&, const LoadedScene&, std::uint32_t, std::span<const double>,
                           const PlanScript<double>&);

template <class S>
json script_record(const PlanScript<S>& script, double end) {
  std::size_t steps = 0;
  for (const auto& step : script.steps) steps += step.time <= end ? 1 : 0;
  return {{"hash", hexadecimal(hash(script))}, {"steps", steps}, {"changes", script.changes_until(end)}};
}

template json script_record(const PlanScript<float>&, double);
template json script_record(const PlanScript<double>&, double);

json again_record(const json& scene_object, const json& scene, const json& strategy, const Study& study) {
  json request{{"id", strategy.at("id")}, {"params", strategy.at("params")}};
  if (!strategy.at("builder").is_null()) request["builder"] = strategy.at("builder");
  json plan{{"scenes", json::array({scene_object})},
            {"strategies", json::array({request})},
            {"scalars", json::array({scene.at("scalar")})},
            {"l", json::array({scene.at("per_keyframe")})},
            {"repetitions", study.repetitions},
            {"interval_width", study.interval_width},
            {"seconds", study.seconds},
            {"oracle_every", study.oracle_every}};
  if (study.frames_limit > 0) plan["frames_limit"] = study.frames_limit;
  plan.update(asked_of(study.asks));
  return plan;
}

std::string configuration_key(const std::string& program, const json& scene, const json& strategy,
                              const Study& study, const json& machine) {
  // nlohmann's objects are sorted by key, so the text does not depend on the order of insertion.
  json all{{"schema", results_schema},
           {"program", program},
           {"scene", scene.at("hash")},
           {"name", scene.value("name", "")},
           {"scalar", scene.at("scalar")},
           {"per_keyframe", scene.at("per_keyframe")},
           {"frames", scene.at("frames")},
           {"frame_times", scene.at("frame_times")},
           {"strategy", strategy.at("id")},
           {"params", strategy.at("params")},
           {"builder", strategy.at("builder")},
           {"repetitions", study.repetitions},
           {"interval_width", study.interval_width},
           {"seconds", study.seconds},
           {"oracle_every", study.oracle_every},
           {"machine",
            {machine.at("cpu"), machine.at("compiler"), machine.at("flags"), machine.at("build_type"),
             machine.at("kernels")}}};
  all.update(asked_of(study.asks));
  if (scene.contains("script")) all["script"] = scene.at("script").at("hash");
  return hexadecimal(hash_of(all.dump()));
}

}  // namespace kbvh::experiments

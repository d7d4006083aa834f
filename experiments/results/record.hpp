#pragma once
#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "experiments/scenes/scene_spec.hpp"
#include "experiments/study/measure.hpp"
#include "experiments/study/plan.hpp"
#include "experiments/study/strategy_record.hpp"

namespace kbvh::experiments {

/// Version of the records; RESULTS.md documents it. Times of schema 1 have no beginning: they leave out the
/// first frame.
inline constexpr int results_schema = 2;
/// The oldest version that is still read, apart from newer ones.
inline constexpr int oldest_results_schema = 1;

/// Returns the word used in result files.
const char* word(SceneOrigin origin);

/// Makes the "scene" of a record: the played scene, its times, and the script that is replayed until the last
/// time.
template <class S>
nlohmann::json scene_record(const Scene<S>& scene, const LoadedScene& loaded, std::uint32_t per_keyframe,
                            std::span<const double> frames, const PlanScript<S>& script = {});

/// Makes the "script" of a scene whose plans change at run time, as far as it is replayed until `end`.
template <class S>
nlohmann::json script_record(const PlanScript<S>& script, double end);

/// Makes the "again" of a record: a plan that measures this configuration alone. `scene_object` is the scene
/// as an object of a plan, `scene` and `strategy` are as above.
nlohmann::json again_record(const nlohmann::json& scene_object, const nlohmann::json& scene,
                            const nlohmann::json& strategy, const Study& study);

/// Computes the key of a configuration: a hash of everything that affects the measurement. `scene` and
/// `strategy` are as above; `program` is program_identity().
std::string configuration_key(const std::string& program, const nlohmann::json& scene,
                              const nlohmann::json& strategy, const Study& study,
                              const nlohmann::json& machine);

/// Returns why a record that was read cannot stand for its configuration: the missing or wrong field, and its
/// defect; or "". A record that passes has all fields that tables and targets read, in the right types.
std::string unusable(const nlohmann::json& record);

}  // namespace kbvh::experiments

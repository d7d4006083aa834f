#pragma once
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/judge/plan_script.hpp"
#include "core/scene/scene.hpp"
#include "experiments/scenes/builtin_scenes.hpp"

namespace kbvh::experiments {

struct LoadedScene;

/// Plan changes as a user writes them (RESULTS.md), before the scene is known.
struct ScriptSpec {
  struct Change {
    std::string place;  ///< for messages
    std::string body;   ///< a name; empty: use the number
    PlanChange<double> plan;
  };
  struct Step {
    std::string place;
    double time;
    std::vector<Change> changes;
  };
  std::vector<Step> steps;   ///< ascending times
  std::uint32_t frames = 0;  ///< of the scene, `rate` per second; 0: from keyframes and l
  double rate = 0;
};

/// Reads a script: an object with `steps` (and, both or none, `frames` and `rate`), or the list of steps
/// alone, or a text, the name of a file with either one, relative to `folder`. Throws io::InputError that
/// begins with `place` or the file's name: for unknown keys, numbers that are not finite, and times that do
/// not ascend.
ScriptSpec read_script_spec(const nlohmann::json& value, const std::string& place,
                            const std::filesystem::path& folder);

/// Returns the plan changes of a scene; empty for most scenes. User-defined changes are applied once as a
/// test: throws io::InputError with the place and the error of a change (unknown body or vertex, values
/// beyond the scalar's admissible range, a time before the first frame). Changes of a rule are recorded, or
/// read from the cache folder.
template <class S>
PlanScript<S> script_of(const Scene<S>& scene, const LoadedScene& loaded, const MakeProgress& progress = {});

/// Returns whether the scene defines its own frames, so that l does not apply.
bool has_own_frames(const LoadedScene& loaded);

/// Returns the frames of a scene: its own, or l per keyframe interval; every time of the script is one of
/// them. Computes only the first `most` frames. Throws io::InputError with vertex, time and value if the
/// scene leaves the admissible range until the last frame (core/motion/admissible.hpp), before any contestant
/// plays it.
template <class S>
std::vector<double> frames_of(const Scene<S>& scene, const LoadedScene& loaded, const PlanScript<S>& script,
                              std::uint32_t per_keyframe,
                              std::size_t most = std::numeric_limits<std::size_t>::max());

}  // namespace kbvh::experiments

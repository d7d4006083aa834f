#pragma once
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "experiments/scenes/scene_spec.hpp"
#include "experiments/study/contestants.hpp"
#include "experiments/study/question.hpp"
#include "experiments/study/targets.hpp"

namespace kbvh::experiments {

/// A study: every scene with every contestant, l and scalar.
struct Study {
  std::string name;
  std::vector<SceneSpec> scenes;
  std::vector<StrategyRequest> strategies{{"default", {}, {}}};
  Sweep params;                                 ///< for all strategies that have them, or "strategy.key"
  BuilderRequest builder;                       ///< for all strategies without their own builder
  std::vector<std::uint32_t> per_keyframe{10};  ///< l: frames for each keyframe interval
  std::vector<std::string> scalars{"float"};
  std::uint32_t repetitions = 5;   ///< at least; fewer than five: exactly this many, and no interval
  double interval_width = 0.05;    ///< repeat until each ratio's relative interval is narrower
  double seconds = 10;             ///< rounds beyond the least number end after this time
  std::uint64_t frames_limit = 0;  ///< only this many first frames; 0: all
  std::uint64_t oracle_every = 1;  ///< verify every n-th frame (and the last)
  Question asks;                   ///< of every contestant at every frame
};

/// A plan: one or more studies, run one after the other into the same results.
struct Plan {
  std::string name, description;
  std::vector<Study> studies;
  std::vector<Target> targets;  ///< targets of its times
};

/// Reads a plan. Its keys are those of a study and serve as defaults of the studies listed in "studies";
/// without this list the plan is one study; "live" is left to `kbvh loop`. RESULTS.md documents them all.
/// `place` begins every message (the file's name), `folder` is the start of relative file names. Throws
/// io::InputError on unknown keys and wrong values; ConfigError is left to `expand`.
Plan read_plan(const nlohmann::json& plan, const std::string& place, const std::filesystem::path& folder);

/// Read "params" and "builder" at any level of a plan. Throw io::InputError that begins with `place`.
Sweep read_params(const nlohmann::json& object, const std::string& place);
BuilderRequest read_builder(const nlohmann::json& object, const std::string& place);

/// Reads a plan file.
Plan load_plan(const std::filesystem::path& file);

}  // namespace kbvh::experiments

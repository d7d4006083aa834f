#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "experiments/study/contestants.hpp"

namespace kbvh::experiments {

struct Plan;

/// The word by which a selector names the best refit: any declared baseline.
inline constexpr const char* best_refit_word = "best_refit";

/// Selects contestants by their description, and the phase whose time counts. Several may match (for example
/// several leaf sizes): the one whose clip takes the shortest time represents them all, in every phase.
struct TargetSelector {
  std::string strategy;              ///< id, or `best_refit_word`
  std::vector<std::string> or_else;  ///< ids of alternative strategies
  std::string phase;  ///< "motion", "update", "traversal", "triangle_tests", "query", "candidates", "total",
                      ///< "upkeep", "update_per_event"
  std::string scene;  ///< empty, or the scene of this side, which overrides the target's scenes
  BuilderRequest builder;  ///< any of these values; empty: all measured ones
  Sweep params;            ///< likewise
};

/// A ratio of two times that a plan should reach: the factor by which the numerator is slower.
struct Target {
  std::string what, note;
  TargetSelector numerator, denominator;
  std::vector<std::string> scenes;  ///< the worst of these counts, or all
  bool mean = false;                ///< their geometric mean counts, not the worst
  std::string scalar;
  std::string changes;  ///< "candidates" or "pairs": of studies that ask for these changes; empty: of others
  std::uint32_t per_keyframe = 10;
  double at_least = 0, aim = 0;
  std::string place;  ///< for messages
};

/// Reads the list "targets" of a plan. Throws io::InputError that begins with `place`.
std::vector<Target> read_targets(const std::vector<nlohmann::json>& list, const std::string& place);

/// Throws io::InputError for scenes that no study of the plan measures in the target's scalar and l, or that
/// share a name.
void check_target_scenes(const Plan& plan);

/// Throws io::InputError for strategies that do not exist (unless optional in the plan), and for targets
/// whose two sides are never measured together. `contestants` are those of each study.
void check_target_contestants(const Plan& plan, const std::vector<std::vector<ContestantSpec>>& contestants);

/// Returns whether the selector matches the contestant, given as the "strategy" of a record. A baseline
/// without a parameter that a selector of the best refit fixes matches.
bool matches(const TargetSelector& selector, const nlohmann::json& strategy);

/// Returns whether this program has the selector's strategy.
bool is_known(const TargetSelector& selector);

/// Describes a selector: "bottom_up with width 8, leaf_size 1 or 4".
std::string described(const TargetSelector& selector);

}  // namespace kbvh::experiments

#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "experiments/study/contestants.hpp"

namespace kbvh::experiments {

struct Plan;

/// Contestants by what is said of them, and the phase whose time counts. Several may match (say, several leaf
/// sizes): the one with the smallest median stands for them all.
struct TargetSelector {
  std::string strategy;              ///< id
  std::vector<std::string> or_else;  ///< ids of others that may stand there as well
  std::string phase;  ///< "motion", "update", "traversal", "triangle_tests", "query", "candidates", "total"
  BuilderRequest builder;  ///< any of these values; empty: whatever was measured
  Sweep params;            ///< likewise
};

/// A ratio of two times that a plan wants to reach: how many times slower the numerator is.
struct Target {
  std::string what, note;
  TargetSelector numerator, denominator;
  std::vector<std::string> scenes;  ///< the worst of these counts, or all
  bool mean = false;                ///< their geometric mean counts, not the worst
  std::string scalar;
  std::uint32_t per_keyframe = 10;
  double at_least = 0, aim = 0;
  std::string place;  ///< for messages
};

/// Reads the list "targets" of a plan. Throws io::InputError that begins with `place`.
std::vector<Target> read_targets(const std::vector<nlohmann::json>& list, const std::string& place);

/// Complains, by io::InputError, about scenes that no study of the plan measures in the target's scalar and
/// l, or that are not told apart by their names.
void check_target_scenes(const Plan& plan);

/// Complains, by io::InputError, about strategies that do not exist (unless the plan has them as optional),
/// and about targets whose two sides are never measured together. `contestants` are those of each study.
void check_target_contestants(const Plan& plan, const std::vector<std::vector<ContestantSpec>>& contestants);

/// Is the contestant, as "strategy" of a record has it, one that the selector means?
bool matches(const TargetSelector& selector, const nlohmann::json& strategy);

/// "bottom_up with width 8, leaf_size 1 or 4": what the selector asks of a contestant.
std::string described(const TargetSelector& selector);

}  // namespace kbvh::experiments

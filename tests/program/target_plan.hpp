// A plan with one target, and what the program says about plans like it when it starts.
#pragma once
#include <string>
#include <vector>

#include "complaint.hpp"
#include "experiments/common/json_reader.hpp"
#include "experiments/study/contestants.hpp"
#include "experiments/study/plan.hpp"
#include "experiments/study/targets.hpp"

namespace kbvh::experiments::targets_test {

using nlohmann::json;

/// A plan with one correct target: period over flat, on "sheet".
inline json example_plan() {
  return json::parse(R"({
    "name": "example",
    "scenes": [{"name": "sheet", "builtin": "waving_sheet", "triangles": 50, "order": ["given", "shuffled"]},
               {"name": "soup", "builtin": "random_soups", "triangles": 50}, "turning_box"],
    "strategies": ["bottom_up_period", {"id": "bottom_up", "builder": {"leaf_size": [1, 4]}},
                   {"id": "peer", "optional": true}],
    "l": [1, 2],
    "targets": [{"what": "flat over period", "numerator": {"strategy": "bottom_up_period", "phase": "update"},
      "denominator": {"strategy": "bottom_up", "phase": "update"},
      "scenes": ["sheet", "soup"], "scalar": "float", "l": 2, "at_least": 2, "aim": 4}]})");
}

inline Plan read(const json& plan) {
  return read_plan(plan, "p.json", {});
}

inline void check_targets(const Plan& plan) {
  std::vector<std::string> notes;
  std::vector<std::vector<ContestantSpec>> contestants;
  for (const Study& study : plan.studies)
    contestants.push_back(expand(study.strategies, study.params, study.builder, notes));
  check_target_contestants(plan, contestants);
}

/// Returns the complaint about the plan when the program starts.
inline std::string start_complaint(const json& value) {
  return complaint([&] { check_targets(read(value)); });
}

}  // namespace kbvh::experiments::targets_test

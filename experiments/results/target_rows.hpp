#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "experiments/study/plan.hpp"

namespace kbvh::experiments {

/// Version of the rows in targets.json; RESULTS.md documents them.
inline constexpr int targets_schema = 2;

/// Records of one table: one scene, one scalar, one l, in one study.
struct TargetGroup {
  nlohmann::json scene;  ///< as in the records
  std::vector<nlohmann::json> records;
};

/// Makes one row per target of the plan, from the records of `groups` (in the order in which they were
/// measured). Intervals are of 95 %, by a bootstrap over whole rounds with a fixed seed; with fewer than five
/// repetitions there is a range instead.
nlohmann::json target_rows(const Plan& plan, const std::vector<TargetGroup>& groups);

/// Formats the tables that `run` prints for the rows: the scenes that count, then every scene.
std::string targets_table(const nlohmann::json& rows);

/// Writes the rows to `folder`/targets.json, in place of those of the same plans; rows of other plans stay. A
/// file that cannot be read is renamed. Throws io::InputError.
void write_targets(const std::filesystem::path& folder, const nlohmann::json& rows);

}  // namespace kbvh::experiments

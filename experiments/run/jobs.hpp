#pragma once
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "experiments/study/plan.hpp"

namespace kbvh::experiments {

/// One job of a plan: all contestants of one study on one scene, in one scalar, at one l: the content of one
/// table. Contestants that are compared with each other are timed by turns in one process, so a job is the
/// smallest part of a study whose ratios can be relied on. Jobs run in any order and on any machine.
struct Job {
  std::string id;  ///< fit for a file name; ends with a hash of everything that is measured and the program
  std::string scene;  ///< the id of the preparation that makes its scene and true pairs
  std::string scene_name;
  std::size_t study_at = 0, scene_at = 0;  ///< places in the plan
  std::string scalar;
  std::uint32_t per_keyframe = 1;
  std::size_t configurations = 0;
  std::uint32_t threads = 1;  ///< the most threads of a contestant
};

/// Cuts a plan into jobs, in the plan's order. Equal tables of several studies are one job, as they are
/// measured once by a run of the whole plan. Optional scenes whose files are missing have no job, with a
/// sentence in `notes`. Throws io::InputError and ConfigError like a run of the plan.
std::vector<Job> jobs_of(const Plan& plan, std::vector<std::string>& notes);

/// Returns the plan of one job: one study with one scene, one scalar and one l, without targets. Throws
/// io::InputError if the plan has no job of this id.
Plan plan_of_job(const Plan& plan, const std::string& id);

/// Describes jobs and scenes as `kbvh run --list-jobs` prints them (RESULTS.md).
nlohmann::json jobs_json(const Plan& plan, const std::vector<Job>& jobs);

/// Makes what the jobs of one scene share, given by its id: the scene and its true pairs at all frames that
/// any study compares, in the cache folder, and its pictures in `out`. The truth of contacts and rays is
/// not cached. Throws io::InputError.
void prepare_scene(const Plan& plan, const std::string& id, const std::filesystem::path& out);

}  // namespace kbvh::experiments

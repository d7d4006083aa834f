#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

#include "experiments/results/table.hpp"
#include "experiments/study/plan.hpp"

namespace kbvh::experiments {

/// The outcome of a study.
struct StudyOutcome {
  std::size_t measured = 0;    ///< configurations
  std::size_t skipped = 0;     ///< already in the results
  std::size_t tables = 0;      ///< printed
  std::size_t timed = 0;       ///< configurations with times, now or before
  std::size_t disturbed = 0;   ///< of these
  std::size_t refused = 0;     ///< without a time, because a guarantee was broken (also in earlier runs)
  std::size_t unfinished = 0;  ///< without a time, because memory ran out; the next run measures them again
};

/// Performs all studies of the plan: verifies and replays every contestant, then times those whose guarantee
/// holds, in shuffled rounds (rounds.hpp),
/// prints a table for each scene, scalar and l on stdout, and appends to `out`/results.jsonl (nothing is
/// written if `out` is empty). A table is printed even if it cannot be written. Configurations that are
/// already in the results are not measured again. If the plan has targets, their table is printed at the end,
/// and `out`/targets.json written. With `job`, the id of the job whose plan this is (jobs.hpp), the records
/// go to a new file in `out`/jobs/ID; records in `out`/results.jsonl and of earlier attempts are known, too.
/// Throws io::InputError and ConfigError.
/// `shown`: which contestants the tables show.
StudyOutcome run_plan(const Plan& plan, const std::filesystem::path& out, const std::string& job = {},
                      Shown shown = Shown::fastest);

}  // namespace kbvh::experiments

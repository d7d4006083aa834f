#pragma once
#include <cstddef>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

namespace kbvh::experiments {

/// What a merge found and did.
struct MergeOutcome {
  std::size_t added = 0;     ///< records that the results did not have
  std::size_t repeated = 0;  ///< records that they had already, or that two inputs share
  std::size_t records = 0;   ///< in the merged results, repetitions included
  std::set<std::string> machines, commits;
  std::vector<std::string> notes;  ///< sentences for the user
};

/// Adds the results of `inputs` to the folder `out`: the records of results.jsonl, word for word, the rows of
/// targets.json, the scenes' pictures, and the other files that commands write there. An input is a results
/// folder, or a file of records. All inputs are read and checked before anything is written. Throws
/// io::InputError, with file and line, for a file without records, an unknown schema, a line that is no
/// record, and one measurement with two contents.
///
/// Of several records with one key the newest finished one is the last in the file, so that it counts; if the
/// folder has it already, and older ones are added, its line is repeated after them. A merge that is repeated
/// adds nothing.
MergeOutcome merge_results(const std::vector<std::filesystem::path>& inputs,
                           const std::filesystem::path& out);

}  // namespace kbvh::experiments

#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "experiments/study/measure.hpp"

namespace kbvh::experiments {

/// One Google Benchmark: an iteration is a whole clip.
struct BenchItem {
  std::string name;
  std::function<const ClipTimes*()> play;  ///< nullptr: the clip could not be played
};

/// Runs the items under Google Benchmark: manual time (update and query of the clip), one iteration per
/// repetition, the repetitions of all items randomly interleaved and all kept. Returns Google Benchmark's own
/// JSON, with the phases (ms per frame) as counters.
nlohmann::json run_benchmarks(const std::vector<BenchItem>& items, std::uint32_t repetitions);

/// Adds the runs to `folder`/benchmark.json (created if missing): its list of benchmarks grows, the context
/// is the newest. Written atomically; several processes add their runs one after the other. A file that is
/// not Google Benchmark's JSON is kept under another name: returns a sentence about that, or "". Throws
/// io::InputError.
std::string add_to_benchmark_file(const std::filesystem::path& folder, const nlohmann::json& runs);

}  // namespace kbvh::experiments

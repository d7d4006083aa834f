#pragma once
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "experiments/measure.hpp"

namespace kbvh::experiments {

/// One Google Benchmark: an iteration is a whole clip.
struct BenchItem {
  std::string name;
  std::function<const ClipTimes&()> play;
};

/// Runs the items under Google Benchmark: manual time (update and query of the clip), one iteration per
/// repetition, the repetitions of all items randomly interleaved and all kept. Returns Google Benchmark's own
/// JSON, with the phases (ms per frame) as counters.
nlohmann::json run_benchmarks(const std::vector<BenchItem>& items, std::uint32_t repetitions);

/// Adds the runs to DIR/benchmark.json (made if it is not there): its list of benchmarks grows, the context
/// is the newest. Written atomically.
void add_to_benchmark_file(const std::string& file, const nlohmann::json& runs);

}  // namespace kbvh::experiments

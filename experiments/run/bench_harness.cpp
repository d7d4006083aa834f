#include "experiments/run/bench_harness.hpp"

#include <benchmark/benchmark.h>

#include <cerrno>
#include <filesystem>
#include <sstream>

#include "experiments/common/json_reader.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/results/result_file.hpp"
#include "experiments/results/results.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

/// Google Benchmark writes NaN and Infinity (the variation of constant zeros), which JSON does not have.
std::string without_nan(std::string text) {
  for (const std::string token : {": NaN", ": -NaN", ": Infinity", ": -Infinity"})
    for (std::size_t at = 0; (at = text.find(token, at)) != std::string::npos;)
      text.replace(at, token.size(), ": null");
  return text;
}

}  // namespace

json run_benchmarks(const std::vector<BenchItem>& items, std::uint32_t repetitions) {
  // Google Benchmark is configured through flags only.
  std::string program = "kbvh", interleave = "--benchmark_enable_random_interleaving=true";
  char* arguments[] = {program.data(), interleave.data(), nullptr};
  int count = 2;
  benchmark::Initialize(&count, arguments);
  for (const BenchItem& item : items)
    benchmark::RegisterBenchmark(item.name.c_str(),
                                 [&item](benchmark::State& state) {
                                   for (auto _ : state) {
                                     const ClipTimes* clip = item.play();
                                     if (clip == nullptr) {
                                       state.SkipWithError("it could not be played");
                                       break;
                                     }
                                     state.SetIterationTime(clip->total());
                                     const PhaseTimes mean = clip->mean();
                                     state.counters["motion_ms"] = 1e3 * mean.motion;
                                     state.counters["update_ms"] = 1e3 * mean.update;
                                     state.counters["traversal_ms"] = 1e3 * mean.traversal;
                                     state.counters["triangle_tests_ms"] = 1e3 * mean.triangle_tests;
                                     state.counters["plan_changes_ms"] = 1e3 * mean.plan_changes;
                                     state.counters["geometry_changes_ms"] = 1e3 * mean.geometry_changes;
                                   }
                                 })
        ->Iterations(1)
        ->Repetitions(int(repetitions))
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  std::ostringstream out, errors;
  benchmark::JSONReporter reporter;
  reporter.SetOutputStream(&out);
  reporter.SetErrorStream(&errors);
  benchmark::RunSpecifiedBenchmarks(&reporter, ".");
  benchmark::ClearRegisteredBenchmarks();
  return parse_json(without_nan(out.str()), "Google Benchmark's report");
}

std::string add_to_benchmark_file(const std::filesystem::path& folder, const json& runs) {
  const std::filesystem::path file = folder / "benchmark.json";
  const FolderLock lock(folder);
  json all = runs;
  std::string said;
  if (std::optional<json> before = content_of(file)) {
    if (before->is_object() && before->contains("benchmarks") && (*before)["benchmarks"].is_array()) {
      for (const json& run : runs.at("benchmarks")) (*before)["benchmarks"].push_back(run);
      (*before)["context"] = runs.at("context");
      all = std::move(*before);
    } else {
      said = file.string() + " is not a file of Google Benchmark: it is now " + set_aside(file) +
             ", and a new file is started";
    }
  }
  io::write_file_atomically(file, all.dump(1, ' ', false, json::error_handler_t::replace) + "\n");
  return said;
}

}  // namespace kbvh::experiments

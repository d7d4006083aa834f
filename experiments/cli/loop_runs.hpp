#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "experiments/common/ranges.hpp"
#include "experiments/loop/simulation.hpp"
#include "experiments/study/contestants.hpp"

namespace kbvh::experiments {

/// The triangles and steps of a simulation that a user may ask for.
inline constexpr WholeRange live_triangles{8, 1u << 24}, live_steps{1, 100000000};

/// What finds the pairs of a simulation, as a user names it.
struct LiveFinder {
  std::string label = "broad_phase";  ///< this word, or the strategy with its settings
  loop::ContactStrategy strategy{};   ///< its id is empty for kbvh::broad_phase
  bool exact = true;                  ///< every pair is promised: all such finders give equal bits
  bool baseline = false;              ///< Info::baseline
};

/// Sums of the lines of the steps that were made now.
struct StepSums {
  std::uint64_t steps = 0, iterates = 0, questions = 0, searches = 0, candidates = 0, most_contacts = 0;
  std::uint64_t orders = 0;
  double detect_ms = 0, impact_ms = 0, rest_ms = 0, worst_ms = 0, smallest_gap = 0, largest_lag = 0;
  std::vector<double> resident_mb{};              ///< after each step
  std::map<std::uint64_t, std::string> states{};  ///< hash of the state after a step

  void add(const nlohmann::json& record);
};

/// A simulation whose pairs one finder found.
struct LiveRun {
  LiveFinder finder;
  loop::SimulationResult result;
  StepSums sums;
};

/// Simulations of one scene, one for each finder.
struct LiveStudy {
  std::string title;  ///< for tables
  loop::SimulationOptions simulation;
  std::vector<LiveFinder> finders;
};

/// Returns the finders that are named: ids of strategies and the other words of StrategyRequest, and
/// "broad_phase", which comes first. `params` are as for `expand`. Members of a family that do not suit are
/// left out, with a message; throws ConfigError, in a sentence with the reason, for a strategy that is named
/// by its id and does not suit the scene of `simulation`, and for words that name nothing.
std::vector<LiveFinder> live_finders(const std::vector<StrategyRequest>& requests, const Sweep& params,
                                     const loop::SimulationOptions& simulation);

/// Reads the simulations of a plan, the list "live" (experiments/RESULTS.md); each has a folder of its name
/// in `out`, unless that is empty. Throws io::InputError for a file without one, for unknown keys, wrong
/// values and equal names, and with the messages of live_finders.
std::vector<LiveStudy> load_live_studies(const std::filesystem::path& plan, const std::filesystem::path& out);

/// Runs the simulations, one after the other, prints a table, and returns the exit code: success, or
/// guarantee_broken if triangles penetrated, or if trajectories of exact finders differ. Of several, each has
/// a folder of its own in that of the simulation.
int run_live(const LiveStudy& study);

}  // namespace kbvh::experiments

#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "experiments/cli/loop_runs.hpp"

namespace kbvh::experiments {

/// One step of a simulation, in numbers.
struct LiveStep {
  std::uint64_t state = 0;  ///< a hash of the state after it
  double detect_ms = 0, impact_ms = 0, rest_ms = 0, resident_mb = 0;
  double whole_ms() const { return detect_ms + impact_ms + rest_ms; }
};

/// The steps of a simulation from its start on, those of earlier runs included.
struct LiveSteps {
  std::vector<LiveStep> each{};
  std::uint64_t iterates = 0, searches = 0, candidates = 0, most_contacts = 0, orders = 0;
  double smallest_gap = 0, largest_lag = 0;

  /// Adds the line of a step (experiments/RESULTS.md).
  void add(const nlohmann::json& record);
};

/// A simulation whose pairs one finder found.
struct LiveRun {
  LiveFinder finder;
  loop::SimulationResult result;
  LiveSteps steps;
};

/// Prints the simulations of a scene: all about a single one, or a line for each.
void print_runs(const LiveStudy& study, const std::vector<LiveRun>& runs);

/// Says what is wrong with the simulations of a scene, and returns the exit code. `title` begins each
/// sentence, unless it is empty.
int judge(const std::string& title, const std::vector<LiveRun>& runs);

/// Sums over the simulations of several scenes, for each finder.
class LiveTotals {
 public:
  /// Adds the simulations of a scene.
  void add(const std::vector<LiveRun>& runs);
  /// Prints a line for each finder, in the order in which they came.
  void print_table() const;

 private:
  struct Sum {
    std::uint64_t simulations = 0, steps = 0, penetrations = 0, cut_short = 0, differing = 0;
    double worst_ms = 0;
  };
  std::vector<std::pair<std::string, Sum>> sums_;
};

}  // namespace kbvh::experiments

#pragma once
#include <cstdint>
#include <filesystem>
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

/// Simulations of one scene, one for each finder.
struct LiveStudy {
  std::string title;  ///< for tables
  loop::SimulationOptions simulation;
  std::vector<LiveFinder> finders;
};

/// Returns the finders that are named: ids of strategies and the other words of StrategyRequest, and
/// "broad_phase", which comes first. `params` are as for `expand`. Members of a family that do not suit are
/// left out, with a sentence in `notes`, each once; throws ConfigError, in a sentence with the reason, for a
/// strategy that is named by its id and does not suit the mesh, and for words that name nothing.
std::vector<LiveFinder> live_finders(const std::vector<StrategyRequest>& requests, const Sweep& params,
                                     const loop::ContactMesh& mesh, std::vector<std::string>& notes);

/// Reads the simulations of a plan, the list "live" (experiments/RESULTS.md), or those with the names of
/// `only`, if there are any. Each has a folder of its name in `out`, unless that is empty. Says the notes of
/// live_finders. Throws io::InputError for a file without simulations, for unknown keys, wrong values, equal
/// names and unknown names, and with the messages of live_finders.
std::vector<LiveStudy> load_live_studies(const std::filesystem::path& plan, const std::filesystem::path& out,
                                         const std::vector<std::string>& only = {});

/// Runs the simulations, one after the other, prints a table for each scene and, of several, one of all, and
/// returns the exit code: success, or guarantee_broken if triangles penetrated, or if trajectories of exact
/// finders differ. `seconds`, unless 0, are those of all simulations: each gets an equal part of what is
/// left. Of several finders, each has a folder of its own in that of the simulation.
int run_live(const std::vector<LiveStudy>& studies, double seconds);

}  // namespace kbvh::experiments

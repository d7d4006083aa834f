#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>

#include "experiments/loop/saved_state.hpp"

namespace kbvh::experiments::loop {

/// A simulation that is run and written to a folder.
struct SimulationOptions {
  std::string scene = "sphere";
  std::uint64_t triangles = 2000, seed = 1, steps = 200;
  Detection detection = Detection::refit;
  double keep = 0;                 ///< the bound of `kept`, as a multiple of the radius
  std::uint64_t save_every = 10;   ///< steps
  double most_seconds = 0;         ///< ends after the step in which the call reaches this time; 0: no limit
  ContactStrategy strategy{};      ///< if named, finds the pairs; `detection` is then `refit`, `keep` 0
  std::uint32_t lose_every = 0;    ///< IterateDetector::Settings
  bool record = false;             ///< writes loop.recording
  std::uint64_t frames_every = 0;  ///< steps between two frames as OBJ files; 0: none
  std::filesystem::path folder{};  ///< empty: nothing is written, and nothing is continued
};

/// The outcome of a call of `simulate`: where it ended, and what its own steps took.
struct SimulationResult : SavedState {
  std::uint64_t first_step = 0;  ///< where an earlier run was continued; 0: there was none
  bool too_near = false;         ///< no step followed the last one: it left a pair nearer than the thickness
  double detect_seconds = 0, impact_seconds = 0, rest_seconds = 0;
};

/// Returns a number that changes with every bit of a state.
std::uint64_t hash_of_state(const State& state);

/// Runs a scene from its start, or from the last saved state of a run with the same options and folder, to
/// the given number of steps, or until `most_seconds` have passed, but for at least one step. The folder
/// receives
///   loop.jsonl      a line of JSON for the simulation, then one for each step (experiments/RESULTS.md)
///   loop.state      the state after the last saved step, replaced in one move
///   loop.recording  with `record`: see recording.hpp
///   frames/         with `frames_every`: see frames.hpp
/// Lines and iterates after the last saved step are cut off before the run continues. So the files of a run
/// that was killed and continued hold each step once, with the bits of an uninterrupted run; times differ. (A
/// strategy that promises no exact answers can find other pairs after a run was continued.)
/// Calls done(record) after each step with its line. Throws io::InputError if a file cannot be read or
/// written or belongs to a simulation with other options, and std::invalid_argument for options that name
/// nothing; ConfigError as check_contact_strategy.
SimulationResult simulate(const SimulationOptions& options,
                          const std::function<void(const nlohmann::json&)>& done = {});

}  // namespace kbvh::experiments::loop

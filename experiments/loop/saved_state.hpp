#pragma once
#include <cstdint>
#include <filesystem>

#include "experiments/loop/implicit_step.hpp"

namespace kbvh::experiments::loop {

/// What a simulation needs to continue after it was ended at any time.
struct SavedState {
  std::uint64_t options = 0;                           ///< a hash of the options, to be equal
  std::uint64_t lines_bytes = 0, recording_bytes = 0;  ///< of the other files when it was saved
  std::uint64_t penetrations = 0;                      ///< intersecting pairs of triangles, summed over steps
  std::uint64_t first_penetration = 0;  ///< the number of steps after which the first were counted; 0: none
  std::uint64_t stalled = 0, unconverged = 0;  ///< steps with these endings
  State state;
};

/// Replaces the file in one move. Throws io::InputError if it cannot be written.
void save_state(const std::filesystem::path& file, const SavedState& saved);
/// Reads a state that `save_state` wrote. Throws io::InputError for any other content.
SavedState load_state(const std::filesystem::path& file);

}  // namespace kbvh::experiments::loop

#pragma once
#include <cstdint>
#include <string>

#include "core/geometry/predicates.hpp"

namespace kbvh {

// The limits of a scene's numbers and of its playing time. They are checked only where data enters:
//   coordinates and velocities  |x| <= admissible_magnitude<S>: 1e30 in float, 1e100 in double
//   positions                   |x| <= admissible_reach<S>, 8 times as much, up to the last requested time:
//                               vertices with unbounded rays must not be played beyond
//   times                       |t| <= admissible_time, 2^900 s (8e270 s)
//   primitives                  1 to most_corners corners
// Differences of positions are therefore at most 1.6e31 in float, and their areas and triple products are
// finite in double: a strategy sees no infinity that it has not computed itself. FlightPlans checks keyframes
// and changes of plans (also that a vertex is within the range of coordinates when its plan changes),
// `validate` and ChangingScene check primitives, Session checks each time step, `check_played` checks a whole
// clip in advance (range_watch.hpp).

/// The largest admissible magnitude of a position during the motion.
template <class S>
inline constexpr S admissible_reach = 8 * admissible_magnitude<S>;

/// The largest magnitude of a time, in seconds.
inline constexpr double admissible_time = 0x1p900;

/// The largest number of corners of a primitive: a leaf of 16 primitives holds at most 65,535 vertices.
inline constexpr std::uint32_t most_corners = 4095;

/// Returns the shortest text that reads back as the same number, for messages.
std::string number_text(double value);

/// Returns "1e+30 in float" or the like, for messages.
template <class S>
std::string admissible_text();

/// Throws std::invalid_argument, with a text that begins with `what`, unless |t| <= admissible_time.
void check_time(double t, const std::string& what);

}  // namespace kbvh

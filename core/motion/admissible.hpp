#pragma once
#include <cstdint>
#include <string>

#include "core/geometry/predicates.hpp"

namespace kbvh {

// What a scene may hold and how far it may be played, checked where it enters and nowhere else:
//   coordinates and velocities  |x| <= admissible_magnitude<S>: 1e30 in float, 1e100 in double
//   positions                   |x| <= admissible_reach<S>, 8 times as much, up to the last time that is
//   asked
//                               for: vertices that fly on for ever must not be played beyond
//   times                       |t| <= admissible_time, 2^900 s (8e270 s)
//   primitives                  1 to most_corners corners
// So differences of positions are at most 1.6e31 in float, and areas and triple products of them finite in
// double: no strategy sees an infinity that it has not made itself. FlightPlans checks keyframes and changes
// of plans (also that a vertex is within the range of coordinates when its plan changes), `validate` and
// ChangingScene primitives, Session each time that it is moved to, `check_played` a whole clip in advance
// (range_watch.hpp).

/// The largest magnitude of a position that a vertex may fly to.
template <class S>
inline constexpr S admissible_reach = 8 * admissible_magnitude<S>;

/// The largest magnitude of a time, in seconds.
inline constexpr double admissible_time = 0x1p900;

/// The most corners of a primitive: a leaf of 16 primitives holds at most 65,535 vertices.
inline constexpr std::uint32_t most_corners = 4095;

/// The shortest text that reads back as the same number, for messages.
std::string number_text(double value);

/// "1e+30 in float", for messages.
template <class S>
std::string admissible_text();

/// Throws std::invalid_argument, beginning with `what`, unless |t| <= admissible_time.
void check_time(double t, const std::string& what);

}  // namespace kbvh

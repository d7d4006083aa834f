#pragma once
#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

namespace kbvh::io {

/// A curved motion to be sampled by keyframes, given by the positions of some points at every time.
struct CurvedMotion {
  std::vector<double> keys;   ///< increasing; between two of them the motion is smooth
  std::vector<double> jumps;  ///< those keys, increasing, at which the motion jumps
  /// Writes the points' coordinates, [point][3], always the same number. At a jump they are those after it.
  std::function<void(double time, std::vector<double>& out)> points;
};

struct KeyframeTimes {
  std::vector<double> times;
  std::size_t added = 0;  ///< between keys, for curves
  std::size_t jumps = 0;  ///< two keyframes at neighbouring doubles
};

/// Chooses the times of keyframes between which straight lines follow the motion: all keys; an additional
/// keyframe one double before each jump with the positions before it; and where a point is further than
/// `tolerance` from its chord at a quarter, the middle or three quarters of an interval, the middle, and so
/// on in both halves. Returns nothing if an interval would be cut into more than 4,096 pieces, or there would
/// be more than `most` keyframes. O(keyframes) calls of `points`.
std::optional<KeyframeTimes> follow(const CurvedMotion& motion, double tolerance, std::size_t most);

}  // namespace kbvh::io

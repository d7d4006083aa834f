#pragma once
#include <cstdint>
#include <string>

namespace kbvh::experiments {

/// Returns "about 40 s left: ", "about 3 min left: " or "about 5 h left: ", or "" for a negative number of
/// seconds.
std::string time_left_in_words(double seconds);

/// Estimates how long the remaining steps of a simulation take. Steps become slower and faster as a scene
/// develops, so recent steps weigh more: one in `memory` steps ago counts a third of the last one.
class StepsLeft {
 public:
  static constexpr double memory = 50;  // steps
  /// A step was made, after which `left` remain. `now` in seconds, of any clock that never goes back; the
  /// first call is where the clock starts.
  void made(std::uint64_t left, double now);
  /// Returns the estimated seconds, or a negative number during the first 3 s.
  double seconds() const;

 private:
  std::uint64_t left_ = 0, steps_ = 0;
  double began_ = 0, last_ = 0;
  double weight_ = 0, weighted_ = 0;  // of steps, and of their seconds
};

}  // namespace kbvh::experiments

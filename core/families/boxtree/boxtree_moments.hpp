#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/motion/flight_plans.hpp"

namespace kbvh {

/// Positions of one body at up to a given number of moments of its clip.
template <class S>
class ClipMoments {
 public:
  /// Evaluates positions at t and, if `moments` > 1, at evenly spread keyframes after t. O(vertices) per
  /// moment.
  ClipMoments(const FlightPlans<S>& plans, double t, std::size_t moments)
      : stride_(std::size_t(3) * plans.vertex_count() + 1) {
    const auto times = plans.keyframe_times();
    const auto later = std::size_t(std::upper_bound(times.begin(), times.end(), t) - times.begin());
    const std::size_t left = times.size() - later;
    count_ = 1 + std::min(left, moments - 1);
    room_.resize(count_ * stride_);
    plans.evaluate(t, room_.data());
    for (std::size_t m = 1; m < count_; ++m)
      plans.evaluate(times[later + (m * left) / (count_ - 1) - 1], room_.data() + m * stride_);
    positions_ = room_.data();
  }
  /// Refers to the positions of a single moment, without a copy.
  explicit ClipMoments(const S* positions) : positions_(positions) {}
  ClipMoments(const ClipMoments&) = delete;
  ClipMoments& operator=(const ClipMoments&) = delete;

  std::size_t count() const { return count_; }
  /// Returns the positions at a moment: [vertex][3].
  const S* positions(std::size_t moment) const { return positions_ + moment * stride_; }
  /// Returns the number of moments that limits the memory for a tree of `nodes` nodes to some 2^21 boxes; at
  /// least 2.
  static std::size_t most_of(std::uint32_t nodes) {
    constexpr std::size_t most_boxes = std::size_t(1) << 21;
    return std::max<std::size_t>(2, most_boxes / nodes);
  }

 private:
  std::size_t count_ = 1, stride_ = 0;
  std::vector<S> room_;
  const S* positions_ = nullptr;
};

}  // namespace kbvh

#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/events/kernels/row_scan.hpp"
#include "core/geometry/volumes/dop.hpp"
#include "core/motion/flight_plans.hpp"

namespace kbvh {

/// A copy of a body's keyframes in vertex order, made when a clip begins: one row of numbers per vertex and
/// direction. The search for a certificate's failure then reads memory in order, several keyframes at a time.
/// Along an axis the numbers are the coordinates. Along another direction they are projections, rounded to S
/// (projected_plan.hpp). Per-vertex plans are not included. Keyframes never change, and neither do the rows.
template <class S>
class KeyframeRows {
 public:
  /// Copies nothing yet: only the times may be asked for.
  KeyframeRows(const FlightPlans<S>& plans, std::span<const SlabDirection> directions);
  /// Copies the keyframes, again if they were copied before; O(keyframes x directions) time and memory.
  /// Copies nothing for a body with one keyframe, or with curves.
  void copy();

  std::span<const double> times() const { return times_; }
  /// Returns the values of a vertex along a direction, [keyframe]. Requires a body with several keyframes.
  const S* row(std::uint32_t vertex, std::size_t direction) const {
    return values_.data() + (direction * vertices_ + vertex) * times_.size();
  }
  /// Does the same as FlightPlans::segment_at. O(1) if keyframes are evenly spaced, otherwise O(log
  /// keyframes).
  std::size_t segment_at(double t) const;
  /// Returns the first keyframe in [from, end) at which row `a` is above row `b`, or `end`. Exact.
  std::size_t first_above(const S* a, const S* b, std::size_t from, std::size_t end) const {
    return kernels_->first_above(a, b, from, end);
  }
  /// Returns the first of vertices[first ..] that is ahead of `winner` on a side of the direction at a
  /// keyframe in [from, end), and that keyframe. Exact.
  RowAhead next_ahead(std::size_t direction, bool upper, std::span<const std::uint32_t> vertices,
                      std::size_t first, std::uint32_t winner, std::size_t from, std::size_t end) const {
    return kernels_->next_ahead[upper ? 1 : 0]({row(0, direction), times_.size()}, vertices.data(), first,
                                               vertices.size(), row(winner, direction), from, end);
  }
  /// Returns how often a vertex is in a list.
  std::uint32_t occurrences(std::span<const std::uint32_t> vertices, std::uint32_t vertex) const {
    return kernels_->occurrences(vertices.data(), vertices.size(), vertex);
  }
  std::size_t bytes() const { return values_.capacity() * sizeof(S); }

 private:
  const FlightPlans<S>* plans_;
  std::span<const SlabDirection> directions_;
  std::span<const double> times_;  ///< of the plans
  std::size_t vertices_;
  double per_second_ = 0;  ///< average number of keyframes per second
  std::vector<S> values_;  ///< [direction][vertex][keyframe], and padding
  const RowScanKernels<S>* kernels_;
};

extern template class KeyframeRows<float>;
extern template class KeyframeRows<double>;

}  // namespace kbvh

#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/events/kernels/row_scan.hpp"
#include "core/motion/flight_plans.hpp"

namespace kbvh {

/// A copy of a body's keyframes, vertex by vertex: one row of numbers for each vertex and axis, so that the
/// search for a certificate's failure reads memory in order, several keyframes at a time. Plans of single
/// vertices are not in it. Keyframes never change, so neither do the rows.
template <class S>
class KeyframeRows {
 public:
  /// O(keyframes), and as much memory; nothing for a body with one keyframe.
  explicit KeyframeRows(const FlightPlans<S>& plans);

  std::span<const double> times() const { return times_; }
  /// Values of a vertex along an axis, [keyframe]. Only for bodies with several keyframes.
  const S* row(std::uint32_t vertex, int axis) const {
    return values_.data() + (std::size_t(axis) * vertices_ + vertex) * times_.size();
  }
  /// As FlightPlans::segment_at. O(1) where keyframes are evenly spaced, else O(log keyframes).
  std::size_t segment_at(double t) const;
  /// The first keyframe in [from, end) at which row `a` is above row `b`, or `end`. Exact.
  std::size_t first_above(const S* a, const S* b, std::size_t from, std::size_t end) const {
    return kernels_->first_above(a, b, from, end);
  }
  /// The first of vertices[first .. count) that is ahead of `winner` on a side of the axis, and at which
  /// keyframe in [from, end). Exact.
  RowAhead next_ahead(int axis, bool upper, std::span<const std::uint32_t> vertices, std::size_t first,
                      std::uint32_t winner, std::size_t from, std::size_t end) const {
    return kernels_->next_ahead[upper ? 1 : 0]({row(0, axis), times_.size()}, vertices.data(), first,
                                               vertices.size(), row(winner, axis), from, end);
  }
  std::size_t bytes() const { return values_.size() * sizeof(S); }

 private:
  std::span<const double> times_;  ///< the plans'
  std::size_t vertices_;
  double per_second_ = 0;  ///< keyframes, on average
  std::vector<S> values_;  ///< [axis][vertex][keyframe], and padding
  const RowScanKernels<S>* kernels_;
};

extern template class KeyframeRows<float>;
extern template class KeyframeRows<double>;

}  // namespace kbvh

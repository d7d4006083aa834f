#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/families/wide/wide_hierarchy.hpp"
#include "core/scene/motion_view.hpp"

namespace kbvh {

/// A wide hierarchy whose boxes are computed at their first use in a frame. Computing the boxes of one node
/// alone costs several times as much per coordinate as in a batch; the nodes that recent queries visited are
/// therefore computed together, before the next query. Derived classes compute the boxes.
template <class S>
class RowsOnDemand {
 public:
  /// Lays out a topology; all boxes are out of date.
  void assign(Topology topology, const Primitives& primitives, KernelSet kernels) {
    hierarchy_.assign(std::move(topology), primitives, kernels);
    stale_.assign(hierarchy_.node_count(), 1);
    visited_.clear();
    visited_.reserve(hierarchy_.node_count());
  }

  WideHierarchy<S>& hierarchy() { return hierarchy_; }
  const WideHierarchy<S>& hierarchy() const { return hierarchy_; }
  /// Returns, by wide node, a value that is not 0 while the boxes of the node's children are out of date.
  const std::uint8_t* stale() const { return stale_.data(); }
  /// Returns whether the box of a node of the topology is current: it is if the rows of its wide parent are,
  /// or those of the root for the root.
  bool current(std::uint32_t node) const {
    const std::uint32_t parent = hierarchy_.wide_parent(node);
    return stale_[parent == WideHierarchy<S>::no_node ? 0 : parent] == 0;
  }

  /// Discards all boxes and the visits learnt from queries, so that a replayed clip costs the same as the
  /// first run.
  void start_over() {
    std::fill(stale_.begin(), stale_.end(), std::uint8_t(1));
    visited_.clear();
    frames_ = 0;
    plans_changed();
  }
  /// Marks all boxes as out of date, after a change of the time or of realisers. A body that rests from the
  /// last time to the new one keeps its boxes.
  void new_frame(const SegmentMotion<S>& motion, std::uint32_t body) {
    const double t = motion.time();
    if (t <= rests_until_) return;
    hierarchy_.positions_changed();
    std::fill(stale_.begin(), stale_.end(), std::uint8_t(1));
    ++frames_;
    if (line_ends_[0] == nullptr || t >= line_times_[1]) find_lines(motion, body);
  }
  /// Ends the body's rest and its current segment, after a change of its vertices' plans.
  void plans_changed() {
    rests_until_ = -std::numeric_limits<double>::infinity();
    line_ends_[0] = nullptr;
  }
  /// Marks all boxes as current, after a refit of the whole hierarchy.
  void refitted() {
    std::fill(stale_.begin(), stale_.end(), std::uint8_t(0));
    visited_.clear();
  }

 protected:
  static constexpr std::size_t made_together = 16;  ///< nodes per batch

  /// Returns the nodes to compute before a query: those that recent queries visited, or at least the root.
  /// Returns nothing if they are current.
  std::span<const std::uint32_t> due() {
    if (hierarchy_.empty()) return {};
    if (frames_ >= visits_kept) {
      visited_.clear();
      frames_ = 0;
    }
    if (stale_[0] == 0) return {};
    if (visited_.empty()) visited_.push_back(0);
    return visited_;
  }
  /// Records the visit to a node that a query waits for. Returns the node.
  std::span<const std::uint32_t> visit(std::uint32_t node) {
    visited_.push_back(node);
    return {&visited_.back(), 1};
  }
  void computed(std::uint32_t node) { stale_[node] = 0; }

  /// Returns whether positions can be interpolated between `line_end(0)` and `line_end(1)`, the stored
  /// positions at the ends of the body's segment.
  bool on_lines() const { return line_ends_[0] != nullptr; }
  const S* line_end(std::size_t end) const { return line_ends_[end]; }
  double line_time(std::size_t end) const { return line_times_[end]; }

  std::size_t bytes_on_demand() const {
    return hierarchy_.bytes() + stale_.capacity() + visited_.capacity() * sizeof(std::uint32_t);
  }

 private:
  static constexpr std::uint32_t visits_kept = 16;  ///< frames after which visits are learnt again

  void find_lines(const SegmentMotion<S>& motion, std::uint32_t body) {
    line_ends_[0] = nullptr;
    if (!motion.as_in_the_scene(body) || motion.on_curves(body)) return;
    if (motion.at_rest(body)) {
      rests_until_ = motion.lines_end(body);
      return;
    }
    const double begin = motion.lines_begin(body), end = motion.lines_end(body);
    if (!std::isfinite(begin) || !std::isfinite(end) || !(begin < end)) return;
    std::vector<S> unused;  // keyframes are stored
    line_ends_[0] = motion.positions_on_lines(body, begin, unused);
    line_ends_[1] = motion.positions_on_lines(body, end, unused);
    line_times_[0] = begin;
    line_times_[1] = end;
  }

  WideHierarchy<S> hierarchy_;
  std::vector<std::uint8_t> stale_;
  std::vector<std::uint32_t> visited_;  ///< nodes computed since the list was last cleared, parents first
  std::uint32_t frames_ = 0;            ///< frames since then
  double rests_until_ = -std::numeric_limits<double>::infinity();
  const S* line_ends_[2] = {nullptr, nullptr};
  double line_times_[2] = {0, 0};
};

}  // namespace kbvh

#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/separation/pair_tree.hpp"

namespace kbvh {

/// Two overlapping leaves, and the earliest possible begin of their overlap.
struct OverlappingLeaves {
  std::uint32_t a, b, slot;
  double since;
};
/// An overlap that has ended: its body pair, its leaves, and the latest possible end.
struct EndedOverlap {
  std::uint32_t bodies;
  OverlappingLeaves leaf;
  double until;
};

/// Stores the overlapping leaves of each body pair, from which a separation list answers queries. While spans
/// are recorded, also stores the overlaps that have ended. `BoxPair::place` is the index of a pair among the
/// overlapping leaves of its body pair.
class LeafOverlaps {
 public:
  void resize(std::size_t body_pairs) { leaves_.resize(body_pairs); }
  void clear() {
    for (auto& leaves : leaves_) leaves.clear();
  }
  /// Returns the overlapping leaves of one body pair, unordered.
  std::span<const OverlappingLeaves> of(std::size_t body_pair) const { return leaves_[body_pair]; }

  void begin(PairTree& tree, std::uint32_t slot, double since) {
    BoxPair& pair = tree[slot];
    auto& leaves = leaves_[pair.bodies];
    pair.place = std::uint32_t(leaves.size());
    leaves.push_back({pair.a, pair.b, slot, since});
  }
  void end(PairTree& tree, std::uint32_t slot, double until) {
    BoxPair& pair = tree[slot];
    auto& leaves = leaves_[pair.bodies];
    if (recording_) ended_.push_back({pair.bodies, leaves[pair.place], until});
    tree[leaves.back().slot].place = pair.place;
    leaves[pair.place] = leaves.back();
    leaves.pop_back();
    pair.place = PairTree::none;
  }

  /// Starts recording ended overlaps. Overlaps that last already count from t.
  void start_spans(double t) {
    for (auto& leaves : leaves_)
      for (OverlappingLeaves& leaf : leaves) leaf.since = t;
    ended_.clear();
    recording_ = true;
  }
  bool is_recording() const { return recording_; }
  std::span<const EndedOverlap> stop_spans() {
    recording_ = false;
    return ended_;
  }
  std::size_t bytes() const {
    std::size_t total = leaves_.capacity() * sizeof(leaves_[0]) + ended_.capacity() * sizeof(EndedOverlap);
    for (const auto& leaves : leaves_) total += leaves.capacity() * sizeof(OverlappingLeaves);
    return total;
  }

 private:
  std::vector<std::vector<OverlappingLeaves>> leaves_;  ///< [body pair]
  bool recording_ = false;
  std::vector<EndedOverlap> ended_;
};

}  // namespace kbvh

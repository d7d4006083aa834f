#pragma once
#include <algorithm>
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
///
/// If all leaves of two bodies have one primitive each, also stores the primitive pairs of the overlapping
/// leaves, contiguous and in the same order. Pairs within one body are left out: they need a filter.
class LeafOverlaps {
 public:
  void resize(std::size_t body_pairs) {
    leaves_.resize(body_pairs);
    primitives_.resize(body_pairs);
  }
  void clear() {
    for (auto& leaves : leaves_) leaves.clear();
    for (auto& primitives : primitives_) primitives.clear();
    notes_changes_ = false;
  }
  /// Returns the overlapping leaves of one body pair, unordered.
  std::span<const OverlappingLeaves> of(std::size_t body_pair) const { return leaves_[body_pair]; }
  /// Returns the primitive pairs of the overlapping leaves, in the same order, or nothing.
  std::span<const PrimitivePair> primitives_of(std::size_t body_pair) const { return primitives_[body_pair]; }

  void begin(PairTree& tree, std::uint32_t slot, double since) {
    BoxPair& pair = tree[slot];
    auto& leaves = leaves_[pair.bodies];
    pair.place = std::uint32_t(leaves.size());
    leaves.push_back({pair.a, pair.b, slot, since});
    if (!stores_primitives(tree, pair.bodies)) return;
    primitives_[pair.bodies].push_back(primitives(tree, pair));
    note(primitives_[pair.bodies].back(), 1);
  }
  void end(PairTree& tree, std::uint32_t slot, double until) {
    BoxPair& pair = tree[slot];
    auto& leaves = leaves_[pair.bodies];
    if (recording_) ended_.push_back({pair.bodies, leaves[pair.place], until});
    tree[leaves.back().slot].place = pair.place;
    leaves[pair.place] = leaves.back();
    leaves.pop_back();
    if (auto& stored = primitives_[pair.bodies]; !stored.empty()) {
      note(stored[pair.place], -1);
      stored[pair.place] = stored.back();
      stored.pop_back();
    }
    pair.place = PairTree::none;
  }

  /// Rereads the primitives of all leaves, after a change of geometry.
  void reread_primitives(const PairTree& tree) {
    for (std::uint32_t bodies = 0; bodies < leaves_.size(); ++bodies) {
      for (const PrimitivePair& pair : primitives_[bodies]) note(pair, -1);
      primitives_[bodies].clear();
      if (leaves_[bodies].empty() || !stores_primitives(tree, bodies)) continue;
      for (const OverlappingLeaves& leaf : leaves_[bodies])
        primitives_[bodies].push_back(primitives(tree, tree[leaf.slot]));
      for (const PrimitivePair& pair : primitives_[bodies]) note(pair, 1);
    }
  }

  /// Starts to record the primitive pairs that begin and end, until `clear`.
  void start_noting() {
    notes_changes_ = true;
    changes_.clear();
  }
  bool is_noting() const { return notes_changes_; }
  /// Appends the primitive pairs that have begun and those that have ended since the last call, or since
  /// `start_noting`. O(n log n) in the overlaps that began or ended.
  void take_changes(PairBuffer& begun, PairBuffer& ended) {
    add_up_changes();
    for (const Change& change : changes_) (change.by > 0 ? begun : ended).push_back(change.pair);
    changes_.clear();
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
    std::size_t total = leaves_.capacity() * sizeof(leaves_[0]) + ended_.capacity() * sizeof(EndedOverlap) +
                        changes_.capacity() * sizeof(Change);
    for (const auto& leaves : leaves_) total += leaves.capacity() * sizeof(OverlappingLeaves);
    for (const auto& primitives : primitives_)
      total += sizeof primitives + primitives.capacity() * sizeof(PrimitivePair);
    return total;
  }

 private:
  /// A primitive pair of two leaves whose overlap began (1) or ended (-1).
  struct Change {
    PrimitivePair pair;
    int by;
  };
  static bool stores_primitives(const PairTree& tree, std::uint32_t bodies) {
    const BodyPair& pair = tree.body_pair(bodies);
    return pair.first != pair.second && tree.topology(pair.first).leaf_size == 1 &&
           tree.topology(pair.second).leaf_size == 1;
  }
  void note(const PrimitivePair& pair, int by) {
    if (!notes_changes_) return;
    changes_.push_back({pair, by});
    if (changes_.size() >= add_up_at_) add_up_changes();
  }
  /// Keeps one change of each pair, and none if the pair is in its former state.
  void add_up_changes() {
    std::sort(changes_.begin(), changes_.end(),
              [](const Change& a, const Change& b) { return a.pair < b.pair; });
    std::size_t kept = 0;
    for (std::size_t i = 0; i < changes_.size();) {
      Change sum = changes_[i];
      for (++i; i < changes_.size() && changes_[i].pair == sum.pair; ++i) sum.by += changes_[i].by;
      if (sum.by != 0) changes_[kept++] = sum;
    }
    changes_.resize(kept);
    add_up_at_ = std::max<std::size_t>(1024, 4 * kept);
  }
  static PrimitivePair primitives(const PairTree& tree, const BoxPair& pair) {
    const auto primitive = [&](int side) {
      const TopologyNode leaf = tree.node(pair, side);
      KBVH_ASSERT(leaf.count() == 1);
      return tree.topology(tree.body_of(pair, side)).primitives[leaf.first()];
    };
    return {tree.body_of(pair, 0), primitive(0), tree.body_of(pair, 1), primitive(1)};
  }

  std::vector<std::vector<OverlappingLeaves>> leaves_;  ///< [body pair]
  std::vector<PairBuffer> primitives_;                  ///< [body pair]
  bool recording_ = false;
  std::vector<EndedOverlap> ended_;
  bool notes_changes_ = false;
  std::vector<Change> changes_;
  std::size_t add_up_at_ = 1024;  ///< bounds the list if no changes are requested
};

}  // namespace kbvh

#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <stdexcept>
#include <vector>

#include "core/base/assert.hpp"
#include "core/base/list_pool.hpp"
#include "core/families/separation/changed_boxes.hpp"
#include "core/scene/pairs.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// Two boxes of a body pair, and their position in the tree of pairs. 40 bytes.
struct BoxPair {
  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();

  std::uint32_t a, b;             ///< nodes of the first and the second body
  std::uint32_t parent = none;    ///< slot of the parent
  std::uint32_t children = none;  ///< first of a block of slots, none of which may be in use
  std::uint32_t row_index[2];     ///< index in the row of a, and in the row of b (PairTree::row)
  std::uint32_t place = none;     ///< index among the overlapping leaves of the body pair
  std::uint32_t bodies = 0;       ///< number of the body pair
  std::uint32_t depth = 0;        ///< depth below the pair of roots
  bool used = false, overlapping = false;
  bool scheduled = false;  ///< has an event in the queue
  bool dirty = false;      ///< has a node with other children, during a change of geometry
};
static_assert(sizeof(BoxPair) == 40);

/// The tree of pairs of a separation list (separation_list.hpp). Stores pairs in blocks of siblings,
/// addressed by slot. Each node has one row for each position (first or second) that it can have in a pair:
/// the slots of the pairs in which it has that position, contiguous. Also numbers the body pairs. Uses
/// topologies only; motion and bounds are not stored here.
class PairTree {
 public:
  static constexpr std::uint32_t none = BoxPair::none;

  /// Refers to the topologies of a scene's bodies; every call reads their current state. `pairs` are all body
  /// pairs that will ever be entered.
  PairTree(const std::vector<const Topology*>& topologies, std::span<const BodyPair> pairs) {
    for (const Topology* topology : topologies) {
      bodies_.push_back({topology, {}, {}, {}});
      block_ = std::max(block_, topology->width * topology->width);
    }
    for (const BodyPair& pair : pairs) {
      bodies_[pair.first].takes_part[0] = true;
      bodies_[pair.second].takes_part[1] = true;
    }
  }
  const Topology& topology(std::uint32_t body) const { return *bodies_[body].topology; }
  /// Makes rows for all current nodes. The number of rows never shrinks, because ids are never given up.
  void follow_topologies() {
    for (Body& body : bodies_)
      for (const int side : {0, 1})
        if (body.takes_part[side] && body.rows[side].keys() < body.topology->size())
          body.rows[side].resize(body.topology->size());
  }
  /// Removes all pairs. Body pairs keep their numbers.
  void clear() {
    pairs_.clear();
    free_blocks_.clear();
    for (Body& body : bodies_)
      for (ListPool& rows : body.rows) rows.clear();
  }

  // ---- Body pairs

  /// Enters a body pair and returns its number.
  std::uint32_t enter(const BodyPair& pair) {
    if (free_numbers_.empty()) {
      body_pairs_.push_back(pair);
      return std::uint32_t(body_pairs_.size() - 1);
    }
    const std::uint32_t number = free_numbers_.back();
    free_numbers_.pop_back();
    body_pairs_[number] = pair;
    return number;
  }
  /// Removes a body pair that has no pairs of boxes.
  void leave(std::uint32_t number) {
    body_pairs_[number] = unused;
    free_numbers_.push_back(number);
  }
  void leave_all() {
    body_pairs_.clear();
    free_numbers_.clear();
  }
  /// Returns the number of body-pair numbers, including unused ones.
  std::uint32_t body_pair_count() const { return std::uint32_t(body_pairs_.size()); }
  bool is_entered(std::uint32_t number) const { return body_pairs_[number].first != unused.first; }
  const BodyPair& body_pair(std::uint32_t number) const { return body_pairs_[number]; }
  bool both_have_nodes(std::uint32_t number) const {
    return is_entered(number) && !topology(body_pairs_[number].first).empty() &&
           !topology(body_pairs_[number].second).empty();
  }

  // ---- Pairs of boxes

  BoxPair& operator[](std::uint32_t slot) { return pairs_[slot]; }
  const BoxPair& operator[](std::uint32_t slot) const { return pairs_[slot]; }
  /// Returns all pairs by slot, including unused slots.
  std::span<const BoxPair> pairs() const { return pairs_; }
  std::uint32_t slots() const { return std::uint32_t(pairs_.size()); }
  std::uint32_t slot_capacity() const { return std::uint32_t(pairs_.capacity()); }

  std::uint32_t body_of(const BoxPair& pair, int side) const {
    return side == 0 ? body_pairs_[pair.bodies].first : body_pairs_[pair.bodies].second;
  }
  TopologyNode node(const BoxPair& pair, int side) const {
    return topology(body_of(pair, side)).nodes[side == 0 ? pair.a : pair.b];
  }
  bool both_leaves(const BoxPair& pair) const { return node(pair, 0).is_leaf() && node(pair, 1).is_leaf(); }

  /// Returns the slots of the pairs that have the node on a side: 0 for the first node, 1 for the second.
  std::span<const std::uint32_t> row(std::uint32_t body, int side, std::uint32_t node) const {
    const ListPool& rows = bodies_[body].rows[side];
    return node < rows.keys() ? rows[node] : std::span<const std::uint32_t>();
  }
  /// Returns whether any pair has the node.
  bool has_pairs(std::uint32_t body, std::uint32_t node) const {
    return !row(body, 0, node).empty() || !row(body, 1, node).empty();
  }
  void prefetch_rows(const BoxPair& pair) const {
    for (const int side : {0, 1}) {
      const ListPool& rows = bodies_[body_of(pair, side)].rows[side];
      rows.prefetch(side == 0 ? pair.a : pair.b);
    }
  }
  void prefetch_rows(std::uint32_t body, std::uint32_t node) const {
    for (const ListPool& rows : bodies_[body].rows)
      if (node < rows.keys()) rows.prefetch(node);
  }
  void prefetch(std::uint32_t slot) const { __builtin_prefetch(pairs_.data() + slot); }
  void prefetch_block(std::uint32_t block) const {
    constexpr std::uint32_t line = 64 / sizeof(BoxPair);
    for (std::uint32_t slot = block; slot < block + block_; slot += line) prefetch(slot);
  }
  void prefetch_nodes(const BoxPair& pair) const {
    for (const int side : {0, 1})
      __builtin_prefetch(&topology(body_of(pair, side)).nodes[side == 0 ? pair.a : pair.b]);
  }
  /// Calls work(body, node) for each node of the pairs that an overlap of the pair would make.
  template <class Work>
  void for_children(const BoxPair& pair, const Work& work) const {
    for (const int side : {0, 1}) {
      const TopologyNode own = node(pair, side);
      if (own.is_leaf()) continue;
      for (std::uint32_t child = own.first(); child < own.first() + own.count(); ++child)
        work(body_of(pair, side), child);
    }
  }
  bool has_node(std::uint32_t slot, std::uint32_t body, std::uint32_t node) const {
    const BodyPair& bodies = body_pairs_[pairs_[slot].bodies];
    return (bodies.first == body && pairs_[slot].a == node) ||
           (bodies.second == body && pairs_[slot].b == node);
  }

  /// Returns a block of slots for siblings, all unused. May move the pairs in memory. Throws
  /// std::length_error beyond 2^32 pairs.
  std::uint32_t new_block() {
    if (!free_blocks_.empty()) {
      const std::uint32_t block = free_blocks_.back();
      free_blocks_.pop_back();
      return block;
    }
    const std::size_t block = pairs_.size();
    if (block + block_ >= none) throw std::length_error("a separation list of more than 2^32 pairs");
    pairs_.resize(block + block_);
    return std::uint32_t(block);
  }
  /// Releases a block of slots. Requires that none of them is in use.
  void free_block(std::uint32_t block) { free_blocks_.push_back(block); }
  /// Calls work(slot) for each pair of a block. `work` may remove that pair.
  template <class Work>
  void for_block(std::uint32_t block, const Work& work) const {
    for (std::uint32_t slot = block; slot < block + block_ && pairs_[slot].used; ++slot) work(slot);
  }

  /// Makes a pair in an unused slot, and links it from its boxes. Within a block, used slots must come first.
  void insert(std::uint32_t slot, std::uint32_t bodies, std::uint32_t a, std::uint32_t b,
              std::uint32_t parent, std::uint32_t depth) {
    BoxPair& pair = pairs_[slot];
    pair = {};
    pair.a = a;
    pair.b = b;
    pair.parent = parent;
    pair.depth = depth;
    pair.bodies = bodies;
    pair.used = true;
    for (const int side : {0, 1}) {
      ListPool& rows = bodies_[body_of(pair, side)].rows[side];
      const std::uint32_t own = side == 0 ? a : b;
      pair.row_index[side] = rows.push(own, slot);
    }
  }
  /// Makes the pairs of a pair's children in a new block, and calls made(slot) for each. A leaf stands for
  /// itself against the children of the other node.
  template <class Made>
  void insert_children(std::uint32_t parent, const Made& made) {
    const std::uint32_t block = new_block();
    pairs_[parent].children = block;
    const BoxPair pair = pairs_[parent];  // by value: new_block may move the pairs
    const TopologyNode a = node(pair, 0), b = node(pair, 1);
    const std::uint32_t begin_a = a.is_leaf() ? pair.a : a.first(), count_a = a.is_leaf() ? 1 : a.count();
    const std::uint32_t begin_b = b.is_leaf() ? pair.b : b.first(), count_b = b.is_leaf() ? 1 : b.count();
    std::uint32_t child = block;
    for (std::uint32_t i = begin_a; i < begin_a + count_a; ++i)
      for (std::uint32_t j = begin_b; j < begin_b + count_b; ++j) {
        insert(child, pair.bodies, i, j, parent, pair.depth + 1);
        made(child++);
      }
  }
  /// Makes the roots of the pair tree within one body: for each inner node, a block with one pair for every
  /// two of its children. Calls made_block(block), then made(slot) for each pair of the block. O(nodes).
  template <class MadeBlock, class Made>
  void insert_self_roots(std::uint32_t bodies, const MadeBlock& made_block, const Made& made) {
    const Topology& own = topology(body_pairs_[bodies].first);
    std::vector<std::uint32_t> inner;
    if (!own.nodes[0].is_leaf()) inner.push_back(0);
    while (!inner.empty()) {
      const TopologyNode parent = own.nodes[inner.back()];
      inner.pop_back();
      const std::uint32_t end = parent.first() + parent.count();
      for (std::uint32_t child = parent.first(); child < end; ++child)
        if (!own.nodes[child].is_leaf()) inner.push_back(child);
      if (parent.count() < 2) continue;
      std::uint32_t slot = new_block();
      made_block(slot);
      for (std::uint32_t a = parent.first(); a < end; ++a)
        for (std::uint32_t b = a + 1; b < end; ++b) {
          insert(slot, bodies, a, b, none, 0);
          made(slot++);
        }
    }
  }
  /// Removes a pair. Its block stays allocated.
  void remove(std::uint32_t slot) {
    BoxPair& pair = pairs_[slot];
    for (const int side : {0, 1}) {
      ListPool& rows = bodies_[body_of(pair, side)].rows[side];
      const std::uint32_t moved = rows.erase_at(side == 0 ? pair.a : pair.b, pair.row_index[side]);
      pairs_[moved].row_index[side] = pair.row_index[side];
    }
    pair.used = false;
  }

  /// Replaces `tops` by the highest pairs that have a changed node and will stay. A pair with a gone node
  /// does not stay, and nothing below it stays; its nearest ancestor without a gone node counts as changed.
  /// The search uses only the tree of pairs, which still represents the trees before the change, whatever the
  /// ids mean now. An id that lost its meaning lay below a node that the trees have reported. O(pairs that
  /// have a changed node, times the depth).
  void find_highest_changed(std::span<const ChangedBoxes::Node> nodes, std::vector<std::uint32_t>& tops) {
    for (const auto& changed : nodes) {
      if (!changed.gone) continue;
      Body& body = bodies_[changed.body];
      body.gone.resize(std::max<std::size_t>(body.gone.size(), changed.node + 1), 0);
      body.gone[changed.node] = 1;
    }
    changed_.clear();
    for (const auto& node : nodes)
      for (const int side : {0, 1})
        for (std::uint32_t top : row(node.body, side, node.node)) {
          while (pairs_[top].parent != none && has_gone_node(pairs_[top])) top = pairs_[top].parent;
          if (pairs_[top].dirty) continue;
          pairs_[top].dirty = true;
          changed_.push_back(top);
        }
    tops.clear();
    for (const std::uint32_t slot : changed_) {
      std::uint32_t above = pairs_[slot].parent;
      while (above != none && !pairs_[above].dirty) above = pairs_[above].parent;
      if (above == none) tops.push_back(slot);
    }
    for (const std::uint32_t slot : changed_) pairs_[slot].dirty = false;
    for (const auto& changed : nodes)
      if (changed.gone) bodies_[changed.body].gone[changed.node] = 0;
  }

  std::size_t bytes() const {
    std::size_t total = pairs_.capacity() * sizeof(BoxPair) + body_pairs_.capacity() * sizeof(BodyPair) +
                        (free_blocks_.capacity() + changed_.capacity()) * sizeof(std::uint32_t);
    for (const Body& body : bodies_) total += body.rows[0].bytes() + body.rows[1].bytes() + body.gone.size();
    return total;
  }

 private:
  static constexpr BodyPair unused{none, none};

  struct Body {
    const Topology* topology;
    std::array<ListPool, 2> rows;    ///< [side] rows of the nodes, if the body takes part on that side
    std::array<bool, 2> takes_part;  ///< [side]
    std::vector<std::uint8_t> gone;  ///< [node] is gone, during a change of geometry
  };

  bool has_gone_node(const BoxPair& pair) const {
    const auto gone = [&](std::uint32_t body, std::uint32_t node) {
      return node < bodies_[body].gone.size() && bodies_[body].gone[node] != 0;
    };
    return gone(body_of(pair, 0), pair.a) || gone(body_of(pair, 1), pair.b);
  }

  std::uint32_t block_ = 4;  ///< maximum number of children of a pair
  std::vector<BoxPair> pairs_;
  std::vector<std::uint32_t> free_blocks_;
  std::vector<Body> bodies_;
  std::vector<BodyPair> body_pairs_;  ///< by number
  std::vector<std::uint32_t> free_numbers_;
  std::vector<std::uint32_t> changed_;
};

}  // namespace kbvh

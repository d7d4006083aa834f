#pragma once
#include <compare>
#include <cstdint>
#include <vector>

#include "core/families/events/event_log.hpp"

namespace kbvh {

/// Observer through which kinetic trees report to a separation list. Collects changed boxes in the order of
/// the notices, and nodes that edits of the trees changed or removed.
struct ChangedBoxes {
  static constexpr Side all_sides = 6;
  struct Box {
    std::uint32_t body, node;
    Side side = all_sides;  ///< the side with a new realiser
    auto operator<=>(const Box&) const = default;
  };

  /// A node that an insertion or a deletion changed. The node has other children, became a leaf, ceased to be
  /// a leaf, or is `gone`. The id of a gone node is unused, or belongs to another node now.
  struct Node {
    std::uint32_t body, node;
    bool gone;
  };
  std::vector<Box>* boxes;
  std::vector<Node>* nodes;

  template <class S, class Exact>
  void realiser_changed(std::uint32_t body, std::uint32_t node, Side side, std::uint32_t /*old_vertex*/,
                        std::uint32_t /*new_vertex*/, const Instant<S, Exact>& /*now*/) {
    boxes->push_back({body, node, side});
  }
  void realiser_plan_changed(std::uint32_t body, std::uint32_t node) { boxes->push_back({body, node}); }
  void leaf_split(std::uint32_t body, std::uint32_t node, std::uint32_t /*first_child*/) {
    nodes->push_back({body, node, false});
  }
  void node_removed(std::uint32_t body, std::uint32_t node) { nodes->push_back({body, node, true}); }
  void node_moved(std::uint32_t body, std::uint32_t from, std::uint32_t to) {
    nodes->push_back({body, from, true});
    nodes->push_back({body, to, false});
  }
  void subtree_rebuilt(std::uint32_t body, std::uint32_t node) { nodes->push_back({body, node, false}); }
};

/// ChangedBoxes that also forwards changes of realisers to `bounds`, the observer of bounds.
template <class S>
struct WatchedBoxes : ChangedBoxes {
  BoundObserver<S> bounds;

  bool reads_instants() const { return bounds.reads_instants(); }

  template <class T, class Exact>
  void realiser_changed(std::uint32_t body, std::uint32_t node, Side side, std::uint32_t old_vertex,
                        std::uint32_t new_vertex, const Instant<T, Exact>& now) {
    ChangedBoxes::realiser_changed(body, node, side, old_vertex, new_vertex, now);
    bounds.realiser_changed(body, node, side, old_vertex, new_vertex, now);
  }
};

}  // namespace kbvh

#pragma once
#include <cstdint>

#include "core/families/events/event.hpp"

namespace kbvh {

/// The observer of a kinetic tree that ignores all changes; the interface of observers.
///
/// An observer may also have any of the following functions, which report how insertions and deletions change
/// the nodes. They are called after the edit of the topology is complete, and before the resulting changes of
/// realisers are reported:
///   leaf_split(body, node, first_child)            a leaf became the parent of first_child, which holds the
///                                                  leaf's former primitives, and of first_child + 1, which
///                                                  holds the new primitive
///   leaf_changed(body, node)                       a leaf has other primitives, or is a new root
///   node_removed(body, node)                       a leaf lost its last primitive; its id is free
///   node_moved(body, from, to)                     the subtree of `from` is now that of `to`, which was
///                                                  its parent or a removed sibling; `from` is free
///   subtree_rebuilt(body, node)                    all nodes below an inner node are new
/// New nodes have `no_vertex` as old realisers. An observer may also have `reads_instants()`: while it
/// returns false, the tree does not compute exact times of events for the observer.
struct NoObserver {
  static constexpr bool reads_instants() { return false; }
  template <class S, class Exact>
  void realiser_changed(std::uint32_t /*body*/, std::uint32_t /*node*/, Side /*side*/,
                        std::uint32_t /*old_vertex*/, std::uint32_t /*new_vertex*/,
                        const Instant<S, Exact>& /*now*/) {}
  void realiser_plan_changed(std::uint32_t /*body*/, std::uint32_t /*node*/) {}
};

/// Returns whether an observer needs the exact times of events.
template <class Observer>
bool reads_instants(const Observer& observer) {
  if constexpr (requires { observer.reads_instants(); }) return observer.reads_instants();
  return true;
}

}  // namespace kbvh

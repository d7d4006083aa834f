#pragma once
#include <cstdint>
#include <vector>

#include "core/families/wide/wide_hierarchy.hpp"
#include "core/parallel/workers.hpp"

namespace kbvh {

/// The refits of several bodies on several threads: large bodies by subtrees, small ones several at a time.
/// The nodes above the subtrees are refitted by one thread afterwards. Every box is written once, by one
/// thread; different threads write to one cache line at most where their ranges of nodes meet.
template <class S>
class SharedRefit {
 public:
  /// Starts anew, without bodies.
  void start() {
    refits_.clear();
    items_.clear();
    gathered_ = none_gathered;
  }
  /// Adds the refit of a body, into its own boxes or, as WideHierarchy::refit_into, into others.
  void add(WideHierarchy<S>& hierarchy, const S* positions) {
    const WideArrays<S> arrays = hierarchy.arrays();
    add(hierarchy, positions, arrays.child_bounds, arrays.node_bounds);
  }
  void add(const WideHierarchy<S>& hierarchy, const S* positions, S* child_bounds, S* node_bounds) {
    const auto refit = std::uint32_t(refits_.size());
    refits_.push_back({&hierarchy, positions, child_bounds, node_bounds});
    if (hierarchy.can_be_shared()) {
      for (const auto& subtree : hierarchy.subtrees())
        items_.push_back({refit, refit + 1, subtree.begin, subtree.end});
      gathered_ = none_gathered;
      return;
    }
    if (gathered_ + hierarchy.node_count() > nodes_at_once) {
      items_.push_back({refit, refit, 0, 0});
      gathered_ = 0;
    }
    items_.back().end = refit + 1;
    gathered_ += hierarchy.node_count();
  }
  void run(Workers& workers) {
    workers.for_each(items_.size(), [this](std::size_t i, std::uint32_t) {
      const Item& item = items_[i];
      for (std::uint32_t k = item.first; k < item.end; ++k) {
        const Refit& refit = refits_[k];
        if (item.end_node != 0)
          refit.hierarchy->refit_into(refit.child_bounds, refit.node_bounds, refit.positions, item.begin_node,
                                      item.end_node);
        else
          refit.hierarchy->refit_into(refit.child_bounds, refit.node_bounds, refit.positions);
      }
    });
    for (const Refit& refit : refits_) {
      if (!refit.hierarchy->can_be_shared()) continue;
      for (const std::uint32_t node : refit.hierarchy->above_subtrees())
        refit.hierarchy->refit_into(refit.child_bounds, refit.node_bounds, refit.positions, node, node + 1);
    }
  }
  std::size_t bytes() const { return refits_.capacity() * sizeof(Refit) + items_.capacity() * sizeof(Item); }

 private:
  /// Small bodies share an item up to this number of nodes.
  static constexpr std::uint32_t nodes_at_once = 64, none_gathered = nodes_at_once + 1;
  struct Refit {
    const WideHierarchy<S>* hierarchy;
    const S* positions;
    S *child_bounds, *node_bounds;
  };
  /// The nodes [begin_node, end_node) of one refit; if there are none, all nodes of refits.
  struct Item {
    std::uint32_t first, end, begin_node, end_node;
  };
  std::vector<Refit> refits_;
  std::vector<Item> items_;
  std::uint32_t gathered_ = none_gathered;  ///< nodes of the last item, if bodies may be added to it
};

}  // namespace kbvh

#pragma once
#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/families/wide/wide_hierarchy.hpp"
#include "core/parallel/workers.hpp"

namespace kbvh {

/// The refits of several bodies on several threads: large bodies by subtrees, small ones several at a time.
/// Afterwards one thread refits the nodes above the subtrees. Every box is written once, by one thread;
/// different threads write to the same cache line only where their ranges of nodes meet.
template <class S>
class SharedRefit {
 public:
  /// Starts over, without bodies.
  void start() {
    refits_.clear();
    items_.clear();
    gathered_ = none_gathered;
  }
  /// Adds the refit of a body, into its own boxes or, like WideHierarchy::refit_into, into others.
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
    for_each_range(workers, [](const Refit& refit, std::uint32_t begin, std::uint32_t end) {
      if (begin == 0 && end == refit.hierarchy->node_count())  // edited hierarchies have their own order
        refit.hierarchy->refit_into(refit.child_bounds, refit.node_bounds, refit.positions);
      else
        refit.hierarchy->refit_into(refit.child_bounds, refit.node_bounds, refit.positions, begin, end);
    });
  }
  /// Makes all boxes empty, without positions: each node's boxes in the memory of the thread that will refit
  /// it.
  void make_empty(Workers& workers) {
    for_each_range(workers, [](const Refit& refit, std::uint32_t begin, std::uint32_t end) {
      const std::size_t lanes = lane_scalars(refit.hierarchy->width());
      std::fill(refit.child_bounds + begin * lanes, refit.child_bounds + end * lanes,
                std::numeric_limits<S>::infinity());
      std::fill(refit.node_bounds + std::size_t(8) * begin, refit.node_bounds + std::size_t(8) * end, S(0));
    });
  }
  /// Moves the boxes and vertex lists of hierarchies, in the order of the added refits, to the memory of the
  /// threads that will refit them.
  void place(Workers& workers, std::span<WideHierarchy<S>> hierarchies) {
    std::vector<typename WideHierarchy<S>::Placed> places;
    for (const WideHierarchy<S>& hierarchy : hierarchies) places.push_back(hierarchy.new_place());
    for_each_range(workers, [&](const Refit& refit, std::uint32_t begin, std::uint32_t end) {
      refit.hierarchy->place(places[std::size_t(&refit - refits_.data())], begin, end);
    });
    for (std::size_t i = 0; i < places.size(); ++i) hierarchies[i].take_place(std::move(places[i]));
  }
  std::size_t bytes() const { return refits_.capacity() * sizeof(Refit) + items_.capacity() * sizeof(Item); }

 private:
  /// Calls work(refit, begin, end) for ranges that together cover all nodes, children before their parents.
  template <class Work>
  void for_each_range(Workers& workers, const Work& work) {
    workers.for_each(items_.size(), [&](std::size_t i, std::uint32_t) {
      const Item& item = items_[i];
      for (std::uint32_t k = item.first; k < item.end; ++k)
        if (item.end_node != 0)
          work(refits_[k], item.begin_node, item.end_node);
        else
          work(refits_[k], 0, refits_[k].hierarchy->node_count());
    });
    for (const Refit& refit : refits_) {
      if (!refit.hierarchy->can_be_shared()) continue;
      for (const std::uint32_t node : refit.hierarchy->above_subtrees()) work(refit, node, node + 1);
    }
  }
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

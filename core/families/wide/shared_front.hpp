#pragma once
#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/parallel/workers.hpp"
#include "core/scene/pairs.hpp"

namespace kbvh {

/// Marks a leaf as computed; returns whether the caller is the first to do so and has to compute it. Several
/// threads may ask for the same leaf: all but one are refused, and the rows may be read after the next
/// Workers::for_each.
inline bool claim_leaf(std::uint32_t& stamp, std::uint32_t current) {
  // Uses builtins: std::atomic_ref is missing from some standard libraries. Most leaves are claimed already.
  if (__atomic_load_n(&stamp, __ATOMIC_RELAXED) == current) return false;
  return __atomic_exchange_n(&stamp, current, __ATOMIC_RELAXED) != current;
}

/// The work of simultaneous traversals, cut into items that threads share. One traversal works from the top
/// of its stack to the bottom. Each pair on the stack is therefore an item, and the answers of the items, one
/// after another, are the answer of the traversal in its order. The front expands the topmost pairs, level by
/// level, until there are enough items; pairs of leaves found on the way become items at their places.
///
/// Threads then traverse the items, and keep the pairs of leaves that they find in their own memory. The
/// pairs found are then cut again, into batches of nearly equal size.
///
/// Calls for each of several traversals (pairs of bodies), numbered from 0:
///   step(traversal, state)   continues the traversal of the pairs on the stack of `state`
class SharedFront {
 public:
  /// Pairs of leaves that one traversal found, consecutive in its order.
  struct Batch {
    std::uint32_t traversal;
    std::span<const LeafSlot> pairs;  ///< first, second, ...
  };

  /// Pairs of leaves per batch: some tens of microseconds of work; and their leaves.
  static constexpr std::size_t batch_pairs = 256, most_batch_slots = 2 * batch_pairs;

  /// Starts over, without traversals.
  void start() {
    items_.clear();
    found_.clear();
    expansion_tests_ = 0;
  }
  /// Adds a traversal that starts at the roots; it follows those already added.
  void add(std::uint32_t traversal) { items_.push_back({{0, 0}, traversal, Item::pair, 0, 0}); }

  /// Expands the front, and traverses it. Calls `take(batch, runner)` with pairs of leaves as they are found,
  /// in any order. Returns the box tests made.
  template <class Step, class Take>
  std::uint64_t traverse(Workers& workers, const Step& step, const Take& take) {
    runners_.resize(workers.threads());
    for (Runner& runner : runners_) {
      runner.stack.resize(std::max<std::size_t>(runner.stack.size(), 1024));
      runner.out.resize(2 * leaf_pairs_at_once);
      runner.found.clear();
      runner.tests = 0;
    }
    const std::size_t enough = items_per_thread * workers.threads();
    for (std::uint32_t level = 0; level < most_levels && items_.size() < enough; ++level)
      if (!expand(step)) break;
    const Parts cut{items_.size(), std::max<std::size_t>(1, items_.size() / (2 * enough))};
    workers.for_each(cut.parts(), [&](std::size_t part, std::uint32_t r) {
      for (std::size_t i = cut.begin(part); i < cut.end(part); ++i) traverse_item(items_[i], r, step, take);
    });
    std::uint64_t tests = expansion_tests_;
    std::size_t all = 0, deepest = 0;
    for (const Runner& runner : runners_) {
      all += runner.found.size();
      deepest = std::max(deepest, runner.stack.size());
    }
    // Another frame may give all work to one thread; no memory is then allocated.
    for (Runner& runner : runners_) {
      runner.found.reserve(all);
      runner.stack.resize(deepest);
    }
    for (const Runner& runner : runners_) tests += runner.tests;
    cut_batches();
    return tests;
  }

  /// Returns the found pairs of leaves, in the order of the traversals. Valid until the next `start`.
  std::span<const Batch> batches() const { return batches_; }

  std::size_t bytes() const {
    std::size_t total = (items_.capacity() + next_.capacity()) * sizeof(Item) +
                        found_.capacity() * sizeof(LeafSlot) + batches_.capacity() * sizeof(Batch);
    for (const Runner& runner : runners_)
      total += sizeof runner + runner.stack.capacity() * sizeof(WidePair) +
               (runner.out.capacity() + runner.found.capacity()) * sizeof(LeafSlot);
    return total;
  }

 private:
  /// Items per thread: enough that no item is long compared with a thread's share.
  static constexpr std::size_t items_per_thread = 24;
  static constexpr std::uint32_t most_levels = 12;
  /// The same as `leaf_pair_room`: the pairs stay in the cache.
  static constexpr std::size_t leaf_pairs_at_once = 2048;

  /// A pair to be traversed, or, afterwards, pairs of leaves found by a runner: [begin, end) of its list.
  struct Item {
    WidePair nodes;
    std::uint32_t traversal;
    static constexpr std::uint32_t pair = ~std::uint32_t(0), front = pair - 1;
    std::uint32_t finder;  ///< `pair`: to be traversed; `front`: found by `expand`; else the runner
    std::size_t begin, end;
  };
  struct alignas(cache_line) Runner {
    std::vector<WidePair> stack;
    std::vector<LeafSlot> out, found;
    std::uint64_t tests = 0;
  };

  /// Replaces each pair by the pairs of its children. Returns whether there are pairs left.
  template <class Step>
  bool expand(const Step& step) {
    Runner& room = runners_[0];
    next_.clear();
    bool more = false;
    for (const Item& item : items_) {
      if (item.finder != Item::pair) {
        next_.push_back(item);
        continue;
      }
      WideTraversal state = traversal_of(room, item);
      state.test_limit = 1;  // one step
      step(item.traversal, state);
      expansion_tests_ += state.tests;
      if (state.found > 0) {
        next_.push_back(
            {{0, 0}, item.traversal, Item::front, found_.size(), found_.size() + 2 * state.found});
        found_.insert(found_.end(), state.out, state.out + 2 * state.found);
      }
      for (; state.depth > 0; more = true)
        next_.push_back({state.stack[--state.depth], item.traversal, Item::pair, 0, 0});
    }
    items_.swap(next_);
    return more;
  }

  static WideTraversal traversal_of(Runner& room, const Item& item) {
    room.stack[0] = item.nodes;
    return {room.stack.data(),  1, room.stack.size(), room.out.data(), 0,
            leaf_pairs_at_once, 0, ~std::uint64_t(0)};
  }

  template <class Step, class Take>
  void traverse_item(Item& item, std::uint32_t r, const Step& step, const Take& take) {
    if (item.finder == Item::front)
      return take(Batch{item.traversal, {found_.data() + item.begin, found_.data() + item.end}}, r);
    Runner& room = runners_[r];
    WideTraversal state = traversal_of(room, item);
    item.finder = r;
    item.begin = room.found.size();
    while (state.depth > 0) {
      step(item.traversal, state);
      const std::span<const LeafSlot> pairs(state.out, 2 * state.found);
      take(Batch{item.traversal, pairs}, r);
      room.found.insert(room.found.end(), pairs.begin(), pairs.end());
      state.found = 0;
      if (state.depth + max_pairs_per_step < state.stack_room) continue;
      room.stack.resize(2 * room.stack.size());
      state.stack = room.stack.data();
      state.stack_room = room.stack.size();
    }
    item.end = room.found.size();
    room.tests += state.tests;
  }

  void cut_batches() {
    batches_.clear();
    for (const Item& item : items_) {
      const std::vector<LeafSlot>& list = item.finder == Item::front ? found_ : runners_[item.finder].found;
      for (std::size_t begin = item.begin; begin < item.end; begin += 2 * batch_pairs)
        batches_.push_back(
            {item.traversal, {list.data() + begin, std::min(item.end - begin, 2 * batch_pairs)}});
    }
  }

  std::vector<Item> items_, next_;
  std::vector<LeafSlot> found_;  ///< by `expand`
  std::vector<Runner> runners_;
  std::vector<Batch> batches_;
  std::uint64_t expansion_tests_ = 0;
};

}  // namespace kbvh

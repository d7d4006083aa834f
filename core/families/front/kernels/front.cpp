#include "core/families/front/kernels/front.hpp"

#include "core/families/wide/kernels/wide_traverse.hpp"

namespace kbvh {
namespace {

/// The lanes of each mask of eight bits, ascending; 0 behind them.
struct LaneLists {
  std::uint64_t of[256][8];
};
constexpr LaneLists make_lane_lists() {
  LaneLists lists{};
  for (unsigned mask = 0; mask < 256; ++mask)
    for (unsigned lane = 0, n = 0; lane < 8; ++lane)
      if ((mask >> lane & 1) != 0) lists.of[mask][n++] = lane;
  return lists;
}
constexpr LaneLists lane_lists = make_lane_lists();

constexpr unsigned low_bits(unsigned count) {
  return (1U << count) - 1;
}

/// Appends pairs of leaves: `pair` with each lane of a mask added, `shift` bits up. Writes eight pairs; those
/// after the last lane do not count. The number of lanes changes from call to call, so a loop over the lanes
/// would be mispredicted each time.
template <unsigned shift>
[[gnu::always_inline]] inline void emit_lanes(FrontUpdate& update, std::uint64_t pair, unsigned mask) {
  static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "a pair is stored as one number, first slot low");
  using V = Vector<std::uint64_t, native_lanes<std::uint64_t>>;
  LeafSlot* const out = update.out + 2 * update.found;
  for (std::size_t k = 0; k < 8; k += native_lanes<std::uint64_t>)
    store_lanes(out + 2 * k, (load_lanes<V>(lane_lists.of[mask] + k) << shift) + pair);
  update.found += unsigned(__builtin_popcount(mask));
}
[[gnu::always_inline]] inline void emit_seconds(FrontUpdate& update, LeafSlot first, std::uint32_t node,
                                                unsigned mask) {
  emit_lanes<32>(update, first.word | std::uint64_t(LeafSlot::of(node, 0)) << 32, mask);
}
[[gnu::always_inline]] inline void emit_firsts(FrontUpdate& update, std::uint32_t node, LeafSlot second,
                                               unsigned mask) {
  emit_lanes<0>(update, LeafSlot::of(node, 0) | std::uint64_t(second.word) << 32, mask);
}

template <class S>
[[gnu::always_inline]] inline bool meet(const SixSides<S>& a, const SixSides<S>& b) {
  bool all = true;
  for (int axis = 0; axis < 3; ++axis)
    all &= a.lower[axis] <= b.upper[axis] && b.lower[axis] <= a.upper[axis];
  return all;
}

/// A front between two hierarchies, or within one.
template <class S, std::uint32_t width, bool within_one>
struct Front {
  StoredView<S, width> view;
  const WideArrays<S>&a, &b;
  FrontUpdate& update;

  [[gnu::always_inline]] void push(std::uint32_t first, std::uint32_t second) {
    update.stack[update.depth++] = {first, second, 0};
    ++update.descended;
  }
  /// Keeps the entry unless its boxes are apart; its parent has found the same, because it compares the same
  /// boxes. `own_boxes_meet()` is called only if no children overlap.
  template <class Meet>
  [[gnu::always_inline]] void keep(const FrontPair& pair, std::uint64_t met, const Meet& own_boxes_meet) {
    if (met != 0 || own_boxes_meet())
      update.kept[update.kept_count++] = {pair.first, pair.second, met};
    else
      ++update.climbed;
  }

  [[gnu::always_inline]] void nodes(const FrontPair& pair) {
    const WideNode node_a = a.nodes[pair.first], node_b = b.nodes[pair.second];
    const unsigned leaves_b = low_bits(node_b.leaf_count);
    std::uint64_t met = 0, leaves = 0;
    unsigned rows = view.meeting_a(pair.first, view.own_b(pair.second));
    update.tests += node_a.count + std::uint64_t(unsigned(__builtin_popcount(rows))) * node_b.count;
    for (; rows != 0; rows &= rows - 1) {
      const std::uint32_t i = lowest(rows);
      unsigned row = view.meeting_b(pair.second, view.lane_a(pair.first, i));
      // For a node paired with itself, the other half mirrors this one.
      if (within_one && pair.first == pair.second) row &= ~0U << i;
      met |= std::uint64_t(row) << (8 * i);
      if (i < node_a.leaf_count) {
        leaves |= std::uint64_t(leaves_b) << (8 * i);
        emit_seconds(update, {LeafSlot::of(pair.first, i)}, pair.second, row & leaves_b);
      }
    }
    for (std::uint64_t fresh = met & ~(pair.met | leaves); fresh != 0; fresh &= fresh - 1) {
      const unsigned bit = unsigned(__builtin_ctzll(fresh));
      push(child(node_a, pair.first, bit / 8), child(node_b, pair.second, bit % 8));
    }
    keep(pair, met,
         [&] { return meet(own_box(a.node_bounds + std::size_t(8) * pair.first), view.own_b(pair.second)); });
  }
  [[gnu::always_inline]] void leaf_and_node(const FrontPair& pair) {
    const LeafSlot leaf{pair.first & ~WidePair::leaf_bit};
    const WideNode node = b.nodes[pair.second];
    const SixSides<S> box = view.lane_a(leaf.node(), leaf.lane());
    const unsigned met = view.meeting_b(pair.second, box), leaves = low_bits(node.leaf_count);
    update.tests += node.count;
    emit_seconds(update, leaf, pair.second, met & leaves);
    for (unsigned fresh = met & ~(unsigned(pair.met) | leaves); fresh != 0; fresh &= fresh - 1)
      push(pair.first, child(node, pair.second, lowest(fresh)));
    keep(pair, met, [&] { return meet(box, view.own_b(pair.second)); });
  }
  [[gnu::always_inline]] void node_and_leaf(const FrontPair& pair) {
    const LeafSlot leaf{pair.second & ~WidePair::leaf_bit};
    const WideNode node = a.nodes[pair.first];
    const SixSides<S> box = view.lane_b(leaf.node(), leaf.lane());
    const unsigned met = view.meeting_a(pair.first, box), leaves = low_bits(node.leaf_count);
    update.tests += node.count;
    emit_firsts(update, pair.first, leaf, met & leaves);
    for (unsigned fresh = met & ~(unsigned(pair.met) | leaves); fresh != 0; fresh &= fresh - 1)
      push(child(node, pair.first, lowest(fresh)), pair.second);
    keep(pair, met, [&] { return meet(own_box(a.node_bounds + std::size_t(8) * pair.first), box); });
  }
};

template <class S, std::uint32_t width, bool within_one>
void update_front(WideArrays<S> a, WideArrays<S> b, FrontUpdate& shared) {
  FrontUpdate update = shared;
  Front<S, width, within_one> front{StoredView<S, width>(a, b), a, b, update};
  while (!update.done() && update.tests < update.test_limit &&
         update.depth + max_pairs_per_step < update.stack_room && update.kept_count < update.kept_room &&
         update.found + front_step < update.out_room) {
    const FrontPair pair = update.depth > 0 ? update.stack[--update.depth] : update.old[update.next++];
    if (((pair.first | pair.second) & WidePair::leaf_bit) == 0)
      front.nodes(pair);
    else if ((pair.first & WidePair::leaf_bit) != 0)
      front.leaf_and_node(pair);
    else
      front.node_and_leaf(pair);
  }
  shared = update;
}

template <class S>
constexpr FrontKernels<S> table{
    {&update_front<S, 2, false>, &update_front<S, 4, false>, &update_front<S, 8, false>},
    {&update_front<S, 2, true>, &update_front<S, 4, true>, &update_front<S, 8, true>}};

}  // namespace

namespace kernels::KBVH_KERNELS {
const FrontKernels<float> front_float = table<float>;
const FrontKernels<double> front_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh

#include "core/broad_phase/kernels/group_traversal.hpp"

#include "core/families/wide/kernels/wide_traverse.hpp"

namespace kbvh {
namespace {

/// Returns a mask. Bit i: the groups and masks in lane i of the rows [2][8] admit pairs with the others.
[[gnu::always_inline]] inline unsigned admitting(const std::uint32_t* rows, std::uint32_t groups,
                                                 std::uint32_t mask) {
  constexpr std::size_t native = native_lanes<std::uint32_t>;
  constexpr std::size_t lanes = native < 8 ? native : 8;
  using V = Vector<std::uint32_t, lanes>;
  constexpr std::uint32_t none = 0;
  unsigned bits = 0;
  for (std::size_t i = 0; i < 8; i += lanes) {
    if constexpr (lanes == 1) {
      bits |= unsigned((rows[i] & mask) != none && (rows[8 + i] & groups) != none) << i;
    } else {
      const auto first = (load_lanes<V>(rows + i) & mask) != none;
      const auto second = (load_lanes<V>(rows + 8 + i) & groups) != none;
      bits |= mask_bits(first & second) << i;
    }
  }
  return bits;
}

/// Stored boxes with groups. A traversal asks for a box of one side, then for the children on the other side
/// that meet this box: the view keeps the groups that belong to the box.
template <class S, bool one>
struct GroupView : StoredView<S, 8> {
  static constexpr bool within_one = one;
  using Base = StoredView<S, 8>;
  GroupArrays groups_a, groups_b;
  std::uint32_t groups = 0, mask = 0;

  [[gnu::always_inline]] GroupView(const WideArrays<S>& a, const WideArrays<S>& b, const GroupArrays& of_a,
                                   const GroupArrays& of_b)
      : Base(a, b), groups_a(of_a), groups_b(of_b) {}
  [[gnu::always_inline]] void compare_with(std::uint32_t with_groups, std::uint32_t with_mask) {
    groups = with_groups;
    mask = with_mask;
  }
  [[gnu::always_inline]] SixSides<S> own_b(std::uint32_t node) {
    compare_with(groups_b.nodes[std::size_t(2) * node], groups_b.nodes[std::size_t(2) * node + 1]);
    return Base::own_b(node);
  }
  [[gnu::always_inline]] SixSides<S> lane_a(std::uint32_t node, std::uint32_t lane) {
    const std::uint32_t* const rows = groups_a.children + std::size_t(16) * node;
    compare_with(rows[lane], rows[8 + lane]);
    return Base::lane_a(node, lane);
  }
  [[gnu::always_inline]] SixSides<S> lane_b(std::uint32_t node, std::uint32_t lane) {
    const std::uint32_t* const rows = groups_b.children + std::size_t(16) * node;
    compare_with(rows[lane], rows[8 + lane]);
    return Base::lane_b(node, lane);
  }
  [[gnu::always_inline]] unsigned meeting_a(std::uint32_t node, const SixSides<S>& box) const {
    return Base::meeting_a(node, box) & admitting(groups_a.children + std::size_t(16) * node, groups, mask);
  }
  [[gnu::always_inline]] unsigned meeting_b(std::uint32_t node, const SixSides<S>& box) const {
    return Base::meeting_b(node, box) & admitting(groups_b.children + std::size_t(16) * node, groups, mask);
  }
};

template <class S, bool one>
void traverse(WideArrays<S> a, WideArrays<S> b, GroupArrays groups_a, GroupArrays groups_b,
              WideTraversal& state) {
  GroupView<S, one> view(a, b, groups_a, groups_b);
  traverse_pairs(a, b, view, state);
}

template <class S>
constexpr GroupTraversalKernels<S> table{&traverse<S, false>, &traverse<S, true>};

}  // namespace

namespace kernels::KBVH_KERNELS {
const GroupTraversalKernels<float> group_traversal_float = table<float>;
const GroupTraversalKernels<double> group_traversal_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh

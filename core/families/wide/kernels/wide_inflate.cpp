#include "core/families/wide/kernels/wide_inflate.hpp"

#include "core/families/wide/kernels/node_fit.hpp"

namespace kbvh {
namespace {

/// The smallest and the largest distance of vertices from the sides of stored boxes, inwards.
template <class S>
struct Room {
  S least, most;
};

/// Rows are lower and -upper, so that "inside" is "not smaller" in all six. Lanes that are empty in both
/// (infinity - infinity) do not count: a comparison with NaN is false, and `smaller` then keeps its second
/// argument.
template <class S, std::uint32_t width>
[[gnu::always_inline]] inline Room<S> room_of(const S* stored, const S* fresh) {
  constexpr std::size_t fit = native_lanes<S> < width ? native_lanes<S> : width;
  constexpr std::size_t lanes = fit * sizeof(S) < 16 ? 1 : fit;
  using V = Vector<S, lanes>;
  V least = V{} + S(__builtin_inf()), most = -least;
  for (std::size_t i = 0; i < std::size_t(6) * width; i += lanes) {
    const V room = load_lanes<V>(fresh + i) - load_lanes<V>(stored + i);
    least = smaller(room, least);
    most = larger(room, most);
  }
  if constexpr (lanes == 1) {
    return {least, most};
  } else {
    Room<S> result{least[0], most[0]};
    for (std::size_t i = 1; i < lanes; ++i)
      result = {smaller(least[i], result.least), larger(most[i], result.most)};
    return result;
  }
}

/// Compares and stores the box of an inflated node; returns whether it changed.
template <class S>
[[gnu::always_inline]] inline bool replace_own(S* node_bounds, const S* fresh) {
  bool changed = false;
  for (std::size_t i = 0; i < 8; ++i) {
    if (i == 3 || i == 7) continue;
    changed |= node_bounds[i] != fresh[i];
    node_bounds[i] = fresh[i];
  }
  return changed;
}

/// Corrects the lanes of nodes and the empty lanes of rows that hold the boxes of the leaves.
template <class S, std::uint32_t width>
[[gnu::noinline]] void put_right(const WideArrays<S>& h, const WideNode& node, S* rows, S* node_bounds) {
  for (std::uint32_t lane = node.leaf_count; lane < width; ++lane) {
    const S* box = NodeFit<S, width>::child_box(h, node, lane);
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      rows[axis * width + lane] = box[axis];
      rows[(axis + 3) * width + lane] = -box[axis + 4];
      node_bounds[axis] = smaller(node_bounds[axis], box[axis]);
      node_bounds[axis + 4] = larger(node_bounds[axis + 4], box[axis + 4]);
    }
  }
}

template <class S, std::uint32_t width>
void check_margins(MarginCheck<S>& shared) {
  constexpr std::size_t row_scalars = std::size_t(6) * width;
  MarginCheck<S> state = shared;
  const WideArrays<S>& h = state.hierarchy;
  S room = S(__builtin_inf()), room_before = S(__builtin_inf());
  std::uint64_t leaf_boxes = 0, inner_boxes = 0;
  alignas(64) S fresh[row_scalars], box[8], inflated[8];
  const auto inflate_box = [&] {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      inflated[axis] = box[axis] - state.margin;
      inflated[axis + 4] = box[axis + 4] + state.margin;
    }
  };
  // As in the refit: nodes with leaves only come first, in ascending order, then the others, children first.
  for (std::uint32_t i = 0; i < state.node_count; ++i) {
    const WideNode& node = h.nodes[i];
    if (node.leaf_count != node.count) continue;
    S* rows = h.child_bounds + i * row_scalars;
    NodeFit<S, width> fit;
    if (node.leaf_count == width)
      fit.from_lists(h.vertices + node.list, node.length, state.positions, fresh);
    else
      fit.from_lists_and_boxes(h, node, state.positions, fresh);
    fit.store_own(box);
    const Room<S> found = room_of<S, width>(rows, fresh);
    room_before = smaller(found.least, room_before);
    state.remade[i] = 0;
    if (found.least >= state.keep_from && found.most <= state.keep_to) {
      room = smaller(found.least, room);
      continue;
    }
    for (std::size_t k = 0; k < row_scalars; ++k) rows[k] = fresh[k] - state.margin;
    room = smaller(room_of<S, width>(rows, fresh).least, room);
    inflate_box();
    state.remade[i] = replace_own(h.node_bounds + std::size_t(8) * i, inflated) ? 1 : 0;
    leaf_boxes += node.count;
  }
  for (std::uint32_t i = state.node_count; i-- > 0;) {
    const WideNode& node = h.nodes[i];
    if (node.leaf_count == node.count) continue;
    bool changed = false;
    for (std::uint32_t c = node.first_child; c < node.first_child + (node.count - node.leaf_count); ++c)
      changed |= state.remade[c] != 0;
    S* rows = h.child_bounds + i * row_scalars;
    S* node_bounds = h.node_bounds + std::size_t(8) * i;
    state.remade[i] = 0;
    if (node.leaf_count == 0) {
      if (!changed) continue;
      const S* boxes[width];
      for (std::uint32_t lane = 0; lane < width; ++lane)
        boxes[lane] =
            lane < node.count ? h.node_bounds + std::size_t(8) * (node.first_child + lane) : empty_box<S>;
      NodeFit<S, width> fit;
      fit.from_boxes(boxes, rows);
      fit.store_own(inflated);
    } else {
      // Leaves next to nodes: leaf lanes are checked, the others are copied from the children.
      NodeFit<S, width> fit;
      fit.from_lists(h.vertices + node.list, node.length, state.positions, fresh);
      fit.store_own(box);
      alignas(64) S leaves_only[row_scalars], stored[row_scalars];
      for (std::uint32_t row = 0; row < 6; ++row)
        for (std::uint32_t lane = 0; lane < width; ++lane) {
          const bool leaf = lane < node.leaf_count;
          leaves_only[row * width + lane] = leaf ? fresh[row * width + lane] : S(__builtin_inf());
          stored[row * width + lane] = leaf ? rows[row * width + lane] : S(__builtin_inf());
        }
      const Room<S> found = room_of<S, width>(stored, leaves_only);
      room_before = smaller(found.least, room_before);
      if (found.least >= state.keep_from && found.most <= state.keep_to) {
        room = smaller(found.least, room);
        if (!changed) continue;
        // The leaves stay unchanged: the node's box is computed from the stored rows.
      } else {
        for (std::size_t k = 0; k < row_scalars; ++k) stored[k] = leaves_only[k] - state.margin;
        room = smaller(room_of<S, width>(stored, leaves_only).least, room);
        leaf_boxes += node.leaf_count;
      }
      for (std::uint32_t row = 0; row < 6; ++row)
        for (std::uint32_t lane = 0; lane < node.leaf_count; ++lane)
          rows[row * width + lane] = stored[row * width + lane];
      for (std::uint32_t axis = 0; axis < 3; ++axis) {
        S lower = rows[axis * width], upper = -rows[(axis + 3) * width];
        for (std::uint32_t lane = 1; lane < node.leaf_count; ++lane) {
          lower = smaller(rows[axis * width + lane], lower);
          upper = larger(-rows[(axis + 3) * width + lane], upper);
        }
        inflated[axis] = lower;
        inflated[axis + 4] = upper;
      }
      put_right<S, width>(h, node, rows, inflated);
    }
    state.remade[i] = replace_own(node_bounds, inflated) ? 1 : 0;
    if (changed) inner_boxes += std::uint32_t(node.count - node.leaf_count);
  }
  if (state.node_count > 1 && state.remade[0] != 0) ++inner_boxes;  // no row contains the root's box
  shared.room = room;
  shared.room_before = room_before;
  shared.leaf_boxes = leaf_boxes;
  shared.inner_boxes = inner_boxes;
}

}  // namespace

namespace kernels::KBVH_KERNELS {
const WideInflateKernels<float> wide_inflate_float{&check_margins<float, 2>, &check_margins<float, 4>,
                                                   &check_margins<float, 8>};
const WideInflateKernels<double> wide_inflate_double{&check_margins<double, 2>, &check_margins<double, 4>,
                                                     &check_margins<double, 8>};
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh

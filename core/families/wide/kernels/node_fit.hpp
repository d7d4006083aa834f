#pragma once
// Internal to kernels: the boxes of one wide node, from the vertices of its leaves and the boxes
// of its children.
#include <array>

#include "core/families/wide/kernels/wide_layout.hpp"
#include "core/kernels/quads.hpp"

namespace kbvh {
namespace {

template <class S>
constexpr S infinity = S(__builtin_inf());
/// The box of an empty lane.
template <class S>
constexpr S empty_box[8] = {infinity<S>,  infinity<S>,  infinity<S>,  infinity<S>,
                            -infinity<S>, -infinity<S>, -infinity<S>, -infinity<S>};

/// `width` lanes of minus infinity, then `width` of infinity.
template <class S, std::uint32_t width>
constexpr std::array<S, 2 * width> make_infinite_from() {
  std::array<S, 2 * width> lanes{};
  for (std::uint32_t lane = 0; lane < width; ++lane) {
    lanes[lane] = -infinity<S>;
    lanes[width + lane] = infinity<S>;
  }
  return lanes;
}
template <class S, std::uint32_t width>
constexpr std::array<S, 2 * width> infinite_from = make_infinite_from<S, width>();

/// Computes the boxes of the `width` children of a node into the node's rows and its own box: from one box
/// each (lower and upper corners, 8 numbers from one child to the next), or from a list of vertices.
template <class S, std::uint32_t width>
struct NodeFit {
  using P = Points<S, width == 8 ? 2 : 1>;
  using Pack = typename P::Pack;
  static constexpr std::uint32_t packs = width < 4 ? width : 4;
  static constexpr std::uint32_t per_pass = packs * std::uint32_t(P::points);

  Pack smallest, largest;

  /// Writes the rows of one pass over the children [first, first + per_pass).
  [[gnu::always_inline]] inline void take(Pack (&lower)[4], Pack (&upper)[4], S* rows, std::uint32_t first) {
    Pack low = lower[0], high = upper[0];
    for (std::uint32_t j = 1; j < packs; ++j) {
      low = smaller(low, lower[j]);
      high = larger(high, upper[j]);
    }
    for (std::uint32_t j = packs; j < 4; ++j) {
      lower[j] = lower[0];
      upper[j] = upper[0];
    }
    smallest = first == 0 ? low : smaller(smallest, low);
    largest = first == 0 ? high : larger(largest, high);
    P::template store_rows<false>(lower, rows + first, width, per_pass);
    P::template store_rows<true>(upper, rows + 3 * width + first, width, per_pass);
  }

  /// Returns pack j of the lanes from `first` on, in one row of the lists.
  [[gnu::always_inline]] static Pack listed(const std::uint32_t* row, std::uint32_t first, std::uint32_t j,
                                            const S* positions) {
    if constexpr (P::points == 2) {
      std::uint64_t two;  // one load for two numbers: loads limit this loop
      __builtin_memcpy(&two, row + 2 * j, sizeof two);
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
      return P::load(positions + std::uint32_t(two), positions + (two >> 32));
#else
      return P::load(positions + (two >> 32), positions + std::uint32_t(two));
#endif
    } else {
      return P::load(positions + row[list_place(first + j, width)], positions);
    }
  }

  /// Computes the boxes of the lanes of one pass from their lists.
  [[gnu::always_inline]] static void gather(const std::uint32_t* vertices, std::uint32_t length,
                                            const S* positions, std::uint32_t first, Pack (&lower)[4],
                                            Pack (&upper)[4]) {
    const std::uint32_t* row = vertices;
    for (std::uint32_t j = 0; j < packs; ++j) lower[j] = upper[j] = listed(row, first, j, positions);
    for (std::uint32_t i = 1; i < length; ++i) {
      row += width;
      for (std::uint32_t j = 0; j < packs; ++j) {
        const Pack p = listed(row, first, j, positions);
        lower[j] = smaller(lower[j], p);
        upper[j] = larger(upper[j], p);
      }
    }
  }

  [[gnu::always_inline]] inline void from_lists(const std::uint32_t* vertices, std::uint32_t length,
                                                const S* positions, S* rows) {
    for (std::uint32_t first = 0; first < width; first += per_pass) {
      Pack lower[4], upper[4];
      gather(vertices, length, positions, first, lower, upper);
      take(lower, upper, rows, first);
    }
  }

  /// Takes the lists of a node's leaves, the boxes of its nodes, and empty boxes for the other lanes. Works
  /// in registers: stores to single lanes of rows that had just been written took half the time of a SAH
  /// tree's refit.
  [[gnu::always_inline]] inline void from_lists_and_boxes(const WideArrays<S>& h, const WideNode& node,
                                                          const S* positions, S* rows) {
    // In lanes from `leaf_count` on, the lower bound becomes infinite, and the upper one minus infinity.
    const S* const least = infinite_from<S, width>.data() + width - node.leaf_count;
    for (std::uint32_t first = 0; first < width; first += per_pass) {
      Pack lower[4], upper[4];
      gather(h.vertices + node.list, node.length, positions, first, lower, upper);
      for (std::uint32_t j = 0; j < packs; ++j) {
        const std::uint32_t one = first + j, other = (first + j + 4) % width;
        lower[j] = larger(lower[j], P::all(least[one], least[other]));
        upper[j] = smaller(upper[j], P::all(-least[one], -least[other]));
        if (node.leaf_count == node.count) continue;
        const S *box = child_box(h, node, one), *other_box = child_box(h, node, other);
        lower[j] = smaller(lower[j], P::load(box, other_box));
        upper[j] = larger(upper[j], P::load(box + 4, other_box + 4));
      }
      take(lower, upper, rows, first);
    }
  }
  /// Returns the box of a child that is a node; an empty box for any other lane.
  [[gnu::always_inline]] static const S* child_box(const WideArrays<S>& h, const WideNode& node,
                                                   std::uint32_t lane) {
    const bool is_node = lane >= node.leaf_count && lane < node.count;
    return is_node ? h.node_bounds + std::size_t(8) * (node.first_child + lane - node.leaf_count)
                   : empty_box<S>;
  }

  /// Takes the child boxes boxes[lane], 8 numbers each.
  [[gnu::always_inline]] inline void from_boxes(const S* const (&boxes)[width], S* rows) {
    for (std::uint32_t first = 0; first < width; first += per_pass) {
      Pack lower[4], upper[4];
      for (std::uint32_t j = 0; j < packs; ++j) {
        const S *one = boxes[first + j], *other = boxes[(first + j + 4) % width];
        lower[j] = P::load(one, other);
        upper[j] = P::load(one + 4, other + 4);
      }
      take(lower, upper, rows, first);
    }
  }

  [[gnu::always_inline]] inline void store_own(S* node_bounds) const {
    P::store_smallest(node_bounds, smallest);
    P::store_largest(node_bounds + 4, largest);
  }
};

/// For few leaves next to nodes (SAH trees; the last nodes of a level): one box at a time.
template <class S, std::uint32_t width>
[[gnu::noinline]] void fit_single(const WideArrays<S>& h, const WideNode& node, const S* positions, S* rows,
                                  S* node_bounds) {
  using P = Points<S, 1>;
  alignas(64) S leaves[width][8];
  const S* boxes[width];
  for (std::uint32_t lane = 0; lane < width; ++lane) {
    if (lane < node.leaf_count) {
      const std::uint32_t* at = h.vertices + node.list + list_place(lane, width);
      auto lower = P::load(positions + *at, positions), upper = lower;
      for (std::uint32_t i = 1; i < node.length; ++i) {
        const auto p = P::load(positions + at[i * width], positions);
        lower = smaller(lower, p);
        upper = larger(upper, p);
      }
      P::store_smallest(leaves[lane], lower);
      P::store_largest(leaves[lane] + 4, upper);
      boxes[lane] = leaves[lane];
    } else {
      boxes[lane] = lane < node.count
                        ? h.node_bounds + std::size_t(8) * (node.first_child + lane - node.leaf_count)
                        : empty_box<S>;
    }
  }
  NodeFit<S, width> fit;
  fit.from_boxes(boxes, rows);
  fit.store_own(node_bounds);
}

/// Fits a node whose children are all leaves.
template <class S, std::uint32_t width>
[[gnu::always_inline]] inline void fit_leaves(const WideArrays<S>& h, const WideNode& node,
                                              const S* positions, S* rows, S* node_bounds) {
  NodeFit<S, width> fit;
  if (node.leaf_count == width)
    fit.from_lists(h.vertices + node.list, node.length, positions, rows);
  else
    fit.from_lists_and_boxes(h, node, positions, rows);
  fit.store_own(node_bounds);
}

/// Fits any other node; the own boxes of children that are nodes must be current.
template <class S, std::uint32_t width>
[[gnu::always_inline]] inline void fit_above(const WideArrays<S>& h, const WideNode& node, const S* positions,
                                             S* rows, S* node_bounds) {
  NodeFit<S, width> fit;
  if (2 * node.leaf_count >= width) {
    fit.from_lists_and_boxes(h, node, positions, rows);
    fit.store_own(node_bounds);
  } else if (node.leaf_count == 0) {
    const S* boxes[width];
    for (std::uint32_t lane = 0; lane < width; ++lane)
      boxes[lane] =
          lane < node.count ? h.node_bounds + std::size_t(8) * (node.first_child + lane) : empty_box<S>;
    fit.from_boxes(boxes, rows);
    fit.store_own(node_bounds);
  } else {
    fit_single<S, width>(h, node, positions, rows, node_bounds);
  }
}

}  // namespace
}  // namespace kbvh

#include "core/families/drift/kernels/near_pairs.hpp"

#include "core/families/wide/kernels/leaf_fit.hpp"
#include "core/families/wide/kernels/wide_traverse.hpp"

namespace kbvh {
namespace {

template <class S, std::size_t width>
constexpr std::size_t lanes_of = [] {
  constexpr std::size_t fit = native_lanes<S> < width ? native_lanes<S> : width;
  return fit * sizeof(S) < 16 ? std::size_t(1) : fit;  // there are no shorter registers
}();

// Gaps are compared with margins and reaches that exceed the values that these motions need by a relative
// 2^-16, which covers the roundings of gaps and margins. The remaining errors are shares of coordinates:
// `rounding` of both bodies, half a unit each for a side that is moved by two sums, and half a unit for
// products of roundings. The coordinates of one of the two boxes suffice, because those of the other differ
// by the gap.
template <class S>
constexpr S unit = sizeof(S) == 4 ? S(0x1p-24) : S(0x1p-53);
template <class S>
constexpr S least = sizeof(S) == 4 ? S(0x1p-126) : S(0x1p-1022);
template <class S>
[[gnu::always_inline]] inline S share_of(S side, S rounding) {
  return (rounding + 3 * unit<S>)*larger(side, -side) + least<S>;
}

/// A box to compare rows of the other body with: upper bounds, and negated lower bounds.
template <class S>
struct Bounds {
  S bound[6];
};
template <class S>
[[gnu::always_inline]] inline Bounds<S> bounds_of(const SixSides<S>& box) {
  return {{box.upper[0], box.upper[1], box.upper[2], -box.lower[0], -box.lower[1], -box.lower[2]}};
}

/// Returns the box, moved outwards by the largest error of vertices.
template <class S>
[[gnu::always_inline]] inline Bounds<S> loosened(Bounds<S> box, S rounding) {
  for (S& bound : box.bound) bound += share_of(bound, rounding);
  return box;
}

/// Returns a mask. Bit i: lane i of the rows, inflated by the margin, overlaps the box.
template <class S, std::size_t width>
[[gnu::always_inline]] inline unsigned widened(const S* rows, const Bounds<S>& box, const S* margin) {
  constexpr std::size_t lanes = lanes_of<S, width>;
  using V = Vector<S, lanes>;
  unsigned bits = 0;
  for (std::size_t i = 0; i < width; i += lanes) {
    V gap = load_lanes<V>(rows + i) - (box.bound[0] + margin[0]);
    for (std::size_t k = 1; k < 6; ++k)
      gap = larger(gap, load_lanes<V>(rows + k * width + i) - (box.bound[k] + margin[k]));
    const V zero = V{} + S(0);
    bits |= mask_bits(gap <= zero) << i;
  }
  return bits;
}

/// Returns a mask. Bit i: the gaps between lane i and the box are within reach on all sides. Writes the
/// largest used share of the reach.
template <class S, std::size_t width>
[[gnu::always_inline]] inline unsigned within_reach(const S* rows, const Bounds<S>& box,
                                                    const S* inverse_reach, S* ratios) {
  constexpr std::size_t lanes = lanes_of<S, width>;
  using V = Vector<S, lanes>;
  unsigned bits = 0;
  for (std::size_t i = 0; i < width; i += lanes) {
    V ratio = (load_lanes<V>(rows + i) - box.bound[0]) * inverse_reach[0];
    for (std::size_t k = 1; k < 6; ++k)
      ratio = larger(ratio, (load_lanes<V>(rows + k * width + i) - box.bound[k]) * inverse_reach[k]);
    const V one = V{} + S(1);
    store_lanes(ratios + i, ratio);
    bits |= mask_bits(ratio <= one) << i;
  }
  return bits;
}

template <class S, std::size_t padded>
[[gnu::always_inline]] inline const S* near_rows(const NearLeaves<S>& leaves, std::uint32_t leaf) {
  S* rows = leaves.rows + std::size_t(leaf) * 6 * padded;
  if (leaves.stamps[leaf] != leaves.stamp) {
    fit_leaf<S, padded>(leaves.lists, leaf, leaves.positions, rows);
    leaves.stamps[leaf] = leaves.stamp;
  }
  return rows;
}

template <class S, std::uint32_t width, std::size_t padded>
void near(LeafNear<S>& shared) {
  LeafNear<S> state = shared;
  const auto number = [](const WideArrays<S>& h, LeafSlot slot) {
    return h.nodes[slot.node()].first_leaf + slot.lane();
  };
  const WideLeafLists &lists_a = state.leaves_a.lists, &lists_b = state.leaves_b.lists;
  const S rounding = state.leaves_a.rounding + state.leaves_b.rounding;
  alignas(64) S ratios[padded];
  for (; state.next < state.count && state.found + leaf_pair_step <= state.out_room; ++state.next) {
    const LeafSlot slot_a = state.pairs[2 * state.next], slot_b = state.pairs[2 * state.next + 1];
    const std::uint32_t leaf_a = number(state.a, slot_a), leaf_b = number(state.b, slot_b);
    const S* rows_a = near_rows<S, padded>(state.leaves_a, leaf_a);
    const S* rows_b = near_rows<S, padded>(state.leaves_b, leaf_b);
    const std::uint32_t begin_a = lists_a.first_entry[leaf_a], begin_b = lists_b.first_entry[leaf_b];
    const std::uint32_t count_a = lists_a.end_entry[leaf_a] - begin_a;
    const std::uint32_t count_b = lists_b.end_entry[leaf_b] - begin_b;
    // The leaf box of b is inflated by the margin of b, the rows of a are not.
    const Bounds<S> box_b =
        loosened(bounds_of(lane_box(state.b.child_bounds + slot_b.node() * std::size_t(6) * width, width,
                                    slot_b.lane())),
                 state.leaves_a.rounding);
    unsigned first = widened<S, padded>(rows_a, box_b, state.leaves_a.margin);
    state.tests += count_a + std::uint64_t(unsigned(__builtin_popcount(first))) * count_b;
    for (; first != 0; first &= first - 1) {
      const std::uint32_t i = lowest(first), primitive_a = lists_a.primitives[begin_a + i];
      const Bounds<S> box_a = bounds_of(lane_box(rows_a, padded, i));
      unsigned second =
          within_reach<S, padded>(rows_b, loosened(box_a, rounding), state.inverse_reach, ratios);
      for (; second != 0; second &= second - 1) {
        const std::uint32_t j = lowest(second);
        bool overlap = true;
        for (std::size_t k = 0; k < 6; ++k) overlap = overlap && rows_b[k * padded + j] <= box_a.bound[k];
        const float ratio = float(ratios[j]);
        state.out[state.found++] = {primitive_a, lists_b.primitives[begin_b + j],
                                    overlap ? 0.0F : larger(ratio, 0x1p-126F)};
      }
    }
  }
  shared = state;
}

template <class S, std::uint32_t width>
void widen(WideArrays<S> h, std::uint32_t node_count, const S* margin, S rounding) {
  for (std::uint32_t n = 0; n < node_count; ++n) {
    S* rows = h.child_bounds + std::size_t(n) * 6 * width;
    for (std::size_t k = 0; k < 6; ++k)
      for (std::size_t i = 0; i < width; ++i) {
        S& side = rows[k * width + i];
        side -= margin[k] + share_of(side, rounding);
      }
    S* node_bounds = h.node_bounds + std::size_t(8) * n;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      node_bounds[axis] -= margin[axis] + share_of(node_bounds[axis], rounding);
      node_bounds[axis + 4] += margin[axis + 3] + share_of(node_bounds[axis + 4], rounding);
    }
  }
}

/// Processes three registers of coordinates, x, y, z, x, y, z, ... in memory order, at a time.
template <class S>
void drift(const S* now, const S* before, std::size_t vertices, S* interval) {
  constexpr std::size_t lanes = native_lanes<S>;
  using V = Vector<S, lanes>;
  const S infinity = S(__builtin_inf());
  V lower[3], upper[3];
  for (std::size_t j = 0; j < 3; ++j) {
    lower[j] = V{} + infinity;
    upper[j] = -lower[j];
  }
  const auto take = [&](std::size_t vertex) {
    for (std::size_t j = 0; j < 3; ++j) {
      const std::size_t at = 3 * vertex + j * lanes;
      const V way = load_lanes<V>(now + at) - load_lanes<V>(before + at);
      lower[j] = smaller(way, lower[j]);
      upper[j] = larger(way, upper[j]);
    }
  };
  std::size_t v = 0;
  for (; v + lanes <= vertices; v += lanes) take(v);
  if (v != vertices && vertices >= lanes) {
    take(vertices - lanes);  // the last ones again
    v = vertices;
  }
  S low[3 * lanes], high[3 * lanes];
  for (std::size_t j = 0; j < 3; ++j) {
    store_lanes(low + j * lanes, lower[j]);
    store_lanes(high + j * lanes, upper[j]);
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    interval[axis] = low[axis];
    interval[axis + 4] = high[axis];
  }
  for (std::size_t i = 3; i < 3 * lanes; ++i) {
    interval[i % 3] = smaller(low[i], interval[i % 3]);
    interval[4 + i % 3] = larger(high[i], interval[4 + i % 3]);
  }
  for (; v < vertices; ++v)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const S way = now[3 * v + axis] - before[3 * v + axis];
      interval[axis] = smaller(way, interval[axis]);
      interval[axis + 4] = larger(way, interval[axis + 4]);
    }
}

/// Returns a mask. Bit i is 0 only if coordinate i of a is larger.
template <class S>
[[gnu::always_inline]] inline unsigned not_larger(PlainPoint<S> a, PlainPoint<S> b) {
  return (a.v[0] <= b.v[0] ? 1u : 0u) | (a.v[1] <= b.v[1] ? 2u : 0u) | (a.v[2] <= b.v[2] ? 4u : 0u);
}
template <class V>
[[gnu::always_inline]] inline unsigned not_larger(V a, V b) {
  return mask_bits(a <= b);
}

template <class S>
std::size_t meeting(const FoundPair* pairs, std::size_t count, PrimitivesNow<S> a, PrimitivesNow<S> b,
                    FoundPair* out) {
  using P = Points<S, 1>;
  using Pack = typename P::Pack;
  const auto fit = [](const PrimitivesNow<S>& body, std::uint32_t primitive, Pack& lower, Pack& upper) {
    const std::uint32_t* corner = body.vertices + body.offsets[primitive];
    const std::uint32_t* end = body.vertices + body.offsets[primitive + 1];
    lower = upper = P::load(body.positions + std::size_t(3) * *corner, body.positions);
    for (++corner; corner != end; ++corner) {
      const Pack p = P::load(body.positions + std::size_t(3) * *corner, body.positions);
      lower = smaller(lower, p);
      upper = larger(upper, p);
    }
  };
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count; ++i) {
    Pack lower_a, upper_a, lower_b, upper_b;
    fit(a, pairs[i].primitive_a, lower_a, upper_a);
    fit(b, pairs[i].primitive_b, lower_b, upper_b);
    out[kept] = pairs[i];
    kept += (not_larger(lower_a, upper_b) & not_larger(lower_b, upper_a) & 7u) == 7u ? 1 : 0;
  }
  return kept;
}

template <class S>
constexpr NearKernels<S> table{{{&near<S, 2, 4>, &near<S, 2, 8>, &near<S, 2, 16>},
                                {&near<S, 4, 4>, &near<S, 4, 8>, &near<S, 4, 16>},
                                {&near<S, 8, 4>, &near<S, 8, 8>, &near<S, 8, 16>}},
                               {&widen<S, 2>, &widen<S, 4>, &widen<S, 8>},
                               &drift<S>,
                               &meeting<S>};

}  // namespace

namespace kernels::KBVH_KERNELS {
const NearKernels<float> near_float = table<float>;
const NearKernels<double> near_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh

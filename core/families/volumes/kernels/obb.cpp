// Oriented boxes in rows of eight lanes. u is half a unit in the last place of 1: the relative error of a
// rounding.
//
// Axes are orthonormal up to 16 u: their pairwise products differ by at most that from 0 and 1. A box is the
// set of centre + sum of u_i axis_i with |u_i| <= half_i. The box and the points below also lie within
// |axis_i . (p - centre)| <= half_i: the halves are enlarged for both (`half_margin`).
#include "core/families/volumes/kernels/obb.hpp"

#include "core/families/volumes/kernels/lane_points.hpp"
#include "core/families/wide/kernels/wide_traverse.hpp"

namespace kbvh {
namespace {

template <class S>
constexpr S unit = sizeof(S) == 4 ? S(0x1p-24) : S(0x1p-53);
/// Squared lengths between these numbers have their full precision.
template <class S>
constexpr S tiny = sizeof(S) == 4 ? S(0x1p-100) : S(0x1p-900);
template <class S>
constexpr S huge = sizeof(S) == 4 ? S(0x1p120) : S(0x1p1000);
/// More than the underflow of many products can lose.
template <class S>
constexpr S loss = sizeof(S) == 4 ? S(0x1p-140) : S(0x1p-1060);

/// Relative to the sum m of the furthest extents from the first point. Along an axis, a point's extent has an
/// error of 4.2 u m; the centre, of 6 u m, and the error of its coordinates (below). The axes' deviation from
/// right angles counts twice, with up to 16 u m each, and once more for the box as a sum of axes (2 * 18 u
/// m). Rounded up.
template <class S>
constexpr S half_margin = 96 * unit<S>;
/// Relative to the sum of the centre's coordinates, each rounded once.
template <class S>
constexpr S centre_margin = 4 * unit<S>;
/// For a separating axis, relative to the distance of the centres (as a sum of coordinates) and the sum of
/// all halves: the axes are within 32 u of exact right angles, which counts at most 10 times, and products of
/// products add up to 40 roundings.
template <class S>
constexpr S axis_margin = 512 * unit<S>;

template <class V>
struct Three {
  V x, y, z;
};
template <class V, class W>
[[gnu::always_inline]] inline auto product(const Three<V>& a, const Three<W>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class V>
[[gnu::always_inline]] inline Three<V> scaled(const Three<V>& a, V by) {
  return {a.x * by, a.y * by, a.z * by};
}
template <class V>
[[gnu::always_inline]] inline Three<V> minus(const Three<V>& a, const Three<V>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class Mask, class V>
[[gnu::always_inline]] inline Three<V> either(Mask first, const Three<V>& a, const Three<V>& b) {
  return {first ? a.x : b.x, first ? a.y : b.y, first ? a.z : b.z};
}
template <class V, class S>
[[gnu::always_inline]] inline Three<V> load_three(const S* from, std::size_t stride) {
  return {load_lanes<V>(from), load_lanes<V>(from + stride), load_lanes<V>(from + 2 * stride)};
}

/// Writes the axes of eight frames, [9][8], from their points [3][3][8].
template <class S>
[[gnu::always_inline]] inline void make_axes(const S* points, S* axes) {
  using V = Eighth<S>;
  for (std::size_t lane = 0; lane < 8; lane += eighth<S>) {
    const auto from = load_three<V>(points + lane, 8);
    const V none = {}, one = none + S(1);
    const Three<V> x_axis{one, none, none}, y_axis{none, one, none};
    const Three<V> edge = minus(load_three<V>(points + 24 + lane, 8), from);
    const V edge_square = product(edge, edge);
    const V edge_length = root(edge_square);
    const Three<V> first =
        either((edge_square > tiny<S>)&(edge_square < huge<S>),
               Three<V>{edge.x / edge_length, edge.y / edge_length, edge.z / edge_length}, x_axis);
    const auto across = [&](const Three<V>& way) { return minus(way, scaled(first, product(way, first))); };
    // If the three points are in line, the second axis is undetermined.
    const Three<V> side = minus(load_three<V>(points + 48 + lane, 8), from);
    const V side_square = product(side, side);
    const Three<V> found = across(side);
    const V found_square = product(found, found);
    const Three<V> any = across(either(first.x * first.x < S(0.5), x_axis, y_axis));
    const Three<V> second =
        either((found_square > side_square * S(0x1p-12)) & (found_square > tiny<S>)&(side_square < huge<S>),
               found, any);
    const V second_length = root(product(second, second));
    const Three<V> again =
        across(Three<V>{second.x / second_length, second.y / second_length, second.z / second_length});
    const V again_length = root(product(again, again));
    const Three<V> b{again.x / again_length, again.y / again_length, again.z / again_length};
    const V all[9] = {first.x,
                      first.y,
                      first.z,
                      b.x,
                      b.y,
                      b.z,
                      first.y * b.z - first.z * b.y,
                      first.z * b.x - first.x * b.z,
                      first.x * b.y - first.y * b.x};
    for (std::size_t i = 0; i < 9; ++i) store_lanes(axes + 8 * i + lane, all[i]);
  }
}

/// Extents of points along three axes, from a first point.
template <class V>
struct Extents {
  V low[3] = {}, high[3] = {};
  template <class W>
  [[gnu::always_inline]] void add(const Three<W> (&axes)[3], const Three<V>& way) {
    for (std::size_t i = 0; i < 3; ++i) {
      const V along = product(axes[i], way);
      low[i] = smaller(along, low[i]);
      high[i] = larger(along, high[i]);
    }
  }
};

/// Computes the centre and halves; `numbers` are [15] at a stride, axes included.
template <class S, class V>
[[gnu::always_inline]] inline void close_box(const Extents<V>& extents, const Three<V> (&axes)[3],
                                             const Three<V>& from, S* numbers, std::size_t stride) {
  V furthest = {}, middle[3];
  for (std::size_t i = 0; i < 3; ++i) {
    furthest = furthest + larger(-extents.low[i], extents.high[i]);
    middle[i] = extents.low[i] * S(0.5) + extents.high[i] * S(0.5);
  }
  const Three<V> centre{from.x + (middle[0] * axes[0].x + middle[1] * axes[1].x + middle[2] * axes[2].x),
                        from.y + (middle[0] * axes[0].y + middle[1] * axes[1].y + middle[2] * axes[2].y),
                        from.z + (middle[0] * axes[0].z + middle[1] * axes[1].z + middle[2] * axes[2].z)};
  const V margin = furthest * half_margin<S> +
                   (magnitude(centre.x) + magnitude(centre.y) + magnitude(centre.z)) * centre_margin<S> +
                   loss<S>;
  store_lanes(numbers, centre.x);
  store_lanes(numbers + stride, centre.y);
  store_lanes(numbers + 2 * stride, centre.z);
  for (std::size_t i = 0; i < 3; ++i)
    store_lanes(numbers + (12 + i) * stride, (extents.high[i] * S(0.5) - extents.low[i] * S(0.5)) + margin);
}

template <class S>
[[gnu::always_inline]] inline void fit_leaves(const ObbRefit<S>& job, std::uint32_t index,
                                              const WideNode& node, S* rows) {
  using V = Eighth<S>;
  if (job.turn) {
    S corners[72];
    load_lists<S>(job.leaf_frames + std::size_t(24) * index, 3, job.positions, corners);
    make_axes<S>(corners, rows + 24);
  }
  load_lists<S>(job.lists + node.list, node.length, job.positions, job.scratch);
  for (std::size_t lane = 0; lane < 8; lane += eighth<S>) {
    const S* const points = job.scratch + lane;
    const Three<V> from = load_three<V>(points, 8);
    const Three<V> axes[3] = {load_three<V>(rows + 24 + lane, 8), load_three<V>(rows + 48 + lane, 8),
                              load_three<V>(rows + 72 + lane, 8)};
    Extents<V> extents;
    for (std::size_t i = 1; i < node.length; ++i)
      extents.add(axes, minus(load_three<V>(points + 24 * i, 8), from));
    close_box<S>(extents, axes, from, rows + lane, 8);
  }
}

/// Extends over points [begin, end) of coordinates in three rows.
template <class S>
[[gnu::always_inline]] inline void add_points(const S* x, const S* y, const S* z, std::size_t begin,
                                              std::size_t end, const Three<S> (&axes)[3],
                                              const Three<S>& from, Extents<S>& all) {
  Extents<Vector<S, lanes_up_to<S, 16>>> wide;
  Extents<Vector<S, lanes_up_to<S, 4>>> narrow;
  in_vectors<S>(begin, end, [&]<class V>(std::size_t i, V) {
    const Three<V> way{load_lanes<V>(x + i) - from.x, load_lanes<V>(y + i) - from.y,
                       load_lanes<V>(z + i) - from.z};
    if constexpr (sizeof(V) == sizeof wide.low[0])
      wide.add(axes, way);
    else if constexpr (sizeof(V) == sizeof narrow.low[0])
      narrow.add(axes, way);
    else
      all.add(axes, way);
  });
  for (std::size_t i = 0; i < 3; ++i) {
    all.low[i] = smaller(-largest_of<S>(-wide.low[i]), smaller(-largest_of<S>(-narrow.low[i]), all.low[i]));
    all.high[i] = larger(largest_of<S>(wide.high[i]), larger(largest_of<S>(narrow.high[i]), all.high[i]));
  }
}

template <class S>
[[gnu::always_inline]] inline void fit_node(const ObbRefit<S>& job, std::uint32_t index) {
  const WideNode node = job.nodes[index];
  S *const rows = job.rows + std::size_t(8 * obb_rows) * index, *const own = job.own + obb_own * index;
  const S* const given = job.node_axes + std::size_t(72) * (index / 8) + index % 8;
  for (std::size_t i = 0; i < 9; ++i) own[3 + i] = given[8 * i];
  const Three<S> axes[3] = {{own[3], own[4], own[5]}, {own[6], own[7], own[8]}, {own[9], own[10], own[11]}};
  Extents<S> extents;
  Three<S> from;
  if (node.leaf_count != 0) fit_leaves<S>(job, index, node, rows);
  if (node.leaf_count == node.count) {
    const S* const points = job.scratch;
    from = {points[0], points[8], points[16]};
    Extents<Eighth<S>> all;
    for (std::size_t i = 0; i < node.length; ++i)
      for (std::size_t lane = 0; lane < 8; lane += eighth<S>) {
        const S* const p = points + 24 * i + lane;
        all.add(axes, {load_lanes<Eighth<S>>(p) - from.x, load_lanes<Eighth<S>>(p + 8) - from.y,
                       load_lanes<Eighth<S>>(p + 16) - from.z});
      }
    for (std::size_t i = 0; i < 3; ++i) {
      extents.low[i] = -largest_of<S>(-all.low[i]);
      extents.high[i] = largest_of<S>(all.high[i]);
    }
  } else {
    for (std::size_t lane = node.leaf_count; lane < 8; ++lane) {
      const std::size_t child =
          node.first_child + (lane < node.count ? std::uint32_t(lane) - node.leaf_count : 0);
      for (std::size_t row = 0; row < obb_rows; ++row) rows[8 * row + lane] = job.own[obb_own * child + row];
    }
    const S *const x = job.coordinates, *const y = x + job.point_count, *const z = y + job.point_count;
    const std::size_t begin = job.ranges[2 * index], end = job.ranges[2 * index + 1];
    from = {x[begin], y[begin], z[begin]};
    add_points<S>(x, y, z, begin, end, axes, from, extents);
  }
  close_box<S>(extents, axes, from, own, 1);
}

template <class S>
void refit(const ObbRefit<S>& job) {
  load_points<S>(job.points, job.point_count, job.positions, job.coordinates);
  if (job.turn)
    for (std::size_t group = 0; 8 * group < job.node_count; ++group) {
      S corners[72];
      load_lists<S>(job.node_frames + 24 * group, 3, job.positions, corners);
      make_axes<S>(corners, job.node_axes + 72 * group);
    }
  for (std::uint32_t i = 0; i < job.node_count; ++i)
    if (job.nodes[i].leaf_count == job.nodes[i].count) fit_node<S>(job, i);
  for (std::uint32_t i = job.node_count; i-- > 0;)
    if (job.nodes[i].leaf_count != job.nodes[i].count) fit_node<S>(job, i);
}

/// One box in plain numbers.
template <class S>
struct Oriented {
  S centre[3], axis[3][3], half[3];
};
template <class S>
[[gnu::always_inline]] inline Oriented<S> oriented(const S* numbers, std::size_t stride) {
  Oriented<S> box;
  for (std::size_t i = 0; i < 3; ++i) {
    box.centre[i] = numbers[i * stride];
    box.half[i] = numbers[(12 + i) * stride];
    for (std::size_t d = 0; d < 3; ++d) box.axis[i][d] = numbers[(3 + 3 * i + d) * stride];
  }
  return box;
}

/// Returns bits of those among `lanes` boxes, in rows, that one of 15 axes separates from a box (Gottschalk,
/// Lin and Manocha 1996).
template <class S, class V>
[[gnu::always_inline]] inline unsigned apart(const S* rows, std::size_t stride, const Oriented<S>& box,
                                             unsigned all) {
  V way[3], half[3], turned[3][3], size[3][3];
  for (std::size_t d = 0; d < 3; ++d) {
    way[d] = load_lanes<V>(rows + d * stride) - box.centre[d];
    half[d] = load_lanes<V>(rows + (12 + d) * stride);
  }
  const V slack = (magnitude(way[0]) + magnitude(way[1]) + magnitude(way[2]) +
                   (half[0] + half[1] + half[2] + (box.half[0] + box.half[1] + box.half[2]))) *
                      axis_margin<S> +
                  loss<S>;
  for (std::size_t j = 0; j < 3; ++j) {
    const S* const axis = rows + (3 + 3 * j) * stride;
    const V x = load_lanes<V>(axis), y = load_lanes<V>(axis + stride), z = load_lanes<V>(axis + 2 * stride);
    for (std::size_t i = 0; i < 3; ++i) {
      turned[i][j] = x * box.axis[i][0] + y * box.axis[i][1] + z * box.axis[i][2];
      size[i][j] = magnitude(turned[i][j]);
    }
  }
  V along[3];
  for (std::size_t i = 0; i < 3; ++i)
    along[i] = way[0] * box.axis[i][0] + way[1] * box.axis[i][1] + way[2] * box.axis[i][2];
  unsigned bits = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const V reach = half[0] * size[i][0] + half[1] * size[i][1] + half[2] * size[i][2] + box.half[i];
    bits |= mask_bits(magnitude(along[i]) > reach + slack);
  }
  if (bits == all) return bits;
  for (std::size_t j = 0; j < 3; ++j) {
    const V reach = size[0][j] * box.half[0] + size[1][j] * box.half[1] + size[2][j] * box.half[2] + half[j];
    const V at = along[0] * turned[0][j] + along[1] * turned[1][j] + along[2] * turned[2][j];
    bits |= mask_bits(magnitude(at) > reach + slack);
  }
  if (bits == all) return bits;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t k = (i + 1) % 3, l = (i + 2) % 3;
    for (std::size_t j = 0; j < 3; ++j) {
      const std::size_t m = (j + 1) % 3, n = (j + 2) % 3;
      const V at = along[l] * turned[k][j] - along[k] * turned[l][j];
      const V reach =
          size[l][j] * box.half[k] + size[k][j] * box.half[l] + half[m] * size[i][n] + half[n] * size[i][m];
      bits |= mask_bits(magnitude(at) > reach + slack);
    }
  }
  return bits;
}

template <class S, bool within>
struct ObbView {
  static constexpr bool within_one = within, selects = false;
  const LanePair<S>& pair;

  [[gnu::always_inline]] static bool waits(const WideTraversal&) { return false; }
  [[gnu::always_inline]] static void enter(std::uint32_t, std::uint32_t) {}
  [[gnu::always_inline]] Oriented<S> own_b(std::uint32_t node) const {
    return oriented(pair.own_b + obb_own * node, 1);
  }
  [[gnu::always_inline]] Oriented<S> lane_a(std::uint32_t node, std::uint32_t lane) const {
    return oriented(pair.rows_a + std::size_t(8 * obb_rows) * node + lane, 8);
  }
  [[gnu::always_inline]] Oriented<S> lane_b(std::uint32_t node, std::uint32_t lane) const {
    return oriented(pair.rows_b + std::size_t(8 * obb_rows) * node + lane, 8);
  }
  [[gnu::noinline]] static unsigned meeting(const WideNode& node, const S* rows, const Oriented<S>& box) {
    constexpr unsigned all = (1U << eighth<S>)-1;
    unsigned bits = 0;
    for (std::size_t lane = 0; lane < node.count; lane += eighth<S>)
      bits |= (all & ~apart<S, Eighth<S>>(rows + lane, 8, box, all)) << lane;
    return bits & ((1U << node.count) - 1);
  }
  [[gnu::always_inline]] unsigned meeting_a(std::uint32_t node, const Oriented<S>& box) const {
    return meeting(pair.nodes_a[node], pair.rows_a + std::size_t(8 * obb_rows) * node, box);
  }
  [[gnu::always_inline]] unsigned meeting_b(std::uint32_t node, const Oriented<S>& box) const {
    return meeting(pair.nodes_b[node], pair.rows_b + std::size_t(8 * obb_rows) * node, box);
  }
};

template <class S, bool within>
void traverse(const LanePair<S>& pair, WideTraversal& state) {
  ObbView<S, within> view{pair};
  const WideArrays<S> a{pair.nodes_a, nullptr, nullptr, nullptr}, b{pair.nodes_b, nullptr, nullptr, nullptr};
  traverse_pairs<S>(a, b, view, state);
}

template <class S>
bool overlap(const S* a, const S* b) {
  return apart<S, S>(a, 1, oriented(b, 1), 1) == 0;
}

template <class S>
constexpr ObbKernels<S> table{&refit<S>, &traverse<S, false>, &traverse<S, true>, &overlap<S>};

}  // namespace

namespace kernels::KBVH_KERNELS {
const ObbKernels<float> obb_float = table<float>;
const ObbKernels<double> obb_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh

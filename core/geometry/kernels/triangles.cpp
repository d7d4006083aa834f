#include "core/geometry/kernels/triangles.hpp"

#include "core/geometry/filter_bounds.hpp"
#include "core/kernels/point_lanes.hpp"

// The first two stages of core/geometry/triangle_triangle.cpp, one pair per lane. Stage 1 computes the six
// signs of the corners against the planes and decides most pairs. The remaining pairs are compacted and their
// corners reordered by the signs. Stage 2 tests whether the intervals on the common line overlap.

namespace kbvh {
namespace {

// ---- Filtered determinants --------------------------------------------------------------------------------

/// A cross product and, for each of its components, the sum of the absolute products (plus the underflow term
/// for float).
template <class S>
struct Cross {
  Point<S> value, magnitude;
};
template <class S>
KBVH_INLINE Cross<S> cross(const Point<S>& b, const Point<S>& c) {
  const Values<S> by_cz = b.y * c.z, bz_cy = b.z * c.y;
  const Values<S> bz_cx = b.z * c.x, bx_cz = b.x * c.z;
  const Values<S> bx_cy = b.x * c.y, by_cx = b.y * c.x;
  Cross<S> result{{by_cz - bz_cy, bz_cx - bx_cz, bx_cy - by_cx},
                  {absolute<S>(by_cz) + absolute<S>(bz_cy), absolute<S>(bz_cx) + absolute<S>(bx_cz),
                   absolute<S>(bx_cy) + absolute<S>(by_cx)}};
  if constexpr (sizeof(S) == sizeof(float)) {
    result.magnitude.x += filter::minor3f;
    result.magnitude.y += filter::minor3f;
    result.magnitude.z += filter::minor3f;
  }
  return result;
}

template <class S>
KBVH_INLINE Values<S> error_bound(Values<S> permanent) {
  if constexpr (sizeof(S) == sizeof(float))
    return permanent * filter::relative3f + filter::absolute3f;
  else
    return permanent * filter::relative3d + filter::absolute3d;
}

// ---- Stage 1 ----------------------------------------------------------------------------------------------

/// Three corners against a plane: which lie on the negative side (highest bits), whether that is certain for
/// all three (all bits), and whether they lie on different sides (highest bits).
template <class S>
struct Sides {
  Words<S> negative[3];
  Words<S> certain;
  Words<S> differ;
};

/// Computes orient3d of a plane, given by two edges from one of its points, and three corners, given relative
/// to that point. One bound holds for all three errors: the permanent is the largest of the three.
template <class S>
KBVH_INLINE Sides<S> sides(const Point<S>& edge, const Point<S>& other_edge, const Point<S>& d0,
                           const Point<S>& d1, const Point<S>& d2) {
  const Cross<S> normal = cross(edge, other_edge);
  const Values<S> v0 = dot(normal.value, d0), v1 = dot(normal.value, d1), v2 = dot(normal.value, d2);
  const Point<S> reach = larger(larger(absolute(d0), absolute(d1)), absolute(d2));
  const Values<S> bound = error_bound<S>(dot(normal.magnitude, reach));
  const Values<S> least = smaller(smaller(absolute<S>(v0), absolute<S>(v1)), absolute<S>(v2));
  const Words<S> s0 = bits<S>(v0), s1 = bits<S>(v1), s2 = bits<S>(v2);
  return {{s0, s1, s2}, greater<S>(least, bound), (s0 ^ s1) | (s0 ^ s2)};
}

/// The results of stage 1 for the pairs of a register, one bit per pair; and where all signs are certain, the
/// signs of the corners: bit i for corner i of the pair on the negative side of the other triangle's plane.
template <class S>
struct Classes {
  Words<S> signs;
  unsigned separate, certain;
};

template <class S>
KBVH_INLINE Classes<S> classify(const TrianglePair<S>* pairs) {
  Point<S> corner[6];
  for (std::size_t c = 0; c < 6; ++c) {
    const S* rows[lanes<S>];
    for (std::size_t k = 0; k < lanes<S>; ++k) rows[k] = pairs[k].corner[c];
    corner[c] = load_points(rows);
  }
  const Point<S>&a = corner[0], &b = corner[3];
  const Sides<S> sides_b = sides(corner[1] - a, corner[2] - a, corner[3] - a, corner[4] - a, corner[5] - a);
  const Sides<S> sides_a = sides(corner[4] - b, corner[5] - b, corner[0] - b, corner[1] - b, corner[2] - b);
  Words<S> signs{};
  for (int i = 2; i >= 0; --i) signs = signs + signs + (sides_b.negative[i] >> sign_shift<S>);
  for (int i = 2; i >= 0; --i) signs = signs + signs + (sides_a.negative[i] >> sign_shift<S>);
  return {signs, high_bits<S>((sides_b.certain & ~sides_b.differ) | (sides_a.certain & ~sides_a.differ)),
          high_bits<S>(sides_b.certain & sides_a.certain)};
}

// ---- Stage 2 ----------------------------------------------------------------------------------------------

/// The corners of a pair in the order that stage 2 expects (see interval_ends in triangle_triangle.cpp).
struct Order {
  std::uint8_t p, p_low, p_high, q, q_low, q_high;
};

/// The corner that lies alone on its side of the plane, and the next two in cyclic order.
struct Apex {
  std::uint8_t corner, next, last;
  bool negative;
};
constexpr Apex apex(unsigned negatives) {
  const bool negative = negatives == 1 || negatives == 2 || negatives == 4;
  const unsigned alone = negative ? negatives : 7 - negatives;
  const unsigned corner = alone == 1 ? 0 : alone == 2 ? 1 : 2;
  return {std::uint8_t(corner), std::uint8_t((corner + 1) % 3), std::uint8_t((corner + 2) % 3), negative};
}

/// With direction = side(p) side(q), the intervals overlap iff direction orient3d(p, p_low, q, q_high) >= 0
/// and direction orient3d(p, p_high, q, q_low) <= 0. On side +1 the edge to the next corner ends the interval
/// of a above and the interval of b below; on side -1 it is the other way round. Where direction is -1, low
/// and high are exchanged again, which reverses both conditions.
struct Orders {
  Order order[64];
};
constexpr Orders make_orders() {
  Orders orders{};
  for (unsigned signs = 0; signs < 64; ++signs) {
    const Apex p = apex(signs & 7), q = apex(signs >> 3);
    const bool turn = p.negative != q.negative;
    const bool next_is_high_of_a = p.negative == turn, next_is_high_of_b = q.negative != turn;
    orders.order[signs] = {p.corner,
                           next_is_high_of_a ? p.last : p.next,
                           next_is_high_of_a ? p.next : p.last,
                           std::uint8_t(3 + q.corner),
                           std::uint8_t(3 + (next_is_high_of_b ? q.last : q.next)),
                           std::uint8_t(3 + (next_is_high_of_b ? q.next : q.last))};
  }
  return orders;
}
constexpr Orders all_orders = make_orders();

/// Computes orient3d(p, end, q, last) and its error bound; q is given relative to p.
template <class S>
struct Orientation {
  Values<S> value, bound;
};
template <class S>
KBVH_INLINE Orientation<S> orientation(const Point<S>& p, const Point<S>& end, const Point<S>& to_q,
                                       const Point<S>& last) {
  const Cross<S> normal = cross(end - p, to_q);
  const Point<S> d = last - p;
  return {dot(normal.value, d), error_bound<S>(dot(normal.magnitude, absolute(d)))};
}

/// The pairs of a register whose intervals certainly overlap, and those whose intervals certainly do not.
struct Overlap {
  unsigned intersect, separate;
};
template <class S>
KBVH_INLINE Overlap overlap(const S* const (&rows)[6][lanes<S>]) {
  const Point<S> p = load_points(rows[0]), to_q = load_points(rows[3]) - p;
  const Orientation<S> low = orientation(p, load_points(rows[1]), to_q, load_points(rows[5]));
  const Orientation<S> high = orientation(p, load_points(rows[2]), to_q, load_points(rows[4]));
  return {high_bits<S>(greater<S>(low.value, low.bound) & greater<S>(-high.bound, high.value)),
          high_bits<S>(greater<S>(-low.bound, low.value) | greater<S>(high.value, high.bound))};
}

// ---- Both -------------------------------------------------------------------------------------------------

/// The number of pairs that pass through both stages together; their indices fit into bytes.
constexpr std::size_t block = 128;

/// The positions of the set bits of 4 bits, and their number.
struct Selections {
  std::uint8_t places[16][4];
  std::uint8_t size[16];
};
constexpr Selections make_selections() {
  Selections selections{};
  for (unsigned mask = 0; mask < 16; ++mask)
    for (std::uint8_t i = 0; i < 4; ++i)
      if ((mask >> i & 1) != 0) selections.places[mask][selections.size[mask]++] = i;
  return selections;
}
constexpr Selections selections = make_selections();

/// Indices of pairs; room for a register plus four more than can be selected.
struct Selected {
  std::uint8_t index[block + 20];
  std::size_t size = 0;

  /// Appends first + i for each set bit i of `mask`, without branches, which would be mispredicted.
  template <std::size_t bit_count>
  KBVH_INLINE void append(std::size_t first, unsigned mask) {
    for (std::size_t at = 0; at < bit_count; at += 4) {
      const unsigned four = mask >> at & 15;
      std::uint32_t places = 0;
      __builtin_memcpy(&places, selections.places[four], 4);
      places += std::uint32_t(first + at) * 0x01010101U;
      __builtin_memcpy(index + size, &places, 4);
      size += selections.size[four];
    }
  }
};

template <class S>
std::size_t filter_block(const TrianglePair<S>* pairs, std::size_t count, FilteredVerdict* verdicts) {
  constexpr std::size_t width = lanes<S>;
  Word<S> signs[block];
  Selected survivors;
  std::size_t open = 0;
  for (std::size_t i = 0; i < count; ++i) verdicts[i] = FilteredVerdict::separate;

  const auto stage1 = [&](const TrianglePair<S>* from, std::size_t at, unsigned valid)
      __attribute__((always_inline)) {
    const Classes<S> classes = classify(from);
    store_lanes(signs + at, classes.signs);
    survivors.append<width>(at, classes.certain & ~classes.separate & valid);
    for (unsigned rest = ~(classes.certain | classes.separate) & valid; rest != 0; rest &= rest - 1) {
      verdicts[at + std::size_t(__builtin_ctz(rest))] = FilteredVerdict::open;
      ++open;
    }
  };
  constexpr unsigned all = (1U << width) - 1;
  std::size_t at = 0;
  for (; at + width <= count; at += width) stage1(pairs + at, at, all);
  if (at < count) {
    TrianglePair<S> rest[width];
    for (std::size_t k = 0; k < width; ++k) rest[k] = pairs[at + k < count ? at + k : at];
    stage1(rest, at, (1U << (count - at)) - 1);
  }

  // Fills the last register up with its last pair.
  for (std::size_t k = 0; survivors.size > 0 && k < width; ++k)
    survivors.index[survivors.size + k] = survivors.index[survivors.size - 1];
  for (std::size_t first = 0; first < survivors.size; first += width) {
    const S* rows[6][width];
    for (std::size_t k = 0; k < width; ++k) {
      const std::size_t i = survivors.index[first + k];
      const Order& order = all_orders.order[signs[i]];
      const auto& corner = pairs[i].corner;
      rows[0][k] = corner[order.p];
      rows[1][k] = corner[order.p_low];
      rows[2][k] = corner[order.p_high];
      rows[3][k] = corner[order.q];
      rows[4][k] = corner[order.q_low];
      rows[5][k] = corner[order.q_high];
    }
    const Overlap result = overlap<S>(rows);
    const std::size_t size = survivors.size - first < width ? survivors.size - first : width;
    for (std::size_t k = 0; k < size; ++k) {
      const unsigned intersect = result.intersect >> k & 1, separate = result.separate >> k & 1;
      const unsigned is_open = 1 - (intersect | separate);
      verdicts[survivors.index[first + k]] = static_cast<FilteredVerdict>(intersect + 2 * is_open);
      open += is_open;
    }
  }
  return open;
}

template <class S>
std::size_t filter_pairs(const TrianglePair<S>* pairs, std::size_t count, FilteredVerdict* verdicts) {
  std::size_t open = 0;
  for (std::size_t first = 0; first < count; first += block)
    open += filter_block(pairs + first, count - first < block ? count - first : block, verdicts + first);
  return open;
}

}  // namespace

namespace kernels::KBVH_KERNELS {
extern const TriangleKernels triangle_kernels = {filter_pairs<float>, filter_pairs<double>};
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh

#undef KBVH_INLINE

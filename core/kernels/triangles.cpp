#include "core/kernels/triangles.hpp"

#include "core/geometry/filter_bounds.hpp"
#include "core/kernels/lanes.hpp"

// The first two stages of core/geometry/triangle_triangle.cpp, one pair in each lane. Stage 1 finds the six
// signs of the corners against the planes; most pairs end there. The others are compacted, their corners
// reordered by the signs, and stage 2 finds whether the intervals on the common line overlap.

namespace kbvh {
namespace {

template <class S>
struct IntegerOf;
template <>
struct IntegerOf<float> {
  using type = std::int32_t;
};
template <>
struct IntegerOf<double> {
  using type = std::int64_t;
};

/// A value for each pair of a register, and integers of the same width.
template <class S>
using Values = Vector<S, native_lanes<S>>;
template <class S>
using Integers = Vector<typename IntegerOf<S>::type, native_lanes<S>>;

#define KBVH_INLINE [[gnu::always_inline]] inline

template <class V>
struct Point {
  V x, y, z;
};
template <class V>
KBVH_INLINE Point<V> operator-(const Point<V>& p, const Point<V>& q) {
  return {p.x - q.x, p.y - q.y, p.z - q.z};
}
template <class V>
KBVH_INLINE V dot(const Point<V>& p, const Point<V>& q) {
  return p.x * q.x + p.y * q.y + p.z * q.z;
}

#if defined(KBVH_KERNELS_portable)
KBVH_INLINE float absolute(float x) {
  return __builtin_fabsf(x);
}
KBVH_INLINE double absolute(double x) {
  return __builtin_fabs(x);
}
#else
KBVH_INLINE Values<float> absolute(Values<float> x) {
  return (Values<float>)((Integers<float>)x & 0x7fffffff);
}
KBVH_INLINE Values<double> absolute(Values<double> x) {
  return (Values<double>)((Integers<double>)x & 0x7fffffffffffffff);
}
#endif
/// All bits set where x > y, else none.
template <class S>
KBVH_INLINE Integers<S> greater(Values<S> x, Values<S> y) {
#if defined(KBVH_KERNELS_portable)
  return x > y ? -1 : 0;
#else
  return (Integers<S>)(x > y);
#endif
}
/// One bit for each lane.
template <class S>
KBVH_INLINE unsigned lane_bits(Integers<S> mask) {
#if defined(KBVH_KERNELS_portable)
  return mask_bits(mask != 0);
#else
  return mask_bits(mask);
#endif
}
template <class V>
KBVH_INLINE Point<V> absolute(const Point<V>& p) {
  return {absolute(p.x), absolute(p.y), absolute(p.z)};
}

// ---- Loads: lane k of the result is the point at rows[k], read with one scalar behind it ------------------

#if defined(KBVH_KERNELS_portable)
template <class S>
KBVH_INLINE Point<S> load_points(const S* const* rows) {
  return {rows[0][0], rows[0][1], rows[0][2]};
}
#else
/// x, y, z from rows of which each 128-bit part holds one point: the i-th row those of lanes i, i + 4, ...
template <class V>
KBVH_INLINE Point<V> transposed(V r0, V r1, V r2, V r3) {
#if defined(KBVH_KERNELS_avx512)
  const __m512d xy01 = _mm512_castps_pd(_mm512_unpacklo_ps(r0, r1)),
                xy23 = _mm512_castps_pd(_mm512_unpacklo_ps(r2, r3)),
                z01 = _mm512_castps_pd(_mm512_unpackhi_ps(r0, r1)),
                z23 = _mm512_castps_pd(_mm512_unpackhi_ps(r2, r3));
  return {_mm512_castpd_ps(_mm512_unpacklo_pd(xy01, xy23)), _mm512_castpd_ps(_mm512_unpackhi_pd(xy01, xy23)),
          _mm512_castpd_ps(_mm512_unpacklo_pd(z01, z23))};
#elif defined(KBVH_KERNELS_avx2)
  const __m256d xy01 = _mm256_castps_pd(_mm256_unpacklo_ps(r0, r1)),
                xy23 = _mm256_castps_pd(_mm256_unpacklo_ps(r2, r3)),
                z01 = _mm256_castps_pd(_mm256_unpackhi_ps(r0, r1)),
                z23 = _mm256_castps_pd(_mm256_unpackhi_ps(r2, r3));
  return {_mm256_castpd_ps(_mm256_unpacklo_pd(xy01, xy23)), _mm256_castpd_ps(_mm256_unpackhi_pd(xy01, xy23)),
          _mm256_castpd_ps(_mm256_unpacklo_pd(z01, z23))};
#else
  const __m128d xy01 = _mm_castps_pd(_mm_unpacklo_ps(r0, r1)), xy23 = _mm_castps_pd(_mm_unpacklo_ps(r2, r3)),
                z01 = _mm_castps_pd(_mm_unpackhi_ps(r0, r1)), z23 = _mm_castps_pd(_mm_unpackhi_ps(r2, r3));
  return {_mm_castpd_ps(_mm_unpacklo_pd(xy01, xy23)), _mm_castpd_ps(_mm_unpackhi_pd(xy01, xy23)),
          _mm_castpd_ps(_mm_unpacklo_pd(z01, z23))};
#endif
}

KBVH_INLINE Values<float> load_row(const float* const* rows) {
#if defined(KBVH_KERNELS_avx512)
  return _mm512_insertf32x8(
      _mm512_castps256_ps512(
          _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(rows[0])), _mm_loadu_ps(rows[4]), 1)),
      _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(rows[8])), _mm_loadu_ps(rows[12]), 1), 1);
#elif defined(KBVH_KERNELS_avx2)
  return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(rows[0])), _mm_loadu_ps(rows[4]), 1);
#else
  return _mm_loadu_ps(rows[0]);
#endif
}

KBVH_INLINE Point<Values<float>> load_points(const float* const* rows) {
  return transposed(load_row(rows), load_row(rows + 1), load_row(rows + 2), load_row(rows + 3));
}

#if defined(KBVH_KERNELS_sse)
KBVH_INLINE Point<Values<double>> load_points(const double* const* rows) {
  const __m128d xy0 = _mm_loadu_pd(rows[0]), xy1 = _mm_loadu_pd(rows[1]);
  return {_mm_unpacklo_pd(xy0, xy1), _mm_unpackhi_pd(xy0, xy1),
          _mm_loadh_pd(_mm_load_sd(rows[0] + 2), rows[1] + 2)};
}
#else
KBVH_INLINE Point<Vector<double, 4>> load_four(const double* const* rows) {
  const __m256d r0 = _mm256_loadu_pd(rows[0]), r1 = _mm256_loadu_pd(rows[1]), r2 = _mm256_loadu_pd(rows[2]),
                r3 = _mm256_loadu_pd(rows[3]);
  const __m256d xz01 = _mm256_unpacklo_pd(r0, r1), xz23 = _mm256_unpacklo_pd(r2, r3);
  const __m256d y01 = _mm256_unpackhi_pd(r0, r1), y23 = _mm256_unpackhi_pd(r2, r3);
  return {_mm256_permute2f128_pd(xz01, xz23, 0x20), _mm256_permute2f128_pd(y01, y23, 0x20),
          _mm256_permute2f128_pd(xz01, xz23, 0x31)};
}
KBVH_INLINE Point<Values<double>> load_points(const double* const* rows) {
#if defined(KBVH_KERNELS_avx512)
  const Point<Vector<double, 4>> p = load_four(rows), q = load_four(rows + 4);
  const auto both = [](__m256d low, __m256d high) __attribute__((always_inline)) {
    return _mm512_insertf64x4(_mm512_castpd256_pd512(low), high, 1);
  };
  return {both(p.x, q.x), both(p.y, q.y), both(p.z, q.z)};
#else
  return load_four(rows);
#endif
}
#endif
#endif

// ---- Filtered determinants --------------------------------------------------------------------------------

/// A cross product and, for each of its components, the sum of the absolute products (and what float's
/// underflow needs).
template <class V>
struct Cross {
  Point<V> value, magnitude;
};
template <class S, class V>
KBVH_INLINE Cross<V> cross(const Point<V>& b, const Point<V>& c) {
  const V by_cz = b.y * c.z, bz_cy = b.z * c.y;
  const V bz_cx = b.z * c.x, bx_cz = b.x * c.z;
  const V bx_cy = b.x * c.y, by_cx = b.y * c.x;
  Cross<V> result{{by_cz - bz_cy, bz_cx - bx_cz, bx_cy - by_cx},
                  {absolute(by_cz) + absolute(bz_cy), absolute(bz_cx) + absolute(bx_cz),
                   absolute(bx_cy) + absolute(by_cx)}};
  if constexpr (sizeof(S) == sizeof(float)) {
    result.magnitude.x += filter::minor3f;
    result.magnitude.y += filter::minor3f;
    result.magnitude.z += filter::minor3f;
  }
  return result;
}

template <class S, class V>
KBVH_INLINE V error_bound(V permanent) {
  if constexpr (sizeof(S) == sizeof(float))
    return permanent * filter::relative3f + filter::absolute3f;
  else
    return permanent * filter::relative3d + filter::absolute3d;
}

/// orient3d(plane, point i) for three points, and one bound for their errors (see side_values in
/// triangle_triangle.cpp).
template <class V>
struct Sides {
  V value[3];
  V bound;
};
template <class S, class V>
KBVH_INLINE Sides<V> sides(const Point<V> (&plane)[3], const Point<V> (&points)[3]) {
  const Cross<V> normal = cross<S>(plane[1] - plane[0], plane[2] - plane[0]);
  const Point<V> d0 = points[0] - plane[0], d1 = points[1] - plane[0], d2 = points[2] - plane[0];
  const Point<V> reach = {larger(larger(absolute(d0.x), absolute(d1.x)), absolute(d2.x)),
                          larger(larger(absolute(d0.y), absolute(d1.y)), absolute(d2.y)),
                          larger(larger(absolute(d0.z), absolute(d1.z)), absolute(d2.z))};
  return {{dot(normal.value, d0), dot(normal.value, d1), dot(normal.value, d2)},
          error_bound<S>(dot(normal.magnitude, reach))};
}
template <class S>
KBVH_INLINE Integers<S> strictly_one_side(const Sides<Values<S>>& s) {
  const auto low = smaller(smaller(s.value[0], s.value[1]), s.value[2]);
  const auto high = larger(larger(s.value[0], s.value[1]), s.value[2]);
  return greater<S>(low, s.bound) | greater<S>(-s.bound, high);
}
template <class S>
KBVH_INLINE Integers<S> decided(const Sides<Values<S>>& s) {
  const auto least = smaller(smaller(absolute(s.value[0]), absolute(s.value[1])), absolute(s.value[2]));
  return greater<S>(least, s.bound);
}

// ---- Stage 1 ----------------------------------------------------------------------------------------------

/// What stage 1 finds: with all signs certain and none separating, bit i for corner i of the pair on the
/// positive side of the other triangle's plane.
constexpr std::int32_t kOpen = 64;
constexpr std::int32_t kSeparate = 128;

template <class S>
KBVH_INLINE Integers<S> classify(const TrianglePair<S>* pairs) {
  using V = Values<S>;
  Point<V> corner[6];
  for (std::size_t c = 0; c < 6; ++c) {
    const S* rows[native_lanes<S>];
    for (std::size_t k = 0; k < native_lanes<S>; ++k) rows[k] = pairs[k].corner[c];
    corner[c] = load_points(rows);
  }
  const Point<V> a[3] = {corner[0], corner[1], corner[2]}, b[3] = {corner[3], corner[4], corner[5]};
  const Sides<V> sides_b = sides<S>(a, b), sides_a = sides<S>(b, a);
  const Integers<S> separate = strictly_one_side<S>(sides_b) | strictly_one_side<S>(sides_a);
  const Integers<S> certain = decided<S>(sides_b) & decided<S>(sides_a);
  const auto positive = [](V value, typename IntegerOf<S>::type bit) __attribute__((always_inline)) {
    return greater<S>(value, V{}) & bit;
  };
  const Integers<S> signs = positive(sides_a.value[0], 1) | positive(sides_a.value[1], 2) |
                            positive(sides_a.value[2], 4) | positive(sides_b.value[0], 8) |
                            positive(sides_b.value[1], 16) | positive(sides_b.value[2], 32);
  return signs | (~certain & kOpen) | (separate & kSeparate);
}

// ---- Stage 2 ----------------------------------------------------------------------------------------------

/// Corners of a pair as stage 2 wants them (see interval_ends in triangle_triangle.cpp).
struct Order {
  std::uint8_t p, p_low, p_high, q, q_low, q_high;
};

/// The corner that is alone on its side of the plane, from the bits of the positive ones; the next two in
/// cyclic order, exchanged if it is on the negative side.
struct Apex {
  std::uint8_t corner, first, second;
  bool negative;
};
constexpr Apex apex(unsigned positive) {
  const bool negative = positive == 3 || positive == 5 || positive == 6;
  const unsigned alone = negative ? 7 - positive : positive;
  const unsigned corner = alone == 1 ? 0 : alone == 2 ? 1 : 2;
  return {std::uint8_t(corner), std::uint8_t((corner + 1) % 3), std::uint8_t((corner + 2) % 3), negative};
}

/// With direction = side(p) side(q), the intervals overlap iff direction orient3d(p, p_low, q, q_high) >= 0
/// and direction orient3d(p, p_high, q, q_low) <= 0. Instead of turning both signs where direction is -1, low
/// and high change their names.
struct Orders {
  Order order[64];
};
constexpr Orders make_orders() {
  Orders orders{};
  for (unsigned signs = 0; signs < 64; ++signs) {
    const Apex a = apex(signs & 7), b = apex(signs >> 3);
    // The edge to the second corner ends a's interval below and b's above, on side +1; conversely on -1.
    const bool turn = a.negative != b.negative;
    const bool swap_a = a.negative != turn, swap_b = b.negative != turn;
    orders.order[signs] = {a.corner,
                           swap_a ? a.first : a.second,
                           swap_a ? a.second : a.first,
                           std::uint8_t(3 + b.corner),
                           std::uint8_t(3 + (swap_b ? b.second : b.first)),
                           std::uint8_t(3 + (swap_b ? b.first : b.second))};
  }
  return orders;
}
constexpr Orders kOrders = make_orders();

/// Both orientations: the pair intersects where both are positive (the second is that of the exchanged last
/// points, so turned), and is separate where one is negative.
struct Overlap {
  unsigned intersect, separate;
};
template <class S>
KBVH_INLINE Overlap overlap(const S* const (&rows)[6][native_lanes<S>]) {
  using V = Values<S>;
  const Point<V> p = load_points(rows[0]);
  const Point<V> to_q = load_points(rows[3]) - p;
  const auto orientation = [&](const S* const* end, const S* const* last) __attribute__((always_inline)) {
    const Cross<V> normal = cross<S>(load_points(end) - p, to_q);
    const Point<V> d = load_points(last) - p;
    return Sides<V>{{dot(normal.value, d)}, error_bound<S>(dot(normal.magnitude, absolute(d)))};
  };
  const Sides<V> s = orientation(rows[1], rows[5]), t = orientation(rows[2], rows[4]);
  return {lane_bits<S>(greater<S>(s.value[0], s.bound) & greater<S>(-t.bound, t.value[0])),
          lane_bits<S>(greater<S>(-s.bound, s.value[0]) | greater<S>(t.value[0], t.bound))};
}

// ---- Both -------------------------------------------------------------------------------------------------

constexpr std::size_t kBlock = 64;

template <class S>
std::size_t filter_block(const TrianglePair<S>* pairs, std::size_t count, FilteredVerdict* verdicts) {
  constexpr std::size_t lanes = native_lanes<S>;
  typename IntegerOf<S>::type found[kBlock];
  std::size_t at = 0;
  for (; at + lanes <= count; at += lanes) store_lanes(found + at, classify(pairs + at));
  if (at < count) {
    TrianglePair<S> rest[lanes];
    for (std::size_t k = 0; k < lanes; ++k) rest[k] = pairs[at + k < count ? at + k : at];
    store_lanes(found + at, classify(rest));
  }

  // Without branches, which could not be predicted.
  std::uint8_t survivors[kBlock + lanes];
  std::size_t survivor_count = 0, open = 0;
  for (std::size_t i = 0; i < count; ++i) {
    survivors[survivor_count] = std::uint8_t(i);
    survivor_count += found[i] < kOpen ? 1 : 0;
    const bool is_open = (found[i] & (kOpen | kSeparate)) == kOpen;
    verdicts[i] = is_open ? FilteredVerdict::open : FilteredVerdict::separate;
    open += is_open ? 1 : 0;
  }
  for (std::size_t k = 0; survivor_count > 0 && k < lanes; ++k)
    survivors[survivor_count + k] = survivors[survivor_count - 1];

  for (std::size_t first = 0; first < survivor_count; first += lanes) {
    const S* rows[6][lanes];
    for (std::size_t k = 0; k < lanes; ++k) {
      const std::size_t i = survivors[first + k];
      const Order& order = kOrders.order[found[i]];
      const auto& corner = pairs[i].corner;
      rows[0][k] = corner[order.p];
      rows[1][k] = corner[order.p_low];
      rows[2][k] = corner[order.p_high];
      rows[3][k] = corner[order.q];
      rows[4][k] = corner[order.q_low];
      rows[5][k] = corner[order.q_high];
    }
    const Overlap result = overlap<S>(rows);
    const std::size_t size = survivor_count - first < lanes ? survivor_count - first : lanes;
    for (std::size_t k = 0; k < size; ++k) {
      const unsigned intersect = result.intersect >> k & 1, separate = result.separate >> k & 1;
      const unsigned is_open = 1 - (intersect | separate);
      verdicts[survivors[first + k]] = static_cast<FilteredVerdict>(intersect + 2 * is_open);
      open += is_open;
    }
  }
  return open;
}

template <class S>
std::size_t filter_pairs(const TrianglePair<S>* pairs, std::size_t count, FilteredVerdict* verdicts) {
  std::size_t open = 0;
  for (std::size_t first = 0; first < count; first += kBlock)
    open += filter_block(pairs + first, count - first < kBlock ? count - first : kBlock, verdicts + first);
  return open;
}

}  // namespace

namespace kernels::KBVH_KERNELS {
extern const TriangleKernels triangle_kernels = {filter_pairs<float>, filter_pairs<double>};
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh

#include "core/continuous/kernels/impacts.hpp"

#include "core/kernels/point_lanes.hpp"

// One query per lane. The points touch only while they are coplanar, at roots of the cubic f = n . r, where n
// = a x b; at a contact n and its shares x, y (core/continuous/exact_impact.cpp) have one sign along each
// axis, or are zero. So
//
//  - a query is free if an axis separates the elements at both ends of the motion: kept_apart;
//  - it is free if the Bernstein coefficients of f have one sign;
//  - if they change their sign exactly once, f has exactly one root in (0, 1) (Descartes' rule of signs).
//    Newton's method finds the cell [k, k + 1] / 2^20 of this root in rounded arithmetic; the signs of f at
//    both ends of the cell, which are computed with error bounds, prove it. The signs of n and the shares in
//    this cell, again by Bernstein coefficients, decide between contact and none;
//  - else the signs of n and the shares from t = 0 to t = 1 can still exclude a contact.
//
// All other queries stay open. A root that is proved to lie in the interior of its cell makes the cell the
// enclosure that find_impact and find_impact_exact report: both halve [0, 1] until an interval of 2^-20 is
// left.
//
// Errors. Let u be the unit roundoff. A computed difference d of coordinates is wrong by at most u |d|. Let
// A, B, R be the largest magnitudes, at both ends, of the computed a, b, r along each axis, and along axis k,
// with the other axes i and j, ab_k = A_i B_j + A_j B_i; ar_k and rb_k alike.
//
// n: a product of two differences is wrong by 2 u of its magnitude from the differences, and by u from its
// own rounding; then each term takes part in one subtraction, and in the middle coefficient in one addition.
// The coefficients' terms have magnitudes that sum to at most ab_k, 2 ab_k (halved), ab_k: errors are at most
// 5.01 u ab_k (5.01, because terms in u^2 are neglected). A coefficient over another interval [s, e] comes
// from two interpolations (1 - s) q + s q'. These round 1 - s exactly, because s is a multiple of 2^-20, and
// add 2.01 u ab_k each: 9.03 u ab_k. A share that is a difference of two or three such coefficients adds up
// their bounds and two roundings of at most area_k = ab_k + ar_k + rb_k: together at most 11.1 u area_k.
// `quadratic` is 16 u, whose surplus covers the rounding of area_k itself and of the bound: 10 u of it.
//
// f, times 3: along each axis n (or 2 n, for the middle coefficient), wrong by 5.01 u of its terms, is
// multiplied by r, wrong by u; product, two additions within a scalar product, and an addition of two scalar
// products or the multiplication by 3 round once each. The terms' magnitudes sum to at most 3 volume, where
// volume is the sum of ab_k R_k: errors are at most 10.1 u * 3 volume. Values at s take three interpolations
// with 2.01 u * 3 volume each: together 48.4 u volume. `cubic` is 56 u, and the surplus covers the roundings
// of the volume and the bound, at most 8 u of it.
//
// Underflow: magnitudes are at most 1e100, differences 2e100. A product of two differences loses at most
// 2^-1075, which is multiplied by at most 2e100 in f. `least_quadratic` and `least_cubic` exceed the sum of
// all such losses. Nothing overflows: |f| is at most 2e302.

namespace kbvh {
namespace {

using Lanes = Values<double>;
using Mask = Words<double>;
constexpr std::size_t width = lanes<double>;
constexpr std::size_t room = ImpactBlock::room;
static_assert(room % width == 0);
constexpr unsigned all_lanes = (1U << width) - 1;

/// A fraction of the motion: the width of an enclosure.
constexpr double cell_width = 0x1p-20, cells = 0x1p20;

KBVH_INLINE Lanes lanes_of(double x) {
  return Lanes{} + x;
}
KBVH_INLINE Mask exceeds(Lanes x, Lanes y) {
  return greater<double>(x, y);
}
KBVH_INLINE Lanes either(Mask mask, Lanes yes, Lanes no) {
  return __builtin_bit_cast(Lanes, (mask & bits<double>(yes)) | (~mask & bits<double>(no)));
}
KBVH_INLINE unsigned bits_of(Mask mask) {
  return high_bits<double>(mask);
}
KBVH_INLINE Lanes coordinate(const ImpactBlock& block, int end, std::size_t point, int axis, std::size_t i) {
  return load_lanes<Lanes>(block.points[end][point][axis] + i);
}

// ---- Separation -------------------------------------------------------------------------------------------

/// Tests whether an axis separates the points [0, split) from the others, on one side from t = 0 to t = 1.
template <std::size_t split>
KBVH_INLINE Mask kept_apart(const ImpactBlock& block, std::size_t i) {
  Mask apart{};
  for (int axis = 0; axis < 3; ++axis) {
    Mask below = ~Mask{}, above = ~Mask{};
    for (int end = 0; end < 2; ++end) {
      const Lanes first = coordinate(block, end, 0, axis, i), last = coordinate(block, end, 3, axis, i);
      Lanes low[2] = {first, last}, high[2] = {first, last};
      for (std::size_t point = 1; point < 3; ++point) {
        const std::size_t side = point < split ? 0 : 1;
        const Lanes x = coordinate(block, end, point, axis, i);
        low[side] = smaller(low[side], x);
        high[side] = larger(high[side], x);
      }
      below &= exceeds(low[1], high[0]);
      above &= exceeds(low[0], high[1]);
    }
    apart |= below | above;
  }
  return apart;
}

/// Tests whether the points [0, split) and the others are in two boxes that are farther apart than the
/// separation from t = 0 to `until`.
template <std::size_t split>
KBVH_INLINE Mask boxes_apart(const ImpactBlock& block, std::size_t i, double until, double separation) {
  Mask apart{};
  for (int axis = 0; axis < 3; ++axis) {
    Lanes low[2]{}, high[2]{}, largest{};
    for (std::size_t point = 0; point < 4; ++point) {
      const Lanes from = coordinate(block, 0, point, axis, i), to = coordinate(block, 1, point, axis, i);
      const Lanes there = (1 - until) * from + until * to;
      const std::size_t side = point < split ? 0 : 1;
      const bool is_first = point == 0 || point == split;
      const Lanes least = smaller(from, there), most = larger(from, there);
      low[side] = is_first ? least : smaller(low[side], least);
      high[side] = is_first ? most : larger(high[side], most);
      largest = larger(largest, larger(absolute<double>(from), absolute<double>(to)));
    }
    // Each place at `until` is wrong by less than 4 half ulps of the largest number, and by underflow.
    const Lanes margin = (separation + largest * 0x1p-49) * (1 + 0x1p-50) + 0x1p-1000;
    apart |= exceeds(low[0] - high[1], margin) | exceeds(low[1] - high[0], margin);
  }
  return apart;
}

/// Tests whether two parallel planes farther apart than the separation, perpendicular to a direction w that
/// stays the same from t = 0 to `until`, separate the elements. Differences d between a point of one element
/// and one of the other are convex combinations of those of corners, so that it suffices that w . d exceeds
/// separation |w| for these, at 0 and at `until`. Tries the sum of all differences and the normal n half-way,
/// as they are computed: any w proves it.
///
/// Errors. Let D be the largest magnitudes of computed differences along each axis. A difference is wrong by
/// u D at t = 0 and by 4.01 u D at `until`; the scalar product has three roundings of its own: together w . d
/// is wrong by at most 7.1 u times the sum of |w| D over the axes, which is computed with an error of 3 u.
/// `gap` is 16 u. Powers of two stand for underflow. The last comparison is of squares, with 32 u for its
/// nine roundings; a separation times w that underflows is less than 2^-500.
template <std::size_t split>
KBVH_INLINE Mask planes_apart(const ImpactBlock& block, std::size_t i, double until, double separation,
                              const ImpactErrors& errors) {
  constexpr std::size_t pairs = split * (4 - split);
  Lanes at[2][pairs][3], directions[2][3], reach[3];
  for (int axis = 0; axis < 3; ++axis) {
    reach[axis] = lanes_of(0x1p-1000);
    directions[0][axis] = Lanes{};
    for (std::size_t pair = 0; pair < pairs; ++pair) {
      const std::size_t first = pair % split, second = split + pair / split;
      const Lanes from = coordinate(block, 0, second, axis, i) - coordinate(block, 0, first, axis, i);
      const Lanes to = coordinate(block, 1, second, axis, i) - coordinate(block, 1, first, axis, i);
      at[0][pair][axis] = from;
      at[1][pair][axis] = (1 - until) * from + until * to;
      reach[axis] = larger(reach[axis], larger(absolute<double>(from), absolute<double>(to)));
      directions[0][axis] = directions[0][axis] + at[0][pair][axis] + at[1][pair][axis];
    }
  }
  Lanes a[3], b[3];
  for (int axis = 0; axis < 3; ++axis) {
    const auto middle = [&](std::size_t to, std::size_t from) __attribute__((always_inline)) {
      return (2 - until) * (coordinate(block, 0, to, axis, i) - coordinate(block, 0, from, axis, i)) +
             until * (coordinate(block, 1, to, axis, i) - coordinate(block, 1, from, axis, i));
    };
    a[axis] = split == 1 ? middle(2, 1) : middle(1, 0);
    b[axis] = split == 1 ? middle(3, 1) : middle(3, 2);
  }
  for (int k = 0; k < 3; ++k)
    directions[1][k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
  Mask apart{};
  for (const Lanes(&w)[3] : directions) {
    Lanes low{}, high{};
    for (int end = 0; end < 2; ++end)
      for (std::size_t pair = 0; pair < pairs; ++pair) {
        const Lanes(&d)[3] = at[end][pair];
        const Lanes along = w[0] * d[0] + w[1] * d[1] + w[2] * d[2];
        const bool is_first = end == 0 && pair == 0;
        low = is_first ? along : smaller(low, along);
        high = is_first ? along : larger(high, along);
      }
    Lanes sum{}, squared{};
    for (int axis = 0; axis < 3; ++axis) {
      sum = sum + absolute<double>(w[axis]) * reach[axis];
      squared = squared + (separation * w[axis]) * (separation * w[axis]);
    }
    const Lanes gap = larger(low, -high) - (errors.gap * sum + 0x1p-1020);
    apart |= exceeds(gap, Lanes{}) & exceeds(gap * gap, squared * (1 + 0x1p-48) + 0x1p-1000);
  }
  return apart;
}

template <std::size_t split>
std::uint64_t apart(const ImpactBlock& block, std::uint64_t which, double until, double separation,
                    const ImpactErrors& errors) {
  std::uint64_t found = 0;
  for (std::size_t i = 0; i < room; i += width) {
    const unsigned wanted = unsigned(which >> i) & all_lanes;
    if (wanted == 0) continue;
    unsigned these = bits_of(boxes_apart<split>(block, i, until, separation)) & wanted;
    if (separation > 0 && these != wanted)
      these |= bits_of(planes_apart<split>(block, i, until, separation, errors)) & wanted;
    found |= std::uint64_t(these) << i;
  }
  return found;
}

// ---- Polynomials ------------------------------------------------------------------------------------------

/// A difference of two points along each axis, at t = 0 and t = 1.
struct Difference {
  Lanes at[3][2];  // [axis][end]
};
KBVH_INLINE Difference difference(const ImpactBlock& block, std::size_t i, std::size_t to, std::size_t from) {
  Difference d;
  for (int axis = 0; axis < 3; ++axis)
    for (int end = 0; end < 2; ++end)
      d.at[axis][end] = coordinate(block, end, to, axis, i) - coordinate(block, end, from, axis, i);
  return d;
}

/// Bernstein coefficients of a quadratic along each axis.
struct Quadratics {
  Lanes of[3][3];  // [axis][coefficient]
};
KBVH_INLINE Quadratics cross(const Difference& a, const Difference& b) {
  Quadratics q;
  for (int k = 0; k < 3; ++k) {
    const Lanes(&ai)[2] = a.at[(k + 1) % 3], (&aj)[2] = a.at[(k + 2) % 3];
    const Lanes(&bi)[2] = b.at[(k + 1) % 3], (&bj)[2] = b.at[(k + 2) % 3];
    q.of[k][0] = ai[0] * bj[0] - aj[0] * bi[0];
    q.of[k][1] = 0.5 * ((ai[0] * bj[1] - aj[0] * bi[1]) + (ai[1] * bj[0] - aj[1] * bi[0]));
    q.of[k][2] = ai[1] * bj[1] - aj[1] * bi[1];
  }
  return q;
}
/// Returns the scalar product of coefficient c of n, times `factor`, with r at one end.
KBVH_INLINE Lanes dot(const Quadratics& n, int c, double factor, const Difference& r, int end) {
  return factor * n.of[0][c] * r.at[0][end] + factor * n.of[1][c] * r.at[1][end] +
         factor * n.of[2][c] * r.at[2][end];
}

/// Part of the motion, whose ends are multiples of 2^-20.
struct Interval {
  Lanes begin, end;
};
/// Returns (1 - t) p + t q.
KBVH_INLINE Lanes between(Lanes p, Lanes q, Lanes t) {
  return (1 - t) * p + t * q;
}
/// Replaces Bernstein coefficients over [0, 1] by those over the interval.
KBVH_INLINE void restrict_to(const Interval& interval, Lanes (&q)[3]) {
  const Lanes s0 = between(q[0], q[1], interval.begin), s1 = between(q[1], q[2], interval.begin);
  const Lanes e0 = between(q[0], q[1], interval.end), e1 = between(q[1], q[2], interval.end);
  q[0] = between(s0, s1, interval.begin);
  q[1] = between(s0, s1, interval.end);
  q[2] = between(e0, e1, interval.end);
}

/// Bernstein coefficients of a cubic.
struct Cubic {
  Lanes f[4];

  KBVH_INLINE Lanes value(Lanes t) const {
    const Lanes f01 = between(f[0], f[1], t), f12 = between(f[1], f[2], t), f23 = between(f[2], f[3], t);
    return between(between(f01, f12, t), between(f12, f23, t), t);
  }
  /// Returns k of the cell [k, k + 1] / 2^20 that contains the root, approximately, of a cubic that falls
  /// from f[0] > 0 to f[3] < 0: Newton's method, or a bisection where a step leaves the bracket. A lane that
  /// has converged stays, so that no lane depends on its neighbours.
  KBVH_INLINE Lanes cell_of_root(Mask active) const {
    const Lanes c1 = 3 * (f[1] - f[0]), c2 = 3 * (f[2] - 2 * f[1] + f[0]);
    const Lanes c3 = f[3] - 3 * f[2] + 3 * f[1] - f[0];
    Lanes low{}, high = lanes_of(1), t = f[0] / (f[0] - f[3]);
    constexpr int most_steps = 12;
    for (int step = 0; step < most_steps && bits_of(active) != 0; ++step) {
      const Lanes v = ((c3 * t + c2) * t + c1) * t + f[0];
      const Lanes slope = (3 * c3 * t + 2 * c2) * t + c1;
      const Mask before = exceeds(v, Lanes{});
      low = either(before & active, t, low);
      high = either(~before & active, t, high);
      Lanes next = t - v / slope;
      next = either(exceeds(low, next) | exceeds(next, high), 0.5 * (low + high), next);
      const Lanes moved = absolute<double>(next - t);
      t = either(active, next, t);
      active &= exceeds(moved, lanes_of(0x1p-30));
    }
    // Rounds to the integer below: the sum has no bits behind the point.
    constexpr double shift = 0x1.8p52;
    return clamped((t * cells - 0.5 + shift) - shift);
  }
  KBVH_INLINE static Lanes clamped(Lanes k) { return larger(smaller(k, lanes_of(cells - 1)), Lanes{}); }
};

/// The signs of n and its shares along one axis, in an interval.
struct Signs {
  Mask some_positive{}, some_negative{}, all_positive = ~Mask{}, all_negative = ~Mask{};

  KBVH_INLINE void add(Lanes q0, Lanes q1, Lanes q2, Lanes beyond) {
    const Mask positive = exceeds(smaller(smaller(q0, q1), q2), beyond);
    const Mask negative = exceeds(-beyond, larger(larger(q0, q1), q2));
    some_positive |= positive;
    some_negative |= negative;
    all_positive &= positive;
    all_negative &= negative;
  }
};

// ---- Verdicts ---------------------------------------------------------------------------------------------

struct Decided {
  unsigned free, touching;
  Lanes begin;
};

template <bool faces>
KBVH_INLINE Decided decide_lanes(const ImpactBlock& block, std::size_t i, const ImpactErrors& errors) {
  const Difference a = faces ? difference(block, i, 2, 1) : difference(block, i, 1, 0);
  const Difference b = faces ? difference(block, i, 3, 1) : difference(block, i, 3, 2);
  const Difference r = faces ? difference(block, i, 0, 1) : difference(block, i, 2, 0);
  Quadratics n = cross(a, b);
  Cubic cubic;
  cubic.f[0] = 3 * dot(n, 0, 1, r, 0);
  cubic.f[1] = dot(n, 0, 1, r, 1) + dot(n, 1, 2, r, 0);
  cubic.f[2] = dot(n, 1, 2, r, 1) + dot(n, 2, 1, r, 0);
  cubic.f[3] = 3 * dot(n, 2, 1, r, 1);

  Lanes largest_a[3], largest_b[3], largest_r[3], ab[3], volume{};
  for (int k = 0; k < 3; ++k) {
    largest_a[k] = larger(absolute<double>(a.at[k][0]), absolute<double>(a.at[k][1]));
    largest_b[k] = larger(absolute<double>(b.at[k][0]), absolute<double>(b.at[k][1]));
    largest_r[k] = larger(absolute<double>(r.at[k][0]), absolute<double>(r.at[k][1]));
  }
  for (int k = 0; k < 3; ++k) {
    const int p = (k + 1) % 3, q = (k + 2) % 3;
    ab[k] = largest_a[p] * largest_b[q] + largest_a[q] * largest_b[p];
    volume = volume + ab[k] * largest_r[k];
  }
  const Lanes bound = errors.cubic * volume + errors.least_cubic;
  // A cubic that falls to a negative value is decided as one that rises to a positive one.
  const Mask turned = bits<double>(cubic.f[0]) & (Word<double>(1) << sign_shift<double>);
  for (Lanes& f : cubic.f) f = __builtin_bit_cast(Lanes, bits<double>(f) ^ turned);
  const Lanes(&f)[4] = cubic.f;
  Mask free = exceeds(smaller(smaller(f[0], f[1]), smaller(f[2], f[3])), bound);
  if (bits_of(free) == all_lanes) return {all_lanes, 0, Lanes{}};

  // One change of sign: f[1] is not negative, or f[2] not positive.
  const Mask once =
      exceeds(f[0], bound) & exceeds(-bound, f[3]) & (exceeds(f[1], bound) | exceeds(-bound, f[2]));
  Interval interval{Lanes{}, lanes_of(1)};
  Mask isolated{};
  if (bits_of(once) != 0) {
    Lanes k = cubic.cell_of_root(once);
    Lanes at_begin = cubic.value(k * cell_width), at_end = cubic.value((k + 1) * cell_width);
    isolated = once & exceeds(at_begin, bound) & exceeds(-bound, at_end);
    if (bits_of(once & ~isolated) != 0) {
      // The root may be in a neighbouring cell.
      k = either(exceeds(Lanes{}, at_begin), k - 1, either(exceeds(at_end, Lanes{}), k + 1, k));
      k = Cubic::clamped(k);
      at_begin = cubic.value(k * cell_width), at_end = cubic.value((k + 1) * cell_width);
      isolated = once & exceeds(at_begin, bound) & exceeds(-bound, at_end);
    }
    interval.begin = either(isolated, k * cell_width, interval.begin);
    interval.end = either(isolated, (k + 1) * cell_width, interval.end);
  }

  Quadratics x = faces ? cross(a, r) : cross(r, a), y = cross(r, b);
  Mask inside{};
  for (int k = 0; k < 3; ++k) {
    const int p = (k + 1) % 3, q = (k + 2) % 3;
    const Lanes area = ab[k] + (largest_a[p] * largest_r[q] + largest_a[q] * largest_r[p]) +
                       (largest_r[p] * largest_b[q] + largest_r[q] * largest_b[p]);
    const Lanes beyond = errors.quadratic * area + errors.least_quadratic;
    restrict_to(interval, n.of[k]);
    restrict_to(interval, x.of[k]);
    restrict_to(interval, y.of[k]);
    const Lanes(&nk)[3] = n.of[k], (&xk)[3] = x.of[k], (&yk)[3] = y.of[k];
    Signs signs;
    signs.add(nk[0], nk[1], nk[2], beyond);
    signs.add(xk[0], xk[1], xk[2], beyond);
    signs.add(yk[0], yk[1], yk[2], beyond);
    if constexpr (faces) {
      signs.add(nk[0] - xk[0] - yk[0], nk[1] - xk[1] - yk[1], nk[2] - xk[2] - yk[2], beyond);
    } else {
      signs.add(nk[0] - xk[0], nk[1] - xk[1], nk[2] - xk[2], beyond);
      signs.add(nk[0] - yk[0], nk[1] - yk[1], nk[2] - yk[2], beyond);
    }
    free |= signs.some_positive & signs.some_negative;
    inside |= signs.all_positive | signs.all_negative;
  }
  return {bits_of(free), bits_of(isolated & inside & ~free), interval.begin};
}

template <bool faces>
void decide(const ImpactBlock& block, std::uint64_t which, const ImpactErrors& errors,
            ImpactVerdicts& verdicts) {
  std::uint64_t left = 0;
  for (std::size_t i = 0; i < room; i += width) {
    const unsigned wanted = unsigned(which >> i) & all_lanes;
    if (wanted == 0) continue;
    left |= std::uint64_t(wanted & ~bits_of(kept_apart < faces ? 1 : 2 > (block, i))) << i;
  }
  verdicts.free = which & ~left;
  verdicts.touching = 0;

  // Brings the others together, so that no lane is idle, and repeats the last one in the lanes that remain.
  std::uint8_t query[room + width];
  std::size_t count = 0;
  for (std::uint64_t rest = left; rest != 0; rest &= rest - 1)
    query[count++] = std::uint8_t(__builtin_ctzll(rest));
  if (count == 0) return;
  const ImpactBlock* from = &block;
  ImpactBlock packed;
  const bool gapless = query[count - 1] == count - 1;
  if (width > 1 && !gapless) {
    const std::size_t padded = (count + width - 1) / width * width;
    for (std::size_t i = count; i < padded; ++i) query[i] = query[count - 1];
    for (int end = 0; end < 2; ++end)
      for (std::size_t point = 0; point < 4; ++point)
        for (int axis = 0; axis < 3; ++axis)
          for (std::size_t i = 0; i < padded; ++i)
            packed.points[end][point][axis][i] = block.points[end][point][axis][query[i]];
    from = &packed;
  }
  for (std::size_t i = 0; i < count; i += width) {
    const Decided decided = decide_lanes<faces>(*from, width == 1 ? query[i] : i, errors);
    double begin[width];
    store_lanes(begin, decided.begin);
    const std::size_t size = count - i < width ? count - i : width;
    for (std::size_t lane = 0; lane < size; ++lane) {
      verdicts.free |= std::uint64_t(decided.free >> lane & 1) << query[i + lane];
      verdicts.touching |= std::uint64_t(decided.touching >> lane & 1) << query[i + lane];
      verdicts.begin[query[i + lane]] = begin[lane];
    }
  }
}

}  // namespace

namespace kernels::KBVH_KERNELS {
extern const ImpactKernels impact_kernels = {decide<true>, decide<false>, apart<1>, apart<2>};
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh

#undef KBVH_INLINE

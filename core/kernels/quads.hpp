#pragma once
// Internal to kernels: points in memory order (x, y, z, and one more number) and their
// transposition into rows of coordinates. A Pack holds one point in four lanes, or two points in eight.
#include "core/kernels/lanes.hpp"

namespace kbvh {
namespace {

/// A point in plain numbers, for instruction sets without a suitable register.
template <class S>
struct PlainPoint {
  S v[3];
};
template <class S>
[[gnu::always_inline]] inline PlainPoint<S> smaller(PlainPoint<S> a, PlainPoint<S> b) {
  return {{smaller(a.v[0], b.v[0]), smaller(a.v[1], b.v[1]), smaller(a.v[2], b.v[2])}};
}
template <class S>
[[gnu::always_inline]] inline PlainPoint<S> larger(PlainPoint<S> a, PlainPoint<S> b) {
  return {{larger(a.v[0], b.v[0]), larger(a.v[1], b.v[1]), larger(a.v[2], b.v[2])}};
}

/// Points in plain numbers; the vectorised version is below.
template <class S, std::size_t wanted_points, bool in_registers = (native_lanes<S> >= 4)>
struct Points {
  static constexpr std::size_t points = 1;
  using Pack = PlainPoint<S>;
  /// Loads the point at `a` and, if a pack holds two, the point at `b`.
  [[gnu::always_inline]] static Pack load(const S* a, const S* /*b*/) { return {{a[0], a[1], a[2]}}; }
  /// Returns a pack whose points have all coordinates a, and if it holds two, the second ones b.
  [[gnu::always_inline]] static Pack all(S a, S /*b*/) { return {{a, a, a}}; }
  /// Writes four packs as rows: rows[axis * stride + i] for the points i < many, each number negated if
  /// `turned`.
  template <bool turned>
  [[gnu::always_inline]] static void store_rows(const Pack (&p)[4], S* rows, std::size_t stride,
                                                std::size_t many) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (std::size_t i = 0; i < many; ++i) rows[axis * stride + i] = turned ? -p[i].v[axis] : p[i].v[axis];
  }
  /// Stores the smallest and largest coordinates of a pack's points; may write a fourth number.
  [[gnu::always_inline]] static void store_smallest(S* to, Pack p) {
    for (int i = 0; i < 3; ++i) to[i] = p.v[i];
  }
  [[gnu::always_inline]] static void store_largest(S* to, Pack p) { store_smallest(to, p); }
};

#if defined(KBVH_KERNELS_avx2) || defined(KBVH_KERNELS_avx512)
// A single instruction that reads memory; GCC 12 makes a load and a shuffle of __builtin_shufflevector.
[[gnu::always_inline]] inline Vector<float, 8> joined(Vector<float, 4> a, Vector<float, 4> b) {
  return (Vector<float, 8>)_mm256_insertf128_ps(_mm256_castps128_ps256((__m128)a), (__m128)b, 1);
}
#endif
#if defined(KBVH_KERNELS_avx512)
[[gnu::always_inline]] inline Vector<double, 8> joined(Vector<double, 4> a, Vector<double, 4> b) {
  return __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7);
}
#endif

/// Points in registers; point i < 4 of four packs is their first point, point 4 + i their second. `load`
/// reads a fourth number past each point.
template <class S, std::size_t wanted_points>
struct Points<S, wanted_points, true> {
  static constexpr std::size_t points = native_lanes<S> >= 8 ? wanted_points : 1;
  static constexpr std::size_t lanes = 4 * points;
  using Point = Vector<S, 4>;
  using Pack = Vector<S, lanes>;

  [[gnu::always_inline]] static Pack load(const S* a, const S* b) {
    if constexpr (points == 1) {
      (void)b;
      return load_lanes<Point>(a);
    } else {
      return joined(load_lanes<Point>(a), load_lanes<Point>(b));
    }
  }
  [[gnu::always_inline]] static Pack all(S a, S b) {
    if constexpr (points == 1) {
      (void)b;
      return Point{a, a, a, a};
    } else {
      return joined(Point{a, a, a, a}, Point{b, b, b, b});
    }
  }
  template <bool turned>
  [[gnu::always_inline]] static void store_rows(const Pack (&p)[4], S* rows, std::size_t stride,
                                                std::size_t many) {
    Pack x, y, z;
    // The two patterns are the cheap ones for 4-byte and for 8-byte lanes.
    if constexpr (points == 2 && sizeof(S) == 4) {
      const Pack xy01 = __builtin_shufflevector(p[0], p[1], 0, 8, 1, 9, 4, 12, 5, 13);
      const Pack xy23 = __builtin_shufflevector(p[2], p[3], 0, 8, 1, 9, 4, 12, 5, 13);
      const Pack z01 = __builtin_shufflevector(p[0], p[1], 2, 10, 3, 11, 6, 14, 7, 15);
      const Pack z23 = __builtin_shufflevector(p[2], p[3], 2, 10, 3, 11, 6, 14, 7, 15);
      x = __builtin_shufflevector(xy01, xy23, 0, 1, 8, 9, 4, 5, 12, 13);
      y = __builtin_shufflevector(xy01, xy23, 2, 3, 10, 11, 6, 7, 14, 15);
      z = __builtin_shufflevector(z01, z23, 0, 1, 8, 9, 4, 5, 12, 13);
    } else if constexpr (points == 2) {
      const Pack xz01 = __builtin_shufflevector(p[0], p[1], 0, 8, 2, 10, 4, 12, 6, 14);
      const Pack xz23 = __builtin_shufflevector(p[2], p[3], 0, 8, 2, 10, 4, 12, 6, 14);
      const Pack y01 = __builtin_shufflevector(p[0], p[1], 1, 9, 3, 11, 5, 13, 7, 15);
      const Pack y23 = __builtin_shufflevector(p[2], p[3], 1, 9, 3, 11, 5, 13, 7, 15);
      x = __builtin_shufflevector(xz01, xz23, 0, 1, 8, 9, 4, 5, 12, 13);
      y = __builtin_shufflevector(y01, y23, 0, 1, 8, 9, 4, 5, 12, 13);
      z = __builtin_shufflevector(xz01, xz23, 2, 3, 10, 11, 6, 7, 14, 15);
    } else if constexpr (sizeof(S) == 4) {
      const Pack xy01 = __builtin_shufflevector(p[0], p[1], 0, 4, 1, 5);
      const Pack xy23 = __builtin_shufflevector(p[2], p[3], 0, 4, 1, 5);
      const Pack z01 = __builtin_shufflevector(p[0], p[1], 2, 6, 3, 7);
      const Pack z23 = __builtin_shufflevector(p[2], p[3], 2, 6, 3, 7);
      x = __builtin_shufflevector(xy01, xy23, 0, 1, 4, 5);
      y = __builtin_shufflevector(xy01, xy23, 2, 3, 6, 7);
      z = __builtin_shufflevector(z01, z23, 0, 1, 4, 5);
    } else {
      const Pack xz01 = __builtin_shufflevector(p[0], p[1], 0, 4, 2, 6);
      const Pack xz23 = __builtin_shufflevector(p[2], p[3], 0, 4, 2, 6);
      const Pack y01 = __builtin_shufflevector(p[0], p[1], 1, 5, 3, 7);
      const Pack y23 = __builtin_shufflevector(p[2], p[3], 1, 5, 3, 7);
      x = __builtin_shufflevector(xz01, xz23, 0, 1, 4, 5);
      y = __builtin_shufflevector(y01, y23, 0, 1, 4, 5);
      z = __builtin_shufflevector(xz01, xz23, 2, 3, 6, 7);
    }
    if constexpr (turned) {
      x = -x;
      y = -y;
      z = -z;
    }
    if (many >= lanes) {
      store_lanes(rows, x);
      store_lanes(rows + stride, y);
      store_lanes(rows + 2 * stride, z);
    } else {
      __builtin_memcpy(rows, &x, many * sizeof(S));
      __builtin_memcpy(rows + stride, &y, many * sizeof(S));
      __builtin_memcpy(rows + 2 * stride, &z, many * sizeof(S));
    }
  }

  [[gnu::always_inline]] static void store_smallest(S* to, Pack p) {
    if constexpr (points == 1) {
      store_lanes(to, p);
    } else {
      store_lanes(
          to, smaller(__builtin_shufflevector(p, p, 0, 1, 2, 3), __builtin_shufflevector(p, p, 4, 5, 6, 7)));
    }
  }
  [[gnu::always_inline]] static void store_largest(S* to, Pack p) {
    if constexpr (points == 1) {
      store_lanes(to, p);
    } else {
      store_lanes(
          to, larger(__builtin_shufflevector(p, p, 0, 1, 2, 3), __builtin_shufflevector(p, p, 4, 5, 6, 7)));
    }
  }
};

}  // namespace
}  // namespace kbvh

#pragma once
// Internal to kernels: points of triangles in lanes, one pair of triangles per lane.
#include "core/kernels/lanes.hpp"

#define KBVH_INLINE [[gnu::always_inline]] inline

namespace kbvh {
namespace {

template <class S>
struct WordsOf;
template <>
struct WordsOf<float> {
  using Unsigned = std::uint32_t;
  using Signed = std::int32_t;
};
template <>
struct WordsOf<double> {
  using Unsigned = std::uint64_t;
  using Signed = std::int64_t;
};

template <class S>
constexpr std::size_t lanes = native_lanes<S>;
/// One value per pair of a register.
template <class S>
using Values = Vector<S, lanes<S>>;
/// Words of the same width: the bits of values, or a mask.
template <class S>
using Word = typename WordsOf<S>::Unsigned;
template <class S>
using Words = Vector<Word<S>, lanes<S>>;

template <class S>
constexpr int sign_shift = int(8 * sizeof(S)) - 1;

template <class S>
KBVH_INLINE Words<S> bits(Values<S> x) {
  return __builtin_bit_cast(Words<S>, x);
}
template <class S>
KBVH_INLINE Values<S> absolute(Values<S> x) {
  return __builtin_bit_cast(Values<S>, bits<S>(x) & (~Word<S>(0) >> 1));
}
/// Returns all bits set where x > y, else none.
template <class S>
KBVH_INLINE Words<S> greater(Values<S> x, Values<S> y) {
#if defined(KBVH_KERNELS_portable)
  return x > y ? ~Words<S>(0) : 0;
#else
  return (Words<S>)(x > y);
#endif
}
/// Returns the highest bit of each lane.
template <class S>
KBVH_INLINE unsigned high_bits(Words<S> mask) {
#if defined(KBVH_KERNELS_portable)
  return unsigned(mask >> sign_shift<S>);
#else
  return mask_bits((Vector<typename WordsOf<S>::Signed, lanes<S>>)mask);
#endif
}

template <class S>
struct Point {
  Values<S> x, y, z;
};
template <class S>
KBVH_INLINE Point<S> operator-(const Point<S>& p, const Point<S>& q) {
  return {p.x - q.x, p.y - q.y, p.z - q.z};
}
template <class S>
KBVH_INLINE Values<S> dot(const Point<S>& p, const Point<S>& q) {
  return p.x * q.x + p.y * q.y + p.z * q.z;
}
template <class S>
KBVH_INLINE Point<S> absolute(const Point<S>& p) {
  return {absolute<S>(p.x), absolute<S>(p.y), absolute<S>(p.z)};
}
template <class S>
KBVH_INLINE Point<S> larger(const Point<S>& p, const Point<S>& q) {
  return {larger(p.x, q.x), larger(p.y, q.y), larger(p.z, q.z)};
}

// ---- Loads: lane k of the result is the point at rows[k], read with one scalar behind it ------------------

#if defined(KBVH_KERNELS_portable)
template <class S>
KBVH_INLINE Point<S> load_points(const S* const* rows) {
  return {rows[0][0], rows[0][1], rows[0][2]};
}
#else
#if defined(KBVH_KERNELS_avx512)
#define KBVH_FLOATS(operation) _mm512_##operation
#elif defined(KBVH_KERNELS_avx2)
#define KBVH_FLOATS(operation) _mm256_##operation
#else
#define KBVH_FLOATS(operation) _mm_##operation
#endif

/// Loads points 0, 4, 8, ..., one in each 128 bits.
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
KBVH_INLINE Point<float> load_points(const float* const* rows) {
  const auto r0 = load_row(rows), r1 = load_row(rows + 1), r2 = load_row(rows + 2), r3 = load_row(rows + 3);
  const auto xy01 = KBVH_FLOATS(castps_pd)(KBVH_FLOATS(unpacklo_ps)(r0, r1));
  const auto xy23 = KBVH_FLOATS(castps_pd)(KBVH_FLOATS(unpacklo_ps)(r2, r3));
  const auto z01 = KBVH_FLOATS(castps_pd)(KBVH_FLOATS(unpackhi_ps)(r0, r1));
  const auto z23 = KBVH_FLOATS(castps_pd)(KBVH_FLOATS(unpackhi_ps)(r2, r3));
  return {KBVH_FLOATS(castpd_ps)(KBVH_FLOATS(unpacklo_pd)(xy01, xy23)),
          KBVH_FLOATS(castpd_ps)(KBVH_FLOATS(unpackhi_pd)(xy01, xy23)),
          KBVH_FLOATS(castpd_ps)(KBVH_FLOATS(unpacklo_pd)(z01, z23))};
}
#undef KBVH_FLOATS

#if defined(KBVH_KERNELS_sse)
KBVH_INLINE Point<double> load_points(const double* const* rows) {
  const __m128d xy0 = _mm_loadu_pd(rows[0]), xy1 = _mm_loadu_pd(rows[1]);
  return {_mm_unpacklo_pd(xy0, xy1), _mm_unpackhi_pd(xy0, xy1),
          _mm_loadh_pd(_mm_load_sd(rows[0] + 2), rows[1] + 2)};
}
#else
struct FourPoints {
  __m256d x, y, z;
};
KBVH_INLINE FourPoints load_four(const double* const* rows) {
  const __m256d r0 = _mm256_loadu_pd(rows[0]), r1 = _mm256_loadu_pd(rows[1]), r2 = _mm256_loadu_pd(rows[2]),
                r3 = _mm256_loadu_pd(rows[3]);
  const __m256d xz01 = _mm256_unpacklo_pd(r0, r1), xz23 = _mm256_unpacklo_pd(r2, r3);
  const __m256d y01 = _mm256_unpackhi_pd(r0, r1), y23 = _mm256_unpackhi_pd(r2, r3);
  return {_mm256_permute2f128_pd(xz01, xz23, 0x20), _mm256_permute2f128_pd(y01, y23, 0x20),
          _mm256_permute2f128_pd(xz01, xz23, 0x31)};
}
#if defined(KBVH_KERNELS_avx512)
KBVH_INLINE __m512d joined(__m256d low, __m256d high) {
  return _mm512_insertf64x4(_mm512_castpd256_pd512(low), high, 1);
}
KBVH_INLINE Point<double> load_points(const double* const* rows) {
  const FourPoints p = load_four(rows), q = load_four(rows + 4);
  return {joined(p.x, q.x), joined(p.y, q.y), joined(p.z, q.z)};
}
#else
KBVH_INLINE Point<double> load_points(const double* const* rows) {
  const FourPoints p = load_four(rows);
  return {p.x, p.y, p.z};
}
#endif
#endif
#endif

}  // namespace
}  // namespace kbvh

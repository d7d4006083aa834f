#pragma once
// Internal to kernels (core/*/kernels/*.cpp): vectors as wide as the instruction set of the file. Everything
// is in an anonymous namespace and forced inline, so that no two translation units share code. "portable"
// uses vectors of one lane, which are plain numbers: the same source without any extension.
#include <cstddef>
#include <cstdint>
// A header that is compiled by itself, without an instruction set, is portable.
#if !defined(KBVH_KERNELS_avx512) && !defined(KBVH_KERNELS_avx2) && !defined(KBVH_KERNELS_sse) && \
    !defined(KBVH_KERNELS_portable)
#define KBVH_KERNELS_portable
#endif
#if !defined(KBVH_KERNELS_portable)
#include <immintrin.h>
#endif

namespace kbvh {
namespace {

#if defined(KBVH_KERNELS_avx512)
constexpr std::size_t kRegisterBytes = 64;
#elif defined(KBVH_KERNELS_avx2)
constexpr std::size_t kRegisterBytes = 32;
#elif defined(KBVH_KERNELS_sse)
constexpr std::size_t kRegisterBytes = 16;
#else
constexpr std::size_t kRegisterBytes = 0;
#endif

template <class S, std::size_t n>
struct VectorOf {
  using type [[gnu::vector_size(n * sizeof(S))]] = S;
};
template <class S>
struct VectorOf<S, 1> {
  using type = S;
};
/// n numbers that are computed together; for n = 1 a plain number.
template <class S, std::size_t n>
using Vector = typename VectorOf<S, n>::type;

/// The largest number of lanes of a register, or 1.
template <class S>
constexpr std::size_t native_lanes = kRegisterBytes == 0 ? 1 : kRegisterBytes / sizeof(S);

template <class V, class S>
[[gnu::always_inline]] inline V load_lanes(const S* from) {
  V v;
  __builtin_memcpy(&v, from, sizeof v);
  return v;
}
template <class V, class S>
[[gnu::always_inline]] inline void store_lanes(S* to, V v) {
  __builtin_memcpy(to, &v, sizeof v);
}
/// Returns the smaller value of each lane; b where they are equal (both zeros count as one number) or
/// unordered.
template <class V>
[[gnu::always_inline]] inline V smaller(V a, V b) {
  return a < b ? a : b;
}
template <class V>
[[gnu::always_inline]] inline V larger(V a, V b) {
  return a > b ? a : b;
}

/// Returns one bit per lane of a comparison's result.
[[gnu::always_inline]] inline unsigned mask_bits(bool lane) {
  return lane ? 1U : 0U;
}
#if !defined(KBVH_KERNELS_portable)
// Dispatches by size, not by type: compilers differ in the type of a comparison's lanes.
template <class V>
[[gnu::always_inline]] inline unsigned mask_bits(V m) {
  constexpr std::size_t lane = sizeof(m[0]);
  static_assert(lane == 4 || lane == 8);
  if constexpr (sizeof(V) == 16) {
    return lane == 4 ? unsigned(_mm_movemask_ps((__m128)m)) : unsigned(_mm_movemask_pd((__m128d)m));
  }
#if defined(KBVH_KERNELS_avx2) || defined(KBVH_KERNELS_avx512)
  if constexpr (sizeof(V) == 32) {
    return lane == 4 ? unsigned(_mm256_movemask_ps((__m256)m)) : unsigned(_mm256_movemask_pd((__m256d)m));
  }
#endif
#if defined(KBVH_KERNELS_avx512)
  // Through 32 bits: GCC 12 can spill a 16-bit mask and reload more than it wrote.
  if constexpr (sizeof(V) == 64) {
    if constexpr (lane == 4)
      return unsigned(_mm512_movepi32_mask((__m512i)m)) & 0xffffU;
    else
      return unsigned(_mm512_movepi64_mask((__m512i)m)) & 0xffU;
  }
#endif
}
#endif

/// Copies, in order, those of at most 16 numbers whose bits are set, and returns their count. May write to 16
/// places.
template <class T>
[[gnu::always_inline]] inline unsigned pack_lanes(unsigned bits, const T* from, T* to) {
  static_assert(sizeof(T) == 4);
#if defined(KBVH_KERNELS_avx512)
  const auto mask = __mmask16(bits);
  _mm512_storeu_si512(to, _mm512_maskz_compress_epi32(mask, _mm512_maskz_loadu_epi32(mask, from)));
  return unsigned(__builtin_popcount(bits));
#else
  unsigned count = 0;
  for (; bits != 0; bits &= bits - 1) to[count++] = from[__builtin_ctz(bits)];
  return count;
#endif
}

}  // namespace
}  // namespace kbvh

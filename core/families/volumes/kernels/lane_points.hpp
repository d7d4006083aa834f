#pragma once
// Internal to kernels: points of a node's leaves in eight lanes, and the points below a node in rows.
#include "core/families/wide/kernels/node_fit.hpp"

namespace kbvh {
namespace {

/// A register of at most `most` lanes, or a plain number: no register is shorter than 16 bytes.
template <class S, std::size_t most>
constexpr std::size_t lanes_up_to = [] {
  const std::size_t lanes = native_lanes<S> < most ? native_lanes<S> : most;
  return lanes * sizeof(S) < 16 ? std::size_t(1) : lanes;
}();
/// Eight lanes take 8 / eighth<S> registers.
template <class S>
constexpr std::size_t eighth = lanes_up_to<S, 8>;
template <class S>
using Eighth = Vector<S, eighth<S>>;

template <class V>
[[gnu::always_inline]] inline V root(V x) {
#if !defined(KBVH_KERNELS_portable)
  constexpr std::size_t lane = sizeof(x[0]);
  if constexpr (sizeof(V) == 16) {
    return lane == 4 ? (V)_mm_sqrt_ps((__m128)x) : (V)_mm_sqrt_pd((__m128d)x);
  }
#if defined(KBVH_KERNELS_avx2) || defined(KBVH_KERNELS_avx512)
  if constexpr (sizeof(V) == 32) {
    return lane == 4 ? (V)_mm256_sqrt_ps((__m256)x) : (V)_mm256_sqrt_pd((__m256d)x);
  }
#endif
#if defined(KBVH_KERNELS_avx512)
  if constexpr (sizeof(V) == 64) {
    return lane == 4 ? (V)_mm512_sqrt_ps((__m512)x) : (V)_mm512_sqrt_pd((__m512d)x);
  }
#endif
#else
  if constexpr (sizeof(V) == 4)
    return __builtin_sqrtf(x);
  else
    return __builtin_sqrt(x);
#endif
}
[[gnu::always_inline]] inline float root_of(float x) {
  return __builtin_sqrtf(x);
}
[[gnu::always_inline]] inline double root_of(double x) {
  return __builtin_sqrt(x);
}
template <class V>
[[gnu::always_inline]] inline V magnitude(V x) {
  return larger(x, -x);
}

/// Writes the points of eight lists as coordinates[i][3][8].
template <class S>
[[gnu::always_inline]] inline void load_lists(const std::uint32_t* lists, std::uint32_t length,
                                              const S* positions, S* coordinates) {
  using Fit = NodeFit<S, 8>;
  using P = typename Fit::P;
  for (std::uint32_t i = 0; i < length; ++i, lists += 8, coordinates += 24)
    for (std::uint32_t first = 0; first < 8; first += Fit::per_pass) {
      typename Fit::Pack p[4];
      for (std::uint32_t j = 0; j < 4; ++j) p[j] = Fit::listed(lists, first, j, positions);
      P::template store_rows<false>(p, coordinates + first, 8, Fit::per_pass);
    }
}

/// Writes points, a multiple of eight, as coordinates[3][count].
template <class S>
void load_points(const std::uint32_t* points, std::size_t count, const S* positions, S* coordinates) {
  using P = Points<S, 2>;
  constexpr std::uint32_t step = 4 * std::uint32_t(P::points);
  for (std::size_t i = 0; i < count; i += step) {
    typename P::Pack p[4];
    for (std::uint32_t j = 0; j < 4; ++j)
      p[j] = P::load(positions + points[i + j], positions + points[i + (P::points == 2 ? 4 + j : j)]);
    P::template store_rows<false>(p, coordinates + i, count, step);
  }
}

/// Calls step(i, V{}) for numbers [begin, end) in vectors; the last one may overlap others. For operations
/// that may process a number twice.
template <class S, class Step>
[[gnu::always_inline]] inline void in_vectors(std::size_t begin, std::size_t end, Step&& step) {
  constexpr std::size_t wide = lanes_up_to<S, 16>, narrow = lanes_up_to<S, 4>;
  if (end - begin >= wide) {
    for (; begin + wide < end; begin += wide) step(begin, Vector<S, wide>{});
    step(end - wide, Vector<S, wide>{});
  } else if (end - begin >= narrow) {
    for (; begin + narrow < end; begin += narrow) step(begin, Vector<S, narrow>{});
    step(end - narrow, Vector<S, narrow>{});
  } else {
    for (; begin < end; ++begin) step(begin, S{});
  }
}

template <class S, class V>
[[gnu::always_inline]] inline S largest_of(V v) {
  S lanes[sizeof(V) / sizeof(S)];
  store_lanes(lanes, v);
  S result = lanes[0];
  for (std::size_t i = 1; i < sizeof(V) / sizeof(S); ++i) result = larger(lanes[i], result);
  return result;
}

}  // namespace
}  // namespace kbvh

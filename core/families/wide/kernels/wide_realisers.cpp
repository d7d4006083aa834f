#include "core/families/wide/kernels/wide_realisers.hpp"

#include "core/families/wide/kernels/node_fit.hpp"

namespace kbvh {
namespace {

/// Computes values[i] = positions[places[i]], a few at a time, so that the loads are independent.
template <class S>
[[gnu::always_inline]] inline void collect_some(const std::uint32_t* places, const S* positions,
                                                std::size_t count, S* values) {
  for (std::size_t i = 0; i < count; ++i) values[i] = positions[places[i]];
}

template <class S>
void collect(const std::uint32_t* places, const S* positions, std::size_t count, S* values) {
  collect_some(places, positions, count, values);
}

/// Returns the largest number of lanes of a register that divides `many`; there are no registers shorter than
/// 16 bytes.
template <class S>
constexpr std::size_t lanes_for(std::size_t many) {
  std::size_t lanes = native_lanes<S>;
  while (lanes > 1 && (many % lanes != 0 || lanes * sizeof(S) < 16)) lanes /= 2;
  return lanes;
}

/// Gathers the coordinates at `lanes` places, without a detour through memory if possible: a load of several
/// numbers must wait until all of them have been stored.
template <class S, std::size_t lanes>
[[gnu::always_inline]] inline Vector<S, lanes> gathered(const std::uint32_t* places, const S* positions) {
#if defined(KBVH_KERNELS_avx2) || defined(KBVH_KERNELS_avx512)
  if constexpr (sizeof(S) == 4 && lanes == 8)
    return (Vector<S, lanes>)_mm256_i32gather_ps((const float*)positions,
                                                 _mm256_loadu_si256((const __m256i*)places), 4);
  else if constexpr (sizeof(S) == 8 && lanes == 4)
    return (Vector<S, lanes>)_mm256_i32gather_pd((const double*)positions,
                                                 _mm_loadu_si128((const __m128i*)places), 8);
  else
#endif
  {
    Vector<S, lanes> values;
    if constexpr (lanes == 1)
      values = positions[*places];
    else
      for (std::size_t i = 0; i < lanes; ++i) values[i] = positions[places[i]];
    return values;
  }
}

/// Returns a mask. Bit i: the realiser's coordinate differs from the bound in the rows.
template <class S, std::uint32_t width>
[[gnu::always_inline]] inline std::uint64_t lost_sides(const std::uint32_t* realisers, const S* positions,
                                                       const S* rows) {
  constexpr std::size_t scalars = 6 * width;
  constexpr std::size_t lanes = lanes_for<S>(3 * width);
  using V = Vector<S, lanes>;
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < scalars; i += lanes) {
    V value = gathered<S, lanes>(realisers + i, positions);
    if (i >= 3 * width) value = -value;
    const V bound = load_lanes<V>(rows + i);
    // Bounds are stored so that smaller is further out. Empty lanes are infinite: no coordinate is larger.
    if constexpr (lanes == 1)
      bits |= std::uint64_t(value > bound) << i;
    else
      bits |= std::uint64_t(mask_bits(value > bound)) << i;
  }
  return bits;
}

template <class S, std::uint32_t width>
void check(WideArrays<S> h, const std::uint32_t* realisers, const S* positions, std::uint64_t* lost,
           std::uint32_t begin, std::uint32_t end) {
  constexpr std::size_t scalars = 6 * width;
  alignas(64) S rows[scalars];
  for (std::uint32_t i = begin; i < end; ++i) {
    const WideNode& node = h.nodes[i];
    if (node.leaf_count != node.count) continue;
    fit_leaves<S, width>(h, node, positions, rows, h.node_bounds + std::size_t(8) * i);
    lost[i] = lost_sides<S, width>(realisers + i * scalars, positions, rows);
  }
  for (std::uint32_t i = end; i-- > begin;) {
    const WideNode& node = h.nodes[i];
    if (node.leaf_count == node.count) continue;
    fit_above<S, width>(h, node, positions, rows, h.node_bounds + std::size_t(8) * i);
    lost[i] = lost_sides<S, width>(realisers + i * scalars, positions, rows);
  }
}

template <class S, std::uint32_t width>
void place(WideArrays<S> h, const S* values, std::uint32_t node) {
  constexpr std::size_t scalars = 6 * width;
  const std::uint32_t count = h.nodes[node].count;
  S* rows = h.child_bounds + node * scalars;
  S* node_bounds = h.node_bounds + std::size_t(8) * node;
  for (std::size_t i = 0; i < 3 * width; ++i) rows[i] = values[i];
  for (std::size_t i = 3 * width; i < scalars; ++i) rows[i] = -values[i];
  if (count != width)
    for (std::size_t row = 0; row < 6; ++row)
      for (std::size_t lane = count; lane < width; ++lane) rows[row * width + lane] = infinity<S>;
  for (std::size_t row = 0; row < 6; ++row) {
    S least = rows[row * width];
    for (std::size_t lane = 1; lane < width; ++lane) least = smaller(least, rows[row * width + lane]);
    node_bounds[row < 3 ? row : row + 1] = row < 3 ? least : -least;
  }
}

template <class S>
constexpr WideRealiserKernels<S> table{
    {&check<S, 2>, &check<S, 4>, &check<S, 8>}, &collect<S>, {&place<S, 2>, &place<S, 4>, &place<S, 8>}};

}  // namespace

namespace kernels::KBVH_KERNELS {
const WideRealiserKernels<float> wide_realisers_float = table<float>;
const WideRealiserKernels<double> wide_realisers_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh

#include "core/families/blend/kernels/blend_rows.hpp"

#include "core/kernels/lanes.hpp"

namespace kbvh {
namespace {

/// Returns the smallest of all lanes.
template <class S, std::size_t lanes, class V>
[[gnu::always_inline]] inline S smallest_lane(V v) {
  if constexpr (lanes == 1) {
    return v;
  } else if constexpr (lanes == 8) {
    const V half = smaller(v, __builtin_shufflevector(v, v, 4, 5, 6, 7, 0, 1, 2, 3));
    const V quarter = smaller(half, __builtin_shufflevector(half, half, 2, 3, 0, 1, 6, 7, 4, 5));
    return smaller(quarter[0], quarter[1]);
  } else {
    S least = v[0];
    for (std::size_t i = 1; i < lanes; ++i) least = smaller(S(v[i]), least);
    return least;
  }
}

template <class S, std::uint32_t width, bool rounds>
[[gnu::always_inline]] inline void make_nodes(WideArrays<S> h, const Blend<S>& shared,
                                              const std::uint32_t* nodes, std::size_t count) {
  constexpr std::size_t fit = native_lanes<S> < width ? native_lanes<S> : width;
  constexpr std::size_t lanes = fit * sizeof(S) < 16 ? 1 : fit;  // there are no shorter registers
  constexpr std::size_t parts = width / lanes;
  using V = Vector<S, lanes>;
  const Blend<S> blend = shared;
  // Half a unit more above 1, where numbers are further apart.
  [[maybe_unused]] const S inwards = 1 - blend.rounding,
                           outwards = 1 + (blend.rounding + (sizeof(S) == 4 ? S(0x1p-24) : S(0x1p-53)));
  for (std::size_t n = 0; n < count; ++n) {
    const std::size_t node = nodes[n], at = node * blend.stride;
    V sums[6][parts];
    for (std::size_t row = 0; row < 6; ++row)
      for (std::size_t part = 0; part < parts; ++part) sums[row][part] = V{};
    for (std::uint32_t i = 0; i < blend.count; ++i) {
      const BlendTerm<S>& term = blend.terms[i];
      const S* const low = term.rows + at + (term.mirrored != 0 ? 3 * width : 0);
      const S* const high = term.rows + at + (term.mirrored != 0 ? 0 : 3 * width);
      const S weight = term.weight;
      const auto take = [&](V& sum, const S* from) {
        const V one = weight * load_lanes<V>(from);
        if constexpr (rounds)
          sum += smaller(one * inwards, one * outwards);  // infinite lanes stay infinite
        else
          sum += one;
      };
      for (std::size_t row = 0; row < 3; ++row)
        for (std::size_t part = 0; part < parts; ++part) {
          take(sums[row][part], low + row * width + part * lanes);
          take(sums[row + 3][part], high + row * width + part * lanes);
        }
    }
    for (std::size_t row = 0; row < 6; ++row)
      for (std::size_t part = 0; part < parts; ++part) sums[row][part] += blend.offset[row];
    S* const rows = h.child_bounds + node * 6 * width;
    S* const node_bounds = h.node_bounds + 8 * node;
    for (std::size_t row = 0; row < 6; ++row) {
      V least = sums[row][0];
      for (std::size_t part = 0; part < parts; ++part) {
        store_lanes(rows + row * width + part * lanes, sums[row][part]);
        least = smaller(sums[row][part], least);
      }
      const S side = smallest_lane<S, lanes>(least);
      node_bounds[row < 3 ? row : row + 1] = row < 3 ? side : -side;
    }
  }
}

template <class S, std::uint32_t width>
void make(WideArrays<S> h, const Blend<S>& blend, const std::uint32_t* nodes, std::size_t count) {
  if (blend.rounding != 0)
    make_nodes<S, width, true>(h, blend, nodes, count);
  else
    make_nodes<S, width, false>(h, blend, nodes, count);
}

template <class S>
constexpr BlendKernels<S> table{&make<S, 2>, &make<S, 4>, &make<S, 8>};

}  // namespace

namespace kernels::KBVH_KERNELS {
const BlendKernels<float> blend_rows_float = table<float>;
const BlendKernels<double> blend_rows_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh

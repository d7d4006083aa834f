#pragma once
// Internal to kernels: the boxes of a leaf's primitives.
#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/kernels/quads.hpp"

namespace kbvh {
namespace {

/// Computes the rows of a leaf: its primitives' boxes, four at a time.
template <class S, std::size_t padded>
[[gnu::noinline]] void fit_leaf(const WideLeafLists& lists, std::uint32_t leaf, const S* positions, S* rows) {
  using P = Points<S, 1>;
  using Pack = typename P::Pack;
  const std::uint32_t begin = lists.first_entry[leaf], end = lists.end_entry[leaf];
  for (std::uint32_t quad = 0; quad < padded; quad += 4) {
    Pack lower[4], upper[4];
    for (std::uint32_t j = 0; j < 4; ++j) {
      // Repeats the last primitive past the end; those lanes are emptied below.
      const std::uint32_t entry = begin + quad + j < end ? begin + quad + j : end - 1;
      std::uint32_t corner = lists.first_corner[entry];
      const std::uint32_t last = lists.first_corner[entry + 1];
      lower[j] = upper[j] = P::load(positions + lists.corners[corner], positions);
      for (++corner; corner < last; ++corner) {
        const Pack p = P::load(positions + lists.corners[corner], positions);
        lower[j] = smaller(lower[j], p);
        upper[j] = larger(upper[j], p);
      }
    }
    P::template store_rows<false>(lower, rows + quad, padded, 4);
    P::template store_rows<true>(upper, rows + 3 * padded + quad, padded, 4);
  }
  for (std::size_t row = 0; row < 6; ++row)
    for (std::size_t i = end - begin; i < padded; ++i) rows[row * padded + i] = S(__builtin_inf());
}

}  // namespace
}  // namespace kbvh

#include "core/judge/sort_pairs.hpp"

#include <algorithm>
#include <array>

namespace kbvh {
namespace {

/// Sorts stably by the word that `of` returns, in one counting pass for each byte in which pairs differ.
template <class Word>
void sort_by(PairBuffer& pairs, PairBuffer& scratch, Word of) {
  std::uint32_t differing = 0;
  for (const PrimitivePair& pair : pairs) differing |= of(pair) ^ of(pairs[0]);
  for (int shift = 0; shift < 32; shift += 8) {
    if (((differing >> shift) & 0xff) == 0) continue;
    const auto digit = [&](const PrimitivePair& pair) { return (of(pair) >> shift) & 0xff; };
    std::array<std::size_t, 257> begin{};
    for (const PrimitivePair& pair : pairs) ++begin[digit(pair) + 1];
    for (std::size_t d = 1; d < begin.size(); ++d) begin[d] += begin[d - 1];
    for (const PrimitivePair& pair : pairs) scratch[begin[digit(pair)]++] = pair;
    pairs.swap(scratch);
  }
}

}  // namespace

void sort_pairs(PairBuffer& pairs) {
  if (pairs.size() < 128) {
    std::sort(pairs.begin(), pairs.end());
    return;
  }
  PairBuffer scratch(pairs.size());
  sort_by(pairs, scratch, [](const PrimitivePair& pair) { return pair.primitive_b; });
  sort_by(pairs, scratch, [](const PrimitivePair& pair) { return pair.body_b; });
  sort_by(pairs, scratch, [](const PrimitivePair& pair) { return pair.primitive_a; });
  sort_by(pairs, scratch, [](const PrimitivePair& pair) { return pair.body_a; });
}

}  // namespace kbvh

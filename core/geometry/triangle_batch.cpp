#include "core/geometry/triangle_batch.hpp"

#include <algorithm>
#include <type_traits>

#include "core/geometry/kernels/triangles.hpp"

namespace kbvh {

template <class S>
void triangles_intersect(std::span<const TrianglePair<S>> pairs, std::uint8_t* intersect,
                         TriangleTestStats& stats, KernelSet kernels) {
  const TriangleKernels& table = KBVH_SELECT_KERNELS(kernels, triangle_kernels);
  constexpr std::size_t block = 256;
  FilteredVerdict verdicts[block];
  for (std::size_t first = 0; first < pairs.size(); first += block) {
    const std::size_t count = std::min(block, pairs.size() - first);
    const TrianglePair<S>* const pair = pairs.data() + first;
    std::uint8_t* const out = intersect + first;
    std::size_t open = 0;
    if constexpr (std::is_same_v<S, float>)
      open = table.filter_float(pair, count, verdicts);
    else
      open = table.filter_double(pair, count, verdicts);
    stats.tests += count - open;
    stats.filtered += count - open;
    for (std::size_t i = 0; i < count; ++i) out[i] = verdicts[i] == FilteredVerdict::intersect ? 1 : 0;
    if (open == 0) continue;
    for (std::size_t i = 0; i < count; ++i) {
      if (verdicts[i] != FilteredVerdict::open) continue;
      const S* const(&c)[6] = pair[i].corner;
      out[i] = triangles_intersect<S>(c[0], c[1], c[2], c[3], c[4], c[5], &stats) ? 1 : 0;
    }
  }
}

template void triangles_intersect(std::span<const TrianglePair<float>>, std::uint8_t*, TriangleTestStats&,
                                  KernelSet);
template void triangles_intersect(std::span<const TrianglePair<double>>, std::uint8_t*, TriangleTestStats&,
                                  KernelSet);

}  // namespace kbvh

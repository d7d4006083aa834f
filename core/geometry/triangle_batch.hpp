#pragma once
#include <cstdint>
#include <span>

#include "core/geometry/triangle_pair.hpp"
#include "core/geometry/triangle_triangle.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

/// Tests many pairs as `triangles_intersect` does, with the same exact answers and a filter vectorised over
/// pairs; pairs that the filter leaves open are tested one by one. Sets intersect[i] to 1 if pair i shares a
/// point, else to 0. The counts equal those of single tests: `exact` is the same for every kernel set.
///
/// Unlike the single test it reads one scalar past each corner, which must be readable (playback positions
/// are padded); its value does not matter. `intersect` has one entry per pair. Linear time; only the exact
/// test allocates.
template <class S>
void triangles_intersect(std::span<const TrianglePair<S>> pairs, std::uint8_t* intersect,
                         TriangleTestStats& stats, KernelSet kernels = active_kernel_set());

extern template void triangles_intersect(std::span<const TrianglePair<float>>, std::uint8_t*,
                                         TriangleTestStats&, KernelSet);
extern template void triangles_intersect(std::span<const TrianglePair<double>>, std::uint8_t*,
                                         TriangleTestStats&, KernelSet);

}  // namespace kbvh

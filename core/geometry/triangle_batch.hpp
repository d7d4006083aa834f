#pragma once
#include <cstdint>
#include <span>

#include "core/geometry/triangle_pair.hpp"
#include "core/geometry/triangle_triangle.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

/// `triangles_intersect` for many pairs: the same exact answers, with a filter that is vectorised over pairs;
/// pairs that it leaves open are tested one by one. Sets intersect[i] to 1 where pair i shares a point, else
/// to 0, and counts as the single test does: `exact` is the same for every kernel set and for single tests.
///
/// Unlike the single test it reads one scalar past each corner, which must be readable (playback positions
/// are padded) and may be anything. `intersect` has a place for each pair. Linear time, no allocation but
/// that of the exact test.
template <class S>
void triangles_intersect(std::span<const TrianglePair<S>> pairs, std::uint8_t* intersect,
                         TriangleTestStats& stats, KernelSet kernels = active_kernel_set());

extern template void triangles_intersect(std::span<const TrianglePair<float>>, std::uint8_t*,
                                         TriangleTestStats&, KernelSet);
extern template void triangles_intersect(std::span<const TrianglePair<double>>, std::uint8_t*,
                                         TriangleTestStats&, KernelSet);

}  // namespace kbvh

#pragma once
// Internal: filtered triangle-triangle tests of many pairs, for core/geometry/triangle_batch.hpp.
#include <cstddef>
#include <cstdint>

#include "core/geometry/triangle_pair.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

/// The verdict of the filter on a pair.
enum class FilteredVerdict : std::uint8_t {
  separate = 0,   ///< certainly
  intersect = 1,  ///< certainly
  open = 2,       ///< left to exact arithmetic
};

/// Writes one verdict per pair for `count` pairs and returns the number of open pairs. Reads one scalar past
/// each corner.
///
/// Double pairs are filtered by the operations of triangles_intersect. Float pairs are filtered in float,
/// with a coarser bound: the filter in double may still decide open pairs.
struct TriangleKernels {
  std::size_t (*filter_float)(const TrianglePair<float>* pairs, std::size_t count, FilteredVerdict* verdicts);
  std::size_t (*filter_double)(const TrianglePair<double>* pairs, std::size_t count,
                               FilteredVerdict* verdicts);
};
KBVH_DECLARE_KERNELS(TriangleKernels, triangle_kernels)

}  // namespace kbvh

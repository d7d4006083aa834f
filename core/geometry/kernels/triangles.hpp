#pragma once
// Internal: filtered triangle-triangle tests of many pairs, for core/geometry/triangle_batch.hpp.
#include <cstddef>
#include <cstdint>

#include "core/geometry/triangle_pair.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

/// What the filter says of a pair.
enum class FilteredVerdict : std::uint8_t {
  separate = 0,   ///< certainly
  intersect = 1,  ///< certainly
  open = 2,       ///< exact arithmetic has to decide
};

/// Writes one verdict for each of `count` pairs and returns how many are open. Reads one scalar past each
/// corner.
///
/// Double pairs are filtered by the operations of triangles_intersect; float pairs in float, by a coarser
/// bound: what is left open may still be decided by the filter in double.
struct TriangleKernels {
  std::size_t (*filter_float)(const TrianglePair<float>* pairs, std::size_t count, FilteredVerdict* verdicts);
  std::size_t (*filter_double)(const TrianglePair<double>* pairs, std::size_t count,
                               FilteredVerdict* verdicts);
};
KBVH_DECLARE_KERNELS(TriangleKernels, triangle_kernels)

}  // namespace kbvh

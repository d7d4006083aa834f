#pragma once
#include <cstdint>
#include <vector>

#include "core/broad_phase/patch_culling.hpp"
#include "core/geometry/triangle_batch.hpp"
#include "core/parallel/workers.hpp"

namespace kbvh {

/// How a search for self intersections leaves out parts of a mesh that cannot intersect themselves.
enum class SelfCulling : std::uint8_t {
  none,
  cones,  ///< by cones of normals and projected contours
};

/// Counts what a search for self intersections did.
struct SelfIntersectionStats {
  std::uint64_t patches = 0;    ///< tested: nodes of the faces' tree
  std::uint64_t certified = 0;  ///< of these: searched no further
  std::uint64_t box_tests = 0;
  TriangleTestStats
      triangles{};  ///< tests: pairs of faces with overlapping boxes and without a common vertex
};

/// Exact tests of pairs of faces, many at a time, by one thread. Keeps its memory.
template <class S>
class alignas(cache_line) FaceTests {
 public:
  /// Moves the pairs of faces that have a common point to the front, and returns their number. `corners` is
  /// [face][3], `points` [vertex][4].
  std::size_t keep(const std::uint32_t* corners, const S* points, Candidate* pairs, std::size_t count,
                   KernelSet kernels);
  /// Adds the counts since the last call to `stats`.
  void take_stats(TriangleTestStats& stats);
  std::size_t bytes() const { return triangles_.capacity() * sizeof(TrianglePair<S>) + touch_.capacity(); }

 private:
  TriangleTestStats stats_;
  std::vector<TrianglePair<S>> triangles_;
  std::vector<std::uint8_t> touch_;
};

extern template class FaceTests<float>;
extern template class FaceTests<double>;

}  // namespace kbvh

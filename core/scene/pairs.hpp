#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/base/counters.hpp"
#include "core/base/unfilled_array.hpp"
#include "core/geometry/triangle_triangle.hpp"
#include "core/scene/motion_view.hpp"
#include "core/scene/scene.hpp"

namespace kbvh {

/// Two primitives of a scene. Canonical: body_a < body_b, or body_a = body_b and primitive_a < primitive_b.
struct PrimitivePair {
  std::uint32_t body_a, primitive_a, body_b, primitive_b;
  bool operator==(const PrimitivePair&) const = default;
  /// Orders by body and primitive of a, then of b.
  auto operator<=>(const PrimitivePair& other) const {
    const auto order = key(body_a, primitive_a) <=> key(other.body_a, other.primitive_a);
    return order != 0 ? order : key(body_b, primitive_b) <=> key(other.body_b, other.primitive_b);
  }

 private:
  static std::uint64_t key(std::uint32_t high, std::uint32_t low) {
    return (std::uint64_t(high) << 32) | low;
  }
};
static_assert(sizeof(PrimitivePair) == 16);

/// The caller-owned answer of a query; strategies append and never shrink its capacity. `resize` leaves new
/// pairs unset: filling them before they are written takes as long as writing them.
using PairBuffer = UnfilledArray<PrimitivePair>;

/// A primitive pair and the closed span of time over which it is reported.
struct PairSpan {
  PrimitivePair pair;
  double begin, end;
};
using SpanBuffer = std::vector<PairSpan>;

/// A contact of continuous collision detection: one record per feature pair.
struct Contact {
  enum class Kind : std::uint8_t { vertex_face, edge_edge } kind;
  std::uint32_t body_a, feature_a, body_b, feature_b;
  double begin, end;  ///< encloses the time of impact
};

/// Tests exactly whether two polygons share a point: whether two of their triangles do. Each `position(v)`
/// returns 3 scalars.
template <class S, class PositionA, class PositionB>
bool polygons_intersect(const PolygonTriangles& a, const PositionA& position_a, const PolygonTriangles& b,
                        const PositionB& position_b, TriangleTestStats& stats) {
  for (std::uint32_t i = 0; i < a.count(); ++i) {
    const auto p = a[i];
    for (std::uint32_t j = 0; j < b.count(); ++j) {
      const auto q = b[j];
      if (triangles_intersect<S>(position_a(p[0]), position_a(p[1]), position_a(p[2]), position_b(q[0]),
                                 position_b(q[1]), position_b(q[2]), &stats))
        return true;
    }
  }
  return false;
}

/// Keeps the pairs whose primitives intersect at the motion's current time, in their order. Points and
/// control nets are answered at candidate level: pairs whose boxes overlap stay. Fetches positions as needed.
template <class S>
void confirm_pairs(const SceneView<S>& scene, const SampledMotion<S>& motion, PairBuffer& pairs,
                   TriangleTestStats& stats);

/// Does the same on the threads of the motion (SampledMotion::workers), with the same result and counts.
template <class S>
class SharedConfirmation {
 public:
  void confirm(const SceneView<S>& scene, const SampledMotion<S>& motion, PairBuffer& pairs,
               TriangleTestStats& stats);
  std::size_t bytes() const {
    return parts_.capacity() * sizeof(Part) + to_fetch_.capacity() * sizeof(std::uint32_t);
  }

 private:
  struct alignas(cache_line) Part {
    std::size_t kept;
    TriangleTestStats stats;
  };
  void fetch(const SceneView<S>& scene, const SampledMotion<S>& motion, const PairBuffer& pairs);

  std::vector<Part> parts_;
  std::vector<std::uint32_t> to_fetch_;
};
extern template class SharedConfirmation<float>;
extern template class SharedConfirmation<double>;

}  // namespace kbvh

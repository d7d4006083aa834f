#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/counters.hpp"
#include "core/geometry/triangle_triangle.hpp"
#include "core/hierarchy/topology.hpp"
#include "core/motion/motion_view.hpp"

namespace kbvh {

/// Two primitives of a scene. Canonical: body_a < body_b, or body_a = body_b and primitive_a < primitive_b.
struct PrimitivePair {
  std::uint32_t body_a, primitive_a, body_b, primitive_b;
  auto operator<=>(const PrimitivePair&) const = default;
};
static_assert(sizeof(PrimitivePair) == 16);

/// Caller-owned answer of a query; strategies append, they never shrink its capacity.
using PairBuffer = std::vector<PrimitivePair>;

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

/// Do two polygons (fans of triangles around their first vertex; a segment or point for fewer than three
/// vertices) share a point? Exact. Each `position(v)` returns 3 scalars.
template <class S, class PositionA, class PositionB>
bool polygons_intersect(std::span<const std::uint32_t> a, const PositionA& position_a,
                        std::span<const std::uint32_t> b, const PositionB& position_b,
                        TriangleTestStats& stats) {
  const std::size_t fan_a = a.size() < 3 ? 1 : a.size() - 2, fan_b = b.size() < 3 ? 1 : b.size() - 2;
  const auto corner = [](std::span<const std::uint32_t> p, std::size_t i) {
    return p[i < p.size() ? i : p.size() - 1];
  };
  for (std::size_t i = 0; i < fan_a; ++i)
    for (std::size_t j = 0; j < fan_b; ++j)
      if (triangles_intersect<S>(position_a(a[0]), position_a(corner(a, i + 1)), position_a(corner(a, i + 2)),
                                 position_b(b[0]), position_b(corner(b, j + 1)), position_b(corner(b, j + 2)),
                                 &stats))
        return true;
  return false;
}

/// Keeps the pairs whose primitives intersect at the motion's current time, in their order. Points and
/// control nets are answered at candidate level: pairs whose boxes overlap stay. Positions are fetched as
/// needed.
template <class S>
void confirm_pairs(const SceneView<S>& scene, const SampledMotion<S>& motion, PairBuffer& pairs,
                   TriangleTestStats& stats);

/// The box of one primitive at the motion's current time; its vertices must be current.
template <class S>
Box<S> primitive_box(std::span<const std::uint32_t> vertices, const S* positions) {
  Box<S> box;
  for (std::uint32_t v : vertices) box.extend(positions + std::size_t(3) * v);
  return box;
}

/// Turns overlapping leaves into candidate pairs: appends the primitive pairs of two leaves whose own boxes
/// overlap. One such object serves one pair of bodies; it fetches the positions it reads.
template <class S, class Count>
class LeafPairs {
 public:
  LeafPairs(const SceneView<S>& scene, const SampledMotion<S>& motion, std::uint32_t body_a,
            const Topology& a, std::uint32_t body_b, const Topology& b, Count& count, PairBuffer& out)
      : motion_(&motion),
        primitives_a_(&scene.primitives(body_a)),
        primitives_b_(&scene.primitives(body_b)),
        body_a_(body_a),
        body_b_(body_b),
        a_(&a),
        b_(&b),
        count_(&count),
        out_(&out) {}

  void operator()(std::uint32_t leaf_a, std::uint32_t leaf_b) {
    const TopologyNode na = a_->nodes[leaf_a], nb = b_->nodes[leaf_b];
    if (na.count() == 1 && nb.count() == 1) {
      out_->push_back({body_a_, a_->primitives[na.first()], body_b_, b_->primitives[nb.first()]});
      return;
    }
    Box<S> boxes_b[16];
    for (std::uint32_t j = 0; j < nb.count(); ++j)
      boxes_b[j] = box(body_b_, *primitives_b_, b_->primitives[nb.first() + j]);
    for (std::uint32_t i = 0; i < na.count(); ++i) {
      const std::uint32_t primitive = a_->primitives[na.first() + i];
      const Box<S> box_a = box(body_a_, *primitives_a_, primitive);
      for (std::uint32_t j = 0; j < nb.count(); ++j)
        if (overlap(box_a, boxes_b[j]))
          out_->push_back({body_a_, primitive, body_b_, b_->primitives[nb.first() + j]});
    }
    count_->add(Counter::box_tests, std::uint64_t(na.count()) * nb.count());
  }

 private:
  Box<S> box(std::uint32_t body, const Primitives& primitives, std::uint32_t primitive) const {
    const auto vertices = primitives[primitive];
    motion_->fetch(body, vertices);
    return primitive_box(vertices, motion_->positions(body));
  }
  const SampledMotion<S>* motion_;
  const Primitives* primitives_a_;
  const Primitives* primitives_b_;
  std::uint32_t body_a_, body_b_;
  const Topology* a_;
  const Topology* b_;
  Count* count_;
  PairBuffer* out_;
};

}  // namespace kbvh

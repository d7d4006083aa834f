#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/base/counters.hpp"
#include "core/geometry/triangle_triangle.hpp"
#include "core/scene/motion_view.hpp"
#include "core/scene/self_pairs.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// Two primitives of a scene. Canonical: body_a < body_b, or body_a = body_b and primitive_a < primitive_b.
struct PrimitivePair {
  std::uint32_t body_a, primitive_a, body_b, primitive_b;
  bool operator==(const PrimitivePair&) const = default;
  /// By body and primitive of a, then of b.
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

/// Lower and upper corner of a box in 4 lanes, so that the compiler keeps each corner in one register; the
/// last lane has no meaning.
template <class S>
struct LaneBox {
  S lower[4], upper[4];

  /// The box of at least one vertex. Reads one scalar past the last vertex (playback positions are padded).
  static LaneBox of(std::span<const std::uint32_t> vertices, const S* positions) {
    LaneBox box;
    const S* first = positions + std::size_t(3) * vertices[0];
    for (int lane = 0; lane < 4; ++lane) box.lower[lane] = box.upper[lane] = first[lane];
    for (const std::uint32_t v : vertices.subspan(1)) {
      const S* p = positions + std::size_t(3) * v;
      box.extend(p, p);
    }
    return box;
  }
  void extend(const LaneBox& other) { extend(other.lower, other.upper); }
  bool overlaps(const LaneBox& other) const {
    return (lower[0] <= other.upper[0]) & (other.lower[0] <= upper[0]) & (lower[1] <= other.upper[1]) &
           (other.lower[1] <= upper[1]) & (lower[2] <= other.upper[2]) & (other.lower[2] <= upper[2]);
  }
  Box<S> box() const { return {{lower[0], lower[1], lower[2]}, {upper[0], upper[1], upper[2]}}; }

 private:
  void extend(const S* low, const S* high) {
    for (int lane = 0; lane < 4; ++lane) {
      lower[lane] = low[lane] < lower[lane] ? low[lane] : lower[lane];
      upper[lane] = high[lane] > upper[lane] ? high[lane] : upper[lane];
    }
  }
};

/// The box of one primitive at the motion's current time; its vertices must be current.
/// Reads one scalar past the last vertex.
template <class S>
Box<S> primitive_box(std::span<const std::uint32_t> vertices, const S* positions) {
  return LaneBox<S>::of(vertices, positions).box();
}

/// Turns overlapping leaves into candidate pairs: appends the primitive pairs of two leaves whose own boxes
/// overlap. One such object serves one pair of bodies; it fetches the positions it reads. Within one body,
/// each two leaves are to be given once, and a leaf of several primitives with itself, too.
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
    const std::size_t before = out_->size();
    append(leaf_a, leaf_b);
    if (body_a_ != body_b_) return;
    const LeavesOf leaves = leaf_a == leaf_b ? LeavesOf::one : LeavesOf::two;
    out_->resize(before +
                 keep_self_pairs(primitives_a_, leaves, out_->data() + before, out_->size() - before));
  }

 private:
  void append(std::uint32_t leaf_a, std::uint32_t leaf_b) {
    const TopologyNode na = a_->nodes[leaf_a], nb = b_->nodes[leaf_b];
    if (na.count() == 1 && nb.count() == 1) {
      out_->push_back({body_a_, a_->primitives[na.first()], body_b_, b_->primitives[nb.first()]});
      return;
    }
    LaneBox<S> boxes_b[16];
    LaneBox<S> whole_b = boxes_b[0] = box(body_b_, *primitives_b_, b_->primitives[nb.first()]);
    for (std::uint32_t j = 1; j < nb.count(); ++j) {
      boxes_b[j] = box(body_b_, *primitives_b_, b_->primitives[nb.first() + j]);
      whole_b.extend(boxes_b[j]);
    }
    std::uint64_t tests = na.count();
    for (std::uint32_t i = 0; i < na.count(); ++i) {
      const std::uint32_t primitive = a_->primitives[na.first() + i];
      const LaneBox<S> box_a = box(body_a_, *primitives_a_, primitive);
      if (!box_a.overlaps(whole_b)) continue;
      tests += nb.count();
      for (std::uint32_t j = 0; j < nb.count(); ++j)
        if (box_a.overlaps(boxes_b[j]))
          out_->push_back({body_a_, primitive, body_b_, b_->primitives[nb.first() + j]});
    }
    count_->add(Counter::box_tests, tests);
  }
  LaneBox<S> box(std::uint32_t body, const Primitives& primitives, std::uint32_t primitive) const {
    const auto vertices = primitives[primitive];
    motion_->fetch(body, vertices);
    return LaneBox<S>::of(vertices, motion_->positions(body));
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

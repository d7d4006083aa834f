#include "core/pairs.hpp"

#include <algorithm>

#include "core/geometry/triangle_batch.hpp"

namespace kbvh {

namespace {

/// Are the primitives of a kind whose intersection is tested, beyond their boxes?
bool tested(const Primitives& a, const Primitives& b) {
  return a.kind == PrimitiveKind::polygons && b.kind == PrimitiveKind::polygons;
}

/// One pair of bodies. A scene's candidates come in long runs of the same.
template <class S>
class BodyPairTest {
 public:
  BodyPairTest(const SceneView<S>& scene, const SampledMotion<S>& motion, const PrimitivePair& pair)
      : motion_(&motion),
        body_a_(pair.body_a),
        body_b_(pair.body_b),
        primitives_a_(&scene.primitives(pair.body_a)),
        primitives_b_(&scene.primitives(pair.body_b)),
        positions_a_(motion.positions(pair.body_a)),
        positions_b_(motion.positions(pair.body_b)),
        tested_(tested(*primitives_a_, *primitives_b_)) {}

  bool covers(const PrimitivePair& pair) const { return pair.body_a == body_a_ && pair.body_b == body_b_; }

  /// Fetches the positions of a pair. If it is one of triangles, gives their corners and returns true.
  bool triangles(const PrimitivePair& pair, TrianglePair<S>& out) const {
    const auto a = (*primitives_a_)[pair.primitive_a], b = (*primitives_b_)[pair.primitive_b];
    motion_->fetch(body_a_, a);
    motion_->fetch(body_b_, b);
    if (!tested_ || a.size() != 3 || b.size() != 3) return false;
    for (std::size_t i = 0; i < 3; ++i) {
      out.corner[i] = at(positions_a_, a[i]);
      out.corner[3 + i] = at(positions_b_, b[i]);
    }
    return true;
  }

  /// Any pair whose positions are fetched.
  bool intersect(const PrimitivePair& pair, TriangleTestStats& stats) const {
    const auto a = (*primitives_a_)[pair.primitive_a], b = (*primitives_b_)[pair.primitive_b];
    if (!tested_) return overlap(primitive_box(a, positions_a_), primitive_box(b, positions_b_));
    return polygons_intersect<S>(
        a, [&](std::uint32_t v) { return at(positions_a_, v); }, b,
        [&](std::uint32_t v) { return at(positions_b_, v); }, stats);
  }

 private:
  static const S* at(const S* positions, std::uint32_t vertex) { return positions + std::size_t(3) * vertex; }

  const SampledMotion<S>* motion_;
  std::uint32_t body_a_, body_b_;
  const Primitives* primitives_a_;
  const Primitives* primitives_b_;
  const S* positions_a_;
  const S* positions_b_;
  bool tested_;
};

}  // namespace

template <class S>
void confirm_pairs(const SceneView<S>& scene, const SampledMotion<S>& motion, PairBuffer& pairs,
                   TriangleTestStats& stats) {
  if (pairs.empty()) return;
  // Blocks that stay in the first-level cache.
  constexpr std::size_t block = 128;
  TrianglePair<S> triangles[block];
  std::uint8_t place[block], verdicts[block], intersect[block];
  const KernelSet kernels = active_kernel_set();
  BodyPairTest<S> bodies(scene, motion, pairs[0]);
  std::size_t kept = 0;
  for (std::size_t first = 0; first < pairs.size(); first += block) {
    const std::size_t count = std::min(block, pairs.size() - first);
    std::size_t batched = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const PrimitivePair& pair = pairs[first + i];
      if (!bodies.covers(pair)) bodies = BodyPairTest<S>(scene, motion, pair);
      if (bodies.triangles(pair, triangles[batched]))
        place[batched++] = std::uint8_t(i);
      else
        intersect[i] = bodies.intersect(pair, stats) ? 1 : 0;
    }
    triangles_intersect(std::span<const TrianglePair<S>>(triangles, batched), verdicts, stats, kernels);
    for (std::size_t k = 0; k < batched; ++k) intersect[place[k]] = verdicts[k];
    // The place of a kept pair is never after the one it comes from.
    for (std::size_t i = 0; i < count; ++i) {
      pairs[kept] = pairs[first + i];
      kept += intersect[i];
    }
  }
  pairs.resize(kept);
}

template void confirm_pairs(const SceneView<float>&, const SampledMotion<float>&, PairBuffer&,
                            TriangleTestStats&);
template void confirm_pairs(const SceneView<double>&, const SampledMotion<double>&, PairBuffer&,
                            TriangleTestStats&);

}  // namespace kbvh

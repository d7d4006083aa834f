#include "core/pairs.hpp"

#include <algorithm>

namespace kbvh {

template <class S>
void confirm_pairs(const SceneView<S>& scene, const SampledMotion<S>& motion, PairBuffer& pairs,
                   TriangleTestStats& stats) {
  std::size_t kept = 0;
  for (const PrimitivePair& pair : pairs) {
    const Primitives& primitives_a = scene.primitives(pair.body_a);
    const Primitives& primitives_b = scene.primitives(pair.body_b);
    const auto a = primitives_a[pair.primitive_a], b = primitives_b[pair.primitive_b];
    motion.fetch(pair.body_a, a);
    motion.fetch(pair.body_b, b);
    const S* positions_a = motion.positions(pair.body_a);
    const S* positions_b = motion.positions(pair.body_b);
    bool intersect = false;
    if (primitives_a.kind != PrimitiveKind::polygons || primitives_b.kind != PrimitiveKind::polygons) {
      intersect = overlap(primitive_box(a, positions_a), primitive_box(b, positions_b));
    } else {
      intersect = polygons_intersect<S>(
          a, [&](std::uint32_t v) { return positions_a + std::size_t(3) * v; }, b,
          [&](std::uint32_t v) { return positions_b + std::size_t(3) * v; }, stats);
    }
    if (intersect) pairs[kept++] = pair;
  }
  pairs.resize(kept);
}

template void confirm_pairs(const SceneView<float>&, const SampledMotion<float>&, PairBuffer&,
                            TriangleTestStats&);
template void confirm_pairs(const SceneView<double>&, const SampledMotion<double>&, PairBuffer&,
                            TriangleTestStats&);

}  // namespace kbvh

#include "core/scene/cut_polygons.hpp"

#include <stdexcept>
#include <string>

namespace kbvh {
namespace {

constexpr double counts_as_bent = 1e-6;

/// Returns the first polygon to be cut, from p on; the number of primitives if there is none.
std::uint32_t next_uncut(const Primitives& primitives, std::uint32_t p) {
  if (primitives.kind != PrimitiveKind::polygons) return primitives.count();
  while (p < primitives.count() && (primitives[p].size() <= 3 || primitives.cuts.contains(p))) ++p;
  return p;
}

template <class S>
void cut_one(PolygonCutter& cutter, Primitives& primitives, std::uint32_t p, const S* positions, double time,
             CutFindings& found) {
  const PolygonCut cut = cutter.cut(primitives[p], positions);
  primitives.cuts.add(p, cut.corners, time);
  found.add(cut);
}

}  // namespace

void CutFindings::add(const PolygonCut& one) {
  add({1, one.bent > counts_as_bent ? 1U : 0U, one.crosses ? 1U : 0U, one.bent});
}
void CutFindings::add(const CutFindings& other) {
  cut += other.cut;
  bent += other.bent;
  crossing += other.crossing;
  most_bent = std::max(most_bent, other.most_bent);
}

template <class S>
CutFindings cut_polygons(Body<S>& body) {
  CutFindings found;
  Primitives& primitives = body.primitives;
  std::uint32_t p = next_uncut(primitives, 0);
  if (p == primitives.count()) return found;
  PolygonCutter cutter;
  for (; p < primitives.count(); p = next_uncut(primitives, p + 1))
    cut_one(cutter, primitives, p, body.plans.keyframe(0), body.plans.keyframe_times()[0], found);
  return found;
}

template <class S>
CutFindings cut_polygons(Scene<S>& scene) {
  CutFindings found;
  for (Body<S>& body : scene.bodies) found.add(cut_polygons(body));
  return found;
}

template <class S>
CutFindings cut_polygon(Primitives& primitives, std::uint32_t primitive, const S* positions, double time) {
  CutFindings found;
  if (next_uncut(primitives, primitive) != primitive) return found;
  PolygonCutter cutter;
  cut_one(cutter, primitives, primitive, positions, time, found);
  return found;
}

template <class S>
void check_cut(const Scene<S>& scene) {
  for (const Body<S>& body : scene.bodies)
    if (const std::uint32_t p = next_uncut(body.primitives, 0); p < body.primitives.count())
      throw std::invalid_argument("body '" + body.name + "': primitive " + std::to_string(p) + " has " +
                                  std::to_string(body.primitives[p].size()) +
                                  " corners and has not been cut into triangles (kbvh::cut_polygons)");
}

#define KBVH_INSTANTIATE(S)                                                       \
  template CutFindings cut_polygons(Body<S>&);                                    \
  template CutFindings cut_polygons(Scene<S>&);                                   \
  template CutFindings cut_polygon(Primitives&, std::uint32_t, const S*, double); \
  template void check_cut(const Scene<S>&);
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh
